"""Position loop over velocity loop: against models by hand, python-control and difference equations, and through the
commands."""

import tomllib
from itertools import pairwise
from pathlib import Path
from typing import Any

import control
import numpy as np
import pytest
import sympy as sp
from emps import emps_log
from scipy.integrate import solve_ivp
from variants import cascade, gains, limit, lugre, release, stage, step, there_and_back

import friso
from benchmarks import by_hand as plain
from friso.equations.bandwidth import faster
from friso.equations.blocks import Loop
from friso.equations.component import state
from friso.equations.continuous import slow_gains
from friso.equations.sampled import SAMPLE_TIME, sampled_controller
from friso.equations.structure import controller_form
from friso.frequency.margins import margins
from friso.frequency.system import limit_cases
from friso.hunting import Hunting
from friso.hunting import hunting as hunting_of
from friso.identification.experiments.moves import identify_moves
from friso.identification.output_error.problem import loop_problem
from friso.identification.readings.common import record
from friso.stage import Stage
from friso.studies.sweep import sweep

KV, KP, T_V, MASS = 60.0, 50.0, 0.03, 1.7

PI = cascade(velocity_integral_time="30 ms")
"""P position, PI velocity: in motion about a reference at rest that is a PID with the derivative on the measurement."""

AS_PID = gains(KP * (KV + 1 / T_V), KP * KV / T_V, KP, extra='derivative_on = "measurement"\n')

BOTH = cascade(position_integral_time="90 ms", velocity_integral_time="30 ms")

INTEGRAL_TIME = "controller.velocity_integral_time"


def rigid(controller: str, motion: str = "") -> Stage:
    return stage(motion or release("2 mm", "20 s"), friction=lugre(2), controller=controller)


def by_radau(machine: Stage, names: tuple[str, ...], times: np.ndarray, start: dict[str, float]) -> np.ndarray:
    """Positions [m] at times [s], by SciPy from equations written by hand."""
    right_hand_side = plain.rates(machine.flat(), names)
    begin = [start.get(name, 0.0) for name in names]
    run = solve_ivp(right_hand_side, (0.0, times[-1]), begin, "Radau", times, rtol=1e-8, atol=1e-12, max_step=5e-3)
    return run.y[names.index("position")]


def test_slow_gains_are_those_of_the_pid_that_it_is() -> None:
    assert slow_gains(rigid(PI).flat()) == pytest.approx(slow_gains(rigid(AS_PID).flat()))


@pytest.mark.slow
def test_trace_against_radau() -> None:
    """A move with feedforward, force limit and both integrals, friction and all."""
    more = "velocity_feedforward = 0.9\n" + limit("4 N")
    motion = there_and_back("0.6 s", "0.3 s", "2 m/s^2")
    ahead = {"acceleration_feedforward": "1.5 kg", "coulomb_feedforward": "1 N", "velocity_filter": "1 ms"}
    times = {"position_integral_time": "90 ms", "velocity_integral_time": "30 ms"}
    machine = rigid(cascade(**ahead, **times, extra=more), motion)
    run = friso.simulate(machine, 1e-9, 2e-3)
    names = (
        "position",
        "velocity",
        "bristle_deflection",
        "filtered_velocity",
        "position_integral",
        "velocity_integral",
    )
    by_hand = solve_in_pieces(machine, names, run["time"].values, (0.03, 0.06, 0.3, 0.33, 0.36))
    assert np.abs(run["position"].values - by_hand).max() < 2e-6 * np.abs(by_hand).max()
    assert np.any(run["force"].values >= 4 - 1e-9)


def solve_in_pieces(
    machine: Stage, names: tuple[str, ...], times: np.ndarray, corners: tuple[float, ...]
) -> np.ndarray:
    """Solve the equations as `solve` does, but start anew at every corner of the reference."""
    right_hand_side, x, positions = plain.rates(machine.flat(), names), np.zeros(len(names)), []
    ends = (0.0, *corners, times[-1])
    for start, end in pairwise(ends):
        wanted = times[(times >= start) & (times < end)]
        run = solve_ivp(
            right_hand_side, (start, end), x, "Radau", dense_output=True, rtol=1e-9, atol=1e-13, max_step=2e-3
        )
        positions.append(run.sol(wanted)[0])
        x = run.y[:, -1]
    return np.concatenate([*positions, [x[0]]])


@pytest.fixture(scope="module")
def hunting() -> Hunting:
    return hunting_of(rigid(PI))


@pytest.mark.slow
def test_hunting_is_that_of_the_pid_that_it_is(hunting: Hunting) -> None:
    (cycle,), (same,) = hunting.attracting, hunting_of(rigid(AS_PID)).attracting
    assert cycle.amplitude == pytest.approx(same.amplitude, rel=1e-5)
    assert cycle.period == pytest.approx(same.period, rel=1e-5)
    assert cycle.multiplier == pytest.approx(same.multiplier, rel=1e-3, abs=1e-4)
    assert cycle.growth == pytest.approx(cycle.multiplier, rel=1e-2, abs=1e-3)


@pytest.mark.thorough
def test_verdict_against_radau(hunting: Hunting) -> None:
    """Stuck at the cycle's amplitude without force, it comes back to it."""
    names = ("position", "velocity", "bristle_deflection", "velocity_integral")
    cycle = hunting.attracting[0]
    start = {"position": cycle.amplitude, "velocity_integral": KV * cycle.amplitude * T_V}
    times = np.linspace(0.0, 12 * cycle.period, 24001)
    last = by_radau(rigid(PI), names, times, start)[times > 10 * cycle.period]
    assert (last.max() - last.min()) / 2 == pytest.approx(cycle.amplitude, rel=1e-3)


@pytest.fixture(scope="module")
def two() -> Hunting:
    return hunting_of(rigid(BOTH))


@pytest.mark.thorough
def test_two_integrals_against_radau(two: Hunting) -> None:
    """The state that winds up is not one number any more: the cycle is one all the same, or there is none."""
    names = ("position", "velocity", "bristle_deflection", "position_integral", "velocity_integral")
    (cycle,) = two.attracting
    times = np.linspace(0.0, 16 * cycle.period, 32001)
    last = by_radau(rigid(BOTH), names, times, {"position": 2e-3})[times > 13 * cycle.period]
    assert (last.max() - last.min()) / 2 == pytest.approx(cycle.amplitude, rel=1e-3)


@pytest.mark.parametrize("proportional_on", ["error", "measurement"])
def test_loops_against_python_control(proportional_on: str) -> None:
    lag, kp, t_p = 1e-3, 300.0, 0.3
    keys = {"position_integral_time": "300 ms", "velocity_integral_time": "30 ms", "velocity_filter": "1 ms"}
    machine = rigid(cascade(kp="300 N*s/m", **keys, proportional_on=proportional_on))
    s = control.tf("s")
    outer, measured = KV * (1 + 1 / (t_p * s)), s / (1 + lag * s)
    inner = kp / (T_V * s)
    loop = (inner * (outer + measured) + kp * measured + (kp * outer if proportional_on == "error" else 0)) / (
        MASS * s**2 + 0.5 * s
    )
    ours = friso.linear(machine, "sliding", "open")
    omega = np.geomspace(0.1, 1e5, 200)
    moved = friso.linear(machine, "sliding")(1j * omega)[0, 0]
    slides = moved * (MASS * (1j * omega) ** 2 + 0.5j * omega)
    assert np.abs(slides - 1).max() < 2e-2  # friction at high speed is viscous, nearly
    theirs = loop(1j * omega) * slides
    assert ours(1j * omega) == pytest.approx(theirs, rel=1e-9)
    gain, phase = control.stability_margins(control.ss(ours))[:2]
    exact = margins(machine.flat(), limit_cases(machine.flat())["sliding"])
    assert exact.stable
    assert exact.phase_margin == pytest.approx(phase, rel=1e-5)
    assert exact.gain_reduction == pytest.approx(gain, rel=1e-4)


def test_feedforward_of_a_perfect_model_leaves_no_error() -> None:
    """The closed loop from the reference with its derivatives is 1: no error whatever the move, but for friction."""
    ahead = {"acceleration_feedforward": "1.7 kg", "viscous_feedforward": "0.5 N*s/m"}
    machine = rigid(cascade(velocity_integral_time="30 ms", **ahead, extra="velocity_feedforward = 1\n"))
    machine = machine.replace({"friction": None}).replace({"controller.viscous_feedforward": "0 N*s/m"})
    closed = friso.linear(machine, part="closed")
    assert [*closed.input_labels][-2:] == ["reference velocity", "reference acceleration"]
    s = 2j * np.pi * np.array([0.3, 3.0, 30.0])
    answers = closed(s)[closed.output_labels.index("stage")]
    r = [answers[closed.input_labels.index(name)] for name in ("reference", *closed.input_labels[-2:])]
    assert r[0] + s * r[1] + s**2 * r[2] == pytest.approx(1.0)


def difference_equations(flat: dict[str, Any], error: np.ndarray, reading: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """The forces of a drive: the filter by Tustin, both integrals summed up, clamped at the limit."""
    key = {name.removeprefix("controller."): value for name, value in flat.items()}
    t, lag = flat["drive.sample_time"], key["velocity_filter"]
    velocity, speed_before, before, outer, inner = 0.0, 0.0, reading[0], 0.0, 0.0
    forces = []
    for e, y, r_rate in zip(error, reading, speed, strict=True):
        velocity = ((2 * lag - t) * velocity + t * ((y - before) / t + speed_before)) / (2 * lag + t)
        speed_before, before = (y - before) / t, y

        def force(outer: float, inner: float, e: float = e, r: float = r_rate, v: float = velocity) -> float:
            wanted = key["kv"] * (e + outer / key["position_integral_time"]) + key["velocity_feedforward"] * r
            ahead = key["viscous_feedforward"] * r + key["coulomb_feedforward"] * np.sign(r)
            return key["kp"] * (wanted - v + inner / key["velocity_integral_time"]) + ahead

        def share(outer: float, e: float = e, r: float = r_rate, v: float = velocity) -> float:
            return t * (key["kv"] * (e + outer / key["position_integral_time"]) + key["velocity_feedforward"] * r - v)

        demand = force(outer + t * e, inner + share(outer + t * e))
        pressing = np.sign(demand) * (abs(demand) > key["force_limit"])
        outer += t * e * (pressing * e <= 0)
        inner += share(outer) * (pressing * share(outer) <= 0)
        forces.append(np.clip(force(outer, inner), -key["force_limit"], key["force_limit"]))
    return np.array(forces)


CLIP = {"clipped": lambda value, limit: min(max(value, -limit), limit)}


def test_sampled_blocks_are_the_difference_equations() -> None:
    ahead = {"viscous_feedforward": "0.5 N*s/m", "coulomb_feedforward": "1 N", "velocity_filter": "2 ms"}
    times = {"position_integral_time": "90 ms", "velocity_integral_time": "30 ms"}
    machine = rigid(cascade(**ahead, **times, extra="velocity_feedforward = 0.9\n" + limit("6 N")))
    flat = {**machine.flat(), "drive.sample_time": 1e-3}
    rng = np.random.default_rng(1)
    reading, reference = rng.normal(size=(2, 300)).cumsum(axis=1) * 2e-4
    speed = np.where(np.arange(300) % 50 < 10, 0.0, rng.normal(size=300) * 1e-2)
    forces = sampled_forces(flat, reference - reading, reading, speed)
    by_hand = difference_equations(flat, reference - reading, reading, speed)
    assert np.abs(forces - by_hand).max() < 1e-11
    assert np.abs(by_hand).max() == 6.0
    assert str(SAMPLE_TIME) in flat


def sampled_forces(flat: dict[str, Any], error: np.ndarray, reading: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """The force [N] of a sampled controller, sample by sample."""
    e, y, r = sp.symbols("e y r", real=True)
    way = sp.Piecewise((1, r > 0), (-1, r < 0), (0, True))
    force, held = sampled_controller(controller_form(flat), Loop(e, y, sp.S.Zero, r, sp.S.Zero, way), 1)
    parts = (force, *(number.update for number in held))
    keys = {symbol: flat[str(symbol)] for part in parts for symbol in part.free_symbols if str(symbol) in flat}
    arguments = [e, y, r, *keys, *(number.symbol for number in held)]
    step_once = sp.lambdify(arguments, parts, [CLIP, "math"], cse=True)
    passed = {state("position_before_1")}
    kept = [reading[0] if number.symbol in passed else 0.0 for number in held]
    forces = []
    for row in zip(error, reading, speed, strict=True):
        now, *kept = step_once(*row, *keys.values(), *kept)
        forces.append(now)
    return np.array(forces)


def test_settings_against_friction_that_never_act_change_nothing() -> None:
    """All settings are given at once, with conditions that depend on each other, in both integrals."""
    idle = """
        integral_limit = "1 MN"
        integral_deadband = "1e-9 nm"
        integral_deadband_exit = "2e-9 nm"
        error_deadband = "1e-9 nm"
        standstill_window = "1e-9 nm"
        standstill_factor = 0.5
        stiction_push = "1 N"
        stiction_push_window = "1 m"
    """
    times = {"position_integral_time": "90 ms", "velocity_integral_time": "30 ms"}
    rng = np.random.default_rng(4)
    error, reading = rng.normal(size=(2, 200)).cumsum(axis=1) * 2e-4
    speed = np.where(np.arange(200) % 50 < 10, 0.0, rng.normal(size=200) * 1e-2)
    machines = (rigid(cascade(**times, extra=limit("6 N") + extra)) for extra in ("", idle))
    without, with_all = (
        sampled_forces({**machine.flat(), "drive.sample_time": 1e-3}, error, reading, speed) for machine in machines
    )
    assert np.abs(with_all - without).max() < 1e-9
    assert np.abs(without).max() == 6.0


def test_loops_at_their_own_rates() -> None:
    """The position loop at every fourth sample, the velocity loop at every second."""
    times = {"position_integral_time": "90 ms", "velocity_integral_time": "30 ms", "velocity_filter": "2 ms"}
    machine = rigid(cascade(**times)).replace(
        {"drive": {"sample_time": "250 us", "velocity_sample_time": "500 us", "position_sample_time": "1 ms"}}
    )
    flat, count = machine.flat(), 400
    reading, reference = np.random.default_rng(3).normal(size=(2, count)).cumsum(axis=1) * 2e-4
    forces, speed, before, outer, inner, command, velocity = [], 0.0, reading[0], 0.0, 0.0, 0.0, 0.0
    for k, (y, e) in enumerate(zip(reading, reference - reading, strict=True)):
        if k % 4 == 0:
            outer += 1e-3 * e
            command = KV * (e + outer / 0.09)
        if k % 2 == 0:
            velocity = ((4e-3 - 5e-4) * velocity + 5e-4 * ((y - before) / 5e-4 + speed)) / (4e-3 + 5e-4)
            speed, before = (y - before) / 5e-4, y
            inner += 5e-4 * (command - velocity)
            wanted = command
        forces.append(KP * (wanted - velocity + inner / 0.03))
    assert commanded(flat, reference - reading, reading) == pytest.approx(np.array(forces), rel=1e-9, abs=1e-9)


def commanded(flat: dict[str, Any], errors: np.ndarray, reading: np.ndarray) -> np.ndarray:
    """Forces of a drive, the reference at rest, that begins at its first reading."""
    return sampled_forces(flat, errors, reading, 0 * errors)


# what the house asks of any controller


def test_it_is_written_read_and_made_faster() -> None:
    machine = rigid(BOTH)
    assert friso.loads(machine.to_toml()) == machine
    quicker = faster(machine.flat(), 2.0)
    assert quicker["controller.kv"] == 120.0
    assert quicker["controller.kp"] == 100.0
    assert quicker[INTEGRAL_TIME] == 0.015
    assert rigid(cascade(kv="1 (m/min)/mm")).flat()["controller.kv"] == pytest.approx(1000 / 60)


@pytest.mark.thorough
def test_boundary_and_map_agree_on_where_hunting_ends() -> None:
    """The key is the integral time of the velocity loop."""
    machine = rigid(PI)
    traced = friso.boundary(machine, {INTEGRAL_TIME: "20 ms..200 ms"})
    ends = np.array([traced.value(point.point.place) for points in traced.special for point in points])
    beside = np.outer(ends, [0.97, 1.03])
    runs = sweep(machine, {INTEGRAL_TIME: (np.sort(beside.ravel()), "s")}, metrics=["multiplier"])
    attracts = np.abs(runs["multiplier"].sel({INTEGRAL_TIME: beside.ravel()}).values.reshape(beside.shape)) < 1
    assert np.any(attracts[:, 0] != attracts[:, 1])


DRIVE = Path(__file__).parents[1] / "examples" / "thesis_drive.toml"


@pytest.fixture(scope="module")
def whole() -> Stage:
    coarse = {"drive.sample_time": "250 us", "drive.delay": "250 us"}
    keys = {
        "kind": "cascade",
        "kv": "60 1/s",
        "kp": "50 N*s/m",
        "velocity_integral_time": "30 ms",
        "force_limit": "200 N",
    }
    return friso.load(DRIVE).replace({**coarse, "controller": keys})


@pytest.mark.slow
def test_bode_with_sampling_and_delay(whole: Stage) -> None:
    slow = friso.bode(whole.replace({"drive.delay": None, "drive.sample_time": None}))
    fast = friso.bode(whole)
    assert fast.limits["free"].highest_stable < slow.limits["free"].highest_stable


@pytest.mark.thorough
def test_identify_in_its_own_loop(whole: Stage) -> None:
    """A log that its own sampled loop wrote gives mass and friction back."""
    plain_axis = {"joint": None, "parasitic": None, "rail": None, "cable": None, "drive": {"sample_time": "1 ms"}}
    one = whole.replace(plain_axis)
    flat, time = one.flat(), np.arange(2000) * 1e-3
    reference = 0.02 * (1 - np.cos(2 * np.pi * time))
    blank = record("given", 1e-3, reference=reference, position=0 * reference, force=0 * reference)
    truth = loop_problem(flat, blank, blank.segments[0], ()).record(np.zeros(0))
    log = record("moves", 1e-3, reference=reference, position=truth.position, force=truth.force)
    estimates = {estimate.name: estimate.value for estimate in identify_moves(log, flat, own_loop=True).estimates}
    assert sum(estimates[key] for key in flat if key.startswith("masses.")) == pytest.approx(1.7, rel=0.01)
    assert estimates["friction.coulomb"] == pytest.approx(1.0, rel=0.05)


@pytest.mark.slow
def test_emps_is_a_cascade(tmp_path: Path) -> None:
    """From its record the cascade predicts the same forces as the PD of equal gains, also sampled."""
    axis = friso.load(DRIVE.with_name("emps_axis.toml")).replace(
        {"drive.sample_time": "1 ms", "drive.velocity_samples": 2.0}
    )
    pd = gains(0, extra='derivative_on = "measurement"\nforce_limit = "351.507 N"\n')
    flat = axis.flat()
    stiffness, damping = flat["controller.kv"] * flat["controller.kp"], flat["controller.kp"]
    table = tomllib.loads(pd) | {"kp": f"{stiffness!r} N/m", "kd": f"{damping!r} N*s/m"}
    log = emps_log(tmp_path)
    part = slice(log.segments[0].start, log.segments[0].start + 4000)
    errors = [
        loop_problem(machine.flat(), log, part, ()).residuals(np.zeros((1, 0)))[0]
        for machine in (axis, axis.replace({"controller": table}))
    ]
    assert np.sqrt(np.mean(errors[0] ** 2)) > 1.0  # newtons: the model is not perfect
    assert np.abs(errors[0] - errors[1]).max() < 1e-6


def test_steps_rest_where_there_is_no_integral() -> None:
    assert friso.check(rigid(cascade(), step("1 mm", "3 s")))["given"].verdict == "settles"
