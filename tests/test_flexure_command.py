"""`friso flexure`: its numbers against textbooks and shells, what it warns of, what it draws."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer
from inside import command_of, strict_json
from pages import Page
from refusals import refused
from snapshots import Snapshots

import friso
from friso.leaf_springs.beams import BeamFailure
from friso.stage import Stage

command = command_of("flexure")

RIG = Path(friso.example("thesis_rig"))
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
SOUND = {**dict.fromkeys(("flexure.young", "flexure.poisson", "flexure.density", "flexure.yield"))}
SOUND |= {"flexure.material": "stainless 1.4310"}


def with_leaves(table: str = LEAVES) -> str:
    """The thesis rig, its joint made of leaf springs."""
    text = RIG.read_text()
    start, end = text.index("\n[parasitic]"), text.index("\n[controller]")
    return text[:start].replace('stiffness = "2.4 N/mm"\n', "") + table + text[end:]


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("leaves") / "leaves.toml"
    file.write_text(with_leaves())
    return file


@pytest.fixture(scope="module")
def stage(path: Path) -> Stage:
    return friso.load(path)


@pytest.fixture(scope="module")
def answer(stage: Stage) -> Any:
    return friso.flexure(stage, 1e-3)


def warnings(answer: Any) -> list[str]:
    """The sentences that are red."""
    (block,) = answer.blocks()
    return [text for text, colour in zip(block.sentences, block.colours, strict=False) if colour != block.colours[0]]


def test_the_document_is_that_of_the_stroke(path: Path, capsys: Any) -> None:
    command(path, stroke="500 um", as_json=True)
    shown = capsys.readouterr()
    document = strict_json(shown.out)
    assert shown.err == ""
    assert (document["stage"], document["failure"]) == ("Thesis rig", None)
    assert (document["model"], document["closed_forms"]["model"]) == ("beams", "closed forms")
    assert np.shape(document["stiffness_zero"]) == np.shape(document["stiffness_full"]) == (6, 6)
    assert len(document["deflections_m"]) == len(document["forces_n"])
    assert document["stroke_m"] == document["deflections_m"][-1] == 5e-4
    assert len(document["eigenfrequencies_hz"]) == len(document["names"]) == len(document["interferes"])
    assert document["fatigue_margin"] is None


@pytest.mark.parametrize("model", ["beams", "closed forms"])
def test_both_models_say_what_textbooks_and_shells_say(answer: Any, model: str) -> None:
    document = answer.to_dict()
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


def test_modes_that_interfere_with_control_are_told_from_the_drive(answer: Any) -> None:
    document = answer.to_dict()
    assert document["names"][0] == "drive"
    assert document["interferes"][0] is False
    first = document["interferes"].index(True)
    assert document["first_interfering_hz"] == document["eigenfrequencies_hz"][first] == pytest.approx(390, rel=0.03)


def test_a_failure_of_the_beams_leaves_the_closed_forms(
    path: Path, capsys: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise BeamFailure("The beams find no equilibrium.")

    monkeypatch.setattr("friso.leaf_springs.beams.beams", fail)
    with pytest.raises(typer.Exit) as leave:
        command(path, as_json=True)
    assert leave.value.exit_code == 1
    shown = capsys.readouterr()
    document = strict_json(shown.out)
    assert document["model"] == "closed forms"
    assert "no equilibrium" in document["failure"]
    assert document["failure"] in " ".join(shown.err.split())


def test_a_sound_joint_has_no_warnings_and_a_largest_stroke(stage: Stage) -> None:
    sound = friso.flexure(stage.replace(SOUND), 1e-3)
    assert warnings(sound) == []
    assert f"{sound.best.fatigue_margin:.2f} mm" in " ".join(sound.sentences())  # of a stroke of 1 mm


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
    assert any(warning in text for text in warnings(friso.flexure(stage.replace(changes), stroke)))


def test_models_that_differ_are_a_warning(answer: Any) -> None:
    models = answer.result
    assert not any("differ" in said for said in warnings(answer))
    other = replace(models, beams=replace(models.beams, stress=models.beams.stress * 0.8, drive=models.beams.drive * 2))
    (text,) = (texts for texts in warnings(type(answer)(other)) if "differ" in texts)
    assert "-50 %" in text
    assert "+2" in text


def test_actuator_and_sensor_that_move_against_each_other_are_a_warning(stage: Stage) -> None:
    alike, against = (
        friso.flexure(stage.replace({**SOUND, "flexure.actuation_y": "20 mm", "flexure.sensor_y": place}), 1e-3)
        for place in ("20 mm", "-20 mm")
    )
    assert warnings(alike) == []
    (texts,) = warnings(against)
    modes = [mode for mode in against.best.modes[1:] if mode.interferes and mode.actuator * mode.sensor < 0]
    assert "stage about x" in [mode.name for mode in modes]
    assert all(f"{mode.name} ({mode.frequency / 1e3:.2f} kHz)" in texts for mode in modes)


def test_only_what_is_left_out_is_assumed(stage: Stage) -> None:
    inputs = {f"flexure.{name}_x": "30 mm" for name in ("centre", "actuation", "sensor")} | {"flexure.load": "0 N"}
    words = ("moments of inertia of an aluminium block of 0.5 kg", "centre of mass", "actuation", "sensor", "no load")
    for changes, assumed in (({}, words), (inputs, words[:1])):
        (text,) = (said for said in friso.flexure(stage.replace(changes)).sentences() if said.startswith("Assumed"))
        assert [word for word in words if word in text] == [*assumed]
    inertia = {f"flexure.inertia_{axis}": "2e-4 kg*m^2" for axis in "xyz"}
    assert "Assumed" not in " ".join(friso.flexure(stage.replace({**inputs, **inertia})).sentences())


def test_without_a_mode_that_interferes_there_is_no_limit(answer: Any, snapshots: Snapshots) -> None:
    closed = answer.result.closed
    quiet = replace(closed, modes=tuple(replace(mode, peak=0.0) for mode in closed.modes))
    alone = type(answer)(replace(answer.result, closed=quiet, beams=None, failure="singular at step 7"))
    assert alone.to_dict()["first_interfering_hz"] is None
    assert "singular at step 7" in Page(str(alone.files()["flexure.html"])).text
    snapshots.check("flexure", "closed forms alone", "\n".join(alone.sentences()))


def test_force_and_supports_are_drawn_by_both_models(answer: Any) -> None:
    _, force, support, _ = answer.figures()
    best, (panel,) = answer.best, force.panels
    assert [line.label for line in panel.series] == ["Beams", "Closed forms", "initial stiffness"]
    assert (panel.series[0].x[-1], panel.series[0].y[-1]) == pytest.approx((1e-3, best.forces[-1]))
    assert panel.series[2].y[-1] == pytest.approx(best.drive[0] * 1e-3)
    for panel, expected in zip(support.panels, (best.support_x, best.support_y), strict=True):
        assert panel.markers[0].y * 1e6 == pytest.approx(expected)
        assert (panel.series[0].y[0] * 1e6, panel.series[0].y[-1] * 1e6) == pytest.approx((expected[0], expected[-1]))


def test_modes_are_drawn_from_where_they_move_with_who_sees_them(answer: Any) -> None:
    figure = answer.figures()[-1]
    panels = {panel.title.rsplit(", ", 1)[0]: panel for panel in figure.panels}
    assert not any("torsion" in title for title in panels)  # whose middle lines rest
    assert panels["leaf bending, in phase"].series[1].label == "seen by actuator and sensor"
    assert panels["leaf bending, out of phase"].series[1].label == "not seen by both"
    views = {"drive": "xz", "leaf bending, in phase": "xz", "stage along y": "xy", "stage about x": "yz"}
    views["stage about z"] = "xy"
    assert {name: panels[name].x.label[0] + panels[name].y.label[0] for name in views} == views
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


SHAPES = [
    {},
    {"flexure.leaves": 6, "flexure.length": "15 mm", "flexure.width": "60 mm", "flexure.thickness": "0.1 mm"},
    {"flexure.leaves": 3, "flexure.length": "120 mm", "flexure.width": "10 mm", "flexure.sensor_z": "200 mm"},
    {"flexure.length": "30 mm", "flexure.spacing": "4 mm", "flexure.actuation_x": "-80 mm"},
    {"flexure.length": "7 m", "flexure.width": "4 m", "flexure.spacing": "5 m"},
]


@pytest.mark.parametrize(("changes", "stroke"), [*zip(SHAPES, (1e-3, 1e-5, 7e-3, 1e-3, 7e-3), strict=True)])
def test_the_drawing_is_to_scale_and_tells_all_dimensions(stage: Stage, changes: dict[str, Any], stroke: float) -> None:
    answer = friso.flexure(stage.replace(changes), stroke)
    value, figure = answer.best.mechanism, answer.figures()[0]
    for length in (value.length, value.width, value.thickness, value.spacing, stroke):
        assert f"{1e3 * length:.4g}" in figure.caption
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


def test_the_block_of_the_stage_has_its_moments_of_inertia(stage: Stage) -> None:
    edge = (0.5 / 2700) ** (1 / 3)
    sizes = " x ".join(f"{1e3 * size:.4g}" for size in (edge**2 / 0.06, edge, 0.06))
    assert f"as a block of its moments of inertia, {sizes} mm" in friso.flexure(stage).figures()[0].caption
    flat = {f"flexure.inertia_{axis}": f"{value} kg*m^2" for axis, value in zip("xyz", (1e-4, 1e-4, 2e-4), strict=True)}
    assert friso.flexure(stage.replace(flat)).figures()[0].panels


def test_a_stage_without_leaves_is_shown_a_table_that_works() -> None:
    with refused("flexure") as caught:
        command(RIG)
    lines = "\n".join(line.strip() for line in caught.value.example.splitlines())
    assert friso.loads(with_leaves(f"\n{lines}\n")).flat()["flexure.young"] == 195e9


def test_a_locked_joint_without_a_stroke_needs_one(tmp_path: Path) -> None:
    locked = friso.loads(with_leaves().replace("locked = false", "locked = true").replace('stroke = "1 mm"\n', ""))
    with refused("stroke"):
        friso.flexure(locked)
    assert friso.flexure(locked, stroke="1 mm").to_dict()["stroke_m"] == 1e-3
