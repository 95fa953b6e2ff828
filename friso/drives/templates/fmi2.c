{% include "about" %}
/* The interface of FMI 2.0 for co-simulation; its types are those of the platform "default". */
#include "{{ model }}_fmu.h"

typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef void (*Logger)(void *environment, const char *name, fmi2Status status, const char *category, const char *message, ...);
typedef struct {
    Logger logger;
    void *(*allocateMemory)(size_t, size_t);
    void (*freeMemory)(void *);
    void (*stepFinished)(void *, fmi2Status);
    void *environment;
} fmi2CallbackFunctions;

static fmi2Status status(int done) { return done ? fmi2OK : fmi2Error; }

/* Of variables of a type that the model has none of. */
static fmi2Status none_of(size_t count) { return status(count == 0); }

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }

EXPORT void *fmi2Instantiate(const char *name, int type, const char *token, const char *resources,
    const fmi2CallbackFunctions *functions, int visible, int logging)
{
    Model *model = NULL;
    (void)resources; (void)visible; (void)logging;
    if (type == 1 && token != NULL && strcmp(token, TOKEN) == 0) model = malloc(sizeof *model);
    if (model != NULL) model_reset(model);
    else if (functions != NULL && functions->logger != NULL)
        functions->logger(functions->environment, name, fmi2Error, "logStatusError", "not co-simulation, or of another file");
    return model;
}

EXPORT void fmi2FreeInstance(void *model) { free(model); }

EXPORT fmi2Status fmi2SetDebugLogging(void *model, int on, size_t count, const char *const categories[])
{
    (void)on; (void)count; (void)categories;
    return status(model != NULL);
}

EXPORT fmi2Status fmi2SetupExperiment(void *instance, int with_tolerance, double tolerance, double start, int with_stop, double stop)
{
    Model *model = instance;
    (void)with_tolerance; (void)tolerance; (void)with_stop; (void)stop;
    if (model == NULL || model->phase != INSTANTIATED || !isfinite(start)) return fmi2Error;
    model->start = start;
    return fmi2OK;
}

EXPORT fmi2Status fmi2EnterInitializationMode(void *instance)
{
    Model *model = instance;
    return status(model != NULL && model_initialize(model, model->start));
}

EXPORT fmi2Status fmi2ExitInitializationMode(void *model) { return status(model != NULL && model_initialized(model)); }
EXPORT fmi2Status fmi2Terminate(void *model) { return status(model != NULL && model_terminate(model)); }

EXPORT fmi2Status fmi2Reset(void *model)
{
    if (model != NULL) model_reset(model);
    return status(model != NULL);
}

EXPORT fmi2Status fmi2GetReal(void *model, const unsigned references[], size_t count, double values[])
{
    return status(model != NULL && model_get(model, references, count, values));
}

EXPORT fmi2Status fmi2SetReal(void *model, const unsigned references[], size_t count, const double values[])
{
    return status(model != NULL && model_set(model, references, count, values));
}

#define NONE_OF(TYPE, C) \
    EXPORT fmi2Status fmi2Get##TYPE(void *model, const unsigned references[], size_t count, C values[]) \
    { (void)model; (void)references; (void)values; return none_of(count); } \
    EXPORT fmi2Status fmi2Set##TYPE(void *model, const unsigned references[], size_t count, const C values[]) \
    { (void)model; (void)references; (void)values; return none_of(count); }
NONE_OF(Integer, int)
NONE_OF(Boolean, int)
typedef const char *String;
NONE_OF(String, String)

EXPORT fmi2Status fmi2GetFMUstate(void *model, void **state)
{
    if (model == NULL || state == NULL) return fmi2Error;
    if (*state != NULL) *(Model *)*state = *(Model *)model;
    else *state = model_copy(model);
    return status(*state != NULL);
}

EXPORT fmi2Status fmi2SetFMUstate(void *model, void *state)
{
    if (model == NULL || state == NULL) return fmi2Error;
    *(Model *)model = *(Model *)state;
    return fmi2OK;
}

EXPORT fmi2Status fmi2FreeFMUstate(void *model, void **state)
{
    (void)model;
    if (state != NULL) {
        free(*state);
        *state = NULL;
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2SerializedFMUstateSize(void *model, void *state, size_t *size)
{
    (void)model;
    *size = sizeof(Model);
    return status(state != NULL);
}

EXPORT fmi2Status fmi2SerializeFMUstate(void *model, void *state, char bytes[], size_t size)
{
    (void)model;
    if (state == NULL || size < sizeof(Model)) return fmi2Error;
    memcpy(bytes, state, sizeof(Model));
    return fmi2OK;
}

EXPORT fmi2Status fmi2DeSerializeFMUstate(void *model, const char bytes[], size_t size, void **state)
{
    if (size != sizeof(Model) || fmi2GetFMUstate(model, state) != fmi2OK) return fmi2Error;
    memcpy(*state, bytes, size);
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetDirectionalDerivative(void *model, const unsigned unknown[], size_t rows, const unsigned known[],
    size_t columns, const double seed[], double values[])
{
    (void)model; (void)unknown; (void)rows; (void)known; (void)columns; (void)seed; (void)values;
    return fmi2Error;
}

EXPORT fmi2Status fmi2SetRealInputDerivatives(void *model, const unsigned references[], size_t count, const int order[],
    const double values[])
{
    (void)model; (void)references; (void)order; (void)values;
    return none_of(count);
}

EXPORT fmi2Status fmi2GetRealOutputDerivatives(void *model, const unsigned references[], size_t count, const int order[],
    double values[])
{
    (void)model; (void)references; (void)order; (void)values;
    return none_of(count);
}

EXPORT fmi2Status fmi2DoStep(void *model, double time, double duration, int state_is_not_set_back)
{
    (void)state_is_not_set_back;
    return status(model != NULL && model_step(model, time, duration));
}

EXPORT fmi2Status fmi2CancelStep(void *model)
{
    (void)model;
    return fmi2Error; /* no step is pending */
}

EXPORT fmi2Status fmi2GetRealStatus(void *instance, int kind, double *value)
{
    Model *model = instance;
    if (model == NULL || kind != 2) return fmi2Discard;
    *value = model->values[0]; /* the last successful time */
    return fmi2OK;
}

#define NO_STATUS(TYPE, C) \
    EXPORT fmi2Status fmi2Get##TYPE(void *model, int kind, C *value) { (void)model; (void)kind; (void)value; return fmi2Discard; }
NO_STATUS(Status, fmi2Status)
NO_STATUS(IntegerStatus, int)
NO_STATUS(BooleanStatus, int)
NO_STATUS(StringStatus, String)
