"""Doubts about the record itself: its channels and digits, its timing, and what changes along it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.signal import welch

from friso.errors import InputError
from friso.identification.combine import spread_of
from friso.identification.doubt import (
    ERROR_SHARE_OF_A_CAUSE,
    Doubt,
    FitCase,
    FittedCase,
    RaisedDoubt,
    RecordCase,
    TriedForces,
    ValueCase,
)
from friso.identification.inverse_model import InverseModel, least_squares
from friso.identification.logs.assemble import SHARE_OF_CLIPPED_SAMPLES
from friso.identification.logs.checks import clipped_share, jumps
from friso.identification.logs.log import Log
from friso.identification.output_error.fit import explained_by_forces, is_sure_beside_all
from friso.identification.readings.common import digit_of, low_pass
from friso.intervals import NORMAL_COVERAGE
from friso.quantities import percent

SHARE_OF_A_WHOLE_RECORD = 0.75
"""Length of the longest stretch without gaps below which gaps are reported, relative to the record."""


def _gaps(case: RecordCase) -> Iterator[RaisedDoubt]:
    """Compare the longest stretch without a gap, which alone is fitted, with the whole record.

    Derivatives and filters do not reach across a gap.
    """
    part, step, count = case.log.longest, case.log.sample_time, len(case.log.time)
    share = (part.stop - part.start) / count
    if share <= SHARE_OF_A_WHOLE_RECORD:
        words = (
            f"The record has gaps, and the longest stretch without one, {step * (part.stop - part.start):.3g} s of "
            f"{step * count:.3g} s, is all that is fitted: export it without gaps"
        )
        yield RaisedDoubt(words=words, size=share)


FRICTION_SHARE_OF_A_DIGIT = 0.1
"""Resolution of the force above which it is coarse, relative to Coulomb friction."""


def _force_digits(case: RecordCase) -> Iterator[RaisedDoubt]:
    """Compare the resolution of the force with Coulomb friction.

    Noise of a digit or more dithers a coarse resolution, so the doubt is raised only if most steps of the force are
    zero.
    """
    force = case.log["force"][case.log.longest]
    digit, coulomb = digit_of(force), abs(case.inverse.value("coulomb"))
    fine = digit == 0 or digit < FRICTION_SHARE_OF_A_DIGIT * coulomb
    if not (fine or np.median(np.abs(np.diff(force))) > 0):
        words = (
            f"The force is logged in steps of {digit:.2g} {case.unit}, {percent(digit / coulomb)} of Coulomb friction: "
            "what friction does at low speed is hidden in them; log it with more digits"
        )
        yield RaisedDoubt(words=words, size=digit, unit=case.unit, spoils=True)


DIGITS_OF_A_FINE_POSITION = 500.0
"""Smallest travel at which the resolution of the position is fine, in steps of the position."""


def _position_digits(case: RecordCase) -> Iterator[RaisedDoubt]:
    """Compare the travel with the resolution of the position, or with its smallest step if no resolution shows.

    A coarse resolution turns into noise of the acceleration, and hides the deflection of bristles. Interpolation to an
    even clock makes smaller steps, and leaves the resolution.
    """
    position = case.log["position"][case.log.longest]
    steps = np.abs(np.diff(position))
    digit, travel = digit_of(position) or float(steps[steps > 0].min(initial=np.inf)), float(np.ptp(position))
    if digit * DIGITS_OF_A_FINE_POSITION >= travel:
        words = f"the position has steps of {digit:.2g} m over a travel of {travel:.3g} m: log it with more digits"
        yield RaisedDoubt(words=words, size=digit, unit="m")


def _clipped_force(case: RecordCase) -> Iterator[RaisedDoubt]:
    """Count the samples at the largest and the smallest force.

    A clipped force is too small exactly where inertia is large, which distorts mass and friction.
    """
    share = clipped_share(case.log["force"])
    if share > SHARE_OF_CLIPPED_SAMPLES:
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


MOTION_PERIODS_OF_A_SHIFT = 0.25
"""Longest shift of the force searched, in periods of the motion's bandwidth. Beyond it a sign would turn."""

MOTION_PERIODS_OF_AN_AVERAGE = 1.0
"""Longest average searched, in periods of the motion's bandwidth. Longer averages leave no motion."""


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
    latest = MOTION_PERIODS_OF_A_SHIFT * period
    widest = MOTION_PERIODS_OF_AN_AVERAGE * period / 2
    lag, _ = best((sign * lag, 1) for lag in _doubling(latest) for sign in (1, -1))
    lag, _ = plain = best((lag + more, 1) for more in (-abs(lag) // 4, abs(lag) // 4) if more)
    _, width = best((lag, sign * (2 * half + 1)) for half in _doubling(widest) for sign in (1, -1))
    wider = abs(width) // 2 | 1
    lag, width = best((lag, (1 if width > 0 else -1) * (abs(width) + sign * (wider - 1))) for sign in (-1, 1))
    lag, width = filtered = best((lag + more, width) for more in (-max(abs(lag) // 4, 1), max(abs(lag) // 4, 1)))
    simpler = min(fits[plain].error, _error_of_equal_averages(case, *filtered))
    choice = filtered if fits[filtered].error < ERROR_SHARE_OF_A_CAUSE * simpler else plain
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


ABOUT_RECORDS: dict[str, tuple[Doubt, str]] = {
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
        Doubt("fault", _position_digits, "the resolution of the position beside its travel", "reported",
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


SAMPLES_OF_A_DELAY = 0.25
"""Smallest reported delay, in samples. Shorter delays may come from holding the force between samples."""

POWER_LEFT_BY_A_DELAY = 0.3
"""Largest fraction of the residual's power that a delay leaves if it is named. It was 0.01 to 0.09 on 6 drawn logs
with a delay, and at least 0.4 on 6 sound logs of coarse encoders."""


def find_delay(case: FitCase) -> Iterator[RaisedDoubt]:
    """Look for a delay of the force, by the derivative of the logged force.

    A force that acts later by a short time differs from the logged force by that time times its derivative. Bristles
    turn the delay into damping, by their stiffness, and inertia turns it into viscous friction. Only a stage that
    follows the log is examined. In slow motion a delay cannot be told from friction at the reversals, and is not named;
    nor is one that leaves much of the residual, as digits of an encoder do.
    """
    for tried, explained in case.explained(forces_of_delay):
        late, words = -float(explained.sizes[0]), ""
        long = abs(late) >= SAMPLES_OF_A_DELAY * case.log.sample_time
        clear = long and explained.left <= POWER_LEFT_BY_A_DELAY
        if clear and case.may_name("delay") and is_sure_beside_all(case.fit, tried.forces, tried.units):
            words = (
                f"The motion seems to come {abs(late) * 1e3:.2g} ms {'after' if late > 0 else 'before'} the force: a "
                "delay of the drive or between the channels, which passes for damping and viscous friction; the "
                "intervals allow for it"
            )
        yield RaisedDoubt(words=words, size=late, unit="s", fit=case.reaching(explained.moved))


SAMPLES_OF_A_TRIED_DELAY = 0.05
"""Tried delay, in samples. Larger delays act on break-aways in jumps."""


def forces_of_delay(case: FittedCase) -> Iterator[TriedForces]:
    """Yield the force that a small delay adds: in proportion to the logged force's derivative.

    Nothing is yielded for a closed loop: only a stage that follows the log is examined.
    """
    force = delay_force(case)
    if not case.fit.problem.closed and force.any():
        yield TriedForces([force], [SAMPLES_OF_A_TRIED_DELAY * case.log.sample_time])


BANDWIDTHS_OF_A_DELAYED_FORCE = 10.0
"""Cut-off of the force for its derivative, in bandwidths of the motion. Beyond it the derivative is noise."""


def delay_force(case: FittedCase) -> np.ndarray:
    """Return the derivative of the logged force [N/s], shape (n,), without noise."""
    cutoff = BANDWIDTHS_OF_A_DELAYED_FORCE * case.inverse.bandwidth
    force = low_pass(case.log["force"][case.log.longest], case.log.sample_time, cutoff)
    return np.gradient(force, case.log.sample_time)


DELAY = Doubt(
    "fit",
    find_delay,
    "a force that goes with the derivative of the logged force",
    "intervals widen",
    "a frequency response, whose phase shows the delay",
    after=("coupling",),
    forces=forces_of_delay,
)


def find_drifting_delay(case: FitCase) -> Iterator[RaisedDoubt]:
    """Name the delays at the record's ends if a drift explains more than a constant delay."""
    effect = case.led_by("drifting-delay")
    if effect is None:
        return
    late, more = (-float(size) for size in effect.explained.sizes)
    words = (
        f"The delay between force and motion changes along the record, from {late * 1e3:.2g} to "
        f"{(late + more) * 1e3:.2g} ms, as of two clocks: the intervals allow for it; log force and motion by one clock"
    )
    yield case.named(effect, words, more, "s")


POWER_SHARE_OF_A_DRIFT = 0.5
"""Largest ratio of residuals with a changing and a constant delay. It was 0.02 to 0.25 on drawn logs."""


def forces_of_drifting_delay(case: FittedCase) -> Iterator[TriedForces]:
    """Yield the forces that a constant and a growing delay add.

    They are the derivative of the force, and its product with a ramp over the record. Nothing is yielded unless a
    changing delay explains more than a constant one.
    """
    force = delay_force(case)
    if case.fit.problem.closed or not force.any():
        return
    units = [SAMPLES_OF_A_TRIED_DELAY * case.log.sample_time] * 2
    both = [force, force * np.linspace(0.0, 1.0, len(force))]
    alone, together = (explained_by_forces(case.fit, both[:count], units[:count]) for count in (1, 2))
    if together is not None and together.left < POWER_SHARE_OF_A_DRIFT * (alone.left if alone else 1.0):
        yield TriedForces(both, units)


DRIFTING_DELAY = Doubt(
    "fit",
    find_drifting_delay,
    "a force that goes with the derivative of the logged force, more and more along the record",
    "intervals widen; bristles are refused",
    "force and motion logged by one clock",
    after=("friction-by-direction",),
    forces=forces_of_drifting_delay,
)


def find_drifting_force(case: RecordCase) -> Iterator[RaisedDoubt]:
    """Fit the inverse model with a force in proportion to time as an additional column.

    The force of a channel that warms up, or of a process, may drift while the machine does not change.
    """
    log = case.log
    with suppress(InputError):
        time = {"drift": log.time - log.time.mean()}
        model = case.modelled(log, extra=time)
        rate = f"{model.value('drift'):.2g} {case.unit}/s"
        words = f"a force drifting by {rate} accounts for most of it"
        yield RaisedDoubt(words=words, size=model.value("drift"), unit=f"{case.unit}/s", without=model, spoils=True)


DRIFTING_FORCE = Doubt(
    "cause",
    find_drifting_force,
    "the fit of the inverse model with a force that grows with time",
    "intervals reach to the values without it; friction at low speed is refused",
    "the force at rest, before and after",
    after=("timing",),
)


FORCE_SHARE_OF_A_CONSTANT_FORCE = 0.1
"""Smallest constant force that is reported beside friction, relative to the force's standard deviation."""


def find_constant_force(case: RecordCase) -> Iterator[RaisedDoubt]:
    """Name a constant force that is larger than Coulomb friction and not small against the whole force."""
    inverse = case.inverse
    offset, coulomb = (abs(inverse.value(name)) for name in ("offset", "coulomb"))
    share = FORCE_SHARE_OF_A_CONSTANT_FORCE
    if offset > max(coulomb, share * float(np.std(inverse.measured))):
        force = f"{inverse.value('offset'):.3g} {case.unit}"
        words = f"a constant force of {force} exceeds the friction: gravity, or an offset of the channel"
        yield RaisedDoubt(words=words, size=offset, unit=case.unit)


CONSTANT_FORCE = Doubt(
    "cause",
    find_constant_force,
    "the constant force of the inverse model beside its friction",
    "reported",
    "the force at rest, in several orientations",
    after=("clipped-force",),
)


SAMPLES_OF_A_SPECTRUM = 256
"""Number of samples in each piece of the residual for its spectrum. Longer pieces resolve more and scatter more."""

POWER_SHARE_OF_AN_OSCILLATION = 0.5
"""Fraction of the residual's power in one peak that counts as an oscillation."""


def find_oscillation(case: RecordCase) -> Iterator[RaisedDoubt]:
    """Look for a spectral peak that holds most of the residual's power.

    A structural mode oscillates at one frequency, and so does a force that repeats along the way at constant speed.
    """
    inverse = case.inverse
    left = inverse.measured - inverse.fitted
    step = float(np.median(np.diff(inverse.time)))
    rates, power = welch(left, 1 / step, nperseg=min(len(left), SAMPLES_OF_A_SPECTRUM))
    peak = int(np.argmax(power))
    share = power[max(peak - 1, 0) : peak + 2].sum() / power.sum() if power.sum() > 0 else 0.0
    if share < POWER_SHARE_OF_AN_OSCILLATION or peak == 0:
        return
    words = (
        f"{percent(share)} of the power of the residual is near {rates[peak]:.3g} Hz: a mode in the band, or a force "
        "that repeats along the way, such as cogging"
    )
    yield RaisedDoubt(words=words, size=float(share))


OSCILLATION = Doubt(
    "otherwise",
    find_oscillation,
    "the spectrum of the residual",
    "reported",
    "a frequency response, or passes at two speeds: cogging moves with the speed, a mode does not",
    after=("perhaps-feedforward",),
)


WORDS = {"mass": "the mass", "viscous": "viscous friction", "coulomb": "Coulomb friction"}
"""Quantities of the inverse model, as named in sentences."""


@dataclass(frozen=True)
class Half:
    """Mass or friction in either half of a record, by least squares, and a range over both.

    `first` and `second` are the values; the range from `low` to `high` holds both intervals.
    """

    name: str
    first: float
    second: float
    low: float
    high: float


def find_differing_halves(case: ValueCase) -> Iterator[RaisedDoubt]:
    """Compare mass and friction between the halves of a record, each by least squares.

    Nothing is compared if the whole model explains the record nearly to its noise.
    """
    for one in halves(case.inverse) if case.lacks else ():
        unit = case.inverse.estimate(one.name).unit
        if abs(one.first - one.second) > case.largest(unit):
            continue
        values = f"{one.first:.4g} and {one.second:.4g} {unit}"
        words = f"The halves of the record differ in {WORDS[one.name]}: {values}; its interval holds both"
        reaches = {one.name: (one.low, one.high)}
        yield RaisedDoubt(
            words="" if case.poor else words, size=abs(one.first - one.second), unit=unit, reaches=reaches
        )


RATIO_OF_COMPARABLE_HALVES = 3.0
"""Largest ratio of the halves' RMS speeds, and of their RMS accelerations, at which they are compared."""

DEVIATIONS_OF_DIFFERING_HALVES = 3.29
"""Standard deviations by which the halves of a sound record differ once in a thousand times."""


def halves(inverse: InverseModel) -> list[Half]:
    """List the mass and frictions of an inverse model that differ between the record's halves.

    They differ by more than chance, given the deviations of both. Friction is not compared between halves that move at
    very different speeds, which show different parts of its curve, nor mass at very different accelerations.
    """
    fits = []
    parts = np.array_split(np.arange(len(inverse.measured)), 2)
    sizes = np.array([np.linalg.norm(inverse.columns[part, :2], axis=0) / np.sqrt(len(part)) for part in parts])
    unlike = (sizes.max(axis=0) > RATIO_OF_COMPARABLE_HALVES * sizes.min(axis=0))[[0, 1, 1]]
    for part in parts:
        columns, force = inverse.columns[part], inverse.measured[part]
        solution, left = least_squares(columns, force)
        fits.append((solution, np.sqrt(np.diag(spread_of(columns, left)))))
    values, off = (np.array(rows) for rows in zip(*fits, strict=True))
    apart = np.abs(values[0] - values[1]) > DEVIATIONS_OF_DIFFERING_HALVES * np.hypot(*off)
    low, high = (values - NORMAL_COVERAGE * off).min(axis=0), (values + NORMAL_COVERAGE * off).max(axis=0)
    return [
        Half(name, *(float(number) for number in (*values[:, i], low[i], high[i])))
        for i, name in enumerate(WORDS)
        if apart[i] and not unlike[i] and np.isfinite(off[:, i]).all()
    ]


DIFFERING_HALVES = Doubt(
    "value",
    find_differing_halves,
    "mass and friction of either half of the record",
    "intervals hold both",
    "the same moves again, after the machine has warmed up",
    after=("little-friction",),
)
