"""Figures, their two renderers and the report, on cases made up here: looking at plots needs no engine."""

from __future__ import annotations

import base64
import hashlib
import io
import json
import re
import subprocess
import sys
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from pages import Page

from friso.version import VERSION
from friso.views import matplotlib_renderer, plotly_renderer
from friso.views.cases import COLOURS, Shown, shown_cases
from friso.views.check_figures import check_figures, response_figure
from friso.views.drawable import drawable
from friso.views.figure import Axis, Figure, Limit, Map, Markers, Panel, Series
from friso.views.prefixes import choose, pretty, with_unit
from friso.views.report import conclusion, report_html, verdict_sentence, write_report
from friso.views.thinning import BUCKETS, KEPT, thin

UNITS = {
    "reference": "m",
    "position": "m",
    "velocity": "m/s",
    "error": "m",
    "force": "N",
    "force_p": "N",
    "force_i": "N",
    "force_d": "N",
    "cart_position": "m",
    "cart_velocity": "m/s",
    "joint_deflection": "m",
    "friction_force": "N",
}


def fake_solver(status: str) -> Any:
    return SimpleNamespace(status=status, steps=4321, rejected=321, rtol=1e-6)


@dataclass(frozen=True)
class FakeCase:
    """What `friso.hunting.Case` promises (contract of the check)."""

    stage: Any
    trace: xr.Dataset | None
    verdict: str = "settles"
    peaks: int = 0
    peak_times: np.ndarray = field(default_factory=lambda: np.empty(0))
    peak_heights: np.ndarray = field(default_factory=lambda: np.empty(0))
    peak_to_peak: float = 2e-10
    period: float | None = None
    settling_time: dict[float, float | None] = field(default_factory=lambda: {1e-6: 0.8234, 1e-5: 0.5123})
    largest_force: float = 179.4
    solver: Any = field(default_factory=lambda: fake_solver("done"))


def fake_stage(name: str = "Thesis rig", locked: bool | None = None, force_limit: float | None = None) -> Any:
    joint = None if locked is None else SimpleNamespace(locked=locked, stroke=1e-3)
    return SimpleNamespace(
        name=name,
        source="made up",
        joint=joint,
        controller=SimpleNamespace(force_limit=force_limit),
        to_toml=lambda: f"name = {json.dumps(name)}\n",
    )


def fake_trace(
    kind: str = "there_and_back", hunting: bool = False, duration: float = 20.0, samples: int = 4001
) -> xr.Dataset:
    """A trace with the shape of the real ones: smooth, with a hunting square wave, spikes in the D share."""
    time = np.linspace(0, duration, samples)
    reference = {
        "there_and_back": 0.09 * ((time > 0.03) & (time < 5.03)),
        "step": np.full(samples, 1.0),
        "ramp": 0.1 * time,
        "release": np.zeros(samples),
        "hold": np.zeros(samples),
    }[kind]
    decay = 0.0 if kind == "hold" else 2e-3
    deviation = decay * np.exp(-4 * np.mod(time, 5.03)) * (time < 15)
    wave = np.tanh(8 * np.sin(2 * np.pi * time / 1.63)) if hunting else np.zeros(samples)
    deviation = deviation + 5.2e-4 * wave
    velocity = np.gradient(reference + deviation, time)
    shares = {
        "force_p": 2 * wave,
        "force_i": 3 * np.cos(2 * np.pi * time / 1.63),
        "force_d": -0.01 * velocity,
    }
    values = shares | {
        "reference": reference,
        "position": reference + deviation,
        "velocity": velocity,
        "error": -deviation,
        "force": sum(shares.values()),
        "cart_position": reference + deviation,
        "cart_velocity": velocity,
        "joint_deflection": 0.5 * deviation,
        "friction_force": np.tanh(1e3 * velocity),
    }
    variables = {name: ("time", np.asarray(array, float), {"units": UNITS[name]}) for name, array in values.items()}
    return xr.Dataset(variables, coords={"time": ("time", time, {"units": "s"})}, attrs={"name": "Thesis rig"})


def fake_case(hunting: bool = False, stage: Any = None, kind: str = "there_and_back", drop: Any = ()) -> FakeCase:
    trace = fake_trace(kind, hunting).drop_vars(list(drop))
    case = FakeCase(stage or fake_stage(), trace)
    if not hunting:
        return case
    times = 10.2 + 1.63 * np.arange(6)
    return replace(
        case,
        verdict="hunts",
        peaks=6,
        peak_times=times,
        peak_heights=np.full(6, 5.2e-4),
        peak_to_peak=1.04e-3,
        period=1.63,
        settling_time={1e-6: None, 1e-5: None},
    )


def both_joints(name: str = "Thesis rig", samples: int = 4001) -> dict[str, Any]:
    free = fake_case(stage=fake_stage(name, locked=False))
    locked = fake_case(hunting=True, stage=fake_stage(name, locked=True))
    free = replace(free, trace=fake_trace(samples=samples))
    locked = replace(locked, trace=fake_trace(hunting=True, samples=samples))
    return {"given": free, "locked": locked, "free": free}


def small_figure() -> Figure:
    """Every kind of thing that can be drawn, in SI units."""
    time = np.linspace(0, 2, 201)
    line = Series(time, 5e-4 * np.sin(time), "wave", "#0072B2")
    upper = Panel(
        "Upper",
        Axis("Time", "s"),
        Axis("Deviation", "m"),
        (line, replace(line, y=-line.y, dash="dashed")),
        (Markers(np.array([1.0, np.nan]), np.array([4e-4, 0.0]), "peak", "#D55E00", "triangle"),),
        (Limit((-1e-4, 1e-4), "band"),),
    )
    field = Map(np.linspace(1e3, 4e3, 4), np.linspace(0, 1e-3, 3), np.arange(12.0).reshape(3, 4), "Peaks", "")
    lower = Panel("Lower", Axis("Stiffness", "N/m"), Axis("Stroke", "m"), maps=(field,))
    return Figure("small", "Small", "A caption.", (upper, lower), columns=2, subject="Rig")


# ---------------------------------------------------------------- plain data


def test_arrays_of_different_length_are_refused():
    with pytest.raises(ValueError, match=r"wave: x has the shape \(3,\), y \(2,\); expected one length"):
        Series(np.zeros(3), np.zeros(2), "wave", "#000000")
    with pytest.raises(ValueError, match=r"z has the shape \(2, 3\), expected \(len\(y\), len\(x\)\) = \(3, 2\)"):
        Map(np.zeros(2), np.zeros(3), np.zeros((2, 3)), "peaks", "")


@pytest.mark.parametrize(
    ("values", "unit", "factor", "text"),
    [
        ([0.0, 0.52e-3], "m", 1e6, "µm"),
        ([-1.04e-3], "m", 1e3, "mm"),
        ([0.09, -0.02], "m", 1e3, "mm"),
        ([0.001], "m", 1e3, "mm"),
        ([1000.0], "m", 1.0, "m"),
        ([2e-13], "m", 1e9, "nm"),
        ([20.0], "s", 1.0, "s"),
        ([3600.0], "s", 1.0, "s"),
        ([0.015], "m/s", 1e3, "mm/s"),
        ([2400.0], "N/m", 1e-3, "kN/m"),
        ([316.0], "N*s/m", 1.0, "N·s/m"),
        ([0.5], "kg", 1.0, "kg"),
        ([1e-6], "m^2", 1.0, "m²"),
        ([0.0, np.nan, np.inf], "m", 1.0, "m"),
        ([], "N", 1.0, "N"),
        ([7.0], "", 1.0, ""),
    ],
)
def test_prefix(values, unit, factor, text):
    assert choose(np.array(values), unit) == (pytest.approx(factor), text)


def test_prefix_of_a_logarithmic_axis_suits_its_middle():
    assert choose(np.array([1e-9, 0.1]), "m", log=True) == (pytest.approx(1e6), "µm")


@given(st.floats(1e-9, 999.0))
def test_prefixed_lengths_read_between_one_and_a_thousand(value):
    factor, _ = choose(np.array([value]), "m")
    assert 1 - 1e-8 <= value * factor < 1000 * (1 + 1e-8)


def test_values_in_sentences():
    assert with_unit(1.04e-3, "m") == "1.04 mm"
    assert with_unit(0.9996e-3, "m") in ("1000 µm", "1.00 mm")
    assert with_unit(0.0, "m") == "0 m"
    assert with_unit(None, "s") == "–"
    assert with_unit(float("nan"), "s") == "–"
    assert with_unit(1234.5, "s") == "1234 s"
    assert with_unit(1e-15, "m") == "1.00e-06 nm"
    assert pretty("m/s**2") == "m/s²"


# ---------------------------------------------------------------- thinning

values = st.one_of(st.floats(-1e6, 1e6), st.just(np.nan))


@settings(deadline=None)
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
    if len(y) > KEPT * buckets:
        assert len(kept_y) <= (KEPT + 1) * buckets + 2


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 199_999), st.floats(1.1, 1e6), st.sampled_from([-1, 1]))
def test_a_spike_of_one_sample_survives_where_it_is(place, height, sign):
    y = np.sin(np.linspace(0, 50, 200_000))
    y[place] = sign * height
    x, kept = thin(np.arange(200_000.0), y)
    assert len(kept) <= (KEPT + 1) * BUCKETS
    assert kept[x == place] == pytest.approx(sign * height)


def test_every_stretch_keeps_its_own_extremes():
    y = np.random.default_rng(1).normal(size=100_000)
    x, kept = thin(np.arange(100_000.0), y, 100)
    for start in range(0, 100_000, 1000):
        inside = (x >= start) & (x < start + 1000)
        assert kept[inside].min() == y[start : start + 1000].min()
        assert kept[inside].max() == y[start : start + 1000].max()


def test_a_loop_that_rests_keeps_its_shape():
    angle = np.concatenate([np.zeros(90_000), np.linspace(0, 2 * np.pi, 10_000)])
    x, y = thin(np.cos(angle), np.sin(angle), 200)
    assert np.max(np.hypot(np.diff(x), np.diff(y))) < 0.1


# ---------------------------------------------------------------- renderers


def mpl_arrays(figure: Figure) -> list[list[np.ndarray]]:
    axes = [a for a in matplotlib_renderer.render(figure).axes if a.get_label() != "<colorbar>"]
    drawn = []
    for panel in axes:
        meshes = [np.asarray(mesh.get_array().filled(np.nan)) for mesh in panel.collections]
        lines = [np.asarray(data, float) for line in panel.lines for data in line.get_data()]
        drawn.append(meshes + lines)
    return drawn


def plotly_arrays(figure: Figure) -> list[list[np.ndarray]]:
    drawn: dict[str, list[np.ndarray]] = {f"x{i or ''}": [] for i in (0, *range(2, len(figure.panels) + 1))}
    for trace in plotly_renderer.render(figure).data:
        parts = (trace.z,) if trace.type == "heatmap" else (trace.x, trace.y)
        drawn[trace.xaxis] += [np.asarray(part, float) for part in parts]
    return list(drawn.values())


def same(left: list[list[np.ndarray]], right: list[list[np.ndarray]]) -> bool:
    return [len(panel) for panel in left] == [len(panel) for panel in right] and all(
        np.array_equal(a, b, equal_nan=True)
        for one, other in zip(left, right, strict=True)
        for a, b in zip(one, other, strict=True)
    )


@pytest.mark.parametrize("figure", [small_figure(), *check_figures(both_joints(samples=20001))], ids=lambda f: f.name)
def test_both_renderers_draw_the_same_arrays(figure):
    on_paper, on_page = mpl_arrays(figure), plotly_arrays(figure)
    assert sum(len(panel) for panel in on_paper) > 0
    assert same(on_paper, on_page)


def test_both_renderers_write_the_same_labels_and_ranges():
    for figure in (small_figure(), *check_figures(both_joints())):
        axes = [a for a in matplotlib_renderer.render(figure).axes if a.get_label() != "<colorbar>"]
        layout = plotly_renderer.render(figure).layout
        for number, (panel, paper) in enumerate(zip(drawable(figure).panels, axes, strict=True)):
            suffix = number + 1 if number else ""
            for declared, label, page in (
                (panel.x, paper.get_xlabel(), layout[f"xaxis{suffix}"]),
                (panel.y, paper.get_ylabel(), layout[f"yaxis{suffix}"]),
            ):
                assert label == page.title.text == declared.label
            if panel.x.limits:
                assert paper.get_xlim() == pytest.approx(layout[f"xaxis{suffix}"].range)


def test_no_axis_of_any_figure_has_an_offset_text():
    far = np.linspace(0, 1, 50)
    narrow = Panel("Far", Axis("Time", "s"), Axis("Position", "m"), (Series(far, 100 + 1e-7 * far, "y", "#000000"),))
    for figure in (Figure("far", "Far", "", (narrow,)), *check_figures(both_joints())):
        canvas = matplotlib_renderer.render(figure)
        canvas.draw_without_rendering()
        for axes in canvas.axes:
            assert axes.xaxis.get_offset_text().get_text() == axes.yaxis.get_offset_text().get_text() == ""


def test_colour_bar_and_units_of_a_map():
    panel = drawable(small_figure()).panels[1]
    assert panel.x.label == "Stiffness [kN/m]"
    assert panel.y.label == "Stroke [mm]"
    assert panel.maps[0].x[-1] == pytest.approx(4.0)


def test_drawing_twice_changes_nothing():
    once = drawable(small_figure())
    assert [p.x for p in drawable(once).panels] == [p.x for p in once.panels]


def test_unknown_format_is_refused(tmp_path):
    with pytest.raises(ValueError, match=r"got 'gif', expected one of png, svg, pdf"):
        matplotlib_renderer.save(small_figure(), tmp_path / "figure.gif")


def test_dollars_and_markup_in_names_are_text():
    figure = replace(small_figure(), subject=r"$\frac{1}$ <b>&", title="_x$")
    panel = replace(figure.panels[0], title="<script>$", series=(replace(figure.panels[0].series[0], label="_$a"),))
    figure = replace(figure, panels=(panel,))
    assert matplotlib_renderer.image(figure, "png").startswith(b"\x89PNG")
    legend = matplotlib_renderer.render(figure).axes[0].get_legend()
    assert [text.get_text() for text in legend.get_texts()] == ["_$a", "band", "peak"]
    assert "<script>$" not in plotly_renderer.fragment(figure)


SCRIPT = """
import hashlib, sys
sys.path.insert(0, {tests!r})
import test_views as t
from friso.views import matplotlib_renderer as m
for figure in (t.small_figure(), t.check_figures(t.both_joints())[-1]):
    for form in m.FORMATS:
        print(hashlib.sha256(m.image(figure, form)).hexdigest())
print(hashlib.sha256(t.report_html(t.both_joints()).encode()).hexdigest())
"""


def test_files_are_the_same_bytes_in_every_process(request, tmp_path):
    code = SCRIPT.format(tests=str(request.path.parent))
    runs = []
    for seed in ("1", "2"):
        (tmp_path / seed).mkdir()
        (tmp_path / seed / "matplotlibrc").write_text("font.size: 30\n" if seed == "2" else "")
        environment = {"PYTHONHASHSEED": seed, "MATPLOTLIBRC": str(tmp_path / seed), "HOME": str(tmp_path)}
        environment |= {"PYTHONPATH": str(request.config.rootpath), "PATH": "/usr/bin:/bin"}
        environment |= {"MPLCONFIGDIR": str(tmp_path / "cache")}
        done = subprocess.run(
            [sys.executable, "-c", code],
            env=environment,
            capture_output=True,
            text=True,
            check=True,
            timeout=300,
        )
        runs.append(done.stdout)
    here = hashlib.sha256(matplotlib_renderer.image(small_figure(), "png")).hexdigest()
    assert runs[0] == runs[1]
    assert runs[0].split()[0] == here


# ---------------------------------------------------------------- figures of a check


def test_figures_of_a_stage_with_a_joint():
    figures = {figure.name: figure for figure in check_figures(both_joints())}
    assert list(figures) == ["settled", "overview", "shares", "joint", "friction"]
    zoom, settling = figures["settled"].panels
    assert zoom.x.limits == (10.0, 20.0)
    assert [line.label for line in zoom.series] == ["Locked", "Free (as given)"]
    assert zoom.markers[0].label == "counted peaks, locked: 6"
    assert np.array_equal(zoom.markers[0].x, both_joints()["locked"].peak_times)
    assert settling.y.log
    assert [limit.values for limit in settling.limits] == [(1e-6,), (1e-5,)]
    assert [line.label for line in figures["shares"].panels[0].series] == ["P", "I", "D", "total"]
    assert figures["shares"].panels[0].y.limits == figures["shares"].panels[1].y.limits
    assert figures["joint"].panels[0].limits[0].values == (-1e-3, 1e-3)
    assert all(panel.title for figure in figures.values() for panel in figure.panels)


def test_a_case_has_one_colour_everywhere():
    for figure in check_figures(both_joints()):
        for panel in figure.panels:
            for drawn in (*panel.series, *panel.markers):
                if drawn.label.startswith("Locked") or "locked" in drawn.label:
                    assert drawn.colour == COLOURS["locked"]
                if drawn.label.startswith("Free"):
                    assert drawn.colour == COLOURS["free"]


def test_given_is_shown_once_beside_its_twin():
    assert [(item.key, item.label) for item in shown_cases(both_joints())] == [
        ("locked", "Locked"),
        ("free", "Free (as given)"),
    ]
    assert [item.label for item in shown_cases({"given": fake_case()})] == ["As given"]


@pytest.mark.parametrize("kind", ["there_and_back", "step", "ramp", "release", "hold"])
@pytest.mark.parametrize("hunting", [False, True])
def test_every_motion_gives_figures_that_can_be_drawn(kind, hunting):
    case = fake_case(hunting, kind=kind, drop=["joint_deflection"])
    figures = check_figures({"given": case})
    assert [figure.name for figure in figures] == ["settled", "overview", "shares", "friction"]
    for figure in figures:
        assert matplotlib_renderer.image(figure, "png").startswith(b"\x89PNG")
        assert same(mpl_arrays(figure), plotly_arrays(figure))


def test_what_a_stage_lacks_has_no_panel():
    bare = ["friction_force", "force_p", "force_i", "force_d", "joint_deflection"]
    figures = check_figures({"given": fake_case(drop=bare)})
    assert [figure.name for figure in figures] == ["settled", "overview"]
    assert "The friction" not in report_html({"given": fake_case(drop=bare)})


def test_a_share_that_is_always_zero_is_left_out():
    case = fake_case(hunting=True)
    assert case.trace is not None
    case.trace["force_i"][:] = 0.0
    shares = {figure.name: figure for figure in check_figures({"given": case})}["shares"]
    assert [line.label for line in shares.panels[0].series] == ["P", "D", "total"]


def test_a_force_limit_is_drawn_where_it_is_near():
    near, far = (fake_case(hunting=True, stage=fake_stage(force_limit=bound)) for bound in (6.0, 200.0))
    panel = check_figures({"given": near})[1].panels[1]
    assert panel.limits[0].values == (-6.0, 6.0)
    assert panel.y.limits is not None
    assert panel.y.limits[1] > 6.0
    assert check_figures({"given": far})[1].panels[1].limits == ()


def test_a_cart_that_rests_is_a_point():
    panel = check_figures(both_joints())[-1].panels[0]
    assert [line.label for line in panel.series] == ["Locked", "Free (as given)"]
    cases = both_joints() | {"free": fake_case(stage=fake_stage(locked=False), kind="hold")}
    panel = check_figures(cases)[-1].panels[0]
    assert [marker.label for marker in panel.markers] == ["Free (as given): at rest"]
    panel = check_figures({"given": fake_case(kind="hold")})[-1].panels[0]
    assert (len(panel.series), len(panel.markers)) == (0, 1)


def test_a_short_run_shows_its_later_half():
    case = replace(fake_case(), trace=fake_trace("hold", duration=4.0, samples=401))
    assert check_figures({"given": case})[0].panels[0].x.limits == (2.0, 4.0)


def test_solver_noise_does_not_fill_the_panel():
    panel = drawable(check_figures({"given": fake_case(kind="hold")})[0]).panels[0]
    assert panel.y.limits == pytest.approx((-1.0, 1.0))
    assert panel.y.unit == "µm"


@pytest.mark.parametrize("start", [0, 1000, 2400, 4000])
def test_nan_of_a_failed_run_breaks_nothing(start):
    case = fake_case(hunting=True, stage=fake_stage(locked=True))
    assert case.trace is not None
    for name in case.trace.data_vars:
        case.trace[name][start:] = np.nan if name != "force" else np.inf
    solver = fake_solver("step size underflow: use a looser rtol")
    failed = replace(case, verdict="failed", solver=solver, peak_to_peak=float("nan"), period=float("nan"))
    cases = {"given": failed, "locked": failed, "free": fake_case(stage=fake_stage(locked=False))}
    for figure in check_figures(cases):
        assert same(mpl_arrays(figure), plotly_arrays(figure))
    page = report_html(cases)
    assert "step size underflow: use a looser rtol" in page
    assert "NaN" not in re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL)


def test_response_of_one_run():
    figure = response_figure(fake_trace())
    assert [panel.title for panel in figure.panels] == [
        "Position",
        "Error",
        "Actuator force",
        "Joint deflection",
    ]
    assert figure.subject == "Thesis rig"
    assert same(mpl_arrays(figure), plotly_arrays(figure))


# ---------------------------------------------------------------- report


@pytest.fixture(scope="module")
def page() -> str:
    return report_html(both_joints())


def test_report_says_the_verdict_first(page):
    text = " ".join(" ".join(Page(page).words).split())
    locked = text.index("Locked: hunts, 1.04 mm peak to peak every 1.63 s (6 peaks counted).")
    free = text.index("Free (as given): settles to within 1 µm in 823 ms.")
    assert locked < free < text.index("Counted peaks") < text.index("Does it hunt?") < text.index("The stage file")
    assert "The free joint stops the hunting." in text
    assert f"friso {VERSION}, relative tolerance 1e-06" in text
    assert 'name = "Thesis rig"' in text


def test_report_opens_offline_and_holds_plotly_once(page):
    parsed = Page(page)
    assert all(address.startswith("data:image/svg+xml;base64,") for address in parsed.loads)
    assert page.count(plotly_renderer.script()) == 1
    assert page.count("Plotly.newPlot(") - plotly_renderer.script().count("Plotly.newPlot(") == 5
    assert "default-src 'none'" in page
    own = page.replace(plotly_renderer.script(), "")
    assert not re.findall(r"https?://[^\"'<> ]*", own)
    assert "sendChartToCloud" not in own


def test_report_holds_a_print_of_every_figure(page):
    prints = [address for address in Page(page).loads if address.startswith("data:image/svg+xml")]
    assert len(prints) == 5
    for address in prints:
        assert b"<svg" in base64.b64decode(address.split(",", 1)[1])


def test_names_and_files_cannot_inject_markup():
    evil = '</script><script>alert("x")</script><img src=x onerror=alert(1)>'
    plain = report_html(both_joints())
    page = report_html(both_joints(evil))
    assert sorted(Page(page).tags) == sorted(Page(plain).tags)
    assert evil in " ".join(Page(page).words)
    assert "&lt;script&gt;alert(" in page


def test_report_without_traces_has_the_table_and_no_script():
    cases = {key: replace(case, trace=None) for key, case in both_joints().items()}
    page = report_html(cases)
    assert "<script" not in page
    assert "Locked: hunts" in page


def test_report_is_written_as_utf8(tmp_path):
    path = tmp_path / "report.html"
    write_report({"given": replace(fake_case(stage=fake_stage("Führung µ")), trace=None)}, path)
    assert "Führung µ" in path.read_bytes().decode("utf-8")


def sentence(**changes: Any) -> str:
    return verdict_sentence(Shown("given", "As given", "#000000", replace(fake_case(), **changes)))


def test_verdict_sentences():
    assert sentence() == "settles to within 1 µm in 823 ms."
    only_coarse = {1e-6: None, 1e-5: 1.5}
    assert sentence(settling_time=only_coarse) == "settles to within 10 µm in 1.50 s, but does not stay within 1 µm."
    never = {1e-6: None, 1e-5: None}
    assert "does not stay within 10 µm (70.0 µm peak to peak" in sentence(settling_time=never, peak_to_peak=7e-5)
    assert sentence(verdict="hunts", peak_to_peak=1e-3, period=None) == "hunts, 1.00 mm peak to peak."
    assert "another move" in sentence(verdict="bistable")
    assert "not settled" in sentence(verdict="transient")
    assert sentence(verdict="failed") == "failed (solver: done)."


def test_conclusion_names_what_the_joint_does():
    cases = both_joints()
    hunts, settles = cases["locked"], cases["free"]
    assert conclusion({"locked": hunts, "free": hunts}) == "The free joint does not stop the hunting."
    assert conclusion({"locked": settles, "free": hunts}) == "The stage hunts only with its joint free."
    assert conclusion({"locked": settles, "free": settles}) is None
    assert conclusion({"given": hunts}) is None
    assert conclusion({"locked": hunts, "free": replace(settles, verdict="failed")}) is None


def test_a_figure_file_opens_as_an_image(tmp_path):
    import matplotlib.image

    matplotlib_renderer.save(small_figure(), tmp_path / "small.PNG")
    assert matplotlib.image.imread(io.BytesIO((tmp_path / "small.PNG").read_bytes()), format="png").ndim == 3
