"""Stiffness and damping of the bristles from small motion about a place at which the bearing sticks.

The force on a body that sticks is F = m a + sigma_0 z + (sigma_1 dz/dt + sigma_2 v) + c, with the deflection of the
bristles dz/dt = v (1 - q z sign v), q = sigma_0/F_s (LuGre; Astrom, Canudas de Wit 2008, doi:10.1109/MCS.2008.929425):
linear in all but q, once the motion is measured. Motion that is quick enough shows the damping beside the stiffness;
hysteresis of slow loops, see `hysteresis`, shows the stiffness alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import accumulate
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar

from friso.identify.estimate import Estimate
from friso.identify.experiments.common import LINEARITY, Mean, by_t, channel, deflection, low_pass, robust, solved
from friso.identify.logs.log import Log

CUTOFF, CHECKED, MOTION = 50.0, 2.0, 5.0
"""Low-pass of the equation [Hz]; that of a second fit by which the first one is checked, and of the motion itself, both
over it: friction depends on the whole motion, not on what a low-pass leaves of it."""

BLOCKS = 8
"""Blocks of the record that are left out in turn, for the errors."""

LEAST, FINE = 20, 40
"""Periods of the low-pass that a record lasts at least, and samples per period of it that are enough."""

BENDING = (1e-3, 5.0)
"""Of the bending q over the range of the motion: from a straight line to bristles that are at their end long before."""

EXPLAINED = 0.2
"""Share of the force's standard deviation that the model may leave unexplained."""

SEEN = 10.0
"""Standard deviations of the noise that those of the motion have to reach."""

YIELDS = 0.5
"""Share of the motion by which a joint may give way that counts as held."""

KEYS = MASS, DAMPING, STIFFNESS = "moving mass", "friction.bristle_damping", "friction.bristle_stiffness"
UNITS = {MASS: "kg", DAMPING: "N*s/m", STIFFNESS: "N/m"}
METHOD = "small motion before sliding: force over inertia, bristles' deflection and its rate"


@dataclass(frozen=True)
class Between:
    """What lies between the force that is commanded and the bristles: the time [s] by which the force comes later, the
    stiffness [N/m] of a joint that is held and the mass [kg] beyond it; and the viscous friction [N s/m]."""

    lag: float = 0.0
    contact: float = np.inf
    beyond: float = 0.0
    viscous: float = 0.0


@dataclass(frozen=True)
class Presliding:
    """Stiffness [N/m] and damping [N s/m] of the bristles and the moving mass [kg]. Over time [s], shape (n,): the
    position [m] of the body on the bearing, the force [N], low-passed, and that of the model (empty where there is
    none); the share of the force's standard deviation that it leaves unexplained."""

    stiffness: Estimate
    damping: Estimate
    mass: Estimate
    time: np.ndarray
    position: np.ndarray
    force: np.ndarray
    model: np.ndarray
    unexplained: float


@dataclass(frozen=True)
class _Fit:
    """Mass, damping and stiffness, and their standard errors by the jackknife, each of shape (3,); over time [s], shape
    (n,), the position of the body on the bearing, its force and that of the model, low-passed."""

    values: np.ndarray
    errors: np.ndarray
    time: np.ndarray
    position: np.ndarray
    force: np.ndarray
    model: np.ndarray


def bristles_from_presliding(log: Log, between: Between = Between(), cutoff: float = CUTOFF) -> Presliding:
    """Bristles from a log of position and force whose motion is small beside their break-away, a joint being held.

    The intervals contain by how much the answer changes up to twice the `cutoff` [Hz] and with half of the lag (that
    of one sample where none is given), and the share of the force that is left unexplained: friction falls with speed,
    which the model leaves out. Where that is large, nothing is shown. Raises StageError for missing channels.
    """
    part = max(log.segments, key=lambda each: each.stop - each.start)
    position, force = channel(log, "position")[part], channel(log, "force")[part]
    bent = deflection(log)
    why = _why_not(position, None if bent is None else bent[part], log.sample_time, cutoff)
    if why:
        return _nothing(why)
    step = max(int(1 / (FINE * cutoff * log.sample_time)), 1)
    time = log.time[part][::step]
    unsure = replace(between, lag=between.lag / 2 if between.lag else log.sample_time)

    def fitted(known: Between, top: float) -> _Fit:
        x, f = (low_pass(signal, log.sample_time, MOTION * top)[::step] for signal in (position, force))
        return _fit(time, x - x[0], f, known, top)

    best, higher, later = fitted(between, cutoff), fitted(between, CHECKED * cutoff), fitted(unsure, cutoff)
    left = float((best.force - best.model).std() / best.force.std())
    changes = np.abs(higher.values - best.values) + np.abs(later.values - best.values)
    systematic = changes + (left + LINEARITY) * np.abs(best.values)
    mass, damping, stiffness = (
        _estimate(key, Mean(float(value), float(error), BLOCKS - 1), float(more), left)
        for key, value, error, more in zip(KEYS, best.values, best.errors, systematic, strict=True)
    )
    return Presliding(stiffness, damping, mass, best.time, best.position, best.force, best.model, left)


def _why_not(position: np.ndarray, bent: np.ndarray | None, sample_time: float, cutoff: float) -> str:
    """Why a record cannot show bristles; empty where it can."""
    if len(position) * sample_time < LEAST / cutoff:
        return f"the record lasts {len(position) * sample_time:.3g} s: {LEAST / cutoff:.3g} s are needed"
    if sample_time * CHECKED * cutoff > 0.2:
        return f"one sample in {sample_time:.3g} s: {0.2 / (CHECKED * cutoff):.3g} s or less is needed"
    motion, noise = low_pass(position, sample_time, cutoff).std(), robust(np.diff(position, 2)) / 6**0.5
    if not motion > SEEN * noise:
        return f"the motion, {motion:.2g} m RMS, does not stand out of the noise"
    if bent is not None and low_pass(bent, sample_time, cutoff).std() > YIELDS * motion:
        return "the joint gives way: it has to be held"
    return ""


def _nothing(why: str) -> Presliding:
    mass, damping, stiffness = (Estimate.unknown(key, UNITS[key], METHOD, why) for key in KEYS)
    none = np.empty(0)
    return Presliding(stiffness, damping, mass, none, none, none, none, np.nan)


def _estimate(key: str, mean: Mean, systematic: float, left: float) -> Estimate:
    found = by_t(key, UNITS[key], mean, METHOD, systematic, systematic)
    if left > EXPLAINED:
        why = f"{left:.0%} of the force is not explained: the bearing slides, or moves otherwise"
        return Estimate.unknown(key, UNITS[key], METHOD, why)
    if not found.low > 0:
        why = "the motion is too slow to show it" if key != STIFFNESS else "no force holds the bearing: does it stick?"
        return Estimate.unknown(key, UNITS[key], METHOD, why, 0.0, max(found.high, 0.0) or np.inf)
    return found


def _fit(time: np.ndarray, position: np.ndarray, force: np.ndarray, between: Between, cutoff: float) -> _Fit:
    """Least squares of the force at a low-pass; the bending, in which it is not linear, is looked for."""
    acceleration = _rate(time, _rate(time, position))
    force = force - between.lag * _rate(time, force)
    force = force - between.beyond * acceleration
    body = position - force / between.contact
    force = force - between.viscous * _rate(time, body)
    interval, span = float(time[1] - time[0]), float(np.ptp(body))
    inside = slice(edge := int(2 / (cutoff * interval)), len(time) - edge)

    def passed(signal: np.ndarray) -> np.ndarray:
        return low_pass(signal, interval, cutoff)[inside]

    def columns(bending: float) -> np.ndarray:
        """Inertia, rate and deflection of the bristles, how a deflection at the start dies away, a constant."""
        z, path = deflected(body, bending), np.concatenate(([0.0], np.cumsum(np.abs(np.diff(body)))))
        each = (acceleration, _rate(time, z), z, np.exp(-bending * path))
        return np.stack([*map(passed, each), np.ones(len(target))], axis=1)

    def off(logarithm: float) -> float:
        x = columns(float(np.exp(logarithm)) / span)
        return float(np.sum((target - x @ solved(x.T @ x, x.T @ target)) ** 2))

    acceleration, target = _rate(time, _rate(time, body)), passed(force)
    best: Any = minimize_scalar(off, bounds=tuple(np.log(BENDING)), method="bounded", options={"xatol": 1e-3})
    x = columns(float(np.exp(best.x)) / span)
    solution = solved(x.T @ x, x.T @ target)
    without = [
        solved(x.T @ x - part.T @ part, x.T @ target - part.T @ own)[:3]
        for part, own in zip(np.array_split(x, BLOCKS), np.array_split(target, BLOCKS), strict=True)
    ]
    errors = np.std(without, axis=0) * np.sqrt(BLOCKS - 1)
    values = solution[:3] + np.array([between.beyond, 0.0, 0.0])
    return _Fit(values, errors, time[inside], passed(body), target, x @ solution)


def _rate(time: np.ndarray, signal: np.ndarray) -> np.ndarray:
    return CubicSpline(time, signal)(time, 1)


def deflected(position: np.ndarray, bending: float) -> np.ndarray:
    """Deflection [m] of bristles of that `bending` q [1/m] under a body at these positions [m], shape (n,), straight at
    first: exact between any two samples, dz = dx (1 - q z sign dx)."""
    moves = np.diff(position)
    ends = np.sign(moves) / bending
    kept = np.exp(-bending * np.abs(moves))
    steps = zip(ends.tolist(), kept.tolist(), strict=True)
    return np.array([*accumulate(steps, lambda z, step: step[0] + (z - step[0]) * step[1], initial=0.0)])
