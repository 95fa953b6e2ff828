"""Prepare the cells of a map for drawing.

Axes are put in order, numbers are scaled, and cells without a number get the reason.
"""

from __future__ import annotations

import json
from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from friso.questions.map import words as map_words
from friso.questions.map.words import quantity, variable
from friso.shown.drawing.figure import Array, Axis, Category, ramp
from friso.shown.text import choose
from friso.studies.metric import metrics, worded

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
