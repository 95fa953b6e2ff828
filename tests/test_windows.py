"""Windows against friction that have an exit, a time to stay or a memory, beside equations by hand.

They are compared in continuous time and as a drive samples; what is said of hunting is compared with long runs.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from variants import gains, lugre, release, stage, there_and_back, van_dijk

import friso
from benchmarks.windows_by_hand import trace
from friso.equations import motion
from friso.equations.settings import gain_states
from friso.hunting import hunting as hunting_of
from friso.hunting.doubt import HuntingDoubt
from friso.stage import Stage
from friso.virtual_rig.run import run
from friso.virtual_rig.task import MoveTask

WINDOWS: dict[str, dict[str, Any]] = {
    "gain in the deadband": {"error_deadband": "300 um", "error_deadband_gain": 0.3},
    "deadband with exit": {"error_deadband": "150 um", "error_deadband_exit": "400 um"},
    "deadband with time": {"error_deadband": "400 um", "error_deadband_time": "10 ms", "error_deadband_gain": 0.1},
    "pause with time": {"integral_deadband": "300 um", "integral_deadband_time": "4 ms"},
    "decay": {"integral_deadband": "300 um", "integral_deadband_exit": "500 um", "integral_deadband_decay": "50 ms"},
    "inner gains": {
        **{"standstill_window": "300 um", "standstill_window_exit": "500 um", "standstill_window_time": "5 ms"},
        **{"standstill_factor": 0.5, "standstill_integral_factor": 2.0},
    },
    "freeze": {"freeze_window": "300 um"},
    "freeze with all": {"freeze_window": "400 um", "freeze_window_exit": "900 um", "freeze_window_time": "2 ms"},
    "no integral in moves": {"integral_rests_in_moves": True},
    "schedule over the error": {"schedule_error": ["0 um", "200 um", "600 um"], "schedule_factor": [0.3, 0.5, 1.2]},
    "schedule over the speed": {"schedule_speed": ["2 mm/s", "10 mm/s"], "schedule_factor": [1, 0.5]},
    "gains in moves": {"moving_factor": 0.6},
    "at rest": {"standstill_window": "800 um", "standstill_factor": 0.4, "windows_at_rest": True},
}

MOVE = there_and_back("0.5 s", "0.25 s", "2 m/s^2")


def machine(settings: dict[str, Any], how: str = MOVE) -> Stage:
    plain = stage(
        how, friction=lugre(2), controller=gains(2000.0, 20000.0, 50.0, extra='derivative_on = "measurement"')
    )
    return plain.replace({f"controller.{key}": value for key, value in settings.items()})


@pytest.mark.parametrize("how", [MOVE, release("2 mm", "0.4 s")], ids=["move", "release"])
@pytest.mark.parametrize("name", WINDOWS)
def test_a_trace_against_equations_by_hand(name: str, how: str) -> None:
    chosen, flat = machine(WINDOWS[name], how), machine(WINDOWS[name], how).flat()
    ours = friso.simulate(chosen, 1e-8, 1e-3)
    start = np.array([flat.get("motion.displacement", 0.0), 0.0, 0.0, 0.0])
    theirs = trace(flat, start, ours["time"].values, 5e-6)
    assert np.abs(ours["position"].values - theirs).max() < 2e-6


@pytest.mark.parametrize("name", WINDOWS)
def test_each_window_makes_a_difference(name: str) -> None:
    settled, plain = (
        friso.simulate(machine(settings), 1e-6, 1e-3)["position"].values for settings in (WINDOWS[name], {})
    )
    assert np.abs(settled - plain).max() > 2e-5


@pytest.mark.parametrize("name", WINDOWS)
def test_a_drive_against_difference_equations_by_hand(name: str) -> None:
    sample = 5e-4
    chosen = machine({**WINDOWS[name]}).replace({"drive.sample_time": "0.5 ms"})
    flat = chosen.flat()
    (recorded,) = run(chosen, MoveTask(motion.pieces(flat, 1)[0], 0.5), [1], 1e-3)
    ours = recorded.true["position"][0]
    theirs = trace(flat, np.zeros(4), np.arange(len(ours)) * 1e-3, 5e-6, sample)
    assert np.abs(ours - theirs).max() < 2e-6


@pytest.mark.parametrize(
    ("settings", "parts"),
    [
        ({"freeze_window_exit": "5 um"}, ["freeze_window", "belongs to freeze_window_exit"]),
        ({"error_deadband_time": "5 ms"}, ["error_deadband", "belongs to error_deadband_time"]),
        ({"integral_deadband_decay": "5 ms"}, ["integral_deadband", "belongs to integral_deadband_decay"]),
        ({"schedule_error": ["1 um", "2 um"]}, ["schedule_factor"]),
        ({"schedule_factor": [1, 2]}, ["schedule_error"]),
        ({"schedule_error": ["2 um", "1 um"], "schedule_factor": [1, 2]}, ["rising"]),
        ({"schedule_error": ["1 um", "2 um"], "schedule_factor": [1, 2, 3]}, ["as many values"]),
        ({"freeze_window": "9 um", "freeze_window_exit": "5 um"}, ["left at a larger error"]),
    ],
)
def test_what_is_wrong_is_told(settings: dict[str, Any], parts: list[str]) -> None:
    with pytest.raises(friso.StageError) as refused:
        machine(settings)
    assert all(part in str(refused.value) for part in parts), str(refused.value)


def test_an_integral_factor_needs_keys_for_the_integral() -> None:
    settings = {"standstill_window": "9 um", "standstill_factor": 0.5, "standstill_integral_factor": 0.2}
    by_rules = stage(MOVE, friction=lugre(2), controller=van_dijk())
    with pytest.raises(friso.StageError, match="standstill_integral_factor"):
        by_rules.replace({f"controller.{key}": value for key, value in settings.items()})


def test_margins_are_of_every_set_of_gains() -> None:
    settings = {**WINDOWS["inner gains"], **WINDOWS["schedule over the error"], "moving_factor": 0.5}
    states = gain_states(machine(settings).flat())
    assert [state["controller.kp"] / 2000.0 for state in states] == pytest.approx(
        [1.2, 0.6, 0.25, 0.15, 0.5, 0.3, 0.15]
    )
    assert states[-1]["controller.ki"] == pytest.approx(20000.0 * 0.3 * 2.0)
    assert not any("schedule" in key for state in states for key in state)


def test_cycles_are_as_stable_as_runs_beside_them_show() -> None:
    """Deviations are carried through the switches: multipliers of orbits against the growth in runs."""
    for name in ("deadband with time", "inner gains", "schedule over the error"):
        cycle = hunting_of(machine(WINDOWS[name], release("2 mm", "40 s"))).cycles[0]
        assert cycle.multiplier == pytest.approx(cycle.growth, abs=2e-3)


@pytest.mark.inner
def test_without_an_integral_a_switched_force_leaves_the_answer_open() -> None:
    """A dead zone that is left later than it is entered takes force away where it would brake."""
    plain = machine({"error_deadband": "100 um"}).replace({"controller.ki": "0 N/(m*s)"})
    switched = plain.replace({"controller.error_deadband_exit": "300 um"})
    assert hunting_of(plain).certain
    assert (hunting_of(switched).certain, hunting_of(switched).reason) == (False, HuntingDoubt.SWITCHES)


@pytest.mark.parametrize("name", ["deadband with exit", "freeze", "inner gains", "decay"])
def test_what_is_said_of_hunting_is_what_a_long_run_by_hand_does(name: str) -> None:
    chosen = machine(WINDOWS[name], release("2 mm", "40 s"))
    said = hunting_of(chosen)
    times = np.append(0.0, np.arange(30.0, 40.0, 2e-3))
    late = trace(chosen.flat(), np.array([2e-3, 0.0, 0.0, 0.0]), times, 2e-5)[1:]
    swing = np.ptp(late) / 2
    sizes = [one.amplitude for one in (*said.attracting, *said.observed)]
    assert said.certain
    assert min(abs(size / swing - 1) for size in sizes) < 5e-3 if sizes else swing < 1e-7
