"""Sweeps: cells against runs alone, structures mixed in one sweep, cells that no stage may have."""

from pathlib import Path

import numpy as np
import pytest

import friso
from friso.stage import Stage, StageError

EXAMPLES = Path(__file__).parent.parent / "examples"

pytestmark = pytest.mark.xdist_group("rig")


@pytest.fixture(scope="module")
def rig() -> Stage:
    return friso.load(EXAMPLES / "thesis_rig.toml")


def test_cells_equal_runs_alone(rig: Stage) -> None:
    """Any cell, run alone as a stage of its own, gives the same numbers bit for bit."""
    runs = friso.sweep(
        rig, {"joint.locked": [True, False], "controller.crossover": (np.array([4.0, 8.0, 20.0]), "Hz")}, rtol=1e-6
    )
    assert runs.peaks.dims == ("joint.locked", "controller.crossover")
    assert runs["controller.crossover"].attrs["units"] == "Hz"
    for locked in (True, False):
        for crossover in (4.0, 8.0, 20.0):
            cell = runs.sel({"joint.locked": locked, "controller.crossover": crossover})
            alone = rig.replace({"joint.locked": locked, "controller.crossover": f"{crossover} Hz"})
            case = friso.check(alone)["given"]
            assert (cell.verdict.item(), cell.peaks.item()) == (case.verdict, case.peaks)
            assert cell.peak_to_peak.item() == case.peak_to_peak
            assert cell.largest_force.item() == case.largest_force
            assert cell.steps.item() == case.solver.steps


def test_a_defaulted_tuned_mass_follows_a_swept_mass(rig: Stage) -> None:
    light = rig.replace({"joint.locked": True, "controller.tuned_mass": None})
    swept = friso.sweep(light, {"masses.cart": ["1.2 kg", "2.4 kg"]})
    alone = friso.check(light.replace({"masses.cart": "2.4 kg"}), rtol=1e-4)["given"]
    assert swept.largest_force.values[1] == alone.largest_force
    assert swept.largest_force.values[1] > 1.5 * swept.largest_force.values[0]


def test_impossible_cells_are_marked_and_the_others_run(rig: Stage) -> None:
    runs = friso.sweep(rig.replace({"joint.locked": True}), {"friction.static": ["0.5 N", "3 N"]})
    assert runs.verdict.values.tolist() == ["invalid", "hunts"]
    assert "friction.coulomb" in runs.status.values[0]
    assert np.isnan(runs.peaks.values[0])
    assert runs.status.values[1] == "done"


@pytest.mark.parametrize(
    ("axes", "message"),
    [
        ({"controller.crosover": ["8 Hz"]}, "did you mean crossover"),
        ({"controller.crossover": ["8 N"]}, "Hz"),
        ({"controller.crossover": (np.linspace(1, 2, 3), "N")}, "Hz"),
        ({"controller.crossover": []}, "no values"),
        ({"controller.crossover": (np.array([1.0, np.nan]), "Hz")}, "finite"),
        ({"controller.alpha": (np.array([0.1]), "Hz")}, "no unit"),
        ({"joint.locked": []}, "no values"),
        ({"joint.locked": ["perhaps"]}, "joint.locked"),
    ],
)
def test_wrong_axes_are_refused(rig: Stage, axes: dict, message: str) -> None:
    with pytest.raises(StageError, match=message):
        friso.sweep(rig, axes)
