"""Single-harmonic balance: the textbook's test for a limit cycle, which for hunting is no test.

A loop whose friction is replaced by its describing function N(A, omega) has a periodic motion where 1/R(i omega) =
N(A, omega), R being the receptance of the loop for a friction force (`loop`): -1/R + N = 0 is one complex equation in A
and omega (Gelb, Vander Velde 1968). Every cell of a grid in amplitude and frequency is asked whether the left side
turns round zero along its edges, so that "no cycle" is the outcome of a computation and not a solver that failed.

Hunting is a jump out of a long rest. Its motion is so far from a sine that this balance finds no cycle where there is
one: see docs/describing.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from friso.engine.tolerance import checked_rtol
from friso.frequency.describing.function import checked_positive, dynamic_stiffness
from friso.frequency.describing.loop import receptance
from friso.frequency.describing.steady import RTOL
from friso.stage import Stage

AMPLITUDES = np.geomspace(1e-9, 1.0, 181)
"""Amplitudes [m] of the grid unless told."""

FREQUENCIES = np.geomspace(1e-4, 1e3, 281)
"""Frequencies [Hz] of the grid unless told."""

NUDGE = 1e-5
"""Change of the logarithms over which derivatives are taken."""

STEPS = 20
"""Newton steps to a solution."""


@dataclass(frozen=True)
class Balance:
    """Outcome of a single-harmonic balance.

    `amplitudes` [m] and `frequencies` [Hz] of the solutions, with the `residuals` left there, all of shape
    (solutions,), none of them if there is no cycle. `least` is the smallest residual of the grid, at the amplitude
    `least_amplitude` [m] of the cart and `least_frequency` [Hz]. A residual is abs(N - 1/R) over abs(N) + abs(1/R): 0
    where the balance holds, and at most 1.
    """

    amplitudes: np.ndarray
    frequencies: np.ndarray
    residuals: np.ndarray
    least: float
    least_amplitude: float
    least_frequency: float


def single_harmonic(
    stage: Stage,
    amplitudes: Sequence[float] | np.ndarray = AMPLITUDES,
    frequencies: Sequence[float] | np.ndarray = FREQUENCIES,
    rtol: float = RTOL,
) -> Balance:
    """Solve the balance of a stage with friction, within a grid of amplitudes [m] of the cart and frequencies [Hz],
    each in ascending order. Two solutions in one cell escape it. Raises StageError for a stage without friction and for
    a grid that is not usable."""
    loop = _Loop(stage, checked_rtol(rtol))
    sizes = checked_positive("amplitudes", amplitudes, "1e-5 m, 1e-4 m")
    rates = checked_positive("frequencies", frequencies, "0.1 Hz, 1 Hz")
    shape = (len(sizes), len(rates))
    logs = np.stack([np.repeat(np.log(sizes), shape[1]), np.tile(np.log(rates), shape[0])])
    left, residual = (part.reshape(shape) for part in loop.left(logs))
    cells = np.argwhere(_turns(left) != 0)
    middles = np.log([sizes[cells[:, 0]], rates[cells[:, 1]]]) / 2
    middles += np.log([sizes[cells[:, 0] + 1], rates[cells[:, 1] + 1]]) / 2
    found = loop.polished(middles)
    i, j = np.unravel_index(np.argmin(residual), shape)
    at = (float(residual[i, j]), float(sizes[i]), float(rates[j]))
    return Balance(np.exp(found[0]), np.exp(found[1]), loop.left(found)[1], *at)


def _turns(left: np.ndarray) -> np.ndarray:
    """How often a complex function on a grid turns round zero along the edges of each cell: its zeros inside, those at
    which it is mirrored counted as -1."""
    along = np.angle(left[1:] / left[:-1])
    across = np.angle(left[:, 1:] / left[:, :-1])
    return np.rint((along[:, :-1] + across[1:] - along[:, 1:] - across[:-1]) / (2 * np.pi)).astype(int)


@dataclass(frozen=True)
class _Loop:
    """The two sides of the balance, at logarithms of amplitude and frequency (2, count)."""

    stage: Stage
    rtol: float

    def left(self, logs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """N - 1/R [N/m], complex, and the residual, both of shape (count,)."""
        amplitudes, frequencies = np.exp(logs)
        flat = self.stage.flat()
        stiffness = dynamic_stiffness(flat, amplitudes, frequencies, self.rtol)
        loop = 1 / receptance(flat, frequencies)[0]
        return stiffness - loop, np.abs(stiffness - loop) / (np.abs(stiffness) + np.abs(loop))

    def polished(self, logs: np.ndarray) -> np.ndarray:
        """Solutions by Newton's method from near them."""
        for _ in range(STEPS if logs.size else 0):
            sides = [self.left(logs + NUDGE * step[:, None])[0] for step in np.vstack([np.eye(2), -np.eye(2)])]
            slopes = np.array([(sides[k] - sides[k + 2]) / (2 * NUDGE) for k in range(2)])
            matrix = np.moveaxis(np.array([np.real(slopes), np.imag(slopes)]), 2, 0)
            left = self.left(logs)[0]
            logs = (
                logs - np.linalg.solve(matrix, np.stack([np.real(left), np.imag(left)], axis=1)[:, :, None])[:, :, 0].T
            )
        return logs
