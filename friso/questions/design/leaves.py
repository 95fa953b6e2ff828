"""Describe the leaf springs of a design in words.

The words cover their numbers, the requirements that limit them, and how closely the beam model confirms the closed
forms.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from friso.design_method.method import Design
from friso.design_method.requirements import RelaxableKey, Requirement
from friso.quantities import percent, plain_factor
from friso.questions.design.words import DesignStep, hertz, leaves, size, trimmed
from friso.questions.flexure.table import megapascals, newtons_per
from friso.questions.flexure.words import assumptions
from friso.shown.drawing.prefixes import listed

BINDS = 0.95
"""Fraction of a requirement's bound from which the requirement is called binding."""


def leaves_step(design: Design) -> DesignStep:
    """Return the step that chooses the leaf springs, with reasons."""
    sentences = (_interfering(design), _strength(design), _why(design), _confirmed(design), *assumptions(design.stage))
    figures = ("design_front", "design_modes")
    return DesignStep(f"Leaf springs: {leaves(design)}", sentences, (*_sizes(design), *_numbers(design)), figures)


def requirement_rows(design: Design) -> list[tuple[str, str, str, str]]:
    """Return a row for each requirement: its name, the keys that relax it, and their values.

    The last text of a row is the fraction of the requirement that the leaves use up.
    """
    choice = design.fitted.choice
    return [
        (
            requirement.name,
            _keys(requirement, lambda relaxable: relaxable.key),
            _keys(requirement, lambda relaxable: trimmed(relaxable.value, relaxable.unit)),
            f"{percent(share, 3)}{', binds' if share > BINDS else ''}",
        )
        for requirement, share in zip(choice.requirements, choice.excess, strict=True)
    ]


def _keys(requirement: Requirement, text: Callable[[RelaxableKey], str]) -> str:
    """Describe by `text` each key whose change relaxes a requirement, and join the descriptions."""
    return ", ".join(map(text, requirement.keys))


def _sizes(design: Design) -> tuple[tuple[str, str], ...]:
    """Return the dimensions of the leaf springs by name."""
    geometry = design.fitted.choice.geometry
    return (
        ("Leaves", f"{geometry.sheet.leaves:g} of {geometry.sheet.material}"),
        (
            "Length, width, thickness",
            f"{size(geometry.length)}, {size(geometry.width)}, {size(geometry.sheet.thickness)} mm",
        ),
        ("Spacing", f"{size(geometry.spacing)} mm"),
    )


def _numbers(design: Design) -> tuple[tuple[str, str], ...]:
    """Return stiffness, frequency, stress and margins of the leaf springs by name."""
    choice, beams = design.fitted.choice, design.fitted.choice.beams
    return (
        ("Drive stiffness, by beams", newtons_per(beams.drive[0], "mm")),
        ("First interfering frequency, by beams", hertz(choice.frequency)),
        ("Stress at the clamps at full stroke", megapascals(beams.clamp_stress)),
        ("Margin to yield, to fatigue", f"{plain_factor(beams.yield_margin)} times, {_factor(beams.fatigue_margin)}"),
        ("Buckling load", trimmed(beams.buckling, "N")),
        ("Load along the leaves, weight included", f"{design.fitted.task.load:.3g} N"),
        (
            "Support stiffness at full stroke, x and y",
            f"{newtons_per(beams.support_x[-1], 'µm')}, {newtons_per(beams.support_y[-1], 'µm')}",
        ),
        ("Shortening at full stroke", trimmed(beams.shortening, "m")),
    )


def _interfering(design: Design) -> str:
    """Name the first mode that interferes with control, and its distance from the crossover."""
    choice, multiple = design.fitted.choice, design.spec.safety.parasitic
    mode = choice.beams.interfering
    if mode is None:
        return f"None of the modes considered interferes with control ({multiple:g} times the crossover is required)."
    return (
        f"The first mode that interferes with control is {mode.name}, at {hertz(mode.frequency)}: "
        f"{plain_factor(mode.frequency / design.controller.crossover)} times the crossover ({multiple:g} required)."
    )


def _strength(design: Design) -> str:
    """Write stress, strength margins and buckling load, with what is required."""
    beams, load, safety = design.fitted.choice.beams, design.fitted.task.load, design.spec.safety
    fatigue = "" if math.isnan(beams.fatigue_margin) else f" and {_factor(beams.fatigue_margin)} below fatigue"
    required = "" if math.isnan(beams.fatigue_margin) else f" and {safety.fatigue:g}"
    margin = beams.buckling / load
    forms = ", met by the closed forms" if margin < safety.buckling else ""
    return (
        f"With the stroke alone, the stress at the clamps is {megapascals(beams.clamp_stress)}, "
        f"{beams.yield_margin:.3g} "
        f"times below yield{fatigue} ({safety.strength:g}{required} required). The leaves buckle at "
        f"{trimmed(beams.buckling, 'N')}, {plain_factor(margin)} times the {load:.3g} N that they carry "
        f"({safety.buckling:g} required{forms})."
    )


def _why(design: Design) -> str:
    """Say which requirements led to these leaves."""
    choice = design.fitted.choice
    binding = [
        requirement.name for requirement, share in zip(choice.requirements, choice.excess, strict=True) if share > BINDS
    ]
    chosen = "They are the softest on the front that allow this crossover"
    if not binding:
        return f"{chosen}; no requirement is binding except space and available thicknesses."
    return f"{chosen}; binding requirements (less than 5 % to spare): {listed(binding, 'and')}."


def _confirmed(design: Design) -> str:
    """Say how many leaf springs the beam model confirms, and how close the closed forms are."""
    tried = design.confirmed
    failed = sum(bool(confirmation.failure) for confirmation in tried)
    confirmed = [confirmation for confirmation in tried if not confirmation.failure]
    off = [abs(confirmation.stiffness / confirmation.candidate.stiffness - 1) for confirmation in confirmed]
    off += [
        abs(confirmation.frequency / confirmation.candidate.frequency - 1)
        for confirmation in confirmed
        if math.isfinite(confirmation.frequency)
    ]
    apart = f", within {percent(max(off))} of the closed forms" if off else ""
    broken = f"; {failed} could not be computed" if failed else ""
    passed = len(design.fitted.choice.passed_over)
    over = f" {passed} softer ones failed in the beam model and were skipped." if passed else ""
    return (
        f"Of the {len(design.candidates)} geometries on the front the beam model confirms {len(confirmed)} of "
        f"{len(tried)} "
        f"tried{apart}{broken}.{over}"
    )


def _factor(value: float) -> str:
    """Write a margin as a factor; "unknown" if it is not finite."""
    return f"{plain_factor(value)} times" if np.isfinite(value) else "unknown"
