"""Roots between two places, and the intervals of shares that are found with them, against SciPy."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import betaincinv

from friso.roots import NotConverged, bracketed_root
from friso.shares import DOUBT, share_interval


@pytest.mark.parametrize(
    ("function", "low", "high"),
    [
        (math.cos, 0.0, 3.0),
        (lambda x: x**9 - 1e-3, 0.0, 1.0),
        (lambda x: math.exp(x) - 2.0, 5.0, -5.0),
        (lambda x: math.copysign(1.0, x - 0.3), 0.0, 1.0),
        (lambda x: x, 0.0, 1.0),
        (lambda x: x - 1.0, 0.0, 1.0),
    ],
)
def test_a_root_is_found_as_by_brent(function, low: float, high: float) -> None:
    calls = []

    def counted(x: float) -> float:
        calls.append(x)
        return function(x)

    root = bracketed_root(counted, low, high, 1e-10)
    reference, result = brentq(function, low, high, xtol=1e-12, full_output=True)
    assert root == pytest.approx(reference, abs=1e-10)
    assert len(calls) <= result.function_calls + 5
    assert all(min(low, high) <= x <= max(low, high) for x in calls)


def test_its_ends_enclose_the_root() -> None:
    """Both signs are met no farther apart than asked for: the last point that attracts is one of them."""
    places = []

    def function(x: float) -> float:
        places.append(x)
        return math.tanh(30 * (x - 0.7))

    bracketed_root(function, 0.0, 1.0, 1e-5)
    below, above = max(x for x in places if x < 0.7), min(x for x in places if x >= 0.7)
    assert above - below <= 1e-5


def test_no_root_is_made_up() -> None:
    with pytest.raises(ValueError, match="same sign"):
        bracketed_root(math.exp, 0.0, 1.0, 1e-6)
    with pytest.raises(NotConverged):
        bracketed_root(math.cos, 0.0, 3.0, 1e-12, 3)


@pytest.mark.parametrize("count", [1, 2, 7, 128, 1681, 100_000])
def test_intervals_of_shares_are_those_of_the_beta_distribution(count: int) -> None:
    for hits in sorted({0, 1, count // 3, count // 2, count - 1, count}):
        low = betaincinv(hits, count - hits + 1, DOUBT / 2) if hits else 0.0
        high = betaincinv(hits + 1, count - hits, 1 - DOUBT / 2) if hits < count else 1.0
        assert share_interval(hits, count) == pytest.approx((low, high), rel=1e-9)
        assert np.all(np.diff([0.0, low, hits / count, high, 1.0]) >= 0)
