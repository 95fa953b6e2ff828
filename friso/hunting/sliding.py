"""Tell whether a stage that is moved at constant speed slides smoothly, or sticks and slips."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.engine.allowance import Exhausted, allowance
from friso.engine.batch import RunOptions, run_chunks
from friso.engine.kernel import kernel
from friso.equations.motions import VELOCITY
from friso.equations.structure import shared_structure, structure
from friso.hunting.attractors.rounds import SURVEY_RTOL
from friso.hunting.cycle.ensemble import Ensemble, done
from friso.hunting.measures import LAST_QUARTER
from friso.hunting.motions import some_of
from friso.hunting.rows import spans
from friso.hunting.settings import tracking_settings
from friso.stage import Stage
from friso.stage.rig import DURATION


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
        others = np.geomspace(*tracking_settings.speeds_tried, tracking_settings.speed_count)
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
            count = tracking_settings.speeds_between + 2
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
    for number in range(1 + tracking_settings.longer_runs):
        moved = {**some_of(flat, left), DURATION: durations[left]}
        budget = tracking_settings.most_sliding_steps
        options = RunOptions(SURVEY_RTOL, window=LAST_QUARTER, record_from=np.inf, least_swing=np.inf, budget=budget)
        swing = np.full(len(left), np.nan)
        for runs in run_chunks(shape, moved, len(left), options):
            spread = runs.statistic("deviation_max") - runs.statistic("deviation_min")
            swing[runs.numbers] = np.where(done(runs.results), spread, np.nan)
        before = swings[left]
        swings[left] = np.where(np.isfinite(swing), swing, before)
        small = swing < tracking_settings.no_swing_share * lengths[left]
        if number:
            lasts[left] = ~small & (swing > tracking_settings.lasting_share * before)
        dies = small | (swing < tracking_settings.dying_share * before)
        decided[left] = lasts[left] | dies
        left = left[~decided[left] & np.isfinite(swing)]
        if not left.size:
            break
        durations[left] *= tracking_settings.longer_run
    return lasts, decided, swings


def _lengths(flat: Mapping[str, Any], count: int) -> np.ndarray:
    """Return the lengths [m] by which the loops of stages are deflected at break-away, (count,)."""
    return np.broadcast_to(Ensemble.held(flat, count, form=shared_structure(flat)).length, (count,)).astype(float)


def _durations(flat: Mapping[str, Any], count: int) -> np.ndarray:
    """Return times [s] in which moving stages stick and slip many times, (count,).

    A swing takes as long as the reference needs to deflect the loop to break-away and back, and the loop to swing.
    """
    rate = np.broadcast_to(Ensemble.held(flat, count, form=shared_structure(flat)).number("rate"), (count,))
    swing = 2 * np.pi / rate + 2 * _lengths(flat, count) / np.abs(flat[VELOCITY])
    return np.asarray(tracking_settings.swings_followed * swing)


def _course(flat: Mapping[str, Any], speed: float) -> tuple[float | None, bool]:
    """Return the period of the error's swing [s] (None: too few swings), and whether the stage sticks in it."""
    shape, duration = kernel(structure(flat)), float(_durations(flat, 1)[0])
    interval = duration / tracking_settings.samples_of_a_course
    options = RunOptions(SURVEY_RTOL, interval=interval, record_from=np.inf, least_swing=np.inf)
    (runs,) = run_chunks(shape, {**flat, DURATION: duration}, 1, options)
    samples = runs.results.samples[0]
    late = slice(int(LAST_QUARTER * len(samples)), None)
    error = samples[late, shape.cart_position] - speed * np.arange(len(samples))[late] * interval
    moved = np.diff(samples[late, shape.cart_position]) / (speed * interval)
    middle = (error.max() + error.min()) / 2
    rises = np.flatnonzero((error[:-1] < middle) & (error[1:] >= middle))
    period = float(np.diff(rises).mean()) * interval if len(rises) > 2 else None
    return period, bool((moved < tracking_settings.standing_speed_share).any())
