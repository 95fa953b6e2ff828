"""Modes that remember, on a law from one file outside friso (`maxwell_slip`): elements that stick or slip, against a
reference written by hand (`benchmarks.by_hand`), through every part of friso that follows them."""

import numpy as np
import pytest
from cycles import flow, flow_by_differences
from variants import FULL, gains, maxwell, release, stage, van_dijk

import friso
from benchmarks.by_hand import V, X, Z, by_hand
from friso.engine.kernel import KernelRequest, kernels
from friso.equations.component import Kink, Switch, state
from friso.equations.structure import structure
from friso.errors import InputError
from friso.frequency.loops import plant
from friso.frequency.system import level, member, speeds, steady_force
from friso.hunting import Cycles, Ensemble, find_cycles
from friso.virtual_rig.run import run
from friso.virtual_rig.task import own_motion

STIFFNESS, STRENGTH, LIMIT = np.array([1e5, 8e4, 6e4]), np.array([0.9, 0.96, 0.96]), np.array([9e-6, 12e-6, 16e-6])

THERE_AND_BACK = """kind = "there_and_back"
acceleration = "100 m/s^2"
acceleration_time = "5 ms"
return_at = "0.15 s"
duration = "0.4 s"
"""

MOVES = stage(THERE_AND_BACK, friction=maxwell(), controller=gains(**FULL, tau=1e-3))
"""A rigid stage that moves there and back."""

DROPS = stage(release("1 mm", "1 s"), friction=maxwell(0.4), controller=van_dijk("12 Hz"))
"""The force of an element drops as it breaks loose, so that the stage hunts."""


# simulate


@pytest.mark.slow
def test_a_loop_against_scipy_with_events() -> None:
    """The first slips and sticks of a stage whose elements drop: when each comes, and where the stage is then."""
    flat = DROPS.flat()
    equations = by_hand(flat)
    times, states, slips, *_ = equations.followed(equations.start(2e-3), 0.8, 1e-11)
    changed = np.any(slips[1:] != slips[:-1], axis=1)
    times = np.array([0.0, *times[1:][changed], times[-1]])
    assert len(times) > 6
    result = friso.simulate(DROPS.replace({"motion.displacement": "2 mm", "motion.duration": "800 ms"}), 1e-11, 1e-6)
    ours = np.stack([result[f"slip_{n}"].values for n in (1, 2, 3)], axis=1)
    changes = np.flatnonzero(np.any(np.diff(ours, axis=0) != 0, axis=1))
    moments = np.unique(np.round(times[1:-1], 5))
    assert len(np.unique(np.round(result.time.values[changes], 5))) == pytest.approx(len(moments), abs=1)
    assert result.time.values[changes][[0, -1]] == pytest.approx(times[[1, -2]], abs=2e-6)
    assert result.position.values[-1] == pytest.approx(states[-1, X], rel=1e-6)
    assert result.friction_force.values[-1] == pytest.approx(states[-1, Z:] @ STIFFNESS + 0.5 * states[-1, V], rel=1e-5)
    assert np.array_equal(ours[-1], slips[-1])


# cycles


@pytest.fixture(scope="module")
def cycle() -> tuple[Ensemble, Cycles]:
    stages = Ensemble.held(DROPS.flat(), 1)
    cycles = find_cycles(stages)
    assert cycles.closed[0], cycles.reasons[0]
    return stages, cycles


def test_the_cycle_against_simulation(cycle: tuple[Ensemble, Cycles]) -> None:
    """Amplitude and period of the cycle that shooting closes are those in which a long run ends; so is its multiplier:
    neighbours drift away from it by as much as they do in runs of their own."""
    stages, cycles = cycle
    long = friso.simulate(DROPS.replace({"motion.duration": "40 s"}), 1e-9)
    turns, values = long.turning_time.values, long.turning_deviation.values
    crossings = turns[1:][np.diff(np.sign(values)) > 0]
    assert np.diff(crossings)[-3:] == pytest.approx(cycles.period[0], rel=1e-4)
    late = values[turns > 40 - 2 * cycles.period[0]]
    assert np.ptp(late) / 2 == pytest.approx(cycles.amplitude[0], rel=1e-4)
    several = stages.take(np.zeros(2, np.int64))
    aside = 1e-4 * abs(cycles.states[0, stages.sticking]) * cycles.direction[0]
    ends = several.run(
        cycles.states[0] + np.array([[1.0], [-1.0]]) * aside, np.repeat(cycles.period / 2, 2), 1e-11
    ).ends
    apart = -(ends[0] - ends[1]) / 2
    rates = stages.rates(cycles.states)[0]
    phase = stages.kernel.states.index("integral")
    apart = apart - rates * apart[phase] / rates[phase]
    moved = apart[stages.sticking] / aside[stages.sticking]
    assert moved == pytest.approx(cycles.multiplier[0], rel=1e-3)
    assert abs(cycles.multiplier[0]) < 1


@pytest.mark.thorough
def test_the_cycle_against_scipy_with_events(cycle: tuple[Ensemble, Cycles]) -> None:
    stages, cycles = cycle
    equations = by_hand(DROPS.flat())
    at = equations.places(stages.kernel.states)
    start = equations.state(stages.kernel.states, cycles.states[0])
    _, states, slips, *_ = equations.followed(start, cycles.period[0] / 2, 1e-11)
    assert np.any(slips)
    assert states[-1][at] == pytest.approx(-start[at], abs=1e-6 * cycles.amplitude[0])


@pytest.mark.parametrize("duration", [0.004, 0.03])
def test_deviations_through_switches_against_differences(duration: float) -> None:
    """The derivative of the flow by where it began, over elements that break loose, drop and stick again."""
    stages = Ensemble.held(DROPS.flat(), 1)
    sizes = {"position": 2e-4, "velocity": -5e-3, "filtered_error": -2e-4}
    start = np.array([sizes.get(name, 0.0) for name in stages.kernel.states])
    differences = flow_by_differences(stages, start, duration, 1e-6)
    assert np.max(np.abs(flow(stages, start, duration) - differences)) < 1e-4 * np.max(np.abs(differences))


# frequency


def test_small_motions_of_a_stage_that_sticks() -> None:
    """A sticking stage is held by all sticking elements; a sliding one is held by none."""
    flat = MOVES.flat()
    stuck, sliding = plant(flat, member()), plant(flat, member(1e-3))
    assert stuck.states == sliding.states == ("position", "velocity")
    assert stuck.a[0, 1, 0] == pytest.approx(-STIFFNESS.sum() / 1.7, rel=1e-12)
    assert sliding.a[0, 1].tolist() == pytest.approx([0.0, -0.5 / 1.7], rel=1e-12)
    assert level(flat, True) == level(flat, False) == pytest.approx(STRENGTH.sum())
    assert steady_force(flat, np.array([1e-3]), False)[0] == pytest.approx(STRENGTH.sum() + 0.5e-3)
    assert level(DROPS.flat(), True) == pytest.approx(0.4 * STRENGTH.sum())
    assert speeds(flat, 2) == pytest.approx([0.1 * 9e-6, 1e5 * 16e-6])
    loops = friso.bode(MOVES)
    assert loops.stable
    resonance = np.sqrt(STIFFNESS.sum() / 1.7)
    shown = loops.omega[np.argmax(np.abs(loops.cases["stuck"].plant))]
    assert shown == pytest.approx(resonance, rel=1e-3)
    system = friso.linear(MOVES, "stuck")
    assert np.max(np.abs(system.poles().imag)) > 0


# drive, identification, declaration


def test_a_rail_along_which_nothing_varies_is_refused() -> None:
    railed = MOVES.replace({"rail": {"seed": 1}})
    with pytest.raises(InputError, match="rail"):
        next(run(railed, own_motion(railed), [0], 1e-3))


def test_a_switch_is_a_kink_whose_surface_depends_on_its_side() -> None:
    x, y = state("x"), state("y")
    switch = Switch("held", enter=x - 1, leave=-x, begins=y, entered={y: x})
    assert isinstance(switch, Kink)
    before, beyond = (switch.surface.subs(switch.beyond, side) for side in (0, 1))
    assert (before, beyond) == (x - 1, x)
    assert switch.at_start == y
    assert [switch.becomes[y].subs(switch.beyond, side) for side in (0, 1)] == [x, y]


def test_the_side_at_the_start_may_be_told() -> None:
    """Behind the states; else it follows from them."""
    (shape,) = kernels([KernelRequest(structure(MOVES.flat()))])
    values = shape.values({**MOVES.flat(), "motion.size": 1e-3}, 1)
    states = np.zeros((1, len(shape.states)))
    names = [*shape.states]
    states[0, names.index("velocity")], states[0, names.index("deflection_2")] = 1e-3, LIMIT[1]
    assert shape.with_modes(states, np.zeros((3, 1)), values)[0, shape.initial_size :].tolist() == [0.0, 1.0, 0.0]
    other = np.hstack([states, [[1.0, 0.0, 0.0]]])
    assert shape.modes(other.T, 0.0, np.zeros((3, 1)), values)[list(shape.switches), 0].tolist() == [1.0, 0.0, 0.0]
