{% include "about" %}
#include "{{ name }}.h"
{% if machine %}
#include "{{ name }}_machine.h"
{% endif %}
#include <math.h>
#include <stdlib.h>
#include <string.h>

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

#define TOKEN "{{ token }}"
static const double STEP = {{ period }}; /* s */
static const double MOST = 9007199254740992.0; /* samples: 2^53, up to which a double holds whole numbers */

/* Every variable is a double, whose reference is its place among the values; the first is the time. */
enum { COUNT = {{ variables | length }} };
typedef enum { TIME, PARAMETER, INPUT, OUTPUT } Kind;
typedef enum { INSTANTIATED, INITIALIZING, STEPPING, TERMINATED } Phase;

static const Kind kinds[COUNT] = { {{ variables | map(attribute="kind") | map("upper") | join(", ") }} };
static const double starts[COUNT] = { {{ variables | map(attribute="start") | map("string") | join(", ") }} };

typedef struct {
    double values[COUNT];
    double start;
    double samples; /* since the start */
    Phase phase;
{% for field in part.fields %}
    {{ field }}
{% endfor %}
} Model;

static void model_reset(Model *model)
{
    memset(model, 0, sizeof *model);
    memcpy(model->values, starts, sizeof starts);
}

/* Writes the outputs. */
static void model_tell(Model *model)
{
    double *v = model->values;
{% for line in part.told %}
    {{ line }}
{% endfor %}
}

/* Begins with the parameters and inputs as they are now. */
static void model_begin(Model *model)
{
    double *v = model->values;
{% for line in part.begun %}
    {{ line }}
{% endfor %}
    model->samples = 0.0;
    model_tell(model);
}

/* Goes on for a sample. */
static void model_sample(Model *model)
{
    double *v = model->values;
{% for line in part.sampled %}
    {{ line }}
{% endfor %}
    model->samples += 1.0;
}

/* The next functions return whether what is asked for is allowed; what is not changes nothing. */

static int model_get(Model *model, const unsigned references[], size_t count, double values[])
{
    size_t k;
    for (k = 0; k < count; k++) {
        if (references[k] >= COUNT) return 0;
    }
    if (model->phase == INITIALIZING) model_begin(model);
    for (k = 0; k < count; k++) values[k] = model->values[references[k]];
    return 1;
}

static int model_set(Model *model, const unsigned references[], size_t count, const double values[])
{
    size_t k;
    for (k = 0; k < count; k++) {
        Kind kind = references[k] < COUNT ? kinds[references[k]] : TIME;
        int now = kind == INPUT ? model->phase != TERMINATED : model->phase <= INITIALIZING;
        if (!now || (kind != INPUT && kind != PARAMETER)) return 0;
    }
    for (k = 0; k < count; k++) model->values[references[k]] = values[k];
    return 1;
}

static int model_initialize(Model *model, double start)
{
    if (model->phase != INSTANTIATED || !isfinite(start)) return 0;
    model->start = model->values[0] = start;
    model->phase = INITIALIZING;
    return 1;
}

static int model_initialized(Model *model)
{
    if (model->phase != INITIALIZING) return 0;
    model_begin(model);
    model->phase = STEPPING;
    return 1;
}

/* Runs the samples from a time on to before its end; each sees the inputs as they are now. */
static int model_step(Model *model, double time, double duration)
{
    double end = (time + duration - model->start) / STEP;
    int k;
    if (model->phase != STEPPING || !(end < MOST) || !(duration > 0.0)) return 0;
    if (fabs(time - model->values[0]) > 1e-6 * STEP) return 0;
    while (model->samples < end - 1e-6) model_sample(model);
    model_tell(model);
    model->values[0] = time + duration;
    for (k = 0; k < COUNT; k++) {
        if (!isfinite(model->values[k]) && kinds[k] == OUTPUT) return 0;
    }
    return 1;
}

static int model_terminate(Model *model)
{
    if (model->phase != STEPPING) return 0;
    model->phase = TERMINATED;
    return 1;
}

static Model *model_copy(const Model *model)
{
    Model *copy = malloc(sizeof *copy);
    if (copy != NULL) *copy = *model;
    return copy;
}
