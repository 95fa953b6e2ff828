"""Whether the constant force or friction of a record changes while it is taken, and how far that moves the fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from friso.identification.inverse_model import InverseModel
from friso.identification.output_error.fit import ALIKE, OutputErrorFit
from friso.identification.spread import correlation_length
from friso.intervals import COVERAGE

CREEPING = 0.01
"""Share of the highest speed up to which friction is not counted as that of one direction."""

SMALL = 0.05
"""Share of Coulomb friction by which the force is changed for its effect on the record."""

SURE = 0.999
"""Probability of a change that is taken for one."""

WORTH_TELLING = 0.1
"""Share of Coulomb friction by which something has to change to be named."""


@dataclass(frozen=True)
class RecordDrift:
    """How far the fitted numbers would move, shape (free,), if constant force and friction were free to change along
    the record; the change of either over it [N], and how far it comes from its mean over the record, its reach [N]."""

    moved: np.ndarray
    friction: float
    constant: float
    friction_reach: float
    constant_reach: float

    def sentences(self, coulomb: float, unit: str) -> list[str]:
        """What changes, where that is much beside Coulomb friction [N]; `unit` is that of the force."""
        return [
            f"{what} changes by {size:.2g} {unit} during the record ({cause}): intervals reach from its least to its "
            "largest"
            for what, size, cause in (
                ("Friction", self.friction, "warming up?"),
                ("The constant force", self.constant, "a drift of the force?"),
            )
            if size > WORTH_TELLING * coulomb
        ]


def drift_of_friction(fit: OutputErrorFit, velocity: np.ndarray) -> RecordDrift | None:
    """What changes during a record, of the smooth `velocity` [m/s], shape (n,); None where nothing clearly does.

    Constant force and friction may follow a line each over either half of the record. They are fitted together with
    the parameters, about the fit.
    """
    problem = fit.problem
    if "friction.coulomb" not in [parameter.name for parameter in problem.parameters]:
        return None
    rest, slopes = fit.linearised()
    way = np.clip(velocity / (CREEPING * np.abs(velocity).max()), -1.0, 1.0)
    unit = SMALL * fit.value("friction.coulomb")
    bends = _bends(np.linspace(0.0, 1.0, len(rest)), problem.counted)
    forces = [base * bend for base in (-way, np.ones(len(way))) for bend in bends]
    effects = [effect_of(unit * force, fit, rest) / unit for force in forces]
    return _fitted(slopes, rest, effects, bends, problem.counted)


def changes_beside(inverse: InverseModel) -> RecordDrift | None:
    """The same for an inverse model of one friction for both directions."""
    share = (inverse.time - inverse.time[0]) / np.ptp(inverse.time)
    counted = np.ones(len(share))
    sign, ones = inverse.columns[:, 2], counted
    bends = _bends(share, counted)
    effects = [-base * bend for base in (sign, ones) for bend in bends]
    return _fitted(-inverse.columns, inverse.measured - inverse.fitted, effects, bends, counted)


def _fitted(
    slopes: np.ndarray, rest: np.ndarray, effects: list[np.ndarray], bends: list[np.ndarray], counted: np.ndarray
) -> RecordDrift | None:
    """Least squares of a residual, shape (n,), on its derivatives to fitted numbers, shape (n, numbers), and to changes
    of friction and of constant force by the same `bends`, each of shape (n,)."""
    explained = explained_by(slopes, rest, effects, counted)
    if explained is None:
        return None
    moved, levels = explained
    friction, constant = (part @ np.stack(bends) for part in np.split(levels, 2))
    reaches = (float(np.abs(line).max()) for line in (friction, constant))
    return RecordDrift(moved, float(np.ptp(friction)), float(np.ptp(constant)), *reaches)


def explained_by(
    slopes: np.ndarray, rest: np.ndarray, effects: Sequence[np.ndarray], counted: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """How far fitted numbers move, and the sizes of further effects beside them, that explain a residual, shape (n,);
    derivatives of shape (n, numbers), effects and weights `counted` of shape (n,). A number that changes nothing, or of
    which nothing finite is known, does not move. None where the effects clearly explain nothing."""
    every = np.column_stack([slopes, *effects])
    size = np.linalg.norm(every, axis=0)
    usable = np.isfinite(size) & (size > 0)
    if not (usable[slopes.shape[1] :].all() and np.isfinite(rest).all()):
        return None
    solution = np.zeros(len(size))
    scaled = every[:, usable] / size[usable]
    solution[usable] = np.linalg.lstsq(scaled, -rest, rcond=ALIKE)[0] / size[usable]
    left = rest + every[:, usable] @ solution[usable]
    independent = max(float(counted.sum()), 1.0) / correlation_length(left)
    if rest @ rest <= left @ left * (1 + chi2.ppf(SURE, len(effects)) / independent):
        return None
    moved, sizes = np.split(solution, [slopes.shape[1]])
    return moved, sizes


def reaching(fit: OutputErrorFit, changes: RecordDrift) -> OutputErrorFit:
    """The fit with deviations that reach as far as what changes would move it, and over the change itself."""
    free = [fit.problem.parameters[i] for i in fit.free]
    further = np.abs(changes.moved)
    for i, parameter in enumerate(free):
        if parameter.name == "friction.coulomb":
            further[i] += changes.friction_reach / fit.value(parameter.name)
        elif parameter.name.startswith("bias."):
            further[i] += changes.constant_reach
    return reaching_over(fit, further)


def reaching_over(fit: OutputErrorFit, further: np.ndarray) -> OutputErrorFit:
    """The fit with deviations whose intervals reach `further`, shape (free,), each way."""
    deviation = np.sqrt(np.diag(fit.covariance))
    usable = np.isfinite(deviation) & (deviation > 0)
    wider = np.divide(further, COVERAGE * deviation, out=np.zeros_like(further), where=usable) + 1
    return replace(fit, covariance=fit.covariance * np.outer(wider, wider))


def inverse_reaching(inverse: InverseModel, changes: RecordDrift) -> InverseModel:
    """The inverse model with intervals that reach as far."""
    over = {"coulomb": changes.friction_reach, "offset": changes.constant_reach}
    answers = []
    for estimate, moved in zip(inverse.estimates, np.abs(changes.moved), strict=True):
        further = moved + over.get(estimate.name, 0.0) if estimate.determined else 0.0
        answers.append(replace(estimate, low=estimate.low - further, high=estimate.high + further))
    return replace(inverse, estimates=tuple(answers))


def _bends(share: np.ndarray, counted: np.ndarray) -> list[np.ndarray]:
    """What is 1 in the middle of a record, and what is 1 at its end, lines in between, less their means, at shares of
    its time, shape (n,)."""
    shapes = 1 - np.abs(2 * share - 1), np.maximum(2 * share - 1, 0.0)
    return [shape - np.average(shape, weights=counted) for shape in shapes]


def effect_of(force: np.ndarray, fit: OutputErrorFit, rest: np.ndarray) -> np.ndarray:
    """What a further force [N] on the stage changes of the residual of a fit, `rest`; each of shape (n,)."""
    inputs = fit.problem.inputs
    return replace(fit.problem, inputs=replace(inputs, force=inputs.force + force)).residuals(fit.inner[None])[0] - rest
