"""A move at several crossovers, with the joint locked and free, which may end in hunting.

Thesis, Fig. 24, 25; on the stage's rail and on further rails with other seeds.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np

from friso.engine.side_by_side import side_by_side
from friso.progress import Progress, together
from friso.shares import Share
from friso.stage import Stage
from friso.studies.rig.moves_on_rails import (
    RailRuns,
    at_crossovers,
    distance,
    move,
    numbers_of,
    on_rails,
    once,
    rails,
    released,
    run_moves,
    with_joint,
)
from friso.studies.rig.outcome import Outcome, pace, rig_log
from friso.virtual_rig.run import RecordedRuns
from friso.virtual_rig.task import MoveTask

RELATIVE_CROSSOVERS = np.array([6.0, 7.0, 8.0, 9.5, 11.0, 12.5, 14.3, 16.0, 20.0]) / 8
"""Crossovers over that of the stage: 8, 9.5 and 14.3 Hz are the thesis's (Sec. 4.3.2), the others friso's choice."""

SHOWN_CROSSOVERS = (2, 3, 6)
"""Indices of the thesis's crossovers among `RELATIVE_CROSSOVERS`."""

RELEASE_DISTANCES = (-0.05, -0.005, 0.005, 0.05)
"""Distances from the reference at which the stage is released, over that of the move.

They are 0.5 and 5 mm to either side on the thesis's rig (friso's choice).
"""

CASES = {"locked": True, "free": False}


@dataclass(frozen=True)
class Trace:
    """Position minus the reference at its end [m] over `time` [s], both of shape (n,)."""

    time: np.ndarray
    deviation: np.ndarray


@dataclass(frozen=True)
class Startable:
    """A machine that comes to rest `after_move`, but swings after a release, `after_release`.

    After the move no peaks are counted; after the release it swings to the end. `crossover` [Hz] is its crossover,
    `rail` the index of its rail, and `displacement` [m] where it is released.
    """

    after_move: Trace
    after_release: Trace
    crossover: float
    rail: int
    displacement: float


@dataclass(frozen=True)
class HuntingResult:
    """Results of the hunting experiment.

    `distance` [m] is the length of the move. `cases` are the outcomes of the moves, joint locked and free, arrays of
    shape (crossovers, rails). The moves are made at `crossovers` [Hz] on `rails` (seeds, the stage's own first).
    `started` are the outcomes of releases with the joint locked, shape (displacements, crossovers, rails), by
    `displacements` [m].

    `plotted` are the indices of the thesis's crossovers. Logs and `traces`, by case and index of the crossover, are
    those of one rail, with the index `rail`. It is the first rail with counted peaks at the stage's own crossover,
    joint locked; if there is none, it is the stage's own rail. `startable` is a machine that comes to rest after the
    move but hunts after a release, None if there is none.
    """

    distance: float
    crossovers: np.ndarray
    rails: np.ndarray
    cases: Mapping[str, RailRuns]
    displacements: np.ndarray
    started: RailRuns
    plotted: tuple[int, ...]
    rail: int
    traces: Mapping[tuple[str, int], Trace]
    startable: Startable | None

    def shares(self, case: str) -> list[Share]:
        """Return the fraction of rails on which peaks are counted in a case, for each crossover."""
        return [self.cases[case].share(row) for row in range(len(self.crossovers))]

    def limit(self, case: str, rail: int | None = None) -> float:
        """Return the highest crossover [Hz] at which peaks are counted in a case; NaN for none.

        `rail` is the index of a rail; None means any rail.
        """
        counted = self.cases[case].counted if rail is None else self.cases[case].counted[:, [rail]]
        rows = np.flatnonzero(counted.any(axis=1))
        return float(self.crossovers[rows[-1]]) if len(rows) else np.nan

    @property
    def can_start(self) -> np.ndarray:
        """Return where peaks are counted after the move or a release, with the joint locked.

        Shape (crossovers, rails).
        """
        return self.started.counted.any(axis=0) | self.cases["locked"].counted


def run_experiment(stage: Stage, seed: int, progress: Progress) -> Outcome:
    """Run the move at all crossovers on all rails, with the joint locked and free.

    With the joint locked, the stage is also let go at several distances from its reference. Raises InputError for a
    stage without joint, or a motion that does not move it.
    """
    stages = {case: with_joint(stage, locked) for case, locked in CASES.items()}
    frequencies, seeds = pace(stage) * RELATIVE_CROSSOVERS, rails(stage)
    moves, started = _moves_and_releases(stages, move(stage), seed, frequencies, seeds, progress)
    rail = int(np.argmax(moves["locked"].counted[SHOWN_CROSSOVERS[0]]))
    machine = on_rails(stage, at_crossovers(stage, frequencies), seeds[[rail]])
    again = {
        case: once(variant, move(stage), [seed + rail] * len(frequencies), machine) for case, variant in stages.items()
    }
    traces = {(case, row): _trace(again[case], row) for case in CASES for row in range(len(frequencies))}
    startable = _startable(stages["locked"], seed, frequencies, seeds, moves["locked"], started)
    displacements = distance(stage) * np.array(RELEASE_DISTANCES)
    result = HuntingResult(
        distance(stage), frequencies, seeds, moves, displacements, started, SHOWN_CROSSOVERS, rail, traces, startable
    )  # fmt: skip
    logs = []
    for case, row in product(CASES, SHOWN_CROSSOVERS):
        name = f"hunting_{case}_{frequencies[row]:.3g}_hz"
        tuned = {key: float(f"{value:.6g}") for key, value in at_crossovers(stage, frequencies[row]).items()}
        file = machine_file(stages[case].with_numbers(tuned), seeds[rail])
        logs.append(rig_log(again[case], row, name, "moves", file, seed + rail))
    return Outcome("hunting", stage, seed, tuple(logs), result, _notes(stage, result))


def machine_file(stage: Stage, rail: float) -> Stage:
    """Return the stage with its rail drawn from another seed, `rail`, if it has a rail."""
    return stage if stage.rail is None else stage.replace({"rail.seed": rail})


def _moves_and_releases(
    stages: Mapping[str, Stage],
    there: MoveTask,
    seed: int,
    frequencies: np.ndarray,
    seeds: np.ndarray,
    progress: Progress,
) -> tuple[dict[str, RailRuns], RailRuns]:
    """Run the move in each case (locked, free), and releases with the joint locked.

    `stages` are those of the cases, and `there` is the move. `frequencies` are crossovers [Hz], and `seeds` those of
    the rails. Moves have the shape (crossovers, rails), releases (displacements, crossovers, rails).
    """
    stage, shape = stages["locked"], (len(frequencies), len(seeds))
    changes = on_rails(stage, at_crossovers(stage, frequencies), seeds)
    numbers = numbers_of(seed, *shape)
    moved = [(variant, there, f"moves, joint {case}") for case, variant in stages.items()]
    let_go = [
        (stage, released(stage, share * distance(stage)), "releases, joint locked") for share in RELEASE_DISTANCES
    ]
    lots = [*moved, *let_go]
    runs = side_by_side(
        [
            partial(run_moves, variant, task, numbers, changes, part, label)
            for (variant, task, label), part in zip(lots, together(progress, len(lots)), strict=True)
        ]
    )
    moves = {case: part.shaped(*shape) for case, part in zip(stages, runs, strict=False)}
    return moves, RailRuns.joined(runs[len(moved) :]).shaped(len(RELEASE_DISTANCES), *shape)


def _startable(
    stage: Stage, seed: int, frequencies: np.ndarray, seeds: np.ndarray, moved: RailRuns, started: RailRuns
) -> Startable | None:
    """Return a machine that hunts after a release but not after the move, or None.

    `moved` are the outcomes of the moves and `started` those of the releases, at crossovers `frequencies` [Hz] on rails
    with `seeds`. Of all such machines it has the lowest crossover, on a rail without counted peaks after the move.
    """
    lasts = started.counted & started.swings & ~moved.counted
    places = np.argwhere(lasts.swapaxes(0, 1))
    if not len(places):
        return None
    row, size, rail = map(int, places[0])
    displacement = RELEASE_DISTANCES[size] * distance(stage)
    changes = on_rails(stage, at_crossovers(stage, frequencies[[row]]), seeds[[rail]])
    tasks = (move(stage), released(stage, displacement))
    quiet, swings = (_trace(once(stage, task, [seed + rail], changes), 0) for task in tasks)
    return Startable(quiet, swings, float(frequencies[row]), rail, displacement)


def _trace(recorded: RecordedRuns, row: int) -> Trace:
    end = recorded.logged["reference"][row, -1]
    return Trace(recorded.time, recorded.logged["position"][row] - end)


def _notes(stage: Stage, result: HuntingResult) -> tuple[str, ...]:
    notes = []
    if stage.rail is None:
        notes.append("the stage file has no [rail], so friction is uniform and there is only one machine")
    elif result.rail:
        first, chosen = result.rails[0], result.rails[result.rail]
        notes.append(f"figure and logs show rail {chosen:g}: the stage's own, {first:g}, has no counted peaks locked")
    failed = sum(int(runs_of_case.failed.sum()) for runs_of_case in (*result.cases.values(), result.started))
    if failed:
        notes.append(f"{failed} runs failed: whether they have counted peaks is unknown")
    notes.append(
        "logs of moves that come to rest at once may contain too little motion for friso identify; those of "
        "moves that swing contain enough"
    )
    return tuple(notes)
