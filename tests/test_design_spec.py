"""Test specifications: what is read, what is refused, and the machines that they allow."""

import copy
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import friso
from friso.design_method.prepare import assumed, by_rules, outline, prepared, with_leaves
from friso.design_method.spec import Geometry, Sheet, Spec, box, load_spec, read_spec, round_geometries, sheets
from friso.design_method.verification import corners, random_machines, typical_move
from friso.frequency.bode import rigid_bandwidth

EXAMPLES = Path(__file__).parent.parent / "examples"
SPEC = EXAMPLES / "specs" / "thesis.toml"
TABLES = tomllib.loads(SPEC.read_text(encoding="utf-8"))


def changed(table: str, **keys: Any) -> Spec:
    """The example with keys of a table changed, or removed by None."""
    tables = copy.deepcopy(TABLES)
    tables.setdefault(table, {}).update(keys)
    tables[table] = {key: value for key, value in tables[table].items() if value is not None}
    return Spec(**tables)


@pytest.fixture(scope="module")
def rig() -> friso.Stage:
    return friso.load(EXAMPLES / "thesis_rig.toml")


def test_the_example_is_read() -> None:
    """Parasitic frequencies set the limit too, or its former name; a range of thickness stands for usual gauges."""
    spec = load_spec(SPEC)
    assert spec.limit == 48
    assert (spec.friction.static.low, spec.friction.static.high) == (1, 3)  # type: ignore[union-attr]
    assert spec.masses.cart.low == pytest.approx(1.14)  # type: ignore[union-attr]
    assert len(sheets(spec)) == 8
    assert changed("machine", crossover_limit=None, bandwidth_limit="25 Hz").limit == 25
    modes = changed("machine", crossover_limit=None, parasitic_frequencies=["730 Hz", "480 Hz"])
    assert modes.limit == pytest.approx(48)
    assert changed("leaves", thickness="0.2 mm .. 0.35 mm").leaves.thickness == (0.2e-3, 0.25e-3, 0.3e-3, 0.35e-3)
    low, high = box(changed("leaves", length="70 mm"))
    assert (low[0], high[0]) == pytest.approx((7e-3, 70e-3))


def test_corners_hold_the_ends_of_all_ranges(rig: friso.Stage) -> None:
    result = corners(load_spec(SPEC), rig.flat())
    static, coulomb = result.keys["friction.static"], result.keys["friction.coulomb"]
    assert result.count == 3 * 3 * 2
    assert (static.min(), static.max()) == (1, 3)
    gap = (static - coulomb) / static
    assert (gap.min(), gap.max()) == pytest.approx((0.3, 0.85))
    assert set(np.round(result.keys["masses.stage"], 6)) == {0.475, 0.525}


def test_drawn_machines_lie_in_all_ranges(rig: friso.Stage) -> None:
    spec = load_spec(SPEC)
    flat = rig.flat()
    samples = random_machines(spec, flat, 500, 0.3)
    factors = samples.keys["joint.stiffness"] / flat["joint.stiffness"]
    assert (factors.min(), factors.max()) == pytest.approx((0.9 * 0.7, 1.1), abs=5e-3)
    travel = samples.keys["motion.acceleration"] * samples.keys["motion.acceleration_time"] ** 2
    assert travel.min() >= 1e-3 * (1 - 1e-9)
    assert travel.max() <= 0.1 * (1 + 1e-9)
    assert np.all(samples.keys["friction.coulomb"] < samples.keys["friction.static"])
    overlapping = random_machines(changed("friction", gap=None, coulomb="0.5 N .. 2 N"), flat, 200, 0.0)
    assert np.all(overlapping.keys["friction.coulomb"] <= overlapping.keys["friction.static"])
    again = random_machines(spec, flat, 500, 0.3)
    assert all(np.array_equal(samples.keys[key], again.keys[key]) for key in samples.keys)


def test_the_typical_move_is_in_the_middle() -> None:
    move = typical_move(load_spec(SPEC))
    assert move["motion.acceleration"] * move["motion.acceleration_time"] ** 2 == pytest.approx(0.01)
    assert move["motion.acceleration"] == pytest.approx(np.sqrt(10 * 100))


@pytest.mark.parametrize("masses", [{"cart": "1.2 kg", "stage": "0.5 kg"}, {"stage": "1.7 kg"}])
def test_a_rigid_stage_is_given_what_it_lacks(rig: friso.Stage, masses: dict[str, str]) -> None:
    """A second mass, and a joint whose limiter is nearly the thesis's."""
    stage, spec = rig.replace({"joint": None, "parasitic": None, "masses": masses}), load_spec(SPEC)
    base = prepared(stage, spec)
    assert base.flat()["joint.limiter_stiffness"] == pytest.approx(2e7, rel=0.1)
    assert base.flat()["joint.limiter_damping"] == pytest.approx(100, rel=0.1)
    assert base.flat()["masses.cart"] + base.flat()["masses.stage"] == pytest.approx(1.7)
    assert ("masses.cart" in assumed(stage, spec)) == (len(masses) == 1)
    assert assumed(rig, spec) == {}


def test_the_outline_of_a_specification_is_one(rig: friso.Stage) -> None:
    stage = rig.replace({"friction.static": "3 N +/- 0.5 N"})
    spec = read_spec(outline(stage))
    assert spec.limit == stage.flat()["controller.crossover"]
    assert (spec.friction.static.low, spec.friction.static.high) == (2.5, 3.5)
    assert spec.moves.travel.high == pytest.approx(100 * 0.03**2)
    prepared(stage, spec)


def test_other_controllers_give_way_to_the_rules_at_their_bandwidth(rig: friso.Stage) -> None:
    """The rules also replace the controller of a rigid stage from which the specification is made."""
    cascade = {"kind": "cascade", "kv": "10 1/s", "kp": "85 N*s/m", "velocity_integral_time": "0.1 s"}
    limited = {**cascade, "force_limit": "200 N"}
    stage = rig.replace({"controller": limited, "joint": None, "parasitic": None})
    ruled = by_rules(stage)
    assert ruled.flat()["controller.crossover"] == pytest.approx(rigid_bandwidth(stage), rel=1e-3)
    assert ruled.flat()["controller.force_limit"] == 200.0
    assert by_rules(ruled) is ruled
    spec = read_spec(outline(stage))
    assert spec.limit == pytest.approx(rigid_bandwidth(stage), rel=1e-3)
    assert prepared(stage, spec).flat()["controller.crossover"] == spec.limit


def test_a_prepared_stage_takes_leaves(rig: friso.Stage) -> None:
    spec = load_spec(SPEC)
    base = prepared(rig, spec)
    stage = with_leaves(base, Geometry(60e-3, 18e-3, 50e-3, Sheet(2.0, 0.3e-3, "stainless 1.4310")), 1e-3)
    assert stage.flat()["flexure.length"] == pytest.approx(0.06)
    assert friso.loads(stage.to_toml()) == stage
    assert prepared(stage, spec).flexure is not None  # a stage that has leaves already


def test_rounded_sizes_stay_in_the_space() -> None:
    spec = load_spec(SPEC)
    near = round_geometries(spec, Geometry(69.97e-3, 15.02e-3, 40.04e-3, sheets(spec)[0]), 1e-4)
    assert {round(item.length * 1e3, 3) for item in near} == {69.9, 70.0}
    assert {round(entry.width * 1e3, 3) for entry in near} == {15.0, 15.1}
    assert len(near) == 8
