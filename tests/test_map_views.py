"""Figures and pages of maps, on runs made up here: looking at maps needs no engine."""

import json
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from pages import Page, packed_values
from snapshots import Snapshots

import friso
from friso.questions.map.cells import axes_of
from friso.questions.map.figures import MOST_SLICES, map_figure, map_panel, marked_figure
from friso.questions.map.findings import headline, statement
from friso.questions.map.question import SweepAnswer
from friso.questions.map.words import FAILED, INVALID, NOT_RUN, QUIET, categories_of
from friso.shown.drawing import matplotlib_renderer, plotly_renderer
from friso.shown.drawing.drawable import MOST_CELLS, cell_edges, drawable, pick
from friso.shown.drawing.figure import Category, Cloud, Figure, Map, painted, ramp, scale
from friso.studies.study import Request

CROSSOVER, STROKE, LOCKED = "controller.crossover", "joint.stroke", "joint.locked"
DAMPING = "joint.limiter_damping"
UNITS = {CROSSOVER: "Hz", STROKE: "m", DAMPING: "N*s/m", LOCKED: ""}
RERUN = "friso simulate --cell map.zarr {}"
RIG = friso.load(friso.example("thesis_rig"))


def numbers(text: str) -> list[float]:
    """The numbers in a text."""
    return [float(number) for number in re.findall(r"\d+(?:\.\d+)?(?:e-?\d+)?", text)]


def made_up(axes: dict[str, Any], log: tuple[str, ...] = (), **attrs: Any) -> xr.Dataset:
    """Runs over these axes whose every cell has its own numbers; the outcome follows the count of peaks."""
    dims = tuple(axes)
    shape = tuple(len(values) for values in axes.values())
    cell = np.arange(math.prod(shape), dtype=float).reshape(shape)
    peaks = cell % 4
    numbers = {
        "peaks": (peaks, "1"),
        "peak_to_peak": (1e-4 + 1e-6 * cell, "m"),
        "period": (np.where(peaks > 0, 1 + cell / 7, np.nan), "s"),
        "settling_time_10um": (np.where(peaks > 0, np.nan, 0.3 + cell / 9), "s"),
    }
    variables: dict[str, Any] = {name: (dims, array, {"units": unit}) for name, (array, unit) in numbers.items()}
    variables["outcome"] = (dims, np.where(peaks > 0, "swings", "rests").astype("<U9"))
    variables["status"] = (dims, np.full(shape, "done", dtype="<U60"))
    coords = {key: (key, values, {"units": UNITS.get(key, "")}) for key, values in axes.items()}
    runs = xr.Dataset(variables, coords, {"name": "Rig", "stage": 'name = "Rig"\n', "friso": "1", "rtol": 1e-4} | attrs)
    for key in log:
        runs[key].attrs["scale"] = "log"
    return runs


def plain(**attrs: Any) -> xr.Dataset:
    return made_up({CROSSOVER: np.linspace(1, 16, 4), STROKE: np.linspace(0, 1e-3, 5)}, **attrs)


def troubled() -> xr.Dataset:
    """Row by row along the crossover: an invalid, a failed and a missing cell; the others ran."""
    runs = plain()
    cells = [("invalid", "invalid: x"), ("failed", "step budget used up"), ("", "not run: interrupted")]
    for i, (verdict, status) in enumerate(cells):
        runs["outcome"][0, i], runs["status"][0, i] = verdict, status
        for name in ("peaks", "peak_to_peak", "period", "settling_time_10um"):
            runs[name][0, i] = np.nan
    runs["peaks"][0, 1] = 3.0  # counted before the run failed: not to be trusted
    return runs


def only_map(figure: Figure) -> Map:
    assert len(figure.panels) == 1
    return figure.panels[0].maps[0]


def categories_shown(field: Map | Cloud) -> list[list[Category | None]]:
    assert field.codes is not None
    return [
        [None if np.isnan(code) else field.categories[int(code)] for code in row] for row in np.atleast_2d(field.codes)
    ]


# ---------------------------------------------------------------- words


# ---------------------------------------------------------------- cells


def test_cells_without_number_are_told_apart_and_never_zero():
    field = only_map(map_figure(troubled(), "peaks"))
    column = [row[0] for row in categories_shown(field)]
    assert column == [INVALID, FAILED, NOT_RUN, None, None]
    assert np.isnan(field.z[:3, 0]).all()
    assert np.array_equal(field.z[3:, 0], troubled().peaks.values[0, 3:])
    assert np.array_equal(field.z[:, 1:], troubled().peaks.values[1:].T)
    assert all(category is None for row in categories_shown(field) for category in row[1:])
    categories = {*field.categories, *categories_of("outcome").values()}
    everything = [QUIET, *ramp(11), *(category.colour for category in categories if category.label != "rests")]
    assert len(set(everything)) == len(everything)
    never = only_map(map_figure(troubled(), "settling_time_10um"))
    assert categories_shown(never)[1][1] == never.categories[-1]


def test_amplitudes_over_many_decades_are_logarithmic_and_end_above_the_noise():
    runs = plain()
    runs["peak_to_peak"][:, 0] = 1e-13
    field = only_map(drawable(map_figure(runs, "peak_to_peak")))
    drawn = scale(field)
    assert field.log
    assert drawn.texts[0].startswith("≤ ")
    assert painted(field).min() == drawn.low == pytest.approx(math.log10(field.z.max()) - 6)
    assert not only_map(map_figure(plain(), "peak_to_peak")).log


def test_cells_without_a_measure_of_what_attracts_say_why(snapshots: Snapshots):
    runs = plain()
    words = np.full(runs["peaks"].shape, "cycle", dtype=object)
    words[0, :3] = "nothing", "unknown", "swing"
    runs["attractor"] = (runs["peaks"].dims, words)
    runs["multiplier"] = (runs["peaks"].dims, np.where(words == "cycle", -0.5, np.nan))
    shown = categories_shown(only_map(map_figure(runs, "multiplier")))
    labels = {category.label for row in shown for category in row if category}
    assert len(labels) == 3
    snapshots.check("map", "what attracts", "\n".join([*sorted(labels), statement(runs, "multiplier")]))


def words_map(**options: Any) -> Any:
    return map_panel(made_up({LOCKED: [True, False], STROKE: [0.0, 1e-3]}), **options)


# ---------------------------------------------------------------- axes


def test_logarithmic_cells_are_centred_by_ratio():
    values = np.geomspace(0.1, 1000, 5)
    assert cell_edges(values, log=True) == pytest.approx(np.geomspace(0.1, 1000, 5)[0] * 10 ** np.arange(-0.5, 5))
    assert cell_edges(np.array([0.0, 1.0, 4.0])) == pytest.approx([-0.5, 0.5, 2.5, 5.5])
    assert cell_edges(np.array([0.0])) == pytest.approx([-0.5, 0.5])
    assert cell_edges(np.array([8.0]), log=True) == pytest.approx([4.0, 16.0])
    figure = map_figure(made_up({DAMPING: values, STROKE: [0.0, 1e-3]}, log=(DAMPING,)), "peaks")
    axes = matplotlib_renderer.render(figure).axes[0]
    corners = np.asarray(axes.collections[0].get_coordinates())
    assert corners[0, :, 0] == pytest.approx(cell_edges(values, log=True))
    assert corners[:, 0, 1] == pytest.approx([-0.5, 0.5, 1.5])
    assert plotly_renderer.render(figure).layout.xaxis.type == "log"


def test_unsorted_axes_are_drawn_in_order_and_words_as_cells():
    runs = made_up({CROSSOVER: np.array([8.0, 2.0, 4.0]), STROKE: np.array([2e-3, 1e-3])})
    field = only_map(map_figure(runs, "peak_to_peak"))
    assert field.x.tolist() == [2.0, 4.0, 8.0]
    assert np.array_equal(field.z, runs.peak_to_peak.sortby([CROSSOVER, STROKE]).values.T)
    figure = map_figure(made_up({LOCKED: [True, False], DAMPING: [0.0, 1.0, 10.0]}, log=(DAMPING,)), "peaks")
    panel = figure.panels[0]
    assert panel.x.words == ("locked", "free")
    assert panel.y.words == ("0 N·s/m", "1 N·s/m", "10 N·s/m")  # the logarithm has no zero
    assert not panel.y.log


def test_the_evaluation_point_is_marked():
    figure = map_figure(plain(), marker={CROSSOVER: 8.0, STROKE: 3e-4, "masses.cart": 1.2})
    point = drawable(figure).panels[0].markers[0]
    assert (point.x.tolist(), point.y.tolist()) == ([8.0], [pytest.approx(0.3)])
    outside = map_figure(plain(), marker={CROSSOVER: 40.0, STROKE: 3e-4}).panels[0]
    assert outside.x.limits == pytest.approx((-1.5, 40.0))
    assert words_map(marker={LOCKED: False, STROKE: 0.0}).markers[0].x.tolist() == [1.0]


def bars(figure: Figure) -> list[str]:
    """Return the panels beside which a colour bar stands; as many stand on paper."""
    traces = plotly_renderer.render(figure).data
    on_page = [trace.xaxis for trace in traces if trace.type == "heatmap" and trace.showscale]
    on_paper = [axes for axes in matplotlib_renderer.render(figure).axes if axes.get_label() == "<colorbar>"]
    assert len(on_page) == len(on_paper)
    return on_page


# ---------------------------------------------------------------- more and fewer axes


def test_further_axes_become_slices_on_one_scale():
    axes = {CROSSOVER: np.linspace(1, 16, 4), LOCKED: [True, False], STROKE: np.linspace(0, 1e-3, 3)}
    runs = made_up({**axes, "mass": np.arange(1.0, 8)})
    figure = map_figure(runs, "peaks", marker={CROSSOVER: 6.0, STROKE: 0.0, LOCKED: False})
    assert len(figure.panels) == 8 <= MOST_SLICES
    assert [bool(panel.markers) for panel in figure.panels] == [False] * 4 + [True] * 4
    second = runs.isel({LOCKED: 0, "mass": 2})
    assert np.array_equal(figure.panels[1].maps[0].z, second.peaks.transpose(STROKE, CROSSOVER).values)
    assert len(bars(figure)) == 1
    without = made_up({CROSSOVER: [1.0, 2.0], STROKE: [0.0, 1e-3], LOCKED: [True, False]})
    without["outcome"][:, :, 0], without["peaks"][:, :, 0] = "invalid", np.nan
    assert bars(map_figure(without, "peaks")) == ["x2"]


@pytest.mark.parametrize(("sizes", "most"), [((5, 5), 9), ((10, 2), 9), ((2, 2, 2, 2), 9), ((1000, 1000, 2), 250_000)])
def test_picks_are_spread_evenly_and_no_more_than_fit(sizes, most):
    picked = pick(sizes, most)
    kept = [len(indices) for indices in picked]
    assert most / 2.1 < math.prod(kept) <= most
    for indices, size in zip(picked, sizes, strict=True):
        assert len(set(indices.tolist())) == len(indices)
        assert 0 <= indices.min() <= indices.max() < size
        assert len(indices) < 2 or np.ptp(np.diff(indices)) <= 1


def test_a_single_axis_is_a_line_with_what_has_no_number_under_it():
    runs = troubled().isel({CROSSOVER: 0})
    runs["peaks"][3], runs["status"][3] = 5.0, "done"
    runs["peaks"][4], runs["status"][4] = 2.0, "done"
    panel = map_figure(runs, "peaks").panels[0]
    assert panel.series[0].y == pytest.approx([np.nan, np.nan, np.nan, 5, 2], nan_ok=True)
    under = {marker.label: marker for marker in panel.markers[1:]}
    assert list(under) == ["failed", "invalid", "not run"]
    assert under["failed"].x.tolist() == [0.25e-3]
    assert all(marker.y.max() < 2.0 for marker in under.values())
    verdicts = map_figure(runs, "outcome").panels[0]
    assert verdicts.y.words == ("swings", "rests", "failed", "invalid", "not run")
    assert [marker.x.tolist() for marker in verdicts.markers[:2]] == [[pytest.approx(0.75e-3)], [1e-3]]


def sampled(**attrs: Any) -> xr.Dataset:
    runs = made_up({"sample": np.arange(12)}, **attrs).drop_vars("sample")
    keys = {"mass": (1.0 + np.arange(12), "kg"), STROKE: (1e-3 / (1 + np.arange(12)), "m"), "x": (np.ones(12), "")}
    runs = runs.assign_coords({key: ("sample", values, {"units": unit}) for key, (values, unit) in keys.items()})
    runs["outcome"][3], runs["peaks"][3] = "invalid", np.nan
    return runs


def test_samples_are_points_over_the_first_two_keys():
    figure = map_figure(sampled(), marker={"mass": 2.0, STROKE: 5e-4})
    panel = drawable(figure).panels[0]
    assert (panel.x.label, panel.y.label) == ("Mass [kg]", "Joint stroke [mm]")
    cloud = panel.clouds[0]
    assert cloud.x.tolist() == sampled().mass.values.tolist()
    assert categories_shown(cloud)[0][3] == INVALID
    assert len(panel.markers) == 1
    assert [axis.key for axis in axes_of(sampled())] == ["mass", STROKE, "x"]


# ---------------------------------------------------------------- renderers


EVERY = {
    "troubled": map_figure(troubled(), marker={CROSSOVER: 8.0, STROKE: 3e-4}),
    "outcome": map_figure(troubled(), "outcome"),
    "slices": map_figure(made_up({CROSSOVER: [1.0, 2.0], STROKE: [0.0, 1e-3], LOCKED: [True, False]}), "peaks"),
    "line": map_figure(plain().isel({CROSSOVER: 0}), "settling_time_10um"),
    "rows": map_figure(plain().isel({CROSSOVER: 0}), "outcome"),
    "samples": map_figure(sampled(), "peaks"),
    "one cell": map_figure(plain().isel({CROSSOVER: [1], STROKE: [0]}), "peak_to_peak"),
}


@pytest.mark.cases(slow=4)
@pytest.mark.parametrize("figure", EVERY.values(), ids=EVERY)
def test_both_renderers_draw_the_same(figure):
    canvas, page = matplotlib_renderer.render(figure), plotly_renderer.render(figure)
    layers = [layer for axes in canvas.axes if axes.get_label() != "<colorbar>" for layer in axes.collections]
    colours = [np.asarray(layer.get_array().filled(np.nan), float).ravel() for layer in layers]
    drawn = [
        np.asarray(trace.z if trace.type == "heatmap" else trace.marker.color, float).ravel()
        for trace in page.data
        if trace.type == "heatmap" or trace.marker.colorscale is not None
    ]
    assert len(colours) == len(drawn)
    assert all(np.array_equal(a, b, equal_nan=True) for a, b in zip(colours, drawn, strict=True))
    in_key = [text.get_text() for legend in canvas.legends for text in legend.get_texts()]
    assert in_key == [trace.name for trace in page.data if trace.x is not None and list(trace.x) == [None]]
    for form in matplotlib_renderer.IMAGE_FORMATS:
        assert len(matplotlib_renderer.image(figure, form)) > 1000


# ---------------------------------------------------------------- page


def page_of(runs: xr.Dataset, metric: str = "peaks", store: str = "map.zarr") -> str:
    """The page of made-up runs in a store."""
    study = Request(RIG, {STROKE: ["0 mm", "1 mm"]}).study()
    parts = {"stage": RIG, "study": study, "metric": metric, "store": Path(store), "exports": (), "edges": None}
    return SweepAnswer(runs, **parts).page().html()


def told(runs: xr.Dataset, metric: str = "peaks") -> list[Any]:
    """The traces of a map that tell something of their points under the mouse."""
    figure = map_figure(runs, metric, rerun=RERUN)
    return [trace for trace in plotly_renderer.render(figure).data if trace.text is not None]


@pytest.mark.slow
def test_the_machine_that_was_swept_stands_in_its_map():
    attrs = {"stage": RIG.to_toml()}
    outside = plain(stage=RIG.replace({CROSSOVER: "27 Hz"}).to_toml())
    (marker,) = marked_figure(plain(**attrs), "peaks").panels[0].markers
    assert (marker.label, marker.x.tolist(), marker.y.tolist()) == ("this machine", [8], [1e-3])
    for other in (plain(**attrs, links='{"masses.cart": "0.7 * mass"}'), plain(), outside):
        assert not marked_figure(other, "peaks").panels[0].markers


def test_a_cell_under_the_mouse_names_the_command_of_its_run():
    """On every kind of map, whatever the order of its values, cells without a number too."""
    runs = troubled().isel({CROSSOVER: [2, 0, 3, 1]})
    for metric in ("peaks", "outcome"):
        for trace in told(runs, metric):
            assert trace.hovertemplate.endswith("<br>friso simulate --cell map.zarr<br>%{text}<extra></extra>")
            assert trace.text.tolist() == [[f"{i} {j}" for i in (1, 3, 0, 2)] for j in range(5)]
    deep = made_up({LOCKED: [True, False], STROKE: np.array([1e-3, 0.0]), CROSSOVER: [2.0, 4.0]})
    numbered = [trace for trace in told(deep) if trace.customdata is not None]
    expected = [[[f"{k} 1 {i}", f"{k} 0 {i}"] for i in range(2)] for k in range(2)]
    assert [trace.text.tolist() for trace in numbered] == expected
    for trace in numbered:
        cell = np.array([[text.split() for text in row] for row in trace.text.tolist()], int)
        assert np.array_equal(deep["peaks"].values[tuple(np.moveaxis(cell, -1, 0))], trace.customdata)
    (cloud, others) = told(sampled())
    assert sorted([*cloud.text, *others.text], key=int) == [str(k) for k in range(12)]
    assert others.text.tolist() == ["3"]
    line = troubled().isel({CROSSOVER: 0, STROKE: [4, 3, 2, 1, 0]})
    for metric, count in (("peaks", 4), ("outcome", 5)):
        at = [(float(x), text) for trace in told(line, metric) for x, text in zip(trace.x, trace.text, strict=True)]
        assert {round(x / 0.25): text for x, text in at} == {k: str(4 - k) for k in range(5)}, metric
        assert len(told(line, metric)) == count
    assert not any(trace.text is not None for trace in plotly_renderer.render(map_figure(runs)).data)


def test_the_page_opens_offline_and_says_what_it_shows():
    page = page_of(troubled())
    parsed = Page(page)
    assert page.count(plotly_renderer.script()) == 1
    assert all(address.startswith("data:image/png;base64,") for address in parsed.loads)
    assert "default-src 'none'" in page
    assert not re.findall(r"https?://[^\"'<> ]*", page.replace(plotly_renderer.script(), ""))
    assert "step budget used up" in parsed.text


@pytest.mark.slow
def test_a_page_too_large_is_thinned_and_says_so():
    runs = made_up({CROSSOVER: np.linspace(1, 16, 1000), STROKE: np.linspace(0, 1e-3, 400)})[["peaks", "outcome"]]
    assert f"{MOST_CELLS} of its 400000 cells" in Page(page_of(runs)).text
    trace, *_ = told(runs)
    assert 0.9 * MOST_CELLS < trace.z.size <= MOST_CELLS
    assert (len(trace.y), len(trace.x)) == trace.z.shape == trace.text.shape
    i, j = np.array([text.split() for text in trace.text.ravel()], int).T
    assert np.array_equal(runs.peaks.values[i, j], trace.z.ravel())
    assert trace.x[i.reshape(trace.z.shape)[0].argmax()] == pytest.approx(16)
    deep = made_up({CROSSOVER: np.linspace(1, 16, 500), STROKE: np.linspace(0, 1e-3, 400), LOCKED: [True, False]})
    assert 0.9 * MOST_CELLS < sum(one.z.size for one in told(deep) if one.customdata is not None) <= MOST_CELLS


EVIL = '</script><script>alert("x")</script><img src=x onerror=alert(1)>$&'


@pytest.mark.slow
def test_names_states_and_words_cannot_inject_markup():
    def runs(word: str) -> xr.Dataset:
        table = made_up({CROSSOVER: [1.0, 2.0], word: ["a", word]}, name=word, stage=word)
        table["outcome"][0, 0], table["status"] = "failed", table.status.astype("<U99")
        table["status"][0, 0] = word
        table["peaks"].attrs["units"] = table[CROSSOVER].attrs["units"] = word
        return table

    plain_page, page = page_of(runs("word")), page_of(runs(EVIL), store=EVIL)
    assert sorted(Page(page).tags) == sorted(Page(plain_page).tags)
    assert EVIL in Page(page).text
    assert "<script>alert" not in json.dumps(packed_values(page))
    own = page.replace(plotly_renderer.script(), "").replace("&lt;script&gt;alert", "").replace("onerror=alert", "")
    assert "alert" not in own
    figure = map_figure(runs(EVIL), "peaks")
    assert "<img src=x" not in json.dumps(packed_values(plotly_renderer.fragment(figure)))
    assert matplotlib_renderer.image(figure, "png").startswith(b"\x89PNG")


# ---------------------------------------------------------------- what a map says first


def swinging(where: np.ndarray) -> xr.Dataset:
    """Return the plain map, 4 crossovers by 5 strokes, whose runs swing where `where` is true and rest elsewhere."""
    runs = plain()
    runs["outcome"] = (runs.outcome.dims, np.where(where, "swings", "rests"))
    runs["peaks"] = (runs.peaks.dims, np.where(where, 2.0, 0.0))
    return runs


@pytest.mark.cases(first=4)
@pytest.mark.parametrize(
    ("rows", "columns", "expected"),
    [
        (slice(0, 2), slice(None), [50, 6]),
        (slice(2, 4), slice(None), [50, 11]),
        (slice(1, 2), slice(0, 2), [10, 6, 250]),
        (slice(1, 3), slice(1, 3), [20, 6, 11, 250, 500]),
        (slice(0, 0), slice(None), []),
        (slice(None), slice(None), []),
    ],
)
def test_a_map_says_first_where_runs_swing(rows: slice, columns: slice, expected: list[float]) -> None:
    """The share of the map [%], and the ranges in Hz and um."""
    where = np.zeros((4, 5), bool)
    where[rows, columns] = True
    runs = swinging(where)
    first = headline(runs, "outcome")
    assert numbers(first) == numbers(headline(runs, "peaks")) == expected
    assert headline(runs, "period") == map_figure(runs).note.splitlines()[0] == first
    assert headline(runs.isel({CROSSOVER: slice(None, None, -1)}), "outcome") == first


def test_where_runs_swing_holds_for_every_cell() -> None:
    """On any map, no cell outside the stated ranges swings, and the stated share of those inside does."""
    rng = np.random.default_rng(2)
    where = rng.random((4, 5)) < 0.4
    where[3], where[:, 4] = False, False
    share, crossover, stroke, inside = numbers(headline(swinging(where), "outcome"))
    assert where[:, 3].any()
    assert (crossover, stroke) == (11, 750)
    assert (share, inside) == (round(100 * where.sum() / 20), round(100 * where.sum() / 12))
    spread = np.zeros((4, 5), bool)
    spread[0, 0] = spread[3, 4] = True
    assert numbers(headline(swinging(spread), "outcome")) == [10]


def test_words_samples_and_verdicts_have_their_sentence(snapshots: Snapshots) -> None:
    runs = made_up({LOCKED: [True, False], CROSSOVER: np.linspace(1, 16, 4)})
    runs["outcome"] = (runs.outcome.dims, [["swings"] * 4, ["rests"] * 4])
    text = [headline(runs, "outcome")]
    runs["verdict"] = (runs.outcome.dims, [["settles"] * 4, ["settles", "bistable", "hunts", "settles"]])
    text += [headline(runs, "verdict"), *statement(runs, "verdict").splitlines()[-2:]]
    drawn = sampled()
    drawn["outcome"] = (drawn.outcome.dims, np.where(drawn["mass"] < drawn["mass"].median(), "swings", "creeps"))
    nothing = troubled()
    nothing["outcome"][:] = "invalid"
    text += [headline(drawn, "outcome"), headline(nothing, "outcome"), statement(troubled(), "outcome")]
    snapshots.check("map", "headlines", "\n".join(text))


@pytest.mark.parametrize(
    "asked",
    [
        lambda: map_figure(plain()[["peak_to_peak"]], "peaks"),
        lambda: map_figure(plain(), marker={STROKE: 1e-3}),
        lambda: words_map(marker={LOCKED: "maybe", STROKE: 0.0}),
        lambda: map_panel(plain().expand_dims({LOCKED: [True]})),
        lambda: replace(only_map(map_figure(plain(), "peaks")), codes=np.zeros(2)),
        lambda: Cloud(np.zeros(2), np.zeros(2), np.zeros(3), "Peaks", ""),
    ],
)
def test_what_cannot_be_shown_is_refused(asked: Any) -> None:
    with pytest.raises(ValueError, match="expected"):
        asked()
