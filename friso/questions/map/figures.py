"""Draw a map: one variable over the swept axes of a sweep."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial, reduce
from itertools import product
from types import MappingProxyType
from typing import Any

import numpy as np
import xarray as xr

from friso.questions.map.cells import (
    SAMPLE,
    SHOWN,
    CellAxis,
    Look,
    axes_of,
    cuts,
    is_of_verdicts,
    look,
    machine_of,
    plane_first,
    verdict_panel,
    with_places,
)
from friso.questions.map.findings import message, own_values, second_scale, statement, subject_of
from friso.questions.map.words import variable
from friso.shown.drawing.drawable import MOST_CELLS, cell_edges, pick
from friso.shown.drawing.figure import BLUE, Axis, Cloud, Figure, Map, Markers, Panel, Series, Told
from friso.stage.rig import is_as_built
from friso.studies.edges import MapEdges
from friso.studies.metric import metrics

MOST_SLICES = 9  # largest number of panels of a map over more than two axes
RED = "#e3001b"  # the evaluation marker of the thesis

MOST_LISTED = 12  # largest number of left-out values that are named one by one


def map_figure(
    runs: xr.Dataset,
    metric: str = "outcome",
    marker: Mapping[str, float] | None = None,
    edges: MapEdges | None = None,
    rerun: str = "",
) -> Figure:
    """Draw a variable over one axis as a line, over two as cells, over more as slices.

    Samples are drawn as points. `runs` is what friso.sweep returns, and `metric` a variable of it. `marker` is the
    evaluation point, by key: SI values or words. It is drawn unless there is a single axis. `edges` are those of a map
    of verdicts over two axes, half-way between cells otherwise. `rerun` is the command that repeats the run of a cell,
    with {} for its indices, which a page tells under the mouse. Raises ValueError for a missing metric, runs without
    dimensions, or a marker that lacks an axis.
    """
    axes, colouring = axes_of(runs), look(runs, metric)
    tell = partial(_told, rerun, [axis.key for axis in axes])
    caption, columns, title = "", 1, variable(metric)
    if SAMPLE in runs.dims:
        told = _told(rerun, [SAMPLE], {SAMPLE: np.arange(runs.sizes[SAMPLE])})
        panels, caption = _samples(axes, colouring, marker, told)
    elif len(axes) == 1:
        panels = [_line(axes[0], colouring, tell({axes[0].key: axes[0].places}))]
    elif len(axes) == 2:
        panels = [_cells(axes[0], axes[1], colouring, marker, "", tell, {}, edges, own_values(runs))]
        panels = [with_second_scales(panel, axes, runs) for panel in panels]
        title = message(runs, metric, edges) or title
    else:
        panels, caption = _slices(axes, colouring, marker, tell)
        columns = {1: 1, 2: 2, 4: 2}.get(len(panels), 3)
    return Figure(
        name=f"map-{metric}",
        title=title,
        caption=f"{caption or f'Every cell is one {_subject(metric, runs)}.'} {_told_of(runs, rerun)}".strip(),
        panels=tuple(panels),
        columns=columns,
        subject=subject_of(runs),
        note=statement(runs, metric) + (f"\n{caption}" if caption else ""),
    )


def marked_figure(
    runs: xr.Dataset, metric: str, edges: MapEdges | None = None, rerun: str = "", condition: str = ""
) -> Figure:
    """Return the figure of a map with the condition under which it holds; over two axes, with the swept machine."""
    figure, stage = map_figure(runs, metric, edges=edges, rerun=rerun), machine_of(runs)
    figure = replace(figure, note=condition + figure.note)
    keys = [] if SAMPLE in runs.dims else [axis.key for axis in axes_of(runs)]
    return with_places(figure, [(SHOWN, stage)], keys) if stage and len(keys) == 2 else figure


def _told(rerun: str, keys: Sequence[str], at: Mapping[str, Any]) -> Told | None:
    """Return the command that repeats the run of each cell; None without a command.

    `keys` are the dimensions of the runs in order, and `at` has the indices of the cells along each of them.
    """
    if not rerun:
        return None
    each = [np.asarray(indices).astype(str) for indices in np.broadcast_arrays(*(at[key] for key in keys))]
    return Told(rerun, reduce(lambda some, more: np.char.add(np.char.add(some, " "), more), each))


def _told_of(runs: xr.Dataset, rerun: str) -> str:
    """Say what a page tells of a cell under the mouse, and that it shows fewer cells of a large map."""
    told = "The mouse over a cell shows the command that repeats its run." if rerun else ""
    cells = math.prod(runs.sizes.values())
    fewer = f"A page shows at most {MOST_CELLS} of its {cells} cells, evenly picked." if cells > MOST_CELLS else ""
    return f"{told} {fewer}".strip()


def _subject(metric: str, runs: xr.Dataset) -> str:
    """Return what a cell of a map represents: one run, or the stage under any motion, whose drive is left out."""
    if metric not in metrics() or metrics()[metric].source == "run":
        return "run"
    stage = machine_of(runs)
    return f"stage{', in continuous time' * (stage is not None and is_as_built(stage))}"


def map_panel(
    runs: xr.Dataset, metric: str = "outcome", marker: Mapping[str, float] | None = None, title: str | None = None
) -> Panel:
    """Return the panel of a variable over the two axes of a map, for figures of several maps.

    The first axis points to the right. `runs` is what friso.sweep returns, and `metric` a variable of it. `marker` is
    the evaluation point: SI values or words by key. By default, the title is the variable with the values at which a
    larger map was cut. Raises ValueError for runs without exactly two axes, a missing metric, or a marker that lacks an
    axis.
    """
    axes = axes_of(runs)
    if len(axes) != 2 or SAMPLE in runs.dims:
        raise ValueError(
            f"map_panel: got runs over {', '.join(map(str, runs.sizes))}, expected two axes; cut the others, "
            'e.g. runs.sel({"joint.stroke": 1e-3}, method="nearest")'
        )
    if title is None:
        title = ", ".join([variable(metric), *cuts(runs)])
    return _cells(axes[0], axes[1], look(runs, metric), marker, title, lambda at: None)


def _cells(
    x: CellAxis,
    y: CellAxis,
    colouring: Look,
    marker: Mapping[str, float] | None,
    title: str,
    tell: Callable[[Mapping[str, Any]], Told | None],
    cut: Mapping[str, Any] = MappingProxyType({}),
    edges: MapEdges | None = None,
    own: Mapping[str, Any] = MappingProxyType({}),
) -> Panel:
    """Return the panel of a map over two axes x and y, the only dimensions of its arrays.

    `marker` is the evaluation point, `colouring` says how cells are coloured, and `tell` what is told of cells by their
    indices. The map is `cut` at indices along other axes. Of verdicts, `edges` are drawn, and the stage with its `own`
    values by key.
    """
    told = tell({**cut, x.key: x.places, y.key: y.places[:, None]})
    z, codes = (
        np.asarray(array.transpose(y.key, x.key).values)[np.ix_(y.places, x.places)]
        for array in (colouring.numbers, colouring.codes)
    )
    if is_of_verdicts(x, y, colouring):
        panel = verdict_panel(x, y, colouring, codes, title, edges, own)
        maps = tuple(replace(field, told=told) for field in panel.maps)
        return replace(panel, markers=(*panel.markers, *_marked(marker, x, y)), maps=maps)
    points = _marked(marker, x, y)
    return Panel(
        title,
        x.axis(_limits(x, [point.x for point in points])),
        y.axis(_limits(y, [point.y for point in points])),
        markers=points,
        maps=(Map(x.positions, y.positions, z, *colouring.scale, codes, told=told),),
    )


def with_second_scales(panel: Panel, axes: Sequence[CellAxis], runs: xr.Dataset) -> Panel:
    """Add to axes of factors the scales of what they multiply: the controller's speed in Hz, friction in N."""
    x, y = (replace(axis, second=second_scale(one, runs)) for axis, one in zip((panel.x, panel.y), axes, strict=True))
    return replace(panel, x=x, y=y)


def _limits(axis: CellAxis, points: Sequence[np.ndarray]) -> tuple[float, float]:
    """Return the outer edges of the cells along an axis, widened to markers outside."""
    values = np.concatenate([cell_edges(axis.positions, log=axis.log), *points])
    return float(values.min()), float(values.max())


def _marked(marker: Mapping[str, float] | None, x: CellAxis, y: CellAxis) -> tuple[Markers, ...]:
    """Return the marker of the evaluation point. Raises ValueError if it lacks an axis."""
    if marker is None:
        return ()
    lacking = [axis.key for axis in (x, y) if axis.key not in marker]
    if lacking:
        raise ValueError(
            f"marker: got {', '.join(marker) or 'nothing'}, expected a value of {' and '.join(lacking)} too"
        )
    right, up = (np.array([axis.position(marker[axis.key])]) for axis in (x, y))
    return (Markers(right, up, "evaluation point", RED, "target"),)


def _slices(
    axes: tuple[CellAxis, ...],
    colouring: Look,
    marker: Mapping[str, float] | None,
    tell: Callable[[Mapping[str, Any]], Told | None],
) -> tuple[list[Panel], str]:
    """Draw a map of three or more axes as panels over two axes, at some values of the others.

    Also returns a text that says which of these values have no panel. `marker` is a point to mark, by its values, and
    `tell` says what is told of cells by their indices.
    """
    x, y, *further = plane_first(axes)
    picked = pick([len(axis.places) for axis in further], MOST_SLICES)
    panels = []
    for positions in product(*picked):
        where = list(zip(further, positions, strict=True))
        cut = {axis.key: int(axis.places[i]) for axis, i in where}
        sliced = replace(colouring, numbers=colouring.numbers.isel(cut), codes=colouring.codes.isel(cut))
        elsewhere = marker and any(
            axis.key in marker and axis.position(marker[axis.key]) != axis.positions[i] for axis, i in where
        )
        title = ", ".join(axis.text(i) for axis, i in where)
        panels.append(_cells(x, y, sliced, None if elsewhere else marker, title, tell, cut))
    left_out = [_left_out(axis, indices) for axis, indices in zip(further, picked, strict=True)]
    return panels, " ".join(text for text in left_out if text)


def _left_out(axis: CellAxis, indices: np.ndarray) -> str:
    """Say which values of an axis have no panel; `indices` are those that have one.

    The text is empty if all values have a panel.
    """
    missing = [i for i in range(len(axis.places)) if i not in indices]
    if not missing:
        return ""
    texts = [axis.text(i).removeprefix(f"{axis.quantity} ") for i in missing]
    listed = ", ".join(texts) if len(texts) <= MOST_LISTED else f"{len(texts)} values from {texts[0]} to {texts[-1]}"
    return f"Not shown: {axis.quantity} {listed}."


def _line(x: CellAxis, colouring: Look, told: Told | None) -> Panel:
    """Draw a map with a single axis as a line, with patches where the variable has no number.

    A variable of words becomes rows of points. `told` is what is told of each cell.
    """
    numbers, codes = (np.asarray(array.values)[x.places] for array in (colouring.numbers, colouring.codes))
    occurring = [i for i in range(len(colouring.categories)) if np.any(codes == i)]
    if not np.isfinite(numbers).any():
        return _rows(x, colouring, codes, occurring, told)
    low, high = float(np.nanmin(numbers)), float(np.nanmax(numbers))
    span = (high - low) or abs(high) or 1.0
    markers = [Markers(x.positions, numbers, "", BLUE, told=told)]
    for i in occurring:
        where = x.positions[codes == i]
        below = low * (low / high) ** 0.06 if colouring.log else low - 0.08 * span
        markers.append(
            Markers(
                where,
                np.full(len(where), below),
                colouring.categories[i].label,
                colouring.categories[i].colour,
                "patch",
                told and told.of(codes == i),
            )
        )
    return Panel(
        "",
        x.axis(None),
        Axis(colouring.quantity, colouring.unit, log=colouring.log),
        (Series(x.positions, numbers, colouring.quantity, BLUE),),
        tuple(markers),
    )


def _rows(x: CellAxis, colouring: Look, codes: np.ndarray, occurring: list[int], told: Told | None) -> Panel:
    """Draw a map with a single axis: one row of points for each word, such as "hunts".

    `codes` holds the index of each cell's word, `occurring` the indices of the words that occur, and `told` what is
    told of each cell.
    """
    names = tuple(colouring.categories[i].label for i in occurring)
    markers = tuple(
        Markers(
            x.positions[codes == i],
            np.full(int(np.sum(codes == i)), float(row)),
            "",
            colouring.categories[i].colour,
            "patch",
            told and told.of(codes == i),
        )
        for row, i in enumerate(occurring)
    )
    return Panel("", x.axis(None), Axis(colouring.quantity, "", (-0.5, len(names) - 0.5), words=names), markers=markers)


def _samples(
    axes: tuple[CellAxis, ...], colouring: Look, marker: Mapping[str, float] | None, told: Told | None
) -> tuple[list[Panel], str]:
    """Draw samples as points over the first two of their keys.

    Also returns a text that names the other keys that were sampled. `marker` is a point to mark, by its values, and
    `told` what is told of each sample.
    """
    if len(axes) < 2:
        raise ValueError(f"map: got samples of {len(axes)} key, expected at least two")
    x, y, *further = axes
    numbers, codes = colouring.numbers.values, colouring.codes.values
    cloud = Cloud(x.positions, y.positions, numbers, *colouring.scale, codes, told=told)
    panel = Panel("", x.axis(None), y.axis(None), markers=_marked(marker, x, y), clouds=(cloud,))
    also = ", ".join(axis.quantity for axis in further)
    return [panel], f"Sampled as well: {also}." if also else ""
