"""C99: a header, a source without allocation, and a test.

Single precision is a choice of whoever compiles: NAME_SINGLE makes all numbers of a sample floats. Constants follow
from the parameters in double precision either way. A machine with its friction is a plant of fixed steps beside it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from friso.drives.languages import c_language
from friso.drives.machine import FORCE, GAMMA, StraightCode
from friso.drives.program import EXTRA_INPUTS, INPUTS, OUTPUT, identifier
from friso.drives.target import CodeTarget, Parcel
from friso.equations.component import STEADY

_WORDS = """auto break case char const continue default do double else enum extern float for goto if inline int long
register restrict return short signed sizeof static struct switch typedef union unsigned void volatile
while sqrt fabs floor exp pow isfinite output command dropped state parameters math tgmath stdio stdlib string"""


def _controller(parcel: Parcel) -> dict[str, Any]:
    """Return what the templates of a controller ask for."""
    program, real = parcel.program, f"{parcel.name}_real"
    own = (*program.sampled_constants, *program.memories)
    kept, of_parameters = {*map(str, own)}, {*map(str, program.parameters)}
    begun = (*(e for _, e in (*program.prepared, *program.begins)), *program.started)
    used = {str(symbol) for e in begun for symbol in e.free_symbols}
    unused = [one for one in (*parcel.inputs, str(OUTPUT)) if one not in used]

    def prepared(symbol: Any) -> str:
        return f"parameters->{identifier(symbol)}" if str(symbol) in of_parameters else identifier(symbol)

    def sampled(symbol: str) -> str:
        return f"state->{identifier(symbol)}" if symbol in kept else identifier(symbol)

    return {
        "real": real,
        "own": own,
        "unused": unused if of_parameters else [*unused, "parameters"],
        "double": c_language(),
        "number": c_language(real),
        "prepared": prepared,
        "sampled": sampled,
    }


def _machine(parcel: Parcel) -> dict[str, Any]:
    """Return what the templates of a machine ask for."""
    run, language = parcel.machine, c_language()
    assert run is not None
    machine = run.machine
    places = {
        str(one): f"{letter}[{k}]"
        for letter, names in {
            "c": machine.constants,
            "x": machine.states,
            "m": machine.modes,
            "s": machine.kinks,
        }.items()
        for k, one in enumerate(names)
    }
    places |= {str(FORCE): "force", str(STEADY.position): "steady_position", str(STEADY.force): "steady_force"}
    places |= {str(one): f"parameters->{identifier(one)}" for one in machine.parameters}

    def body(part: StraightCode, targets: Sequence[str], unused: Sequence[str]) -> list[str]:
        """Return the body of a function that assigns the values of a part to `targets`."""
        own = {str(symbol): identifier(symbol) for symbol, _ in part.steps if str(symbol) not in places}
        name = (own | places).__getitem__
        assigned = zip(targets, part.values, strict=False)  # of a vector, a part may fill the beginning
        return [
            *(f"double {one};" for one in own.values()),
            *language.lines(part.steps, name),
            *(f"{target} = {language.expression(value, name)};" for target, value in assigned),
            *(f"(void){one};" for one in unused),
        ]

    return {
        "run": run,
        "machine": machine,
        "gamma": GAMMA,
        "body": body,
        "prepared": body(StraightCode(machine.prepared, ()), (), ()),
        "values": [f"values[{k}]" for k in range(len(machine.states) + len(machine.modes) + len(machine.kinks))],
        "entries": [f"jacobian[{i}][{j}]" for i, j in machine.places],
    }


def _files(parcel: Parcel) -> Mapping[str, str]:
    """Return header, source, test and vector by name, and those of the machine."""
    name, run, values = parcel.name, parcel.machine, _controller(parcel)
    files = {
        f"{name}.h": parcel.rendered("code.h", **values),
        f"{name}.c": parcel.rendered("code.c", **values),
        f"{name}_test.c": parcel.rendered("code_test.c", **values),
        f"{name}_vector.csv": parcel.vector.text(),
    }
    if run is None:
        return files
    values = _machine(parcel)
    files |= {f"{name}_{one}": parcel.rendered(one, **values) for one in ("machine.h", "machine.c", "machine_test.c")}
    rows = ["output,position", *(f"{output!r},{position!r}" for output, position in run.rows), ""]
    return files | {f"{name}_machine_vector.csv": "\n".join(rows)}


TARGET = CodeTarget(
    "C", _files, frozenset(_WORDS.split()) - {str(one) for one in (*INPUTS, *EXTRA_INPUTS)}, holds_machine=True
)
