"""What constant speed on the rig shows of dynamic friction, and what it does not (thesis, Fig. 21)."""

from __future__ import annotations

from typing import Any

import numpy as np

from friso.studies.rig.constant_speed import ConstantSpeed, Passes
from friso.studies.rig.outcome import Outcome
from friso.views.figure import BLUE, VERMILLION, Axis, Figure, Panel, Series
from friso.views.prefixes import listed, with_unit


def sentences(outcome: Outcome) -> list[str]:
    """What was found."""
    found: ConstantSpeed = outcome.result
    said = [f"Joint {each.name}: {each.place.verdict}" for each in found.cases]
    for each in found.cases:
        coulomb = each.velocity.both.coulomb
        told = with_unit(coulomb.value, "N") if coulomb.shown else f"not shown ({coulomb.reason})"
        said.append(f"Joint {each.name}: Coulomb friction {told}.")
    true = listed(
        [
            f"{with_unit(float(force), 'N')} at {with_unit(speed, 'm/s')}"
            for force, speed in zip(found.cases[0].true, found.speeds, strict=True)
        ],
        "and",
    )
    return [*said, f"The dynamic friction along the way is truly {true} on average."]


def figures(outcome: Outcome) -> list[Figure]:
    """Force against position at both speeds, a column for each state of the joint."""
    found: ConstantSpeed = outcome.result
    panels = tuple(
        Panel(
            f"joint {each.name}",
            Axis("Position", "m"),
            Axis("Force", "N"),
            tuple(_lines(each, found.speeds)),
        )
        for each in found.cases
    )
    caption = "Commanded force, averaged over places, on the way there; the way back goes with it in the log."
    title = "Force at constant speed"
    return [
        Figure("rig_constant_speed", title, caption, panels, columns=1, subject=outcome.stage.name),
    ]


def _lines(each: Passes, speeds: tuple[float, ...]) -> list[Series]:
    """The forward passes."""
    forward = [one for one in each.place.passes if one.velocity > 0]
    return [
        Series(one.places, one.force, with_unit(speed, "m/s"), colour)
        for one, speed, colour in zip(forward, speeds, (BLUE, VERMILLION), strict=False)
    ]


def numbers(outcome: Outcome) -> dict[str, Any]:
    """As JSON."""
    found: ConstantSpeed = outcome.result
    return {"speeds_m_per_s": [*found.speeds], "cases": {each.name: _numbers(each) for each in found.cases}}


def _numbers(each: Passes) -> dict[str, Any]:
    coulomb = each.velocity.both.coulomb
    return {
        "separated": each.place.separated,
        "verdict": each.place.verdict,
        "repeatability": each.place.repeatability.value,
        "passes": [
            {"velocity_m_per_s": one.velocity, "mean_force_n": one.mean.value, "deviation_n": one.spread}
            for one in each.place.passes
        ],
        "coulomb_n": coulomb.value,
        "coulomb_reason": coulomb.reason,
        "true_dynamic_friction_n": np.asarray(each.true).tolist(),
    }
