"""Figures as data and their two renderers."""

import base64
import io
import json
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import matplotlib
import matplotlib.image
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from made_up import both_joints, digests, mpl_arrays, plotly_arrays, same, small_figure
from pages import packed_values

from friso.quantities import percent
from friso.questions.check.figures import check_figures
from friso.shown import blocks, pages
from friso.shown.drawing import matplotlib_renderer, plotly_renderer
from friso.shown.drawing.drawable import KEPT_PER_BUCKET, MOST_BUCKETS, drawable, thin
from friso.shown.drawing.figure import GREY, Axis, Figure, Map, Panel, Series
from friso.shown.text import choose, pretty, range_with_unit, swing_with_unit, with_unit

# ---------------------------------------------------------------- plain data


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        (lambda: Series(np.zeros(3), np.zeros(2), "wave", "#000"), r"\(3,\), y \(2,\); expected one length"),
        (lambda: Map(np.zeros(2), np.zeros(3), np.zeros((2, 3)), "peaks", ""), r"\(2, 3\), expected .* = \(3, 2\)"),
        (lambda: blocks.save(small_figure(), Path("figure.gif")), "got 'gif', expected one of png, svg, pdf"),
    ],
)
def test_what_cannot_be_drawn_is_refused(asked, message):
    with pytest.raises(ValueError, match=message):
        asked()


PREFIXED = """0 0.52e-3: m 1e6 µm; -1.04e-3: m 1e3 mm; 0.09 -0.02: m 1e3 mm; 0.001: m 1e3 mm; 2e-13: m 1e9 nm;
20: s 1 s; 3600: s 1 s; 0.015: m/s 1e3 mm/s; 2400: N/m 1e-3 kN/m; 316: N*s/m 1 N·s/m; 0.5: kg 1 kg; 1e-6: m^2 1 m²;
0 nan inf: m 1 m; : N 1 N; 1000: m 1 m"""


def test_prefixes() -> None:
    """Of values, their unit: the factor and the unit that they are shown in."""
    for row in PREFIXED.split(";"):
        values, shown = row.split(":")
        unit, factor, text = shown.split()
        assert choose(np.array(values.split(), float), unit) == (pytest.approx(float(factor)), text), row


@given(st.floats(1e-9, 999.0))
def test_prefixed_lengths_read_between_one_and_a_thousand(value):
    assert choose(np.array([1e-9, 0.1]), "m", log=True) == (pytest.approx(1e6), "µm")  # of its middle
    factor, _ = choose(np.array([value]), "m")
    assert 1 - 1e-8 <= value * factor < 1000 * (1 + 1e-8)


def test_ranges_and_shares_in_sentences():
    sentences = {1.04e-3: "1.04 mm", 0.0: "0 m", None: "–", np.nan: "–", 1e-15: "< 0.00100 nm", 0.0496: "49.6 mm"}
    assert [with_unit(value, "m") for value in sentences] == [*sentences.values()]
    assert (with_unit(1234.5, "s"), with_unit(0.0496, "Hz")) == ("1234 s", "0.0496 Hz")
    assert pretty("m/s**2") == "m/s²"
    assert swing_with_unit(0.52e-3, 0.0, "m") == "±0.52 mm"
    assert swing_with_unit(0.345e-3, 1e-5, "m") == "±345 µm"
    assert swing_with_unit(6.0732e-3, 4.5346e-3, "m") == "from −1.54 to +10.6 mm about its target"
    assert swing_with_unit(1e-3, 3e-3, "m", 4) == "from +2 to +4 mm about its target"
    assert range_with_unit(0.233e-3, 2.07e-3, "m") == "0.233 to 2.07 mm"
    assert range_with_unit(520.1e-6, 520.4e-6, "m") == "520 µm"
    shares = {1.0: "100 %", 0.954: "95 %", 12.3: "1200 %", 0.00012: "0.012 %", 1.9e-7: "0.000019 %", np.nan: "–"}
    assert [percent(share) for share in shares] == [*shares.values()]


# ---------------------------------------------------------------- thinning

values = st.one_of(st.floats(-1e6, 1e6), st.just(np.nan))


@pytest.mark.slow
@given(arrays(float, st.integers(1, 900), elements=values), st.integers(1, 12), st.booleans())
def test_thinning_keeps_order_ends_extremes_and_gaps(y, buckets, loop):
    x = np.cos(np.arange(len(y))) if loop else np.arange(len(y), dtype=float)
    label = np.arange(len(y), dtype=float) * 1e-9  # tells samples of equal value apart
    kept_x, kept_y = thin(x + label, y, buckets)
    places = np.array([int(np.flatnonzero(x + label == value)[0]) for value in kept_x])
    assert np.all(np.diff(places) > 0)
    assert np.array_equal(kept_y, y[places], equal_nan=True)
    assert places[0] == 0
    assert places[-1] == len(y) - 1
    assert np.isnan(kept_y).any() == np.isnan(y).any()
    if not np.isnan(y).all():
        assert np.nanmin(kept_y) == np.nanmin(y)
        assert np.nanmax(kept_y) == np.nanmax(y)
    assert kept_x.min() == (x + label).min()
    assert kept_x.max() == (x + label).max()
    if len(y) > KEPT_PER_BUCKET * buckets:
        assert len(kept_y) <= (KEPT_PER_BUCKET + 1) * buckets + 2


@settings(max_examples=30)
@given(st.integers(0, 199_999), st.floats(1.1, 1e6), st.sampled_from([-1, 1]))
def test_a_spike_of_one_sample_survives_where_it_is(place, height, sign):
    y = np.sin(np.linspace(0, 50, 200_000))
    y[place] = sign * height
    x, kept = thin(np.arange(200_000.0), y)
    assert len(kept) <= (KEPT_PER_BUCKET + 1) * MOST_BUCKETS
    assert kept[x == place] == pytest.approx(sign * height)


def test_a_loop_that_rests_keeps_its_shape():
    angle = np.concatenate([np.zeros(90_000), np.linspace(0, 2 * np.pi, 10_000)])
    x, y = thin(np.cos(angle), np.sin(angle), 200)
    assert np.max(np.hypot(np.diff(x), np.diff(y))) < 0.1


# ---------------------------------------------------------------- renderers


@pytest.mark.cases(first=3)
@pytest.mark.parametrize("figure", [small_figure(), *check_figures(both_joints(samples=20001))], ids=lambda f: f.name)
def test_both_renderers_draw_the_same_arrays(figure):
    on_paper, on_page = mpl_arrays(figure), plotly_arrays(figure)
    assert sum(len(panel) for panel in on_paper) > 0
    assert same(on_paper, on_page)


@pytest.mark.slow
def test_both_renderers_write_the_same_labels_and_ranges():
    """No axis has an offset text."""
    far = np.linspace(0, 1, 50)
    narrow = Panel("Far", Axis("Time", "s"), Axis("Position", "m"), (Series(far, 100 + 1e-7 * far, "y", "#000000"),))
    for figure in (Figure("far", "Far", "", (narrow,)), small_figure(), *check_figures(both_joints())):
        canvas, layout = matplotlib_renderer.render(figure), plotly_renderer.render(figure).layout
        canvas.draw_without_rendering()
        axes = [a for a in canvas.axes if a.get_label() != "<colorbar>"]
        for number, (panel, paper) in enumerate(zip(drawable(figure).panels, axes, strict=True)):
            x, y = (layout[f"{name}axis{number + 1 if number else ''}"] for name in "xy")
            assert paper.get_xlabel() == x.title.text == panel.x.label
            assert paper.get_ylabel() == y.title.text == panel.y.label
            assert paper.xaxis.get_offset_text().get_text() == paper.yaxis.get_offset_text().get_text() == ""
            if panel.x.limits:
                assert paper.get_xlim() == pytest.approx(x.range)


@pytest.mark.slow
def test_figures_drawn_in_threads_are_those_drawn_alone():
    kinds = [("png", True), ("svg", False), ("svg", True), ("png", False)]
    alone = [matplotlib_renderer.image(small_figure(), *kind) for kind in kinds]
    figure = small_figure()
    with ThreadPoolExecutor(4) as threads:
        together = threads.map(lambda kind: matplotlib_renderer.image(figure, *kind), 2 * kinds)
        assert [*together] == 2 * alone


def test_a_figure_has_one_legend_that_names_each_line_once() -> None:
    """A line that two panels have is named once, and one alone in its panel is not; on paper as on the page."""

    def panel(*labels: str) -> Panel:
        lines = [Series(np.arange(2.0), np.arange(2.0), label, "#000000" if label == "b" else GREY) for label in labels]
        return Panel("", Axis("x", ""), Axis("y", ""), tuple(lines))

    figure = Figure("f", "", "", (panel("a", "b"), panel("b", "c", ""), panel("alone")), columns=2)
    canvas, page = matplotlib_renderer.render(figure), plotly_renderer.render(figure)
    (legend,) = canvas.legends
    assert [text.get_text() for text in legend.get_texts()] == ["a", "b", "c"]
    assert not any(axes.get_legend() for axes in canvas.axes)
    assert [trace.name for trace in page.data if trace.showlegend is not False] == ["a", "b", "c"]
    (first, *others) = matplotlib_renderer.draw_on(figure, None)
    assert [text.get_text() for text in first.get_legend().get_texts()] == ["a", "b", "c"]
    assert not any(axes.get_legend() for axes in others)


def test_dollars_and_markup_in_names_are_text():
    figure = replace(small_figure(), subject=r"$\frac{1}$ <b>&", title="_x$")
    panel = replace(figure.panels[0], title="<script>$", series=(replace(figure.panels[0].series[0], label="_$a"),))
    figure = replace(figure, panels=(panel,))
    assert matplotlib_renderer.image(figure, "png").startswith(b"\x89PNG")
    (legend,) = matplotlib_renderer.render(figure).legends
    assert [text.get_text() for text in legend.get_texts()] == ["_$a", "band", "peak"]
    assert "<script>$" not in json.dumps(packed_values(plotly_renderer.fragment(figure)))


@pytest.mark.thorough
def test_files_are_the_same_bytes_in_every_process(request, tmp_path, monkeypatch, printed):
    monkeypatch.setattr("friso.shown.pages.foreign", list)  # other tests bring some to this process
    (tmp_path / "matplotlibrc").write_text("font.size: 30\n")
    environment = {"PYTHONHASHSEED": "2", "MATPLOTLIBRC": str(tmp_path), "HOME": str(tmp_path), "PATH": "/usr/bin:/bin"}
    environment |= {"PYTHONPATH": os.pathsep.join(map(str, (request.config.rootpath, request.path.parent)))}
    environment |= {"MPLCONFIGDIR": matplotlib.get_cachedir()}  # the list of fonts takes seconds to make
    code = "import made_up; print(*made_up.digests())"
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.split() == digests()


def test_a_page_carries_what_plotly_draws_in_four_bytes_a_number():
    """The first bytes of all numbers of an array stand first, as `page.js` reads them."""
    figure = small_figure()
    carried = packed_values(plotly_renderer.fragment(figure))[0]["data"]
    for trace, part in zip(plotly_renderer.render(figure).data, carried, strict=True):
        for name in () if [*trace.x] == [None] else {"x", "y", *(("z",) if trace.type == "heatmap" else ())}:
            planes = np.frombuffer(base64.b64decode(part[name]["planes"]), np.uint8)
            numbers = planes.reshape(4, -1).T.copy().view("<f4")
            shape = [int(size) for size in part[name]["shape"].split(",") if size] or -1
            assert np.array_equal(numbers.reshape(shape), np.asarray(trace[name], "<f4"), equal_nan=True)


def test_a_print_is_the_figure_without_its_heading() -> None:
    """The rest stays as it is, to the dot."""
    whole, bare = (read_image(blocks.image(small_figure(), "png", headed)) for headed in (True, False))
    cut = len(whole) - len(bare)
    assert cut == pytest.approx(matplotlib_renderer.HEADER_HEIGHT * matplotlib_renderer.DOTS_PER_INCH, abs=1)
    assert np.array_equal(whole[cut:], bare)
    untitled = replace(small_figure(), title="", subject="")
    assert blocks.image(untitled, "png", headed=False) == blocks.image(untitled, "png")
    address = str(pages.print_image(small_figure()))
    assert address.startswith("data:image/png;base64,")


def read_image(content: bytes) -> np.ndarray:
    """The dots of a PNG."""
    return np.asarray(matplotlib.image.imread(io.BytesIO(content)))


@pytest.mark.parametrize(
    ("limits", "readable"),
    [
        ((0.6, 2.8), ["0.7", "1", "1.5", "2"]),
        ((2.0, 90.0), ["2", "5", "10", "20", "50"]),
        ((4.1, 4.9), ["4.2", "4.8"]),
        ((7.0, 13.0), ["8", "10", "12"]),
    ],
)
def test_a_log_axis_of_less_than_two_decades_has_whole_numbers(limits, readable):
    line = Series(np.arange(1.0, 3.0), np.zeros(2), "", GREY)
    panel = Panel("", Axis("Factor", "", limits, True), Axis("y", ""), (line,))
    axis = plotly_renderer.render(Figure("f", "", "", (panel,))).layout.xaxis
    assert {*readable} <= {*axis.ticktext}
    assert len(axis.ticktext) == len(axis.tickvals)
