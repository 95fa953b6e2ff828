"""What slow records leave open, and machines drawn from what is left open."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from friso.identification.doubts import quality_of
from friso.identification.estimate import Estimate
from friso.identification.inverse_model import FilteredMotion, inverse_model
from friso.identification.output_error.drawn import DRAWS, drawn_from
from friso.identification.output_error.parameters import MASS, RATIO, FitParameter
from friso.identification.quality import Quality
from friso.identification.readings.common import record
from friso.identification.slow_records import without_what_is_too_slow
from friso.identification.stage_file import made_up

FLAT = {"friction.stribeck_velocity": 1e-3, "axis.kind": "linear"}
MASSES = Estimate.normal("masses.cart", "kg", 3.0, 0.1, "drawn")
COULOMB = Estimate.normal("friction.coulomb", "N", 8.0, 0.1, "drawn")
UNKNOWN = Estimate.unknown("friction.stribeck_velocity", "m/s", "drawn", "not covered")
STRIBECK = Estimate.normal("friction.stribeck_velocity", "m/s", 1e-3, 1e-5, "drawn")


def shown(estimates: tuple[Estimate, ...], top: float, left: float) -> set[str]:
    """What is left of estimates of a sine of this highest speed [m/s] at 1 Hz, of which `left` [N] is unexplained."""
    time = np.linspace(0, 10, 1000)
    moved = FilteredMotion(time, top * np.cos(2 * np.pi * time), -2 * np.pi * top * np.sin(2 * np.pi * time))
    quality = Quality(1e-3, left, 1e-3, 0.1, 0.1)
    size = sum(estimate.determined for estimate in estimates)
    counted = np.ones(len(time), dtype=bool)
    kept, correlation = without_what_is_too_slow(estimates, np.eye(size), FLAT, moved, counted, quality, "N")
    names = {estimate.name for estimate in kept if estimate.determined}
    assert len(correlation) == len(names)
    return names


def test_friction_at_slow_speeds_alone_is_no_coulomb_friction() -> None:
    assert shown((MASSES, COULOMB, UNKNOWN), 1e-3, 1e-3) == {"masses.cart"}
    assert shown((MASSES, COULOMB, STRIBECK), 1e-3, 1e-3) == {"masses.cart", COULOMB.name, STRIBECK.name}
    assert shown((MASSES, COULOMB, UNKNOWN), 0.1, 1e-3) == {"masses.cart", COULOMB.name}


def test_an_inertia_below_what_is_left_shows_no_mass() -> None:
    inertia = 3.0 * 2 * np.pi * 0.1 / np.sqrt(2)
    assert shown((MASSES, COULOMB, STRIBECK), 0.1, 0.9 * inertia) >= {"masses.cart"}
    assert "masses.cart" not in shown((MASSES, COULOMB, STRIBECK), 0.1, 1.1 * inertia)


def test_machines_are_drawn_from_intervals_and_from_what_is_left() -> None:
    static = Estimate.unknown("friction.static", "N", "drawn", "not covered", 8.0, 32.0)
    parameters = [
        FitParameter(MASS, "kg", 3.0, 0.6, 15.0),
        FitParameter("friction.coulomb", "N", 8.0, 1.0, 40.0),
        FitParameter(RATIO, "", 1.0, 1.0, 4.0, logarithmic=False),
        FitParameter("friction.viscous", "N*s/m", 5.0, 0.0, 50.0, logarithmic=False),
    ]
    inner = np.array([np.log(3.0), np.log(8.0), 1.0, 5.0])
    rows = drawn_from((MASSES, COULOMB, static), np.eye(2), parameters, inner)
    assert rows.shape == (DRAWS, 4)
    assert np.ptp(rows[:, 0]) > 0
    assert MASSES.low <= np.exp(rows[:, 0]).min() <= np.exp(rows[:, 0]).max() <= MASSES.high
    assert rows[:, 2].min() < 1.5
    assert rows[:, 2].max() > 2.5
    assert (rows[:, 3] == 5.0).all()


@pytest.mark.parametrize(("left", "failed"), [(1.0, False), (15.0, True)])
def test_a_record_that_the_whole_model_alone_describes_is_described(left: float, failed: bool) -> None:
    """A force that the inverse model cannot know, as that of a stage that sticks: what counts is what the fit leaves,
    and no cause is named that explains less."""
    time = np.arange(8000) * 1e-3
    position = 0.05 * np.sin(2 * np.pi * 0.5 * time)
    force = 11.0 * np.sign(np.cos(2 * np.pi * 0.5 * time)) + 20.0 * np.sin(2 * np.pi * 3.1 * time)
    log = record("axis", 1e-3, position=position, force=force)
    inverse = inverse_model(log)
    stage, problem = made_up(log, inverse).flat(), SimpleNamespace(passes=1.0, closed=False)
    fit: Any = SimpleNamespace(left=left, problem=problem, stage=stage, explains=lambda noise: False)
    quality = quality_of(log, inverse, fit, 0.05, 0.0)
    assert quality.failed == failed
    assert not quality.rejected
    assert failed or not quality.without
