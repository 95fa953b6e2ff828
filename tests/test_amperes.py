"""Gains and limits in amperes: of a stage that says what an ampere exerts, and of one that does not."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from refusals import refused

import friso
from friso.axis import KINDS
from friso.drives.conversions import conversions
from friso.drives.gains import gains_of
from friso.drives.questions import UserAnswers
from friso.stage import Stage
from friso.studies.axes import SweptAxis, read_axis

LINEAR = {
    "masses": {"stage": "20 kg"},
    "controller": {
        "kind": "pid",
        "kp": "100 A/mm",
        "ki": "400 A/(m*s)",
        "kd": "2 A*s/mm",
        "tau": "1 ms",
        "viscous_feedforward": "3 A*s/m",
        "acceleration_feedforward": "0.4 A*s^2/m",
        "coulomb_feedforward": "0.2 A",
        "force_limit": "4 A",
        "integral_limit": "500 mA",
    },
    "actuator": {"motor_constant": "50 N/A"},
    "motion": {"kind": "hold", "duration": "1 s"},
}
ROTARY = {
    "axis": {"kind": "rotary"},
    "masses": {"stage": "0.02 kg*m^2"},
    "controller": {
        "kind": "cascade",
        "kv": "25 1/s",
        "kp": "2 A*s/rad",
        "velocity_integral_time": "10 ms",
        "acceleration_feedforward": "0.4 A*s^2/rad",
        "force_limit": "4 A",
    },
    "actuator": {"motor_constant": "5 N*m/A"},
    "motion": {"kind": "hold", "duration": "1 s"},
}
IN_NEWTONS = {
    "kp": 5e6,
    "ki": 2e4,
    "kd": 1e5,
    "viscous_feedforward": 150.0,
    "acceleration_feedforward": 20.0,
    "coulomb_feedforward": 10.0,
    "force_limit": 200.0,
    "integral_limit": 25.0,
}
IN_NEWTON_METRES = {"kp": 10.0, "acceleration_feedforward": 2.0, "force_limit": 20.0}


@pytest.mark.parametrize(("tables", "forces"), [(LINEAR, IN_NEWTONS), (ROTARY, IN_NEWTON_METRES)])
def test_an_ampere_exerts_what_the_actuator_says(tables: dict[str, Any], forces: dict[str, float]) -> None:
    stage = Stage(**tables)
    assert stage.axis_kind == KINDS["rotary" if tables is ROTARY else "linear"]
    assert "actuator.motor_constant" not in stage.numeric_keys()
    assert friso.loads(stage.to_toml()) == stage
    twice = stage.replace({"actuator.motor_constant": f"{2 * stage.actuator.motor_constant} {stage.axis_kind.force}/A"})
    for times, of in ((1, stage.flat()), (2, twice.flat())):
        assert [of[f"controller.{key}"] for key in forces] == pytest.approx([times * one for one in forces.values()])


@pytest.mark.parametrize("tables", [LINEAR, ROTARY])
def test_what_export_prints_in_amperes_may_stand_in_the_file(tables: dict[str, Any]) -> None:
    stage = Stage(**tables)
    flat, fields = stage.flat(), stage.numeric_keys()
    printed = {row.values[0]: row.values[1:] for row in gains_of(stage, {}).conversions}
    tried = 0
    for (value, unit), others in printed.items():
        keys = [key for key, field in fields.items() if flat.get(key) == value and field.unit == unit]
        for key in keys:
            for number, other in others:
                if other.startswith("A"):
                    tried += 1
                    assert stage.replace({key: f"{number!r} {other}"}).flat()[key] == pytest.approx(value)
    assert tried >= len(IN_NEWTON_METRES)


def test_no_unit_of_a_rotary_axis_stands_for_load_and_motor_at_once() -> None:
    stage = Stage(**ROTARY)
    for row in conversions(stage.flat(), UserAnswers({"travel_per_turn": "36 deg"}), stage.axis_kind.per_ampere):
        units = [unit for _, unit in row.values]
        assert len(units) == len({*units}), row.name


@pytest.mark.parametrize("tables", [LINEAR, ROTARY])
def test_without_an_actuator_each_gain_in_amperes_says_what_it_needs(tables: dict[str, Any]) -> None:
    bare = {name: table for name, table in tables.items() if name != "actuator"}
    with pytest.raises(friso.StageError) as refusal:
        Stage(**bare)
    said = [refusal.value.actual, *(actual for _, actual in refusal.value.also)]
    amperes = [text for text in tables["controller"].values() if "A" in text]
    assert sum("[actuator] motor_constant" in text for text in said) == len(amperes)


@pytest.mark.parametrize("constant", ["50", "50 N", "0 N/A", 50, None])
def test_a_wrong_constant_is_the_one_mistake(constant: Any) -> None:
    actuator = {} if constant is None else {"motor_constant": constant}
    with refused("actuator.motor_constant", friso.StageError) as caught:
        Stage(**{**LINEAR, "actuator": actuator})
    assert not caught.value.also


@pytest.mark.parametrize("text", ["2 A/rpm", "2 A*s", "2 A^2*s/m", "2 V*s/m", "2 A/m"])
def test_amperes_of_another_kind_are_refused(text: str) -> None:
    with refused("controller.kd"):
        Stage(**LINEAR).replace({"controller.kd": text})


def test_amperes_stand_wherever_a_value_of_the_stage_is_given() -> None:
    stage = Stage(**LINEAR)
    swept = read_axis(stage, "controller.kp", ["50 A/mm", "100 A/mm"], free=False)
    assert isinstance(swept, SweptAxis)
    assert [*swept.values] == pytest.approx([2.5e6, 5e6])
    uncertain = stage.replace({"controller.force_limit": "4 A +/- 1 A"}).uncertain()["controller.force_limit"]
    assert (uncertain.low, uncertain.high) == pytest.approx((150.0, 250.0))
    assert stage.in_own_units({"controller.kp": 80})["controller.kp"] == "80 A/mm"


def test_the_constant_of_the_file_is_that_of_export() -> None:
    stage = Stage(**LINEAR)
    with pytest.raises(friso.InputError, match="50 N/A"):
        gains_of(stage, {"motor_constant": "40 N/A"})
    assert gains_of(stage, {"motor_constant": "50 N/A"}).conversions == gains_of(stage, {}).conversions


def test_gains_to_type_in_name_the_log_to_record_next(tmp_path: Path) -> None:
    """The file of a stage leads on; a stage without a file, or with changed keys, has no name to lead on with."""
    file = tmp_path / "axis.toml"
    file.write_text(Path(friso.example("thesis_rig")).read_text())
    gains = friso.export("gains", file)
    assert gains.next_steps([]) == [f"friso identify NEW_LOG.csv --against {file}"]
    assert friso.export("gains", file, set={"controller.crossover": "9 Hz"}).next_steps([]) == []
    assert friso.export("gains", Stage(**LINEAR)).next_steps([]) == []
