"""Hunting by the return map: known maps, the thesis rig compared with the search, and results that are no map."""

from dataclasses import replace

import numpy as np
import pytest
from book import BOOK
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.truth.draws import draw
from friso.engine.allowance import allowance
from friso.equations.bandwidth import faster
from friso.hunting import (
    Ensemble,
    ReturnMapSettings,
    displacements_that_hunt,
    find_attractors,
    find_margin,
    find_swings,
    hunting,
    sketch_attractors,
)
from friso.hunting.margin import NOT_SOUGHT, search_bandwidths
from friso.hunting.return_map.attracting import survey_maps
from friso.hunting.return_map.landing_map import LandingMap, attractors_of
from friso.hunting.return_map.landings import Landings
from friso.hunting.what_attracts import map_may_decide, resolved_map, what_attracts
from friso.stage import Stage

DISTANCES = np.geomspace(0.01, 3.0, 400)


def of_function(after: np.ndarray, before: np.ndarray = DISTANCES) -> LandingMap:
    """The map of a symmetric stage that lands at `after` from distances `before`."""
    order = np.argsort(before, kind="stable")
    numbers = np.arange(len(before))
    return LandingMap(before[order], after[order], numbers, np.ones(len(before), bool), True, 0)


@pytest.mark.slow
@settings(deadline=None)
@given(st.floats(0.2, 0.95), st.floats(0.1, 1.0))
def test_a_map_with_a_slope_below_1_is_drawn_to_its_fixed_point(slope: float, fixed: float) -> None:
    """Runs converge to it from everywhere, whatever the sign of the slope, except where they leave the known range."""
    for sign in (1, -1):
        after = fixed * (DISTANCES / fixed) ** (sign * slope)
        (attractor,) = of_function(after).attractors
        assert attractor.periodic
        assert attractor.distances == pytest.approx([fixed], rel=1e-3)
        within = np.flatnonzero((after >= DISTANCES[0]) & (after <= DISTANCES[-1]))
        assert set(within) <= set(attractor.basin)


@settings(deadline=None)
@given(st.floats(0.05, 0.99))
def test_a_stage_that_always_lands_nearer_comes_to_rest(gain: float) -> None:
    assert of_function(gain * DISTANCES).attractors == ()


@pytest.mark.parametrize("r", [0.3, 1.9, 1.99, 2.01, 2.3])
@pytest.mark.parametrize("noise", [0.0, 1e-4])
def test_a_fixed_point_has_its_slope_within_its_error(r: float, noise: float) -> None:
    """The Ricker map x exp(r - r x) has slope 1 - r at 1. Its points are a thirtieth apart, as those of real maps."""
    before = DISTANCES[::2]
    after = before * np.exp(r - r * before + noise * np.random.default_rng(1).normal(size=before.size))
    (point,) = of_function(after, before).fixed_points()
    assert point.distance == pytest.approx(1.0, rel=1e-3)
    assert point.slope == pytest.approx(1 - r, abs=4 * point.error + 1e-4)
    assert point.error < 2e-3 + 30 * noise


def test_a_slope_that_too_few_points_tell_has_no_error() -> None:
    (point,) = of_function(0.5 * (DISTANCES[::100] / 0.5) ** -0.5, DISTANCES[::100]).fixed_points()
    assert point.slope == pytest.approx(-0.5)
    assert point.error == np.inf


@pytest.mark.parametrize(("slope", "corner", "beyond"), [(-0.95, 0.02, -1.5), (-0.97, 0.03, -1.3)])
def test_beside_a_corner_a_slope_is_as_unsure_as_it_is_wrong(slope: float, corner: float, beyond: float) -> None:
    u = np.unique(np.concatenate([np.arange(-0.5, 0.5, 0.03), np.arange(-0.1, 0.1, 0.01)]))
    bent = np.where(np.abs(u) < corner, slope * u, np.sign(u) * (slope * corner + beyond * (np.abs(u) - corner)))
    (point,) = of_function(np.exp(bent), np.exp(u)).fixed_points()
    assert abs(point.slope) < 1 + 3 * point.error


@pytest.mark.parametrize("gain", [0.9, 1.1])
def test_both_sides_of_a_map_go_on_alike(gain: float) -> None:
    """Beyond its outermost landings it goes on if they lead inward."""
    one = np.geomspace(0.1, 1, 30)
    before = np.concatenate([-one[::-1], one])
    sides = LandingMap(before, -gain * before, np.arange(60), np.ones(60, bool), False, 0)
    assert sides.foretold(np.array([0.5, -0.5])) == pytest.approx([-0.5 * gain, 0.5 * gain])
    assert sides.foretold(np.array([1.05, -1.05])) == pytest.approx(1.05 * 0.9 * np.array([-1, 1]) * (gain < 1))


def test_beyond_a_flip_landings_alternate() -> None:
    """The Ricker map x exp(r - r x): a cycle of 2 for r between 2 and 2.526, of 4 up to 2.656 (May 1974,
    doi:10.1126/science.186.4164.645); then irregular."""
    swings = {}
    for r in (1.9, 2.3, 2.6, 2.9):
        (attractor,) = of_function(DISTANCES * np.exp(r - r * DISTANCES)).attractors
        swings[r] = len(attractor.distances) if attractor.periodic else 0
    assert swings == {1.9: 1, 2.3: 2, 2.6: 4, 2.9: 0}


def test_maps_of_many_stages_lead_where_each_leads_alone() -> None:
    """Also irregular motions, which a shift of coordinates would change."""
    maps = [of_function(DISTANCES * np.exp(r - r * DISTANCES)) for r in np.linspace(1.5, 3.2, 40)]
    for one, found in zip(maps, attractors_of(maps), strict=True):
        for alone, together in zip(one.attractors, found, strict=True):
            assert np.array_equal(alone.distances, together.distances)
            assert np.array_equal(alone.basin, together.basin)


def test_a_map_whose_returns_lie_in_a_narrower_range_than_its_points_is_not_at_rest() -> None:
    """All landings converge to the smallest distance, and no point of the map is below it."""
    near = np.geomspace(0.0496, 3.0, 60)
    assert of_function(0.04959 * (near / 0.0496) ** 0.01, near).attractors


def test_rest_and_excursions() -> None:
    """A run that rests ends in 0; landings farther off than a stage sticks are passed over if it comes back."""
    away = np.array([[0.5, -0.4, 8.0, -4.0, 0.3], [0.5, -0.01, np.nan, np.nan, np.nan]])
    runs = Landings(
        away, np.zeros((2, 5)), np.array([4, 1]), np.zeros((2, 1)), np.array([False, True]), *np.zeros((2, 2), bool)
    )
    landed = LandingMap.of(runs, 1.0, True)
    assert [*zip(landed.before.tolist(), landed.after.tolist(), strict=True)] == [(0.01, 0.0), (0.4, 0.3)]


def test_landings_that_depend_on_more_than_their_distance_scatter() -> None:
    smooth = DISTANCES * np.exp(1.5 - 1.5 * DISTANCES)
    assert of_function(smooth).scatter < 1e-3
    two_sheets = np.where(np.arange(400) % 2, 1.2, 1.0) * smooth
    assert of_function(two_sheets).scatter > 0.1
    between = np.where(np.arange(400) % 5 == 0, 0.0, smooth)  # some rest
    assert of_function(between).scatter == np.inf


@pytest.mark.slow
def test_the_map_shows_what_attracts_the_rig(rig: Stage, locked: Stage) -> None:
    survey = survey_maps(Ensemble.held(locked.flat(), 1))
    (motion,) = survey.motions
    (cycle,) = hunting(locked).attracting
    assert survey.resolved[0]
    assert motion.amplitude == pytest.approx(cycle.amplitude, rel=1e-6)
    free = survey_maps(Ensemble.held(rig.replace({"joint.locked": False}).flat(), 1))
    assert free.resolved[0]
    assert free.motions == ()


@pytest.mark.slow
def test_kicks_by_the_map_are_those_of_long_runs(locked: Stage) -> None:
    known = hunting(locked)
    assert known.target is not None
    target, landing_map = known.target, resolved_map(Ensemble.held(locked.flat(), 1), known.surveyed.motions)
    assert landing_map is not None
    long_runs = displacements_that_hunt(locked, target)
    by_map = displacements_that_hunt(locked, target, landing_map=landing_map)
    assert np.array(by_map.windows) == pytest.approx(np.array(long_runs.windows), rel=0.02)


@pytest.mark.slow
def test_the_edge_of_the_locked_rig_by_maps(locked: Stage) -> None:
    """9.750 Hz, where its cycle flips; nothing attracts a hundredth beyond."""
    margin = find_margin(locked, attracting=True)
    assert margin.crossover == pytest.approx(9.750, rel=2e-4)
    beyond = {**locked.flat(), "controller.crossover": 9.75 * np.array([0.99, 1.01])}
    answer = find_attractors(beyond, 2)
    assert answer.attracts.tolist() == [True, False]
    assert answer.decided.all()


def test_a_sketch_tells_where_the_locked_rig_hunts(locked: Stage) -> None:
    """The rig hunts below 9.75 Hz; an unstable cycle continues up to a fold at 16.2 Hz."""
    crossovers = np.array([8.0, 11.0, 14.0, 17.0])
    sketch = sketch_attractors({**locked.flat(), "controller.crossover": crossovers}, 4)
    assert sketch.attracts.tolist() == [True, False, False, False]
    assert sketch.decided.all()


def test_bandwidths_that_no_work_was_left_for_make_no_edge(rig: Stage) -> None:
    free = rig.replace({"joint.locked": False})
    survey = hunting(free).surveyed
    with allowance(1e6):
        assert search_bandwidths(free, False, survey) == replace(NOT_SOUGHT, undecided=True)


@pytest.mark.slow
def test_what_a_repelling_orbit_of_the_map_holds_beside_it_is_found() -> None:
    """A stable orbit of four swings lies within 3 % of an unstable orbit of two.

    The sampled points of the map are farther apart there. The search alone also finds a multiplier of -0.68.
    """
    edge = find_margin(draw(7001, 83, "stages").variants()["locked"], attracting=False)
    assert edge.factor < 0.46474 < edge.quiet


@pytest.mark.slow
@pytest.mark.parametrize("crossover", ["17.9 Hz", "17.90625 Hz", "17.9125 Hz"])
def test_a_swing_beside_a_cycle_that_repels_is_not_taken_for_it(crossover: str) -> None:
    """It is 2.5 % larger, and of 32 starts 13 end in it, at 1e-7 and 1e-9 (number 72 of seed 1301)."""
    stage = draw(1301, 72).replace({"controller.crossover": crossover})
    assert what_attracts(Ensemble.held(stage.flat(), 1)).attracts[0]


@pytest.mark.slow
@pytest.mark.parametrize("crossover", [12.975, 12.98, 12.985, 12.99])
def test_a_cycle_on_a_narrow_piece_of_the_map_attracts(crossover: float) -> None:
    """The piece ends 0.5 % below the cycle and 1 % above it, and no start of a survey lands on it."""
    stage = BOOK["creeping"].replace({"controller.crossover": f"{crossover} Hz", "friction.static": "28.6 N"})
    assert what_attracts(Ensemble.held(stage.flat(), 1)).attracts[0]


@pytest.mark.slow
def test_simulations_that_take_too_much_leave_bandwidths_open_and_no_more() -> None:
    """Many maps of this stage are not resolved; its edge at 9.54 times the bandwidth is found all the same."""
    touching = draw(7001, 47, "stages").variants()["locked"]
    edge = find_margin(touching, attracting=True)
    assert edge.factor == pytest.approx(9.5422, rel=1e-3)


SCHEDULED = BOOK["scheduled"]
"""Gains follow a schedule. Below 0.8925 times its bandwidth a symmetric cycle attracts; an asymmetric one does so, from
half of the displacements, up to between 0.910 and 0.915 times."""


@pytest.mark.slow
def test_an_asymmetric_cycle_that_outlives_a_flip_makes_the_edge() -> None:
    edge = find_margin(SCHEDULED, attracting=False)
    assert 0.908 < edge.factor < 0.915 < edge.quiet < 0.921
    factors = (0.905, edge.factor * 0.998, edge.quiet)
    assert [bool(find_swings(faster(SCHEDULED.flat(), factor))) for factor in factors] == [True, True, False]


def test_a_dead_band_a_schedule_or_friction_that_follows_the_drive_has_no_map(rig: Stage, locked: Stage) -> None:
    """Of a drawn stage with such friction a map called three of 128 displacements hunting from which it rests."""
    law = {"friction.model": "load_dependent", "friction.load_coefficient": 0.05}
    others = (rig.replace({"joint.locked": False}), locked.replace({"controller.error_deadband": "1 um"}), SCHEDULED)
    stages = [Ensemble.held(stage.flat(), 1) for stage in (locked, *others, locked.replace(law))]
    assert [map_may_decide(each) for each in stages] == [True, True, False, False, False]
    with ReturnMapSettings(maps_decide=False).in_use():
        assert not map_may_decide(stages[0])
