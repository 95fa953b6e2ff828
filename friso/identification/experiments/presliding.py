"""Small motion about a place at which the bearing sticks: stiffness and damping of its bristles.

The force on a body that sticks is F = m a + sigma_0 z + (sigma_1 dz/dt + sigma_2 v) + c, with the deflection of the
bristles dz/dt = v (1 - q z sign v), q = sigma_0/F_s (LuGre; Astrom, Canudas de Wit 2008, doi:10.1109/MCS.2008.929425):
linear in all but q, once the motion is measured. Motion that is quick enough shows the damping beside the stiffness.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from friso.errors import InputError
from friso.identification.combine import Correlated
from friso.identification.estimate import Estimate, with_interval
from friso.identification.estimate_documents import estimates_document
from friso.identification.experiments.slow_sliding import LOW_PASS_OF_A_CHECK, SHARE_LEFT_UNEXPLAINED
from friso.identification.kind import (
    TIME,
    AnalysisSettings,
    ExperimentKind,
    Facts,
    Prior,
    Source,
    by_rows,
)
from friso.identification.logs.log import Log
from friso.identification.output_error.parameters import bends
from friso.identification.readings import at_bearing as bearing
from friso.identification.readings.at_bearing import DIRECT, BearingRecord, Between, LowPass
from friso.identification.readings.common import (
    BLOCKS_OF_A_MEAN,
    Mean,
    by_t,
    correlation_of,
    deflections,
    jackknife,
    solve_normal_equations,
)
from friso.identification.readings.course import Course
from friso.identification.readings.friction_velocity import LINEARITY_OF_SENSORS
from friso.identification.stage_file import shared_masses
from friso.quantities import percent
from friso.shown.documents import entries
from friso.shown.drawing.figure import BLUE, INK, ORANGE, Axis, Figure, Panel, Series
from friso.stage import Stage

KEYS = MASS, DAMPING, STIFFNESS = "moving mass", "friction.bristle_damping", "friction.bristle_stiffness"

UNITS = {MASS: "kg", DAMPING: "N*s/m", STIFFNESS: "N/m"}

METHOD = "small motion before sliding: force over inertia, bristles' deflection and its rate"

SLIDES = "the bearing slides, or noise is as large as the force"

SPRING = "a spring to ground acts, such as a flexure or a cable, beside bristles or instead of them"

VISCOUS = "friction.viscous"


@dataclass(frozen=True, kw_only=True)
class Presliding:
    """Bristles and moving mass from small motion before sliding.

    Moving mass [kg], damping [N s/m] and stiffness [N/m] of the bristles have the `correlation` of shape (3, 3).
    Signals over time [s], shape (n,), are the position [m] of the body on the bearing, its low-passed force [N], and
    the model's force (empty without a model). `unexplained` is the fraction of the friction's standard deviation that
    the model leaves.
    """

    mass: Estimate
    damping: Estimate
    stiffness: Estimate
    correlation: np.ndarray
    time: np.ndarray
    position: np.ndarray
    force: np.ndarray
    model: np.ndarray
    unexplained: float
    warnings: tuple[str, ...] = ()

    def order(self, key: str) -> int:
        """Return the row of a key of the stage file in the `correlation`."""
        return KEYS.index(key) if key in KEYS else KEYS.index(MASS)


@dataclass(frozen=True)
class _Fit:
    """A fit of mass and bristles to signals below one low-pass frequency.

    `values` are mass, damping and stiffness, shape (3,), with their covariance by the jackknife. `doubt`, shape (3,),
    is how far the residual may have shifted each value. `late` [s] is the delay of the force beyond the assumed delay.
    `ends` is true if the search for the bristles' bending q stopped at its upper limit. `left` is the unexplained
    fraction of the friction. Low-passed signals over time [s], shape (n,), are the position of the body on the bearing,
    its force and the model's. The fit solves the `equation` with the `bending` q [1/m].
    """

    values: np.ndarray
    covariance: np.ndarray
    doubt: np.ndarray
    late: float
    ends: bool
    left: float
    time: np.ndarray
    position: np.ndarray
    force: np.ndarray
    model: np.ndarray
    equation: _Equation
    bending: float


SAMPLES_OF_PRESLIDING = 1000
"""Fewest samples of a record of pre-sliding. With fewer, the interval is useless."""

BENDING_RANGE = (1e-6, 5.0)
"""Range of the bristles' bending parameter in a fit, relative to the motion: from a straight line to immediate
slip."""


def bristles_from_presliding(log: Log, between: Between = DIRECT) -> Presliding:
    """Estimate bristles from motion that is small against their break-away deflection.

    The log has position and force; if it has gaps, the longest stretch is used. A joint must be held, or its deflection
    measured. `between` describes what lies between the measured force and the bearing.

    The intervals include: the change with a lower low-pass and with the best-fitting delay (used if no delay is known);
    the uncertainty of the viscous friction subtracted from the damping; and the residual, because the model leaves out
    that friction falls with speed and that bristles of another law bend differently. With a large residual, or beside a
    spring to ground, nothing is determined. Raises InputError for missing channels.
    """
    record = bearing.record_of(log, log.longest, between)
    if why := bearing.why_unseen(record, SAMPLES_OF_PRESLIDING):
        return _nothing(why)
    cutoff, looked_for = bearing.cutoff_of(record), between.delay is None
    tried = [
        (cutoff, looked_for),
        (LOW_PASS_OF_A_CHECK * cutoff, looked_for),
        *([] if looked_for else [(cutoff, True)]),
    ]
    longest = bends(log.axis)[1]
    if np.ptp(record.body) >= longest * BENDING_RANGE[1]:
        return _nothing(f"the motion is wider than bristles bend: {SLIDES}")
    best, *others = (_converged_fit(_seen(record, top), between, top, late) for top, late in tried)
    changes = np.array([other.values - best.values for other in others])
    even = best.doubt + LINEARITY_OF_SENSORS * np.abs(best.values)
    even[KEYS.index(DAMPING)] += between.viscous[1]
    systematic = np.abs(changes).sum(axis=0) + even
    why = _no_bristles(best, between, record.bent is None, longest)
    mass, damping, stiffness = (
        Estimate.unknown(key, UNITS[key], METHOD, why) if why else _estimate(key, *map(float, numbers))
        for key, *numbers in zip(KEYS, best.values, np.diag(best.covariance) ** 0.5, systematic, strict=True)
    )
    correlation = correlation_of(best.covariance, changes, even)
    notes = (bearing.HELD,) if record.bent is None and between.joint else ()
    return Presliding(
        mass=mass,
        damping=damping,
        stiffness=stiffness,
        correlation=correlation,
        time=best.time,
        position=best.position,
        force=best.force,
        model=best.model,
        unexplained=best.left,
        warnings=notes,
    )


SAMPLES_OF_A_PRESLIDING_PERIOD = 40
"""Number of samples per period of the low-pass in pre-sliding. More take longer and show no more."""

LOW_PASS_OF_THE_MOTION = 5.0
"""Ratio of the low-pass frequencies of motion and fit in pre-sliding. Friction depends on faster motion than is
fitted."""


def _seen(record: BearingRecord, cutoff: float) -> BearingRecord:
    """Low-pass and thin a record, as a fit of the force below `cutoff` [Hz] needs it."""
    every = int(1 / (SAMPLES_OF_A_PRESLIDING_PERIOD * cutoff * record.interval))
    return record.seen(LOW_PASS_OF_THE_MOTION * cutoff, max(every, 1))


def _nothing(why: str) -> Presliding:
    """Return a result without estimates, for the reason `why`."""
    mass, damping, stiffness = (Estimate.unknown(key, UNITS[key], METHOD, why) for key in KEYS)
    curves = dict.fromkeys(("time", "position", "force", "model"), np.empty(0))
    unknown = {"correlation": np.eye(len(KEYS)), "unexplained": np.nan}
    return Presliding(mass=mass, damping=damping, stiffness=stiffness, **unknown, **curves)


STIFFNESS_RATIO_OF_A_JOINT = 3.0
"""Largest ratio of a measured stiffness to the stage file's joint stiffness for it to be the joint's."""


def _no_bristles(fit: _Fit, between: Between, held: bool, longest: float) -> str:
    """Return why a fit shows no bristles; "" if it does.

    `held` is true if the joint counts as held; a stiffness like the joint's then contradicts that. Bristles bend by
    `longest` [m] at most before they slide.
    """
    if fit.left > SHARE_LEFT_UNEXPLAINED:
        return f"{percent(fit.left)} of the friction is not explained: {SLIDES}"
    if held and 0 < fit.values[KEYS.index(STIFFNESS)] < STIFFNESS_RATIO_OF_A_JOINT * between.joint:
        return "the stiffness is like that of the joint: is it held?"
    if fit.ends:
        return f"the bristles yield: {SLIDES}"
    return SPRING if _spring_acts(fit, longest) else ""


def _estimate(key: str, value: float, error: float, systematic: float) -> Estimate:
    """Make the estimate of mass, damping or stiffness, all of which must be positive.

    `error` is the standard error, to which `systematic` is added. The quantity is not determined if its interval
    reaches 0.
    """
    mean = Mean(value, error, BLOCKS_OF_A_MEAN - 1)
    why = (
        "the motion is too slow to show it"
        if key != STIFFNESS
        else "no force holds the bearing: does it stick? repeat it with a smaller force"
    )
    return by_t(key, UNITS[key], mean, METHOD, systematic, systematic).if_positive(why)


def _converged_fit(record: BearingRecord, between: Between, cutoff: float, late: bool) -> _Fit:
    """Fit twice, the second time with the mass and, if `late`, the delay that the first gives."""
    fit = _fit(record, between, cutoff, between.mass, late)
    delayed = replace(between, delay=(between.delay or 0.0) + fit.late)
    return _fit(record, delayed, cutoff, float(fit.values[0]), late)


BEND_SHARE_OF_A_SEEN_SPRING = 0.1
"""Smallest motion that tells a spring from bristles, relative to the longest bend. A smaller one shows a line."""

SHARE_LEFT_BY_SOFT_BRISTLES = 0.99
"""Fraction of the squared residual below which bristles softer than those of a bearing fit better: a spring."""

SHARE_OF_A_SEEN_SPRING = 0.02
"""Smallest residual of bristles, relative to the force, that a spring beside them may explain."""

BENDING_BESIDE_A_SPRING = 200.0
"""Largest bending parameter of bristles that is tried beside a spring, relative to the motion."""

SHARE_LEFT_BY_A_SPRING = 0.25
"""Fraction of the squared residual below which a spring beside the bristles is taken to act."""


def _spring_acts(fit: _Fit, longest: float) -> bool:
    """Tell whether a spring to ground, beside bristles or instead of them, explains the force better than bristles.

    Bristles softer than those that bend by `longest` [m] before they slide are a spring, if the motion is wide enough
    to tell. Beside a spring, bristles may be much stiffer than without.
    """
    equation = fit.equation
    span, left = float(np.ptp(equation.body)), equation.squares_left(fit.bending)
    if span > BEND_SHARE_OF_A_SEEN_SPRING * longest and fit.bending < 1 / longest:
        return left < SHARE_LEFT_BY_SOFT_BRISTLES * equation.squares_left(1 / longest)
    if left <= (SHARE_OF_A_SEEN_SPRING * np.linalg.norm(fit.force - fit.force.mean())) ** 2:
        return False
    tried = np.geomspace(BENDING_RANGE[0], BENDING_BESIDE_A_SPRING, 40) / span
    spring = equation.low_pass(equation.body - equation.body.mean())
    least = min(equation.squares_left(bending, spring) for bending in tried)
    return least < SHARE_LEFT_BY_A_SPRING * left


def _fit(record: BearingRecord, between: Between, cutoff: float, mass: float, late: bool) -> _Fit:
    """Fit the force below a low-pass frequency [Hz] by least squares.

    The bending of the bristles, which is nonlinear, is searched. `mass` [kg] is the assumed moving mass; if `late`, the
    effect of a slightly larger delay is among the columns.
    """
    equation = _equation(record, between, cutoff, mass, late)
    target, span = equation.target, float(np.ptp(equation.body))
    limits = tuple(np.log(BENDING_RANGE))
    squares = lambda logarithm: equation.squares_left(float(np.exp(logarithm)) / span)  # noqa: E731
    best: Any = minimize_scalar(squares, bounds=limits, method="bounded", options={"xatol": 1e-3})
    bending = float(np.exp(best.x)) / span
    x = equation.columns(bending)
    solution = solve_normal_equations(x.T @ x, x.T @ target)
    bent = (equation.columns(1.01 * bending) - equation.columns(bending / 1.01)) @ solution
    columns, friction = np.column_stack([x, bent]), target - x[:, 0] * solution[0]
    covariance = jackknife(columns, target)[:3, :3]
    unexplained = target - x @ solution
    hidden = np.linalg.norm(unexplained) + LINEARITY_OF_SENSORS * np.linalg.norm(friction)
    doubt = hidden / np.array([_apart(columns, number) for number in range(len(KEYS))])
    left = float(unexplained.std() / friction.std())
    ends, more = bending * span > 0.99 * BENDING_RANGE[1], float(solution[-1]) if late else 0.0
    curves = (record.time[equation.low_pass.inside], equation.low_pass(equation.body), target, x @ solution)
    return _Fit(solution[:3], covariance, doubt, more, ends, left, *curves, equation, bending)


def _apart(columns: np.ndarray, number: int) -> float:
    """Return the norm of the part of a column that the other columns do not explain.

    The column has the index `number` in `columns`, shape (m, p).
    """
    sizes = np.linalg.norm(columns, axis=0)
    scaled = columns / np.where(sizes > 0, sizes, 1.0)
    others = np.delete(scaled, number, axis=1)
    own = scaled[:, number] - others @ np.linalg.lstsq(others, scaled[:, number], rcond=None)[0]
    return float(np.linalg.norm(own) * sizes[number])


@dataclass(frozen=True)
class _Equation:
    """The equation of motion for a record of small motion, below one low-pass frequency.

    `body` is the position [m] of the body on the bearing, shape (n,). Low-passed, shape (m,) each, there are the force
    [N] in `target` and the columns that do not depend on the bristles.
    """

    low_pass: LowPass
    body: np.ndarray
    target: np.ndarray
    inertia: np.ndarray
    rest: tuple[np.ndarray, ...]

    def columns(self, bending: float) -> np.ndarray:
        """Return all columns of the fit for bristles with a bending q [1/m], shape (m, p).

        Columns are inertia, rate and deflection of the bristles, the decay of an initial deflection, then the fixed
        columns.
        """
        moves = np.diff(self.body)
        z = deflections(moves, np.full(len(moves), 1 / bending))
        path = np.concatenate(([0.0], np.cumsum(np.abs(moves))))
        turned = map(self.low_pass, (bearing.rate_of(self.low_pass.time, z), z, np.exp(-bending * path)))
        return np.stack([self.inertia, *turned, *self.rest], axis=1)

    def squares_left(self, bending: float, *further: np.ndarray) -> float:
        """Return the sum of squares [N^2] that bristles of a bending q [1/m] leave, fitted with `further` columns."""
        x = np.column_stack([self.columns(bending), *further])
        return float(np.sum((self.target - x @ solve_normal_equations(x.T @ x, x.T @ self.target)) ** 2))


def _equation(record: BearingRecord, between: Between, cutoff: float, mass: float, late: bool) -> _Equation:
    """Set up the equation of motion of a record, with signals low-passed at `cutoff` [Hz].

    A structural mode with the mass m and frequency w adds m/w^2 times the fourth derivative of the position. The part
    of this effect that `between` does not describe is among the fixed columns.
    """
    time, low_pass = record.time, LowPass(record.time, cutoff)
    body, force, inertia = bearing.at_bearing(record, between, mass)
    rate = partial(bearing.rate_of, time)
    target = force - between.viscous[0] * rate(body)
    rest = [np.ones(len(time)), rate(rate(inertia)), *([rate(force)] if late else [])]
    return _Equation(low_pass, body, low_pass(target), low_pass(inertia), tuple(map(low_pass, rest)))


def _at_most(total: Estimate) -> Estimate:
    """Return the damping with an upper bound only: `total` includes unknown viscous friction."""
    if not total.determined:
        return total
    why = f"its sum with viscous friction, which is not known, is {total.low:.4g} to {total.high:.4g} {total.unit}"
    return total.withheld(why, 0.0, total.high)


def presliding_caption(result: Presliding) -> str:
    """Say how stiff and damped the bristles are, and how much of the friction stays unexplained."""
    return (
        f"The last tenth of the record. Stiffness of the bristles: {with_interval(result.stiffness)}; damping: "
        f"{with_interval(result.damping)}. {percent(result.unexplained, 3)} of the friction remains unexplained."
    )


def presliding_panels(result: Presliding) -> tuple[Panel, ...]:
    """Draw force and model, and the motion, over the last tenth of the record."""
    late = slice(-(len(result.time) // 10), None)
    time, motion = result.time[late], result.position[late] - result.position[late].mean()
    lines = (
        Series(time, result.force[late], "force, low-passed", INK, width=1.6),
        Series(time, result.model[late], "mass and bristles", ORANGE, "dashed", 1.2),
    )
    return (
        Panel("", TIME, Axis("Force", "N"), lines),
        Panel("", TIME, Axis("Position about its mean", "m"), (Series(time, motion, "", BLUE, width=1.0),)),
    )


class PreslidingKind(ExperimentKind[Presliding]):
    """Small motion before sliding, which shows the bristles."""

    title = "Motion before sliding"
    after = ("constant-speed", "frequency", "moves")
    instead_of = ("moves",)
    foreign = ("force",)
    per_unit = True

    def analyse_log(self, log: Log, prior: Prior, settings: AnalysisSettings) -> Presliding:
        """Analyse a log of small motion, and subtract viscous friction from the damping if known."""
        between = bearing.believed_between(prior, log)
        if VISCOUS in prior.estimates or prior.user_told(VISCOUS, log):
            return bristles_from_presliding(log, between)
        result = bristles_from_presliding(log, replace(between, viscous=(0.0, 0.0)))
        return replace(result, damping=_at_most(result.damping))

    def estimates(self, result: Presliding, stage: Stage | None) -> tuple[Estimate, ...]:
        """Return estimates of the bristles and, if the stage's masses add up to it, the total mass."""
        masses = shared_masses(result.mass, stage) if stage is not None and result.mass.determined else ()
        return (result.stiffness, result.damping, *masses)

    def claims(self, course: Course) -> str | None:
        """Return why a log holds motion before sliding, or None: moves, large or small, that bristles alone explain."""
        if course.moves is None or not course.may_stick:
            return None
        try:
            shown = bristles_from_presliding(course.log.per_unit_of_force())
        except InputError:
            return None
        return "bristles explain the force, which stays below that of sliding" if shown.stiffness.determined else None

    def facts(self, result: Presliding) -> Facts:
        """List stiffness and damping of the bristles, the moving mass, and friction not explained."""
        facts = [
            ("Stiffness of the bristles", with_interval(result.stiffness)),
            ("Damping of the bristles", with_interval(result.damping)),
            ("Moving mass", with_interval(result.mass)),
        ]
        if len(result.time):
            facts += [("Residual friction", f"{percent(result.unexplained, 3)} of its standard deviation")]
        return tuple(facts)

    def numbers(self, result: Presliding) -> dict[str, Any]:
        """Return the mass, and stiffness and damping of the bristles, for the document."""
        estimates = estimates_document(result, "stiffness", "damping", "mass")
        return estimates | entries(result, "unexplained", "warnings")

    def figures(self, result: Presliding, logs: Sequence[Source], name: str) -> list[Figure]:
        """Draw force and model, and the motion, over the last tenth of the record.

        The list is empty if no model was fitted.
        """
        if not len(result.model):
            return []
        return [Figure(f"{name}_force", "Motion before sliding", presliding_caption(result), presliding_panels(result))]

    def correlated(self, result: Presliding, estimates: Sequence[Estimate]) -> Correlated:
        """Return the estimates with their correlation in the fit."""
        return by_rows(result, estimates, lambda estimate: result.order(estimate.name))


KIND = PreslidingKind()
