"""Draw maps and clouds on paper, colour bars, and legend and note of every figure."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PathCollection, QuadMesh
from matplotlib.colors import Colormap, LinearSegmentedColormap, ListedColormap, Normalize
from matplotlib.figure import Figure as Canvas
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from friso.shown.drawing.colours import ColourScale, painted, scale
from friso.shown.drawing.drawable import LegendEntry, cell_edges, legend_entries
from friso.shown.drawing.figure import Array, Coloured, Figure, Map, Markers, Panel, Series
from friso.shown.drawing.palette import GREY, INK

LINE_HEIGHT = 0.17  # [inch] one line of the legend or the note
LETTERS_PER_INCH = 15.5  # to the inch, at their size
MOST_VECTORS = 1000  # more cells become a picture inside an SVG or PDF, which else is slow to draw and to open


def draw_coloured(axes: Axes, panel: Panel) -> None:
    """Draw the maps and clouds of a panel: numbers first, then categories."""
    for field in panel.coloured:
        colour_scale = scale(field)
        _add(axes, panel, field, painted(field), _colour_map(colour_scale), (colour_scale.low, colour_scale.high))
        if field.codes is not None and field.categories:
            categories = ListedColormap([category.colour for category in field.categories])
            _add(axes, panel, field, field.codes, categories, (-0.5, len(field.categories) - 0.5))
    if panel.maps:
        axes.grid(visible=False)


def _add(
    axes: Axes, panel: Panel, field: Coloured, values: Array, colours: Colormap, limits: tuple[float, float]
) -> QuadMesh | PathCollection:
    """Draw the numbers or the categories of a map or cloud; places without one stay empty."""
    style = {"cmap": colours, "norm": Normalize(*limits), "rasterized": np.size(values) > MOST_VECTORS}
    if isinstance(field, Map):
        x, y = cell_edges(field.x, log=panel.x.log), cell_edges(field.y, log=panel.y.log)
        # without them SVG shows white hairlines
        seams = {} if style["rasterized"] else {"edgecolors": "face", "linewidth": 0.2}
        return axes.pcolormesh(x, y, np.ma.masked_invalid(values), **seams, **style)
    finite = np.isfinite(values)
    edge = {"s": 20, "linewidths": 0.3, "edgecolors": GREY}
    return axes.scatter(field.x[finite], field.y[finite], c=values[finite], **edge, **style)


def add_colour_bars(canvas: Canvas, axes: Sequence[Axes], panels: Sequence[Panel]) -> None:
    """Add a colour bar to every panel that shows numbers, or one bar if all share one scale."""
    fields = {i: field for i, panel in enumerate(panels) for field in panel.coloured if field.has_numbers}
    bars = {i: (scale(field), field.label) for i, field in fields.items()}
    if len(set(bars.values())) == 1:
        shared = [axes[i] for i, panel in enumerate(panels) if panel.coloured]
        _bar(canvas, shared, *next(iter(bars.values())))
        return
    for i, (colour_scale, label) in bars.items():
        _bar(canvas, [axes[i]], colour_scale, label)


def _bar(canvas: Canvas, axes: list[Axes], colour_scale: ColourScale, label: str) -> None:
    """Add a colour bar with its ticks and label."""
    mappable = ScalarMappable(Normalize(colour_scale.low, colour_scale.high), _colour_map(colour_scale))
    bar = canvas.colorbar(
        mappable, ax=axes, ticks=list(colour_scale.ticks) or None, fraction=0.05, pad=0.015, aspect=28
    )
    if colour_scale.texts:
        bar.set_ticklabels(list(colour_scale.texts))
    bar.minorticks_off()
    bar.set_label(label, parse_math=False)


def _colour_map(colour_scale: ColourScale) -> Colormap:
    """Return the colours of a scale as matplotlib takes them."""
    if colour_scale.steps:
        return ListedColormap(list(colour_scale.colours))
    return LinearSegmentedColormap.from_list("friso", list(colour_scale.colours))


def note_lines(figure: Figure, width: float) -> list[str]:
    """Return the note of a figure in lines that fit into `width` [inch]."""
    return [
        line for part in figure.note.splitlines() for line in textwrap.wrap(part, int(LETTERS_PER_INCH * (width - 0.3)))
    ]


def footer_height(figure: Figure, width: float) -> float:
    """Return the height [inch] that legend and note take beneath the panels."""
    rows = _key_rows(figure, width) + len(note_lines(figure, width))
    return LINE_HEIGHT * rows + 0.08 if rows else 0.0


def add_footer(
    canvas: Canvas, figure: Figure, symbols: dict[str, dict[str, Any]], dashes: dict[str, Any], width: float
) -> None:
    """Draw the legend of a figure, and the note below it.

    Both stand in the strip that `footer_height` reserved.
    """
    height = float(canvas.get_figheight())
    lines = note_lines(figure, width)
    if handles := legend_handles(figure, symbols, dashes):
        place = {"loc": "lower left", "bbox_to_anchor": (0.006, (LINE_HEIGHT * len(lines) + 0.03) / height)}
        columns = -(-len(handles) // _key_rows(figure, width))
        legend = canvas.legend(
            handles=handles,
            ncols=columns,
            columnspacing=1.4,
            labelspacing=0.25,
            borderaxespad=0,
            borderpad=0.1,
            **place,
        )
        legend.set_in_layout(False)
        for text in legend.get_texts():
            text.set_parse_math(False)
    for number, line in enumerate(reversed(lines)):
        y = (LINE_HEIGHT * number + 0.06) / height
        canvas.text(0.01, y, line, fontsize=8, color=INK, parse_math=False, in_layout=False)


def legend_handles(figure: Figure, symbols: dict[str, dict[str, Any]], dashes: dict[str, Any]) -> list[Patch | Line2D]:
    """Return what stands beside the labels of a figure's legend."""

    def handle(item: LegendEntry) -> Patch | Line2D:
        """Return a line, a point or a patch of colour."""
        if isinstance(item, Series):
            style = {"linestyle": dashes[item.dash], "linewidth": item.width}
            return Line2D([], [], label=item.label, color=item.colour, **style)
        if isinstance(item, Markers):
            return Line2D([], [], linestyle="none", label=item.label, color=item.colour, **symbols[item.symbol])
        return Patch(facecolor=item.colour, edgecolor=GREY, linewidth=0.6, label=item.label)

    return [handle(item) for item in legend_entries(figure)]


def _key_rows(figure: Figure, width: float) -> int:
    """Return the number of rows of the legend, in columns as wide as the longest entry.

    It is 0 without entries. `width` [inch] is that of the figure.
    """
    labels = [item.label for item in legend_entries(figure)]
    if not labels:
        return 0
    columns = max(1, int(LETTERS_PER_INCH * (width - 0.3) / (max(map(len, labels)) + 8)))
    return -(-len(labels) // columns)
