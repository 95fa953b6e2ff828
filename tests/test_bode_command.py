"""Test `friso bode` as a user runs it: what it computes, says, draws and refuses."""

import subprocess
from collections.abc import Mapping
from copy import copy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from inside import command_of, friso_inside, strict_json
from pages import Page
from snapshots import Snapshots

import friso
from friso.frequency.bode import Bode, Unstable, bode
from friso.questions.bode.figures import bode_figures
from friso.questions.bode.numbers import rows, shown_states
from friso.questions.bode.words import bode_document, details, sentences
from friso.shown.drawing import matplotlib_renderer, plotly_renderer
from friso.shown.drawing.figure import Figure, phases
from friso.stage import Stage

command = command_of("bode")

EXAMPLES = Path(__file__).parent.parent / "examples"
RIG, EMPS = EXAMPLES / "thesis_rig.toml", EXAMPLES / "emps_axis.toml"
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
    return strict_json(done.stdout), folder / "out"


# ---------------------------------------------------------------- the document


@pytest.mark.thorough
def test_the_document_tells_margins_and_limits_of_the_rig(written: tuple[dict, Path]) -> None:
    document, _ = written
    assert document["cases"].keys() == {"stuck", "sliding", "stuck-touched", "sliding-touched"}
    assert document["limits"].keys() == {"locked", "free"}
    sliding = document["cases"]["sliding"]
    assert sliding["crossovers_hz"] == pytest.approx([5.123, 9.009, 24.75], rel=1e-3)
    assert sliding["phase_margin_deg"] == pytest.approx(37.42, abs=0.01)
    assert (sliding["gain_margin"], sliding["gain_reduction"]) == (None, pytest.approx(0.1228, rel=1e-3))
    for case in document["cases"].values():
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


def test_the_last_crossover_is_marked(rig: Stage) -> None:
    loops = bode(rig)
    above, _ = _figures(loops)["bode_loop"].panels
    lines = above.series[: len(above.markers)]
    for mark, line, case in zip(above.markers, lines, loops.cases.values(), strict=True):
        assert mark.x == pytest.approx(case.margins.crossovers[-1:])
        assert mark.colour == line.colour


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
    table = [f"{name}: {' | '.join(texts)}" for name, texts in rows(shown_states(emps))]
    snapshots.check("bode", "gains", "\n".join([*sentences(emps), *details(emps), *table]))


@pytest.mark.slow
def test_a_rigid_stage_without_friction_has_the_one_case_given(rigid: Bode) -> None:
    document = bode_document(rigid)
    assert document["cases"].keys() == {"given"}
    assert (document["worst"]["at"]["speed_m_per_s"], document["worst"]["at"]["limiter"]) == (0.0, None)
    assert document["limits"].keys() == {"given"}
    figures = _figures(rigid)
    assert [*figures] == ["bode_loop", "bode_plant", "bode_nyquist", "bode_sensitivity"]
    assert not figures["bode_sensitivity"].panels[0].bands
    plant = figures["bode_plant"].panels
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
    assert len(figures["bode_sensitivity"].panels[0].series) == 1  # of the states that are stable
    snapshots.check("bode", "unstable", "\n".join([*sentences(unstable), details(unstable)[0]]))


# ---------------------------------------------------------------- what is said


def _but(response: Bode, **other: Any) -> Bode:
    """The analysis with other values, those that are computed when they are asked for included."""
    changed = copy(response)
    vars(changed).update({"limits": response.limits, **other})
    return changed


@pytest.mark.slow
def test_words(response: Bode, rig: Stage, snapshots: Snapshots) -> None:
    """Friction that rises is not blamed. Tuned for too light a mass, the loop of a sliding cart is too slow for its
    integral action."""
    risen = _but(response, unstable=(Unstable(1e-2, 1.0, False, True, falling=False, gains=""),))
    sampled = _but(response, stage=rig.replace({"drive.sample_time": "50 us", "drive.delay": "0 s"}))
    light = details(bode(rig.replace({"controller.tuned_mass": "0.2 kg"})))
    lost = [text for text in light if text.startswith("Joint")]
    said = {"given": sentences(response), "risen": sentences(risen), "sampled": sentences(sampled), "light": lost}
    snapshots.check("bode", "sentences", "\n".join(f"{name}: {' '.join(texts)}" for name, texts in said.items()))


# ---------------------------------------------------------------- figures


@pytest.mark.thorough
def test_the_page_opens_offline(written: tuple[dict, Path]) -> None:
    page = Page((written[1] / "bode.html").read_text(encoding="utf-8"))
    assert all(address.startswith("data:") for address in page.loads)
    assert page.tags.count("img") == len([*written[1].glob("*.png")]) == 5


def _figures(response: Bode) -> Mapping[str, Figure]:
    return {figure.name: figure for figure in bode_figures(response)}


def test_the_plant_is_drawn_with_its_mass_lines(response: Bode) -> None:
    magnitude, phase = _figures(response)["bode_plant"].panels
    lines = {line.label: line for line in magnitude.series}
    assert lines["Sliding"].y == pytest.approx(np.abs(response.cases["sliding"].plant))
    assert lines["mass of 0.5 kg"].y * response.omega**2 == pytest.approx(2.0)
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


def test_the_band_of_the_sensitivity_holds_the_stable_states(response: Bode) -> None:
    figure = _figures(response)["bode_sensitivity"]
    (panel,) = figure.panels
    (band,) = panel.bands
    stable = response.scan.stable
    sensitivity = 1 / np.abs(1 + response.loops[stable])
    assert 10 ** (band.low / 20) == pytest.approx(sensitivity.min(axis=0))
    assert 10 ** (band.high / 20) == pytest.approx(sensitivity.max(axis=0))
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


# ---------------------------------------------------------------- what is refused
