"""Prepare the cells of a map for drawing, and draw its verdicts as regions.

Axes are put in order, numbers are scaled, and cells without a number get the reason. Machines are marked at the values
that they have. Regions have words in them, the edge of hunting, and the way from a stage to it.
"""

from __future__ import annotations

import json
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr

from friso.errors import InputError
from friso.hunting.criteria import ATTRACTED
from friso.questions.map import words as map_words
from friso.questions.map.words import quantity, variable
from friso.shown.drawing.figure import (
    BLACK,
    GREY,
    INK,
    VERMILLION,
    WHITE,
    Area,
    Array,
    Arrow,
    Axis,
    Category,
    Figure,
    Lettering,
    Map,
    Markers,
    Panel,
    Series,
    ramp,
)
from friso.shown.text import choose
from friso.stage import Stage, loads
from friso.studies.axes import SCALINGS
from friso.studies.edges import HUNTS_LEVEL, SETTLES_LEVEL, SLOW_LEVEL, MapEdges, OwnLine, coarse_edges, verdict_levels
from friso.studies.metric import metrics, worded

SHOWN = "this machine"
"""Label of the machine that a figure is about; any other machine is grey."""


def with_places(figure: Figure, stands: Sequence[tuple[str, Stage]], keys: Sequence[str]) -> Figure:
    """Mark stages that have both keys in a figure over these keys.

    `stands` gives label and stage. Stages beyond the axes are left out.
    """
    places = []
    for label, stage in stands:
        right, up = ({**dict.fromkeys(SCALINGS, 1.0), **stage.flat()}.get(key) for key in keys)
        if isinstance(right, float) and isinstance(up, float):
            colour = INK if label == SHOWN else GREY
            places.append(Markers(np.array([right]), np.array([up]), label, colour, "target"))

    def marked(panel: Panel) -> Panel:
        """Add the marks that lie within a panel, but those that it has."""
        marked = {(item.x[0], item.y[0]) for item in panel.markers if item.symbol == "target"}
        inside = [one for one in places if _is_on(panel.x, one.x[0]) and _is_on(panel.y, one.y[0])]
        inside = [one for one in inside if (one.x[0], one.y[0]) not in marked]
        return replace(panel, markers=(*panel.markers, *inside))

    return replace(figure, panels=tuple(map(marked, figure.panels)))


def _is_on(axis: Axis, value: float) -> bool:
    """Tell whether a value lies within the limits of an axis."""
    return axis.limits is None or axis.limits[0] <= value <= axis.limits[1]


def machine_of(runs: xr.Dataset) -> Stage | None:
    """Return the machine around which keys were swept.

    Returns None if links tie keys to others, or if the runs are no study of friso.
    """
    if json.loads(runs.attrs.get("links", "{}")):
        return None
    try:
        return loads(runs.attrs.get("stage", ""))
    except InputError:  # for runs that are no study of friso
        return None


SAMPLE = "sample"  # dimension of sampled maps, which have no grid


@dataclass(frozen=True)
class CellAxis:
    """The cells along a swept key, in ascending order, shape (n,).

    `positions` are values in SI, or 0, 1, 2, ... if the cells are named by `words`. `places` has the index of each cell
    in the runs.
    """

    key: str
    quantity: str
    unit: str
    log: bool
    positions: Array
    words: tuple[str, ...]
    places: np.ndarray

    def axis(self, limits: tuple[float, float] | None) -> Axis:
        """Return the axis of a panel for these cells, drawn between `limits` (None: over all cells)."""
        return Axis(self.quantity, self.unit, limits, self.log, self.words)

    def text(self, position: int) -> str:
        """Write the quantity and value of one cell, e.g. "Crossover 8 Hz"."""
        return f"{self.quantity} {self.value(position)}"

    def value(self, position: int) -> str:
        """Write the value of one cell, e.g. "8 Hz"."""
        return self.words[position] if self.words else _value(self.positions[position], self.unit)

    def span(self) -> str:
        """Describe all values in a few words, e.g. "1 to 16 Hz, 41 values"."""
        if self.words:
            return ", ".join(self.words) if len(self.words) <= 8 else f"{len(self.words)} values"
        factor, unit = choose(self.positions, self.unit)
        low, high = float(self.positions.min()) * factor, float(self.positions.max()) * factor
        spacing = ", logarithmic" if self.log else ""
        return f"{low:.4g} to {high:.4g} {unit}".rstrip() + f", {len(self.positions)} values{spacing}"

    def position(self, value: object) -> float:
        """Return where a value or word lies on the axis: the value [SI], or the number of the word.

        Raises ValueError for a word that is not on the axis.
        """
        if not self.words:
            return float(value)  # type: ignore[arg-type]
        word = _word(self.key, value) if not isinstance(value, float | int) or isinstance(value, bool) else None
        word = word or _value(float(value), self.unit)  # type: ignore[arg-type]
        if word not in self.words:
            raise ValueError(f"{self.key}: got {value!r}, expected one of {', '.join(self.words)}")
        return float(self.words.index(word))


@dataclass(frozen=True)
class Look:
    """How a variable is coloured wherever it is shown: quantity, range, scale and categories.

    `numbers` and `codes` have the dimensions of the runs. A code is the index of a category, or NaN for a cell that is
    coloured by its number.
    """

    quantity: str
    unit: str
    limits: tuple[float, float] | None
    log: bool
    colours: tuple[str, ...]
    categories: tuple[Category, ...]
    numbers: xr.DataArray
    codes: xr.DataArray

    @property
    def scale(self) -> tuple[str, str, tuple[float, float] | None, bool, tuple[str, ...], tuple[Category, ...]]:
        """Return what a panel of cells or of points needs for its colours.

        These are quantity, unit, limits, whether the scale is logarithmic, colours of counts, and categories.
        """
        return self.quantity, self.unit, self.limits, self.log, self.colours, self.categories


def axes_of(runs: xr.Dataset) -> tuple[CellAxis, ...]:
    """Return the swept axes in the order of the runs, or the keys of sampled runs.

    Raises ValueError for runs without axes.
    """
    if SAMPLE in runs.dims:
        order = json.loads(runs.attrs.get("axes", "[]"))  # a store forgets the order of its coordinates
        keys = [key for key in runs.coords if runs[key].dims == (SAMPLE,) and key != SAMPLE]
        keys.sort(key=lambda key: order.index(key) if key in order else len(order))
        return tuple(_sampled(runs, key) for key in keys)
    dims = dims_of(runs)
    if not dims:
        raise ValueError("map: got runs without any dimension, expected those of a sweep, e.g. friso.sweep(...)")
    return tuple(_gridded(runs, key) for key in dims)


def cuts(runs: xr.Dataset) -> list[str]:
    """List the keys fixed in this slice of a larger map, with their values: "Crossover 8 Hz"."""
    fixed = runs.coords.to_dataset()
    return [_gridded(fixed.expand_dims(key), key).text(0) for key in fixed.coords if fixed[key].ndim == 0]


def dims_of(runs: xr.Dataset) -> tuple[Hashable, ...]:
    """Return the dimensions in the order of the variables.

    A dataset's own list may have another order.
    """
    return max((variable.dims for variable in runs.data_vars.values()), key=len, default=())


def _gridded(runs: xr.Dataset, key: Hashable) -> CellAxis:
    """Return the axis of a swept key.

    A logarithmic axis that includes 0 gets cells of equal width, each named by its value.
    """
    coordinate = runs[key]
    unit, log = map_words.unit_of(coordinate), coordinate.attrs.get("scale") == "log"
    if coordinate.dtype.kind not in "iuf":
        words = tuple(_word(str(key), value) for value in coordinate.values)
        return _axis_of_words(key, words, np.arange(len(words)))
    values, places = np.unique(np.asarray(coordinate.values, dtype=float), return_index=True)
    if log and values[0] <= 0:  # a logarithmic axis cannot reach zero, so cells have equal widths, each with its value
        return _axis_of_words(key, tuple(_value(value, unit) for value in values), places)
    return CellAxis(str(key), quantity(key), unit, log, values, (), places)


def _axis_of_words(key: Hashable, words: tuple[str, ...], places: np.ndarray) -> CellAxis:
    """Return an axis whose cells are named by words; `places` are their indices in the runs."""
    return CellAxis(str(key), quantity(key), "", False, np.arange(float(len(words))), words, places)


def _sampled(runs: xr.Dataset, key: Hashable) -> CellAxis:
    """Return the axis of a key that was sampled at random, with one cell for each sample."""
    coordinate = runs[key]
    places = np.arange(coordinate.size)
    if coordinate.dtype.kind in "iuf":
        values = np.asarray(coordinate.values, dtype=float)
        log = coordinate.attrs.get("scale") == "log" and bool(np.all(values > 0))
        return CellAxis(str(key), quantity(key), map_words.unit_of(coordinate), log, values, (), places)
    words, positions = np.unique([_word(str(key), value) for value in coordinate.values], return_inverse=True)
    return CellAxis(str(key), quantity(key), "", False, positions.astype(float), tuple(map(str, words)), places)


def _word(key: str, value: object) -> str:
    """Write a word or boolean as it is shown: a joint is "locked" or "free"."""
    if isinstance(value, bool | np.bool_):
        return ("locked" if value else "free") if key == "joint.locked" else ("true" if value else "false")
    return str(value)


def _value(value: float, unit: str) -> str:
    """Write a value with its unit and a suitable prefix."""
    factor, text = choose(np.array([value]), unit)
    return f"{value * factor:.4g} {text}".rstrip()


def plane_first(axes: Sequence[CellAxis]) -> list[CellAxis]:
    """Return the axes with the two that span the map first.

    Numbers with more than one value go before words and single values.
    """
    x, y, *_ = sorted(axes, key=lambda axis: (len(axis.places) == 1, bool(axis.words)))
    return [x, y, *(axis for axis in axes if axis is not x and axis is not y)]


def look(runs: xr.Dataset, metric: str) -> Look:
    """Return how a metric of words or of numbers is coloured.

    Raises ValueError for a metric that the runs do not hold.
    """
    if metric not in coloured(runs):
        raise ValueError(f"metric: got {metric!r}, expected one of {', '.join(coloured(runs))}")
    if metric in worded():
        codes, words = map_words.words_of(runs, metric)
        template = runs[metric]
        numbers = template.copy(data=np.full(template.shape, np.nan))
        word_categories = [map_words.word_category(metric, word) for word in words]
        categories = map_words.in_order(word_categories)
        table = np.array([categories.index(category) for category in word_categories], dtype=float)
        return Look(variable(metric), "", None, False, (), categories, numbers, template.copy(data=table[codes]))
    values = np.asarray(runs[metric].values, dtype=float)
    categories, codes = _without_number(runs, metric, values)
    numbers = np.where(np.isnan(codes), values, np.nan)
    limits, log, colours = _range(metric, numbers)
    arrays = (runs[metric].copy(data=numbers), runs[metric].copy(data=codes))
    return Look(variable(metric), map_words.unit_of(runs[metric]), limits, log, colours, categories, *arrays)


def coloured(runs: xr.Dataset) -> list[str]:
    """List the variables of a sweep that a map can colour: numbers first, then outcomes in words."""
    numeric = [str(name) for name, array in runs.data_vars.items() if array.dtype.kind in "iuf"]
    return numeric + [name for name in worded() if name in runs]


def _range(name: str, numbers: np.ndarray) -> tuple[tuple[float, float] | None, bool, tuple[str, ...]]:
    """Return the limits of a colour scale, whether it is logarithmic, and the colours of counts.

    `name` is the metric. Limits that it defines are taken as they are. If its numbers are counts, each count gets one
    colour; 0 gets the colour of a stage at rest. Positive numbers that span more than three decades get a logarithmic
    scale of at most six: anything smaller is solver noise of a stage at rest.
    """
    finite, metric = numbers[np.isfinite(numbers)], metrics().get(name)
    if not finite.size:
        return None, False, ()
    low, high = float(finite.min()), float(finite.max())
    if metric and metric.limits:
        return metric.limits, False, ()
    if metric and metric.counts:
        return None, False, (map_words.QUIET, *ramp(max(1, int(high)))[::-1])
    positive = finite[finite > 0]
    if low >= 0 and positive.size and high > 1e3 * float(positive.min()):
        return (max(float(positive.min()), 1e-6 * high), high), True, ()
    return (low, high), False, ()


def _without_number(runs: xr.Dataset, metric: str, values: np.ndarray) -> tuple[tuple[Category, ...], np.ndarray]:
    """Return the categories of cells that have no number, and a code for each cell.

    A code is the index of a category, or NaN for a cell that has a number.
    """
    shape, dims = runs[metric].shape, runs[metric].dims
    outcome = _texts(runs, "outcome", dims)
    status = _texts(runs, "status", dims)
    pairs = [_state(word, reason) for word in outcome[1] for reason in status[1]]
    places, words = _texts(runs, metrics()[metric].reasons if metric in metrics() else "", dims)
    none = [map_words.no_number(metric, word) for word in words]
    categories = map_words.in_order(category for category in (*pairs, *none) if category is not None)
    table = np.array([np.nan if category is None else categories.index(category) for category in pairs], dtype=float)
    codes = np.broadcast_to(table[outcome[0] * len(status[1]) + status[0]], shape)
    reasons = np.array([categories.index(category) for category in none], dtype=float)[places]
    return categories, np.where(np.isnan(codes) & ~np.isfinite(values), reasons, codes)


def _texts(runs: xr.Dataset, name: str, dims: tuple[Hashable, ...]) -> tuple[np.ndarray, Sequence[str | None]]:
    """Return the index of each run's text, in the order of `dims`, and the texts once each.

    A variable that the runs lack has a single text, None.
    """
    if name not in runs:
        return np.zeros((), dtype=int), [None]
    return map_words.words_of(runs.transpose(*dims), name)


def _state(outcome: str | None, status: str | None) -> Category | None:
    """Return why a cell has no numbers of its own, as a category; None if it ran to its end.

    `outcome` and `status` are the texts of the cell, None if the runs have no such variable.
    """
    reason = status or ""
    if outcome == "" or reason.startswith("not run"):
        return map_words.NOT_RUN
    if outcome == "invalid" or reason.startswith("invalid"):
        return map_words.INVALID
    if outcome == "failed" or (outcome is None and reason not in ("", "done")):
        return map_words.FAILED
    return None


HUNTS, KICKED, SLOW, SETTLES = "hunts", "bistable", "transient", "settles"
"""Verdicts with a region. That of stages that hunt after a kick only is a hatched part of the region that hunts."""

GROUNDS = {SETTLES: SETTLES_LEVEL, SLOW: SLOW_LEVEL, HUNTS: HUNTS_LEVEL}
"""Levels from which on each region has its colour, the lowest first: the next one lies on it."""

WRITTEN = {
    KICKED: ("A KICK\nSTARTS IT", WHITE),
    HUNTS: ("HUNTS", WHITE),
    SLOW: ("SLOW", BLACK),
    SETTLES: ("SETTLES", INK),
}
"""Words in the regions, and their colours."""

BEHIND_WORDS = {WHITE: VERMILLION}
"""Colours that cover the hatching behind words, by the colour of the words."""

MapPoint = tuple[float, float]
"""Values [SI] along both axes."""


def is_of_verdicts(x: CellAxis, y: CellAxis, colouring: Look) -> bool:
    """Tell whether cells over two axes have verdicts between which there may be edges."""
    words = {category.label for category in colouring.categories}
    return bool(words & {*ATTRACTED, SETTLES}) and not (x.words or y.words) and min(len(x.places), len(y.places)) > 1


def verdict_panel(
    x: CellAxis, y: CellAxis, colouring: Look, codes: Array, title: str, edges: MapEdges | None, own: Mapping[str, Any]
) -> Panel:
    """Return a map of verdicts over two axes; `codes`, shape (y, x), are indices of its categories.

    Without `edges`, they are drawn half-way between cells. `own` has the values of the swept stage, by key.
    """
    labels = np.array([*(category.label for category in colouring.categories), ""])
    words = labels[np.where(np.isnan(codes), -1, codes).astype(int)].T
    levels = verdict_levels(words)
    drawn = edges or coarse_edges(x.positions, y.positions, (x.log, y.log))
    mesh = (drawn.near + drawn.far) / 2
    colours = {category.label: category.colour for category in colouring.categories}
    colours[HUNTS] = colours.get(HUNTS, colours.get(KICKED, ""))
    areas = [
        _area(levels, levels >= level, mesh[max(level - SLOW_LEVEL, 0)], colours[word])
        for word, level in GROUNDS.items()
        if word in colours and (levels >= level).any()
    ]
    if (words == KICKED).any():
        areas.append(_area(levels, words == KICKED, mesh[-1], WHITE, hatched=True))
    if edges is not None:
        areas += _bands(levels, edges)
    here = _here(x, y, own)
    arrows, beside = _way(here, drawn.own, x.key) if here else ((), ())
    taken = [*([here] if here else []), *(arrow.end for arrow in arrows)]
    lettering = [item for word in WRITTEN if (item := _written(word, words, x, y, taken))]
    written = {KICKED, *(word for word, (text, _) in WRITTEN.items() if any(item.text == text for item in lettering))}
    categories = tuple(
        replace(one, is_written=one.label in written, colour=colours[HUNTS if one.label == KICKED else one.label])
        for one in colouring.categories
    )
    return Panel(
        title,
        x.axis((float(x.positions[0]), float(x.positions[-1]))),
        y.axis((float(y.positions[0]), float(y.positions[-1]))),
        tuple(Series(line[:, 0], line[:, 1], "", INK, width=1.8) for line in _lines(levels, mesh[-1])),
        (Markers(np.array(here[:1]), np.array(here[1:]), "", INK, "target"),) if here else (),
        maps=(Map(x.positions, y.positions, np.full(codes.shape, np.nan), *colouring.scale[:-1], categories, codes),),
        areas=tuple(areas),
        arrows=arrows,
        words=(*lettering, *beside),
    )


def _contours(levels: Array, cells: np.ndarray) -> Any:
    """Return the generator of contours of marked cells, shape (n, m), whose points are indices of cells.

    Cells without a level are left out.
    """
    from contourpy import contour_generator

    marked = np.ma.masked_array(cells.astype(float), np.isnan(levels))
    return contour_generator(z=marked.T, fill_type="OuterOffset")


def _placed(points: Array, mesh: Array) -> Array:
    """Return the places [SI] of points given as indices of cells, whole or half, shape (count, 2)."""
    i, j = np.round(2 * points).astype(int).T
    return mesh[i, j]


def _lines(levels: Array, mesh: Array) -> list[Array]:
    """Return the edges of hunting, each of shape (count, 2) [SI]."""
    return [_placed(line, mesh) for line in _contours(levels, levels >= HUNTS_LEVEL).lines(0.5)]


def _area(levels: Array, cells: np.ndarray, mesh: Array, colour: str, hatched: bool = False) -> Area:
    """Return the area of marked cells, shape (n, m), up to half-way to other cells or their edge on the mesh."""
    rings = []
    for points, offsets in zip(*_contours(levels, cells).filled(0.5, np.inf), strict=True):
        for ring in np.split(points, offsets[1:-1]):
            rings += [_placed(ring, mesh), np.full((1, 2), np.nan)]
    x, y = (np.concatenate(rings[:-1]) if rings else np.zeros((0, 2))).T
    return Area(x, y, colour, hatched)


def _bands(levels: Array, edges: MapEdges) -> list[Area]:
    """Return the areas between the last places inside and the first outside along the edges of hunting."""
    sides = zip(_lines(levels, edges.near[-1]), _lines(levels, edges.far[-1]), strict=True)
    rings = [np.concatenate([near, far[::-1], near[:1]]) for near, far in sides]
    return [Area(ring[:, 0], ring[:, 1], INK) for ring in rings]


def _here(x: CellAxis, y: CellAxis, own: Mapping[str, Any]) -> MapPoint | None:
    """Return the place of the swept stage, None if it is not on the map."""
    values = own.get(x.key), own.get(y.key)
    if not all(isinstance(value, float) for value in values):
        return None
    inside = all(axis.positions[0] <= value <= axis.positions[-1] for axis, value in zip((x, y), values, strict=True))
    return (float(values[0]), float(values[1])) if inside else None  # type: ignore[arg-type]


def nearest_way(ways: Iterable[OwnLine]) -> tuple[OwnLine, float] | None:
    """Return the axis along which the edge of hunting is nearest, and the factor to it; None without an edge."""
    factors = [
        (way, float(way.nearest.mean() / way.own))
        for way in ways
        if way.own > 0 and way.nearest is not None and way.nearest.min() > 0
    ]
    return min(factors, key=lambda pair: abs(np.log(pair[1])), default=None)


def _way(here: MapPoint, ways: tuple[OwnLine, ...], key: str) -> tuple[tuple[Arrow, ...], tuple[Lettering, ...]]:
    """Return the arrow from the stage to the nearest edge of hunting, and its factor beside it.

    `key` is that of the axis to the right.
    """
    nearest = nearest_way(ways)
    if nearest is None:
        return (), ()
    way, factor = nearest
    across = way.key == key
    end = (here[0] * factor, here[1]) if across else (here[0], here[1] * factor)
    colour = WHITE if way.attracts else INK
    ground = BEHIND_WORDS.get(colour, "")
    half = factor**0.5
    middle = (here[0] * half, here[1]) if across else (here[0], here[1] * half)
    words = Lettering(*middle, f"× {factor:.3g}", colour, "above" if across else "right", ground=ground)
    yours = Lettering(*here, "YOURS", colour, "below" if across or factor > 1 else "above", ground=ground)
    return (Arrow(here, end, colour),), (words, yours)


def _room(cells: np.ndarray, steps: list[float]) -> Array:
    """Return how far each cell, shape (n, m), lies from the next one that is not marked, or the side of the map.

    The map ends at the outermost cells. `steps` are the sizes of a cell.
    """
    from scipy import ndimage

    inner = np.zeros(cells.shape, bool)
    inner[1:-1, 1:-1] = cells[1:-1, 1:-1]
    distances: Any = ndimage.distance_transform_edt(inner, sampling=steps)
    return distances


LETTER_WIDTH = 0.012
"""Width of a letter as a share of the panel. Bold capitals of a page's panel take as much."""

LINE_HEIGHT = 0.05
"""Height of a line of words as a share of the panel. Lines of a page's panel take as much."""

ROOM_OF_WORDS = 0.55
"""Distance of words from the edge of their region, by their own size. With 0.5, their middles touch it."""


def _written(word: str, words: np.ndarray, x: CellAxis, y: CellAxis, taken: list[MapPoint]) -> Lettering | None:
    """Return the word of a region where it has most room in it; None where it has too little.

    `words` are the verdicts of the cells, shape (n, m), and `taken` places at which something else stands.
    """
    from scipy import ndimage

    cells = np.isin(words, ATTRACTED) if word == HUNTS else words == word
    if not cells.any():
        return None
    text, colour = WRITTEN[word]
    lines = text.splitlines()
    shares = LETTER_WIDTH * max(map(len, lines)), LINE_HEIGHT * len(lines)
    steps = [1 / share / count for share, count in zip(shares, cells.shape, strict=True)]  # [sizes of the words]
    if word == HUNTS:
        labelled: Any = ndimage.label(words == KICKED)
        parts = [labelled[0] == number + 1 for number in range(labelled[1])]
        for part in parts:
            cells &= ~part if _room(part, steps).max() > ROOM_OF_WORDS else True
    free = cells.copy()
    for place in taken:
        free[_nearest_cell(x, place[0]), _nearest_cell(y, place[1])] = False
    room = _room(free, steps)
    if room.max() < ROOM_OF_WORDS:
        return None
    at = np.unravel_index(room.argmax(), room.shape)
    place = float(x.positions[at[0]]), float(y.positions[at[1]])
    return Lettering(*place, text, colour, ground=BEHIND_WORDS.get(colour, ""))


def _nearest_cell(axis: CellAxis, value: float) -> int:
    """Return the index of the cell of an axis next to a value [SI]."""
    away = np.log(axis.positions / value) if axis.log else axis.positions - value
    return int(np.abs(away).argmin())
