"""Collect the data of a map page: axes, variables and colours of the runs.

The page's script reads it as JSON.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from friso.axis import unit_shown
from friso.hunting.measures import BANDS
from friso.questions.check.figures import common_range
from friso.questions.map.cells import SAMPLE, CellAxis, axes_of, coloured, look, pick, plane_first
from friso.questions.map.places import SHOWN, machine_of
from friso.questions.map.words import variable, words_of
from friso.shown.drawing.colours import scale
from friso.shown.drawing.drawable import colour_prefix, prefixed
from friso.shown.drawing.figure import Array, Cloud, Figure
from friso.shown.drawing.palette import DARK
from friso.shown.drawing.prefixes import choose
from friso.studies.axes import SCALINGS
from friso.studies.metric import worded
from friso.studies.traces import Traces

MOST_CELLS = 250_000  # most cells in a page: more take a browser seconds to open and colour

MISSING_HEIGHT = 255  # code for a cell without a category, whose number counts


def page_data(
    runs: xr.Dataset, metric: str, rerun: str, drawn: Traces | None = None, figure: Figure | None = None
) -> dict[str, Any]:
    """Return everything that the page's script reads, ready for JSON.

    Arrays are base64 of little-endian numbers, cell by cell in the order of the axes, the last axis fastest. `drawn`
    holds the runs of all cells. `rerun` is the command that repeats a run. `figure` is the map of verdicts that the
    page shows as it is, for a map over two axes. Raises ValueError for runs without axes, or
    without the metric.
    """
    axes = axes_of(runs)
    sampled = SAMPLE in runs.dims
    chosen = picked(runs)
    cells = _Cells(axes, chosen, sampled)
    flat = dict.fromkeys(SCALINGS, 1.0) | stage.flat() if (stage := machine_of(runs)) else {}
    chosen_all = not sampled and all(len(at) == len(axis.places) for at, axis in zip(chosen, axes, strict=True))
    order = list(axes) if sampled or len(axes) == 1 else plane_first(axes)
    return {
        "metric": metric,
        "rerun": rerun,
        "sampled": sampled,
        "indices": [[int(i) for i in places] for places in cells.indices()],
        "axes": [_axis(axis, positions, flat) for axis, positions in zip(axes, cells.positions(), strict=True)],
        "dark": DARK,
        "machine": SHOWN,
        "order": [axes.index(axis) for axis in order],
        "picture": _picture(figure) if len(axes) == 2 and chosen_all else None,
        "variables": [_coloured(runs, name, cells) for name in coloured(runs)],
        "lines": None if drawn is None else _lines(drawn, runs, cells),
        "texts": [_text(runs, str(name), cells) for name, array in runs.data_vars.items() if array.dtype.kind in "OUT"],
    }


def picked(runs: xr.Dataset) -> tuple[np.ndarray, ...]:
    """Return the indices of cells that the page holds along each axis, or of samples.

    A map that is too large is thinned evenly.
    """
    if SAMPLE in runs.dims:
        return pick([runs.sizes[SAMPLE]], MOST_CELLS)
    return pick([len(axis.places) for axis in axes_of(runs)], MOST_CELLS)


class _Cells:
    """The cells of a map that its page holds, and their values in arrays of the runs."""

    def __init__(self, axes: tuple[CellAxis, ...], chosen: tuple[np.ndarray, ...], sampled: bool) -> None:
        self.axes, self.chosen, self.sampled = axes, chosen, sampled

    def indices(self) -> list[np.ndarray]:
        """Return the indices of the chosen cells along each dimension of the runs."""
        if self.sampled:
            return list(self.chosen)
        return [axis.places[at] for axis, at in zip(self.axes, self.chosen, strict=True)]

    def positions(self) -> list[np.ndarray]:
        """Return the indices of the chosen cells along each axis; for sampled runs, one per sample."""
        return [self.chosen[0]] * len(self.axes) if self.sampled else list(self.chosen)

    def take(self, array: xr.DataArray) -> np.ndarray:
        """Return the values of the chosen cells, shape (cells,)."""
        dims = (SAMPLE,) if self.sampled else tuple(axis.key for axis in self.axes)
        return np.asarray(array.transpose(*dims).values)[np.ix_(*self.indices())].ravel()


FINEST = 2 * min(BANDS)
"""Least range [m] of the axis of a drawn run."""

HIGHEST_BYTE = 250
"""Largest byte that encodes a height of a drawn run; 255 encodes a missing height."""


def _lines(drawn: Traces, runs: xr.Dataset, cells: _Cells) -> dict[str, Any]:
    """Return the run of each cell as a line: its heights, and the range that they cover.

    The range shows the final behaviour of the run. Heights are bytes from 0 to HIGHEST_BYTE, which cover the range and
    half a range beyond either end; lines are cut there.
    """
    outcome = runs["outcome"]
    of_cell = cells.take(outcome.copy(data=np.arange(outcome.size).reshape(outcome.shape)))
    deviations, late = drawn.deviations[of_cell], drawn.late[of_cell]
    time = np.linspace(0.0, drawn.duration, deviations.shape[1])
    ends = [common_range([line[time >= start]], FINEST) for line, start in zip(deviations, late, strict=True)]
    low, high = np.array([end or (-FINEST, FINEST) for end in ends]).T[:, :, None]
    shares = ((deviations - low) / (high - low) + 0.5) / 2
    heights = np.where(
        np.isnan(shares), MISSING_HEIGHT, np.clip(np.round(HIGHEST_BYTE * shares), 0, HIGHEST_BYTE)
    ).astype(np.uint8)
    ranges = {"low": _base64(low.astype("<f4")), "high": _base64(high.astype("<f4"))}
    return {"duration": drawn.duration, "unit": unit_shown("m"), "heights": _base64(heights), **ranges}


def _axis(axis: CellAxis, positions: np.ndarray, flat: Mapping[str, Any]) -> dict[str, Any]:
    """Return an axis with its values at `positions`, the indices of the cells on the page.

    The value of the machine with the keys `flat` is added. This value is null for an axis of words, and beyond the ends
    of the axis.
    """
    values = axis.positions[positions]
    factor, unit = choose(axis.positions, axis.unit, log=axis.log)
    own = None if axis.words else flat.get(axis.key)
    inside = isinstance(own, float) and axis.positions.min() <= own <= axis.positions.max()
    return {
        "machine": _shortened(own * factor) if inside and own is not None else None,
        "key": axis.key,
        "label": axis.axis(None).quantity,
        "unit": unit,
        "log": axis.log,
        "words": list(axis.words),
        "values": [_shortened(value * factor) for value in values],
    }


def _picture(figure: Figure | None) -> dict[str, Any] | None:
    """Return what plotly draws of a map of verdicts, without its note; None for other maps."""
    if figure is None or not figure.panels[0].areas:
        return None
    from friso.shown.drawing.plotly_renderer import plain_parts

    return plain_parts(replace(figure, note=""))


def _coloured(runs: xr.Dataset, name: str, cells: _Cells) -> dict[str, Any]:
    """Return a variable that the page can colour: its numbers, categories and scale."""
    colouring = look(runs, name)
    numbers = colouring.numbers.values.ravel().astype(float)
    none = np.zeros(numbers.size)
    field = Cloud(none, none, numbers, *colouring.scale[:-1])
    factor, unit = colour_prefix(field)
    scaled = scale(prefixed(field))
    codes = cells.take(colouring.codes)
    stored = colouring.numbers if name in worded() else runs[name]
    categories = [{"label": category.label, "colour": category.colour} for category in colouring.categories]
    return {
        "name": name,
        "label": colouring.quantity,
        "unit": unit,
        "log": colouring.log,
        "low": scaled.low,
        "high": scaled.high,
        "stops": [[_shortened(place), colour] for place, colour in scaled.stops],
        "ticks": list(scaled.ticks),
        "texts": list(scaled.texts),
        "kinds": categories,
        "codes": _base64(np.where(np.isnan(codes), MISSING_HEIGHT, codes).astype(np.uint8)),
        "numbers": _base64(_short(cells.take(stored).astype(float) * factor)),
    }


def _text(runs: xr.Dataset, name: str, cells: _Cells) -> dict[str, Any]:
    """Return a variable of texts: each text once, and for each cell the index of its text."""
    codes, words = words_of(runs, name)
    numbers = cells.take(runs[name].copy(data=codes)).astype("<u4")
    return {"name": name, "label": variable(name), "words": words, "codes": _base64(numbers)}


def _short(values: Array) -> np.ndarray:
    """Round values to six significant digits, as float32, which holds seven."""
    with np.errstate(divide="ignore", invalid="ignore"):
        size = np.floor(np.log10(np.abs(values)))
    scaled = 10.0 ** (5 - np.where(np.isfinite(size), size, 0.0))
    return (np.round(values * scaled) / scaled).astype("<f4")


def _shortened(value: float) -> float:
    """Round a value to six significant digits."""
    return float(f"{value:.6g}")


def _base64(array: np.ndarray) -> str:
    """Write the bytes of an array in base64."""
    return base64.b64encode(np.ascontiguousarray(array).tobytes()).decode("ascii")
