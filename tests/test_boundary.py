"""The boundary of hunting: branches of cycles in one key, curves in two, and multipliers on a grid."""

from typing import Any

import numpy as np
import pytest
from book import BOOK
from variants import VARIANTS

import friso
from friso.hunting import (
    Diagram,
    KeyRange,
    LocatedPoint,
    Plane,
    Space,
    diagram,
    find_cycles,
    find_swings,
    plane,
)
from friso.hunting.continuation.locate import turn
from friso.stage import Stage
from friso.studies.boundary import stability_changes

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
def test_the_branch_is_what_is_found_at_single_stages(over_crossover: Diagram) -> None:
    (symmetric,) = (branch for branch in over_crossover.branches if branch.sign < 0)
    part = [point for point in symmetric.points if 0 < point.place < 0.35][::6]
    stages = over_crossover.space.stages(np.array([[point.place] for point in part]))
    alone = find_cycles(stages)
    assert alone.closed.all()
    assert alone.amplitude == pytest.approx([point.cycle.amplitude[0] for point in part], rel=1e-6)
    assert alone.multiplier == pytest.approx([point.multiplier for point in part], rel=1e-3)


@pytest.fixture(scope="module")
def over_friction() -> Plane:
    axes = [KeyRange("friction.static", 1.2, 6.0, unit="N"), KeyRange("friction.coulomb", 0.3, 1.15, unit="N")]
    return plane(Space.of(AT_8_HZ, axes), nodes=5)


def beside(plane: Plane, share: float) -> tuple[np.ndarray, np.ndarray]:
    """Places on either side of the edge, inside and outside, by a share of the way between neighbours of the grid."""
    hunts = np.zeros(plane.nodes**2, bool)
    hunts[plane.allowed] = plane.attracts
    hunts, nodes = hunts.reshape(plane.nodes, -1), plane.space.grid(plane.nodes).reshape(plane.nodes, -1, 2)
    inside, outside = [], []
    for i, j in np.argwhere(plane.kinds != ""):
        one, other = (i // 2, j // 2), (-(-i // 2), -(-j // 2))
        inner, outer = (one, other) if hunts[one] else (other, one)
        way = share * (nodes[outer] - nodes[inner])
        inside.append(plane.near[i, j] - way)
        outside.append(plane.far[i, j] + way)
    return np.array(inside), np.array(outside)


@pytest.mark.slow
def test_a_thorough_search_agrees_on_both_sides_of_the_edge(over_friction: Plane) -> None:
    assert "flip" in over_friction.curves[0].kinds
    for hunts, places in zip((True, False), beside(over_friction, 0.1), strict=True):
        for place in places[:: len(places) // 6]:
            assert bool(find_swings(over_friction.space.stages(place[None]).flat)) == hunts


@pytest.mark.slow
def test_curves_in_two_keys_pass_through_the_points_in_one(over_friction: Plane) -> None:
    """At 1 N of Coulomb friction, hunting begins and ends over static friction on the curves, within the grid."""
    static = KeyRange("friction.static", 1.2, 6.0, unit="N")
    single = diagram(Space.of(AT_8_HZ.replace({"friction.coulomb": "1 N"}), [static]))
    crossings = [value for curve in over_friction.curves for value in at_1_n(over_friction, curve)]
    for change in stability_changes(single):
        assert min(abs(np.array(crossings) - change.low)) < 0.05


def at_1_n(plane: Plane, curve: Any) -> list[float]:
    """Static friction [N] where a curve crosses a Coulomb friction of 1 N."""
    values = plane.space.values(curve.points)
    static, coulomb = values["friction.static"], values["friction.coulomb"] - 1.0
    at = np.flatnonzero(coulomb[:-1] * coulomb[1:] <= 0)
    return [float(static[i] - coulomb[i] * (static[i + 1] - static[i]) / (coulomb[i + 1] - coulomb[i])) for i in at]


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


@pytest.mark.slow
def test_where_hunting_ends_beyond_a_curve_it_is_searched_on() -> None:
    """Beyond the flip that is drawn, an asymmetric cycle attracts on: a thorough search agrees on both sides."""
    space = Space.of(
        BOOK["creeping"], [KeyRange("controller.crossover", 11.9, 13.5), KeyRange("friction.static", 28.6, 29.2)]
    )
    for hunts, places in zip((True, False), beside(plane(space, nodes=3), 0.02), strict=True):
        for place in places:
            assert bool(find_swings(space.stages(place[None]).flat)) == hunts


@pytest.mark.slow
def test_a_symmetric_orbit_ends_where_the_stage_is_not_symmetric() -> None:
    """An orbit over half a period does not exist beyond, though Newton's method closes one."""
    space = Space.of(RIGID, [KeyRange("controller.crossover", 8.5, 9.0), KeyRange("friction.asymmetry", 0.0, 0.04)])
    result = plane(space, nodes=3)
    assert result.attracts.tolist() == [True, False, False] * 3
    for place in beside(result, 0.05)[1]:
        assert not find_swings(space.stages(place[None]).flat)


@pytest.mark.slow
def test_a_range_over_four_decades_is_searched(rig: Stage) -> None:
    """Keys are compared with their values in the middle of a line, not with a ten-thousandth of them."""
    axes = [KeyRange("joint.stroke", 1e-7, 1e-3, unit="m"), KeyRange("controller.crossover", 5.0, 9.0, unit="Hz")]
    result = plane(Space.of(rig.replace({"joint.locked": False}), axes), nodes=3)
    assert result.attracts.reshape(3, 3)[0].all()
    assert {"flip"} <= {*result.curves[0].kinds}
