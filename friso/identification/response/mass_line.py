"""Find straight lines of a response: stiffness (slope 0), damping (slope -1) and mass lines (slope -2).

On a straight line, a response from force to position follows 1/k, 1/(i omega d) or 1/((i omega)^2 m), so that its
product with (i omega)^n is real, positive and constant.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy import stats

from friso.identification.estimate import Estimate
from friso.identification.response.records import FrequencyResponse
from friso.intervals import NORMAL_COVERAGE

LARGEST_TURN = np.radians(30)
"""Largest phase deviation [rad] on a straight line beyond the noise, by delay, damping or a mode nearby."""

KINDS: Mapping[int, str] = {0: "stiffness line", 1: "damping line", 2: "mass line"}
"""Names of straight lines, by their negative slope."""


@dataclass(frozen=True)
class StraightLine:
    """A straight line in a response, from `low` to `high` [Hz].

    `kind` is a name of `KINDS`; `value` is the stiffness, damping or mass, and `level` its inverse: position, velocity
    or acceleration per input. `sign` is -1 if the output opposes the input. `independent` is the effective number of
    independent spectral lines behind the interval.
    """

    kind: str
    low: float
    high: float
    level: Estimate
    value: Estimate
    sign: float
    independent: float

    @property
    def octaves(self) -> float:
        """Return the width of the band in octaves."""
        return float(np.log2(self.high / self.low))


def mass_lines(response: FrequencyResponse, most: int = 3) -> tuple[StraightLine, ...]:
    """Find the mass lines of a force-to-position response, at most `most`, by frequency.

    On a mass line the response falls as that of a free mass. Below an antiresonance it shows the whole mass, above the
    resonance the driven part. Returns () without any.
    """
    return straight_lines(response, 2, most=most)


def straight_lines(
    response: FrequencyResponse, slope: int, sign: float | None = None, most: int = 3
) -> tuple[StraightLine, ...]:
    """Find bands in which a response falls with frequency to the power `slope`: 0, 1 or 2.

    The widest bands in octaves are searched first, at most `most`; the result is sorted by frequency. `sign` is 1 or -1
    if the direction of the input is known (default: that of most of the band).
    """
    ordered = response.at((response.frequency > 0) & (np.abs(response.response) > 0))
    bands: list[tuple[int, int, float]] = []
    pieces = [(0, len(ordered.frequency))]
    while pieces and len(bands) < most:
        piece = pieces.pop(0)
        band = _widest(ordered, slope, sign, *piece)
        if band is None:
            continue
        if _clear(ordered, slope, band) and all(_parted(ordered, slope, band, other) for other in bands):
            bands.append(band)
        pieces += [(piece[0], band[0]), (band[1] + 1, piece[1])]
    lines = [_line(ordered, slope, its_sign, slice(first, last + 1)) for first, last, its_sign in bands]
    return tuple(sorted(lines, key=lambda line: line.low))


SCATTER_OF_A_STRAIGHT_LINE = 0.02
"""Relative scatter allowed on a straight line beyond its noise, by drives, guides and cables."""


def _clear(response: FrequencyResponse, slope: int, band: tuple[int, int, float]) -> bool:
    """Tell whether the slope of a band clearly differs from the next higher and lower slopes.

    `band` has the indices of its first and last spectral line, and its sign.
    """
    frequency, level, _, relative = (quantity[band[0] : band[1] + 1] for quantity in _flat(response, slope, band[2]))
    weight = 1 / (relative**2 / 2 + SCATTER_OF_A_STRAIGHT_LINE**2)
    octave = np.log(frequency) - np.average(np.log(frequency), weights=weight)
    spread = np.sum(weight * octave**2)
    return bool(abs(np.sum(weight * octave * level) / spread) + 2 / np.sqrt(spread) < 0.5)


FACTOR_BETWEEN_LINES = 1.5
"""Factor by which the level between two straight lines must differ from both to show a mode, not a bend."""


def _parted(
    response: FrequencyResponse, slope: int, first: tuple[int, int, float], second: tuple[int, int, float]
) -> bool:
    """Tell whether a mode separates two bands of one slope.

    Each band has the indices of its first and last spectral line. A mode shows by a spectral line between the bands
    whose level is far from that of both.
    """
    lower, upper = sorted([first, second])
    level = _flat(response, slope, 1.0)[1]
    between = level[lower[1] + 1 : upper[0]]
    means = [np.mean(level[band[0] : band[1] + 1]) for band in (lower, upper)]
    off = np.abs(between[:, None] - means).min(axis=1, initial=np.inf)
    return bool(np.any(off > np.log(FACTOR_BETWEEN_LINES)))


def _widest(
    response: FrequencyResponse, slope: int, sign: float | None, start: int, stop: int
) -> tuple[int, int, float] | None:
    """Return the first and last spectral line of the widest straight band, and its sign.

    Spectral lines from `start` to before `stop` are searched. Without a `sign`, both are tried. Returns None if there
    is no such band.
    """
    signs = (1.0, -1.0) if sign is None else (sign,)
    bands = [(*band, its_sign) for its_sign in signs if (band := _straight(response, slope, its_sign, start, stop))]
    frequency = response.frequency
    return max(bands, key=lambda limits: frequency[limits[1]] / frequency[limits[0]], default=None)


LINES_OF_A_BAND = 4
"""Fewest spectral lines of a straight line. Fewer leave its slope uncertain."""

EDGES_TRIED = 300
"""Largest number of frequencies tried as ends of a band."""

OCTAVES_OF_A_BAND = 0.4
"""Narrowest band of a straight line, in octaves. In narrower bands the slope is uncertain."""


def _straight(response: FrequencyResponse, slope: int, sign: float, start: int, stop: int) -> tuple[int, int] | None:
    """Return the indices of the first and last spectral line of the widest straight band.

    In the band, chi-square and phase must agree with a response that falls with frequency to the power `slope` and has
    this `sign`. Spectral lines from `start` to before `stop` are searched; at most `edges_tried` evenly spaced ones are
    tried as ends. Returns None if no such band is wide enough.
    """
    if stop - start < LINES_OF_A_BAND:
        return None
    frequency, level, phase, relative = (quantity[start:stop] for quantity in _flat(response, slope, sign))
    weight = 2 / (relative**2 + 2 * SCATTER_OF_A_STRAIGHT_LINE**2)
    sums = np.stack([weight, weight * level, weight * level**2, np.abs(phase) > LARGEST_TURN + 2 * relative])
    sums = np.concatenate([np.zeros((4, 1)), np.cumsum(sums, axis=1)], axis=1)
    step = max(1, -(-len(frequency) // EDGES_TRIED))
    first, last = np.arange(0, len(frequency), step)[:, None], np.arange(0, len(frequency), step)[None, :]
    count = last - first + 1
    total, linear, square, turned = sums[:, np.maximum(last + 1, first)] - sums[:, np.minimum(first, last + 1)]
    with np.errstate(divide="ignore", invalid="ignore"):
        even = square - linear**2 / total <= stats.chi2.ppf(0.95, np.maximum(count - 1, 1))
        good = (count >= LINES_OF_A_BAND) & (turned == 0) & even
    width = np.where(good, np.log2(frequency[last] / frequency[first]), -1.0)
    i, j = np.unravel_index(np.argmax(width), width.shape)
    if width[i, j] < OCTAVES_OF_A_BAND:
        return None
    return start + int(first[i, 0]), start + int(last[0, j])


def _flat(response: FrequencyResponse, slope: int, sign: float) -> tuple[np.ndarray, ...]:
    """Return frequency, log level, phase and relative deviation, each of shape (lines,).

    The response is multiplied by `sign` and (i omega)^`slope`, so that a straight line of this slope is level and its
    phase is 0.
    """
    value = sign * response.response * (2j * np.pi * response.frequency) ** slope
    relative = response.scatter() / np.abs(response.response)
    return response.frequency, np.log(np.abs(value)), np.angle(value), relative


def _line(response: FrequencyResponse, slope: int, sign: float, band: slice) -> StraightLine:
    """Describe a straight band of a response: its level, and stiffness, damping or mass.

    `slope` is 0 for a stiffness, 1 for a damping and 2 for a mass line. `sign` is -1 if the output opposes the input.
    """
    mean, half, independent = _level(response, slope, sign, band)
    low, high = float(response.frequency[band][0]), float(response.frequency[band][-1])
    method = f"{KINDS[slope]}, {low:.3g} to {high:.3g} Hz"
    into, out = response.channels.input_unit, response.channels.output_unit
    per = ("", "/s", "/s^2")[slope]
    unit, inverse = f"{out}{per}/{into}", {0: "N/m", 1: "N s/m", 2: "kg"}[slope]
    if (into, out) != ("N", "m"):
        inverse = f"{into}{(' ', ' s', ' s^2')[slope].rstrip()}/{out}"
    down, up = float(np.exp(mean - half)), float(np.exp(mean + half))
    name = KINDS[slope].removesuffix(" line")
    level = Estimate(f"{name} line level", unit, float(np.exp(mean)), down, up, method)
    value = Estimate(name, inverse, float(np.exp(-mean)), 1 / up, 1 / down, method)
    return StraightLine(KINDS[slope], low, high, level, value, sign, independent)


def _level(response: FrequencyResponse, slope: int, sign: float, band: slice) -> tuple[float, float, float]:
    """Return the log level of a band, half its interval, and its number of independent lines.

    A line may bend towards a mode above it (with frequency squared) or from one below (with its inverse). If the bend
    is significant, the level is taken at the straight end.

    The interval covers the noise, the scatter along the band, what a bend may hide to second order, and what the phase
    leaves open: under friction, 1/level is the magnitude times its cosine; under a delay, the magnitude. Friction that
    makes neighbouring lines scatter also makes the mass read high, by 0.1 to 1.0 times the scatter on 23 machines
    drawn at random (`benchmarks/identify.py`).
    """
    _, level, phase, relative = (quantity[band] for quantity in _flat(response, slope, sign))
    weight = 1 / (relative**2 / 2 + SCATTER_OF_A_STRAIGHT_LINE**2)
    columns, coefficients = _bent(_bends(response, slope, band), level, weight)
    inverse = np.linalg.inv(columns.T @ (weight[:, None] * columns))
    residual = level - columns @ coefficients
    independent = _independent(residual)
    free = max(independent - len(coefficients), 1.0)
    scale = np.average(residual**2, weights=weight) * np.sum(weight) / free
    scatter = float(np.sqrt(scale * inverse[0, 0]))
    gains = inverse[0] @ (columns * weight[:, None]).T
    noise = float(np.sqrt(np.sum(gains**2 * relative**2 / 2)))
    half_width = stats.t.ppf(0.975, free) * scatter if scatter > noise else NORMAL_COVERAGE * noise
    turned = float(np.average(-np.log(np.cos(phase)), weights=weight))
    bent = float(np.hypot(half_width, np.sum(coefficients[1:] ** 2) / 2))
    return float(coefficients[0]), bent + max(turned, 0.0) + float(np.median(relative)), independent


def _independent(residual: np.ndarray) -> float:
    """Return the effective number of independent residuals, from the correlation of neighbours.

    The sum of correlations comes out too small in a short band. A first-order autoregression does not, and is used if
    it gives fewer.
    """
    squares = float(np.sum(residual**2))
    if not squares > 0:
        return float(len(residual))
    correlation = np.correlate(residual, residual, "full")[len(residual) - 1 :] / squares
    gone = np.flatnonzero(correlation < 0)
    summed = 1 + 2 * np.sum(correlation[1 : gone[0] if gone.size else None])
    first = float(np.clip(correlation[1], 0.0, 0.99))
    return max(len(residual) / max(summed, (1 + first) / (1 - first)), 2.0)


def _bends(response: FrequencyResponse, slope: int, band: slice) -> list[np.ndarray]:
    """Return the shapes, (lines,), in which a straight line may bend towards the nearer mode.

    There is one shape for a nearer mode above the band, or below it. If the modes are equally near, or there is none,
    both shapes are returned.
    """
    frequency, level = _flat(response, slope, 1.0)[:2]
    inside, mean = frequency[band], np.mean(level[band])
    gone = frequency[np.abs(level - mean) > np.log(FACTOR_BETWEEN_LINES)]
    above, below = gone[gone > inside[-1]], gone[gone < inside[0]]
    up = above[0] / inside[-1] if above.size else np.inf
    down = inside[0] / below[-1] if below.size else np.inf
    shapes = {up: (inside / inside[-1]) ** 2, down: (inside[0] / inside) ** 2}
    return [shapes[min(up, down)]] if up != down else [(inside / inside[-1]) ** 2, (inside[0] / inside) ** 2]


def _bent(shapes: list[np.ndarray], level: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Fit a constant to levels, or a constant plus one of the `shapes` if significant.

    An F-test at 1 % decides. Returns the columns of the fit (spectral lines, 1 or 2), and their coefficients.
    """
    ones = np.ones((len(level), 1))
    columns, coefficients = ones, np.array([np.average(level, weights=weight)])
    straight = squares = float(np.sum(weight * (level - coefficients[0]) ** 2))
    for shape in shapes:
        tried = np.hstack([ones, shape[:, None]])
        fitted = np.linalg.solve(tried.T @ (weight[:, None] * tried), tried.T @ (weight * level))
        left = float(np.sum(weight * (level - tried @ fitted) ** 2))
        free = max(_independent(level - tried @ fitted) - 2, 1.0)
        if left < squares and straight - left > stats.f.ppf(0.99, 1, free) * left / free:
            columns, coefficients, squares = tried, fitted, left
    return columns, coefficients
