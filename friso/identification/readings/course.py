"""Describe a log whose kind of experiment is not stated: whether its reference moves, and what repeats."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d, uniform_filter1d

from friso.errors import InputError
from friso.identification.logs.checks import runs
from friso.identification.logs.log import Log
from friso.identification.output_error.parameters import bends
from friso.identification.readings.friction_velocity import SPEEDS_OF_A_LINE, distinct
from friso.identification.readings.motion_events import Pass, force_ramps, passes
from friso.identification.response.records import find_periods


@dataclass(frozen=True)
class Repetition:
    """How a signal in a log repeats.

    `samples` is the length of a period, `harmonics` the effective number of harmonics in it, and `turns` the number of
    changes of direction. The position rests for the fraction `rests` of the time.
    """

    samples: int
    harmonics: float
    turns: int
    rests: float


FEWEST_RAMPS = 3
"""Fewest ramps that determine static friction, or contradict a fit."""

VARIANCE_SHARE_OF_BRISTLES = 0.25
"""Smallest fraction of the force's variance that the position must explain before a fit of bristles is tried."""

SAMPLES_OF_A_BLUR = 20
"""Number of samples over which a position is averaged, against noise, before its travel is summed."""

SHARE_OF_MOST_OF_A_WAY = 0.75
"""Fraction of the way that counts as most of the way. Moves cover a sixth to a half at constant speed."""

LOG_SHARE_OF_RAMPS = 0.25
"""Smallest fraction of a log that force ramps must take together. The starts of moves take a few per cent."""

FORCE_SHARE_OFF_A_LINE = 0.1
"""Largest deviation of a ramp from a line, relative to its break-away force."""

FORCE_SHARE_BEFORE_A_RAMP = 0.05
"""Largest force before a ramp, relative to the ramp's. An integrator passes zero without a rest."""

LOG_SHARE_OF_A_REST = 0.01
"""Shortest rest of a position, relative to the log."""

RESTS_OF_MOVES = 0.1
"""Fraction of time at rest above which a repeating log consists of moves."""

HARMONICS_OF_AN_EXCITATION = 7.0
"""Effective number of harmonics above which a log is a broad-band excitation. Moves have 1 to 7."""


@dataclass(frozen=True)
class Course:
    """What a log shows of its motion, from which its kind of experiment is recognised."""

    log: Log

    @property
    def reference_moves(self) -> bool:
        """Tell whether there is a reference that is not constant."""
        return "reference" in self.log and bool(np.ptp(self.log["reference"][self.log.longest]) > 0)

    @property
    def signal(self) -> str:
        """Return the role of the driving signal: injected force, moving reference, or force."""
        return external(self.log) or "force"

    @cached_property
    def repetition(self) -> Repetition | None:
        """Return how the driving signal repeats; None if it does not."""
        part = self.log.longest
        try:
            periods = find_periods(self.log[self.signal][part])
        except InputError:
            return None
        period = periods.cut(self.log[self.signal][part]).mean(axis=0)
        moved = self.log["position"][part][periods.start : periods.stop]
        return Repetition(periods.samples, _harmonics(period), _turns(period), _rest(moved, periods.samples))

    @cached_property
    def moves(self) -> str | None:
        """Return why a log holds moves of any size; None for an experiment that drives the body in a way of its own.

        The reference of such a log moves. Otherwise it has no series of constant speeds or force ramps, and its driving
        signal must meet one of two conditions. It does not repeat, and the log has no reference; or it repeats with
        rests in between, or with few frequencies, as sines do.
        """
        if self.reference_moves:
            return "its reference moves"
        if distinct(self.speeds) >= SPEEDS_OF_A_LINE or self.ramps >= FEWEST_RAMPS:
            return None
        repetition = self.repetition
        if repetition is None:
            standing = "reference" in self.log
            return None if standing else f"the {self.signal} does not repeat, and there is no reference that moves"
        if repetition.rests > RESTS_OF_MOVES:
            return f"{self.repeats}, but the position rests in between"
        if repetition.harmonics < HARMONICS_OF_AN_EXCITATION:
            return f"{self.repeats}, but contains few frequencies"
        return None

    @cached_property
    def may_stick(self) -> bool:
        """Tell whether the body moves within what bristles bend, and its place explains most of the force.

        A body that slides there and back may look alike, if a controller holds its friction while it rests.
        """
        part = self.log.longest
        position, force = self.log["position"][part], self.log["force"][part]
        if not (0 < np.ptp(position) < 2 * bends(self.log.axis)[1] and np.ptp(force) > 0):
            return False
        least = VARIANCE_SHARE_OF_BRISTLES
        return float(np.corrcoef(position, force)[0, 1]) > np.sqrt(least)

    @cached_property
    def speeds(self) -> np.ndarray:
        """Return the constant speeds [m/s], shape (n,), at which a body slides over most of its way.

        The result is empty if they cover less of the way, if a reference moves, or if the position has no SI unit.
        """
        part, position = self.log.longest, self.log["position"]
        try:
            stretches = [] if self.reference_moves else passes(self.log.per_unit_of_force())
        except InputError:
            return np.zeros(0)
        steady = [stretch for stretch in stretches if stretch.steady and self._slides(stretch)]
        way = float(np.abs(np.diff(uniform_filter1d(position[part], SAMPLES_OF_A_BLUR))).sum())
        gone = sum(float(np.ptp(position[stretch.span])) for stretch in steady)
        return np.array([abs(stretch.velocity) for stretch in steady if gone > SHARE_OF_MOST_OF_A_WAY * way])

    @cached_property
    def ramps(self) -> int:
        """Return how often the force rises evenly from zero until the body moves off.

        The result is 0 if ramps are a small part of the log, if a reference moves, or if the position has no SI unit.
        """
        log = self.log
        try:
            shown = None if self.reference_moves else force_ramps(log.per_unit_of_force())
        except InputError:
            return 0
        if shown is None:
            return 0
        rows = zip(shown.times, shown.directions * shown.forces, shown.forces / shown.rates, strict=True)
        even = [lasts for at, force, lasts in rows if self._from_none(at, force, lasts)]
        return len(even) if sum(even) > LOG_SHARE_OF_RAMPS * len(log.time) * log.sample_time else 0

    def _from_none(self, at: float, force: float, lasts: float) -> bool:
        """Tell whether the force rests at zero and then rises evenly until the time `at` [s].

        The rise to `force` lasts for `lasts` [s].
        """

        def mean(first: float, last: float) -> float:
            """Return the mean force over a part of the rise, relative to the force at its end."""
            edges = np.searchsorted(self.log.time, at - lasts * (1 - np.array([first, last])))
            values = self.log["force"][edges[0] : edges[1]]
            return float(values.mean()) / force if values.size else 0.0

        on_line = abs(mean(0.2, 0.3) - 0.25) < FORCE_SHARE_OFF_A_LINE
        return on_line and abs(mean(-0.2, -0.1)) < FORCE_SHARE_BEFORE_A_RAMP

    @property
    def one_way(self) -> bool:
        """Tell whether most of the way goes in one direction, with or without stops."""
        position = uniform_filter1d(self.log["position"][self.log.longest], SAMPLES_OF_A_BLUR)
        return bool(np.ptp(position) > SHARE_OF_MOST_OF_A_WAY * np.abs(np.diff(position)).sum())

    def _slides(self, stretch: Pass) -> bool:
        """Tell whether a body slides in a stretch: the force changes there by less than its mean.

        Otherwise a spring, such as bristles before sliding, determines the speed.
        """
        force = self.log["force"][stretch.span]
        half = len(force) // 2
        return bool(abs(force[half:].mean() - force[:half].mean()) < abs(force.mean()))

    @cached_property
    def against_a_spring(self) -> bool:
        """Tell whether the position rests at several places, with a force that rises with it."""
        part = self.log.longest
        position, force = self.log["position"][part], self.log["force"][part]
        size = max(int(LOG_SHARE_OF_A_REST * len(position)), 2)
        rests = [rest for rest in runs(_still(position, size)) if rest.stop - rest.start > size]
        later = [slice((rest.start + rest.stop) // 2, rest.stop) for rest in rests]
        places, forces = (np.array([values[rest].mean() for rest in later]) for values in (position, force))
        return _on_a_spring(places, forces)

    @property
    def repeats(self) -> str:
        """Return in words which signal repeats, and after how many samples; "" if none does."""
        repetition = self.repetition
        return f"the {self.signal} repeats every {repetition.samples} samples" if repetition else ""

    @property
    def rests(self) -> bool:
        """Tell whether the reference stands still, nothing in the log repeats, and the position does not wander off."""
        if self.repetition is not None or self.reference_moves or "position" not in self.log:
            return False
        halves = np.array_split(self.log["position"][self.log.longest], 2)
        return abs(float(halves[1].mean() - halves[0].mean())) < max(float(half.std()) for half in halves)

    @property
    def words(self) -> str:
        """Describe in words what repeats in the log, with its harmonics and reversals."""
        repetition = self.repetition
        if repetition is None:
            return "a log whose reference stands still, with nothing periodic in it"
        between = f"has about {repetition.harmonics:.0f} harmonics and {repetition.turns} reversals per period"
        return f"a log in which {self.repeats}, {between}"


PLACES_OF_A_SPRING = 4
"""Fewest rest positions that show a spring."""

TRAVEL_SHARE_OF_A_REST = 0.01
"""Largest motion of a position at rest, relative to the travel."""

RETURNS_TO_A_PLACE = 2
"""Fewest places reached from both sides that show a spring."""

HYSTERESIS_OF_A_SPRING = 0.05
"""Largest difference of a spring's force between both sides, relative to its range. Friction differs by more."""

VARIANCE_SHARE_OF_A_SPRING = 0.99
"""Smallest fraction of the force's variance between rests that position must explain for a spring to act."""


def _on_a_spring(places: np.ndarray, forces: np.ndarray) -> bool:
    """Tell whether forces at successive rest positions, shape (n,), rise as a spring's do."""
    if len(places) < PLACES_OF_A_SPRING or not (np.ptp(places) > 0 and np.ptp(forces) > 0):
        return False
    order = np.argsort(places)
    near = 2 * TRAVEL_SHARE_OF_A_REST * np.ptp(places)
    alike = np.split(order, np.flatnonzero(np.diff(places[order]) > near) + 1)
    upward = np.diff(places, prepend=np.nan)
    sides = [(forces[here[upward[here] > 0]], forces[here[upward[here] < 0]]) for here in alike]
    apart = [abs(float(np.median(up) - np.median(down))) for up, down in sides if len(up) and len(down)]
    if len(alike) < PLACES_OF_A_SPRING or len(apart) < RETURNS_TO_A_PLACE:
        return False
    if max(apart) > HYSTERESIS_OF_A_SPRING * np.ptp(forces):
        return False
    return float(np.corrcoef(places, forces)[0, 1]) > np.sqrt(VARIANCE_SHARE_OF_A_SPRING)


def external(log: Log) -> str | None:
    """Return the role of a loop's external signal (injected force or moving reference), or None."""
    roles = ("disturbance", "reference")
    return next((role for role in roles if role in log and np.ptp(log[role][log.longest]) > 0), None)


def _harmonics(period: np.ndarray) -> float:
    """Return the effective number of harmonics of one period of a signal, shape (samples,).

    Equally strong harmonics of this number would have the same spread of power.
    """
    power = np.abs(np.fft.rfft(period)[1:]) ** 2
    return float(power.sum() ** 2 / np.sum(power**2))


def _rest(position: np.ndarray, samples: int) -> float:
    """Return the fraction of time in which the position hardly moves for a tenth of a period.

    A period has `samples` samples. The fraction is 0 for a sine, which moves by 2.4 % of its travel about its turning
    points.
    """
    return float(np.mean(_still(position, max(samples // 10, 2))))


def _still(position: np.ndarray, size: int) -> np.ndarray:
    """Tell at which samples, (n,), a position [m] hardly moves, within windows of a `size`."""
    moved = maximum_filter1d(position, size) - minimum_filter1d(position, size)
    return moved < TRAVEL_SHARE_OF_A_REST * np.ptp(position)


RANGE_SHARE_OF_A_TURN = 0.1
"""Smallest reversal of a signal that counts as a turn, relative to its range."""


def _turns(period: np.ndarray) -> int:
    """Count how often a signal turns back within one period by a fraction of its range."""
    least, turns, direction, last = RANGE_SHARE_OF_A_TURN * np.ptp(period), 0, 1.0, period[0]
    for value in period:
        if (value - last) * direction > 0:
            last = value
        elif (last - value) * direction > least:
            direction, last, turns = -direction, value, turns + 1
    return turns
