"""Test `friso flexure` as a user runs it: what it computes, says, draws and refuses."""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer
from inside import command_of, friso_inside
from pages import Page
from refusals import refused
from snapshots import Snapshots

import friso
from friso.leaf_springs.beams import BeamFailure
from friso.leaf_springs.both_models import BEAMS, CLOSED, BothModels, both_models
from friso.leaf_springs.evaluation import Mode
from friso.leaf_springs.mechanism import Mechanism
from friso.questions.flexure.blocks import flexure_document
from friso.questions.flexure.drawing import block_size, drawing_figure
from friso.questions.flexure.figures import VIEWS, best_view, flexure_figures, modes_figure
from friso.questions.flexure.numbers import rows
from friso.questions.flexure.question import EXAMPLE, FlexureAnswer
from friso.questions.flexure.words import assumptions, findings, sentences, warnings
from friso.shown.drawing.matplotlib_renderer import image
from friso.stage import Stage

command = command_of("flexure")

RIG = Path(__file__).parent.parent / "examples" / "thesis_rig.toml"
FIGURES = ("flexure_drawing", "flexure_force", "flexure_support", "flexure_modes")
LEAVES = """
[flexure]
leaves = 2
length = "70 mm"
width = "45 mm"
thickness = "0.35 mm"
spacing = "60 mm"
young = "210 GPa"
poisson = 0.3
density = "7850 kg/m^3"
yield = "1.1 GPa"
"""
LISTED = (
    "model stroke_m drive_stiffness_n_per_m drive_stiffness_under_load_n_per_m drive_stiffness_at_stroke_n_per_m "
    "nonlinearity support_stiffness_n_per_m eigenfrequencies_hz names interferes first_interfering_hz max_stress_pa "
    "clamp_stress_pa stress_concentration yield_margin fatigue_margin shortening_m buckling_load_n "
    "buckling_load_per_leaf_n buckling_margin stiffness_zero stiffness_full deflections_m forces_n"
)
KEYS = {*LISTED.split()}
MATERIAL = {**dict.fromkeys(("flexure.young", "flexure.poisson", "flexure.density", "flexure.yield"))}


def with_leaves(table: str = LEAVES) -> str:
    """The thesis rig, its joint made of leaf springs."""
    text = RIG.read_text()
    start, end = text.index("\n[parasitic]"), text.index("\n[controller]")
    return text[:start].replace('stiffness = "2.4 N/mm"\n', "") + table + text[end:]


def of_material(stage: Stage, name: str) -> Stage:
    return stage.replace({**MATERIAL, "flexure.material": name})


def evaluated(stage: Stage, stroke: float = 1e-3) -> BothModels:
    return both_models(stage, Mechanism.of(stage.flat()), stroke)


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("leaves") / "leaves.toml"
    file.write_text(with_leaves())
    return file


@pytest.fixture(scope="module")
def stage(path: Path) -> Stage:
    return friso.load(path)


@pytest.fixture(scope="module")
def models(stage: Stage) -> BothModels:
    return evaluated(stage)


@pytest.fixture(scope="module")
def folder(path: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of all files, written once."""
    out = tmp_path_factory.mktemp("flexure")
    command(path, out=out)
    return out


@pytest.fixture
def broken(monkeypatch: pytest.MonkeyPatch) -> None:
    """Beams that find no answer."""

    def fail(mechanism: Mechanism, stroke: float) -> None:
        raise BeamFailure("The beams find no equilibrium at a deflection of 1 mm: reduce the stroke.")

    monkeypatch.setattr("friso.leaf_springs.both_models.beams", fail)


def _strict(text: str) -> dict[str, Any]:
    """A JSON document, in which infinite and undefined numbers have no place."""

    def refuse(name: str) -> None:
        raise AssertionError(f"{name} in the document")

    return json.loads(text, parse_constant=refuse)


# ---------------------------------------------------------------- the document


@pytest.mark.parametrize(("stroke", "expected"), [(None, 1e-3), ("500 um", 5e-4)])
def test_the_document_has_the_agreed_keys(path: Path, capsys: Any, stroke: str | None, expected: float) -> None:
    command(path, stroke=stroke, as_json=True)
    shown = capsys.readouterr()
    document = _strict(shown.out)
    assert shown.err == ""
    assert document.keys() == KEYS | {"conclusion", "stage", "failure", "closed_forms", "files", "plug_ins"}
    assert document["closed_forms"].keys() == KEYS
    assert (document["stage"], document["failure"]) == ("Thesis rig", None)
    assert (document["model"], document["closed_forms"]["model"]) == ("beams", "closed forms")
    assert np.shape(document["stiffness_zero"]) == np.shape(document["stiffness_full"]) == (6, 6)
    assert len(document["deflections_m"]) == len(document["forces_n"])
    assert (document["stroke_m"], document["deflections_m"][-1]) == (expected, expected)
    assert len(document["eigenfrequencies_hz"]) == len(document["names"]) == len(document["interferes"])
    assert document["fatigue_margin"] is None


@pytest.mark.parametrize("model", ["beams", "closed forms"])
def test_the_document_tells_what_textbooks_and_shells_say(models: BothModels, model: str) -> None:
    document = flexure_document(models)
    expected = document if model == "beams" else document["closed_forms"]
    assert expected["model"] == model
    assert expected["drive_stiffness_n_per_m"] == pytest.approx(2540, rel=0.01)  # shells; a beam has 2362.5
    support = expected["support_stiffness_n_per_m"]
    assert support["x"]["zero"] == pytest.approx(96.0e6, rel=2e-3)  # shells; a rod has 94.5
    assert support["x"]["full"] == pytest.approx(84.9e6, rel=0.01)  # shells
    assert support["y"]["zero"] == pytest.approx(17.58e6, rel=5e-3)  # shells; a beam has 17.06
    assert expected["max_stress_pa"] == pytest.approx(51.8e6, rel=0.02)  # shells, at mid-width
    assert expected["clamp_stress_pa"] == pytest.approx(1.5 * expected["max_stress_pa"])
    assert expected["yield_margin"] == pytest.approx(1.1e9 / expected["clamp_stress_pa"])
    assert expected["shortening_m"] == pytest.approx(3 * 1e-3**2 / (5 * 0.07), rel=5e-3)
    assert expected["buckling_load_n"] == 2 * expected["buckling_load_per_leaf_n"]
    assert expected["buckling_margin"] == pytest.approx(expected["buckling_load_n"] / (0.5 * 9.80665))
    assert expected["eigenfrequencies_hz"][0] == pytest.approx(11.3, rel=0.01)
    assert expected["forces_n"][-1] == pytest.approx(expected["drive_stiffness_n_per_m"] * 1e-3, rel=5e-3)


def test_modes_that_interfere_with_control_are_told_from_the_drive(models: BothModels) -> None:
    document = flexure_document(models)
    assert document["names"][0] == "drive"
    assert document["interferes"][0] is False
    first = document["interferes"].index(True)
    assert document["first_interfering_hz"] == document["eigenfrequencies_hz"][first] == pytest.approx(390, rel=0.03)
    for model in models.models.values():
        assert next((mode for mode in model.modes[1:] if mode.interferes), None) is model.interfering
        expected = [False, *(mode.interferes for mode in model.modes[1:])]
        assert [model.interferes(mode) for mode in model.modes] == expected


def test_a_failure_of_the_beams_leaves_the_closed_forms(broken: None, path: Path, capsys: Any) -> None:
    with pytest.raises(typer.Exit) as leave:
        command(path, as_json=True)
    assert leave.value.exit_code == 1
    shown = capsys.readouterr()
    document = _strict(shown.out)
    assert document["model"] == "closed forms"
    assert "no equilibrium at a deflection of 1 mm" in document["failure"]
    assert document["failure"] in " ".join(shown.err.split())
    with pytest.raises(typer.Exit):
        command(path)
    text = " ".join(capsys.readouterr().out.split())
    assert document["failure"] in text
    assert (BEAMS in text, CLOSED in text) == (False, True)


# ---------------------------------------------------------------- what is said


def test_the_table_has_a_row_for_each_mode_by_name(models: BothModels) -> None:
    table = dict(rows(models))
    assert table["Drive stiffness"] == ["2.54 N/mm", "2.54 N/mm"]
    assert table["Support stiffness x, straight"] == ["96.1 N/µm", "96.1 N/µm"]
    assert table["Margin to fatigue"] == ["unknown", "unknown"]
    assert table["Concentration factor at the clamp"] == ["1.5", "1.5"]
    assert "interferes" not in "".join(table["Mode: drive"])
    assert all(text.endswith("Hz (interferes)") for text in table["Mode: leaf bending, in phase"])
    assert {f"Mode: {mode.name}" for mode in models.best.modes} <= table.keys()
    assert sum(name.startswith("Mode: ") for name in table) >= len(models.best.modes)


def test_a_sound_joint_has_no_warnings_and_a_largest_stroke(stage: Stage) -> None:
    evaluation = evaluated(of_material(stage, "stainless 1.4310"))
    assert warnings(evaluation) == []
    largest = evaluation.best.fatigue_margin  # of a stroke of 1 mm
    assert f"{largest:.2f} mm" in " ".join(findings(evaluation))


@pytest.mark.parametrize(
    ("changes", "stroke", "warning"),
    [
        ({"flexure.thickness": "1 mm"}, 8e-3, "yield"),
        ({"flexure.fatigue": "60 MPa"}, 1e-3, "fatigue"),
        ({"flexure.thickness": "0.05 mm", "masses.stage": "5 kg"}, 1e-4, "49.0 N"),
        ({"friction.static": "2 N"}, 1e-3, "2.54 N"),
    ],
)
def test_what_the_leaves_do_not_bear_is_a_warning(stage: Stage, changes: Any, stroke: float, warning: str) -> None:
    assert any(warning in text for text in warnings(evaluated(stage.replace(changes), stroke)))


def test_models_that_differ_are_a_warning(models: BothModels) -> None:
    assert not any("differ" in said for said in warnings(models))
    assert models.beams is not None
    other = replace(models, beams=replace(models.beams, stress=models.beams.stress * 0.8, drive=models.beams.drive * 2))
    (text,) = (texts for texts in warnings(other) if "differ" in texts)
    assert "-50 %" in text
    assert "+2" in text


def test_actuator_and_sensor_that_move_against_each_other_are_a_warning(stage: Stage) -> None:
    sound = {"flexure.material": "stainless 1.4310", **MATERIAL}
    across = {"flexure.actuation_y": "20 mm"}
    alike, against = (
        evaluated(stage.replace({**sound, **across, "flexure.sensor_y": place})) for place in ("20 mm", "-20 mm")
    )
    assert warnings(alike) == []
    (texts,) = warnings(against)
    modes = [mode for mode in against.best.modes[1:] if mode.interferes and mode.actuator * mode.sensor < 0]
    assert "stage about x" in [mode.name for mode in modes]
    named = " and ".join(f"{mode.name} ({mode.frequency / 1e3:.2f} kHz)" for mode in modes)
    assert named in texts
    assert "[parasitic]" in texts


def test_only_what_is_left_out_is_assumed(stage: Stage) -> None:
    inputs = {f"flexure.{name}_x": "30 mm" for name in ("centre", "actuation", "sensor")} | {"flexure.load": "0 N"}
    inertia = {f"flexure.inertia_{axis}": "2e-4 kg*m^2" for axis in "xyz"}
    assert assumptions(stage.replace({**inputs, **inertia})) == []
    (text,), (everything,) = assumptions(stage.replace(inputs)), assumptions(stage)
    words = ("moments of inertia of an aluminium block of 0.5 kg", "centre of mass", "actuation", "sensor", "no load")
    assert [word in text for word in words] == [True, False, False, False, False]
    assert all(word in everything for word in words)


def test_without_a_mode_that_interferes_there_is_no_limit(models: BothModels, snapshots: Snapshots) -> None:
    quiet = tuple(replace(mode, peak=0.0) for mode in models.closed.modes)
    alone = BothModels(models.stage, replace(models.closed, modes=quiet), None, "singular at step 7")
    assert flexure_document(alone)["first_interfering_hz"] is None
    assert "singular at step 7" in Page(str(FlexureAnswer(alone).files()["flexure.html"])).text
    snapshots.check("flexure", "closed forms alone", "\n".join(sentences(alone)))


# ---------------------------------------------------------------- figures and page


@pytest.mark.slow
def test_files_and_page(folder: Path) -> None:
    pictures = {f"{name}.{form}" for name in FIGURES for form in ("png", "svg", "pdf")}
    assert {path.name for path in folder.iterdir()} == pictures | {"flexure.html"}
    assert (folder / "flexure_modes.png").read_bytes().startswith(b"\x89PNG")
    assert (folder / "flexure_force.pdf").read_bytes().startswith(b"%PDF")
    page = Page((folder / "flexure.html").read_text(encoding="utf-8"))
    assert all(address.startswith("data:") for address in page.loads)
    assert (page.tags.count("img"), page.tags.count("svg")) == (len(FIGURES), 0)
    for words in ("The joint: 2 leaves", "Closed forms", "Buckling load", "Force over the stroke"):
        assert words in page.text
    assert "thickness = " in page.text


def test_force_and_supports_are_drawn_by_both_models(models: BothModels) -> None:
    _, force, support, _ = flexure_figures(models)
    (panel,) = force.panels
    assert [line.label for line in panel.series] == [BEAMS, CLOSED, "initial stiffness"]
    assert (panel.series[0].x[-1], panel.series[0].y[-1]) == pytest.approx((1e-3, models.best.forces[-1]))
    assert panel.series[2].y[-1] == pytest.approx(models.best.drive[0] * 1e-3)
    for panel, expected in zip(support.panels, (models.best.support_x, models.best.support_y), strict=True):
        assert [line.label for line in panel.series] == [BEAMS, CLOSED]
        assert panel.markers[0].y * 1e6 == pytest.approx(expected)
        assert (panel.series[0].y[0] * 1e6, panel.series[0].y[-1] * 1e6) == pytest.approx((expected[0], expected[-1]))


def test_modes_are_drawn_with_their_names_and_who_sees_them(models: BothModels) -> None:
    figure = modes_figure(models.best)
    titles = [panel.title for panel in figure.panels]
    assert titles[0].startswith("drive, 11.3 Hz")
    assert not any("torsion" in title for title in titles)  # whose middle lines rest
    labels = {panel.title.rsplit(", ", 1)[0]: panel.series[1].label for panel in figure.panels}
    assert labels["leaf bending, in phase"] == "seen by actuator and sensor"
    assert labels["leaf bending, out of phase"] == "not seen by both"
    for panel in figure.panels:
        assert panel.equal
        for line in panel.series:
            for values, axis in ((line.x, panel.x), (line.y, panel.y)):
                low, high = axis.limits or (math.nan, math.nan)
                assert (np.nanmin(values) >= low, np.nanmax(values) <= high) == (True, True)
    rest, moved = figure.panels[0].series
    shift = moved.y - rest.y
    block = slice(-6, -1)
    assert np.ptp(shift[block]) < 0.1 * abs(shift[block]).max()  # the drive moves the stage as a whole
    assert moved.x[block] == pytest.approx(rest.x[block], abs=1e-3)
    assert shift[0] == pytest.approx(0, abs=1e-12)  # at the cart


@pytest.mark.parametrize(
    ("stage_motion", "view"),
    [
        ((0, 0, 1, 0, 0, 0), "from the side"),
        ((1, 0, 0, 0, 0, 0), "from the side"),
        ((0, 0, 0, 0, 20, 0), "from the side"),
        ((0, 1, 0, 0, 0, 0), "from above"),
        ((0, 0, 0, 0, 0, 20), "from above"),
        ((0, 0, 0, 20, 0, 0), "along the leaves"),
    ],
)
def test_a_mode_is_seen_from_where_it_moves(models: BothModels, stage_motion: tuple[float, ...], view: str) -> None:
    mode = Mode("some", 1.0, 0.0, 0.0, 0.0, np.array(stage_motion, float), np.zeros((2, 17, 3)))
    assert best_view(models.mechanism, mode) == view
    assert view in VIEWS


# ---------------------------------------------------------------- the drawing


SHAPES = [
    {},
    {"flexure.leaves": 6, "flexure.length": "15 mm", "flexure.width": "60 mm", "flexure.thickness": "0.1 mm"},
    {"flexure.leaves": 3, "flexure.length": "120 mm", "flexure.width": "10 mm", "flexure.sensor_z": "200 mm"},
    {"flexure.length": "30 mm", "flexure.spacing": "4 mm", "flexure.actuation_x": "-80 mm"},
    {"flexure.length": "7 m", "flexure.width": "4 m", "flexure.spacing": "5 m"},
]


@pytest.mark.parametrize("changes", SHAPES)
@pytest.mark.parametrize("stroke", [1e-5, 1e-3, 7e-3])
def test_the_drawing_is_to_scale_and_tells_all_dimensions(stage: Stage, changes: dict[str, Any], stroke: float) -> None:
    value = Mechanism.of(stage.replace(changes).flat())
    figure = drawing_figure(value, stroke, "steel")
    for length in (value.length, value.width, value.thickness, value.spacing, stroke):
        assert f"{1e3 * length:.4g}" in figure.caption
    assert "steel" in figure.caption
    side, above = figure.panels
    assert (side.equal, above.equal) == (True, True)
    leaves = [line for line in side.series if line.dash == "solid"][1:]
    assert [float(line.y[0]) for line in leaves] == pytest.approx([*value.offsets])
    assert all(np.ptp(line.x) == pytest.approx(value.length) for line in leaves)
    bent = [line for line in side.series if line.dash == "dashed"]
    assert max(np.ptp(line.y) for line in bent) == pytest.approx(stroke)
    assert np.ptp(above.series[1].y) == pytest.approx(value.width)
    for panel in figure.panels:
        for part in (*panel.series, *panel.markers, *panel.areas):
            for values, axis in ((part.x, panel.x), (part.y, panel.y)):
                low, high = axis.limits or (np.nan, np.nan)
                assert low < values.min() <= values.max() < high
    assert image(figure, "svg")


def test_the_block_of_the_stage_has_its_moments_of_inertia(stage: Stage) -> None:
    value = Mechanism.of(stage.flat())
    x, y, z = block_size(value)
    edge = (0.5 / 2700) ** (1 / 3)
    assert (x, y, z) == pytest.approx((edge**2 / 0.06, edge, 0.06))
    flat = replace(value, body=replace(value.body, inertia=(1e-4, 1e-4, 2e-4)))
    assert block_size(flat)[2] == pytest.approx(0, abs=1e-9)
    assert drawing_figure(flat, 1e-3).panels


# ---------------------------------------------------------------- what is refused


def test_a_stage_without_leaves_is_shown_a_table_that_works(tmp_path: Path) -> None:
    done = friso_inside(tmp_path, "flexure", RIG, "--out", "out")
    assert (done.returncode, done.stdout) == (2, "")
    assert "leaves = 2" in done.stderr
    assert not (tmp_path / "out").exists()
    with refused("flexure.material"):
        friso.loads(with_leaves(LEAVES[: LEAVES.index("young")] + 'material = "titanum"\n'))
    with refused("flexure") as caught:
        command(RIG)
    table = caught.value.example
    assert table == EXAMPLE
    assert table in str(caught.value)
    lines = "\n".join(line.strip() for line in table.splitlines())
    assert friso.loads(with_leaves(f"\n{lines}\n")).flat()["flexure.young"] == 195e9


@pytest.mark.parametrize(
    ("key", "options"),
    [
        *(("stroke", {"stroke": stroke}) for stroke in ("1", "0 mm", "-1 mm", "1 N", "36 mm", "")),
        ("joint.stroke", {"set": ['joint.stroke="36 mm"']}),
        (None, {"set": ['flexure.thickness="80 mm"', 'flexure.width="300 mm"']}),
        (None, {"set": ['flexure.lenght="70 mm"']}),
        (None, {"set": ["flexure.leaves=1"]}),
    ],
)
def test_strokes_and_leaves_that_are_refused(path: Path, key: str | None, options: Any) -> None:
    with refused() as caught:
        command(path, **options)
    assert (key or "") in str(caught.value)


def test_a_locked_joint_without_a_stroke_needs_one(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    file = tmp_path / "locked.toml"
    file.write_text(with_leaves().replace("locked = false", "locked = true").replace('stroke = "1 mm"\n', ""))
    with refused("--stroke"):
        command(file)
    command(file, stroke="1 mm", as_json=True)
    assert _strict(capsys.readouterr().out)["stroke_m"] == 1e-3
