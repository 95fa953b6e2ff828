"""Least squares on the inverse model: force = M a + F_v v + F_c sign(v) + offset, with both sides filtered alike.

The filtering follows Janot, Gautier, Brunot (EMPS benchmark, nonlinearbenchmark.org, 2019) and, for the method,
Gautier, Janot, Vandanjon 2013, doi:10.1109/TCST.2012.2185697. A Butterworth filter of order 4 takes the position
forward and back, at five times the bandwidth of the motion. Central differences give the derivatives. Another filter
decimates all columns and the force to 2.5 times the bandwidth.

At rest friction is any force, and bristles bend. Such samples leave the force and all columns before they are
decimated, which would spread that force over the rows beside them.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from types import MappingProxyType

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.ndimage import uniform_filter1d
from scipy.signal import butter, cheby1, sosfiltfilt, welch

from friso.errors import InputError
from friso.identification.combine import groups_of, spread_of
from friso.identification.estimate import Estimate
from friso.identification.logs.log import ROLES, Log
from friso.identification.readings.common import noise_of, on_bearing, turns_of

METHOD = "least squares on the inverse model"

NO_COLUMNS: Mapping[str, np.ndarray] = MappingProxyType({})


@dataclass(frozen=True)
class InverseModel:
    """A fit of force = M a + F_v v + F_c sign(v) + offset to a log, with its data.

    `estimates` have intervals; `solution` has the fitted coefficients by name ("mass"; per direction "... forward" and
    "... backward"). The fit combines the `columns`, shape (rows, columns); `covariance` is that of their coefficients.
    `time` [s] and forces [N], `measured` and `fitted`, have the shape (rows,). `bandwidth` [Hz] is the motion's.
    Samples not faster than `slowest` [m/s] are left out.
    """

    estimates: tuple[Estimate, ...]
    solution: Mapping[str, float]
    columns: np.ndarray
    covariance: np.ndarray
    time: np.ndarray
    measured: np.ndarray
    fitted: np.ndarray
    bandwidth: float
    slowest: float

    @property
    def error(self) -> float:
        """Return the norm of the residual force over the norm of the force."""
        return float(np.linalg.norm(self.measured - self.fitted) / np.linalg.norm(self.measured))

    def value(self, name: str) -> float:
        """Return the least-squares coefficient of a column by name, whether determined or not."""
        return self.solution[name]

    def estimate(self, name: str) -> Estimate:
        """Return the estimate of a quantity by its name, such as "mass" or "coulomb"."""
        return next(estimate for estimate in self.estimates if estimate.name == name)


@dataclass(frozen=True)
class FilteredMotion:
    """Position [m], velocity [m/s] and acceleration [m/s^2] below a cut-off frequency, (n,)."""

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray


ORDER_OF_SMOOTHING = 4
"""Order of the Butterworth filter of the position (Gautier, Janot, Vandanjon 2013)."""


def smoothed(position: np.ndarray, sample_time: float, cutoff: float) -> np.ndarray:
    """Smooth positions [m], (..., n), forward and back below `cutoff` [Hz].

    Positions stay unchanged if the cut-off is above half the sampling frequency.
    """
    if cutoff >= 0.5 / sample_time:
        return position
    sections = _smoothing(ORDER_OF_SMOOTHING, 2 * cutoff * sample_time)
    edge = min(3 * ORDER_OF_SMOOTHING, position.shape[-1] - 1)
    return sosfiltfilt(sections, position, axis=-1, padlen=edge)


@lru_cache
def _smoothing(order: int, cutoff: float) -> np.ndarray:
    """Design a Butterworth low-pass of an order (cached).

    `cutoff` is relative to half the sampling rate.
    """
    return np.asarray(butter(order, cutoff, output="sos"))


SAMPLING_OF_SPLINES = 0.15
"""Cut-off times sample time above which splines give derivatives. Differences would lose 1 % of the
acceleration."""


def motion(position: np.ndarray, sample_time: float, cutoff: float) -> FilteredMotion:
    """Smooth a position [m], (n,), forward and back below `cutoff` [Hz], and differentiate it.

    If the cut-off is near the sampling frequency, derivatives are taken from a spline, because differences would lose a
    part of the acceleration.
    """
    smooth, filtered = smoothed(position, sample_time, cutoff), cutoff < 0.5 / sample_time
    if cutoff * sample_time < SAMPLING_OF_SPLINES:
        velocity = np.gradient(smooth, sample_time)
        return FilteredMotion(smooth, velocity, np.gradient(velocity, sample_time))
    time = np.arange(len(smooth)) * sample_time
    curve = make_interp_spline(time, smooth, k=5)
    velocity, acceleration = (curve.derivative(order)(time) for order in (1, 2))
    if filtered:
        acceleration[[0, -1]] = acceleration[[1, -2]]  # the filter distorts the ends
    return FilteredMotion(smooth, velocity, acceleration)


SMOOTHING_BANDWIDTHS = 5.0
"""Cut-off of the position in bandwidths of the motion (Gautier, Janot, Vandanjon 2013)."""


def moved_in(log: Log, position: np.ndarray, bandwidth: float) -> FilteredMotion:
    """Return a motion [m], sampled like a log, shape (n,), smoothed for moves of a `bandwidth` [Hz]."""
    return motion(position, log.sample_time, SMOOTHING_BANDWIDTHS * bandwidth)


PIECES_OF_A_SPECTRUM = 8
"""Number of pieces into which a record is cut for its spectrum (Welch). More scatter less and resolve less."""

POWER_SHARE_OF_THE_MOTION = 0.95
"""Fraction of the acceleration's power within the bandwidth. Nearer 1 noise determines it."""


def bandwidth_of(log: Log) -> float:
    """Return the bandwidth [Hz] of the motion in a log, without reading across gaps.

    The bandwidth is the frequency below which the acceleration has 95 % of its power, counting only frequencies up to
    which the position (or the integrated velocity) stands out of its noise. Raises InputError if there are none.
    """
    role, derivatives = ("velocity", 1) if log.is_integrated else ("position", 2)
    lengths = [part.stop - part.start for part in log.segments]
    pieces = min(max(lengths), max(256, sum(lengths) // PIECES_OF_A_SPECTRUM))
    whole = [log[role][part] for part, length in zip(log.segments, lengths, strict=True) if length >= pieces]
    spectra = [welch(part, 1 / log.sample_time, nperseg=pieces, detrend="linear") for part in whole]
    frequency = spectra[0][0]
    power = np.average([spectrum for _, spectrum in spectra], axis=0, weights=[part.size for part in whole])
    noise = np.median(power[3 * len(power) // 4 :])
    passband = slice(0, _end_of_motion(power, noise))
    share = np.cumsum(np.maximum(power - noise, 0.0)[passband] * frequency[passband] ** (2 * derivatives))
    if not share.size or not share[-1] > 0:
        raise InputError(role, "nothing but noise", "a motion that stands out of it", "a larger or faster move")
    most = POWER_SHARE_OF_THE_MOTION * share[-1]
    return float(frequency[passband][np.searchsorted(share, most)])


POWER_ABOVE_NOISE = 4.0
"""Smallest ratio of the position's spectrum to its noise at frequencies that count."""

LINES_OF_A_GAP = 5
"""Widest gap in the spectrum of a motion, in frequencies of its strongest line. Equal moves to and fro have every
second line, and their duration may cancel two in a row."""


def _end_of_motion(power: np.ndarray, noise: float) -> int:
    """Return the number of frequencies up to which a motion stands out of its noise.

    `power` is the spectrum at even frequencies from 0 on, shape (n,). A repeated move has lines with nothing between
    them, and a move of one duration has zeros: what stands out clearly within a few lines belongs to the motion.
    """
    clear = POWER_ABOVE_NOISE
    below = np.flatnonzero(power < clear * noise)
    end = int(below[0]) if below.size else len(power)
    reach = LINES_OF_A_GAP * (1 + int(np.argmax(power[1:]))) if len(power) > 1 else 0
    for line in np.flatnonzero(power[end:] >= clear**2 * noise) + end:
        if line >= end + reach:
            break
        end = int(line) + 1
    return end


WAY_SHARE_OF_A_DIRECTION = 0.02
"""Smallest fraction of the way in either direction for separating friction from a constant force."""


def directions(position: np.ndarray) -> tuple[bool, bool]:
    """Tell whether a motion [m], shape (n,), goes forward, and whether it goes back.

    Noise does not count as motion.
    """
    steps = _ways(position)
    travelled = np.array([steps[steps > 0].sum(), -steps[steps < 0].sum()])
    forward, back = travelled > WAY_SHARE_OF_A_DIRECTION * travelled.sum()
    return bool(forward), bool(back)


TRAVELS_OF_A_SINGLE_PASS = 1.5
"""Way below which a record passes its places once, in ranges of the position. To and fro makes 2."""


def passes_once(position: np.ndarray) -> bool:
    """Tell whether a motion [m], shape (n,), passes most of its way only once, so that a place is as good as a time."""
    travelled = float(np.abs(_ways(position)).sum())
    return travelled < TRAVELS_OF_A_SINGLE_PASS * float(np.ptp(position))


DEVIATIONS_OF_STANDING_STILL = 20.0
"""Largest motion at standstill, in standard deviations of the position's noise."""


def _ways(position: np.ndarray) -> np.ndarray:
    """Return the ways [m] between the turning points of a motion [m], shape (n,), without those of noise."""
    turns = turns_of(position, DEVIATIONS_OF_STANDING_STILL * noise_of(position))
    return np.diff(position[[0, *turns, len(position) - 1]])


ROWS_OF_AN_INVERSE_MODEL = 20
"""Fewest rows of an inverse model. With fewer, its four coefficients have no interval."""

POWER_SHARE_OF_FRICTION = 0.1
"""Correlation of force and velocity above which the force clearly feeds friction, so that its sign is right."""

ERROR_OF_A_POOR_MODEL = 0.3
"""Relative error of the force above which a model does not describe the record."""


def inverse_model(
    log: Log,
    bandwidth: float | None = None,
    by_direction: bool = False,
    cart_share: float = 0.0,
    averaged: int = 1,
    extra: Mapping[str, np.ndarray] = NO_COLUMNS,
    slowest: float | None = None,
) -> InverseModel:
    """Fit mass, viscous and Coulomb friction and offset to a log with position and force.

    With `by_direction`, viscous and Coulomb friction have a value for each direction; the offset is left out, because a
    difference of the Coulomb frictions looks alike. For a stage on a joint, `cart_share` is the fraction of the mass
    that moves with the measured cart, on which friction acts.

    `bandwidth` [Hz] is the motion's, taken from the log by default. If the model is poor there, others are tried:
    larger ones first, then smaller ones, as a log may vibrate beyond its moves (a loop does on the steps of an
    encoder). One counts if its model is not poor, and its error half as large.

    Samples not faster than `slowest` [m/s] are left out. By default it is the lowest of some shares of the highest
    speed above which friction is that of sliding, as far as the error shows: with none of the others is it half as
    large, or it is small.

    `averaged` is the number of samples over which the log's force is averaged; the columns are averaged alike. `extra`
    columns by name, shape (n,), are fitted as well, and their part is subtracted from the measured force. Raises
    InputError for a log that is too short.
    """
    if bandwidth is None:
        return _within_its_moves(log, by_direction, cart_share, averaged, extra)
    if slowest is None:
        return _where_it_slides(log, bandwidth, by_direction, cart_share, averaged, extra)
    band = bandwidth
    longest = max(part.stop - part.start for part in log.segments) * log.sample_time
    if band * longest < 1:
        actual, expected = f"{band:.3g} Hz for {longest:.3g} s", "at least one period of it in the log"
        raise InputError("--bandwidth", actual, expected, '--bandwidth "20 Hz"', log.name)
    beside = np.stack(list(extra.values()), axis=1) if extra else np.zeros((len(log.time), 0))
    parts = [_rows(log, part, band, by_direction, cart_share, averaged, beside[part], slowest) for part in log.segments]
    time, columns, forces, position = (np.concatenate([part[i] for part in parts]) for i in range(4))
    force = forces[:, 0]
    velocity = columns[:, 1] + columns[:, 3] if by_direction else columns[:, 1]
    if len(force) < ROWS_OF_AN_INVERSE_MODEL:
        actual = f"{len(log.time)} samples, {len(force)} of them in motion after decimation to {5 * band:.3g} Hz"
        least = f"at least {ROWS_OF_AN_INVERSE_MODEL} in motion after decimation"
        expected = f"{least}: a longer log, or the experiment that it is"
        raise InputError("position", actual, expected, "--as break-away, for force that rises from rest")
    both = all(directions(log["position"]))
    if not both and not by_direction:
        columns[:, 3] = 0.0  # motion in one direction only adds it to Coulomb friction
    solution, held = np.linalg.lstsq(columns, forces, rcond=None)[0].T
    fitted = columns @ solution
    names = _NAMES[by_direction]
    own = len(names)
    covariance = spread_of(columns, force - fitted, groups_of(position, velocity, columns[:, 0]))[:own, :own]
    estimates = tuple(
        _estimate(name, unit_of(unit, log), value, other, variance if both or name != "coulomb" else np.inf)
        for (name, unit), value, other, variance in zip(names, solution[:own], held, np.diag(covariance), strict=False)
    )
    residual, size = np.linalg.norm(force - fitted), float(np.linalg.norm(force))
    power = float(force @ velocity)
    little = POWER_SHARE_OF_FRICTION * size * float(np.linalg.norm(velocity))
    poor = residual > ERROR_OF_A_POOR_MODEL * size
    if estimates[0].high < 0 and (power < 0 or (not poor and power < little)):  # the motor feeds friction
        expected = "a force that accelerates the mass forward where it is positive: give its scale the other sign"
        actual = f"a mass of {solution[0]:.3g} {unit_of('kg', log)}"
        raise InputError("force", actual, expected, f'--scale force="{_other_sign(log)}"', log.name)
    numbers = dict(zip((*(name for name, _ in names), *extra), map(float, solution), strict=True))
    explained = columns[:, own:] @ solution[own:]
    forces = force - explained, fitted - explained
    return InverseModel(estimates, numbers, columns[:, :own], covariance, time, *forces, band, slowest)


SPEED_SHARES_OF_SLIDING = (0.01, 0.02, 0.05, 0.1, 0.2, 0.4)
"""Speeds, relative to the highest, one of which separates rest and bending bristles from sliding. In 30 drawn clean
logs of smooth moves with dwells, the error of the force fell from up to 22 % at 0.01 to below 1 % at another."""

ERROR_SHARE_OF_A_CLEARLY_BETTER_MODEL = 0.5
"""Ratio of the whole model's error to the best cause's, or the inverse model's, below which no cause is named, and
the whole model is not rejected."""

ERROR_OF_A_FINE_MODEL = 0.01
"""Relative error of the force below which a whole model contradicts nothing."""


def _where_it_slides(
    log: Log, band: float, by_direction: bool, cart_share: float, averaged: int, extra: Mapping[str, np.ndarray]
) -> InverseModel:
    """Fit an inverse model to the samples of a log in which friction is that of sliding.

    Intervals hold those of clearly better models of faster samples: where friction falls with speed, no line through it
    is right. Raises InputError as `inverse_model` does.
    """
    moved = [_carried(log, part, band, cart_share) for part in log.segments]
    top = max(float(np.abs(motion.velocity).max(initial=0.0)) for motion in moved)
    models, first = [], None
    for share in SPEED_SHARES_OF_SLIDING:
        try:
            models.append(inverse_model(log, band, by_direction, cart_share, averaged, extra, share * top))
        except InputError as error:
            first = first or error
    if first is not None and all(model.estimate("mass").high < 0 for model in models):
        raise first  # whatever samples count, the force has the wrong sign, or there are too few of them
    better, fine = ERROR_SHARE_OF_A_CLEARLY_BETTER_MODEL, ERROR_OF_A_FINE_MODEL
    enough = max(fine, min(model.error for model in models) / better)
    chosen = next(model for model in models if model.error <= enough)
    for model in models:
        if model.slowest > chosen.slowest and model.error <= better * chosen.error:
            pairs = zip(chosen.estimates, model.estimates, strict=True)
            wider = (one.reaching(other.low, other.high) if other.determined else one for one, other in pairs)
            chosen = replace(chosen, estimates=tuple(wider))
    return chosen


BANDWIDTHS_OF_A_POOR_MODEL = (2.0, 4.0, 0.5, 0.25, 0.125)
"""Bandwidths that are tried where an inverse model is poor, relative to the log's, in this order. Smaller ones are
for moves beyond which the log vibrates."""


def _within_its_moves(
    log: Log, by_direction: bool, cart_share: float, averaged: int, extra: Mapping[str, np.ndarray]
) -> InverseModel:
    """Fit an inverse model within the bandwidth of a log, or, if it is poor there, within another one.

    Another bandwidth counts if the error is half of the first or less. Raises InputError as `inverse_model` does.
    """
    poor, band = ERROR_OF_A_POOR_MODEL, bandwidth_of(log)
    first: InverseModel | InputError
    try:
        first = inverse_model(log, band, by_direction, cart_share, averaged, extra)
    except InputError as error:  # vibration may be against the force, as of a negative mass
        first = error
    worse = first.error if isinstance(first, InverseModel) else 1.0
    for part in BANDWIDTHS_OF_A_POOR_MODEL if worse > poor else ():
        with suppress(InputError):
            model = inverse_model(log, part * band, by_direction, cart_share, averaged, extra)
            if model.error <= min(poor, worse / 2):
                return model
    if isinstance(first, InputError):
        raise first
    return first


def within_stretches(signals: np.ndarray, stretch: np.ndarray) -> np.ndarray:
    """Subtract from signals, (rows, signals), their means over each stretch, whose numbers are (rows,).

    The integral of a controller may have changed between stretches, so each has a constant force of its own.
    """
    _, number, count = np.unique(stretch, return_inverse=True, return_counts=True)
    means = np.stack([np.bincount(number, signal) / count for signal in signals.T], axis=1)
    return signals - means[number]


def least_squares(columns: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Fit a force [N], shape (rows,), by columns, shape (rows, columns).

    Returns the solution, shape (columns,), and the residual [N], shape (rows,).
    """
    solution = np.linalg.lstsq(columns, force, rcond=None)[0]
    return solution, force - columns @ solution


def _other_sign(log: Log) -> str:
    """Write the scale, such as "-35 N/V", that reads the force of a log with the opposite sign."""
    scales = [re.search(r"; ([+-]?)(\d\S* \S+/[^,/]+)", line) for line in log.read if line.startswith("force:")]
    scale = next((match for match in scales if match), None)
    if scale is None:
        return "-1 N/N" if log.unit("force") == ROLES["force"] else f"-NUMBER N/{log.unit('force')}"
    return scale[2] if scale[1] == "-" else f"-{scale[2]}"


def unit_of(unit: str, log: Log) -> str:
    """Return a unit with the newton replaced by the unit of the log's force.

    With a force in volts a mass is in V*s^2/m instead of kg.
    """
    if log.unit("force") == ROLES["force"]:
        return unit
    return re.sub(r"\bN\b", log.unit("force"), unit.replace("kg", "N*s^2/m"))


def _estimate(name: str, unit: str, value: float, held: float, variance: float) -> Estimate:
    """Make an estimate from a coefficient and its variance.

    The interval is wider by the distance to the value `held` for a force half a sample off. The variance is infinite,
    and the value unknown, if the log lacks a direction.
    """
    if np.isfinite(variance):
        off = abs(float(held - value))
        return replace(
            Estimate.normal(name, unit, value, float(np.sqrt(variance)), METHOD).widened(off), systematic=off
        )
    why = "the motion is in one direction only, which does not separate it from the others"
    return Estimate.unknown(name, unit, METHOD, why)


_NAMES = {
    False: (("mass", "kg"), ("viscous", "N*s/m"), ("coulomb", "N"), ("offset", "N")),
    True: (
        ("mass", "kg"),
        ("viscous forward", "N*s/m"),
        ("coulomb forward", "N"),
        ("viscous backward", "N*s/m"),
        ("coulomb backward", "N"),
    ),
}


SAMPLES_OF_AN_EDGE = 49
"""Number of samples left out at the start of a record, where the filters settle."""

DECIMATION_BANDWIDTHS = 2.0
"""Cut-off of the decimation in bandwidths of the motion (Gautier, Janot, Vandanjon 2013)."""

DECIMATION_PASS = 0.8
"""Passband of the decimation filter, relative to half the new sampling frequency. Nearer 1 it aliases."""


def _rows(
    log: Log,
    part: slice,
    band: float,
    by_direction: bool,
    cart_share: float,
    averaged: int,
    extra: np.ndarray,
    slowest: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return filtered, decimated times, columns, forces and positions of a segment where it slides.

    `part` are its samples, and `band` [Hz] is the motion's bandwidth; the other arguments are those of `inverse_model`.
    Forces, (rows, 2), are as logged, and half a sample later, as a force acts that is held up to the next sample. Which
    came first in a sample, force or position, a log does not tell, and in brisk moves inertia half a sample off looks
    like viscous friction. All results are empty for a segment too short to filter.
    """
    if part.stop - part.start < 2 * SAMPLES_OF_AN_EDGE:
        return np.zeros(0), np.zeros((0, len(_NAMES[by_direction]) + extra.shape[1])), np.zeros((0, 2)), np.zeros(0)
    moved = moved_in(log, log["position"][part], band)
    v, a = moved.velocity, moved.acceleration
    if cart_share:
        carried = _carried(log, part, band, cart_share)
        v, a = carried.velocity, cart_share * carried.acceleration + (1 - cart_share) * a
    cutoff = SMOOTHING_BANDWIDTHS * band
    force, sign = (smoothed(one, log.sample_time, cutoff) for one in (log["force"][part], np.sign(v)))
    if by_direction:
        forward, backward = (1 + sign) / 2, (1 - sign) / 2
        columns = np.stack([a, v * forward, sign * forward, v * backward, sign * backward], axis=1)
    else:
        columns = np.stack([a, v, sign, np.ones_like(v)], axis=1)
    if averaged > 1:
        columns = uniform_filter1d(columns, averaged, axis=0)
    kept_band = DECIMATION_BANDWIDTHS * band  # vibration beyond it would count samples by turns
    slides = np.abs(smoothed(v, log.sample_time, kept_band)) > slowest
    forces = np.stack([force, (force + np.r_[force[0], force[:-1]]) / 2], axis=1) * slides[:, None]
    columns = np.hstack([columns, extra]) * slides[:, None]
    rate = 2 * DECIMATION_BANDWIDTHS * band
    step = max(1, round(DECIMATION_PASS / (rate * log.sample_time)))
    inside = slice(SAMPLES_OF_AN_EDGE, None)
    columns, forces = (_decimated(array[inside], step) for array in (columns, forces))
    every = slice(_first(len(v[inside]), step), None, step)
    time, position, kept = (array[inside][every] for array in (log.time[part], moved.position, slides))
    return time[kept], columns[kept], forces[kept], position[kept]


def _carried(log: Log, part: slice, band: float, cart_share: float) -> FilteredMotion:
    """Return the motion in a segment of the body on the bearing: the cart's, if it has a share of the mass."""
    return moved_in(log, (on_bearing(log) if cart_share else log["position"])[part], band)


ORDER_OF_DECIMATION = 8
"""Order of the Chebyshev filter before decimation."""

RIPPLE_OF_DECIMATION = 0.05  # [dB]
"""Ripple of the Chebyshev filter before decimation, common to the force and all columns."""


def _decimated(columns: np.ndarray, step: int) -> np.ndarray:
    """Keep every `step`th row, after a low-pass forward and back against aliasing."""
    if step == 1:
        return columns
    order, ripple = ORDER_OF_DECIMATION, RIPPLE_OF_DECIMATION
    sections = cheby1(order, ripple, DECIMATION_PASS / step, output="sos")
    low = sosfiltfilt(sections, columns, axis=0, padlen=3 * order)
    return low[_first(len(columns), step) :: step]


def _first(count: int, step: int) -> int:
    """Return the first row to keep so that, at every `step`th of `count`, the last one is kept."""
    return (count - 1) % step
