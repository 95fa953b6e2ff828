"""A move at several crossovers, with the joint locked and free, which may end in hunting.

Thesis, Fig. 24, 25; on the stage's rail and on further rails with other seeds.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from friso.axis import axis_shown
from friso.engine.side_by_side import side_by_side
from friso.hunting.criteria import COUNTED_ABOVE, DISTINCT_CRITERION, PEAK_CRITERION
from friso.hunting.criteria import OUTCOME_CRITERION as OUTCOME
from friso.intervals import Share
from friso.progress import Progress, together
from friso.quantities import percent
from friso.shown.documents import entries
from friso.shown.drawing.figure import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PINK,
    SKY,
    VERMILLION,
    Axis,
    Band,
    Figure,
    Limit,
    Panel,
    Series,
)
from friso.shown.text import with_unit
from friso.stage import Stage
from friso.virtual_rig.run import RecordedRuns
from friso.virtual_rig.task import MoveTask
from friso_thesis.studies.rig.experiments import RigExperiment
from friso_thesis.studies.rig.moves_on_rails import (
    PEAK_BAND,
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
from friso_thesis.studies.rig.outcome import Outcome, pace, rig_log

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


TIME = Axis("Time", "s")

COLOURS = {"locked": VERMILLION, "free": BLUE}

AREAS = {"locked": "#f6dccb", "free": "#cfdfee"}

LINES = (GREY, GREEN, VERMILLION, ORANGE, PINK, SKY, BLUE, INK, GREY)

SHOWN_AFTER = 5.0
"""Time [s] after which the remaining deviation sets the height of a panel."""


def rails_text(share: Share, count: int) -> str:
    """Write on how many of `count` rails something happens, with the interval of the fraction."""
    return f"{round(share.probability * count)} of {count} rails ({percent(share.low)} to {percent(share.high)})"


def _swings(moves: HuntingResult) -> str:
    """Describe the swings at the stage's own crossover with the joint locked."""
    runs = moves.cases["locked"]
    swings, counted = runs.swings[moves.plotted[0]], int(runs.counted[moves.plotted[0]].sum())
    if not swings.any():
        return "With the joint locked the stage swings on no rail when the run ends."
    swing, period = runs.swing[moves.plotted[0]][swings], runs.period[moves.plotted[0]][swings]
    return (
        f"With the joint locked the stage still swings at the end of the run on {int(swings.sum())} rails (peaks are "
        f"counted on {counted}), {with_unit(float(np.median(swing)), 'm')} peak to peak with a period "
        f"of {with_unit(float(np.median(period)), 's')} (medians)."
    )


def _limit(moves: HuntingResult, case: str) -> str:
    """Say up to which crossover peaks are counted on any rail, and on the rail that is shown.

    `case` is the state of the joint.
    """
    last, on_rail = moves.limit(case), moves.limit(case, moves.rail)
    if np.isnan(last):
        return f"no peaks are counted from {moves.crossovers[0]:.3g} to {moves.crossovers[-1]:.3g} Hz."
    above = moves.crossovers[moves.crossovers > last]
    bound = moves.shares(case)[-1].high
    beyond = (
        f"none from {above[0]:.3g} Hz on (at most {percent(bound)} of all rails)" if len(above) else "none tried above"
    )
    name = f"rail {moves.rails[moves.rail]:.0f}" if len(moves.rails) > 1 else "it"
    reach = f"on {name} up to {on_rail:.3g} Hz" if np.isfinite(on_rail) else f"none on {name}"
    return f"peaks are counted on some rails up to {last:.3g} Hz, {beyond}; {reach}."


def _started(moves: HuntingResult) -> list[str]:
    """Say on how many rails peaks are counted after the move, and after the move or a release.

    A second sentence describes a run that rests after the move but swings after a release.
    """
    counts = [
        f"{int(moves.cases['locked'].counted[row].sum())} and {int(moves.can_start[row].sum())} of {len(moves.rails)} "
        f"at {moves.crossovers[row]:.3g} Hz"
        for row in moves.plotted
    ]
    listed = ", ".join(with_unit(displacement, "m") for displacement in moves.displacements)
    texts = [
        f"Rails with counted peaks, joint locked, after the move, and after it or a release from {listed}: "
        f"{'; '.join(counts)}."
    ]
    if moves.startable is not None:
        texts.append(
            f"At {moves.startable.crossover:.3g} Hz no peaks are counted{_rail(moves, moves.startable.rail, ' on')} "
            "after the move, but released from "
            f"{with_unit(moves.startable.displacement, 'm')} the stage swings to the end: a run that rests does not "
            "prove that the stage cannot hunt."
        )
    return texts


def _locked_and_free(moves: HuntingResult) -> Figure:
    """Draw the position after the move with the joint locked and free (Fig. 24)."""
    row = moves.plotted[0]
    lines = tuple(
        Series(t.time, t.deviation + moves.distance, f"joint {case}", COLOURS[case])
        for case, t in ((case, moves.traces[case, row]) for case in COLOURS)
    )
    reach = _reach([moves.traces[case, row] for case in COLOURS])
    zoom = (moves.distance - reach, moves.distance + reach)
    return Figure(
        "hunting_locked_and_free",
        f"Move of {with_unit(moves.distance, 'm')} at {moves.crossovers[row]:.3g} Hz{_on(moves)}",
        "The position that the drive logs (Fig. 24).",
        (
            Panel("A: position", TIME, Axis("Position", "m"), lines),
            Panel(
                "B: about its end",
                TIME,
                Axis("Position", "m", zoom),
                lines,
                limits=(Limit((moves.distance,), "reference", INK, "dotted"),),
            ),
        ),
        columns=2,
    )


def _on(moves: HuntingResult) -> str:
    """Say on which rail the figure's run was made; empty if there is only one rail."""
    return _rail(moves, moves.rail, ",")


def _rail(moves: HuntingResult, number: int, before: str) -> str:
    """Name a rail by its seed, after the text `before`, if there are several; empty otherwise.

    A stage file without [rail] has a single nameless rail.
    """
    return f"{before} rail {moves.rails[number]:.0f}" if len(moves.rails) > 1 else ""


def _reach(traces: list[Trace]) -> float:
    """Return half the height [m] of a panel in which the motion after the move is well seen."""
    late = [np.abs(t.deviation[t.time >= SHOWN_AFTER]).max() for t in traces]
    return 1.6 * max(float(np.nanmax(late)), 2 * COUNTED_ABOVE)


def _crossovers(moves: HuntingResult) -> Figure:
    """Draw the error after the move at several crossovers, with the joint locked and free.

    The crossovers are the thesis's, and the highest with counted peaks.
    """
    panels = []
    reach = _reach([moves.traces["locked", row] for row in moves.plotted])
    for case in COLOURS:
        lines = tuple(
            Series(t.time, t.deviation, f"{moves.crossovers[row]:.3g} Hz", LINES[number + 1])
            for number, row in enumerate(moves.plotted)
            for t in (moves.traces[case, row],)
        )
        axis = Axis("Position minus reference", "m", (-reach, reach))
        panels.append(Panel(f"joint {case}", TIME, axis, lines))
    return Figure(
        "hunting_crossovers",
        f"The same move at other crossovers{_on(moves)}",
        "The error that remains after the move (Fig. 25 shows the joint locked).",
        tuple(panels),
        columns=2,
    )


def _shares(moves: HuntingResult) -> Figure:
    """Draw the fraction of rails with counted peaks over the crossover.

    The interval of the fraction is drawn for the locked joint only.
    """
    bands, lines = [], []
    for case, colour in COLOURS.items():
        shares = moves.shares(case)
        low, high = (np.array([getattr(share_of_case, end) for share_of_case in shares]) for end in ("low", "high"))
        share = np.array([share_of_case.probability for share_of_case in shares])
        bands.append(Band(moves.crossovers, low, high, f"95 % interval, {case}", AREAS[case]))
        lines.append(Series(moves.crossovers, share, f"joint {case}", colour))
    swings = moves.cases["locked"].swings.mean(axis=1)
    lines.append(Series(moves.crossovers, swings, "locked, swings at the end", VERMILLION, "dashed"))
    lines.append(Series(moves.crossovers, moves.can_start.mean(axis=1), "locked, after it or a release", INK, "dotted"))
    panel = Panel("", Axis("Crossover", "Hz"), Axis("Share of rails", "", (-0.03, 1.03)), tuple(lines))
    return Figure(
        "hunting_shares",
        f"Share of {len(moves.rails)} rails with counted peaks after the move",
        axis_shown().text(f"{PEAK_CRITERION[0].upper()}{PEAK_CRITERION[1:]}."),
        (Panel(panel.title, panel.x, panel.y, panel.series, bands=tuple(bands[:1])),),
    )


def _release_figure(moves: HuntingResult) -> Figure:
    """Draw a run that rests after the move, but swings after a release."""
    startable = moves.startable
    assert startable is not None
    both = (
        (startable.after_move, "after the move", BLUE),
        (startable.after_release, f"released from {with_unit(startable.displacement, 'm')}", VERMILLION),
    )
    lines = tuple(Series(t.time, t.deviation, label, colour) for t, label, colour in both)
    reach = _reach([startable.after_move, startable.after_release])
    return Figure(
        "hunting_started",
        f"{startable.crossover:.3g} Hz, joint locked{_rail(moves, startable.rail, ',')}: swinging once started",
        "The same machine twice.",
        (Panel("", TIME, Axis("Position minus reference", "m", (-reach, reach)), lines),),
    )


CRITERIA = {"outcome": OUTCOME, "band_m": PEAK_BAND, "distinct_peaks": DISTINCT_CRITERION}


def runs_document(runs: RailRuns) -> dict[str, Any]:
    """Return the outcomes of runs as arrays of the shape of the runs."""
    return {
        **entries(runs, "outcome", "period_s"),
        "distinct_peaks": runs.peaks,
        "peak_to_peak_m": runs.swing,
    }


def share_document(share: Share) -> dict[str, float]:
    """Return a fraction and its 95 % interval."""
    return {"share": share.probability, "low": share.low, "high": share.high}


class HuntingExperiment(RigExperiment):
    """Moves at several crossovers on many rails, and releases."""

    def run(self, stage: Stage, seed: int, progress: Progress) -> Outcome:
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
            case: once(variant, move(stage), [seed + rail] * len(frequencies), machine)
            for case, variant in stages.items()
        }
        traces = {(case, row): _trace(again[case], row) for case in CASES for row in range(len(frequencies))}
        startable = _startable(stages["locked"], seed, frequencies, seeds, moves["locked"], started)
        displacements = distance(stage) * np.array(RELEASE_DISTANCES)
        result = HuntingResult(
            distance=distance(stage),
            crossovers=frequencies,
            rails=seeds,
            cases=moves,
            displacements=displacements,
            started=started,
            plotted=SHOWN_CROSSOVERS,
            rail=rail,
            traces=traces,
            startable=startable,
        )
        logs = []
        for case, row in product(CASES, SHOWN_CROSSOVERS):
            name = f"hunting_{case}_{frequencies[row]:.3g}_hz"
            tuned = {key: float(f"{value:.6g}") for key, value in at_crossovers(stage, frequencies[row]).items()}
            file = machine_file(stages[case].with_numbers(tuned), seeds[rail])
            logs.append(rig_log(again[case], row, name, "moves", file, seed + rail))
        return Outcome("hunting", stage, seed, tuple(logs), result, _notes(stage, result))

    def sentences(self, outcome: Outcome) -> list[str]:
        """Say at which crossovers peaks are counted and the stage swings on.

        Results on the stage's own rail stand beside results on repeated rails.
        """
        moves: HuntingResult = outcome.result
        first = moves.plotted[0]
        count = len(moves.rails)
        return [
            f"After a move of {with_unit(moves.distance, 'm')} at {moves.crossovers[first]:.3g} Hz peaks are counted "
            f"on {rails_text(moves.shares('locked')[first], count)} with the joint locked, and on "
            f"{rails_text(moves.shares('free')[first], count)} with it free (95 % intervals).",
            _swings(moves),
            f"Joint locked: {_limit(moves, 'locked')} Joint free: {_limit(moves, 'free')}",
            *_started(moves),
        ]

    def figures(self, outcome: Outcome) -> list[Figure]:
        """Draw Fig. 24 and 25, the fraction of rails over the crossover, and a start by release."""
        moves: HuntingResult = outcome.result
        figures = [_locked_and_free(moves), _crossovers(moves), _shares(moves)]
        return [*figures, _release_figure(moves)] if moves.startable is not None else figures

    def numbers(self, outcome: Outcome) -> dict[str, Any]:
        """Return all results for the JSON document."""
        moves: HuntingResult = outcome.result
        cases = {
            case: {**runs_document(runs), "counted": [share_document(share) for share in moves.shares(case)]}
            for case, runs in moves.cases.items()
        }
        started = {"displacements_m": moves.displacements}
        return {
            "criteria": {**CRITERIA, "distinct_peaks": axis_shown().text(DISTINCT_CRITERION)},
            **entries(moves, "distance_m", "crossovers_hz"),
            "rail_seeds": moves.rails,
            "cases": cases,
            "releases": started | runs_document(moves.started),
        }


EXPERIMENT = HuntingExperiment()
