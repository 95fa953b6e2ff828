"""The first zero of a kink's surface inside a step, from its values at both ends and at the thirds."""

from __future__ import annotations

from numba import njit

from friso.engine.simd_math import OPTIONS


@njit(**OPTIONS)
def cubic(p0, p1, p2, p3, theta):
    """The cubic through p0 at 0, p1 at 1/3, p2 at 2/3 and p3 at 1, at theta."""
    c1 = -5.5 * p0 + 9.0 * p1 - 4.5 * p2 + p3
    c2 = 9.0 * p0 - 22.5 * p1 + 18.0 * p2 - 4.5 * p3
    c3 = -4.5 * p0 + 13.5 * p1 - 13.5 * p2 + 4.5 * p3
    return p0 + theta * (c1 + theta * (c2 + theta * c3))


@njit(**OPTIONS)
def first_crossing(p0, p1, p2, p3):
    """Where the cubic first falls below zero from p0 > 0; 2 where it does not.

    A third in which the sign changes brackets the zero; a secant and three Newton steps find it, halving the
    bracket where a step would leave it; what has not converged then is taken at the bracket's far end.
    """
    c1 = -5.5 * p0 + 9.0 * p1 - 4.5 * p2 + p3
    c2 = 9.0 * p0 - 22.5 * p1 + 18.0 * p2 - 4.5 * p3
    c3 = -4.5 * p0 + 13.5 * p1 - 13.5 * p2 + 4.5 * p3
    early = p1 < 0.0
    middle = p2 < 0.0
    low = 0.0 if early else (1.0 / 3.0 if middle else 2.0 / 3.0)
    high = low + 1.0 / 3.0
    above = p0 if early else (p1 if middle else p2)
    below = p1 if early else (p2 if middle else p3)
    theta = low + above / (3.0 * (above - below))
    for _ in range(3):
        value = p0 + theta * (c1 + theta * (c2 + theta * c3))
        slope = c1 + theta * (2.0 * c2 + theta * 3.0 * c3)
        low = theta if value > 0.0 else low
        high = high if value > 0.0 else theta
        newton = theta - value / slope
        theta = newton if (newton > low) & (newton < high) else 0.5 * (low + high)
    found = p0 + theta * (c1 + theta * (c2 + theta * c3)) <= 0.01 * p0
    crossed = early | middle | (p3 < 0.0)
    return (theta if found else high) if crossed else 2.0
