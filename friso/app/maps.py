"""Compute verdicts over keys for the page: maps, first without located edges, and the tracks of sliders."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

from friso.app.machine import Machine
from friso.errors import InputError
from friso.interface.inputs import mention_sampling, mention_unstable_loop, read_stage
from friso.progress import Progress, silent
from friso.questions.map.figures import map_figure
from friso.questions.map.findings import own_values
from friso.questions.map.question import SweepAnswer
from friso.questions.map.study import Varied, study_for
from friso.shown.drawing.figure import Figure
from friso.stage import Stage
from friso.stage.rig import AS_BUILT
from friso.studies.cells import of_runs_alone, runs_as_built
from friso.studies.edges import fine_edges
from friso.studies.study import Study
from friso.studies.sweep import local_crew, run_in_memory


def _studies(stage: Stage, all_axes: Sequence[Mapping[str, Any]], metric: str) -> list[Study]:
    """Return a study of each of several sets of axes, which are ranges by key.

    Raises InputError for an unusable range.
    """
    chosen = read_stage(stage, None, leaves_out=() if of_runs_alone([metric]) else AS_BUILT)
    with local_crew() as crew:
        return [study_for(chosen, Varied({**axes}), metric, None, crew) for axes in all_axes]


def sketched(stage: Stage, *, metric: str, progress: Progress = silent, **axes: str) -> SweepAnswer:
    """Return a map over two keys whose edges lie half-way between cells, which is soon there.

    Its parameters are those of `friso.sweep`. Raises InputError for an unusable range.
    """
    varied = Varied.of_texts({}, axes["x"], axes["y"], ())
    (study,) = _studies(stage, [varied.axes], metric)
    if runs_as_built(study.stage, [metric]):
        mention_sampling(study.stage)
    mention_unstable_loop(study.stage)
    with local_crew() as crew:
        (runs,) = run_in_memory([study], crew, progress)
    return SweepAnswer(runs, stage=study.stage, study=study, metric=metric, store=None, edges=None)


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
