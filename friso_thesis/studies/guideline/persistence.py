"""Simulate stages for long from many starts, to see whether they still swing at the end.

A swing at the end is evidence of an attractor if no orbit could be closed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.engine.arrays import Status
from friso.engine.batch import RunOptions, run_chunks
from friso.engine.kernel import kernel
from friso.hunting import Ensemble, stuck, wait
from friso.hunting.criteria import lasts
from friso.hunting.measures import swing_of

DISTANCES = np.geomspace(0.02, 2.0, 95)
"""Start distances, relative to the loop's deflection by the break-away force, 5 % apart. Cycles have distances from
0.03, at the smallest friction gaps, to 1.5."""

SMALL = 0.005
"""Band around the reference within which a motion counts as resting, relative to the loop's deflection by the
break-away force. The smallest cycles of the sweeps swing by at least 0.06 from peak to peak."""

SLOW = 0.05
"""Distance whose cycle sets the length of simulations, relative to the deflection by the break-away force. Small cycles
have the longest periods, because a stage sticks longer near its reference."""

PERIODS, LAST = 200.0, 2.0
"""Default length of simulations, and length of the end that is judged, in periods of the cycle at `SLOW`. Near a cycle
that repels by 1 % per half period, a deviation grows 50 times within the first."""

RTOL = 1e-6
"""Relative tolerance of the simulations."""


@dataclass(frozen=True)
class Begin:
    """Start of runs: keys of a motion, initial states, and when the motion is over [s].

    States have the shape (count, states); None stands for rest.
    """

    motion: Mapping[str, Any]
    starts: np.ndarray | None = None
    over: np.ndarray | float = 0.0


def from_rest(stages: Ensemble, distances: np.ndarray) -> Begin:
    """Return a start at rest, stuck at distances (count,) relative to the break-away deflection."""
    return Begin({"motion.displacement": stages.length}, stuck(stages, distances * stages.length))


@np.errstate(all="ignore")  # runs that fail on the way leave infinities behind
def still_swings(stages: Ensemble, begin: Begin, periods: float = PERIODS) -> tuple[np.ndarray, np.ndarray]:
    """Return which stages still swing at the end, and which runs were completed, both (count,).

    After the motion is over, runs last as long as `periods` periods of a slow cycle.
    """
    period = 2 * (wait(stages, SLOW * stages.length) + 2 * np.pi / stages.number("rate"))
    end = begin.over + periods * period
    options = RunOptions(
        rtol=RTOL,
        window=1 - LAST / periods,
        record_from=float(np.min(end)) / 2,
        least_swing=np.inf,
        threads=stages.threads,
        cancel=stages.cancel,
    )
    flat = {**stages.flat, **begin.motion, "motion.duration": end}
    swings, completed = np.zeros(stages.count, bool), np.zeros(stages.count, bool)
    for runs in run_chunks(kernel(stages.structure), flat, stages.count, options, begin.starts):
        completed[runs.numbers] = np.equal(runs.results.statuses, Status.DONE)
        lasting = lasts(swing_of(runs), 0.0, SMALL * stages.length[runs.numbers])
        swings[runs.numbers] = completed[runs.numbers] & lasting
    return swings, completed


def swings_from_any_distance(
    stages: Ensemble, periods: float = PERIODS, distances: np.ndarray = DISTANCES
) -> tuple[np.ndarray, np.ndarray]:
    """Return which stages swing for ever from any of the distances, and for which this is known.

    Both results have the shape (count,). Simulations last `periods` periods of a slow cycle. If a run of a stage
    failed, and no other run keeps swinging, its result is unknown.
    """
    several = stages.take(np.repeat(np.arange(stages.count), len(distances)))
    runs = still_swings(several, from_rest(several, np.tile(distances, stages.count)), periods)
    swings, completed = (runs_of_stages.reshape(stages.count, -1) for runs_of_stages in runs)
    swinging = np.any(swings, axis=1)
    return np.asarray(swinging), np.asarray(swinging | np.all(completed, axis=1))
