"""The questions that a page asks: each is answered by the function of friso of that name."""

from __future__ import annotations

import base64
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import friso
from friso.app import machine as machines
from friso.app.archive import archive
from friso.app.frames import figure_on_page
from friso.app.ghosts import ghosts_of, with_edge, with_places
from friso.app.lines import command_line, python_line
from friso.app.machine import Machine
from friso.app.uploads import Uploads
from friso.axis import speaking_of
from friso.errors import InputError
from friso.identification.logs.mapping import MAPPABLE
from friso.quantities import exactly
from friso.stage import Stage
from friso.stage.stage import numeric_keys
from friso.views.check.cases import case_labels
from friso.views.drawing.figure import Figure

if TYPE_CHECKING:
    from friso.answers.answer import Answer
    from friso.answers.sweep import SweepAnswer
    from friso.app.work import Work

AnswerPart = dict[str, Any]


@dataclass(frozen=True)
class PageRequest:
    """What a page asks about: the machine shown, the one that is `pinned` beside it or None, the options, and whether
    figures are for a `narrow` page; and the files that were dropped on it."""

    machine: Machine
    pinned: Machine | None
    options: Mapping[str, Any]
    narrow: bool
    uploads: Uploads

    @classmethod
    def of(cls, data: Mapping[str, Any], uploads: Uploads) -> PageRequest:
        """What a request holds. Raises InputError."""
        options = data.get("options") or {}
        if not isinstance(options, Mapping):
            raise InputError("options", type(options).__name__, "options by name")
        pinned = data.get("pinned")
        both = Machine.of(data.get("machine")), None if pinned is None else Machine.of(pinned)
        return cls(*both, options, bool(data.get("narrow")), uploads)

    def chosen(self, *names: str) -> dict[str, Any]:
        """The options of these names that are given: texts, numbers, true or false. Raises InputError for others."""
        for name, value in self.options.items():
            if name not in names or not isinstance(value, str | int | float | bool | None):
                raise InputError("options", name, f"one of {', '.join(names) or 'none'}, a text or a number")
        return {name: value for name, value in self.options.items() if value not in (None, "")}


def parts_of(
    asked: PageRequest, answer: Answer, beside: Callable[[Figure], Figure] = lambda figure: figure, **more: Any
) -> AnswerPart:
    """An answer as a page shows it, each figure with what is shown `beside`."""
    return {**figures_of(asked, answer, beside), **words_of(answer), **more}


def figures_of(asked: PageRequest, answer: Answer, beside: Callable[[Figure], Figure]) -> AnswerPart:
    """The figures of an answer, without words."""
    with speaking_of(answer.axis_kind):
        figures = [figure_on_page(beside(figure), asked.narrow) for figure in answer.figures()]
    return {"kind": "answer", "sentences": [], "tables": [], "details": [], "failure": "", "figures": figures}


def words_of(answer: Answer) -> AnswerPart:
    """The words of an answer, without figures: those that are shown stay."""
    return {
        "kind": "answer",
        "sentences": [*answer.sentences()],
        "tables": [{"title": item.title, "columns": item.columns, "rows": item.rows} for item in answer.tables()],
        "details": [*answer.details()],
        "failure": answer.failure,
    }


def machine(asked: PageRequest, work: Work) -> Iterator[AnswerPart]:
    """The keys of the machine."""
    asked.chosen()
    yield {"kind": "answer", **machines.machine_on_page(asked.machine)}


def run(asked: PageRequest, work: Work) -> Iterator[AnswerPart]:
    """What the run does."""
    asked.chosen()
    pinned = None if asked.pinned is None else _run(asked.pinned)
    work.notes.clear()  # those on the pinned machine
    yield parts_of(asked, friso.simulate(asked.machine.stage), ghosts_of(pinned), **_lines("simulate", asked))


def cell(asked: PageRequest, work: Work) -> Iterator[AnswerPart]:
    """What the run of a cell of a map does: its error alone."""
    asked.chosen()
    answer = friso.simulate(asked.machine.stage)
    with speaking_of(answer.axis_kind):
        (figure,) = answer.figures()
        error = replace(figure, panels=tuple(panel for panel in figure.panels if panel.title == "Error"))
        yield {"kind": "answer", "sentences": [*answer.sentences()], "figures": [figure_on_page(error, narrow=True)]}


def verdict(asked: PageRequest, work: Work) -> Iterator[AnswerPart]:
    """The verdict by the cycles that attract, in a word for each case: a map of a single cell, or one over the joint
    locked and free."""
    stage = asked.machine.stage
    key, cases = _cases(stage)
    runs = friso.sweep(stage, {key: list(cases.values())}, metric="verdict", progress=work.progress)
    words = dict(zip(cases, runs.data["verdict"].values.tolist(), strict=True))
    yield {"kind": "answer", "cases": _labelled(stage, words), "verdict": words[_given(stage)]}


def check(asked: PageRequest, work: Work) -> Iterator[AnswerPart]:
    """Does it hunt: every case, with its margin."""
    options = asked.chosen("draws")
    pinned = None if asked.pinned is None else _check(asked.pinned)
    work.notes.clear()
    answer = friso.check(asked.machine.stage, **options, progress=work.progress)
    cases = {name: case.verdict for name, case in answer.result.items()}
    more = {"cases": _labelled(asked.machine.stage, cases), **_lines("check", asked, options)}
    yield parts_of(asked, answer, ghosts_of(pinned), **more)


def bode(asked: PageRequest, work: Work) -> Iterator[AnswerPart]:
    """The loop in the limit cases: the figures, and then how fast the controller may be, which takes longer."""
    answer, picture = _loops(asked, work)
    lines = _lines("bode", asked)
    yield {**picture, **lines, "kind": "partly"}
    yield {**words_of(answer), **lines}


def loops(asked: PageRequest, work: Work) -> Iterator[AnswerPart]:
    """The same while a slider moves: the figures alone."""
    yield {**_loops(asked, work)[1], **_lines("bode", asked)}


def _loops(asked: PageRequest, work: Work) -> tuple[Answer, AnswerPart]:
    asked.chosen()
    pinned = None if asked.pinned is None else _bode(asked.pinned)
    work.notes.clear()
    answer = friso.bode(asked.machine.stage, progress=work.progress)
    return answer, figures_of(asked, answer, ghosts_of(pinned))


def flexure(asked: PageRequest, work: Work) -> Iterator[AnswerPart]:
    """The leaf springs."""
    asked.chosen()
    pinned = asked.pinned and asked.pinned.stage
    ghost = friso.flexure(pinned) if pinned and pinned.flexure else None
    work.notes.clear()
    answer = friso.flexure(asked.machine.stage, progress=work.progress)
    drawing = answer.files()["flexure_drawing.svg"]
    yield parts_of(asked, answer, ghosts_of(ghost), drawing=drawing, **_lines("flexure", asked))


COARSE_TO_FINE = (6, 21, 41)
"""Points along each axis of a map, one picture after the other."""


def map_study(asked: PageRequest, work: Work) -> Iterator[AnswerPart]:
    """A map over two keys, coarse to fine, and last, if it is asked for, the edge of hunting over it; where the machine
    stands in it, and the pinned one."""
    options = asked.chosen("x", "y", "log", "metric", "edge")
    axes = {name: str(options.get(name, "")) for name in ("x", "y")}
    keys = {name: text.partition("=")[0].strip() for name, text in axes.items()}
    shown = {"metric": options.get("metric", "outcome"), "log": options.get("log", False)}
    stands = [("this machine", asked.machine.stage)]
    stands += [("pinned", asked.pinned.stage)] if asked.pinned else []

    def ranges(count: int) -> dict[str, Any]:
        return {name: f"{text}:{count}" for name, text in axes.items()}

    def swept(count: int) -> SweepAnswer:
        return friso.sweep(asked.machine.stage, **ranges(count), **shown, progress=work.progress)

    def part(answer: SweepAnswer, count: int, edge: Answer | None = None) -> AnswerPart:
        def drawn(figure: Figure) -> Figure:
            return with_edge(with_places(figure, stands, [*keys.values()]), edge)

        places = {name: answer.data[key].values.tolist() for name, key in keys.items()}
        more = {"axes": keys, "places": places, **_lines("map", asked, {**ranges(count), **shown}, "sweep")}
        return parts_of(asked, answer, drawn, **more)

    *coarse, finest = COARSE_TO_FINE
    for count in coarse:
        yield {**part(swept(count), count), "kind": "partly"}
    answer = swept(finest)
    whole = part(answer, finest)
    if options.get("edge"):
        yield {**whole, "kind": "partly"}
        try:
            edge = friso.boundary(
                asked.machine.stage, x=axes["x"], y=axes["y"], log=shown["log"], progress=work.progress
            )
            whole = part(answer, finest, edge)
            whole["sentences"] += edge.sentences()
        except InputError as error:  # such as a stage that cannot hunt: its map is shown all the same
            whole["sentences"] += [str(error)]
    yield whole


def boundary(asked: PageRequest, work: Work) -> Iterator[AnswerPart]:
    """Where hunting ends, over one key or in the plane of two."""
    options = asked.chosen("x", "y", "log")
    answer = friso.boundary(asked.machine.stage, **options, progress=work.progress)
    yield parts_of(asked, answer, **_lines("boundary", asked, options))


def tune(asked: PageRequest, work: Work) -> Iterator[AnswerPart]:
    """What stops it: the ways, and the stage of each that works."""
    options = asked.chosen("within", "settle", "force_limit", "bandwidth_limit", "only", "keep")
    answer = friso.tune(asked.machine.stage, **options, progress=work.progress)
    ways = [{"name": outcome.remedy.name, "toml": outcome.stage.to_toml()} for outcome in answer.working]
    yield parts_of(asked, answer, ways=ways, **_lines("tune", asked, options))


def design(asked: PageRequest, work: Work) -> Iterator[AnswerPart]:
    """What stops it: an isolator with its leaf springs."""
    asked.chosen()
    answer = friso.design(asked.machine.stage, progress=work.progress)
    ways = [{"name": "design", "toml": answer.stage.to_toml()}]
    yield parts_of(asked, answer, ways=ways, **_lines("design", asked))


def logs(asked: PageRequest, work: Work) -> Iterator[AnswerPart]:
    """What dropped files hold, and which channels there are to choose from."""
    files, assigned = _dropped(asked)
    answer = friso.logs(files, **assigned, progress=work.progress)
    channels = list(dict.fromkeys(channel.name for item in answer.result for channel in item.channels))
    yield parts_of(asked, answer, channels=channels, roles=[*MAPPABLE])


def identify(asked: PageRequest, work: Work) -> Iterator[AnswerPart]:
    """The machine that dropped logs show, with its uncertainties; with `assumed`, the one shown is what is known."""
    files, assigned = _dropped(asked)
    stage = asked.machine.stage if asked.options.get("assumed") is True else None
    beside = files[0].parent  # else a file of that name in the folder where friso was started would have its say
    answer = friso.identify(files, stage=stage, **assigned, folder=beside, progress=work.progress)
    stages = [] if answer.stage is None else [{"name": "identified", "toml": answer.stage.to_toml()}]
    if stages and answer.result.correlations.keys:
        work.notes.append(CORRELATED)
    yield parts_of(asked, answer, ways=stages)


CORRELATED = (
    "The correlations of the estimates are left out here, and of a machine that is taken over: "
    "friso identify on the command line writes them beside its stage file."
)


def _dropped(asked: PageRequest) -> tuple[list[Path], dict[str, Any]]:
    """The files of a question about logs, and what is said of their channels. Raises InputError."""
    names, options = asked.options.get("files"), {}
    if not isinstance(names, list) or not names:
        raise InputError("files", "none", "files that were dropped on the page")
    for name in ("map", "unit", "scale"):
        said = asked.options.get(name) or {}
        if not isinstance(said, Mapping) or not all(isinstance(text, str) for text in said.values()):
            raise InputError(name, "something else", "texts by name")
        options[name] = {key: text for key, text in said.items() if text}
    if step := asked.options.get("dt"):
        options["dt"] = str(step)
    return [asked.uploads.path(name) for name in names], options


QUESTIONS: Mapping[str, Callable[[PageRequest, Work], Iterator[AnswerPart]]] = {
    "machine": machine,
    "run": run,
    "cell": cell,
    "verdict": verdict,
    "check": check,
    "bode": bode,
    "loops": loops,
    "flexure": flexure,
    "map": map_study,
    "boundary": boundary,
    "tune": tune,
    "design": design,
    "logs": logs,
    "identify": identify,
}
"""The questions by name."""

QUICK = frozenset({"machine"})
"""The questions that compute nothing."""

REPORTS: Mapping[str, Callable[..., Answer]] = {
    "check.zip": friso.check,
    "bode.zip": friso.bode,
    "flexure.zip": friso.flexure,
    "boundary.zip": friso.boundary,
    "map.zip": friso.sweep,
}
"""The answers whose files are handed out: all that the command writes, and its document, in one archive."""


def report(function: Callable[..., Answer], asked: PageRequest, work: Work) -> Iterator[AnswerPart]:
    """The files of an answer."""
    options = asked.chosen("x", "y", "log", "metric", "edge")
    options.pop("edge", None)  # the archive of a map holds the map
    if function is friso.sweep:
        options |= {name: f"{options[name]}:{COARSE_TO_FINE[-1]}" for name in ("x", "y") if name in options}
    answer = function(asked.machine.stage, **options, progress=work.progress)
    work.progress(0, 0, "drawing the figures")
    stem = asked.machine.name.removesuffix(".toml")
    held = archive(answer, asked.machine.stage, stem)
    yield {"kind": "files", "name": f"{stem}_{answer.command}.zip", "base64": base64.b64encode(held).decode("ascii")}


def _lines(
    command: str, asked: PageRequest, options: Mapping[str, Any] | None = None, function: str = ""
) -> AnswerPart:
    chosen = {name: value for name, value in (options or {}).items() if value is not False}
    line = python_line(function or command, asked.machine, chosen)
    of = "the stage file saved here" if asked.machine.is_of_page else f"{asked.machine.name} as it was opened"
    return {"command": command_line(command, asked.machine, chosen), "python": line, "of": of}


@lru_cache(8)
def _run(which: Machine) -> Any:
    return friso.simulate(which.stage)


@lru_cache(2)
def _bode(which: Machine) -> Any:
    return friso.bode(which.stage)


@lru_cache(2)
def _check(which: Machine) -> Any:
    return friso.check(which.stage)


def _given(stage: Stage) -> str:
    """Which of the cases is the stage as it is given."""
    return "given" if stage.joint is None else "locked" if stage.joint.locked else "free"


def _labelled(stage: Stage, verdicts: Mapping[str, str]) -> list[dict[str, str]]:
    """The cases that differ, by their labels in sentences, with the verdicts."""
    return [{"label": label, "verdict": verdicts[name]} for name, label in case_labels(stage).items()]


def _cases(stage: Stage) -> tuple[str, dict[str, Any]]:
    """A key, and the value of it in each case."""
    if stage.joint is not None:
        values = {"locked": True, "free": False}
        cases = {name: values[name] for name in stage.variants() if name in values}
        return "joint.locked", cases
    key, flat = "masses.stage" if stage.masses.stage is not None else "masses.cart", stage.flat()
    return key, {"given": exactly(flat[key], numeric_keys(flat)[key].unit)}
