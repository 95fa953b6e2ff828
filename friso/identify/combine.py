"""One estimate of a quantity from several, and how the combined ones hang together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import brentq
from scipy.stats import chi2

from friso.identify.estimate import Estimate
from friso.identify.readings.common import Mean, by_t, t_value
from friso.intervals import COVERAGE

CHANCE = 0.01
"""Probability below which a scatter as large as that of estimates which agree is taken for a disagreement."""

Correlated = tuple[Sequence[Estimate], np.ndarray]
"""What one experiment shows, each with an interval, and its correlation matrix, shape (estimates, estimates)."""


def combined(found: Sequence[Estimate]) -> tuple[list[Estimate], list[str]]:
    """One estimate per key from all those found, weighted by their intervals; and a sentence where they disagree.

    Where some disagree, the interval allows for that. What one experiment shows counts, whatever another cannot show;
    where none does, what all of them leave possible is left.
    """
    answers, said = [], []
    for key in dict.fromkeys(each.name for each in found):
        own = [each for each in found if each.name == key]
        shown = [each for each in own if each.shown]
        sure = _weighty(shown)
        if len(sure) > 1:
            one, agrees = _mean(key, sure)
        elif shown:
            one, agrees = (sure or shown)[0], True
        else:
            one, agrees = _left(key, own)
        answers.append(one)
        if not agrees:
            said.append(f"{key}: the experiments disagree, and the interval allows for it: {_texts(sure or own)}")
        beyond = [each for each in own if shown and not each.shown and (each.low > one.high or each.high < one.low)]
        said += [f"{key}: {_text(one)} is shown, but {_text(each)}" for each in beyond]
    return answers, said


def correlations(found: Sequence[Estimate], groups: Sequence[Correlated]) -> tuple[tuple[str, ...], np.ndarray]:
    """The keys of the groups and their correlations once combined, shape (keys, keys).

    `found` are the estimates of all experiments. A combined value is a mean of single ones with weights a_i, and the
    experiments are independent: its covariance is the sum of A_i C_i A_i, with C_i the covariance within one.
    """
    keys = tuple(dict.fromkeys(each.name for group, _ in groups for each in group))
    precision = {key: sum(_weight(each) for each in _weighty(found) if each.name == key) for key in keys}
    covariance = np.diag([1 / precision[key] for key in keys])
    for group, matrix in groups:
        shares = np.array([_weight(each) ** 0.5 / precision[each.name] for each in group])  # a_i times the deviation
        places = [keys.index(each.name) for each in group]
        covariance[np.ix_(places, places)] += (matrix - np.eye(len(group))) * np.outer(shares, shares)
    size = np.sqrt(np.diag(covariance))
    joint = covariance / np.outer(size, size)
    return keys, (joint + joint.T) / 2


def _weighty(found: Sequence[Estimate]) -> list[Estimate]:
    """Those that can be weighted: shown, with an interval."""
    return [each for each in found if each.shown and each.half_width > 0]


def _weight(each: Estimate) -> float:
    return (COVERAGE / each.half_width) ** 2


def _mean(key: str, shown: Sequence[Estimate]) -> tuple[Estimate, bool]:
    """The weighted mean where a chi-square test allows that all are of one value, and whether it does.

    Its interval is wider by the Birge ratio (Birge 1932, doi:10.1103/PhysRev.40.207), by Student's t of three and more,
    where they scatter more than their own intervals say; what is systematic in these does not average out. Where the
    test does not allow it, as for friction at several places, each counts with a scatter from place to place besides
    its own (`_between`); of two, which hardly show a scatter, the interval spans both.
    """
    values, weights = (
        np.array(column) for column in zip(*((each.value, _weight(each)) for each in shown), strict=True)
    )
    mean, freedom = float(np.average(values, weights=weights)), len(values) - 1
    shared = float(np.average([each.systematic for each in shown], weights=weights))
    squares = float(np.sum(weights * (values - mean) ** 2))
    method = ", ".join(dict.fromkeys(each.method for each in shown))
    if chi2.sf(squares, freedom) > CHANCE:
        own = np.array([(each.half_width - each.systematic) / COVERAGE for each in shown])
        error = float(np.linalg.norm(weights * own)) / float(weights.sum())
        ratio = (squares / freedom) ** 0.5
        wider = ratio * t_value(freedom) if ratio > 1 and freedom > 1 else COVERAGE * max(ratio, 1.0)
        half = wider * error + shared
        return Estimate(key, shown[0].unit, mean, mean - half, mean + half, method, systematic=shared), True
    if freedom == 1:
        low, high = min(each.low for each in shown), max(each.high for each in shown)
        return Estimate(key, shown[0].unit, (low + high) / 2, low, high, method), False
    return by_t(key, shown[0].unit, _between(values, 1 / weights), method, shared, shared), False


def _between(values: np.ndarray, variances: np.ndarray) -> Mean:
    """The mean of values, shape (n,), that scatter by more than their variances: a variance from one to the next is
    added with which they scatter as they do (Paule, Mandel 1982, doi:10.6028/jres.087.022). The degrees of freedom are
    those of as many values as count equally: one that is hardly known tells little of the scatter."""

    def excess(added: float) -> float:
        weights = 1 / (variances + added)
        return float(np.sum(weights * (values - np.average(values, weights=weights)) ** 2)) - (len(values) - 1)

    weights = 1 / (variances + brentq(excess, 0.0, float(np.ptp(values)) ** 2))
    equal = weights.sum() ** 2 / (weights @ weights)
    return Mean(float(np.average(values, weights=weights)), float(weights.sum() ** -0.5), max(float(equal) - 1, 1.0))


def _left(key: str, own: Sequence[Estimate]) -> tuple[Estimate, bool]:
    """What several that do not show it leave possible: what they have in common, or the hull where that is nothing."""
    bounding = [each for each in own if np.isfinite(each.low) or np.isfinite(each.high)] or own[:1]
    low, high = max(each.low for each in bounding), min(each.high for each in bounding)
    agrees = low <= high
    if not agrees:
        low, high = min(each.low for each in bounding), max(each.high for each in bounding)
    method, reason = (
        joint.join(dict.fromkeys(texts))
        for joint, texts in ((", ", [each.method for each in bounding]), ("; ", [each.reason for each in bounding]))
    )
    return Estimate.unknown(key, own[0].unit, method, reason, low, high), agrees


def _text(each: Estimate) -> str:
    return f"{_value(each)} by {each.method}"


def _texts(every: Sequence[Estimate]) -> str:
    """The values by method."""
    methods = dict.fromkeys(each.method for each in every)
    own = ([_value(each) for each in every if each.method == method] for method in methods)
    return "; ".join(f"{', '.join(values)} by {method}" for method, values in zip(methods, own, strict=True))


def _value(each: Estimate) -> str:
    if each.shown:
        return f"{each.value:.4g} ({each.low:.4g} to {each.high:.4g})"
    return f"{each.low:.4g} to {each.high:.4g} is the possible range"
