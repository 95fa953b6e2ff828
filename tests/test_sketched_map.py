"""Maps of verdicts by sketches, and axes that make the controller faster or scale all friction."""

from typing import Any

import numpy as np
import pytest
from refusals import refused

import friso
from friso.equations.bandwidth import faster
from friso.equations.scaled_friction import with_friction
from friso.hunting import check, sketch_attractors
from friso.hunting.criteria import ATTRACTED, SWINGS
from friso.hunting.return_map.settings import ReturnMapSettings
from friso.questions.map.data import page_data
from friso.questions.map.figures import map_figure
from friso.questions.map.findings import caveats, own_place
from friso.questions.map.page import map_html
from friso.questions.map.question import SweepAnswer
from friso.stage import Stage

SPEEDS = np.array([0.6, 0.9, 1.0, 1.3, 1.7])


@pytest.fixture(scope="module")
def locked(rig: Stage) -> Stage:
    """The thesis rig, its joint locked."""
    return rig.variants()["locked"]


@pytest.fixture(scope="module")
def sketched(locked: Stage) -> SweepAnswer:
    """A map of verdicts over both scalings, as `friso map` makes it."""
    return friso.sweep(locked, {"speed": SPEEDS.tolist(), "friction": [0.5, 1.0, 2.0]})


def test_the_default_map_is_a_sketch_of_the_verdicts_that_a_search_gives(locked: Stage, sketched: SweepAnswer) -> None:
    searched = friso.sweep(locked, {"speed": SPEEDS.tolist(), "friction": [0.5, 1.0, 2.0]}, confirm=True)
    assert sketched.metric == "sketch"
    assert searched.metric == "verdict"
    sketch, verdict = sketched.data["sketch"].values, searched.data["verdict"].values
    assert {"hunts", "settles"} <= set(verdict.ravel())
    np.testing.assert_array_equal(sketch, verdict)


def test_a_cell_has_the_verdict_that_check_gives(locked: Stage) -> None:
    """At half its static friction the rig is soon within 10 um at its last place, but not at the one before."""
    stage = locked.replace({"friction.static": "1.5 N"})
    runs = friso.sweep(stage, {"controller.crossover": ["8 Hz", "9 Hz"]}, confirm=True)
    for k, crossover in enumerate(("8 Hz", "9 Hz")):
        case = check(stage.replace({"controller.crossover": crossover}), margins=False)["given"]
        assert runs.data["verdict"].values[k] == case.verdict


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


@pytest.mark.parametrize(
    ("changed", "axes", "options"),
    [
        ({"friction": {"model": "none"}}, {"friction": [0.5, 2.0]}, {"metric": "outcome"}),
        ({}, {"speed": "-1,0,1"}, {}),
        ({}, {"speed": [0.5, 1.0]}, {"metric": "outcome", "confirm": True}),
    ],
)
def test_what_cannot_be_scaled_or_confirmed_is_refused(locked: Stage, changed: Any, axes: Any, options: Any) -> None:
    with refused():
        friso.sweep(locked.replace(changed), axes, **options)


def test_the_edge_lies_between_cells_that_hunt_and_cells_that_do_not(sketched: SweepAnswer) -> None:
    (panel,) = map_figure(sketched.data, "sketch").panels
    (edge,) = panel.series
    row = np.isin(sketched.data["sketch"].values, ATTRACTED)[:, 1]
    at = int(np.flatnonzero(row[:-1] & ~row[1:])[-1])
    crossing = edge.x[np.isclose(edge.y, 1.0)]
    assert np.any((crossing > SPEEDS[at]) & (crossing < SPEEDS[at + 1]))
    assert not map_figure(sketched.data, "outcome").panels[0].series
    x, y = page_data(sketched.data, "sketch", "{indices}")["edge"]
    assert [value is None for value in x] == [*np.isnan(edge.x)]
    assert np.nanmax(np.array(y, float)) == pytest.approx(np.nanmax(edge.y), rel=1e-4)
    assert page_data(sketched.data, "outcome", "{indices}")["edge"] is None


def test_the_stage_of_the_file_is_told_with_its_distance_to_the_edge(locked: Stage, sketched: SweepAnswer) -> None:
    """The nearest cell is not called the stage."""
    (sentence,) = own_place(sketched.data, "sketch")
    assert "hunts" in sentence
    assert "crossover 8.000 to 10.40 Hz" in sentence
    assert not own_place(sketched.data, "outcome")
    assert sentence.split(";")[0] in map_html(sketched.data, "sketch", "{indices}")
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


@pytest.mark.inner
def test_an_attractor_of_few_points_is_not_trusted(locked: Stage) -> None:
    """At 1.357 times its speed, with 2.4 % more friction, a coarse map has an attractor that no orbit confirms."""
    flat = with_friction(faster(locked.flat(), 1.3572), 1.02436)
    assert not sketch_attractors(flat, 1).attracts[0]
    with ReturnMapSettings(least_arriving_points=0).in_use():
        assert sketch_attractors(flat, 1).attracts[0]


def test_cells_without_a_verdict_are_on_no_side_of_an_edge(locked: Stage) -> None:
    """Static friction below Coulomb friction is no stage: neither curve nor sentence says hunting ends there."""
    runs = friso.sweep(locked, {"friction.static": ["0.5 N", "0.9 N", "3 N", "3.3 N"], "speed": [0.9, 1.0, 1.1]})
    assert not map_figure(runs.data, "sketch").panels[0].series
    (sentence,) = own_place(runs.data, "sketch")
    assert "ends" not in sentence


def test_a_name_that_links_use_is_free(locked: Stage) -> None:
    linked = friso.sweep(locked, {"speed": [0.5, 1.0]}, link={"controller.crossover": "8*speed"}, metric="outcome")
    assert linked.cell(0).controller.crossover == pytest.approx(4.0)
