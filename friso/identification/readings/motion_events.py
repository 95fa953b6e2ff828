"""Find what happens in slow motion: slips, passes at constant velocity, and force ramps up to break-away.

A slip of a sticking body starts where its speed stands out of the noise.

A pass shows friction, because its force is without inertia.

A force ramp runs from rest until the body moves off, and shows friction at the start of motion. A maximum over noise
reads high, by up to about sqrt(2 ln n) deviations of n independent values. A smoothed peak reads low, by the rise of
the force within the smoothing. The smoothing minimises the sum of both errors.

Static friction follows from break-away forces, which fall with the rate of the force. While the force rises at a rate R
the bristles creep at a speed v with F = g(v) (1 - R/(sigma_0 v)), from LuGre with dz/dt = R/sigma_0; break-away is the
largest F over all speeds. It lies below F_s by a part that grows as R^(2/3) while it is small (g expanded to second
order in v/v_s) and depends on R/(sigma_0 v_s) and F_c/F_s only. Inertia, left out here, only delays: break-away is no
lower (Canudas de Wit et al. 1995, doi:10.1109/9.376053, Fig. 3).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.signal import detrend

from friso.identification.estimate import Estimate
from friso.identification.logs.checks import runs
from friso.identification.logs.log import Log
from friso.identification.readings.common import (
    Mean,
    block_mean,
    by_t,
    channel,
    correlated_mean,
    low_pass,
    on_bearing,
    rate,
    robust,
    stribeck_curve,
    t_value,
)
from friso.quantities import percent


class Slip(NamedTuple):
    """Start of a slip of a sticking body, by sample numbers.

    `onset` is that of visible motion (above the noise and a hundredth of the highest speed), `start` that of the slip
    (above the threshold). `rest` is the beginning of the rest before, and `fastest` the fastest sample. The `direction`
    is +1 or -1.
    """

    onset: int
    start: int
    rest: int
    fastest: int
    direction: int


@dataclass(frozen=True)
class Slips:
    """Starts of slips of a sticking body.

    `speed` [m/s], shape (samples,), is the body's, with the `threshold` [m/s] of slips and the fraction of time above
    it.
    """

    starts: tuple[Slip, ...]
    speed: np.ndarray
    threshold: float
    share: float


DEVIATIONS_OF_A_SLIP = 8.0
"""Smallest speed of a slip, in standard deviations of the noise."""

SPEED_SHARE_OF_A_SLIP = 0.1
"""Speed above which a body slips, relative to the highest speed."""

TIME_BEFORE_A_SLIP = 0.05  # [s]
"""Shortest rest before a slip, which shows the rate of the force."""

SAMPLES_BEFORE_A_SLIP = 10
"""Fewest samples of the rest before a slip."""

SPEED_SHARE_OF_AN_ONSET = 0.01
"""Speed at which the motion of a slip becomes visible, relative to its highest."""


def slips(position: np.ndarray, sample_time: float, cutoff: float) -> Slips:
    """Find the slips in a position [m], shape (n,), differentiated below `cutoff` [Hz].

    A slip counts only after a rest of some length.
    """
    speed = rate(position, sample_time, cutoff)
    size = np.abs(speed)
    slow = speed[size <= np.percentile(size, 50)]
    noise = robust(slow) * 2  # of normal scatter, the slower half spreads by about half the standard deviation
    clear = DEVIATIONS_OF_A_SLIP * noise
    threshold = max(clear, SPEED_SHARE_OF_A_SLIP * float(size.max(initial=0.0)))
    above = size > threshold
    least = max(int(TIME_BEFORE_A_SLIP / sample_time), SAMPLES_BEFORE_A_SLIP)
    edge = int(1 / (cutoff * sample_time))
    starts: list[Slip] = []
    rested = 0
    for run in runs(above):
        if run.start - rested >= least and run.start > edge and threshold > 0:
            top = run.start + int(np.argmax(size[run]))
            level = min(max(clear, SPEED_SHARE_OF_AN_ONSET * float(size[top])), threshold)
            quiet = np.flatnonzero(size[rested : run.start] <= level)
            onset = rested + int(quiet[-1]) if len(quiet) else rested
            if onset - rested >= SAMPLES_BEFORE_A_SLIP:
                starts.append(Slip(onset, run.start - 1, rested, top, int(np.sign(speed[top]))))
        rested = run.stop
    return Slips(tuple(starts), speed, threshold, float(above.mean()) if len(above) else 0.0)


QUICK_SWING_OF_A_STEADY_PASS = 0.02
"""Largest fast swing of a steady velocity, relative to its mean. Aliasing may make it appear smaller."""

SWING_OF_A_STEADY_PASS = 0.3
"""Largest swing of a steady velocity, relative to its mean. With more, a body sticks and slips, or oscillates."""


@dataclass(frozen=True)
class Pass:
    """A stretch of constant velocity in a log.

    Fields are the samples (`span`), the mean velocity [m/s], the velocity's standard deviation below and above the
    cut-off, the mean force [N] by blocks, and the mean acceleration [m/s^2].
    """

    span: slice
    velocity: float
    swing: float
    quick_swing: float
    force: Mean
    acceleration: float

    @property
    def steady(self) -> bool:
        """Tell whether the velocity hardly swings, neither slowly nor fast."""
        speed = abs(self.velocity)
        quick = self.quick_swing > QUICK_SWING_OF_A_STEADY_PASS * speed
        return self.swing <= SWING_OF_A_STEADY_PASS * speed and not quick


SAMPLES_OF_A_PASS = 40
"""Fewest samples of a stretch of constant velocity."""


def passes(log: Log) -> tuple[Pass, ...]:
    """Find all stretches of constant velocity.

    The reference decides where the velocity is constant; without a reference, the body's own motion. Each pass states
    whether its motion was steady. Raises InputError for missing position or force.
    """
    position, velocity = on_bearing(log), _velocity(log)
    channel(log, "force")
    stretches = []
    for part in log.segments:
        if part.stop - part.start < SAMPLES_OF_A_PASS:
            continue
        spans = _of_reference(log, part) if "reference" in log else _of_motion(velocity[part], log.sample_time)
        for steady in spans:
            span = slice(part.start + steady.start, part.start + steady.stop)
            if np.ptp(position[span]) > 0 and velocity[span].mean() != 0:
                stretches.append(_pass(log, span, velocity))
    return tuple(stretches)


SHARE_IN_COMMON = 0.5
"""Shortest common way, relative to the shortest pass."""

SAMPLES_IN_COMMON = 16
"""Fewest samples of each pass on the way that all passes share."""


def on_common_places(log: Log, stretches: Sequence[Pass]) -> tuple[Pass, ...]:
    """Cut passes to the way that all of them cover, to compare friction at the same places.

    Passes stay uncut if the common way is too short.
    """
    position, velocity = on_bearing(log), _velocity(log)
    covered = [(float(position[single.span].min()), float(position[single.span].max())) for single in stretches]
    low, high = max((span[0] for span in covered), default=0.0), min((span[1] for span in covered), default=0.0)
    if high - low < SHARE_IN_COMMON * min((span[1] - span[0] for span in covered), default=np.inf):
        return tuple(stretches)
    cut = []
    for stretch in stretches:
        inside = stretch.span.start + np.flatnonzero((position[stretch.span] >= low) & (position[stretch.span] <= high))
        if len(inside) < SAMPLES_IN_COMMON:
            return tuple(stretches)
        cut.append(_pass(log, slice(int(inside[0]), int(inside[-1]) + 1), velocity))
    return tuple(cut)


def places_of(log: Log, stretches: Sequence[Pass]) -> tuple[float, float]:
    """Return the lowest and highest position [m] in passes of a log; NaN without any."""
    places = [on_bearing(log)[stretch.span] for stretch in stretches]
    return (min(place.min() for place in places), max(place.max() for place in places)) if places else (np.nan, np.nan)


LOW_PASS_OF_PASSES = 25.0  # [Hz]
"""Cut-off frequency of the velocity in which stretches of constant velocity are searched."""


def _velocity(log: Log) -> np.ndarray:
    """Return the velocity [m/s] of the body on the bearing, (n,); NaN in segments too short."""
    position = on_bearing(log)
    velocity = np.full(len(position), np.nan)
    for part in log.segments:
        if part.stop - part.start >= SAMPLES_OF_A_PASS:
            velocity[part] = rate(position[part], log.sample_time, LOW_PASS_OF_PASSES)
    return velocity


ACCELERATION_OF_A_CONSTANT_SPEED = 0.02
"""Acceleration below which the reference has constant velocity, relative to its largest."""

SPEED_SHARE_OF_CREEPING = 1e-4
"""Speed below which a body creeps, relative to the highest speed."""


def _of_reference(log: Log, part: slice) -> list[slice]:
    """Find where the reference has constant velocity, without the time of settling.

    `part` are the samples of a segment. Standstill does not count.
    """
    reference = channel(log, "reference")[part]
    velocity = np.gradient(low_pass(reference, log.sample_time, LOW_PASS_OF_PASSES), log.sample_time)
    acceleration = np.abs(np.gradient(velocity, log.sample_time))
    steady = acceleration <= ACCELERATION_OF_A_CONSTANT_SPEED * float(acceleration.max())
    moving = np.abs(velocity) > SPEED_SHARE_OF_CREEPING * float(np.abs(velocity).max())
    return _trimmed(steady & moving, log.sample_time, 0.1)


CHANGE_OF_A_KEPT_VELOCITY = 0.1
"""Largest change of a constant velocity within a period of the cut-off."""

SPEED_SHARE_OF_SETTLING = 1e-3
"""Speed below which a body settles rather than keeps its velocity, relative to the highest (friso's choice)."""


def _of_motion(velocity: np.ndarray, sample_time: float) -> list[slice]:
    """Find the stretches over which the body itself keeps its velocity.

    The acceleration is within the noise there, or small compared with the largest acceleration and with the velocity. A
    stretch that swings throughout counts as well.
    """
    smooth = low_pass(velocity, sample_time, LOW_PASS_OF_PASSES / 2)
    acceleration, speed = np.abs(np.gradient(smooth, sample_time)), np.abs(smooth)
    noise, top = 5 * robust(np.gradient(smooth, sample_time)), float(speed.max())
    gentle = ACCELERATION_OF_A_CONSTANT_SPEED * float(np.percentile(acceleration, 99.5))
    moving = speed > max(SPEED_SHARE_OF_CREEPING * top, 8 * robust(velocity - smooth))
    kept_velocity = CHANGE_OF_A_KEPT_VELOCITY * LOW_PASS_OF_PASSES * speed
    even = moving & (acceleration <= np.maximum(np.minimum(gentle, kept_velocity), noise))
    swinging = moving & (speed > SPEED_SHARE_OF_SETTLING * top) & (acceleration <= max(gentle, noise))
    kept = _trimmed(even, sample_time, 0.0)
    others = _trimmed(swinging, sample_time, 0.0)
    kept += [one for one in others if not any(one.start < other.stop and other.start < one.stop for other in kept)]
    return sorted(kept, key=lambda one: one.start)


TIME_OF_A_PASS = 0.1  # [s]
"""Shortest stretch of constant velocity, the settling time of the filter."""


def _trimmed(mask: np.ndarray, sample_time: float, share: float) -> list[slice]:
    """Return the stretches of a mask without their ends, as far as they are long enough.

    Both ends are cut by the filter's settling time, and the start by a further fraction, `share`, for the axis to
    settle.
    """
    edge = int(1 / (LOW_PASS_OF_PASSES * sample_time))
    least = max(int(TIME_OF_A_PASS / sample_time), SAMPLES_OF_A_PASS)
    stretches = []
    for run in runs(mask):
        begin, end = run.start + edge + int(share * (run.stop - run.start)), run.stop - edge
        if end - begin >= least:
            stretches.append(slice(begin, end))
    return stretches


def _pass(log: Log, span: slice, velocity: np.ndarray) -> Pass:
    """Describe a stretch of constant velocity."""
    went, force = velocity[span], block_mean(channel(log, "force")[span])
    acceleration = float((went[-1] - went[0]) / ((span.stop - span.start - 1) * log.sample_time))
    position = on_bearing(log)
    quick = _quick_swing(position[span], log.sample_time, _digit(position))
    return Pass(span, float(went.mean()), float(went.std()), quick, force, acceleration)


ROUNDING_OF_A_STEP = 1e-6
"""Largest step of a position that counts as rounding error, relative to the largest step."""

ERROR_OF_WHOLE_DIGITS = 0.1
"""Largest distance of steps from multiples of the resolution."""


def _digit(position: np.ndarray) -> float:
    """Return the resolution [m] of a position: the smallest step, if all steps are multiples.

    Otherwise, and for a position that never changes, the result is 0.
    """
    steps = np.abs(np.diff(position))
    steps = steps[steps > ROUNDING_OF_A_STEP * steps.max(initial=0.0)]
    if not len(steps):
        return 0.0
    digits = steps / steps.min()
    return float(steps.min()) if np.abs(digits - np.rint(digits)).max() < ERROR_OF_WHOLE_DIGITS else 0.0


POWER_OF_A_CLEAR_LINE = 20.0
"""Smallest power of a spectral line that stands out of the noise, relative to the median."""


def _quick_swing(position: np.ndarray, sample_time: float, digit: float) -> float:
    """Return the standard deviation of fast oscillation of the velocity [m/s]; 0 if none shows.

    The oscillation is faster than the low-pass of passes. Only spectral lines clear of the noise count. Motion by less
    than one `digit` [m] of the position does not count.
    """
    window = np.hanning(len(position))
    lines = np.abs(np.fft.rfft(detrend(position) * window)) ** 2 * 2 / (len(position) * np.sum(window**2))
    frequency = np.fft.rfftfreq(len(position), sample_time)
    lobe = 2 / (len(position) * sample_time)  # half a main lobe of the window, to separate the lines
    above = frequency > LOW_PASS_OF_PASSES + lobe
    if not above.any():
        return 0.0
    power = np.where(above & (lines > POWER_OF_A_CLEAR_LINE * np.median(lines[above])), lines, 0.0)
    if power.sum() < digit**2:
        return 0.0
    return float(np.sqrt(np.sum(power * (2 * np.pi * frequency) ** 2)))


@dataclass(frozen=True)
class Ramps:
    """Ramps of the force from rest, each until the body moves off.

    Per ramp, shape (n,), there are time [s], place [m], direction, break-away force [N] in this direction, force rate
    [N/s], the break-away force's error [N] by noise and smoothing to either side, its possible excess [N] if the mass
    is not known, and the body's highest speed [m/s] until break-away. `threshold` [m/s] is the speed at which motion
    counts.
    """

    times: np.ndarray
    places: np.ndarray
    directions: np.ndarray
    forces: np.ndarray
    rates: np.ndarray
    unsure: np.ndarray
    late: np.ndarray
    speeds: np.ndarray
    threshold: float
    notes: tuple[str, ...]


LOW_PASS_OF_RAMPS = 100.0  # [Hz]
"""Cut-off frequency of force and velocity in force ramps."""

PERIODS_OF_A_RAMP = 2.0
"""Shortest second half of a ramp whose break-away can be read, in periods of the low-pass."""

SAMPLES_OF_A_RAMP = 5
"""Fewest samples from which the rate of a ramp is read."""

SAMPLES_WITH_A_RAMP = 20
"""Fewest samples of a segment with a ramp."""

FORCE_SHARE_OF_A_START = 0.5
"""Largest initial force of a ramp, relative to break-away. With more, bristles are bent already."""


def force_ramps(log: Log, mass: float = 0.0) -> Ramps:
    """Find the ramps of the force in a log, each from rest of the body on the bearing.

    With the moving `mass` [kg], the break-away force is the greatest friction (force minus inertia) as motion begins,
    the published definition. Without, it is the force at which motion becomes visible, which contains inertia. Raises
    InputError for a missing channel.
    """
    force, body = channel(log, "force"), on_bearing(log)
    rows: list[tuple[float, ...]] = []
    cutoff, threshold, quick, stops = LOW_PASS_OF_RAMPS, 0.0, 0, 0
    shortest = max(PERIODS_OF_A_RAMP / (cutoff * log.sample_time), SAMPLES_OF_A_RAMP)
    for part in log.segments:
        if part.stop - part.start < SAMPLES_WITH_A_RAMP:
            continue
        breaks = slips(body[part], log.sample_time, cutoff)
        threshold = max(threshold, breaks.threshold)
        pushed = low_pass(force[part], log.sample_time, cutoff)
        for onset, start, rest, fastest, direction in breaks.starts:
            push = direction * force[part][rest : start + 1]
            if _lowest(push) > FORCE_SHARE_OF_A_START * float(direction * pushed[start]) > 0:
                stops += 1
                continue
            begin = rest + _half(push)
            before = pushed[max(rest, start - round(shortest))]
            if start - begin < shortest or direction * (2 * before - pushed[rest] - pushed[start]) < 0:
                quick += 1
                continue
            rising = direction * np.polyfit(np.arange(begin, start) * log.sample_time, pushed[begin:start], 1)[0]
            at, level, unsure, late = onset, float(direction * pushed[onset]), 0.0, 0.0
            if rising > 0:
                # friction opposes the motion, so the force's impulse is at least mass times speed
                heaviest = direction * float(pushed[onset:fastest].sum()) * log.sample_time / abs(breaks.speed[fastest])
                signals = direction * force[part], direction * body[part]
                top = peak(*signals, mass or heaviest, log.sample_time, rising, (begin, start), cutoff)
                if mass:
                    at, level, unsure = top.at, top.level, top.unsure
                else:
                    late = max(level - top.level + top.unsure, 0.0)
            first = part.start + at
            place = float(log.time[first]), float(body[first]), float(direction)
            rows.append((*place, level, float(rising), unsure, late, abs(float(breaks.speed[start]))))
    table = np.array([row for row in rows if row[3] > 0 and row[4] > 0]).reshape(-1, 8).T
    notes = []
    if quick:
        too_fast = f"{quick} ramps rise too fast for a low-pass at {cutoff:g} Hz (or the sampling)"
        notes.append(f"{too_fast} and are left out.")
    if stops:
        notes.append(f"{stops} motions continued after a stop within a ramp and are left out: they began from no rest.")
    if len(rows) > table.shape[1]:
        notes.append(f"{len(rows) - table.shape[1]} motions did not begin under a rising force and are left out.")
    times, places, directions, forces, rates, unsure, late, speeds = table
    return Ramps(times, places, directions, forces, rates, unsure, late, speeds, threshold, tuple(notes))


SMOOTHING_OF_A_RAMP = 40
"""Divisor of a ramp's number of samples that gives the smoothing width for finding the ramp's second half."""


def _lowest(push: np.ndarray) -> float:
    """Return the smallest smoothed force [N] on a body during its rest before a motion."""
    return float(smoothed(push, len(push) / SMOOTHING_OF_A_RAMP).min())


def _half(push: np.ndarray) -> int:
    """Return the last sample at which a smoothed force is at most the mean of its end values."""
    smooth = smoothed(push, len(push) / SMOOTHING_OF_A_RAMP)
    return int(np.flatnonzero(smooth <= (smooth[0] + smooth[-1]) / 2)[-1])


PEAK_LOSS = 2.2
"""Loss of a smoothed peak of a ramp that ends in a sudden fall, in units of its rise R w within one deviation w of the
Gaussian. It holds for a fall by 10 R w (least over k of k Phi(k) + phi(k) + 10 Phi(-k), of the normal distribution;
1.8 for a fall by 5 R w, 2.8 for one by 50); a gradual fall loses less."""

GAUSSIAN_WIDTH = 0.1325
"""Standard deviation of a Gaussian in time, times the frequency at which it halves the power: sqrt(ln 2) / (2 pi)."""


@dataclass(frozen=True)
class Peak:
    """Largest friction in a break-away: its sample, its level [N], and its uncertainty [N]."""

    at: int
    level: float
    unsure: float


DEVIATIONS_OF_A_KERNEL = 4
"""Half-width at which the smoothing Gaussian is cut off, in standard deviations."""


def smoothed(values: np.ndarray, width: float) -> np.ndarray:
    """Smooth values, shape (n,), by a Gaussian of `width` samples.

    Beyond its ends, the signal is continued by point reflection about its end values.
    """
    more = min(int(DEVIATIONS_OF_A_KERNEL * width) + 1, len(values) - 1)
    longer = np.pad(values, more, mode="reflect", reflect_type="odd")
    return gaussian_filter1d(longer, width, truncate=DEVIATIONS_OF_A_KERNEL)[more : len(longer) - more]


def scatter(values: np.ndarray) -> float:
    """Return the standard deviation of white noise on slow values; 0 for fewer than 3 values.

    The deviation is computed from second differences.
    """
    return float(np.sqrt(np.mean(np.diff(values, 2) ** 2) / 6)) if len(values) > 2 else 0.0


def _second(values: np.ndarray) -> np.ndarray:
    """Return second differences, shape (n,); 0 at the ends."""
    return np.pad(np.diff(values, 2), 1)


RAMP_SHARE_OF_A_WIDTH = 0.1
"""Largest width of the smoothing Gaussian, relative to the second half of a ramp."""

WIDTHS_TRIED = 12
"""Number of widths of the smoothing Gaussian among which the best is chosen."""


def peak(
    force: np.ndarray,
    position: np.ndarray,
    mass: float,
    sample_time: float,
    rising: float,
    marks: tuple[int, int],
    cutoff: float,
) -> Peak:
    """Find the largest friction before a body breaks away.

    Friction is the force [N] minus `mass` [kg] times the second derivative of the position [m], both of shape (n,) and
    positive in the direction of motion. It is searched between two `marks` (indices); the body rests in the first half.
    The force rises at `rising` [N/s]; frequencies above `cutoff` [Hz] are filtered out.
    """
    begin, start = marks
    rest = slice(begin, (begin + start) // 2)
    noise = scatter(force[rest]), mass / sample_time**2 * scatter(position[rest])
    least = max(GAUSSIAN_WIDTH / (cutoff * sample_time), 1.0)
    widths = np.geomspace(least, max(RAMP_SHARE_OF_A_WIDTH * (start - begin), least), WIDTHS_TRIED)
    # deviations of white noise under a Gaussian, and under its second derivative
    left = np.hypot(noise[0] / np.sqrt(2 * np.pi**0.5 * widths), noise[1] * np.sqrt(3 / (8 * np.pi**0.5 * widths**5)))
    high = left * np.sqrt(2 * np.log(1 + (start - begin) / (2 * widths)))
    low = PEAK_LOSS * rising * widths * sample_time
    best = int(np.argmin(high + low))
    width = float(widths[best])
    # second differences of the smoothed signal: the derivative of a truncated Gaussian does not sum to 0
    friction = smoothed(force, width) - mass / sample_time**2 * _second(smoothed(position, width))
    at = begin + int(np.argmax(friction[begin : start + 1]))
    return Peak(at, float(friction[at] + (low[best] - high[best]) / 2), float(low[best] + high[best]) / 2)


RELATIVE_SPEEDS = np.geomspace(1e-4, 10, 2001)
"""Speeds, relative to the Stribeck velocity, among which the largest force is searched."""


def break_away(
    force_rate: float, static: float, coulomb: float, bristle_stiffness: float, stribeck_velocity: float
) -> float:
    """Return the least break-away force [N] of LuGre friction at a `force_rate` [N/s].

    Static and Coulomb friction are in N, bristle stiffness in N/m, Stribeck velocity in m/s. Inertia, which is left
    out, only raises break-away.
    """
    level = stribeck_curve(RELATIVE_SPEEDS, coulomb, static, 1.0)
    creep = 1 - force_rate / (bristle_stiffness * stribeck_velocity * RELATIVE_SPEEDS)
    return float(max(np.max(level * creep), coulomb))


LEAST_BRISTLE_RATE = 100.0  # [N/s]
"""Least product of bristle stiffness and Stribeck velocity, of Canudas de Wit et al. 1995; the thesis has 160."""


def share_below(force_rate: float) -> float:
    """Return by which fraction break-away may lie below static friction at a rate [N/s].

    The bound holds whatever the Coulomb friction is, if bristle stiffness times Stribeck velocity is at least the
    setting `least_bristle_rate`. Returns 1 for rates at which nothing can be concluded.
    """
    return min(1 - break_away(force_rate, 1.0, 0.0, LEAST_BRISTLE_RATE, 1.0), 1.0)


SPREAD_OF_RATES = 3.0
"""Smallest ratio of highest to lowest force rate at which break-aways are extrapolated to rate 0."""


def static_friction(
    name: str, forces: np.ndarray, rates: np.ndarray, relative_error: float = 0.0, late: float = 0.0
) -> Estimate:
    """Estimate static friction [N] from break-away forces [N] at force rates [N/s], shape (n,).

    Rates that differ enough are extrapolated to 0. Otherwise the upper end of the interval allows for the most that
    break-away may lie below static friction (`share_below`). Static friction stays unknown with fewer than 3 forces, or
    if the rates do not show it.

    `relative_error` is a standard deviation common to all forces, such as that of a stiffness. Forces may be up to
    `late` [N] too high, because they were read after the break-away.
    """
    if len(forces) < 3:
        low = float(np.min(forces)) if len(forces) else 0.0
        return Estimate.unknown(name, "N", "break-away forces", f"{len(forces)} break-aways: 3 are needed", low)
    low, high = np.percentile(rates, [10, 90])
    if high >= SPREAD_OF_RATES * low > 0:
        estimate = _extrapolated(name, forces, rates, relative_error)
    else:
        estimate = _bounded(name, forces, rates, relative_error)
    return replace(estimate, low=max(float(estimate.low - late), 0.0), systematic=estimate.systematic + late / 2)


SHARE_EXTRAPOLATED = 0.15
"""Largest extrapolation or bound, relative to static friction."""


def _bounded(name: str, forces: np.ndarray, rates: np.ndarray, relative_error: float) -> Estimate:
    """Estimate static friction from break-aways at one rate.

    Break-aways are too low by a bounded part, and the value is raised by half of it. Static friction is not determined
    if the bound is too large.
    """
    mean = correlated_mean(forces)
    share = share_below(float(np.median(rates)))
    method = "mean break-away force; at rate 0 it may be higher, which is allowed for"  # one sentence for many logs
    scatter = t_value(mean.freedom) * mean.error
    half = float(np.hypot(scatter, t_value(mean.freedom) * relative_error * mean.value))
    low, high = mean.value - half, (mean.value + half) / (1 - share) if share < 1 else np.inf
    low, high = float(low), float(high)
    if share > 2 * SHARE_EXTRAPOLATED:
        reason = (
            f"at {np.median(rates):.3g} N/s ramps may break away up to {percent(share)} below static friction; ramps "
            f"below {_slow_enough():.2g} N/s, or at rates more than {SPREAD_OF_RATES:g} times apart, would "
            "show it"
        )
        return Estimate.unknown(name, "N", method, reason, low, high)
    value = float(mean.value * (1 + share / (1 - share) / 2))
    return Estimate(name, "N", value, low, high, method, systematic=(high - low) / 2 - scatter)


def _slow_enough() -> float:
    """Return the highest force rate [N/s] at which ramps of a single rate show static friction."""
    rates = LEAST_BRISTLE_RATE * np.geomspace(1e-6, 1, 145)
    return float(max(rate for rate in rates if share_below(rate) <= 2 * SHARE_EXTRAPOLATED))


def _rising(name: str, forces: np.ndarray, rates: np.ndarray) -> Estimate | None:
    """Return a bound on static friction if break-away clearly rises with the rate; else None.

    Bristles make break-away fall with the rate. If motion is noticed late by a constant time, forces rise in proportion
    to the rate: the line extrapolated to rate 0, and the forces at the lowest rates, bound static friction.
    """
    if len(forces) < 4:
        return None
    design = np.stack([np.ones_like(rates), rates], axis=1)
    solution, rest, _, _ = np.linalg.lstsq(design, forces, rcond=None)
    freedom = len(forces) - 2
    errors = t_value(freedom) * np.sqrt(np.diag(np.linalg.inv(design.T @ design)) * float(np.sum(rest)) / freedom)
    lowest, highest = rates <= 1.5 * rates.min(), rates >= rates.max() / 1.5
    low, high = (float(forces[chosen].mean()) for chosen in (lowest, highest))
    if not (solution[1] > errors[1] and high > low):
        return None
    reason = (
        f"break-away rises with the force rate, from {low:.3g} N at {rates.min():.3g} N/s to {high:.3g} N at "
        f"{rates.max():.3g} N/s, which contradicts LuGre's bristles: usually the motion is noticed late, by a "
        f"threshold or a filter, here by about {1e3 * float(solution[1]):.2g} ms; static friction is no more than at "
        "the lowest rate"
    )
    return Estimate.unknown(name, "N", "break-away forces", reason, max(float(solution[0] - errors[0]), 0.0), low)


RANGE_OF_RATES = 12.0
"""Largest ratio of used force rates to the lowest. The power law holds for small rates only."""


def _extrapolated(name: str, forces: np.ndarray, rates: np.ndarray, relative_error: float) -> Estimate:
    """Extrapolate break-away forces to rate 0 by a straight line over rate^(2/3).

    The line is fitted at the lower rates. The interval is widened by half of the extrapolated distance.
    """
    rises = _rising(name, forces, rates)
    if rises is not None:
        return rises
    near = rates <= max(RANGE_OF_RATES * rates.min(), np.sort(rates)[2])
    if np.ptp(rates[near]) == 0:
        return _bounded(name, forces[near], rates[near], relative_error)
    power = rates[near] ** (2 / 3)
    design = np.stack([np.ones_like(power), power], axis=1)
    (level, slope), rest, _, _ = np.linalg.lstsq(design, forces[near], rcond=None)
    freedom = int(near.sum()) - 2
    inverse = np.linalg.inv(design.T @ design) * float(np.sum(rest)) / freedom
    error, offset = float(np.hypot(inverse[0, 0] ** 0.5, relative_error * level)), -slope * float(power.min())
    method = f"break-away forces at {rates[near].min():.3g} to {rates[near].max():.3g} N/s, extrapolated to 0"
    least = float(np.mean(forces[rates <= 1.5 * rates.min()]))
    if slope + t_value(freedom) * inverse[1, 1] ** 0.5 >= 0:
        if share_below(float(rates.min())) <= SHARE_EXTRAPOLATED:
            return _bounded(name, forces[near], np.full(int(near.sum()), rates.min()), relative_error)
        reason = "break-away does not fall with the force rate: the rates may be too high to show static friction"
        return Estimate.unknown(name, "N", method, reason, least)
    if offset > SHARE_EXTRAPOLATED * level:
        reason = f"the lowest force rate, {rates.min():.3g} N/s, is too high: the forces still rise towards rate 0"
        return Estimate.unknown(name, "N", method, reason, least)
    return by_t(name, "N", Mean(float(level), error, freedom), method, offset / 2, offset / 2)
