"""Determine what the motion of a record can show: steady speeds for the Stribeck effect, sticking for the bristles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from friso.identification.inverse_model import FilteredMotion
from friso.identification.logs.checks import runs
from friso.identification.output_error.settings import settings
from friso.identification.readings.common import turns_of


@dataclass(frozen=True)
class Coverage:
    """Steady speeds and starts of motion in a record; they decide what a fit can show.

    `steady` has the mean speeds of pieces of steady motion [m/s], ascending. `starts` has an array for each stretch
    between turning points: the distances [m] covered at its samples, NaN where inertia outweighed friction.
    `resolution` [m] is the smallest visible displacement, `slowest` [m/s] the lowest visible speed.
    """

    steady: np.ndarray
    starts: tuple[np.ndarray, ...]
    resolution: float
    slowest: float

    def shows_speed(self, speed: float) -> bool:
        """Tell whether the record has steady motion near a speed [m/s], both below and above it.

        Friction falls around the Stribeck velocity; steady motion on one side of this velocity alone does not show the
        fall.
        """
        below = (self.steady >= speed / settings.speed_factor_of_coverage) & (self.steady < speed)
        above = (self.steady > speed) & (self.steady <= speed * settings.speed_factor_of_coverage)
        return bool(below.any() and above.any())

    @property
    def gap(self) -> tuple[float, float]:
        """Return the range of speeds [m/s], widest by ratio, in which there is no steady motion.

        The range lies between neighbouring steady speeds, or below the lowest. If there is no steady motion at all, its
        upper end is infinite. Speeds far below the highest count as rest, however little noise there is.
        """
        slowest = max(self.slowest, settings.speed_share_of_rest * float(self.steady.max(initial=0.0)))
        faster = self.steady[self.steady > slowest]
        speeds = np.concatenate([[slowest], faster]) if faster.size else np.array([slowest, np.inf])
        widest = int(np.argmax(speeds[1:] / speeds[:-1]))
        return float(speeds[widest]), float(speeds[widest + 1])

    def shows_length(self, length: float) -> bool:
        """Tell whether bristles are repeatedly seen bending by a length [m].

        The bend must stand out of the noise of the position over several samples of several starts, because one start
        may be chance.
        """
        least = settings.deviations_of_a_bend * self.resolution
        passes = [np.sum((distance > least) & (distance < length)) for distance in self.starts]
        return bool(sum(count >= settings.samples_of_a_bend for count in passes) >= settings.starts_with_a_bend)


def coverage(position: np.ndarray, moved: FilteredMotion, mass: float, coulomb: float, sample_time: float) -> Coverage:
    """Determine at which steady speeds, and from which starts, a record moves.

    `position` [m] has the shape (n,) and is sampled every `sample_time` [s]; `moved` is the filtered motion. Motion
    counts as steady where inertia, by `mass` [kg], stays below a fraction of the friction `coulomb` [N] for long
    enough.
    """
    rough = position - moved.position
    steps = np.abs(np.diff(position))
    quantum = steps[steps > 0].min() if (steps > 0).any() else 0.0
    resolution = max(float(np.std(rough)), float(quantum) / np.sqrt(12))
    length = max(1, round(settings.time_of_steady_motion / sample_time))
    slowest = resolution / (length * sample_time)
    calm = (mass * np.abs(moved.acceleration) < settings.friction_share_of_inertia * coulomb) & (
        np.abs(moved.velocity) > slowest
    )
    stretches = [stretch for stretch in runs(calm) if stretch.stop - stretch.start >= length]
    speeds = [_speeds(np.abs(moved.velocity[stretch]), length) for stretch in stretches]
    steady = np.sort(np.concatenate(speeds)) if speeds else np.zeros(0)
    starts = _starts(position, moved, mass / coulomb, settings.deviations_of_a_bend * resolution)
    return Coverage(steady, starts, resolution, slowest)


def _starts(position: np.ndarray, moved: FilteredMotion, mass_per_force: float, swing: float) -> tuple[np.ndarray, ...]:
    """Return the distances [m] covered since the last turning point, for each stretch.

    A stretch runs from one turning point to the next, and has one distance per sample. A reversal by less than `swing`
    [m] is no turning point. Distances are NaN at samples where inertia outweighs friction, because the force does not
    show the bristles there. `mass_per_force` is the mass over the Coulomb friction [kg/N].
    """
    ends = np.unique([0, *turns_of(position, swing)])
    calm = mass_per_force * np.abs(moved.acceleration) < settings.friction_share_of_inertia
    pieces = zip(ends, [*ends[1:], len(position)], strict=True)
    return tuple(np.where(calm[a:b], np.abs(position[a:b] - position[a]), np.nan) for a, b in pieces)


def _speeds(speed: np.ndarray, length: int) -> np.ndarray:
    """Cut the speeds of a stretch into pieces of about `length` samples; return the means [m/s]."""
    return np.array([piece.mean() for piece in np.array_split(speed, max(1, len(speed) // length))])
