"""Meetings of two curves of the edge of hunting in the plane of two keys, on invented curves."""

from typing import Any

import numpy as np
import pytest
from variants import VARIANTS

from friso.hunting import CLOSED, END_OF_RANGE, Curve, Cycles, KeyRange, LocatedPoint, Point, Space, Spot
from friso.hunting.boundary.curve import CurveTracer
from friso.hunting.boundary.meetings import find_meetings

pytestmark = pytest.mark.inner

RANGES = KeyRange("controller.crossover", 8.0, 10.0), KeyRange("masses.cart", 1.0, 2.0)
SPACE = Space.of(VARIANTS["rigid"], RANGES)


def spot(at: Any, amplitude: float, period: float) -> Spot:
    """A point of a curve whose cycle has an amplitude [mm] and a period [s]."""
    one = np.ones(1)
    cycle = Cycles(
        **{"sign": -1.0, "swings": 1, "closed": one > 0, "reasons": one.astype(object), "states": np.zeros((1, 2))},
        **{"period": period * one, "amplitude": amplitude * one, "middle": 0 * one, "gap": 0 * one},
        **{"local": np.zeros((1, 1), complex), "direction": np.zeros((1, 2)), "slope": one, "multiplier": one},
    )
    across = np.array([1.0, 0.0])
    return Spot(np.array(at, float), LocatedPoint("flip", Point(0.0, 0.0, 0.0, cycle), across, 1e-8), across)


def curve(points: Any, amplitude: float = 1.0, period: float = 2.0, ends: Any = (END_OF_RANGE, END_OF_RANGE)) -> Curve:
    return Curve("flip", -1.0, tuple(spot(at, amplitude, period) for at in points), ends)


LEVEL = curve([(x, 0.5) for x in np.linspace(0, 1, 11)])
STEEP = [(0.52, y) for y in np.linspace(0.03, 0.97, 9)]
LOST = (END_OF_RANGE, "it could not be followed farther")


def bent(monkeypatch: pytest.MonkeyPatch) -> None:
    """Points are corrected onto what curves follow between their points: one is level, the other bent."""

    def on_line(tracer: CurveTracer, origin: np.ndarray, across: np.ndarray, near: Spot, reach: float) -> Spot:
        level = near.special.point.cycle.amplitude[0] == 1.0
        at = (origin[0], 0.5) if level else (0.52 + 0.3 * (origin[1] - 0.45) * (origin[1] - 0.55), origin[1])
        return spot(at, near.special.point.cycle.amplitude[0], near.special.point.cycle.period[0])

    monkeypatch.setattr(CurveTracer, "on_line", on_line)


@pytest.mark.parametrize(("amplitude", "period", "same"), [(1.01, 2.0, True), (1.01, 4.0, True), (1.3, 2.0, False)])
def test_a_crossing_is_refined_by_cycles(
    monkeypatch: pytest.MonkeyPatch, amplitude: float, period: float, same: bool
) -> None:
    """A crossing is also refined if one cycle has twice the other's period, as at a period doubling."""
    bent(monkeypatch)
    (meeting,) = find_meetings(SPACE, [LEVEL, curve(STEEP, amplitude, period)], 1e-9)
    assert (meeting.curves, meeting.kind, meeting.same_cycle) == ((0, 1), "cross", same)
    assert meeting.places == pytest.approx(np.array([[0.52 - 0.3 * 0.0025, 0.5]]), abs=1e-7)
    assert (meeting.error < 1e-5).all()


def test_a_crossing_at_which_a_cycle_is_lost_is_where_straight_lines_cross(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(CurveTracer, "on_line", lambda *arguments: None)
    (meeting,) = find_meetings(SPACE, [LEVEL, curve(STEEP)], 1e-9)
    assert meeting.places == pytest.approx(np.array([[0.52, 0.5]]))
    assert np.isinf(meeting.error).all()


def test_no_crossing_is_refined_where_a_limiter_chatters(monkeypatch: pytest.MonkeyPatch) -> None:
    bent(monkeypatch)
    chattering = Space.of(VARIANTS["free"], RANGES)
    (meeting,) = find_meetings(chattering, [LEVEL, curve(STEEP)], 1e-9)
    assert np.isinf(meeting.error).all()


def test_a_curve_that_was_followed_twice_is_told_as_one() -> None:
    again = curve([(x, 0.501) for x in (0.2, 0.3, 0.4, 0.5)])
    (meeting,) = find_meetings(SPACE, [LEVEL, again], 1e-9)
    assert meeting.kind == "together"
    assert meeting.places == pytest.approx(np.array([[0.2, 0.501], [0.5, 0.501]]))


@pytest.mark.parametrize(("amplitude", "stop", "meets"), [(1.0, 0.485, True), (2.0, 0.485, False), (1.0, 0.4, False)])
def test_a_curve_may_end_on_another(amplitude: float, stop: float, meets: bool) -> None:
    """If both have one cycle there, and it is near."""
    lost = curve([(0.52, 0.0), (0.52, 0.2), (0.52, stop)], amplitude, ends=LOST)
    meetings = find_meetings(SPACE, [LEVEL, lost], 1e-9)
    assert [(meeting.curves, meeting.kind) for meeting in meetings] == [((1, 0), "end")] * meets


def test_a_curve_that_ends_on_another_with_short_steps_does_not_run_together_with_it() -> None:
    """Whichever of them comes first; and so does one that ends there at both ends."""
    halved = [(0.52, y) for y in (0.4, 0.45, 0.49, 0.497, 0.4985, 0.4995)]
    ending = curve(halved, ends=LOST)
    for curves, number in (([LEVEL, ending], 1), ([ending, LEVEL], 0)):
        (meeting,) = find_meetings(SPACE, curves, 1e-9)
        assert (meeting.curves, meeting.kind) == ((number, 1 - number), "end")
    bow = curve([(0.3, 0.499), (0.3, 0.4), (0.6, 0.4), (0.6, 0.499)], ends=(LOST[1], LOST[1]))
    assert [meeting.kind for meeting in find_meetings(SPACE, [LEVEL, bow], 1e-9)] == ["end", "end"]


def test_two_stretches_are_two_and_leave_crossings_between_them(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(CurveTracer, "on_line", lambda *arguments: None)
    other = [(0.0, 0.5), (0.1, 0.5), (0.2, 0.7), (0.4, 0.7), (0.6, 0.3), (0.8, 0.3), (0.9, 0.5), (1.0, 0.5)]
    meetings = find_meetings(SPACE, [LEVEL, curve(other)], 1e-9)
    assert [meeting.kind for meeting in meetings] == ["together", "together", "cross"]
    assert meetings[2].places == pytest.approx(np.array([[0.5, 0.5]]))


def test_a_curve_through_the_gap_of_a_ring_meets_it_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    """A ring is closed by a leg from its last point to its first one."""
    monkeypatch.setattr(CurveTracer, "on_line", lambda *arguments: None)
    ring = curve([(0.2, 0.52), (0.2, 0.8), (0.8, 0.8), (0.8, 0.2), (0.2, 0.2), (0.2, 0.48)], ends=(CLOSED, CLOSED))
    places = sorted(meeting.places[0, 0] for meeting in find_meetings(SPACE, [LEVEL, ring], 1e-9))
    assert places == pytest.approx([0.2, 0.8])


def test_a_curve_may_cross_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    """A ring meets itself at its start, which is no crossing."""
    monkeypatch.setattr(CurveTracer, "on_line", lambda *arguments: None)
    loop = curve([(0.1, 0.5), (0.6, 0.5), (0.6, 0.8), (0.4, 0.8), (0.4, 0.2)])
    (meeting,) = find_meetings(SPACE, [loop], 1e-9)
    assert (meeting.curves, meeting.kind) == ((0, 0), "cross")
    assert meeting.places == pytest.approx(np.array([[0.4, 0.5]]))
    ring = curve([(0.2, 0.2), (0.8, 0.2), (0.8, 0.8), (0.2, 0.8), (0.2, 0.19)], ends=(CLOSED, CLOSED))
    assert find_meetings(SPACE, [ring], 1e-9) == ()
