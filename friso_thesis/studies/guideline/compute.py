"""Compute the guideline: sweeps, laws, their errors, and the worked steps.

The laws are fitted to some samples, and their errors are taken from other samples. Samples are also simulated for long
below and above their edge of hunting: do runs still swing below it, and come to rest above it, however they begin?
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from math import ceil
from pathlib import Path

import numpy as np
from scipy.stats import qmc

from friso.engine.kernel import KernelRequest, kernels
from friso.equations.structure import shared_structure
from friso.errors import InputError
from friso.hunting import Ensemble
from friso.platform.system import usable_cores
from friso.progress import Progress, Tally, silent
from friso.quantities import quoted
from friso_thesis.studies.guideline.edges import START_DISTANCES, Begin, from_rest, still_swings
from friso_thesis.studies.guideline.groups import Count, flat_of, group_count, values_of
from friso_thesis.studies.guideline.laws import FREE_LAW, LOCKED_LAW, Errors, FittedLaw, fit_law
from friso_thesis.studies.guideline.sweeps import (
    FREE_FIT,
    FREE_TEST,
    LOCKED,
    LOCKED_FIT,
    LOCKED_TEST,
    PART_SAMPLES,
    STEPS,
    Keep,
    Sweep,
    concatenate_sweeps,
    free_sweep,
    locked_sweep,
)
from friso_thesis.studies.guideline.worked import (
    Laws,
    ParasiticLimits,
    Worked,
    friction_range,
    parasitic_limits,
    plain_rig,
    worked,
)
from friso_thesis.studies.thesis.studies import thesis_rig

BELOW_EDGE, ABOVE_EDGE = 0.9, 1.15
"""Crossovers of the check simulations, relative to the edge."""

MOVES_PER_SAMPLE = 16
"""Number of moves tried for each sample."""

MOVE_SIZES, MOVE_TIMES = (3.0, 300.0), (0.3, 3.0)
"""Ranges of the moves. The first is a t_acc^2 relative to the deflection by the break-away force; the second is t_acc
times omega_c. The thesis's move has 90 and 1.5 at 8 Hz."""

PERIODS_BESIDE = {BELOW_EDGE: 200.0, ABOVE_EDGE: 2000.0}
"""Length of the check simulations in periods. Above the edge, transients of up to a thousand periods were seen."""

MOVES_APART = 20.0
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
    runs = [_still_swing(samples, share, *begin) for begin in (_STUCK, _MOVED) for share in (BELOW_EDGE, ABOVE_EDGE)]
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
    swings, completed = still_swings(stages, begin(stages, values["crossover"], count), PERIODS_BESIDE[share])
    return swings.reshape(count, tried), completed.reshape(count, tried)


def _random_moves(stages: Ensemble, crossover: np.ndarray, count: int) -> Begin:
    """Return moves there and back whose sizes and times are a Sobol sample.

    `count` samples make the same moves. Sizes are multiples of each stage's own length scale (`stages.length`), and
    times of the inverse of its `crossover`.
    """
    ends = np.log([MOVE_SIZES, MOVE_TIMES]).T
    size, time = np.exp(qmc.scale(qmc.Sobol(2, rng=0).random(MOVES_PER_SAMPLE), *ends)).T
    duration = np.tile(time, count) / crossover
    back = 2 * duration + MOVES_APART * 2 * np.pi / crossover
    motion = {
        "motion.kind": "there_and_back",
        "motion.acceleration": np.tile(size, count) * stages.length / duration**2,
        "motion.acceleration_time": duration,
        "motion.return_at": back,
    }
    return Begin(motion, None, back + 2 * duration)


_STUCK = (lambda stages, crossover, count: from_rest(stages, np.tile(START_DISTANCES, count))), len(START_DISTANCES)
_MOVED = _random_moves, MOVES_PER_SAMPLE


FIT_SAMPLES = 512
"""Default number of samples for the fit of the locked law. The other sweeps have fractions of it."""

FEWEST_SAMPLES, MOST_SAMPLES = 64, 65536
"""Smallest and largest number of samples. Fewer do not determine the exponents of a law; more bring no gain with Sobol
points."""

FREE_SHARE, TEST_SHARE = 3 / 8, 1 / 2
"""Ratios of sample numbers: free joint to rigid mass, and test to fit. The edge of a rigid mass takes a tenth of the
work."""

CHECKED_SHARE = 1 / 8
"""Ratio of simulated samples to samples of the locked fit."""

SWEPT_SHARES = (1 / 8, 1 / 4, 1 / 2, 1.0)
"""Fractions of the samples that are swept in turn, so that an interrupted run has an answer from fewer samples."""

RATIOS = (0.0, 0.05, 0.3, 3.0, 20.0, np.inf)
"""Edges of the bins of the ratio of slip to drop, for errors of the locked law."""


@dataclass(frozen=True)
class Fit:
    """A law, the samples behind it, and its errors.

    The law was fitted to the samples `fit` and tested on the samples `test`, with errors on both. With a free joint,
    the locked edge is computed for `on_fit`, and comes from the locked law for `on_test`. `on_computed_edge` has the
    errors of the test with the computed locked edge. `checked` holds simulations of test samples.
    """

    law: FittedLaw
    fit: Sweep
    test: Sweep
    on_fit: Errors
    on_test: Errors
    on_computed_edge: Errors
    checked: SimulationCheck

    @property
    def sweep(self) -> Sweep:
        """Return the samples of fit and test together."""
        return concatenate_sweeps(self.fit, self.test)

    @property
    def kinds(self) -> Mapping[str, int]:
        """Return how many samples have each kind of edge, or each reason for having none.

        Samples of fit and test count.
        """
        return Counter(self.sweep.edges.kind.astype(str))

    @property
    def again(self) -> int:
        """Return the number of samples that hunt in two or more separate ranges of the crossover.

        Samples of fit and test count.
        """
        return int(np.count_nonzero(self.sweep.edges.windows > 1))


@dataclass(frozen=True)
class Guideline:
    """All results of the guideline, as in `docs/evidence/guideline.md`.

    Fields are the numbers of dimensionless groups by part of the stage, both laws, the worked steps, and what a
    parasitic mode allows. Also stored are how long the computation took [s], on how many cores, and how many parts of
    the sweeps came from an interrupted run. An `interrupted` guideline rests on fewer samples than were asked for.
    """

    samples: int
    counts: Mapping[str, Count]
    locked: Fit
    free: Fit
    worked: Worked
    parasitic: list[ParasiticLimits]
    seconds: float
    cores: int
    resumed: int
    interrupted: bool = False

    def held_out(self, free: bool, which: Callable[[Sweep], np.ndarray]) -> Errors | None:
        """Return the errors of a law on the held-out samples selected by `which`, shape (count,).

        If `free`, the law is that of the free joint, otherwise that of the locked one. Returns None if no sample is
        selected.
        """
        held = (self.free if free else self.locked).test.usable
        subset = held.take(which(held))
        locked = self.locked.law.edge(subset.values)
        law = self.free.law.edge(subset.values, locked) if free else locked
        return Errors.between(law, subset.edge) if len(law) else None

    def held_out_by_rates(self) -> list[ByRates]:
        """Return the errors of the locked law, one for each range of the ratio of its two rates."""
        return by_rates(self.locked)


@dataclass(frozen=True)
class ByRates:
    """Errors of the locked law on held-out samples whose ratio of rates lies in a range.

    The ratio has the frequency at which the bearing slips over the one at which falling friction drives the mass away.
    The range goes from `low` to below `high`. The errors are None without samples.
    """

    low: float
    high: float
    errors: Errors | None


def by_rates(locked: Fit) -> list[ByRates]:
    """Return the errors of the locked law, one for each range of the ratio of its two rates."""
    held = locked.test.usable
    ratio = _ratio(locked.law, held.values)
    decades = []
    for low, high in pairwise(RATIOS):
        subset = held.take((ratio >= low) & (ratio < high))
        errors = Errors.between(locked.law.edge(subset.values), subset.edge) if len(subset.edge) else None
        decades.append(ByRates(low, high, errors))
    return decades


def safe_over_friction(locked: Fit) -> float:
    """Return the factor on the locked law that is safe for the rig, whatever its friction.

    Each range of the ratio of the law's two frequencies has a safe factor. The rig's friction may put it into several
    ranges; the largest factor of these is returned.
    """
    flats = [plain_rig() | forces for forces in friction_range()]
    groups = [values_of(flat) for flat in flats]
    visited = _ratio(locked.law, {name: np.array([group[name] for group in groups], float) for name in groups[0]})
    bins = [decade for decade in by_rates(locked) if np.any((visited >= decade.low) & (visited < decade.high))]
    return max(decade.errors.safe if decade.errors else locked.on_test.safe for decade in bins)


def _ratio(law: FittedLaw, values: Mapping[str, np.ndarray]) -> np.ndarray:
    slip, drop = np.exp(law.log_rates(values))
    return slip / drop


def guideline(samples: int = FIT_SAMPLES, keep: Path | None = None, progress: Progress = silent) -> Guideline:
    """Compute the guideline.

    `keep` is a folder for finished parts, from which an interrupted run goes on. `progress` is called as work is done.
    After Ctrl-C, the guideline is computed from the samples so far. Raises KeyboardInterrupt if these are too few, and
    InputError for an unusable number of samples.
    """
    checked_samples(samples)
    begin = time.perf_counter()
    sizes = _sizes(samples)
    tally = Tally(progress, _steps(sizes))
    parts = Keep(keep)
    resumed = parts.count
    tally.add(0, "compiling")
    _compile()

    swept: _Swept | None = None
    interrupted = False
    try:
        for share in SWEPT_SHARES:
            some = {name: min(size, PART_SAMPLES * ceil(share * size / PART_SAMPLES)) for name, size in sizes.items()}
            if share == 1 or some["locked fit"] >= FEWEST_SAMPLES:
                swept = _Swept.of(some, parts, tally, last=share == 1)
    except KeyboardInterrupt:
        if swept is None:
            raise
        interrupted = True
    assert swept is not None  # by the last round
    samples, so_far = len(swept.rigid.edge), "the answer so far (Ctrl-C again ends it): " if interrupted else ""
    tally.add(0, f"{so_far}laws and simulations")
    few = max(8, int(samples * CHECKED_SHARE))
    locked_fit = _locked_fit(swept.rigid, concatenate_sweeps(swept.rigid_test, *swept.beside), few)
    free_fit = _free(swept.free, swept.free_test, locked_fit.law, few)
    tally.add(0, f"{so_far}worked steps")
    laws = Laws(locked_fit.law, free_fit.law)
    steps = worked(laws, safe_over_friction(locked_fit), free_fit.on_test.safe)
    modes = parasitic_limits(thesis_rig())
    seconds, cores = time.perf_counter() - begin, usable_cores()
    return Guideline(samples, group_counts(), locked_fit, free_fit, steps, modes, seconds, cores, resumed, interrupted)


@dataclass(frozen=True)
class _Swept:
    """Sweeps for a guideline: of rigid masses, of free joints, and of rigid masses `beside` these.

    Each has samples for a fit and for its test.
    """

    rigid: Sweep
    rigid_test: Sweep
    free: Sweep
    free_test: Sweep
    beside: tuple[Sweep, Sweep]

    @classmethod
    def of(cls, sizes: Mapping[str, int], parts: Keep, tally: Tally, last: bool) -> _Swept:
        """Sweep samples, `sizes` by name; parts that are done already are taken over.

        Unless these are the `last` sweeps, larger ones follow.
        """
        rigid = locked_sweep(sizes["locked fit"], LOCKED_FIT, parts, tally)
        rigid_test = locked_sweep(sizes["locked test"], LOCKED_TEST, parts, tally)
        free, beside = free_sweep(sizes["free fit"], FREE_FIT, parts, tally, last)
        free_test, beside_test = free_sweep(sizes["free test"], FREE_TEST, parts, tally, last)
        return cls(rigid, rigid_test, free, free_test, (beside, beside_test))


def checked_samples(samples: int) -> None:
    """Check the number of samples. Raises InputError if it is too small or too large."""
    if not FEWEST_SAMPLES <= samples <= MOST_SAMPLES:
        raise InputError(
            "--samples",
            quoted(samples),
            f"a whole number from {FEWEST_SAMPLES} to {MOST_SAMPLES}",
            f"--samples {FIT_SAMPLES}",
        )


def group_counts() -> dict[str, Count]:
    """Return the numbers of parameters and dimensionless groups of three structures, by name.

    The structures are the rigid rig, the rig with its joint, and the rig with its parasitic mode as well.
    """
    return {
        "rigid": group_count(plain_rig()),
        "joint": group_count(plain_rig("joint")),
        "parasitic": group_count(thesis_rig().flat()),
    }


def _sizes(samples: int) -> dict[str, int]:
    free = int(samples * FREE_SHARE)
    return {
        "locked fit": samples,
        "locked test": samples // 4,  # samples with a free joint give more samples of the locked law
        "free fit": free,
        "free test": int(free * TEST_SHARE),
    }


def _steps(sizes: Mapping[str, int]) -> int:
    """Return the number of progress steps of all sweeps; `sizes` are their samples by name.

    A sample with a free joint is also computed with the joint locked.
    """
    both = sum(STEPS.values())
    return sum(size * (both if name.startswith("free") else STEPS[LOCKED]) for name, size in sizes.items())


def _compile() -> None:
    """Compile the equations of all stages that the guideline needs, in parallel."""
    flats = (plain_rig(), plain_rig("joint"), thesis_rig().flat(), thesis_rig().flat() | {"joint.locked": True})
    kernels([KernelRequest(shared_structure(flat), variational) for flat in flats for variational in (False, True)])


def _locked_fit(fit: Sweep, test: Sweep, few: int) -> Fit:
    used, held = fit.usable, test.usable
    law = fit_law(LOCKED_LAW, used.values, used.edge)
    errors = Errors.between(law.edge(held.values), held.edge)
    return Fit(
        law, fit, test, Errors.between(law.edge(used.values), used.edge), errors, errors, simulate_samples(test, few)
    )


def _free(fit: Sweep, test: Sweep, locked: FittedLaw, few: int) -> Fit:
    used, held = fit.usable, test.usable
    law = fit_law(FREE_LAW, used.values, used.edge, used.locked)
    from_simulated = Errors.between(law.edge(held.values, held.locked), held.edge)
    combined = Errors.between(law.edge(held.values, locked.edge(held.values)), held.edge)
    on_fit = Errors.between(law.edge(used.values, used.locked), used.edge)
    return Fit(law, fit, test, on_fit, combined, from_simulated, simulate_samples(test, few))
