"""Hunting by the return map: known maps, the thesis rig compared with the search, and results that are no map."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.truth.draws import draw
from friso.engine.allowance import allowance
from friso.equations.bandwidth import faster
from friso.hunting import SEARCH_LIMITS, Ensemble, find_margin, stuck
from friso.hunting.attractors import attractors
from friso.hunting.basin import displacements_that_hunt
from friso.hunting.cycle.hunting import hunting
from friso.hunting.cycle.rest import spread_over
from friso.hunting.edge_search import EdgeSearch, _Place
from friso.hunting.margin import NOT_SOUGHT, search_bandwidths
from friso.hunting.path import bandwidth_path
from friso.hunting.path_search import PathSearch
from friso.hunting.return_map.attracting import MapSurvey, is_motion, survey_maps
from friso.hunting.return_map.confirmed import runs_land_as_foretold
from friso.hunting.return_map.landing_map import LandingMap, MapAttractor
from friso.hunting.return_map.landings import LANDING_RTOL, Landings, find_landings
from friso.hunting.return_map.mapped import gaps
from friso.hunting.return_map.settings import ReturnMapSettings
from friso.hunting.settings import EdgeSettings, ToleranceSettings
from friso.hunting.what_attracts import Sketch, has_a_map, resolved_map, sketched, what_attracts
from friso.stage import Stage

pytestmark = pytest.mark.inner

DISTANCES = np.geomspace(0.01, 3.0, 400)


def of_function(after: np.ndarray, before: np.ndarray = DISTANCES) -> LandingMap:
    """The map of a symmetric stage that lands at `after` from distances `before`."""
    order = np.argsort(before, kind="stable")
    numbers = np.arange(len(before))
    return LandingMap(before[order], after[order], numbers, np.ones(len(before), bool), True, 0)


def test_equal_nearest_landings_reach_as_far_in_as_one() -> None:
    once = of_function(np.array([0.12, 0.22, 0.3]), np.array([0.1, 0.2, 0.3]))
    twice = of_function(np.array([0.12, 0.12, 0.22, 0.3]), np.array([0.1, 0.1, 0.2, 0.3]))
    nearer = np.array([0.0999])
    assert twice.foretold(nearer) == pytest.approx(once.foretold(nearer), rel=1e-12)
    assert twice.foretold(nearer) > 0.11


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


@pytest.mark.slow
@settings(deadline=None, max_examples=40)
@given(st.integers(0, 10**9), st.booleans())
def test_the_cycle_to_which_straight_pieces_lead_is_that_of_many_landings(seed: int, symmetric: bool) -> None:
    """Slow twin: the map iterated 4000 times from every point that is moved to a cycle at once."""
    rng = np.random.default_rng(seed)
    before = np.sort(np.exp(rng.uniform(-4, 1, 40)))
    after = before * np.exp(np.cumsum(rng.normal(0, 0.1, 40)))
    if not symmetric:
        before, after = (
            np.concatenate([-before[::-1], before]),
            np.concatenate([after[::-1], -after * rng.uniform(0.9, 1.1)]),
        )
    count = len(before)
    drawn = LandingMap(before, after, np.arange(count), np.ones(count, bool), symmetric, 0)
    at = drawn._places(before)
    cycles = drawn._on_cycles(at)
    moved = cycles != at
    apart = np.abs(cycles - at)[moved]
    for _ in range(4000):
        at = drawn.next(at)
    assert np.all(np.abs(at - cycles)[moved] <= 1e-9 + 0.02 * apart)
    assert drawn.next(drawn.next(cycles[moved])) == pytest.approx(cycles[moved], abs=1e-9)


@settings(deadline=None)
@given(st.floats(0.05, 0.99))
def test_a_stage_that_always_lands_nearer_comes_to_rest(gain: float) -> None:
    assert of_function(gain * DISTANCES).attractors == ()


def test_beyond_a_flip_landings_alternate() -> None:
    """The Ricker map x exp(r - r x): a cycle of 2 for r between 2 and 2.526, of 4 up to 2.656 (May 1974,
    doi:10.1126/science.186.4164.645); then irregular."""
    swings = {}
    for r in (1.9, 2.3, 2.6, 2.9):
        (attractor,) = of_function(DISTANCES * np.exp(r - r * DISTANCES)).attractors
        swings[r] = len(attractor.distances) if attractor.periodic else 0
    assert swings == {1.9: 1, 2.3: 2, 2.6: 4, 2.9: 0}


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
    assert of_function(smooth).scatter[0] < 1e-3
    two_sheets = np.where(np.arange(400) % 2, 1.2, 1.0) * smooth
    assert of_function(two_sheets).scatter[0] > 0.1
    between = np.where(np.arange(400) % 5 == 0, 0.0, smooth)  # some rest
    assert of_function(between).scatter[0] == np.inf


def test_gaps_are_looked_for_where_the_map_comes_near_its_diagonal() -> None:
    sparse = DISTANCES[::20]
    landed = gaps(of_function(0.5 * (sparse / 0.5) ** -0.5, sparse))
    assert np.abs(np.log(landed[0] / 0.5)) < 0.5 * np.log(sparse[1] / sparse[0])
    assert gaps(of_function(0.2 * sparse, sparse)).size == 0


def test_a_stage_that_hunts_in_a_narrow_range_beside_a_break_of_its_map() -> None:
    """No sampled point, a fifth apart, lands in that range; the search, long runs and SciPy agree that it hunts."""
    entries = tomllib.loads(Path(__file__).with_name("hard_stages.toml").read_text(encoding="utf-8"))["stages"]
    (entry,) = (entry for entry in entries if entry["name"] == "seed 1, number 27, beyond the edge once named")
    stage = Stage(**{key: value for key, value in entry.items() if isinstance(value, dict)})
    (motion,) = survey_maps(Ensemble.held(stage.flat(), 1)).motions
    assert motion.amplitude == pytest.approx(0.0359787, rel=1e-3)


@pytest.fixture(scope="module")
def locked(rig: Stage) -> Stage:
    return rig.replace({"joint.locked": True})


@pytest.fixture(scope="module")
def survey(locked: Stage) -> MapSurvey:
    return survey_maps(Ensemble.held(locked.flat(), 1))


@pytest.mark.slow
def test_landings_of_the_rig_alternate_and_come_to_its_cycle(locked: Stage) -> None:
    stages = Ensemble.held(locked.flat(), 1).take(np.zeros(4, np.int64))
    starts = np.array([0.2, 0.23, 0.26, 1.5]) * stages.length
    landed = find_landings(stages, stuck(stages, starts), 100)
    assert (landed.count == 100).all()
    assert (landed.distances[:, 1:] * landed.distances[:, :-1] < 0).all()
    assert (np.diff(landed.times, axis=1) > 0).all()
    (cycle,) = hunting(locked).attracting
    assert np.abs(landed.distances[:, -1]) == pytest.approx(cycle.amplitude, rel=1e-3)
    assert 2 * np.diff(landed.times, axis=1)[:, -1] == pytest.approx(cycle.period, rel=1e-2)


@pytest.mark.slow
def test_the_map_shows_what_attracts_the_rig(rig: Stage, locked: Stage, survey: MapSurvey) -> None:
    (motion,) = survey.motions
    (cycle,) = hunting(locked).attracting
    assert survey.resolved[0]
    assert motion.amplitude == pytest.approx(cycle.amplitude, rel=1e-6)
    free = survey_maps(Ensemble.held(rig.replace({"joint.locked": False}).flat(), 1))
    assert free.resolved[0]
    assert free.motions == ()


def _map_of(stage: Stage) -> LandingMap | None:
    surveyed = hunting(stage).surveyed
    assert surveyed is not None
    return resolved_map(Ensemble.held(stage.flat(), 1), surveyed.motions)


@pytest.mark.slow
def test_kicks_by_the_map_are_those_of_long_runs(locked: Stage) -> None:
    target, landing_map = hunting(locked).target, _map_of(locked)
    assert target is not None
    assert landing_map is not None
    long_runs = displacements_that_hunt(locked, target)
    by_map = displacements_that_hunt(locked, target, landing_map=landing_map)
    assert np.array(by_map.windows) == pytest.approx(np.array(long_runs.windows), rel=0.02)


def test_no_map_decides_on_kicks_under_friction_that_follows_the_drive(locked: Stage) -> None:
    """Of a drawn stage it called three of 128 displacements hunting from which long runs come to rest."""
    law = {"friction.model": "load_dependent", "friction.load_coefficient": 0.05}
    followed = locked.replace(law)
    assert hunting(followed).attracting
    assert _map_of(followed) is None


@pytest.mark.slow
def test_a_map_without_all_that_attracts_tells_nothing_of_kicks(locked: Stage) -> None:
    surveyed = hunting(locked).surveyed
    assert surveyed is not None
    (motion,) = surveyed.motions
    other = replace(motion, amplitude=2 * motion.amplitude)
    assert resolved_map(Ensemble.held(locked.flat(), 1), (motion, other)) is None
    assert resolved_map(Ensemble.held(locked.flat(), 1), ()) is None


@pytest.mark.slow
def test_the_edge_of_the_locked_rig_by_maps(locked: Stage) -> None:
    """9.750 Hz, where its cycle flips; nothing attracts a hundredth beyond."""
    margin = find_margin(locked, attracting=True)
    assert margin is not None
    assert margin.crossover == pytest.approx(9.750, rel=2e-4)
    beyond = {**locked.flat(), "controller.crossover": 9.75 * np.array([0.99, 1.01])}
    answer = what_attracts(Ensemble.held(beyond, 2))
    assert answer.attracts.tolist() == [True, False]
    assert answer.decided.all()


def test_a_sketch_tells_where_the_locked_rig_hunts(locked: Stage) -> None:
    """The rig hunts below 9.75 Hz; an unstable cycle continues up to a fold at 16.2 Hz."""
    crossovers = np.array([8.0, 11.0, 14.0, 17.0])
    sketch = sketched(Ensemble.held({**locked.flat(), "controller.crossover": crossovers}, 4))
    assert sketch.attracts.tolist() == [True, False, False, False]
    assert sketch.decided.all()


def test_runs_land_where_the_map_of_the_rig_says_and_not_where_another_does(locked: Stage) -> None:
    """Just beyond its edge; a map that is off by a tenth is noticed."""
    beyond = survey_maps(Ensemble.held({**locked.flat(), "controller.crossover": 9.85}, 1))
    assert runs_land_as_foretold(beyond, np.zeros(1, np.int64)).all()
    (landing_map,) = beyond.mapped.maps
    off = replace(beyond.mapped)
    vars(off)["maps"] = (replace(landing_map, after=1.1 * landing_map.after),)
    assert not runs_land_as_foretold(replace(beyond, mapped=off), np.zeros(1, np.int64)).any()


def _everywhere(stages: Ensemble) -> Sketch:
    yes = np.ones(stages.count, bool)
    return Sketch(yes, yes)


@pytest.mark.slow
def test_what_seems_to_attract_up_to_the_top_is_proved_there(locked: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    """A sketch that says of all bandwidths that something attracts there moves no edge."""
    monkeypatch.setattr("friso.hunting.path_search.sketched", _everywhere)
    sought = search_bandwidths(locked, attracting=True)
    assert not sought.to_the_top
    assert sought.margin is not None
    assert sought.margin.crossover == pytest.approx(9.750, rel=2e-4)


def test_a_top_that_no_work_is_left_for_is_undecided(locked: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("friso.hunting.path_search.sketched", _everywhere)
    survey = attractors(Ensemble.held(locked.flat(), 1), thorough=True)
    with allowance(1e5):
        sought = search_bandwidths(locked, True, survey)
    assert sought.undecided
    assert not sought.to_the_top


def test_bandwidths_that_no_work_was_left_for_make_no_edge(rig: Stage) -> None:
    free = rig.replace({"joint.locked": False})
    survey = attractors(Ensemble.held(free.flat(), 1), thorough=True)
    with allowance(1e6):
        assert search_bandwidths(free, False, survey) == replace(NOT_SOUGHT, undecided=True)


@pytest.mark.slow
def test_what_a_repelling_orbit_of_the_map_holds_beside_it_is_found() -> None:
    """A stable orbit of four swings lies within 3 % of an unstable orbit of two.

    The sampled points of the map are farther apart there. The search alone also finds a multiplier of -0.68.
    """
    locked = draw(7001, 83, "stages").variants()["locked"]
    stages = Ensemble.held(faster(locked.flat(), np.array([0.46])), 1)
    (motion,) = what_attracts(stages).motions
    assert motion.swings == 4
    edge = find_margin(locked, attracting=False)
    assert edge is not None
    assert edge.factor < 0.46474 < edge.quiet


@pytest.mark.slow
def test_simulations_that_take_too_much_leave_bandwidths_open_and_no_more() -> None:
    """Many maps of this stage are not resolved; its edge at 9.54 times the bandwidth is found all the same."""
    touching = draw(7001, 47, "stages").variants()["locked"]
    edge = search_bandwidths(touching, attracting=True).margin
    assert edge is not None
    assert edge.factor == pytest.approx(9.5422, rel=1e-3)


@pytest.mark.slow
def test_a_window_that_is_followed_to_the_stage_itself_contradicts_that_nothing_attracts_it(
    locked: Stage, monkeypatch: pytest.MonkeyPatch
) -> None:
    def followed_home(grid: PathSearch, besides: int) -> tuple[()]:
        grid.attracts[np.argmin(np.abs(grid.factors - 1))] = True
        return ()

    monkeypatch.setattr(PathSearch, "windows", followed_home)
    quiet = locked.replace({"controller.crossover": "12 Hz"})
    assert search_bandwidths(quiet, attracting=False).contradicts


@pytest.mark.cases(first=1)
@pytest.mark.parametrize("attracts", [True, False])
def test_what_one_survey_observed_makes_no_edge_certain_unless_a_thorough_one_does(
    locked: Stage, monkeypatch: pytest.MonkeyPatch, attracts: bool
) -> None:
    survey = attractors(Ensemble.held(locked.flat(), 1), thorough=True)
    observed = tuple(replace(motion, cycles=None) for motion in survey.motions)
    seen = survey if attracts else replace(survey, motions=())
    monkeypatch.setattr("friso.hunting.edge_search.attractors", lambda *_, **__: seen)
    where = EdgeSearch(bandwidth_path(locked.flat(), True), 10.0)
    assert where._surely_attracts(_Place(1.0, observed, 1.1)) == attracts
    assert where._surely_attracts(_Place(1.0, survey.motions, 1.1))


SCHEDULED = Stage(
    masses={"stage": "4.858 kg"},
    friction={
        **{"model": "lugre", "static": "9.036 N", "coulomb": "5.197 N", "viscous": "1.128 N*s/m"},
        **{"stribeck_velocity": "0.001754 m/s", "stribeck_exponent": 2.0},
        **{"bristle_stiffness": "209900.0 N/m", "bristle_damping": "692.9 N*s/m"},
    },
    controller={
        **{"kind": "pid", "kp": "4122.0 N/m", "ki": "9761.0 N/(m*s)", "kd": "122.2 N*s/m"},
        **{"derivative_on": "error", "tau": "0.00168 s"},
        "schedule_error": ["0.0001325 m", "0.000265 m", "0.00106 m"],
        "schedule_factor": [0.2997, 0.656, 0.8678],
    },
    motion={"kind": "release", "displacement": "0.006576 m", "duration": "13.7 s"},
)
"""Gains follow a schedule. Below 0.8925 times its bandwidth a symmetric cycle attracts; an asymmetric one does so, from
half of the displacements, up to between 0.910 and 0.915 times."""


@pytest.mark.slow
def test_an_asymmetric_cycle_that_outlives_a_flip_makes_the_edge() -> None:
    edge = find_margin(SCHEDULED, attracting=False)
    assert edge is not None
    assert 0.908 < edge.factor < 0.915 < edge.quiet < 0.921
    beside = bandwidth_path(SCHEDULED.flat(), False).stages(np.array([0.905, edge.factor * 0.998, edge.quiet]))
    assert attractors(beside, thorough=True).attracts.tolist() == [True, True, False]


def test_a_joint_that_is_free_or_a_dead_band_has_no_map(rig: Stage, locked: Stage) -> None:
    others = (rig.replace({"joint.locked": False}), locked.replace({"controller.error_deadband": "1 um"}), SCHEDULED)
    assert [has_a_map(Ensemble.held(stage.flat(), 1)) for stage in (locked, *others)] == [True, False, False, False]
    with ReturnMapSettings(maps_decide=False).in_use():
        assert not has_a_map(Ensemble.held(locked.flat(), 1))


def test_a_pair_of_landings_beside_a_cycle_that_repels_is_not_taken_for_it(survey: MapSurvey) -> None:
    """Just beyond a flip they are a few per cent apart, their mean being the distance of the cycle."""
    (cycle,) = survey.motions
    size = cycle.amplitude

    def is_cycle(landings: list[float], periodic: bool = True) -> bool:
        return is_motion(MapAttractor(np.array(landings), np.arange(3), periodic), cycle, size, exactly=True)

    assert is_cycle([1.0])
    assert not is_cycle([1.03, 0.97])
    assert not is_cycle([0.7, 1.3, 0.9, 1.1], periodic=False)


def test_an_orbit_of_many_swings_of_a_leaning_stage_is_known_again(survey: MapSurvey) -> None:
    """Half of peak to peak is the mean of its farthest landings on either side."""
    landings = np.array([0.212, -0.219, 0.355, -0.1, 0.469, -0.017, 0.557, -0.38])
    (cycle,) = survey.motions
    eight = replace(cycle, swings=8)
    size = cycle.amplitude / ((0.557 + 0.38) / 2)
    assert is_motion(MapAttractor(landings, np.arange(3), True), eight, size)
    assert not is_motion(MapAttractor(1.1 * landings, np.arange(3), True), eight, size)


def test_the_page_says_what_certain_means_with_the_numbers_of_the_code() -> None:
    page = (Path(__file__).parent.parent / "docs" / "hunting.md").read_text(encoding="utf-8")
    edge, maps = EdgeSettings(), ReturnMapSettings()
    sketched = len(spread_over(*maps.sketched_starts)) + len(spread_over(maps.far_starts)[1::3])
    section = " ".join(page.split("## What *certain* means")[1].split("\n## ")[0].split())
    *nearer, farthest = (f"{100 * (factor - 1):.3g}" for factor in edge.beyond_bandwidths)
    steps = [f"{100 * (10 ** (1 / n) - 1):.0f}" for n in (SEARCH_LIMITS.steps_to_edge, SEARCH_LIMITS.steps_beyond)]
    tolerances = f"{LANDING_RTOL:.0e} and at {ToleranceSettings().check_rtol_factor * LANDING_RTOL:.0e}".replace(
        "e-0", "e-"
    )
    for text in (
        f"less than {100 * maps.map_scatter_share:g} %",
        f"from {maps.near_starts[0][0]:g} to {maps.far_starts[1]:g} times",
        f"at most {100 * edge.edge_bracket_share:g} % away",
        f"{', '.join(nearer)} and {farthest} % beyond",
        f"land up to {maps.confirmed_landings} times where the map says, at {tolerances}",
        f"from {SEARCH_LIMITS.lowest_bandwidth:g} to {SEARCH_LIMITS.highest_bandwidth:g} times",
        f"({steps[0]} and {steps[1]} %)",
        f"from {sketched} distances",
    ):
        assert text in section
