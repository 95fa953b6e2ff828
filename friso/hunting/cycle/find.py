"""Find limit cycles of many stages at once, as closed orbits with their stability.

Stability is how deviations from a cycle grow per return: Floquet multipliers describe small deviations, the slope of
the return map finite ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from friso.hunting.cycle.ensemble import CHATTERING_RTOL, ArrayRows, Ensemble, stuck, wait
from friso.hunting.cycle.guess import (
    UNWINDING_WAIT_SHARE,
    Guess,
    ReturnMap,
    return_map,
    swings,
    symmetric_guess,
    whole_guess,
)
from friso.hunting.cycle.shooting import Orbits, Shot, close, shoot, swings_of_simplest


@dataclass(frozen=True)
class Multipliers:
    """Floquet multipliers of orbits, without the trivial one along the cycle.

    `local` (count, states - 1) has the largest first. `direction` (count, states) is the eigenvector of the first,
    scaled to a position of 1. `slope` (count,) is the slope of the return map along that direction over a finite range.
    It is only computed where a limiter may chatter, and NaN elsewhere. `high` and `low` [m] (count,) are the extremes
    of the position on the orbit.
    """

    local: np.ndarray
    direction: np.ndarray
    slope: np.ndarray
    high: np.ndarray
    low: np.ndarray


def multipliers(stages: Ensemble, orbits: Orbits, rtol: float) -> Multipliers:
    """Compute the multipliers of closed orbits, one orbit per stage.

    Runs have the relative tolerance `rtol`. The multipliers are growth factors over half a period if the orbits were
    closed over half a period, else over a whole one.
    """
    shot = shoot(stages, orbits.states, orbits.times, orbits.sign, rtol)
    flows = np.where(shot.done[:, None, None], shot.flows, np.nan)
    local, direction = _floquet(stages, flows, stages.rates(shot.ends))
    slope = slopes(stages, orbits, direction, rtol) if stages.chatters else np.full(stages.count, np.nan)
    high, low = (np.where(shot.done, extreme, np.nan) for extreme in (shot.high, shot.low))
    return Multipliers(local, direction, slope, high, low)


def decisive(local: np.ndarray) -> np.ndarray:
    """Return the multiplier that decides whether orbits are stable, (count,).

    `local`, shape (count, n), are multipliers with the largest first. That one decides; of a complex pair, its
    magnitude.
    """
    first = local[:, 0]
    complex_pair = np.abs(np.imag(first)) > 1e-6 * np.abs(first)
    return np.where(complex_pair, np.abs(first), np.real(first))


def decisive_of(stages: Ensemble, shot: Shot) -> np.ndarray:
    """Return the multiplier that decides whether orbits are stable, (count,), from shots along them."""
    return decisive(_floquet(stages, shot.flows, stages.rates(shot.ends))[0])


def _floquet(stages: Ensemble, flows: np.ndarray, rates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Compute the multipliers of orbits, and the direction in which the largest one acts.

    Deviations are compared at equal states of the integrator. `flows` (count, states, states) are derivatives of final
    by initial states, and `rates` (count, states) time derivatives at the end.
    """
    phase = stages.integral
    sections = flows - rates[:, :, None] * flows[:, None, phase, :] / rates[:, phase, None, None]
    sections[:, :, phase] = 0.0
    finite = np.all(np.isfinite(sections), axis=(1, 2), keepdims=True)
    values, vectors = np.linalg.eig(np.where(finite, sections, 0.0))
    values = np.where(finite[:, :, 0], values, np.nan)
    order = np.argsort(-np.abs(values), axis=1)
    values = np.take_along_axis(values, order, axis=1)[:, :-1]  # the last multiplier belongs to the phase and is zero
    first = np.take_along_axis(vectors, order[:, None, :1], axis=2)[:, :, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        return values, np.real(first / first[:, stages.sticking, None])


SLOPE_RANGE_SHARE = 0.01  # [of the distance]
"""Range of the return map's slope where a limiter chatters. Over a smaller one the slope follows the chatter."""

SLOPE_RUNS = 25
"""Runs through which the slope is fitted. Fewer follow the scatter of returns."""

SLOPE_RTOL_FACTOR = 100.0  # [of cycle_rtol]
"""Tolerance of runs for the slope of a return map, relative to that of cycles. The slope is taken over a wide
range."""


def slopes(stages: Ensemble, orbits: Orbits, direction: np.ndarray, rtol: float) -> np.ndarray:
    """Return the slope of the return map over a small range about the orbits, shape (count,).

    Runs start beside the orbits along a direction (count, states); a straight line is fitted to their returns.
    """
    coarser = min(SLOPE_RTOL_FACTOR * rtol, max(rtol, CHATTERING_RTOL))
    away = np.linspace(-SLOPE_RANGE_SHARE / 2, SLOPE_RANGE_SHARE / 2, SLOPE_RUNS)[None, :]
    heights = returns_of(stages, orbits, direction, away, 2, coarser)
    return np.array([_straight(pairs[np.isfinite(pairs).all(axis=1)]) for pairs in heights])


LEAST_SLOPE_RUNS = 18
"""Fewest returning runs for the slope of a return map. With fewer, the range crosses a break of the map."""

NEAR_RETURN_SHARE = 0.25  # [of the range]
"""Largest distance of a return from the others. Farther off it belongs to another branch of the map."""


def _straight(pairs: np.ndarray) -> float:
    """Fit a straight line without outliers to pairs (points, 2), and return its slope.

    The slope is NaN if too few pairs are left. A stage that does not break away makes an outlier.
    """
    if len(pairs) < LEAST_SLOPE_RUNS:
        return np.nan
    first, second = (pairs - np.median(pairs, axis=0)).T
    earlier, later = np.triu_indices(len(first), 1)
    # median of all slopes, after Theil and Sen
    slope = np.nanmedian((second[later] - second[earlier]) / (first[later] - first[earlier]))
    near = np.abs(second - slope * first) < NEAR_RETURN_SHARE * np.ptp(first)
    if np.count_nonzero(near) < LEAST_SLOPE_RUNS:
        return np.nan
    return float(np.polyfit(first[near], second[near], 1)[0])


def returns_of(
    stages: Ensemble, orbits: Orbits, direction: np.ndarray, away: np.ndarray, returns: int, rtol: float
) -> np.ndarray:
    """Measure how far stages swing [m] on each return, shape (count, points, returns).

    Each run starts displaced from its orbit along `direction`, shape (count, states). `away`, shape (1, points), has
    the displacements as fractions of the orbit's sticking distance. Returns that a run does not make are NaN.
    """
    count, points = stages.count, away.shape[1]
    distance = orbits.states[:, stages.sticking]
    starts = orbits.states[:, None, :] + (away * np.abs(distance)[:, None])[:, :, None] * direction[:, None, :]
    starts = starts.reshape(count * points, -1)
    several = stages.take(np.repeat(np.arange(count), points))
    per_return = orbits.swings
    durations = (returns + 0.5) * np.repeat(orbits.times, points)
    extrema = swings(several, starts, durations, per_return * returns, rtol)
    return np.abs(extrema.values[:, per_return - 1 :: per_return]).reshape(count, points, returns)


CYCLE_RTOL = 1e-9
"""Tolerance of cycles. Looser runs scatter multipliers near -1; tighter ones take longer."""


GUESS_RTOL = 1e-6
"""Tolerance of runs that start Newton's method. Looser ones miss narrow cycles."""


NO_RETURN = "from every distance the stage swings back less far than it started"
NO_MULTIPLIER = "an orbit was closed, but its multiplier could not be computed"
NO_PAIR = "there is no asymmetric cycle beside the symmetric one"
NOT_CLOSED = "the return map has a fixed point, but no orbit near it could be closed"

UNCERTAIN = (NOT_CLOSED, NO_MULTIPLIER)
"""Reasons for finding no cycle that leave open whether there is one."""


def time_constant(returned: np.ndarray, multiplier: np.ndarray) -> np.ndarray:
    """Return the time [s] in which a deviation from a cycle changes by the factor e, (count,).

    The `multiplier` acts once per time `returned` [s].
    """
    return returned / np.maximum(np.abs(np.log(np.abs(multiplier))), 1e-12)


@dataclass(frozen=True)
class Cycles(ArrayRows):
    """One cycle for each stage; arrays are NaN for a stage without one.

    - `sign`: -1 for cycles that are their own mirror image after half a period, to which all numbers then refer; 1 for
      others. `swings`: swings in that time.
    - `closed` (count,): whether there is a cycle; `reasons` (count,): why there is none.
    - `states` (count, states): on the cycle, in the middle of sticking.
    - `period` [s], `amplitude` [m], half of peak to peak, and `middle` [m] between the peaks, (count,).
    - `gap` (count,): error of closing (see `Orbits`).
    - `local` (count, states - 1): Floquet multipliers, the largest first; `direction` (count, states): of the first.
    - `slope` (count,): macroscopic slope of the return map, where a limiter may chatter.
    - `multiplier` (count,): largest multiplier or slope, whichever decides stability.
    """

    sign: float
    swings: int
    closed: np.ndarray
    reasons: np.ndarray
    states: np.ndarray
    period: np.ndarray
    amplitude: np.ndarray
    middle: np.ndarray
    gap: np.ndarray
    local: np.ndarray
    direction: np.ndarray
    slope: np.ndarray
    multiplier: np.ndarray

    @property
    def attracting(self) -> np.ndarray:
        """Return which cycles are stable, shape (count,)."""
        return self.closed & (np.abs(self.multiplier) < 1)

    @property
    def time_constant(self) -> np.ndarray:
        """Return the time [s] in which a small deviation changes by the factor e, (count,)."""
        return time_constant(self.orbits.times, self.multiplier)

    @property
    def uncertain(self) -> np.ndarray:
        """Return which stages may have a cycle that the search did not find, shape (count,)."""
        return np.isin(self.reasons.astype(str), UNCERTAIN)

    @property
    def orbits(self) -> Orbits:
        """Return the cycles as closed orbits."""
        times = self.period * (0.5 if self.sign < 0 else 1.0)
        return Orbits(self.states, times, self.sign, self.gap, self.closed, self.swings)

    @property
    def arrays(self) -> dict[str, np.ndarray]:
        """Return all arrays that have one row per stage, by the names of their fields."""
        return {field.name: getattr(self, field.name) for field in fields(self) if field.name not in ("sign", "swings")}


@np.errstate(all="ignore")  # runs that fail on the way leave infinities behind
def symmetric_cycles(stages: Ensemble, rtol: float = CYCLE_RTOL, positive: ReturnMap | None = None) -> Cycles:
    """Find the symmetric cycle of every stage with symmetric equations.

    Such a cycle is its own mirror image after half a period. `positive` is the return map of stages that stick on the
    positive side (None: it is computed).
    """
    positive = positive or return_map(stages, GUESS_RTOL)
    return _closed(stages, symmetric_guess(stages, positive, GUESS_RTOL), -1.0, rtol)


def find_cycles(stages: Ensemble, rtol: float = CYCLE_RTOL) -> Cycles:
    """Find one hunting cycle of every stage, stable or not.

    For a symmetric stage it is the symmetric cycle, with the multiplier of half a period; for others the multiplier is
    that of a whole period. `sign` is 0 if there are both kinds of stage. Orbits are closed to the relative tolerance
    `rtol`.
    """
    symmetric = stages.symmetric
    kinds = ((symmetric, symmetric_cycles), (~symmetric, whole_cycles))
    parts = [(which, find(stages.take(which), rtol)) for mask, find in kinds if (which := np.flatnonzero(mask)).size]
    return concatenate_cycles(parts)


def concatenate_cycles(parts: Sequence[tuple[np.ndarray, Cycles]]) -> Cycles:
    """Join the cycles of several groups of stages into one object, in the order of the stages.

    `parts` has, for each group, the numbers of its stages and their cycles.
    """
    if len(parts) == 1:
        return parts[0][1]
    order = np.argsort(np.concatenate([which for which, _ in parts]))
    columns = zip(*(part.arrays.items() for _, part in parts), strict=True)
    return Cycles(0.0, 0, **{pair[0][0]: np.concatenate([array for _, array in pair])[order] for pair in columns})


def families(stages: Ensemble, rtol: float = CYCLE_RTOL) -> tuple[Cycles, ...]:
    """Find the cycles that the return maps of stages suggest.

    If all stages are symmetric, the result has two entries: their symmetric cycles, and one of each asymmetric pair. If
    any stage is not, the only entry has cycles over a whole period.
    """
    positive = return_map(stages, GUESS_RTOL)
    if not stages.symmetric.all():
        return (whole_cycles(stages, rtol, positive),)
    return symmetric_cycles(stages, rtol, positive), asymmetric_cycles(stages, positive, rtol)


LEAST_ASYMMETRY_SHARE = 0.05
"""Smallest asymmetry of a guess of an asymmetric cycle. With less, the guess leads to the symmetric cycle."""

LEAST_LEAN_SHARE = 1e-3  # [of the amplitude]
"""Smallest offset of the middle of an asymmetric cycle. With less, the orbit is the symmetric one."""


@np.errstate(all="ignore")  # runs that fail on the way leave infinities behind
def asymmetric_cycles(stages: Ensemble, positive: ReturnMap, rtol: float = CYCLE_RTOL) -> Cycles:
    """Find one of the pair of asymmetric cycles of each symmetric stage, if it has one.

    `positive` is the return map, which suggests the cycle. The other cycle of the pair is its mirror image.
    """
    guess = whole_guess(stages, positive, positive, LEAST_ASYMMETRY_SHARE)
    cycles = _closed(stages, guess, 1.0, rtol)
    same = np.abs(cycles.middle) < LEAST_LEAN_SHARE * cycles.amplitude
    cycles.closed[same], cycles.reasons[same] = False, NO_PAIR
    return cycles


@np.errstate(all="ignore")  # runs that fail on the way leave infinities behind
def whole_cycles(stages: Ensemble, rtol: float = CYCLE_RTOL, positive: ReturnMap | None = None) -> Cycles:
    """Find the cycle of every stage over a whole period, for stages that need not be symmetric.

    `positive` is the return map of stages that stick on the positive side (None: it is computed).
    """
    positive = positive or return_map(stages, GUESS_RTOL)
    return _closed(stages, whole_guess(stages, positive, return_map(stages, GUESS_RTOL, -1.0)), 1.0, rtol)


GUESS_VARIANTS = ((1.0, 1.0), (0.985, 1.05), (0.985, 1.0), (0.97, 1.05), (1.015, 1.0))
"""Factors on the guessed distance and time, tried in turn. More variants close hardly any further orbit."""


def _closed(stages: Ensemble, guess: Guess, sign: float, rtol: float) -> Cycles:
    """Close cycles near guesses, from several variants of each guess in turn.

    `sign` is -1 for half a period of symmetric cycles, 1 for whole periods.
    """
    count, size = stages.count, len(stages.kernel.states)
    orbits = Orbits(
        np.full((count, size), np.nan),
        guess.times.copy(),
        sign,
        np.full(count, np.inf),
        np.zeros(count, bool),
        swings_of_simplest(sign),
    )
    for distance, time in GUESS_VARIANTS:
        missing = guess.numbers[~orbits.closed[guess.numbers]]
        if not missing.size:
            break
        subset, distances = stages.take(missing), guess.distances[missing] * distance
        trial = close(subset, stuck(subset, distances), guess.times[missing] * time, sign, rtol)
        _accept(stages, orbits, missing, trial, guess)
    if stages.chatters:
        _close_simulated(stages, guess, orbits, rtol)
    reasons = np.where(np.isfinite(guess.times), NOT_CLOSED, NO_RETURN)
    return described(stages, orbits, rtol, reasons)


KEPT_DISTANCE_SHARE = 0.5
"""Largest distance of an orbit from its guess. Farther off it is another solution, such as rest."""


def kept(stages: Ensemble, orbits: Orbits, distances: np.ndarray) -> np.ndarray:
    """Return which orbits stick near the guessed `distances` [m], shape (count,)."""
    return np.abs(orbits.states[:, stages.sticking] / distances - 1) < KEPT_DISTANCE_SHARE


def _accept(stages: Ensemble, orbits: Orbits, which: np.ndarray, trial: Orbits, guess: Guess) -> None:
    """Copy trial orbits that were closed near their guess into the rows `which` of `orbits`."""
    good = trial.closed & kept(stages, trial, guess.distances[which])
    for name in ("states", "times", "gaps", "closed"):
        getattr(orbits, name)[which[good]] = getattr(trial, name)[good]


GUESS_RETURNS = 40  # [returns]
"""Returns that are simulated to find an attractor where no orbit closes near a guess."""

STEADY_RETURN_SHARE = 0.02
"""Largest change of the last returns of a simulation that has reached a cycle."""


def _close_simulated(stages: Ensemble, guess: Guess, orbits: Orbits, rtol: float) -> None:
    """Close orbits that are still open from the end of a long simulation that repeats itself.

    The closed ones are copied into `orbits`.
    """
    missing = guess.numbers[~orbits.closed[guess.numbers]]
    if not missing.size:
        return
    subset, sign = stages.take(missing), orbits.sign
    starts = stuck(subset, guess.distances[missing])
    extrema = swings(subset, starts, GUESS_RETURNS * guess.times[missing], 4 * GUESS_RETURNS, GUESS_RTOL)
    rows, step = np.arange(subset.count), 1 if sign < 0 else 2
    last = np.maximum(np.isfinite(extrema.values).sum(axis=1) - 2, step)
    last -= (sign > 0) & (extrema.values[rows, last] < 0)  # on the side on which the orbit begins
    heights = np.abs(np.stack([extrema.values[rows, last], extrema.values[rows, last - step]]))
    times = extrema.times[rows, last] - extrema.times[rows, last - step]
    fine = np.flatnonzero((last > GUESS_RETURNS // 2) & (np.abs(heights[0] / heights[1] - 1) < STEADY_RETURN_SHARE))
    if not fine.size:
        return
    ends_at = extrema.times[rows, last] + UNWINDING_WAIT_SHARE * wait(subset, heights[0])
    ends = subset.take(fine).run(starts[fine], ends_at[fine], GUESS_RTOL).ends
    if sign < 0:
        ends *= np.sign(ends[:, stages.sticking])[:, None]
    _accept(stages, orbits, missing[fine], close(subset.take(fine), ends, times[fine], sign, rtol), guess)


@np.errstate(all="ignore")  # runs that fail on the way leave infinities behind
def described(stages: Ensemble, orbits: Orbits, rtol: float, reasons: np.ndarray | str = NOT_CLOSED) -> Cycles:
    """Make cycles from orbits: compute size, multipliers and stability of the closed ones.

    `reasons` say why the others are not closed.
    """
    which = np.flatnonzero(orbits.closed)
    subset, shut = stages.take(which), orbits.take(which)
    periods = shut.times * (2.0 if shut.sign < 0 else 1.0)
    count, size = stages.count, len(stages.kernel.states)
    cycles = Cycles(
        sign=orbits.sign,
        swings=orbits.swings,
        closed=orbits.closed.copy(),
        reasons=np.where(orbits.closed, "", reasons).astype(object),
        states=orbits.states,
        local=np.full((count, size - 1), np.nan, complex),
        direction=np.full((count, size), np.nan),
        **{name: np.full(count, np.nan) for name in ("period", "amplitude", "middle", "gap", "slope", "multiplier")},
    )
    if not which.size:
        return cycles
    floquet = multipliers(subset, shut, rtol)
    high, low = floquet.high, floquet.low
    if shut.sign < 0:
        high, low = np.maximum(high, -low), np.minimum(low, -high)
    values = {
        "period": periods,
        "amplitude": (high - low) / 2,
        "middle": (high + low) / 2,
        "gap": shut.gaps,
        "local": floquet.local,
        "direction": floquet.direction,
        "slope": floquet.slope,
        "multiplier": floquet.slope if subset.chatters else decisive(floquet.local),
    }
    for name, value in values.items():
        getattr(cycles, name)[which] = value
    if subset.kernel.switches:
        elsewhere = which[~subset.same_modes(shut.states, subset.run(shut.states, periods, rtol, with_modes=True).ends)]
        cycles.closed[elsewhere], cycles.reasons[elsewhere] = False, NOT_CLOSED
    unknown = cycles.closed & ~(np.isfinite(cycles.multiplier) & np.isfinite(cycles.amplitude))
    cycles.closed[unknown], cycles.reasons[unknown] = False, NO_MULTIPLIER
    return cycles
