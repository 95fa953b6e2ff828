"""Draw figures on a page: interactive HTML through plotly, readable without a network.

A page holds plotly's script once (`script()`) and any number of fragments (`fragment(figure)`). Their elements are
named after the figure, so that equal figures give equal bytes. Both are compressed; `page.js` unpacks and draws them in
the browser.

Maps and clouds have colour bars, and every figure has its legend and note beneath.
"""

from __future__ import annotations

import base64
import gzip
import html
import json
import math
import textwrap
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import plotly.graph_objects as go
from plotly.offline import get_plotlyjs

from friso.shown.drawing.drawable import (
    SIDES,
    LegendEntry,
    cell_edges,
    drawable,
    legend_entries,
    log_ticks,
    second_ticks,
    with_fewer_cells,
    word_ticks,
)
from friso.shown.drawing.figure import (
    DARK,
    GREY,
    INK,
    Area,
    Array,
    Arrow,
    Axis,
    Band,
    Coloured,
    ColourScale,
    Figure,
    Lettering,
    Map,
    Markers,
    Panel,
    Series,
    Told,
    painted,
    scale,
)

GZIP_LEVEL = 6
"""Level of gzip. The highest level takes half as long again and saves two thousandths of the size."""


def packed(text: str) -> str:
    """Return a text compressed by gzip, in base64; equal texts give equal bytes."""
    return base64.b64encode(gzip.compress(text.encode(), GZIP_LEVEL, mtime=0)).decode("ascii")


def packed_json(value: object) -> str:
    """Return a value as packed JSON. Raises ValueError for a number that is not finite."""
    return packed(json.dumps(value, separators=(",", ":"), allow_nan=False))


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


def map_footer(figure: Figure, width: int) -> tuple[int, dict[str, Any], list[dict[str, Any]]]:
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


WIDE_PAGE_WIDTH, NARROW_PAGE_WIDTH = (
    540,
    290,
)  # [px] for all columns of axes: the least of a wide page, and of a telephone
TITLE_HEIGHT, ROW_SPACE = 17, 18  # [px] a line of the title, and what lies about it
TITLE_LETTER, TICK_LETTER = 7.6, 5.9  # [px] one letter of it, and of a word at an axis
PLOT_HEIGHT = 230  # [px] height of the axes
MAP_PLOTS = {1: 430, 2: 320}  # [px] the same of one or two columns of maps: both axes matter equally
EQUAL_PLOTS = {1: 520, 2: 290}  # [px] the same of panels with equal scales
FOOTER_HEIGHT = 54  # [px] tick labels and axis label
LEFT_MARGIN, RIGHT_MARGIN, TOP_MARGIN = 72, 14, 26  # [px]; the buttons stand in the top margin
COLUMN_GAP = 0.09  # between two panels of a row, as a fraction of the width

# The buttons are listed, since plotly's own choice has one that sends the data to a server.
_BUTTONS = [["toImage"], ["zoom2d", "pan2d"], ["zoomIn2d", "zoomOut2d", "resetScale2d"]]
_CONFIG = {
    "displaylogo": False,
    "responsive": False,  # page.js resizes
    "modeBarButtons": _BUTTONS,
    "showSendToCloud": False,
    "plotlyServerURL": "",
}


@cache
def script() -> str:
    """Return plotly.js of the installed package, packed, to be placed once in a page."""
    return packed(get_plotlyjs())


def fragment(figure: Figure) -> str:
    """Return the figure as an HTML element with its packed data.

    The data hold what plotly draws, and the layout and places of colour bars on a narrow screen.
    """
    narrow = narrow_parts(figure)  # traces differ only in the places of colour bars
    narrow["layout"] = _checked([], narrow["layout"]).to_plotly_json()["layout"]
    drawn = _on_both(render(figure).to_plotly_json(), narrow)
    return (
        f'<div id="figure-{figure.name}" style="height: {drawn["layout"]["height"]}px"></div>\n'
        f'<script type="application/gzip" class="figure">{packed_json({**_single(drawn), "config": _CONFIG})}</script>'
    )


def parts_of_both(figure: Figure) -> dict[str, Any]:
    """Return `parts`, with the layout and colour bars that differ on a narrow screen."""
    prepared = drawable(with_fewer_cells(figure))
    return _on_both(_laid_out(prepared, WIDE_PAGE_WIDTH), _laid_out(replace(prepared, columns=1), NARROW_PAGE_WIDTH))


def _on_both(wide: dict[str, Any], narrow: dict[str, Any]) -> dict[str, Any]:
    """Return the wide figure with what is different on a narrow screen."""
    return {**wide, "narrow": narrow["layout"], "bars": [_bar(trace) for trace in narrow["data"]]}


def _bar(trace: dict[str, Any]) -> dict[str, Any] | None:
    """Return the place of a trace's colour bar, or None."""
    bar = trace.get("colorbar") or trace.get("marker", {}).get("colorbar")
    return {name: bar[name] for name in ("x", "y", "len")} if bar else None


def _single(part: Any) -> Any:
    """Return arrays in single precision, which is enough for a screen and half as long.

    The first bytes of all numbers come before the second bytes, and so on, which packs better; `page.js` puts them
    together. Numbers that are not finite become null.
    """
    if isinstance(part, dict) and part.get("dtype") == "f8":
        numbers = np.frombuffer(base64.b64decode(part["bdata"]), "<f8").astype("<f4")
        planes = base64.b64encode(numbers.view(np.uint8).reshape(-1, 4).T.tobytes()).decode("ascii")
        return {"planes": planes, "shape": part.get("shape", "")}
    if isinstance(part, dict):
        return {name: _single(value) for name, value in part.items()}
    if isinstance(part, list | tuple | np.ndarray):  # plotly leaves an empty array as it is
        return [_single(value) for value in (part.tolist() if isinstance(part, np.ndarray) else part)]
    return None if isinstance(part, float) and not math.isfinite(part) else part


def render(figure: Figure) -> go.Figure:
    """Return the figure for plotly, with the arrays of `drawable(figure)` in order."""
    plain = parts(figure)
    return _checked(plain["data"], plain["layout"])


def _checked(traces: list[Any], layout: dict[str, Any]) -> go.Figure:
    """Build a plotly figure, which validates the traces."""
    return go.Figure(traces, {"template": "none", **layout})


def narrow_parts(figure: Figure) -> dict[str, Any]:
    """Return traces and layout for a narrow screen, with panels one below the other."""
    return parts(replace(figure, columns=1), NARROW_PAGE_WIDTH)


def parts(figure: Figure, width: int = WIDE_PAGE_WIDTH) -> dict[str, Any]:
    """Return traces and layout as plain dictionaries that hold NumPy arrays.

    Plotly does not validate them, because that would take ten times as long as making them. `width` is the least width
    [px] for the axes of all columns.
    """
    return _laid_out(drawable(with_fewer_cells(figure)), width)


def _laid_out(prepared: Figure, width: int) -> dict[str, Any]:
    """Lay out the panels of a figure, with legend, colour bars and note."""
    plot = _plot_height(prepared, width)
    letters = int(width // prepared.columns / TITLE_LETTER)
    heads = [textwrap.wrap(panel.title, letters) for panel in prepared.panels]
    rows = [heads[k : k + prepared.columns] for k in range(0, len(heads), prepared.columns)]
    headers = [TITLE_HEIGHT * max(map(len, row)) + ROW_SPACE for row in rows]
    footer = FOOTER_HEIGHT + max(_upright(panel.x, width // prepared.columns) for panel in prepared.panels)
    height = sum(headers) + (plot + footer) * len(rows)
    below, legend, note = map_footer(prepared, width)
    top_margin = TOP_MARGIN + FOOTER_HEIGHT * any(panel.x.second is not None for panel in prepared.panels)
    right_margin = FOOTER_HEIGHT if any(panel.y.second is not None for panel in prepared.panels) else RIGHT_MARGIN
    layout: dict[str, Any] = {
        "height": height + top_margin + below,
        "margin": {"l": LEFT_MARGIN, "r": right_margin, "t": top_margin, "b": below},
        "font": {"family": "system-ui, sans-serif", "size": 12, "color": INK},
        "hovermode": "closest",
        "meta": {"dark": DARK},
        "annotations": note,
        **legend,
    }
    traces: list[Any] = []
    links: dict[Axis, str] = {}
    with_bar, shared_bar = bar_panels(prepared.panels)
    for number, panel in enumerate(prepared.panels):
        above = number // prepared.columns
        top = height - sum(headers[: above + 1]) - (plot + footer) * above
        y_domain = ((top - plot) / height, top / height)
        x_domain = _columns(number % prepared.columns, prepared.columns)
        bar = None
        if shared_bar and number in with_bar:
            bar = {
                "x": 1.0,
                "y": (footer + height - headers[0]) / 2 / height,
                "len": 1 - (footer + headers[0]) / height,
            }
        elif number in with_bar:
            x_domain = (x_domain[0], x_domain[1] - BAR_WIDTH_SHARE)
            bar = {"x": x_domain[1], "y": sum(y_domain) / 2, "len": y_domain[1] - y_domain[0]}
        _add_panel(layout, panel, number, x_domain, y_domain, links)
        if heads[number]:
            layout["annotations"].append(_title(heads[number], x_domain[0], y_domain[1]))
        traces += _traces(panel, number, bar)
    return {"data": traces + key_traces(prepared), "layout": layout}


def _upright(axis: Axis, width: int) -> int:
    """Return how much higher words at an axis of some width [px] stand if they do not fit side by side, and are turned.

    Plotly turns them.
    """
    words = word_ticks(axis)[1] if axis.words else []
    longest = max((len(line) for word in words for line in word.splitlines()), default=0)
    fits = longest * TICK_LETTER * len(words) <= width
    return 0 if fits else max(0, round(longest * TICK_LETTER) - FOOTER_HEIGHT // 2)


def _title(lines: Sequence[str], left: float, top: float) -> dict[str, Any]:
    """Return the title of a panel in bold, above axes whose upper left corner is at `left` and `top`.

    These are fractions of the figure.
    """
    text = {"text": f"<b>{'<br>'.join(map(html.escape, lines))}</b>", "font": {"size": 13}, "align": "left"}
    place = {"x": left, "xref": "paper", "xanchor": "left", "y": top, "yref": "paper", "yanchor": "bottom"}
    return {**text, "showarrow": False, **place, "yshift": ROW_SPACE - 12}


def _plot_height(figure: Figure, width: int) -> int:
    """Return the height of the axes of a panel [px]."""
    if any(panel.equal for panel in figure.panels):
        return min(EQUAL_PLOTS.get(figure.columns, PLOT_HEIGHT), max(width, PLOT_HEIGHT))
    mapped = any(panel.coloured for panel in figure.panels)
    return MAP_PLOTS.get(figure.columns, PLOT_HEIGHT) if mapped else PLOT_HEIGHT


def _columns(column: int, columns: int) -> tuple[float, float]:
    """Return the left and right end of column number `column` as fractions of the width."""
    width = (1 - COLUMN_GAP * (columns - 1)) / columns
    left = column * (width + COLUMN_GAP)
    return left, min(1.0, left + width)


def _add_panel(
    layout: dict[str, Any],
    panel: Panel,
    number: int,
    x_domain: tuple[float, float],
    y_domain: tuple[float, float],
    links: dict[Axis, str],
) -> None:
    """Add the axes of a panel; panels with equal x axes are zoomed together.

    `x_domain` and `y_domain` are the place of the panel, as fractions of the figure.
    """
    suffix = _suffix(number)
    shape = {"constrain": "domain"} if panel.equal else {}
    x_axis = _axis(panel.x) | {"domain": x_domain, "anchor": f"y{suffix}"} | shape
    if panel.x in links:
        x_axis["matches"] = links[panel.x]
    links.setdefault(panel.x, f"x{suffix}")
    layout[f"xaxis{suffix}"] = x_axis
    shape |= {"scaleanchor": f"x{suffix}"} if panel.equal else {}
    layout[f"yaxis{suffix}"] = _axis(panel.y) | {"domain": y_domain, "anchor": f"x{suffix}"} | shape
    layout["annotations"] += [_arrow(arrow, panel, suffix) for arrow in panel.arrows]
    layout["annotations"] += [_lettering(item, panel, suffix) for item in panel.words]
    for letter, axis, side in (("x", panel.x, "top"), ("y", panel.y, "right")):
        if axis.second is not None:
            main = f"{letter}axis{suffix}"
            other = {"x": f"y{suffix}", "y": f"x{suffix}"}[letter]
            layout[f"{letter}axis{SECOND}{number + 1}"] = _second(axis, layout[main]) | {
                "overlaying": f"{letter}{suffix}", "matches": f"{letter}{suffix}", "side": side, "anchor": other,
            }  # fmt: skip


SECOND = "9"
"""First digit of the numbers of second scales, which no panel's own axes have."""


def _second(axis: Axis, settings: dict[str, Any]) -> dict[str, Any]:
    """Return the settings of the second scale of an axis, from those of the axis itself."""
    assert axis.second is not None
    places, texts = second_ticks(axis)
    title = {"text": html.escape(axis.second.label), "standoff": 8}
    ticks = {"title": title, "tickmode": "array", "tickvals": places, "ticktext": texts, "showgrid": False}
    return {**settings, **ticks}


def _at(value: float, axis: Axis) -> float:
    """Return where a value lies on an axis for an annotation: its logarithm on a logarithmic one."""
    return math.log10(value) if axis.log else value


def _arrow(arrow: Arrow, panel: Panel, suffix: str) -> dict[str, Any]:
    """Return an arrow as an annotation without text, on the axes of a panel."""
    (ax, ay), (x, y) = ((_at(at[0], panel.x), _at(at[1], panel.y)) for at in (arrow.start, arrow.end))
    refs = {"xref": f"x{suffix}", "axref": f"x{suffix}", "yref": f"y{suffix}", "ayref": f"y{suffix}"}
    style = {"showarrow": True, "arrowhead": 2, "arrowwidth": 2, "arrowcolor": arrow.colour, "text": ""}
    return {"x": x, "y": y, "ax": ax, "ay": ay, **refs, **style}


def _lettering(item: Lettering, panel: Panel, suffix: str) -> dict[str, Any]:
    """Return words as an annotation, on the axes of a panel."""
    across, up, right, above = SIDES[item.side]
    text = "<br>".join(f"<b>{html.escape(line)}</b>" for line in item.text.splitlines())
    place = {"x": _at(item.x, panel.x), "y": _at(item.y, panel.y), "xref": f"x{suffix}", "yref": f"y{suffix}"}
    shift = {"xanchor": across, "yanchor": {"center": "middle"}.get(up, up), "xshift": right, "yshift": above}
    shift |= {"bgcolor": item.ground, "borderpad": 1} if item.ground else {}
    return {"text": text, "showarrow": False, "font": {"color": item.colour}, **place, **shift}


def _axis(axis: Axis) -> dict[str, Any]:
    """Return the settings of an axis as plotly takes them: scale, ticks, words and range."""
    settings: dict[str, Any] = {
        "title": {"text": html.escape(axis.label), "standoff": 8},
        "type": "log" if axis.log else "linear",
        "exponentformat": "power" if axis.log else "none",
        "gridcolor": "#e3e3e3",
        "zeroline": False,
        "showline": True,
        "linecolor": GREY,
        "ticks": "outside",
        "tickcolor": GREY,
    }
    if axis.words:
        positions, words = word_ticks(axis)
        texts = [html.escape(word).replace("\n", "<br>") for word in words]
        settings |= {"tickmode": "array", "tickvals": positions, "ticktext": texts}
        settings["automargin"] = True  # words may have any length
    if axis.log:
        settings |= _log_ticks(axis.limits)
    if axis.step:
        settings |= {"tick0": 0, "dtick": axis.step}
    if axis.limits:
        settings["range"] = [math.log10(limit) for limit in axis.limits] if axis.log else list(axis.limits)
    return settings


def _log_ticks(limits: tuple[float, float] | None) -> dict[str, Any]:
    """Return the ticks of a logarithmic axis.

    Ticks stand at decades, and at 2 and 5 or more numbers between them if decades are too few. Plotly itself would
    write 0.5 as "5". If all these are too few, there are about five round numbers.
    """
    decades = math.log10(limits[1] / limits[0]) if limits else math.inf
    if limits is None or decades >= 2:
        return {"dtick": 1}
    values = log_ticks(*limits)
    return {"tickmode": "array", "tickvals": values, "ticktext": [f"{value:.10g}" for value in values]}


def _traces(panel: Panel, number: int, bar: dict[str, Any] | None) -> list[Any]:
    """Return what is drawn in a panel in the order of `drawable`, maps first."""
    suffix = _suffix(number)
    place = {"xaxis": f"x{suffix}", "yaxis": f"y{suffix}"}
    unnamed = place | {"showlegend": False}
    seconds = [
        {
            "type": "scatter",
            "x": [None],
            "y": [None],
            "showlegend": False,
            **place,
            f"{letter}axis": f"{letter}{SECOND}{number + 1}",
        }
        for letter, axis in (("x", panel.x), ("y", panel.y))
        if axis.second is not None
    ]  # an axis without any trace is not drawn
    return [
        *seconds,
        *coloured_traces(panel, place, bar),
        *(_filled(area, place) for area in panel.areas),
        *(_area(band, unnamed) for band in panel.bands),
        *(_line(line, panel, unnamed) for line in panel.series),
        *(_points(marker, panel, unnamed) for marker in panel.markers),
    ]


def _filled(area: Area, place: dict[str, Any]) -> dict[str, Any]:
    """Return the trace of filled rings, on the axes in `place`."""
    style: dict[str, Any] = {"mode": "lines", "line": {"width": 0}, "fill": "toself", "fillcolor": area.colour}
    if area.hatched:
        style |= {
            "fillpattern": {
                "shape": "/",
                "fgcolor": area.colour,
                "bgcolor": "rgba(0,0,0,0)",
                "size": 9,
                "solidity": 0.16,
            }
        }
        style["fillcolor"] = "rgba(0,0,0,0)"
    return {"type": "scatter", "x": area.x, "y": area.y, "hoverinfo": "skip", "showlegend": False, **style, **place}


def _area(band: Band, place: dict[str, Any]) -> dict[str, Any]:
    """Return the trace of a filled band, on the axes in `place`."""
    x, y = band.outline
    style = {"mode": "lines", "line": {"width": 0}, "fill": "toself", "fillcolor": band.colour, "hoverinfo": "skip"}
    return {"type": "scatter", "x": x, "y": y, "name": html.escape(band.label), **style, **place}


def _line(line: Series, panel: Panel, place: dict[str, Any]) -> dict[str, Any]:
    """Return the trace of a line, on the axes in `place`."""
    style = {"color": line.colour, "width": line.width, "dash": DASHES[line.dash], "simplify": False}
    drawn = {"type": "scatter", "x": line.x, "y": line.y, "mode": "lines", "line": style, "connectgaps": False}
    return {**drawn, **_text(line.label, panel), **place}


def _points(marker: Markers, panel: Panel, place: dict[str, Any]) -> dict[str, Any]:
    """Return the trace of single points, on the axes in `place`."""
    style = {"color": marker.colour, **SYMBOLS[marker.symbol]}
    drawn = {"type": "scatter", "x": marker.x, "y": marker.y, "mode": "markers", "marker": style}
    return {**drawn, **_text(marker.label, panel, marker.told), **told_each(marker.told), **place}


def _text(label: str, panel: Panel, told: Told | None = None) -> dict[str, Any]:
    """Return name and hover text of a line; plotly reads both as HTML."""
    x_unit, y_unit = html.escape(panel.x.unit), html.escape(panel.y.unit)
    hover = f"%{{x:.5~g}} {x_unit}, %{{y:.5~g}} {y_unit}"
    return {"name": html.escape(label), "hovertemplate": hover + told_text(told)}


def _suffix(number: int) -> str:
    """Return the number that plotly adds to an axis: x, x2, x3, ..."""
    return "" if number == 0 else str(number + 1)
