"""Show the results of frequency responses."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from friso.identification.response.analysis import Bench
from friso.identification.response.departure import Drag
from friso.identification.response.mass_line import StraightLine
from friso.quantities import percent
from friso.questions.identify.estimates import estimate_document, estimates_document
from friso.questions.identify.kind_view import Facts, KindView, PredictionView
from friso.questions.identify.numbers import digits, name_of, with_interval
from friso.questions.identify.response_figures import response_figures
from friso.shown.documents import entries
from friso.shown.drawing.prefixes import range_with_unit


def _sentences(bench: Bench) -> tuple[str, ...]:
    """Say what the response shows, and whether friction explains where it is not linear."""
    sentences = [f"{text[0].upper()}{text[1:]}." for text in (bench.seen.words[-1:] if bench.seen else ())]
    if bench.departs is not None and bench.departs.frequency.determined:
        below = digits(bench.departs.frequency.value, "Hz")
        sentences.append(f"Below about {below} the response departs from the linear model.")
        sentences += [_friction(bench)] if bench.explanation is not None else []
    return tuple(sentences)


def _friction(bench: Bench) -> str:
    """Say how much of the response's departure from the linear model friction explains.

    The fraction is that of a simulated mass with Coulomb friction on a spring.
    """
    assert bench.explanation is not None
    share = 1 - bench.explanation.left
    verb = "explains" if share > 0.5 else "does not explain"
    accounted = percent(max(share, 0.0), 3)
    return f"A simulated mass with Coulomb friction on a spring {verb} this: it accounts for {accounted}."


def _facts(bench: Bench) -> Facts:
    """List mass lines, modes, masses and joint, friction, and how one log predicts the other."""
    facts = [("Band of the models", range_with_unit(*bench.band, "Hz"))]
    for line in bench.lines:
        place = _place(line)
        facts.append((place[0].upper() + place[1:], f"{with_interval(line.value)}; level {with_interval(line.level)}"))
    facts += [
        (name_of(estimate.name), with_interval(estimate)) for estimate in (bench.modes.estimates if bench.modes else ())
    ]
    facts += [
        (f"Two masses: {estimate.name}", with_interval(estimate))
        for estimate in (bench.two_masses.estimates if bench.two_masses else ())
    ]
    if bench.departs is not None:
        facts.append(("Departs from the linear model below", with_interval(bench.departs.frequency)))
    if bench.drag is not None:
        facts.append(("Coulomb friction, from the departure", with_interval(bench.drag.coulomb)))
        facts.append(("Spring beside it", with_interval(bench.drag.stiffness)))
    facts += [(f"{log}, predicted by another log", _outputs(errors)) for log, errors in bench.aside]
    return tuple(facts)


def _place(line: StraightLine) -> str:
    """Write the kind of a mass line and the band of frequencies that it covers."""
    return f"{line.kind}, {range_with_unit(line.low, line.high, 'Hz')}"


def _headline(bench: Bench) -> str:
    """Say which masses and modes a response shows, and which units the stage file still needs."""
    sentences = []
    names = ("total mass", "antiresonance frequency", "resonance frequency")
    if bench.two_masses is not None:
        sentences = [f"{name} {with_interval(bench.two_masses[name])}" for name in names]
    else:
        sentences = [f"{_place(line)} {with_interval(line.value)}" for line in bench.lines]
        modes = bench.modes.estimates if bench.modes is not None else ()
        sentences += [f"{estimate.name} {with_interval(estimate)}" for estimate in modes if estimate.unit == "Hz"]
    units = bench.driven.channels.input_unit, bench.driven.channels.output_unit
    seen = f"Frequency response: {'; '.join(sentences)}." if sentences else ""
    if units == ("N", "m"):
        return seen
    return f"{seen} {_without_units(*units)}".strip()


def _without_units(force: str, motion: str) -> str:
    """Say that masses and stiffness enter the stage file only with a force in N and motion in m.

    A unit "1" means that the log states none.
    """
    wanted = "masses and stiffness need N and m to enter the stage file"
    silent = " and the ".join(name for name, unit in (("force", force), ("motion", motion)) if unit == "1")
    if silent:
        return f"The log states no unit for the {silent}: {wanted} (--unit, --scale)."
    return f"The force is in {force} and the motion in {motion}: {wanted} (--scale)."


def _outputs(errors: Sequence[float]) -> str:
    """Write the relative errors of a predicted response: of the driven mass, then of the other."""
    names = ("driven mass", "other mass")
    return ", ".join(f"{percent(error, 3)} ({name})" for name, error in zip(names, errors, strict=False))


def _numbers(bench: Bench) -> dict[str, Any]:
    """Return the results of an analysed frequency response for the JSON document."""
    channels = bench.driven.channels
    return {
        "input": {"name": channels.input, "unit": channels.input_unit},
        "output": {"name": channels.output, "unit": channels.output_unit},
        "estimator": bench.driven.kind,
        "lines": len(bench.driven.frequency),
        "band_hz": list(bench.band),
        "mass_lines": [_line_numbers(line) for line in bench.lines],
        "modes": [estimate_document(estimate) for estimate in bench.modes.estimates] if bench.modes else [],
        "two_masses": [estimate_document(estimate) for estimate in bench.two_masses.estimates]
        if bench.two_masses
        else [],
        "case": bench.seen.case or None if bench.seen else None,
        "seen": list(bench.seen.words) if bench.seen else [],
        "departure": estimate_document(bench.departs.frequency) if bench.departs else None,
        "realisations_differ": bench.departs.differ if bench.departs else None,
        "friction": _drag_numbers(bench.drag) if bench.drag else None,
        "departure_left_by_friction": bench.explanation.left if bench.explanation else None,
        "aside": [{"log": name, "errors": list(errors)} for name, errors in bench.aside],
        "warnings": list(bench.warnings),
    }


def _line_numbers(line: StraightLine) -> dict[str, Any]:
    """Return a straight line fitted to a frequency response, for the document."""
    band = {"low_hz": line.low, "high_hz": line.high, **estimates_document(line, "level", "value")}
    return band | entries(line, "kind", "sign")


def _drag_numbers(drag: Drag) -> dict[str, Any]:
    """Return mass, damping, stiffness and Coulomb friction at low frequency, for the document."""
    return estimates_document(drag, "mass", "damping", "stiffness", "coulomb") | entries(drag, "warnings")


VIEW = KindView[Bench](
    "Frequency response",
    _facts,
    _numbers,
    lambda result, logs, name: response_figures(result, name),
    sentences=_sentences,
    headline=_headline,
    longest=True,
    prediction=PredictionView[tuple[float, ...]](
        worst=lambda errors: max(errors, default=np.nan),
        sentence=lambda errors: f"relative error of the response {_outputs(errors)}.",
        numbers=lambda errors: {"response_errors": list(errors)},
    ),
)
