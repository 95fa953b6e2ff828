"""Find the landings of stages.

A landing is where a stage sticks after a swing, as a signed distance from its reference.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from friso.equations.roles import Role
from friso.hunting.attractors.rounds import LEAST_SWING, TYPICAL_DISTANCE
from friso.hunting.cycle.ensemble import ArrayRows, Ensemble, done, wait
from friso.hunting.cycle.guess import BREAKAWAY_WAITS

LANDING_RTOL = 1e-6
"""Tolerance of runs that find where stages stick. They scatter by less than the gaps between points of a map."""


@dataclass(frozen=True)
class Landings(ArrayRows):
    """Runs and their landings, the start first.

    `distances` [m], signed, and `times` [s] have the shape (runs, landings), NaN after the last. `count` (runs,) is the
    number of landings without the start. `ends` (runs, kept) are the final states, followed by the modes with memory.
    Runs come to `rest`, diverge (`away`), or are `lost`, shape (runs,). A run is lost if it failed or diverged, or
    landed too seldom in the time allowed.
    """

    distances: np.ndarray
    times: np.ndarray
    count: np.ndarray
    ends: np.ndarray
    rest: np.ndarray
    away: np.ndarray
    lost: np.ndarray

    def joined(self, more: Landings) -> Landings:
        """Join these runs and further ones into one table."""
        room = max(self.distances.shape[1], more.distances.shape[1])
        pairs = ((getattr(part._with(room), entry.name) for part in (self, more)) for entry in fields(self))
        return Landings(*(np.concatenate([*pair]) for pair in pairs))

    def _with(self, room: int) -> Landings:
        """Return the runs with columns for `room` landings, the start included; new ones hold NaN."""
        wider = ((0, 0), (0, room - self.distances.shape[1]))
        distances, times = (np.pad(part, wider, constant_values=np.nan) for part in (self.distances, self.times))
        return replace(self, distances=distances, times=times)


EXTRA_ROUNDS = 10
"""Further rounds for a stage that stops short, creeps, or is driven at its force limit."""

STANDING_SPEED = 1e-3  # [distances times natural frequency]
"""Speed below which a stage has landed."""

FLIGHT_TIME = 30.0  # [1/natural frequencies]
"""Longest crossing in a round. A slower one continues in the next round."""

RINGING_SHARE = 0.05  # [of the distance]
"""Largest ringing of a stage that has landed."""

ROUND_STEP_LIMIT = 20_000  # [steps]
"""Most steps of a round. A swing takes a thousand; a limiter that chatters would take millions."""

RESTING_MOVE_SHARE = 0.01  # [of the distance]
"""Largest move of a stage that rests or creeps home while it could have broken away."""


@np.errstate(all="ignore")  # runs that fail on the way leave infinities behind
def find_landings(stages: Ensemble, starts: np.ndarray, most: int, rtol: float = LANDING_RTOL) -> Landings:
    """Follow stages from states, (runs, states), until each has landed `most` times or rests.

    A stage lands where it sticks after a swing. Runs have the relative tolerance `rtol`. They go on in rounds, each as
    long as a sticking stage may take to wind up and to cross its reference.
    """
    count, position, sticking = len(starts), stages.kernel.position, stages.sticking
    speeds = stages.kernel.having(Role.VELOCITY)
    states = stages.kernel.with_modes(starts, np.zeros(3), stages.values)
    values, times = starts[:, position, None].copy(), np.zeros((count, 1))
    rest, away, lost = (np.zeros(count, bool) for _ in range(3))
    passed, left, landed = np.zeros(count), np.arange(count), np.zeros(count, np.int64)
    where, when = values, times
    for _ in range(most + EXTRA_ROUNDS):
        some, begun = stages.take(left), states[left]
        sticks = np.abs(begun[:, sticking])
        small = LEAST_SWING * some.length
        moves = np.abs(begun[:, speeds]).max(axis=1) > STANDING_SPEED * some.number("rate") * some.length
        from_where = np.maximum(sticks, np.where(moves, TYPICAL_DISTANCE * some.length, small))
        durations = BREAKAWAY_WAITS * wait(some, from_where) + FLIGHT_TIME / some.number("rate")
        legs = np.maximum(RINGING_SHARE * sticks, small)
        results = some.run(begun, durations, rtol, with_modes=True, least_swing=legs, budget=ROUND_STEP_LIMIT)
        fine, room = done(results), results.turn_values.shape[1]
        held = (np.arange(room) < results.turn_counts[:, None]) & fine[:, None]
        more, at = np.full((2, count, room + 1), np.nan)
        more[left] = np.hstack([np.where(held, results.turn_values, np.nan), results.ends[:, [position]]])
        at[left] = passed[left, None] + np.hstack([results.turn_times, durations[:, None]])
        values, times = np.hstack([values, more]), np.hstack([times, at])
        states[left], passed[left] = results.ends, passed[left] + durations
        away[left], lost[left] = ~fine & (np.abs(results.ends[:, position]) > 1e5 * some.length), ~fine
        before = landed[left]
        speed = np.abs(results.ends[:, speeds]).max(axis=1)
        stands = speed < STANDING_SPEED * some.number("rate") * np.maximum(np.abs(results.ends[:, position]), small)
        where, when, landed = _landings(values, times, most)
        ends = np.abs(results.ends[:, sticking])
        rest[left] = fine & stands & (landed[left] == before) & (before < most)
        rest[left] &= np.abs(ends - sticks) < np.maximum(RESTING_MOVE_SHARE * sticks, small)
        last = np.abs(where[left, landed[left]])
        rest[left] |= fine & stands & (ends < small) & (last < small)
        unfinished = ~stands & (landed[left] == most) & (before < most)
        left = left[fine & ~rest[left] & ((landed[left] < most) | unfinished)]
        if not left.size:
            break
    lost[left] = True  # they have not landed often enough in the allowed rounds
    return Landings(where, when, landed, states, rest, away, lost)


def _landings(values: np.ndarray, times: np.ndarray, most: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find the landings of runs: the farthest turning points [m] on alternating sides.

    Returns where they are, their times [s], and their number, at most `most`. Positions and times have the shape (runs,
    most + 1), the start first; the number excludes the start, (runs,). `values` and `times` have the shape (runs,
    points), NaN for none.
    """
    count = len(values)
    rows = np.arange(count)
    where, when = np.full((count, most + 1), np.nan), np.full((count, most + 1), np.nan)
    where[:, 0], when[:, 0] = values[:, 0], times[:, 0]
    number, side = np.zeros(count, np.int64), np.where(values[:, 0] < 0, -1.0, 1.0)
    for value, time in zip(values.T[1:], times.T[1:], strict=True):
        crossed = (side * value < 0) & (number <= most)
        number[crossed] += 1
        side[crossed] *= -1
        open_ = np.minimum(number, most)
        farther = (crossed | (side * value > side * where[rows, open_])) & (number <= most) & np.isfinite(value)
        farther &= number > 0
        where[rows[farther], open_[farther]], when[rows[farther], open_[farther]] = value[farther], time[farther]
    return where, when, np.minimum(number, most)
