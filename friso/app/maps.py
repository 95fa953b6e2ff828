"""What the app draws beside answers: maps, runs of earlier values, cures.

Maps are drawn first without located edges. Runs of earlier values are the tracks of sliders. Cures are keys to set that
stop hunting, offered as buttons of the page.

Figures show what they are compared with: on most it is the machine pinned for comparison, in grey; on a map, the edge
of hunting; on a run, the other state of the joint, and a logged run.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from friso.app.machine import Machine
from friso.equations.bandwidth import bandwidth, sped_up
from friso.errors import InputError
from friso.hunting import Case
from friso.hunting.criteria import ATTRACTED
from friso.identification.logs.log import Log
from friso.interface.answer import Answer
from friso.interface.inputs import mention_sampling, mention_unstable_loop, read_stage
from friso.progress import Progress, silent
from friso.questions.check.words import freeing_helps
from friso.questions.map.figures import map_figure
from friso.questions.map.findings import own_values
from friso.questions.map.question import SweepAnswer, Varied, study_for
from friso.shown.drawing.figure import BLUE, PINK, Figure, Panel, Series
from friso.shown.motion_words import shown_cases
from friso.shown.text import rounded_down, rounded_up, with_unit
from friso.stage import Stage
from friso.stage.rig import AS_BUILT
from friso.studies.cells import of_runs_alone, runs_as_built
from friso.studies.edges import fine_edges
from friso.studies.study import Study
from friso.studies.sweep import dataset, local_crew, run_in_memory, run_scattered


def _studies(stage: Stage, all_axes: Sequence[Mapping[str, Any]], metric: str) -> list[Study]:
    """Return a study of each of several sets of axes, which are ranges by key.

    Raises InputError for an unusable range.
    """
    chosen = read_stage(stage, None, leaves_out=() if of_runs_alone([metric]) else AS_BUILT)
    with local_crew() as crew:
        return [study_for(chosen, Varied({**axes}), metric, None, crew) for axes in all_axes]


class Look(NamedTuple):
    """A map whose edges lie half-way between cells, and which cells are computed, (n, n); others are as the nearest."""

    answer: SweepAnswer
    done: np.ndarray


def sketched(stage: Stage, *, metric: str, progress: Progress = silent, **axes: str) -> Look:
    """Return a map over two keys that is soon there.

    Its parameters are those of `friso.sweep`. Raises InputError for an unusable range.
    """
    varied = Varied.of_texts({}, axes["x"], axes["y"], ())
    (study,) = _studies(stage, [varied.axes], metric)
    if runs_as_built(study.stage, [metric]):
        mention_sampling(study.stage)
    mention_unstable_loop(study.stage)
    with local_crew() as crew:
        (runs,) = run_in_memory([study], crew, progress)
    answer = SweepAnswer(runs, stage=study.stage, study=study, metric=metric, store=None, edges=None)
    return Look(answer, np.ones(study.shape, bool))


def finer(stage: Stage, coarse: Look, *, at_edges: bool, metric: str, **axes: str) -> Look:
    """Return a map over the same ranges with more points, those of the `coarse` one and others between them.

    With `at_edges`, cells are computed between those of the coarse map of which some hunt and some do not (of another
    metric than verdicts: that differ), else all that are left.
    """
    (study,) = _studies(stage, [Varied.of_texts({}, axes["x"], axes["y"], ()).axes], metric)
    ratio, along = (study.shape[0] - 1) // (len(coarse.done) - 1), np.arange(study.shape[0])
    known, (below, above) = coarse.answer.result, (along // ratio, -(-along // ratio))
    told = np.isin(known[metric], ATTRACTED) if metric in ("sketch", "verdict") else known[metric].values
    corners = [told[np.ix_(one, other)] for one in (below, above) for other in (below, above)]
    wanted = np.logical_or.reduce([corners[0] != corner for corner in corners]) | (not at_edges)
    done = np.zeros(study.shape, bool)
    done[::ratio, ::ratio] = coarse.done
    cells, nearest = np.flatnonzero(wanted & ~done), np.rint(along / ratio).astype(int)
    columns = {name: known[name].values[np.ix_(nearest, nearest)] for name in study.metrics}
    with local_crew() as crew:
        for name, values in run_scattered(study, cells, crew).items() if cells.size else ():
            columns[name].flat[cells] = values
    runs = dataset(study, columns)
    answer = SweepAnswer(runs, stage=study.stage, study=study, metric=metric, store=None, edges=None)
    return Look(answer, done | wanted)


def located(sketch: SweepAnswer, progress: Progress) -> SweepAnswer:
    """Return a map with its edges located: the answer of `friso.sweep`, of which the cells are there."""
    study, runs, metric = sketch.study, sketch.result, sketch.metric
    with local_crew() as crew:
        edges = fine_edges(study, runs, metric, own_values(runs), crew, progress)
    return SweepAnswer(runs, stage=study.stage, study=study, metric=metric, store=None, edges=edges)


def tracks_of(stage: Stage, values: Mapping[str, Sequence[Any]], progress: Progress) -> dict[str, list[str]]:
    """Return the verdict at each of several values of each key, "" for a value that the stage cannot have."""
    studies = _studies(stage, [{key: [*column]} for key, column in values.items()], "sketch")
    with local_crew() as crew:
        runs = run_in_memory(studies, crew, progress)
    return {key: held["sketch"].values.tolist() for key, held in zip(values, runs, strict=True)}


def home_of(machine: Machine, keys: Sequence[str]) -> Machine:
    """Return the machine without changes of the keys of a map, on which the map does not depend.

    Where the machine is none without these changes, it stays as it is.
    """
    changes = {key: value for key, value in machine.changes.items() if key not in keys}
    home = replace(machine, changed=json.dumps(changes))
    with suppress(InputError):
        home.stage.flat()
        return home
    return machine


def without_own(answer: SweepAnswer) -> list[Figure]:
    """Return the figures of a map without what concerns the place of the machine that was swept."""
    edges = replace(answer.edges, own=(), verdict="") if answer.edges else None
    figure = map_figure(answer.result, answer.metric, edges=edges)
    panels = [
        replace(panel, markers=tuple(one for one in panel.markers if one.symbol != "target"), arrows=(), words=words)
        for panel in figure.panels
        for words in [tuple(word for word in panel.words if word.text != "YOURS")]
    ]
    return [replace(figure, panels=tuple(panels))]


GHOST = "#a9a9a9"
"""Colour of lines of the pinned machine."""


def ghosts_of(pinned: Answer | None) -> Callable[[Figure], Figure]:
    """Return a function that adds the pinned machine's lines, in grey, to a figure.

    Figures are matched by name. Without a pinned answer, figures stay as they are.
    """
    if pinned is None:
        return lambda figure: figure
    others = {figure.name: figure for figure in pinned.figures()}
    return lambda figure: _ghosted(figure, others[figure.name]) if figure.name in others else figure


def _ghosted(figure: Figure, other: Figure) -> Figure:
    """Add the lines of another figure, in grey, behind the lines of a figure.

    Panels are matched by title and axis labels.
    """
    ghosts = {_subject(panel): panel for panel in other.panels}

    def both(panel: Panel) -> Panel:
        """Draw the other figure's lines in grey behind those of a panel."""
        ghost = ghosts.get(_subject(panel))
        if ghost is None or not ghost.series:
            return panel
        lines = [replace(line, colour=GHOST, label="", width=1.0) for line in ghost.series]
        lines[-1] = replace(lines[-1], label="pinned")
        return replace(panel, series=(*lines, *panel.series))

    return replace(figure, panels=tuple(map(both, figure.panels)))


_OWN = re.compile(r" \(as given\)|, \S+ k?Hz$")
"""Pattern of the part of a title that belongs to one machine: its case, or the frequency of a mode."""


def _subject(panel: Panel) -> tuple[str, str, str]:
    """Return title and axis labels of a panel.

    The part of the title that belongs to one machine is left out.
    """
    return _OWN.sub("", panel.title), panel.x.label, panel.y.label


def with_edge(figure: Figure, edge: Answer | None) -> Figure:
    """Add to a map over two keys the curves on which hunting ends.

    `edge` is the answer of `friso boundary`; with None the map stays as it is.
    """
    if edge is None:
        return figure
    curves = edge.figures()[0].panels[0].series
    return replace(figure, panels=tuple(replace(panel, series=(*panel.series, *curves)) for panel in figure.panels))


def with_other_joint(figure: Figure, other: Figure, own: tuple[str, str], others: tuple[str, str]) -> Figure:
    """Lay the run of the other state of the joint under a run; `own` and `others` are label and colour of each."""
    under = {panel.title: panel for panel in other.panels}

    def both(panel: Panel) -> Panel:
        """Draw the lines of both runs in a panel, within the limits of both."""
        named, there = _named(panel, *own), under.get(panel.title)
        if there is None:
            return named
        lines = tuple(line for line in _named(there, *others).series if line.label == others[0])
        ends = [limits for limits in (panel.y.limits, there.y.limits) if limits]
        limits = (min(low for low, _ in ends), max(high for _, high in ends)) if ends else None
        return replace(named, y=replace(panel.y, limits=limits), series=(*lines, *named.series))

    return replace(figure, panels=tuple(map(both, figure.panels)))


def _named(panel: Panel, label: str, colour: str) -> Panel:
    """Give the lines of a run, not its reference, a label and a colour."""
    lines = (replace(line, label=label, colour=colour) if line.colour == BLUE else line for line in panel.series)
    return replace(panel, series=tuple(lines))


def with_log(figure: Figure, log: Log, reference: np.ndarray, time: np.ndarray) -> Figure:
    """Lay a logged run over a simulated one, whose `reference` [m] over `time` [s] begins to move at the same instant.

    Positions count from the first one. The error is drawn if the log has the reference.
    """
    signals, commanded = log.signals, "reference" if "reference" in log.signals else "position"
    drawn = {"Position": signals["position"] - signals["position"][0], "Actuator force": signals.get("force")}
    if commanded == "reference":
        drawn["Error"] = signals["reference"] - signals["position"]
    logged = log.time - log.time[_begin(signals[commanded])] + time[_begin(reference)]

    def over(panel: Panel) -> Panel:
        """Draw what the log has of a panel over its lines."""
        values = drawn.get(panel.title)
        if values is None:
            return panel
        inside = (logged >= time[0]) & (logged <= time[-1])
        return replace(panel, series=(*panel.series, Series(logged[inside], values[inside], "logged", PINK)))

    return replace(figure, panels=tuple(map(over, figure.panels)))


BEGUN_SHARE = 0.01
"""Share of its range by which a quantity leaves its first value when a move begins. Noise of a log is smaller."""


def _begin(values: np.ndarray) -> int:
    """Return the index of the last value before a quantity leaves its first value."""
    away = np.abs(values - values[0]) > BEGUN_SHARE * np.ptp(values)
    return max(int(away.argmax()) - 1, 0)


FREE = {"label": "Free the joint", "values": {"joint.locked": False}}


def cures_of(cases: Mapping[str, Case], name: str) -> list[dict[str, Any]]:
    """Return what stops the hunting of a case, by its name: a label, and values by key (SI numbers).

    It is what the conclusion of `friso check` advises. The list is empty for a case that does not hunt.
    """
    case = cases[name]
    if case.verdict not in ATTRACTED:
        return []
    (item,) = [item for item in shown_cases(cases) if item.key in (name, _twin(case.stage))]
    flat, cures = case.stage.flat(), []
    for advice, verb, away in ((case.faster, "Raise", rounded_up), (case.slower, "Lower", rounded_down)):
        if advice is None:
            continue
        own = bandwidth(flat)
        factor = away(advice.factor * own) / own if own else away(advice.factor)
        label = (
            f"{verb} to {with_unit(factor * own, 'Hz')}" if own else f"{verb} the speed of the controller × {factor:g}"
        )
        cures.append({"label": label, "values": sped_up(flat, factor)})
    return [*cures, *([FREE] if freeing_helps(item, cases) else [])]


def _twin(stage: Stage) -> str:
    return "" if stage.joint is None else "locked" if stage.joint.locked else "free"
