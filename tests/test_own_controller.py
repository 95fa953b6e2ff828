"""A controller from one file, of which friso knows nothing else, through every command."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import own_controller
import pandas as pd
import pytest
from inside import friso_inside
from patched import patched

import friso
from friso.engine.arrays import Status
from friso.equations.bandwidth import bandwidth, faster
from friso.equations.continuous import slow_gains
from friso.equations.structure import structure
from friso.frequency import bode
from friso.identification.output_error.problem import loop_problem
from friso.identification.readings.common import record
from friso.remedies import method
from friso.remedies.catalogue import remedies
from friso.remedies.search import Budget
from friso.stage import Stage, save

EXAMPLE = Path(__file__).parents[1] / "examples" / "thesis_drive.toml"
CONTROLLER = {"kind": "pi-d", "bandwidth": "6 Hz", "mass": "1.7 kg", "force_limit": "200 N"}
COARSE = {"drive.sample_time": "250 us", "drive.delay": "250 us"}
"""A drive that costs a fifth, with the same equations: one sample of delay."""

BANDWIDTH = own_controller.PiDLead.bandwidth_key
EDGE = 10.07
"""Bandwidth [Hz] from which the locked stage does not hunt any more: found by `check`, `boundary` and `map` alike."""


@pytest.fixture(scope="module")
def whole() -> Stage:
    return friso.load(EXAMPLE).replace({**COARSE, "controller": CONTROLLER})


@pytest.fixture(scope="module")
def locked(whole: Stage) -> Stage:
    return whole.replace({"joint.locked": True, "parasitic": None})


def test_it_is_written_and_read(whole: Stage) -> None:
    assert isinstance(whole.controller, own_controller.PiDLead)
    assert friso.loads(whole.to_toml()) == whole
    assert bandwidth(whole.flat()) == 6.0
    assert faster(whole.flat(), 2.0)[BANDWIDTH] == 12.0
    assert structure(whole.flat()) != structure(whole.replace({"controller.force_limit": None}).flat())


def test_its_slow_gains_are_those_of_its_formula(whole: Stage) -> None:
    stiffness = 4 * 1.7 * 6.0**2 * 9
    assert slow_gains(whole.flat()) == pytest.approx((stiffness, stiffness * 2 * np.pi * 6.0 / 4))


def test_both_realisations_agree_on_a_slow_motion(whole: Stage) -> None:
    """One realisation is what the drive commands at its samples, the other the force in continuous time."""
    run = friso.simulate(whole.replace({"joint.locked": True, "motion": {**SLOW}}), 1e-8, 250e-6, continuous=True)
    names = {"reference", "position", "force", "force_p", "force_i", "force_d"}
    assert names <= {*map(str, run)}
    assert run.attrs["status"] == Status.DONE.text
    shares = sum(run[f"force_{share}"].values for share in "pid")
    assert np.abs(run["force"].values - np.clip(shares, -200, 200)).max() < 1e-9
    assert run["force_i"].attrs["long_name"] == "integral share"
    assert run["force_p"].attrs["long_name"] == "spring share"


SLOW = {"kind": "there_and_back", "duration": "2 s", "acceleration": "1 m/s^2", "acceleration_time": "0.2 s",
        "return_at": "1 s"}  # fmt: skip


def answer(folder: Path, stage: Stage, command: str, *arguments: object, status: int = 0) -> dict[str, Any]:
    """The JSON document of a command, called with the file of a stage."""
    save(stage, folder / "stage.toml")
    run = friso_inside(folder, command, "stage.toml", *arguments, "--json")
    assert run.returncode == status, run.stderr
    return json.loads(run.stdout)


@pytest.mark.thorough
def test_check(locked: Stage, tmp_path: Path) -> None:
    """The multiplier of its cycle is that of a simulation; the remedy names its own key and value."""
    document = answer(tmp_path, locked, "check")
    case = document["cases"]["given"]
    assert case["verdict"] in ("hunts", "bistable")
    assert case["cycle"]["growth"] == pytest.approx(case["cycle"]["multiplier"], rel=1e-3)
    assert case["margin"]["crossover_hz"] == pytest.approx(EDGE, rel=2e-3)
    assert case["margin"]["factor"] == pytest.approx(EDGE / 6.0, rel=2e-3)
    factor = next(word for word in document["conclusion"].split() if word.replace(".", "", 1).isdigit())
    assert float(factor) >= EDGE / 6.0


@pytest.mark.slow
def test_boundary(locked: Stage, tmp_path: Path) -> None:
    """None of the stage's cycles is stable beyond the edge."""
    document = answer(tmp_path, locked, "boundary", "--x", f"{BANDWIDTH}=6 Hz..15 Hz")
    assert document["branches"]
    assert min(abs(point["value"] - EDGE) for point in document["points"]) < 0.05


@pytest.mark.slow
def test_map_of_multipliers(locked: Stage, tmp_path: Path) -> None:
    places = f"{BANDWIDTH}={EDGE * 0.97} Hz, {EDGE * 1.03} Hz"
    document = answer(tmp_path, locked, "map", "--x", places, "--metric", "multiplier", "--out", "map")
    assert document["axes"][BANDWIDTH]["unit"] == "Hz"
    inside, outside = np.abs(friso.read_store(tmp_path / "map")["multiplier"].values)
    assert inside < 1
    assert not outside < 1


@pytest.mark.slow
def test_bode_with_sampling_and_delay(whole: Stage, tmp_path: Path) -> None:
    document = answer(tmp_path, whole, "bode")
    assert "At 6.00 Hz" in document["conclusion"]
    slow = bode.limits(whole.replace({"drive.delay": None, "drive.sample_time": None}).flat())
    assert document["highest_stable_crossover_hz"] < slow.highest_stable


@pytest.mark.slow
def test_compare(whole: Stage, tmp_path: Path) -> None:
    document = answer(tmp_path, whole, "compare", "--names", "own", "--machines", 20, "--seed", 1)
    assert [*document["stages"]] == ["own"]
    assert not document["stages"]["own"]["failed"]


@pytest.mark.slow
def test_tune(locked: Stage, tmp_path: Path) -> None:
    """The answer knows the stage's cycles and tunes its bandwidth; with so few machines no remedy is sure to work."""
    tiny = Budget(points=2, generations=2, machines=3, surveyed=1, fresh=12, further=12)
    with patched({method: {"Budget": lambda: tiny, "remedies": lambda *goal: remedies(*goal)[:1]}}):
        document = answer(tmp_path, locked, "tune", "--only", "controller", "--within", "5 um", status=2)
    way = document["ways"]["bandwidth"]

    assert way["works"] == "unsure"
    assert document["as_is"]["verdict"] == "bistable"
    (change,) = way["changes"]
    assert change.startswith(BANDWIDTH)


def test_export(locked: Stage, tmp_path: Path) -> None:
    """The export has the controller's keys with units, its loop as a box, and the limit common to all controllers."""
    save(locked, tmp_path / "stage.toml")
    document = json.loads(friso_inside(tmp_path, "export", "stage.toml", "--json").stdout)
    gains = {row["symbol"]: row["values"] for row in document["gains"]}
    assert gains["bandwidth"][0] == {"value": 6.0, "unit": "Hz"}
    assert gains["bandwidth"][1] == {"value": pytest.approx(12 * np.pi), "unit": "rad/s"}
    assert gains["mass"][0] == {"value": 1.7, "unit": "kg"}
    assert gains["Fmax"][0] == {"value": 200.0, "unit": "N"}
    assert "[ pi-d ]--[ limit ]" in document["structure"][0]


@pytest.mark.slow
@pytest.mark.usefixtures("undrawn")
def test_identify_in_its_own_loop(locked: Stage, tmp_path: Path) -> None:
    """A log that its own sampled loop wrote gives mass and friction back."""
    rigid = locked.replace({"joint": None, "rail": None, "cable": None, "drive": {"sample_time": "1 ms"}})
    time = np.arange(2000) * 1e-3
    reference = 0.02 * (1 - np.cos(2 * np.pi * time))
    blank = record("blank", 1e-3, reference=reference, position=0 * reference, force=0 * reference)
    problem = loop_problem(rigid.flat(), blank, blank.segments[0], ())
    assert problem.form.velocity_samples == 1
    simulated = problem.record(np.zeros(0))
    columns = {"time": time, "reference": reference, "position": simulated.position, "force": simulated.force}
    pd.DataFrame(columns).to_csv(tmp_path / "log.csv", index=False)
    save(rigid, tmp_path / "stage.toml")
    run = friso_inside(
        tmp_path, "identify", "log.csv", "--stage", "stage.toml", "--as", "moves", *UNITS, "--out", "out", "--json"
    )
    assert run.returncode == 0, run.stderr
    estimates = {estimate["key"]: estimate["value"] for estimate in json.loads(run.stdout)["estimates"]}
    assert sum(value for key, value in estimates.items() if key.startswith("masses.")) == pytest.approx(1.7, rel=0.01)
    assert estimates["friction.coulomb"] == pytest.approx(1.0, rel=0.05)


UNITS = tuple(word for pair in ("time=s", "reference=m", "position=m", "force=N") for word in ("--unit", pair))
