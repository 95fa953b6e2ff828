"""C99: a header, a source without allocation, and a test.

Single precision is a choice of whoever compiles: NAME_SINGLE makes all numbers of a sample floats. Constants follow
from the parameters in double precision either way.
"""

from __future__ import annotations

from collections.abc import Mapping

from friso.drives.c_machine import machine_files
from friso.drives.languages import c_language, commented
from friso.drives.program import EXTRA_INPUTS, INPUTS, OUTPUT, identifier
from friso.drives.target import CodeTarget, Parcel

_WORDS = """auto break case char const continue default do double else enum extern float for goto if inline int long
register restrict return short signed sizeof static struct switch typedef union unsigned void volatile
while sqrt fabs floor exp pow isfinite output command dropped state parameters math tgmath stdio stdlib string"""


def _arguments(parcel: Parcel, real: str) -> str:
    """Return the declaration of the inputs, in their order."""
    return ", ".join(f"{real} {name}" for name in parcel.inputs)


def _header(parcel: Parcel) -> str:
    """Return the header: parameters, state, and the functions."""
    name, real, upper = parcel.name, f"{parcel.name}_real", parcel.name.upper()
    keys = {identifier(str(one)): str(one) for one in parcel.program.parameters}
    fields = [f"    double {field}; /* [{unit}] {keys[field]} */" for field, (_, unit) in parcel.parameters.items()]
    kept = [
        f"    {real} {identifier(str(one))};" for one in (*parcel.program.sampled_constants, *parcel.program.memories)
    ]
    usage = [
        *parcel.header,
        "",
        f"Call {name}_defaults and {name}_init once, with what is read and with the output so far, so that it does not",
        f"jump. Then call {name}_step every {parcel.program.period!r} s, which returns the output [{parcel.unit}].",
        "A sample whose results are not all finite changes nothing: the output stays, and `dropped` counts it.",
        f"Compile with -D{upper}_SINGLE for single precision. Nothing is allocated, nothing recurses.",
        "",
        *(f"{one}: {meaning}" for one, meaning in parcel.meanings.items()),
    ]
    return "\n".join(
        [
            *commented(usage),
            f"#ifndef {upper}_H",
            f"#define {upper}_H",
            "",
            f"#ifdef {upper}_SINGLE",
            f"typedef float {real};",
            "#else",
            f"typedef double {real};",
            "#endif",
            "",
            "typedef struct {",
            *fields,
            f"}} {name}_parameters;",
            "",
            "typedef struct {",
            *kept,
            f"    {real} output; /* [{parcel.unit}] */",
            "    unsigned long dropped;",
            f"}} {name}_state;",
            "",
            f"void {name}_defaults({name}_parameters *parameters);",
            f"void {name}_init({name}_state *state, const {name}_parameters *parameters,",
            f"    {_arguments(parcel, 'double')}, double output);",
            f"{real} {name}_step({name}_state *state, {_arguments(parcel, real)});",
            "",
            "#endif",
            "",
        ]
    )


def _source(parcel: Parcel) -> str:
    """Return the source of the functions."""
    name, real, program = parcel.name, f"{parcel.name}_real", parcel.program
    double, number = c_language(), c_language(real)
    own = {str(one) for one in (*program.sampled_constants, *program.memories)}
    of_parameters = {str(one) for one in program.parameters}

    def prepared(symbol: str) -> str:
        return f"parameters->{identifier(symbol)}" if symbol in of_parameters else identifier(symbol)

    def sampled(symbol: str) -> str:
        return f"state->{identifier(symbol)}" if symbol in own else identifier(symbol)

    begins = (*program.prepared, *program.begins)
    used = {str(s) for e in (*(e for _, e in begins), *program.started) for s in e.free_symbols}
    read = [one for one in parcel.inputs if one in program.read]
    following = [f"{real} next_{identifier(str(one))}" for one in program.memories]
    finite = [f"isfinite(next_{identifier(str(one))})" for one in program.memories]
    finite += ["isfinite(command)", *(f"isfinite({one})" for one in read)]
    init = [
        *_declared(begins, "double"),
        *double.lines(begins, prepared),
        *(f"state->{identifier(str(one))} = ({real}){prepared(str(one))};" for one in program.sampled_constants),
        *(
            f"state->{identifier(str(one))} = ({real})({double.expression(value, prepared)});"
            for one, value in zip(program.memories, program.started, strict=True)
        ),
        f"state->output = ({real})output;",
        "state->dropped = 0;",
        *(f"(void){one};" for one in (*parcel.inputs, str(OUTPUT)) if one not in used),
        *([] if of_parameters else ["(void)parameters;"]),
    ]
    step = [
        *_declared(program.steps, real),
        *(f"{one};" for one in (*following, f"{real} command")),
        *number.lines(program.steps, sampled),
        *(
            f"next_{identifier(str(one))} = {number.expression(value, sampled)};"
            for one, value in zip(program.memories, program.updates, strict=True)
        ),
        f"command = {number.expression(program.command, sampled)};",
        "if (!(" + "\n        && ".join(finite) + ")) {",
        "    state->dropped++;",
        "    return state->output;",
        "}",
        *(f"state->{identifier(str(one))} = next_{identifier(str(one))};" for one in program.memories),
        "state->output = command;",
        *(f"(void){one};" for one in parcel.inputs if one not in read),
        "return command;",
    ]
    defaults = [f"parameters->{field} = {value!r};" for field, (value, _) in parcel.parameters.items()]
    return "\n".join(
        [
            *commented([*parcel.header]),
            f'#include "{name}.h"',
            "#include <tgmath.h>",
            "",
            f"void {name}_defaults({name}_parameters *parameters)",
            *_body(defaults or ["(void)parameters;"]),
            "",
            f"void {name}_init({name}_state *state, const {name}_parameters *parameters,",
            f"    {_arguments(parcel, 'double')}, double output)",
            *_body(init),
            "",
            f"{real} {name}_step({name}_state *state, {_arguments(parcel, real)})",
            *_body(step),
            "",
        ]
    )


def _declared(assignments: tuple, real: str) -> list[str]:
    """Return the declarations of the symbols that are assigned to."""
    return [f"{real} {identifier(str(symbol))};" for symbol, _ in assignments]


def _body(lines: list[str]) -> list[str]:
    """Return the body of a function."""
    return ["{", *(f"    {line}" for line in lines), "}"]


_TEST = """\
#include "NAME.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#ifdef UPPER_SINGLE
#define TOLERANCE SINGLE_BOUND
#else
#define TOLERANCE DOUBLE_BOUND
#endif

/* Runs the samples of a CSV file, whose first row is the start, and compares the outputs with friso's. */
int main(int count, char **words)
{
    NAME_parameters parameters;
    NAME_state state;
    double row[COLUMNS], worst = 0.0, largest = 0.0;
    long samples = -1;
    char line[4096];
    FILE *file = count == 2 ? fopen(words[1], "r") : NULL;
    if (file == NULL || fgets(line, sizeof line, file) == NULL) {
        fprintf(stderr, "usage: NAME_test NAME_vector.csv\\n");
        return 2;
    }
    NAME_defaults(&parameters);
    while (fgets(line, sizeof line, file) != NULL) {
        char *place = line;
        int k;
        for (k = 0; k < COLUMNS; k++) {
            row[k] = strtod(place, &place);
            place += *place == ',';
        }
        if (samples < 0) {
            NAME_init(&state, &parameters, DOUBLES, row[COLUMNS - 1]);
        } else {
            double output = (double)NAME_step(&state, REALS);
            worst = fmax(worst, fabs(output - row[COLUMNS - 1]));
            largest = fmax(largest, fabs(row[COLUMNS - 1]));
        }
        samples++;
    }
    fclose(file);
    printf("%ld samples, largest difference %.3g of %.3g, %lu dropped\\n", samples, worst, largest, state.dropped);
    return samples > 0 && worst <= TOLERANCE && state.dropped == 0 ? 0 : 1;
}
"""


def _test(parcel: Parcel) -> str:
    """Return the test, which runs the vector."""
    places = range(len(parcel.inputs))
    reals = ", ".join(f"(NAME_real)row[{k}]" for k in places)
    text = _TEST.replace("REALS", reals).replace("DOUBLES", ", ".join(f"row[{k}]" for k in places))
    text = text.replace("SINGLE_BOUND", repr(parcel.single_tolerance)).replace("DOUBLE_BOUND", repr(parcel.tolerance))
    text = text.replace("COLUMNS", str(len(parcel.inputs) + 1)).replace("UPPER", parcel.name.upper())
    return text.replace("NAME", parcel.name)


def _files(parcel: Parcel) -> Mapping[str, str]:
    """Return header, source, test and vector by name."""
    name = parcel.name
    return {
        f"{name}.h": _header(parcel),
        f"{name}.c": _source(parcel),
        f"{name}_test.c": _test(parcel),
        f"{name}_vector.csv": parcel.vector.text(),
        **(machine_files(parcel) if parcel.machine else {}),
    }


TARGET = CodeTarget(
    "C", _files, frozenset(_WORDS.split()) - {str(one) for one in (*INPUTS, *EXTRA_INPUTS)}, holds_machine=True
)
