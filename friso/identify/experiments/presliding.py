"""Stiffness and damping of the bristles from small motion about a place at which the bearing sticks.

The force on a body that sticks is F = m a + sigma_0 z + (sigma_1 dz/dt + sigma_2 v) + c, with the deflection of the
bristles dz/dt = v (1 - q z sign v), q = sigma_0/F_s (LuGre; Astrom, Canudas de Wit 2008, doi:10.1109/MCS.2008.929425):
linear in all but q, once the motion is measured. Motion that is quick enough shows the damping beside the stiffness;
hysteresis of slow loops, see `hysteresis`, shows the stiffness alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from friso.identify.estimate import Estimate
from friso.identify.experiments.at_bearing import DIRECT, Between, at_bearing, rate_of
from friso.identify.experiments.common import (
    LINEARITY,
    Mean,
    by_t,
    channel,
    deflection,
    deflections,
    jackknife,
    low_pass,
    reach,
    robust,
    solved,
)
from friso.identify.logs.log import Log

CHECKED, MOTION = 0.7, 5.0
"""Low-pass of a second fit by which the first one is checked, and of the motion itself, both over that of the first:
friction depends on the whole motion, not on what a low-pass leaves of it."""

BLOCKS = 8
"""Blocks of the record that are left out in turn, for the errors."""

LEAST, FINE, SAMPLED = 20, 40, 0.2
"""Periods of the low-pass that a record lasts at least, samples per period of it that are enough, and the highest
frequency of the motion over that of the samples."""

FEWEST = 1000
"""Samples of a record at least."""

BENDING = (1e-6, 5.0)
"""Of the bending q over the range of the motion: from a straight line to bristles that are at their end long before."""

EXPLAINED = 0.2
"""Share of the friction's standard deviation that the model may leave unexplained."""

SEEN, ROUNDING = 10.0, 1e-9
"""Standard deviations of the noise that those of the motion have to reach, and the same over the largest position."""

MOVES, STANDS_OUT = 0.02, 3.0
"""A joint bends where its deflection reaches this share of the motion, and so many times its sensor's noise."""

SPRING = 3.0
"""Stiffness over that of the joint up to which it may well be the joint that is seen, and deflection over that of the
contact up to which it may well be the contact."""

KEYS = MASS, DAMPING, STIFFNESS = "moving mass", "friction.bristle_damping", "friction.bristle_stiffness"
UNITS = {MASS: "kg", DAMPING: "N*s/m", STIFFNESS: "N/m"}
METHOD = "small motion before sliding: force over inertia, bristles' deflection and its rate"
SLIDES = "the bearing slides, or noise is as large as the force"
HELD = "The joint is taken as held, with the limiter's stiffness: it is not seen to bend."


@dataclass(frozen=True)
class Presliding:
    """Moving mass [kg], damping [N s/m] and stiffness [N/m] of the bristles, and the `correlation` of the three, shape
    (3, 3). Over time [s], shape (n,): the position [m] of the body on the bearing, the force [N], low-passed, and that
    of the model (empty where there is none); the share of the friction's standard deviation that it leaves
    unexplained."""

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
        """The row of a key of the stage file in the `correlation`."""
        return KEYS.index(key) if key in KEYS else KEYS.index(MASS)


@dataclass(frozen=True)
class _Fit:
    """Mass, damping and stiffness, shape (3,), and their covariance by the jackknife; by how much later [s] the force
    comes than was taken; whether the bristles are at their end, and the share of the friction that is left; over time
    [s], shape (n,), the position of the body on the bearing, its force and that of the model, low-passed."""

    values: np.ndarray
    covariance: np.ndarray
    late: float
    ends: bool
    left: float
    time: np.ndarray
    position: np.ndarray
    force: np.ndarray
    model: np.ndarray


@dataclass(frozen=True)
class _Record:
    """Time [s], position of the body on which the force acts, deflection of the joint that carries it [m] (None: it
    is held), and force [N], shape (n,)."""

    time: np.ndarray
    position: np.ndarray
    bent: np.ndarray | None
    force: np.ndarray

    def seen(self, cutoff: float) -> _Record:
        """Low-passed at a frequency [Hz], with no more samples than that needs."""
        each = float(self.time[1] - self.time[0])
        step = max(int(MOTION / (FINE * cutoff * each)), 1)
        place, force = (low_pass(signal, each, cutoff)[::step] for signal in (self.position, self.force))
        bent = None if self.bent is None else low_pass(self.bent, each, cutoff)[::step]
        return _Record(self.time[::step], place - place[0], bent, force)


def bristles_from_presliding(log: Log, between: Between = DIRECT) -> Presliding:
    """Bristles from a log of position and force whose motion is small beside their break-away. Of a log with gaps the
    longest stretch is used.

    A joint is held, or its deflection is measured. The intervals contain by how much the answer changes up to twice the
    low-pass and with the delay that fits best (which is taken where none is given), the viscous friction that is
    taken off the damping, and the share of the friction that is left unexplained: it falls with speed, which the model
    leaves out. Where that share is large, nothing is shown. Raises StageError for missing channels.
    """
    part, each = log.longest, log.sample_time
    position, force = channel(log, "position")[part], channel(log, "force")[part]
    if len(position) < FEWEST:
        return _nothing(f"the record has {len(position)} samples: {FEWEST} are needed")
    cutoff = max(reach(position, each), LEAST / (len(position) * each))
    why = _why_not(position, each, cutoff)
    if why:
        return _nothing(why)
    cutoff = min(cutoff, SAMPLED / (2 * each))
    bent = _bends(log, part, position, cutoff, SPRING * float(force.std()) / between.contact)
    record = _Record(log.time[part], position, bent, force)
    own = between.delay is None
    best, *others = (
        _settled(record.seen(MOTION * top), between, top, late)
        for top, late in ((cutoff, own), (CHECKED * cutoff, own), *([] if own else [(cutoff, True)]))
    )
    changes = np.array([other.values - best.values for other in others])
    systematic = np.abs(changes).sum(axis=0) + (best.left + LINEARITY) * np.abs(best.values)
    systematic[KEYS.index(DAMPING)] += between.viscous
    why = _no_bristles(best, between, bent is None)
    mass, damping, stiffness = (
        Estimate.unknown(key, UNITS[key], METHOD, why) if why else _estimate(key, *map(float, numbers))
        for key, *numbers in zip(KEYS, best.values, np.diag(best.covariance) ** 0.5, systematic, strict=True)
    )
    whole = best.covariance + changes.T @ changes / 4
    size = np.sqrt(np.diag(whole))
    said = (HELD,) if bent is None and between.joint else ()
    shown = (best.time, best.position, best.force, best.model)
    return Presliding(mass, damping, stiffness, whole / np.outer(size, size), *shown, best.left, said)


def _why_not(position: np.ndarray, sample_time: float, cutoff: float) -> str:
    """Why a record cannot show bristles; empty where it can."""
    if sample_time * cutoff > SAMPLED:
        needed = SAMPLED / cutoff
        return f"the motion goes up to {cutoff:.3g} Hz: one sample in {needed:.3g} s or less is needed"
    motion, noise = low_pass(position, sample_time, cutoff).std(), robust(np.diff(position, 2)) / 6**0.5
    if not motion > max(SEEN * noise, ROUNDING * float(np.abs(position).max())):
        return f"the motion, {motion:.2g} m RMS, does not stand out of the noise"
    return ""


def _bends(log: Log, part: slice, position: np.ndarray, cutoff: float, gives: float) -> np.ndarray | None:
    """The measured deflection [m] of a joint that bends; None where it is not measured, or held and no more than what
    its contact `gives` [m]."""
    measured = deflection(log)
    if measured is None:
        return None
    bent = measured[part]
    size = low_pass(bent, log.sample_time, cutoff).std()
    noise = low_pass(np.random.default_rng(0).standard_normal(len(bent)), log.sample_time, cutoff).std()
    noise *= robust(np.diff(bent, 2)) / 6**0.5
    least = max(STANDS_OUT * noise, MOVES * low_pass(position, log.sample_time, cutoff).std(), gives)
    return bent if size > least else None


def _nothing(why: str) -> Presliding:
    mass, damping, stiffness = (Estimate.unknown(key, UNITS[key], METHOD, why) for key in KEYS)
    none = np.empty(0)
    return Presliding(mass, damping, stiffness, np.eye(len(KEYS)), none, none, none, none, np.nan)


def _no_bristles(fit: _Fit, between: Between, held: bool) -> str:
    """Why what was found are no bristles; empty where they are."""
    if fit.left > EXPLAINED:
        return f"{fit.left:.0%} of the friction are not explained: {SLIDES}"
    if fit.ends:
        return f"the bristles are at their end: {SLIDES}"
    if held and 0 < fit.values[KEYS.index(STIFFNESS)] < SPRING * between.joint:
        return "the stiffness is like that of the joint: is it held?"
    return ""


def _estimate(key: str, value: float, error: float, systematic: float) -> Estimate:
    found = by_t(key, UNITS[key], Mean(value, error, BLOCKS - 1), METHOD, systematic, systematic)
    if found.low > 0:
        return found
    why = "the motion is too slow to show it" if key != STIFFNESS else "no force holds the bearing: does it stick?"
    return Estimate.unknown(key, UNITS[key], METHOD, why, 0.0, max(found.high, 0.0) or np.inf)


def _settled(record: _Record, between: Between, cutoff: float, late: bool) -> _Fit:
    """The fit once the mass that is believed to move is the one found and, if it is to be looked for (`late`),
    the delay that which fits best."""
    fit = _fit(record, replace(between, delay=between.delay or 0.0), cutoff, 0.0, late)
    delay = (between.delay or 0.0) + fit.late
    return _fit(record, replace(between, delay=delay), cutoff, float(fit.values[0]), late)


def _fit(record: _Record, between: Between, cutoff: float, mass: float, late: bool) -> _Fit:
    """Least squares of the force at a low-pass; the bending, in which it is not linear, is looked for. `mass` [kg] is
    believed to move; with `late`, what a little more delay would do is among the columns."""
    equation = _equation(record, between, cutoff, mass, late)
    target, span = equation.target, float(np.ptp(equation.body))

    def off(logarithm: float) -> float:
        x = equation.columns(float(np.exp(logarithm)) / span)
        return float(np.sum((target - x @ solved(x.T @ x, x.T @ target)) ** 2))

    best: Any = minimize_scalar(off, bounds=tuple(np.log(BENDING)), method="bounded", options={"xatol": 1e-3})
    bending = float(np.exp(best.x)) / span
    x = equation.columns(bending)
    solution = solved(x.T @ x, x.T @ target)
    bends = (equation.columns(1.01 * bending) - equation.columns(bending / 1.01)) @ solution
    covariance = jackknife(np.column_stack([x, bends]), target)[:3, :3]
    values = solution[:3] + np.array([between.beyond * mass, 0.0, 0.0])
    left = float((target - x @ solution).std() / (target - x[:, 0] * solution[0]).std())
    ends, more = bending * span > 0.99 * BENDING[1], float(solution[-1]) if late else 0.0
    shown = (equation.time[equation.inside], equation.passed(equation.body), target, x @ solution)
    return _Fit(values, covariance, more, ends, left, *shown)


@dataclass(frozen=True)
class _Equation:
    """Time [s] and position [m] of the body on the bearing, shape (n,); the low-pass [Hz], and the samples `inside`,
    which its ends do not touch; the force [N] and its columns that do not depend on the bristles, inside, shape (m,)
    each."""

    time: np.ndarray
    body: np.ndarray
    cutoff: float
    inside: slice
    target: np.ndarray
    inertia: np.ndarray
    rest: tuple[np.ndarray, ...]

    def passed(self, signal: np.ndarray) -> np.ndarray:
        return low_pass(signal, float(self.time[1] - self.time[0]), self.cutoff)[self.inside]

    def columns(self, bending: float) -> np.ndarray:
        """Inertia, rate and deflection of bristles of a bending q [1/m], how a deflection at the start dies away, and
        the rest, shape (m, p)."""
        moves = np.diff(self.body)
        z = deflections(moves, np.full(len(moves), 1 / bending))
        path = np.concatenate(([0.0], np.cumsum(np.abs(moves))))
        turned = (self.passed(each) for each in (rate_of(self.time, z), z, np.exp(-bending * path)))
        return np.stack([self.inertia, *turned, *self.rest], axis=1)


def _equation(record: _Record, between: Between, cutoff: float, mass: float, late: bool) -> _Equation:
    """The equation of a record. A mode of the structure, whose mass m moves on its own spring at a frequency w, adds
    m/w^2 times the fourth derivative of the position: what of it `between` does not know is among the rest."""
    time = record.time
    body, force = at_bearing(time, record.position, record.force, between, mass, record.bent)
    force = force - between.viscous * rate_of(time, body)
    interval = float(time[1] - time[0])
    inside = slice(edge := int(2 / (cutoff * interval)), len(time) - edge)
    acceleration = rate_of(time, rate_of(time, body))
    rest = [np.ones(len(time)), rate_of(time, rate_of(time, acceleration)), *([rate_of(time, force)] if late else [])]
    target, inertia, *others = (low_pass(each, interval, cutoff)[inside] for each in (force, acceleration, *rest))
    return _Equation(time, body, cutoff, inside, target, inertia, tuple(others))
