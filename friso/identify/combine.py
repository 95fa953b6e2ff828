"""One estimate of a quantity from several."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from friso.identify.estimate import Estimate
from friso.intervals import COVERAGE

AGREE = 3.0
"""Estimates disagree when one is further from their mean than so many standard deviations of the difference."""


def combined(found: Sequence[Estimate]) -> tuple[list[Estimate], list[str]]:
    """One estimate per key from all those found, weighted by their intervals; and a sentence where they disagree.

    Where some disagree, the interval spans all of them. What one experiment shows counts, whatever another cannot show.
    """
    keys = list(dict.fromkeys(each.name for each in found))
    answers, said = [], []
    for key in keys:
        own = [each for each in found if each.name == key]
        shown = [each for each in own if each.shown and each.half_width > 0]
        if len(shown) < 2:
            answers.append(shown[0] if shown else min(own, key=lambda each: each.half_width))
            continue
        one, agrees = _weighted(key, shown)
        answers.append(one)
        if not agrees:
            texts = "; ".join(
                f"{each.value:.4g} ({each.low:.4g} to {each.high:.4g}) by {each.method}" for each in shown
            )
            said.append(f"{key}: the experiments disagree, the interval spans them all: {texts}")
    return answers, said


def _weighted(key: str, shown: Sequence[Estimate]) -> tuple[Estimate, bool]:
    """The weighted mean, and whether all agree with it."""
    values = np.array([each.value for each in shown])
    spreads = np.array([each.half_width for each in shown]) / COVERAGE
    weights = 1 / spreads**2
    mean = float(np.average(values, weights=weights))
    agrees = bool(np.all(np.abs(values - mean) < AGREE * np.sqrt(spreads**2 + 1 / weights.sum())))
    method = ", ".join(dict.fromkeys(each.method for each in shown))
    if agrees:
        return Estimate.normal(key, shown[0].unit, mean, float(weights.sum() ** -0.5), method), True
    low, high = min(each.low for each in shown), max(each.high for each in shown)
    return Estimate(key, shown[0].unit, (low + high) / 2, low, high, method), False
