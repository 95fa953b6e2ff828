"""Whether a stage hunts whose numbers are uncertain: the verdicts on many stages drawn from it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.stats import binomtest, mannwhitneyu

from friso.engine.arrays import Status
from friso.engine.batch import Options, run_chunks
from friso.engine.kernel import Wanted, kernel, kernels
from friso.equations.motion import last_corner
from friso.equations.structure import shared_structure
from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.cycle.find import ROUGH, RTOL, asymmetric_cycles, symmetric_cycles, whole_cycles
from friso.hunting.cycle.hunting import why_not
from friso.hunting.cycle.neighbours import pair_beside, partner
from friso.hunting.cycle.return_map import ReturnMap, return_map
from friso.hunting.measures import COUNTED_ABOVE, measure, options
from friso.hunting.persistence import Begin, hunts_somehow, still_hunts
from friso.hunting.verdict import LONG, STEADY
from friso.stage import Stage
from friso.stage.correlations import Drawn, laid_over

WORDS = ("hunts", "bistable", "transient", "settles", "failed")
"""The verdicts, as `friso.hunting.verdict.Judgement` has them."""

ATTRACTED = ("hunts", "bistable")
"""Those of stages with a cycle that attracts."""

CHUNK = 256
"""Stages whose verdicts are found at once: between chunks progress is told."""

MOST = 100_000
"""Draws at most: at the edge of hunting one takes some 50 ms."""

NEAR = 1.01
"""Size of the multiplier of a cycle that repels, up to which one that attracts is looked for beside it, stage by stage:
such are born where it is 1, and farther on they are found from the return map, which tells those that are 5 % apart."""


@dataclass(frozen=True)
class Share:
    """The probability of something, by a share of draws (NaN: none is known), and its 95 % interval (Clopper, Pearson),
    which holds whatever became of the draws that failed."""

    probability: float
    low: float
    high: float


@dataclass(frozen=True)
class Fates:
    """The verdicts on drawn stages, words of `WORDS`, shape (count,)."""

    verdicts: np.ndarray

    @property
    def counts(self) -> dict[str, int]:
        """How often each verdict was found."""
        return {word: int(np.count_nonzero(self.verdicts == word)) for word in WORDS}

    def share(self, words: tuple[str, ...]) -> Share:
        """The probability of any of these verdicts."""
        count, failed = len(self.verdicts), self.counts["failed"]
        hits = sum(self.counts[word] for word in words)
        low = binomtest(hits, count).proportion_ci(0.95, method="exact").low
        high = binomtest(hits + failed, count).proportion_ci(0.95, method="exact").high
        return Share(hits / (count - failed) if failed < count else np.nan, float(low), float(high))

    def separations(self, keys: Mapping[str, np.ndarray]) -> dict[str, float]:
        """How far each key tells stages with an attracting cycle from those without, the most decisive first.

        It is the rank-biserial correlation (Kerby 2014, doi 10.2466/11.IT.3.1): 1 where all that hunt have the larger
        values, -1 where all have the smaller ones, 0 where the key tells nothing. Empty where all share one fate.
        """
        attracted = np.isin(self.verdicts, ATTRACTED)
        others = ~attracted & (self.verdicts != "failed")
        if not (attracted.any() and others.any()):
            return {}
        pairs = int(attracted.sum()) * int(others.sum())
        found = {
            key: 2 * float(mannwhitneyu(values[attracted], values[others]).statistic) / pairs - 1
            for key, values in keys.items()
        }
        return dict(sorted(found.items(), key=lambda item: -abs(item[1])))


def fates(
    stage: Stage, drawn: Drawn, rtol: float, progress: Callable[[int], None] = lambda done: None
) -> dict[str, Fates]:
    """The fates of the drawn stages as given and, with a joint, locked and free; `progress` gets stages just done."""
    variants = different(stage)
    wanted = [shared_structure(laid_over(variant, drawn.keys)) for variant in variants.values()]
    kernels([Wanted(form, variational) for form in wanted for variational in (False, not why_not(form))])
    found = {name: _fates(variant, drawn, rtol, progress) for name, variant in variants.items()}
    return {
        name: found[next(other for other, known in variants.items() if known == variant)]
        for name, variant in stage.variants().items()
    }


def different(stage: Stage) -> dict[str, Stage]:
    """The variants of a stage, each once."""
    kept: dict[str, Stage] = {}
    for name, variant in stage.variants().items():
        if variant not in kept.values():
            kept[name] = variant
    return kept


def _fates(stage: Stage, drawn: Drawn, rtol: float, progress: Callable[[int], None]) -> Fates:
    words = np.full(drawn.count, "failed", dtype=object)
    for first in range(0, drawn.count, CHUNK):
        some = slice(first, min(first + CHUNK, drawn.count))
        keys = {key: values[some] for key, values in drawn.keys.items()}
        words[some] = verdicts(laid_over(stage, keys), some.stop - first, rtol)
        progress(some.stop - first)
    return Fates(words)


@np.errstate(all="ignore")  # runs that fail on the way leave infinities behind
def verdicts(flat: Mapping[str, Any], count: int, rtol: float) -> np.ndarray:
    """The verdicts on stages of one structure, given as flat keys to SI numbers or arrays of shape (count,).

    They are those of `friso.hunting.verdict.judge`, but where an orbit may be that could not be closed, simulations
    from many places decide whether something attracts; those that fail leave the verdict "failed".
    """
    form = shared_structure(flat)
    words = np.full(count, "failed", dtype=object)
    found = _measured(flat, count, options(rtol))
    done = found["status"] == Status.DONE
    moving = flat["motion.kind"] == "ramp" and bool(np.any(flat["motion.velocity"]))
    possible = not why_not(form) and not moving
    attracts, known = np.zeros(count, bool), np.ones(count, bool)
    if possible:
        stages = Ensemble.held(flat, count, form=form)
        attracts, known = attracting(stages)
        which = np.flatnonzero(done & known & attracts)
        words[which] = _ends(stages.take(which), _part(flat, which))
    which = np.flatnonzero(done & known & ~attracts)
    words[which] = _settles(_part(flat, which), _part(found, which), len(which), rtol, possible)
    return words


def _part(columns: Mapping[str, Any], which: np.ndarray) -> dict[str, Any]:
    """Some entries of the arrays among the values."""
    return {key: value[which] if np.ndim(value) else value for key, value in columns.items()}


def _measured(flat: Mapping[str, Any], count: int, how: Options) -> dict[str, np.ndarray]:
    """Measures of the motion of every stage: status, peak count, peak to peak [m], time of settling to 10 um [s]."""
    found = {name: np.full(count, np.nan) for name in ("status", "peaks", "peak_to_peak", "settling")}
    for runs in run_chunks(kernel(shared_structure(flat)), flat, count, how):
        some = measure(runs.part(flat), runs)
        for name, column in zip(
            found, (some.status, some.peaks, some.peak_to_peak, some.settling_time[1]), strict=True
        ):
            found[name][runs.numbers] = column
    return found


def _ends(stages: Ensemble, flat: Mapping[str, Any]) -> np.ndarray:
    """The verdicts on stages with an attracting cycle: whether their own motion, followed for long, ends in it."""
    if not stages.count:
        return np.zeros(0, dtype=object)
    motion = {key: value for key, value in flat.items() if key.startswith("motion.")}
    hunts, completed = still_hunts(stages, Begin(motion, over=last_corner(flat)))
    return np.where(completed, np.where(hunts, "hunts", "bistable"), "failed").astype(object)


def _settles(
    flat: Mapping[str, Any], found: Mapping[str, np.ndarray], count: int, rtol: float, possible: bool
) -> np.ndarray:
    """The verdicts on stages without an attracting cycle. Where hunting is not `possible`, a stage may rest off its
    reference; else a motion that has not settled at its end is followed: one that neither settles nor decays hunts."""
    settled, swing = np.isfinite(found["settling"]), found["peak_to_peak"]
    if not possible:
        settled |= (swing <= COUNTED_ABOVE) & (found["peaks"] == 0)
    words = np.where(settled, "settles", "transient").astype(object)
    on = np.flatnonzero(~settled & possible)
    if count and on.size:
        own = _part(flat, on)
        end = np.maximum(LONG, own["motion.duration"]) + last_corner(own)
        long = {**own, "motion.duration": end}
        last, half = (
            _measured(long, on.size, replace(options(rtol), window=window))["peak_to_peak"] for window in (0.75, 0.5)
        )
        words[on[(last > COUNTED_ABOVE) & (np.abs(half / last - 1) < STEADY)]] = "hunts"
    return words


@np.errstate(all="ignore")  # runs that fail on the way leave infinities behind
def attracting(stages: Ensemble) -> tuple[np.ndarray, np.ndarray]:
    """Which stages have a cycle that attracts, and of which that is known, both of shape (count,)."""
    attracts, known = np.zeros(stages.count, bool), np.zeros(stages.count, bool)
    for mask, symmetric in ((stages.symmetric, True), (~stages.symmetric, False)):
        which = np.flatnonzero(mask)
        if which.size:
            attracts[which], known[which] = _attracting(stages.take(which), symmetric)
    return attracts, known


def _attracting(stages: Ensemble, symmetric: bool) -> tuple[np.ndarray, np.ndarray]:
    """The same of stages that are all symmetric, or none of them."""
    there = return_map(stages, ROUGH)
    cycles = (symmetric_cycles if symmetric else whole_cycles)(stages, RTOL, there)
    attracts, known = cycles.attracting, np.ones(stages.count, bool)
    rest = np.flatnonzero(~attracts)
    if symmetric and rest.size:
        rows = ReturnMap(there.distances[rest], there.returns[rest], there.times[rest])
        attracts[rest] = asymmetric_cycles(stages.take(rest), rows).attracting
    beside = pair_beside if symmetric else partner
    for k in np.flatnonzero(cycles.found & ~attracts & (np.abs(cycles.multiplier) < NEAR)):
        other = beside(stages.take(np.array([k])), cycles.take(np.array([k])))
        attracts[k] = other is not None and bool(other.attracting[0])
    unsure = np.flatnonzero(cycles.uncertain & ~attracts)
    if unsure.size:
        attracts[unsure], known[unsure] = hunts_somehow(stages.take(unsure))
    return attracts, known
