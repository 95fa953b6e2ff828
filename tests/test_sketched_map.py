"""Maps of verdicts by sketches, and axes that make the controller faster or scale all friction."""

import numpy as np
import pytest

import friso
from friso.equations.bandwidth import faster, with_friction, with_static_friction
from friso.hunting import check, sketch_attractors
from friso.hunting.criteria import ATTRACTED, SWINGS
from friso.questions.map.figures import map_figure
from friso.questions.map.findings import caveats, message, own_place
from friso.questions.map.question import SweepAnswer
from friso.shown.drawing import plotly_renderer
from friso.stage import Stage
from friso.studies.study import Request

SPEEDS = np.array([0.6, 0.9, 1.0, 1.3, 1.7])


@pytest.fixture(scope="module")
def sketched(locked: Stage) -> SweepAnswer:
    """A map of verdicts over both scalings, as `friso map` makes it."""
    return friso.sweep(locked, {"speed": SPEEDS.tolist(), "friction": [0.5, 1.0, 2.0]})


@pytest.mark.slow
def test_the_default_map_is_a_sketch_of_the_verdicts_that_a_search_gives(locked: Stage, sketched: SweepAnswer) -> None:
    searched = friso.sweep(locked, {"speed": SPEEDS.tolist(), "friction": [0.5, 1.0, 2.0]}, confirm=True)
    assert sketched.metric == "sketch"
    assert searched.metric == "verdict"
    sketch, verdict = sketched.data["sketch"].values, searched.data["verdict"].values
    assert {"hunts", "settles"} <= set(verdict.ravel())
    np.testing.assert_array_equal(sketch, verdict)


@pytest.mark.slow
def test_a_cell_has_the_verdict_that_check_gives(locked: Stage) -> None:
    """At half its static friction the rig is soon within 10 um at its last place, but not at the one before."""
    stage = locked.replace({"friction.static": "1.5 N"})
    runs = friso.sweep(stage, {"controller.crossover": ["8 Hz", "9 Hz"]}, confirm=True)
    for k, crossover in enumerate(("8 Hz", "9 Hz")):
        case = check(stage.replace({"controller.crossover": crossover}), margins=False)["given"]
        assert runs.data["verdict"].values[k] == case.verdict


@pytest.mark.slow
def test_a_scaled_cell_is_a_stage_with_a_faster_controller_or_more_friction(
    locked: Stage, sketched: SweepAnswer
) -> None:
    flat = locked.flat()
    for (i, j), expected in {
        (0, 1): faster(flat, 0.6),
        (2, 0): with_friction(flat, 0.5),
        (4, 2): with_friction(faster(flat, 1.7), 2.0),
    }.items():
        cell = sketched.cell(i, j).flat()
        assert cell == pytest.approx({**expected, **{k: v for k, v in cell.items() if isinstance(v, str)}})


def test_gains_are_scaled_with_the_speed() -> None:
    stage = friso.load(friso.example("twincat_cascade"))
    runs = friso.sweep(stage, {"speed": [1.0, 2.0]}, metric="outcome")
    assert runs.cell(1).flat() == pytest.approx(
        {**faster(stage.flat(), 2.0), **{k: v for k, v in stage.flat().items() if isinstance(v, str)}}
    )


@pytest.mark.slow
def test_the_edge_of_a_map_is_that_at_which_followed_cycles_cease_to_attract(
    locked: Stage, sketched: SweepAnswer
) -> None:
    """On every line between cells, and on those through the stage, it is the flip that `friso boundary` follows."""
    (along_speed, _) = sketched.edges.own
    (edge,) = along_speed.changes
    (branch, *_) = friso.boundary(locked, {"speed": "0.9..1.4"}).result.special
    (flip,) = [spot for spot in branch if spot.kind == "flip"]
    assert edge[0] <= 0.9 + 0.5 * flip.point.place <= edge[1]
    assert edge[1] - edge[0] < 0.002
    (panel,) = map_figure(sketched.data, "sketch", edges=sketched.edges).panels
    (line,) = panel.series
    at = np.isclose(line.y, 1.0)
    assert line.x[at] == pytest.approx([edge.mean()], rel=1e-3)
    assert not map_figure(sketched.data, "outcome").panels[0].series


def test_the_title_of_a_map_says_what_holds_over_the_whole_picture(sketched: SweepAnswer) -> None:
    hunts = np.isin(sketched.data["sketch"].values, ATTRACTED)
    assert (hunts[:-1] >= hunts[1:]).all()
    says = message(sketched.data, "sketch", sketched.edges)
    assert "left of the line" in says
    assert "9.75 Hz" in says
    mirrored = message(sketched.data.isel(speed=slice(None, None, -1)), "sketch", None)
    assert "left of the line" in mirrored
    assert "right of the line" in message(sketched.data.assign_coords(speed=SPEEDS[::-1]), "sketch", None)
    assert "nowhere" in message(sketched.data.isel(speed=[-2, -1], friction=[0, 1]), "sketch", None)
    assert not message(sketched.data, "outcome", None)


def test_regions_of_a_map_are_written_on_and_the_stage_points_to_the_nearest_edge(sketched: SweepAnswer) -> None:
    (panel,) = map_figure(sketched.data, "sketch", edges=sketched.edges).panels
    words = {item.text: item for item in panel.words}
    verdict = sketched.data["sketch"].sel(speed=words["HUNTS"].x, friction=words["HUNTS"].y, method="nearest")
    assert verdict.item() in ATTRACTED
    (arrow,) = panel.arrows
    assert arrow.start == (1.0, 1.0)
    assert arrow.end[0] == pytest.approx(9.75 / 8, rel=1e-3)
    assert arrow.end[1] == 1.0
    assert (panel.x.second.unit, panel.x.second.factor) == ("Hz", 8.0)  # type: ignore[union-attr]
    assert (panel.y.second.unit, panel.y.second.factor) == ("N", 3.0)  # type: ignore[union-attr]
    drawn = plotly_renderer.render(map_figure(sketched.data, "sketch", rerun="again {}"))
    assert drawn.to_plotly_json()["layout"]["xaxis91"]["matches"] == "x"
    (cells,) = (trace for trace in drawn.data if trace.type == "heatmap" and np.isfinite(trace.z).any())
    assert cells.hovertemplate.endswith("<br>again %{text}<extra></extra>")  # over the regions too
    assert cells.text[1, 2] == "2 1"


@pytest.mark.slow
def test_the_stage_of_the_file_is_told_with_its_distance_to_the_edge(locked: Stage, sketched: SweepAnswer) -> None:
    """Without edges, the nearest cell is not called the stage."""
    (sentence,) = own_place(sketched.data, "sketch", sketched.edges)
    assert "Your stage hunts" in sentence
    assert "crossover 9.75 Hz" in sentence
    (sentence,) = own_place(sketched.data, "sketch")
    assert "hunts" in sentence
    assert "crossover 8.000 to 10.40 Hz" in sentence
    assert not own_place(sketched.data, "outcome")
    beside = friso.sweep(locked, {"controller.crossover": ["5 Hz", "9.9 Hz", "14 Hz"]})
    (sentence,) = own_place(beside.data, "sketch")
    assert "nearest" in sentence
    assert "is transient" in sentence


def test_a_cycle_longer_than_the_run_is_told(locked: Stage) -> None:
    runs = friso.sweep(locked, {"controller.crossover": ["0.3 Hz", "2 Hz", "8 Hz"]}, metric="sketch").data
    hidden = (runs["sketch"].values == "hunts") & (runs["outcome"].values != SWINGS)
    assert hidden.any()
    (sentence,) = caveats(runs, "sketch")
    assert str(hidden.sum()) in sentence
    assert not caveats(runs.isel({"controller.crossover": [2]}), "sketch")


def test_an_attractor_that_gaps_of_a_coarse_map_make_is_not_trusted(locked: Stage) -> None:
    """At 1.357 times its speed, with 2.4 % more friction, no orbit confirms one; free, static friction from 1.11 to
    1.23 times the rig's had one on maps of straight pieces."""
    assert not sketch_attractors(with_friction(faster(locked.flat(), 1.3572), 1.02436), 1).attracts[0]
    free = with_static_friction(locked.replace({"joint.locked": False}).flat(), np.array([1.11, 1.15, 1.2, 1.232]))
    assert not sketch_attractors(free, 4).attracts.any()


def test_cells_without_a_verdict_are_on_no_side_of_an_edge(locked: Stage) -> None:
    """Static friction below Coulomb friction is no stage: neither curve nor sentence says hunting ends there."""
    runs = friso.sweep(locked, {"friction.static": ["0.5 N", "0.9 N", "3 N", "3.3 N"], "speed": [0.9, 1.0, 1.1]})
    assert not map_figure(runs.data, "sketch").panels[0].series
    (sentence,) = own_place(runs.data, "sketch")
    assert "ends" not in sentence


def test_a_name_that_links_use_is_free(locked: Stage) -> None:
    study = Request(locked, {"speed": [0.5, 1.0]}, None, {"controller.crossover": "8*speed"}).study()
    assert study.cell_stage([0]).controller.crossover == pytest.approx(4.0)


@pytest.mark.parametrize(
    ("changes", "crossover", "grey", "title"),
    [
        ({}, "20 Hz..40 Hz:3", True, "in the"),
        ({}, "4 Hz..40 Hz:5", True, "has an answer"),
        ({"friction.static": "unknown"}, "20 Hz..40 Hz:3", False, "on this map"),
    ],
)
def test_no_title_speaks_for_cells_without_an_answer(
    locked: Stage, changes: dict[str, str], crossover: str, grey: bool, title: str
) -> None:
    """Static friction that nobody knows follows a swept Coulomb friction, which leaves no cell without an answer."""
    axes = {"friction.coulomb": "0.5 N..6 N:5", "controller.crossover": crossover}
    answer = friso.sweep(locked.replace(changes), axes)
    assert bool((answer.data["sketch"] == "invalid").any()) is grey
    assert title in message(answer.data, "sketch", None)
    assert answer.condition.count("friction.static follows friction.coulomb") == (not grey)
    if not grey:
        assert answer.cell(4, 0).flat()["friction.static"] == pytest.approx(12)  # 1 to 3 times 6 N
