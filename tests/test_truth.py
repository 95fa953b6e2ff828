"""The adversary of benchmarks.truth judges swings by itself, draws the same stages again, and keeps its attacks."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from variants import VARIANTS

from benchmarks.truth.claims import RUNS_AWAY, checked
from benchmarks.truth.classes import classes_of
from benchmarks.truth.draws import SERIES, draw
from benchmarks.truth.refute import attempts, may_attract
from benchmarks.truth.swings import RESTS, SWINGS, UNSURE, judge, legs
from benchmarks.truth.trials import Bench
from friso.equations.bandwidth import faster
from friso.hunting import find_swings
from friso.stage import loads

END = 1000.0


def word(times: np.ndarray, sizes: np.ndarray, patient: bool = False) -> str:
    """Return the verdict on a run that turns at `times` [s], by `sizes` to either side in turn."""
    values = sizes * (-1.0) ** np.arange(len(sizes))
    late = values[times >= 0.75 * END]
    return judge(legs(times, values, END), float(np.ptp(late)) if late.size else 0.0, 1e-3, patient)


def evenly(sizes: np.ndarray) -> str:
    return word(np.linspace(0.0, END, len(sizes)), sizes)


def test_a_cycle_swings_on_whatever_its_period() -> None:
    long_and_short = np.tile([1.0, 0.4, 0.7], 100)
    assert evenly(np.ones(300)) == evenly(long_and_short) == SWINGS


@pytest.mark.parametrize("share", [0.9999, 1.0001])
def test_what_grows_or_decays_slowly_is_followed_on(share: float) -> None:
    assert evenly(share ** np.arange(400)) == UNSURE


def test_shrinking_by_a_share_at_every_ever_longer_stop_is_no_cycle() -> None:
    """A stage waits the longer the nearer it sticks: in time its swings shrink as 1/t."""
    sizes = 0.97 ** np.arange(200)
    times = np.cumsum(1 / sizes)
    times *= END / times[-1]
    assert word(times, sizes) == UNSURE
    assert word(times, sizes, patient=True) == RESTS


def test_small_swings_are_rest() -> None:
    assert evenly(np.full(300, 1e-4)) == RESTS


@pytest.mark.cases(first=3)
@pytest.mark.parametrize("series", SERIES)
def test_stages_are_drawn_again_by_seed_and_number(series: str) -> None:
    for number in range(len(SERIES[series])):
        stage = draw(7, number, series)
        assert stage == draw(7, number, series)
        assert loads(stage.to_toml()) == stage
        assert stage.flat() != draw(8, number, series).flat()


def test_stages_are_those_that_the_documentation_counts() -> None:
    """Whatever other series draw besides."""
    assert draw(1, 18).flat()["motion.displacement"] == pytest.approx(0.679328, rel=1e-5)
    assert draw(2, 5).flat()["motion.displacement"] == pytest.approx(0.0217155, rel=1e-5)


def test_a_stage_that_runs_away_is_said_to_and_another_that_is_said_to_is_refuted() -> None:
    """An integrator far too strong: m s^3 + sigma_2 s^2 + kp s + ki has roots on the right."""
    chosen = VARIANTS["rigid stage, PI"]
    (claim,) = checked(chosen.replace({"controller.ki": "5e6 N/(m*s)"})).claims
    assert (claim.verdict, claim.sure) == (RUNS_AWAY, True)
    assert [*attempts(claim, 0)["verdict"]] == []
    (wrong,) = attempts(replace(claim, stage=chosen), 0)["verdict"]
    assert (wrong.of, wrong.sure) == ("own motion", True)


HUNTING = VARIANTS["rigid"]


@cache
def attracting() -> Any:
    """Return the stable motion of a stage as friso finds it."""
    (motion,) = find_swings(HUNTING.flat())
    return motion


def test_what_is_said_to_attract_is_followed_from_close_beside_it() -> None:
    """A hunting stage keeps its cycle up, and a much faster one, begun there, does not."""
    assert may_attract(Bench(HUNTING.flat()), attracting())
    assert not may_attract(Bench(faster(HUNTING.flat(), 8)), attracting())


@pytest.mark.slow
def test_stages_are_counted_by_class_of_machine() -> None:
    """Classes are law, joint and controller, settings, backlash, and friction on both sides of a transmission."""
    names = {name for series in SERIES for number in range(30) for name in classes_of(draw(7, number, series).flat())}
    settings = {
        "dead band of the error",
        "leak of the integral",
        "limit of the integral",
        "force limit, no anti-windup",
    }
    assert names >= settings | {"backlash", "transmission", "two frictions", "joint: free", "friction: gms"}
    assert classes_of(draw(7, 2, "drives").flat()) == [
        "controller: pid",
        "friction: none",
        "joint: rigid",
        "transmission",
    ]
