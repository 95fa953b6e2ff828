"""Find force ramps from rest until the body moves off, and read the friction at the start of motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from friso.identification.logs.log import Log
from friso.identification.readings.common import channel, low_pass, on_bearing
from friso.identification.readings.peaks import peak, smoothed
from friso.identification.readings.settings import settings
from friso.identification.readings.slips import slips


@dataclass(frozen=True)
class Ramps:
    """Ramps of the force from rest, each until the body moves off.

    Per ramp, shape (n,), there are time [s], place [m], direction, break-away force [N] in this direction, force rate
    [N/s], the break-away force's error [N] by noise and smoothing to either side, its possible excess [N] if the mass
    is not known, and the body's highest speed [m/s] until break-away. `threshold` [m/s] is the speed at which motion
    counts.
    """

    times: np.ndarray
    places: np.ndarray
    directions: np.ndarray
    forces: np.ndarray
    rates: np.ndarray
    unsure: np.ndarray
    late: np.ndarray
    speeds: np.ndarray
    threshold: float
    notes: tuple[str, ...]


def force_ramps(log: Log, mass: float = 0.0) -> Ramps:
    """Find the ramps of the force in a log, each from rest of the body on the bearing.

    With the moving `mass` [kg], the break-away force is the greatest friction (force minus inertia) as motion begins,
    the published definition. Without, it is the force at which motion becomes visible, which contains inertia. Raises
    InputError for a missing channel.
    """
    force, body = channel(log, "force"), on_bearing(log)
    rows: list[tuple[float, ...]] = []
    threshold, quick, stops = 0.0, 0, 0
    for part in log.segments:
        if part.stop - part.start < settings.samples_with_a_ramp:
            continue
        breaks = slips(body[part], log.sample_time, settings.low_pass_of_ramps)
        threshold = max(threshold, breaks.threshold)
        pushed = low_pass(force[part], log.sample_time, settings.low_pass_of_ramps)
        marks = zip(breaks.onsets, breaks.starts, breaks.rests, breaks.fastest, breaks.directions, strict=True)
        for onset, start, rest, fastest, direction in marks:
            push = direction * force[part][rest : start + 1]
            if _lowest(push) > settings.force_share_of_a_start * float(direction * pushed[start]) > 0:
                stops += 1
                continue
            begin, shortest = (
                rest + _half(push),
                max(
                    settings.periods_of_a_ramp / (settings.low_pass_of_ramps * log.sample_time),
                    settings.samples_of_a_ramp,
                ),
            )
            before = pushed[max(rest, start - round(shortest))]
            if start - begin < shortest or direction * (2 * before - pushed[rest] - pushed[start]) < 0:
                quick += 1
                continue
            rising = direction * np.polyfit(np.arange(begin, start) * log.sample_time, pushed[begin:start], 1)[0]
            at, level, unsure, late = onset, float(direction * pushed[onset]), 0.0, 0.0
            if rising > 0:
                # friction opposes the motion, so the force's impulse is at least mass times speed
                heaviest = direction * float(pushed[onset:fastest].sum()) * log.sample_time / abs(breaks.speed[fastest])
                signals = direction * force[part], direction * body[part]
                top = peak(
                    *signals, mass or heaviest, log.sample_time, rising, (begin, start), settings.low_pass_of_ramps
                )
                if mass:
                    at, level, unsure = top.at, top.level, top.unsure
                else:
                    late = max(level - top.level + top.unsure, 0.0)
            first = part.start + at
            place = float(log.time[first]), float(body[first]), float(direction)
            rows.append((*place, level, float(rising), unsure, late, abs(float(breaks.speed[start]))))
    table = np.array([row for row in rows if row[3] > 0 and row[4] > 0]).reshape(-1, 8).T
    notes = []
    if quick:
        notes.append(
            f"{quick} ramps rise too fast for a low-pass at {settings.low_pass_of_ramps:g} Hz (or the sampling) and "
            "are left out."
        )
    if stops:
        notes.append(f"{stops} motions continued after a stop within a ramp and are left out: they began from no rest.")
    if len(rows) > table.shape[1]:
        notes.append(f"{len(rows) - table.shape[1]} motions did not begin under a rising force and are left out.")
    times, places, directions, forces, rates, unsure, late, speeds = table
    return Ramps(times, places, directions, forces, rates, unsure, late, speeds, threshold, tuple(notes))


def _lowest(push: np.ndarray) -> float:
    """Return the smallest smoothed force [N] on a body during its rest before a motion."""
    return float(smoothed(push, len(push) / settings.smoothing_of_a_ramp).min())


def _half(push: np.ndarray) -> int:
    """Return the last sample at which a smoothed force is at most the mean of its end values."""
    smooth = smoothed(push, len(push) / settings.smoothing_of_a_ramp)
    return int(np.flatnonzero(smooth <= (smooth[0] + smooth[-1]) / 2)[-1])
