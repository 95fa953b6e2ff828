"""Files and values that are no stage files: devices, pipes, foreign names, wrong types."""

import inspect
import os
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from inside import friso_inside
from refusals import refused
from systems import posix

import friso
from friso.errors import InputError
from friso.interface.inputs import stage_of

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


QUESTIONS = {name: getattr(friso, name) for name in ("check", "bode", "simulate", "tune", "flexure", "reproduce")}


@pytest.mark.parametrize("name", QUESTIONS)
def test_an_argument_of_another_type_is_named(name: str) -> None:
    stage = {} if name == "reproduce" else {"stage": RIG}
    named = {"rtol", "seed", "only", "series", "stroke", "sample_time", "points"}
    for parameter in named & inspect.signature(QUESTIONS[name]).parameters.keys():
        for value in (np.array([1.0, 2.0]), {"a": {}}, object(), b"x", complex(1, 1)):
            with refused(parameter):
                QUESTIONS[name](**stage, **{parameter: value})


def test_huge_values_of_a_log_are_shown_as_far_as_a_picture_can(tmp_path: Path) -> None:
    rows = [f"{i}e305,{1.7e308 * (-1) ** i},{i * 1e-320}" for i in range(20)]
    (tmp_path / "log.csv").write_text("\n".join(["time [s],position [m],force [N]", *rows]), "utf-8")
    answer = friso.logs(tmp_path / "log.csv")
    assert any("1.7e+308" in text for _, texts in answer.tables()[0].rows for text in texts)
    drawn = answer.figures()[0].panels[0]
    assert "not drawn" in drawn.title


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
