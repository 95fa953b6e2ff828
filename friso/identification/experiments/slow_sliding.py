"""Slow motion that swings, or sticks and slips: Coulomb and static friction, Stribeck velocity.

Where friction falls steeply no controller holds a constant speed, and `friction_velocity` has nothing to read. The
swinging motion itself passes through all slow speeds: LuGre's bristles, dz/dt = v - sigma_0 |v| z / g(v) with g = F_c +
(F_s - F_c) exp(-(v/v_s)^2) (Astrom, Canudas de Wit 2008, doi:10.1109/MCS.2008.929425), follow from the measured motion
without simulating a loop; F_c, F_s and v_s follow from the measured friction force. Mass, stiffness and damping of the
bristles come from other experiments, see `presliding`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from friso.identification.combine import Correlated
from friso.identification.estimate import Estimate, with_interval
from friso.identification.estimate_documents import estimate_document
from friso.identification.kind import TIME, AnalysisSettings, ExperimentKind, Facts, Prior, Source, by_rows
from friso.identification.logs.log import Log
from friso.identification.readings import at_bearing as bearing
from friso.identification.readings.at_bearing import BearingRecord, Between, LowPass
from friso.identification.readings.common import (
    BLOCKS_OF_A_MEAN,
    Mean,
    by_t,
    correlation_of,
    deflections,
    jackknife,
    stribeck_curve,
)
from friso.identification.readings.friction_velocity import LINEARITY_OF_SENSORS
from friso.quantities import percent
from friso.shown.documents import entries
from friso.shown.drawing.figure import BLUE, INK, ORANGE, Axis, Figure, Panel, Series
from friso.stage import Stage

NAMES = ("friction.coulomb", "friction.static", "friction.stribeck_velocity")

UNITS = ("N", "N", "m/s")

METHOD = "LuGre in the motion of slow sliding"

BRISTLES = "mass and bristles are needed: add a log of small motion before sliding, --as presliding"

RIGID = "The structure is assumed rigid, as the stage file has no [parasitic]."

DELAY = "the drive's delay is needed: give it in [drive] of the stage file, --stage"


@dataclass(frozen=True)
class MassOnBristles:
    """Mass and bristles from other experiments.

    Moving mass [kg], stiffness [N/m] and damping [N s/m] of the bristles are pairs: a value and the half-width of its
    interval. `exponent` is that of the Stribeck curve.
    """

    mass: tuple[float, float]
    stiffness: tuple[float, float]
    damping: tuple[float, float]
    exponent: float = 2.0


@dataclass(frozen=True)
class SlowSliding:
    """Friction from slow sliding.

    `estimates` are Coulomb and static friction [N] and Stribeck velocity [m/s], with the `correlation` of shape (3, 3).
    Signals over time [s], shape (n,), are the velocity [m/s] of the body on the bearing, its low-passed friction [N],
    and the model's friction (empty without a model). `unexplained` is the fraction of the friction's standard deviation
    that the model leaves.
    """

    estimates: tuple[Estimate, ...]
    correlation: np.ndarray
    time: np.ndarray
    velocity: np.ndarray
    friction: np.ndarray
    model: np.ndarray
    unexplained: float
    exponent: float = 2.0
    warnings: tuple[str, ...] = ()


STEP_OF_SLIDING = 1e-3
"""Relative step for finite differences in slow sliding. Smaller steps drown in rounding errors."""


@dataclass(frozen=True)
class _Equation:
    """The equation of friction for a record of slow sliding, below one low-pass frequency.

    The record has the moves [m] of the body on the bearing between samples, shape (n - 1,), and its velocity [m/s],
    shape (n,). Low-passed, shape (m,), it has the friction [N] without the viscous part, and its change per second of
    delay. `sizes` are the scales of the fitted numbers: Coulomb friction, excess of static friction, Stribeck velocity,
    constant force, initial force of the bristles.
    """

    low_pass: LowPass
    moves: np.ndarray
    velocity: np.ndarray
    friction: np.ndarray
    late: np.ndarray
    contact: MassOnBristles
    sizes: np.ndarray

    def model(self, p: np.ndarray) -> np.ndarray:
        """Return the low-passed friction [N] of the model, shape (m,).

        The first three fitted numbers `p` are logarithms relative to their `sizes`, the other two are fractions of
        their `sizes`.
        """
        coulomb, more, stribeck, constant, start = np.append(np.exp(p[:3]), p[3:]) * self.sizes
        stiffness, damping = self.contact.stiffness[0], self.contact.damping[0]
        speed = np.abs(self.velocity)
        ends = stribeck_curve(speed, coulomb, coulomb + more, stribeck, self.contact.exponent) / stiffness
        z = deflections(self.moves, (ends[1:] + ends[:-1]) / 2, start / stiffness)
        return self.low_pass(stiffness * z + damping * (self.velocity - speed * z / ends)) + constant

    def residual(self, p: np.ndarray) -> np.ndarray:
        """Return the model's friction minus the measured friction [N], shape (m,)."""
        return self.model(p) - self.friction

    def derivatives(self, p: np.ndarray) -> np.ndarray:
        """Return the derivatives of the residual by the fitted numbers, shape (m, 5)."""
        here, step = self.model(p), STEP_OF_SLIDING
        return np.stack([(self.model(moved) - here) / step for moved in p + step * np.eye(len(p))], axis=1)


SAMPLES_OF_SLOW_SLIDING = 60_000
"""Largest number of samples of slow sliding that are used. More take longer and show no more."""

FEWEST_SAMPLES_OF_SLIDING = 2000
"""Fewest samples of slow sliding. With fewer, the interval is useless."""

LOW_PASS_BELOW_A_MODE = 1 / 3
"""Highest low-pass frequency, relative to the structural mode, which the model lacks."""

STRIBECK_STARTS = (0.2, 0.5)
"""Stribeck velocities from which fits start, relative to the RMS velocity. One start alone may miss the best
fit."""

LOW_PASS_OF_A_CHECK = 0.7
"""Ratio of the low-pass frequencies of the second fit, a check, and the first fit."""


def stribeck_from_slow_sliding(log: Log, between: Between, contact: MassOnBristles | None) -> SlowSliding:
    """Estimate Coulomb and static friction and Stribeck velocity from slow sliding both ways.

    If the log has gaps, the longest stretch is used, up to a number of samples in the settings. A joint is held, or its
    deflection is measured.

    The intervals include the change with a lower low-pass, the intervals of mass, bristles and viscous friction, the
    effect of the best-fitting delay, and the fraction of friction left unexplained; contact, mode and exponent are
    taken as exact. Raises InputError for missing channels.
    """
    first, stop = log.longest.start, log.longest.stop
    part = slice(first, min(stop, first + SAMPLES_OF_SLOW_SLIDING))
    record = bearing.record_of(log, part, between)
    why = bearing.why_unseen(record, FEWEST_SAMPLES_OF_SLIDING)
    why = why or (DELAY if between.delay is None else "")
    if why or contact is None:
        return _nothing(why or BRISTLES)
    cutoff = bearing.cutoff_of(record)
    cutoff = min(cutoff, LOW_PASS_BELOW_A_MODE * between.mode.frequency) if between.mode else cutoff
    sizes = _sizes(record, cutoff)
    equation = _equation(record, between, contact, cutoff, sizes)
    best = _fitted(equation, [np.log([1.0, 0.5, share]) for share in STRIBECK_STARTS])
    jacobian, residual = equation.derivatives(best), equation.residual(best)
    checked = _equation(record, between, contact, LOW_PASS_OF_A_CHECK * cutoff, sizes)
    lower = _fitted(checked, [best])
    shifts = [lower - best, _parameter_change(np.column_stack([jacobian, equation.late]), residual)[:5]]
    for other in _off(between, contact):
        shifts.append(_parameter_change(jacobian, _equation(record, *other, cutoff, sizes).residual(best) - residual))
    left = float(residual.std() / equation.friction.std())
    covariance = jackknife(jacobian, -residual)[:3, :3]
    estimates, correlation = _estimates(best[:3] + np.log(sizes[:3]), covariance, np.array(shifts)[:, :3], left)
    inside = equation.low_pass.inside
    curves = (record.time[inside], equation.low_pass(equation.velocity), equation.friction, equation.model(best), left)
    held = [bearing.HELD] if record.bent is None and between.joint else []
    notes = (*held, *([] if between.mode else [RIGID]))
    return SlowSliding(_estimates_shown(estimates, left, curves[1]), correlation, *curves, contact.exponent, notes)


def _off(between: Between, contact: MassOnBristles) -> list[tuple[Between, MassOnBristles]]:
    """Return copies of the prior values, each with one quantity at its interval's upper end.

    The quantities are mass, stiffness and damping of the bristles, and viscous friction.
    """
    doubted = {key: getattr(contact, key) for key in ("mass", "stiffness", "damping")}
    others = [(between, replace(contact, **{key: (sum(value), value[1])})) for key, value in doubted.items()]
    return [*others, (replace(between, viscous=(sum(between.viscous), between.viscous[1])), contact)]


def _parameter_change(jacobian: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """Return the shift of fitted numbers that a residual, (m,), causes, by derivatives (m, p)."""
    return -np.linalg.lstsq(jacobian, residual, rcond=None)[0]


def _nothing(why: str) -> SlowSliding:
    """Return a result without estimates, for the reason `why`."""
    none = np.empty(0)
    return SlowSliding(_unknown(why), np.eye(3), none, none, none, none, np.nan)


def _unknown(why: str) -> tuple[Estimate, ...]:
    """Return Coulomb friction, static friction and Stribeck velocity as not determined."""
    return tuple(Estimate.unknown(*key, METHOD, why) for key in zip(NAMES, UNITS, strict=True))


def _sizes(record: BearingRecord, cutoff: float) -> np.ndarray:
    """Return the scales of the five fitted numbers, in the order of `_Equation`, shape (5,).

    Forces have the mean size of the record's force [N], below `cutoff` [Hz]; the Stribeck velocity has the RMS velocity
    [m/s].
    """
    level, low_pass = float(np.abs(record.force - record.force.mean()).mean()), LowPass(record.time, cutoff)
    return np.array([level, level, float(low_pass(bearing.rate_of(record.time, record.body)).std()), level, level])


LOW_PASS_OF_SLIDING = 8.0
"""Ratio of the low-pass frequencies of motion and fit in slow sliding. Slips are faster than the fitted force."""


def _equation(
    record: BearingRecord, between: Between, contact: MassOnBristles, cutoff: float, sizes: np.ndarray
) -> _Equation:
    """Set up the equation of friction of a record, with signals low-passed at `cutoff` [Hz].

    `contact` has mass and bristles, and `sizes`, shape (5,), the scales of the fitted numbers.
    """
    seen, low_pass = record.seen(LOW_PASS_OF_SLIDING * cutoff), LowPass(record.time, cutoff)
    body, force, inertia = bearing.at_bearing(seen, between, contact.mass[0])
    velocity = bearing.rate_of(record.time, body)
    friction = force - contact.mass[0] * inertia - between.viscous[0] * velocity
    late = low_pass(bearing.rate_of(record.time, force))
    return _Equation(low_pass, np.diff(body), velocity, low_pass(friction), late, contact, sizes)


SLIDING_BOUNDS = (0.01, 10.0)
"""Bounds of the fitted numbers of slow sliding, relative to RMS velocity and mean friction."""

TOLERANCE_OF_SLIDING = 1e-6
"""Relative change of squares and parameters that ends a fit of slow sliding, far within any interval."""


def _fitted(equation: _Equation, starts: list[np.ndarray]) -> np.ndarray:
    """Return the numbers of the best fit from several starts, shape (5,).

    A start may leave out its last numbers, which then begin at 0.
    """
    least, most = SLIDING_BOUNDS
    low, high = np.array([*np.log([least] * 3), -most, -most]), np.array([*np.log([most] * 3), most, most])
    scale = float(equation.friction.std())
    complete = [np.clip(np.append(start, np.zeros(len(low) - len(start))), low, high) for start in starts]
    off, slopes = (lambda p: equation.residual(p) / scale), (lambda p: equation.derivatives(p) / scale)
    tolerance = TOLERANCE_OF_SLIDING
    options: Any = {"jac": slopes, "bounds": (low, high), "ftol": tolerance, "xtol": tolerance}
    fits: Any = [least_squares(off, start, **options) for start in complete]
    return min(fits, key=lambda fit: fit.cost).x


def _estimates(
    best: np.ndarray, covariance: np.ndarray, shifts: np.ndarray, left: float
) -> tuple[tuple[Estimate, ...], np.ndarray]:
    """Convert fitted logarithms to friction and Stribeck velocity, with their correlation.

    `best`, shape (5,), are the fitted numbers, of which the first three count. They have a covariance, shape (3, 3).
    `shifts`, shape (m, 3), are their changes by systematic errors. `left` is the unexplained fraction of the friction.
    """
    coulomb, more, stribeck = np.exp(best[:3])
    values = (coulomb, coulomb + more, stribeck)
    turned = np.array([[coulomb, 0, 0], [coulomb, more, 0], [0, 0, stribeck]])  # derivatives by the logarithms
    covariance, shifts = turned @ covariance @ turned.T, shifts @ turned.T
    even, estimates = (left + LINEARITY_OF_SENSORS) * np.array(values), []
    for i, (name, unit) in enumerate(zip(NAMES, UNITS, strict=True)):
        mean = Mean(float(values[i]), float(covariance[i, i] ** 0.5), BLOCKS_OF_A_MEAN - 1)
        systematic = float(np.abs(shifts[:, i]).sum() + even[i])
        estimates.append(by_t(name, unit, mean, METHOD, systematic, systematic))
    return tuple(estimates), correlation_of(covariance, shifts, even)


SHARE_LEFT_UNEXPLAINED = 0.2
"""Largest residual of a useful model, relative to the standard deviation of friction."""

STRIBECK_VELOCITIES_GONE = 1.5
"""Speed that slow sliding must reach, in Stribeck velocities. At 1.5 a tenth of the fall of friction is left."""


def _estimates_shown(estimates: tuple[Estimate, ...], left: float, velocity: np.ndarray) -> tuple[Estimate, ...]:
    """Withdraw estimates that the motion does not determine, with the reason.

    `left` is the unexplained fraction of the friction; `velocity` [m/s], shape (n,), is the body's.
    """
    coulomb, static, stribeck = estimates
    fastest = float(np.abs(velocity).max())
    if left > SHARE_LEFT_UNEXPLAINED:
        return _unknown(f"{percent(left)} of the friction is not explained by LuGre's bristles")
    if not coulomb.low > 0:
        return _unknown("the force shows no friction: does the bearing slide?")
    if fastest < STRIBECK_VELOCITIES_GONE * stribeck.value:
        return _unknown(f"no faster than {fastest:.3g} m/s, the motion does not show where friction ceases to fall")
    if not (static.low > coulomb.value and stribeck.low > 0):
        why = "no rise of friction towards rest shows"
        return coulomb, static.withheld(why), stribeck.withheld(why)
    return estimates


def _bristles(prior: Prior, log: Log) -> MassOnBristles | None:
    """Return mass and bristles from other experiments.

    Returns None unless these gave all masses, and stiffness and damping of the bristles.
    """
    flat = prior.flat(log)
    masses = [key for key in flat if key.startswith("masses.")]
    bristles = ["friction.bristle_stiffness", "friction.bristle_damping"]
    if not masses or not all(key in prior.estimates for key in (*masses, *bristles)):
        return None
    mass = (sum(prior.estimates[key].value for key in masses), sum(prior.estimates[key].half_width for key in masses))
    stiffness, damping = ((prior.estimates[key].value, prior.estimates[key].half_width) for key in bristles)
    return MassOnBristles(mass, stiffness, damping, flat.get("friction.stribeck_exponent", 2.0))


def slow_sliding_caption(result: SlowSliding) -> str:
    """Write Coulomb and static friction and Stribeck velocity, and how much stays unexplained."""
    coulomb, static, stribeck = (with_interval(estimate) for estimate in result.estimates)
    return (
        "Force less inertia, and the friction of LuGre bristles in the measured motion. Coulomb "
        f"friction: {coulomb}; static friction: {static}; Stribeck velocity: {stribeck}. "
        f"{percent(result.unexplained, 3)} of "
        "the friction remains unexplained."
    )


POINTS_OF_A_RECORD = 5000
"""Number of points drawn of a record of slow sliding; more make a page heavy and show nothing."""


def slow_sliding_panels(result: SlowSliding) -> tuple[Panel, ...]:
    """Draw measured and modelled friction over time and over velocity."""
    friction = Axis("Friction, low-passed", "N")
    thinned = slice(None, None, max(len(result.time) // POINTS_OF_A_RECORD, 1))

    def both(x: np.ndarray) -> tuple[Series, ...]:
        """Draw measured and modelled friction over a signal."""
        return (
            Series(x[thinned], result.friction[thinned], "force less inertia", INK, width=1.4),
            Series(x[thinned], result.model[thinned], "LuGre's bristles", ORANGE, "dashed", 1.0),
        )

    over = Panel("", Axis("Velocity", "m/s"), friction, (*both(result.velocity), *_steady_friction(result)))
    return Panel("", TIME, friction, both(result.time)), over


POINTS_OF_A_CURVE = 200
"""Number of points drawn of the friction curve at steady velocities, which then looks smooth."""


def _steady_friction(result: SlowSliding) -> tuple[Series, ...]:
    """Draw the friction at steady velocities without the viscous part, in both directions."""
    coulomb, static, stribeck = (estimate.value for estimate in result.estimates)
    if not all(estimate.determined for estimate in result.estimates):
        return ()
    speeds = np.linspace(0, float(np.abs(result.velocity).max()), POINTS_OF_A_CURVE)
    level = stribeck_curve(speeds, coulomb, static, stribeck, result.exponent)
    velocities, forces = (np.concatenate([-values[::-1], [np.nan], values]) for values in (speeds, level))
    return (Series(velocities, forces, "at steady velocity", BLUE, width=2.0),)


class SlowSlidingKind(ExperimentKind[SlowSliding]):
    """Slow sliding both ways, which shows how friction falls with speed."""

    title = "Slow sliding"
    after = ("constant-speed", "frequency", "moves", "presliding")

    def analyse_log(self, log: Log, prior: Prior, settings: AnalysisSettings) -> SlowSliding:
        """Analyse a log with mass and bristles from other experiments."""
        return stribeck_from_slow_sliding(log, bearing.believed_between(prior, log), _bristles(prior, log))

    def facts(self, result: SlowSliding) -> Facts:
        """List Coulomb and static friction and Stribeck velocity, and how much stays unexplained."""
        names = ("Coulomb friction", "Static friction", "Stribeck velocity")
        facts = [(name, with_interval(estimate)) for name, estimate in zip(names, result.estimates, strict=True)]
        if len(result.time):
            facts += [("Residual friction", f"{percent(result.unexplained, 3)} of its standard deviation")]
        return tuple(facts)

    def numbers(self, result: SlowSliding) -> dict[str, Any]:
        """Return Coulomb and static friction and the Stribeck velocity, for the document."""
        named = {estimate.name.removeprefix("friction."): estimate_document(estimate) for estimate in result.estimates}
        return named | entries(result, "unexplained", "warnings")

    def figures(self, result: SlowSliding, logs: Sequence[Source], name: str) -> list[Figure]:
        """Draw measured and modelled friction, over velocity and over time; empty without a model."""
        if not len(result.model):
            return []
        caption, panels = slow_sliding_caption(result), slow_sliding_panels(result)
        return [Figure(f"{name}_friction", "Friction in slow sliding", caption, panels)]

    def estimates(self, result: SlowSliding, stage: Stage | None) -> tuple[Estimate, ...]:
        """Return the estimates of friction."""
        return result.estimates

    def correlated(self, result: SlowSliding, estimates: Sequence[Estimate]) -> Correlated:
        """Return the estimates with their correlation in the fit."""
        return by_rows(result, estimates, result.estimates.index)


KIND = SlowSlidingKind()
