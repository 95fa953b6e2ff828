"""The boundary of hunting: branches of cycles in one key, curves in two, and multipliers on a grid."""

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from beyond_flip import CREEPING
from refusals import refused
from variants import VARIANTS

import friso
from friso.hunting import Diagram, Ensemble, KeyRange, LocatedPoint, Plane, Point, Space, diagram, plane
from friso.hunting.attractors import attractors
from friso.hunting.boundary.diagram import each_once
from friso.hunting.continuation.branch import REACHED, Tracer, continued
from friso.hunting.continuation.crossing import crossing, turn
from friso.hunting.continuation.locate import changes, met
from friso.hunting.cycle.find import symmetric_cycles
from friso.stage import Stage
from friso.studies.boundary import stability_changes

pytestmark = pytest.mark.xdist_group("rigid")

RIGID = VARIANTS["rigid"]
AT_8_HZ = RIGID.replace({"controller.crossover": "8 Hz"})
CROSSOVER = KeyRange("controller.crossover", 1.0, 40.0, unit="Hz")


@pytest.fixture(scope="module")
def over_crossover() -> Diagram:
    """Return the diagram of one rigid mass of 1.7 kg with the friction of Table 2, as in references.md."""
    return diagram(Space.of(RIGID, [CROSSOVER]))


def special(diagram: Diagram, symmetric: bool) -> dict[str, list[tuple[float, LocatedPoint]]]:
    """The special points of the symmetric or of the asymmetric branches by kind, with their values."""
    points: dict[str, list[tuple[float, LocatedPoint]]] = {"flip": [], "fold": [], "torus": []}
    for branch, own in zip(diagram.branches, diagram.special, strict=True):
        if (branch.sign < 0) == symmetric:
            for item in own:
                points[item.kind].append((diagram.value(item.point.place), item))
    return points


def test_one_rigid_mass_flips_at_9_77_hz_and_folds_at_16_2_hz(over_crossover: Diagram) -> None:
    """references.md: it stops attracting near 9.77 Hz; the issue: the unstable cycle lives on to a fold at 16.2 Hz."""
    points = special(over_crossover, symmetric=True)
    first = min(points["flip"], key=lambda item: item[0])
    assert first[0] == pytest.approx(9.77, abs=0.005)
    assert first[1].point.multiplier == pytest.approx(-1, abs=1e-6)
    (fold,) = points["fold"]
    assert fold[0] == pytest.approx(16.22, abs=0.05)
    assert fold[1].point.multiplier == pytest.approx(1, abs=1e-3)


@pytest.mark.thorough
@pytest.mark.inner
def test_what_overlapping_branches_meet_is_listed_once(over_crossover: Diagram) -> None:
    """The error of a merged point is the difference; points at another place, or of another cycle, stay separate."""
    (_, fold), *_ = special(over_crossover, symmetric=True)["fold"]

    def moved(place: float, time: float = 0.0) -> LocatedPoint:
        return replace(fold, point=replace(fold.point, place=fold.point.place + place, time=fold.point.time + time))

    hundredth = over_crossover.space.hundredth(np.zeros(1), np.ones(1))
    ((kept,), *others) = each_once([[fold], [moved(2e-4)], [moved(0.01)], [moved(0.0, 0.05)]], hundredth)
    assert [len(own) for own in others] == [0, 1, 1]
    assert kept.point == fold.point
    assert kept.error == pytest.approx(2e-4 + fold.error)
    assert each_once([[fold, moved(2e-4)]], hundredth) == ((fold, moved(2e-4)),)  # round a cusp
    rough = replace(fold, error=3e-4)
    assert [len(own) for own in each_once([[rough, moved(2e-4), moved(4e-4)]], hundredth)] == [2]


@pytest.mark.parametrize(
    ("swept", "value", "percent"),
    [
        (KeyRange("k", 2.0, 40.0), 5.0, 0.05),
        (KeyRange("k", 5.5, 5.7), 5.6, 0.056),
        (KeyRange("k", 5.7, 5.5), 5.6, 0.056),
        (KeyRange("k", 1.0, 100.0, log=True), 10.0, 0.1),
        (KeyRange("k", -3.0, 2.0), 0.0, 0.03),
    ],
)
def test_a_hundredth_of_a_key_does_not_depend_on_the_range(swept: KeyRange, value: float, percent: float) -> None:
    """The step differs only if the range contains 0; on a line at an angle to the key the step is longer."""
    space = Space.of(RIGID, [swept, KeyRange("n", 1.0, 1000.0)])
    place = float(swept.place(np.array(value)))
    assert swept.at(np.array(place + swept.hundredth(place))) - value == pytest.approx(
        percent * np.sign(swept.high - swept.low), rel=0.01
    )
    slanted = space.hundredth(np.array([0.0, 1.0]), np.array([0.5, 0.0]))
    assert slanted(2 * place) == pytest.approx(2 * swept.hundredth(place))


@pytest.mark.inner
def test_orbits_closed_at_once_are_those_closed_one_by_one() -> None:
    """The limiter of the thesis's rig chatters, so that multipliers scatter; places and periods do not."""
    free = VARIANTS["free"].replace({"joint.stroke": "0.2 mm"})
    space = Space.of(free, [KeyRange("controller.crossover", 5.0, 7.0, unit="Hz")])
    tracer = Tracer(space.lines(np.zeros((1, 1)), np.ones((1, 1))), -1.0)
    stages = space.stages(np.zeros((1, 1)))
    assert stages.chatters
    start = Point.of(stages, 0.0, symmetric_cycles(stages))
    along = np.array([1.0, 0.0, 0.0])
    targets = start.vector + np.linspace(0.0, 0.01, 4)[:, None] * along
    several = tracer.solve_all(start, targets, along)
    singly = [tracer.solve(start, target, along) for target in targets]
    assert len(several) == 4
    for one, other, target in zip(several, singly, targets, strict=True):
        assert other is not None
        assert one.place == other.place == pytest.approx(target[0])
        assert one.vector == pytest.approx(other.vector, abs=1e-4)
        assert one.multiplier == pytest.approx(other.multiplier, abs=0.02)


@pytest.mark.slow
@pytest.mark.inner
def test_a_crossing_of_values_that_scatter_is_told_with_an_honest_reserve() -> None:
    """Straight lines through scattered values: the reserve usually holds the true place.

    A place that is not known within half of the range is not returned. Of three crossings the last is returned, with an
    error as large as their distance.
    """
    draws, places = np.random.default_rng(0), np.linspace(-0.01, 0.01, 8)
    for scatter in (4e-4, 2e-3, 4e-3):
        true = draws.uniform(-2e-3, 2e-3, 300)
        values = (0.4 * (places - at) + scatter * draws.standard_normal(8) for at in true)
        sought = [(crossing(places, value), at) for value, at in zip(values, true, strict=True)]
        reached = [(met, at) for met, at in sought if met]
        assert all(0 < met.reserve <= 0.01 for met, _ in reached)
        assert scatter > 4e-4 or len(reached) > 290
        assert np.mean([abs(met.place - at) <= met.reserve for met, at in reached]) > 0.9
    assert crossing(places, places + 2.0) is None
    assert crossing(places[:5], places[:5]) is None
    thrice = crossing(places, places * (places - 0.004) * (places + 0.004))
    assert thrice is not None
    assert (thrice.place, thrice.reserve) == (pytest.approx(0.004), pytest.approx(0.008))


@pytest.mark.inner
def test_a_branch_whose_places_scatter_turns_within_its_reserve() -> None:
    """Parabolas through places that scatter: the reserve mostly holds the true one; a line does not turn."""
    draws, lengths = np.random.default_rng(1), np.linspace(-0.03, 0.03, 8)
    turns = draws.uniform(-0.01, 0.01, 300)
    branches = [at - (lengths - at) ** 2 + 2e-5 * draws.standard_normal(8) for at in turns]
    sought = [(turn(lengths, places), at) for places, at in zip(branches, turns, strict=True)]
    reached = [(back, at) for back, at in sought if back]
    assert len(reached) > 290
    assert np.mean([abs(back.place - at) <= back.reserve for back, at in reached]) > 0.9
    assert turn(lengths, lengths) is None


@pytest.mark.thorough
def test_what_is_simulated_within_the_error_of_a_flip_tells_nothing_of_it(over_crossover: Diagram) -> None:
    """Near a flip, cycles are so weakly unstable that runs may stay on them.

    Hunting ends at the flip, whatever the simulated verdicts are.
    """
    (first,) = [change for change in stability_changes(over_crossover) if not change.begins]
    (flip,) = [
        spot
        for own in over_crossover.special
        for spot in own
        if over_crossover.value(spot.point.place) == pytest.approx(first.low, rel=1e-9)
    ]
    wide = replace(flip, error=3.1 / (len(over_crossover.places) - 1))
    near = np.flatnonzero(np.abs(over_crossover.places - flip.point.place) < wide.error)
    attracts = over_crossover.attracts.copy()
    attracts[near] = np.arange(near.size) % 2 == 1
    special = tuple(tuple(wide if spot is flip else spot for spot in own) for own in over_crossover.special)
    doubtful = replace(over_crossover, special=special, attracts=attracts)
    assert [change for change in stability_changes(doubtful) if not change.begins] == [first]


@pytest.mark.thorough
def test_a_window_within_the_error_of_a_special_point_is_told(over_crossover: Diagram) -> None:
    places = over_crossover.places
    attracts = np.abs(places - 0.8) < 0.05
    spot = replace(over_crossover.special[0][0], error=0.15)
    wide = replace(spot, point=replace(spot.point, place=0.8))
    branch = replace(over_crossover.branches[0], points=over_crossover.branches[0].points[-2:])
    verdicts = {"attracts": attracts, "decided": np.ones(len(places), bool)}
    window = replace(over_crossover, branches=(branch,), special=((wide,),), **verdicts)
    assert [change.begins for change in stability_changes(window)] == [True, False]


@pytest.mark.thorough
def test_an_asymmetric_pair_bounds_the_basin_from_8_47_hz(over_crossover: Diagram) -> None:
    """Subcritical: the pair ends in the flip of the symmetric cycle, and folds at 8.47 Hz."""
    points = special(over_crossover, symmetric=False)
    (fold,) = points["fold"]
    assert fold[0] == pytest.approx(8.47, abs=0.005)
    (pair,) = (branch for branch in over_crossover.branches if branch.sign > 0)
    places = [over_crossover.value(point.place) for point in pair.points]
    assert any("symmetric" in end for end in pair.ends)
    assert max(places) == pytest.approx(9.77, abs=0.02)


@pytest.mark.thorough
def test_errors_are_honest(over_crossover: Diagram) -> None:
    """A diagram at a hundredth of the tolerance has its points within a few of the stated errors."""
    tight = diagram(Space.of(RIGID, [CROSSOVER]), rtol=1e-11)
    for symmetric in (True, False):
        for kind, points in special(over_crossover, symmetric).items():
            other = [value for value, _ in special(tight, symmetric)[kind]]
            for value, result in points:
                nearest = min(other, key=lambda item: abs(item - value))
                assert abs(nearest - value) < 3 * over_crossover.error(result) + 1e-6
                assert over_crossover.error(result) < 1e-4


@pytest.mark.thorough
@pytest.mark.inner
def test_the_branch_is_what_is_found_at_single_stages(over_crossover: Diagram) -> None:
    (symmetric,) = (branch for branch in over_crossover.branches if branch.sign < 0)
    part = [point for point in symmetric.points if 0 < point.place < 0.35][::6]
    stages = over_crossover.space.stages(np.array([[point.place] for point in part]))
    alone = symmetric_cycles(stages)
    assert alone.closed.all()
    assert alone.amplitude == pytest.approx([point.cycle.amplitude[0] for point in part], rel=1e-6)
    assert alone.multiplier == pytest.approx([point.multiplier for point in part], rel=1e-3)


@pytest.mark.inner
@pytest.mark.thorough
def test_a_branch_does_not_depend_on_where_it_is_begun(over_crossover: Diagram) -> None:
    """The fold is reached from 4 Hz as from 15 Hz."""
    space = over_crossover.space
    folds = []
    for crossover in (4.0, 15.0):
        place = float(CROSSOVER.place(np.array(crossover)))
        stages = space.stages(np.array([[place]]))
        tracer = Tracer(space.lines(np.zeros((1, 1)), np.ones((1, 1))), -1.0)
        branch = tracer.branch(Point.of(stages, place, symmetric_cycles(stages)))
        folds.append(max(point.place for point in branch.points))
    assert over_crossover.value(folds[0]) == pytest.approx(over_crossover.value(folds[1]), abs=1e-3)


@pytest.mark.thorough
@pytest.mark.inner
@pytest.mark.parametrize("poison", [np.nan, 0.0, 1.0, 1e6])
def test_a_wrong_jacobian_does_not_end_a_walk(over_crossover: Diagram, poison: float) -> None:
    """The walk runs from 9.6 Hz to the flip, with a Jacobian that is missing, singular, or wrong."""
    space = over_crossover.space
    place = float(CROSSOVER.place(np.array(9.6)))
    stages = space.stages(np.array([[place]]))
    cycle = symmetric_cycles(stages)
    size = cycle.states.shape[1] + 2
    tracer = Tracer(space.lines(np.zeros((1, 1)), np.ones((1, 1))), -1.0)
    wrong = poison * np.random.default_rng(0).normal(size=(1, size, size))
    start = Point.of(stages, place, cycle, wrong)
    points, reason = tracer.walk(start, 1.0, lambda last, point: "flip" in changes(last, point))
    assert reason == REACHED
    assert over_crossover.value(points[-1].place) == pytest.approx(9.78, abs=0.2)


@pytest.mark.thorough
@pytest.mark.inner
def test_a_branch_that_turns_back_does_not_reach_the_farthest_place(over_crossover: Diagram) -> None:
    """The pair from 9.5 Hz on: it meets the symmetric cycle at 9.77 Hz, and goes on as its own mirror image."""
    space = over_crossover.space
    (pair,) = (branch for branch in over_crossover.branches if branch.sign > 0)
    near = min(pair.points, key=lambda point: abs(over_crossover.value(point.place) - 9.6))
    tracer = Tracer(space.lines(np.full((1, 1), near.place), np.ones((1, 1))), 1.0, farthest=0.02)
    start = Point.of(space.stages(np.array([[near.place]])), 0.0, near.cycle)
    points, reason = tracer.walk(start, 1.0, lambda last, point: False)
    assert not tracer.reaches(points, reason)
    points, reason = tracer.walk(start, 1.0)
    assert "symmetric" in reason


@pytest.mark.thorough
@pytest.mark.inner
def test_a_flip_is_met_from_beside_it(over_crossover: Diagram) -> None:
    """Begun 0.2 % beside it, without the Jacobian of a point nearby."""
    space = over_crossover.space
    value, flip = min(special(over_crossover, symmetric=True)["flip"], key=lambda item: item[0])
    place = float(CROSSOVER.place(np.array(0.998 * value)))
    stages = space.stages(np.array([[place]]))
    tracer = Tracer(space.lines(np.zeros((1, 1)), np.ones((1, 1))), -1.0)
    near = Point.of(stages, place, symmetric_cycles(stages))
    along = np.array([1.0, 0.0, 0.0])
    beside = replace(flip, point=near)
    reached = met(tracer, beside, near.vector, along, 0.02, near.cycle.states)
    assert reached is not None
    assert reached.point.place == pytest.approx(flip.point.place, abs=1e-6)


@pytest.fixture(scope="module")
def over_friction() -> Plane:
    axes = [KeyRange("friction.static", 1.0, 6.0, unit="N"), KeyRange("friction.coulomb", 0.3, 2.5, unit="N")]
    return plane(Space.of(AT_8_HZ, axes), nodes=5)


@pytest.mark.slow
@pytest.mark.inner
def test_every_curve_lies_where_the_multiplier_says(over_friction: Plane) -> None:
    """Flips of the symmetric cycle: 0.2 % to either side of the curve the cycle attracts on one and repels on the
    other, by cycles that are found from scratch (1 % off, near the end of the curve, there is another cycle)."""
    flips = [curve for curve in over_friction.curves if curve.kind == "flip" and curve.sign < 0]
    assert flips
    for curve in flips:
        for spot in curve.spots[2:-2:5]:
            sides = np.clip(np.stack([spot.at - 0.002 * spot.across, spot.at + 0.002 * spot.across]), 0, 1)
            cycles = symmetric_cycles(over_friction.space.stages(sides))
            if cycles.closed.all():
                assert sorted(np.abs(cycles.multiplier) < 1) == [False, True]


@pytest.mark.slow
def test_curves_in_two_keys_pass_through_the_points_in_one(over_friction: Plane) -> None:
    """At 1 N of Coulomb friction, folds and flips over static friction lie on the curves."""
    static = KeyRange("friction.static", 1.0, 6.0, unit="N")
    single = diagram(Space.of(AT_8_HZ.replace({"friction.coulomb": "1 N"}), [static]))
    for kind, points in special(single, symmetric=True).items():
        crossings = [
            value
            for curve in over_friction.curves
            if (curve.kind, curve.sign) == (kind, -1.0)
            for value in at_1_n(over_friction, curve)
        ]
        for value, _ in points:
            assert min(abs(np.array(crossings) - value)) < 0.01


def at_1_n(plane: Plane, curve: Any) -> list[float]:
    """Static friction [N] where a curve crosses a Coulomb friction of 1 N."""
    values = plane.space.values(curve.points)
    static, coulomb = values["friction.static"], values["friction.coulomb"] - 1.0
    at = np.flatnonzero(coulomb[:-1] * coulomb[1:] <= 0)
    return [float(static[i] - coulomb[i] * (static[i + 1] - static[i]) / (coulomb[i + 1] - coulomb[i])) for i in at]


@pytest.mark.slow
@pytest.mark.inner
def test_multipliers_on_a_grid_and_the_curve_agree_within_a_cell(over_friction: Plane) -> None:
    """The multipliers of the symmetric cycle say whether it attracts."""
    static, coulomb = np.meshgrid(np.linspace(1.0, 6.0, 21), np.linspace(0.3, 2.5, 21), indexing="ij")
    falls = static > coulomb
    flat = {**AT_8_HZ.flat(), "friction.static": static[falls], "friction.coulomb": coulomb[falls]}
    size = np.full(static.shape, np.nan)
    size[falls] = np.abs(symmetric_cycles(Ensemble.held(flat, int(falls.sum()))).multiplier)
    edges = np.argwhere((size[:-1] < 1) & (size[1:] > 1) & np.isfinite(size[:-1]) & np.isfinite(size[1:]))
    assert len(edges) > 5
    flips = [curve for curve in over_friction.curves if curve.kind == "flip" and curve.sign < 0]
    points = np.concatenate([refined(curve.points) for curve in flips])
    for i, j in edges:
        place = np.array([(i + 0.5) / 20, j / 20])
        assert np.abs(points - place).max(axis=1).min() < 1 / 20


def refined(points: np.ndarray) -> np.ndarray:
    """Twenty points on every leg of a polyline."""
    shares = np.linspace(0, 1, 20)[:, None]
    return np.concatenate([a + shares * (b - a) for a, b in pairwise(points)])


@pytest.mark.slow
def test_an_asymmetric_stage_loses_its_cycle_in_a_fold() -> None:
    """Unequal friction unfolds the pitchfork: the flip of the half period becomes a fold of the whole one."""
    traced = diagram(
        Space.of(RIGID.replace({"friction.asymmetry": 0.005}), [KeyRange("controller.crossover", 8.0, 11.0)]), seeds=5
    )
    assert {branch.sign for branch in traced.branches} == {1.0}
    kinds = {item.kind for own in traced.special for item in own}
    assert "fold" in kinds


def test_a_range_without_a_boundary_has_no_points() -> None:
    traced = diagram(Space.of(RIGID, [KeyRange("controller.crossover", 4.0, 6.0)]), seeds=5)
    assert traced.cycles.attracting.all()
    assert not any(traced.special)


@pytest.mark.slow
def test_cycles_at_the_force_limit_are_followed_to_their_fold() -> None:
    """With back-calculation, it rests at 38 Hz and swings at 40 Hz, released from up to 1 m (test_attractors.py).

    No cycle of the return map attracts there.
    """
    unwound = VARIANTS["rigid, limit, back-calculation"].replace(
        {"controller.force_limit": "12 N", "controller.anti_windup_time": "50 ms"}
    )
    traced = diagram(Space.of(unwound, [KeyRange("controller.crossover", 36.0, 44.0)]), seeds=5)
    assert traced.decided.all()
    assert traced.attracts.tolist() == [False, False, True, True, True]
    assert not traced.cycles.attracting.any()
    (fold,) = special(traced, symmetric=True)["fold"]
    assert fold[0] == pytest.approx(39.599, abs=0.001)
    (change,) = stability_changes(traced)
    assert change.begins
    assert change.low == change.high == pytest.approx(39.599, abs=0.001)


@pytest.mark.thorough
def test_a_logarithmic_range_finds_the_same_flip() -> None:
    traced = friso.boundary(RIGID, {"controller.crossover": "8 Hz..12 Hz:log"})
    (flip,) = special(traced.result, symmetric=True)["flip"]
    assert flip[0] == pytest.approx(9.77, abs=0.005)


NO_INTEGRAL = VARIANTS["rigid cart, P"]


@pytest.mark.parametrize(
    ("stage", "axes"),
    [
        (RIGID, {}),
        (RIGID, {"controller.crossover": "1 Hz..40 Hz:41"}),
        (RIGID, {"controller.crossover": "40 Hz..1 Hz"}),
        (RIGID, {"controller.crosover": "1 Hz..40 Hz"}),
        (NO_INTEGRAL, {"controller.kp": "1 N/m..4 N/m"}),
        (VARIANTS["rigid, no friction section"], {"controller.crossover": "1 Hz..40 Hz"}),
    ],
)
def test_what_has_no_boundary_is_refused(stage: Stage, axes: dict[str, str]) -> None:
    with refused():
        friso.boundary(stage, axes)


@pytest.mark.thorough
@pytest.mark.inner
def test_a_branch_goes_on_along_a_parabola(over_crossover: Diagram) -> None:
    points = max((branch.points for branch in over_crossover.branches), key=len)[2:-2]  # its ends may stand there twice
    off: list[list[float]] = []
    for *before, ahead in zip(points, points[1:], points[2:], points[3:], strict=False):
        last = before[-1]
        step = float(np.linalg.norm(ahead.vector - last.vector))
        direction = last.vector - before[-2].vector
        direction /= np.linalg.norm(direction)
        guesses = [continued(some, step, direction)[0] for some in (before[1:], before)]
        off.append([float(np.linalg.norm(guess - ahead.vector)) for guess in guesses])
    straight, parabola = np.median(off, axis=0)
    assert parabola < straight / 3


@pytest.mark.slow
@pytest.mark.inner
def test_where_hunting_ends_beyond_a_curve_it_is_searched_on() -> None:
    """Beyond the flip that is drawn, an asymmetric cycle attracts on: a thorough search agrees on both sides."""
    space = Space.of(CREEPING, [KeyRange("controller.crossover", 11.9, 13.5), KeyRange("friction.static", 28.6, 29.2)])
    (end,) = plane(space, nodes=3).last_ends
    assert end.certain
    inside, outside = (attractors(space.stages(at[None]), thorough=True) for at in (end.inside, end.outside))
    assert inside.attracts.all()
    assert not outside.attracts.any()
