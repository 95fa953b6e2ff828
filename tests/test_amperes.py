"""Gains and limits in amperes: of a stage that says what an ampere exerts, and of one that does not."""

import re
from typing import Any

import numpy as np
import pytest
from book import BOOK

import friso
from friso.axis import KINDS
from friso.drives.ask import Ask
from friso.drives.gains import conversions, gains_of
from friso.hunting import hunting as hunting_of
from friso.stage import Stage
from friso.studies.axes import SweptAxis, read_axis

LINEAR, ROTARY, IN_VOLTS = (
    BOOK[name].as_written() for name in ("linear axis in amperes", "rotary axis in amperes", "in volts")
)
WITHOUT_DRIVE = {name: table for name, table in IN_VOLTS.items() if name != "drive"}
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
    for row in conversions(stage.flat(), Ask({"travel_per_turn": "36 deg"}), stage.axis_kind.exerts):
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


def test_volts_exert_what_the_motor_draws_at_standstill() -> None:
    """A volt on 2 ohm drives 0.5 A, which exert 5 N; 24 V are 100 % and 1000 counts of PWM."""
    stage = Stage(**IN_VOLTS)
    assert stage.flat()["controller.kp"] == pytest.approx(0.4 / 1e-3 * 5)
    assert stage.flat()["controller.force_limit"] == pytest.approx(24 * 5)
    assert friso.loads(stage.to_toml()) == stage
    for text, newtons in {
        "3 PWM/count": 3 * 0.024 * 5 / 1e-6,
        "2 %/mm": 2 * 0.24 * 5 / 1e-3,
        "0.1 V/count": 0.1 * 5 / 1e-6,
        "300 N/m": 300.0,
    }.items():
        assert stage.replace({"controller.kp": text}).flat()["controller.kp"] == pytest.approx(newtons)


def test_gains_per_sample_are_the_sums_and_differences_of_a_drive() -> None:
    """P 3, I 1e-5, D 15 in a drive that runs each 90 us: I sums errors, D takes their difference."""
    gains = {"kp": "3 PWM/count", "ki": "1e-5 PWM/(count*sample)", "kd": "15 PWM*sample/count"}
    flat = Stage(**IN_VOLTS).replace({f"controller.{key}": text for key, text in gains.items()}).flat()
    per_count = 0.024 * 5 / 1e-6
    assert flat["controller.ki"] == pytest.approx(1e-5 * per_count / 90e-6)
    assert flat["controller.kd"] == pytest.approx(15 * per_count * 90e-6)


def test_counts_of_a_rotary_axis_are_angles() -> None:
    stage = Stage(**{**ROTARY, "drive": {"encoder_resolution": "1 mrad"}})
    assert stage.replace({"controller.kp": "2e-3 A*s/count"}).flat()["controller.kp"] == pytest.approx(10.0)


def test_what_export_prints_in_volts_may_stand_in_the_file() -> None:
    stage, tried = Stage(**IN_VOLTS), 0
    for row in gains_of(stage, {}).conversions:
        (value, unit), *others = row.values
        keys = [key for key, field in stage.numeric_keys().items() if stage.flat().get(key) == value]
        for number, other in others if unit.startswith("N") else ():
            if re.match("V|%|PWM", other):
                tried += 1
                assert stage.replace({keys[0]: f"{number!r} {other}"}).flat()[keys[0]] == pytest.approx(value)
    assert tried == 3 * 4


IN_PLAIN_UNITS = {"kp": "2000 N/m", "ki": "8 N/(mm*s)", "kd": "20 N*s/m", "force_limit": "120 N"}


def test_back_emf_brakes_as_viscous_friction_does() -> None:
    """It is 10 N/A times 10 V s/m over 0.1 ohm, 1000 N s/m, and takes the energy of which the stage hunts."""
    tables = {**WITHOUT_DRIVE, "controller": {**IN_VOLTS["controller"], **IN_PLAIN_UNITS}}
    braked = Stage(**{**tables, "actuator": {"back_emf": "10 V*s/m", "resistance": "0.1 ohm"}})
    free = Stage(**{**tables, "actuator": {"motor_constant": "10 N/A"}})
    viscous = free.replace({"friction.viscous": "1000.5 N*s/m"})
    ours, theirs, without = (friso.simulate(stage, 1e-9, 1e-3)["position"].values for stage in (braked, viscous, free))
    assert np.abs(ours - theirs).max() < 1e-9
    assert np.abs(ours - without).max() > 1e-4
    assert hunting_of(free).attracting
    assert (hunting_of(braked).attracting, hunting_of(braked).certain) == ((), True)


def test_a_motor_behind_a_transmission_brakes_itself() -> None:
    """Back-EMF acts where the motor turns, as viscous friction there does."""
    tables: dict[str, Any] = {
        **WITHOUT_DRIVE,
        "controller": {**IN_VOLTS["controller"], **IN_PLAIN_UNITS},
        "transmission": {"mass": "1 kg", "stiffness": "1 N/um", "damping": "200 N*s/m", "backlash": "20 um"},
        "encoder": {"position": "load", "velocity": "motor"},
    }
    law = {"model": "stribeck", "static": "1 N", "coulomb": "1 N", "regularisation_velocity": "1 mm/s"}
    law |= {"stribeck_velocity": "1 mm/s", "stribeck_exponent": 2}
    braked = Stage(**{**tables, "motor_friction": {**law, "viscous": "0.5 N*s/m"}})
    free = {**tables, "actuator": {"motor_constant": "1 N/A"}}
    viscous = Stage(**{**free, "motor_friction": {**law, "viscous": "50.5 N*s/m"}})
    ours, theirs = (friso.simulate(stage, 1e-9, 1e-3)["position"].values for stage in (braked, viscous))
    assert np.abs(ours - theirs).max() < 1e-8
