"""Sweeps: axes and links read, cells against runs alone, structures mixed in one sweep, cells no stage may have."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from book import BOOK
from hypothesis import given, settings
from hypothesis import strategies as st
from refusals import refused

import friso
from friso.stage import Stage
from friso.studies.metric import usual_metrics, with_usual
from friso.studies.study import Request, study_of
from friso.studies.sweep import sweep

EXAMPLES = Path(__file__).parent.parent / "examples"
MASS = {"masses.cart": "0.7 * mass", "masses.stage": "0.3 * mass", "parasitic.mass": "0.15 * mass"}


@pytest.mark.slow
@pytest.mark.usefixtures("own_bandwidth")
def test_cells_equal_runs_alone(rig: Stage) -> None:
    """Any cell, checked alone as a stage of its own, gives the same numbers bit for bit, and the verdict."""
    axes = {"joint.locked": [True, False], "controller.crossover": (np.array([4.0, 8.0, 20.0]), "Hz")}
    runs = sweep(rig, axes, metrics=[*usual_metrics(), "verdict"], rtol=1e-6)
    assert runs.peaks.dims == ("joint.locked", "controller.crossover")
    assert runs["controller.crossover"].attrs["units"] == "Hz"
    for locked, crossover in ((True, 8.0), (False, 4.0), (True, 20.0)):
        cell = runs.sel({"joint.locked": locked, "controller.crossover": crossover})
        alone = rig.replace({"joint.locked": locked, "controller.crossover": f"{crossover} Hz"})
        case = friso.check(alone, rtol=1e-6)["given"]
        assert cell.verdict.item() == case.verdict
        for name in ("peaks", "peak_to_peak", "largest_force"):
            assert cell[name].item() == getattr(case, name)
        assert cell.steps.item() == case.solver.steps


@pytest.mark.slow
@pytest.mark.usefixtures("own_bandwidth")
def test_a_defaulted_tuned_mass_follows_a_swept_mass(rig: Stage) -> None:
    light = rig.replace({"joint.locked": True, "controller.tuned_mass": None})
    swept = sweep(light, {"masses.cart": ["1.2 kg", "2.4 kg"]})
    alone = friso.check(light.replace({"masses.cart": "2.4 kg"}), rtol=study_of(swept).rtol)["given"]
    assert swept.largest_force.values[1] == alone.largest_force
    assert swept.largest_force.values[1] > 1.5 * swept.largest_force.values[0]


def test_impossible_cells_are_marked_and_the_others_run(rig: Stage) -> None:
    locked = rig.replace({"joint.locked": True})
    runs = sweep(locked, {"friction.static": "0 N..4 N:3", "controller.crossover": ["8 Hz", "-1 Hz"]})
    assert (runs.outcome.values == "invalid").tolist() == [[True, True], [False, True], [False, True]]
    reasons = runs.status.values
    assert "friction.static" in reasons[0, 0]
    assert "controller.crossover" in reasons[1, 1]
    assert np.isnan(runs.peaks.values[0, 0])
    assert reasons[1, 0] == "done"
    below = sweep(locked, {"friction.coulomb": ["1 N", "3.5 N"]})
    assert "friction.coulomb" in below.status.values[1]
    assert below.outcome.values.tolist() == ["swings", "invalid"]


@pytest.mark.slow
@pytest.mark.usefixtures("own_bandwidth")
def test_a_link_moves_the_keys_that_follow(rig: Stage) -> None:
    """Total mass at a fixed ratio, and F_s = max(F_s, F_c), which leaves no cell invalid."""
    free = rig.replace({"joint.locked": True, "controller.tuned_mass": None})
    runs = sweep(free, {"mass": (np.array([1.0, 3.0]), "kg")}, links=MASS)
    assert runs["mass"].attrs["units"] == "kg"
    alone = friso.check(study_of(runs).cell_stage((1,)), rtol=study_of(runs).rtol)["given"]
    assert alone.stage.masses.cart == pytest.approx(2.1)
    assert alone.stage.masses.stage == pytest.approx(0.9)
    assert alone.largest_force == runs.largest_force.values[1]
    links = {"friction.static": "max(friction.static, friction.coulomb)"}
    axes = {"friction.static": "1 N..3 N:2", "friction.coulomb": "0.5 N..3 N:2"}
    runs = sweep(rig, axes, links=links)
    assert "invalid" not in runs.outcome.values
    assert study_of(runs).cell_stage((0, 1)).friction.static == 3.0


@pytest.mark.slow
@pytest.mark.usefixtures("own_bandwidth")
def test_samples_vary_several_keys_at_once(rig: Stage) -> None:
    ranges = {"controller.crossover": "2 Hz..16 Hz", "joint.stroke": "10 um..1 mm:log"}
    runs = sweep(rig, {"joint.locked": [True, False]}, friso.Samples(ranges, 16))
    assert runs.outcome.dims == ("joint.locked", "sample")
    assert runs["joint.stroke"].dims == ("sample",)
    assert (runs["joint.stroke"] < 1e-4).sum() == 8  # even in the logarithm
    index = (1, 5)
    case = friso.check(study_of(runs).cell_stage(index), rtol=study_of(runs).rtol)["given"]
    assert case.largest_force == runs.largest_force.values[index]
    again = Request(rig, {}, friso.Samples(ranges, 16)).study()
    assert np.array_equal(again.axes[0].values, runs["controller.crossover"].values)
    other = Request(rig, {}, friso.Samples(ranges, 16, seed=1)).study()
    assert not np.array_equal(other.axes[0].values, again.axes[0].values)
    latin = Request(rig, {}, friso.Samples(ranges, 10, "latin")).study().axes[0].values
    assert sorted(np.floor((latin - 2) / 1.4)) == list(range(10))
    own = friso.Samples({"controller.crossover": ["4 Hz", "4 Hz"], "joint.stroke": (np.array([0.1, 1.0]), "mm")})
    assert Request(rig, {}, own).study().axes[1].values.tolist() == pytest.approx([1e-4, 1e-3])


def test_ranges_and_lists_as_texts(rig: Stage) -> None:
    axes = {
        "controller.crossover": "1 Hz..40 Hz:41",
        "joint.limiter_damping": "0.01 N*s/m..1e4 N*s/m:7:log",
        "controller.alpha": "0.1..0.3:3",
        "joint.stroke": "0.1 mm, 0.3 mm",
        "joint.locked": "true, false",
    }
    study = Request(rig, axes).study()
    assert study.shape == (41, 7, 3, 2, 2)
    values = {axis.name: axis.values for axis in study.axes}
    assert np.array_equal(values["controller.crossover"], np.linspace(1, 40, 41))
    assert np.array_equal(values["joint.limiter_damping"], np.geomspace(1e-2, 1e4, 7))
    assert values["joint.stroke"].tolist() == [1e-4, 3e-4]
    assert values["joint.locked"].tolist() == [True, False]


def test_only_the_metrics_asked_for_are_kept(rig: Stage) -> None:
    runs = sweep(rig, {"controller.crossover": ["4 Hz", "8 Hz"]}, metrics=["peaks"])
    assert set(runs.data_vars) == {"peaks", "outcome", "status"}


@pytest.mark.slow
@settings(max_examples=40)
@given(shape=st.lists(st.integers(1, 15), min_size=1, max_size=4), target=st.integers(1, 300))
def test_blocks_cover_every_cell_once(shape: list[int], target: int) -> None:
    stage = friso.load(EXAMPLES / "thesis_rig.toml")
    keys = ("controller.crossover", "controller.alpha", "controller.beta", "friction.static")
    axes = {key: np.linspace(0.1, 0.2, size) for key, size in zip(keys, shape, strict=False)}
    units = ("Hz", "", "", "N")
    study = Request(stage, {key: (axes[key], unit) for key, unit in zip(axes, units, strict=False)}).study()
    block = study.block_shape(target)
    assert np.prod(block) <= max(target, 1)
    seen = np.zeros(study.shape, int)
    for part in study.blocks(block):
        seen[part] += 1
        columns = study.block_columns(part)
        numbers = np.arange(study.cells).reshape(study.shape)[part].ravel()
        assert all(np.array_equal(columns[name], study.columns(numbers)[name]) for name in columns)
    assert np.all(seen == 1)


def test_a_dataset_holds_its_study(rig: Stage) -> None:
    axes = {"controller.crossover": "4 Hz..8 Hz:2", "joint.locked": [True, False]}
    runs = sweep(rig, axes, samples=friso.Samples({"joint.stroke": "0.1 mm..1 mm"}, 2), metrics=["peaks"])
    study = study_of(runs)
    made_of = friso.Samples({"joint.stroke": "0.1 mm..1 mm"}, 2)
    made = Request(rig, axes, made_of).study(metrics=["peaks"])
    assert not made.differences(study, runs.attrs["equations"])
    others = {"controller.crossover": "4 Hz..9 Hz:2", "joint.locked": [False]}
    more = Request(rig, others, made_of).study(metrics=["peaks", "multiplier"])
    said = " ".join(more.differences(study, "0"))
    for words in ("0 there", "4..8 Hz", "4..9 Hz", "True..False", "none of multiplier"):
        assert words in said
    assert runs.attrs["stage"] == rig.to_toml()


def test_results_do_not_depend_on_threads(rig: Stage) -> None:
    axes = {"controller.crossover": "2 Hz..16 Hz:15", "joint.stroke": "0 m..1 mm:9"}
    xr.testing.assert_identical(sweep(rig, axes, threads=1), sweep(rig, axes, threads=3))


MIXED = {"mass": ["1 kg", "2 kg"], "controller.crossover": ["8 Hz"]}
STROKE, TWO = {"joint.stroke": "0 m..1 mm"}, {"controller.alpha": [0.1, 0.2]}


@pytest.mark.parametrize(
    "asked",
    [
        {"axes": {}},
        {"axes": {"controller.crossover": (np.linspace(1, 2, 3), "N")}},
        {"axes": {"controller.crossover": (np.array([1.0, np.nan]), "Hz")}},
        {"axes": {"controller.alpha": (np.array([0.1]), "Hz")}},
        {"axes": MIXED, "links": {"masses.crt": "mass"}},
        {"axes": MIXED, "links": {"masses.cart": "mas + mass"}},
        {"axes": MIXED, "links": {"masses.cart": "__import__('os').getcwd()"}},
        {"axes": MIXED, "links": {"masses.cart": "mass if mass else 1"}},
        {"axes": MIXED, "links": {"masses.cart": "0.7 *"}},
        {"axes": MIXED, "links": {"masses.cart": "max(mass)"}},
        {"axes": MIXED, "links": {"masses.cart": "mass * friction.model"}},
        {"axes": MIXED, "links": {"masses.cart": "mass", "controller.crossover": "8"}},
        {"axes": {}, "samples": (STROKE,)},
        {"axes": {}, "samples": ({"joint.stroke": "0 m..1 mm:5"}, 8)},
        {"axes": {}, "samples": (STROKE, 8, "dice")},
        {"axes": {}, "samples": (STROKE, 8.5)},
        {"axes": {}, "samples": (STROKE, 8, "latin", -1)},
        {"axes": {}, "samples": (["joint.stroke"], 8)},
        {"axes": {}, "samples": ({"joint.stroke": ["1 mm"], **TWO},)},
        {"axes": {}, "samples": ({**STROKE, **TWO}, 8)},
    ],
)
def test_what_makes_no_study_is_refused(rig: Stage, asked: dict) -> None:
    with refused():
        sweep(rig, **{**asked, **({"samples": friso.Samples(*asked["samples"])} if "samples" in asked else {})})


@pytest.mark.slow
@pytest.mark.usefixtures("own_bandwidth")
def test_measures_of_what_attracts_are_those_of_the_stage_alone(rig: Stage) -> None:
    """Asked for by name; the motion plays no part, and a cell that nothing attracts has no number."""
    locked = rig.replace({"joint.locked": True})
    axes = {"controller.crossover": ["4 Hz", "8 Hz", "30 Hz"], "motion.acceleration": ["1 m/s^2", "100 m/s^2"]}
    runs = sweep(locked, axes, metrics=["multiplier", "amplitude", "cycle_period", "peaks"])
    assert set(runs.data_vars) == {"peaks", "multiplier", "amplitude", "cycle_period", "outcome", "attractor", "status"}
    assert runs.attractor.values[:, 0].tolist() == ["cycle", "cycle", "nothing"]
    for name in ("multiplier", "amplitude", "cycle_period"):
        assert np.array_equal(runs[name].values[:, 0], runs[name].values[:, 1], equal_nan=True)
        assert np.isnan(runs[name].values[2]).all()
    cycle = friso.check(locked)["given"].judgement.cycle
    alone = (cycle.multiplier, cycle.amplitude, cycle.period)
    result = [runs[name].values[1, 0] for name in ("multiplier", "amplitude", "cycle_period")]
    assert result == pytest.approx(alone, rel=1e-9)
    assert runs.multiplier.attrs["units"] == "1"
    assert "multiplier" not in sweep(locked, {"controller.crossover": ["8 Hz"]})


@pytest.mark.slow
def test_measures_are_those_of_an_asymmetric_cycle_where_that_attracts() -> None:
    """The symmetric cycle repels at both crossovers; the other one is 0.876 mm large at the lower, by simulations at
    1e-7 and 1e-9, and gone at the higher."""
    metrics = ["multiplier", "amplitude", "verdict"]
    runs = sweep(BOOK["creeping"], {"controller.crossover": ["12.3332 Hz", "13.3 Hz"]}, metrics=metrics)
    assert runs.attractor.values[0] in ("cycle", "swing")
    assert runs.attractor.values[1] == "nothing"
    assert runs.verdict.values[0] in ("hunts", "bistable")
    assert runs.verdict.values[1] in ("settles", "transient")
    assert runs.amplitude.values[0] == pytest.approx(0.876e-3, rel=0.01)
    assert not abs(runs.multiplier.values[0]) >= 1
    assert np.isnan([runs.amplitude.values[1], runs.multiplier.values[1]]).all()


RAMP = """
masses.cart = "1 kg"
friction = { model = "lugre", static = "1.5 N", coulomb = "1 N", stribeck_velocity = "1 mm/s", stribeck_exponent = 2, \
bristle_stiffness = "1e5 N/m", bristle_damping = "316 N*s/m", viscous = "0.4 N*s/m" }
controller = { kind = "pid", kp = "8 N/m", ki = "0.8 N/(m*s)", kd = "1 N*s/m", derivative_on = "measurement" }
motion = { kind = "ramp", velocity = "0.1 m/s", duration = "60 s" }
"""


METRICS_OF_VERDICTS = (None, "sketch", "verdict", "attractor", "multiplier")


def test_there_is_no_map_of_verdicts_and_no_boundary_where_the_reference_keeps_moving() -> None:
    """A check gives no verdict there; runs can be mapped, and swing."""
    stage = friso.loads(RAMP.replace("\\\n", ""))
    assert friso.check(stage).verdict == "none"
    standing, friction = stage.replace({"motion.velocity": "0 m/s"}), {"friction.static": ["1.5 N", "3 N"]}
    axes = {"motion.velocity": ["0.02 m/s", "0.05 m/s"], **friction}
    for metric in METRICS_OF_VERDICTS:
        if metric is not None:
            with refused("metric"):
                friso.sweep(stage, axes, metric=metric)
        with refused("metric"):  # it stands in the file, and moves on the axis
            friso.sweep(standing, axes, metric=metric)
        with refused("metric"):  # or by a link
            moved = {"motion.velocity": "friction.static / 30"}
            Request(standing, friction, None, moved).study(with_usual(metric or "sketch"))
    assert (friso.sweep(stage, axes, metric="outcome").outcome == "swings").any()
    assert friso.sweep(stage, axes).metric == "stick_slip"


def test_a_stage_that_cannot_hunt_has_a_verdict_whatever_its_reference_does() -> None:
    stage = friso.loads(RAMP.replace("\\\n", "")).replace({"controller.ki": None})
    verdict = friso.check(stage).verdict
    assert verdict in ("transient", "settles")
    cells = friso.sweep(stage, {"motion.velocity": ["0.05 m/s", "0.1 m/s"]}, metric="verdict").data["verdict"]
    assert cells.values[1] == verdict
    with refused("metric"):
        friso.sweep(stage, {"controller.ki": ["0 N/(m*s)", "0.8 N/(m*s)"]}, metric="verdict")
