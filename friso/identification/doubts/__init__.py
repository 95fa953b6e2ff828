"""Doubts about logs: those about a record itself in a table, and one module for each effect outside the model."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import replace

import numpy as np
from scipy.ndimage import uniform_filter1d

from friso.errors import InputError
from friso.identification.doubt import Doubt, RaisedDoubt, RecordCase
from friso.identification.inverse_model import InverseModel
from friso.identification.logs.checks import clipped_share, jumps
from friso.identification.logs.log import Log
from friso.identification.logs.settings import settings
from friso.identification.readings.common import digit_of
from friso.identification.settings import doubt_settings
from friso.quantities import percent


def _gaps(case: RecordCase) -> Iterator[RaisedDoubt]:
    """Compare the longest stretch without a gap, which alone is fitted, with the whole record.

    Derivatives and filters do not reach across a gap.
    """
    part, step, count = case.log.longest, case.log.sample_time, len(case.log.time)
    share = (part.stop - part.start) / count
    if share <= doubt_settings.share_of_a_whole_record:
        words = (
            f"The record has gaps, and the longest stretch without one, {step * (part.stop - part.start):.3g} s of "
            f"{step * count:.3g} s, is all that is fitted: export it without gaps"
        )
        yield RaisedDoubt(words=words, size=share)


def _force_digits(case: RecordCase) -> Iterator[RaisedDoubt]:
    """Compare the resolution of the force with Coulomb friction.

    Noise of a digit or more dithers a coarse resolution, so the doubt is raised only if most steps of the force are
    zero.
    """
    force = case.log["force"][case.log.longest]
    digit, coulomb = digit_of(force), abs(case.inverse.value("coulomb"))
    fine = digit == 0 or digit < doubt_settings.friction_share_of_a_digit * coulomb
    if not (fine or np.median(np.abs(np.diff(force))) > 0):
        words = (
            f"The force is logged in steps of {digit:.2g} {case.unit}, {percent(digit / coulomb)} of Coulomb friction: "
            "what friction does at low speed is hidden in them; log it with more digits"
        )
        yield RaisedDoubt(words=words, size=digit, unit=case.unit, spoils=True)


def _position_digits(case: RecordCase) -> Iterator[RaisedDoubt]:
    """Compare the travel with the smallest step of the position.

    A coarse resolution turns into noise of the acceleration, and hides the deflection of bristles.
    """
    position = case.log["position"][case.log.longest]
    steps = np.abs(np.diff(position))
    digit, travel = float(steps[steps > 0].min(initial=np.inf)), float(np.ptp(position))
    if digit * doubt_settings.digits_of_a_fine_position >= travel:
        words = f"the position has steps of {digit:.2g} m over a travel of {travel:.3g} m: log it with more digits"
        yield RaisedDoubt(words=words, size=digit, unit="m")


def _clipped_force(case: RecordCase) -> Iterator[RaisedDoubt]:
    """Count the samples at the largest and the smallest force.

    A clipped force is too small exactly where inertia is large, which distorts mass and friction.
    """
    share = clipped_share(case.log["force"])
    if share > settings.share_of_clipped_samples:
        words = f"{percent(share)} of the force samples lie at its extremes: the channel clips"
        yield RaisedDoubt(words=words, size=share, spoils=True)


def _position_jump(case: RecordCase) -> Iterator[RaisedDoubt]:
    """Look for a step between two samples that no motion makes, many times larger than nearly all others.

    The inverse model turns it into an impossible force.
    """
    size, sample = jumps(case.log["position"][case.log.longest])
    if size:
        at = case.log.time[case.log.longest][sample]
        words = f"the position jumps by {size:.3g} m at {at:.4g} s, as after homing or a reset: cut the record there"
        yield RaisedDoubt(words=words, size=size, unit="m")


def _timing(case: RecordCase) -> Iterator[RaisedDoubt]:
    """Search for the shift of the force, and the average of force or motion, that fit best.

    Lags and widths of 1, 2, 4, ... samples are tried; the best is then refined once to either side.
    """
    log = case.log
    fits: dict[tuple[int, int], InverseModel] = {(0, 1): case.inverse}

    def best(tried: Iterable[tuple[int, int]]) -> tuple[int, int]:
        for lag, width in tried:
            with suppress(InputError):
                fits[lag, width] = _with_timing(case, lag, width)
        return min(fits, key=lambda choice: fits[choice].error)

    period = 1 / (case.inverse.bandwidth * log.sample_time)
    latest = doubt_settings.motion_periods_of_a_shift * period
    widest = doubt_settings.motion_periods_of_an_average * period / 2
    lag, _ = best((sign * lag, 1) for lag in _doubling(latest) for sign in (1, -1))
    lag, _ = plain = best((lag + more, 1) for more in (-abs(lag) // 4, abs(lag) // 4) if more)
    _, width = best((lag, sign * (2 * half + 1)) for half in _doubling(widest) for sign in (1, -1))
    wider = abs(width) // 2 | 1
    lag, width = best((lag, (1 if width > 0 else -1) * (abs(width) + sign * (wider - 1))) for sign in (-1, 1))
    lag, width = filtered = best((lag + more, width) for more in (-max(abs(lag) // 4, 1), max(abs(lag) // 4, 1)))
    simpler = min(fits[plain].error, _error_of_equal_averages(case, *filtered))
    choice = filtered if fits[filtered].error < doubt_settings.error_share_of_a_cause * simpler else plain
    if choice != (0, 1):
        size = choice[0] * log.sample_time
        yield RaisedDoubt(
            words=_sentence(*choice, log.sample_time), size=size, unit="s", without=fits[choice], spoils=True
        )


def _doubling(most: float) -> list[int]:
    """List the powers of two from 1 up to `most`; [] if `most` is below 1."""
    return [2**power for power in range(int(np.log2(most)) + 1)] if most >= 1 else []


def _with_timing(case: RecordCase, lag: int, width: int) -> InverseModel:
    """Fit the inverse model with the force delayed by `lag`, the motion averaged over `width`.

    `lag` and `width` are numbers of samples. A negative `width` averages the force instead.
    """
    moved = _force_moved(case.log, lag, max(-width, 1))
    return case.modelled(moved, averaged=max(width, 1))


def _error_of_equal_averages(case: RecordCase, lag: int, width: int) -> float:
    """Return the error of the inverse model with force and motion averaged alike.

    The force is `lag` samples later. `width` is negative; both are averaged over its size in samples. The error serves
    as a check: averaging the force alone merely hides fast residuals.
    """
    if width >= 0:
        return np.inf
    moved = _force_moved(case.log, lag, -width)
    return case.modelled(moved, averaged=-width).error


def _force_moved(log: Log, lag: int, width: int) -> Log:
    """Return the log with its force `lag` samples later, averaged over `width` samples."""
    force = uniform_filter1d(np.roll(log["force"], lag), width)
    return replace(log, signals={**log.signals, "force": force})


def _sentence(lag: int, width: int, step: float) -> str:
    """Write which shift and which average improve the fit, and what that suggests.

    `lag` and `width` are counted in samples of `step` [s]; a negative width averages the force, not the motion.
    """
    shift = f"{abs(lag) * step * 1e3:.3g} ms {'earlier' if lag < 0 else 'later'}"
    if width == 1:
        return f"shifting the force {shift} improves the fit considerably, which suggests a delay between the channels"
    averaged, shifted, cause = (
        ("motion", "the force", "an averaged or filtered force, or a coupling between force and position")
        if width > 0
        else ("force", "it", "a position that is filtered, or not measured")
    )
    also = f" and shifting {shifted} {shift}" if lag else ""
    span = f"{abs(width) * step * 1e3:.3g} ms"
    return f"averaging the {averaged} over {span}{also} improves the fit considerably, which suggests {cause}"


TABLE: dict[str, tuple[Doubt, str]] = {
    "clipped-force": (
        Doubt("cause", _clipped_force, "force samples at the extremes", "friction at low speed is refused",
              "a wider range of the channel"),
        "Doubt: the force channel clips, with many samples at its extremes",
    ),
    "force-digits": (
        Doubt("record", _force_digits, "the steps of the force beside Coulomb friction",
              "friction at low speed is refused", "a log with more digits"),
        "Doubt: the resolution of the force is coarse compared with the friction",
    ),
    "gaps": (
        Doubt("record", _gaps, "gaps between samples", "reported", "a record exported without gaps"),
        "Doubt: gaps leave little of the record to fit",
    ),
    "position-digits": (
        Doubt("fault", _position_digits, "the smallest step of the position beside its travel", "reported",
              "a log with more digits", after=("position-jump",)),
        "Doubt: the resolution of the position is coarse compared with its travel",
    ),
    "position-jump": (
        Doubt("fault", _position_jump, "steps of the position between samples", "reported",
              "the record cut at the jump"),
        "Doubt: the position jumps, as after homing or a reset of the counter",
    ),
    "timing": (
        Doubt("cause", _timing, "the fit of the inverse model with the force shifted, and force or motion averaged",
              "intervals reach to the values without it; friction at low speed is refused",
              "a step of the force logged with the motion on the same clock"),
        "Doubt: force and motion differ in timing: one is delayed, or averaged by a filter or a slow channel",
    ),
}  # fmt: skip
"""Doubts about the record itself: gaps, digits, range and clock of its channels."""
