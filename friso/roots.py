"""A root of a function of one variable between two places, without SciPy's optimisers, which take 0.4 s to import."""

from __future__ import annotations

from collections.abc import Callable


class NotConverged(ArithmeticError):
    """A root was not enclosed closely enough within the evaluations allowed."""


def bracketed_root(
    function: Callable[[float], float], low: float, high: float, precise: float, most: int = 100
) -> float:
    """Where a function is zero between two places at which it has opposite signs: the better end of an interval not
    wider than `precise` in which it changes sign. By a secant first, then by inverse quadratic interpolation where
    that is safe, else by bisection (Chandrupatla 1997, doi:10.1016/S0965-9978(96)00051-8). Raises NotConverged after so
    many evaluations, and ValueError where both signs are the same."""
    a, b, f_a, f_b = low, high, function(low), function(high)
    if f_a * f_b > 0:
        raise ValueError("the function has the same sign at both ends")
    share = f_a / (f_a - f_b) if f_a != f_b else 0.5
    for _ in range(most):
        if f_a == 0 or abs(b - a) <= precise:
            return a if abs(f_a) < abs(f_b) else b
        if f_b == 0:
            return b
        x = a + share * (b - a)
        f_x = function(x)
        if (f_x > 0) == (f_a > 0):
            c, f_c = a, f_a
        else:
            c, f_c, b, f_b = b, f_b, a, f_a
        a, f_a = x, f_x
        across, down = (a - b) / (c - b), (f_a - f_b) / (f_c - f_b)
        share = 0.5
        if down**2 < across and (1 - down) ** 2 < 1 - across:
            share = f_a / (f_b - f_a) * f_c / (f_b - f_c) + (c - a) / (b - a) * f_a / (f_c - f_a) * f_b / (f_c - f_b)
        least = precise / 2 / abs(b - a) if a != b else 0.5
        share = min(max(share, least), 1 - least)
    raise NotConverged
