"""Fit one friction law to records: mass, steady friction, bristles and the shape of the law before sliding.

A record is a log as a body dragged along the measured motion, on which a law exerts its friction.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from friso.engine.driven import Inputs, run_driven
from friso.engine.kernel import kernel
from friso.equations.dragged import Dragged
from friso.equations.friction.measured import MeasuredFriction
from friso.identification.laws.settings import settings
from friso.identification.logs.log import Log
from friso.identification.readings.at_bearing import Between, LowPass, at_bearing, cutoff_of, record_of, why_unseen
from friso.stage.tables import friction_law

FAR = {"mass": 3.0, "coulomb": 30.0, "gap": 100.0, "stribeck_velocity": 100.0, "viscous": 100.0, "stiffness": 30.0,
       "damping": 100.0}  # fmt: skip
"""Largest factor by which a fitted number may differ from its prior value. Every law has these numbers."""


@dataclass(frozen=True)
class LawFit:
    """A law fitted to records: mass [kg], keys of the law [SI], and the fitted logarithms."""

    law: str
    mass: float
    keys: Mapping[str, float]
    numbers: np.ndarray


@dataclass(frozen=True)
class LawProblem:
    """A law to be fitted to records, with the mass [kg] and friction assumed before the fit.

    The Stribeck exponent is not fitted.
    """

    law: str
    mass: float
    before: MeasuredFriction
    records: Sequence[DraggedRecord]

    @property
    def names(self) -> list[str]:
        """Return the names of the fitted numbers, each of which is a logarithm."""
        return [*FAR, *friction_law(self.law).shape]

    @property
    def start(self) -> np.ndarray:
        """Return the fitted numbers (logarithms) as assumed before the fit, shape (parameters,)."""
        levels, before = self.before.levels, self.before
        speed = levels.static / levels.stribeck_velocity
        beforehand = {
            "mass": self.mass,
            "coulomb": levels.coulomb,
            "gap": max(levels.static - levels.coulomb, settings.share_of_a_first_value * levels.static),
            "stribeck_velocity": levels.stribeck_velocity,
            "viscous": max(levels.viscous, settings.share_of_a_first_value * speed),
            "stiffness": before.stiffness,
            "damping": max(before.damping, settings.share_of_a_first_value * np.sqrt(before.stiffness * self.mass)),
        }
        shape = [start for _, start, _ in friction_law(self.law).shape.values()]
        return np.log([*(beforehand[name] for name in FAR), *shape])

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Return lower and upper bounds of the fitted numbers, each of shape (parameters,)."""
        far, shape = np.log(list(FAR.values())), friction_law(self.law).shape.values()
        centre = self.start[: len(far)]
        low, high = ([np.log(limits[end]) for limits in shape] for end in (0, 2))
        return np.concatenate([centre - far, low]), np.concatenate([centre + far, high])

    def keys(self, numbers: np.ndarray) -> dict[str, float]:
        """Return the keys of the law [SI] that belong to fitted numbers, shape (parameters,)."""
        value = dict(zip(self.names, np.exp(numbers), strict=True))
        static = value["coulomb"] + value["gap"]
        shown = {name: value[name] for name in ("coulomb", "stribeck_velocity", "viscous")}
        levels = replace(self.before.levels, static=static, **shown)
        measured = MeasuredFriction(levels, value["stiffness"], value["damping"], np.zeros(1), np.zeros(1))
        law = friction_law(self.law)
        return law.shaped(measured, {name: value[name] for name in law.shape})

    def errors(self, rows: np.ndarray) -> list[np.ndarray]:
        """Return each record's residual force [N], minus its mean, as an array of shape (rows, m).

        Each row of `rows`, shape (rows, parameters), has fitted numbers. Residuals of a failed run are infinite.
        """
        columns = [self.keys(row) for row in rows]
        flat = {key: np.array([keys[key] for keys in columns]) for key in columns[0]}
        # numbers that select the equations are equal in all rows
        flat |= {key: value[0] for key, value in flat.items() if key in friction_law(self.law).decisive}
        left = []
        for record in self.records:
            friction = record.friction({**flat, "friction.model": self.law}, len(rows))
            rest = record.force - np.exp(rows[:, :1]) * record.acceleration - friction
            rest -= rest.mean(axis=1, keepdims=True)
            left.append(np.where(np.isfinite(rest), rest, np.inf))
        return left

    def fitted(self, used: Sequence[np.ndarray], starts: np.ndarray) -> LawFit:
        """Fit the law to the `used` samples of each record, from the best of some starts.

        The starts have the shape (starts, parameters), and `used` has a mask of shape (m,) for each record.
        """
        weights = [
            mask / np.sqrt(max(int(mask.sum()), 1)) / record.force.std()
            for mask, record in zip(used, self.records, strict=True)
        ]
        step = settings.step_of_a_logarithm
        rows: dict[bytes, np.ndarray] = {}  # residual and derivatives from runs side by side

        def at(numbers: np.ndarray) -> np.ndarray:
            if numbers.tobytes() not in rows:
                rows.clear()
                moved = numbers + step * np.eye(len(numbers))
                rows[numbers.tobytes()] = self._weighed(np.vstack([numbers, moved]), weights)
            return rows[numbers.tobytes()]

        def jacobian(numbers: np.ndarray) -> np.ndarray:
            here = at(numbers)
            return (here[1:] - here[0]).T / step

        low, high = self.bounds
        starts = np.clip(starts, low + 2 * step, high - 2 * step)
        first = starts[np.argmin(np.sum(self._weighed(starts, weights) ** 2, axis=1))]
        tolerance = settings.tolerance_of_a_fit
        options: dict[str, Any] = {"bounds": (low, high), "xtol": tolerance, "ftol": tolerance, "jac": jacobian}
        residual, most = (lambda numbers: at(numbers)[0]), settings.evaluations_of_a_fit
        best = least_squares(residual, first, max_nfev=most, **options).x
        return LawFit(self.law, float(np.exp(best[0])), self.keys(best), best)

    def everywhere(self) -> np.ndarray:
        """Return starts of the fit, (starts, parameters), with softer and stiffer bristles.

        All other numbers are the prior ones.
        """
        starts = np.tile(self.start, (len(settings.stiffness_factors), 1))
        starts[:, self.names.index("stiffness")] += np.log(settings.stiffness_factors)
        return starts

    def _weighed(self, rows: np.ndarray, weights: Sequence[np.ndarray]) -> np.ndarray:
        """Return weighted residuals of all records side by side, shape (rows, samples).

        `weights` has one array of shape (m,) per record. Residuals of a failed run are large but finite.
        """
        with np.errstate(invalid="ignore"):  # a failed run may be infinite where its weight is 0
            parts = [left * weight for left, weight in zip(self.errors(rows), weights, strict=True)]
        failed = settings.residual_of_a_failed_run
        return np.nan_to_num(np.hstack(parts), nan=failed, posinf=failed, neginf=-failed)


@dataclass(frozen=True)
class DraggedRecord:
    """A log as a body dragged along the measured motion.

    Over `time` [s] the record has the position [m] of the body on the bearing, shape (n,). Force [N], after the drive's
    delay, and acceleration [m/s^2] of the whole moving mass are low-passed, and left out at the ends: shape (m,).
    """

    name: str
    position: np.ndarray
    low_pass: LowPass
    force: np.ndarray
    acceleration: np.ndarray

    @property
    def interval(self) -> float:
        """Return the time between samples [s]."""
        return float(self.low_pass.time[1] - self.low_pass.time[0])

    def friction(self, flat: Mapping[str, Any], runs: int) -> np.ndarray:
        """Return the low-passed friction force [N] of several laws along the record, (runs, m).

        The laws are of one kind, and differ in their numbers: `flat` has their keys with numbers or arrays of shape
        (runs,). Failed runs are NaN. The bristles start unbent.
        """
        law = flat["friction.model"]
        first = {key: value[0] if np.ndim(value) else value for key, value in flat.items()}
        shape = kernel(Dragged(law, friction_law(law).variant(first)))
        inputs = Inputs(self.position, np.zeros(len(self.position)), self.interval)
        starts = np.zeros((runs, shape.initial_size))
        starts[:, shape.position] = self.position[0]
        starts[:, shape.velocity] = inputs.velocity[0]  # a record may begin in motion
        forces = np.full((runs, len(self.force)), np.nan)
        timed = {**flat, "motion.duration": 1.0}
        for part in run_driven(shape, timed, runs, inputs, starts, settings.tolerance_of_dragging):
            impulse = part.states[:, :, -1]
            mean = np.diff(impulse, axis=1) / self.interval
            middle = np.pad((mean[:, 1:] + mean[:, :-1]) / 2, ((0, 0), (1, 1)), mode="edge")
            done = np.isfinite(middle).all(axis=1)
            forces[part.numbers[done]] = [self.low_pass(row) for row in middle[done]]
        return forces


def dragged_record(log: Log, between: Between) -> DraggedRecord | str:
    """Read the longest stretch of a log, or return why it cannot be read.

    Raises InputError for missing channels.
    """
    whole = record_of(log, log.longest, between)
    if why := why_unseen(whole, settings.samples_of_a_dragged_record):
        return why
    cutoff = cutoff_of(whole)
    every = max(int(1 / (settings.samples_of_a_dragged_period * cutoff * whole.interval)), 1)
    record = whole.seen(settings.band_of_the_motion * cutoff, every).beginning(settings.most_samples_of_a_record)
    low_pass = LowPass(record.time, cutoff)
    body, force, acceleration = at_bearing(record, between, between.mass)
    return DraggedRecord(log.name, body, low_pass, low_pass(force), low_pass(acceleration))


def blocks(records: Sequence[DraggedRecord], pieces: int) -> list[list[np.ndarray]]:
    """Divide the records into the parts that are left out of a fit in turn.

    Each part is a list with one mask of shape (m,) per record. With at least `pieces` records, each record is a part;
    otherwise each is cut into equally many pieces in time.
    """
    cuts = -(-pieces // len(records))
    parts = []
    for out in records:
        piece = np.arange(len(out.force)) * cuts // len(out.force)
        parts += [[(piece == k) if r is out else np.zeros(len(r.force), bool) for r in records] for k in range(cuts)]
    return parts
