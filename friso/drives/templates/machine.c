{% include "about_machine" %}
#include "{{ name }}_machine.h"
#include <math.h>

enum { STATES = {{ machine.states | length }}, MODES = {{ [machine.modes | length, 1] | max }}, WAITING = {{ machine.waiting + 1 }} };

void {{ name }}_machine_defaults({{ name }}_machine_parameters *parameters)
{
{% for one, value in machine.parameters.items() %}
    parameters->{{ one | identifier }} = {{ value }};
{% endfor %}
}

static void {{ name }}_sides(const double *c, const double *x, double *values)
{
{% for line in body(machine.sides, values, ("c", "x", "values")) %}
    {{ line }}
{% endfor %}
}

static void {{ name }}_modes(const double *c, const double *x, double *values)
{
{% for line in body(machine.mode_starts, values, ("c", "x", "values")) %}
    {{ line }}
{% endfor %}
}

static void {{ name }}_rates(const double *c, const double *x, const double *m, const double *s, double force, double *values)
{
{% for line in body(machine.rates, values, ("c", "x", "m", "s", "force")) %}
    {{ line }}
{% endfor %}
}

static void {{ name }}_jacobian(const double *c, const double *x, const double *m, const double *s, double force,
    double jacobian[STATES][STATES])
{
{% for line in body(machine.jacobian, entries, ("c", "x", "m", "s", "force")) %}
    {{ line }}
{% endfor %}
}

static void {{ name }}_changes(const double *c, const double *x, const double *m, const double *s, double *values)
{
{% for line in body(machine.changes, values, ("c", "x", "m", "s")) %}
    {{ line }}
{% endfor %}
}

/* Solves matrix y = right for y, which replaces right; the matrix is factored in place where fresh. */
static void {{ name }}_solve(double matrix[STATES][STATES], int pivots[STATES], double right[STATES], int fresh)
{
    int i, j, k;
    for (k = 0; k < STATES; k++) {
        double moved;
        if (fresh) {
            pivots[k] = k;
            for (i = k + 1; i < STATES; i++) {
                if (fabs(matrix[i][k]) > fabs(matrix[pivots[k]][k])) pivots[k] = i;
            }
            for (j = 0; j < STATES; j++) {
                moved = matrix[k][j];
                matrix[k][j] = matrix[pivots[k]][j];
                matrix[pivots[k]][j] = moved;
            }
            for (i = k + 1; i < STATES; i++) {
                matrix[i][k] /= matrix[k][k];
                for (j = k + 1; j < STATES; j++) matrix[i][j] -= matrix[i][k] * matrix[k][j];
            }
        }
    }
    for (k = 0; k < STATES; k++) {
        double moved = right[k];
        right[k] = right[pivots[k]];
        right[pivots[k]] = moved;
    }
    for (i = 0; i < STATES; i++) {
        for (j = 0; j < i; j++) right[i] -= matrix[i][j] * right[j];
    }
    for (i = STATES - 1; i >= 0; i--) {
        for (j = i + 1; j < STATES; j++) right[i] -= matrix[i][j] * right[j];
        right[i] /= matrix[i][i];
    }
}

static void {{ name }}_go_on({{ name }}_machine *machine, double duration)
{
    const double h = duration / machine->steps, force = machine->waiting[WAITING - 1];
    double *x = machine->states;
    int step, i, j;
    for (step = 0; duration > 0.0 && step < machine->steps; step++) {
        double sides[{{ [machine.kinks | length, 1] | max }}], matrix[STATES][STATES] = {{ "{{0.0}}" }}, first[STATES], second[STATES], later[STATES];
        double changed[STATES + MODES];
        int pivots[STATES];
        {{ name }}_sides(machine->constants, x, sides);
        {{ name }}_jacobian(machine->constants, x, machine->modes, sides, force, matrix);
        for (i = 0; i < STATES; i++) {
            for (j = 0; j < STATES; j++) matrix[i][j] = (i == j ? 1.0 : 0.0) - {{ gamma }} * h * matrix[i][j];
        }
        {{ name }}_rates(machine->constants, x, machine->modes, sides, force, first);
        {{ name }}_solve(matrix, pivots, first, 1);
        for (i = 0; i < STATES; i++) later[i] = x[i] + h * first[i];
        {{ name }}_rates(machine->constants, later, machine->modes, sides, force, second);
        for (i = 0; i < STATES; i++) second[i] -= 2.0 * first[i];
        {{ name }}_solve(matrix, pivots, second, 0);
        for (i = 0; i < STATES; i++) x[i] += h * (1.5 * first[i] + 0.5 * second[i]);
        {{ name }}_sides(machine->constants, x, sides);
        {{ name }}_changes(machine->constants, x, machine->modes, sides, changed);
        for (i = 0; i < STATES; i++) x[i] = changed[i];
        for (i = 0; i < {{ machine.modes | length }}; i++) machine->modes[i] = changed[STATES + i];
    }
}

void {{ name }}_machine_init({{ name }}_machine *machine, const {{ name }}_machine_parameters *parameters,
    double position, double output, int steps)
{
    double *c = machine->constants, *values = machine->states;
    const double steady_position = position, steady_force = output / {{ run.per_newton }};
    int i;
    machine->steps = steps > 0 ? steps : 1;
    for (i = 0; i < WAITING; i++) machine->waiting[i] = steady_force;
{% for line in prepared %}
    {{ line }}
{% endfor %}
{% for line in body(machine.started, values, ("c",)) %}
    {{ line }}
{% endfor %}
    {{ name }}_modes(c, values, machine->modes);
    (void)steady_position;
}

void {{ name }}_machine_step({{ name }}_machine *machine, double output)
{
    int i;
    {{ name }}_go_on(machine, {{ machine.late }});
    for (i = WAITING - 1; i > 0; i--) machine->waiting[i] = machine->waiting[i - 1];
    machine->waiting[0] = output / {{ run.per_newton }};
    {{ name }}_go_on(machine, {{ machine.period - machine.late }});
}

double {{ name }}_machine_position(const {{ name }}_machine *machine)
{
    return machine->states[{{ machine.states.index(machine.position) }}];
}

double {{ name }}_machine_motor_position(const {{ name }}_machine *machine)
{
    return machine->states[{{ machine.states.index(machine.rated or machine.position) }}];
}
