"""`friso tune`: machines, remedies, searches and outcomes, with tiny budgets."""

from collections.abc import Callable
from dataclasses import fields, replace
from functools import partial
from itertools import product
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast
from warnings import catch_warnings

import numpy as np
import pytest
from scipy.optimize import brentq
from snapshots import Snapshots
from variants import maxwell, release, van_dijk
from variants import stage as variant

import friso
from benchmarks.tune import performance_of
from friso import Stage, load, loads
from friso.app import questions
from friso.design_method.prepare import isolated
from friso.engine.batch import simulate
from friso.equations.bandwidth import breakaway, least_breakaway, sliding, sped_up
from friso.equations.motion import size
from friso.equations.settings import SETTINGS
from friso.frequency.bode import bandwidths_at, loop_bandwidth, loop_bandwidths, rigid_bandwidth, settled_margin
from friso.frequency.margins import controller_response
from friso.hunting import check_given, find_margin
from friso.hunting.measures import measured_run
from friso.questions.tune.question import TuneAnswer
from friso.questions.tune.words import unseen
from friso.remedies import verified
from friso.remedies.catalogue import (
    BANDWIDTH,
    FASTER_THAN_LEAST,
    FASTEST_UNASKED,
    Remedy,
    SpeedCap,
    remedies,
    speed_cap,
    suggestion,
)
from friso.remedies.machines import Fleet, Goal, MoveRange, draw_fleet
from friso.remedies.method import Advice, ChangeSize, change_size, least_factors, pairs, tune
from friso.remedies.search import (
    Attraction,
    Budget,
    Moves,
    Search,
    TriedPoints,
    attraction,
    modulus_margins,
    moves_of_points,
    quantile,
)
from friso.remedies.settings import RemedySettings
from friso.remedies.verified import MOVE_RTOL
from friso.stage.controllers import controller_of
from friso.stage.correlations import Correlations

EXAMPLES = Path(__file__).parent.parent / "examples"
AS_IS = partial(Remedy.settled_on, "")
ONE_POINT = np.zeros((1, 0))
TINY = Budget(points=3, generations=2, refined=1, machines=4, surveyed=2, fresh=6, further=74)


def unmet_goals(confirmation: Any, measured: verified.Performance, goal: Goal) -> tuple[str, ...]:
    """Return all parts of the goal that a stage misses or may miss."""
    return (*verified.unsettled_parts(confirmation, measured, goal), *verified.missed_parts(measured, goal))


def points_of(shares: Any, **columns: Any) -> TriedPoints:
    """Return settings that were tried, with 1 in all columns that are not stated."""
    shares = np.array(shares, float).reshape(len(shares), -1)
    names = [column.name for column in fields(TriedPoints)][1:]
    return TriedPoints(shares, *(np.array(columns.get(name, np.ones(len(shares)))) for name in names))


def search_of(remedy: Remedy, goal: Goal, machines: Fleet, *points: TriedPoints, **behaviour: Any) -> Search:
    """Return a search that has tried some points, and whose methods may behave otherwise."""
    search = Search(remedy, goal, machines, machines, remedy.stage, TINY, lambda label: None, [*points])
    vars(search).update(behaviour)
    return search


def every(batch: np.ndarray) -> np.ndarray:
    """Return one for each of the points."""
    return np.ones(len(batch))


@pytest.fixture(scope="module")
def rigid() -> Stage:
    """The thesis's rig without its joint: it hunts below 9.75 Hz."""
    return load(EXAMPLES / "thesis_rig.toml").replace({"joint": None, "parasitic": None})


@pytest.fixture(scope="module")
def goal() -> Goal:
    return Goal(bandwidth_limit=25.0, joint=False)


@pytest.fixture(scope="module")
def tuning(rigid: Stage, goal: Goal) -> Advice:
    """Interrupted in the middle of the second way."""

    def interrupt(done: int, total: int, label: str) -> None:
        if label.startswith("gains"):
            raise KeyboardInterrupt

    return tune(rigid, goal, budget=TINY, chosen=["bandwidth", "gains"], progress=interrupt)


@pytest.fixture(scope="module")
def works(tuning: Advice) -> SimpleNamespace:
    """The remedy that works, with its measured stage."""
    (outcome,) = tuning.working
    assert outcome.stage is not None
    assert outcome.measured is not None
    return SimpleNamespace(outcome=outcome, stage=outcome.stage, measured=outcome.measured)


@pytest.fixture(scope="module")
def machines(rigid: Stage) -> Fleet:
    return draw_fleet(rigid, Correlations(), 5, 1)


def test_settings_are_laid_over_machines_of_which_the_first_is_that_of_the_file(rigid: Stage, machines: Fleet) -> None:
    flat, own = machines.laid_over(rigid, {"controller.crossover": np.array([8.0, 16.0])}, 2), rigid.flat()
    assert all(flat[key][0] == own[key] for key in [*machines.ratios, "motion.acceleration_time"] if key in own)
    assert np.ptp(flat["friction.static"]) > 0
    assert flat["controller.crossover"].tolist() == [8.0] * 5 + [16.0] * 5
    assert flat["friction.static"][:5].tolist() == flat["friction.static"][5:].tolist()
    assert set(flat["controller.tuned_mass"]) == {own["controller.tuned_mass"]}


def test_both_parts_of_a_split_mass_are_as_heavy_as_the_whole(rigid: Stage) -> None:
    gone = dict.fromkeys(("masses.cart", "controller.tuned_mass"))
    whole = rigid.replace({**gone, "masses.stage": "2 kg"})
    machines, free = draw_fleet(whole, Correlations(), 4, 1), isolated(whole)
    flat = machines.laid_over(free, {}, 1)
    np.testing.assert_allclose(
        flat["masses.cart"] + flat["masses.stage"], machines.laid_over(whole, {}, 1)["masses.stage"]
    )
    assert free.flat()["controller.tuned_mass"] == 2.0
    assert free.flat()["joint.stiffness"] * free.flat()["joint.stroke"] < least_breakaway(whole.flat())


def moved_there(stage: Stage, within: float) -> float:
    """Return how long a stage takes to settle after its first move, before it returns [s]."""
    trace = simulate(stage, 1e-6, 1e-4)
    time, off = np.asarray(trace["time"]), np.asarray(trace["position"] - trace["reference"])
    flat = stage.flat()
    outside = time[(time < flat["motion.return_at"]) & (np.abs(off) > within)]
    return float(outside[-1] - 2 * flat["motion.acceleration_time"])


def test_moves_and_margin_of_a_machine_are_those_of_its_stage(rigid: Stage, machines: Fleet, goal: Goal) -> None:
    fast = rigid.replace({"controller.crossover": "20 Hz"})
    moves = moves_of_points(AS_IS(fast), ONE_POINT, machines, goal, rtol=MOVE_RTOL)
    alone = measured_run(fast)
    there = moved_there(fast, goal.within)
    assert moves.settling[0, 0] == pytest.approx(max(alone.in_the_end[0][0], there), abs=2e-4)
    assert moves.looser[0, 0] == pytest.approx(max(alone.in_the_end[1][0], moved_there(fast, 1e-5)), abs=2e-4)
    assert (moves.settling[0, 0], moves.looser[0, 0]) == pytest.approx([time[0] for time in alone.settling_time])
    assert there > alone.in_the_end[0][0]
    assert moves.force[0, 0] == pytest.approx(alone.largest_force[0], rel=1e-9)
    limited = fast.replace({"controller.force_limit": "60 N"})
    assert moves_of_points(AS_IS(limited), ONE_POINT, machines, goal).force.max() == 60.0
    margin = modulus_margins(AS_IS(rigid), ONE_POINT, machines, rigid)[0, 0]
    assert margin == pytest.approx(settled_margin(rigid.flat()), rel=0.02)


def test_what_attracts_is_looked_for_down_to_the_distance(rigid: Stage, machines: Fleet, goal: Goal) -> None:
    """The edge is at 9.75 Hz: at 11 Hz nothing attracts, at 11 Hz over 1.2 something does. With a force limit and no
    anti-windup farther motions may grow: nothing found to attract is not certain."""
    near, far = (rigid.replace({"controller.crossover": f"{hertz} Hz"}) for hertz in (11, 14))
    one = machines.take(np.array([0]))
    limited = far.replace({"controller.force_limit": "500 kN", "controller.anti_windup": "none"})
    results = [attraction(AS_IS(stage), ONE_POINT, one, goal) for stage in (near, far, limited)]
    assert [result.clear[0, 0] for result in results] == [False, True, True]
    assert [result.surely_clear[0, 0] for result in results] == [False, True, False]


def test_a_quantile_is_a_machine_s() -> None:
    assert quantile(np.array([[3.0, 1.0, np.inf, 2.0]]), 0.75)[0] == 3.0
    assert quantile(np.arange(20.0)[None], 0.95)[0] == 18.0


def test_ways_are_what_may_be_changed(rigid: Stage) -> None:
    names = {name: [remedy.name for remedy in remedies(rigid, goal)] for name, goal in GOALS.items()}
    assert names["all"] == [*names["controller"], *names["joint"], "isolator and gains"]
    assert names["joint"] == ["isolator"]
    assert names["controller"][:2] == ["bandwidth", "gains"]


def test_friction_of_any_law_counts() -> None:
    """Friction counts under a law from outside friso, and on a motor alone, where it holds no cart at a joint."""
    own = variant(release("1 mm", "1 s"), friction=maxwell(0.4), controller=van_dijk("12 Hz"))
    assert breakaway(own.flat()) == least_breakaway(own.flat()) == pytest.approx(2.82)
    assert sliding(own.flat()) == pytest.approx(0.4 * 2.82)
    assert {"isolator", "integral limit"} <= {remedy.name for remedy in remedies(own, Goal())}
    assert SETTINGS["limit"].ranges(own.flat(), 1e-6) == {"controller.integral_limit": pytest.approx((0.141, 5.64))}
    screw = load(EXAMPLES / "ball_screw_axis.toml")
    at_motor = screw.flat()["motor_friction.static"]
    assert breakaway(screw.flat()) == pytest.approx(screw.flat()["friction.static"] + at_motor)
    free = screw.replace({"friction": {"model": "none"}})
    names = {remedy.name for remedy in remedies(free, Goal())}
    assert "integral limit" in names
    assert "isolator" not in names
    assert breakaway(free.flat()) == sliding(free.flat()) + at_motor - free.flat()["motor_friction.coulomb"] == at_motor


def test_the_weaker_direction_breaks_away_first() -> None:
    flat = load(EXAMPLES / "thesis_rig.toml").replace({"friction.asymmetry": 0.2, "bias.cart": "0.3 N"}).flat()
    several = {**flat, "friction.static": np.array([2.0, 3.0])}
    assert least_breakaway(several) == pytest.approx([2.0 * 0.8 - 0.3, 3.0 * 0.8 - 0.3])


GOALS = {"all": Goal(), "controller": Goal(joint=False), "joint": Goal(controller=False)}


CONTROLLERS = {
    "gains": {"kind": "pid", "kp": "1.4 kN/m", "ki": "11 kN/(m*s)", "kd": "85 N*s/m", "tau": "5 ms"},
    "cascade": {"kind": "cascade", "kv": "10 1/s", "kp": "85 N*s/m", "velocity_integral_time": "100 ms"},
}


@pytest.mark.slow
@pytest.mark.parametrize("factor", [0.5, 3.978])
def test_bandwidth_and_margin_are_those_of_the_gains_at_standstill_too(
    rigid: Stage, machines: Fleet, factor: float
) -> None:
    """Within its window the loop has other gains: the larger bandwidth and the smaller margin of both count."""

    def made(times: float, **more: Any) -> Stage:
        scaled = {"kp": f"{2e4 * times} N/m", "ki": f"{1e5 * times} N/(m*s)", "kd": f"{500 * times} N*s/m"}
        table = {"kind": "pid", **scaled, "tau": "0.5 ms", "derivative_on": "error", **more}
        return rigid.replace({"controller": table})

    switched = made(1, standstill_window="100 um", standstill_factor=factor)
    plain, inside = made(1), made(factor)
    larger = max(loop_bandwidth(plain), loop_bandwidth(inside))
    assert loop_bandwidth(switched) == pytest.approx(larger, rel=1e-6)
    assert loop_bandwidths(switched, {}, 1)[0] == pytest.approx(larger, rel=2e-3)
    own, *both = (modulus_margins(AS_IS(one), ONE_POINT, machines, one) for one in (switched, plain, inside))
    assert own == pytest.approx(np.minimum(*both))
    assert np.abs(both[0] - both[1]).min() > 1e-3
    measured, *others = (performance_of(one, machines, Goal(settle=1e-9), one) for one in (switched, plain, inside))
    assert measured.own_margin == pytest.approx(min(other.own_margin for other in others))


def crossing(loop: Callable[[complex], complex], low: float, high: float) -> float:
    """Return the frequency between two others at which the gain of a loop is 1 [Hz]."""
    root: Any = brentq(lambda hertz: np.log(abs(loop(2j * np.pi * hertz))), low, high, xtol=1e-9)
    return float(root)


def by_rules(s: complex) -> complex:
    """The thesis's Eq. 7 and 8 at 8 Hz, alpha 0.1, beta 2, for 1.7 kg [N/m]."""
    rate = 2 * np.pi * 8
    lead, lag, integral = np.sqrt(1 / 0.1) / rate, np.sqrt(0.1) / rate, 2 * np.sqrt(1 / 0.1) / rate
    return 1.7 * rate**2 * np.sqrt(0.1) * (lead * s + 1) * (1 + 1 / (integral * s)) / (lag * s + 1)


def observed(s: complex) -> complex:
    """The feedback of what an observer estimates [N/m], from its own equations: w_c = 2 pi 3 Hz, w_o = 5 w_c,
    1.7 kg."""
    slow = 2 * np.pi * 3
    fast, mass = 5 * slow, 1.7
    feedback = np.array([slow**2, 2 * slow, 1.0])
    gains = np.array([3 * fast, 3 * fast**2, fast**3])
    drift = np.diag([1.0, 1.0], 1) - np.outer(gains, [1, 0, 0]) - np.outer([0, 1, 0], feedback)
    return complex(mass * feedback @ np.linalg.solve(s * np.eye(3) - drift, gains))


@pytest.mark.cases(first=2)
@pytest.mark.parametrize(
    ("controller", "force", "free", "between"),
    [
        ({}, by_rules, False, (4.0, 16.0)),
        ({}, by_rules, True, (15.0, 40.0)),
        ({"kind": "adrc", "bandwidth": "3 Hz"}, observed, False, (4.0, 16.0)),
    ],
)
def test_the_bandwidth_is_where_the_loop_last_crosses_0_db(
    controller: dict[str, Any], force: Callable[[complex], complex], free: bool, between: tuple[float, float]
) -> None:
    """Transfer functions written by hand are the reference: 8.08, 24.75 and 8.21 Hz.

    The controller's own key may state another value.
    """
    rig = load(EXAMPLES / "thesis_rig.toml").replace({"parasitic": None, "joint.locked": not free})
    stage = Stage(**{**rig.as_written(), "controller": controller}) if controller else rig
    flat = stage.flat()
    cart, end, viscous = flat["masses.cart"], flat["masses.stage"], flat["friction.viscous"]

    def plant(s: complex) -> complex:
        if not free:
            return 1 / ((cart + end) * s**2 + viscous * s)
        joint = flat["joint.damping"] * s + flat["joint.stiffness"]
        carried = cart * s**2 + viscous * s + joint
        return carried / ((end * s**2 + joint) * carried - joint**2)

    by_hand = crossing(lambda s: force(s) * plant(s), *between)
    assert loop_bandwidth(stage) == pytest.approx(by_hand, rel=1e-3)
    assert bandwidths_at(stage, [1.0]) == pytest.approx([by_hand], rel=1e-3)
    assert rigid_bandwidth(stage) == pytest.approx(by_hand if not free else 8.08, rel=1e-3)


def test_a_light_mode_that_rises_above_0_db_is_where_the_loop_last_crosses_it(rigid: Stage) -> None:
    mode = {"frequency": "300 Hz", "mass": "0.25 kg", "damping_ratio": 5e-4}
    stage = rigid.replace({"controller.crossover": "30 Hz", "joint": {**LIMITER, "locked": True}, "parasitic": mode})
    assert loop_bandwidth(stage) > 200
    assert bandwidths_at(stage, [1.0]) == pytest.approx([loop_bandwidth(stage)], rel=1e-3)


@pytest.mark.parametrize("kind", [*CONTROLLERS])
def test_other_structures_are_stages(rigid: Stage, kind: str) -> None:
    """Each structure differs from the present one, and the thesis's rules have the gains of Eq. 7."""
    stage = Stage(**{**rigid.as_written(), "controller": CONTROLLERS[kind]})
    gain = stage.flat()["controller.kp"] * np.array([0.7, 1.0, 2.0])
    alone = [loop_bandwidth(stage.with_numbers({"controller.kp": float(value)})) for value in gain]
    assert loop_bandwidths(stage, {"controller.kp": gain}, 3) == pytest.approx(alone, rel=1e-3)
    listed = controller_of(stage.flat()).structures(stage.flat())
    tried = [remedy for remedy in remedies(stage, Goal(joint=False)) if remedy.name in listed]
    assert [remedy.name for remedy in tried] == [*listed]
    assert all(remedy.stage.flat() != stage.flat() for remedy in tried)
    assert "feedforward of the move" in listed
    (by_gains,) = [remedy for remedy in remedies(rigid, Goal(joint=False)) if "derivative" in remedy.name]
    step = stage.replace({"motion": {"kind": "step", "size": "1 mm", "duration": "1 s"}})
    assert "feedforward of the move" not in {remedy.name for remedy in remedies(step, Goal(joint=False))}
    gain = 1.7 * (2 * np.pi * 8.0) ** 2 * 0.1**0.5
    assert by_gains.stage.flat()["controller.kd"] == pytest.approx(gain * 10**0.5 / (2 * np.pi * 8.0))


def test_changes_are_compared_by_what_is_bought_then_by_keys_then_by_factors(rigid: Stage) -> None:
    twice, thrice = (rigid.replace({"controller.crossover": f"{hertz} Hz"}) for hertz in (16, 24))
    both = twice.replace({"controller.alpha": 0.05})
    free = isolated(rigid)
    sizes = [change_size(rigid, stage) for stage in (rigid, twice, thrice, both, free)]
    assert sizes == sorted(sizes)
    assert sizes[0] == ChangeSize(False, 0, 1.0)
    assert (sizes[3].keys, sizes[3].factor) == (2, pytest.approx(4.0))
    assert change_size(twice, rigid).factor == pytest.approx(2.0)
    assert sizes[4].bought


def factors_searched(
    rigid: Stage, machines: Fleet, works: Callable[[Any], Any], **behaviour: Any
) -> tuple[Any, Search]:
    """Return the bandwidth as a variable, and a search in which its factors work as stated, the larger the sooner."""
    remedy = remedies(rigid, Goal())[0]
    (variable,) = remedy.variables

    def measured(points: np.ndarray, *_: object) -> TriedPoints:
        factors = variable.at(points[:, 0])
        return points_of(points, settling=np.where(works(factors), 1 / factors, np.inf))

    looks = {"share": every, "clear": lambda batch: np.ones(len(batch), bool), "_closer": lambda point: []}
    return variable, search_of(remedy, Goal(), machines, measured=measured, **looks | behaviour)


@pytest.mark.parametrize(
    ("works", "on_fresh", "clear", "least"),
    [
        (1.3, 1.3, 1.3, 1.3),
        (1.3, 2.0, 1.3, 2.0),
        (1.3, 1.3, 2.6, 2.6),
        (1.3, 0.0, 0.0, 1.3),
    ],
)
def test_the_least_factor_that_works_on_fresh_machines_without_hunting_is_taken(
    rigid: Stage, machines: Fleet, works: float, on_fresh: float, clear: float, least: float
) -> None:
    """A stage that a factor of 8 cures was told to go to the end of the search as "the least change"."""
    variable, search = factors_searched(
        rigid,
        machines,
        lambda factors: factors > works,
        share=lambda batch: np.where(variable.at(batch[:, 0]) > on_fresh, 1.0, 0.99),
        clear=lambda batch: variable.at(batch[:, 0]) > clear,
    )
    factors = [float(variable.at(point)[0]) for point in least_factors(search)]
    assert least < factors[0] < 1.11 * least
    assert factors == sorted(factors)


def test_a_smaller_factor_may_lie_below(rigid: Stage, machines: Fleet) -> None:
    variable, search = factors_searched(rigid, machines, lambda factors: np.abs(np.log(factors)) > 0.2)
    assert np.exp(-0.26) < variable.at(next(least_factors(search)))[0] < np.exp(-0.2)
    cut = search_of(search.remedy, Goal(), machines)
    with RemedySettings(search_work=1.0).in_use():  # which ends before the first point
        assert [*least_factors(cut)] == []
    assert cut.cut
    assert len(cut.points.shares) == 0


def working(remedy: Remedy, tuned: Stage) -> verified.RemedyOutcome:
    """Return the outcome of a remedy that works, without measurements."""
    return verified.RemedyOutcome(remedy, tuned, None, None, ())


@pytest.mark.slow
def test_the_answer_does_not_hunt(tuning: Advice, works: Any) -> None:
    """The answer's verdicts say so, and so does `friso check`; the edge is at least a fifth of the bandwidth away."""
    assert tuning.needed
    assert tuning.case.verdict == "hunts"
    confirmation = works.outcome.confirmation
    assert confirmation.stage == works.stage
    assert (confirmation.verdict, confirmation.certain, confirmation.doubts) == ("settles", True, ())
    case = check_given(works.stage)
    edge = case.judgement.margin
    assert (case.verdict, case.judgement.hunting.certain) == ("settles", True)
    assert edge.factor * tuning.goal.distance < 1
    assert settled_margin(works.stage.flat()) >= tuning.goal.margin


@pytest.mark.slow
def test_the_stiffness_under_load_is_that_of_the_loop(rigid: Stage) -> None:
    """Before the integral acts, a controller is nowhere softer.

    The stiffness of van Dijk's rules was stated too small, by 1/beta, and a free joint was said to cost nothing,
    although the load acts on the stage, with actuator and sensor. At standstill the gains of standstill count, and
    behind a motor's encoder the transmission does.
    """
    cascade, screw = load(EXAMPLES / "twincat_cascade.toml"), load(EXAMPLES / "ball_screw_axis.toml")

    def stiffness(stage: Stage) -> float:
        return verified.moving(stage, draw_fleet(stage, Correlations(), 1, 1), Goal(), stage).stiffness

    for stage in (rigid, cascade):
        softest = np.abs(controller_response(stage.flat(), np.geomspace(0.1, 1e3, 500))).min()
        assert stiffness(stage) == pytest.approx(softest, rel=0.05)
    own = stiffness(rigid)
    assert stiffness(isolated(rigid)) == pytest.approx(own)
    at_rest = rigid.replace({"controller.standstill_window": "1 um", "controller.standstill_factor": 3.0})
    assert stiffness(at_rest) == pytest.approx(3 * own)
    behind = screw.replace({"encoder.position": "motor"})
    assert 1 / stiffness(behind) == pytest.approx(1 / 220e3 + 1 / 35e6)


@pytest.mark.slow
def test_a_stage_that_hunts_is_never_an_answer(rigid: Stage, goal: Goal, tuning: Advice) -> None:
    """Settings with which only some moves settle are none either: 11.5 Hz is too close to the edge of 9.75 Hz."""
    near = rigid.replace({"controller.crossover": "11.5 Hz"})
    measured, confirmation = performance_of(near, tuning.machines, goal, near), verified.confirmed(near, goal)
    assert {"distance", "hunting"} <= {*unmet_goals(confirmation, measured, goal)}
    assert confirmation.verdict == "settles"
    assert verified.confirmed(rigid.replace({"controller.crossover": "9 Hz"}), goal).doubts == ("verdict", "distance")
    assert verified.confirmed(rigid, goal).doubts == ("verdict", "distance", "window")


@pytest.mark.slow
def test_the_distance_from_hunting_is_that_from_its_edge(rigid: Stage, goal: Goal) -> None:
    """Found from other starts than the edge, which follows orbits: 1.2 times the quiet end is far enough, less is not.

    The stage's own motion does not settle in time at the lower bandwidth, which is no doubt.
    """
    edge = find_margin(rigid.replace({"controller.crossover": "12 Hz"}), attracting=False)
    ends = edge.crossover / edge.factor * np.array([edge.factor * 0.995, edge.quiet * 1.005]) * goal.distance
    near, far = (verified.confirmed(rigid.replace({"controller.crossover": f"{end} Hz"}), goal) for end in ends)
    assert (near.doubts, far.doubts) == (("distance",), ())


def test_a_pair_is_tried_only_where_no_change_of_the_controller_works(rigid: Stage, goal: Goal) -> None:
    limit = next(remedy for remedy in remedies(rigid, goal) if remedy.name == "integral limit")
    points = TriedPoints(np.zeros((1, 1)), *np.full((8, 1), np.inf))
    closest = verified.RemedyOutcome(limit, None, None, None, (), points)
    assert [pair.name for pair in pairs([closest], goal)] == ["integral limit, and bandwidth"]
    assert not pairs([closest, working(Remedy.settled_on("bandwidth", rigid), rigid)], goal)
    assert pairs([closest, working(Remedy.settled_on("isolator", rigid, buys_joint=True), rigid)], goal)


@pytest.mark.parametrize(("work", "certainty"), [(RemedySettings().search_work, "does not work"), (1e5, "given up")])
def test_a_search_that_is_cut_says_so_and_not_that_nothing_works(
    rigid: Stage, machines: Fleet, tuning: Advice, work: float, certainty: str
) -> None:
    goal = Goal(margin=0.9, joint=False)
    with RemedySettings(search_work=work).in_use():
        search = search_of(remedies(rigid, goal)[0], goal, machines)
        search.optimise()
    tried = search.points if search.tried else tuning.outcomes[0].points
    outcome = verified.RemedyOutcome(search.remedy, None, None, None, (), tried, cut=search.cut)
    assert outcome.certainty == certainty


def test_a_share_that_few_machines_leave_open_is_measured_on_more(rigid: Stage) -> None:
    """99 of 100 machines may be chance for 94 %; 398 of 400 are not."""
    measured = made_up(100, settling=range(1))[1]
    goal = Goal()
    assert measured.decides(goal) is None
    assert replace(measured, further=np.arange(300) > 0).decides(goal)
    assert replace(measured, further=np.arange(300) > 60).decides(goal) is False
    assert made_up(100)[1].decides(goal)
    fleet = draw_fleet(rigid, Correlations(), 3, 1)
    further = measured.with_further(rigid, fleet, goal, rigid)
    assert further.count == 103
    assert not further.further.any()  # it hunts


def test_moves_fill_their_range_evenly_and_are_what_the_stage_makes(rigid: Stage) -> None:
    """However few there are: twelve of them leave no tenth of the range, in the logarithm, without any by much."""
    stage = rigid.replace({"moves": {"smallest": "10 um", "largest": "10 mm", **ACCELERATIONS}})
    moves = MoveRange.of_stage(stage, 1e-6)
    assert moves == MoveRange(1e-5, 1e-2, (1.0, 10.0))
    fleet = draw_fleet(stage, Correlations(), 25, 1, moves)
    assert fleet.sizes[0] == 1e-2  # the file's own is larger
    for some in (fleet.sizes[1:13], fleet.sizes[13:]):
        assert np.diff(np.sort(np.log(some / 1e-5) / np.log(1000.0))).max() < 0.2
    flat = fleet.laid_over(stage, {}, 2)
    assert np.asarray(size(flat)) == pytest.approx(np.tile(fleet.sizes, 2))
    assert flat["motion.acceleration"][:25] == pytest.approx(fleet.accelerations)
    assert (fleet.accelerations.min(), fleet.accelerations.max()) == pytest.approx((1, 10), rel=0.2)
    own = MoveRange.of_stage(rigid, 1e-6)
    assert (own.smallest, own.largest) == pytest.approx((1e-5, 0.09))
    step = rigid.replace({"motion": {"kind": "step", "size": "-1 mm", "duration": "1 s"}})
    assert draw_fleet(step, Correlations(), 3, 1, MoveRange(1e-5, 1e-4)).laid_over(step, {}, 1)["motion.size"].max() < 0


ACCELERATIONS = {"lowest_acceleration": "1 m/s^2", "highest_acceleration": "10 m/s^2"}


@pytest.mark.parametrize(
    ("missed", "held"),
    [
        ([], (1e-5, 1e-1)),
        (range(30), (30, 99)),
        ([*range(30), 50], (30, 99)),
        ([*range(45), *range(55, 100)], None),
        ([50], (0, 99)),
        ([99], (0, 99)),
        ([2, 97], (0, 99)),
        ([97, 98, 99], (0, 96)),
        (range(80, 100), (0, 79)),
    ],
)
def test_the_goal_holds_between_the_moves_next_to_which_enough_meet_it(missed: Any, held: Any) -> None:
    """Any number of misses may lie next to either end of the range of moves; fewer than 20 moves decide nothing.

    One miss among the last moves may be chance, and ends no range; three misses in a row are not.
    """
    sizes = np.geomspace(1e-5, 1e-1, 102)[1:-1]
    moves = Moves(*(np.where(np.isin(np.arange(100), missed), np.inf, 1.0)[None] for _ in range(3)))
    measured = verified.Performance(moves, np.ones((1, 100)), Attraction.none(100), 1.0, 1.0, np.zeros(0, bool), sizes)
    assert measured.held_moves(Goal()) is None  # nobody knows yet which machines hunt
    between = replace(measured, moves_drawn=MoveRange(1e-5, 1e-1), is_surveyed=True).held_moves(Goal())
    ends = {0: 1e-5, 99: 1e-1}
    expected = held and tuple(ends.get(end, sizes[end] if isinstance(end, int) else end) for end in held)
    assert between == (None if held is None else pytest.approx(expected))


DRIVE = {"sample_time": "1 ms", "delay": "3 ms", "current_bandwidth": "40 Hz .. 400 Hz"}


def test_sensitivities_are_those_behind_the_drive_as_built(tuning: Advice, works: Any) -> None:
    stage = tuning.stage.replace({"drive": {**DRIVE, "current_bandwidth": "200 Hz", "travel_per_turn": "10 mm"}})
    advice = replace(tuning, as_built={"drive": stage.as_written()["drive"]})
    (figure,) = TuneAnswer(advice).figures()
    for own, series in zip((tuning.stage, works.stage), figure.panels[2].series, strict=False):
        alone = draw_fleet(own, Correlations(), 1, 1)
        margin = modulus_margins(AS_IS(own), verified.NO_VARIABLES, alone, stage)[0, 0]
        assert 1 / np.nanmax(series.y) == pytest.approx(margin, rel=2e-3)


LIMITER = {"limiter_stiffness": "2e7 N/m", "limiter_damping": "100 N*s/m"}


def test_a_force_that_is_not_finite_warns_of_nothing() -> None:
    """With a force limit below 1 N the library's overflow warning appeared on the user's screen."""
    with catch_warnings(action="error"):
        assert np.isfinite(points_of([0.0], force=[np.inf]).cost(Goal(force_limit=0.2))).all()


@pytest.mark.cases(first=7)
@pytest.mark.parametrize("first", np.arange(0, 0.95, 0.08))
def test_a_narrow_range_in_which_nothing_attracts_is_found(first: float, machines: Fleet, rigid: Stage) -> None:
    """Settings settle sooner the lower they are, and a window of 6 % anywhere has no limit cycle.

    Next to settings with a limit cycle none is surveyed.
    """
    shares = np.linspace(0, 1, 60)
    attracted: list[float] = []

    def clear(batch: np.ndarray) -> np.ndarray:
        inside = (batch[:, 0] >= first) & (batch[:, 0] <= first + 0.06)
        attracted.extend(batch[~inside, 0])
        return inside

    looks = {"clear": clear, "share": every, "_closer": lambda point: []}
    assert [*search_of(AS_IS(rigid), Goal(), machines, points_of(shares, settling=1 + shares), **looks).surveyed()]
    assert np.diff(np.sort(attracted)).min() > 0.03


def test_a_stage_that_never_leaves_does_not_settle(rigid: Stage, machines: Fleet) -> None:
    """Held by its friction, it is in position once the reference is back: that was the fastest remedy of an axis."""
    weak = {"kind": "pid", "kp": "1 N/m", "ki": "0 N/(m*s)", "kd": "1 N*s/m", "derivative_on": "measurement"}
    moves = moves_of_points(AS_IS(rigid.replace({"controller": weak})), ONE_POINT, machines, Goal())
    assert not np.isfinite(moves.looser).any()


@pytest.mark.slow
def test_check_tells_what_an_isolator_would_do(rigid: Stage) -> None:
    """At 8 Hz one isolator settles the stage; at 1 Hz none of those tried does."""
    tried, none = suggestion(rigid), suggestion(rigid.replace({"controller.crossover": "1 Hz"}))
    flat = tried.stage.flat()
    assert (tried.settles, none.settles) == (True, False)
    assert flat["joint.stiffness"] * flat["joint.stroke"] < flat["friction.static"]
    assert suggestion(load(EXAMPLES / "thesis_rig.toml")) is None


def made_up(machines: int = 40, given_up: tuple[str, ...] = (), **failing: Any) -> tuple[Any, verified.Performance]:
    """A stage that settles, and machines of which some fail a part of the goal."""
    ok = {name: np.array([k not in failing.get(name, ()) for k in range(machines)])[None] for name in PARTS}
    moves = Moves(np.where(ok["settling"], 0.1, np.inf), np.full((1, machines), 0.1), np.where(ok["force"], 1.0, 99.0))
    margin = np.where(ok["margin"], 0.6, 0.1)
    survey = Attraction(~ok["hunting"], np.ones((1, machines), bool), np.ones((1, machines), bool))
    measured = verified.Performance(moves, margin, survey, 0.6, 1e6, is_surveyed=True)
    return SimpleNamespace(doubts=given_up, unstable=()), measured


PARTS = ("hunting", "settling", "margin", "force")
FORCE_LIMITED = Goal(force_limit=10.0)


def test_machines_that_meet_all_of_the_goal_are_counted() -> None:
    """2 of 40 fail each part: 95 % meet each, 80 % meet all."""
    each_two: dict[str, Any] = {name: range(2 * k, 2 * k + 2) for k, name in enumerate(PARTS)}
    apart = made_up(**each_two)
    assert apart[1].share(FORCE_LIMITED).probability == pytest.approx(0.8)
    assert unmet_goals(*apart, FORCE_LIMITED) == ("together",)
    some, many = (dict[str, Any].fromkeys(PARTS, range(count)) for count in (12, 20))
    assert unmet_goals(*made_up(400, **some), FORCE_LIMITED) == ()
    assert unmet_goals(*made_up(400, **many), FORCE_LIMITED) == ("together",)  # by chance
    assert unmet_goals(*made_up(margin=range(3), force=range(3, 5)), FORCE_LIMITED) == ("margin",)
    surveyed = made_up(settling=range(2))[1]
    unknown = replace(surveyed, is_surveyed=False).share(Goal())  # all that meet the rest may hunt
    assert np.isnan(unknown.probability)
    assert (unknown.low, unknown.high) == (0.0, surveyed.share(Goal()).high)


def test_a_stage_of_which_it_is_not_known_what_attracts_it_is_a_doubt(rigid: Stage, goal: Goal) -> None:
    assert unmet_goals(*made_up(given_up=("given up",)), FORCE_LIMITED) == ("given up",)
    with RemedySettings(confirming_work=1e6).in_use():
        given_up = verified.confirmed(rigid, goal)
    assert (given_up.doubts, given_up.verdict) == (("given up",), "failed")


def test_costs_order_settings() -> None:
    """A setting that breaks a constraint costs more than one that meets all, and more the further it breaks it.

    If not all machines settle, it costs more the fewer do.
    """
    columns: dict[str, Any] = {"settling": [1.0, 2.0, 1.0, np.inf, np.inf], "margin": [0.6, 0.6, 0.4, 0.6, 0.6]}
    points = points_of([0.0] * 5, **columns, bandwidth=[8.0] * 5, nearness=[1.0, 1.0, 1.0, 0.75, 0.25])
    assert points.cost(Goal()).argsort().tolist() == [0, 1, 2, 3, 4]


@pytest.mark.parametrize(
    ("drive", "mode", "limit", "factor", "reason"),
    [
        ({}, None, None, 4.0, "unknown"),
        ({"sample_time": "5 ms"}, None, None, 20 / 8, "sampling"),
        ({}, "30 Hz", None, 15 / 8, "mode"),
        ({}, "9 Hz", None, 1.0, "mode"),
        ({"sample_time": "5 ms"}, "30 Hz", 25.0, 10.0, "stated"),
    ],
)
def test_the_speed_is_capped_by_sampling_mode_or_what_is_unknown_unless_a_limit_is_stated(
    rigid: Stage, drive: dict, mode: str | None, limit: float | None, factor: float, reason: str
) -> None:
    """The bandwidth of a locked stage on van Dijk's rules is about its crossover, 8 Hz."""
    locked = load(friso.example("thesis_rig")).replace({"joint.locked": True})
    parasitic = {"frequency": mode, "mass": "1 g", "damping_ratio": 0.5}
    stage = locked.replace({"parasitic": parasitic}) if mode else rigid
    stage = stage.replace({"drive": drive}) if drive else stage
    cap = speed_cap(stage, Goal(bandwidth_limit=limit))
    assert (cap.factor, cap.reason) == (pytest.approx(factor, rel=0.05), reason)


def test_no_gain_goes_beyond_the_cap_whatever_is_turned(rigid: Stage) -> None:
    """That holds at all corners of the ranges, for a filter's time constant as for gains."""
    gains = {"kind": "pid", "kp": "1.4 kN/m", "ki": "11 kN/(m*s)", "kd": "85 N*s/m", "tau": "5 ms"}
    stage = rigid.replace({"controller": gains})
    before = stage.flat()
    most = sped_up(before, FASTEST_UNASKED)
    for remedy in remedies(stage, Goal()):
        corners = np.array([*product((0.0, 1.0), repeat=len(remedy.variables))])
        changed = remedy.changes(corners)
        for key in {*most} & {*changed}:
            furthest = changed[key].max() / most[key] if most[key] > before[key] else most[key] / changed[key].min()
            assert furthest <= 1 + 1e-9


def test_once_a_speed_works_others_stay_near_it_and_a_stated_limit_stands() -> None:
    assert SpeedCap(4.0, "unknown").above(2.0) == SpeedCap(2.0 * FASTER_THAN_LEAST, "least")
    assert SpeedCap(2.1, "mode").above(2.0) == SpeedCap(2.1, "least")
    assert SpeedCap(10.0, "stated").above(2.0) == SpeedCap(10.0, "stated")


def test_tuned_numbers_are_in_the_units_of_the_file_and_others_stay_as_they_are_written() -> None:
    """What is typed as 1 A/mm is answered in A/mm."""
    stage = Stage(
        masses={"stage": "12 kg"},
        actuator={"motor_constant": "55 N/A"},
        controller={"kind": "pid", "kp": "1 A/mm", "ki": "22 A/(mm*s)", "kd": "25.0 A*s/m", "tau": "2 ms"},
        motion={"kind": "hold", "duration": "1 s"},
    )
    flat = stage.flat()
    tuned = stage.with_rounded({"controller.kp": flat["controller.kp"] * 1.23456, "controller.kd": 1375.0}, 4)
    assert tuned.as_written()["controller"] == {**stage.as_written()["controller"], "kp": "1.235 A/mm"}


def test_the_speed_of_the_controller_comes_first_however_many_keys_spell_it(tuning: Advice, works: Any) -> None:
    """Another remedy that changes one key, for as much force, comes after it."""
    slow, quick = (
        next(one.remedy for one in tuning.outcomes if (one.remedy.name == BANDWIDTH) == is_it) for is_it in (0, 1)
    )
    small, large = ({"controller.beta": 2.1}, {**sped_up(tuning.stage.flat(), 1.2), "controller.alpha": 0.12})
    outcomes = [
        replace(works.outcome, remedy=remedy, stage=tuning.stage.with_numbers(numbers))
        for remedy, numbers in ((slow, small), (quick, large))
    ]
    assert replace(tuning, outcomes=(*outcomes,)).working[0].remedy.name == BANDWIDTH


def test_the_answer_changes_the_bandwidth_alone_and_is_that_so_far(tuning: Advice, works: Any) -> None:
    document = TuneAnswer(tuning).to_dict()
    assert document["interrupted"]
    assert (document["least_change"], document["ways"]["gains"]["works"]) == ("bandwidth", "unsure")
    way = document["ways"]["bandwidth"]
    assert (way["works"], way["keys_changed"], way["doubts"]) == ("works", 1, [])
    (change,) = way["changes"]
    assert change.startswith("controller.crossover = ")
    assert loop_bandwidth(works.stage) < tuning.goal.bandwidth_limit
    low, high = way["slowest_twentieth_interval_s"]
    assert low <= way["slowest_twentieth_s"]
    assert high is None  # of few machines
    assert document["as_is"]["slowest_twentieth_s"] is None
    assert (TuneAnswer(tuning).failure, TuneAnswer(replace(tuning, outcomes=())).failure != "") == ("", True)
    assert TuneAnswer(tuning).next_steps([Path("tuned.toml")]) == ["friso export tuned.toml"]


def test_the_answer_s_stage_is_a_file_with_the_drive_as_built(tuning: Advice, works: Any, undrawn: None) -> None:
    files = TuneAnswer(replace(tuning, as_built={"drive": {"sample_time": "50 us"}})).files()
    assert files["tuned.toml"] == files["tuned-bandwidth.toml"]
    flat = loads(str(files["tuned.toml"])).flat()
    assert flat.items() > works.stage.flat().items()
    assert flat["drive.sample_time"] == 5e-5


def unmade(tuning: Advice, points: TriedPoints, **parts: Any) -> Advice:
    """Return an advice of which one remedy was tried in vain."""
    outcome = verified.RemedyOutcome(Remedy("gains", tuning.stage, ()), None, None, None, (), points, **parts)
    return replace(tuning, outcomes=(outcome,))


def missing(tuning: Advice, **failing: Any) -> Advice:
    """Return an advice on a stage without a limit cycle, of whose machines some fail a part of the goal."""
    quiet = check_given(tuning.stage.replace({"controller.crossover": "12 Hz"}))
    return replace(
        tuning, case=quiet, goal=FORCE_LIMITED, present=made_up(50, **failing)[1], unmet=(*failing, "together")
    )


LATE = {name: [1.0, np.inf] for name in ("settling", "looser", "slower")}
TOLD: dict[str, Callable[[Advice], Advice]] = {
    "interrupted": lambda tuning: tuning,
    "behind a drive": lambda tuning: replace(tuning, interrupted=False, as_built={"drive": {"delay": "50 us"}}),
    "too late or of little margin": lambda tuning: unmade(
        tuning, points_of([0.0] * 2, **LATE, margin=[0.4, 0.6], nearness=[1.0, 0.0])
    ),
    "attracted": lambda tuning: unmade(tuning, points_of([0.0] * 2), attracted=24),
    "given up": lambda tuning: unmade(tuning, points_of([0.0] * 2), cut=True),
    "without margin": lambda tuning: unmade(tuning, points_of([0.0] * 2, margin=np.zeros(2))),
    "parts that are missed": lambda tuning: missing(tuning, settling=range(6), margin=range(5), force=range(10, 20)),
    "machines that may hunt": lambda tuning: missing(tuning, settling=range(10), hunting=range(5, 20)),
}


@pytest.mark.cases(first=6)
@pytest.mark.parametrize("case", TOLD)
def test_words(case: str, tuning: Advice, snapshots: Snapshots) -> None:
    """A case after the first keeps what the first does not say."""
    said, first = (
        TuneAnswer(advice).sentences() + TuneAnswer(advice).details() for advice in (TOLD[case](tuning), tuning)
    )
    snapshots.check("tune", case, "\n".join(line for line in said if case == "interrupted" or line not in first))


@pytest.mark.slow
def test_what_decides_is_drawn(tuning: Advice, works: Any) -> None:
    moves = works.measured.moves
    later = replace(works.measured, moves=replace(moves, settling=moves.settling + 1))
    bought = replace(works.outcome, remedy=replace(works.outcome.remedy, name="isolator", buys_joint=True))
    outcomes = (works.outcome, replace(bought, measured=later))
    ((response, settling, loops),) = (
        figure.panels
        for figure in TuneAnswer(replace(tuning, outcomes=outcomes, goal=replace(tuning.goal, margin=0.6))).figures()
    )
    for panel in (response, settling, loops):
        assert [series.label for series in panel.series][:3] == ["as it is", works.outcome.remedy.name, "isolator"]
    assert loops.series[-1].y[0] == pytest.approx(1 / 0.6)
    assert response.x.limits == (0.0, pytest.approx(3 * later.slowest(tuning.goal)))


def test_a_way_that_the_app_takes_over_keeps_the_machine_as_built(
    tuning: Advice, monkeypatch: pytest.MonkeyPatch
) -> None:
    advice = replace(tuning, as_built={"drive": {"sample_time": "1 ms", "delay": "3 ms"}})
    monkeypatch.setattr(questions.KEPT, "answer", lambda *question: TuneAnswer(advice))
    monkeypatch.setattr(questions, "_lines", lambda *question: {})
    asked: Any = SimpleNamespace(chosen=lambda *names: {}, machine=None)
    (part,) = questions.tune(asked, cast("Any", None))
    for way, outcome in zip(part["ways"], advice.working, strict=True):
        assert outcome.stage is not None
        assert loads(way["toml"]) == advice.complete(outcome.stage)
        assert "3 ms" in way["toml"]


@pytest.mark.parametrize(("place", "says"), [("motor", "188 µm"), ("load", "")])
def test_what_an_encoder_at_the_motor_does_not_see_is_said(place: str, says: str) -> None:
    """The load's friction, 3 N, winds a transmission of 16 kN/m; the motor's own friction does not."""
    law = {"model": "lugre", "static": 3.0, "coulomb": 2.0, "stribeck_velocity": 1e-3, "stribeck_exponent": 2.0}
    law |= {"bristle_stiffness": 1e5, "bristle_damping": 100.0, "viscous": 1.0}
    flat = {f"{table}.{key}": value for table in ("friction", "motor_friction") for key, value in law.items()}
    text = unseen({**flat, "transmission.stiffness": 1.6e4, "encoder.position": place})
    assert says in text
    assert bool(text) == bool(says)
