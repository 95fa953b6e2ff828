"""Test `friso bode` as a user runs it: what it computes, says, draws and refuses."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Mapping
from copy import copy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from inside import command_of, friso_inside
from pages import Page
from refusals import refused, rows_of
from snapshots import Snapshots

import friso
from friso.frequency.bode import Bode, Unstable, bode
from friso.questions.bode.blocks import bode_document
from friso.questions.bode.figures import bode_figures
from friso.questions.bode.numbers import rows
from friso.questions.bode.states import shown_states
from friso.questions.bode.words import details, sentences
from friso.shown.drawing import matplotlib_renderer, plotly_renderer
from friso.shown.drawing.drawable import drawable
from friso.shown.drawing.figure import Axis, Band, Figure, Panel, Series
from friso.shown.drawing.phases import phases
from friso.stage import Stage

command = command_of("bode")

EXAMPLES = Path(__file__).parent.parent / "examples"
RIG, EMPS = EXAMPLES / "thesis_rig.toml", EXAMPLES / "emps_axis.toml"
FIGURES = ("bode_loop", "bode_plant", "bode_speeds", "bode_nyquist", "bode_sensitivity")
MARGINS = {
    *("stable", "crossovers_hz", "phase_margin_deg", "gain_margin", "gain_reduction", "modulus_margin"),
    *("peak_sensitivity", "delay_margin_s", "closest_hz", "poles"),
}
RIGID = """
[masses]
stage = "2 kg"
[controller]
kind = "pid"
crossover = "10 Hz"
alpha = 0.1
beta = 2
[motion]
kind = "step"
size = "1 mm"
duration = "2 s"
"""


def run(folder: Path, *arguments: str, stage: Path = RIG) -> subprocess.CompletedProcess[str]:
    """Run the command in a folder."""
    return friso_inside(folder, "bode", stage, *arguments)


@pytest.fixture(scope="module")
def response(rig: Stage) -> Bode:
    return bode(rig)


@pytest.fixture(scope="module")
def unstable(rig: Stage) -> Bode:
    """Hardly any phase lead: stuck and sliding are unstable alike."""
    return bode(rig.replace({"controller.alpha": 0.9, "controller.beta": 1}))


@pytest.fixture(scope="module")
def emps() -> Bode:
    return bode(friso.load(EMPS))


@pytest.fixture(scope="module")
def rigid(tmp_path_factory: pytest.TempPathFactory) -> Bode:
    path = tmp_path_factory.mktemp("rigid") / "rigid.toml"
    path.write_text(RIGID)
    return bode(friso.load(path))


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], Path]:
    """The document of the rig, and the folder of its files."""
    folder = tmp_path_factory.mktemp("bode")
    done = run(folder, "--json", "--out", "out", "--frequencies", "0.1 Hz..1 kHz")
    assert (done.returncode, done.stderr) == (0, "")
    return _strict(done.stdout), folder / "out"


def _strict(text: str) -> dict[str, Any]:
    """A JSON document, in which infinite and undefined numbers have no place."""

    def refuse(name: str) -> None:
        raise AssertionError(f"{name} in the document")

    return json.loads(text, parse_constant=refuse)


@pytest.mark.slow
def test_minus_signs_reach_a_terminal_without_them(tmp_path: Path) -> None:
    (tmp_path / "rigid.toml").write_text(RIGID)
    command, environ = (
        [sys.executable, "-m", "friso", "bode", "rigid.toml"],
        {**os.environ, "PYTHONIOENCODING": "cp437"},
    )
    text = subprocess.run(command, cwd=tmp_path, env=environ, capture_output=True, check=True).stdout.decode("cp437")
    assert "Closest to -1" in text
    assert re.search(r"-\d+\.\d dB", text)
    assert "?" not in text


# ---------------------------------------------------------------- the document


def keys(text: str) -> set[str]:
    return {*text.split()}


@pytest.mark.thorough
def test_the_document_tells_margins_and_limits_of_the_rig(written: tuple[dict, Path]) -> None:
    document, _ = written
    assert document.keys() == keys(
        "conclusion stage cases worst worst_settled unstable_speeds_m_per_s limits files plug_ins cascade_loops "
        "highest_stable_crossover_hz still_stable_there"
    )
    assert document["stage"] == "Thesis rig"
    assert document["cases"].keys() == {"stuck", "sliding", "stuck-touched", "sliding-touched"}
    for name in ("worst", "worst_settled"):
        assert document[name].keys() == MARGINS | {"at"}
        assert document[name]["at"].keys() == keys("bias_n speed_m_per_s limiter forward")
    assert document["limits"].keys() == {"locked", "free"}
    for expected in document["limits"].values():
        assert expected.keys() == keys(
            "highest_stable_crossover_hz still_stable_there stable_hz modulus_margin_above_half_hz searched_hz"
        )
    sliding = document["cases"]["sliding"]
    assert sliding["crossovers_hz"] == pytest.approx([5.123, 9.009, 24.75], rel=1e-3)
    assert sliding["phase_margin_deg"] == pytest.approx(37.42, abs=0.01)
    assert (sliding["gain_margin"], sliding["gain_reduction"]) == (None, pytest.approx(0.1228, rel=1e-3))
    for case in document["cases"].values():
        assert case.keys() == MARGINS
        assert case["stable"]
        assert case["stable"] == all(real < 0 for real, _ in case["poles"])
        assert case["peak_sensitivity"] * case["modulus_margin"] == pytest.approx(1)
    worst = document["worst"]
    assert not worst["stable"]
    assert worst["modulus_margin"] is None
    assert worst["at"]["limiter"] == "free"
    assert worst["at"]["speed_m_per_s"] == pytest.approx(1.78e-3, rel=0.05)
    free, touched = document["unstable_speeds_m_per_s"]
    assert (free["limiter"], touched["limiter"]) == ("free", "touched")
    assert (free["low"], free["high"]) == pytest.approx((1.2225e-4, 3.9e-3), rel=1e-3)
    assert document["highest_stable_crossover_hz"] == 1e4
    assert document["limits"]["free"]["still_stable_there"]
    comfortable = document["limits"]["free"]["modulus_margin_above_half_hz"]
    assert np.ravel(comfortable) == pytest.approx([0.1, 0.651, 3.64, 14.3], rel=5e-3)


@pytest.mark.thorough
def test_the_highest_stable_crossover_is_that_of_the_joint_as_given(rig: Stage) -> None:
    slow = rig.replace({"drive.delay": "2 ms"})
    for locked in (True, False):
        document = bode_document(bode(slow.replace({"joint.locked": locked})))
        own = document["limits"]["locked" if locked else "free"]["highest_stable_crossover_hz"]
        assert document["highest_stable_crossover_hz"] == own
        assert own == pytest.approx(60.8 if locked else 21.1, rel=5e-3)
        assert (document["worst"]["at"]["limiter"] is None) == locked


@pytest.mark.slow
def test_series_adds_the_thesis_formula_beside(rig: Stage) -> None:
    loops = bode(rig, (1.0, 100.0), series=True)
    assert {"stuck-touched-series", "sliding-touched-series"} <= bode_document(loops)["cases"].keys()
    plant = _figures(loops)["bode_plant"].panels[0]
    dashed = {line.label: line for line in plant.series if line.dash == "dashed"}
    assert "Sliding, limiter in series" in dashed
    line = dashed["Stuck, limiter in series"]
    assert line.y == pytest.approx(np.abs(loops.cases["stuck-touched-series"].plant))
    assert plant.x.limits == pytest.approx((1.0, 100.0))
    assert (line.x[0], line.x[-1]) == pytest.approx((1.0, 100.0))


def test_the_last_crossover_and_its_phase_margin_are_marked(rig: Stage) -> None:
    loops = bode(rig)
    above, below = _figures(loops)["bode_loop"].panels
    margins = below.series[-len(above.markers) :]
    lines = above.series[: len(above.markers)]
    for mark, line, margin, case in zip(above.markers, lines, margins, loops.cases.values(), strict=True):
        assert mark.x == pytest.approx(case.margins.crossovers[-1:])
        assert mark.colour == line.colour
        assert line.label.endswith(f" {abs(margin.y[1] - margin.y[0]):.0f}°")
    last = loops.cases["sliding"].margins
    assert f" {last.phase_margin:.0f}°" in above.series[1].label


def test_a_controller_by_gains_has_factors_instead_of_crossovers(emps: Bode, snapshots: Snapshots) -> None:
    document = bode_document(emps)
    assert document["highest_stable_crossover_hz"] is None
    assert document["limits"]["given"] == {
        "highest_stable_crossover_factor": 1000.0,
        "still_stable_there": True,
        "stable_factor": [[0.01, 1000.0]],
        "modulus_margin_above_half_factor": [[0.01, 1000.0]],
        "searched_factor": [0.01, 1000.0],
    }
    assert document["cases"].keys() == {"stuck", "sliding"}
    assert document["cases"]["stuck"]["crossovers_hz"] == []
    assert document["cases"]["stuck"]["phase_margin_deg"] is None
    assert document["worst_settled"]["stable"]
    assert document["unstable_speeds_m_per_s"] == []
    texts = [*sentences(emps), *details(emps)]
    assert "20.4 N" in " ".join(texts)
    assert "crossover" not in " ".join(texts)
    snapshots.check("bode", "gains", "\n".join(texts))


@pytest.mark.slow
def test_a_rigid_stage_without_friction_has_the_one_case_given(rigid: Bode) -> None:
    document = bode_document(rigid)
    assert document["cases"].keys() == {"given"}
    assert document["worst"]["at"] == {
        "bias_n": 0.0,
        "speed_m_per_s": 0.0,
        "limiter": None,
        "forward": True,
        "gains": None,
    }
    assert document["limits"].keys() == {"given"}
    assert [item.label for item in shown_states(rigid)] == ["As given"]
    assert "0.73" in sentences(rigid)[0]
    figures = _figures(rigid)
    assert [*figures] == ["bode_loop", "bode_plant", "bode_nyquist", "bode_sensitivity"]
    assert not figures["bode_sensitivity"].panels[0].bands
    plant = figures["bode_plant"].panels
    assert [line.label for line in plant[0].series] == ["As given", "mass of 2 kg"]
    assert plant[1].series[0].y == pytest.approx(-180)
    for figure in figures.values():
        assert matplotlib_renderer.image(figure, "png")
        assert plotly_renderer.fragment(figure)


@pytest.mark.slow
def test_an_unstable_loop_is_a_plain_statement(unstable: Bode, snapshots: Snapshots) -> None:
    case = bode_document(unstable)["cases"]["sliding"]
    assert case["stable"] is False
    assert max(real for real, _ in case["poles"]) > 0
    nothing = ("phase_margin_deg", "gain_margin", "gain_reduction", "modulus_margin", "peak_sensitivity", "closest_hz")
    assert {name: case[name] for name in nothing} == dict.fromkeys(nothing)
    assert len(case["crossovers_hz"]) == 3
    figures = _figures(unstable)
    assert [line.label for line in figures["bode_sensitivity"].panels[0].series] == ["Stuck, limiter touched"]
    labels = [line.label.split(":")[0] for line in figures["bode_loop"].panels[0].series]
    assert labels[:3] == ["Stuck (unstable)", "Sliding (unstable)", "Stuck, limiter touched"]
    assert all(line.label.endswith("(unstable)") for line in figures["bode_speeds"].panels[0].series)
    first, why, fast = sentences(unstable)
    assert [word for word in ("8.00 Hz", "64.4 ms", "9.26 Hz") if word not in first] == []
    assert [word for word in ("stuck", "any speed") if word not in details(unstable)[0]] == []
    assert "Stribeck" not in why
    assert "stage file" not in fast
    snapshots.check("bode", "unstable", "\n".join([first, why, fast]))


# ---------------------------------------------------------------- what is said


def test_the_table_says_where_there_is_no_limit_and_no_margin(response: Bode) -> None:
    shown = shown_states(response)
    table = {name: dict(zip([item.label for item in shown], texts, strict=True)) for name, texts in rows(shown)}
    assert table["Gain margin"]["Sliding"] == "no limit"
    assert table["Gain margin downwards"]["Sliding"] == "−18.2 dB"
    assert table["Phase margin"]["Worst of the family"] == "–"
    assert table["Stable"]["Worst of the family"] == "no"
    assert table["State"]["Worst of the family"] == "sliding at 1.78 mm/s, limiter free"
    assert table["Unstable"]["Worst of the family"].startswith("grows e-fold in 2.9")
    assert table["Least damped pole"]["Stuck"] == "ζ = 0.01 at 301 Hz"
    assert "Unstable" not in dict(rows(shown[:4]))


def _but(response: Bode, **other: Any) -> Bode:
    """The analysis with other values, those that are computed when they are asked for included."""
    changed = copy(response)
    vars(changed).update({"limits": response.limits, **other})
    return changed


@pytest.mark.slow
def test_friction_that_rises_is_not_blamed(response: Bode) -> None:
    assert all(item.falling for item in response.unstable)
    risen = _but(response, unstable=(Unstable(1e-2, 1.0, False, True, falling=False, gains=""),))
    assert not any("Stribeck" in sentence for sentence in sentences(risen))
    assert any("Stribeck" in sentence for sentence in sentences(response))


@pytest.mark.slow
def test_the_state_that_is_lost_first_is_named(rig: Stage) -> None:
    """Tuned for too light a mass, the loop of a sliding cart is too slow for its integral action."""
    texts = details(bode(rig.replace({"controller.tuned_mass": "0.2 kg"})))
    for joint, highest in (("locked", "8.41 Hz"), ("free", "5.92 Hz")):
        (text,) = (text for text in texts if text.startswith(f"Joint {joint}"))
        assert "lost first: sliding fast" in text.partition(highest)[2]


def test_what_the_stage_file_lacks_is_named(response: Bode, rig: Stage, snapshots: Snapshots) -> None:
    bare = sentences(response)[-1]
    assert [key for key in ("10.0 kHz", "drive.sample_time", "drive.delay") if key not in bare] == []
    *_, sampled = sentences(_but(response, stage=rig.replace({"drive.sample_time": "50 us", "drive.delay": "0 s"})))
    assert "drive." not in sampled
    snapshots.check("bode", "caveats", f"{bare}\n{sampled}")


# ---------------------------------------------------------------- figures and page


@pytest.mark.thorough
def test_files_and_page(written: tuple[dict, Path]) -> None:
    _, folder = written
    pictures = {f"{name}.{form}" for name in FIGURES for form in ("png", "svg", "pdf")}
    assert {path.name for path in folder.iterdir()} == pictures | {"bode.html"}
    assert (folder / "bode_plant.png").read_bytes().startswith(b"\x89PNG")
    assert (folder / "bode_nyquist.pdf").read_bytes().startswith(b"%PDF")
    page = Page((folder / "bode.html").read_text(encoding="utf-8"))
    assert all(address.startswith("data:") for address in page.loads)
    assert page.tags.count("img") == len(FIGURES)


def _figures(response: Bode) -> Mapping[str, Figure]:
    return {figure.name: figure for figure in bode_figures(response)}


def test_the_plant_is_drawn_with_its_mass_lines(response: Bode) -> None:
    magnitude, phase = _figures(response)["bode_plant"].panels
    lines = {line.label: line for line in magnitude.series}
    assert [*lines] == [
        *("Stuck", "Sliding", "Stuck, limiter touched", "Sliding, limiter touched"),
        *("mass of 1.7 kg", "mass of 0.5 kg"),
    ]
    assert lines["Sliding"].y == pytest.approx(np.abs(response.cases["sliding"].plant))
    assert lines["mass of 0.5 kg"].y * response.omega**2 == pytest.approx(2.0)
    assert drawable(_figures(response)["bode_plant"]).panels[0].y.label == "Magnitude [m/N]"
    starts = [line.y[0] for line in phase.series]
    viscous = -90 - np.degrees(np.arctan(response.omega[0] * 1.7 / 0.5))
    assert starts == pytest.approx([0, viscous, 0, viscous], abs=1)
    assert [line.y[-1] for line in phase.series] == pytest.approx([-180] * 4, abs=2)


def test_loops_cross_0_db_where_the_table_says(response: Bode) -> None:
    magnitude, phase = _figures(response)["bode_loop"].panels
    (sliding,) = (line for line in magnitude.series if line.label.startswith("Sliding: "))
    passes = np.flatnonzero(np.diff(np.sign(sliding.y)))
    expected = response.cases["sliding"].margins.crossovers
    assert sliding.x[passes] == pytest.approx(expected, rel=0.02)
    assert [limit.values for limit in (*magnitude.limits, *phase.limits)] == [(0.0,), (-180.0,)]


def test_loops_at_prescribed_speeds(response: Bode) -> None:
    magnitude, phase = _figures(response)["bode_speeds"].panels
    solid = ["stuck", "1 µm/s", "10 µm/s", "100 µm/s", "10 mm/s", "100 mm/s"]
    assert [line.label for line in magnitude.series if line.dash == "solid"] == solid
    assert [line.label for line in magnitude.series if line.dash == "dashed"] == ["1 mm/s (unstable)"]
    assert magnitude.series[3].y == pytest.approx(20 * np.log10(np.abs(response.prescribed[3].loop)))
    assert len({line.colour for line in magnitude.series}) == 7
    assert [line.y[-1] for line in phase.series] == pytest.approx([-180] * 7, abs=2)


@pytest.mark.slow
def test_nyquist_has_equal_scales_the_point_and_the_circle(response: Bode) -> None:
    figure = _figures(response)["bode_nyquist"]
    (panel,) = figure.panels
    (circle,) = (line for line in panel.series if line.label == "modulus margin 0.5")
    assert np.hypot(circle.x + 1, circle.y) == pytest.approx(0.5)
    assert (panel.markers[0].x[0], panel.markers[0].y[0]) == (-1, 0)
    (stuck,) = (line for line in panel.series if line.label == "Stuck")
    assert stuck.x + 1j * stuck.y == pytest.approx(response.cases["stuck"].loop)
    least = min(np.hypot(stuck.x + 1, stuck.y))
    assert least == pytest.approx(response.cases["stuck"].margins.modulus_margin, rel=1e-3)
    assert {"stable states of the family", "unstable states of the family"} <= {line.label for line in panel.series}
    canvas = matplotlib_renderer.render(figure)
    canvas.draw_without_rendering()
    box = canvas.axes[0].get_window_extent()
    (x0, x1), (y0, y1) = canvas.axes[0].get_xlim(), canvas.axes[0].get_ylim()
    assert box.width / (x1 - x0) == pytest.approx(box.height / (y1 - y0))
    assert plotly_renderer.render(figure).layout.yaxis.scaleanchor == "x"


def test_the_band_of_the_sensitivity_holds_the_stable_states(response: Bode) -> None:
    figure = _figures(response)["bode_sensitivity"]
    (panel,) = figure.panels
    (band,) = panel.bands
    stable = response.scan.stable
    sensitivity = 1 / np.abs(1 + response.loops[stable])
    assert 10 ** (band.low / 20) == pytest.approx(sensitivity.min(axis=0))
    assert 10 ** (band.high / 20) == pytest.approx(sensitivity.max(axis=0))
    assert [int(number) for number in re.findall(r"\b\d+\b", figure.note)] == [stable.sum(), (~stable).sum()]
    (six,) = panel.limits
    assert six.values[0] == pytest.approx(6.02, abs=0.01)
    for line in panel.series:
        assert (line.y >= band.low - 1e-6).all()
        assert (line.y <= band.high + 1e-6).all()


def test_phases_do_not_jump() -> None:
    s = 1j * np.geomspace(1e-2, 1e2, 400)
    mass, triple, late = 1 / s**2, 1 / s**3, np.exp(-s) / s**2
    undamped = 1 / (s**2 + 1)
    negative = (s + 1) / (s * (s - 1))  # begins with 90 degrees lead, or 270 lag
    assert phases([mass])[0] == pytest.approx(-180)
    assert phases([triple])[0] == pytest.approx(-270)
    assert phases([late])[0] == pytest.approx(-180 - np.degrees(s.imag))
    assert np.unique(phases([undamped])[0].round()).tolist() == [-180, 0]
    one, other = phases([1 / s, negative])
    assert (one[0], one[-1]) == pytest.approx((-90, -90))
    assert (other[0], other[-1]) == pytest.approx((-270, -90), abs=2)


# ---------------------------------------------------------------- what figures learned for this


def banded() -> Figure:
    x = np.linspace(0, 2e-3, 5)
    band = Band(x, -1e-3 * x, 2e-3 * x, "between", "#c9c9c9")
    line = Series(x, 1e-3 * x, "line", "#000000")
    y = Axis("Deviation", "m", (-4e-6, 4e-6), step=2e-6)
    return Figure("banded", "Banded", "", (Panel("", Axis("Time", "s", prefixed=False), y, (line,), bands=(band,)),))


def test_a_band_is_prefixed_and_drawn_alike_under_its_label() -> None:
    figure = banded()
    (panel,) = drawable(figure).panels
    assert (panel.y.unit, panel.y.step) == ("µm", pytest.approx(2.0))
    assert panel.x.unit == "s"
    assert panel.bands[0].high[-1] == pytest.approx(4.0)
    canvas, page = matplotlib_renderer.render(figure), plotly_renderer.render(figure)
    (axes,) = canvas.axes
    (patch,) = axes.patches
    paper = [*np.asarray(patch.get_xy()).T, *axes.lines[0].get_data()]  # type: ignore[attr-defined]
    drawn, named = page.data[:2], page.data[2:]
    for one, other in zip(paper, (part for trace in drawn for part in (trace.x, trace.y)), strict=True):
        assert one == pytest.approx(other)
    (legend,) = canvas.legends
    assert [text.get_text() for text in legend.get_texts()] == [trace.name for trace in named] == ["between", "line"]
    canvas.draw_without_rendering()
    assert np.diff(axes.get_yticks()) == pytest.approx(2.0)
    assert page.layout.yaxis.dtick == pytest.approx(2.0)


def test_a_band_with_gaps_or_of_two_lengths_is_refused() -> None:
    x = np.arange(3.0)
    with pytest.raises(ValueError, match="a band has no gaps"):
        Band(x, x, np.array([0.0, np.nan, 1.0]), "between", "#000000")
    with pytest.raises(ValueError, match=r"x has the shape \(3,\), y \(2,\); expected one length"):
        Band(x, x[:2], x, "between", "#000000")


# ---------------------------------------------------------------- what is refused


REFUSED = (
    *("1 kHz..0.1 Hz", "1 Hz..1 Hz", "0 Hz..1 kHz", "-1 Hz..1 kHz", "1 Hz..1e20 Hz", "1 Hz..", "..1 kHz", "1 Hz", ""),
    *("1..100", "1 m..2 m", "1 Hz..2 Hz..3 Hz"),
)


@pytest.mark.cases(first=11)
@pytest.mark.parametrize(
    "options",
    [
        *({"frequencies": text} for text in REFUSED),
        {"set": ['drive.sample_time="1 ms"'], "frequencies": "1 Hz..600 Hz"},
        {"set": ['drive.sample_time="100 ms"']},
        {"set": ['controller.crosover="8 Hz"']},
        {"set": ["crossover"]},
        {"out": Path(__file__)},
    ],
)
def test_options_that_are_refused(options: dict[str, Any]) -> None:
    with refused():
        command(RIG, **options)


@pytest.mark.slow
def test_half_the_sampling_frequency_itself_is_shown(capsys: pytest.CaptureFixture) -> None:
    command(RIG, set=['drive.sample_time="1 ms"'], frequencies="1 Hz..500 Hz", as_json=True)
    assert _strict(capsys.readouterr().out)["stage"] == "Thesis rig"


def test_wrong_input_ends_in_one_message_and_status_2(tmp_path: Path) -> None:
    text = RIG.read_text()
    (tmp_path / "bare.toml").write_text(text[: text.index("\n[controller]")] + text[text.index("\n[motion]") :])
    for stage, options in ((tmp_path / "bare.toml", ("--out", "out")), (RIG, ("--frequencies", "2 Hz..1 Hz"))):
        done = run(tmp_path, *options, stage=stage)
        assert (done.returncode, done.stdout) == (2, "")
        assert rows_of(done.stderr)
        assert "Traceback" not in done.stderr
    assert not (tmp_path / "out").exists()
