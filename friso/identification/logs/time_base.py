"""Make the instants of channels even within segments, split at gaps, and bring several rates to one base."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from scipy.interpolate import CubicSpline

from friso.errors import LogError
from friso.identification.logs.checks import repeated_stamps, runs
from friso.quantities import percent


@dataclass
class Track:
    """A channel with even instants within each segment.

    `time` [s] and `values` have the shape (n,), and `bridged` marks lost samples; `read` and `warnings` describe the
    processing. `as_even` is the track with its samples as they are, taken as even, where they were interpolated.
    """

    time: np.ndarray
    values: np.ndarray
    period: float
    segments: list[slice]
    bridged: np.ndarray
    read: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    as_even: Track | None = None


DEVIATIONS_OF_A_GAP = 4.0
"""Deviation of a gap from whole sample times that scatter explains, in standard deviations of other steps."""

SCATTER_OF_EVEN_STAMPS = 0.01
"""Scatter of time stamps below which they count as even, relative to the sample time."""

ERROR_OF_A_WHOLE_GAP = 0.25
"""Largest deviation of a gap from a whole number of sample times, relative to the sample time."""

SAMPLES_BRIDGED = 3
"""Largest number of lost samples in a row that are interpolated. Longer gaps split a record."""

SHARE_OF_GAPS = 0.1
"""Ratio of gaps to samples above which sampling counts as uneven. Gaps between even time stamps
that are filled do not count."""

SAMPLE_TIMES_OF_A_GAP = 1.5
"""Smallest time step that is a gap, in sample times. One missing sample makes 2."""


def track(name: str, time: np.ndarray, values: np.ndarray) -> Track:
    """Clean a channel, and put it on even instants.

    NaN and repeated stamps [s] are left out, a few lost samples are interpolated, and longer gaps split the track.
    Raises LogError for too few samples, decreasing time, stamps repeated with other values, and uneven sampling.
    """
    read: list[str] = []
    time, values, missing = _numbers_only(name, time, values)
    if missing:
        read.append(f"{name}: {missing} samples that are not numbers left out")
    time, values, repeated = repeated_stamps(name, time, values)
    if repeated:
        read.append(f"{name}: {repeated} samples repeated with the same time stamp left out")
    steps = np.diff(time)
    long = gaps(steps)
    period = usual_step(steps)
    lost = np.round(steps / period) - 1
    usual_scatter = DEVIATIONS_OF_A_GAP * float(np.std(steps[~long])) / period
    scatter = min(max(SCATTER_OF_EVEN_STAMPS, usual_scatter), ERROR_OF_A_WHOLE_GAP)
    whole = np.abs(steps / period - 1 - lost) <= scatter  # otherwise the clock was reset
    bridged = long & whole & (lost >= 1) & (lost <= SAMPLES_BRIDGED)
    even = np.abs(steps / period - 1 - lost).max() <= SCATTER_OF_EVEN_STAMPS
    uneven = float((long & ~bridged).mean() if even else long.mean())
    if uneven > SHARE_OF_GAPS:
        usual = f"{SAMPLE_TIMES_OF_A_GAP} times the usual {np.median(steps):.4g} s"
        actual = f"time stamps with {percent(uneven)} of the steps over {usual}"
        raise LogError(name, actual, "uniform sampling, or the true sample time", '--dt "NUMBER ms"')
    edges = [0, *(np.flatnonzero(long & ~bridged) + 1).tolist(), time.size]
    inserted = np.where(bridged, lost, 0).astype(int)
    parts = [_bridged(time[a:b], values[a:b], inserted[a : b - 1]) for a, b in pairwise(edges)]
    ends = np.cumsum([0, *(part[0].size for part in parts)]).tolist()
    time, values, filled = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    return _evened(name, Track(time, values, period, [slice(a, b) for a, b in pairwise(ends)], filled, read))


SAMPLES_OF_A_LOG = 50
"""Fewest samples of a log; no interval from fewer would be meaningful (friso's choice)."""

SCATTER_OF_UNEVEN_STAMPS = 0.15
"""RMS deviation of the steps from whole numbers of the usual step, relative to it, above which a log has no even
clock. Interpolation onto one then loses more than the motion's corners; steps at random have 0.29."""


def is_uneven(time: np.ndarray) -> bool:
    """Tell whether instants [s] belong to no even clock: their steps are no whole numbers of a usual one.

    Lost samples, and the rounding of stamps, whose steps take two values only, leave a clock even.
    """
    steps = np.diff(time[np.isfinite(time)])
    steps = steps[steps > 0]
    if steps.size < SAMPLES_OF_A_LOG:
        return False
    whole = steps / np.median(steps)
    off = whole - np.round(whole)
    rounded = np.unique(np.round(whole / SCATTER_OF_EVEN_STAMPS)).size <= 2
    return bool(not rounded and np.sqrt(np.mean(off**2)) > SCATTER_OF_UNEVEN_STAMPS)


def as_stamped(signals: Mapping[str, tuple[np.ndarray, np.ndarray]]) -> tuple[Track, dict[str, np.ndarray]]:
    """Bring signals, pairs of instants [s] and values by role, to the instants of the first.

    Values that are no numbers are left out. Raises LogError for decreasing time, and for stamps repeated with other
    values.
    """
    base, values, read = np.zeros(0), {}, []
    for role, (time, held) in signals.items():
        finite = np.isfinite(time) & np.isfinite(held)
        time, held, _ = repeated_stamps(role, time[finite], held[finite])
        base = base if values else time
        if not np.array_equal(time, base):
            read.append(f"{role}: interpolated linearly onto the instants of {next(iter(values))}")
            held = np.interp(base, time, held)
        values[role] = held
    steps = np.diff(base)
    spread = f"{1e3 * steps.min():.3g} to {1e3 * steps.max():.3g} ms"
    read.append(f"time stamps are uneven, {spread} apart: taken as they are")
    period = float(np.median(steps))
    return Track(base, base, period, [slice(0, base.size)], np.zeros(base.size, bool), read), values


def usual_step(steps: np.ndarray) -> float:
    """Return the mean of the time steps [s], shape (n,), without gaps."""
    return float(steps[~gaps(steps)].mean())


STEPS_AVERAGED = 5
"""Number of steps in a row that are averaged for the usual step, because coarse stamps scatter."""


def gaps(steps: np.ndarray) -> np.ndarray:
    """Tell which time steps, shape (n,), are gaps: longer than a few usual steps.

    After a gap the samples stay late. A step that is long only because a stamp is late has short neighbours, and is no
    gap.
    """
    usual = float(np.median(steps))
    averaged, longest = STEPS_AVERAGED, SAMPLE_TIMES_OF_A_GAP
    if steps.size >= averaged:
        usual = float(np.median(np.convolve(steps, np.ones(averaged), "valid"))) / averaged
    beside = np.pad(np.minimum(steps, longest * usual), 1, constant_values=usual)
    late = beside[:-2] + steps + beside[2:] > (longest + 2) * usual
    return (steps > longest * usual) & late


def _bridged(time: np.ndarray, values: np.ndarray, lost: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Interpolate lost samples by a cubic spline through the others.

    `lost`, shape (n - 1,), counts the samples lost after each sample but the last. Returns all instants and values, and
    marks of lost samples.
    """
    if not lost.any():
        return time, values, np.zeros(time.size, bool)
    places = np.repeat(np.arange(lost.size), lost)
    number = np.arange(places.size) - np.repeat(np.cumsum(lost) - lost, lost) + 1
    instants = time[places] + (time[places + 1] - time[places]) * number / (lost[places] + 1)
    made_up = CubicSpline(time, values)(instants)
    filled = np.insert(np.zeros(time.size, bool), places + 1, True)
    return np.insert(time, places + 1, instants), np.insert(values, places + 1, made_up), filled


STEPS_OF_A_TOPIC = 10.0
"""Longest step between samples of a topic in rows of several, in its usual steps. A longer one is a hole."""


def _numbers_only(name: str, time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """Return the samples that are numbers, and how many samples between them are not.

    Raises LogError if fewer than half of the samples are numbers, unless these are even, as those of a topic are that
    shares its rows with faster ones.
    """
    finite = np.isfinite(time) & np.isfinite(values)
    if finite.size < 2:
        raise LogError(name, f"{finite.size} sample{'' if finite.size == 1 else 's'}", "a record over time", "")
    steps = np.diff(time[finite])
    even = steps.size > 1 and (steps >= 0).all() and steps.max() <= STEPS_OF_A_TOPIC * np.median(steps)
    if finite.sum() < (2 if even else max(2, 0.5 * finite.size)):
        actual = f"{finite.size - finite.sum()} of {finite.size} samples that are not numbers (NaN)"
        raise LogError(name, actual, "at least half of the samples", "")
    inside = np.flatnonzero(finite)
    return time[finite], values[finite], int(np.count_nonzero(~finite[inside[0] : inside[-1]]))


def _evened(name: str, raw: Track) -> Track:
    """Give a channel even instants in each segment.

    Stamps are replaced by even ones if they scatter little, or only by their resolution; otherwise the values are
    interpolated, with a warning.
    """
    order, about = np.empty_like(raw.time), np.empty_like(raw.time)
    for part in raw.segments:
        count = part.stop - part.start
        order[part] = np.arange(count) - (count - 1) / 2
        about[part] = np.mean(raw.time[part])
    raw.period = float(order @ (raw.time - about) / (order @ order))
    time = about + raw.period * order
    scatter = float(np.sum((raw.time - time) ** 2))
    jitter = np.sqrt(scatter / time.size) / raw.period
    sampled = f"{time.size} samples at {1 / raw.period:.6g} Hz"
    raw.read.append(f"{name}: {sampled}, time stamps even to {percent(jitter)} of a step")
    rounded = _rounded(raw, time) if jitter > SCATTER_OF_EVEN_STAMPS else 0.0
    if rounded:
        raw.read.append(f"{name}: time stamps are rounded to {rounded * 1e3:.4g} ms: taken as uniform")
    if rounded or jitter <= SCATTER_OF_EVEN_STAMPS:
        raw.time = time
        return raw
    raw.warnings.append(
        f"{name}: time stamps scatter by {jitter:.2g} of a sample time: interpolated onto uniform time stamps; if the "
        f'sampling was uniform and only the time stamps were not, use --dt "{raw.period * 1e3:.6g} ms"'
    )
    raw.as_even = Track(time, raw.values, raw.period, raw.segments, raw.bridged)
    times, values, filled, segments, start = [], [], [], [], 0
    for part in raw.segments:
        count = int((raw.time[part.stop - 1] - raw.time[part.start]) / raw.period + 1e-6) + 1
        grid = raw.time[part.start] + raw.period * np.arange(count)
        times.append(grid)
        values.append(np.interp(grid, raw.time[part], raw.values[part]))
        filled.append(np.interp(grid, raw.time[part], raw.bridged[part]) > 0)
        segments.append(slice(start, start + count))
        start += count
    raw.time, raw.values, raw.bridged = (np.concatenate(arrays) for arrays in (times, values, filled))
    raw.segments = segments
    return raw


def _rounded(raw: Track, even: np.ndarray) -> float:
    """Estimate the resolution [s] to which the time stamps of an evenly running clock are rounded.

    The steps of such a clock take two values only, one resolution apart. No stamp deviates from `even` (n,) [s] by more
    than one resolution: half for the rounding, half for the error of the estimated offset and rate. Returns 0 if the
    stamps scatter in another way.
    """
    bridges = raw.bridged[1:] | raw.bridged[:-1]
    inside = np.ones(raw.time.size - 1, bool)
    inside[[part.start - 1 for part in raw.segments[1:]]] = False
    steps = np.diff(raw.time)[inside & ~bridges]
    short = steps < raw.period
    if short.all() or not short.any():
        return 0.0
    lower, upper = float(np.median(steps[short])), float(np.median(steps[~short]))
    digit = upper - lower
    of_two = np.minimum(np.abs(steps - lower), np.abs(steps - upper)) <= SCATTER_OF_EVEN_STAMPS * digit
    near = np.abs(raw.time - even) <= (1 + SCATTER_OF_EVEN_STAMPS) * digit
    return digit if of_two.all() and near[~raw.bridged].all() else 0.0


SAMPLES_OF_A_SEGMENT = 10
"""Fewest samples of a segment. No filter settles within fewer."""


def resample_tracks(tracks: Mapping[str, Track]) -> tuple[Track, dict[str, np.ndarray]]:
    """Bring all tracks to the instants of the coarsest, as far as all cover them.

    Returns the common instants as a track, and the values by name. Finer tracks are interpolated linearly within their
    own segments. Raises LogError if the tracks have no time in common.
    """
    base_name = max(tracks, key=lambda name: round(np.log(tracks[name].period), 4))
    base = tracks[base_name]
    read, warnings, values = [], [], {}
    bridged = np.zeros(base.time.size, bool)
    for name, single in tracks.items():
        if _same_instants(single, base):
            values[name] = single.values
            bridged |= single.bridged
            continue
        values[name] = _at(base, single, single.values)
        bridged |= _at(base, single, single.bridged) > 0
        if not _coincident(base, single):
            instants = f"the {1 / base.period:.6g} Hz instants of {base_name}"
            read.append(f"{name}: interpolated linearly from {1 / single.period:.6g} Hz onto {instants}")
        if single.period < base.period / SAMPLE_TIMES_OF_A_GAP:
            warnings.append(
                f"{name}: sampled at {1 / single.period:.6g} Hz and read at {1 / base.period:.6g} Hz without an "
                "anti-aliasing filter"
            )
    covered = np.all([np.isfinite(value) for value in values.values()], axis=0)
    segments = [
        slice(part.start + run.start, part.start + run.stop) for part in base.segments for run in runs(covered[part])
    ]
    short = [run for run in segments if run.stop - run.start < SAMPLES_OF_A_SEGMENT]
    segments = [run for run in segments if run.stop - run.start >= SAMPLES_OF_A_SEGMENT]
    if not segments:
        spans = ", ".join(f"{name} {trace.time[0]:.6g} s to {trace.time[-1]:.6g} s" for name, trace in tracks.items())
        consecutive = f"no {SAMPLES_OF_A_SEGMENT} consecutive samples that all channels share"
        raise LogError("log", f"{consecutive}: {spans}", "a common span", "")
    if short:
        read.append(f"{len(short)} segments shorter than {SAMPLES_OF_A_SEGMENT} samples left out")
    ends = np.cumsum([0, *(run.stop - run.start for run in segments)]).tolist()
    parts = [slice(start, stop) for start, stop in pairwise(ends)]
    pick = np.concatenate([np.arange(run.start, run.stop) for run in segments])
    track = Track(base.time[pick], base.values[pick], base.period, parts, bridged[pick], read, warnings)
    return track, {name: value[pick] for name, value in values.items()}


def _same_instants(first: Track, second: Track) -> bool:
    """Tell whether two tracks have the same instants, to a hundredth of a sample time."""
    same = first.time.size == second.time.size and first.segments == second.segments
    return same and bool(np.all(np.abs(first.time - second.time) <= SCATTER_OF_EVEN_STAMPS * second.period))


def _coincident(base: Track, other: Track) -> bool:
    """Tell whether instants of a track fall on those of another, in the other's first segment."""
    part = other.segments[0]
    inside = base.time[(base.time >= other.time[part.start]) & (base.time <= other.time[part.stop - 1])]
    steps = (inside - other.time[part.start]) / other.period
    return bool(np.all(np.abs(steps - np.round(steps)) <= SCATTER_OF_EVEN_STAMPS))


def _at(base: Track, other: Track, values: np.ndarray) -> np.ndarray:
    """Return values of a track, (n,), at the instants of the base; NaN outside its segments."""
    resampled = np.full(base.time.size, np.nan)
    slack = SCATTER_OF_EVEN_STAMPS * other.period
    for part in other.segments:
        time = other.time[part]
        a, b = np.searchsorted(base.time, (time[0] - slack, time[-1] + slack))
        resampled[a:b] = np.interp(base.time[a:b], time, values[part])
    return resampled
