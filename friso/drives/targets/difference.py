"""Difference equations, state space and biquads, as JSON, Markdown and LaTeX."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
import sympy as sp

from friso.drives.languages import PYTHON
from friso.drives.program import OUTPUT, LinearController, identifier
from friso.drives.settings import settings
from friso.drives.target import CodeTarget, Parcel
from friso.errors import markdown

_WORDS = """False None True and as assert async await break class continue def del elif else except finally for from
global if import in is lambda nonlocal not or pass raise return try while with yield abs sqrt floor exp
pow output"""

_TEST = '''\
"""Run the equations of NAME.json over NAME_vector.csv, and compare the outputs with friso's."""

import csv
import json
from math import exp, floor, isfinite, sqrt
from pathlib import Path

HERE = Path(__file__).parent
MODEL = json.loads((HERE / "NAME.json").read_text())
with open(HERE / "NAME_vector.csv", newline="") as file:
    START, *SAMPLES = [{name: float(text) for name, text in row.items()} for row in csv.DictReader(file)]


def ready(part):
    """Compile the equations of a part: for each a name, and cases of a condition and a value."""
    equations = [(one["name"], [(case["if"], case["value"]) for case in one["cases"]]) for one in MODEL[part]]
    return [(name, [[compile(text, name, "eval") for text in case] for case in cases]) for name, cases in equations]


def after(equations, values):
    """Add to the values what the equations assign, one after another."""
    for name, cases in equations:
        values[name] = next(eval(value, FUNCTIONS, values) for holds, value in cases if eval(holds, FUNCTIONS, values))
    return values


FUNCTIONS = {"abs": abs, "exp": exp, "floor": floor, "sqrt": sqrt}
PREPARE, BEGIN, SAMPLE, FOLLOWING = map(ready, ("prepare", "begin", "sample", "following"))
begun = after(PREPARE + BEGIN, {**{p["name"]: p["value"] for p in MODEL["parameters"]}, **START})
kept = {name: begun[name] for name in (*MODEL["constants"], *MODEL["memories"])}
output, worst = START["output"], 0.0
for sample in SAMPLES:
    inputs = {name: sample[name] for name in MODEL["inputs"]}
    values = after(SAMPLE, {**kept, **inputs})
    following = after(FOLLOWING, dict(values))
    if all(map(isfinite, (values["output"], *(following["next_" + name] for name in MODEL["memories"])))):
        kept |= {name: following["next_" + name] for name in MODEL["memories"]}
        output = values["output"]
    worst = max(worst, abs(output - sample["output"]))
print(f"{len(SAMPLES)} samples, largest difference {worst:.3g}")
raise SystemExit(worst > MODEL["tolerance"])
'''


def _equation(name: str, value: Any) -> dict[str, Any]:
    """Return an assignment as a table: a name, and cases of which the first that holds gives the value."""
    cases = [case.args for case in value.args] if isinstance(value, sp.Piecewise) else [(value, sp.true)]
    return {
        "name": name,
        "cases": [
            {
                "if": "True" if condition == sp.true else PYTHON.condition(condition, identifier),
                "value": PYTHON.expression(result, identifier),
            }
            for result, condition in cases
        ],
    }


def _parts(parcel: Parcel) -> dict[str, list[tuple[str, Any]]]:
    """Return all equations by part: preparation, beginning, sample and what follows it."""
    program = parcel.program
    kept = [identifier(str(one)) for one in program.memories]
    return {
        "prepare": [(identifier(str(symbol)), value) for symbol, value in program.prepared],
        "begin": [
            *((identifier(str(symbol)), value) for symbol, value in program.begins),
            *zip(kept, program.started, strict=True),
        ],
        "sample": [
            *((identifier(str(symbol)), value) for symbol, value in program.steps),
            (str(OUTPUT), program.command),
        ],
        "following": [(f"next_{name}", value) for name, value in zip(kept, program.updates, strict=True)],
    }


def _document(parcel: Parcel) -> dict[str, Any]:
    """Return the controller as plain tables and numbers."""
    program, linear = parcel.program, parcel.linear
    rows = {part: [_equation(name, value) for name, value in pairs] for part, pairs in _parts(parcel).items()}
    return {
        "about": [*parcel.header],
        "sample_time_s": program.period,
        "inputs": parcel.meanings,
        "output_unit": parcel.unit,
        "parameters": [
            {"name": name, "value": value, "unit": unit} for name, (value, unit) in parcel.parameters.items()
        ],
        "constants": [identifier(str(one)) for one in program.sampled_constants],
        "memories": [identifier(str(one)) for one in program.memories],
        **rows,
        "state_space": {
            "inputs": [*linear.inputs],
            "states": [*linear.states],
            "samples": [
                {letter: matrix.tolist() for letter, matrix in zip("abcd", matrices, strict=True)}
                for matrices in linear.samples
            ],
        },
        "biquads": {name: sections.tolist() for name, sections in biquads(linear).items()},
        "tolerance": parcel.tolerance,
    }


def biquads(linear: LinearController) -> dict[str, np.ndarray]:
    """Return the transfer function from each input to the output as sections of second order, by input.

    The rows of an array, shape (sections, 6), are b0, b1, b2, 1, a1, a2. Inputs without effect, loops at several rates,
    and functions whose sections would lose digits are left out.
    """
    from scipy.signal import zpk2sos

    if len(linear.samples) > 1:
        return {}
    found_sections: dict[str, np.ndarray] = {}
    turns = np.geomspace(1e-3, np.pi, settings.section_points)[:-1]  # where the last one is, a zero may lie
    for name in linear.inputs:
        zeros, poles = _roots(linear, name)
        wanted = linear.response(name, turns)
        if not np.any(wanted):
            continue
        z = np.exp(1j * turns)
        shape = np.prod(z[:, None] - zeros, axis=1) / np.prod(z[:, None] - poles, axis=1)
        largest = np.argmax(np.abs(shape))
        gain = float(np.real(wanted[largest] / shape[largest]))
        sections = zpk2sos(zeros, poles, gain)
        error = np.abs(_of_sections(sections, z) - wanted) / np.abs(wanted)
        if error.max() <= settings.section_rounding:
            found_sections[name] = sections
    return found_sections


def _roots(linear: LinearController, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return zeros and poles from an input to the output, without those that cancel."""
    from scipy.linalg import eig

    ((a, b, c, d),) = linear.samples
    column = [linear.inputs.index(name)]
    n = len(a)
    whole = np.block([[a, b[:, column]], [c, d[:, column]]])
    pairs: Any = eig(whole, np.diag([1.0] * n + [0.0]), right=False, homogeneous_eigvals=True)
    finite, infinite = pairs
    ends = np.abs(infinite) > settings.cancelling_distance * np.abs(finite)
    zeros = [*(finite[ends] / infinite[ends])]
    poles = []
    for pole in np.linalg.eigvals(a):
        near = [k for k, zero in enumerate(zeros) if abs(zero - pole) <= settings.cancelling_distance]
        if near:
            zeros.pop(min(near, key=lambda k: abs(zeros[k] - pole)))
        else:
            poles.append(pole)
    return np.array(zeros, complex), np.array(poles, complex)


def _of_sections(sections: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Return the response of sections at points z."""
    powers = z[:, None, None] ** -np.arange(3)
    upper, lower = ((sections[:, part] * powers).sum(axis=-1) for part in (slice(0, 3), slice(3, 6)))
    return np.prod(upper / lower, axis=1)


def _table(heading: list[str], rows: list[list[str]]) -> list[str]:
    """Return a table in Markdown, of cells in Markdown."""
    lines = [heading, ["---"] * len(heading), *rows]
    return ["", *(f"| {' | '.join(line)} |" for line in lines), ""]


def _codes(names: Iterable[str]) -> str:
    """Return names as code in Markdown."""
    return ", ".join(f"`{name}`" for name in names)


def _equations(pairs: list[tuple[str, Any]], written: Callable[[Any], str]) -> list[list[str]]:
    """Return rows of a table of equations: name, value, and when it holds."""
    rows = []
    for name, value in pairs:
        for k, case in enumerate(_equation(name, value)["cases"]):
            rows.append(
                [f"`{name}`" if k == 0 else "", f"`{case['value']}`", "" if case["if"] == "True" else f"`{case['if']}`"]
            )
    return rows


def _markdown(parcel: Parcel) -> str:
    """Return the controller as tables for people."""
    linear, parts = parcel.linear, _parts(parcel)
    heading = ["Name", "Value", "If (the first row that holds)"]
    lines = [f"# {parcel.name}: difference equations", "", *(markdown(line) + "  " for line in parcel.header)]
    lines += ["", f"Every {parcel.program.period!r} s. The output is in {markdown(parcel.unit)}."]
    lines += _table(
        ["Input", "Meaning"], [[f"`{name}`", markdown(meaning)] for name, meaning in parcel.meanings.items()]
    )
    parameters = [[f"`{name}`", repr(value), markdown(unit)] for name, (value, unit) in parcel.parameters.items()]
    lines += _table(["Parameter", "Value", "Unit"], parameters)
    titles = {
        "prepare": "Constants",
        "begin": "Beginning",
        "sample": "Each sample",
        "following": "Kept for the next sample",
    }
    for part, title in titles.items():
        lines += [f"## {title}", *_table(heading, _equations(parts[part], str))]
    lines += ["## State space", "", "Without limits and settings against friction: x' = a x + b u, y = c x + d u."]
    lines += ["", f"States: {_codes(linear.states)}.  ", f"Inputs: {_codes(linear.inputs)}."]
    for k, matrices in enumerate(linear.samples):
        lines += ["", *([f"Sample {k} of {len(linear.samples)}:", ""] if len(linear.samples) > 1 else []), "```"]
        lines += [f"{letter} = {matrix.tolist()}" for letter, matrix in zip("abcd", matrices, strict=True)] + ["```"]
    lines += ["", "## Biquads"]
    for name, sections in biquads(linear).items():
        lines += ["", f"From `{name}` to the output:"]
        lines += _table(["b0", "b1", "b2", "a0", "a1", "a2"], [[repr(one) for one in row] for row in sections.tolist()])
    left = len(linear.samples) > 1
    lines += ["", "Loops at several rates have none."] if left else []
    return "\n".join([*lines, ""])


def _latex(parcel: Parcel) -> str:
    """Return the equations of a sample in LaTeX, for amsmath."""

    def plain(name: str) -> str:
        return r"\mathrm{" + name.replace("_", r"\_") + "}"

    pairs = [pair for part in ("prepare", "sample", "following") for pair in _parts(parcel)[part]]
    rows = []
    for name, value in pairs:
        names = {symbol: plain(identifier(str(symbol))) for symbol in value.free_symbols}
        rows.append(f"{plain(name)} &= {sp.latex(value, symbol_names=names)}")
    about = [f"% {line}".rstrip() for line in parcel.header]
    return "\n".join([*about, r"\begin{align*}", " \\\\\n".join(rows), r"\end{align*}", ""])


def _files(parcel: Parcel) -> Mapping[str, str]:
    """Return equations in three forms, test and vector by name."""
    name = parcel.name
    return {
        f"{name}.json": json.dumps(_document(parcel), indent=1) + "\n",
        f"{name}.md": _markdown(parcel),
        f"{name}.tex": _latex(parcel),
        f"{name}_test.py": _TEST.replace("NAME", name),
        f"{name}_vector.csv": parcel.vector.text(),
    }


TARGET = CodeTarget("difference equations", _files, frozenset(_WORDS.split()))
