"""Windows against friction that have an exit, a time to stay or a memory, beside equations by hand.

They are compared in continuous time and as a drive samples; what is said of hunting is compared with long runs.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from variants import gains, lugre, release, stage, there_and_back

import friso
from benchmarks.windows_by_hand import trace
from friso.equations import motion
from friso.hunting import hunting as hunting_of
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
    "at rest": {"standstill_window": "800 um", "standstill_factor": 0.4, "windows_at_rest": True},
}

MOVE = there_and_back("0.5 s", "0.25 s", "2 m/s^2")


def machine(settings: dict[str, Any], how: str = MOVE) -> Stage:
    plain = stage(how, friction=lugre(2), controller=gains(2000.0, 20000.0, 50.0, extra='derivative_on = "measurement"'))
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
    settled, plain = (friso.simulate(machine(settings), 1e-6, 1e-3)["position"].values for settings in (WINDOWS[name], {}))
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
