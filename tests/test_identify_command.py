"""Test `friso identify` as a user runs it: what it writes, says, predicts and refuses."""

from __future__ import annotations

import json
import os
import re
import shlex
import sys
from collections.abc import Iterator
from copy import deepcopy
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from machines import Machine, drawn, moves
from pages import Page
from snapshots import Snapshots
from systems import posix

import friso
from friso.cli.app import main
from friso.errors import InputError
from friso.identification import method
from friso.identification.estimate import Estimate
from friso.identification.kind import Prior
from friso.identification.logs.log import Log
from friso.identification.output_error.settings import OutputErrorSettings
from friso.identification.stage_file import identified_stage, origins, with_unknown
from friso.identification.stage_keys import fitting
from friso.stage.correlations import correlations_file, read_correlations

pytestmark = pytest.mark.xdist_group("identify-moves")

SMALL = OutputErrorSettings(
    points_of_a_profile=3,
    iterations_of_a_profile=1,
    starts_of_a_fit=64,
    starts_refined_first=4,
    starts_refined_further=2,
    starts_near_a_fit=15,
)
"""Sizes with which a log is identified in seconds."""

COUNT = 2000
"""Samples of the log that are used: the first two moves."""

COLUMNS = {"time": "Time [s]", "reference": "SetPos [mm]", "position": "ActPos [mm]", "force": "Force [N]"}
Said = tuple[int, str, str]


@pytest.fixture(scope="module", autouse=True)
def small() -> Iterator[None]:
    with SMALL.in_use():
        yield


@pytest.fixture(scope="module")
def machine() -> Machine:
    return drawn(3, False)


@pytest.fixture(scope="module")
def log(machine: Machine) -> Log:
    return moves(machine)


def table(log: Log, count: int = COUNT, **changes: Any) -> pd.DataFrame:
    """The columns of a log in millimetres, some of them changed, or left out by None."""
    values = {"time": log.time[:count]}
    values |= {role: log[role][:count] * (1.0 if role == "force" else 1e3) for role in COLUMNS if role != "time"}
    values |= changes
    return pd.DataFrame({COLUMNS.get(role, role): value for role, value in values.items() if value is not None})


def run(capsys: pytest.CaptureFixture[str], *arguments: object) -> Said:
    """Exit status, standard output and standard error of `friso identify`."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["friso", "identify", *map(str, arguments)])
        with pytest.raises(SystemExit) as left:
            main()
    shown = capsys.readouterr()
    return int(left.value.code or 0), shown.out, shown.err


@pytest.fixture(scope="module")
def inputs(machine: Machine, log: Log, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The log and the stage file."""
    folder = tmp_path_factory.mktemp("given")
    table(log).to_csv(folder / "log.csv", index=False)
    friso.save(machine.guess, folder / "stage.toml")
    return folder / "log.csv", folder / "stage.toml"


@pytest.fixture(scope="module")
def done(inputs: tuple[Path, Path], tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """A run with --json and a prediction, its folder and its answer."""
    out = tmp_path_factory.mktemp("done") / "out"
    log, stage = inputs
    arguments = ["identify", log, "--stage", stage, "--map", "force=Force", "--predict", log, "--json", "--out", out]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["friso", *map(str, arguments)])
        answer = out.parent / "answer.json"
        with answer.open("w") as stream:
            patch.setattr(sys, "stdout", stream)
            with pytest.raises(SystemExit) as left:
                main()
    assert not left.value.code
    return out, json.loads(answer.read_text(), parse_constant=lambda text: pytest.fail(f"{text} is no JSON"))


def test_a_stage_file_may_leave_out_what_the_log_tells(
    inputs: tuple[Path, Path], machine: Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Masses, friction and motion may be missing; this is handed on, so that they do not count as given.

    The caller's tables stay unchanged.
    """
    taken: list[Any] = []

    def instead(sources: object, base: friso.Stage, settings: object, progress: object, made_up: list[str]) -> None:
        taken.extend((base, made_up))
        raise InputError("", "enough", "", "")

    monkeypatch.setattr(method, "identify", instead)
    controller = {"controller": friso.load(inputs[1]).as_written()["controller"]}
    before, settings = deepcopy(controller), {"friction.stribeck_velocity": "2 mm/s", "controller.kind": "pid"}
    with pytest.raises(InputError, match="enough"):
        friso.identify(inputs[0], stage=controller, set=settings, map={"force": "Force"})
    base, made_up = taken
    assert controller == before
    assert {key.partition(".")[0] for key in made_up} == {"masses", "friction", "motion"}
    assert "friction.coulomb" in made_up
    assert not {*settings} & {*made_up}
    log, around = SimpleNamespace(setup={}), Prior(base, True, made_up=made_up)
    assert around.user_told("friction.stribeck_velocity", log)  # type: ignore[arg-type]
    assert not around.user_told("friction.viscous", log)  # type: ignore[arg-type]
    assert base.as_written()["controller"] == controller["controller"]
    assert base.flat()["masses.cart"] == pytest.approx(machine.flat["masses.cart"], rel=0.2)
    with pytest.raises(InputError) as open_tables:
        friso.identify(inputs[0], stage={"name": "axis"}, map={"force": "Force"})
    assert all(name in str(open_tables.value) for name in ("masses", "controller", "motion"))


def test_files_are_written_and_listed(done: tuple[Path, dict[str, Any]], snapshots: Snapshots) -> None:
    out, answer = done
    files = {Path(item) for item in answer["files"]}
    assert {out / "identified.toml", out / "identify.html", correlations_file(out / "identified.toml")} <= files
    assert all(entry.stat().st_size > 0 for entry in files)
    assert {file.suffix for file in files} >= {".toml", ".html", ".png", ".svg", ".pdf"}
    page = (out / "identify.html").read_text("utf-8")
    assert not re.search(r"<(script|link|img)[^>]*(src|href)=.https?:", page)
    snapshots.check("identify", "page", Page(page).lines)


def test_the_stage_file_has_uncertain_keys_that_hold_the_truth(
    done: tuple[Path, dict[str, Any]], machine: Machine
) -> None:
    stage = friso.load(done[0] / "identified.toml")
    uncertain = stage.uncertain()
    assert {"masses.cart", "friction.coulomb", "friction.viscous", "bias.cart"} <= uncertain.keys()
    low, high = uncertain["masses.cart"].low, uncertain["masses.cart"].high
    middle, half = (low + high) / 2, (high - low) / 2
    assert abs(machine.flat["masses.cart"] - middle) < 2 * half
    assert half < 0.05 * middle
    assert "log" in stage.source
    correlations = read_correlations(correlations_file(done[0] / "identified.toml"), stage)
    assert {*correlations.keys} <= uncertain.keys()
    assert len(correlations.keys) >= 3


@pytest.mark.usefixtures("own_bandwidth")
def test_friso_check_runs_on_what_was_identified(
    done: tuple[Path, dict[str, Any]], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "argv", ["friso", "check", str(done[0] / "identified.toml"), "--json"])
    with pytest.raises(SystemExit) as left:
        main()
    assert not left.value.code
    assert json.loads(capsys.readouterr().out)


def test_the_answer_has_everything(done: tuple[Path, dict[str, Any]]) -> None:
    text = json.dumps(done[1])
    for word in ("masses.cart", "friction.static", "friction.stribeck_velocity", "friction.coulomb", "log.csv"):
        assert word in text, word


def test_a_second_run_needs_no_options_again(
    inputs: tuple[Path, Path], done: tuple[Path, dict[str, Any]], tmp_path: Path, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """The mapping beside the log is used; if it names a missing channel, it is refused by its name."""
    kept = inputs[0].with_name("log.csv.friso.toml")
    assert '"force" = "Force"' in kept.read_text()
    monkeypatch.setattr(method, "identify", _stopped)
    kept.write_text(kept.read_text().replace('"Force"', '"Kraft"'))
    status, _, text = run(capsys, inputs[0], "--stage", inputs[1], "--out", tmp_path / "out")
    kept.write_text(kept.read_text().replace('"Kraft"', '"Force"'))
    assert (status, "Kraft" in text) == (2, True)
    assert run(capsys, inputs[0], "--stage", inputs[1], "--out", tmp_path / "out")[0] == 130


def _stopped(*arguments: Any, **named: Any) -> None:
    raise KeyboardInterrupt


def test_one_message_holds_the_command_that_tells_all(
    log: Log, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The log is copied and read; a refused run keeps nothing, neither options nor guesses."""
    bare = pd.DataFrame({"t": log.time[:COUNT], "x": log["position"][:COUNT] * 1e3, "u": log["force"][:COUNT]})
    bare.to_csv(tmp_path / "bare.csv", index=False)
    monkeypatch.setattr(method, "identify", _stopped)
    first = ("bare.csv", "--unit", "u=N", "--out", "out")
    monkeypatch.chdir(tmp_path)
    status, _, text = run(capsys, *first)
    assert status == 2
    assert "--unit u=N" in text
    assert not (tmp_path / "out").exists()
    command = next(line for line in text.splitlines() if "friso identify" in line).partition("friso identify")[2]
    assert run(capsys, *shlex.split(command))[0] == 130
    assert [file.name for file in tmp_path.iterdir()] == ["bare.csv"]


def test_a_kind_that_shows_nothing_is_not_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A body that hardly moves, said to go at constant speeds: the next run asks its kind anew."""
    time = np.arange(3000) * 1e-3
    table = pd.DataFrame({"t [s]": time, "x [m]": 1e-7 * np.sin(time), "u [N]": np.sin(time)})
    table.to_csv(tmp_path / "still.csv", index=False)
    run(capsys, tmp_path / "still.csv", "--as", "constant-speed", "--out", tmp_path / "out")
    assert not (tmp_path / "still.csv.friso.toml").exists()


def test_ctrl_c_leaves_nothing(
    inputs: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(method, "identify", _stopped)
    status, out, text = run(capsys, inputs[0], "--stage", inputs[1], "--out", tmp_path / "out")
    assert (status, out) == (130, "")
    assert "interrupted" in text
    assert not [*tmp_path.rglob("identified.toml"), *tmp_path.rglob("*.html")]


BAD_OPTIONS = [
    (["--map", "position=Nowhere"], "Nowhere"),
    (["--map", "speed=ActPos"], "one of time, reference"),
    (["--map", "position"], "two texts separated by ="),
    (["--as", "dance"], "one of break-away, constant-speed, frequency, hunting, moves"),
    (["--unit", "ActPos=parrots"], "parrots"),
    (["--scale", "force=heavy"], "heavy"),
    (["--bandwidth", "20 kg"], "--bandwidth"),
    (["--band", "20 Hz .. 3 Hz"], "--band"),
    (["--period", "0 s"], "--period"),
    (["--dt", "-1 ms"], "--dt"),
    (["--predict", "nowhere.csv"], "nowhere.csv"),
]


@pytest.mark.parametrize(("options", "message"), BAD_OPTIONS, ids=lambda item: "".join(item[:2]))
def test_options_that_do_not_fit_are_refused(
    options: list[str], message: str, inputs: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / "log.csv"
    log.write_bytes(inputs[0].read_bytes())
    refused(capsys, message, log, "--stage", inputs[1], *options, "--out", tmp_path / "out")


def refused(capsys: pytest.CaptureFixture[str], message: str, *arguments: object) -> None:
    """Exit 2 with one message, and nothing written."""
    status, out, text = run(capsys, *arguments)
    plain = " ".join(text.split())
    assert status == 2, plain
    assert out == ""
    assert message in plain
    assert "Traceback" not in text
    assert text.count("expected") == 1
    places = [Path(str(argument)) for argument in arguments]
    assert not any((place / "identified.toml").exists() for place in places if place.name == "out")


def _bad(log: Log) -> dict[str, tuple[pd.DataFrame, str]]:
    position, force = log["position"][:COUNT] * 1e3, log["force"][:COUNT]
    holed = np.where(np.arange(COUNT) == 700, np.nan, force)
    time = log.time[:COUNT].copy()
    time[500] = time[400]
    return {
        "short": (table(log, 30), "at least 50 samples"),
        "constant": (table(log, position=np.full(COUNT, 1.0)), "a constant signal"),
        "nan": (table(log, force=holed), "force"),
        "two candidates": (table(log, **{"ActPos2 [mm]": position * 1.01}), "position"),
        "no units": (table(log).rename(columns={"ActPos [mm]": "ActPos"}), "ActPos"),
        "no force": (table(log, force=None), "force"),
        "no position": (table(log, position=None), "position"),
        "backwards": (table(log, time=time), "time"),
    }


@pytest.mark.parametrize(
    "case", ["short", "constant", "two candidates", "no units", "no force", "no position", "backwards"]
)
def test_bad_logs_are_refused(
    case: str, log: Log, inputs: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data, message = _bad(log)[case]
    data.to_csv(tmp_path / "bad.csv", index=False)
    refused(capsys, message, tmp_path / "bad.csv", "--stage", inputs[1], "--out", tmp_path / "out")


def test_missing_and_empty_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "empty.csv").write_text("")
    refused(capsys, "nowhere.csv", tmp_path / "nowhere.csv", "--out", tmp_path / "out")
    refused(capsys, "empty.csv", tmp_path / "empty.csv", "--out", tmp_path / "out")


def test_set_without_stage(inputs: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = (inputs[0], "--set", "friction.static=2 N", "--out", tmp_path / "out")
    refused(capsys, "a stage whose keys to override", *arguments)


def test_a_foreign_stage_file_is_not_overwritten(
    inputs: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    own = tmp_path / "identified.toml"
    own.write_bytes(inputs[1].read_bytes())
    for stage, options, remedy in ((inputs[1], (), "--overwrite"), (own, ("--overwrite",), "another folder")):
        status, out, message = run(capsys, inputs[0], "--stage", stage, "--out", tmp_path, *options)
        assert (status, out) == (2, "")
        assert remedy in " ".join(message.split())
    assert own.read_bytes() == inputs[1].read_bytes()


@posix
@pytest.mark.skipif(getattr(os, "geteuid", int)() == 0, reason="nothing is kept from a superuser")
def test_a_folder_that_cannot_be_written(
    inputs: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tmp_path.chmod(0o500)
    status, _, text = run(capsys, inputs[0], "--stage", inputs[1], "--out", tmp_path)
    tmp_path.chmod(0o700)
    assert (status, "can be written" in text) == (2, True)


def test_a_placeholder_for_the_controller_is_noted_in_the_file(inputs: tuple[Path, Path]) -> None:
    answer = friso.identify(inputs[0], map={"force": "Force"})
    assert "[controller]" in answer.stage.note
    assert friso.loads(answer.stage.to_toml()).note in answer.sentences()
    assert not friso.load(inputs[1]).note


def shown_or_unknown(stage: friso.Stage) -> bool:
    """Whether each number of masses and friction has an interval, or is listed as what nobody knows."""
    keys = {
        key for key in stage.numeric_keys() if key.startswith(("masses.", "friction.", "bias.")) and key in stage.flat()
    }
    return keys <= {*stage.uncertain(), *stage.unknown_keys}


def test_values_that_the_log_does_not_show_are_listed_as_unknown(inputs: tuple[Path, Path]) -> None:
    """No plain number stands in the file for what nobody knows: our choices, or estimates without ends."""
    answer = friso.identify(inputs[0], map={"force": "Force"})
    assert shown_or_unknown(answer.stage)
    assert "controller" in answer.stage.unknown_keys
    assert not {one.name for one in answer.estimates if one.determined} & {*answer.stage.unknown_keys}
    assert friso.bode(answer.stage).sentences()[0].startswith("If ")
    tables = {"controller": friso.load(inputs[1]).as_written()["controller"]}
    own = friso.identify(inputs[0], stage=tables, map={"force": "Force"}).stage
    assert shown_or_unknown(own)
    assert not any(key.startswith("controller") for key in own.unknown_keys)


def test_static_friction_that_only_followed_another_is_unknown() -> None:
    """A log of one way shows neither static friction nor its distance from Coulomb friction."""
    stage = friso.load(friso.example("thesis_rig")).replace({"joint.locked": True, "friction.static": "1 N"})
    coulomb = Estimate("friction.coulomb", "N", 1.4, 1.3, 1.5, "output error")
    fits = fitting(stage, [coulomb, Estimate.unknown("friction.bristle_stiffness", "N/m", "output error", "open")])
    fitted = identified_stage(stage, fits.estimates, ["one_way"])
    fitted = with_unknown(fitted, origins(fitted, fits.estimates, fits.follows, ()), fits.left)
    assert fitted.unknown_keys == ("friction.static", "friction.bristle_stiffness")
    assert fitted.flat()["friction.static"] == pytest.approx(fitted.flat()["friction.coulomb"])


def test_a_wrong_controller_is_told(inputs: tuple[Path, Path]) -> None:
    """The closed loop with a third more crossover is out of step with the log."""
    right, wrong = (
        friso.identify(inputs[0], stage=inputs[1], set=changes, map={"force": "Force"}).sentences()
        for changes in (None, {"controller.crossover": "13.4 Hz"})
    )
    assert not any("out of step" in sentence for sentence in right)
    assert any("out of step" in sentence for sentence in wrong)
