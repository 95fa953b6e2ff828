"""Functions that kernels call, as straight-line code: elementary ones, random numbers, and zeros of a kink's surface.

`friso.engine.vector_code` compiles them. The code has no calls, branches or tables. Mathematics libraries work on one
number at a time, so these functions split off the exponent by the bits of the number. Relative errors are below 1e-15
over the ranges stated; tested against NumPy.

At a kink derivatives jump. Its surface is a function of the states that is 0 there. Its first zero inside a step is
that of a cubic, which values at the ends and thirds of the step fix.
"""

from __future__ import annotations

from math import sqrt

import numpy as np


def cubic(p0, p1, p2, p3, theta):
    """Return the cubic through p0 at 0, p1 at 1/3, p2 at 2/3 and p3 at 1, at theta."""
    c1 = -5.5 * p0 + 9.0 * p1 - 4.5 * p2 + p3
    c2 = 9.0 * p0 - 22.5 * p1 + 18.0 * p2 - 4.5 * p3
    c3 = -4.5 * p0 + 13.5 * p1 - 13.5 * p2 + 4.5 * p3
    return p0 + theta * (c1 + theta * (c2 + theta * c3))


def bracket(p0, p1, p2, p3):
    """Bracket the first zero of a cubic: return the ends of an interval and the cubic there.

    p0 to p3 are the values of the cubic at 0, 1/3, 2/3 and 1. It is evaluated there and at its minimum. The upper end
    is 2 if the cubic is nowhere below zero.
    """
    c1 = -5.5 * p0 + 9.0 * p1 - 4.5 * p2 + p3
    c2 = 9.0 * p0 - 22.5 * p1 + 18.0 * p2 - 4.5 * p3
    c3 = -4.5 * p0 + 13.5 * p1 - 13.5 * p2 + 4.5 * p3
    dip = -c1 / (c2 + sqrt(max(c2 * c2 - 3.0 * c1 * c3, 0.0)))
    least = p0 + dip * (c1 + dip * (c2 + dip * c3))
    high = 1.0 / 3.0 if p1 < 0.0 else (2.0 / 3.0 if p2 < 0.0 else (1.0 if p3 < 0.0 else 2.0))
    below = p1 if p1 < 0.0 else (p2 if p2 < 0.0 else p3)
    dips = (dip > 0.0) & (dip < min(high, 1.0)) & (least < 0.0)
    high = dip if dips else high
    below = least if dips else below
    low = 2.0 / 3.0 if high > 2.0 / 3.0 else (1.0 / 3.0 if high > 1.0 / 3.0 else 0.0)
    above = p2 if high > 2.0 / 3.0 else (p1 if high > 1.0 / 3.0 else p0)
    return low, high, above, below


def first_guess(p0, p1, p2, p3):
    """Return approximately where a cubic first falls below zero from p0 > 0; 2 if it does not.

    The guess is that of a secant.
    """
    low, high, above, below = bracket(p0, p1, p2, p3)
    guess = low + (high - low) * above / (above - below)
    return guess if high < 2.0 else 2.0


def crossing(p0, p1, p2, p3, guess):
    """Find where the cubic first falls below zero, starting from `first_guess`.

    Three Newton steps find it; a step that would leave the bracket halves it instead. Without convergence, the far end
    of the bracket is returned.
    """
    c1 = -5.5 * p0 + 9.0 * p1 - 4.5 * p2 + p3
    c2 = 9.0 * p0 - 22.5 * p1 + 18.0 * p2 - 4.5 * p3
    c3 = -4.5 * p0 + 13.5 * p1 - 13.5 * p2 + 4.5 * p3
    low, high, _, _ = bracket(p0, p1, p2, p3)
    theta = guess
    for _ in range(3):
        value = p0 + theta * (c1 + theta * (c2 + theta * c3))
        slope = c1 + theta * (2.0 * c2 + theta * 3.0 * c3)
        low = theta if value > 0.0 else low
        high = high if value > 0.0 else theta
        newton = theta - value / slope
        theta = newton if (newton >= low) & (newton <= high) else 0.5 * (low + high)
    crosses = p0 + theta * (c1 + theta * (c2 + theta * c3)) <= 0.01 * p0
    return theta if crosses else high


_ROUNDING_SHIFT = 6755399441055744.0  # 1.5 * 2^52: the low bits of x + 1.5 * 2^52 are a whole number
_LOG2_E = 1.4426950408889634
_LN2_HIGH, _LN2_LOW = 0.6931471803691238, 1.9082149292705877e-10
_THREE_QUARTERS = 4604930618986332160  # the bits of 0.75
_TWO_TO_52 = 4503599627370496.0
_TWO52_BITS = 4841369599423283200


def bits_of(x):
    """Return the bits of a number as a whole number."""
    return np.float64(x).view(np.int64)


def number_of(bits):
    """Return the number with the given bits."""
    return np.int64(bits).view(np.float64)


def exp(x):
    """Return e^x, with x limited to -300 to 700.

    At -300 it is 1e-130, so that products with it stay normal numbers.
    """
    x = min(max(x, -300.0), 700.0)
    shifted = x * _LOG2_E + _ROUNDING_SHIFT
    rounded = shifted - _ROUNDING_SHIFT
    r = (x - rounded * _LN2_HIGH) - rounded * _LN2_LOW
    r2 = r * r
    r4 = r2 * r2
    p0 = (1.0 + r) + r2 * (1.0 / 2 + r * (1.0 / 6))  # the series in independent groups
    p1 = (1.0 / 24 + r * (1.0 / 120)) + r2 * (1.0 / 720 + r * (1.0 / 5040))
    p2 = (1.0 / 40320 + r * (1.0 / 362880)) + r2 * (1.0 / 3628800 + r * (1.0 / 39916800))
    p3 = 1.0 / 479001600 + r * (1.0 / 6227020800)
    p = p0 + r4 * (p1 + r4 * (p2 + r4 * p3))
    return p * number_of((bits_of(shifted) + np.int64(1023)) << np.int64(52))


def log(x):
    """Return the natural logarithm of a positive, normal x."""
    bits = bits_of(x)
    exponent_bits = (bits - np.int64(_THREE_QUARTERS)) >> np.int64(52)  # rounds so that 0.75 <= m < 1.5
    m = number_of(bits - (exponent_bits << np.int64(52)))
    exponent = number_of((exponent_bits + np.int64(2048)) | np.int64(_TWO52_BITS)) - (_TWO_TO_52 + 2048.0)
    s = (m - 1.0) / (m + 1.0)
    q = s * s
    p = 1.0 / 15 + q * (1.0 / 17 + q * (1.0 / 19 + q * (1.0 / 21 + q * (1.0 / 23 + q * (1.0 / 25)))))
    p = 1.0 / 3 + q * (1.0 / 5 + q * (1.0 / 7 + q * (1.0 / 9 + q * (1.0 / 11 + q * (1.0 / 13 + q * p)))))
    return exponent * _LN2_HIGH + (exponent * _LN2_LOW + 2.0 * (s + s * q * p))


def power(base, exponent):
    """Return base^exponent for a positive, normal base."""
    return exp(exponent * log(base))


def tanh(x):
    """Return the hyperbolic tangent, with an absolute error below 1e-15."""
    return 1.0 - 2.0 / (exp(2.0 * x) + 1.0)


def clipped(x, limit):
    """Return x limited to plus and minus a limit."""
    return min(max(x, -limit), limit)


def quantised(x, digit):
    """Return x rounded to multiples of the step `digit`, unchanged for a step of 0.

    It is exact for fewer than 2^51 steps.
    """
    rounded = digit * ((x / digit + _ROUNDING_SHIFT) - _ROUNDING_SHIFT)
    return rounded if digit > 0.0 else x


def mixed(z):
    """Return the bits of z well mixed, by SplitMix64.

    Steele, Lea, Flood 2014, doi:10.1145/2660193.2660195.
    """
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


def uniform(bits):
    """Return a number uniform in the open interval from 0 to 1, from the top 40 bits.

    Half of the last bit is added.
    """
    number = number_of(np.int64((bits >> np.uint64(12)) | np.uint64(0x3FF0000000000000)))
    return (number - 1.0) + 4.547473508864641e-13


def gaussian(seed, tick):
    """Return a normally distributed number for a seed and a tick, whole numbers below 2^51.

    By Box and Muller (1958, doi:10.1214/aoms/1177706645). The number is at most 7.5 in size, and equal on any thread
    and in any order.
    """
    key = mixed(np.uint64(bits_of(seed + _TWO_TO_52)) * np.uint64(0x9E3779B97F4A7C15))
    bits = mixed(key + np.uint64(bits_of(tick + _TWO_TO_52)) * np.uint64(0x9E3779B97F4A7C15))
    radius = sqrt(-2.0 * log(uniform(bits & np.uint64(0xFFFFFFFFFF000000))))
    return radius * quarter_sine(abs(uniform(bits << np.uint64(40)) - 0.5) - 0.25)


def quarter_sine(turn):
    """Return sin(2 pi turn) for at most a quarter turn to either side.

    The absolute error is below 1e-11.
    """
    x = 6.283185307179586 * turn
    q = x * x
    p = -1.0 / 39916800 + q * (1.0 / 6227020800 - q * (1.0 / 1307674368000))
    return x * (1.0 + q * (-1.0 / 6 + q * (1.0 / 120 + q * (-1.0 / 5040 + q * (1.0 / 362880 + q * p)))))


def sine(turn):
    """Return sin(2 pi turn) for up to 2^50 turns.

    The absolute error is below 1e-11, plus the rounding of the turn.
    """
    quarter_later = turn + 0.25
    within = quarter_later - ((quarter_later - 0.5 + _ROUNDING_SHIFT) - _ROUNDING_SHIFT)  # 0 to 1
    return quarter_sine(0.25 - abs(within - 0.5))
