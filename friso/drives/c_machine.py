"""Write a machine with its friction in C99, as a plant of fixed steps beside its controller."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from friso.drives.languages import c_language, commented
from friso.drives.machine import FORCE, GAMMA, MachineRun, StraightCode
from friso.drives.program import POSITION, identifier
from friso.drives.target import Parcel
from friso.equations.component import STEADY

C = c_language()

_HEADER = """\
#ifndef UPPER_MACHINE_H
#define UPPER_MACHINE_H

typedef struct {
FIELDS
} NAME_machine_parameters;

typedef struct {
    double constants[COUNT_CONSTANTS];
    double states[COUNT_STATES];
    double modes[COUNT_MODES];
    double waiting[COUNT_WAITING];
    int steps;
} NAME_machine;

void NAME_machine_defaults(NAME_machine_parameters *parameters);
void NAME_machine_init(NAME_machine *machine, const NAME_machine_parameters *parameters,
    double position, double output, int steps);
void NAME_machine_step(NAME_machine *machine, double output);
double NAME_machine_position(const NAME_machine *machine);
double NAME_machine_motor_position(const NAME_machine *machine);

#endif
"""

_SOURCE = """\
#include "NAME_machine.h"
#include <math.h>

enum { STATES = COUNT_STATES, MODES = COUNT_MODES, WAITING = COUNT_WAITING };

void NAME_machine_defaults(NAME_machine_parameters *parameters)
{
DEFAULTS
}

static void NAME_sides(const double *c, const double *x, double *values)
{
SIDES
}

static void NAME_modes(const double *c, const double *x, double *values)
{
MODES_BEGUN
}

static void NAME_rates(const double *c, const double *x, const double *m, const double *s, double force, double *values)
{
RATES
}

static void NAME_jacobian(const double *c, const double *x, const double *m, const double *s, double force,
    double jacobian[STATES][STATES])
{
JACOBIAN
}

static void NAME_changes(const double *c, const double *x, const double *m, const double *s, double *values)
{
CHANGES
}

/* Solves matrix y = right for y, which replaces right; the matrix is factored in place where fresh. */
static void NAME_solve(double matrix[STATES][STATES], int pivots[STATES], double right[STATES], int fresh)
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

static void NAME_go_on(NAME_machine *machine, double duration)
{
    const double h = duration / machine->steps, force = machine->waiting[WAITING - 1];
    double *x = machine->states;
    int step, i, j;
    for (step = 0; duration > 0.0 && step < machine->steps; step++) {
        double sides[COUNT_SIDES], matrix[STATES][STATES] = {{0.0}}, first[STATES], second[STATES], later[STATES];
        double changed[STATES + MODES];
        int pivots[STATES];
        NAME_sides(machine->constants, x, sides);
        NAME_jacobian(machine->constants, x, machine->modes, sides, force, matrix);
        for (i = 0; i < STATES; i++) {
            for (j = 0; j < STATES; j++) matrix[i][j] = (i == j ? 1.0 : 0.0) - GAMMA * h * matrix[i][j];
        }
        NAME_rates(machine->constants, x, machine->modes, sides, force, first);
        NAME_solve(matrix, pivots, first, 1);
        for (i = 0; i < STATES; i++) later[i] = x[i] + h * first[i];
        NAME_rates(machine->constants, later, machine->modes, sides, force, second);
        for (i = 0; i < STATES; i++) second[i] -= 2.0 * first[i];
        NAME_solve(matrix, pivots, second, 0);
        for (i = 0; i < STATES; i++) x[i] += h * (1.5 * first[i] + 0.5 * second[i]);
        NAME_sides(machine->constants, x, sides);
        NAME_changes(machine->constants, x, machine->modes, sides, changed);
        for (i = 0; i < STATES; i++) x[i] = changed[i];
        for (i = 0; i < MODE_COUNT; i++) machine->modes[i] = changed[STATES + i];
    }
}

void NAME_machine_init(NAME_machine *machine, const NAME_machine_parameters *parameters,
    double position, double output, int steps)
{
    double *c = machine->constants, *values = machine->states;
    const double steady_position = position, steady_force = output / PER_NEWTON;
    int i;
    machine->steps = steps > 0 ? steps : 1;
    for (i = 0; i < WAITING; i++) machine->waiting[i] = steady_force;
PREPARED
STARTED
    NAME_modes(c, values, machine->modes);
    (void)steady_position;
}

void NAME_machine_step(NAME_machine *machine, double output)
{
    int i;
    NAME_go_on(machine, LATE);
    for (i = WAITING - 1; i > 0; i--) machine->waiting[i] = machine->waiting[i - 1];
    machine->waiting[0] = output / PER_NEWTON;
    NAME_go_on(machine, REST);
}

double NAME_machine_position(const NAME_machine *machine)
{
    return machine->states[POSITION];
}

double NAME_machine_motor_position(const NAME_machine *machine)
{
    return machine->states[RATED];
}
"""

_TEST = """\
#include "NAME_machine.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

/* Runs the outputs of a CSV file through the machine, and compares its positions with friso's run of the same steps. */
int main(int count, char **words)
{
    NAME_machine_parameters parameters;
    NAME_machine machine;
    double worst = 0.0;
    long samples = -1;
    char line[4096];
    FILE *file = count == 2 ? fopen(words[1], "r") : NULL;
    if (file == NULL || fgets(line, sizeof line, file) == NULL) {
        fprintf(stderr, "usage: NAME_machine_test NAME_machine_vector.csv\\n");
        return 2;
    }
    NAME_machine_defaults(&parameters);
    while (fgets(line, sizeof line, file) != NULL) {
        char *place = line;
        double output = strtod(place, &place), position = strtod(place + 1, NULL);
        if (samples < 0) {
            NAME_machine_init(&machine, &parameters, position, output, STEPS);
        } else {
            worst = fmax(worst, fabs(NAME_machine_position(&machine) - position));
            NAME_machine_step(&machine, output);
        }
        samples++;
    }
    fclose(file);
    printf("%ld samples, largest difference %.3g\\n", samples, worst);
    return samples > 0 && worst <= BOUND ? 0 : 1;
}
"""


def machine_files(parcel: Parcel) -> Mapping[str, str]:
    """Return header, source, test and test vector of a machine by name."""
    run, name = parcel.machine, parcel.name
    assert run is not None
    about, words = commented([*parcel.header, *_usage(parcel, run)]), _words(parcel, run)
    texts = {f"{name}_machine.h": _HEADER, f"{name}_machine.c": _SOURCE, f"{name}_machine_test.c": _TEST}
    tokens = re.compile("|".join(sorted(words, key=len, reverse=True)))
    files = {file: "\n".join([*about, tokens.sub(lambda match: words[match[0]], text)]) for file, text in texts.items()}
    rows = ["output,position", *(f"{output!r},{position!r}" for output, position in run.rows), ""]
    return files | {f"{name}_machine_vector.csv": "\n".join(rows)}


def _usage(parcel: Parcel, run: MachineRun) -> list[str]:
    """Say how the machine is used, and how far it is from friso."""
    name, machine = parcel.name, run.machine
    unit = parcel.units[str(POSITION)]
    differences = ", ".join(f"{difference:.1e} {unit} with {steps}" for steps, difference in run.differences.items())
    return [
        "",
        f"The machine with its friction as a plant. Call {name}_machine_defaults and {name}_machine_init once. Then,",
        f"every {machine.period!r} s, read {name}_machine_position, call the controller, and give its output to",
        f"{name}_machine_step. The delay of the drive is in it; noise and digits of encoders are not.",
        f"Driven by the output of friso's own run, its position differs over {len(run.rows) - 1} samples by at most",
        f"{differences} steps in a sample.",
    ]


def _words(parcel: Parcel, run: MachineRun) -> dict[str, str]:
    """Return what stands for the words of the templates."""
    machine = run.machine
    states, modes, kinks = ([*map(str, names)] for names in (machine.states, machine.modes, machine.kinks))
    places = {name: f"x[{k}]" for k, name in enumerate(states)} | {name: f"m[{k}]" for k, name in enumerate(modes)}
    places |= {name: f"s[{k}]" for k, name in enumerate(kinks)} | {str(FORCE): "force"}
    constants = {str(one): f"c[{k}]" for k, one in enumerate(machine.constants)}
    keys = {str(one): f"parameters->{identifier(str(one))}" for one in machine.parameters}
    start = {str(STEADY.position): "steady_position", str(STEADY.force): "steady_force"}
    rated = machine.position if machine.rated is None else machine.rated

    def body(
        part: StraightCode, names: Mapping[str, str], targets: Sequence[str], unused: Sequence[str] = ("c", "x")
    ) -> str:
        """Write a part as the body of a function that assigns the values to `targets`."""
        own = {str(symbol): identifier(str(symbol)) for symbol, _ in part.steps if str(symbol) not in names}
        written = {**own, **names}
        lines = [f"double {name};" for name in own.values()]
        lines += C.lines(part.steps, written.__getitem__)
        for target, value in zip(targets, part.values, strict=True):
            lines.append(f"{target} = {C.expression(value, written.__getitem__)};")
        return "\n".join(f"    {line}" for line in (*lines, *(f"(void){name};" for name in unused)))

    every, values = {**places, **constants}, [f"values[{k}]" for k in range(len(states) + len(modes))]
    along = ("c", "x", "m", "s")
    prepared = StraightCode(machine.prepared, ())
    fields = [
        f"    double {identifier(str(one))}; /* [{parcel.units.get(str(one)) or '1'}] {one} */"
        for one in machine.parameters
    ]
    entries = [f"jacobian[{i}][{j}]" for i, j in machine.places]
    return {
        "NAME": parcel.name,
        "UPPER": parcel.name.upper(),
        "FIELDS": "\n".join(fields),
        "DEFAULTS": "\n".join(
            f"    parameters->{identifier(str(one))} = {value!r};" for one, value in machine.parameters.items()
        ),
        "COUNT_CONSTANTS": str(max(1, len(constants))),
        "COUNT_STATES": str(len(states)),
        "COUNT_MODES": str(max(1, len(modes))),
        "MODE_COUNT": str(len(modes)),
        "COUNT_SIDES": str(max(1, len(kinks))),
        "COUNT_WAITING": str(machine.waiting + 1),
        "SIDES": body(machine.sides, every, values[: len(kinks)], ("c", "x", "values")),
        "MODES_BEGUN": body(machine.mode_starts, every, values[: len(modes)], ("c", "x", "values")),
        "RATES": body(machine.rates, every, values[: len(states)], (*along, "force")),
        "JACOBIAN": body(machine.jacobian, every, entries, (*along, "force")),
        "CHANGES": body(machine.changes, every, values, along),
        "PREPARED": body(prepared, {**keys, **constants}, (), ()),
        "STARTED": body(machine.started, {**start, **constants}, values[: len(states)], ("c",)),
        "GAMMA": repr(GAMMA),
        "PER_NEWTON": repr(run.per_newton),
        "LATE": repr(machine.late),
        "REST": repr(machine.period - machine.late),
        "POSITION": str(machine.states.index(machine.position)),
        "RATED": str(machine.states.index(rated)),
        "STEPS": str(run.steps),
        "BOUND": repr(run.tolerance),
    }
