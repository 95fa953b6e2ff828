"""Oracles that nobody here made (`benchmarks/oracles`), where asking them is cheap; the rest is on the page."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))

import friso
from benchmarks.by_hand import by_hand
from benchmarks.oracles import cycles, dcmotor, drift, orbits, servo, switch
from benchmarks.oracles.edges import RESTS, SEED, SWINGS, edge_of, kept, what_becomes
from benchmarks.truth.draws import draw
from friso.equations.bandwidth import faster
from friso.hunting import Ensemble, find_cycles, find_swings

PUBLISHED = 7.54040, 6.36272, 0.369816
"""First passage [s], period [s] and top speed [m/s] of the stick-slip of 1995 (references.md, section 1)."""


@pytest.mark.slow
def test_bristles_creep_under_a_load_that_oscillates_below_break_away() -> None:
    """LuGre's do, without end; elasto-plastic ones do not (references.md, section 9)."""
    assert drift.by_friso("lugre") == pytest.approx(drift.by_scipy("lugre"), rel=1e-6)
    assert abs(drift.by_friso("elasto_plastic")) < 1e-12


@pytest.mark.slow
def test_the_servo_of_1995_hunts_with_its_integral_and_rests_without() -> None:
    (swing,) = find_swings(servo.stage().flat())
    times, places, _ = servo.by_scipy(servo.KI)
    seen = servo.swings(times, places)
    assert 2 * swing.amplitude == pytest.approx(seen["peak to peak at the end [m]"], rel=1e-5)
    assert swing.period == pytest.approx(seen["period at the end [s]"], rel=1e-5)
    assert seen["first peak [m]"] == pytest.approx(1.500473, abs=1e-6)
    end = float(friso.simulate(servo.stage(0.0), 1e-9, "10 ms")["position"][-1])
    assert end == pytest.approx(servo.by_scipy(0.0)[2], rel=1e-5)
    assert 1 - end < servo.STATIC / servo.KP


@pytest.mark.slow
def test_every_stabilising_pid_has_a_limit_cycle_with_a_gap_and_none_without() -> None:
    """Solved exactly; towards the limit friso's cycle comes near that."""
    pids = switch.drawn(12)
    sizes = [pid.cycle() for pid in pids]
    assert all(size > 0 and sticks for size, sticks in sizes)
    assert all(-1 < pid.ratio() < 1 for pid in pids)
    off = [abs(switch.surveyed(switch.stage(pids[0], sharpness)) / sizes[0][0] - 1) for sharpness in (1e-1, 1e-3)]
    assert off[1] < switch.NEAR < off[0]


def test_a_pid_with_a_gap_swings_about_its_own_limit_cycle() -> None:
    """From a smaller distance the mass stops farther away than it began, from a larger one nearer."""
    pid = switch.drawn(1)[0]
    size, _ = pid.cycle()
    assert -pid.stop(size, switch.GAP)[0] == pytest.approx(size, rel=1e-9)
    assert -pid.stop(size / 2, switch.GAP)[0] > size / 2
    assert -pid.stop(2 * size, switch.GAP)[0] < 2 * size


@pytest.mark.slow
def test_multipliers_by_differences_are_those_of_the_variational_equations() -> None:
    orbit = orbits.first_orbit(4.0)
    assert orbit.period == pytest.approx(3.15031069, abs=1e-8)
    assert orbit.multiplier == pytest.approx(-0.8172509, abs=1e-6)
    cycle = find_cycles(Ensemble.held(cycles.stage(4.0).flat(), 1))
    assert cycle.period[0] == pytest.approx(orbit.period, rel=1e-7)
    assert cycle.multiplier[0] == pytest.approx(orbit.multiplier, abs=1e-5)


def test_mujoco_errs_in_proportion_to_its_time_step() -> None:
    pytest.importorskip("mujoco")
    coarse, fine = (np.array(dcmotor.by_mujoco(step)) for step in dcmotor.STEPS[:2])
    assert 2 * fine - coarse == pytest.approx(PUBLISHED, rel=2e-6)
    assert (coarse - PUBLISHED) / (fine - PUBLISHED) == pytest.approx(2, abs=0.1)


@pytest.mark.slow
def test_plain_runs_keep_to_a_cycle_that_is_published() -> None:
    """The rigid mass at 4 Hz, on its cycle of 2.0166608 mm by the end; the error falls with the tolerance."""
    plain = by_hand(cycles.stage(4.0).flat()).held()
    spreads = [plain.long_run(plain.start(2e-3), 200.0, rtol).spread for rtol in (1e-5, 1e-8)]
    off = [abs(spread / 2 / 2.0166608e-3 - 1) for spread in spreads]
    assert off[1] < 1e-6 < off[0] < 1e-3


@pytest.mark.parametrize("number", [0, 5, 7])
def test_a_faster_stage_is_the_same_by_hand_and_by_friso(number: int) -> None:
    flat = draw(SEED, number).flat()
    scaled, own = by_hand(flat).faster(1.7).numbers, by_hand(faster(flat, 1.7)).numbers
    assert scaled.tolist() == pytest.approx(own.tolist(), rel=1e-12)


@pytest.mark.slow
def test_an_edge_by_brute_force_is_one_in_friso() -> None:
    record = next(r for r in kept() if (r["series"], r["number"]) == ("stages", 30))
    flat = draw(SEED, 30).flat()
    words = []
    for factor in record["edge"]:
        word, _ = what_becomes(by_hand(flat).held().faster(factor))
        words.append(word)
        assert bool(find_swings(faster(flat, factor))) == (word == SWINGS)
    assert words == [SWINGS, RESTS]


def test_the_edge_is_the_last_one_of_a_stage_that_swings_and_else_the_nearest_below() -> None:
    words = {0.25: SWINGS, 0.4: RESTS, 0.63: SWINGS, 1.0: RESTS, 1.6: SWINGS, 2.5: "unsure", 4.0: RESTS}
    assert edge_of(words) == [0.63, 1.0]
    assert edge_of(words | {1.0: SWINGS}) == [1.6, 4.0]
    assert edge_of(dict.fromkeys(words, RESTS)) is None
