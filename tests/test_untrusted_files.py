"""Files and values that are no stage files: devices, pipes, foreign names, wrong types."""

import inspect
import json
import os
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from inside import friso_inside
from refusals import refused, rows_of
from systems import posix

import friso
from friso.errors import InputError
from friso.interface.inputs import stage_of
from friso.stage.tables_of_files import MOST_BYTES

EXAMPLES = Path(__file__).parent.parent / "examples"
RIG = EXAMPLES / "thesis_rig.toml"
AXIS = EXAMPLES / "drives" / "linuxcnc_torque_axis.ini"
MACHINE = {
    **{"force_per_output": "10 N"},
    **{"masses.stage": "3 kg", "friction.model": "none"},
    **{"motion.acceleration": "1 m/s^2", "motion.acceleration_time": "30 ms"},
}


@posix
@pytest.mark.parametrize("place", ["/dev/zero", "pipe"])
def test_devices_and_pipes_are_refused_at_once(place: str, tmp_path: Path) -> None:
    file = Path(place) if place.startswith("/") else tmp_path / place
    if not file.exists():
        os.mkfifo(file)
    for read in (
        friso.load,
        lambda path: friso.export(path),
        lambda path: friso.init(tmp_path / "new.toml", from_=path),
    ):
        with pytest.raises(InputError, match="a device or a pipe"):
            read(file)


def test_a_text_file_has_a_largest_size_and_a_name_a_longest(tmp_path: Path) -> None:
    with (tmp_path / "huge.toml").open("wb") as file:
        file.truncate(MOST_BYTES + 1)
    for name, reason in (("huge.toml", "MB"), ("x" * 5000, "name")):
        with pytest.raises(InputError, match=reason):
            friso.load(tmp_path / name)


@pytest.mark.slow
def test_a_table_of_countless_keys_is_refused_at_once() -> None:
    """For each of which the nearest known one would be looked for."""
    text = (RIG).read_text(encoding="utf-8")
    keys = "".join(f"k{number} = 1\n" for number in range(15_000))
    for place in ("", "[masses]\n"):
        with pytest.raises(InputError, match="a table of 1500"):
            friso.loads(text.replace(place, place + keys, 1))


@pytest.mark.slow
@posix
def test_a_file_whose_name_is_no_text_is_answered(tmp_path: Path) -> None:
    """A name so long that no suffix fits is answered as well."""
    for name, stem in ((b"r\xffg", "r_g"), ("ä".encode() * 120, "ä" * 75)):
        file = tmp_path / os.fsdecode(name + b".toml")
        file.write_bytes((EXAMPLES / "lugre_stick_slip.toml").read_bytes())
        out = tmp_path / os.fsdecode(b"o\xff" + stem[0].encode())
        done = friso_inside(tmp_path, "simulate", file, "--out", out)
        assert done.returncode == 0, done.stderr
        assert (out / f"{stem}_response.csv").exists()


def test_a_stage_is_not_saved_over_a_file_that_appears_meanwhile(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place, stage = tmp_path / "a.toml", friso.load(RIG)

    def text(stage: friso.Stage) -> str:
        place.write_text("mine")
        return ""

    monkeypatch.setattr(friso.Stage, "to_toml", text)
    with pytest.raises(InputError):
        friso.save(stage, place)
    assert ([*tmp_path.iterdir()], place.read_text()) == ([place], "mine")


@pytest.mark.cases(first=1)
@posix
@pytest.mark.parametrize("arguments", [[], ["schema"]])
@pytest.mark.parametrize(("way", "status"), [(">/dev/full", 1), ("<&- >&- 2>&-", 0)])
def test_where_nothing_can_be_printed_there_is_no_traceback(
    tmp_path: Path, arguments: list[str], way: str, status: int
) -> None:
    line = shlex.join([sys.executable, "-m", "friso", *arguments])
    done = subprocess.run(["sh", "-c", f"{line} {way}"], cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    assert done.returncode == status
    assert "Traceback" not in done.stderr


def test_every_public_function_checks_its_arguments() -> None:
    functions = [getattr(friso, name) for name in dir(friso) if inspect.isfunction(getattr(friso, name))]
    assert [function.__name__ for function in functions if not hasattr(function, "__wrapped__")] == []


RANGES = {"controller.crossover": "2 Hz..16 Hz", "joint.stroke": "0.1 mm..1 mm"}


@pytest.mark.cases(first=19)
@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("samples", value) for value in (0, 1.5, True, "8", {}, float("nan"), 10**17, 10**5000)),
        *(("export", value) for value in ("", 3, [3], [b"a.nc"], [""], ["x" * 300 + ".nc"], ["a\0.nc"])),
        *(("export", value) for value in (["nowhere/a.nc"], ["a.xls"], ["folder.nc"], {"a.nc": 1, "b": 2})),
        *(("out", value) for value in ("", "/", "x" * 5000, "x" * 201, "x/" * 1500, "a\0b", 3)),
        *(("stage", value) for value in ("", "x" * 5000, 3, None)),
    ],
    ids=lambda value: repr(value)[:20] if not isinstance(value, int) else "number",
)
def test_a_sweep_refuses_arguments_of_other_types_and_writes_nothing(
    name: str, value: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder.nc").mkdir()
    with refused() as refusal:
        friso.sweep(**{"stage": friso.load(RIG), "axes": RANGES, "samples": 8, name: value})
    assert max(map(len, str(refusal.value).splitlines())) < 200
    assert [*tmp_path.rglob("*")] == [tmp_path / "folder.nc"]


@pytest.mark.parametrize(
    ("option", "path"), [("--out", ""), ("--out=", ""), ("--out", "x/" * 1500), ("--export", "x" * 201)]
)
def test_a_map_refuses_paths_that_are_none_and_writes_nothing(option: str, path: str, tmp_path: Path) -> None:
    words = [option + path] if option.endswith("=") else [option, f"{path}.nc" if "port" in option else path]
    done = friso_inside(tmp_path, "map", RIG, "--x", "joint.stroke=0.1 mm..1 mm:3", *words)
    assert done.returncode == 2
    assert option.rstrip("=") in done.stderr.splitlines()[0]
    assert rows_of(done.stderr)
    assert [*tmp_path.iterdir()] == []


@posix
def test_the_name_of_a_parameter_file_writes_no_table(tmp_path: Path) -> None:
    source = tmp_path / "a\n[evil]\nx = 1\x1b.ini"
    source.write_bytes(AXIS.read_bytes())
    place = friso.init(tmp_path / "new.toml", from_=source, set=MACHINE)
    assert "evil" not in {table for table in place.read_text("utf-8").splitlines() if table.startswith("[")}
    assert friso.load(place).masses.stage is not None


def test_init_does_not_replace_what_it_reads(tmp_path: Path) -> None:
    stage = tmp_path / "stage.toml"
    stage.write_bytes((EXAMPLES / "lugre_stick_slip.toml").read_bytes())
    done = friso_inside(tmp_path, "init", "stage.toml", "--spec", "stage.toml", "--overwrite")
    assert done.returncode == 2
    assert stage.read_bytes() == (EXAMPLES / "lugre_stick_slip.toml").read_bytes()


@posix
def test_a_dangling_link_is_a_file_that_exists(tmp_path: Path) -> None:
    (tmp_path / "new.toml").symlink_to("nowhere")
    with pytest.raises(InputError, match="already exists"):
        friso.init(tmp_path / "new.toml")
    assert (tmp_path / "new.toml").is_symlink()


@pytest.mark.parametrize(
    "gains",
    [
        {"kp": "1e30 N/m", "ki": "1 N/(m*s)", "kd": "1 N*s/m"},
        {"kp": "1e10 N/m", "ki": "1 N/(m*s)", "kd": "1e-30 N*s/m"},
        {"kp": "1e-30 N/m", "ki": "1e-30 N/(m*s)", "kd": "1e-30 N*s/m"},
        {"kp": "1e30 N/m", "ki": "1e-30 N/(m*s)", "kd": "1e-30 N*s/m"},
    ],
)
def test_gains_beyond_all_drives_are_refused_or_left_out(gains: dict[str, str]) -> None:
    controller = {"kind": "pid", **gains, "derivative_on": "measurement"}
    try:
        stage = friso.load(EXAMPLES / "lugre_stick_slip.toml").replace({"controller": controller})
        document = friso.export(stage).to_dict()
    except InputError:
        return
    json.dumps(document, allow_nan=False)


QUESTIONS = {name: getattr(friso, name) for name in ("check", "bode", "simulate", "tune", "flexure", "reproduce")}


@pytest.mark.parametrize("name", QUESTIONS)
def test_an_argument_of_another_type_is_named(name: str) -> None:
    stage = {} if name == "reproduce" else {"stage": RIG}
    named = {"rtol", "seed", "only", "series", "stroke", "sample_time", "points"}
    for parameter in named & inspect.signature(QUESTIONS[name]).parameters.keys():
        for value in (np.array([1.0, 2.0]), {"a": {}}, object(), b"x", complex(1, 1)):
            with refused(parameter):
                QUESTIONS[name](**stage, **{parameter: value})


@pytest.mark.parametrize("choice", [np.array([1.0, 2.0]), 3, None, [], b"gains", float("nan")])
def test_a_choice_of_another_type_is_refused(choice: Any) -> None:
    asked = [lambda: friso.example(choice), lambda: friso.schema(choice)]
    asked += [lambda: friso.export(RIG, to=choice)] if choice is not None else []
    for ask in asked:
        with refused():
            ask()


@pytest.mark.parametrize("draws", ["6", b"3", True, 2.5, pytest.param(10**5000, id="long")])
def test_a_whole_number_of_another_type_is_refused(draws: object) -> None:
    with refused("draws") as refusal:
        friso.check(RIG, draws=draws)  # type: ignore[arg-type]
    assert ("from 1 to 100000" in refusal.value.expected) == (type(draws) is int)


def test_changes_of_another_type_are_refused() -> None:
    array, stage = np.array([1.0, 2.0]), friso.load(RIG)
    for changes in (3.0, True, [float("nan")], [b"x"], array, {3: 4}, "masses.cart=1 kg"):
        with refused("set"):
            friso.export(RIG, set=changes)  # type: ignore[arg-type]
    for changes in ({"joint": {1: 2}}, {3: 4}, ["masses.stage"], array, "masses.stage"):
        with pytest.raises(InputError):
            stage.replace(changes)  # type: ignore[arg-type]
    with refused("stage"):
        friso.export({3: 4})  # type: ignore[dict-item]
    with pytest.raises(InputError, match="set="):
        friso.check(RIG, {"masses.cart": "1 kg"})  # type: ignore[arg-type]
    with refused("within"):
        friso.tune(RIG, within="1e200 m")


def test_huge_values_of_a_log_are_shown_as_far_as_a_picture_can(tmp_path: Path) -> None:
    rows = [f"{i}e305,{1.7e308 * (-1) ** i},{i * 1e-320}" for i in range(20)]
    (tmp_path / "log.csv").write_text("\n".join(["time [s],position [m],force [N]", *rows]), "utf-8")
    answer = friso.logs(tmp_path / "log.csv")
    assert any("1.7e+308" in text for _, texts in answer.tables()[0].rows for text in texts)
    drawn = answer.figures()[0].panels[0]
    assert "not drawn" in drawn.title


def line_of_gain(axis: list[str]) -> int:
    return next(k for k, line in enumerate(axis) if line.startswith("P "))


@pytest.mark.parametrize("number", ["2_0", "\u0663", "0x10", "1" + 400 * "0"])
def test_numbers_of_a_parameter_file_are_those_that_drives_read(number: str, tmp_path: Path) -> None:
    lines = AXIS.read_text("utf-8").splitlines()
    lines[line_of_gain(lines)] = f"P = {number}"
    (tmp_path / "axis.ini").write_text("\n".join(lines), "utf-8")
    with refused("P"):
        friso.init(tmp_path / "new.toml", from_=tmp_path / "axis.ini", set=MACHINE)


def test_a_move_without_acceleration_is_asked_for(tmp_path: Path) -> None:
    lines = [line for line in AXIS.read_text("utf-8").splitlines() if not line.startswith("MAX_ACCELERATION")]
    lines.insert(line_of_gain(lines), "MAX_ACCELERATION = 0")
    (tmp_path / "axis.ini").write_text("\n".join(lines), "utf-8")
    machine = {key: value for key, value in MACHINE.items() if not key.startswith("motion")}
    with pytest.raises(InputError, match=r"motion\.acceleration"):
        friso.init(tmp_path / "new.toml", from_=tmp_path / "axis.ini", set=machine)


@pytest.mark.parametrize("key", ["torqe_per_output", "mass", ""])
def test_an_answer_to_no_question_is_refused(key: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="force_per_output"):
        friso.init(tmp_path / "new.toml", from_=AXIS, set={**MACHINE, key: "3 kg"})
    assert not (tmp_path / "new.toml").exists()


@pytest.mark.parametrize("text", ['masses.stage="0.6 kg', "masses.stage = '0.6 kg"])
def test_a_quote_that_is_not_closed_is_shown(text: str) -> None:
    with pytest.raises(InputError) as caught:
        friso.export(RIG, set=[text])
    _, line, caret = caught.value.actual.splitlines()
    assert line[caret.index("^")] in "\"'"


def test_changes_supply_what_a_file_lacks(tmp_path: Path) -> None:
    text = (RIG).read_text("utf-8")
    assert 'model = "lugre"' in text
    (tmp_path / "stage.toml").write_text(text.replace('model = "lugre"', ""), "utf-8")
    with pytest.raises(InputError, match=r"friction\.model"):
        friso.export(tmp_path / "stage.toml", to="odrive")
    assert stage_of(tmp_path / "stage.toml", {"friction.model": "lugre"}) == friso.load(RIG)


def test_an_axis_is_chosen_by_its_letter(tmp_path: Path) -> None:
    """A section with a huge number is no axis."""
    source, text = tmp_path / "axis.ini", AXIS.read_text("utf-8")
    lines = [line for line in text.splitlines() if not line.startswith("COORDINATES")]
    chosen = "\n".join(lines).replace("[TRAJ]", "[TRAJ]\nCOORDINATES = X Y")
    source.write_text(f"{chosen}\n[JOINT_{5000 * '9'}]\nP = 3\n", "utf-8")
    named = friso.init(tmp_path / "a.toml", from_=source, axis="X", set=MACHINE).read_text("utf-8")
    assert named == friso.init(tmp_path / "b.toml", from_=source, set=MACHINE).read_text("utf-8")
    assert friso.loads(named).masses.stage is not None


@pytest.mark.parametrize(("name", "hint"), [("axis.ini", "--from"), ("log.csv", "friso logs"), ("no.zarr", "store")])
def test_files_for_other_commands_are_recognised(name: str, hint: str, tmp_path: Path) -> None:
    if not name.endswith(".zarr"):
        (tmp_path / name).write_text("[JOINT_0]\nP = x,y\n", "utf-8")
    with pytest.raises(InputError, match=hint):
        friso.load(tmp_path / name)
