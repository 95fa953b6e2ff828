"""Find force and motion among channels by mechanics: a force accelerates a mass and overcomes its friction.

Each pair of channels is read as force and position, and as force and velocity: force = M a + F_v v + F_c sign(v) +
offset is fitted at several time scales, without units, because a factor changes nothing. With the right channels, the
fit leaves little of the force on any scale, and inertia and friction have equal signs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.signal import correlate

from friso.identification.logs.channel import Channel
from friso.identification.logs.checks import rises_evenly
from friso.identification.logs.settings import settings

KINDS = ("position", "velocity")
"""Kinds of motion channels, with the number of derivatives that lead to a velocity."""


@dataclass(frozen=True)
class MotionReading:
    """Two channels read as a force and the motion that it causes.

    `kind` tells whether the motion is a position or a velocity. `unexplained` is the fraction of the force's variance
    that inertia and friction leave, the mean over time scales; 1 if their signs contradict each other. `sign` is -1 if
    the force acts against the motion. `doubt` is 1 if the force is proportional to the acceleration alone, 2 if it is
    proportional to the velocity alone at some time scale, and 4 more if the sign is -1.
    """

    force: Channel
    motion: Channel
    kind: str
    unexplained: float
    sign: int = 1
    doubt: int = 0

    def channel(self, role: str) -> Channel | None:
        """Return the channel to which this reading gives a role; None for other roles."""
        return self.force if role == "force" else self.motion if role == self.kind else None


def motion_readings(forces: Sequence[Channel], motions: Sequence[tuple[Channel, str]]) -> list[MotionReading]:
    """Fit every force with every motion (a channel and its kind); the best reading comes first.

    Readings that mechanics refutes come last; before them, readings in which the force opposes the motion, or is
    proportional to velocity or acceleration alone (one channel may be the reference or the derivative of the other).
    """
    signals = {id(channel): _filled(channel) for channel in (*forces, *(motion for motion, _ in motions))}
    readings = []
    for force, (motion, kind) in product(forces, motions):
        values, moved = signals[id(force)], signals[id(motion)]
        if force is not motion and values is not None and moved is not None and len(values) == len(moved):
            readings.append(_reading(force, motion, kind, values, moved))
    refuted = settings.share_left_by_a_reading
    return sorted(readings, key=lambda one: (one.unexplained > refuted, one.doubt, one.unexplained))


def with_positions_first(readings: Sequence[MotionReading]) -> list[MotionReading]:
    """Move a position first whose derivative is the velocity of the best reading.

    A position contains all that its derivative contains, and also the micrometres of bending bristles.
    """
    best, refuted = readings[0], settings.share_left_by_a_reading
    as_good = [one for one in readings if one.doubt == best.doubt and one.unexplained <= refuted]
    first = [one for one in as_good if one.force is best.force and _is_integral(one, best)]
    return [*first, *(one for one in readings if one not in first)]


def _is_integral(one: MotionReading, best: MotionReading) -> bool:
    """Tell whether a reading's position has the best reading's velocity as its derivative."""
    signals = [_filled(one.motion), _filled(best.motion)]
    if one.kind != "position" or best.kind != "velocity" or any(signal is None for signal in signals):
        return False
    place, speed = (signal for signal in signals if signal is not None)
    if len(place) != len(speed):
        return False
    columns = np.stack([np.cumsum(speed), np.arange(len(speed)), np.ones_like(speed)], axis=1)
    columns /= np.abs(columns).max(axis=0)
    solution, *_ = np.linalg.lstsq(columns, place, rcond=None)
    correlation = np.corrcoef(place - columns[:, 1:] @ solution[1:], columns[:, 0])[0, 1]
    return bool(correlation > settings.correlation_of_a_pair)


def is_ramp(channel: Channel) -> bool:
    """Tell whether a channel rises with every sample, as a counter or a clock with jitter does."""
    finite = channel.values[np.isfinite(channel.values)]
    if len(finite) < settings.samples_of_a_pair or not (np.diff(finite) > 0).all():
        return False
    line = np.linspace(finite[0], finite[-1], len(finite))
    off = float(np.abs(finite - line).max())
    return rises_evenly(finite) or off < settings.range_share_off_a_clock * float(np.ptp(finite))


def is_counter(channel: Channel) -> bool:
    """Tell whether a channel counts samples: it rises by 1 from whole number to whole number."""
    return len(channel.values) > 1 and bool((np.diff(channel.values) == 1).all()) and channel.values[0] % 1 == 0


def leads(one: Channel, other: Channel) -> bool:
    """Tell whether a channel runs ahead of another with a similar motion, as a reference does.

    The velocities of both correlate best if the other is shifted back by a sample or more, up to a tenth of the record.
    """
    signals = [_filled(one), _filled(other)]
    size = len(one.values)
    if size != len(other.values) or any(signal is None for signal in signals):
        return False
    width = settings.samples_of_a_scale
    first, second = (gaussian_filter1d(signal, width, order=1) for signal in signals if signal is not None)
    products = correlate(second - second.mean(), first - first.mean(), method="fft")
    shift = int(np.argmax(products[size - 1 - size // 10 : size + size // 10])) - size // 10
    return shift >= 1


def _filled(channel: Channel) -> np.ndarray | None:
    """Return a channel's values minus their mean, over their range; lost ones interpolated.

    Returns None for a channel with few values, or a constant one.
    """
    finite = np.isfinite(channel.values)
    if finite.sum() < settings.samples_of_a_reading or not np.ptp(channel.values[finite]) > 0:
        return None
    places = np.arange(len(channel.values))
    with np.errstate(all="ignore"):
        values = np.interp(places, places[finite], channel.values[finite])
        values = (values - values.mean()) / np.ptp(values) if channel.values.max() < np.inf else values
    return values if np.isfinite(values).all() else None


def _reading(force: Channel, motion: Channel, kind: str, values: np.ndarray, moved: np.ndarray) -> MotionReading:
    """Fit inertia and friction to a pair of channels, at several time scales.

    `values` and `moved`, shape (n,), are the samples of force and motion, without gaps. `kind` tells whether the motion
    is a position or a velocity.
    """
    rows = []
    while len(values) >= settings.samples_of_a_reading:
        rows += [row for row in [_fitted(values, moved, kind)] if row is not None]
        even = len(values) // 2 * 2
        values, moved = (array[:even].reshape(-1, 2).mean(axis=1) for array in (values, moved))
    if not rows:
        return MotionReading(force, motion, kind, 1.0)
    left, inertia, friction, alike = np.array(rows).T
    mean = float(np.where(inertia * friction >= 0, left, 1.0).mean())
    against = float(np.sum((1 - left) * (inertia + friction))) < 0
    same, size = settings.correlation_of_a_pair, np.abs(inertia) + np.abs(friction)
    alone = 1 if (np.abs(inertia) > same * size).all() else 2 if alike.max() > same else 0
    return MotionReading(force, motion, kind, mean, -1 if against else 1, alone + 4 * against)


def _fitted(values: np.ndarray, moved: np.ndarray, kind: str) -> tuple[float, float, float, float] | None:
    """Fit inertia and friction at one time scale; None if hardly anything moves.

    Returns the remaining fraction of the variance, the sizes of inertia and friction with their signs, and the
    correlation of the force with the velocity.
    """
    width, order = settings.samples_of_a_scale, 1 - KINDS.index(kind)
    edge, step = int(4 * width), max(1, len(values) // settings.rows_of_a_scale)
    inner = slice(edge, -edge, step)
    push = gaussian_filter1d(values, width)[inner]
    velocity, acceleration = (gaussian_filter1d(moved, width, order=order + more)[inner] for more in (0, 1))
    moves = np.abs(velocity) > settings.speed_share_of_a_rest * np.percentile(np.abs(velocity), 99)
    push, velocity, acceleration = push[moves], velocity[moves], acceleration[moves]
    if len(push) < settings.samples_of_a_pair or not np.var(push) > 0:
        return None
    columns = np.stack([acceleration, velocity, np.sign(velocity), np.ones_like(velocity)], axis=1)
    columns /= np.maximum(np.abs(columns).max(axis=0), np.finfo(float).tiny)
    solution, *_ = np.linalg.lstsq(columns, push, rcond=1e-9)
    left = float(np.var(push - columns @ solution) / np.var(push))
    friction = float(solution[1] * np.std(columns[:, 1]) + solution[2] * np.std(columns[:, 2]))
    alike = abs(float(np.corrcoef(push, velocity)[0, 1])) if np.var(velocity) > 0 else 0.0
    return left, float(solution[0] * np.std(columns[:, 0])), friction, alike
