{% filter commented %}
{% for line in header %}
{{ line }}
{% endfor %}

Call {{ name }}_defaults and {{ name }}_init once, with what is read and with the output so far, so that it does not
jump. Then call {{ name }}_step every {{ program.period }} s, which returns the output [{{ unit }}].
A sample whose results are not all finite changes nothing: the output stays, and `dropped` counts it.
Compile with -D{{ name | upper }}_SINGLE for single precision. Nothing is allocated, nothing recurses.

{% for one, meaning in parcel.meanings.items() %}
{{ one }}: {{ meaning }}
{% endfor %}
{% endfilter %}
#ifndef {{ name | upper }}_H
#define {{ name | upper }}_H

#ifdef {{ name | upper }}_SINGLE
typedef float {{ real }};
#else
typedef double {{ real }};
#endif

typedef struct {
{% for one, key, _, unit in parcel.parameters %}
    double {{ one }}; /* [{{ unit }}] {{ key }} */
{% endfor %}
} {{ name }}_parameters;

typedef struct {
{% for one in own %}
    {{ real }} {{ one | identifier }};
{% endfor %}
    {{ real }} output; /* [{{ unit }}] */
    unsigned long dropped;
} {{ name }}_state;

void {{ name }}_defaults({{ name }}_parameters *parameters);
void {{ name }}_init({{ name }}_state *state, const {{ name }}_parameters *parameters,
    double {{ inputs | join(", double ") }}, double output);
{{ real }} {{ name }}_step({{ name }}_state *state, {{ real }} {{ inputs | join(", " ~ real ~ " ") }});

#endif
