"""Turn a figure in SI units into the arrays that are drawn.

Units get prefixes, lines are thinned, and limits become lines. Both renderers start here, so that they draw the same
arrays.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeVar

import numpy as np

from friso.errors import escaped
from friso.shown.drawing.figure import (
    Array,
    Arrow,
    Axis,
    Band,
    Category,
    Coloured,
    Figure,
    Limit,
    Markers,
    Panel,
    Series,
)
from friso.shown.text import choose, pretty

Field = TypeVar("Field", bound=Coloured)

LegendEntry = Category | Band | Series | Markers
"""What a legend names."""


SIDES = {
    "": ("center", "center", 0, 0),
    "left": ("right", "center", -8, 0),
    "right": ("left", "center", 8, 0),
    "below": ("center", "top", 0, -8),
    "above": ("center", "bottom", 0, 8),
}
"""How words are aligned that stand on a side of a point, and how far [px or point] they are moved right and up."""

LONGEST_TEXT = 1000
"""Longest text in a figure in characters. The longest caption has half as many."""


def drawable(figure: Figure) -> Figure:
    """Return a figure ready to draw: prefixed units, thinned series, limits, and markers.

    Limits are drawn as series.
    """
    return _escaped_part(replace(figure, panels=tuple(_panel(panel) for panel in figure.panels)))


MOST_CELLS = 250_000
"""Largest number of cells in a figure on a page: more take a browser seconds to open and colour."""


def with_fewer_cells(figure: Figure) -> Figure:
    """Return a figure with maps and clouds thinned evenly, to at most MOST_CELLS cells together."""
    most = MOST_CELLS // max(1, sum(len(panel.coloured) for panel in figure.panels))

    def thinned(field: Field) -> Field:
        """Return a map or cloud with evenly spread rows and columns, or points."""
        at = pick(field.z.shape, most)
        cells = np.ix_(*at)
        codes = None if field.codes is None else field.codes[cells]
        told = None if field.told is None else field.told.of(cells)
        return replace(field, x=field.x[at[-1]], y=field.y[at[0]], z=field.z[cells], codes=codes, told=told)

    return replace(
        figure,
        panels=tuple(
            replace(panel, maps=tuple(map(thinned, panel.maps)), clouds=tuple(map(thinned, panel.clouds)))
            for panel in figure.panels
        ),
    )


def pick(sizes: Sequence[int], most: int) -> tuple[np.ndarray, ...]:
    """Return evenly spread indices along each dimension, together at most `most` combinations.

    `sizes` are the lengths of the dimensions. The longest one is thinned first.
    """
    counts = list(sizes)
    while math.prod(counts) > most and max(counts) > 1:
        counts[counts.index(max(counts))] -= 1
    return tuple(
        np.linspace(0, size - 1, number).round().astype(int) for size, number in zip(sizes, counts, strict=True)
    )


def _escaped_part(part: Any) -> Any:
    """Return a part of a figure with its texts escaped and shortened.

    Texts may come from a file that others wrote.
    """
    if isinstance(part, str):
        text = escaped(part)
        return text if len(text) <= LONGEST_TEXT else f"{text[:LONGEST_TEXT]}..."
    if isinstance(part, tuple):
        return tuple(map(_escaped_part, part))
    if is_dataclass(part) and not isinstance(part, type):
        return replace(part, **{field.name: _escaped_part(getattr(part, field.name)) for field in fields(part)})
    return part


def cell_edges(centres: Array, *, log: bool = False) -> Array:
    """Return the edges, shape (n + 1,), of the cells around ascending centres, shape (n,).

    Edges lie half-way between centres, on a logarithmic axis by ratio. A single cell reaches half its value, or 0.5, to
    both sides; on a logarithmic axis it reaches a factor of two.
    """
    if log:
        return np.exp(cell_edges(np.log(centres))) if len(centres) > 1 else np.array([centres[0] / 2, centres[0] * 2])
    if len(centres) == 1:
        half = abs(centres[0]) / 2 or 0.5
        return np.array([centres[0] - half, centres[0] + half])
    inner = (centres[1:] + centres[:-1]) / 2
    return np.concatenate(([2 * centres[0] - inner[0]], inner, [2 * centres[-1] - inner[-1]]))


def colour_prefix(field: Coloured) -> tuple[float, str]:
    """Return factor and prefixed unit for the numbers of a map or cloud.

    The limits of the colours decide, or without limits all numbers.
    """
    return choose(field.z if field.limits is None else np.array(field.limits), field.unit, log=field.log)


def legend_entries(figure: Figure) -> list[LegendEntry]:
    """Return what the one legend of a figure names, each entry once: categories that occur, then lines and points.

    A panel without colours for numbers is named only if it has several labels, and a category only if no word in the
    panel names it.
    """
    fields = [field for panel in figure.panels for field in panel.coloured]
    codes = [(field, [] if field.codes is None else np.unique(_finite(field.codes.ravel()))) for field in fields]
    occurring = {field.categories[int(code)] for field, several in codes for code in several}
    every = dict.fromkeys(category for field in fields for category in field.categories)
    entries: dict[tuple[str, ...], LegendEntry] = {}
    for panel in figure.panels:
        drawn = [item for item in (*panel.bands, *panel.series, *panel.markers) if item.label]
        for item in drawn if panel.coloured or len(drawn) > 1 else ():
            style = item.dash if isinstance(item, Series) else item.symbol if isinstance(item, Markers) else "band"
            entries.setdefault((item.label, item.colour, style), item)
    return [*(one for one in every if one in occurring and not one.is_written), *entries.values()]


MOST_WORDS = 12
"""Largest number of words written at an axis."""


def word_ticks(axis: Axis) -> tuple[list[int], list[str]]:
    """Return positions and words at an axis of words.

    Only every second, third, ... word is written if there are more than `MOST_WORDS`.
    """
    positions = list(range(0, len(axis.words), -(-len(axis.words) // MOST_WORDS)))
    return positions, [axis.words[position] for position in positions]


def _panel(panel: Panel) -> Panel:
    """Return a panel as it is drawn: prefixed axes, thinned lines, and limits as lines."""
    limits = _finite([value for limit in panel.limits for value in limit.values])
    points = (*panel.series, *panel.markers, *panel.coloured)
    xs = _gather(panel.x, [item.x for item in (*points, *panel.bands)])
    sides = [side for band in panel.bands for side in (band.low, band.high)]
    ys = _gather(panel.y, [*(item.y for item in points), *sides])
    x_factor, x_unit = _prefix(panel.x, xs)
    y_factor, y_unit = _prefix(panel.y, ys if panel.y.limits else np.concatenate((ys, limits)))
    extent = (float(xs.min()), float(xs.max())) if xs.size else (0.0, 1.0)
    lines = [_thinned(line) for line in panel.series] + [_limit(limit, extent) for limit in panel.limits]
    return replace(
        panel,
        x=_axis(panel.x, x_factor, x_unit),
        y=_axis(panel.y, y_factor, y_unit),
        series=tuple(replace(line, x=line.x * x_factor, y=line.y * y_factor) for line in lines),
        markers=tuple(_markers(marker, x_factor, y_factor) for marker in panel.markers),
        maps=tuple(prefixed(field, x_factor, y_factor) for field in panel.maps),
        clouds=tuple(prefixed(cloud, x_factor, y_factor) for cloud in panel.clouds),
        bands=tuple(
            replace(band, x=band.x * x_factor, low=band.low * y_factor, high=band.high * y_factor)
            for band in panel.bands
        ),
        limits=(),
        areas=tuple(replace(area, x=area.x * x_factor, y=area.y * y_factor) for area in panel.areas),
        arrows=tuple(
            replace(arrow, **{end: (at[0] * x_factor, at[1] * y_factor) for end, at in _ends(arrow).items()})
            for arrow in panel.arrows
        ),
        words=tuple(replace(item, x=item.x * x_factor, y=item.y * y_factor) for item in panel.words),
    )


def _ends(arrow: Arrow) -> dict[str, tuple[float, float]]:
    """Return both ends of an arrow by name."""
    return {"start": arrow.start, "end": arrow.end}


def _gather(axis: Axis, arrays: Iterable[Array]) -> Array:
    """Return the values that decide an axis's prefix: its limits, or else all finite data."""
    if axis.limits is not None:
        return np.array(axis.limits)
    values = _finite(np.concatenate([np.empty(0), *(np.asarray(array, dtype=float) for array in arrays)]))
    return values[values > 0] if axis.log else values


def _prefix(axis: Axis, values: Array) -> tuple[float, str]:
    """Return the factor and the prefixed unit that suit the values of an axis.

    A value times the factor is in the prefixed unit.
    """
    return choose(values, axis.unit, log=axis.log) if axis.prefixed else (1.0, pretty(axis.unit))


def _finite(values: Iterable[float] | Array) -> Array:
    """Return all finite values as one array."""
    array = np.asarray(values, dtype=float)
    return array[np.isfinite(array)]


def _axis(axis: Axis, factor: float, unit: str) -> Axis:
    """Return an axis with a prefixed unit, such as mm, and its limits and step times `factor`."""
    limits = None if axis.limits is None else (axis.limits[0] * factor, axis.limits[1] * factor)
    step = None if axis.step is None else axis.step * factor
    second = None if axis.second is None else replace(axis.second, factor=axis.second.factor / factor)
    return replace(axis, unit=unit, limits=limits, step=step, second=second)


def log_ticks(low: float, high: float) -> list[float]:
    """Return round numbers within a logarithmic axis of less than two decades, three at least.

    They are 1, 2 and 5 times powers of ten, more numbers if these are too few, and evenly spaced ones at last.
    """
    steps = (1, 2, 5) if math.log10(high / low) >= 1 else (1, 1.5, 2, 3, 4, 5, 7)
    exponents = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    values = [step * 10.0**exponent for exponent in exponents for step in steps]
    if low < high and sum(low <= value <= high for value in values) < 3:
        return even_ticks(low, high)
    return values


def even_ticks(low: float, high: float) -> list[float]:
    """Return about five round numbers from low to high, evenly spaced."""
    unit = 10.0 ** math.floor(math.log10((high - low) / 4))
    step = unit * next((size for size in (5, 2) if size * unit <= (high - low) / 4), 1)
    return [number * step for number in range(math.ceil(low / step), math.floor(high / step) + 1)]


def second_ticks(axis: Axis) -> tuple[list[float], list[str]]:
    """Return where on an axis its second scale has ticks, and their texts. The axis must have limits."""
    if axis.second is None or axis.limits is None:
        return [], []
    factor = axis.second.factor
    low, high = (limit * factor for limit in axis.limits)
    values = log_ticks(low, high) if axis.log else even_ticks(low, high)
    inside = [value for value in values if low <= value <= high]
    return [value / factor for value in inside], [f"{value:.10g}" for value in inside]


def _thinned(line: Series) -> Series:
    """Return a line with gaps at broken or infinite samples, thinned."""
    broken = ~(np.isfinite(line.x) & np.isfinite(line.y))
    x, y = np.where(broken, np.nan, line.x), np.where(broken, np.nan, line.y)
    x, y = thin(x, y)
    return replace(line, x=x, y=y)


def _limit(limit: Limit, extent: tuple[float, float]) -> Series:
    """Return all lines of a limit as one series across `extent`, with gaps between them.

    `extent` has the left and right end in the unit of x.
    """
    x = np.array([*extent, np.nan] * len(limit.values))
    y = np.array([entry for value in limit.values for entry in (value, value, np.nan)])
    return Series(x, y, limit.label, limit.colour, limit.dash, width=1.0)


def _markers(markers: Markers, x_factor: float, y_factor: float) -> Markers:
    """Return markers with their coordinates times the factors of both axes."""
    finite = np.isfinite(markers.x) & np.isfinite(markers.y)
    told = None if markers.told is None else markers.told.of(finite)
    return replace(markers, x=markers.x[finite] * x_factor, y=markers.y[finite] * y_factor, told=told)


def prefixed(field: Field, x_factor: float = 1.0, y_factor: float = 1.0) -> Field:
    """Return a map or cloud with prefixed axes and numbers; infinite numbers become gaps.

    Coordinates are multiplied by the factors of both axes.
    """
    z = np.where(np.isfinite(field.z), field.z, np.nan)
    factor, unit = colour_prefix(field)
    limits = None if field.limits is None else (field.limits[0] * factor, field.limits[1] * factor)
    return replace(field, x=field.x * x_factor, y=field.y * y_factor, z=z * factor, unit=unit, limits=limits)


MOST_BUCKETS = 1500  # about one per pixel of a page-wide panel
KEPT_PER_BUCKET = 5  # at most this many samples of a bucket are kept: the extremes of x and of y, and a gap


def thin(x: Array, y: Array, buckets: int = MOST_BUCKETS) -> tuple[Array, Array]:
    """Return samples of the line (x, y), in order, that look like the whole line.

    x and y have shape (n,) and any unit; NaN breaks the line. Lines of up to KEPT_PER_BUCKET * buckets samples are
    returned as they are. Of a longer line, the first and last sample are kept. In each bucket of neighbouring samples,
    the ones with the smallest and largest y and x are kept, and the first gap. Of equal samples, the first counts.

    Buckets hold equally many samples. If x runs to and fro, as in a loop, they are equally long pieces of the path
    instead. A state that rests for seconds then takes no samples from one that moves.
    """
    if len(x) <= KEPT_PER_BUCKET * buckets:
        return x, y
    starts = _starts(x, y, buckets)
    bucket = np.zeros(len(x), int)
    bucket[starts[1:]] = 1
    bucket = np.cumsum(bucket)
    kept = np.zeros(len(x), bool)
    kept[[0, -1]] = True
    for values in (x, y):
        finite = np.isfinite(values)
        least = np.minimum.reduceat(np.where(finite, values, np.inf), starts)[bucket]
        greatest = np.maximum.reduceat(np.where(finite, values, -np.inf), starts)[bucket]
        for wanted in (finite & (values == least), finite & (values == greatest), ~finite):
            places = np.flatnonzero(wanted)
            kept[places[np.diff(bucket[places], prepend=-1) > 0]] = True
    return x[kept], y[kept]


def _starts(x: Array, y: Array, buckets: int) -> np.ndarray:
    """Return the index of the first sample of every bucket, strictly rising."""
    count = len(x)
    if not np.any(np.diff(x) < 0):
        return count * np.arange(buckets) // buckets
    path = np.cumsum(_steps(x) + _steps(y))
    inner = np.searchsorted(path, path[-1] * np.arange(1, buckets) / buckets)
    return np.unique(np.concatenate(([0], inner[inner < count])))


def _steps(values: Array) -> Array:
    """Return the length of each step along one axis as a fraction of the axis, shape (n,).

    Gaps have no length.
    """
    finite = values[np.isfinite(values)]
    span = float(np.ptp(finite)) if finite.size else 0.0
    if span == 0.0:
        return np.zeros(len(values))
    return np.nan_to_num(np.abs(np.diff(values, prepend=values[0])) / span, posinf=0.0)
