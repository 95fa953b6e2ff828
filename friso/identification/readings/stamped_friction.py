"""Mass and friction from motion and force at uneven instants, by regression on local polynomials."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from friso.errors import InputError
from friso.identification.estimate import Estimate
from friso.identification.inverse_model import unit_of
from friso.identification.logs.checks import runs
from friso.identification.logs.log import Log
from friso.identification.readings.common import channel
from friso.identification.readings.settings import settings
from friso.identification.spread import spread_of

METHOD = "least squares on local polynomials at the stamps"
_NAMES = (("mass", "kg"), ("friction.viscous", "N*s/m"), ("friction.coulomb", "N"), ("bias.cart", "N"))
"""Names and units of the fitted numbers, in their order."""
_ONE_WAY = "the motion is in one direction only, in which a constant force passes for friction"


@dataclass(frozen=True)
class StampedFriction:
    """Mass and friction from a log without an even clock.

    `estimates` have intervals, and `correlation` is that of those determined. `velocity` [m/s] and `friction` [N], the
    force less inertia, have the shape (rows,); `fitted` [N] is the curve there. Polynomials reach over `width` samples,
    and samples are `steps` [s] apart: the least, the usual, and the largest step without gaps.
    """

    log: Log
    estimates: tuple[Estimate, ...]
    correlation: np.ndarray
    velocity: np.ndarray
    friction: np.ndarray
    fitted: np.ndarray
    width: int
    steps: tuple[float, float, float]

    @property
    def by_name(self) -> Mapping[str, Estimate]:
        """Return the estimates by name."""
        return {estimate.name: estimate for estimate in self.estimates}


@dataclass(frozen=True)
class _StampedFit:
    """A fit with polynomials over some samples: rows, their solution and its covariance."""

    width: int
    columns: np.ndarray
    force: np.ndarray
    solution: np.ndarray
    covariance: np.ndarray

    @property
    def deviations(self) -> np.ndarray:
        """Return the standard deviation of each fitted number."""
        return np.sqrt(np.diag(self.covariance))


def local_polynomials(time: np.ndarray, values: np.ndarray, degree: int, width: int) -> np.ndarray:
    """Fit a polynomial around each instant [s], and return its value, slope and curvature there, shape (3, n).

    A polynomial of the `degree` is fitted to `width` samples, an odd number. The ends, without enough samples, are NaN.
    """
    out, half = np.full((3, len(time)), np.nan), width // 2
    if len(time) < width:
        return out
    times, held = (np.lib.stride_tricks.sliding_window_view(array, width) for array in (time, values))
    apart = times - time[half : len(time) - half, None]
    scale = np.abs(apart).max(axis=1)
    powers = (apart / scale[:, None])[..., None] ** np.arange(degree + 1)
    solution = (np.linalg.pinv(powers) @ held[..., None])[..., 0]
    for order, factor in enumerate((1.0, 1.0, 2.0)):
        out[order, half : len(time) - half] = factor * solution[:, order] / scale**order
    return out


def stamped_friction(log: Log) -> StampedFriction:
    """Identify mass, Coulomb and viscous friction from a log with a force and a velocity or position.

    Of several widths of the polynomials the one counts whose error is least: chance, together with the difference to
    the next narrower one. Raises InputError for a log with too little steady sliding.
    """
    fits = [fit for width in settings.widths_of_polynomials if (fit := _fit(log, width)) is not None]
    if not fits:
        least = settings.rows_of_a_stamped_fit
        expected = f"{least} samples or more within moves: faster sampling, or longer moves"
        raise InputError("position", f"{len(log.time)} samples, of which fewer slide", expected, "", log.name)
    apart = [np.abs(fit.solution - other.solution) for fit, other in zip(fits, [fits[0], *fits], strict=False)]
    apart[0] = apart[1] if len(fits) > 1 else np.zeros(4)
    relative = [(fit.deviations[0] + away[0]) / abs(fit.solution[0]) for fit, away in zip(fits, apart, strict=True)]
    best = int(np.argmin(relative))
    fit, away = fits[best], apart[best]
    steps = np.diff(log.time)
    usual = float(np.median(steps))
    regular = steps[steps <= settings.steps_of_a_hole * usual]
    estimates, correlation = _estimates(log, fit, away)
    curve = fit.columns[:, 1:] @ fit.solution[1:]
    velocity, inertia = fit.columns[:, 1], fit.columns[:, 0] * fit.solution[0]
    shown = (float(steps.min()), usual, float(regular.max()))
    return StampedFriction(log, estimates, correlation, velocity, fit.force - inertia, curve, fit.width, shown)


def _estimates(log: Log, fit: _StampedFit, away: np.ndarray) -> tuple[tuple[Estimate, ...], np.ndarray]:
    """Return the estimates of a fit, and the correlation of those with a value.

    The fitted numbers are `away` from those with narrower polynomials.
    """
    size, both = fit.deviations, len(np.unique(np.sign(fit.columns[:, 1]))) == 2
    estimates = []
    for i, (name, unit) in enumerate(_NAMES):
        unit = unit_of(unit, log)
        if not both and i > 1:
            estimates.append(Estimate.unknown(name, unit, METHOD, _ONE_WAY))
            continue
        one = Estimate.normal(name, unit, fit.solution[i], size[i], METHOD).widened(float(away[i]))
        estimates.append(one if i > 2 else one.if_positive("its interval reaches down to zero"))
    kept = [i for i, estimate in enumerate(estimates) if estimate.determined]
    return tuple(estimates), fit.covariance[np.ix_(kept, kept)] / np.outer(size[kept], size[kept])


def _fit(log: Log, width: int) -> _StampedFit | None:
    """Fit force = M a + F_v v + F_c sign(v) + offset within moves, with polynomials over `width` samples.

    The result is None if too few polynomials lie within moves in one direction and without holes.
    """
    time, force = log.time, channel(log, "force")
    smooth = local_polynomials(time, force, settings.degree_of_polynomials, width)[0]
    if "velocity" in log:
        velocity, acceleration, _ = local_polynomials(time, log["velocity"], settings.degree_of_polynomials, width)
    else:
        place = channel(log, "position")
        _, velocity, acceleration = local_polynomials(time, place, settings.degree_of_polynomials + 1, width)
    speed = np.abs(velocity)
    direction = np.sign(velocity) * (speed > settings.speed_share_of_stamped_sliding * np.nanmax(speed, initial=0.0))
    whole = np.append(np.diff(time) <= settings.steps_of_a_hole * np.median(np.diff(time)), False)
    groups, rows, half = np.zeros(len(time), int), np.zeros(len(time), bool), width // 2
    number = 0
    for sign in (-1.0, 1.0):
        for part in runs(direction == sign):
            for piece in runs(np.append(whole[part.start : part.stop - 1], False)) or []:
                first, last = part.start + piece.start + half, part.start + piece.stop + 1 - half
                rows[first:last], number = True, number + 1
                groups[first:last] = number
    if np.count_nonzero(rows) < settings.rows_of_a_stamped_fit:
        return None
    columns = np.stack([acceleration, velocity, np.sign(velocity), np.ones_like(velocity)], axis=1)[rows]
    if len(np.unique(np.sign(velocity[rows]))) == 1:
        columns[:, 3] = 0.0  # motion in one direction only adds a constant force to Coulomb friction
    scale = np.maximum(np.linalg.norm(columns, axis=0), np.finfo(float).tiny)
    solution = np.linalg.lstsq(columns / scale, smooth[rows], rcond=1e-10)[0] / scale
    covariance = spread_of(columns, smooth[rows] - columns @ solution, (groups[rows],))
    return _StampedFit(width, columns, smooth[rows], solution, covariance)
