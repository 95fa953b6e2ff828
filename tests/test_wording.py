"""What commands say, compared with tests/snapshots: a run of each, its help, a mistake and its page.

Facts are tested elsewhere; a new wording is read once and kept by `pytest --refresh-snapshots`. Slow commands run in
their own tests, which keep their texts as well.
"""

from pathlib import Path

import pytest
from inside import friso_inside
from pages import Page
from snapshots import Snapshots, alike, masked

from friso.cli.app import COMMANDS

TESTS = Path(__file__).parent
EXAMPLES = TESTS.parent / "examples"
RIG, DRIVE, LEAVES = (EXAMPLES / f"thesis_{name}.toml" for name in ("rig", "drive", "leaves"))
STICK_SLIP = EXAMPLES / "lugre_stick_slip.toml"


MISTAKES = {
    "init": ("no/folder/stage.toml",),
    "check": (RIG, "--set", "controller.crosover=8 Hz"),
    "simulate": (RIG, "--sample-time", "1 mm"),
    "map": (RIG, "--x", "controller.crossover=2 Hz..1 Hz:3"),
    "bode": (RIG, "--frequencies", "2 Hz..1 Hz"),
    "boundary": (RIG, "--x", "controller.crossover=4 Hz"),
    "flexure": (RIG,),
    "design": (RIG, RIG),
    "logs": ("nowhere.csv",),
    "export": (RIG, "--to", "siemens"),
    "identify": ("nowhere.csv",),
    "rig": ("stifness", DRIVE),
    "compare": (DRIVE, "--machines", "19"),
    "tune": (RIG, "--within", "1 s"),
    "reproduce": ("masses", "--out", "out"),
    "guideline": ("--samples", "63"),
    "doctor": ("--jsom",),
    "example": ("thesis",),
    "schema": ("--of", "design"),
    "app": ("missing.toml", "--no-browser"),
}

RUNS = {
    "init": ("init", "stage.toml"),
    "check": ("check", RIG, "--out", "out"),
    "simulate": ("simulate", STICK_SLIP, "--sample-time", "10 ms", "--out", "out"),
    "map": ("map", RIG, "--x", "controller.crossover=4 Hz..12 Hz:3", "--y", "joint.stroke=0.1 mm..1 mm:2"),
    "bode": ("bode", RIG, "--out", "out"),
    "boundary": ("boundary", RIG, "--set", "joint.locked=true", "--x", "controller.crossover=9.5 Hz..10 Hz"),
    "flexure": ("flexure", LEAVES, "--out", "out"),
    "rig": ("rig", "stiffness", DRIVE, "--out", "out"),
    "export": ("export", RIG, "--out", "out"),
}


@pytest.fixture(autouse=True)
def narrow(monkeypatch: pytest.MonkeyPatch, undrawn: None) -> None:
    """A narrow terminal, and no time for pictures, which say nothing here."""
    monkeypatch.setenv("COLUMNS", "80")


def test_every_command_has_its_words_here() -> None:
    assert sorted(MISTAKES) == list(COMMANDS)


@pytest.mark.cases(first=6)
@pytest.mark.parametrize("command", MISTAKES)
def test_help(command: str, tmp_path: Path, snapshots: Snapshots) -> None:
    done = friso_inside(tmp_path, command, "--help")
    assert (done.returncode, done.stderr) == (0, "")
    assert f"Example: friso {command}" in done.stdout
    snapshots.check(command, "help", done.stdout)


@pytest.mark.cases(first=13)
@pytest.mark.parametrize("command", MISTAKES)
def test_a_mistake(command: str, tmp_path: Path, snapshots: Snapshots) -> None:
    done = friso_inside(tmp_path, command, *MISTAKES[command])
    assert (done.returncode, done.stdout) == (2, "")
    snapshots.check(command, "mistake", done.stderr)


LONG = dict.fromkeys(("boundary", "check"), pytest.mark.thorough) | {"bode": pytest.mark.slow}


@pytest.mark.parametrize("command", [pytest.param(name, marks=LONG.get(name, ())) for name in RUNS])
def test_a_run(command: str, tmp_path: Path, snapshots: Snapshots) -> None:
    done = friso_inside(tmp_path, *RUNS[command])
    assert done.returncode == 0
    snapshots.check(command, "run", done.stdout)
    for page in (tmp_path / "out").glob("*.html"):
        snapshots.check(command, "page", Page(page.read_text(encoding="utf-8")).lines)


def test_what_is_compared() -> None:
    """Words and numbers as far as they tell; no folders, widths of tables or last digits."""
    one = masked("wrote /tmp/a/b.png\n──── ± 0.5201 mm  takes 3 s\n| x |  hunts")
    assert alike(one, masked("wrote /home/c/b.png\n── ± 0.5199 mm takes 4 s\n│ x │ hunts"))
    for other in ("0.5401 mm takes 3 s", "0.5201 um takes 3 s", "0.5201 mm 3 s"):
        assert not alike(one, masked(f"wrote /tmp/a/b.png\n──── ± {other}\n| x |  hunts"))
    assert not alike("6 peaks", "7 peaks")
    assert alike("0.006 N", "0.007 N")
    assert not alike("hunts", "hunts not")
