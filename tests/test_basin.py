"""Test the starts of hunting and the distance of its edge, against single runs and each other."""

from functools import cache
from typing import Any

import numpy as np
import pytest
from book import BOOK
from cycles import by_gains
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom, qmc
from variants import VARIANTS, lugre, stage, there_and_back, van_dijk

import friso
from friso.engine.arrays import Status
from friso.engine.batch import RunOptions, run_chunks
from friso.equations.bandwidth import faster
from friso.equations.motion import last_corner, standing
from friso.hunting import (
    SEARCH_LIMITS,
    Cycle,
    Ensemble,
    HuntingDoubt,
    Kick,
    MoveShare,
    Target,
    displacements_that_hunt,
    find_margin,
    hunting,
    moves_that_hunt,
    pushes_that_hunt,
)
from friso.hunting.basin import DRAWN_MOVES, ends_in, evenly
from friso.hunting.verdict import own_motion
from friso.stage import Stage

LONG = 60
"""Periods after which a single run has settled, or swings like the cycle."""


def rigid(crossover: float) -> Stage:
    """The rigid mass of 1.7 kg."""
    return VARIANTS["rigid"].replace({"controller.crossover": f"{crossover} Hz"})


@cache
def cycle() -> Cycle:
    """Return the stable cycle of the rig at 8 Hz: 0.52 mm and 1.63 s."""
    (result,) = hunting(rigid(8)).attracting
    return result


@cache
def target() -> Target:
    """Return the motion that marks a run in this cycle."""
    result = hunting(rigid(8)).target
    assert result is not None
    return result


@cache
def windows() -> Kick:
    return displacements_that_hunt(rigid(8), target())


def hunts(chosen: Stage) -> bool:
    """Whether a single run still swings like the cycle at its end, by its samples."""
    response = friso.simulate(chosen, rtol=1e-7, sample_time=2e-3)
    assert response.attrs["status"] == "done"
    end = float(response.time[-1])
    deviation = (response.position - response.reference).sel(time=slice(end - 2 * cycle().period, end))
    swing = np.ptp(deviation.to_numpy()) / (2 * cycle().amplitude)
    assert swing < 0.1 or swing == pytest.approx(1, rel=0.1)
    return bool(swing > 0.5)


@pytest.mark.slow
def test_a_motion_that_a_hair_turns_is_not_certain() -> None:
    """A verdict is uncertain at the very end of a window of kicks, and certain a hundredth beside it."""
    window = windows().windows[0]
    low, high = 0.98 * window[1], 1.02 * window[1]
    for _ in range(4):
        kicks = np.linspace(low, high, 24)
        ends, _, _ = ends_in({**released(high).flat(), "motion.displacement": kicks}, len(kicks), target())
        first = int(np.flatnonzero(~ends)[0])
        low, high = float(kicks[first - 1]), float(kicks[first])
    turned = [own_motion(released(kick), target(), np.inf).doubt for kick in (low, 0.99 * low, 1.01 * high)]
    assert turned == [HuntingDoubt.RUNS, "", ""]


def released(displacement: float) -> Stage:
    motion = {"motion.displacement": f"{displacement!r} m", "motion.duration": f"{LONG * cycle().period!r} s"}
    return rigid(8).replace(motion)


def test_displacements_that_start_hunting() -> None:
    """At 8 Hz there are three windows: 0.2 to 1.02 mm, 2.58 to 5.27 mm, and from 7.62 mm to the end searched.

    From the gaps between them, the stage lands near enough to its reference to rest after a first or second swing.
    """
    bands = windows()
    ends = [1e3 * end for window in bands.windows for end in window]
    assert ends[:5] == pytest.approx([0.2, 1.02, 2.58, 5.27, 7.62], rel=0.02)
    assert len(ends) == 6
    assert bands.windows[-1][1] == bands.searched[1] == pytest.approx(300 * cycle().amplitude)
    assert bands.searched[0] == pytest.approx(cycle().amplitude / 30)
    assert bands.smallest == bands.windows[0][0]


@pytest.mark.cases(first=3)
@pytest.mark.parametrize("edge", range(5))
def test_edges_of_the_windows_by_single_runs(edge: int) -> None:
    """A release 2 % inside of each edge hunts, one 2 % outside does not."""
    place = [end for window in windows().windows for end in window][edge]
    inwards = 1.02 if edge % 2 == 0 else 1 / 1.02
    assert hunts(released(place * inwards))
    assert not hunts(released(place / inwards))


def test_pushes_that_start_hunting() -> None:
    """2 % inside the first window a push hunts, 2 % outside it does not: by runs from states by hand."""
    chosen = rigid(8)
    result = pushes_that_hunt(chosen, target())
    low, high = result.windows[0]
    velocities = np.array([low * 1.02, high / 1.02, low / 1.02, high * 1.02])
    stages = Ensemble.held(chosen.flat(), 4)
    starts = np.zeros((4, 5))
    starts[:, stages.kernel.states.index("velocity")] = velocities
    duration = LONG * cycle().period
    results = stages.run(starts, np.full(4, duration), 1e-7, interval=duration / 20000)
    swing = np.ptp(results.samples[:, -600:, stages.kernel.position], axis=1) / 2
    assert swing[:2] == pytest.approx(cycle().amplitude, rel=0.05)
    assert np.all(swing[2:] < 0.05 * cycle().amplitude)


MOVING = stage(there_and_back(), friction=lugre(2), controller=van_dijk("8 Hz"))


def test_share_of_moves_is_reproducible() -> None:
    """Equal draws give equal numbers."""
    first, second = moves_that_hunt(MOVING, target()), moves_that_hunt(MOVING, target())
    assert first == second
    assert first.count == DRAWN_MOVES
    assert first.ranges["motion.acceleration"] == pytest.approx([10, 200])
    assert first.ranges["motion.acceleration_time"] == pytest.approx([0.003, 0.06])
    low, high = first.interval
    assert 0 < low < first.fraction < high < 1


@pytest.mark.parametrize("kind", ["release", "there and back"])
def test_a_run_that_goes_on_where_its_reference_stands_is_the_whole_run(kind: str) -> None:
    """The run is continued from its state after the last corner, within the tolerance of both."""
    flat = (released(2e-3) if kind == "release" else MOVING).flat()
    form = Ensemble.held(flat, 1).kernel
    first, rest = float(last_corner(flat)) + 0.7, 2.3

    def ends(keys: dict[str, Any], duration: float, starts: np.ndarray | None = None) -> np.ndarray:
        (runs,) = run_chunks(form, {**keys, "motion.duration": duration}, 1, RunOptions(rtol=1e-9), starts)
        assert runs.results.statuses == Status.DONE
        return runs.results.ends

    on = ends(standing(flat), rest, ends(flat, first))
    scales = Ensemble.held(flat, 1).scales
    assert np.max(np.abs(on - ends(flat, first + rest))[:, : scales.shape[1]] / scales) < 1e-5


@pytest.mark.slow
def test_moves_by_single_runs() -> None:
    """The count equals that of single runs of the draws; eight of them, hunting and resting, are simulated."""
    result = moves_that_hunt(MOVING, target())
    drawn = qmc.scale(evenly(DRAWN_MOVES).T, *zip(*result.ranges.values(), strict=True))
    own = MOVING.flat() | {"motion.acceleration": drawn[:, 0], "motion.acceleration_time": drawn[:, 1]}
    item, completed, _ = ends_in(own, DRAWN_MOVES, target())
    assert completed.all()
    assert item.sum() == result.hunting
    assert 0 < result.hunting < DRAWN_MOVES
    for k in (*np.flatnonzero(item)[:4], *np.flatnonzero(~item)[:4]):
        acceleration, time = map(float, drawn[k])
        move = there_and_back(f"{5.2 + LONG * cycle().period!r} s").replace("30 ms", f"{time!r} s")
        move = move.replace("100 m/s^2", f"{acceleration!r} m/s^2")
        assert hunts(stage(move, friction=lugre(2), controller=van_dijk("8 Hz"))) == item[k]


def test_moves_that_overlap_are_not_drawn() -> None:
    """A move takes twice the acceleration time, and the stage returns after it has arrived."""
    soon = MOVING.replace({"motion.return_at": "0.08 s"})
    result = moves_that_hunt(soon, target())
    assert result.ranges["motion.acceleration_time"] == pytest.approx([SEARCH_LIMITS.move_shares[0] * 0.03, 0.04])


def test_motions_without_acceleration_have_no_share() -> None:
    """A release has none, nor does a move that stays where it is."""
    assert moves_that_hunt(rigid(8), target()) is None
    assert moves_that_hunt(MOVING.replace({"motion.acceleration": "0 m/s^2"}), target()) is None


@pytest.mark.slow
@given(drawn=st.integers(1, 500), data=st.data())
def test_interval_holds_the_share(drawn: int, data: st.DataObject) -> None:
    """At its lower end, so many hits or more have a probability of 2.5 %, at its upper end, so many or fewer.

    Clopper and Pearson 1934.
    """
    hunting = data.draw(st.integers(0, drawn))
    result = MoveShare(drawn, hunting, {})
    low, high = result.interval
    assert 0 <= low <= result.fraction <= high <= 1
    assert low == 0.0 or binom.sf(hunting - 1, drawn, low) == pytest.approx(0.025, rel=1e-6)
    assert high == 1.0 or binom.cdf(hunting, drawn, high) == pytest.approx(0.025, rel=1e-6)


def equal_gains(crossover: float) -> Stage:
    """The controller of `rigid`, its transfer function written as gains; the force limit is far off."""
    return by_gains(crossover, "1e6 N")


@pytest.mark.thorough
def test_gains_hunt_like_the_tuned_controller_they_equal() -> None:
    """The states of the controllers differ, their effect does not: equal cycle, equal margin."""
    chosen = equal_gains(8)
    (result,) = hunting(chosen).cycles
    assert result.period == pytest.approx(cycle().period, rel=1e-7)
    assert result.amplitude == pytest.approx(cycle().amplitude, rel=1e-7)
    assert result.multiplier == pytest.approx(cycle().multiplier, rel=1e-4)
    assert result.growth == pytest.approx(cycle().growth, rel=1e-4)
    edge, tuned = find_margin(chosen, attracting=True), find_margin(rigid(8), attracting=True)
    assert edge.crossover is None
    assert edge.factor == pytest.approx(tuned.factor, rel=1e-5)


def test_faster_gains_are_those_of_the_tuned_controller_at_a_higher_crossover() -> None:
    """All poles, zeros and the crossover are scaled: kp by the square, ki by the cube, kd once, tau inversely."""
    scaled, wanted = faster(equal_gains(8).flat(), np.array(1.25)), equal_gains(10).flat()
    for name in ("kp", "ki", "kd", "tau"):
        assert float(scaled[f"controller.{name}"]) == pytest.approx(wanted[f"controller.{name}"], rel=1e-12)


@pytest.mark.cases(slow=1)
@pytest.mark.parametrize("chosen", [rigid(8), equal_gains(8)], ids=["tuned", "gains"])
def test_cycle_attracts_up_to_the_margin_and_not_beyond(chosen: Stage) -> None:
    """At 0.98 times the factor a cycle attracts, at 1.02 times none does; tested by hunting(), from stage files."""
    edge = find_margin(chosen, attracting=True)
    assert edge is not None
    for share, attracting in ((0.98, 1), (1.02, 0)):
        assert len(hunting(at(chosen, share * edge.factor)).attracting) == attracting


def at(chosen: Stage, factor: float) -> Stage:
    """The stage with a controller faster by a factor, written out."""
    units = {"crossover": "Hz", "kp": "N/m", "ki": "N/(m*s)", "kd": "N*s/m", "tau": "s"}
    scaled = faster(chosen.flat(), np.array(factor))
    texts = {f"controller.{name}": unit for name, unit in units.items() if f"controller.{name}" in scaled}
    return chosen.replace({key: f"{float(scaled[key])!r} {unit}" for key, unit in texts.items()})


@pytest.mark.thorough
def test_margin_from_above_is_that_from_below() -> None:
    """Whether the stage hunts or not, the edge in between is the same."""
    below, above = find_margin(rigid(8), attracting=True), find_margin(rigid(14), attracting=False)
    assert below.crossover == pytest.approx(above.crossover, rel=1e-5)


@pytest.mark.cases(first=1)
@pytest.mark.parametrize(("crossover", "attracting"), [(110, False), (0.9, True)])
def test_no_margin_within_the_range_of_the_search(crossover: float, attracting: bool) -> None:
    """The edge at 9.77 Hz is too far off to be looked for."""
    assert not SEARCH_LIMITS.lowest_bandwidth < 9.77 / crossover < SEARCH_LIMITS.highest_bandwidth
    assert find_margin(rigid(crossover), attracting) is None


def test_a_stage_that_rests_just_below_break_away_is_not_shaken_loose_by_rounding() -> None:
    """Behind a backlash the motor stands on its flank with 99.94 % of the static friction once the error is gone: for
    ever, at tolerances of 1e-7 to 1e-9; at 1e-6 the stage broke away again."""
    stage = BOOK["just below break-away"]
    kicks = {**stage.flat(), "motion.displacement": np.array([110e-6, 141e-6, 146.3e-6, 152e-6, 160e-6])}
    ends, completed, _ = ends_in(kicks, 5, Target(77.9911e-6, 76.8975, 850.0, 212.5))
    assert completed.all()
    assert ends.tolist() == [True, False, False, False, False]


LEANING = BOOK["leaning"]


def test_kicks_of_a_stage_that_leans_are_searched_on_both_sides() -> None:
    """From 0.495 mm on the negative side, from 0.69 mm on the positive one: by single runs 3 % beside these."""
    found = hunting(LEANING)
    assert found.target is not None
    kick = displacements_that_hunt(LEANING, found.target)
    assert not kick.symmetric
    assert kick.smallest == pytest.approx(-0.495e-3, rel=0.02)
    assert kick.towards(1)[0][0] == pytest.approx(0.692e-3, rel=0.02)
    assert len(kick.windows) == len(kick.towards(1)) + len(kick.towards(-1))
    for side in (1, -1):
        least = side * kick.towards(side)[0][0]
        ends = [
            friso.simulate(LEANING.replace({"motion.displacement": f"{least * factor!r} m", "motion.duration": "30 s"}))
            for factor in (1.03, 1 / 1.03)
        ]
        swings = [float(np.ptp(run["position"].values[-len(run.time) // 10 :])) for run in ends]
        assert swings[0] > 3e-3
        assert swings[1] < 1e-5
