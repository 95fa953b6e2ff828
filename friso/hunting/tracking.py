"""Measure how a stage follows a moving reference and settles where it stands, and whether it sticks and slips.

A stage that is moved at constant speed slides smoothly, or sticks and slips.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.engine.allowance import Exhausted, allowance
from friso.engine.arrays import Status
from friso.engine.batch import RunOptions, run_chunks
from friso.engine.kernel import Kernel, kernel
from friso.equations import motion
from friso.equations.motions import VELOCITY
from friso.equations.structure import shared_structure, structure
from friso.hunting.attractors.rounds import SURVEY_RTOL
from friso.hunting.criteria import settling_of_traces
from friso.hunting.cycle.ensemble import Ensemble, done, spans
from friso.hunting.measures import LAST_QUARTER, bands_of, measuring_options
from friso.hunting.motions import some_of
from friso.stage import Stage
from friso.stage.rig import DURATION, motion_of


@dataclass(frozen=True)
class Dwell:
    """A place at which the reference stands, and how the stage settles there.

    `number` counts these places from 1, at a `position` [m]. The reference stands there from the time `since` [s].
    `settling` has for each band [m] the time [s] until the stage stays within the band; None if it does not while the
    reference stands.
    """

    number: int
    position: float
    since: float
    settling: Mapping[float, float | None]

    @property
    def bands(self) -> tuple[float, float]:
        """Return the two bands [m] into which the stage settles, the wider one last."""
        return min(self.settling), max(self.settling)

    @property
    def slowness(self) -> float:
        """Return the time of settling into the wider band [s], infinite if the stage does not settle."""
        time = self.settling[self.bands[1]]
        return np.inf if time is None else time


@dataclass(frozen=True)
class Reversal:
    """A reversal of the reference, at a time [s] and a position [m], and the error after it [m].

    The error is the largest one until half-way to the next reversal.
    """

    time: float
    position: float
    error: float


@dataclass(frozen=True)
class Tracking:
    """Error of a stage that follows a moving reference [m]: largest, and RMS.

    If the response was `closed` as a periodic orbit, the error is that of one `period` [s], otherwise that of the last
    quarter of the run. `multiplier` is the growth of small deviations from the orbit per period, None if it was not
    closed.
    """

    largest: float
    rms: float
    largest_force: float
    reversals: tuple[Reversal, ...]
    period: float | None
    multiplier: float | None

    @property
    def closed(self) -> bool:
        """Tell whether the response was closed as a periodic orbit."""
        return self.multiplier is not None

    @property
    def attracts(self) -> bool:
        """Tell whether neighbouring motions approach the periodic orbit; False without an orbit."""
        return self.multiplier is not None and self.multiplier < 1


def dwells(stage: Stage, rtol: float) -> tuple[Dwell, ...]:
    """Return how a stage settles at each place where its reference stands, the slowest first.

    Runs of the motion up to the end of each stand are computed side by side.
    """
    flat, bands = stage.flat(), bands_of(stage.flat())
    places = motion.stands(flat)
    until = np.array([float(place.until) for place in places])
    since = np.array([float(place.corner) for place in places])
    entered = np.full((len(places), len(bands)), np.inf)
    options = measuring_options(rtol, bands=bands)
    for runs in run_chunks(kernel(structure(flat)), {**flat, DURATION: until}, len(places), options):
        done = runs.results.statuses == Status.DONE
        for column, band in enumerate(("inner", "outer")):
            times = runs.statistic(f"{band}_exit")
            entered[runs.numbers, column] = np.where(done & (times < runs.statistic("ended")), times, np.inf)
    settled = np.maximum(entered - since[:, None], 0.0)
    positions = motion.reference(flat, since)
    places_told = [
        Dwell(
            number + 1,
            float(positions[number]),
            float(since[number]),
            {band: float(t) if np.isfinite(t) else None for band, t in zip(bands, settled[number], strict=True)},
        )
        for number in range(len(places))
    ]
    return tuple(sorted(places_told, key=lambda dwell: dwell.slowness, reverse=True))


def dwells_of_trace(stage: Stage, time: np.ndarray, deviation: np.ndarray) -> tuple[Dwell, ...]:
    """Return how a sampled run settles at each place of its reference, the slowest first.

    Deviations [m] and times [s] have the shape (n,).
    """
    flat, places = stage.flat(), motion.stands(stage.flat())
    positions = motion.reference(flat, np.array([float(place.corner) for place in places]))
    listed = []
    for number, (place, position) in enumerate(zip(places, positions, strict=True), start=1):
        within, bands = time <= place.until, bands_of(flat)
        times = {band: settling_of_traces([place], time[within], deviation[None, within], band)[0] for band in bands}
        settling = {band: float(t) if np.isfinite(t) else None for band, t in times.items()}
        listed.append(Dwell(number, float(position), float(place.corner), settling))
    return tuple(sorted(listed, key=lambda dwell: dwell.slowness, reverse=True))


SAMPLES_OF_A_PERIOD = 4000
"""Samples of a period. Fewer miss the peak of an error behind a reversal; more take memory."""


def tracking(stage: Stage, rtol: float) -> Tracking | None:
    """Return how a stage follows a moving reference; None if its run was not completed.

    For a periodic reference, Newton's method closes the response of equal period, from the end of the stage's own
    motion.
    """
    flat = stage.flat()
    shape, period = kernel(structure(flat)), motion_of(flat).period(flat)
    start, multiplier = None, None
    begins, ends = LAST_QUARTER * flat[DURATION], flat[DURATION]
    end = ends
    if period is not None and period <= end and (orbit := _closed(shape, flat, period, rtol)) is not None:
        start, multiplier = orbit
        begins, ends, end = 0.0, period, 2 * period  # the error behind the last reversal lasts into the next period
    interval = (ends - begins) / SAMPLES_OF_A_PERIOD
    options = RunOptions(rtol=rtol, interval=interval, record_from=np.inf, least_swing=np.inf)
    (runs,) = run_chunks(shape, {**flat, DURATION: end}, 1, options, start)
    if runs.results.statuses[0] != Status.DONE:
        return None
    time = np.arange(runs.results.samples.shape[1]) * interval
    error = motion.reference(flat, time) - runs.results.samples[0, :, shape.position]
    counted = (time >= begins) & (time < ends - interval / 2)
    return Tracking(
        float(np.abs(error[counted]).max()),
        float(np.sqrt(np.mean(error[counted] ** 2))),
        float(runs.statistic("force_peak")[0]),
        _reversals({**flat, DURATION: end}, time, error, (begins, ends)),
        period,
        multiplier,
    )


def _reversals(
    flat: Mapping[str, Any], time: np.ndarray, error: np.ndarray, span: tuple[float, float]
) -> tuple[Reversal, ...]:
    """Return the reversals of a reference in a span of time [s], each with the error after it.

    `error` [m] belongs to the times `time` [s], both of shape (n,). There are none for a reference without sinusoids.
    """
    corners = motion.pieces(flat, 1)[0, 1:, 0] if motion.form_of(flat).tones else np.zeros(0)
    reversals = []
    for corner, following in zip(corners, np.append(corners, flat[DURATION])[1:], strict=True):
        if not span[0] <= corner < span[1]:
            continue
        behind = (time >= corner) & (time <= (corner + following) / 2)
        if behind.any():
            position = float(motion.reference(flat, np.array([corner]))[0])
            reversals.append(Reversal(float(corner), position, float(np.abs(error[behind]).max())))
    return tuple(reversals)


CLOSING_ROUNDS = 30
"""Newton steps, or equal waits, after which a periodic response is abandoned."""

DERIVATIVE_STEP = 1e-4  # [of the scales of the states]
"""Step of numerical derivatives. Smaller ones are lost in the tolerance; larger ones cross jumps of derivatives."""

CLOSED_DISTANCE = 1e-4  # [of the scales of the states]
"""Largest distance between states one period apart on a closed response, of which three digits are shown."""

PERIODS_WAITED = 4  # [periods]
"""Periods of a plain run where jumps of friction's derivatives keep a Newton step from coming closer."""


def _closed(shape: Kernel, flat: Mapping[str, Any], period: float, rtol: float) -> tuple[np.ndarray, float] | None:
    """Close the response of a stage to a periodic reference; None if that fails.

    Returns a state on it, shape (1, kept), and its multiplier per period. `flat` has the stage's keys in SI.
    """
    values = shape.values({**flat, "motion.size": motion.size(flat)}, 1)
    scales = shape.scales(values, 1)[0]
    size = len(shape.states)

    def later(starts: np.ndarray | None, periods: int = 1) -> np.ndarray | None:
        """Return the states some periods after `starts`, shape (runs, kept); None if a run fails.

        Without `starts`, there is one run of the stage's own motion.
        """
        count = 1 if starts is None else len(starts)
        options = RunOptions(rtol=rtol, record_from=np.inf, least_swing=np.inf)
        ends = np.zeros((count, len(shape.full_state)))
        for runs in run_chunks(shape, {**flat, DURATION: periods * period}, count, options, starts):
            if np.any(runs.results.statuses != Status.DONE):
                return None
            ends[runs.numbers] = runs.results.ends
        return ends

    state = later(None, max(1, int(flat[DURATION] / period)))
    for _ in range(CLOSING_ROUNDS):
        if state is None:
            return None
        beside = np.vstack([state, state + np.eye(size, state.shape[1]) * DERIVATIVE_STEP * scales[:, None]])
        ends = later(beside)
        if ends is None:
            return None
        gap = (ends[0, :size] - state[0, :size]) / scales
        by = (ends[1:, :size] - ends[0, :size]).T / (DERIVATIVE_STEP * scales[:, None])
        step = np.linalg.lstsq(np.eye(size) - by, gap, rcond=None)[0]
        if max(np.abs(gap).max(), np.abs(step).max()) <= CLOSED_DISTANCE:
            return state, float(np.abs(np.linalg.eigvals(by)).max())
        tried = ends[:1].copy()
        tried[0, :size] = state[0, :size] + step * scales
        after = later(tried)
        closer = after is not None and np.abs((after - tried)[0, :size] / scales).max() < np.abs(gap).max() / 2
        state = tried if closer else later(ends[:1], PERIODS_WAITED)
    return None


@dataclass(frozen=True)
class SpeedRange:
    """Range of speeds [m/s] in which a swing lasts, from the `slowest` to the `fastest` tried.

    At `quiet_below` and `quiet_above`, the next speeds tried, it slides smoothly (None: not tried, or undecided).
    """

    slowest: float
    fastest: float
    quiet_below: float | None
    quiet_above: float | None


@dataclass(frozen=True)
class StickSlipSpeeds:
    """How a stage moves at the constant speed of its reference, and at other speeds, always from rest.

    - `lasts`: its error keeps swinging (None: not decided); `sticks`: it stands still in each swing.
    - `swing` [m] of the error, peak to peak, and `period` [s]: of the last quarter of a long run.
    - `ranges`: speeds at which the error keeps swinging.
    - `tried`: lowest and highest speed tried [m/s]; `open_speeds`: at how many of them it was not decided.
    """

    lasts: bool | None
    sticks: bool
    swing: float
    period: float | None
    ranges: tuple[SpeedRange, ...]
    tried: tuple[float, float]
    open_speeds: int


def is_moved_evenly(stage: Stage) -> bool:
    """Tell whether the reference of a stage moves at one constant speed, against friction."""
    flat = stage.flat()
    return flat["motion.kind"] == "ramp" and bool(flat[VELOCITY]) and flat.get("friction.model", "none") != "none"


SPEEDS_TRIED = (3e-3, 300.0)  # [of the speed of the reference]
"""Lowest and highest constant speed at which stick-slip is looked for."""

SPEED_COUNT = 41
"""Speeds tried at first, a third apart. Ranges of stick-slip narrower than a step are missed."""

SPEEDS_BETWEEN = 8
"""Speeds tried between two with different results. They bracket the change to three per cent."""


@np.errstate(all="ignore")  # runs that fail on the way leave infinities behind
def stick_slip(stage: Stage, work: float) -> StickSlipSpeeds | None:
    """Find out at which speeds a stage sticks and slips; None if that takes more than the given `work`.

    Speeds are tried over some decades about that of the reference, and more closely where the result changes.
    """
    flat, own = stage.flat(), float(stage.flat()[VELOCITY])
    factors, lasts, decided = np.ones(1), np.zeros(1, bool), np.zeros(1, bool)
    try:
        with allowance(work):
            lasts, decided, swing = lasting_swings(flat, 1)
            period, sticks = _course(flat, own) if lasts[0] else (None, False)
    except Exhausted:
        return None
    own_lasts = bool(lasts[0]) if decided[0] else None
    with suppress(Exhausted), allowance(work):
        others = np.geomspace(*SPEEDS_TRIED, SPEED_COUNT)
        for _ in range(2):
            more = lasting_swings({**flat, VELOCITY: own * others}, len(others))[:2]
            columns = zip((lasts, decided), more, strict=True)
            lasts, decided = (np.append(*pair) for pair in columns)
            factors = np.append(factors, others)
            order = np.argsort(factors)
            factors, lasts, decided = factors[order], lasts[order], decided[order]
            changes = np.flatnonzero(decided[:-1] & decided[1:] & (lasts[:-1] != lasts[1:]))
            if not changes.size:
                break
            count = SPEEDS_BETWEEN + 2
            others = np.concatenate([np.geomspace(factors[k], factors[k + 1], count)[1:-1] for k in changes])
    speeds = abs(own) * factors
    return StickSlipSpeeds(
        own_lasts,
        sticks,
        float(swing[0]),
        period,
        _ranges(speeds, lasts, decided),
        (float(speeds[0]), float(speeds[-1])),
        int(np.count_nonzero(~decided)),
    )


def _ranges(speeds: np.ndarray, lasts: np.ndarray, decided: np.ndarray) -> tuple[SpeedRange, ...]:
    """Return the ranges of ascending speeds, shape (count,), in which a swing certainly lasts."""

    def quiet(number: int) -> float | None:
        return float(speeds[number]) if 0 <= number < len(speeds) and decided[number] else None

    return tuple(
        SpeedRange(float(speeds[first]), float(speeds[last]), quiet(first - 1), quiet(last + 1))
        for first, last in spans(lasts & decided)
    )


LONGER_RUNS = 2
"""Most runs that follow the first at a speed. A swing that changes slowly is not decided then."""

MOST_SLIDING_STEPS = 2_000_000
"""Most steps of a run at constant speed. A speed that needs more is not decided."""

NO_SWING_SHARE = 1e-4  # [of the deflection at break-away]
"""Swing below which a stage slides smoothly."""

LASTING_SHARE = 0.8  # [of the swing of the last run]
"""Least swing of the next run that lasts."""

DYING_SHARE = 0.3  # [of the swing of the last run]
"""Largest swing of the next run that dies out."""

LONGER_RUN = 3.0
"""Length of the next run, which shows whether a swing lasts, in lengths of the last one."""


@np.errstate(all="ignore")
def lasting_swings(flat: Mapping[str, Any], count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Tell whether stages that move at constant speeds keep swinging about their references, always from rest.

    `flat` has the keys of `count` stages of one structure in SI. Returns which keep swinging, where that is decided,
    and the swing of the error [m], peak to peak, each (count,). Each run is compared with a longer one, until its swing
    has lasted or is dying out.
    """
    shape, lengths = kernel(shared_structure(flat)), _lengths(flat, count)
    lasts, decided, swings = np.zeros(count, bool), np.zeros(count, bool), np.full(count, np.nan)
    left, durations = np.arange(count), _durations(flat, count)
    for number in range(1 + LONGER_RUNS):
        moved = {**some_of(flat, left), DURATION: durations[left]}
        budget = MOST_SLIDING_STEPS
        options = RunOptions(SURVEY_RTOL, window=LAST_QUARTER, record_from=np.inf, least_swing=np.inf, budget=budget)
        swing = np.full(len(left), np.nan)
        for runs in run_chunks(shape, moved, len(left), options):
            spread = runs.statistic("deviation_max") - runs.statistic("deviation_min")
            swing[runs.numbers] = np.where(done(runs.results), spread, np.nan)
        before = swings[left]
        swings[left] = np.where(np.isfinite(swing), swing, before)
        small = swing < NO_SWING_SHARE * lengths[left]
        if number:
            lasts[left] = ~small & (swing > LASTING_SHARE * before)
        dies = small | (swing < DYING_SHARE * before)
        decided[left] = lasts[left] | dies
        left = left[~decided[left] & np.isfinite(swing)]
        if not left.size:
            break
        durations[left] *= LONGER_RUN
    return lasts, decided, swings


def _lengths(flat: Mapping[str, Any], count: int) -> np.ndarray:
    """Return the lengths [m] by which the loops of stages are deflected at break-away, (count,)."""
    return np.broadcast_to(Ensemble.held(flat, count, form=shared_structure(flat)).length, (count,)).astype(float)


SWINGS_FOLLOWED = 20.0
"""Length of a run at constant speed, in times of sticking, slipping and swinging of the loop."""


def _durations(flat: Mapping[str, Any], count: int) -> np.ndarray:
    """Return times [s] in which moving stages stick and slip many times, (count,).

    A swing takes as long as the reference needs to deflect the loop to break-away and back, and the loop to swing.
    """
    rate = np.broadcast_to(Ensemble.held(flat, count, form=shared_structure(flat)).number("rate"), (count,))
    swing = 2 * np.pi / rate + 2 * _lengths(flat, count) / np.abs(flat[VELOCITY])
    return np.asarray(SWINGS_FOLLOWED * swing)


SAMPLES_OF_A_COURSE = 20_000
"""Samples of the run at the speed of the reference, some hundred in each swing."""

STANDING_SPEED_SHARE = 0.02  # [of the speed of the reference]
"""Speed below which a stage stands."""


def _course(flat: Mapping[str, Any], speed: float) -> tuple[float | None, bool]:
    """Return the period of the error's swing [s] (None: too few swings), and whether the stage sticks in it."""
    shape, duration = kernel(structure(flat)), float(_durations(flat, 1)[0])
    interval = duration / SAMPLES_OF_A_COURSE
    options = RunOptions(SURVEY_RTOL, interval=interval, record_from=np.inf, least_swing=np.inf)
    (runs,) = run_chunks(shape, {**flat, DURATION: duration}, 1, options)
    samples = runs.results.samples[0]
    late = slice(int(LAST_QUARTER * len(samples)), None)
    error = samples[late, shape.cart_position] - speed * np.arange(len(samples))[late] * interval
    moved = np.diff(samples[late, shape.cart_position]) / (speed * interval)
    middle = (error.max() + error.min()) / 2
    rises = np.flatnonzero((error[:-1] < middle) & (error[1:] >= middle))
    period = float(np.diff(rises).mean()) * interval if len(rises) > 2 else None
    return period, bool((moved < STANDING_SPEED_SHARE).any())
