"""Interpolate a return map smoothly between its landings, up to the places where it breaks off.

Values and slopes are those of cubics fitted by least squares to the landings about a place (W. S. Cleveland, Robust
locally weighted regression and smoothing scatterplots, 1979, doi:10.1080/01621459.1979.10481038, with equal weights).
Coordinates are logarithms of distance (see `friso.hunting.return_map.landing_map`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

REST_COORDINATE, FIRST_COORDINATE = -1e6, -1e9
"""Coordinate on the map that stands for a stage that rests, or has diverged; and one before all others."""

NEGATIVE_SIDE_SHIFT = 1e3
"""Shift of a landing's coordinate on the map, its log distance, on the negative side."""

TERMS = 4
"""Coefficients of a cubic."""


STAGE_SHIFT = 4 * NEGATIVE_SIDE_SHIFT
"""Shift from one stage to the next on the line of several maps, which leaves room for both sides of each."""


@dataclass(frozen=True)
class Cubics:
    """Cubics side by side: where each begins, ascending, and its coefficients by power, (4, cubics).

    A cubic is one of the distance from its beginning. The maps of several stages follow each other on one line, on
    which `shifts` says where each cubic's stage lies.
    """

    begins: np.ndarray
    terms: np.ndarray
    shifts: np.ndarray | float = 0.0

    def __call__(self, places: np.ndarray, shifts: np.ndarray | float = 0.0) -> np.ndarray:
        """Return the values at `places` of stages with these `shifts`, all (count,)."""
        number = self._numbers(places, shifts)
        apart, (value, slope, bend, twist) = places - self.begins[number], self.terms[:, number]
        return value + apart * (slope + apart * (bend + apart * twist))

    def slope(self, places: np.ndarray, shifts: np.ndarray | float = 0.0) -> np.ndarray:
        """Return the slopes at `places` of stages with these `shifts`, all (count,)."""
        number = self._numbers(places, shifts)
        apart, (_, slope, bend, twist) = places - self.begins[number], self.terms[:, number]
        return slope + apart * (2 * bend + apart * 3 * twist)

    @cached_property
    def _line(self) -> np.ndarray:
        """Return where the cubics begin on the line of all stages."""
        return _on_line(np.minimum(self.begins, STAGE_SHIFT / 2), self.shifts)

    def _numbers(self, places: np.ndarray, shifts: np.ndarray | float) -> np.ndarray:
        """Return the numbers of the cubics at `places` of stages with these `shifts`, all (count,)."""
        return self._line.searchsorted(_on_line(places, shifts), side="right") - 1


def _on_line(places: np.ndarray, shifts: np.ndarray | float) -> np.ndarray:
    """Return where coordinates of stages lie on the line of all stages."""
    return np.maximum(places, -STAGE_SHIFT / 2) + shifts


def at_rest(begin: float) -> Cubics:
    """Return the curve of a stage that rests after landings from a coordinate on."""
    return _flat(np.array([begin]), np.array([REST_COORDINATE]), 0.0)


SCATTER_RANGE_LOG = 0.05
"""Distance between points over which scatter is measured. Over more, the map itself changes."""


def curve(places: np.ndarray, after: np.ndarray, inward: bool) -> Cubics:
    """Return the curve through landings at ascending `places` and the next ones `after`, (points,), -inf for rest.

    Where the curve breaks off between two landings, each half has the gain of the nearer one. It continues a little
    nearer to home than the first landing, and beyond the last one if that leads `inward`.
    """
    pieces = _pieces(places, after)
    ends = np.flatnonzero(np.diff(pieces)) + 1
    parts, begin = list[Cubics](), float(places[0]) - SCATTER_RANGE_LOG
    for first, last in zip(np.append(0, ends), np.append(ends, len(places)), strict=True):
        here, ahead = places[first:last], after[first:last]
        if np.isfinite(ahead[0]):
            parts += _piece(here, ahead, begin, first > 0)
        else:
            parts.append(at_rest(begin))
        begin = float(places[last - 1] + places[min(last, len(places) - 1)]) / 2
    if not (inward and np.isfinite(after[-1])):
        parts.append(at_rest(places[-1]))
    return join(parts)


def join(parts: Sequence[Cubics]) -> Cubics:
    """Return curves side by side as one."""
    return Cubics(np.concatenate([part.begins for part in parts]), np.hstack([part.terms for part in parts]))


def side_by_side(curves: Sequence[Cubics]) -> Cubics:
    """Return the curves of several stages as one."""
    return replace(join(curves), shifts=shifts_of([len(one.begins) for one in curves]))


def shifts_of(counts: Sequence[int]) -> np.ndarray:
    """Return the shifts of so many places of each of several stages on the line of all stages."""
    return np.repeat(STAGE_SHIFT * np.arange(len(counts)), counts)


def _flat(begins: np.ndarray, values: np.ndarray, slope: float) -> Cubics:
    """Return straight lines of one slope, each with its value where it begins, both (lines,)."""
    return Cubics(begins, np.array([values, np.full(len(begins), slope), *np.zeros((2, len(begins)))]))


BREAK_JUMP_LOG = 0.5
"""Difference in log distance beyond which neighbouring returns lie on two sides of a break of the map."""

BREAK_STEEPNESS = 3.0
"""Slope between two points beyond which the map breaks off."""


def _pieces(places: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Return on which piece of the map each landing lies, numbered in order, (points,)."""
    goes = np.isfinite(after)
    with np.errstate(all="ignore"):  # two landings after which the stage rests
        joined = np.abs(np.diff(after)) < BREAK_JUMP_LOG + BREAK_STEEPNESS * np.diff(places)
    return np.append(0, np.cumsum((goes[1:] | goes[:-1]) & ~joined))


def piece_about(places: np.ndarray, after: np.ndarray, place: float) -> np.ndarray:
    """Return which landings lie on the piece of the map on which a coordinate lies, (points,)."""
    pieces = _pieces(places, after)
    return pieces == pieces[np.abs(places - place).argmin()]


def _piece(places: np.ndarray, after: np.ndarray, begin: float, breaks: bool) -> list[Cubics]:
    """Return the curve of one continuous piece from the coordinate `begin` on, where the map `breaks` off or begins."""
    knots, values = _merged(places, after)
    slopes = _slopes(knots, values)
    fit = fitted(places, after, knots)
    values, slopes = np.where(fit.good, fit.value, values), np.where(fit.good, fit.slope, slopes)
    apart, rise = np.diff(knots), np.diff(values)
    bend = (3 * rise / apart - 2 * slopes[:-1] - slopes[1:]) / apart
    twist = (slopes[:-1] + slopes[1:] - 2 * rise / apart) / apart**2
    low = values[:1] + slopes[0] * (places[0] - knots[:1])
    high = values[-1:] + slopes[-1] * (places[-1] - knots[-1:])
    nearer = 1.0 if breaks else slopes[0]
    return [
        _flat(np.array([begin]), low + nearer * (begin - places[0]), nearer),
        _flat(places[:1], low, slopes[0]),
        Cubics(knots[:-1], np.array([values[:-1], slopes[:-1], bend, twist])),
        _flat(knots[-1:], values[-1:], slopes[-1]),
        _flat(places[-1:], high, 1.0),
    ]


MERGED_RANGE_LOG = 0.02
"""Range of log distance in which landings count as one point. The slope between nearer ones is noise."""

FEWEST_FITTED = 7  # [landings]
"""Fewest landings to which a cubic is fitted, three more than it has coefficients. They form more points than it
has coefficients, too."""


def _merged(places: np.ndarray, after: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the means of landings that are so near to each other that their slope is noise.

    A narrow piece of the map keeps as many points as a cubic needs.
    """
    first, apart = [0], min(MERGED_RANGE_LOG, float(places[-1] - places[0]) / FEWEST_FITTED)
    while (end := int(places.searchsorted(places[first[-1]] + apart, side="right"))) < len(places):
        first.append(end)
    number = np.diff([*first, len(places)])
    return np.add.reduceat(places, first) / number, np.add.reduceat(after, first) / number


def _slopes(knots: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the slopes of a piece at its knots by Akima's rule, which does not overshoot beside a corner."""
    if len(knots) < 3:
        return np.ones(len(knots)) if len(knots) < 2 else np.full(2, np.diff(values)[0] / np.diff(knots)[0])
    from scipy.interpolate import Akima1DInterpolator  # slow

    return Akima1DInterpolator(knots, values)(knots, 1)


@dataclass(frozen=True)
class CubicFit:
    """Cubics fitted about places, arrays of shape (places,).

    They have a value, a slope with its standard error, and the landings scatter about them by `scatter`. Where they
    are not `good`, too few landings or their scatter forbid them.
    """

    value: np.ndarray
    slope: np.ndarray
    error: np.ndarray
    scatter: np.ndarray
    good: np.ndarray


FITTED_REACHES_LOG = (0.15, 0.075, 0.0375)
"""Ranges of log distance on either side within which a cubic is fitted. A map bends little over a seventh; beside a
corner only the narrowest fits."""

FITTED_SCATTER_LOG = 0.01
"""Scatter of landings about a fitted cubic beyond which the map goes through the landings themselves."""


def fitted(places: np.ndarray, after: np.ndarray, about: np.ndarray) -> CubicFit:
    """Fit cubics to the landings about coordinates `about`, (n,), of one continuous piece of a map.

    The landings lie within the reach at which the slope has the least standard error. The error grows by what slopes
    within other reaches differ by beyond their own errors, as they do beside a corner. It is so large that three times
    it are as rare as with many landings (Student's distribution).
    """
    from scipy.special import ndtr, stdtrit  # slow

    knots, _ = _merged(places, after)
    found = np.full((4, len(FITTED_REACHES_LOG), len(about)), np.nan)
    found[2] = np.inf
    for values, slopes, errors, scatters, reach in zip(*found, FITTED_REACHES_LOG, strict=True):
        apart = (places - about[:, None]) / reach
        near = np.abs(apart) < 1
        number, distinct = near.sum(axis=1), (np.abs(knots - about[:, None]) < reach).sum(axis=1)
        enough = (number >= FEWEST_FITTED) & (distinct > TERMS)
        if not enough.any():
            continue
        powers = np.where(near, apart, 0.0)[:, :, None] ** np.arange(TERMS) * near[:, :, None]
        normal = np.einsum("npi,npj->nij", powers, powers)
        normal[~enough] = np.eye(TERMS)
        inverse = np.linalg.inv(normal)
        terms = np.einsum("nij,npj,p->in", inverse, powers, after)
        left = np.where(near, after - np.einsum("npi,in->np", powers, terms), 0.0)
        freedom = np.maximum(number - TERMS, 1)
        scatter = np.sqrt((left**2).sum(axis=1) / freedom)
        good = enough & (scatter < FITTED_SCATTER_LOG)
        error = scatter * np.sqrt(inverse[:, 1, 1]) / reach * stdtrit(freedom, ndtr(3.0)) / 3
        values[good], slopes[good], errors[good] = terms[0, good], terms[1, good] / reach, error[good]
        scatters[good] = scatter[good]
    best, column = found[2].argmin(axis=0), np.arange(len(about))
    value, slope, error, scatter = found[:, best, column]
    misfit = np.nanmax(np.abs(found[1] - slope) - found[2], axis=0, initial=0.0, where=np.isfinite(found[1]))
    return CubicFit(value, slope, np.hypot(error, misfit), scatter, np.isfinite(error))
