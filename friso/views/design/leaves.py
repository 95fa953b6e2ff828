"""The leaf springs of a design in words: their numbers, what binds them, and how beams confirm the closed forms."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from friso.design.method import Design
from friso.design.requirements import Requirement, Way
from friso.views.design.words import Step, hertz, leaves, percent, plain, size
from friso.views.drawing.prefixes import listed
from friso.views.flexure.table import megapascals, newtons_per
from friso.views.flexure.words import assumptions

BINDS = 0.95
"""Share of what is required from which on a requirement is said to bind."""


def leaves_step(found: Design) -> Step:
    """Which leaf springs, and why these."""
    said = (_interfering(found), _strength(found), _why(found), _confirmed(found), *assumptions(found.stage))
    figures = ("design_front", "design_modes")
    return Step(f"Leaf springs: {leaves(found)}", said, (*_sizes(found), *_numbers(found)), figures)


def requirement_rows(found: Design) -> list[tuple[str, str, str, str]]:
    """The requirements: name, keys of the specification that relax it, their values, and how much of it is used."""
    choice = found.fitted.choice
    return [
        (
            each.name,
            _keys(each, lambda way: way.key),
            _keys(each, lambda way: plain(way.value, way.unit)),
            f"{100 * share:.1f} %{', binds' if share > BINDS else ''}",
        )
        for each, share in zip(choice.requirements, choice.excess, strict=True)
    ]


def _keys(it: Requirement, text: Callable[[Way], str]) -> str:
    return ", ".join(map(text, it.ways))


def _sizes(found: Design) -> tuple[tuple[str, str], ...]:
    it = found.fitted.choice.geometry
    return (
        ("Leaves", f"{it.sheet.leaves:g} of {it.sheet.material}"),
        ("Length, width, thickness", f"{size(it.length)}, {size(it.width)}, {size(it.sheet.thickness)} mm"),
        ("Spacing", f"{size(it.spacing)} mm"),
    )


def _numbers(found: Design) -> tuple[tuple[str, str], ...]:
    choice, it = found.fitted.choice, found.fitted.choice.beams
    return (
        ("Drive stiffness, by beams", newtons_per(it.drive[0], "mm")),
        ("First interfering frequency, by beams", hertz(choice.frequency)),
        ("Stress at the clamps at full stroke", megapascals(it.clamp_stress)),
        ("Margin to yield, to fatigue", f"{it.yield_margin:.3g} times, {_factor(it.fatigue_margin)}"),
        ("Buckling load", plain(it.buckling, "N")),
        ("Load along the leaves, weight included", f"{found.fitted.task.load:.3g} N"),
        (
            "Support stiffness at full stroke, x and y",
            f"{newtons_per(it.support_x[-1], 'µm')}, {newtons_per(it.support_y[-1], 'µm')}",
        ),
        ("Shortening at full stroke", plain(it.shortening, "m")),
    )


def _interfering(found: Design) -> str:
    choice, multiple = found.fitted.choice, found.spec.safety.parasitic
    mode = choice.beams.interfering
    if mode is None:
        return f"None of the modes looked at interferes with control ({multiple:g} times the crossover is required)."
    return (
        f"The first mode that interferes with control is {mode.name}, at {hertz(mode.frequency)}: "
        f"{mode.frequency / found.controller.crossover:.3g} times the crossover ({multiple:g} required)."
    )


def _strength(found: Design) -> str:
    it, load, safety = found.fitted.choice.beams, found.fitted.task.load, found.spec.safety
    fatigue = "" if math.isnan(it.fatigue_margin) else f" and {_factor(it.fatigue_margin)} below fatigue"
    required = "" if math.isnan(it.fatigue_margin) else f" and {safety.fatigue:g}"
    margin = it.buckling / load
    forms = ", met by the closed forms" if margin < safety.buckling else ""
    return (
        f"Bent by the stroke alone, the clamps bear {megapascals(it.clamp_stress)}, {it.yield_margin:.3g} times below "
        f"yield{fatigue} ({safety.strength:g}{required} required). The leaves buckle at {plain(it.buckling, 'N')}, "
        f"{margin:.3g} times the {load:.3g} N that they carry ({safety.buckling:g} required{forms})."
    )


def _why(found: Design) -> str:
    """What made these leaves and no others."""
    choice = found.fitted.choice
    binding = [each.name for each, share in zip(choice.requirements, choice.excess, strict=True) if share > BINDS]
    chosen = "They are the softest of the front that allow this crossover"
    if not binding:
        return f"{chosen}; no requirement binds but space and sheets."
    return f"{chosen}; what binds (less than 5 % to spare): {listed(binding, 'and')}."


def _confirmed(found: Design) -> str:
    """How beams see the front."""
    tried = found.confirmed
    failed = sum(bool(each.failure) for each in tried)
    known = [each for each in tried if not each.failure]
    off = [abs(each.stiffness / each.candidate.stiffness - 1) for each in known]
    off += [abs(each.frequency / each.candidate.frequency - 1) for each in known if math.isfinite(each.frequency)]
    apart = f", within {percent(max(off))} of the closed forms" if off else ""
    broken = f"; {failed} could not be computed" if failed else ""
    passed = len(found.fitted.choice.passed_over)
    over = f" {passed} softer ones fell short by beams and were passed over." if passed else ""
    return (
        f"Of the {len(found.candidates)} geometries on the front beams confirm {len(known)} of {len(tried)} "
        f"tried{apart}{broken}.{over}"
    )


def _factor(value: float) -> str:
    return f"{value:.3g} times" if np.isfinite(value) else "unknown"
