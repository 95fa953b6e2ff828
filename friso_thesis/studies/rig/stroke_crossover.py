"""Fraction of rails on which peaks are counted, over stroke and crossover (thesis, Fig. 26)."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from friso.hunting.criteria import FAILED, PEAK_CRITERION
from friso.progress import Progress
from friso.questions.map.words import QUIET
from friso.shown.drawing.figure import INK, Axis, Figure, Map, Panel, Series, ramp
from friso.shown.text import with_unit
from friso.stage import Stage
from friso_thesis.studies.rig.experiments import RigExperiment
from friso_thesis.studies.rig.experiments.hunting import CRITERIA, runs_document, share_document
from friso_thesis.studies.rig.moves_on_rails import (
    RailRuns,
    crossover,
    crossover_key,
    move,
    numbers_of,
    on_rails,
    once,
    rails,
    run_moves,
    with_joint,
)
from friso_thesis.studies.rig.outcome import Outcome, rig_log

RELATIVE_CROSSOVERS = np.array([3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 14.0]) / 8
"""Crossovers relative to the stage's. The range is that of the thesis's rig (Table 3, Fig. 16); the steps are our
choice."""

RELATIVE_STROKES = np.array([0.02, 0.05, 0.1, 0.2, 0.3, 0.6, 1.0])
"""Strokes relative to the stage's: up to 1 mm in Table 3. The steps are our choice."""

AT_ONCE = 4
"""Number of rails tried at once on a cell of which only is asked whether any rail has peaks (our choice). Fewer leave
processors idle, more are run in vain."""


@dataclass(frozen=True)
class StrokeCrossover:
    """Results of moves, as arrays of shape (strokes, crossovers, rails).

    `strokes` [m], `crossovers` [Hz] and `rails` (seeds) are the axes. `frequency` [Hz] is the stage's own crossover.
    """

    strokes: np.ndarray
    crossovers: np.ndarray
    rails: np.ndarray
    frequency: float
    runs: RailRuns

    @property
    def share(self) -> np.ndarray:
        """Return the fraction of rails on which peaks are counted, shape (strokes, crossovers).

        The fraction is NaN where all runs failed.
        """
        done = ~self.runs.failed
        count = done.sum(axis=2)
        counted = (self.runs.counted & done).sum(axis=2)
        return np.divide(counted, count, out=np.full(count.shape, np.nan), where=count > 0)

    @property
    def nearest(self) -> int:
        """Return the index of the crossover on the grid that is nearest to the stage's own."""
        return int(np.argmin(abs(self.crossovers - self.frequency)))

    @property
    def limits(self) -> np.ndarray:
        """Return the crossover [Hz] up to which any rail has counted peaks, for each stroke.

        The shape is (strokes,). The limit lies halfway to the next crossover tried. It is 0 if no rail has peaks at any
        crossover, and infinite if some rail has peaks at the highest.
        """
        limits = np.zeros(len(self.strokes))
        for row, counted in enumerate(self.share > 0):
            if counted.any():
                last = int(np.flatnonzero(counted)[-1])
                limits[row] = np.inf if last + 1 == len(counted) else self.crossovers[last : last + 2].mean()
        return limits


def stroke_crossover(
    stage: Stage, seed: int, strokes: np.ndarray, factors: np.ndarray, seeds: np.ndarray, progress: Progress
) -> StrokeCrossover:
    """Run the move on a grid of strokes and crossovers, on a rail for each of `seeds`.

    `strokes` and `factors` are relative to the stage's stroke and crossover [-].
    """
    sizes, frequencies = stage.flat()["joint.stroke"] * strokes, crossover(stage) * factors
    cases = {"joint.stroke": np.repeat(sizes, len(frequencies)), crossover_key(stage): np.tile(frequencies, len(sizes))}
    numbers = numbers_of(seed, len(sizes) * len(frequencies), len(seeds))
    runs = run_moves(stage, move(stage), numbers, on_rails(stage, cases, seeds), progress, "moves, joint free")
    return StrokeCrossover(
        sizes, frequencies, seeds, crossover(stage), runs.shaped(len(sizes), len(frequencies), len(seeds))
    )


def limits_of_crossover(
    stage: Stage, seed: int, strokes: np.ndarray, factors: np.ndarray, seeds: np.ndarray
) -> StrokeCrossover:
    """Run the move on a grid of strokes and crossovers, as far as its limits need.

    For each stroke, crossovers are tried from the highest down, to the first at which some rail has counted peaks; the
    lowest is always tried. No more rails are run on a cell once one has peaks. Runs left out have the outcome "failed".
    `strokes` and `factors` are relative to the stage's stroke and crossover [-], and `seeds` those of its [rail].
    """
    sizes, frequencies = stage.flat()["joint.stroke"] * strokes, crossover(stage) * factors
    shape = len(sizes), len(frequencies), len(seeds)
    tried, runs = np.zeros(shape, bool), _left_out(int(np.prod(shape)))
    cells = {(row, column) for row in range(len(sizes)) for column in (0, len(frequencies) - 1)}
    while cells:
        chosen = [
            np.ravel_multi_index((*cell, rail), shape)
            for cell in sorted(cells)
            for rail in np.flatnonzero(~tried[cell])[:AT_ONCE]
        ]
        row, column, rail = np.unravel_index(chosen, shape)
        changes = {"joint.stroke": sizes[row], crossover_key(stage): frequencies[column], "rail.seed": seeds[rail]}
        several = run_moves(stage, move(stage), [seed + int(number) for number in rail], changes)
        for entry in fields(runs):
            getattr(runs, entry.name)[chosen] = getattr(several, entry.name)
        tried.flat[chosen] = True
        counted = np.any(runs.counted.reshape(shape), axis=2)
        free = {cell for cell in cells if tried[cell].all() and not counted[cell]}
        below = {(row, column - 1) for row, column in free if column}
        cells = {cell for cell in cells - free | below if not counted[cell] and not tried[cell].all()}
    return StrokeCrossover(sizes, frequencies, seeds, crossover(stage), runs.shaped(*shape))


def _left_out(count: int) -> RailRuns:
    """Return the results of `count` runs of which none was run."""
    numbers = {entry.name: np.full(count, np.nan) for entry in fields(RailRuns)}
    return RailRuns(**numbers | {"peaks": np.zeros(count, np.int64), "outcome": np.full(count, FAILED, object)})


def _limit(counts: StrokeCrossover, row: int) -> str:
    limit = counts.limits[row]
    if limit == 0:
        return "no peaks"
    return "peaks up to the highest crossover" if np.isinf(limit) else f"none above {limit:.3g} Hz"


def _needed(counts: StrokeCrossover) -> list[str]:
    """Say where counted peaks end, in crossover by stroke, and in stroke at the own crossover."""
    named = [f"{with_unit(float(stroke), 'm')} {_limit(counts, row)}" for row, stroke in enumerate(counts.strokes)]
    lines = [f"Counted peaks by stroke: {'; '.join(named)}."]
    rows = np.flatnonzero(counts.share[:, counts.nearest] > 0)
    if len(rows) and rows[-1] + 1 < len(counts.strokes):
        least = float(counts.strokes[rows[-1] + 1])
        lines.append(
            f"At {counts.crossovers[counts.nearest]:.3g} Hz no peaks are counted from a stroke of "
            f"{with_unit(least, 'm')} up."
        )
    return lines


def rails_panel(counts: StrokeCrossover) -> Panel:
    """Return the map of the number of rails with counted peaks.

    Lighter cells have fewer such rails; cells without any have the colour of rest.
    """
    count = len(counts.rails)
    label, colours = f"Rails with counted peaks, of {count}", (QUIET, *ramp(count)[::-1])
    field = Map(counts.strokes, counts.crossovers, count * counts.share.T, label, "", colours=colours)
    return Panel("", Axis("Stroke", "m", log=True), Axis("Crossover", "Hz"), (), maps=(field,))


class StrokeCrossoverExperiment(RigExperiment):
    """Moves over stroke and crossover on many rails."""

    def run(self, stage: Stage, seed: int, progress: Progress) -> Outcome:
        """Run the move at all strokes and crossovers on all rails, with the joint free.

        Raises InputError without a joint.
        """
        free = with_joint(stage, locked=False)
        result = stroke_crossover(free, seed, RELATIVE_STROKES, RELATIVE_CROSSOVERS, rails(stage), progress)
        corners = {"joint.stroke": result.strokes[[0, -1]], crossover_key(stage): np.full(2, crossover(stage))}
        recorded = once(free, move(free), [seed, seed], corners)
        logs = []
        for row, stroke in enumerate(corners["joint.stroke"]):
            file = free.replace({"joint.stroke": f"{stroke:.6g} m"})
            logs.append(rig_log(recorded, row, f"stroke_{stroke * 1e3:.3g}_mm", "moves", file, seed))
        notes = (
            ("the stage file has no [rail]: friction is uniform, and a cell is one run",) if stage.rail is None else ()
        )
        return Outcome("stroke-crossover", stage, seed, tuple(logs), result, notes)

    def sentences(self, outcome: Outcome) -> list[str]:
        """Say from which crossover and which stroke on no rail has any counted peaks."""
        counts: StrokeCrossover = outcome.result
        count, cells = len(counts.rails), counts.share
        shown = np.isfinite(cells) & (cells > 0)
        if not shown.any():
            return [f"On none of {count} rails are peaks counted, at any stroke or crossover."]
        first = (
            f"In {shown.sum()} of {shown.size} cells peaks are counted on at least one of {count} rails, in "
            f"{(cells >= 0.5).sum()} on at least half of them."
        )
        return [first, *_needed(counts)]

    def figures(self, outcome: Outcome) -> list[Figure]:
        """Draw the map of rails with counted peaks, over stroke and crossover."""
        counts: StrokeCrossover = outcome.result
        finite = np.isfinite(counts.limits) & (counts.limits > 0)
        border = Series(counts.strokes[finite], counts.limits[finite], "no counted peaks above", INK, width=2.0)
        panel = replace(rails_panel(counts), series=(border,))
        caption = f"Each cell: {len(counts.rails)} rails, one move each, {PEAK_CRITERION} (Fig. 26: of one run)."
        return [Figure("stroke_crossover", "Joint free: rails with counted peaks", caption, (panel,))]

    def numbers(self, outcome: Outcome) -> dict[str, Any]:
        """Return all results for the JSON document.

        Arrays have the shape (strokes, crossovers, rails); fractions of rails have the shape (strokes, crossovers).
        """
        counts: StrokeCrossover = outcome.result
        shares = [
            [share_document(counts.runs.share((row, column))) for column in range(len(counts.crossovers))]
            for row in range(len(counts.strokes))
        ]
        axes = {"strokes_m": counts.strokes, "crossovers_hz": counts.crossovers, "rail_seeds": counts.rails}
        return {
            "criteria": CRITERIA,
            **axes,
            "counted": shares,
            "limits_hz": counts.limits,
            **runs_document(counts.runs),
        }


EXPERIMENT = StrokeCrossoverExperiment()
