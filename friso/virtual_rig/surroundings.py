"""Build the surroundings of the drive as tables.

Friction and motor constant are tables over position; floor and injected force are tables over time.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.special import exprel

from friso.engine.arrays import Tables
from friso.equations.rail import friction_factors
from friso.errors import InputError
from friso.stage.rig import Floor
from friso.virtual_rig.settings import settings
from friso.virtual_rig.task import MoveTask


def tables(flat: Mapping[str, Any], floor: Floor | None, task: MoveTask, seeds: Sequence[int]) -> Tables:
    """Return friction, motor constant, floor and injected force of runs as tables.

    Stages are given as flat keys to SI numbers or arrays of shape (runs,). `seeds` are the seeds of the runs' noise.
    Friction along a rail has a seed of its own, the stage's "rail.seed". If the runs do not differ, all share one
    table.
    """
    places, grid = _places(flat, task)
    varied = [key for key, value in flat.items() if key.startswith(("rail.", "drive.ripple")) and np.ndim(value)]
    over = [_over_places(_of_run(flat, run), places) for run in (range(len(seeds)) if varied else range(1))]
    times, per_second = _over_time(floor, task, seeds)
    return Tables(np.array(over), grid, times, np.array([per_second]))


def _of_run(flat: Mapping[str, Any], run: int) -> dict[str, Any]:
    return {key: value[run] if np.ndim(value) else value for key, value in flat.items()}


def _places(flat: Mapping[str, Any], task: MoveTask) -> tuple[np.ndarray, np.ndarray]:
    """Return the places [m] at which tables have points, and the grid that they form, (1, 2).

    The places reach beyond the reference on both sides. The grid holds the first place [m] and the points per metre.
    """
    low, high = task.span
    margin = max(settings.table_margin, settings.table_share * (high - low))
    lengths = [np.inf]
    for key, points in (
        ("rail.correlation_length", settings.points_per_length),
        ("drive.ripple_pitch", settings.points_per_wave),
    ):
        lengths += [float(np.min(flat[key])) / points] if key in flat else []
    if "rail.rolling_pitch" in flat:
        lengths.append(float(np.min(flat["rail.rolling_pitch"])) / (3 * settings.points_per_wave))
    step = min(lengths)
    count = 2 if step == np.inf else int(np.ceil((high - low + 2 * margin) / step)) + 2
    step = (high - low + 2 * margin) / (count - 1)
    return low - margin + step * np.arange(count), np.array([[low - margin, 1 / step]])


def _over_places(flat: Mapping[str, Any], places: np.ndarray) -> np.ndarray:
    """Return factors of static friction, Coulomb friction and motor constant, shape (3, places)."""
    ripple = 1 + flat.get("drive.ripple", 0.0) * np.cos(2 * np.pi * places / flat.get("drive.ripple_pitch", np.inf))
    return np.array([*friction_factors(flat, places), ripple])


def _over_time(floor: Floor | None, task: MoveTask, seeds: Sequence[int]) -> tuple[np.ndarray, float]:
    """Return injected force and floor acceleration over time, shape (runs or 1, 2, points).

    The second result is the number of points per second.
    """
    injected = task.injected.size > 0
    if floor is None and not injected:
        return np.zeros((1, 2, 2)), 0.0
    fine = [task.injected_each] if injected else []
    fine += [1 / (settings.points_per_period * floor.frequency[-1])] if floor else []
    interval = min(fine)
    count = int(np.ceil(task.duration / interval)) + 2
    inputs = np.zeros((len(seeds) if floor or task.injected.ndim > 1 else 1, 2, count))
    if injected:
        inputs[:, 0] = task.injected_at(np.arange(count) * interval)
    if floor:
        shaken = {seed: floor_acceleration(floor, count * interval, interval, seed)[:count] for seed in set(seeds)}
        inputs[:, 1] = [shaken[seed] for seed in seeds]
    return inputs, 1 / interval


FLOOR = int.from_bytes(b"floor")
"""Second half of the Philox key for random numbers of the floor's vibration."""


def floor_acceleration(floor: Floor, duration: float, interval: float, seed: int) -> np.ndarray:
    """Return a random acceleration of the floor [m/s^2], shape (n,), every `interval` [s].

    It lasts from 0 to `duration` [s], and is equal for equal `seed`. There is one wave per frequency of the Fourier
    transform. The variance of each wave is that of the spectrum in the band around it, so the total variance does not
    depend on the length of the record. Raises InputError for a spectrum that reaches beyond half the sampling
    frequency.
    """
    highest = floor.frequency[-1]
    if highest * interval > 0.5:
        expected = f"at most {0.5 / interval:g} Hz, half the sampling frequency"
        raise InputError("floor.frequency", f"{highest.text!r}", expected, 'frequency = ["1 Hz", "100 Hz"]')
    count = int(duration / interval * (1 + 1e-12)) + 1
    size = 1 << count.bit_length()
    step = 1 / (size * interval)
    waves = min(int(highest / step + 0.5), (size - 1) // 2) + 1
    edges = np.concatenate([[0.0], (np.arange(waves) + 0.5) * step])
    edges[-1] = max(edges[-1], highest)  # the last wave takes what lies beyond it
    rng = np.random.Generator(np.random.Philox(key=[seed, FLOOR]))
    cosine, sine = rng.standard_normal((2, waves)) * np.sqrt(np.diff(variance_below(floor, edges)))
    spectrum = np.zeros(size // 2 + 1, dtype=complex)
    spectrum[:waves] = (cosine - 1j * sine) / 2
    spectrum[0] = cosine[0]
    return np.fft.irfft(spectrum, size, norm="forward")[:count]


def variance_below(floor: Floor, frequencies: np.ndarray) -> np.ndarray:
    """Return the variance [m^2/s^4] of the floor's acceleration below frequencies [Hz].

    The result has the shape of `frequencies`.
    """
    total = np.zeros(len(frequencies))
    for (low, high), (first, last) in zip(pairwise(floor.frequency), pairwise(floor.acceleration), strict=True):
        slope = 2 * np.log(last / first) / np.log(high / low) + 1
        span = np.log(np.clip(frequencies, low, high) / low)
        total += first**2 * low * span * exprel(slope * span)
    return total
