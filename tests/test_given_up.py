"""Test that results given up or uncertain are not called sure, with made-up surveys and runs."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from made_up import fake_cycle, fake_hunting
from patched import patched
from variants import VARIANTS

from friso.engine.allowance import Exhausted, allowance, current_allowance
from friso.engine.arrays import Status
from friso.hunting import (
    MORE_WORK,
    AttractionEnd,
    BandwidthWindow,
    CheckPart,
    HuntingDoubt,
    Judgement,
    Kick,
    Margin,
    MoveShare,
    Target,
    basin,
    displacements_that_hunt,
    verdict,
)
from friso.hunting.attractors import Attractors
from friso.hunting.basin import KICK_COUNT
from friso.hunting.margin import NOT_SOUGHT, SearchedBandwidths
from friso.hunting.measures import measuring_options
from friso.hunting.verdict import (
    MASS_CHANGES,
    judge,
)
from friso.stage import Stage

STAGE = VARIANTS["rigid"]
TARGET = Target(1e-3, 1.6, 100.0, 25.0)
HUNTING = Kick(((2e-3, 1e-2),), (1e-5, 0.1))
NONE = replace(HUNTING, windows=())


def displaced(hunts: Any, completed: Any, swing: float = 0.0) -> Kick:
    """Return the kick windows, if functions of the kick [m] say which kicks hunt and which runs completed."""

    def ends_in(flat: Any, count: int, *_: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        kicks = flat["motion.displacement"]
        return hunts(kicks) & completed(kicks), completed(kicks), swing * kicks

    with patched({basin: {"ends_in": ends_in}}):
        return displacements_that_hunt(STAGE, TARGET, widest=4e-3)


def beyond(size: float) -> Any:
    return lambda kicks: kicks > size


def test_kicks_whose_runs_were_given_up_make_no_window() -> None:
    """Between 10 and 20 mm no run is completed: there is no edge of hunting. Nor do kicks after which swings are far
    larger than what attracts, which may grow or die out, but takes long without anti-windup."""
    whole = displaced(beyond(2e-3), beyond(0))
    assert whole.unknown == 0
    gap = displaced(beyond(2e-3), lambda kicks: (kicks < 0.01) | (kicks > 0.02))
    assert gap.unknown > 0
    assert gap.windows == whole.windows
    assert len(whole.windows) == 1
    assert 2e-3 < whole.windows[0][0] < 1.01 * 2e-3
    large = displaced(beyond(2e-3), beyond(0), swing=0.5)
    assert large.unknown > 0
    assert large.searched[1] == large.windows[-1][1] < 8e-3
    nothing = displaced(beyond(2e-3), beyond(1))
    assert (nothing.windows, nothing.unknown) == ((), KICK_COUNT)
    assert nothing.searched == pytest.approx((1e-3 / 30, 0.3))


def surveyed(complete: bool) -> Attractors:
    yes, no = np.ones(1, bool), np.zeros(1, bool)
    return Attractors((), yes, np.ones(1), (), no, np.array([complete]), no)


def run_to(settling: float, swing: float = 0.0) -> Any:
    """Return measures of the stage's own motion, as far as a verdict needs them."""
    return SimpleNamespace(
        status=np.array([Status.DONE]),
        peaks=np.zeros(1),
        peak_to_peak=np.array([swing]),
        offset=np.zeros(1),
        in_the_end=(np.array([settling]), np.array([settling])),
    )


def judged(
    settling: float = np.nan,
    ends: bool = False,
    completed: bool = True,
    other: tuple[bool, bool] | None = None,
    swing: float = 0.0,
    complete: bool = True,
    starts: tuple[Kick, Kick, MoveShare | None] = (HUNTING, HUNTING, None),
    sought: Callable[[], SearchedBandwidths] = lambda: NOT_SOUGHT,
    stage: Stage = STAGE,
    certain: bool = True,
) -> Judgement:
    """The verdict on a stage that something attracts, where its own motion ends so, and is completed or not; and with
    the last of the other masses."""
    attraction = replace(fake_hunting(fake_cycle(), certain=certain), surveyed=surveyed(complete))
    runs = np.array([(ends, completed)] * (len(MASS_CHANGES) - 1) + [other or (ends, completed)])
    made_up = {
        "hunting": lambda *_, **__: attraction,
        "ends_in": lambda *_: (*runs.T, np.full(len(runs), swing)),
        "search_bandwidths": lambda *_: sought(),
        "displacements_that_hunt": lambda *_: starts[0],
        "pushes_that_hunt": lambda *_: starts[1],
        "moves_that_hunt": lambda *_: starts[2],
    }
    with patched({verdict: made_up}):
        return judge(stage, run_to(settling), 1e-6)


@pytest.mark.cases(first=5)
@pytest.mark.parametrize(
    ("run", "doubt"),
    [
        ({}, ""),
        ({"complete": False}, HuntingDoubt.MOTION),
        ({"complete": False, "settling": 0.5}, ""),
        ({"swing": 2e-4}, HuntingDoubt.MOTION),
        ({"swing": 1e-5, "settling": 0.5}, HuntingDoubt.MOTION),
        ({"other": (True, True)}, HuntingDoubt.RUNS),
        ({"other": (False, False)}, HuntingDoubt.WORK),
        ({"ends": True, "swing": 1e-3, "complete": False}, ""),
        ({"ends": True, "swing": 1e-2}, HuntingDoubt.MOTION),
    ],
)
def test_a_motion_that_may_end_in_another_swing_does_not_surely_settle(run: dict[str, Any], doubt: str) -> None:
    """What ends in the hunting that was found hunts, whatever else there is."""
    judgement = judged(**run)
    assert judgement.verdict == ("hunts" if "ends" in run else "bistable")
    assert judgement.hunting.certain == (not doubt)
    assert judgement.hunting.reason == doubt


def test_a_longer_run_that_is_not_completed_gives_no_verdict() -> None:
    assert judged(completed=False).verdict == "failed"
    assert MORE_WORK in HuntingDoubt.WORK  # sentences name the commands by these words


@pytest.mark.cases(first=3)
@pytest.mark.parametrize(
    ("certain", "changes", "sure"),
    [
        (True, {}, True),
        (False, {}, False),
        (True, {"controller.force_limit": "14 N", "controller.anti_windup": "clamp"}, True),
        (True, {"controller.force_limit": "14 N", "controller.anti_windup": "none"}, False),
    ],
)
def test_no_edge_is_more_certain_than_the_verdict_or_than_large_motions_are_bounded_there(
    certain: bool, changes: dict[str, Any], sure: bool
) -> None:
    """The viscous friction of this stage is too small to bound them without anti-windup."""
    lower, again = AttractionEnd(0.5, 0.4, True), AttractionEnd(4.0, 3.9, True)
    bandwidths = SearchedBandwidths(Margin(2.0, 16.0, True, 2.1), (BandwidthWindow(again, None),), lower)
    judgement = judged(sought=lambda: bandwidths, stage=STAGE.replace(changes), certain=certain)
    edges = judgement.margin, judgement.lower, judgement.windows[0].low
    assert [edge is not None and edge.certain for edge in edges] == [sure] * 3
    assert judgement.windows[0].high is None


@pytest.mark.cases(first=2)
@pytest.mark.parametrize(
    ("starts", "certain"),
    [
        ((NONE, NONE, None), True),
        ((HUNTING, replace(NONE, unknown=2), None), False),
        ((replace(HUNTING, unknown=2), NONE, None), True),
        ((NONE, NONE, MoveShare(100, 0, {"motion.acceleration": (1.0, 2.0)})), False),
    ],
)
def test_no_kick_or_move_starts_hunting_only_if_all_were_run(starts: Any, certain: bool) -> None:
    assert (CheckPart.STARTS in judged(starts=starts).given_up) == (not certain)


@pytest.mark.parametrize(("to_the_top", "left"), [(False, CheckPart.BANDWIDTHS), (True, CheckPart.LOWER_BANDWIDTHS)])
def test_of_a_stage_that_hunts_at_all_higher_bandwidths_the_lower_ones_alone_are_given_up(
    to_the_top: bool, left: str
) -> None:
    def exhausted() -> SearchedBandwidths:
        allowed = current_allowance()
        with suppress(Exhausted):
            allowed.exhaust()
        return replace(NOT_SOUGHT, to_the_top=to_the_top)

    assert judged(sought=exhausted).given_up == (left,)
    assert judged().given_up == ()


@pytest.mark.parametrize(("budget", "work"), [(100, np.inf), (2_000_000, 1e5)])
def test_a_longer_run_that_is_given_up_tells_nothing_of_settling(budget: int, work: float) -> None:
    """The motion has not settled at its end, and the longer run runs out of steps or of allowed work.

    No attractor is known, but this motion was not seen to come to rest.
    """
    resting = fake_hunting(reason="")
    attraction = replace(resting, surveyed=surveyed(complete=True))
    made_up = {
        "hunting": lambda *_, **__: attraction,
        "search_bandwidths": lambda *_: NOT_SOUGHT,
        "measuring_options": lambda *_, **__: replace(measuring_options(1e-6), budget=budget),
    }
    with patched({verdict: made_up}), allowance() as spent:
        judgement = judge(STAGE, run_to(np.nan, swing=1e-3), 1e-6, work=work)
    assert (judgement.verdict, judgement.observed) == ("transient", False)
    assert (judgement.settled_after, judgement.followed) == (None, None)
    assert (judgement.hunting.certain, judgement.hunting.reason) == (False, HuntingDoubt.WORK)
    assert spent.used < 1e6
