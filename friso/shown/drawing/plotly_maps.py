"""Draw maps and clouds on a page, colour bars, and legend and note beneath every figure."""

from __future__ import annotations

import html
import math
import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np

from friso.shown.drawing.colours import ColourScale, painted, scale
from friso.shown.drawing.drawable import LegendEntry, cell_edges, legend_entries
from friso.shown.drawing.figure import Array, Axis, Coloured, Figure, Map, Markers, Panel, Series, Told
from friso.shown.drawing.palette import GREY, INK

BAR_WIDTH_SHARE = 0.085  # width of a panel's own colour bar with its numbers and label, as a fraction of the width
LINE_HEIGHT = 17  # [px] one line of the note
KEY_ROW, KEY_SPACE = 19, 11  # [px] a row of a legend, and what lies about the one beneath a figure
KEY_LETTER, KEY_MARK = 6.6, 45  # [px] one letter of a legend, and the sign of an entry
LETTER_WIDTH = 6.1  # [px] of the note
TOLD_LETTERS = 30  # letters in a line of what is told under the mouse, for which a telephone has room

DASHES = {"solid": "solid", "dashed": "6px,4px", "dotted": "2px,3px"}
SYMBOLS: dict[str, dict[str, Any]] = {
    "circle": {"symbol": "circle", "size": 9},
    "triangle": {"symbol": "triangle-down", "size": 9},
    "cross": {"symbol": "x-thin-open", "size": 9},
    "target": {"symbol": "circle", "size": 12, "line": {"color": "white", "width": 2}},
    "patch": {"symbol": "square", "size": 9, "line": {"color": GREY, "width": 1}},
}


def bar_panels(panels: Sequence[Panel]) -> tuple[set[int], bool]:
    """Return the indices of the panels with a colour bar, and whether one bar serves all panels."""
    bars = {
        number: (scale(field), field.label)
        for number, panel in enumerate(panels)
        for field in panel.coloured
        if field.has_numbers
    }
    shared = len(set(bars.values())) == 1 and all(panel.coloured for panel in panels)
    return ({min(bars)} if shared else set(bars)), shared


def coloured_traces(panel: Panel, place: dict[str, Any], bar: dict[str, Any] | None) -> list[Any]:
    """Return the traces of a panel's maps and clouds.

    Numbers with their colour bar come first, then categories.
    """
    traces: list[Any] = []
    for field in panel.coloured:
        colouring = _colouring(scale(field), bar if field.has_numbers else None, field.label)
        traces.append(_layer(panel, field, painted(field), colouring, place))
        if field.codes is not None and field.categories:
            categories = ColourScale(
                -0.5, len(field.categories) - 0.5, tuple(category.colour for category in field.categories), steps=True
            )
            traces.append(_layer(panel, field, field.codes, _colouring(categories, None, ""), place))
    return traces


def _layer(panel: Panel, field: Coloured, values: Array, colouring: dict[str, Any], place: dict[str, Any]) -> Any:
    """Return the trace of a map's or cloud's numbers or categories; cells without one are empty."""
    where = f"{_hover('x', panel.x)}, {_hover('y', panel.y)}"
    if values is not field.codes:
        where += f": %{{customdata:.4~g}} {html.escape(field.unit)}"
    text = {"hovertemplate": f"{where}{told_text(field.told)}<extra></extra>", "showlegend": False}
    if isinstance(field, Map):
        x, y = _cells(field.x, panel.x), _cells(field.y, panel.y)
        numbers_shown = None if values is field.codes else field.z
        cells = {"type": "heatmap", "x": x, "y": y, "z": values, "customdata": numbers_shown}
        cells["hoverongaps"] = False  # numbers and categories have cells of their own
        return {**cells, **colouring, **text, **told_each(field.told), **place}
    numbers_shown = np.isfinite(values)
    names = {"zmin": "cmin", "zmax": "cmax"}
    marker = {names.get(name, name): value for name, value in colouring.items()}
    marker |= {"color": values[numbers_shown], "size": 6, "line": {"color": GREY, "width": 0.4}}
    numbers = {"x": field.x[numbers_shown], "y": field.y[numbers_shown], "customdata": field.z[numbers_shown]}
    numbers |= told_each(field.told and field.told.of(numbers_shown))
    return {"type": "scatter", "mode": "markers", "marker": marker, **numbers, **text, **place}


def told_text(told: Told | None) -> str:
    """Return what is told of a point under the mouse, on lines of its own; "" if nothing is."""
    if told is None:
        return ""
    lines = textwrap.wrap(told.text, TOLD_LETTERS, break_long_words=False, break_on_hyphens=False)
    return "%{text}".join("".join(f"<br>{html.escape(line)}" for line in lines).rsplit("{}", 1))


def told_each(told: Told | None) -> dict[str, Any]:
    """Return the texts of points as plotly takes them."""
    return {} if told is None else {"text": told.each, "hoverlabel": {"align": "left"}}


def _cells(centres: Array, axis: Axis) -> Array:
    """Return the centres of cells along an axis, or the edges of a single cell, for plotly.

    Plotly itself finds the edges between centres, but not those of a single cell.
    """
    return cell_edges(centres, log=axis.log) if len(centres) == 1 else centres


def _hover(name: str, axis: Axis) -> str:
    """Return the text of a coordinate while the mouse is over a cell."""
    return f"%{{{name}}}" if axis.words else f"%{{{name}:.5~g}} {html.escape(axis.unit)}"


def _colouring(colour_scale: ColourScale, bar: dict[str, Any] | None, label: str) -> dict[str, Any]:
    """Return the colours of a trace as plotly takes them, with its colour bar if it has one."""
    colouring = {
        "colorscale": colour_scale.stops,
        "zmin": colour_scale.low,
        "zmax": colour_scale.high,
        "showscale": bar is not None,
    }
    if bar is None:
        return colouring
    ticks = (
        {"tickmode": "array", "tickvals": colour_scale.ticks, "ticktext": colour_scale.texts}
        if colour_scale.ticks
        else {}
    )
    title = {"text": html.escape(label), "side": "right"}
    return colouring | {"colorbar": {"title": title, "thickness": 14, "outlinewidth": 0, **ticks, **bar}}


def key_traces(figure: Figure) -> list[dict[str, Any]]:
    """Return traces without points, which fill the legend of a figure."""

    def style(item: LegendEntry) -> dict[str, Any]:
        """Return a line, a point or a square."""
        if isinstance(item, Series):
            return {"mode": "lines", "line": {"color": item.colour, "width": item.width, "dash": DASHES[item.dash]}}
        square = {"symbol": "square", "size": 11, "line": {"color": GREY, "width": 1}}
        sign = SYMBOLS[item.symbol] if isinstance(item, Markers) else square
        return {"mode": "markers", "marker": sign | {"color": item.colour}}

    unseen = {"type": "scatter", "x": [None], "y": [None]}
    return [{**unseen, "name": html.escape(item.label), **style(item)} for item in legend_entries(figure)]


def key_rows(labels: Sequence[str], width: int) -> int:
    """Count the rows of a legend of some width [px]; columns are as wide as the longest label."""
    entry = KEY_MARK + KEY_LETTER * max(map(len, labels), default=0)
    return math.ceil(len(labels) / max(1, int(width / entry)))


def footer(figure: Figure, width: int) -> tuple[int, dict[str, Any], list[dict[str, Any]]]:
    """Return the area below the panels: its height [px], its legend, and its note.

    The note is broken at a width [px] and given as annotations.
    """
    lines = [line for part in figure.note.splitlines() for line in textwrap.wrap(part, int(width / LETTER_WIDTH))]
    note = LINE_HEIGHT * len(lines) + 6 if lines else 0
    below = {"x": 0, "xanchor": "left", "y": 0, "yanchor": "top", "xref": "paper", "yref": "paper"}
    text = "<br>".join(html.escape(line) for line in lines)
    font = {"size": 11, "color": INK}
    annotations = [{"text": text, "align": "left", "showarrow": False, "font": font, **below}] if lines else []
    labels = [item.label for item in legend_entries(figure)]
    if not labels:
        return note, {}, annotations
    key = KEY_SPACE + KEY_ROW * key_rows(labels, width)
    for annotation in annotations:
        annotation["yshift"] = -key
    style = {"orientation": "h", "x": 0, "xanchor": "left", "y": 0, "yanchor": "top", "itemclick": False}
    return note + key, {"legend": style | {"itemdoubleclick": False, "bgcolor": "rgba(0,0,0,0)"}}, annotations
