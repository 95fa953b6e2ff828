"""Judge a stage whose numbers are uncertain, by the verdicts on many stages drawn from it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from friso.engine.allowance import allowance
from friso.engine.kernel import KernelRequest, kernels
from friso.equations.structure import shared_structure
from friso.hunting import judge_many, kernels_to_judge, loops_unstable
from friso.hunting.criteria import ATTRACTED, VERDICTS
from friso.progress import Progress, Tally, silent
from friso.shares import Share, share
from friso.stage import Stage
from friso.stage.correlations import Correlations, Sample, draw, laid_over
from friso.studies.settings import StudySettings


@dataclass(frozen=True)
class Fates:
    """The verdicts on drawn stages, words of `friso.hunting.criteria.VERDICTS`, and the loops of which are `unstable`,
    sticking or sliding, both of shape (count,)."""

    verdicts: np.ndarray
    unstable: np.ndarray

    @property
    def counts(self) -> dict[str, int]:
        """Return how often each verdict occurs."""
        return {word: int(np.count_nonzero(self.verdicts == word)) for word in VERDICTS}

    def share(self, words: tuple[str, ...]) -> Share:
        """Return the probability of any of these verdicts."""
        return share(np.isin(self.verdicts, words), self.verdicts != "failed")

    def separations(self, keys: Mapping[str, np.ndarray]) -> dict[str, float]:
        """Return how well each key separates stages with an attracting cycle from those without,
        the most decisive first.

        It is the rank-biserial correlation (Kerby 2014, doi 10.2466/11.IT.3.1): 1 where all that hunt have the larger
        values, -1 where all have the smaller ones, 0 where the key separates nothing. Empty where all share one fate.
        """
        from scipy.stats import mannwhitneyu  # 0.7 s to import

        attracted = np.isin(self.verdicts, ATTRACTED)
        others = ~attracted & (self.verdicts != "failed")
        if not (attracted.any() and others.any()):
            return {}
        pairs = int(attracted.sum()) * int(others.sum())
        separation = {
            key: 2 * float(mannwhitneyu(values[attracted], values[others]).statistic) / pairs - 1
            for key, values in keys.items()
        }
        return dict(sorted(separation.items(), key=lambda item: -abs(item[1])))


def fates(stage: Stage, sample: Sample, rtol: float, progress: Progress = silent) -> dict[str, Fates]:
    """Return the fates of the drawn stages as given and, with a joint, locked and free.

    After Ctrl-C, they are those of the first of the stages, as many as were judged in all variants by then.
    """
    settings = StudySettings.current()
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
    by_variant = {name: _joined(some) for name, some in parts.items()}
    return {
        name: by_variant[next(other for other, same in variants.items() if same == variant)]
        for name, variant in stage.variants().items()
    }


def affordable(stage: Stage, correlations: Correlations, seed: int, rtol: float) -> int:
    """Return how many stages may be drawn for a fixed work,
    a power of two (Sobol' points are even then)."""
    settings = StudySettings.current()
    with allowance() as spent:
        fates(stage, draw(stage, correlations, settings.trial_draws, seed), rtol)
    most = min(settings.trial_draws * settings.usual_work / max(spent.used, 1.0), settings.usual_draws)
    return 1 << max(settings.trial_draws.bit_length() - 1, int(np.log2(most)))


@dataclass(frozen=True)
class Draws:
    """Stages drawn from an uncertain one with a seed, and their fates case by case.

    They are fewer than were `asked` for after an interruption.
    """

    stage: Stage
    sample: Sample
    seed: int
    fates: Mapping[str, Fates]
    asked: int

    @classmethod
    def of(cls, stage: Stage, sample: Sample, seed: int, rtol: float, progress: Progress = silent) -> Draws:
        """Judge the stages of a sample (see `fates`)."""
        judged = fates(stage, sample, rtol, progress)
        count = len(next(iter(judged.values())).verdicts)
        keys = {key: values[:count] for key, values in sample.keys.items()}
        return cls(stage, replace(sample, keys=keys, count=count), seed, judged, sample.count)

    def unit(self, key: str) -> str:
        """Return the SI unit of a key."""
        return self.stage.numeric_keys()[key].unit


def different(stage: Stage) -> dict[str, Stage]:
    """Return the variants of a stage, each once."""
    variants: dict[str, Stage] = {}
    for name, variant in stage.variants().items():
        if variant not in variants.values():
            variants[name] = variant
    return variants


def _fates(stage: Stage, sample: Sample, chunk: slice, rtol: float, tally: Tally) -> Fates:
    """Judge some of the drawn stages."""
    flat = laid_over(stage, {key: values[chunk] for key, values in sample.keys.items()})
    count = chunk.stop - chunk.start
    judged = Fates(judge_many(flat, count, rtol), loops_unstable(flat, count))
    tally.add(count, "machines drawn")
    return judged


def _joined(parts: Sequence[Fates]) -> Fates:
    """Return the fates of several groups of stages as those of one."""
    return Fates(np.concatenate([part.verdicts for part in parts]), np.concatenate([part.unstable for part in parts]))
