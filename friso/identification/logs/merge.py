"""Merge two files of one run, recorded by two clocks: align the motion that both have."""

from __future__ import annotations

from collections.abc import Mapping as Roles
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy.fft import next_fast_len
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d
from scipy.stats import t as student

from friso.errors import LogError
from friso.identification.logs.log import Channel, ChannelTable
from friso.identification.logs.read import ReadFile
from friso.identification.logs.roles import AssignedRole, Mapping, propose
from friso.identification.logs.signals import Notes, Reading, instants, no_time, with_user_units
from friso.identification.logs.time_base import SAMPLES_OF_A_LOG
from friso.quantities import percent

MOTIONS = ("position", "velocity")
"""Roles of channels by which files are aligned."""


@dataclass(frozen=True)
class Alignment:
    """Clock of a second file by that of the first: `begins` [s] is when it begins there, `ratio` how fast it runs.

    A second of the second clock takes `ratio` seconds of the first. `half_begins` [s] and `half_ratio` are halves of
    95 % intervals, and `left` is the share of the motion (RMS) that the alignment leaves unexplained.
    """

    begins: float
    ratio: float
    half_begins: float
    half_ratio: float
    left: float

    def onto_first(self, time: np.ndarray, start: float) -> np.ndarray:
        """Return instants [s], shape (n,), of the first clock for those of the second, which begins at `start`."""
        return self.begins + self.ratio * (time - start)


@dataclass(frozen=True)
class _Motion:
    """A channel of motion on even instants, `step` [s] apart from `start` on; `kind` is position or velocity."""

    channel: Channel
    kind: str
    start: float
    step: float
    values: np.ndarray

    @property
    def end(self) -> float:
        """Return the last instant [s]."""
        return self.start + self.step * (self.values.size - 1)

    def smoothed(self, width: float, order: int) -> tuple[np.ndarray, np.ndarray]:
        """Return instants [s] and the derivative of an `order`, smoothed over a `width` [s] without delay."""
        sigma = width / self.step
        edge = min(int(np.ceil(4 * sigma)), self.values.size // 4)
        values = gaussian_filter1d(self.values, sigma, order=order) / self.step**order
        inner = slice(edge, self.values.size - edge)
        return (self.start + self.step * np.arange(self.values.size))[inner], values[inner]


def merged(one: ReadFile, other: ReadFile, mapping: Mapping) -> ReadFile:
    """Merge the channels of two files of one run into a file on the clock of the first.

    Raises LogError for files without instants, without a motion in both, or whose motions agree nowhere or at several
    places.
    """
    timed = [_timed(file, mapping) for file in (one, other)]
    motions = [motions_of(table, roles) for table, roles in timed]
    names = f"{one.path.name} and {other.path.name}"
    for file, found_in in zip((one, other), motions, strict=True):
        if not found_in:
            raise LogError(
                "--merge", f"no position or velocity that changes in {file.path.name}", "a motion in both files",
                "--map position=CHANNEL", str(file.path),
            )  # fmt: skip
    pairs = [(first, second, aligned(first, second)) for first, second in product(*motions)]
    fits = [(first, second, alignments) for first, second, alignments in pairs if alignments]
    if not fits:
        expected = "two records of one motion at the same time: both position or velocity of one axis"
        raise LogError("--merge", f"motions of {names} that agree nowhere", expected, "", str(one.path))
    first, second, alignments = min(fits, key=lambda fit: fit[2][0].left)
    best, *rivals = alignments
    if rivals:
        places = " or ".join(f"{one.begins:.4g} s" for one in alignments[:3])
        actual = f"a motion that repeats: {other.path.name} may begin at {places} of {one.path.name}"
        raise LogError("--merge", actual, "a record that contains a move unlike the others", "", str(one.path))
    start = second.start
    added = [
        replace(c, time=best.onto_first(c.time, start), source=f"{c.source} of {other.path.name}")
        for c in timed[1][0].channels
        if c.time is not None and not (c is second.channel and first.kind == second.kind)
    ]
    clocks = (
        f"{other.path.name} begins at {best.begins:.6g} s +/- {best.half_begins:.2g} s (95 %) of {one.path.name}, and "
        f"a second of its clock takes {best.ratio:.9g} s +/- {best.half_ratio:.2g} s there: aligned by "
        f"{second.channel.name} and {first.channel.name}, which differ by {percent(best.left)}"
    )
    read = (clocks, *timed[0][0].read, *(f"{other.path.name}: {line}" for line in timed[1][0].read))
    scalars = {**timed[1][0].scalars, **timed[0][0].scalars}
    table = ChannelTable((*timed[0][0].channels, *added), scalars, read)
    return replace(one, form=replace(one.form, times=True), table=table)


def _timed(file: ReadFile, mapping: Mapping) -> tuple[ChannelTable, Roles[str, str]]:
    """Return the signals of a file with their instants, and the names of those that may be its motion, by role.

    Raises LogError for a file without instants.
    """
    names, origin = {channel.name for channel in file.table.channels}, str(file.path)
    roles = {role: name for role, name in mapping.roles.items() if name in names}
    units = {name: unit for name, unit in mapping.units.items() if name in names}
    own = replace(mapping, roles=roles, units=units)
    table = with_user_units(file.table, own, file.form.times, origin)
    reading, proposal = Reading(table, own, False, not file.form.units, origin), propose(table, roles, origin)
    clock = proposal.chosen.get("time")
    channels, motions = [], {}
    for channel in table.channels:
        if clock is not None and channel is clock.channel:
            continue
        time = instants(AssignedRole("", channel, "", False), clock, reading, Notes())
        channels.append(replace(channel, time=time))
        rivals = {role: [*proposal.rivals.get(role, ())] for role in MOTIONS}
        for role in MOTIONS:
            chosen = proposal.chosen.get(role)
            if any(channel is its for its in [*rivals[role], *([chosen.channel] if chosen else [])]):
                motions[channel.name] = role
    if all(channel.time is None for channel in channels):
        raise no_time(channels[0], reading)
    return replace(table, channels=tuple(channels)), motions


def motions_of(table: ChannelTable, roles: Roles[str, str]) -> list[_Motion]:
    """Return the channels of motion that change, on even instants."""
    motions = []
    for channel in table.channels:
        if channel.name not in roles or channel.time is None:
            continue
        finite = np.isfinite(channel.values) & np.isfinite(channel.time)
        time, at = np.unique(channel.time[finite], return_index=True)
        values = channel.values[finite][at]
        if time.size < SAMPLES_OF_A_LOG or not np.ptp(values) > 0:
            continue
        step = float(np.median(np.diff(time)))
        grid = np.arange(int((time[-1] - time[0]) / step + 1e-6) + 1)
        even = np.interp(time[0] + step * grid, time, (values - values.mean()) / np.ptp(values))
        motions.append(_Motion(channel, roles[channel.name], float(time[0]), step, even))
    return motions


WIDTHS_OF_A_MERGE = (2.0, 8.0, 32.0)
"""Widths of smoothing that are tried, in samples of the slower file: noise asks for wide ones."""

SHARE_OF_A_WIDTH = 0.01
"""Largest width of smoothing, relative to the shorter record."""

RATIO_OF_RIVAL_MERGES = 2.0
"""Ratio of what two alignments leave up to which both count: then the motion repeats."""


def aligned(first: _Motion, second: _Motion) -> list[Alignment]:
    """Align two motions; return the alignments that explain them about equally well, the best first.

    Of several widths of smoothing the least decides whose interval is hardly wider than the narrowest one. Returns []
    if the motions agree nowhere.
    """
    fits: list[list[Alignment]] = []
    for samples in WIDTHS_OF_A_MERGE:
        width = samples * max(first.step, second.step)
        if width < SHARE_OF_A_WIDTH * min(first.end - first.start, second.end - second.start):
            fits += [alike] if (alike := _aligned(first, second, width)) else []
    least = min((alike[0].half_begins for alike in fits), default=0.0)
    return next((alike for alike in fits if alike[0].half_begins <= RATIO_OF_RIVAL_MERGES * least), [])


SHARE_LEFT_BY_A_MERGE = 0.5
"""Largest share of a motion (RMS) that an alignment may leave. Noise, and another point of the axis, leave less."""

SHARE_LEFT_BY_ROUNDING = 1e-3
"""Share of a motion up to which what alignments leave is the rounding of the files."""


def _aligned(first: _Motion, second: _Motion, width: float) -> list[Alignment]:
    """Align two motions, smoothed over a width [s], as `aligned` does."""
    coherent, fits = _coherence(first, width), list[Alignment]()
    for ratio, begins in _candidates(first, second, width, coherent):
        fit = _refined(first, second, width, ratio, begins)
        if fit is not None and not any(abs(other.begins - fit.begins) <= coherent for other in fits):
            fits.append(fit)
    fits.sort(key=lambda fit: fit.left)
    usable = [fit for fit in fits if fit.left <= SHARE_LEFT_BY_A_MERGE]
    return [fit for fit in usable if fit.left <= RATIO_OF_RIVAL_MERGES * max(usable[0].left, SHARE_LEFT_BY_ROUNDING)]


def _speed(motion: _Motion, width: float, step: float) -> np.ndarray:
    """Return the speed of a motion, smoothed over a width [s], on instants a `step` [s] apart."""
    time, speed = motion.smoothed(max(width, step), int(motion.kind == "position"))
    return np.interp(np.arange(motion.start, motion.end, step), time, speed, 0.0, 0.0)


def _coherence(motion: _Motion, width: float) -> float:
    """Return the shift [s] over which the speed stays alike: its power over that of its derivative."""
    time, speed = motion.smoothed(width, int(motion.kind == "position"))
    change = np.gradient(speed, time)
    return float(np.sqrt(speed @ speed / max(change @ change, np.finfo(float).tiny)))


SAMPLES_OF_A_CORRELATION = 32768.0
"""Number of samples of a record by which it is aligned at first. More change nothing."""

DIFFERENCE_OF_CLOCKS = 5e-3
"""Largest relative difference of two clocks that is searched. Clocks of computers differ by less than 1e-3."""

RATIOS_OF_A_MERGE = 100
"""Largest number of ratios of clocks that are tried on either side of 1. More take seconds."""

PLACES_OF_A_MERGE = 4
"""Number of places at which an alignment is begun."""


def _candidates(first: _Motion, second: _Motion, width: float, coherent: float) -> list[tuple[float, float]]:
    """Return pairs of a ratio and a beginning [s] at which speeds correlate, the best first.

    All ratios up to the largest usual one are tried, in steps that leave the ends of the records coherent. At every
    beginning one of the records overlaps with a share of its motion.
    """
    longest = max(first.end - first.start, second.end - second.start)
    step = max(first.step, second.step, longest / SAMPLES_OF_A_CORRELATION)
    one, other = (_speed(motion, width, step) for motion in (first, second))
    count = int(np.ceil(DIFFERENCE_OF_CLOCKS * (second.end - second.start) / coherent))
    count = min(count, RATIOS_OF_A_MERGE)
    peaks: list[tuple[float, float, float]] = []
    for ratio in 1 + DIFFERENCE_OF_CLOCKS * np.linspace(-1, 1, 2 * count + 1):
        stretched = np.interp(np.arange(0, other.size * ratio) / ratio, np.arange(other.size), other, 0.0, 0.0)
        heights = _correlation(one, stretched)
        for at in _peaks(heights, max(1, round(coherent / step))):
            peaks.append((float(heights[at]), float(ratio), first.start + step * (at - stretched.size + 1)))
    places: list[tuple[float, float]] = []
    half = 0.5 * (second.end - second.start)
    for height, ratio, begins in sorted(peaks, reverse=True):
        apart = (abs(begins + ratio * half - start - other * half) > coherent for other, start in places)
        if height > 0 and len(places) < PLACES_OF_A_MERGE and all(apart):
            places.append((ratio, begins))
    return places


SHARE_OF_AN_OVERLAP = 0.25
"""Least share of the motion of one of two records that must overlap with the other."""


def _correlation(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return the size of the correlation of two signals at all shifts, over their overlap; 0 for too little of it."""
    size = next_fast_len(one.size + other.size - 1, real=True)

    def products(first: np.ndarray, second: np.ndarray) -> np.ndarray:
        return np.fft.irfft(np.fft.rfft(first, size) * np.fft.rfft(second[::-1], size), size)[
            : one.size + other.size - 1
        ]

    energies = [products(one**2, np.ones_like(other)), products(np.ones_like(one), other**2)]
    shares = [energy / max(energy.max(), np.finfo(float).tiny) for energy in energies]
    enough = (np.maximum(*shares) >= SHARE_OF_AN_OVERLAP) & (np.minimum(*shares) > 1e-6)
    norm = np.sqrt(np.maximum(energies[0] * energies[1], np.finfo(float).tiny))
    return np.where(enough, np.abs(products(one, other)) / norm, 0.0)


def _peaks(heights: np.ndarray, apart: int) -> list[int]:
    """Return the places of the highest peaks, at least some samples `apart`."""
    heights, places = heights.copy(), []
    for _ in range(PLACES_OF_A_MERGE):
        at = int(np.argmax(heights))
        places.append(at)
        heights[max(0, at - apart) : at + apart + 1] = 0.0
    return places


ROWS_OF_A_MERGE = 50_000
"""Largest number of samples from which an alignment is fitted. More change little."""

STEPS_OF_A_MERGE = 30
"""Largest number of steps of Gauss and Newton to an alignment. Most take five."""

PRECISION_OF_A_MERGE = 1e-9
"""Change of an alignment, relative to the record, below which it is final."""

PARTS_OF_A_MERGE = 24
"""Number of stretches of a record whose scores give the intervals of an alignment."""


def _refined(first: _Motion, second: _Motion, width: float, ratio: float, begins: float) -> Alignment | None:
    """Fit beginning and ratio, with gain and offset of the second motion; None if that fails.

    The equations of least squares are weighted by the second motion's slope instead of the first's (an instrument),
    whose noise would count as motion. Intervals are by the jackknife: one stretch of the record after the other is
    left out, because what is left is coloured, and few moves may decide.
    """
    orders = [int(motion.kind == "position" and first.kind != second.kind) for motion in (first, second)]
    time, values = first.smoothed(width, orders[0])
    thin = slice(None, None, max(1, second.values.size // ROWS_OF_A_MERGE))
    second_time, measured = (array[thin] for array in second.smoothed(width, orders[1]))
    own_slope = second.smoothed(width, orders[1] + 1)[1][thin]
    curve = CubicSpline(time, values)
    slope, middle = curve.derivative(), 0.5 * (second_time[0] + second_time[-1])
    begins += ratio * (middle - second.start)  # of the middle, which the ratio does not shift
    for _ in range(STEPS_OF_A_MERGE):
        place = begins + ratio * (second_time - middle)
        inside = (place >= time[0]) & (place <= time[-1])
        if inside.sum() < SAMPLES_OF_A_LOG:
            return None
        at, after, aim = place[inside], second_time[inside] - middle, measured[inside]
        linear = np.polyfit(curve(at), aim, 1)
        left = aim - np.polyval(linear, curve(at))
        moved, ones = linear[0] * slope(at), np.ones_like(at)
        rows = np.stack([moved, moved * after, curve(at), ones], axis=1)
        weights = np.stack([own_slope[inside], own_slope[inside] * after, aim, ones], axis=1)
        sizes = np.maximum(np.abs(rows).max(axis=0), np.finfo(float).tiny)
        inverse = np.linalg.pinv(weights.T @ (rows / sizes)) / sizes[:, None]
        change = inverse @ (weights.T @ left)
        begins, ratio = begins + change[0], ratio + change[1]
        if not abs(ratio - 1) <= 2 * DIFFERENCE_OF_CLOCKS:
            return None
        if abs(change[0]) + abs(change[1]) * np.ptp(after) < PRECISION_OF_A_MERGE * np.ptp(after):
            break
    else:
        return None
    share = float(np.std(left) / max(np.std(aim), np.finfo(float).tiny))
    parts = [np.array_split(array, PARTS_OF_A_MERGE) for array in (weights, rows / sizes, left)]
    whole = weights.T @ (rows / sizes)
    shifts = [np.linalg.pinv(whole - w.T @ r) @ (w.T @ e) / sizes for w, r, e in zip(*parts, strict=True)]
    freedom = len(shifts) - rows.shape[1]
    covariance = np.transpose(shifts) @ shifts
    quantile = student.ppf(0.975, freedom)
    back = np.array([1.0, second.start - middle])
    half = quantile * np.sqrt(back @ covariance[:2, :2] @ back), quantile * np.sqrt(covariance[1, 1])
    return Alignment(float(begins + ratio * back[1]), float(ratio), float(half[0]), float(half[1]), share)
