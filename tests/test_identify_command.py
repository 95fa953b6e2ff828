"""Test `friso identify` as a user runs it: what it writes, says, predicts and refuses."""

import json
import os
import re
import shlex
from collections.abc import Iterator
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from inside import friso_inside
from machines import Machine, drawn, moves
from pages import Page
from refusals import rows_of
from snapshots import Snapshots
from systems import posix

import friso
from friso.errors import InputError
from friso.identification import method
from friso.identification.estimate import Estimate
from friso.identification.logs.log import Log
from friso.identification.output_error.settings import OutputErrorSettings
from friso.identification.stage_file import fitting, identified_stage, origins, with_unknown
from friso.interface.answer import Answer
from friso.stage.correlations import correlations_file, read_correlations

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


@pytest.fixture
def folder(tmp_path: Path, inputs: tuple[Path, Path]) -> Path:
    """A folder with the log and the stage file."""
    for path in inputs:
        (tmp_path / path.name).write_bytes(path.read_bytes())
    return tmp_path


WITH_STAGE = ("log.csv", "--stage", "stage.toml")


@pytest.fixture(scope="module")
def inputs(machine: Machine, log: Log, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The log and the stage file."""
    folder = tmp_path_factory.mktemp("inputs")
    table(log).to_csv(folder / "log.csv", index=False)
    friso.save(machine.guess, folder / "stage.toml")
    return folder / "log.csv", folder / "stage.toml"


@pytest.fixture(scope="module")
def done(inputs: tuple[Path, Path]) -> tuple[Path, dict[str, Any]]:
    """A run with --json and a prediction, its folder and its answer."""
    options = ("--map", "force=Force", "--predict", "log.csv", "--json", "--out", "out")
    answer = friso_inside(inputs[0].parent, "identify", *WITH_STAGE, *options)
    assert answer.returncode == 0, answer.stderr
    strict = json.loads(answer.stdout, parse_constant=lambda text: pytest.fail(f"{text} is no JSON"))
    return inputs[0].parent / "out", strict


@pytest.fixture(scope="module")
def without_stage(inputs: tuple[Path, Path]) -> Answer:
    return friso.identify(inputs[0], map={"force": "Force"})


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
    assert base.as_written()["controller"] == controller["controller"]
    assert base.flat()["masses.cart"] == pytest.approx(machine.flat["masses.cart"], rel=0.2)
    with pytest.raises(InputError) as open_tables:
        friso.identify(inputs[0], stage={"name": "axis"}, map={"force": "Force"})
    assert all(name in str(open_tables.value) for name in ("masses", "controller", "motion"))


@pytest.mark.slow
def test_files_are_written_and_listed(done: tuple[Path, dict[str, Any]], snapshots: Snapshots) -> None:
    out, answer = done[0].resolve(), done[1]
    files = {out.parent / item for item in answer["files"]}
    assert {out / "identified.toml", out / "identify.html", correlations_file(out / "identified.toml")} <= files
    assert all(entry.stat().st_size > 0 for entry in files)
    assert {file.suffix for file in files} >= {".toml", ".html", ".png", ".svg", ".pdf"}
    assert {one["key"] for one in answer["estimates"]} >= {"masses.cart", "friction.static", "friction.coulomb"}
    page = (out / "identify.html").read_text("utf-8")
    assert not re.search(r"<(script|link|img)[^>]*(src|href)=.https?:", page)
    snapshots.check("identify", "page", Page(page).lines)


@pytest.mark.slow
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


@pytest.mark.slow
@pytest.mark.usefixtures("own_bandwidth")
def test_friso_check_runs_on_what_was_identified(done: tuple[Path, dict[str, Any]]) -> None:
    answer = friso_inside(done[0], "check", "identified.toml", "--json")
    assert answer.returncode == 0, answer.stderr
    assert json.loads(answer.stdout)


@pytest.mark.slow
@pytest.mark.usefixtures("done")
def test_a_second_run_needs_no_options_again(inputs: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch) -> None:
    """The mapping beside the log is used; if it names a missing channel, it is refused by its name."""
    folder, kept = inputs[0].parent, inputs[0].with_name("log.csv.friso.toml")
    assert '"force" = "Force"' in kept.read_text()
    monkeypatch.setattr(method, "identify", _stopped)
    kept.write_text(kept.read_text().replace('"Force"', '"Kraft"'))
    refused(folder, "Kraft", *WITH_STAGE, out="second")
    kept.write_text(kept.read_text().replace('"Kraft"', '"Force"'))
    assert friso_inside(folder, "identify", *WITH_STAGE, "--out", "second").returncode == 130


def _stopped(*arguments: Any, **named: Any) -> None:
    raise KeyboardInterrupt


def test_one_message_holds_the_command_that_tells_all(
    log: Log, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The log is copied and read; a refused run keeps nothing, neither options nor guesses."""
    bare = pd.DataFrame({"t": log.time[:COUNT], "x": log["position"][:COUNT] * 1e3, "u": log["force"][:COUNT]})
    bare.to_csv(tmp_path / "bare.csv", index=False)
    monkeypatch.setattr(method, "identify", _stopped)
    first = friso_inside(tmp_path, "identify", "bare.csv", "--unit", "u=N", "--out", "out")
    assert first.returncode == 2
    assert not (tmp_path / "out").exists()
    command = next(line for line in first.stderr.splitlines() if "friso identify" in line).partition("friso ")[2]
    assert "--unit u=N" in command
    assert friso_inside(tmp_path, *shlex.split(command)).returncode == 130
    assert [file.name for file in tmp_path.iterdir()] == ["bare.csv"]


def test_an_interrupted_analysis_leaves_the_values_that_it_has(
    folder: Path, machine: Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those of the inverse model, and no stage, which would have them as if they were examined."""
    monkeypatch.setattr(friso.identification.moves, "fit_identifiable", _stopped)
    run = friso_inside(folder, "identify", *WITH_STAGE, "--predict", "log.csv", "--check", "--out", "out", "--json")
    told = json.loads(run.stdout)
    assert (run.returncode, told["interrupted"], told["stage"], told["predictions"]) == (130, True, None, [])
    mass = next(one for one in told["estimates"] if one["key"] == "mass")
    truth = sum(machine.flat.get(key, 0.0) for key in ("masses.cart", "masses.stage"))
    assert mass["low"] < truth < mass["high"]
    assert {path.suffix for path in (folder / "out").iterdir()} == {".html", ".png", ".svg", ".pdf"}


def test_a_kind_that_shows_nothing_is_not_kept(tmp_path: Path) -> None:
    """A body that hardly moves, said to go at constant speeds: the next run asks its kind anew."""
    time = np.arange(3000) * 1e-3
    table = pd.DataFrame({"t [s]": time, "x [m]": 1e-7 * np.sin(time), "u [N]": np.sin(time)})
    table.to_csv(tmp_path / "still.csv", index=False)
    friso_inside(tmp_path, "identify", "still.csv", "--as", "constant-speed", "--out", "out")
    assert not (tmp_path / "still.csv.friso.toml").exists()


def refused(folder: Path, words: str, *arguments: object, out: str = "out") -> None:
    """Exit 2 with one message, and nothing written."""
    answer = friso_inside(folder, "identify", *arguments, "--out", out)
    assert answer.returncode == 2, answer.stderr
    assert answer.stdout == ""
    assert words in " ".join(answer.stderr.split())
    assert rows_of(answer.stderr)
    assert not (folder / out / "identified.toml").exists()


@pytest.mark.cases(first=5)
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([*WITH_STAGE, "--as", "dance"], "one of break-away, constant-speed, frequency, hunting, moves"),
        ([*WITH_STAGE, "--unit", "ActPos=parrots"], "parrots"),
        ([*WITH_STAGE, "--bandwidth", "20 kg"], "--bandwidth"),
        ([*WITH_STAGE, "--predict", "nowhere.csv"], "nowhere.csv"),
        (["log.csv", "--set", "friction.static=2 N"], "a stage whose keys to override"),
        (["bad.csv", "--stage", "stage.toml"], "position"),
    ],
)
def test_options_that_do_not_fit_are_refused(arguments: list[str], words: str, log: Log, folder: Path) -> None:
    table(log, position=None).to_csv(folder / "bad.csv", index=False)
    refused(folder, words, *arguments)


def test_a_foreign_stage_file_is_not_overwritten(folder: Path) -> None:
    own, stage = folder / "identified.toml", folder / "stage.toml"
    own.write_bytes(stage.read_bytes())
    for name, options, remedy in (
        ("stage.toml", (), "--overwrite"),
        ("identified.toml", ("--overwrite",), "another folder"),
    ):
        answer = friso_inside(folder, "identify", "log.csv", "--stage", name, "--out", ".", *options)
        assert (answer.returncode, answer.stdout) == (2, "")
        assert remedy in " ".join(answer.stderr.split())
    assert own.read_bytes() == stage.read_bytes()


@posix
@pytest.mark.skipif(getattr(os, "geteuid", int)() == 0, reason="nothing is kept from a superuser")
def test_a_folder_that_cannot_be_written(folder: Path) -> None:
    folder.chmod(0o500)
    answer = friso_inside(folder, "identify", *WITH_STAGE, "--out", ".")
    folder.chmod(0o700)
    assert (answer.returncode, "can be written" in answer.stderr) == (2, True)


@pytest.mark.slow
def test_a_placeholder_for_the_controller_is_noted_in_the_file(
    without_stage: Answer, inputs: tuple[Path, Path]
) -> None:
    assert "[controller]" in without_stage.stage.note
    assert not friso.load(inputs[1]).note


def shown_or_unknown(stage: friso.Stage) -> bool:
    """Whether each number of masses and friction has an interval, or is listed as what nobody knows."""
    keys = {
        key for key in stage.numeric_keys() if key.startswith(("masses.", "friction.", "bias.")) and key in stage.flat()
    }
    return keys <= {*stage.uncertain(), *stage.unknown_keys}


@pytest.mark.slow
def test_values_that_the_log_does_not_show_are_listed_as_unknown(
    without_stage: Answer, inputs: tuple[Path, Path]
) -> None:
    """No plain number stands in the file for what nobody knows: our choices, or estimates without ends."""
    stage = without_stage.stage
    assert shown_or_unknown(stage)
    assert "controller" in stage.unknown_keys
    assert not {one.name for one in without_stage.estimates if one.determined} & {*stage.unknown_keys}
    assert friso.bode(stage).sentences()[0].startswith("If ")
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
    interval = fitted.uncertain()["friction.static"]
    assert (interval.low, interval.high) == (pytest.approx(1.3, rel=0.01), pytest.approx(3 * 1.5, rel=0.01))


@pytest.mark.slow
def test_a_wrong_controller_is_told(inputs: tuple[Path, Path]) -> None:
    """A third more crossover makes another controller; the stage file then lists it as unknown."""
    right, wrong = (
        friso.identify(inputs[0], stage=inputs[1], set=changes, map={"force": "Force"})
        for changes in (None, {"controller.crossover": "13.4 Hz"})
    )
    assert "controller" not in right.stage.unknown_keys
    assert "controller" in wrong.stage.unknown_keys
