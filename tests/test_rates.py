"""Loops at several rates: exact lifting against difference equations by hand and python-control."""

from __future__ import annotations

from functools import cache

import control
import numpy as np
import pytest
from variants import cascade, lugre, release, stage

import friso
from friso.frequency.drive import DriveTiming, waited, zero_order_hold
from friso.frequency.loops import poles, response
from friso.frequency.margins import Margins, margins
from friso.frequency.members import Members, limit_cases
from friso.frequency.parts import plant
from friso.frequency.rates import cut_over_period, samples_controller
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


def by_hand(case: Stage, gain: float = 1.0) -> np.ndarray:
    """How four samples take position, velocity, the force before, and the drive's numbers along, sample by sample."""
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
                command = -flat["controller.kv"] * y
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


@pytest.fixture(scope="module")
def of_machine() -> Margins:
    return margins(machine().flat(), member_of(machine()))


@pytest.mark.parametrize("which", ["gain_margin", "gain_reduction"])
def test_gain_margins_are_where_it_becomes_unstable(of_machine: Margins, which: str) -> None:
    edge = getattr(of_machine, which)
    assert 0 < edge < np.inf
    sizes = [np.abs(np.linalg.eigvals(by_hand(machine(), edge * factor))).max() for factor in (0.999, 1.001)]
    assert min(sizes) < 1 < max(sizes)
    assert (sizes[0] < sizes[1]) == (which == "gain_margin")


def test_with_all_loops_at_one_rate_the_loci_are_the_loop(of_machine: Margins) -> None:
    """A period of four samples of a controller that is the same at all of them, against python-control."""
    case = machine("1 ms")
    flat, omega = case.flat(), np.geomspace(1.0, 0.98 * np.pi / FAST, 60)
    plant_sampled = waited(zero_order_hold(plant(flat, member_of(case)).take(("force",), ("stage",)), FAST, 0.4e-3), 0)
    (same,) = samples_controller(flat, 1, 1)
    locus = cut_over_period(plant_sampled, (same,) * 4).locus(omega * FAST)[0]
    one = control.ss(plant_sampled.a[0], plant_sampled.b[0], plant_sampled.c[0], 0.0, FAST)
    law = control.ss(same.a[0], same.b[0], same.c[0], same.d[0], FAST)
    assert locus == pytest.approx(-np.asarray((one * law)(np.exp(1j * omega * FAST))), rel=1e-8)


def test_slower_loops_leave_less() -> None:
    """A position loop at half and at a sixteenth of the rate: phase is lost."""
    phases = [margins(machine(t).flat(), member_of(machine(t))).phase_margin for t in ("2 ms", "16 ms")]
    assert phases[0] > phases[1]


def test_a_locus_is_the_response_where_aliases_do_not_matter() -> None:
    """Slowly, the loop is that in continuous time."""
    case = machine()
    omega = np.array([2.0, 5.0])
    continuous = case.replace({"drive": None})
    theirs = response(continuous.flat(), member_of(case), DriveTiming(0.0, 0.0))(omega)
    ours = response(case.flat(), member_of(case), DriveTiming.of(case.flat()))(omega)
    assert ours == pytest.approx(theirs, rel=0.05)


def test_a_period_that_is_too_long_is_refused() -> None:
    with pytest.raises(friso.InputError, match="at most 64 samples"):
        margins(machine("200 ms").flat(), member_of(machine()))
