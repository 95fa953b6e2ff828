"""Judge an uncertain stage by the verdicts on many stages drawn at random from it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from friso.engine.allowance import allowance
from friso.engine.arrays import ArrayColumns
from friso.engine.kernel import KernelRequest, kernels
from friso.equations.bandwidth import at_bandwidth, bandwidth
from friso.equations.structure import shared_structure
from friso.hunting import Margin, find_attractors, judge_many, kernels_to_judge, loops_unstable, sketch_attractors
from friso.hunting.criteria import ATTRACTED, UNDECIDED, VERDICTS
from friso.progress import Progress, Tally, silent
from friso.shares import Share, separation, share
from friso.stage import Stage
from friso.stage.correlations import Correlations, Sample, draw, laid_over
from friso.studies.settings import settings


@dataclass(frozen=True)
class Fates(ArrayColumns):
    """Verdicts on drawn stages, and which of their linear loops are unstable, both (count,).

    Verdicts are words of `friso.hunting.criteria.VERDICTS`. A loop counts as `unstable` if it is so while the stage
    sticks, or while it slides. `amplitudes` [m], half of peak to peak, and `periods` [s] have the shape (count,) too,
    or are empty if they are not known. They are NaN for a stage that has no attractor, or an uncertain one.
    """

    verdicts: np.ndarray
    unstable: np.ndarray
    amplitudes: np.ndarray = field(default_factory=lambda: np.zeros(0))
    periods: np.ndarray = field(default_factory=lambda: np.zeros(0))

    @property
    def counts(self) -> dict[str, int]:
        """Return how often each verdict occurs."""
        return {word: int(np.count_nonzero(self.verdicts == word)) for word in VERDICTS}

    def share(self, words: tuple[str, ...]) -> Share:
        """Return the probability that a drawn stage has any of these verdicts."""
        return share(np.isin(self.verdicts, words), ~np.isin(self.verdicts, UNDECIDED))

    def separations(self, keys: Mapping[str, np.ndarray]) -> dict[str, float]:
        """Return how well each key separates hunting stages from others, the most decisive first.

        The measure is the rank-biserial correlation (Kerby 2014, doi 10.2466/11.IT.3.1): 1 if all hunting stages have
        the larger values, -1 if they have the smaller ones, 0 if the key separates nothing. Stages without a certain
        verdict are left out. The result is empty if all of the others hunt, or none of them.
        """
        decided = ~np.isin(self.verdicts, UNDECIDED)
        attracted = np.isin(self.verdicts[decided], ATTRACTED)
        if attracted.all() or not attracted.any():
            return {}
        by_key = {key: separation(values[decided], attracted)[0] for key, values in keys.items()}
        return dict(sorted(by_key.items(), key=lambda item: -abs(item[1])))


def fates(stage: Stage, sample: Sample, rtol: float, progress: Progress = silent) -> dict[str, Fates]:
    """Judge the drawn stages in each variant: as in the file and, with a joint, locked and free.

    The verdicts come by name of the variant. After Ctrl-C, the result has the stages judged in all variants by then.
    Raises KeyboardInterrupt if there are none yet.
    """
    variants = different(stage)
    structures = [shared_structure(laid_over(variant, sample.keys)) for variant in variants.values()]
    kernels(set[KernelRequest]().union(*map(kernels_to_judge, structures)))
    tally = Tally(progress, sample.count * len(variants))
    parts: dict[str, list[Fates]] = {name: [] for name in variants}
    try:
        for first in range(0, sample.count, settings.stages_together):
            chunk = slice(first, min(first + settings.stages_together, sample.count))
            judged = {name: _fates(variant, sample, chunk, rtol, tally) for name, variant in variants.items()}
            for name, part in judged.items():
                parts[name].append(part)
    except KeyboardInterrupt:
        if not all(parts.values()):
            raise
    by_variant = {name: Fates.joined(some) for name, some in parts.items()}
    return {
        name: by_variant[next(other for other, same in variants.items() if same == variant)]
        for name, variant in stage.variants().items()
    }


@dataclass(frozen=True)
class DrawnEdges:
    """Edges of hunting of drawn stages: the bandwidths [Hz] below which they hunt, (count,).

    An edge lies between `low` and `high`. Both are NaN for a stage that hunts at none of the tried bandwidths, or up to
    the last. They are also NaN if it is not certain at one of these whether the stage hunts.
    """

    low: np.ndarray
    high: np.ndarray


def edges(stage: Stage, sample: Sample, margin: Margin | None) -> DrawnEdges | None:
    """Find up to which bandwidth the first drawn stages hunt, near the stage's own `margin`.

    The margin is that from the stage to its edge of hunting. The last change between coarse steps of the bandwidth is
    narrowed down by halving. Coarse return maps tell which stages hunt, so an attractor with a narrow basin may be
    missed: the edges show their spread, not for certain where each lies. Returns None if there is no margin, or if the
    controller has no bandwidth.
    """
    own = bandwidth(stage.flat())
    if margin is None or margin.crossover is None or own is None:
        return None
    count = min(sample.count, settings.draws_of_an_edge)
    coarse = 1 << settings.halvings_of_an_edge
    steps = coarse * settings.coarse_steps_of_an_edge
    tried = margin.crossover * np.geomspace(1 / settings.reach_of_an_edge, settings.reach_of_an_edge, steps + 1)

    def hunting(rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """Return 1 where drawn stages hunt at bandwidths given by number, 0 where not, NaN where not certain."""
        if not rows.size:
            return np.zeros(0)
        flat = laid_over(stage, {key: values[rows] for key, values in sample.keys.items()})
        attracted = sketch_attractors(at_bandwidth(flat, tried[columns]), len(rows))
        return np.where(attracted.certain, attracted.attracts, np.nan)

    columns = np.arange(0, steps + 1, coarse)
    hunts = hunting(np.repeat(np.arange(count), len(columns)), np.tile(columns, count)).reshape(count, -1)
    rows = np.flatnonzero(np.isfinite(hunts).all(axis=1) & np.any(hunts > 0, axis=1) & (hunts[:, -1] == 0))
    last = coarse * (len(columns) - 1 - hunts[rows, ::-1].argmax(axis=1))
    for step in (coarse >> n for n in range(1, settings.halvings_of_an_edge + 1)):
        farther = hunting(rows, last + step)
        sure = np.isfinite(farther)
        rows, last = rows[sure], last[sure] + step * farther[sure].astype(np.int64)
    low, high = np.full((2, count), np.nan)
    low[rows], high[rows] = tried[last], tried[last + 1]
    return DrawnEdges(low, high)


def affordable(stage: Stage, correlations: Correlations, seed: int, rtol: float) -> int:
    """Return how many stages to draw for a fixed amount of work, measured on a few draws.

    The number is a power of two, for which Sobol's points are spread evenly.
    """
    with allowance() as spent:
        fates(stage, draw(stage, correlations, settings.trial_draws, seed), rtol)
    most = min(settings.trial_draws * settings.usual_work / max(spent.used, 1.0), settings.usual_draws)
    return 1 << max(settings.trial_draws.bit_length() - 1, int(np.log2(most)))


@dataclass(frozen=True)
class Draws:
    """Stages drawn from an uncertain one with a seed, and verdicts on them by variant.

    Variants are as in the file, locked and free. After an interruption there are fewer stages than were `asked` for,
    and no `edges`.
    """

    stage: Stage
    sample: Sample
    seed: int
    fates: Mapping[str, Fates]
    asked: int
    edges: DrawnEdges | None = None

    @classmethod
    def of(
        cls,
        stage: Stage,
        sample: Sample,
        seed: int,
        rtol: float,
        margin: Margin | None = None,
        progress: Progress = silent,
    ) -> Draws:
        """Judge the stages of a sample, and find the edges of hunting of the first ones.

        Edges are sought near the stage's `margin`, its distance from the edge. The function `fates` makes the verdicts.
        """
        judged = fates(stage, sample, rtol, progress)
        count = len(next(iter(judged.values())).verdicts)
        keys = {key: values[:count] for key, values in sample.keys.items()}
        ends = edges(stage, sample, margin) if count == sample.count else None
        return cls(stage, replace(sample, keys=keys, count=count), seed, judged, sample.count, ends)

    def unit(self, key: str) -> str:
        """Return the SI unit of a key."""
        return self.stage.numeric_keys()[key].unit


def different(stage: Stage) -> dict[str, Stage]:
    """Return the variants of a stage (as in the file, locked, free) without repetitions."""
    variants: dict[str, Stage] = {}
    for name, variant in stage.variants().items():
        if variant not in variants.values():
            variants[name] = variant
    return variants


def _fates(stage: Stage, sample: Sample, chunk: slice, rtol: float, tally: Tally) -> Fates:
    """Judge those of the drawn stages that are in a slice, the `chunk`."""
    flat = laid_over(stage, {key: values[chunk] for key, values in sample.keys.items()})
    count = chunk.stop - chunk.start
    attracted = find_attractors(flat, count)
    verdicts = judge_many(flat, count, rtol, attracted)
    sure = attracted.certain & np.isin(verdicts, ATTRACTED)
    swings = (np.where(sure, values, np.nan) for values in (attracted.amplitude, attracted.period))
    tally.add(count, "machines drawn")
    return Fates(verdicts, loops_unstable(flat, count), *swings)
