"""Answer the questions of a page, each by the friso function of that name."""

from __future__ import annotations

import base64
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import friso
from friso.app import machine as machines
from friso.app.machine import Machine, Uploads, archive, command_line, python_line
from friso.app.maps import (
    cures_of,
    finer,
    ghosts_of,
    home_of,
    located,
    sketched,
    tracks_of,
    with_edge,
    with_log,
    with_other_joint,
    without_own,
)
from friso.app.work import KeptAnswers, Work, figure_on_page
from friso.axis import speaking_of
from friso.equations.motion import rests
from friso.errors import InputError
from friso.hunting import cannot_hunt, is_moved_evenly, unstable
from friso.identification.logs.assemble import read_log
from friso.identification.logs.log import Log
from friso.identification.logs.roles import MAPPABLE
from friso.interface.question import QUESTIONS as DECLARED
from friso.quantities import exactly
from friso.questions.check.built_words import built_in_short
from friso.questions.logs.question import LogsAnswer, options_of
from friso.questions.map.cells import SHOWN, with_places
from friso.shown.drawing.figure import Figure
from friso.shown.motion_words import COLOURS, LABELS, case_labels, verdict_in_short
from friso.shown.text import after_loop, lost_as_built, unknown_condition
from friso.stage import Stage
from friso.stage.rig import is_as_built
from friso.stage.stage import numeric_keys
from friso.studies.metric import metrics

if TYPE_CHECKING:
    from friso.interface.answer import Answer
    from friso.questions.identify.question import IdentifyAnswer
    from friso.questions.map.question import SweepAnswer

AnswerPart = dict[str, Any]

KEPT = KeptAnswers()
"""Answers kept about machines. Answers about runs change with a slider, and are kept for the pinned machine only."""


@dataclass(frozen=True)
class PageRequest:
    """A question of the page: the machine shown, the pinned one, options, and dropped files.

    `pinned` is None if no machine is pinned.
    """

    machine: Machine
    pinned: Machine | None
    options: Mapping[str, Any]
    uploads: Uploads

    @classmethod
    def of(cls, data: Mapping[str, Any], uploads: Uploads) -> PageRequest:
        """Read a request from the JSON that a page sent. Raises InputError for any other data."""
        options = data.get("options") or {}
        if not isinstance(options, Mapping):
            raise InputError("options", type(options).__name__, "options by name")
        pinned = data.get("pinned")
        both = Machine.of(data.get("machine")), None if pinned is None else Machine.of(pinned)
        return cls(*both, options, uploads)

    def chosen(self, *names: str) -> dict[str, Any]:
        """Return the options of the request that have a value.

        Raises InputError for an option that is not in `names`, or a value that is no text, number or truth value.
        """
        for name, value in self.options.items():
            if name not in names or not isinstance(value, str | int | float | bool | None):
                raise InputError("options", name, f"one of {', '.join(names) or 'none'}, a text or a number")
        return {name: value for name, value in self.options.items() if value not in (None, "")}


def parts_of(answer: Answer, beside: Callable[[Figure], Figure] = lambda figure: figure, **more: Any) -> AnswerPart:
    """Return an answer as the page shows it.

    `beside` adds to each figure what it is compared with. `more` are further entries.
    """
    return {**figures_of(answer, beside), **words_of(answer), **more}


def figures_of(
    answer: Answer, beside: Callable[[Figure], Figure], some: Callable[[], Sequence[Figure]] | None = None
) -> AnswerPart:
    """Return the figures of an answer for the page, without the answer's words.

    `some` computes the figures to show, by default all of the answer. `beside` adds to each figure what it is compared
    with.
    """
    with speaking_of(answer.axis_kind):
        figures = [figure_on_page(beside(figure)) for figure in (some or answer.figures)()]
    return {"kind": "answer", "sentences": [], "tables": [], "details": [], "failure": "", "figures": figures}


def words_of(answer: Answer) -> AnswerPart:
    """Return the words of an answer without figures; the page keeps the figures it shows."""
    return {
        "kind": "answer",
        "sentences": [*answer.sentences()],
        "tables": [
            {"title": table.title, "columns": table.labels, "rows": table.rows}
            for table in answer.tables()
            if not table.behind
        ],
        "details": [*answer.details()],
        "failure": answer.failure,
    }


def machine(asked: PageRequest, work: Work) -> Iterator[AnswerPart]:
    """Yield the machine's keys, the metrics of maps, and questions of installed packages.

    If a changed key is wrong, the keys of the file as it was opened come before the error.
    """
    asked.chosen()
    others = [{"id": name, "label": name.replace("-", " ").capitalize()} for name in others_of_stages()]
    in_order = sorted(metrics().items(), key=lambda item: not item[1].words)  # metrics in words first
    shown = {"others": others, "metrics": [{"id": name, "label": metric.title} for name, metric in in_order]}
    try:
        yield {"kind": "answer", **shown, **machines.machine_on_page(asked.machine)}
    except InputError:
        yield {"kind": "partly", **shown, **machines.machine_on_page(replace(asked.machine, changed="{}"))}
        raise


def controller(asked: PageRequest, work: Work) -> Iterator[AnswerPart]:
    """Yield the keys that change if the machine has another kind of controller."""
    name = str(asked.chosen("name").get("name"))
    yield {"kind": "answer", "changes": machines.as_controller(asked.machine.stage, name)}


def others_of_stages() -> list[str]:
    """Return the questions of installed packages that need only a stage.

    The page shows each of them as a picture.
    """
    return [name for name in DECLARED.others if name not in {*QUESTIONS, *COMMANDS} and _takes_a_stage_alone(name)]


def _takes_a_stage_alone(name: str) -> bool:
    """Tell whether a question needs only a stage, and no option.

    The answer is False for a package that cannot be loaded; `friso --help` reports it.
    """
    try:
        declared = DECLARED[name]
        options = (item for key, item in declared.parameters.items() if key != "stage")
        return declared.takes == ("stage",) and all(option.default is not option.empty for option in options)
    except InputError:  # friso --help reports it
        return False


def other(name: str, asked: PageRequest, work: Work) -> Iterator[AnswerPart]:
    """Yield the answer of an installed package about the machine shown."""
    asked.chosen()
    yield parts_of(_other(name, asked, work), **_lines(name, asked))


def _other(name: str, asked: PageRequest, work: Work) -> Answer:
    return KEPT.answer(DECLARED[name].function, asked.machine, work)


def run(asked: PageRequest, work: Work) -> Iterator[AnswerPart]:
    """Yield the run: first its figures, then its sentences, which need measurements of the run."""
    log = _logged(asked) if asked.options else None
    ghosts = _ghosts(asked, work, friso.simulate)
    stage = asked.machine.stage
    answer, lines = friso.simulate(stage), _lines("simulate", asked)
    others = {name: case for name, case in stage.variants().items() if name not in ("given", _given(stage))}

    def drawn(figure: Figure) -> Figure:
        """Lay the other state of the joint, the logged run and the pinned machine beside a run."""
        for name, case in others.items():
            (other,) = friso.simulate(case).figures()
            own = case_labels(stage)[_given(stage)], COLOURS[_given(stage)]
            figure = with_other_joint(figure, other, own, (case_labels(stage)[name], COLOURS[name]))
        if log:
            run = answer.result
            figure = with_log(figure, log, run["reference"].to_numpy(), run["time"].to_numpy())
        return ghosts(figure)

    yield {**figures_of(answer, drawn), **lines, "kind": "partly"}
    yield {**words_of(answer), **lines}


def _logged(asked: PageRequest) -> Log:
    """Return the first of the dropped files as a log of positions."""
    if unknown := {*asked.options} - {"files", "map", "unit", "scale", "dt"}:
        raise InputError("options", ", ".join(sorted(unknown)), "files that were dropped, and what is said of them")
    files, assigned = _dropped(asked)
    with _named_as_dropped():
        return read_log(files[0], options_of(**{"dt": None, **assigned}))


def cell(asked: PageRequest, work: Work) -> Iterator[AnswerPart]:
    """Yield a figure of the error in the run of a map's cell, and sentences on the run.

    The machine of the request is the one of this cell.
    """
    asked.chosen()
    ghosts = _ghosts(asked, work, friso.simulate)
    answer = friso.simulate(asked.machine.stage)
    with speaking_of(answer.axis_kind):
        (figure,) = map(ghosts, answer.figures())
        error = replace(figure, panels=tuple(panel for panel in figure.panels if panel.title == "Error"))
        yield {"kind": "answer", "sentences": [*answer.sentences()], "figures": [figure_on_page(error)]}


def verdict(asked: PageRequest, work: Work) -> Iterator[AnswerPart]:
    """Yield the verdict on the machine in one word, for the joint locked and free if it has one.

    It is not certain of a stage with unknown values, or with a drive whose samples and delays make the loop unstable.
    It is computed as a map of one or two cells, by a search for attractors. The word is "none" for a stage that may
    hunt while its reference keeps moving.
    """
    stage = asked.machine.stage
    key, cases = _cases(stage)
    words = dict.fromkeys(cases, "none")
    if rests(stage.flat()) or cannot_hunt(stage):
        runs = friso.sweep(stage, {key: list(cases.values())}, metric="verdict", progress=work.progress)
        words = dict(zip(cases, runs.data["verdict"].values.tolist(), strict=True))
    work.notes += [*work.meanwhile, *filter(None, [unknown_condition(stage).removesuffix(": ")])]
    lost = lost_as_built(stage)
    short = after_loop(f"{words[_given(stage)]}{' (not certain)' if stage.doubt else ''}", unstable(stage), lost)
    time = "in continuous time: " if is_as_built(stage) and not lost else ""
    certain = {"certain": not stage.doubt and not lost, "in_short": time + short}
    yield {"kind": "answer", **_told(stage, words), **certain}


def check(asked: PageRequest, work: Work) -> Iterator[AnswerPart]:
    """Yield whether the stage hunts, as given and with its joint locked and free, and margins."""
    options = asked.chosen(*OPTIONS["check"])
    ghosts = _ghosts(asked, work, friso.check)
    answer = KEPT.answer(friso.check, asked.machine, work, options)
    cases = {name: case.verdict for name, case in answer.result.items()}
    stage = asked.machine.stage
    more = {**_told(stage, cases), "verdict": answer.verdict, **_lines("check", asked, options)}
    more["cures"] = cures_of(answer.result, _given(stage))
    case, built = answer.result[_given(stage)], answer.as_built
    certain, short = (case.judgement.hunting.certain, verdict_in_short(case))
    if built:
        certain, short = built.certain, built_in_short(built)
    more |= {"certain": certain, "in_short": short}
    yield parts_of(answer, ghosts, **more)


def bode(asked: PageRequest, work: Work) -> Iterator[AnswerPart]:
    """Yield the Bode plots of the limit cases, then the largest bandwidth.

    The bandwidth takes longer to compute.
    """
    lines = _lines("bode", asked)
    for picture in loops(asked, work):
        yield {**picture, "kind": "partly"}
    yield {**words_of(KEPT.answer(friso.bode, asked.machine, work)), **lines}


def loops(asked: PageRequest, work: Work) -> Iterator[AnswerPart]:
    """Yield the Bode plots while a slider moves.

    First come the figures that need only the limit cases, not all states of friction.
    """
    asked.chosen()
    ghosts, lines = _ghosts(asked, work, friso.bode), _lines("bode", asked)
    answer = KEPT.answer(friso.bode, asked.machine, work)
    first = figures_of(answer, ghosts, answer.first_figures)
    yield {**first, **lines, "kind": "partly", "names": None}
    there = [figure["name"] for figure in first["figures"]]
    others = figures_of(answer, ghosts, lambda: [figure for figure in answer.figures() if figure.name not in there])
    yield {**others, **lines, "names": [*there, *(figure["name"] for figure in others["figures"])]}


def flexure(asked: PageRequest, work: Work) -> Iterator[AnswerPart]:
    """Yield the leaf springs of the machine, beside those of the pinned machine if it has any."""
    asked.chosen()
    pinned = asked.pinned if asked.pinned and asked.pinned.stage.flexure else None
    ghost = KEPT.answer(friso.flexure, pinned, work) if pinned else None
    work.notes.clear()
    answer = KEPT.answer(friso.flexure, asked.machine, work)
    yield parts_of(answer, ghosts_of(ghost), **_lines("flexure", asked))


OPTIONS: Mapping[str, tuple[str, ...]] = {
    "check": ("draws",),
    "map": ("x", "y", "log", "metric", "edge", "coarse"),
    "boundary": ("x", "y", "log"),
    "tune": ("within", "settle", "force_limit", "bandwidth_limit", "margin", "only", "keep"),
}
"""The options that a page may set, by command."""

COARSE_TO_FINE = (6, 11, 21)
"""Numbers of points along each axis of a map, in the order of its pictures. The last one has its edges located."""


def map_study(asked: PageRequest, work: Work) -> Iterator[AnswerPart]:
    """Yield a map over two keys from coarse to fine, with marks where the machines lie in it.

    If asked for, the edge of hunting is added last. A stage that cannot hunt gets a sentence instead. With the option
    `coarse` the first two pictures are all, unless the map is there: a page asks for more once its verdict is known.
    """
    options = asked.chosen(*OPTIONS["map"])
    axes, spacing = {name: str(options.get(name, "")) for name in ("x", "y")}, _spacing(options)
    keys = {name: text.partition("=")[0].strip() for name, text in axes.items()}
    metric, stage = str(options.get("metric", "outcome")), asked.machine.stage
    home = home_of(asked.machine, [*keys.values()])
    if metric == "sketch" and not rests(stage.flat()):  # there is a verdict only where the reference comes to stand
        metric = "stick_slip" if is_moved_evenly(stage) else "outcome"
    shown = {"metric": metric}

    def ranges(count: int) -> dict[str, Any]:
        """Return the ranges of both axes with `count` points."""
        return {name: f"{text}:{count}{spacing}" for name, text in axes.items()}

    def part(answer: SweepAnswer, count: int, edge: Answer | None = None, title: str = "") -> AnswerPart:
        """Return a map as the page shows it, with the machines and the edge of hunting on it.

        `title` stands above it instead of what it shows.
        """

        def drawn(figure: Figure) -> Figure:
            titled = replace(figure, title=title or figure.title)
            return with_edge(_on_map(titled, asked, [*keys.values()]), edge)

        places = {name: answer.data[key].values.tolist() for name, key in keys.items()}
        more = {"axes": keys, "places": places, **_lines("map", asked, {**ranges(count), **shown}, "sweep")}
        if home == asked.machine:
            return parts_of(answer, drawn, **more)
        words = {**words_of(answer), "sentences": [], "details": []}  # they are about the place of another machine
        return {**figures_of(answer, drawn, lambda: without_own(answer)), **words, **more}

    finest = COARSE_TO_FINE[-1]
    whole_options = {**ranges(finest), **shown}
    edged = None
    if not KEPT.holds(friso.sweep, home, whole_options):
        look = KEPT.answer(sketched, home, work, {**ranges(COARSE_TO_FINE[0]), **shown})
        steps = [{**ranges(count), **shown, "at_edges": True} for count in COARSE_TO_FINE[1:]]
        for step in [{}, *steps, {**steps[-1], "at_edges": False}]:
            if step:
                look = KEPT.answer(finer, home, work, step, partial(finer, home.stage, look, **step))
            elif KEPT.holds(finer, home, steps[0]):
                continue
            count = len(look.done)
            title = f"A first look: {count} by {count} cells{' at its edges' * (not look.done.all())}, not located yet"
            yield {**part(look.answer, count, title=title), "kind": "partly", "sentences": [], "details": []}
            if options.get("coarse") and step == steps[0]:
                return
        edged = partial(located, look.answer, work.progress)
    answer = KEPT.answer(friso.sweep, home, work, whole_options, edged)
    whole = part(answer, finest)
    if options.get("edge"):
        yield {**whole, "kind": "partly"}
        try:
            edge = KEPT.answer(
                friso.boundary, asked.machine, work, {name: f"{text}{spacing}" for name, text in axes.items()}
            )
            whole = part(answer, finest, edge)
            whole["sentences"] += edge.sentences()
        except InputError as error:  # such as a stage that cannot hunt: its map is shown all the same
            whole["sentences"] += [str(error)]
    yield whole


def _spacing(options: Mapping[str, Any]) -> str:
    """Return what stands behind a range that the page spaces as its option says."""
    return ":log" if options.get("log") else ""


MOST_VALUES = 40
"""Largest number of values along the slider of a key. A page asks for eleven."""


def tracks(asked: PageRequest, work: Work) -> Iterator[AnswerPart]:
    """Yield the verdict at values [SI] along the sliders of keys; none for a stage without a verdict."""
    stage, said = asked.machine.stage, asked.options.get("values")
    most, columns = MOST_VALUES, said.values() if isinstance(said, Mapping) else [None]
    if not all(isinstance(one, list) and len(one) <= most and all(map(_is_number, one)) for one in columns):
        raise InputError("values", "something else", f"at most {most} values by key")
    fields, sought = numeric_keys(stage.flat()), rests(stage.flat())
    values = {
        key: [exactly(float(value), fields[key].unit) for value in column]
        for key, column in dict(said or {}).items()
        if sought and key in fields and isinstance(stage.flat().get(key), float)
    }
    yield {"kind": "answer", "tracks": tracks_of(stage, values, work.progress) if values else {}}


def _is_number(value: object) -> bool:
    """Tell whether a value of JSON is a finite number; whole ones may be too large for one."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= sys.float_info.max


def _on_map(figure: Figure, asked: PageRequest, keys: Sequence[str]) -> Figure:
    """Mark the machines on a map over two keys.

    The note of the figure is removed, because the sentences below say the same.
    """
    return with_places(replace(figure, note=""), _stands(asked), keys)


def boundary(asked: PageRequest, work: Work) -> Iterator[AnswerPart]:
    """Yield where hunting ends, over one key or in the plane of two keys.

    Following the edge may take minutes, so in a plane a coarse map of verdicts comes first. If the stage cannot hunt,
    the map stays, with the reason.
    """
    chosen = asked.chosen(*OPTIONS["boundary"])
    spacing = _spacing(chosen)
    options = {name: f"{chosen[name]}{spacing}" for name in ("x", "y") if name in chosen}
    keys = [str(options[name]).partition("=")[0].strip() for name in ("x", "y") if name in options]
    lines, rough = _lines("boundary", asked, options), None
    if len(keys) == 2 and not KEPT.holds(friso.boundary, asked.machine, options):
        ranges = {name: text.removesuffix(spacing) for name, text in options.items()}
        coarse = {name: f"{text}:{COARSE_TO_FINE[0]}{spacing}" for name, text in ranges.items()} | {"metric": "sketch"}
        with suppress(InputError):  # there may be no verdicts, but the boundary says why
            verdicts = KEPT.answer(friso.sweep, asked.machine, work, coarse)
            rough = {**parts_of(verdicts, lambda figure: _on_map(figure, asked, keys)), **lines}
    if rough is not None:
        yield {**rough, "kind": "partly"}
    try:
        answer = KEPT.answer(friso.boundary, asked.machine, work, options)
    except InputError as error:  # such as a stage that cannot hunt
        if rough is None:
            raise
        yield {**rough, "sentences": [str(error)]}
        return

    def part(ghosts: Callable[[Figure], Figure]) -> AnswerPart:
        """Return the boundary as the page shows it, with the pinned machine's in grey.

        In a plane of two keys, marks show where the machines lie.
        """

        def drawn(figure: Figure) -> Figure:
            return with_places(ghosts(figure), _stands(asked), keys) if len(keys) == 2 else ghosts(figure)

        return parts_of(answer, drawn, **lines)

    if asked.pinned is None:
        yield part(ghosts_of(None))
        return
    yield {**part(ghosts_of(None)), "kind": "partly"}
    notes = [*work.notes]
    try:
        ghost = KEPT.answer(friso.boundary, asked.pinned, work, options)
        whole = part(ghosts_of(ghost))
    except InputError as error:  # such as a stage that cannot hunt
        whole = part(ghosts_of(None))
        whole["sentences"] = [*whole["sentences"], f"The pinned machine: {error}"]
    work.notes[:] = notes  # leave out notes on the pinned machine
    yield whole


def tune(asked: PageRequest, work: Work) -> Iterator[AnswerPart]:
    """Yield the remedies that stop hunting, and the stage of each that works."""
    options = asked.chosen(*OPTIONS["tune"])
    answer = KEPT.answer(friso.tune, asked.machine, work, options)
    ways = [
        {"name": outcome.remedy.name, "toml": answer.result.complete(outcome.stage).to_toml()}
        for outcome in answer.working
    ]
    yield parts_of(answer, ways=ways, **_lines("tune", asked, options))


def design(asked: PageRequest, work: Work) -> Iterator[AnswerPart]:
    """Yield a design that stops hunting: an isolator with its leaf springs."""
    asked.chosen()
    answer = KEPT.answer(friso.design, asked.machine, work)
    work.notes += work.meanwhile
    ways = [{"name": "design", "toml": answer.stage.to_toml()}]
    yield parts_of(answer, ways=ways, **_lines("design", asked))


def logs(asked: PageRequest, work: Work) -> Iterator[AnswerPart]:
    """Yield what dropped files hold, and which channels can be chosen."""
    answer = _looked_into(asked, work)
    held = [channel for item in answer.result for channel in item.channels]
    channels = list(dict.fromkeys(channel.name for channel in held))
    recognised = {channel.role: channel.name for channel in held if channel.role}
    more = {"channels": channels, "roles": [*MAPPABLE], "recognised": recognised}
    yield parts_of(answer, **more, **_lines_of_logs("logs", asked))


def _looked_into(asked: PageRequest, work: Work) -> LogsAnswer:
    """Read the dropped files with what the user said of their channels."""
    files, assigned = _dropped(asked)
    with _named_as_dropped():
        return friso.logs(files, **assigned, progress=work.progress)


def identify(asked: PageRequest, work: Work) -> Iterator[AnswerPart]:
    """Yield the machine identified from dropped logs, with its uncertainties.

    With the option `assumed`, the machine shown counts as prior knowledge.
    """
    answer = _identified(asked, work)
    stages = [] if answer.stage is None else [{"name": "identified", "toml": answer.stage.to_toml()}]
    if stages and answer.result.correlations.keys:
        work.notes.append(CORRELATED)
    yield parts_of(answer, ways=stages, **_lines_of_logs("identify", asked))


def _identified(asked: PageRequest, work: Work) -> IdentifyAnswer:
    """Identify a machine from the dropped logs.

    The logs' own folder is searched for further files, not the folder in which friso was started.
    """
    files, assigned = _dropped(asked)
    stage = asked.machine.stage if asked.options.get("assumed") is True else None
    beside = files[0].parent  # a file of that name in the folder where friso was started must not count
    with _named_as_dropped():
        return friso.identify(files, stage=stage, **assigned, folder=beside, progress=work.progress)


@contextmanager
def _named_as_dropped() -> Iterator[None]:
    """Let errors in a log name the file as it was dropped, without the server's folder."""
    try:
        yield
    except InputError as error:
        raise InputError.of(error).found_in(Path(error.origin).name) from None


CORRELATED = (
    "The correlations of the estimates are left out here, and of a machine that is taken over: "
    "they stand in a file beside the stage file, which friso identify writes, as does the report under Out."
)


def _dropped(asked: PageRequest) -> tuple[list[Path], dict[str, Any]]:
    """Return the files of a question about logs, and what the user said of their channels.

    Raises InputError if no file was dropped, or for options that are no texts.
    """
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
    "controller": controller,
    "run": run,
    "cell": cell,
    "verdict": verdict,
    "check": check,
    "bode": bode,
    "loops": loops,
    "flexure": flexure,
    "map": map_study,
    "tracks": tracks,
    "boundary": boundary,
    "tune": tune,
    "design": design,
    "logs": logs,
    "identify": identify,
}
"""The functions that answer questions, by name."""

QUICK = frozenset({"machine", "controller"})
"""The questions that need no computation."""

FIRST = frozenset({"verdict", "run", "cell", "loops", "bode", "flexure", "map"})
"""The questions whose first part, a verdict or a picture, appears soon; all other questions wait for it."""


def _answered(command: str, asked: PageRequest, work: Work) -> Answer:
    """Answer a command about the machine shown, with the options that the page gave."""
    options = asked.chosen(*OPTIONS.get(command, ()))
    return KEPT.answer(getattr(friso, command), asked.machine, work, options)


def _mapped(asked: PageRequest, work: Work) -> Answer:
    """Return the map with the most cells that the page shows, for writing its files.

    The edge of hunting belongs to the command boundary and is left out.
    """
    options = asked.chosen(*OPTIONS["map"])
    options = {name: value for name, value in options.items() if name not in ("edge", "coarse")}
    options |= {name: f"{options[name]}:{COARSE_TO_FINE[-1]}" for name in ("x", "y") if name in options}
    return KEPT.answer(friso.sweep, asked.machine, work, options)


COMMANDS: Mapping[str, Callable[[PageRequest, Work], Answer]] = {
    **{
        name: partial(_answered, name)
        for name in ("simulate", "check", "bode", "flexure", "boundary", "tune", "design")
    },
    "map": _mapped,
    "logs": _looked_into,
    "identify": _identified,
}
"""The commands whose files can be downloaded, as one archive with everything that the command writes."""


def job_of(name: str) -> Callable[[PageRequest, Work], Iterator[AnswerPart]] | None:
    """Return the function that answers a question of the page; None for an unknown name.

    A name that ends in ".zip" asks for the files of a command.
    """
    command = name.removesuffix(".zip")
    if name in QUESTIONS:
        return QUESTIONS[name]
    if name != command and command in COMMANDS:
        return partial(report, command)
    if command in DECLARED.others and command in others_of_stages():
        return partial(report if name != command else other, command)
    return None


def report(command: str, asked: PageRequest, work: Work) -> Iterator[AnswerPart]:
    """Yield the files of a command's answer as one archive in base64."""
    answer = COMMANDS[command](asked, work) if command in COMMANDS else _other(command, asked, work)
    work.progress(0, 0, "drawing the figures")
    of_logs = command in ("logs", "identify")  # what is written includes an identified stage file
    stem = "logs" if of_logs else asked.machine.name.removesuffix(".toml")
    held = archive(answer, {} if of_logs else {f"{stem}.toml": asked.machine.stage.to_toml()})
    yield {"kind": "files", "name": f"{stem}_{answer.command}.zip", "base64": base64.b64encode(held).decode("ascii")}


def _lines(
    command: str, asked: PageRequest, options: Mapping[str, Any] | None = None, function: str = ""
) -> AnswerPart:
    """Return the shell command and the line of Python that repeat what the page shows.

    Both are about the machine shown. `function` is the function of friso to call, if it is not named as the command.
    """
    chosen = {name: value for name, value in (options or {}).items() if value is not False}
    files, options = [asked.machine.name], {**asked.machine.to_set, **chosen}
    return _both_lines(command, asked, files, options, _of(asked.machine), function)


def _lines_of_logs(command: str, asked: PageRequest) -> AnswerPart:
    """Return the shell command and the line of Python for a question about logs.

    Both lines name the machine shown if it counts as prior knowledge.
    """
    paths, assigned = _dropped(asked)
    options, of = {name: item for name, item in assigned.items() if item}, "the files dropped here"
    if asked.options.get("assumed") is True and command == "identify":
        options |= {"stage": asked.machine.name, **asked.machine.to_set}
        of += f" and {_of(asked.machine)}"
    return _both_lines(command, asked, [path.name for path in paths], options, of)


def _both_lines(
    command: str, asked: PageRequest, files: list[str], options: Mapping[str, Any], of: str, function: str = ""
) -> AnswerPart:
    """Return the shell command and the Python line that repeat the page's question.

    `of` says in words to which file these two lines apply. `function` is the function of friso to call, if it is not
    named as the command. The question's name and options are returned too.
    """
    lines = {
        "command": command_line(command, files, options),
        "python": python_line(function or command, files, options),
    }
    return {**lines, "of": of, "asked": {"name": command, "options": dict(asked.options)}}


def _of(machine: Machine) -> str:
    """Say to which file the shell command and the line of Python apply."""
    return "the stage file saved here" if machine.is_of_page else f"{machine.name} as it was opened"


def _ghosts(asked: PageRequest, work: Work, function: Callable[..., Answer]) -> Callable[[Figure], Figure]:
    """Return a function that adds the pinned machine's lines, in grey, to a figure.

    The pinned machine's answer is computed by `function`.
    """
    if asked.pinned is None:
        return ghosts_of(None)
    pinned = KEPT.answer(function, asked.pinned, work)
    work.notes.clear()  # leave out notes on the pinned machine
    return ghosts_of(pinned)


def _stands(asked: PageRequest) -> list[tuple[str, Stage]]:
    """Return the machine shown and, if there is one, the pinned machine, with labels for a map."""
    pinned = [("pinned", asked.pinned.stage)] if asked.pinned else []
    return [(SHOWN, asked.machine.stage), *pinned]


def _given(stage: Stage) -> str:
    """Return the name of the case that the stage file describes: "given", "locked" or "free"."""
    return "given" if stage.joint is None else "locked" if stage.joint.locked else "free"


def _told(stage: Stage, verdicts: Mapping[str, str]) -> AnswerPart:
    """Return label and verdict for each state of the joint that the stage can have, and those of the state it is in."""
    cases = [{"label": label, "verdict": verdicts[name]} for name, label in case_labels(stage).items()]
    return {"cases": cases, "verdict": verdicts[_given(stage)], "state": LABELS[_given(stage)] if stage.joint else ""}


def _cases(stage: Stage) -> tuple[str, dict[str, Any]]:
    """Return a key, and its value in each case that is asked about.

    For a stage with a joint, the key locks the joint, and the cases are "locked" and "free". Without a joint, the only
    case is "given", and the key is a mass with its present value.
    """
    if stage.joint is not None:
        values = {"locked": True, "free": False}
        cases = {name: values[name] for name in stage.variants() if name in values}
        return "joint.locked", cases
    key, flat = "masses.stage" if stage.masses.stage is not None else "masses.cart", stage.flat()
    return key, {"given": exactly(flat[key], numeric_keys(flat)[key].unit)}
