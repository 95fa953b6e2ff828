"""Solve the single-harmonic balance: a test for a limit cycle, but none for hunting.

The friction is replaced by its describing function N(A, omega). The loop then has a periodic motion where 1/R(i omega)
= N(A, omega), with R the receptance of the loop for a friction force. So -1/R + N = 0 is one complex equation in A and
omega (Gelb, Vander Velde 1968). For every cell of a grid in amplitude and frequency, it is checked whether the left
side turns around zero along the edges. "No cycle" is then the result of a computation, and not of a solver that failed.

Hunting is a jump out of a long rest. Its motion is so far from a sine that this balance finds no cycle even if there is
one: see docs/describing.md.

Friction sees the closed loop as positions, of cart and stage, per friction force on the cart.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import sympy as sp

from friso.engine.allowance import checked_rtol
from friso.equations.component import key
from friso.equations.model import assemble
from friso.equations.structure import Structure, shared_structure
from friso.frequency.system import Declared
from friso.stage import Stage
from friso_thesis.studies.describing.function import IMPOSED_RTOL, checked_positive, dynamic_stiffness

FORCE, CART, STAGE = "force on cart", "cart", "stage"

TOUCHES = "the joint deflects beyond its stroke: the limiter, which this answer leaves out, would be touched"


def receptance(flat: Mapping[str, Any], frequencies: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return positions of cart and stage per friction force on the cart [m/N], complex.

    Frequencies [Hz] and results have the shape (frequencies,). The reference rests, the limiter is not touched, and the
    force is below its limit.
    """
    loop = _loop(shared_structure(flat).standing).at(flat, 1)
    (answer,) = loop.take((FORCE,), (CART, STAGE)).at(2j * np.pi * frequencies)
    return -answer[:, 0, 0], -answer[:, 1, 0]


@cache
def _loop(form: Structure) -> Declared:
    """Return a stage's own equations in symbols, with a force in place of friction."""
    control = replace(form.controller, anti_windup=None) if form.controller else None
    linear = replace(form, friction="none", friction_variant=None, controller=control, biased=("cart",))
    model = assemble(linear)
    outputs = {CART: model.outputs["cart_position"].expression, STAGE: model.outputs["position"].expression}
    within: dict[Any, Any] = {kink.beyond: sp.S.Zero for kink in model.kinks}  # within the stroke and all limits
    rates = tuple(sp.sympify(rate).subs(within) for rate in model.rhs)
    return Declared(model.symbols, rates, {FORCE: key("bias.cart")}, outputs)


def beyond_stroke(flat: Mapping[str, Any], deflections: np.ndarray) -> np.ndarray:
    """Return where joint deflections [m] exceed the stroke of a free joint, in their shape."""
    free = "joint.stroke" in flat and not flat["joint.locked"]
    return deflections > flat["joint.stroke"] if free else np.zeros(np.shape(deflections), bool)


DEFAULT_AMPLITUDES = np.geomspace(1e-9, 1.0, 181)
"""Default amplitudes [m] of the grid."""

DEFAULT_FREQUENCIES = np.geomspace(1e-4, 1e3, 281)
"""Default frequencies [Hz] of the grid."""


TURN, PARTS_BETWEEN = np.pi / 2, 16
"""Largest turn [rad] of the loop between neighbouring frequencies, and number of parts in which the loop is examined
between them."""


@dataclass(frozen=True)
class Balance:
    """Result of a single-harmonic balance.

    `amplitudes` [m] and `frequencies` [Hz] are the solutions, with the remaining `residuals`, all of shape
    (solutions,); empty without a cycle. `least` is the smallest residual of the grid, at the amplitude
    `least_amplitude` [m] of the cart and `least_frequency` [Hz]. A residual is abs(N - 1/R) over abs(N) + abs(1/R): 0
    for a solution, and at most 1.

    The grid has no other cycle, except possibly in two kinds of cell: friction was not found at a corner of `unknown`
    cells, and in `unsolved` cells the balance turns around zero without a solution found.
    """

    amplitudes: np.ndarray
    frequencies: np.ndarray
    residuals: np.ndarray
    least: float
    least_amplitude: float
    least_frequency: float
    unknown: int
    unsolved: int


BALANCE_RESIDUAL = 1e-6
"""Relative residual of a solution, the accuracy of the describing functions."""


def single_harmonic(
    stage: Stage,
    amplitudes: Sequence[float] | np.ndarray = DEFAULT_AMPLITUDES,
    frequencies: Sequence[float] | np.ndarray = DEFAULT_FREQUENCIES,
    rtol: float = IMPOSED_RTOL,
) -> Balance:
    """Solve the single-harmonic balance of a stage with friction on a grid.

    The grid has amplitudes [m] of the cart and frequencies [Hz], each ascending. More frequencies are added where the
    loop turns by a right angle or more from one to the next. Two solutions in one cell are missed. Raises InputError
    for a stage without friction and for a grid that is not usable.
    """
    loop = _Loop(stage, checked_rtol(rtol))
    sizes = checked_positive("amplitudes", amplitudes, "1e-5 m, 1e-4 m")
    rates = loop.refined(checked_positive("frequencies", frequencies, "0.1 Hz, 1 Hz"))
    axes, shape = (np.log(sizes), np.log(rates)), (len(sizes), len(rates))
    logs = np.stack([np.repeat(axes[0], shape[1]), np.tile(axes[1], shape[0])])
    left, residual = (part.reshape(shape) for part in loop.left(logs))
    turns, unknown = _turns(left)
    cells = np.argwhere(turns != 0)
    middles = np.stack([(axis[cell] + axis[cell + 1]) / 2 for axis, cell in zip(axes, cells.T, strict=True)])
    solutions = loop.polished(middles)
    error = loop.left(solutions)[1]
    good = (error < BALANCE_RESIDUAL) & _near(axes, cells, solutions)
    i, j = np.unravel_index(np.argmin(np.where(np.isnan(residual), np.inf, residual)), shape)
    least = (float(residual[i, j]), float(sizes[i]), float(rates[j]))
    solutions, error = solutions[:, good], error[good]
    return Balance(np.exp(solutions[0]), np.exp(solutions[1]), error, *least, int(unknown.sum()), int((~good).sum()))


def _turns(left: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return how often a complex function turns round zero along the edges of each cell.

    `left` has its values on a grid. The count is that of the zeros inside a cell; a zero about which the function turns
    the other way counts -1. The second result marks cells for which the count is unknown, because a corner is NaN; the
    first is 0 there.
    """
    along = np.angle(left[1:] * np.conj(left[:-1]))
    across = np.angle(left[:, 1:] * np.conj(left[:, :-1]))
    turns = (along[:, :-1] + across[1:] - along[:, 1:] - across[:-1]) / (2 * np.pi)
    unknown = ~np.isfinite(turns)
    return np.rint(np.where(unknown, 0.0, turns)).astype(int), unknown


def _near(axes: tuple[np.ndarray, np.ndarray], cells: np.ndarray, solutions: np.ndarray) -> np.ndarray:
    """Return which solutions (2, count) lie in or next to their cells (count, 2).

    `axes` are the values along both sides of the grid.
    """
    near = np.ones(len(cells), bool)
    for axis, cell, place in zip(axes, cells.T, solutions, strict=True):
        low, high = axis[np.maximum(cell - 1, 0)], axis[np.minimum(cell + 2, len(axis) - 1)]
        near &= (low <= place) & (place <= high)
    return near


GRID_HALVINGS = 12
"""Halvings of the grid. A resonance that needs more has no damping."""

BALANCE_NEWTON_STEPS = 20
"""Newton steps after which a balance does not converge."""

LOGARITHM_NUDGE = 1e-5
"""Step in the logarithms of amplitude and frequency for numerical derivatives. Smaller steps drown in the error of
the describing function."""

LONGEST_LOG_STEP = 1.0
"""Longest Newton step in the logarithms. A longer one jumps to another solution."""


@dataclass(frozen=True)
class _Loop:
    """Both sides of the balance, 1/R and N, as functions of log amplitude and log frequency.

    The arguments have the shape (2, count).
    """

    stage: Stage
    rtol: float

    def left(self, logs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return N - 1/R [N/m], complex, and its residual (see `Balance`), both of shape (count,)."""
        amplitudes, frequencies = np.exp(logs)
        flat = self.stage.flat()
        stiffness = dynamic_stiffness(flat, amplitudes, frequencies, self.rtol)
        loop = 1 / receptance(flat, frequencies)[0]
        return stiffness - loop, np.abs(stiffness - loop) / (np.abs(stiffness) + np.abs(loop))

    def refined(self, frequencies: np.ndarray) -> np.ndarray:
        """Return ascending frequencies [Hz], (n,), with more inserted where the loop turns by TURN."""
        for _ in range(GRID_HALVINGS):
            logs, share = np.log(frequencies), np.linspace(0, 1, PARTS_BETWEEN + 1)
            dense = np.exp(logs[:-1, None] + np.diff(logs)[:, None] * share)
            answer = receptance(self.stage.flat(), dense.ravel())[0].reshape(dense.shape)
            turned = np.sum(np.abs(np.angle(answer[:, 1:] / answer[:, :-1])), axis=1)
            wide = np.flatnonzero(turned >= TURN)
            if not wide.size:
                break
            frequencies = np.insert(frequencies, wide + 1, np.exp((logs[wide] + logs[wide + 1]) / 2))
        return frequencies

    def polished(self, logs: np.ndarray) -> np.ndarray:
        """Return solutions by Newton's method from nearby starts, both (2, count).

        A start stays where no step can be computed.
        """
        for _ in range(BALANCE_NEWTON_STEPS if logs.size else 0):
            sides = [
                self.left(logs + LOGARITHM_NUDGE * step[:, None])[0] for step in np.vstack([np.eye(2), -np.eye(2)])
            ]
            slopes = np.array([(sides[k] - sides[k + 2]) / (2 * LOGARITHM_NUDGE) for k in range(2)])
            matrix = np.moveaxis(np.array([np.real(slopes), np.imag(slopes)]), 2, 0)
            left = self.left(logs)[0]
            usable = np.isfinite(left) & np.all(np.isfinite(slopes), axis=0)
            matrix[~usable] = np.eye(2)
            usable &= np.linalg.det(matrix) != 0
            matrix[~usable] = np.eye(2)
            step = np.linalg.solve(matrix, np.stack([np.real(left), np.imag(left)], axis=1)[:, :, None])[:, :, 0].T
            logs = logs - np.where(usable, np.clip(step, -LONGEST_LOG_STEP, LONGEST_LOG_STEP), 0.0)
        return logs
