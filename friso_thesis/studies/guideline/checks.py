"""Simulate samples for long below and above their edge of hunting.

The question is whether runs still swing below the edge, and come to rest above it, however they begin.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.stats import qmc

from friso.hunting import Ensemble
from friso_thesis.studies.guideline.groups import flat_of
from friso_thesis.studies.guideline.persistence import DISTANCES, Begin, from_rest, still_swings
from friso_thesis.studies.guideline.sweeps import Sweep

BELOW, ABOVE = 0.9, 1.15
"""Crossovers of the check simulations, relative to the edge."""

MOVES = 16
"""Number of moves tried for each sample."""

SIZES, TIMES = (3.0, 300.0), (0.3, 3.0)
"""Ranges of the moves. The first is a t_acc^2 relative to the deflection by the break-away force; the second is t_acc
times omega_c. The thesis's move has 90 and 1.5 at 8 Hz."""

PERIODS = {BELOW: 200.0, ABOVE: 2000.0}
"""Length of the check simulations in periods. Above the edge, transients of up to a thousand periods were seen."""

APART = 20.0
"""Time between the move there and the move back, in periods of the crossover."""


@dataclass(frozen=True)
class SimulationCheck:
    """How many `samples` still swing at the end of long simulations, below and above their edge.

    The `stuck` ones began stuck at some distances, the `moved` ones with some moves; `below` is 0.9 and `above` 1.15
    times the edge of hunting. `runs` were made in all, of which `failed` were not completed.
    """

    samples: int
    stuck_below: int
    stuck_above: int
    moved_below: int
    moved_above: int
    runs: int
    failed: int


def simulate_samples(sweep: Sweep, most: int) -> SimulationCheck:
    """Count the samples that still swing after long runs below and above their edge of hunting.

    Of the samples with an edge, which are in random order, the first `most` are simulated.
    """
    usable = sweep.usable
    samples = usable.take(np.arange(min(most, len(usable.edge))))
    runs = [_still_swing(samples, share, *begin) for begin in (_STUCK, _MOVED) for share in (BELOW, ABOVE)]
    numbers = [int(swinging.any(axis=1).sum()) for swinging, _ in runs]
    completed = np.concatenate([done.ravel() for _, done in runs])
    return SimulationCheck(len(samples.edge), *numbers, runs=completed.size, failed=int(np.count_nonzero(~completed)))


_Begins = Callable[[Ensemble, np.ndarray, int], Begin]


def _still_swing(sweep: Sweep, share: float, begin: _Begins, tried: int) -> tuple[np.ndarray, np.ndarray]:
    """Simulate samples with their crossover at `share` times their edge, `tried` times each.

    `begin` makes the starts of all runs. Returns which runs still swing at the end, and which were completed, both of
    shape (samples, tried).
    """
    count = len(sweep.edge)
    which = np.repeat(np.arange(count), tried)
    values = {name: value[which] for name, value in sweep.values.items()} | {"crossover": share * sweep.edge[which]}
    stages = Ensemble.held(flat_of(values), len(which))
    swings, completed = still_swings(stages, begin(stages, values["crossover"], count), PERIODS[share])
    return swings.reshape(count, tried), completed.reshape(count, tried)


def _stuck(stages: Ensemble, crossover: np.ndarray, count: int) -> Begin:
    return from_rest(stages, np.tile(DISTANCES, count))


def _random_moves(stages: Ensemble, crossover: np.ndarray, count: int) -> Begin:
    """Return moves there and back whose sizes and times are a Sobol sample.

    `count` samples make the same moves. Sizes are multiples of each stage's own length scale (`stages.length`), and
    times of the inverse of its `crossover`.
    """
    ends = np.log([SIZES, TIMES]).T
    size, time = np.exp(qmc.scale(qmc.Sobol(2, rng=0).random(MOVES), *ends)).T
    duration = np.tile(time, count) / crossover
    back = 2 * duration + APART * 2 * np.pi / crossover
    motion = {
        "motion.kind": "there_and_back",
        "motion.acceleration": np.tile(size, count) * stages.length / duration**2,
        "motion.acceleration_time": duration,
        "motion.return_at": back,
    }
    return Begin(motion, None, back + 2 * duration)


_STUCK, _MOVED = (_stuck, len(DISTANCES)), (_random_moves, MOVES)
