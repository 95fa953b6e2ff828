"""The verdict on a stage: whether there is a cycle that attracts, and whether the stage's own motion ends in it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from friso.engine.arrays import Status
from friso.engine.batch import run_chunks
from friso.engine.kernel import kernel
from friso.equations.motion import last_corner
from friso.equations.structure import structure
from friso.hunting.basin import Kick, Moves, displacements, ends_hunting, moves, pushes
from friso.hunting.cycle.hunting import Cycle, Hunting, cannot_hunt, hunting
from friso.hunting.margin import Margin, margin
from friso.hunting.measures import COUNTED_ABOVE, Measures, measure, options
from friso.stage import Stage

Word = Literal["hunts", "bistable", "transient", "settles", "failed"]

LONG = 1000.0
"""Time [s] for which a motion that has not settled at its end is followed."""

MOVING = "the reference never stands still"
"""Why a stage whose reference is a ramp does not hunt: it may stick and slip, but not about a place."""

STEADY = 0.01
"""Share by which the swing of a motion that neither grows nor decays changes over a quarter of the run."""


@dataclass(frozen=True)
class Judgement:
    """The verdict and what it rests on.

    "hunts": there is a cycle that attracts, and this motion ends in it; "bistable": there is one, but this motion
    settles; "transient": there is none, and the motion has not settled at its end; "settles": there is none, and it
    has; "failed": the run of the motion was not completed. `displacement`, `push` and `moves` tell what starts
    hunting, where there is a cycle that attracts; `margin` the edge of hunting nearest in bandwidth; `settled_after`
    the time [s] after the last corner of the reference from which on this motion stays within 10 um, up to 1000 s.
    `observed`: no cycle could be found, yet the motion swings on steadily, and so the verdict is that of the motion.
    """

    verdict: Word
    hunting: Hunting
    displacement: Kick | None = None
    push: Kick | None = None
    moves: Moves | None = None
    margin: Margin | None = None
    settled_after: float | None = None
    observed: bool = False

    @property
    def cycle(self) -> Cycle | None:
        """The cycle that matters most: the one that attracts, or else the first there is."""
        return next(iter((*self.hunting.attracting, *self.hunting.cycles)), None)


def judge(stage: Stage, found: Measures, rtol: float) -> Judgement:
    """The verdict on a stage whose motion was run and measured at a relative tolerance."""
    moves_on = _keeps_moving(stage) and not cannot_hunt(stage)
    known = Hunting((), MOVING, True, None) if moves_on else hunting(stage)
    if found.status[0] != Status.DONE:
        return Judgement("failed", known)
    if known.attracting:
        return _with_a_cycle(stage, found, known, known.attracting[0])
    settled, after, steady = _settling(stage, found, rtol, possible=known.returns is not None)
    observed = steady and not settled
    word: Word = "hunts" if observed else "settles" if settled else "transient"
    edge = margin(stage, attracting=False) if known.returns is not None and not observed else None
    return Judgement(word, known, margin=edge, settled_after=after, observed=observed)


def _keeps_moving(stage: Stage) -> bool:
    flat = stage.flat()
    return flat["motion.kind"] == "ramp" and flat["motion.velocity"] != 0


def _with_a_cycle(stage: Stage, found: Measures, known: Hunting, cycle: Cycle) -> Judgement:
    (hunts,), (completed,) = ends_hunting(stage.flat(), 1, cycle)
    if not completed:
        return Judgement("failed", known)
    within = float(found.settling_time[1][0])
    return Judgement(
        "hunts" if hunts else "bistable",
        known,
        displacements(stage, cycle),
        pushes(stage, cycle),
        moves(stage, cycle),
        margin(stage, attracting=True) if known.cycles[0].attracts else None,
        None if hunts or not np.isfinite(within) else within,
    )


def _settling(stage: Stage, found: Measures, rtol: float, possible: bool) -> tuple[bool, float | None, bool]:
    """Whether the motion has settled at its end; after which time [s], if it is followed for long; and whether it does
    neither settle nor decay then. Where hunting is not `possible`, a stage may rest off its reference."""
    within, still = found.settling_time[1][0], found.peak_to_peak[0] <= COUNTED_ABOVE
    if np.isfinite(within):
        return True, float(within), False
    if not possible:
        return bool(still and found.peaks[0] == 0), None, False
    flat = stage.flat()
    end = max(LONG, flat["motion.duration"]) + float(last_corner(flat))
    last, half = (_followed({**flat, "motion.duration": end}, rtol, window) for window in (0.75, 0.5))
    swing, after = last.peak_to_peak[0], last.settling_time[1][0]
    steady = swing > COUNTED_ABOVE and abs(half.peak_to_peak[0] / swing - 1) < STEADY  # and not NaN: it was completed
    return False, float(after) if np.isfinite(after) else None, bool(steady)


def _followed(flat: dict[str, Any], rtol: float, window: float) -> Measures:
    """Measures of a run, its swing over the part of it that comes after `window`, a share of the whole."""
    (runs,) = run_chunks(kernel(structure(flat)), flat, 1, replace(options(rtol), window=window))
    return measure(flat, runs)
