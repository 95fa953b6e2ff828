"""Kinds of experiment, experiments of the rig, formats of logs and pages that are each declared in one place, here, go
all the way through friso."""

import importlib
import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import friso
from friso.app.machine import Uploads
from friso.app.questions import QUESTIONS as QUESTIONS_OF_PAGES
from friso.app.questions import PageRequest, job_of
from friso.app.work import Work
from friso.cli.app import main
from friso.identification.estimate import Estimate
from friso.identification.kind import AnalysisSettings, ExperimentKind, Facts, Prior, Source
from friso.identification.kinds import KINDS, in_order
from friso.identification.logs.log import Channel, ChannelTable, Log
from friso.identification.logs.read import FORMATS, LogFormat, file_format, read_table
from friso.interface.question import HUNTS, QUESTIONS
from friso.progress import Progress
from friso.shown.drawing.figure import Axis, Figure, Panel, Series
from friso.stage import Stage
from friso.stage.arguments import foreign
from friso.studies.metric import METRICS, MapFinding, Metric, Word
from friso_thesis.studies.rig.experiments import RIG_EXPERIMENTS, RigExperiment
from friso_thesis.studies.rig.outcome import Outcome, RigLog

ROOT = Path(__file__).parents[1]


@dataclass(frozen=True)
class Hold:
    """Forces [N] under which a stage stands still without a brake: a kind of experiment of this test alone."""

    least: Estimate
    time: np.ndarray
    force: np.ndarray


class HoldKind(ExperimentKind[Hold]):
    title = "Hold"
    after = ("moves",)

    def analyse_log(self, log: Log, prior: Prior, settings: AnalysisSettings) -> Hold:
        top = float(np.abs(log["force"]).max())
        return Hold(Estimate.unknown("friction.static", "N", "holds", "it holds", top), log.time, log["force"])

    def estimates(self, result: Hold, stage: Stage | None) -> tuple[Estimate, ...]:
        return (result.least,)


class HeldForce(HoldKind):
    """A kind of experiment that says by itself how it is shown."""

    title = "Held force"

    def facts(self, result: Hold) -> Facts:
        return (("Held", f"{result.least.low:.3g} N"),)

    def numbers(self, result: Hold) -> dict[str, Any]:
        return {"held_n": result.least.low}

    def figures(self, result: Hold, logs: Sequence[Source], name: str) -> list[Figure]:
        panel = Panel("", Axis("Time", "s"), Axis("Force", "N"), (Series(result.time, result.force, "", "#000000"),))
        return [Figure(f"{name}_force", "Forces held", "Held.", (panel,))]


class Push(RigExperiment):
    """An experiment of the rig: nothing moves."""

    def run(self, stage: Stage, seed: int, progress: Progress) -> Outcome:
        logged = {"position": np.zeros(100), "force": np.full(100, float(seed))}
        return Outcome("push", stage, seed, (RigLog("pushed", "hold", 1e-3, logged, logged, stage, seed),), None)


LOADED = Metric(
    "Load of the actuator",
    lambda run: np.where(run.measures.largest_force > run.flat["friction.static"], "heavy", "light"),
    words=(Word("heavy", "orange", "the actuator overcomes static friction"), Word("light", "#eef0ff")),
    findings=(MapFinding("The actuator works hard", ("heavy",)),),
)
"""A metric of words, computed from runs."""

ATTRACTORS = Metric(
    "Motions that attract",
    lambda stage: stage.attracted.attracts.astype(float),
    source="sketch",
    unit="1",
    counts=True,
    findings=(MapFinding("Something attracts"),),
)
"""A metric of numbers, computed from a sketch of a stage's attractors."""


def read_pairs(path: Path) -> ChannelTable:
    """Position in m and force in N, a millisecond apart, alternating in a file of doubles behind its mark."""
    position, force = np.frombuffer(path.read_bytes()[4:]).reshape(-1, 2).T
    time = 1e-3 * np.arange(len(force))
    channels = (Channel("position", "m", position, time, "pairs"), Channel("force", "N", force, time, "pairs"))
    return ChannelTable(channels, {}, ("format: pairs",))


FORMAT = LogFormat("Pairs", lambda head: head.start.startswith(b"PAIR"), read_pairs)


@pytest.fixture
def extended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(KINDS.added, "hold", (HoldKind(), "Forces that the stage bears without moving"))
    monkeypatch.setitem(RIG_EXPERIMENTS.added, "push", (Push(), "Push without moving"))
    monkeypatch.setitem(FORMATS.added, "pairs", (FORMAT, "Pairs of doubles"))
    monkeypatch.setitem(METRICS.added, "loaded", (LOADED, "How hard the actuator works"))
    monkeypatch.setitem(METRICS.added, "attracting", (ATTRACTORS, "How much attracts the stage"))


@pytest.fixture
def log(tmp_path: Path) -> Path:
    force = 2 * np.sin(np.arange(1000) / 50)
    path = tmp_path / "held.bin"
    path.write_bytes(b"PAIR" + np.stack([1e-9 * force, force], axis=1).tobytes())
    return path


def run(*arguments: object, command: str = "identify") -> int:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["friso", command, *map(str, arguments)])
        with pytest.raises(SystemExit) as left:
            main()
    return int(left.value.code or 0)


def test_a_format_of_its_own_is_read(extended: None, log: Path) -> None:
    assert file_format(log) == "pairs"
    assert [channel.name for channel in read_table(log).channels] == ["position", "force"]


def test_a_kind_of_its_own_is_identified_and_shown(
    extended: None, log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """By its estimates, and as it says itself once it does."""
    stage, out = ROOT / "examples" / "emps_axis.toml", tmp_path / "out"
    assert run(log, "--as", "hold", "--stage", stage, "--json", "--out", out) == 0
    answer = json.loads(capsys.readouterr().out)
    (experiment,) = answer["experiments"]
    assert experiment["kind"] == "hold"
    assert answer["estimates"][0]["key"] == "friction.static"
    for estimate in (experiment["estimates"][0], answer["estimates"][0]):
        assert estimate["low"] == pytest.approx(2, rel=1e-3)
    assert "Hold: held" in (out / "identify.html").read_text(encoding="utf-8")
    assert (out / "identify_hold_1.png").stat().st_size > 0
    monkeypatch.setitem(KINDS.added, "hold", (HeldForce(), ""))
    assert run(log, "--stage", stage, "--json", "--out", out, "--overwrite") == 0  # as kept beside the log
    (experiment,) = json.loads(capsys.readouterr().out)["experiments"]
    assert experiment["held_n"] == pytest.approx(2, rel=1e-3)
    assert "Held force: held" in (out / "identify.html").read_text(encoding="utf-8")
    assert (out / "identify_hold_force.png").stat().st_size > 0


def test_an_experiment_of_the_rig_of_its_own_is_run_and_shown(
    extended: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    stage, out = ROOT / "examples" / "thesis_drive.toml", tmp_path / "out"
    assert run("push", stage, "--seed", 3, "--json", "--out", out, command="rig") == 0
    answer = json.loads(capsys.readouterr().out)
    assert (answer["experiment"], answer["logs"][0]["name"]) == ("push", "pushed")
    assert "pushed" in (out / "rig.html").read_text(encoding="utf-8")
    assert (out / "rig_pushed.png").stat().st_size > 0
    assert run("--help", command="rig") == 0
    assert "push Push without moving" in " ".join(capsys.readouterr().out.split())


@pytest.mark.slow
def test_a_metric_of_its_own_is_swept_drawn_and_told(
    extended: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    stage, crossovers = ROOT / "examples" / "thesis_rig.toml", "controller.crossover=4 Hz, 8 Hz"
    answer = friso.sweep(stage, x=crossovers, metric="attracting")
    assert answer.data["attracting"].attrs == {"units": "1"}
    assert np.array_equal(answer.data["attracting"] > 0, friso.sweep(stage, x=crossovers).data["sketch"] == "hunts")
    assert answer.sentences()[0].startswith("Something attracts in ")
    assert [figure.title for figure in answer.figures()] == ["Motions that attract"]
    store = tmp_path / "map.zarr"
    assert run(stage, "--x", crossovers, "--metric", "loaded", "--out", store, command="map") == 0
    assert "The actuator works hard in " in " ".join(capsys.readouterr().out.split())
    page = store.with_suffix(".html").read_text(encoding="utf-8")
    assert all(text in page for text in ("Load of the actuator", "the actuator overcomes static friction"))
    assert run(store, "--json", "--out", tmp_path / "again", command="map") == 0
    assert json.loads(capsys.readouterr().out)["conclusion"].startswith("The actuator works hard")
    assert run(stage, "--x", crossovers, "--metric", "load", "--out", tmp_path / "no.zarr", command="map") == 2
    assert "--metric loaded" in capsys.readouterr().err


QUESTION = {
    "__init__": """
from friso.interface.question import HUNTS, Question
QUESTION = Question(__name__, 25, HUNTS, "hold rig.toml --force-limit '3 N'", details=True)
""",
    "question": """
from __future__ import annotations

from friso.interface.answer import Answer, question
from friso.interface.inputs import Changes, ForceLike, StageLike, quantity_of, read_stage
from friso.progress import Progress, silent
from friso.quantities import Quantity, positive
from friso.stage import Stage

class HoldAnswer(Answer):
    '''Whether it holds: `result` is the force [N].'''
    stage: Stage
    @property
    def subject(self) -> HoldAnswer:
        return self

@question
def hold(
    stage: StageLike, *, force_limit: ForceLike = "2 N", set: Changes = None, progress: Progress = silent
) -> HoldAnswer:
    '''Does it hold still.

    Parameters
    ----------
    force_limit : str or float
        The force that it has to bear, "2 N" or a number [N].
    '''
    chosen = read_stage(stage, set)
    force = Quantity("N", positive, "2 N").on(chosen.axis_kind)
    return HoldAnswer(quantity_of(force_limit, "force_limit", force), stage=chosen)
""",
    "blocks": """
from friso.shown.blocks import AnswerBlock
def blocks(answer):
    holds = f"It holds {answer.result:g} N."
    return [AnswerBlock(sentences=[holds], numbers=lambda: {"conclusion": holds, "force_n": answer.result})]
""",
}
"""The folder of a question, by module."""


@pytest.fixture
def asked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A question of its own, "hold"."""
    folder = tmp_path / "own" / "hold"
    folder.mkdir(parents=True)
    for name, text in QUESTION.items():
        (folder / f"{name}.py").write_text(text)
    monkeypatch.syspath_prepend(folder.parent)
    monkeypatch.setitem(QUESTIONS.added, "hold", (importlib.import_module("hold").QUESTION, ""))


def test_a_question_of_its_own_is_listed_and_answers(
    asked: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(command="--help") == 0
    lines = capsys.readouterr().out.partition(HUNTS)[2].splitlines()
    names = [line.split()[0] for line in lines if line[:2] == "  " and line[2:3].isalpha()]
    assert names.index("check") < names.index("hold") < names.index("simulate")
    assert run("--help", command="hold") == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert '--force-limit FORCE The force that it has to bear, "2 N". [default: 2 N]' in shown
    assert "--set KEY=VALUE Override a key" in shown
    stage, out = ROOT / "examples" / "thesis_rig.toml", tmp_path / "out"
    assert run(stage, "--force-limit", "3 N", "--json", "--out", out, command="hold") == 0
    expected = {"conclusion": "It holds 3 N.", "force_n": 3.0, "files": [str(out / "hold.html")], "plug_ins": foreign()}
    assert json.loads(capsys.readouterr().out) == expected
    assert "It holds 3 N." in (out / "hold.html").read_text(encoding="utf-8")
    assert run(stage, "--force-limit", "3 mm", command="hold") == 2
    assert "--force-limit" in capsys.readouterr().err


def test_a_question_of_its_own_is_a_function_of_friso(asked: None, tmp_path: Path) -> None:
    answer = friso.hold(friso.example("thesis_rig"), force_limit=4.0)
    assert str(answer) == "It holds 4 N."
    assert answer.data["force"].attrs["units"] == "N"
    assert "hold" in dir(friso)
    assert "set : dict, optional" in (friso.hold.__doc__ or "")
    assert answer.report(tmp_path / "hold.html") == [tmp_path / "hold.html"]


def test_a_question_of_its_own_is_a_picture_of_the_app(asked: None) -> None:
    rig = ROOT / "examples" / "thesis_rig.toml"
    machine = {"name": "rig.toml", "text": rig.read_text(encoding="utf-8"), "changes": {}}
    request, work = PageRequest.of({"machine": machine}, Uploads()), Work(lambda frame: None)
    (described,) = QUESTIONS_OF_PAGES["machine"](request, work)
    assert {"id": "hold", "label": "Hold"} in described["others"]
    job, files = job_of("hold"), job_of("hold.zip")
    assert job is not None
    assert files is not None
    (part,) = job(request, work)
    assert part["sentences"] == ["It holds 2 N."]
    assert part["command"] == "friso hold rig.toml"
    (archive,) = files(request, work)
    assert archive["name"] == "rig_hold.zip"
    assert job_of("held") is None


def test_what_is_registered_is_in_the_help(extended: None, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("--help") == 0
    text = " ".join(capsys.readouterr().out.split())
    assert all(f"{name} {KINDS.one_line(name)}" in text for name in KINDS)
    assert "hold Forces that the stage bears without moving" in text


def test_what_uses_others_is_analysed_after_them(extended: None) -> None:
    order = in_order()
    assert sorted(order) == list(KINDS)
    assert all(order.index(earlier) < order.index(name) for name in KINDS for earlier in KINDS[name].after)


@pytest.mark.parametrize(("registry", "page"), [(KINDS, "identify.md"), (RIG_EXPERIMENTS, "rig.md")])
def test_the_docs_name_all(registry: Sequence[str], page: str) -> None:
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    assert [name for name in registry if f"`{name}`" not in text and f"rig {name}" not in text] == []
