"""Doubt: friction or a constant force changes during the record, by warming up or by drift."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from friso.identification.doubt import Doubt, FitCase, FittedCase, RaisedDoubt, TriedForces, way_of
from friso.identification.inverse_model import InverseModel
from friso.identification.output_error.effects import (
    ExplainedResidual,
    explained_by,
    explained_by_forces,
    reaching_over,
)
from friso.identification.output_error.fit import OutputErrorFit
from friso.identification.settings import doubt_settings


@dataclass(frozen=True)
class RecordDrift:
    """How friction and a constant force change during a record, and what that shifts.

    `moved`, shape (free,), is the shift of the fitted numbers. `friction` and `constant` [N] are the changes over the
    record. `friction_reach` and `constant_reach` [N] are the largest deviations from the mean over the record. The
    changes are not `sure` if each of them may be 0, so that friction and constant force cannot be told apart.
    """

    moved: np.ndarray
    friction: float
    constant: float
    friction_reach: float
    constant_reach: float
    sure: bool = field(default=True, kw_only=True)


def find(case: FitCase) -> Iterator[RaisedDoubt]:
    """Fit changes of friction and of the constant force to the residual force.

    Intervals reach over all changes; sure ones are named.
    """
    inverse, quality = case.inverse, case.quality
    changes = None
    if not quality.failed:
        changes = changes_beside(inverse) if quality.rejected else _changes_of_fit(case.fit, case.velocity)
    if changes is None:
        return
    if quality.rejected:
        yield RaisedDoubt(inverse=inverse_reaching(inverse, changes))
    else:
        yield RaisedDoubt(fit=_reaching(case.fit, changes))
    for what, size, cause in (
        ("Friction", changes.friction, "warming up?"),
        ("The constant force", changes.constant, "a drift of the force?"),
    ):
        if changes.sure and size > doubt_settings.friction_share_of_a_change * case.inverse.value("coulomb"):
            words = f"{what} changes by {size:.2g} {case.unit} during the record ({cause})"
            yield RaisedDoubt(
                words=f"{words}: intervals reach from its least to its largest", size=size, unit=case.unit
            )


def _changes_of_fit(fit: OutputErrorFit, velocity: np.ndarray) -> RecordDrift | None:
    """Return the changes during a record, from its smooth `velocity` [m/s], shape (n,).

    The changes are fitted together with the parameters, starting from the fit. Returns None if nothing clearly changes,
    and for a fit without Coulomb friction.
    """
    if "friction.coulomb" not in fit.problem.names:
        return None
    forces, units, bends = changing_forces(fit, velocity)
    explained = explained_by_forces(fit, forces, units)
    drift = _drift(explained, bends)
    return drift and replace(drift, sure=explained is not None and bool(explained.sure(fit).any()))


def changing_forces(
    fit: OutputErrorFit, velocity: np.ndarray
) -> tuple[list[np.ndarray], list[float], list[np.ndarray]]:
    """Build the forces by which friction and a constant force could change along a record.

    `velocity` [m/s] is the record's. Each force, shape (n,), changes along a straight line in either half of the
    record. Also returns the sizes [N] at which the forces are simulated, and the two shapes of change, (n,) each.
    """
    unit = doubt_settings.friction_share_of_a_tried_force * fit.value("friction.coulomb")
    bends = _bends(np.linspace(0.0, 1.0, len(velocity)), fit.problem.counted)
    forces = [base * bend for base in (-way_of(velocity), np.ones(len(velocity))) for bend in bends]
    return forces, [unit] * len(forces), bends


def changes_beside(inverse: InverseModel) -> RecordDrift | None:
    """Return how friction and constant force change during the record of an inverse model.

    The inverse model has equal friction both ways. Returns None if nothing clearly changes.
    """
    share = (inverse.time - inverse.time[0]) / np.ptp(inverse.time)
    counted = np.ones(len(share))
    bends = _bends(share, counted)
    effects = [-base * bend for base in (inverse.columns[:, 2], counted) for bend in bends]
    return _drift(explained_by(-inverse.columns, inverse.measured - inverse.fitted, effects, counted), bends)


def _bends(share: np.ndarray, counted: np.ndarray) -> list[np.ndarray]:
    """Return two shapes of change along a record, without their means, shape (n,) each.

    `share` is the fraction of the record's time. One shape rises to 1 in the middle and falls again; the other rises to
    1 from the middle to the end. `counted` weights the samples in the means.
    """
    shapes = 1 - np.abs(2 * share - 1), np.maximum(2 * share - 1, 0.0)
    return [shape - np.average(shape, weights=counted) for shape in shapes]


def _drift(explained: ExplainedResidual | None, bends: Sequence[np.ndarray]) -> RecordDrift | None:
    """Compute changes of friction and constant force from the fitted sizes of their shapes.

    `bends` are the shapes, (n,) each. Returns None if the changes explained nothing.
    """
    if explained is None:
        return None
    friction, constant = (part @ np.stack(bends) for part in np.split(explained.sizes, 2))
    reaches = (float(np.abs(line).max()) for line in (friction, constant))
    return RecordDrift(explained.moved, float(np.ptp(friction)), float(np.ptp(constant)), *reaches)


def _reaching(fit: OutputErrorFit, changes: RecordDrift) -> OutputErrorFit:
    """Widen the fit's deviations by a drift of friction and constant force, and what it shifts.

    Coulomb friction and the constant force get their largest drift from the mean. All fitted numbers get the shift that
    the drift causes.
    """
    further = np.abs(changes.moved)
    for i, name in enumerate(fit.fitted):
        if name == "friction.coulomb":
            further[i] += changes.friction_reach / fit.value(name)
        elif name.startswith("bias."):
            further[i] += changes.constant_reach
    return reaching_over(fit, further)


def inverse_reaching(inverse: InverseModel, changes: RecordDrift) -> InverseModel:
    """Widen the inverse model's intervals by changes during the record and the shifts they cause."""
    over = {"coulomb": changes.friction_reach, "offset": changes.constant_reach}
    answers = tuple(
        one.widened(moved + over.get(one.name, 0.0)) if one.determined else one
        for one, moved in zip(inverse.estimates, np.abs(changes.moved), strict=True)
    )
    return replace(inverse, estimates=answers)


def forces(case: FittedCase) -> Iterator[TriedForces]:
    """Yield the forces by which friction and a constant force could change along the record."""
    if "friction.coulomb" in case.fit.problem.names:
        yield TriedForces(*changing_forces(case.fit, case.velocity)[:2])


DOUBT = Doubt(
    "fit",
    find,
    "forces along and against the motion that change with time",
    "intervals reach over the change",
    "the same moves again, after the machine has warmed up",
    after=("delay",),
    forces=forces,
)
