"""Difference equations, state space and biquads, as JSON, Markdown and LaTeX."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import sympy as sp

from friso.drives.languages import PYTHON
from friso.drives.program import OUTPUT, LinearController, identifier
from friso.drives.target import CodeTarget, Parcel

_WORDS = """False None True and as assert async await break class continue def del elif else except finally for from
global if import in is lambda nonlocal not or pass raise return try while with yield abs sqrt floor exp
pow output"""

TITLES = {
    "prepare": "Constants",
    "begin": "Beginning",
    "sample": "Each sample",
    "following": "Kept for the next sample",
}
"""Headings of the parts of the equations."""


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
    kept = [identifier(one) for one in program.memories]
    return {
        "prepare": [(identifier(symbol), value) for symbol, value in program.prepared],
        "begin": [
            *((identifier(symbol), value) for symbol, value in program.begins),
            *zip(kept, program.started, strict=True),
        ],
        "sample": [
            *((identifier(symbol), value) for symbol, value in program.steps),
            (str(OUTPUT), program.command),
        ],
        "following": [(f"next_{name}", value) for name, value in zip(kept, program.updates, strict=True)],
    }


def _document(parcel: Parcel, rows: Mapping[str, Any], sections: Mapping[str, np.ndarray]) -> dict[str, Any]:
    """Return the controller as plain tables and numbers: equations in `rows` by part, and sections by input."""
    program, linear = parcel.program, parcel.linear
    return {
        "about": [*parcel.header],
        "sample_time_s": program.period,
        "inputs": parcel.meanings,
        "output_unit": parcel.unit,
        "parameters": [{"name": name, "value": value, "unit": unit} for name, _, value, unit in parcel.parameters],
        "constants": [identifier(one) for one in program.sampled_constants],
        "memories": [identifier(one) for one in program.memories],
        **rows,
        "state_space": {
            "inputs": [*linear.inputs],
            "states": [*linear.states],
            "samples": [
                {letter: matrix.tolist() for letter, matrix in zip("abcd", matrices, strict=True)}
                for matrices in linear.samples
            ],
        },
        "biquads": {name: one.tolist() for name, one in sections.items()},
        "tolerance": parcel.tolerance,
    }


SECTION_POINTS = 200
"""Frequencies at which biquads are compared with the state space; a notch is a tenth of a decade wide."""

SECTION_ROUNDING = 1e-6
"""Largest relative difference between biquads and state space at which the biquads are told. Poles that nearly
coincide lose digits."""


def biquads(linear: LinearController) -> dict[str, np.ndarray]:
    """Return the transfer function from each input to the output as sections of second order, by input.

    The rows of an array, shape (sections, 6), are b0, b1, b2, 1, a1, a2. Inputs without effect, loops at several rates,
    and functions whose sections would lose digits are left out.
    """
    from scipy.signal import zpk2sos

    if len(linear.samples) > 1:
        return {}
    found_sections: dict[str, np.ndarray] = {}
    turns = np.geomspace(1e-3, np.pi, SECTION_POINTS)[:-1]  # where the last one is, a zero may lie
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
        if error.max() <= SECTION_ROUNDING:
            found_sections[name] = sections
    return found_sections


CANCELLING_DISTANCE = 1e-9
"""Distance of a zero and a pole in z that cancel, and size of what is infinite. Rounding of a pole is 1e-15, of a
double one 1e-8."""


def _roots(linear: LinearController, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return zeros and poles from an input to the output, without those that cancel."""
    from scipy.linalg import eig

    ((a, b, c, d),) = linear.samples
    column = [linear.inputs.index(name)]
    n = len(a)
    whole = np.block([[a, b[:, column]], [c, d[:, column]]])
    pairs: Any = eig(whole, np.diag([1.0] * n + [0.0]), right=False, homogeneous_eigvals=True)
    finite, infinite = pairs
    ends = np.abs(infinite) > CANCELLING_DISTANCE * np.abs(finite)
    zeros = [*(finite[ends] / infinite[ends])]
    poles = []
    for pole in np.linalg.eigvals(a):
        near = [k for k, zero in enumerate(zeros) if abs(zero - pole) <= CANCELLING_DISTANCE]
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


def _in_latex(parts: Mapping[str, list[tuple[str, Any]]]) -> list[tuple[str, str]]:
    """Return name and value of the equations of a sample in LaTeX."""

    def plain(name: str) -> str:
        return r"\mathrm{" + name.replace("_", r"\_") + "}"

    pairs = [pair for part in ("prepare", "sample", "following") for pair in parts[part]]
    named = [{symbol: plain(identifier(symbol)) for symbol in value.free_symbols} for _, value in pairs]
    latex = [sp.latex(value, symbol_names=names) for (_, value), names in zip(pairs, named, strict=True)]
    return [(plain(name), text) for (name, _), text in zip(pairs, latex, strict=True)]


def _files(parcel: Parcel) -> Mapping[str, str]:
    """Return equations in three forms, test and vector by name."""
    name, parts, sections = parcel.name, _parts(parcel), biquads(parcel.linear)
    rows = {part: [_equation(*pair) for pair in pairs] for part, pairs in parts.items()}
    titled = [(title, rows[part]) for part, title in TITLES.items()]
    return {
        f"{name}.json": json.dumps(_document(parcel, rows, sections), indent=1) + "\n",
        f"{name}.md": parcel.rendered("equations.md", titled=titled, biquads=sections),
        f"{name}.tex": parcel.rendered("equations.tex", equations=_in_latex(parts)),
        f"{name}_test.py": parcel.rendered("equations_test.py.jinja"),
        f"{name}_vector.csv": parcel.vector.text(),
    }


TARGET = CodeTarget("difference equations", _files, frozenset(_WORDS.split()))
