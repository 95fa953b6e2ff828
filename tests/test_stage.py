"""Stage files that are right: values, defaults, round trip, changes, sweeps."""

import copy
import math
import pickle
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from refusals import refused
from systems import posix

from friso.errors import InputError
from friso.interface.inputs import stage_of
from friso.quantities import Quantity, Value, any_sign, positive
from friso.stage import Stage, load, loads, numeric_keys, parse_set, save, violations

ROOT = Path(__file__).parents[1]
EXAMPLES = sorted((ROOT / "examples").glob("*.toml"))
TEMPLATE = ROOT / "friso" / "templates" / "stage.toml"
THESIS_RIG = ROOT / "examples" / "thesis_rig.toml"

RIGID = """
[masses]
stage = "2 kg"
[controller]
kind = "pid"
kp = "3 N/m"
[motion]
kind = "hold"
duration = "1 s"
"""


@pytest.fixture(scope="module")
def rig() -> Stage:
    return load(THESIS_RIG)


def test_thesis_rig_in_si(rig: Stage) -> None:
    """Plain values of Python."""
    numbers = {
        "masses": {"cart": 1.2, "stage": 0.5},
        "friction": {"static": 3.0, "coulomb": 1.0, "stribeck_velocity": 0.0016, "stribeck_exponent": 2.0}
        | {"bristle_stiffness": 1e5, "bristle_damping": 316.2277660168379, "viscous": 0.5, "model": "lugre"},
        "joint": {"stiffness": 2400.0, "damping": 0.5, "stroke": 0.001, "limiter_stiffness": 2e7}
        | {"limiter_damping": 100.0, "locked": False},
        "parasitic": {"frequency": 300.0, "mass": 0.25, "damping_ratio": 0.01},
        "controller": {"kind": "pid", "crossover": 8.0, "alpha": 0.1, "beta": 2.0, "tuned_mass": 1.7},
        "motion": {"kind": "there_and_back", "acceleration": 100.0, "acceleration_time": 0.03}
        | {"return_at": 5.0, "duration": 20.0},
    }
    assert rig.flat() == {f"{table}.{key}": value for table, keys in numbers.items() for key, value in keys.items()}
    assert {type(value) for value in rig.flat().values()} == {float, bool, str}


def test_defaults_of_a_rigid_mass_without_friction() -> None:
    assert loads(RIGID).flat() == {
        "masses.stage": 2.0,
        "friction.model": "none",
        "controller.kind": "pid",
        "controller.derivative_on": "error",
        "controller.kp": 3.0,
        "controller.ki": 0.0,
        "controller.kd": 0.0,
        "controller.tau": 0.0,
        "motion.kind": "hold",
        "motion.duration": 1.0,
    }


def test_emps_gains_follow_from_the_recorded_loop() -> None:
    flat = load(ROOT / "examples" / "emps_axis.toml").flat()
    gtau, kp, kv = 35.1507, 160.18, 243.45  # N/V, 1/s, V s/m: data/README of the record
    assert flat["controller.kv"] * flat["controller.kp"] == pytest.approx(gtau * kv * kp, rel=1e-12)
    assert flat["controller.kp"] == pytest.approx(gtau * kv, rel=1e-12)
    assert flat["controller.force_limit"] == pytest.approx(10 * gtau, rel=1e-12)
    assert flat["controller.anti_windup"] == "clamp"


@pytest.mark.parametrize(
    ("text", "unit", "si"),
    [
        ("2.4N/mm", "N/m", 2400.0),
        ("  2.4   N / mm ", "N/m", 2400.0),
        ("+.5e1 kN/m", "N/m", 5000.0),
        ("3 µm", "m", 3e-6),
        ("3 μm", "m", 3e-6),
        ("0.5 min", "s", 30.0),
        ("-0 mm", "m", 0.0),
        ("0e999 mm", "m", 0.0),
        ("1 inch", "m", 0.0254),
        ("2 lbf", "N", 8.896443230521),
        ("9.81 m/s²", "m/s^2", 9.81),
        ("9.81 m/s**2", "m/s^2", 9.81),
        ("9.81 m s^-2", "m/s^2", 9.81),
        ("9.81 m·s⁻²", "m/s^2", 9.81),
        ("4 N/(mm s)", "N/(m*s)", 4000.0),
        ("0.3 kHz", "Hz", 300.0),
        ("50 rad/s", "Hz", 7.957747154594768),
        ("480 rpm", "Hz", 8.0),
        ("8 turn/s", "Hz", 8.0),
        ("2880 deg/s", "Hz", 8.0),
    ],
)
def test_units(text: str, unit: str, si: float) -> None:
    value = Quantity(unit, any_sign, "").read(text)
    assert value == si
    assert value.text == text


def test_unit_factor_converts_arrays() -> None:
    assert Quantity("m", positive, "1 mm").factor("mm") == 1e-3
    assert Quantity("Hz", positive, "8 Hz").factor("rad/s") == 1 / (2 * math.pi)
    with pytest.raises(InputError):
        Quantity("m", positive, "1 mm").factor("kg")


@pytest.mark.cases(first=10)
@pytest.mark.parametrize("path", [*EXAMPLES, TEMPLATE], ids=lambda path: path.stem)
def test_round_trip(path: Path, tmp_path: Path) -> None:
    stage = load(path)
    save(stage, tmp_path / "again.toml")
    again = load(tmp_path / "again.toml")
    assert (again, again.flat(), again.as_written()) == (stage, stage.flat(), stage.as_written())
    assert again.to_toml() == stage.to_toml()
    assert stage.source or path == TEMPLATE  # a machine of one's own has another source


def test_numbers_are_written_as_people_do_and_read_again_as_the_same(rig: Stage) -> None:
    numbers = {"joint.limiter_stiffness": 1.9e7, "joint.stroke": 0.1 + 0.2, "joint.damping": -0.0}
    stage = rig.with_numbers(numbers)
    assert [line for line in stage.to_toml().splitlines() if "-0" in line or ".0 " in line] == []
    assert {key: stage.flat()[key] for key in numbers} == numbers


def test_template_with_its_optional_lines_loads() -> None:
    """Only the alternative form of the controller stays commented out."""
    lines = TEMPLATE.read_text(encoding="utf-8").splitlines()
    other_form = ("# kp", "# ki", "# kd", "# tau", "# derivative_on", "# kind")
    inputs = [line if line.startswith(other_form) else re.sub(r"^# (\[|\w+ = )", r"\1", line) for line in lines]
    whole = loads("\n".join(inputs))
    assert load(TEMPLATE).flat().keys() < whole.flat().keys()
    assert {"parasitic.damping_ratio", "drive.ripple", "rail.first_harmonic", "cable.drag"} <= whole.flat().keys()
    assert whole.floor is not None
    assert loads(whole.to_toml()) == whole


def test_a_controller_in_another_form_replaces_that_of_the_file(rig: Stage) -> None:
    """For example, friso's own choice in an identified stage is replaced by the machine's gains."""
    stage = rig.replace({"controller.kp": "3 N/m", "controller.force_limit": "5 N"})
    assert stage.as_written()["controller"] == {"kind": "pid", "kp": "3 N/m", "force_limit": "5 N"}
    for more in ({"tau": "1 ms"}, {"derivative_on": "measurement"}):
        gains = {"kind": "pid", "kp": "3 N/m", "ki": "4 N/(m*s)", "kd": "6 N*s/m", **more}
        assert rig.replace({"controller": gains}).flat()["controller.kd"] == 6.0


@pytest.mark.parametrize("changes", [{"joint": {1: 2}}, {3: 4}, ["masses.stage"], np.zeros(2), {"name": "\ud800"}])
def test_what_is_no_change_of_a_stage_is_refused(rig: Stage, changes: Any) -> None:
    with pytest.raises(InputError):
        rig.replace(changes)


def test_sections_from_python_are_checked(rig: Stage) -> None:
    """A section of another table is refused, and a value nested too deeply to be shown."""
    with refused("cart"):
        type(rig.masses)(cart="3 m")  # pyright: ignore[reportArgumentType]
    with refused("motion"):
        Stage(**{**rig.as_written(), "motion": rig.masses})
    deep: dict[str, object] = {}
    for _ in range(5000):
        deep = {"a": deep}
    with refused("name"):
        rig.replace({"name": deep})


def test_texts_survive_saving(rig: Stage) -> None:
    awkward = 'tab\t quote" back\\slash \x00\x7f\x85 newline\n µ 漢 🙂 \u2028'
    stage = rig.replace({"name": awkward, "joint.stroke": "1000 um"})
    assert loads(stage.to_toml()).name == awkward
    assert 'stroke = "1000 um"' in stage.to_toml()


def test_byte_order_mark_and_windows_line_ends(tmp_path: Path, rig: Stage) -> None:
    path = tmp_path / "windows.toml"
    path.write_bytes(b"\xef\xbb\xbf" + THESIS_RIG.read_bytes().replace(b"\n", b"\r\n"))
    assert load(path) == rig


def test_save_keeps_an_existing_file(tmp_path: Path, rig: Stage) -> None:
    path = tmp_path / "rig.toml"
    path.write_text("precious", encoding="utf-8")
    with refused():
        save(rig, path)
    assert path.read_text(encoding="utf-8") == "precious"
    save(rig, path, overwrite=True)
    assert load(path) == rig
    assert [*tmp_path.iterdir()] == [path]


@posix
@pytest.mark.parametrize("mode", [0o600, 0o664])
def test_save_keeps_permissions_and_links(tmp_path: Path, rig: Stage, mode: int) -> None:
    file, link = tmp_path / "rig.toml", tmp_path / "link.toml"
    file.write_text("")
    file.chmod(mode)
    link.symlink_to(file)
    save(rig, link, overwrite=True)
    assert load(file) == rig
    assert (link.is_symlink(), file.stat().st_mode & 0o777) == (True, mode)


def test_save_refuses_what_may_not_be_written(tmp_path: Path, rig: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file that is read-only, a folder that is not there, and a device of Windows."""
    file = tmp_path / "rig.toml"
    file.write_text("mine")
    file.chmod(0o400)
    with pytest.raises(InputError, match="read-only"):
        save(rig, file, overwrite=True)
    with refused():
        save(rig, tmp_path / "missing" / "rig.toml")
    monkeypatch.setattr("friso.platform.files.name_refused", lambda path: f"{path.name} is a device")
    with pytest.raises(InputError, match=r"con\.toml is a device"):
        save(rig, tmp_path / "con.toml")
    assert ([*tmp_path.iterdir()], file.read_text()) == ([file], "mine")


def test_replace(rig: Stage) -> None:
    """Values of another stage are taken, keys removed by None, and the form of the controller changed."""
    changed = rig.replace({"controller.crossover": "12 Hz", "joint.locked": True, "name": "Other"})
    assert (changed.flat()["controller.crossover"], changed.flat()["joint.locked"]) == (12.0, True)
    assert changed.name == "Other"
    assert rig.flat()["controller.crossover"] == 8.0
    rigid = rig.replace({"joint": None, "parasitic": None, "friction": None})
    assert rigid.joint is None
    assert rigid.flat()["friction.model"] == "none"
    locked = rig.replace({"joint.locked": True, "joint.stiffness": None, "joint.damping": None, "joint.stroke": None})
    assert "joint.stiffness" not in locked.flat()
    rules = dict.fromkeys(["controller.crossover", "controller.alpha", "controller.beta", "controller.tuned_mass"])
    for gains in ({**rules, "controller.kp": "3 N/m"}, {"controller": {"kind": "pid", "kp": "3 N/m"}}):
        assert rig.replace(gains).flat()["controller.kp"] == 3.0
    taken = rig.replace({"joint.limiter_stiffness": rig.joint and rig.joint.stiffness, "joint.stroke": "0 mm"}).flat()
    assert taken["joint.limiter_stiffness"] == pytest.approx(2400)
    assert taken["joint.stroke"] == 0.0


@pytest.mark.parametrize(
    ("text", "key", "value"),
    [
        ("controller.crossover=12 Hz", "controller.crossover", "12 Hz"),
        ('controller.crossover="12 Hz"', "controller.crossover", "12 Hz"),
        (" controller.alpha = 0.2 ", "controller.alpha", 0.2),
        ("joint.locked=true", "joint.locked", True),
        ("joint.locked=True", "joint.locked", "True"),
        ("controller.beta=2", "controller.beta", 2),
        ("name=a=b", "name", "a=b"),
        ("name=", "name", ""),
        ("name=3 # no comment", "name", "3 # no comment"),
        ("name=1}\nx={y=2", "name", "1}\nx={y=2"),
        ("name=1, other = 2", "name", "1, other = 2"),
        ("name=" + "[" * 5000, "name", "[" * 5000),
    ],
)
def test_parse_set(text: str, key: str, value: object) -> None:
    assert parse_set(text) == (key, value)


def test_swept_values_move_the_defaults_that_follow_them(rig: Stage) -> None:
    cart = np.array([1.0, 2.0])
    stage = rig.replace({"controller.tuned_mass": None})
    np.testing.assert_array_equal(stage.flat({"masses.cart": cart})["controller.tuned_mass"], cart + 0.5)
    assert rig.flat({"masses.cart": cart})["controller.tuned_mass"] == 1.7
    with refused("controller.crossovr"):
        rig.flat({"controller.crossovr": cart})


def test_violations_tell_cells_apart(rig: Stage) -> None:
    assert violations(rig.flat()) == []
    swept = {
        "masses.cart": np.array([1.0, 0.0, 1.0, np.nan]),
        "friction.coulomb": np.array([1.0, 1.0, 4.0, 1.0]),
        "parasitic.mass": 0.5,
    }
    broken = violations(rig.flat(swept))
    result = {tuple(re.findall(r"[a-z]+\.[a-z]+", why)): np.broadcast_to(where, 4).tolist() for where, why in broken}
    assert result == {
        ("masses.cart",): [False, True, False, True],
        ("friction.coulomb", "friction.static"): [False, False, True, False],
        ("parasitic.mass", "masses.stage"): [True] * 4,
    }


def test_numeric_keys_have_units(rig: Stage) -> None:
    units = {key: field.unit for key, field in numeric_keys(rig.flat()).items()}
    assert units["controller.crossover"] == "Hz"
    assert units["friction.static"] == "N"
    assert units["controller.alpha"] == ""
    assert units["controller.force_limit"] == "N"  # absent from the file, but may be swept
    assert "joint.locked" not in units


def test_stages_copy_pickle_and_are_frozen_and_hashable(rig: Stage) -> None:
    assert pickle.loads(pickle.dumps(rig)).to_toml() == rig.to_toml()
    assert copy.deepcopy(Value(0.03, "30 ms")).text == "30 ms"
    error = pickle.loads(pickle.dumps(InputError("key", "given", "expected", "example", "origin")))
    assert str(error) == "origin: key\n  given:    given\n  expected: expected\n  example:  example"
    with pytest.raises(AttributeError, match=r"stage\.replace"):
        rig.name = "other"
    assert hash(rig) == hash(load(THESIS_RIG))


@pytest.mark.parametrize("value", ["12", "12.0", "12hz", "12 HZ", " 12 Hz "])
def test_a_typed_number_has_the_unit_in_which_the_file_has_the_key(rig: Stage, value: str) -> None:
    assert stage_of(rig, [f"controller.crossover={value}"]).flat()["controller.crossover"] == 12.0


def test_no_unit_is_guessed_that_may_be_another(rig: Stage) -> None:
    """No unit is suggested if capitals mean another one."""
    mega = rig.replace({"controller.crossover": "0.00001 MHz"})
    with pytest.raises(InputError, match="unit"):
        stage_of(mega, ["controller.crossover=5 mHZ"])
    assert stage_of(mega, ["controller.crossover=9000 mHz"]).flat()["controller.crossover"] == pytest.approx(9.0)
    assert stage_of(mega, ["controller.crossover=0.00002"]).flat()["controller.crossover"] == pytest.approx(20.0)
    assert stage_of(rig.replace({"masses.cart": "1 kg +/- 1 %"}), ["masses.cart=2 kg"]).flat()["masses.cart"] == 2.0
    assert stage_of(rig.replace({"name": "2 axis"}), ["name=3 rows"]).name == "3 rows"
