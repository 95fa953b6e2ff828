"""Test the command line: what it prints, its exit status, what it writes."""

import copy
import io
import json
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import xarray as xr
from inside import friso_inside
from patience import wait_until

import friso
from friso.cli.app import COMMANDS, _failed
from friso.cli.terminal import ProgressBar
from friso.platform.system import LIBRARIES
from friso.progress import WORK_CLOCK

ROOT = Path(__file__).parent.parent
RIG, STICK_SLIP = ROOT / "examples" / "thesis_rig.toml", ROOT / "examples" / "lugre_stick_slip.toml"


def run(*arguments: object, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    return friso_inside(cwd or ROOT, *arguments)


@pytest.fixture(scope="module")
def checked() -> dict[str, Any]:
    """Return what `friso check --json` prints about the rig."""
    return json.loads(run("check", RIG, "--json").stdout)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The seconds that the clock of work takes for the time."""
    seconds = [0.0]
    monkeypatch.setattr("friso.progress.time", SimpleNamespace(monotonic=lambda: seconds[0]))
    return seconds


FIRST = "100 10 100, 190 40 100, 220 91 100, 230 0 100, 240 50 100, 250 20 100, 260 30 100"
OTHER = "60 0 0, 120 1 800, 240 30 800, 246 41 800, 300 41 9000, 310 99 9000, 320 200 9000"
"""Seconds, and how much of how many is done then."""


@pytest.mark.parametrize(
    ("reports", "times"),
    [
        (FIRST, ["work", "3 min to go", "13 s to go", "work", "10 s to go", "work", "70 s to go"]),
        (OTHER, ["work", "work", "work", "40 min to go", "work", "work", "18 min to go"]),
    ],
)
def test_the_time_to_go(clock: list[float], reports: str, times: list[str]) -> None:
    """That of other work counts from its beginning; before a twentieth of the work is done, or a hundred steps of it,
    the rest may take any time."""
    bar, shown = ProgressBar("first"), []
    for clock[0], done, total in (map(int, report.split()) for report in reports.split(", ")):
        bar(done, total, "work")
        shown.append(bar.line().rpartition(", ")[2])
    assert shown == times


def test_the_time_to_go_leaves_out_compiling(clock: list[float]) -> None:
    bar = ProgressBar()
    bar(0, 100, "work")
    clock[0] = 10.0
    with WORK_CLOCK.stands(), WORK_CLOCK.stands():  # of two threads
        clock[0] = 70.0
        bar(10, 100, "work")
        assert bar.line() == "10 %, work, 90 s to go"
    clock[0] = 80.0
    bar(20, 100, "work")
    assert bar.line() == "20 %, work, 80 s to go"


def test_a_wait_is_told_where_no_terminal_shows_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The line appears even while nothing is reported."""
    monkeypatch.setattr("friso.cli.terminal.LINE_INTERVAL", 0.01)
    with ProgressBar("first") as bar:
        _until_told(capsys, "friso: first")
        bar(0, 12, "cells")
        bar(3, 12, "cells")
        _until_told(capsys, "friso: 25 %, cells, 0 s to go")


def _until_told(capsys: pytest.CaptureFixture[str], line: str) -> None:
    printed: list[str] = []

    def told_so() -> bool:
        printed.extend(capsys.readouterr().err.splitlines())
        return line in printed

    wait_until(told_so)


@pytest.mark.slow
def test_check_json(checked: dict[str, Any]) -> None:
    """The condition of passivity that is not met: thesis, Table 2: sigma_2 is far below sigma_1 (F_s - F_c)/F_c = 316.2
    (3 - 1)/1 N*s/m."""
    assert checked["stage"] == "Thesis rig"
    assert checked["cases"]["given"] == checked["cases"]["free"]
    assert "632.5 N*s/m" in (checked["friction_passive_where"] or "")
    locked, free = (copy.deepcopy(checked["cases"][case]) for case in ("locked", "free"))
    assert (locked["verdict"], locked["peaks"], locked["cycles"], locked["reason"]) == ("hunts", 6, 1, None)
    cycle = locked["cycle"]
    assert (cycle["symmetric"], cycle["attracts"], locked["observed"]) == (True, True, False)
    expected = {"amplitude_m": 0.520e-3, "period_s": 1.6277, "multiplier": -0.9312, "growth": -0.9312, "slope": -0.9312}
    assert {key: cycle[key] for key in expected} == pytest.approx(expected, rel=1e-3)
    assert cycle["residual"] < 1e-6
    assert cycle["time_constant_s"] == pytest.approx(11.42, rel=0.01)
    margin = {"factor": 1.2187, "crossover_hz": 9.75, "reserve": 0.0095, "settles_at_factor": 1.2303}
    assert {key: locked["margin"][key] for key in margin} == pytest.approx(margin, rel=2e-3)
    assert (locked["margin"]["certain"], locked["margin"]["kind"]) == (True, "flip")
    assert [len(window) for window in locked["kick"]["displacement_m"]] == [2, 2, 2]
    assert locked["kick"]["velocity_m_per_s"][0][0] == pytest.approx(0.0231, rel=0.02)
    assert locked["moves"] == {"drawn": 128, "hunting": pytest.approx(111, abs=2)}
    assert (free["cycle"], free["cycles"], free["kick"], free["moves"]) == (None, 0, None, None)
    assert "swings back less far" in free["reason"]
    assert free["settled_after_s"] == free["settling_time_10um_s"]


@pytest.mark.usefixtures("own_bandwidth")
def test_set_overrides_any_key() -> None:
    document = json.loads(
        run("check", RIG, "--set", "joint.locked=true", "--set", "controller.crossover=30 Hz", "--json").stdout
    )
    assert document["cases"]["given"] == document["cases"]["locked"]
    assert document["cases"]["locked"]["verdict"] == "settles"


@pytest.mark.parametrize(
    ("typed", "fits"), [("friso ch", ["check"]), ("friso tune --b", ["--bandwidth-limit"]), ("friso ", [*COMMANDS])]
)
def test_a_shell_completes_commands_and_options(
    typed: str, fits: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """bash calls friso without arguments, and puts what was typed into the environment."""
    asked = {"_FRISO_COMPLETE": "complete_bash", "COMP_WORDS": typed, "COMP_CWORD": str(typed.count(" "))}
    for name, value in asked.items():
        monkeypatch.setenv(name, value)
    done = run(cwd=tmp_path)
    assert done.returncode == 0
    assert sorted(done.stdout.split()) == sorted(fits)


@pytest.mark.slow
def test_simulate_writes_what_python_returns(tmp_path: Path) -> None:
    done = run("simulate", STICK_SLIP, "--sample-time", "10 ms", "--out", tmp_path)
    assert done.returncode == 0
    assert sorted(path.suffix for path in tmp_path.glob("lugre*")) == [".csv", ".nc", ".png"]
    with xr.load_dataset(tmp_path / "lugre_stick_slip_response.nc", engine="scipy") as written:
        expected = friso.simulate(friso.load(STICK_SLIP), sample_time=0.01)
        assert (written.position.values == expected.position.values).all()
        assert written.attrs["status"] == "done"
        assert friso.loads(written.attrs["stage"]) == friso.load(STICK_SLIP)
    header = (tmp_path / "lugre_stick_slip_response.csv").read_text().splitlines()[0]
    assert header.startswith("time [s],reference [m],")


def test_init_writes_a_stage_that_checks_and_overwrites_nothing(tmp_path: Path) -> None:
    made = run("init", "my stage.toml", cwd=tmp_path)
    assert made.returncode == 0
    assert 'then: friso check "my stage.toml"' in made.stdout
    before = (tmp_path / "my stage.toml").read_text()
    friso.loads(before)
    again = run("init", "my stage.toml", cwd=tmp_path)
    assert again.returncode == 2
    assert "nothing was overwritten" in again.stderr
    assert (tmp_path / "my stage.toml").read_text() == before


def test_version() -> None:
    """The command runs in a process of its own, as for a user."""
    done = subprocess.run([sys.executable, "-m", "friso", "--version"], capture_output=True, text=True, check=True)
    assert done.stdout == f"friso {friso.__version__}\n"


def test_commands_that_lack_something_or_are_none() -> None:
    for arguments, words in ((["check"], "STAGE"), (["chek", RIG], "chek"), (["simulate", "--json"], "STAGE")):
        done = run(*arguments)
        assert (done.returncode, done.stdout) == (2, "")
        assert words in done.stderr


@pytest.mark.slow
def test_a_run_that_fails_says_so_and_keeps_what_it_has(tmp_path: Path) -> None:
    """An unstable loop diverges past what numbers hold: status 1, and the response up to there is written.

    Without phase lead and with strong integral action van Dijk's controller has a negative phase margin.
    """
    settings = ("controller.alpha=0.99", "controller.beta=1", "controller.crossover=40 Hz")
    wild = [part for text in settings for part in ("--set", text)]
    done = run("simulate", RIG, "--out", tmp_path, *wild)
    assert done.returncode == 1
    assert "unstable" in done.stdout
    with xr.load_dataset(tmp_path / "thesis_rig_response.nc", engine="scipy") as written:
        assert 0 < written.position.notnull().sum() < written.time.size
    document = json.loads(run("check", RIG, "--json", *wild).stdout)
    assert document["cases"]["given"]["verdict"] == "failed"
    assert document["cases"]["given"]["peak_to_peak_m"] is None


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (PermissionError(13, "Permission denied", "draft", None, "page.html"), "Permission denied: page.html"),
        (ImportError("DLL load failed while importing _multiarray"), LIBRARIES),
        (OSError("Could not find/load 'libllvmlite.so'"), LIBRARIES),
    ],
)
def test_a_failure_names_the_target_or_the_remedy(
    error: Exception, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert _failed(error) == 1
    assert words in " ".join(capsys.readouterr().err.split())


@pytest.mark.cases(first=1)
@pytest.mark.parametrize("module", [["-m", "friso"], ["-mfriso.__main__"], ["-W", "ignore", "-Bum", "friso"]])
def test_as_a_module_friso_imports_nothing_from_the_current_folder(tmp_path: Path, module: list[str]) -> None:
    # Not those that Python's own -m imports before it looks for friso: types, functools, contextlib and their like.
    for name in ("typer", "logging", "numpy", "signal", "enum", "atexit"):
        (tmp_path / f"{name}.py").write_text("open('run', 'w').close()\n")
    done = subprocess.run([sys.executable, *module, "--version"], cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("command", ["check", "logs"])
def test_a_path_with_blanks_that_lacks_its_quotes_is_told(tmp_path: Path, command: str) -> None:
    (tmp_path / "my rig.toml").write_text("")
    done = friso_inside(tmp_path, command, "my", "rig.toml")
    assert done.returncode == 2
    assert "needs quotes: 'my rig.toml'" in done.stderr.replace('"', "'")


@pytest.mark.slow
@pytest.mark.parametrize("command", ["bode", "map"])
def test_a_notice_on_an_input_comes_once_after_the_answer(command: str, tmp_path: Path) -> None:
    uncertain = ["--set", "friction.static=3 N .. 4 N", "--set", "joint.locked=true"]
    axes = ["--x", "controller.crossover=8 Hz..12 Hz:2"] * (command == "map")
    both = io.StringIO()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("inside.io.StringIO", lambda: both)
        run(command, ROOT / "examples/thesis_rig.toml", *uncertain, *axes, cwd=tmp_path)
    lines = both.getvalue().splitlines()
    notices = [number for number, line in enumerate(lines) if "uncertain" in line]
    assert len(notices) == 1
    assert notices[0] > next(number for number, line in enumerate(lines) if "hunts" in line or "phase" in line)
