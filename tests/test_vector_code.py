"""Straight-line code: compiled, it computes in all lanes what plain Python computes lane by lane."""

from collections.abc import Callable

import numpy as np
import pytest
from compiled import in_all

from friso.engine.simd_math import number_of


def arithmetic(B, share, least):
    x, y = B[0], B[1]
    for power in range(1, 4):
        x = x + share * y / power
    high, low = max(x, least), min(x, -y)
    B[2] = high * low - 1.0
    B[3] = abs(-x)


def choices(B, share, least):
    above, flag = B[0] > least, False
    flag = flag | (above & (B[1] <= share))
    B[2] = 1.0 if flag else (2.0 if not above else -share)
    B[3] = B[0] if B[1] and (above or B[0] < 0.0) else 3


def of_known_truths(B, share, least):
    x = y = 2.0 * B[0]
    B[2] = x if 0.5 else y
    B[3] = 1.0 if not B[1] else y


def of_several(B, share, least):
    """Assign two results of another function; a function's results may be used afterwards."""
    B[2], B[3] = parted(B[0], least)


def parted(x, at):
    beyond = x - at
    return beyond, 0.5 * beyond


CODE = [arithmetic, choices, of_known_truths, of_several]


@pytest.mark.cases(first=9)
@pytest.mark.parametrize("lanes", [1, 2, 8, 12])
@pytest.mark.parametrize("function", CODE)
def test_all_lanes_do_what_plain_python_does_in_one(function: Callable[..., None], lanes: int) -> None:
    rng = np.random.default_rng(lanes)
    rows = rng.normal(size=(4, lanes))
    rows[1, ::3] = 0.0
    plain = rows.copy()
    for column in plain.T:
        function(column, 0.3, -0.2)
    assert in_all(function, rows, 0.3, -0.2, lanes=lanes) == pytest.approx(plain, rel=1e-14, abs=1e-15)


def branched(B):
    if B[0] > 0.0:
        B[1] = 1.0


def looped(B):
    x = B[0]
    while x > 1.0:
        x = 0.5 * x
    B[1] = x


def called_outside(B):
    B[1] = np.sin(B[0])


def chained(B):
    B[1] = 1.0 if 0.0 < B[0] < 1.0 else 0.0


def compared_for_equality(B):
    B[1] = 1.0 if B[0] == 1.0 else 0.0


def stored_by_another(B):
    put(B, B[0])


def put(B, x):
    B[1] = x


def with_a_keyword(B):
    B[1] = max(B[0], -3.0, key=abs)


def before_the_first_row(B):
    B[1] = B[-1]


def number_as_bits(B):
    B[1] = number_of(np.int64(B[0]))


REFUSED = [branched, looped, called_outside, chained, compared_for_equality, stored_by_another, with_a_keyword]
REFUSED += [before_the_first_row, number_as_bits]


@pytest.mark.parametrize("function", REFUSED)
def test_what_the_language_does_not_have_is_refused(function: Callable[..., None]) -> None:
    with pytest.raises(Exception, match="not in the language of straight-line code"):
        in_all(function, np.zeros((2, 8)))
