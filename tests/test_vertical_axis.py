"""A vertical axis: its weight is a constant force, which the actuator carries before anything moves."""

from __future__ import annotations

import numpy as np
import pytest

import friso
from friso.stage import Stage

WEIGHT = 20.0
CONTROLLERS = {
    "pid": {"kind": "pid", "crossover": "20 Hz", "alpha": 0.1, "beta": 2},
    "cascade": {"kind": "cascade", "kv": "30 1/s", "kp": "250 N*s/m", "velocity_integral_time": "20 ms"},
    "adrc": {"kind": "adrc", "bandwidth": "10 Hz", "observer_ratio": 5},
    "transfer function": {"kind": "transfer_function", "numerator": [2e5, 2.4e7, 2.4e8], "denominator": [1, 400, 0]},
}
AS_BUILT = {"sample_time": "100 us", "delay": "100 us"}


def axis(controller: dict, weight: float = WEIGHT, **tables: dict) -> Stage:
    """The thesis's rig as a rigid vertical axis that counts upwards, held at its reference."""
    rig = friso.load(friso.example("thesis_rig"))
    hold = {"joint": None, "parasitic": None, "motion": {"kind": "hold", "duration": "1 s"}}
    return rig.replace({**hold, "bias": {"stage": f"{-weight} N"}, "controller": controller, **tables})


@pytest.mark.parametrize("drive", [{}, {"drive": AS_BUILT}], ids=["continuous", "as built"])
@pytest.mark.parametrize("name", CONTROLLERS)
def test_a_held_axis_stays_where_it_is(name: str, drive: dict) -> None:
    run = friso.simulate(axis(CONTROLLERS[name], **drive)).data
    assert np.abs(run.position).max() < 1e-9
    assert run.force.values == pytest.approx(WEIGHT, rel=1e-6)


@pytest.mark.parametrize("drive", [{}, {"drive": AS_BUILT}], ids=["continuous", "as built"])
def test_without_an_integral_the_weight_is_carried_by_the_error(drive: dict) -> None:
    stiff = {"kind": "pid", "kp": "20 N/mm", "kd": "300 N*s/m", "tau": "1 ms"}
    run = friso.simulate(axis(stiff, **drive)).data
    assert run.position.values == pytest.approx(-WEIGHT / 20e3, rel=1e-6)


def test_a_weight_changes_nothing_of_a_move() -> None:
    """The integral carries it, and everything else is as on a level axis."""
    move = {
        "kind": "there_and_back",
        "acceleration": "10 m/s^2",
        "acceleration_time": "30 ms",
        "return_at": "1 s",
        "duration": "2 s",
    }
    level, vertical = (friso.simulate(axis(CONTROLLERS["pid"], weight, motion=move)).data for weight in (0.0, WEIGHT))
    assert np.abs(vertical.position - level.position).max() < 1e-7
    assert (vertical.force - level.force).values == pytest.approx(WEIGHT, rel=1e-3)
