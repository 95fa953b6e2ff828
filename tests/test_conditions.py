"""Load, temperature and place on the rail: factors on the levels of friction, the same for every command."""

import numpy as np
import pytest
from variants import VARIANTS

import friso
from benchmarks.by_hand import conditions
from friso.equations.rail import friction_factors
from friso.frequency.system import level
from friso.stage import Stage
from friso.virtual_rig.run import as_built_keys

RAIL = {"rail": {"seed": 3, "static_deviation": 0.2, "coulomb_deviation": 0.1, "correlation_length": "5 mm"}}
PLACE = "conditions.place"
LEVELS = ("static", "coulomb")


@pytest.fixture(scope="module")
def warming() -> Stage:
    """Released, so that its reference does not accelerate."""
    return VARIANTS["rigid, conditions"].replace({"motion": VARIANTS["rigid"].as_written()["motion"]})


def test_a_stage_under_conditions_moves_as_one_with_such_levels(warming: Stage) -> None:
    flat = warming.flat()
    levels = {f"friction.{name}": f"{float(conditions(flat, 0.0) * flat[f'friction.{name}'])!r} N" for name in LEVELS}
    alike = warming.replace({"conditions": None, **levels})
    ours, theirs = (friso.simulate(stage, rtol=1e-9, sample_time=0.1).position for stage in (warming, alike))
    assert ours.to_numpy() == pytest.approx(theirs.to_numpy(), abs=1e-9)
    assert level(warming.flat(), True) == pytest.approx(level(alike.flat(), True), rel=1e-12)


def test_the_place_on_the_rail_decides_and_may_be_swept() -> None:
    stage, places = VARIANTS["rigid"].replace({**RAIL, PLACE: "12 mm"}), np.array([0.012, -0.03])
    factors = friction_factors(stage.flat(), places)
    swept = stage.flat({PLACE: places})
    for name, row in zip(LEVELS, factors, strict=True):
        assert swept[f"conditions.{name}_factor"] == pytest.approx(row, rel=1e-12)
        assert stage.flat()[f"conditions.{name}_factor"] == pytest.approx(row[0], rel=1e-12)
    rails = stage.flat({PLACE: places, "rail.seed": np.array([3.0, 4.0])})["conditions.static_factor"]
    assert rails[0] == pytest.approx(factors[0, 0], rel=1e-12)
    assert rails[1] != pytest.approx(factors[0, 1], rel=1e-3)


def test_a_drive_as_built_moves_along_the_rail_whatever_the_place() -> None:
    stage = VARIANTS["rigid"].replace({**RAIL, PLACE: "12 mm", "conditions.load": 2.0})
    assert [as_built_keys(stage)[f"conditions.{name}_factor"] for name in LEVELS] == [2.0, 2.0]
