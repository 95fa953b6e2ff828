"""Draw figures on paper with matplotlib: PNG, SVG and PDF, with equal bytes on every run.

The user's matplotlibrc does not matter: everything is drawn under matplotlib's defaults and the style below. Texts are
drawn as they stand: a dollar sign in a stage's name starts no formula.

Maps and clouds have colour bars, and every figure has its legend and note.
"""

from __future__ import annotations

import io
import math
import re
import textwrap
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from threading import RLock
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib import ticker
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PathCollection, QuadMesh
from matplotlib.colors import Colormap, LinearSegmentedColormap, ListedColormap, Normalize
from matplotlib.figure import Figure as Canvas
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path
from matplotlib.patheffects import withStroke
from matplotlib.transforms import Bbox

from friso.errors import InputError
from friso.quantities import quoted
from friso.shown.drawing.drawable import (
    SIDES,
    LegendEntry,
    cell_edges,
    drawable,
    legend_entries,
    second_ticks,
    word_ticks,
)
from friso.shown.drawing.figure import (
    GREY,
    IMAGE_FORMATS,
    INK,
    Area,
    Array,
    Axis,
    Coloured,
    ColourScale,
    Figure,
    Map,
    Markers,
    Panel,
    Series,
    painted,
    scale,
)

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


FIGURE_WIDTH = 9.0  # [inch]
ROW_HEIGHT = 2.7  # [inch] axes, labels and title of one row of panels
MAP_HEIGHTS = {1: 4.9, 2: 3.7}  # [inch] the same of one or two columns of maps: both axes matter equally
EQUAL_HEIGHTS = {1: 5.9, 2: 3.6}  # [inch] the same of panels with equal scales, which need height for their width
HEADER_HEIGHT, HEADER_LINE = 0.35, 0.19  # [inch] the figure's own title, and each further line of it
HEADER_LETTERS = 82  # letters of a line of this title
DOTS_PER_INCH, FINER_FACTOR = 150, 2  # and how many times as many dots where a file of lines holds a picture

# No dates and no version numbers in the files, so that a rerun gives the same bytes.
_METADATA = {
    "png": {"Software": None},
    "svg": {"Date": None, "Creator": None},
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}
_STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",  # comes with matplotlib
    "font.size": 9,
    "axes.titlesize": 9.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 9,
    "axes.labelcolor": INK,
    "axes.edgecolor": GREY,
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.xmargin": 0.01,
    "axes.ymargin": 0.06,
    "grid.color": "#e3e3e3",
    "grid.linewidth": 0.7,
    "xtick.color": GREY,
    "ytick.color": GREY,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "lines.solid_joinstyle": "round",
    "svg.hashsalt": "friso",
    "svg.fonttype": "path",
    "pdf.fonttype": 42,
}
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_DASHES = {"solid": "-", "dashed": (0, (5, 2.5)), "dotted": (0, (1.2, 1.6))}
_SYMBOLS: dict[str, dict[str, Any]] = {
    "circle": {"marker": "o", "markersize": 6},
    "triangle": {"marker": "v", "markersize": 6},
    "cross": {"marker": "x", "markersize": 6},
    "target": {"marker": "o", "markersize": 9, "markeredgecolor": "white", "markeredgewidth": 1.6},
    "patch": {"marker": "s", "markersize": 6, "markeredgecolor": GREY, "markeredgewidth": 0.6},
}


def render(figure: Figure) -> Canvas:
    """Draw a figure on a matplotlib canvas.

    The lines on the canvas carry the arrays of `drawable(figure)`, in that order.
    """
    with _style():
        prepared = drawable(figure)
        heading = ": ".join(text for text in (prepared.subject, prepared.title) if text)
        unbroken = re.sub(r"(?<=\d) ", "\N{NO-BREAK SPACE}", heading)  # numbers keep their units
        heading = "\n".join(textwrap.wrap(unbroken, HEADER_LETTERS))
        footer = footer_height(prepared, FIGURE_WIDTH)
        height = _row_height(prepared) * prepared.rows + _header_height(heading) + footer
        canvas = Canvas(figsize=(FIGURE_WIDTH, height), layout="constrained", facecolor="white")
        area = (0, footer / height, 1, 1 - footer / height)
        canvas.get_layout_engine().set(w_pad=0.08, h_pad=0.08, rect=area)  # type: ignore[union-attr]
        if heading:
            canvas.suptitle(heading, x=0.01, ha="left", fontsize=11.5, fontweight="bold", parse_math=False)
        for number, panel in enumerate(prepared.panels):
            axes = canvas.add_subplot(prepared.rows, prepared.columns, number + 1)
            _draw(axes, panel, FIGURE_WIDTH / prepared.columns)
        add_colour_bars(canvas, list(canvas.axes), prepared.panels)
        add_footer(canvas, prepared, _SYMBOLS, _DASHES, FIGURE_WIDTH)
        return canvas


def _header_height(heading: str) -> float:
    """Return the height [inch] of a figure's own title, whose lines are broken; 0 without a title."""
    return HEADER_HEIGHT + HEADER_LINE * heading.count("\n") if heading else 0.0


def draw_on(figure: Figure, axes: Axes | Sequence[Axes] | None) -> list[Axes]:
    """Draw the panels on given axes, one each, or on a new figure of pyplot; return the axes.

    Raises InputError unless there is one axes for each panel.
    """
    prepared = drawable(figure)
    if axes is None:
        from matplotlib import pyplot

        size = (FIGURE_WIDTH, _row_height(prepared) * prepared.rows)
        canvas = pyplot.figure(figsize=size, layout="constrained")
        places = [canvas.add_subplot(prepared.rows, prepared.columns, k + 1) for k in range(len(prepared.panels))]
    else:
        places = [axes] if isinstance(axes, Axes | str) else [*axes]
    if not all(isinstance(place, Axes) for place in places):
        raise InputError("axes", quoted(axes), "axes of matplotlib (.report writes files)", '.report("folder")')
    if len(places) != len(prepared.panels):
        expected = f"{len(prepared.panels)}, one per panel of the figure"
        raise InputError("axes", f"{len(places)} axes", expected, f"plt.subplots({len(prepared.panels)})[1]")
    with _style():
        for place, panel in zip(places, prepared.panels, strict=True):
            _draw(place, panel, FIGURE_WIDTH / prepared.columns)
        if handles := legend_handles(prepared, _SYMBOLS, _DASHES):
            for text in places[0].legend(handles=handles).get_texts():
                text.set_parse_math(False)
    return places


def image(figure: Figure, form: str, headed: bool = True) -> bytes:
    """Return the figure as the bytes of a file; without its heading, which is cut off, unless `headed`.

    `form` is one of the formats of images. Raises ValueError for any other.
    """
    if form not in IMAGE_FORMATS:
        raise ValueError(f"figure format: got {form!r}, expected one of {', '.join(IMAGE_FORMATS)}, e.g. 'png'")
    with _style(), _letters_alone() if form == "pdf" else nullcontext():
        canvas, stream = _laid_out(figure), io.BytesIO()
        cut = 0.0 if headed else round(_header_height(canvas.get_suptitle()) * DOTS_PER_INCH) / DOTS_PER_INCH
        area = Bbox([[0, 0], [FIGURE_WIDTH, canvas.get_figheight() - cut]])
        dots = DOTS_PER_INCH if form == "png" else FINER_FACTOR * DOTS_PER_INCH  # resolution of pictures inside
        canvas.savefig(stream, format=form, metadata=_METADATA[form], bbox_inches=area if cut else None, dpi=dots)
        return stream.getvalue()


@contextmanager
def _letters_alone() -> Iterator[None]:
    """Embed fonts without the tables for placing letters.

    Cutting these tables down to the letters that occur would take two thirds of the time of a PDF. Matplotlib sets the
    options of FontTools, so they are replaced in the `with` block.
    """
    from fontTools import subset

    usual = subset.Options

    class LettersAlone(usual):
        def __init__(self, **options: object) -> None:
            super().__init__(**options)
            self.drop_tables = [*self.drop_tables, "GDEF", "GPOS", "GSUB"]

    subset.Options = LettersAlone
    try:
        yield
    finally:
        subset.Options = usual


def _laid_out(figure: Figure) -> Canvas:
    """Return a figure on a canvas on which all parts have fixed places, and keep the last ones for their next format.

    A page, for example, shows a figure that is also written as a file.
    """
    for kept, canvas in tuple(_last):
        if kept is figure:
            return canvas
    canvas = render(figure)
    if engine := canvas.get_layout_engine():
        engine.execute(canvas)
    canvas.set_layout_engine(None)  # with any, each format is drawn twice
    _last.append((figure, canvas))
    return canvas


_last: deque[tuple[Figure, Canvas]] = deque(maxlen=6)

_one_at_a_time = RLock()
"""Lock for drawing: Matplotlib's parameters belong to the process, and a canvas may be kept, but friso app draws in
several threads."""


@contextmanager
def _style() -> Iterator[None]:
    """Use friso's style of matplotlib in the `with` block, one thread at a time."""
    with _one_at_a_time, mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(_STYLE)
        yield


def _row_height(figure: Figure) -> float:
    """Return the height of a row of panels [inch]."""
    if any(panel.equal for panel in figure.panels):
        return EQUAL_HEIGHTS.get(figure.columns, ROW_HEIGHT)
    mapped = any(panel.coloured for panel in figure.panels)
    return MAP_HEIGHTS.get(figure.columns, ROW_HEIGHT) if mapped else ROW_HEIGHT


def _draw(axes: Axes, panel: Panel, width: float) -> None:
    """Draw everything in one panel, which is `width` [inch] wide."""
    _scale(axes, panel)
    draw_coloured(axes, panel)
    for area in panel.areas:
        axes.add_patch(_filled(area))
    for band in panel.bands:
        axes.fill(*band.outline, color=band.colour, linewidth=0)
    for line in panel.series:
        style = {"color": line.colour, "linestyle": _DASHES[line.dash], "linewidth": line.width}
        axes.plot(line.x, line.y, **style)
    for marker in panel.markers:
        style = {"color": marker.colour, "linestyle": "none", "zorder": 3, **_SYMBOLS[marker.symbol]}
        axes.plot(marker.x, marker.y, **style)
    if panel.x.limits:
        axes.set_xlim(panel.x.limits)
    if panel.y.limits:
        axes.set_ylim(panel.y.limits)
    for arrow in panel.arrows:
        shape = {"arrowstyle": "-|>", "color": arrow.colour, "linewidth": 1.8, "shrinkA": 0, "shrinkB": 0}
        axes.annotate("", arrow.end, arrow.start, arrowprops=shape)
    for item in panel.words:
        across, up, *shift = SIDES[item.side]
        place: dict[str, Any] = {"ha": across, "va": up, "xytext": shift, "textcoords": "offset points"}
        if item.ground:
            place["path_effects"] = [withStroke(linewidth=4, foreground=item.ground)]
        axes.annotate(item.text, (item.x, item.y), color=item.colour, weight="bold", parse_math=False, **place)
    if panel.equal:
        axes.set_aspect("equal")
    _ticks(axes, panel, width)
    _annotate(axes, panel)


def _filled(area: Area) -> PathPatch:
    """Return the patch of filled rings."""
    rings = np.split(np.column_stack([area.x, area.y]), np.flatnonzero(np.isnan(area.x)))
    paths = [Path(ring[~np.isnan(ring[:, 0])], closed=True) for ring in rings]
    style: dict[str, Any] = {"facecolor": area.colour, "edgecolor": "none"}
    if area.hatched:
        style = {"facecolor": "none", "edgecolor": area.colour, "hatch": "///", "linewidth": 0}
    return PathPatch(Path.make_compound_path(*paths), **style)


def _scale(axes: Axes, panel: Panel) -> None:
    """Set both axes of a panel linear or logarithmic."""
    axes.set_xscale("log" if panel.x.log else "linear")
    axes.set_yscale("log" if panel.y.log else "linear")
    if panel.markers and panel.x.limits is None:
        axes.margins(x=0.03)


def _ticks(axes: Axes, panel: Panel, width: float) -> None:
    """Set the ticks of a panel: plain numbers, without a factor or an offset beside the axis."""
    bins = (min(9, int(2 * width)), [1, 2, 5, 10]), (6, [1, 2, 2.5, 5, 10])
    for axis, declared, (most, steps) in zip((axes.xaxis, axes.yaxis), (panel.x, panel.y), bins, strict=True):
        if declared.words:
            positions, words = word_ticks(declared)
            axis.set_ticks(positions, words, parse_math=False)
        elif declared.log:
            _decades(axis, ticker.MaxNLocator(nbins=most, steps=steps))
        else:
            plain = ticker.ScalarFormatter(useOffset=False)
            plain.set_scientific(False)
            even = ticker.MaxNLocator(nbins=most, steps=steps)
            axis.set_major_formatter(plain)
            axis.set_major_locator(ticker.MultipleLocator(declared.step) if declared.step else even)


def _decades(axis: Any, even: ticker.Locator) -> None:
    """Set the ticks of a logarithmic axis.

    They stand at powers of ten, also at 2 and 5 over a few decades, and evenly within one decade.
    """
    low, high = axis.get_view_interval()
    few = high < 1000 * low
    fine = even if high < 10 * low else ticker.LogLocator(subs=(1.0, 2.0, 5.0))
    axis.set_major_locator(fine if few else ticker.LogLocator(numticks=8))
    axis.set_major_formatter("{x:g}" if few else ticker.FuncFormatter(_power_of_ten))
    axis.set_minor_formatter(ticker.NullFormatter())


def _power_of_ten(value: float, _: int | None = None) -> str:
    """Return the label of a tick at a power of ten, in letters.

    Setting it as a formula would take a tenth of the time of a figure.
    """
    return "10" + str(round(math.log10(value))).translate(_RAISED)


def _annotate(axes: Axes, panel: Panel) -> None:
    """Write the labels, and the title above the axes."""
    axes.set_xlabel(panel.x.label, parse_math=False)
    axes.set_ylabel(panel.y.label, parse_math=False)
    if panel.x.second is not None:
        above = axes.secondary_xaxis("top")
        above.set_xlabel(panel.x.second.label, parse_math=False)
        _second_ticks(above.xaxis, panel.x)
    if panel.y.second is not None:
        beside = axes.secondary_yaxis("right")
        beside.set_ylabel(panel.y.second.label, parse_math=False)
        _second_ticks(beside.yaxis, panel.y)
    axes.set_title(panel.title, pad=5, parse_math=False)


def _second_ticks(axis: Any, declared: Axis) -> None:
    """Set the ticks of the second scale of an axis."""
    places, texts = second_ticks(declared)
    axis.set_major_locator(ticker.FixedLocator(places))
    axis.set_major_formatter(ticker.FixedFormatter(texts))
    axis.set_minor_locator(ticker.NullLocator())
