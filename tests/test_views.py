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

from friso.equations.controllers.pid_gains import PidGains
from friso.equations.controllers.van_dijk import VanDijk
from friso.hunting import Cycle, Hunting, Judgement, Kick, Margin, MoveShare
from friso.hunting.attractors import Target
from friso.hunting.cycle.return_map import ReturnMap
from friso.version import VERSION
from friso.views.check.cases import COLOURS, ShownCase, shown_cases
from friso.views.check.figures import check_figures, response_figure
from friso.views.check.page import conclusion, report_html, verdict_sentence
from friso.views.check.table import rows
from friso.views.drawing import matplotlib_renderer, plotly_renderer
from friso.views.drawing.drawable import drawable
from friso.views.drawing.figure import Axis, Figure, Limit, Map, Markers, Panel, Series
from friso.views.drawing.prefixes import choose, plus_minus, pretty, range_with_unit, with_unit
from friso.views.drawing.thinning import BUCKETS, KEPT, thin
from friso.views.pages import made_with

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


NO_RETURN = "from no distance does the stage swing back as far as it came from"


def fake_solver(status: str) -> Any:
    return SimpleNamespace(status=status, steps=4321, rejected=321, rtol=1e-6)


def fake_cycle(symmetric: bool = True, multiplier: float = -0.9312, apart: float = 0.0) -> Cycle:
    """A cycle of a stage that turns at 0.52 mm, `apart` [m] farther out on one side than on the other."""
    time = np.linspace(0, 1.6277, 401)
    position = 5.2e-4 * np.tanh(8 * np.cos(2 * np.pi * time / 1.6277)) + apart / 2
    arrays = {"position": position, "cart_position": 0.9 * position, "velocity": np.gradient(position, time)}
    variables = {name: ("time", array) for name, array in (arrays | {"force": 3 * np.sin(time)}).items()}
    trace = xr.Dataset(variables, coords={"time": time})
    return Cycle(symmetric, 5.2e-4, 0.0, 1.6277, multiplier, np.array([multiplier]), -0.93, -0.9311, 1e-12, trace)


def fake_hunting(*cycles: Cycle, reason: str = "", certain: bool = True) -> Hunting:
    distances = np.geomspace(5e-5, 4e-3, 32)[None, :]
    returns = np.where(distances > 2e-4, 1e-3 - 0.93 * distances, 0.0)
    target = Target(5.2e-4, 1.6277, 100.0) if any(cycle.attracts for cycle in cycles) else None
    return Hunting(cycles, reason, certain, ReturnMap(distances, returns, np.ones((1, 32))), (), target)


def hunts(**changes: Any) -> Judgement:
    """What is known of the thesis rig, locked."""
    found = Judgement(
        "hunts",
        fake_hunting(fake_cycle()),
        Kick(((1.72e-3, 10.8e-3), (22.7e-3, 43.3e-3), (59.3e-3, 0.156)), (1.73e-5, 0.156)),
        Kick(((0.0231, 0.0734),), (5e-4, 4.4)),
        MoveShare(128, 111, (10.0, 200.0), (0.003, 0.06)),
        Margin(1.2187, 9.7496, True),
    )
    return replace(found, **changes)


def settles(**changes: Any) -> Judgement:
    """What is known of it, free."""
    edge = Margin(0.6998, 5.598, True)
    found = Judgement("settles", fake_hunting(reason=NO_RETURN), margin=edge, settled_after=0.5123)
    return replace(found, **changes)


def cannot_hunt(verdict: Any = "settles") -> Judgement:
    return Judgement(verdict, Hunting((), "there is no friction to stick to", True, None))


@dataclass(frozen=True)
class FakeCase:
    """What `friso.hunting.Case` promises (contract of the check)."""

    stage: Any
    trace: xr.Dataset | None
    judgement: Judgement = field(default_factory=settles)
    peaks: int = 0
    peak_times: np.ndarray = field(default_factory=lambda: np.empty(0))
    peak_heights: np.ndarray = field(default_factory=lambda: np.empty(0))
    peak_to_peak: float = 2e-10
    period: float | None = None
    settling_time: dict[float, float | None] = field(default_factory=lambda: {1e-6: 0.8234, 1e-5: 0.5123})
    largest_force: float = 179.4
    solver: Any = field(default_factory=lambda: fake_solver("done"))
    unstable: tuple[str, ...] = ()

    @property
    def verdict(self) -> str:
        return self.judgement.verdict


def fake_stage(name: str = "Thesis rig", locked: bool | None = None, force_limit: float | None = None) -> Any:
    joint = None if locked is None else SimpleNamespace(locked=locked, stroke=1e-3)
    return SimpleNamespace(
        name=name,
        source="made up",
        joint=joint,
        controller=SimpleNamespace(
            force_limit=force_limit,
            **{"kp": 3.0, "ki": 4.0, "kd": 6.0, "tau": 0.0},
            bandwidth_name=VanDijk.bandwidth_name,
            speeds_up=PidGains.speeds_up,
        ),
        flat=lambda: {"motion.kind": "hold"},
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
    turns = np.arange(0.4, duration, 0.815)
    variables["turning_time"] = ("turning_point", turns, {"units": "s"})
    variables["turning_deviation"] = ("turning_point", 5.2e-4 * (-0.9) ** np.arange(len(turns)), {"units": "m"})
    return xr.Dataset(variables, coords={"time": ("time", time, {"units": "s"})}, attrs={"name": "Thesis rig"})


def fake_case(hunting: bool = False, stage: Any = None, kind: str = "there_and_back", drop: Any = ()) -> FakeCase:
    trace = fake_trace(kind, hunting).drop_vars(list(drop))
    case = FakeCase(stage or fake_stage(), trace)
    if not hunting:
        return case
    times = 10.2 + 1.63 * np.arange(6)
    return replace(
        case,
        judgement=hunts(),
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
    assert with_unit(0.0496, "Hz") == "0.0496 Hz"
    assert plus_minus(0.52e-3, "m") == "±0.52 mm"
    assert plus_minus(0.345e-3, "m") == "±345 µm"
    assert range_with_unit(0.233e-3, 2.07e-3, "m") == "0.233 to 2.07 mm"


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
from friso.views.drawing import matplotlib_renderer as m
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


def figure_of(name: str, cases: dict[str, Any]) -> Figure:
    return next(figure for figure in check_figures(cases) if figure.name == name)


def test_figures_of_a_stage_with_a_joint():
    figures = {figure.name: figure for figure in check_figures(both_joints())}
    assert list(figures) == ["settled", "return-map", "cycle", "overview", "shares", "joint", "friction"]
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
    cycle = ["cycle"] if hunting else []
    assert [figure.name for figure in figures] == ["settled", "return-map", *cycle, "overview", "shares", "friction"]
    for figure in figures:
        assert matplotlib_renderer.image(figure, "png").startswith(b"\x89PNG")
        assert same(mpl_arrays(figure), plotly_arrays(figure))


def test_what_a_stage_lacks_has_no_panel():
    bare = ["friction_force", "force_p", "force_i", "force_d", "joint_deflection"]
    case = replace(fake_case(drop=bare), judgement=cannot_hunt())
    assert [figure.name for figure in check_figures({"given": case})] == ["settled", "overview"]
    assert "The friction" not in report_html({"given": case})


def test_a_share_that_is_always_zero_is_left_out():
    case = fake_case(hunting=True)
    assert case.trace is not None
    case.trace["force_i"][:] = 0.0
    assert [line.label for line in figure_of("shares", {"given": case}).panels[0].series] == ["P", "D", "total"]


def test_a_force_limit_is_drawn_where_it_is_near():
    near, far = (fake_case(hunting=True, stage=fake_stage(force_limit=bound)) for bound in (6.0, 200.0))
    panel = figure_of("overview", {"given": near}).panels[1]
    assert panel.limits[0].values == (-6.0, 6.0)
    assert panel.y.limits is not None
    assert panel.y.limits[1] > 6.0
    assert figure_of("overview", {"given": far}).panels[1].limits == ()


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
    numbers = {"peak_to_peak": float("nan"), "period": float("nan")}
    failed = replace(case, judgement=hunts(verdict="failed"), solver=solver, **numbers)
    cases = {"given": failed, "locked": failed, "free": fake_case(stage=fake_stage(locked=False))}
    for figure in check_figures(cases):
        assert same(mpl_arrays(figure), plotly_arrays(figure))
    page = report_html(cases)
    assert "step size underflow: use a looser rtol" in page
    assert "NaN" not in re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL)


def test_return_map_with_the_swings_of_this_motion():
    locked, free = figure_of("return-map", both_joints()).panels
    assert locked.x.limits == locked.y.limits == pytest.approx((0.0, 2.2 * 5.2e-4))
    diagonal, curve, motion = locked.series
    assert np.array_equal(diagonal.x, diagonal.y)
    assert np.isnan(curve.y[curve.x < 2e-4]).all()
    assert np.isfinite(curve.y[(curve.x > 2e-4) & (curve.x < 1e-3)]).all()
    assert motion.x[:4] == pytest.approx(5.2e-4 * 0.9 ** np.array([0, 1, 1, 2]))
    assert motion.y[:4] == pytest.approx(5.2e-4 * 0.9 ** np.array([1, 1, 2, 2]))
    (cycle,) = locked.markers
    assert (cycle.label, *cycle.x, *cycle.y) == ("attracts", *[pytest.approx(5.2e-4)] * 4)
    assert free.markers == ()
    assert f"Free (as given): no cycle, as {NO_RETURN}." in figure_of("return-map", both_joints()).caption


def test_ringing_does_not_count_as_a_swing():
    case = fake_case(hunting=True)
    assert case.trace is not None
    ringing = np.array([4e-4, 4.2e-4, -1e-4, -3e-4, -2e-4, 1e-4])
    turns = {"turning_time": ("turning_point", np.arange(6.0) + 1), "turning_deviation": ("turning_point", ringing)}
    case = replace(case, trace=case.trace.drop_vars(list(turns)).assign(turns))
    motion = figure_of("return-map", {"given": case}).panels[0].series[2]
    assert motion.x == pytest.approx([4.2e-4, 3e-4, 3e-4, 1e-4])
    assert motion.y == pytest.approx([3e-4, 3e-4, 1e-4, 1e-4])


def test_cycles_that_attract_are_solid_and_others_dashed():
    both = fake_hunting(fake_cycle(), fake_cycle(symmetric=False, multiplier=1.02, apart=1e-4))
    cases = {"given": replace(fake_case(hunting=True), judgement=hunts(hunting=both))}
    attracts, repels = figure_of("return-map", cases).panels[0].markers
    assert (attracts.label, attracts.symbol, repels.label, repels.symbol) == ("attracts", "target", "repels", "cross")
    assert sorted(repels.x) == pytest.approx([4.7e-4, 5.7e-4])
    position, force, loop = figure_of("cycle", cases).panels
    assert [line.label for line in position.series] == ["attracts", "cart", "repels", "cart"]
    assert [line.dash for line in position.series] == ["solid", "solid", "dashed", "dashed"]
    assert [line.dash for line in force.series] == [line.dash for line in loop.series] == ["solid", "dashed"]
    for name in ("return-map", "cycle"):
        assert same(mpl_arrays(figure_of(name, cases)), plotly_arrays(figure_of(name, cases)))


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
    locked = text.index("Locked: hunts, ±0.52 mm every 1.63 s. Raise the crossover by 1.75 Hz (to 9.75 Hz) or free the")
    free = text.index("Free (as given): settles to within 1 µm in 823 ms. Hunting is possible below 5.60 Hz.")
    assert locked < free < text.index("Counted peaks") < text.index("Does it hunt?") < text.index("The stage file")
    assert "The free joint stops the hunting." in text
    assert made_with().startswith(VERSION)  # then what other tests have registered
    assert f"friso {made_with()}, relative tolerance 1e-06" in text
    assert 'name = "Thesis rig"' in text


def test_report_opens_offline_and_holds_plotly_once(page):
    parsed = Page(page)
    assert all(address.startswith("data:image/svg+xml;base64,") for address in parsed.loads)
    assert page.count(plotly_renderer.script()) == 1
    assert page.count("Plotly.newPlot(") - plotly_renderer.script().count("Plotly.newPlot(") == 7
    assert "default-src 'none'" in page
    own = page.replace(plotly_renderer.script(), "")
    assert not re.findall(r"https?://[^\"'<> ]*", own)
    assert "sendChartToCloud" not in own


def test_report_holds_a_print_of_every_figure(page):
    prints = [address for address in Page(page).loads if address.startswith("data:image/svg+xml")]
    assert len(prints) == 7
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


def sentence(judgement: Judgement, cases: Any = None, locked: bool | None = None, **changes: Any) -> str:
    case = replace(fake_case(stage=fake_stage(locked=locked)), judgement=judgement, **changes)
    return verdict_sentence(ShownCase("given", "As given", "#000000", case), cases or {"given": case})


def test_an_unstable_loop_is_named_before_what_friction_makes_of_it():
    said = sentence(hunts(), unstable=("sticks", "slides"))
    assert said.startswith("the loop is unstable while the stage sticks and while the stage slides")
    assert "hunts, ±0.52 mm" in said


NEVER = {1e-6: None, 1e-5: None}


def test_a_stage_that_hunts_gets_a_remedy():
    assert sentence(hunts()) == "hunts, ±0.52 mm every 1.63 s. Raise the crossover by 1.75 Hz (to 9.75 Hz)."
    free = {"free": replace(fake_case(), judgement=settles())}
    assert sentence(hunts(), free, locked=True).endswith("by 1.75 Hz (to 9.75 Hz) or free the joint.")
    assert "joint" not in sentence(hunts(), free, locked=False)
    for known in (hunts(verdict="bistable"), settles(hunting=fake_hunting(certain=False)), settles(verdict="failed")):
        assert "joint" not in sentence(hunts(), {"free": replace(fake_case(), judgement=known)}, locked=True)
    none = sentence(hunts(margin=None), free, locked=True)
    assert none.endswith("s. Hunting is still possible at 10 times this bandwidth. Free the joint.")


def test_a_controller_by_its_gains_is_made_faster():
    gains = "kp × 1.49, ki × 1.82, kd × 1.22"
    faster = sentence(hunts(margin=Margin(1.22, None, True)))
    assert faster.endswith(f"Make the controller 1.22 times faster ({gains}).")
    slower = sentence(settles(margin=Margin(0.5, None, True)))
    assert slower.endswith("Hunting is possible with a controller more than 2 times slower.")


def test_a_bistable_stage_is_told_what_starts_its_hunting():
    starts = "a displacement of 1.72 mm, a push of 23.1 mm/s or 87 % of the moves tried"
    text = sentence(hunts(verdict="bistable"))
    assert text.startswith(f"settles after this move, but {starts} (like this one, 0.1 to 2 times its acceleration")
    assert "can start hunting, ±0.52 mm every 1.63 s. Raise the crossover by 1.75 Hz" in text
    none = hunts(verdict="bistable", displacement=Kick((), (1e-5, 0.1)), push=Kick((), (1e-3, 4.0)), moves=None)
    assert "none of the kicks and moves tried starts hunting (±0.52 mm every 1.63 s)" in sentence(none)


def test_a_transient_is_said_to_be_one():
    repels = fake_hunting(fake_cycle(multiplier=-1.0112))
    known = settles(verdict="transient", hunting=repels, settled_after=190.2, margin=Margin(0.975, 9.7496, True))
    text = sentence(known, peak_to_peak=6.9e-4, period=1.33)
    assert text == (
        "transient: no cycle attracts, but this motion has not settled at its end (still 690 µm peak to peak every "
        "1.33 s). Transients change slowly, by a factor of e in 73.1 s. It settles to within 10 µm in 190 s. Hunting "
        "is possible below 9.75 Hz."
    )
    long = sentence(settles(verdict="transient", settled_after=None), peak_to_peak=1e-7)
    assert "(at rest, but off its reference). It does not settle to within 10 µm in 1000 s either." in long
    assert sentence(cannot_hunt("transient"), peak_to_peak=0.383, period=6.36) == (
        "cannot hunt, because there is no friction to stick to; but this motion has not settled at its end "
        "(still 383 mm peak to peak every 6.36 s)."
    )


def test_a_stage_that_settles_is_told_where_hunting_begins():
    assert sentence(settles()) == "settles to within 1 µm in 823 ms. Hunting is possible below 5.60 Hz."
    assert sentence(settles(margin=None)).endswith("ms. No hunting was found down to 1/10 of this bandwidth.")
    assert sentence(cannot_hunt()).endswith("ms. It cannot hunt, because there is no friction to stick to.")
    coarse = sentence(settles(), settling_time={1e-6: None, 1e-5: 1.5})
    assert coarse.startswith("settles to within 10 µm in 1.50 s, but does not stay within 1 µm.")
    swings = sentence(settles(), settling_time=NEVER, peak_to_peak=7e-5)
    assert swings.startswith("settles, but not to within 10 µm (still 70.0 µm peak to peak).")


def test_what_is_not_certain_is_said():
    text = sentence(settles(hunting=fake_hunting(reason="no orbit could be closed", certain=False)))
    assert "This is not certain: no orbit could be closed; other motions may hunt." in text
    seen = hunts(hunting=fake_hunting(reason=NO_RETURN), margin=None, observed=True)
    text = sentence(seen, peak_to_peak=1.04e-3, period=1.63)
    assert text.startswith("hunts, 1.04 mm peak to peak every 1.63 s. This was observed in long simulations")
    assert sentence(settles(verdict="failed")) == "failed (solver: done)."


def row(name: str, judgement: Judgement, **changes: Any) -> str | None:
    item = ShownCase("given", "As given", "#000000", replace(fake_case(), judgement=judgement, **changes))
    return dict(rows((item,))).get(name, [None])[0]


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("Hunting cycle, amplitude", "±0.52 mm"),
        ("Hunting cycle, period", "1.628 s"),
        ("Hunting multiplier", "-0.9312 (simulated: -0.9311)"),
        ("Multiplier taken over", "half a period (Floquet)"),
        ("Other hunting cycles", None),
        ("Time constant of transients", "11.4 s"),
        ("Edge of hunting", "9.75 Hz"),
        ("Displacements that hunt", "1.72 to 10.8 mm, 22.7 to 43.3 mm, from 59.3 mm on (tried: 0.0173 to 156 mm)"),
        ("Pushes that hunt", "23.1 to 73.4 mm/s"),
        ("Moves that end in hunting", "87 % (80 to 92 %) of 128 moves"),
    ],
)
def test_rows_of_a_stage_that_hunts(name, text):
    assert row(name, hunts()) == text
    assert row(name, cannot_hunt()) is None


def test_rows_of_other_cycles():
    pair = fake_cycle(symmetric=False, multiplier=1.0105)
    repels = fake_cycle(multiplier=-1.01)
    assert row("Other hunting cycles", hunts(hunting=fake_hunting(fake_cycle(), pair))) == (
        "asymmetric, ±0.52 mm, repels"
    )
    assert row("Hunting cycle, amplitude", settles(hunting=fake_hunting(repels))) == "±0.52 mm (repels)"
    whole = hunts(hunting=fake_hunting(replace(pair, multiplier=-0.93, growth=np.nan)))
    assert row("Multiplier taken over", whole) == "a whole period (slope of the returns)"
    assert row("Hunting multiplier", whole) == "-0.9300"
    assert row("Edge of hunting", hunts(margin=Margin(1.22, None, True))) == "1.22 × as fast"


@pytest.mark.parametrize(
    ("windows", "text"),
    [
        ((), "none from 0.0100 to 100 mm"),
        (((1e-5, 0.1),), "all that were tried, 0.0100 to 100 mm"),
        (((1e-5, 2e-3), (3e-3, 4e-3)), "up to 2.00 mm, 3.00 to 4.00 mm (tried: 0.0100 to 100 mm)"),
        ([(i * 1e-3, i * 1e-3 + 5e-4) for i in range(1, 8)], "1.00 to 1.50 mm, 2.00 to 2.50 mm, 3.00 to 3.50 mm, "),
    ],
)
def test_windows_of_kicks(windows, text):
    found = row("Displacements that hunt", hunts(displacement=Kick(tuple(windows), (1e-5, 0.1))))
    assert found is not None
    assert found.startswith(text)
    assert found.endswith("and 3 more ranges") == (len(windows) == 7)


@pytest.mark.parametrize(
    ("judgement", "peaks", "text"),
    [
        (hunts(), 6, "6"),
        (hunts(), 0, "0 (only those after 10 s, above 100 µm, count)"),
        (hunts(verdict="bistable"), 0, "0 (another motion hunts)"),
        (settles(verdict="transient"), 8, "8 (a long transient)"),
        (settles(), 0, "0"),
    ],
)
def test_a_peak_count_that_contradicts_the_verdict_is_explained(judgement, peaks, text):
    assert row("Counted peaks", judgement, peaks=peaks) == text


def test_conclusion_names_what_the_joint_does():
    cases = both_joints()
    hunting, settled = cases["locked"], cases["free"]
    bistable, failed = (replace(settled, judgement=hunts(verdict=word)) for word in ("bistable", "failed"))
    assert conclusion({"locked": hunting, "free": settled}) == "The free joint stops the hunting."
    assert conclusion({"locked": hunting, "free": hunting}) == "The free joint does not stop the hunting."
    assert conclusion({"locked": hunting, "free": bistable}) == (
        "The free joint stops the hunting after this move, but does not rule it out."
    )
    assert conclusion({"locked": settled, "free": bistable}) == "The stage hunts only with its joint free."
    assert conclusion({"locked": settled, "free": settled}) is None
    assert conclusion({"given": hunting}) is None
    assert conclusion({"locked": hunting, "free": failed}) is None


def test_a_figure_file_opens_as_an_image(tmp_path):
    import matplotlib.image

    matplotlib_renderer.save(small_figure(), tmp_path / "small.PNG")
    assert matplotlib.image.imread(io.BytesIO((tmp_path / "small.PNG").read_bytes()), format="png").ndim == 3
