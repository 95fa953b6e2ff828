{% include "about_machine" %}
#ifndef {{ name | upper }}_MACHINE_H
#define {{ name | upper }}_MACHINE_H

typedef struct {
{% for one in machine.parameters %}
    double {{ one | identifier }}; /* [{{ units.get(one | string) or "1" }}] {{ one }} */
{% endfor %}
} {{ name }}_machine_parameters;

typedef struct {
    double constants[{{ [machine.constants | length, 1] | max }}];
    double states[{{ machine.states | length }}];
    double modes[{{ [machine.modes | length, 1] | max }}];
    double waiting[{{ machine.waiting + 1 }}];
    int steps;
} {{ name }}_machine;

void {{ name }}_machine_defaults({{ name }}_machine_parameters *parameters);
void {{ name }}_machine_init({{ name }}_machine *machine, const {{ name }}_machine_parameters *parameters,
    double position, double output, int steps);
void {{ name }}_machine_step({{ name }}_machine *machine, double output);
double {{ name }}_machine_position(const {{ name }}_machine *machine);
double {{ name }}_machine_motor_position(const {{ name }}_machine *machine);

#endif
