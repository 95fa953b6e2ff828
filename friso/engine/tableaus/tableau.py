"""Hold the coefficients of a Rosenbrock method, transformed to avoid matrix products.

The products are those with the Jacobian.

Hairer & Wanner, Solving ODEs II (1996), Sec. IV.7: stage i solves (1/(gamma h) - J) k_i = f(t + time_i h, x + sum_j
a_ij k_j) + h rate_i df/dt + sum_j c_ij/h k_j. Stiffly accurate: the last stage adds k to the solution, and this k is
the error estimate. Between the ends, x(theta) = (1 - theta) x_0 + theta (x_1 + (1 - theta) (d_1 + theta (d_2 + ...)))
with d_m = sum_j dense_mj k_j.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Tableau:
    """A Rosenbrock method: rows of `a` and `c`, nodes, time weights and dense output.

    Rows are for the stages after the first.
    """

    name: str
    order: int
    error_order: int
    gamma: float
    a: tuple[tuple[float, ...], ...]
    c: tuple[tuple[float, ...], ...]
    time: tuple[float, ...]
    rate: tuple[float, ...]
    dense: tuple[tuple[float, ...], ...]

    @property
    def stages(self) -> int:
        return len(self.time)
