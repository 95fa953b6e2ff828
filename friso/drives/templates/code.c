{% include "about" %}
#include "{{ name }}.h"
#include <tgmath.h>

void {{ name }}_defaults({{ name }}_parameters *parameters)
{
{% for one, _, value, _ in parcel.parameters %}
    parameters->{{ one }} = {{ value }};
{% else %}
    (void)parameters;
{% endfor %}
}

void {{ name }}_init({{ name }}_state *state, const {{ name }}_parameters *parameters,
    double {{ inputs | join(", double ") }}, double output)
{
{% for one, _ in begins %}
    double {{ one | identifier }};
{% endfor %}
{% for line in double.lines(begins, prepared) %}
    {{ line }}
{% endfor %}
{% for one in program.sampled_constants %}
    state->{{ one | identifier }} = ({{ real }}){{ prepared(one) }};
{% endfor %}
{% for one, value in zip(program.memories, program.started) %}
    state->{{ one | identifier }} = ({{ real }})({{ double.expression(value, prepared) }});
{% endfor %}
    state->output = ({{ real }})output;
    state->dropped = 0;
{% for one in unused %}
    (void){{ one }};
{% endfor %}
}

{{ real }} {{ name }}_step({{ name }}_state *state, {{ real }} {{ inputs | join(", " ~ real ~ " ") }})
{
{% for one, _ in program.steps %}
    {{ real }} {{ one | identifier }};
{% endfor %}
{% for one in program.memories %}
    {{ real }} next_{{ one | identifier }};
{% endfor %}
    {{ real }} command;
{% for line in number.lines(program.steps, sampled) %}
    {{ line }}
{% endfor %}
{% for one, value in zip(program.memories, program.updates) %}
    next_{{ one | identifier }} = {{ number.expression(value, sampled) }};
{% endfor %}
    command = {{ number.expression(program.command, sampled) }};
    if (!(isfinite({{ parcel.checked | join(")\n        && isfinite(") }}))) {
        state->dropped++;
        return state->output;
    }
{% for one in program.memories %}
    state->{{ one | identifier }} = next_{{ one | identifier }};
{% endfor %}
    state->output = command;
{% for one in inputs if one not in program.read %}
    (void){{ one }};
{% endfor %}
    return command;
}
