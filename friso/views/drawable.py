"""From a figure in SI units to the arrays that are drawn: prefixed, thinned, limits laid out.

Both renderers start here, so that they draw the same arrays.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from friso.views.figure import Array, Axis, Figure, Limit, Map, Markers, Panel, Series
from friso.views.prefixes import choose
from friso.views.thinning import thin


def drawable(figure: Figure) -> Figure:
    """The figure with prefixed units, thinned series, limits as series, and markers that can be drawn."""
    return replace(figure, panels=tuple(_panel(panel) for panel in figure.panels))


def _panel(panel: Panel) -> Panel:
    limits = _finite([value for limit in panel.limits for value in limit.values])
    xs = _gather(panel.x, [item.x for item in (*panel.series, *panel.markers, *panel.maps)])
    ys = _gather(panel.y, [item.y for item in (*panel.series, *panel.markers, *panel.maps)])
    x_factor, x_unit = choose(xs, panel.x.unit, log=panel.x.log)
    y_factor, y_unit = choose(ys if panel.y.limits else np.concatenate((ys, limits)), panel.y.unit, log=panel.y.log)
    extent = (float(xs.min()), float(xs.max())) if xs.size else (0.0, 1.0)
    lines = [_thinned(line) for line in panel.series] + [_limit(limit, extent) for limit in panel.limits]
    return Panel(
        title=panel.title,
        x=_axis(panel.x, x_factor, x_unit),
        y=_axis(panel.y, y_factor, y_unit),
        series=tuple(replace(line, x=line.x * x_factor, y=line.y * y_factor) for line in lines),
        markers=tuple(_markers(marker, x_factor, y_factor) for marker in panel.markers),
        maps=tuple(_map(field, x_factor, y_factor) for field in panel.maps),
    )


def _gather(axis: Axis, arrays: Iterable[Array]) -> Array:
    """The values that decide the prefix of an axis: its limits when given, else all finite data."""
    if axis.limits is not None:
        return np.array(axis.limits)
    values = _finite(np.concatenate([np.empty(0), *(np.asarray(array, dtype=float) for array in arrays)]))
    return values[values > 0] if axis.log else values


def _finite(values: Iterable[float] | Array) -> Array:
    array = np.asarray(values, dtype=float)
    return array[np.isfinite(array)]


def _axis(axis: Axis, factor: float, unit: str) -> Axis:
    limits = None if axis.limits is None else (axis.limits[0] * factor, axis.limits[1] * factor)
    return replace(axis, unit=unit, limits=limits)


def _thinned(line: Series) -> Series:
    """A broken or infinite sample becomes a gap in both directions; then the line is thinned."""
    broken = ~(np.isfinite(line.x) & np.isfinite(line.y))
    x, y = np.where(broken, np.nan, line.x), np.where(broken, np.nan, line.y)
    x, y = thin(x, y)
    return replace(line, x=x, y=y)


def _limit(limit: Limit, extent: tuple[float, float]) -> Series:
    """All lines of a limit as one series, with gaps between them."""
    x = np.array([*extent, np.nan] * len(limit.values))
    y = np.array([entry for value in limit.values for entry in (value, value, np.nan)])
    return Series(x, y, limit.label, limit.colour, limit.dash, width=1.0)


def _markers(markers: Markers, x_factor: float, y_factor: float) -> Markers:
    shown = np.isfinite(markers.x) & np.isfinite(markers.y)
    return replace(markers, x=markers.x[shown] * x_factor, y=markers.y[shown] * y_factor)


def _map(field: Map, x_factor: float, y_factor: float) -> Map:
    z = np.where(np.isfinite(field.z), field.z, np.nan)
    factor, unit = choose(z, field.unit)
    return replace(field, x=field.x * x_factor, y=field.y * y_factor, z=z * factor, unit=unit)
