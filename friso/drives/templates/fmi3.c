{% include "about" %}
/* The interface of FMI 3.0 for co-simulation. */
#include "{{ model }}_fmu.h"
#include <stdbool.h>
#include <stdint.h>

typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;
typedef void (*Logger)(void *environment, fmi3Status status, const char *category, const char *message);
typedef void (*Callback)(void);
typedef const uint8_t *Binary;
typedef const char *String;

static fmi3Status status(int done) { return done ? fmi3OK : fmi3Error; }

EXPORT const char *fmi3GetVersion(void) { return "3.0"; }

EXPORT void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible, bool logging,
    bool events, bool early, const uint32_t intermediate[], size_t count, void *environment, Logger logger, Callback update)
{
    Model *model = NULL;
    (void)name; (void)resources; (void)visible; (void)logging; (void)early; (void)intermediate; (void)update;
    if (token != NULL && strcmp(token, TOKEN) == 0 && !events && count == 0) model = malloc(sizeof *model);
    if (model != NULL) model_reset(model);
    else if (logger != NULL) logger(environment, fmi3Error, "logStatusError", "with events, or of another file");
    return model;
}

EXPORT void *fmi3InstantiateModelExchange(const char *name, const char *token, const char *resources, bool visible, bool logging,
    void *environment, Logger logger)
{
    (void)name; (void)token; (void)resources; (void)visible; (void)logging;
    if (logger != NULL) logger(environment, fmi3Error, "logStatusError", "this is for co-simulation");
    return NULL;
}

EXPORT void *fmi3InstantiateScheduledExecution(const char *name, const char *token, const char *resources, bool visible,
    bool logging, void *environment, Logger logger, Callback update, Callback lock, Callback unlock)
{
    (void)update; (void)lock; (void)unlock;
    return fmi3InstantiateModelExchange(name, token, resources, visible, logging, environment, logger);
}

EXPORT void fmi3FreeInstance(void *model) { free(model); }

EXPORT fmi3Status fmi3SetDebugLogging(void *model, bool on, size_t count, const String categories[])
{
    (void)on; (void)count; (void)categories;
    return status(model != NULL);
}

EXPORT fmi3Status fmi3EnterInitializationMode(void *model, bool with_tolerance, double tolerance, double start, bool with_stop,
    double stop)
{
    (void)with_tolerance; (void)tolerance; (void)with_stop; (void)stop;
    return status(model != NULL && model_initialize(model, start));
}

EXPORT fmi3Status fmi3ExitInitializationMode(void *model) { return status(model != NULL && model_initialized(model)); }
EXPORT fmi3Status fmi3Terminate(void *model) { return status(model != NULL && model_terminate(model)); }

EXPORT fmi3Status fmi3Reset(void *model)
{
    if (model != NULL) model_reset(model);
    return status(model != NULL);
}

EXPORT fmi3Status fmi3GetFloat64(void *model, const uint32_t references[], size_t count, double values[], size_t size)
{
    return status(model != NULL && size == count && model_get(model, references, count, values));
}

EXPORT fmi3Status fmi3SetFloat64(void *model, const uint32_t references[], size_t count, const double values[], size_t size)
{
    return status(model != NULL && size == count && model_set(model, references, count, values));
}

/* Variables of other types, of which the model has none. */
#define NONE_OF(TYPE, C) \
    EXPORT fmi3Status fmi3Get##TYPE(void *model, const uint32_t references[], size_t count, C values[], size_t size) \
    { (void)model; (void)references; (void)values; return status(count == 0 && size == 0); } \
    EXPORT fmi3Status fmi3Set##TYPE(void *model, const uint32_t references[], size_t count, const C values[], size_t size) \
    { (void)model; (void)references; (void)values; return status(count == 0 && size == 0); }
NONE_OF(Float32, float)
NONE_OF(Int8, int8_t)
NONE_OF(UInt8, uint8_t)
NONE_OF(Int16, int16_t)
NONE_OF(UInt16, uint16_t)
NONE_OF(Int32, int32_t)
NONE_OF(UInt32, uint32_t)
NONE_OF(Int64, int64_t)
NONE_OF(UInt64, uint64_t)
NONE_OF(Boolean, bool)
NONE_OF(String, String)

/* What the model cannot do, by the capabilities that its description tells. */
#define NOT_ABLE(NAME, ...) EXPORT fmi3Status fmi3##NAME(void *model, __VA_ARGS__)
#define IS_ERROR { (void)model; return fmi3Error; }
#if defined __GNUC__
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

EXPORT fmi3Status fmi3GetBinary(void *model, const uint32_t r[], size_t count, size_t sizes[], Binary values[], size_t size)
{ return status(count == 0 && size == 0); }
EXPORT fmi3Status fmi3SetBinary(void *model, const uint32_t r[], size_t count, const size_t sizes[], const Binary values[], size_t size)
{ return status(count == 0 && size == 0); }
EXPORT fmi3Status fmi3GetClock(void *model, const uint32_t r[], size_t count, bool values[]) { return status(count == 0); }
EXPORT fmi3Status fmi3SetClock(void *model, const uint32_t r[], size_t count, const bool values[]) { return status(count == 0); }
NOT_ABLE(GetNumberOfVariableDependencies, uint32_t r, size_t *count) IS_ERROR
NOT_ABLE(GetVariableDependencies, uint32_t r, size_t rows[], uint32_t of[], size_t columns[], int dependencies[], size_t count) IS_ERROR
NOT_ABLE(GetDirectionalDerivative, const uint32_t u[], size_t nu, const uint32_t k[], size_t nk, const double seed[], size_t ns, double s[], size_t n) IS_ERROR
NOT_ABLE(GetAdjointDerivative, const uint32_t u[], size_t nu, const uint32_t k[], size_t nk, const double seed[], size_t ns, double s[], size_t n) IS_ERROR
EXPORT fmi3Status fmi3EnterConfigurationMode(void *model) IS_ERROR
EXPORT fmi3Status fmi3ExitConfigurationMode(void *model) IS_ERROR
EXPORT fmi3Status fmi3EnterEventMode(void *model) IS_ERROR
EXPORT fmi3Status fmi3EnterStepMode(void *model) IS_ERROR
EXPORT fmi3Status fmi3EvaluateDiscreteStates(void *model) IS_ERROR
NOT_ABLE(GetIntervalDecimal, const uint32_t r[], size_t count, double values[], int qualifiers[]) IS_ERROR
NOT_ABLE(GetIntervalFraction, const uint32_t r[], size_t count, uint64_t counters[], uint64_t resolutions[], int qualifiers[]) IS_ERROR
NOT_ABLE(GetShiftDecimal, const uint32_t r[], size_t count, double values[]) IS_ERROR
NOT_ABLE(GetShiftFraction, const uint32_t r[], size_t count, uint64_t counters[], uint64_t resolutions[]) IS_ERROR
NOT_ABLE(SetIntervalDecimal, const uint32_t r[], size_t count, const double values[]) IS_ERROR
NOT_ABLE(SetIntervalFraction, const uint32_t r[], size_t count, const uint64_t counters[], const uint64_t resolutions[]) IS_ERROR
NOT_ABLE(SetShiftDecimal, const uint32_t r[], size_t count, const double values[]) IS_ERROR
NOT_ABLE(SetShiftFraction, const uint32_t r[], size_t count, const uint64_t counters[], const uint64_t resolutions[]) IS_ERROR
NOT_ABLE(UpdateDiscreteStates, bool *n, bool *t, bool *nominals, bool *values, bool *defined, double *time) IS_ERROR
EXPORT fmi3Status fmi3EnterContinuousTimeMode(void *model) IS_ERROR
NOT_ABLE(CompletedIntegratorStep, bool prior, bool *event, bool *end) IS_ERROR
NOT_ABLE(SetTime, double time) IS_ERROR
NOT_ABLE(SetContinuousStates, const double x[], size_t count) IS_ERROR
NOT_ABLE(GetContinuousStateDerivatives, double x[], size_t count) IS_ERROR
NOT_ABLE(GetEventIndicators, double x[], size_t count) IS_ERROR
NOT_ABLE(GetContinuousStates, double x[], size_t count) IS_ERROR
NOT_ABLE(GetNominalsOfContinuousStates, double x[], size_t count) IS_ERROR
NOT_ABLE(GetNumberOfEventIndicators, size_t *count) IS_ERROR
NOT_ABLE(GetNumberOfContinuousStates, size_t *count) IS_ERROR
NOT_ABLE(GetOutputDerivatives, const uint32_t r[], size_t count, const int32_t orders[], double values[], size_t size) IS_ERROR
NOT_ABLE(ActivateModelPartition, uint32_t clock, double time) IS_ERROR

EXPORT fmi3Status fmi3GetFMUState(void *model, void **state)
{
    if (model == NULL || state == NULL) return fmi3Error;
    if (*state != NULL) *(Model *)*state = *(Model *)model;
    else *state = model_copy(model);
    return status(*state != NULL);
}

EXPORT fmi3Status fmi3SetFMUState(void *model, void *state)
{
    if (model == NULL || state == NULL) return fmi3Error;
    *(Model *)model = *(Model *)state;
    return fmi3OK;
}

EXPORT fmi3Status fmi3FreeFMUState(void *model, void **state)
{
    if (state != NULL) {
        free(*state);
        *state = NULL;
    }
    return fmi3OK;
}

EXPORT fmi3Status fmi3SerializedFMUStateSize(void *model, void *state, size_t *size)
{
    *size = sizeof(Model);
    return status(state != NULL);
}

EXPORT fmi3Status fmi3SerializeFMUState(void *model, void *state, uint8_t bytes[], size_t size)
{
    if (state == NULL || size < sizeof(Model)) return fmi3Error;
    memcpy(bytes, state, sizeof(Model));
    return fmi3OK;
}

EXPORT fmi3Status fmi3DeserializeFMUState(void *model, const uint8_t bytes[], size_t size, void **state)
{
    if (size != sizeof(Model) || fmi3GetFMUState(model, state) != fmi3OK) return fmi3Error;
    memcpy(*state, bytes, size);
    return fmi3OK;
}

EXPORT fmi3Status fmi3DoStep(void *instance, double time, double duration, bool state_is_not_set_back, bool *event, bool *end,
    bool *early, double *last)
{
    Model *model = instance;
    int done = model != NULL && model_step(model, time, duration);
    *event = *end = *early = false;
    if (model != NULL) *last = model->values[0];
    return status(done);
}
