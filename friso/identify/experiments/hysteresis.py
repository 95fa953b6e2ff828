"""Stiffness from the slopes of hysteresis loops: bristles before sliding, or the joint with the cart stuck.

After a reversal the force of bristles bends off exponentially with the displacement d (LuGre before sliding; Astrom,
Canudas de Wit 2008, doi:10.1109/MCS.2008.929425), F = F_r + S (1 - exp(-q d))/q: its slope is S just after the reversal
and S - q |F_r| where the friction passes 0. There it is the stiffness of the bristles, while just after the reversal it
is larger, sigma_0 (1 + |F_r|/F_s). A spring has q = 0, and one slope.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import find_peaks

from friso.errors import InputError
from friso.identify.estimate import Estimate
from friso.identify.experiments.common import (
    by_t,
    channel,
    correlated_mean,
    deflection,
    low_pass,
    on_bearing,
    robust,
    ways,
)
from friso.identify.logs.log import Log

CUTOFF = 50.0
"""Low-pass of position and force [Hz]: loops are driven slowly, inertia must not enter."""

LEAST = 20
"""Samples of a branch from which it is fitted."""

BOUNDS = ((-1.0, -5.0, -np.inf), (1.0, 50.0, np.inf))
"""Of the fit of a branch: start and slope over its force, bending over its length; far beyond what any spring does."""

Spring = Literal["bristles", "joint"]
_KEYS = {"bristles": "friction.bristle_stiffness", "joint": "joint.stiffness"}


@dataclass(frozen=True)
class Branch:
    """From one reversal to the next: `time` [s], `position` [m] and `force` [N] at its start, its direction; slopes
    [N/m] just after it and where the friction passes 0 (offset taken out), and the bending q [1/m]."""

    time: float
    position: float
    force: float
    direction: int
    first_slope: float
    slope: float
    bending: float


@dataclass(frozen=True)
class HysteresisStiffness:
    """The stiffness [N/m] where the friction force passes 0, in all and after reversals to either side, and the mean
    slope just after reversals extrapolated to zero displacement; the branches; low-passed position and force."""

    stiffness: Estimate
    forward: Estimate
    backward: Estimate
    first_slope: Estimate
    branches: tuple[Branch, ...]
    position: np.ndarray
    force: np.ndarray
    warnings: tuple[str, ...]


def stiffness_from_hysteresis(log: Log, spring: Spring = "bristles", cutoff: float = CUTOFF) -> HysteresisStiffness:
    """Stiffness from the slopes after reversals, of force over the position of the body on the bearing ("bristles") or
    over the deflection of the joint ("joint", the position where that is not measured), low-passed at `cutoff` [Hz].

    Fewer than two branches leave it unknown. Raises InputError for a missing channel or another spring.
    """
    if spring not in _KEYS:
        raise InputError("spring", repr(spring), '"bristles" or "joint"', "bristles", log.name)
    force = channel(log, "force")
    measured = deflection(log) if spring == "joint" else on_bearing(log)
    position = channel(log, "position") if measured is None else measured
    branches: list[Branch] = []
    smooth = [
        np.concatenate([low_pass(x[s], log.sample_time, cutoff) for s in log.segments]) for x in (position, force)
    ]
    for part in log.segments:
        branches += _branches(log, part, smooth[0], smooth[1], robust(np.diff(position[part], 2)) / 6**0.5)
    values = np.array([[b.slope, b.first_slope, b.direction] for b in branches]).reshape(-1, 3)
    key = _KEYS[spring]
    both = [_mean(key, values[m, 0], f"slopes of {words} branches") for words, m in ways(values[:, 2])]
    every = _mean(key, values[:, 0], "slopes of hysteresis branches where the friction passes 0")
    first = _mean("slope after reversal", values[:, 1], "slopes of branches, extrapolated to zero displacement")
    said = _warnings(branches, spring)
    return HysteresisStiffness(every, both[0], both[1], first, tuple(branches), smooth[0], smooth[1], said)


def _mean(name: str, values: np.ndarray, method: str) -> Estimate:
    if len(values) < 2:
        return Estimate.unknown(name, "N/m", method, f"{len(values)} branches between reversals: 2 are needed")
    return by_t(name, "N/m", correlated_mean(values), method)


def _branches(log: Log, part: slice, position: np.ndarray, force: np.ndarray, noise: float) -> list[Branch]:
    """The fitted branches of one segment: between extremes that stand out of the noise and of the whole range."""
    x, f = position[part], force[part]
    height = max(8 * noise, 0.05 * float(np.ptp(x)))
    if not height > 0:
        return []
    turns = np.sort(np.concatenate([find_peaks(sign * x, prominence=height)[0] for sign in (1, -1)]))
    found = []
    centre = float(np.mean([np.max(f), np.min(f)]))
    for start, end in pairwise(turns):
        if end - start >= LEAST and np.ptp(f[start : end + 1]) > 0:
            found.append(_branch(float(log.time[part.start + start]), x[start : end + 1], f[start : end + 1], centre))
    return found


def _branch(time: float, x: np.ndarray, f: np.ndarray, centre: float) -> Branch:
    """Least squares of F_r + S (1 - exp(-q d))/q; the ends, where the motion is slowest, weigh as they are sampled."""
    way = 1 if x[-1] > x[0] else -1
    d, rise = way * (x - x[0]), way * (f - f[0])
    scale, top = float(d.max()), float(np.ptp(rise))

    def off(p: np.ndarray) -> np.ndarray:
        bent = d / scale if abs(p[1]) < 1e-9 else -np.expm1(-p[1] * d / scale) / p[1]
        return (p[0] + p[2] * bent) - rise / top

    start, bend, slope = least_squares(off, [0.0, 0.5, 1.0], bounds=BOUNDS).x * [top, 1 / scale, top / scale]
    force = f[0] + way * start
    return Branch(float(time), float(x[0]), float(force), way, slope, slope + way * bend * (force - centre), bend)


def _warnings(branches: list[Branch], spring: Spring) -> tuple[str, ...]:
    if spring == "bristles" and branches and all(abs(b.slope - b.first_slope) < 0.05 * b.first_slope for b in branches):
        return ("The loops are hardly open: a spring in series or parallel would look the same as bristles.",)
    return ()
