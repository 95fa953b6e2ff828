"""Settings against friction, windows with an exit, a time to stay or a memory among them, beside equations by hand.

They are compared in continuous time and as a drive samples; what is said of hunting is compared with long runs.
"""

from typing import Any

import numpy as np
import pytest
from variants import gains, lugre, release, stage, there_and_back

import friso
from benchmarks.by_hand import trace
from friso.equations import motion
from friso.equations.settings import gain_states
from friso.hunting import HuntingDoubt
from friso.hunting import hunting as hunting_of
from friso.stage import Stage
from friso.virtual_rig.run import run
from friso.virtual_rig.task import MoveTask

WINDOWS: dict[str, dict[str, Any]] = {
    "gain in the deadband": {"error_deadband": "300 um", "error_deadband_gain": 0.3},
    "deadband with exit": {"error_deadband": "150 um", "error_deadband_exit": "400 um"},
    "deadband with time": {"error_deadband": "400 um", "error_deadband_time": "10 ms", "error_deadband_gain": 0.1},
    "pause with time": {"integral_deadband": "300 um", "integral_deadband_time": "4 ms"},
    "decay": {"integral_deadband": "300 um", "integral_deadband_exit": "500 um", "integral_deadband_decay": "50 ms"},
    "inner gains": {
        **{"standstill_window": "300 um", "standstill_window_exit": "500 um", "standstill_window_time": "5 ms"},
        **{"standstill_factor": 0.5, "standstill_integral_factor": 2.0},
    },
    "freeze": {"freeze_window": "300 um"},
    "freeze with all": {"freeze_window": "400 um", "freeze_window_exit": "900 um", "freeze_window_time": "2 ms"},
    "no integral in moves": {"integral_rests_in_moves": True},
    "schedule over the error": {"schedule_error": ["0 um", "200 um", "600 um"], "schedule_factor": [0.3, 0.5, 1.2]},
    "schedule over the speed": {"schedule_speed": ["2 mm/s", "10 mm/s"], "schedule_factor": [1, 0.5]},
    "gains in moves": {"moving_factor": 0.6},
    "at rest": {"standstill_window": "800 um", "standstill_factor": 0.4, "windows_at_rest": True},
    "dead zone": {"error_deadband": "80 um"},
    "hysteresis": {"integral_deadband": "100 um", "integral_deadband_exit": "600 um"},
    "limit": {"integral_limit": "1.2 N"},
    "leak": {"integral_leak": "1 Hz"},
    "reset": {"integral_reset": True},
    "push": {"stiction_push": "0.7 N", "stiction_push_window": "150 um"},
    "dither": {"dither_amplitude": "1.5 N", "dither_frequency": "30 Hz"},
    "force limit": {"force_limit": "2.5 N", "anti_windup": "clamp"},
    "nearly all": {
        **{"integral_limit": "1.2 N", "integral_leak": "1 Hz", "integral_reset": True, "error_deadband": "80 um"},
        **{"integral_deadband": "100 um", "integral_deadband_exit": "600 um"},
        **{"standstill_window": "300 um", "standstill_factor": 0.4},
        **{"stiction_push": "0.7 N", "stiction_push_window": "150 um"},
        **{"force_limit": "2.5 N", "anti_windup": "clamp"},
    },
}

MOVE = there_and_back("0.5 s", "0.25 s", "2 m/s^2")
MOTIONS = {"move": MOVE, "release": release("2 mm", "0.4 s")}


def machine(settings: dict[str, Any], how: str = MOVE) -> Stage:
    plain = stage(
        how, friction=lugre(2), controller=gains(2000.0, 20000.0, 50.0, extra='derivative_on = "measurement"')
    )
    return plain.replace({f"controller.{key}": value for key, value in settings.items()})


@pytest.mark.cases(first=14)
@pytest.mark.parametrize(
    ("name", "how"), [(name, how) for name in WINDOWS for how in MOTIONS if (name, how) != ("dither", "move")]
)
def test_a_trace_against_equations_by_hand(name: str, how: str) -> None:
    chosen, flat = machine(WINDOWS[name], MOTIONS[how]), machine(WINDOWS[name], MOTIONS[how]).flat()
    ours = friso.simulate(chosen, 1e-8, 1e-3)
    start = np.array([flat.get("motion.displacement", 0.0), 0.0, 0.0, 0.0])
    theirs = trace(flat, start, ours["time"].values, 5e-6)
    assert np.abs(ours["position"].values - theirs).max() < 2e-6


@pytest.mark.cases(first=7)
@pytest.mark.parametrize("name", WINDOWS)
def test_each_window_makes_a_difference(name: str) -> None:
    settled, plain = (
        friso.simulate(machine(settings), 1e-6, 1e-3)["position"].values for settings in (WINDOWS[name], {})
    )
    assert np.abs(settled - plain).max() > 2e-5


@pytest.mark.cases(first=4)
@pytest.mark.parametrize("name", WINDOWS)
def test_a_drive_against_difference_equations_by_hand(name: str) -> None:
    sample = 5e-4
    chosen = machine({**WINDOWS[name]}).replace({"drive.sample_time": "0.5 ms"})
    flat = chosen.flat()
    (recorded,) = run(chosen, MoveTask(motion.pieces(flat, 1)[0], 0.5), [1], 1e-3)
    ours = recorded.true["position"][0]
    theirs = trace(flat, np.zeros(4), np.arange(len(ours)) * 1e-3, 5e-6, sample)
    assert np.abs(ours - theirs).max() < 2e-6


IN_LOOP: dict[str, dict[str, Any]] = {
    "freeze": {"freeze_window": "150 um", "freeze_window_exit": "300 um", "freeze_window_time": "8 ms"},
    "inner gains": {
        **{"standstill_window": "600 um", "standstill_factor": 0.4, "standstill_integral_factor": 3.0},
        "windows_at_rest": True,
    },
    "pause": {"integral_deadband": "400 um", "integral_deadband_decay": "30 ms"},
}


def cascade(settings: dict[str, Any], **drive: Any) -> Stage:
    """A machine under a cascade with integrals in both loops."""
    controller = """
kind = "cascade"
kv = "25 1/s"
position_integral_time = "0.2 s"
kp = "60 N*s/m"
velocity_integral_time = "30 ms"
"""
    plain = stage(MOVE, friction=lugre(2), controller=controller)
    keys = {f"controller.{key}": value for key, value in settings.items()}
    return plain.replace(keys | {f"drive.{name}": value for name, value in drive.items()})


def cascade_by_hand(flat: dict[str, Any], times: np.ndarray, step: float, sample: float = 0.0) -> np.ndarray:
    """Return positions [m] at times [s], where windows act on the position loop; 0 for `sample` is continuous time."""
    key = {name.removeprefix("controller."): value for name, value in flat.items() if name.startswith("controller.")}
    kv, kp, outer, inner = (key[name] for name in ("kv", "kp", "position_integral_time", "velocity_integral_time"))
    period = flat["drive.position_sample_time"] if sample else step
    freeze, leave, stay = (key.get(f"freeze_window{end}", 0.0) for end in ("", "_exit", "_time"))
    reach, pause = key.get("standstill_window", 0.0), key.get("integral_deadband", 0.0)
    lost = 1 / key["integral_deadband_decay"] if pause else 0.0
    static, coulomb, slow, viscous = (
        flat[f"friction.{name}"] for name in ("static", "coulomb", "stribeck_velocity", "viscous")
    )
    stiffness, damping = flat["friction.bristle_stiffness"], flat["friction.bristle_damping"]
    mass = sum(flat.get(f"masses.{name}", 0.0) for name in ("cart", "stage"))
    x = v = z = p = w = force = command = before = now = clock = 0.0
    frozen, ticks, out, pieces = False, 0, [0.0], motion.pieces(flat, 1)[0]

    def reference(t: float) -> tuple[float, bool]:
        begun, r, speed, acceleration = pieces[np.searchsorted(pieces[:, 0], t + 1e-12) - 1][:4]
        return r + speed * (t - begun) + acceleration / 2 * (t - begun) ** 2, speed == 0 == acceleration

    def commanded(t: float, x: float, p: float) -> tuple[float, float]:
        """Return the command of the position loop, and what its integral takes in."""
        r, rests = reference(t)
        near = abs(r - x) < reach and rests
        gain, own = (key["standstill_factor"], key["standstill_integral_factor"]) if near else (1.0, 1.0)
        takes = 0.0 if abs(r - x) < pause or frozen else own * (r - x)
        return (0.0 if frozen else kv * (gain * (r - x) + p / outer)), takes

    def rates(t: float, x: float, v: float, z: float, p: float, w: float) -> np.ndarray:
        wanted, takes = (command, 0.0) if sample else commanded(t, x, p)
        acts = force if sample else kp * (wanted - v + w / inner)
        bends = v - stiffness * abs(v) / (coulomb + (static - coulomb) * np.exp(-((v / slow) ** 2))) * z
        drag = stiffness * z + damping * bends + viscous * v
        decay = lost * p if abs(reference(t)[0] - x) < pause and not sample else 0.0
        return np.array([v, (acts - drag) / mass, bends, takes - decay, 0.0 if sample else wanted - v])

    def window(t: float, dt: float) -> None:
        nonlocal frozen, clock
        r, rests = reference(t)
        near = abs(r - x) < freeze and rests
        frozen = (abs(r - x) <= leave and rests) if frozen else near and clock >= stay - 0.5 * dt
        clock = clock + dt if near else 0.0

    for end in times[1:].tolist():
        while now < end - 1e-12:
            if sample and now > (ticks - 1e-9) * sample:
                if ticks % round(period / sample) == 0:
                    window(now, period)
                    p += period * commanded(now, x, p)[1]
                    p /= 1 + lost * period * (abs(reference(now)[0] - x) < pause)
                    p = 0.0 if frozen else p
                    command = commanded(now, x, p)[0]
                speed, before = (x - before) / sample, x
                w += sample * (command - speed)
                force = kp * (command - speed + w / inner)
                ticks += 1
            h = min(step, end - now, ticks * sample - now if sample else step)
            state = np.array([x, v, z, p, w])
            k1 = rates(now, *state)
            k2 = rates(now + h / 2, *(state + h / 2 * k1))
            k3 = rates(now + h / 2, *(state + h / 2 * k2))
            k4 = rates(now + h - 1e-11, *(state + h * k3))
            x, v, z, p, w = (state + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)).tolist()
            now += h
            if not sample:
                froze = frozen
                window(now, h)
                p = p if frozen == froze else 0.0
        out.append(x)
    return np.array(out)


@pytest.mark.parametrize("sampled", [False, True], ids=["continuous", "drive"])
@pytest.mark.parametrize("name", IN_LOOP)
def test_windows_in_the_position_loop_leave_the_velocity_loop_alone(name: str, sampled: bool) -> None:
    settings = {**IN_LOOP[name], "windows_in_position_loop": True}
    chosen, everywhere = cascade(settings), cascade(IN_LOOP[name])
    if sampled:
        chosen = cascade(settings, sample_time="0.5 ms", position_sample_time="2 ms")
    flat = chosen.flat()
    if sampled:
        (recorded,) = run(chosen, MoveTask(motion.pieces(flat, 1)[0], 0.5), [1], 1e-3)
        ours = recorded.true["position"][0]
        theirs = cascade_by_hand(flat, np.arange(len(ours)) * 1e-3, 2e-5, flat["drive.sample_time"])
    else:
        simulated = friso.simulate(chosen, 1e-8, 1e-3)
        ours = simulated["position"].values
        theirs = cascade_by_hand(flat, simulated["time"].values, 2e-5)
        assert np.abs(ours - friso.simulate(everywhere, 1e-8, 1e-3)["position"].values).max() > 2e-5
    assert np.abs(ours - theirs).max() < 2e-6


def test_margins_are_of_the_gains_of_the_position_loop() -> None:
    states = gain_states(cascade({**IN_LOOP["inner gains"], "windows_in_position_loop": True}).flat())
    assert [(one["controller.kv"], one["controller.kp"]) for one in states] == [(25.0, 60.0), (10.0, 60.0)]
    times = [one["controller.position_integral_time"] for one in states]
    assert times == pytest.approx([0.2, 0.2 * 0.4 / 3.0])
    assert {one["controller.velocity_integral_time"] for one in states} == {0.03}


def test_margins_are_of_every_set_of_gains() -> None:
    settings = {**WINDOWS["inner gains"], **WINDOWS["schedule over the error"], "moving_factor": 0.5}
    states = gain_states(machine(settings).flat())
    assert [state["controller.kp"] / 2000.0 for state in states] == pytest.approx(
        [1.2, 0.6, 0.25, 0.15, 0.5, 0.3, 0.15]
    )
    assert states[-1]["controller.ki"] == pytest.approx(20000.0 * 0.3 * 2.0)
    assert not any("schedule" in key for state in states for key in state)


@pytest.mark.slow
def test_cycles_are_as_stable_as_runs_beside_them_show() -> None:
    """Deviations are carried through the switches: multipliers of orbits against the growth in runs."""
    for name in ("deadband with time", "inner gains", "schedule over the error"):
        cycle = hunting_of(machine(WINDOWS[name], release("2 mm", "40 s"))).cycles[0]
        assert cycle.multiplier == pytest.approx(cycle.growth, abs=2e-3)


def test_without_an_integral_a_switched_force_leaves_the_answer_open() -> None:
    """A dead zone that is left later than it is entered takes force away where it would brake."""
    plain = machine({"error_deadband": "100 um"}).replace({"controller.ki": "0 N/(m*s)"})
    switched = plain.replace({"controller.error_deadband_exit": "300 um"})
    assert hunting_of(plain).certain
    assert (hunting_of(switched).certain, hunting_of(switched).reason) == (False, HuntingDoubt.SWITCHES)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["deadband with exit", "freeze", "inner gains", "decay"])
def test_what_is_said_of_hunting_is_what_a_long_run_by_hand_does(name: str) -> None:
    chosen = machine(WINDOWS[name], release("2 mm", "40 s"))
    said = hunting_of(chosen)
    times = np.append(0.0, np.arange(30.0, 40.0, 2e-3))
    late = trace(chosen.flat(), np.array([2e-3, 0.0, 0.0, 0.0]), times, 2e-5)[1:]
    swing = np.ptp(late) / 2
    sizes = [one.amplitude for one in (*said.attracting, *said.observed)]
    assert said.certain
    assert min(abs(size / swing - 1) for size in sizes) < 5e-3 if sizes else swing < 1e-7
