"""From what the drive commands and the sensor sees to the bearing: force and motion of the body that rides on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import bilinear, lfilter, lfilter_zi

FINER = 8
"""Points per sample for what a mode of the structure does: a mode of a tenth of the sampling rate is off by 0.05 %."""


@dataclass(frozen=True)
class Mode:
    """The first mode of a structure: a `share` of the moving mass on a spring of its own, its frequency [Hz] and
    damping ratio."""

    share: float
    frequency: float
    damping_ratio: float


@dataclass(frozen=True)
class Between:
    """What lies between the force that is commanded and the bearing: its `delay` [s] (None: not known) and the
    `bandwidth` of the current loop [Hz]; the stiffness [N/m] of the `contact` that holds a joint, the share of the
    moving mass that is `beyond` it, and the stiffness [N/m] of the `joint` itself; the viscous friction [N s/m]; the
    `mode` of the structure, on the side of the force and the sensor."""

    delay: float | None = None
    bandwidth: float = np.inf
    contact: float = np.inf
    beyond: float = 0.0
    joint: float = 0.0
    viscous: float = 0.0
    mode: Mode | None = None


DIRECT = Between()
"""Nothing lies between; the delay is not known."""


def at_bearing(
    time: np.ndarray,
    position: np.ndarray,
    command: np.ndarray,
    between: Between,
    mass: float,
    bent: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Position [m] of the body on the bearing and the force [N] that reaches it, from the position of the sensor and
    the commanded force over time [s], all of shape (n,), of a machine that moves a mass [kg]: the force less the
    inertia of what it moves before, its mode included. `bent` is the deflection of the joint where it is measured; else
    the contact gives way."""
    acceleration = rate_of(time, rate_of(time, position))
    force = _arrived(time, command, between) - between.beyond * mass * acceleration
    if between.mode is not None:
        lag = _followed(time, acceleration, between.mode) - acceleration
        force = force - between.mode.share * mass * lag
    return position - (force / between.contact if bent is None else bent), force


def rate_of(time: np.ndarray, signal: np.ndarray) -> np.ndarray:
    """Time derivative of a signal, shape (n,), by a spline."""
    return CubicSpline(time, signal)(time, 1)


def _arrived(time: np.ndarray, command: np.ndarray, between: Between) -> np.ndarray:
    """The force [N] that a command [N], shape (n,), has become: late by the delay and by the current loop."""
    late = CubicSpline(time, command)(np.maximum(time - (between.delay or 0.0), time[0]))
    if not np.isfinite(between.bandwidth):
        return late
    ratio = 1 / (np.pi * between.bandwidth * (time[1] - time[0]))
    b, a = np.array([1.0, 1.0]) / (1 + ratio), np.array([1.0, (1 - ratio) / (1 + ratio)])
    return lfilter(b, a, late, zi=lfilter_zi(b, a) * late[0])[0]


def _followed(time: np.ndarray, acceleration: np.ndarray, mode: Mode) -> np.ndarray:
    """Acceleration of the mass of a mode whose base moves with an acceleration [m/s^2], shape (n,)."""
    omega, each = 2 * np.pi * mode.frequency, float(time[1] - time[0]) / FINER
    fine = CubicSpline(time, acceleration)(np.linspace(time[0], time[-1], (len(time) - 1) * FINER + 1))
    damping = 2 * mode.damping_ratio * omega
    b, a = bilinear([damping, omega**2], [1.0, damping, omega**2], 1 / each)
    return lfilter(b, a, fine, zi=lfilter_zi(b, a) * fine[0])[0][::FINER]
