"""Estimate how far a force that the model leaves out would move a fit, by one linear step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2, norm

from friso.identification.output_error.fit import OutputErrorFit, spread_along
from friso.identification.output_error.settings import settings
from friso.identification.spread import correlation_length
from friso.intervals import NORMAL_COVERAGE


@dataclass(frozen=True)
class ExplainedResidual:
    """What additional forces, which the model leaves out, explain of a fit's residual.

    `moved`, shape (free,), is the shift of the fitted numbers. `sizes`, shape (forces,), are the fitted sizes of the
    forces, and `left` is the fraction of the residual's power that remains. `rest` [N], shape (n,), is the remaining
    residual, and `slopes`, shape (n, numbers + forces), its derivatives by numbers and sizes.
    """

    moved: np.ndarray
    sizes: np.ndarray
    left: float
    rest: np.ndarray
    slopes: np.ndarray

    def sure(self, fit: OutputErrorFit) -> np.ndarray:
        """Tell for each additional force, shape (forces,), whether it is present: its size is not 0 within its error.

        The error allows for residuals that repeat at every reversal. With a slow sine, a coupling or a delay cannot
        then be told from slightly different friction.
        """
        size = np.linalg.norm(self.slopes, axis=0)
        usable = np.isfinite(size) & (size > 0)
        covariance = spread_along(fit.problem, self.slopes[:, usable], self.rest)
        chance = 1 - settings.probability_of_an_effect
        deviations = np.sqrt(np.diag(covariance)[-len(self.sizes) :])
        return np.abs(self.sizes) > norm.isf(chance / 2) * deviations


def explained_by_forces(
    fit: OutputErrorFit, forces: Sequence[np.ndarray], units: Sequence[float], searched: int = 1
) -> ExplainedResidual | None:
    """Fit additional forces to the residual of a fit, while its parameters may change, too.

    A force [N], shape (n,), is that of an effect of size 1. It is simulated at its size in `units`, small enough to be
    linear. Returns None if the forces explain no more than the best of `searched` random ones.
    """
    rest, slopes = fit.linearised
    return explained_by(slopes, rest, effects_of(forces, units, fit), fit.problem.counted, searched)


def explained_by(
    slopes: np.ndarray, rest: np.ndarray, effects: Sequence[np.ndarray], counted: np.ndarray, searched: int = 1
) -> ExplainedResidual | None:
    """Explain a residual, shape (n,), by changes of the fitted numbers and additional effects.

    `slopes` are the derivatives by the numbers, (n, numbers). Each of the `effects`, and the weights `counted` of the
    samples, has the shape (n,). A number without effect, or with infinite derivatives, does not move. Returns None if
    the effects explain no more than the best of `searched` random ones.
    """
    every = np.column_stack([slopes, *effects])
    size = np.linalg.norm(every, axis=0)
    usable = np.isfinite(size) & (size > 0)
    if not (usable[slopes.shape[1] :].all() and np.isfinite(rest).all()):
        return None
    solution = np.zeros(len(size))
    scaled, smallest = every[:, usable] / size[usable], settings.smallest_singular_value**2
    solution[usable] = np.linalg.lstsq(scaled.T @ scaled, -rest @ scaled, rcond=smallest)[0] / size[usable]
    left = rest + every[:, usable] @ solution[usable]
    independent = max(float(counted.sum()), 1.0) / correlation_length(left)
    chance = chi2.isf((1 - settings.probability_of_an_effect) / searched, len(effects))
    if rest @ rest <= left @ left * (1 + chance / independent):
        return None
    moved, sizes = np.split(solution, [slopes.shape[1]])
    return ExplainedResidual(moved, sizes, float(left @ left) / float(rest @ rest), left, every)


def is_sure_beside_all(fit: OutputErrorFit, forces: Sequence[np.ndarray], units: Sequence[float]) -> bool:
    """Tell whether a residual shows the last of some forces even if all parameters may change.

    `forces` [N], shape (n,) each, have size 1; `units` are the sizes at which they are simulated.
    """
    rest, slopes = beside_all_numbers(fit)
    explained = explained_by(slopes, rest, effects_of(forces, units, fit), fit.problem.counted)
    return explained is not None and bool(explained.sure(fit)[-1])


def beside_all_numbers(fit: OutputErrorFit, further: Sequence[np.ndarray] = ()) -> tuple[np.ndarray, np.ndarray]:
    """Return the residual after a linear refit of all parameters and `further` effects, with its derivatives.

    The residual [N] and each of the effects have the shape (n,), the derivatives (n, parameters + effects).

    Parameters that the log does not determine take part: what they explain, such as the Stribeck effect at a reversal,
    is no effect outside the model.
    """
    rest, slopes = fit.problem.linearised(fit.inner, np.ones(len(fit.inner), bool))
    slopes = np.column_stack([slopes, *further])
    size = np.linalg.norm(slopes, axis=0)
    usable = np.isfinite(size) & (size > 0)
    scaled = slopes[:, usable] / size[usable]
    solution = np.linalg.lstsq(scaled, -rest, rcond=settings.smallest_singular_value)[0]
    return rest + scaled @ solution, slopes


def reaching_over(fit: OutputErrorFit, further: np.ndarray) -> OutputErrorFit:
    """Return the fit with intervals extended at both ends by `further`, shape (free,)."""
    return fit.with_deviations(fit.deviation + further / NORMAL_COVERAGE)


def effects_of(forces: Sequence[np.ndarray], units: Sequence[float], fit: OutputErrorFit) -> list[np.ndarray]:
    """Return the change of a fit's residual per unit of each additional force, shape (n,) each.

    A force [N], shape (n,), is that of an effect of size 1, and is simulated at its size in `units`. All forces are
    simulated side by side.
    """
    inputs, (rest, _), sizes = fit.problem.inputs, fit.linearised, np.array(units)[:, None]
    pushed = replace(fit.problem, inputs=replace(inputs, force=inputs.force + sizes * np.array(forces)))
    return [*(pushed.residuals(np.tile(fit.inner, (len(forces), 1))) - rest) / sizes]
