"""What a record's motion can show at all: slow steady speeds for the Stribeck effect, stuck phases for the bristles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from friso.identification.inverse_model import FilteredMotion
from friso.identification.output_error.settings import OutputErrorSettings
from friso.identification.readings.common import turns_of


@dataclass(frozen=True)
class Coverage:
    """What the motion of a record covers: steady speeds, and starts of motions.

    `steady` holds speeds of steady motion [m/s], ascending, one per stretch. `starts` holds, for each stretch between
    turning points, the ways [m] gone at its samples, NaN where inertia outweighed friction. Below `resolution` [m] of
    position nothing is seen, below `slowest` [m/s] no speed.
    """

    steady: np.ndarray
    starts: tuple[np.ndarray, ...]
    resolution: float
    slowest: float

    def shows_speed(self, speed: float) -> bool:
        """Tell whether there is steady motion both below and above a speed [m/s], near it.

        A Stribeck velocity shows in how friction falls about it, and steady motion on one side of it shows no fall.
        """
        settings = OutputErrorSettings.current()
        below = (self.steady >= speed / settings.speed_factor_of_coverage) & (self.steady < speed)
        above = (self.steady > speed) & (self.steady <= speed * settings.speed_factor_of_coverage)
        return bool(below.any() and above.any())

    @property
    def gap(self) -> tuple[float, float]:
        """The widest range of speeds [m/s] without steady motion."""
        speeds = np.concatenate([[self.slowest], self.steady]) if self.steady.size else np.array([self.slowest, np.inf])
        widest = int(np.argmax(speeds[1:] / speeds[:-1]))
        return float(speeds[widest]), float(speeds[widest + 1])

    def shows_length(self, length: float) -> bool:
        """Tell whether bristles are seen bending by a length [m], again and again.

        The bend has to stand out of the noise of the position over several samples of several starts: one start may be
        chance.
        """
        settings = OutputErrorSettings.current()
        passes = [
            np.sum((distance > settings.deviations_of_a_bend * self.resolution) & (distance < length))
            for distance in self.starts
        ]
        return bool(sum(count >= settings.samples_of_a_bend for count in passes) >= settings.starts_with_a_bend)


def coverage(position: np.ndarray, moved: FilteredMotion, mass: float, coulomb: float, sample_time: float) -> Coverage:
    """Find what a motion covers: at which speeds it is steady, and how its starts go.

    The motion, of shape (n,), is that of a mass [kg] with a Coulomb friction [N], sampled every `sample_time` [s]. It
    is steady where inertia stays below a share of that friction for long enough.
    """
    settings = OutputErrorSettings.current()
    rough = position - moved.position
    steps = np.abs(np.diff(position))
    quantum = steps[steps > 0].min() if (steps > 0).any() else 0.0
    resolution = max(float(np.std(rough)), float(quantum) / np.sqrt(12))
    length = max(1, round(settings.time_of_steady_motion / sample_time))
    slowest = resolution / (length * sample_time)
    calm = (mass * np.abs(moved.acceleration) < settings.friction_share_of_inertia * coulomb) & (
        np.abs(moved.velocity) > slowest
    )
    edges = np.flatnonzero(np.diff(np.concatenate([[False], calm, [False]]).astype(int)))
    stretches = [(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a >= length]
    speeds = [_speeds(np.abs(moved.velocity[a:b]), length) for a, b in stretches]
    steady = np.sort(np.concatenate(speeds)) if speeds else np.zeros(0)
    return Coverage(
        steady,
        _starts(position, moved, mass / coulomb, settings.deviations_of_a_bend * resolution),
        resolution,
        slowest,
    )


def _starts(position: np.ndarray, moved: FilteredMotion, mass_per_force: float, swing: float) -> tuple[np.ndarray, ...]:
    """Return the ways [m] gone from each turning point to the next, where inertia was small.

    A swing that is less than `swing` [m] turns nothing. Samples at which inertia outweighs friction are NaN: the force
    does not show the bristles there.
    """
    ends = np.unique([0, *turns_of(position, swing)])
    calm = mass_per_force * np.abs(moved.acceleration) < OutputErrorSettings.current().friction_share_of_inertia
    pieces = zip(ends, [*ends[1:], len(position)], strict=True)
    return tuple(np.where(calm[a:b], np.abs(position[a:b] - position[a]), np.nan) for a, b in pieces)


def _speeds(speed: np.ndarray, length: int) -> np.ndarray:
    """Return the mean speeds [m/s] of the pieces of a stretch, each of about `length` samples."""
    return np.array([piece.mean() for piece in np.array_split(speed, max(1, len(speed) // length))])
