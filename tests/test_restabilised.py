"""Windows of bandwidths far beyond an edge in which a cycle that repels attracts again, next to the fold of its branch,
against simulations that begin beside the cycle."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from variants import VARIANTS

from friso.engine.allowance import allowance
from friso.equations.bandwidth import faster
from friso.hunting import BandwidthWindow, Ensemble
from friso.hunting.cycle.find import symmetric_cycles
from friso.hunting.cycle.swings import swings
from friso.hunting.margin import NOT_SOUGHT, followed_on, search_bandwidths
from friso.hunting.restabilised import windows_again
from friso.stage import Stage

pytestmark = pytest.mark.inner

TABLE = Stage(
    axis={"kind": "rotary"},
    masses={"stage": "0.06 kg*m^2"},
    friction={
        "model": "lugre",
        "static": "1.6 N*m",
        "coulomb": "1.1 N*m",
        "stribeck_velocity": "0.02 rad/s",
        "stribeck_exponent": 2,
        "bristle_stiffness": "5e3 N*m/rad",
        "bristle_damping": "8 N*m*s/rad",
        "viscous": "0.4 N*m*s/rad",
    },
    controller={"kind": "pid", "crossover": "12 Hz", "alpha": 0.1, "beta": 2, "force_limit": "30 N*m"},
    motion={
        "kind": "there_and_back",
        "acceleration": "40 rad/s^2",
        "acceleration_time": "0.1 s",
        "return_at": "3 s",
        "duration": "12 s",
    },
)
"""Hunts below 9.425 Hz, and again from 10.9026 to 10.9253 Hz, where its symmetric cycle folds."""


@cache
def window_of_table() -> BandwidthWindow:
    (window,) = windows_again(TABLE.flat(), 9.52 / 12, 10.0, ())
    return window


def ends(window: BandwidthWindow) -> tuple[float, float]:
    assert window.low is not None
    assert window.high is not None
    return window.low.inside, window.high.inside


def share_left(factor: float, beside: float) -> float:
    """What is left of the swing of the stage at a factor of its bandwidth after 400 half periods from a state that is a
    share `beside` the cycle of the middle of the window."""
    middle = sum(ends(window_of_table())) / 2
    cycle = symmetric_cycles(Ensemble.held(faster(TABLE.flat(), np.array([middle])), 1))
    stages = Ensemble.held(faster(TABLE.flat(), np.array([factor])), 1)
    seen = swings(stages, cycle.states * (1 + beside), 400 * cycle.orbits.times, 1600, 1e-9)
    heights = np.abs(seen.values[0][np.isfinite(seen.values[0])])
    return float(heights[-1] / cycle.amplitude[0])


def test_the_window_of_a_table() -> None:
    window = window_of_table()
    assert [12 * end for end in ends(window)] == pytest.approx([10.9026, 10.9253], abs=2e-4)
    assert window.holds(10.91 / 12)
    assert not window.holds(10.93 / 12)
    assert not window.narrow


@pytest.mark.parametrize("beside", [1e-3, -1e-3])
def test_simulations_swing_on_within_it_alone(beside: float) -> None:
    low, high = ends(window_of_table())
    assert share_left((low + high) / 2, beside) == pytest.approx(1, abs=1e-6)
    assert share_left(1.001 * high, beside) < 0.1
    assert share_left(0.99 * low, beside) < 0.1


@pytest.mark.parametrize(("crossover", "attracting"), [(8.0, True), (10.0, False)])
def test_it_is_found_from_a_stage_that_hunts_and_from_one_that_does_not(crossover: float, attracting: bool) -> None:
    stage = TABLE.replace({"controller.crossover": f"{crossover} Hz"})
    sought = search_bandwidths(stage, attracting)
    (window,) = followed_on(stage, sought).windows
    assert [crossover * end for end in ends(window)] == pytest.approx(
        [12 * e for e in ends(window_of_table())], rel=1e-5
    )
    assert sought.margin is not None
    assert sought.margin.crossover == pytest.approx(9.42501, rel=1e-4)


def test_windows_are_told_once() -> None:
    assert windows_again(TABLE.flat(), 9.52 / 12, 10.0, (window_of_table(),)) == ()


def test_what_no_allowance_suffices_for_is_left_out() -> None:
    with allowance(1e6):
        assert windows_again(TABLE.flat(), 9.52 / 12, 10.0, ()) == ()


def test_a_window_narrower_than_bandwidths_are_held() -> None:
    """Of the thesis's rig, locked: 0.0025 % of the bandwidth, at twice the crossover of the rig."""
    (window,) = followed_on(VARIANTS["locked"], replace(NOT_SOUGHT, last_returns=((1.2309, 10.0),))).windows
    assert window.narrow
    assert window.holds(2.02737)


def test_a_cycle_that_attracts_to_the_end_of_the_search_has_no_upper_end() -> None:
    low, high = ends(window_of_table())
    (cut,) = windows_again(TABLE.flat(), 9.52 / 12, (low + high) / 2, ())
    assert cut.low is not None
    assert cut.low.inside == pytest.approx(low, rel=1e-5)
    assert cut.high is None
    assert not cut.narrow
