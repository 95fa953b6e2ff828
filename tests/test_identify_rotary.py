"""Logs of a rotary axis: the same SI numbers as of a linear axis, in kg m^2, N m and rad; the axis is stated once."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from inside import friso_inside
from refusals import refused
from test_identify_experiments import LUGRE, ramps
from test_identify_records import axis, csv
from test_rotary_axis import LENGTHS, texts

import friso
from friso.axis import LINEAR, ROTARY
from friso.identification.experiments.break_away import static_from_ramps
from friso.identification.inverse_model import inverse_model
from friso.identification.logs.assemble import read_log
from friso.identification.logs.gaps import GapsError
from friso.identification.logs.roles import Mapping, load_mapping, mapping_text, sidecar
from friso.identification.method import axis_of_all
from friso.identification.output_error.parameters import LONGEST_BRISTLE_BEND, SHORTEST_BRISTLE_BEND, bends
from friso.identification.stage_file import made_up

TURNING = Mapping(axis="rotary")


@pytest.fixture(scope="module")
def break_away(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Ramps of a torque, the same numbers as of a linear axis whose static friction is known."""
    log, folder = ramps(LUGRE, [1.0, 1.0, 5.0, 5.0], 1.0, np.random.default_rng(3)), tmp_path_factory.mktemp("turning")
    step, place, force = log.sample_time, log["position"], log["force"]
    time = np.concatenate([np.arange(part.stop - part.start) * step + 100 * i for i, part in enumerate(log.segments)])
    csv(folder / "linear.csv", "time [s],position [m],force [N]", time, place, force)
    csv(folder / "turned.csv", "time [s],angle [deg],torque [mN*m]", time, np.rad2deg(place), 1e3 * force)
    return folder


def test_angles_and_torques_are_in_si_under_the_units_of_a_linear_axis(break_away: Path) -> None:
    """A log of angles asks for the kind of axis alone."""
    linear, turned = read_log(break_away / "linear.csv"), read_log(break_away / "turned.csv", TURNING)
    assert (linear.axis, turned.axis) == (LINEAR, ROTARY)
    for role in ("position", "force"):
        assert turned[role] == pytest.approx(linear[role], rel=1e-7, abs=1e-15)
        assert turned.unit(role) == linear.unit(role)
    with pytest.raises(GapsError) as open_questions:
        read_log(break_away / "turned.csv", needed=("position", "force"))
    assert open_questions.value.options == ("--axis rotary",)


def test_a_rotary_log_is_told_once_and_answered_in_its_units(break_away: Path) -> None:
    """All numbers of static friction equal those of the linear axis; the option is stored beside the log."""
    options = ("--as", "break-away", "--axis", "rotary", "--out", "answer", "--json")
    answer = friso_inside(break_away, "identify", "turned.csv", *options)
    assert answer.returncode == 0, answer.stderr
    assert load_mapping(break_away / "turned.csv") == Mapping(experiment="break-away", axis="rotary")
    (result,) = json.loads(answer.stdout)["estimates"]
    static = static_from_ramps(read_log(break_away / "linear.csv")).static
    assert result["unit"] == "N*m"
    assert result["written"].count("N*m") == 2
    assert [result[end] for end in ("low", "value", "high")] == pytest.approx([static.low, static.value, static.high])
    assert not LENGTHS.search(answer.stderr + " ".join(texts(json.loads(answer.stdout))))
    asked = friso.identify(break_away / "turned.csv")
    assert "N·m" in asked.sentences()[0]
    assert not LENGTHS.search(" ".join([*asked.sentences(), *asked.details(), *texts(asked.document())]))


@pytest.mark.cases(first=1)
@pytest.mark.parametrize(("options", "unit"), [(("--scale", "force=0.08 N/A"), "N"), ((), "A")])
def test_a_break_away_in_amperes_is_answered_in_amperes(break_away: Path, options: tuple[str, ...], unit: str) -> None:
    """All texts and keys are in amperes unless the scale to newtons is given.

    A stage file in newtons asks for the scale.
    """
    rows = np.genfromtxt(break_away / "linear.csv", delimiter=",", skip_header=1)
    log = f"{unit}.csv"
    csv(break_away / log, "time [s],position [m],current [A]", *(rows * [1, 1, 12.5]).T)
    command = ("identify", log, "--as", "break-away", "--json", *options)
    answer = friso_inside(break_away, *command, "--out", f"answer_{unit}")
    assert answer.returncode == 0, answer.stderr
    document = json.loads(answer.stdout)
    (result,) = document["estimates"]
    static = static_from_ramps(read_log(break_away / "linear.csv")).static.value
    assert result["unit"] == unit
    assert result["value"] == pytest.approx(static * (12.5 if unit == "A" else 1), rel=1e-6)
    assert f"forces_{unit.lower()}" in document["experiments"][0]
    if unit == "A":
        stage = Path("examples/thesis_rig.toml").resolve()
        beside = friso_inside(break_away, *command, "--stage", stage, "--out", "beside")
        assert beside.returncode == 2
        assert '--scale force="NUMBER N/A"' in beside.stderr


def test_units_of_an_axis_whose_forces_are_in_another_unit() -> None:
    amperes = LINEAR.per("A")
    assert [amperes.unit(unit) for unit in ("N", "kN", "N*s/m", "kg", "m/s")] == ["A", "kA", "A*s/m", "A*s^2/m", "m/s"]
    assert amperes.text("2 mm with 3 N of 5 kg") == "2 mm with 3 A of 5 A*s^2/m"
    assert ROTARY.text("3 to 7 N*s/m, 2 N/m at 5 mm/s") == "3 to 7 N*m*s/rad, 2 N*m/rad at 5 mrad/s"
    assert [amperes.suffix(key) for key in ("force_n", "rate_n_per_s", "x_m")] == ["force_a", "rate_a_per_s", "x_m"]
    assert ROTARY.per("V").unit("kg") == "V*s^2/rad"
    volts = LINEAR.per("V")
    assert [volts.unit(unit) for unit in ("N/kg", "m/N")] == ["V/(V*s^2/m)", "m/V"]
    assert [ROTARY.unit(unit) for unit in ("N/kg", "m/kN", "1/kg")] == ["N*m/(kg*m^2)", "rad/(kN*m)", "1/(kg*m^2)"]
    assert ROTARY.suffix("drag_ns_per_m") == "drag_n_m_s_per_rad"


def test_a_stage_around_a_rotary_log_is_one_of_a_rotary_axis() -> None:
    log = axis()
    linear, turned = (made_up(one, inverse_model(one, 5.0)) for one in (log, replace(log, axis=ROTARY)))
    assert turned.axis_kind == ROTARY
    assert {key: value for key, value in turned.flat().items() if key != "axis.kind"} == linear.flat()
    assert bends(linear.axis_kind) == (SHORTEST_BRISTLE_BEND, LONGEST_BRISTLE_BEND)
    assert bends(turned.axis_kind)[1] > LONGEST_BRISTLE_BEND


def test_logs_and_stage_are_of_one_kind_of_axis_and_unit_of_force(tmp_path: Path) -> None:
    log, turned = axis(), replace(axis(), axis=ROTARY)
    assert axis_of_all([turned], None) == ROTARY
    for logs, stage, key in (
        ([log, replace(turned, name="other")], None, "--axis"),
        ([turned], friso.load("examples/emps_axis.toml"), "--axis"),
        ([log, replace(log, name="other", axis=LINEAR.per("A"))], None, "force"),
    ):
        with refused(key):
            axis_of_all(logs, stage)
    sidecar(tmp_path / "log.csv").write_text(mapping_text(Mapping(axis="round")))
    with refused("--axis"):
        load_mapping(tmp_path / "log.csv")
