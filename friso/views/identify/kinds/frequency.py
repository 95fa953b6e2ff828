"""How frequency responses are shown."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from friso.identify.response.analysis import Bench
from friso.identify.response.departure import Drag
from friso.identify.response.mass_line import StraightLine
from friso.views.drawing.prefixes import range_with_unit
from friso.views.identify.estimates import estimate_document
from friso.views.identify.kind_view import Facts, KindView, PredictionView
from friso.views.identify.numbers import digits, name_of, percent, with_interval
from friso.views.identify.response_figures import response_figures


def _sentences(it: Bench) -> tuple[str, ...]:
    """What the response shows, and whether friction explains its lower end."""
    said = [f"{text[0].upper()}{text[1:]}." for text in (it.seen.words[-1:] if it.seen else ())]
    if it.departs is not None and it.departs.frequency.shown:
        below = digits(it.departs.frequency.value, "Hz")
        said.append(f"Below about {below} the response leaves the linear model.")
        said += [_friction(it)] if it.explanation is not None else []
    return tuple(said)


def _friction(it: Bench) -> str:
    """Whether a simulation with friction explains the departure."""
    assert it.explanation is not None
    share = 1 - it.explanation.left
    verb = "explains" if share > 0.5 else "does not explain"
    accounted = percent(max(share, 0.0))
    return f"A simulated mass with Coulomb friction on a spring {verb} it: {accounted} of it is accounted for."


def _facts(it: Bench) -> Facts:
    """Lines, modes, masses and joint, friction, and how one log predicts the other."""
    facts = [("Band of the models", range_with_unit(*it.band, "Hz"))]
    facts += [(f"{line.kind[0].upper()}{line.kind[1:]}, {range_with_unit(line.low, line.high, 'Hz')}",
               f"{with_interval(line.value)}; level {with_interval(line.level)}") for line in it.lines]  # fmt: skip
    facts += [(name_of(each.name), with_interval(each)) for each in (it.modes.estimates if it.modes else ())]
    facts += [
        (f"Two masses: {each.name}", with_interval(each)) for each in (it.two_masses.estimates if it.two_masses else ())
    ]
    if it.departs is not None:
        facts.append(("Leaves the linear model below", with_interval(it.departs.frequency)))
    if it.drag is not None:
        facts.append(("Coulomb friction, from the departure", with_interval(it.drag.coulomb)))
        facts.append(("Spring beside it", with_interval(it.drag.stiffness)))
    facts += [(f"{log}, predicted by another log", _outputs(errors)) for log, errors in it.aside]
    return tuple(facts)


def _headline(bench: Bench) -> str:
    """The modes of a frequency response, and what its units keep from the stage file."""
    said = []
    names = ("total mass", "antiresonance frequency", "resonance frequency")
    if bench.two_masses is not None:
        said = [f"{name} {with_interval(bench.two_masses[name])}" for name in names]
    elif bench.modes is not None:
        said = [f"{each.name} {with_interval(each)}" for each in bench.modes.estimates if each.unit == "Hz"]
    units = bench.driven.channels.input_unit, bench.driven.channels.output_unit
    modes = f"Frequency response: {'; '.join(said)}." if said else ""
    if units == ("N", "m"):
        return modes
    scale = (
        f"The force stands in {units[0]} and the motion in {units[1]}: only in N and m do masses and stiffness enter "
    )
    return f"{modes} {scale}the stage file (--scale).".strip()


def _outputs(errors: Sequence[float]) -> str:
    """Relative errors of the outputs, the driven mass's first."""
    names = ("driven mass", "other mass")
    return ", ".join(f"{percent(error)} ({name})" for name, error in zip(names, errors, strict=False))


def _numbers(it: Bench) -> dict[str, Any]:
    channels = it.driven.channels
    return {
        "input": {"name": channels.input, "unit": channels.input_unit},
        "output": {"name": channels.output, "unit": channels.output_unit},
        "estimator": it.driven.kind,
        "lines": len(it.driven.frequency),
        "band_hz": list(it.band),
        "mass_lines": [_line_numbers(each) for each in it.lines],
        "modes": [estimate_document(each) for each in it.modes.estimates] if it.modes else [],
        "two_masses": [estimate_document(each) for each in it.two_masses.estimates] if it.two_masses else [],
        "case": it.seen.case or None if it.seen else None,
        "seen": list(it.seen.words) if it.seen else [],
        "departure": estimate_document(it.departs.frequency) if it.departs else None,
        "realisations_differ": it.departs.differ if it.departs else None,
        "friction": _drag_numbers(it.drag) if it.drag else None,
        "departure_left_by_friction": it.explanation.left if it.explanation else None,
        "aside": [{"log": name, "errors": list(errors)} for name, errors in it.aside],
        "warnings": list(it.warnings),
    }


def _line_numbers(it: StraightLine) -> dict[str, Any]:
    band = {"kind": it.kind, "low_hz": it.low, "high_hz": it.high, "sign": it.sign}
    return {**band, "level": estimate_document(it.level), "value": estimate_document(it.value)}


def _drag_numbers(it: Drag) -> dict[str, Any]:
    several = {"mass": it.mass, "damping": it.damping, "stiffness": it.stiffness, "coulomb": it.coulomb}
    return {**{name: estimate_document(each) for name, each in several.items()}, "warnings": list(it.warnings)}


VIEW = KindView[Bench](
    "Frequency response",
    _facts,
    _numbers,
    lambda it, logs, name: response_figures(it, name),
    sentences=_sentences,
    headline=_headline,
    longest=True,
    prediction=PredictionView[tuple[float, ...]](
        worst=lambda errors: max(errors, default=np.nan),
        sentence=lambda errors: f"relative error of the response {_outputs(errors)}.",
        numbers=lambda errors: {"response_errors": list(errors)},
    ),
)
