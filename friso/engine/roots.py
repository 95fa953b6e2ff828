"""Find the first zero of a kink's surface inside a step, as straight-line code.

At a kink derivatives jump; its surface is a function of the states that is 0 there. Values at the ends and thirds of
the step fix a cubic. `friso.engine.vector_code` compiles the code.
"""

from __future__ import annotations

from math import sqrt


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
