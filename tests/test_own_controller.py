"""A controller from one file, of which friso knows nothing else, through every command."""

import json
from pathlib import Path

import numpy as np
import own_controller
import pytest
from inside import friso_inside
from patched import patched

import friso
from friso.engine.arrays import Status
from friso.equations.as_built import AsBuilt
from friso.equations.bandwidth import bandwidth, faster
from friso.equations.continuous import slow_gains
from friso.equations.structure import structure
from friso.frequency import crossover
from friso.hunting import Case
from friso.identification.moves import identify_moves
from friso.identification.output_error.problem import closed_loop
from friso.identification.readings.common import record
from friso.progress import silent
from friso.stage import Stage, save
from friso.studies.compare import study
from friso.studies.compare.study import compare
from friso.studies.rig.experiments import hunting
from friso.studies.rig.moves_on_rails import rails
from friso.views.compare.words import sentences as comparison_sentences
from friso.views.rig.page import sentences
from friso.virtual_rig.run import as_built_keys

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
    """What the drive commands at its samples, and the force in continuous time."""
    run = friso.simulate(whole.replace({"joint.locked": True, "motion": {**SLOW}}), 1e-8, 250e-6)
    names = {"reference", "position", "force", "force_p", "force_i", "force_d"}
    assert names <= {*map(str, run)}
    assert run.attrs["status"] == Status.DONE.text
    shares = sum(run[f"force_{share}"].values for share in "pid")
    assert np.abs(run["force"].values - np.clip(shares, -200, 200)).max() < 1e-9
    assert run["force_i"].attrs["long_name"] == "integral share"
    assert run["force_p"].attrs["long_name"] == "spring share"


SLOW = {"kind": "there_and_back", "duration": "2 s", "acceleration": "1 m/s^2", "acceleration_time": "0.2 s",
        "return_at": "1 s"}  # fmt: skip


@pytest.fixture(scope="module")
def checked(locked: Stage) -> dict[str, Case]:
    return friso.check(locked)


def test_check(checked: dict[str, Case]) -> None:
    """Its cycle's multiplier is that of a simulation beside it; the remedy is told in its own word and number."""
    case = checked["given"]
    cycle, margin = case.judgement.cycle, case.judgement.margin
    assert case.verdict in ("hunts", "bistable")
    assert cycle is not None
    assert cycle.growth == pytest.approx(cycle.multiplier, rel=1e-3)
    assert margin is not None
    assert margin.crossover == pytest.approx(EDGE, rel=2e-3)
    assert margin.factor == pytest.approx(EDGE / 6.0, rel=2e-3)


def test_check_in_words(
    locked: Stage, checked: dict[str, Case], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    save(locked, tmp_path / "stage.toml")
    monkeypatch.setattr("friso.hunting.check", lambda stage, **how: checked if stage == locked else {})
    done = friso_inside(tmp_path, "check", "stage.toml")
    assert done.returncode == 0, done.stderr
    assert "aise the bandwidth by" in " ".join(done.stdout.split())


def test_boundary(locked: Stage) -> None:
    """Of all cycles of the stage none attracts beyond the edge."""
    found = friso.boundary(locked, {BANDWIDTH: "8 Hz..13 Hz"})
    ends = [found.value(point.point.place) for points in found.special for point in points]
    assert found.branches
    assert min(abs(end - EDGE) for end in ends) < 0.05


def test_map_of_multipliers(locked: Stage) -> None:
    runs = friso.sweep(locked, {BANDWIDTH: ([EDGE * 0.97, EDGE * 1.03], "Hz")}, metrics=["multiplier"])
    inside, outside = np.abs(runs["multiplier"].values)
    assert inside < 1
    assert not outside < 1


def test_bode_with_sampling_and_delay(whole: Stage, tmp_path: Path) -> None:
    save(whole, tmp_path / "stage.toml")
    done = friso_inside(tmp_path, "bode", "stage.toml", "--json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    said = friso_inside(tmp_path, "bode", "stage.toml")
    assert said.returncode == 0, said.stderr
    assert "At 6.00 Hz" in " ".join(said.stdout.split())
    slow = friso.bode(whole.replace({"drive.delay": None, "drive.sample_time": None}))
    assert found["highest_stable_crossover_hz"] < slow.limits["free"].highest_stable


def small(stage: Stage) -> np.ndarray:
    return rails(stage)[:2]


def test_rig_hunting(whole: Stage) -> None:
    sizes = {"CROSSOVERS": np.array([1.0, 3.0]), "SHOWN": (0, 1), "DISPLACEMENTS": (0.02,), "rails": small}
    with patched({hunting: sizes}):
        outcome = hunting.run_experiment(whole, 1, silent)
    assert outcome.result.crossovers == pytest.approx([6.0, 18.0])
    assert all(sentences(outcome))
    assert AsBuilt.of(as_built_keys(whole)).structure.controller is not None


def test_compare(whole: Stage) -> None:
    with patched({crossover: {"STEPS": 21, "BIASES": 3}, study: {"FOLLOWED": 6, "LONGER": 3}}):
        found = compare(whole, 20, 1)
    letters = {result.option.letter: result.option for result in found.results}
    assert {"a", "c", "d", "e", "f"} <= {*letters}
    assert all(comparison_sentences(found))
    if "b" in letters:
        assert letters["b"].stage.flat()[BANDWIDTH] == pytest.approx(6.0 * letters["b"].factor)


def test_identify_in_its_own_loop(locked: Stage) -> None:
    """A log that its own sampled loop wrote gives mass and friction back."""
    rigid = locked.replace({"joint": None, "rail": None, "cable": None, "drive": {"sample_time": "1 ms"}})
    flat, time = rigid.flat(), np.arange(4000) * 1e-3
    reference = 0.02 * (1 - np.cos(2 * np.pi * time))
    blank = record("given", 1e-3, reference=reference, position=0 * reference, force=0 * reference)
    problem = closed_loop(flat, blank, blank.segments[0], ())
    assert problem.form.velocity_samples == 1
    one = problem.record(np.zeros(0))
    log = record("moves", 1e-3, reference=reference, position=one.position, force=one.force)
    found = identify_moves(log, flat, own_loop=True)
    estimates = {each.name: each.value for each in found.estimates}
    assert sum(estimates[key] for key in flat if key.startswith("masses.")) == pytest.approx(1.7, rel=0.01)
    assert estimates["friction.coulomb"] == pytest.approx(1.0, rel=0.05)
