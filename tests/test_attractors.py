"""Everything that attracts a stage: stages whose symmetric cycle repels, or rests on jumps of the return map, and which
hunt all the same. What they do is simulated here from the kicks that start it, at two tolerances."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from book import BOOK
from patched import patched
from variants import VARIANTS

import friso
from benchmarks.truth.draws import draw
from friso.engine.allowance import allowance
from friso.engine.arrays import STATISTICS
from friso.equations.roles import Role
from friso.hunting import (
    SEARCH_LIMITS,
    Ensemble,
    HuntingDoubt,
    KeyRange,
    Motions,
    Space,
    StageAttractors,
    check_given,
    diagram,
    find_attractors,
    find_margin,
    find_swings,
    hunting,
    judge_many,
    judge_runs,
    verdict,
)
from friso.hunting.attractors import starts
from friso.hunting.attractors.settings import SurveySettings
from friso.hunting.basin import ends_in, swings_seldom
from friso.hunting.cycle.ensemble import bent
from friso.hunting.measures import measuring_options
from friso.hunting.motions import run_motions
from friso.hunting.verdict import CHECK_WORK, own_motion
from friso.stage import Stage
from friso.studies.boundary import REPELS, UNKNOWN, place_verdicts
from friso.studies.sweep import sweep


def held(chosen: Stage) -> Ensemble:
    return Ensemble.held(chosen.flat(), 1)


@pytest.mark.cases(first=1)
@pytest.mark.parametrize(("crossover", "hunts"), [("13.35 Hz", True), ("13.6 Hz", False)])
def test_a_basin_narrower_than_starts_are_apart(crossover: str, hunts: bool) -> None:
    """Near its fold at 13.47 Hz a cycle attracts from 1 % less to 3 % more than its distance alone: simulated for 6000
    periods at 1e-6, 1e-7 and 1e-9."""
    friction = {"friction.static": "1 N", "friction.coulomb": "0.15 N", "masses.cart": "1.26 kg"}
    stage = VARIANTS["rigid"].replace({**friction, "masses.stage": "0.525 kg", "controller.crossover": crossover})
    survey = find_attractors(stage.flat(), 1)
    assert (survey.attracts.tolist(), survey.decided.tolist()) == ([hunts], [True])


@pytest.mark.slow
def test_irregular_swings_are_tried_again_from_where_they_were_seen() -> None:
    """Irregular swings continue at 1e-6 and 1e-9, and in SciPy (0.8303 mm).

    No other start tried at 1e-9 leads to them. That was taken for a verdict that depends on the tolerance: "settles",
    not certain.
    """
    survey = hunting(BOOK["irregular"])
    (motion,) = survey.observed
    assert motion.amplitude == pytest.approx(0.8303e-3, rel=3e-3)
    assert survey.certain


def test_the_period_of_a_doubled_orbit_is_told_by_its_swings() -> None:
    """At 12.66 Hz the creeping stage swings every 2.07 s, and repeats itself after twice that."""
    attracted = find_attractors(BOOK["creeping"].replace({"controller.crossover": "12.6553 Hz"}).flat(), 1)
    assert attracted.period == pytest.approx(4.144, rel=0.01)


@pytest.mark.cases(slow=2)
@pytest.mark.parametrize("crossover", [11.279, 12.9, 12.3332, 13.1, 14.1995])
def test_the_edge_is_that_of_the_last_attractor(crossover: float) -> None:
    """Beyond its flip at 11.97 Hz the creeping stage has asymmetric cycles, of one period and of many, up to 12.95 Hz,
    where the symmetric one attracts again, until it folds: by brute force between 13.026 and 13.029 Hz."""
    edge = find_margin(BOOK["creeping"].replace({"controller.crossover": f"{crossover} Hz"}), attracting=crossover < 13)
    assert edge.certain
    assert edge.crossover < 13.029
    assert edge.crossover * (1 + edge.reserve) > 13.026


@pytest.mark.slow
def test_many_stages_at_once_are_judged_alike_where_basins_are_narrow() -> None:
    """From 12.95 Hz on, the creeping stage's symmetric cycle attracts from less than 0.25 % about its distance."""
    flat, crossovers = BOOK["creeping"].flat(), np.array([12.6553, 12.9, 12.955, 12.98, 13.02, 13.04])
    several = {**flat, "controller.crossover": crossovers * flat["controller.crossover"] / 12.3332}
    assert list(judge_many(several, len(crossovers), 1e-6) == "bistable") == [True] * 5 + [False]


DOUBLED = draw(1301, 72).replace({"controller.crossover": "17.4 Hz"})
"""Its cycle flips at 17.841 Hz, beyond which one of twice the period attracts up to 17.88 Hz: by brute force, and by
SciPy at 17.8762 Hz, +-0.17156 mm (`benchmarks.truth --seed 1301 --number 72`)."""


@pytest.mark.thorough
def test_beyond_the_end_of_a_cycle_others_attract_close_by() -> None:
    edge = find_margin(DOUBLED, attracting=True)
    assert edge.crossover * (1 + edge.reserve) > 17.8762


SMALLER = draw(1301, 90).replace({"controller.crossover": "30.8841 Hz"})
"""Just beyond the fold of its symmetric cycle, with one of half its size, which few starts end in: by brute force, and
by SciPy, +-32.79 um (`benchmarks.truth --seed 1301 --number 90`)."""


def test_just_beyond_a_fold_a_smaller_cycle_is_found() -> None:
    assert min(motion.amplitude for motion in find_swings(SMALLER.flat())) == pytest.approx(3.279e-5, rel=1e-2)


LOSING = draw(1301, 3)
"""Followed from 1.3 times its bandwidth, its cycle is lost at 1.8997 times, while it attracts well
(`benchmarks.truth --seed 1301 --number 3`)."""


@pytest.mark.slow
def test_an_orbit_that_is_lost_while_it_attracts_well_ends_about_there() -> None:
    edge = find_margin(LOSING.replace({"controller.crossover": f"{1.3 * 9.79954} Hz"}), attracting=True)
    assert 1.3 * edge.factor <= 1.8997 * 1.002
    assert 1.3 * edge.quiet >= 1.8997 * 0.998


WINDOWED = draw(27, 91, "rolling").replace({"controller.crossover": "3 Hz"})
"""Hunts below 3.016 Hz, and again from 3.10 to 3.35 Hz by cycles that are not symmetric, which no orbit leads to: by
brute force at 1e-9 (`benchmarks.laws --law rolling --seed 27`, number 91)."""


@pytest.mark.thorough
def test_a_window_just_beyond_an_edge_is_narrower_than_the_steps_of_a_search() -> None:
    """The edge lies beyond it."""
    edge = find_margin(WINDOWED, attracting=True)
    assert 3 * edge.factor > 3.1
    assert 3 * edge.quiet > 3.35


@pytest.mark.slow
def test_no_window_is_looked_for_beyond_the_range_or_a_stage_that_settles() -> None:
    """A stage in the gap below the window was said to be contradicted by an orbit that is followed to it."""
    edge = find_margin(WINDOWED.replace({"controller.crossover": "3.06 Hz"}), attracting=False)
    assert edge.crossover == pytest.approx(3.016, rel=2e-3)


UNWOUND = BOOK["unwound by back-calculation"]
"""Hunts below 9.77 Hz, and again from some 39 Hz on, where back-calculation drives it to and fro at the force limit."""


UPPER = 39.5987
"""Bandwidth [Hz] at which the upper window begins: a fold, by `friso boundary`."""


@pytest.mark.thorough
def test_every_window_in_which_a_stage_hunts_is_searched() -> None:
    """The search starts from both windows, and from the gap between them."""
    for crossover, attracting in ((8.0, True), (20.0, False), (60.0, True)):
        sought = check_given(UNWOUND.replace({"controller.crossover": f"{crossover} Hz"})).judgement
        assert (sought.hunting.target is not None) == attracting
        ends = [end for window in sought.windows for end in (window.low, window.high) if end is not None]
        if crossover < 60:
            assert sought.margin.crossover == pytest.approx(9.77, abs=0.005)
            assert sought.windows[0].high is None
            again, expected = ends[0], UPPER
        else:
            assert sought.lower.certain
            assert crossover * sought.lower.outside < UPPER < crossover * sought.lower.inside
            assert sought.lower.reserve < 0.02
            assert crossover * SEARCH_LIMITS.lowest_bandwidth > 9.77  # the lower window is out of reach
            assert not sought.windows
            continue
        assert again.certain
        assert crossover * again.inside == pytest.approx(expected, rel=1e-3)


@pytest.mark.slow
def test_a_verdict_that_flips_with_the_tolerance_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    """Simulations at a hundredth of the tolerance decide where no orbit was closed: here they are made to fail to see
    what the others do, by beginning at rest."""
    monkeypatch.setattr(starts.Starts, "seen", lambda *_: None)
    with SurveySettings(usual_starts=((1e-6, 2e-6, 2),), beside_motion_shares=(1e-6,)).in_use():
        attracted = hunting(BOOK["creeping"])
    assert (attracted.certain, attracted.target) == (False, None)


@pytest.mark.slow
def test_runs_that_are_given_up_leave_it_unknown() -> None:
    """Just above its edge many runs of the rigid mass still swing after two rounds, each in its own way. Of a stage of
    which one alone is followed on, and that settles, nothing is known."""
    above = VARIANTS["rigid"].replace({"controller.crossover": "9.9 Hz"}).flat()
    assert find_attractors(above, 1).decided.all()
    with SurveySettings(most_kinds=1).in_use():
        assert find_attractors(above, 1).decided.all()  # there are steps left for the others
    with SurveySettings(most_kinds=1, next_round_cost=1e9).in_use():
        assert not find_attractors(above, 1).decided.any()


def test_a_survey_out_of_steps_knows_nothing() -> None:
    """Just above its edge the rigid mass settles from everywhere, and takes more steps than these to show it."""
    above = VARIANTS["rigid"].replace({"controller.crossover": "9.9 Hz"}).flat()
    with SurveySettings(quick_step_limit=20_000).in_use():
        assert not find_attractors(above, 1).decided.any()


def with_little_gap(static: str) -> Stage:
    """A stage with Coulomb friction of 401 N, and static friction that is hardly more."""
    r = 403 / 3
    return VARIANTS["rigid"].replace(
        {
            "friction.static": static,
            "friction.coulomb": "401 N",
            "friction.bristle_stiffness": f"{1e5 * r} N/m",
            "friction.bristle_damping": f"{316.23 * r**0.5} N*s/m",
            "controller.crossover": "4 Hz",
            "motion": {"kind": "release", "displacement": "2.1 mm", "duration": "60 s"},
        }
    )


@pytest.mark.slow
@pytest.mark.usefixtures("own_bandwidth")
def test_a_swing_of_ten_minutes_is_seen() -> None:
    """With static friction 0.5 % above Coulomb friction the stage waits five minutes at 2 mm, and keeps swinging."""
    judgement = friso.check(with_little_gap("403 N"))["given"].judgement
    assert judgement.verdict == "hunts"
    assert judgement.cycle.attracts
    assert judgement.cycle.period == pytest.approx(572, rel=0.01)


@pytest.mark.slow
def test_swings_that_are_smaller_than_is_looked_for_leave_a_doubt() -> None:
    """With 0.05 %, swings of an hour could exist unresolved: the motion is followed for many of them."""
    judgement = friso.check(with_little_gap("401.2 N"))["given"].judgement
    assert not judgement.hunting.certain
    assert judgement.followed > 5 * 3600


@pytest.mark.cases(first=1)
@pytest.mark.parametrize(("series", "seed", "number"), [("machines", 5201, 26), ("stages", 6101, 8)])
def test_a_fall_of_friction_too_slow_to_feed_a_cycle_leaves_no_doubt(series: str, seed: int, number: int) -> None:
    """Friction falls by 0.06 and 0.13 %, over speeds of a cycle a hundred times larger than it could feed."""
    assert hunting(draw(seed, number, series)).certain


SOFT_ELEMENT = BOOK["soft element"]
"""Its softest element yields by 3.1 mm, more than the stage swings, and never slips then."""


@pytest.mark.slow
@pytest.mark.parametrize(("crossover", "amplitude"), [("12 Hz", 0.8907e-3), ("10 Hz", 1.2043e-3)])
def test_of_several_bristles_some_remember_how_a_stage_came_to_stick(crossover: str, amplitude: float) -> None:
    """No start with relaxed bristles leads to this swing: the stage was said to settle, for certain.

    It is also simulated after being drawn from the reference to where it sticks, and from there on at a tighter
    tolerance.
    """
    stages = held(SOFT_ELEMENT.replace({"controller.crossover": crossover}))
    few, (motion,) = find_attractors(stages.flat, 1, close_orbits=False), find_swings(stages.flat)
    assert few.decided.all()
    assert few.amplitude == pytest.approx(amplitude, rel=1e-3)
    run = stages.run(motion.seen[None, :], np.array([120 * motion.period]), 1e-9, window=0.9)
    high, low = (run.statistics[0, STATISTICS.index(f"deviation_{side}")] for side in ("max", "min"))
    assert (high - low) / 2 == pytest.approx(amplitude, rel=1e-3)


def test_slow_travels_bend_bristles_one_after_the_other_until_they_yield() -> None:
    stages = held(SOFT_ELEMENT)
    bristles, most = stages.kernel.having(Role.BRISTLE), stages.scales[0, stages.kernel.having(Role.BRISTLE)]
    there = np.array([0.4e-3])
    drawn = bent(stages, there, there)[0, bristles]
    assert drawn == pytest.approx([*most[:-1], 0.4e-3])
    back = bent(stages, there, np.array([np.inf]), np.array([-0.1e-3]))[0, bristles]
    assert back == pytest.approx(np.maximum(most - 0.1e-3, -most))


@pytest.mark.slow
def test_a_motion_that_swings_on_by_less_than_what_was_found_to_attract_is_not_at_rest() -> None:
    """A survey of many stages stops at one motion that attracts: there may be smaller ones."""
    flat = VARIANTS["rigid"].replace({"controller.crossover": "8 Hz", "motion.displacement": "4 mm"}).flat()
    still_moving = Motions(np.ones(1, bool), np.zeros(1, bool), np.zeros(1), np.full(1, np.nan), np.full(1, np.nan))
    assert judge_runs(flat, still_moving, ten_times_larger(flat), 1e-6).tolist() == ["hunts"]


def ten_times_larger(flat: dict[str, Any]) -> StageAttractors:
    """Return what attracts a stage, as if it had been seen to swing ten times as far."""
    attracted = find_attractors(flat, 1)
    return replace(attracted, target=replace(attracted.target, amplitude=10 * attracted.target.amplitude))


@pytest.mark.thorough
def test_a_stage_that_begins_to_hunt_after_hundreds_of_seconds() -> None:
    """A bias on one side, and bristles that hardly yield."""
    with allowance(CHECK_WORK / 2) as work:
        (motion,) = find_swings(draw(302, 12).flat())
    assert not work.exhausted
    assert motion.amplitude == pytest.approx(2.90279e-3, rel=1e-4)  # SciPy's as well


def test_a_motion_that_cannot_be_followed_to_its_end_is_not_decided() -> None:
    flat = VARIANTS["rigid"].replace({"controller.crossover": "14 Hz"}).flat()
    attracted = find_attractors(flat, 1)
    assert not attracted.attracts[0]
    moving = Motions(np.ones(1, bool), np.zeros(1, bool), np.zeros(1), np.full(1, 1e-4), np.full(1, np.nan))
    assert judge_runs(flat, moving, attracted, 1e-6).tolist() == ["transient"]
    with allowance(1):
        assert judge_runs(flat, moving, attracted, 1e-6).tolist() == ["undecided"]


@pytest.mark.slow
@pytest.mark.usefixtures("own_bandwidth")
def test_a_motion_that_swings_on_within_the_band_of_10_um_is_not_at_rest_for_sure() -> None:
    """The thesis's friction and speeds a hundredth as large: hunts by 5.2 um, of which this survey knows nothing."""
    friction = {"static": "0.03 N", "coulomb": "0.01 N", "stribeck_velocity": "16 um/s"}
    changes = {f"friction.{name}": value for name, value in friction.items()}
    small = VARIANTS["rigid"].replace({**changes, "controller.crossover": "8 Hz", "motion.duration": "60 s"})
    nothing = replace(hunting(small), target=None, cycles=())
    with patched({verdict: {"hunting": lambda stage, work, side: nothing}}):
        case = check_given(small)
    assert case.settling_time[1e-5] is not None
    assert 1.02e-5 < case.peak_to_peak < 1.06e-5
    assert (case.judgement.hunting.certain, case.judgement.hunting.reason) == (False, HuntingDoubt.MOTION)
    flat = small.flat()
    moved = run_motions(flat, 1, measuring_options(1e-6))
    assert judge_runs(flat, moved, ten_times_larger(flat), 1e-6).tolist() == ["undecided"]


@pytest.mark.slow
def test_a_motion_that_swings_beside_what_was_observed_for_six_of_its_periods_may_come_to_rest() -> None:
    """After a step of 18.7 mm the stage swings like them, at 1e-6, for up to 5000 s; at 1e-8 to 1e-10 it rests from
    2000 s on."""
    stage = BOOK["repeats every 174 s"]
    target = hunting(stage).target
    assert 2 * target.amplitude == pytest.approx(3.4929e-3, rel=1e-3)
    own = own_motion(stage, target, np.inf)
    assert own.completed
    assert not own.ends
    assert own.swing < 1e-9


@pytest.mark.slow
def test_a_motion_that_swings_less_often_than_what_was_observed_is_not_told_at_rest() -> None:
    """After a step of 12.09817 mm, the stage swings as far, but every 1215 s, with pauses of 940 s."""
    seldom = BOOK["repeats every 174 s"].replace({"motion.size": "-12.09817 mm"})
    target = hunting(seldom).target
    ends, completed, swing = ends_in(seldom.flat(), 1, target)
    assert completed[0]
    assert ends[0] or swings_seldom(target, ends, swing)[0]
    assert own_motion(seldom, target, np.inf).swing > target.amplitude


@pytest.mark.slow
def test_a_swing_that_grows_without_bound_has_no_size() -> None:
    """Without anti-windup, where b k_p < m k_i: in a run from 500 mm each swing is larger than the one before."""
    stage = BOOK["grows without bound"]
    result = hunting(stage)
    assert result.passing
    assert (result.certain, result.reason) == (False, HuntingDoubt.GROWTH)
    position = friso.simulate(stage, sample_time=0.1).position.to_numpy()
    swings = np.abs(position[:30000]).reshape(30, -1).max(axis=1)  # of 100 s each
    assert (np.diff(swings[3:]) > 0).all()
    assert swings[-1] > 2 * swings[3]
    assert not hunting(stage.replace({"controller.anti_windup": "clamp"})).passing


UNWINDING = {"controller.anti_windup": "none", "controller.crossover": "20 Hz"}


@pytest.mark.slow
def test_many_stages_are_judged_no_more_surely_than_one() -> None:
    """At 500 kN no motion tried reaches the limit for long, but farther ones do, and may grow."""
    stage = VARIANTS["rigid"].replace({**UNWINDING, "controller.force_limit": "500 kN"})
    result = hunting(stage)
    assert (result.certain, result.reason) == (False, HuntingDoubt.BEYOND)
    assert judge_many(stage.flat(), 1, 1e-6).tolist() == ["undecided"]
    clamped = stage.replace({"controller.anti_windup": "clamp"})
    assert judge_many(clamped.flat(), 1, 1e-6).tolist() == ["settles"]
    for either, word in ((stage, "unknown"), (clamped, "nothing")):
        runs = sweep(either, {"controller.crossover": ["20 Hz"]}, metrics=["attractor"])
        traced = diagram(Space.of(either, [KeyRange("controller.crossover", 20.0, 21.0)]), seeds=2)
        assert runs.attractor.values.tolist() == [word]
        assert place_verdicts(traced) == [REPELS if word == "nothing" else UNKNOWN] * 2


@pytest.mark.usefixtures("own_bandwidth")
def test_a_stage_that_large_motions_run_away_of_settles_for_certain_from_smaller_ones() -> None:
    """At 50 N every start tried comes to rest or runs away, and the farthest all run away."""
    stage = VARIANTS["rigid"].replace({**UNWINDING, "controller.force_limit": "50 N"})
    case = check_given(stage)
    assert (case.verdict, case.judgement.hunting.certain) == ("settles", True)
    assert judge_many(stage.flat(), 1, 1e-6).tolist() == ["settles"]
    away = case.judgement.running_away
    edge, flat = away.windows[0][0], stage.replace({"motion.duration": "200 s"}).flat()
    kicked = {**flat, "motion.displacement": edge * np.array([0.98, 1.02])}
    assert run_motions(kicked, 2, measuring_options(1e-8)).away.tolist() == [False, True]


@pytest.mark.slow
def test_a_large_swing_that_dies_out_slowly_does_not_attract() -> None:
    """Without anti-windup, where b k_p > m k_i: from 1.7 m swings last for 20 000 s, of 313 s each at first."""
    stage = BOOK["dies out slowly"]
    position = np.abs(friso.simulate(stage, sample_time=1.0).position.to_numpy())
    assert position[1000:1500].max() > 0.3
    assert position[5000:].max() < 1e-6
    result = hunting(stage)
    assert not (result.certain and result.observed)


@pytest.mark.slow
def test_an_orbit_beside_the_edge_of_a_window_beyond_which_a_controller_pushes_is_closed() -> None:
    """An orbit along the edge of a window has no derivative: the push holds the stage there as a relay does.

    By the linearised equations the orbit is unstable. Runs come to it to within 1e-13.
    """
    survey = hunting(draw(5101, 6, "axes"))
    (cycle,) = survey.attracting
    assert survey.certain
    assert (cycle.amplitude, cycle.period) == pytest.approx((4.57664e-4, 2.77911), rel=1e-5)


def test_a_motion_that_anti_windup_holds_far_out_is_not_said_to_run_away_for_good() -> None:
    """Runs of a step of 1 mm are followed for 1 km; with 10 kN the stage swings by 1.4 km to either side in the end."""
    limit = {"controller.force_limit": "10 kN", "controller.anti_windup": "back_calculation"}
    chosen = VARIANTS["rigid stage, PI"].replace({"controller.ki": "5e6 N/(m*s)"})
    case = check_given(chosen.replace({**limit, "controller.anti_windup_time": "50 ms"}))
    assert float(case.judgement.hunting.target.amplitude) == pytest.approx(1399, rel=0.01)
    assert (case.verdict, case.judgement.runs_away, case.runs_away) == ("failed", False, False)
    assert check_given(chosen).runs_away
