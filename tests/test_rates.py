"""Loops at several rates: exact lifting against difference equations by hand and python-control."""

from functools import cache
from typing import get_args

import control
import numpy as np
import pytest
from variants import cascade, lugre, release, stage

import friso
from friso.frequency.bode import CascadeLoop, cascade_loops
from friso.frequency.loops import FORCE, RATED, STAGE, cut_over_period, plant, poles, response, samples_controller
from friso.frequency.margins import margins
from friso.frequency.system import DriveTiming, Members, limit_cases, waited, zero_order_hold
from friso.stage import Stage

KV, KP, T_V, FAST, SLOW = 25.0, 50.0, 0.06, 1e-3, 4

CASE = "sliding"


@cache
def machine(position: str = "4 ms", gain: float = 1.0, **drive: str) -> Stage:
    """P over PI on a mass, the position loop at every fourth sample."""
    times = {"sample_time": "1 ms", "position_sample_time": position, "delay": "0.4 ms", **drive}
    keys = {"kv": f"{KV} 1/s", "kp": f"{KP * gain} N*s/m", "velocity_integral_time": "60 ms"}
    return stage(release("2 mm", "1 s"), friction=lugre(2), controller=cascade(**keys)).replace({"drive": times})


def member_of(case: Stage) -> Members:
    return limit_cases(case.flat())[CASE]


def by_hand(case: Stage, gain: float = 1.0, outer: float = 1.0) -> np.ndarray:
    """Return the matrix over four samples, built sample by sample.

    It takes position, velocity, the previous force and the drive's numbers from the beginning to the end.
    """
    flat = case.flat()
    open_plant = friso.linear(case, CASE, "plant")
    row = open_plant.find_output("stage")
    sampled = [
        control.sample_system(control.ss(open_plant.A, open_plant.B[:, :1], open_plant.C[[row]], 0.0), part, "zoh")
        for part in (0.4e-3, 0.6e-3)
    ]
    n = open_plant.nstates

    def four(z: np.ndarray) -> np.ndarray:
        x, force, past, wound, command = z[:n], z[n], z[n + 1], z[n + 2], z[n + 3]
        for k in range(SLOW):
            y = float((open_plant.C[row] @ x).item())
            if k == 0:
                command = -outer * flat["controller.kv"] * y
            velocity = (y - past) / FAST
            past = y
            wound += FAST * (command - velocity)
            new = gain * flat["controller.kp"] * (command - velocity + wound / T_V)
            x = sampled[0].A @ x + sampled[0].B[:, 0] * force
            x = sampled[1].A @ x + sampled[1].B[:, 0] * new
            force = new
        return np.array([*x, force, past, wound, command])

    size = n + 4
    return np.array([four(unit) for unit in np.eye(size)]).T


def test_poles_are_those_of_the_difference_equations() -> None:
    case = machine()
    ours = poles(case.flat(), member_of(case), DriveTiming.of(case.flat())).closed[0]
    theirs = np.linalg.eigvals(by_hand(case))
    ours, theirs = (np.sort_complex(z[np.abs(z) > 1e-9]) for z in (ours, theirs))
    assert ours == pytest.approx(theirs, rel=1e-7)


@pytest.mark.parametrize("which", ["gain_margin", "gain_reduction"])
def test_gain_margins_are_where_it_becomes_unstable(which: str) -> None:
    edge = getattr(margins(machine().flat(), member_of(machine())), which)
    assert 0 < edge < np.inf
    sizes = [np.abs(np.linalg.eigvals(by_hand(machine(), edge * factor))).max() for factor in (0.999, 1.001)]
    assert min(sizes) < 1 < max(sizes)
    assert (sizes[0] < sizes[1]) == (which == "gain_margin")


def test_each_loop_of_a_cascade_opened_is_on_the_edge_at_its_gain_margin() -> None:
    """Difference equations by hand: of the velocity loop with the position loop open, whose position is a pole at 1,
    and of both where the gain of the position loop alone is raised."""
    loops = cascade_loops(machine().flat(), member_of(machine()), np.array([10.0]))
    inner, outer = (loops.margins[loop].gain_margin for loop in get_args(CascadeLoop))
    for factor, stable in ((0.999, True), (1.001, False)):
        alone = np.linalg.eigvals(by_hand(machine(), inner * factor, 0.0))
        assert (np.abs(alone[np.abs(alone - 1) > 1e-6]).max() < 1) == stable
        assert (np.abs(np.linalg.eigvals(by_hand(machine(), 1.0, outer * factor))).max() < 1) == stable


def test_loops_of_a_cascade_in_continuous_time_against_python_control() -> None:
    case = machine().replace({"drive": None})
    flat, omega = case.flat(), np.geomspace(1.0, 1e4, 40)
    loops = cascade_loops(flat, member_of(case), omega)
    s, moved = 1j * omega, friso.linear(case, CASE, "plant")
    velocity = s * moved(s)[moved.find_output("stage"), 0]
    inner = KP * (1 + 1 / (T_V * s)) * velocity
    assert loops.plant == pytest.approx(velocity)
    assert loops.loops["velocity"] == pytest.approx(inner)
    assert loops.loops["position"] == pytest.approx(KV / s * inner / (1 + inner))
    system = control.ss(moved.A, moved.B[:, :1], moved.C[[moved.find_output("stage")]], 0.0)
    speed = control.tf([1, 0], [1]) * control.tf(system) * control.tf([KP * T_V, KP], [T_V, 0])
    _, phase, *_ = control.stability_margins(
        control.minreal(control.tf([KV], [1, 0]) * speed / (1 + speed), 1e-6, False)
    )
    assert loops.margins["position"].phase_margin == pytest.approx(phase, rel=1e-4)


def test_two_encoders_at_several_rates() -> None:
    """The poles are those of the loop built by hand, sample by sample.

    The position comes from the load's encoder, the velocity from the motor's.
    """
    case = friso.load(friso.example("ball_screw_axis")).replace(
        {
            "controller": {"kind": "cascade", "kv": "60 1/s", "kp": "5500 N*s/m", "velocity_integral_time": "30 ms"},
            "drive": {"sample_time": "250 us", "position_sample_time": "1 ms"},
        }
    )
    one, step = member_of(case), 250e-6
    machine_ = plant(case.flat(), one).take((FORCE,), (STAGE, RATED))
    held = control.sample_system(control.ss(machine_.a[0], machine_.b[0], machine_.c[0], 0.0), step, "zoh")

    def four(z: np.ndarray) -> np.ndarray:
        x, (past, wound, command) = z[:-3], z[-3:]
        for k in range(4):
            load, motor = held.C @ x
            command = -60 * load if k == 0 else command
            velocity, past = (motor - past) / step, motor
            wound += step * (command - velocity)
            x = held.A @ x + held.B[:, 0] * 5500 * (command - velocity + wound / 0.03)
        return np.array([*x, past, wound, command])

    theirs = np.linalg.eigvals(np.array([four(unit) for unit in np.eye(len(held.A) + 3)]).T)
    ours = poles(case.flat(), one, DriveTiming.of(case.flat())).closed[0]
    theirs, ours = (np.sort(np.abs(z[np.abs(z) > 1e-6])) for z in (theirs, ours))
    assert ours == pytest.approx(theirs, rel=1e-6)


def test_with_all_loops_at_one_rate_the_loci_are_the_loop() -> None:
    """A period of four samples of a controller that is the same at all of them, against python-control."""
    case = machine("1 ms")
    flat, omega = case.flat(), np.geomspace(1.0, 0.98 * np.pi / FAST, 60)
    held = zero_order_hold(plant(flat, member_of(case)).take((FORCE,), (STAGE, RATED)), FAST, 0.4e-3)
    plant_sampled = waited(held, 0)
    (same,) = samples_controller(flat, 1, 1)
    locus = cut_over_period(plant_sampled, (same,) * 4).locus(omega * FAST)[0]
    one = control.ss(plant_sampled.a[0], plant_sampled.b[0], plant_sampled.c[0][:1], 0.0, FAST)
    seen = same.a[0], same.b[0].sum(axis=1, keepdims=True), same.c[0], same.d[0].sum(axis=1, keepdims=True)
    law = control.ss(*seen, FAST)  # of one encoder
    assert locus == pytest.approx(-np.asarray((one * law)(np.exp(1j * omega * FAST))), rel=1e-8)


def test_slower_loops_leave_less_until_they_are_refused() -> None:
    """A position loop at half and at a sixteenth of the rate: phase is lost; slowly, it is that in continuous time."""
    phases = [margins(machine(t).flat(), member_of(machine(t))).phase_margin for t in ("2 ms", "16 ms")]
    assert phases[0] > phases[1]
    case, omega = machine(), np.array([2.0, 5.0])
    continuous = case.replace({"drive": None}).flat()
    theirs = response(continuous, member_of(case), DriveTiming(0.0, 0.0))(omega)
    ours = response(case.flat(), member_of(case), DriveTiming.of(case.flat()))(omega)
    assert ours == pytest.approx(theirs, rel=0.05)
    with pytest.raises(friso.InputError, match="at most 64 samples"):
        margins(machine("200 ms").flat(), member_of(machine()))
