"""Mark machines in a figure over two keys, at the values that they have."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import xarray as xr

from friso.errors import InputError
from friso.shown.drawing.figure import GREY, INK, Axis, Figure, Markers, Panel
from friso.stage import Stage, loads
from friso.studies.axes import SCALINGS

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
