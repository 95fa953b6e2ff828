"""Settings against friction (dead band, leak, limits), beside any controller.

They are compared with a model written by hand and with a real drive; the statements on hunting with them are tested.
"""

from math import exp, pi, sin
from typing import Any

import numpy as np
import pytest
from variants import gains, limit, lugre, release, stage, there_and_back, van_dijk

import friso
from friso.equations import motion
from friso.equations.blocks import Loop
from friso.equations.sampled import sampled_controller
from friso.equations.structure import controller_form
from friso.errors import InputError
from friso.frequency.loops import compensator
from friso.hunting import DITHERS, Ensemble, HuntingDoubt, stuck, wait
from friso.hunting import hunting as hunting_of
from friso.stage import Stage
from friso.virtual_rig.run import run
from friso.virtual_rig.task import MoveTask

KP, KI, KD, MASS = 2000.0, 20000.0, 50.0, 1.7

SETTINGS: dict[str, dict[str, Any]] = {
    "limit": {"integral_limit": "1.2 N"},
    "leak": {"integral_leak": "1 Hz"},
    "deadband": {"integral_deadband": "200 um"},
    "hysteresis": {"integral_deadband": "100 um", "integral_deadband_exit": "600 um"},
    "reset": {"integral_reset": True},
    "dead zone": {"error_deadband": "80 um"},
    "standstill": {"standstill_window": "300 um", "standstill_factor": 0.4},
    "push": {"stiction_push": "0.7 N", "stiction_push_window": "150 um"},
    "dither": {"dither_amplitude": "1.5 N", "dither_frequency": "30 Hz"},
}


def machine(settings: dict[str, Any], extra: str = "", duration: str = "0.4 s") -> Stage:
    controller = gains(KP, KI, KD, extra='derivative_on = "measurement"\n' + extra)
    plain = stage(release("2 mm", duration), friction=lugre(2), controller=controller)
    return plain.replace({f"controller.{key}": value for key, value in settings.items()})


def by_hand(flat: dict[str, Any], times: np.ndarray, step: float) -> np.ndarray:
    """Positions [m] at times [s], in steps of fixed length; modes that remember change between steps."""
    key = {name.removeprefix("controller."): value for name, value in flat.items() if name.startswith("controller.")}
    limit_, leak = key.get("integral_limit", np.inf), 2 * pi * key.get("integral_leak", 0.0)
    near, far = key.get("integral_deadband", 0.0), key.get("integral_deadband_exit", key.get("integral_deadband", 0.0))
    window, factor = key.get("standstill_window", 0.0), key.get("standstill_factor", 1.0)
    push, reach = key.get("stiction_push", 0.0), key.get("stiction_push_window", 0.0)
    amplitude, frequency = key.get("dither_amplitude", 0.0), key.get("dither_frequency", 0.0)
    bound, dead = key.get("force_limit", np.inf), key.get("error_deadband", 0.0)

    def rates(t: float, y: float, v: float, z: float, x: float, pauses: bool) -> tuple[float, float, float, float]:
        e = -y
        share = factor if abs(e) < window else 1.0
        acting = max(abs(e) - dead, 0.0) * (1 if e > 0 else -1)
        demand = share * (KP * acting - KD * v) + KI * x + push * (float(e > reach) - float(e < -reach))
        demand += amplitude * sin(2 * pi * frequency * t)
        force = min(max(demand, -bound), bound)
        level = 1.0 + 2.0 * exp(-((v / 1.6e-3) ** 2))
        z_rate = v - 1e5 * abs(v) / level * z
        drag = 1e5 * z + 316.2277660168379 * z_rate + 0.5 * v
        winds = share * acting * (not pauses)
        winds *= not (abs(KI * x) > limit_ and x * e > 0)
        winds *= not (abs(demand) > bound and demand * e > 0)
        return v, (force - drag) / MASS, z_rate, winds - leak * x

    state, t, positions = (2e-3, 0.0, 0.0, 0.0), 0.0, [2e-3]
    pauses = near > 2e-3
    for now in times.tolist()[1:]:
        count = max(1, round((now - t) / step))
        h = (now - t) / count
        for _ in range(count):
            k1 = rates(t, *state, pauses)
            k2 = rates(t + h / 2, *(a + h / 2 * k for a, k in zip(state, k1, strict=True)), pauses)
            k3 = rates(t + h / 2, *(a + h / 2 * k for a, k in zip(state, k2, strict=True)), pauses)
            k4 = rates(t + h, *(a + h * k for a, k in zip(state, k3, strict=True)), pauses)
            slopes = (sum(weight * k for weight, k in zip((1, 2, 2, 1), ks, strict=True)) / 6
                      for ks in zip(k1, k2, k3, k4, strict=True))  # fmt: skip
            before = state[0]
            state, t = tuple(a + h * slope for a, slope in zip(state, slopes, strict=True)), t + h  # type: ignore[assignment]
            pauses = abs(state[0]) < (far if pauses else near)
            if key.get("integral_reset") and before * state[0] < 0:
                state = (*state[:3], 0.0)
        positions.append(state[0])
    return np.array(positions)


@pytest.mark.cases(slow=4)
@pytest.mark.parametrize("name", [*SETTINGS, "all"])
def test_a_trace_against_a_model_by_hand(name: str) -> None:
    settings = {key: value for part in SETTINGS.values() for key, value in part.items()}
    chosen = machine(settings, limit("3.5 N")) if name == "all" else machine(SETTINGS[name])
    run = friso.simulate(chosen, 1e-8, 2e-3)
    plain = friso.simulate(machine({}, limit("3.5 N") if name == "all" else ""), 1e-8, 2e-3)
    assert run.attrs["status"] == plain.attrs["status"]
    ours, theirs = run["position"].values, by_hand(chosen.flat(), run["time"].values, 2e-5)
    assert np.abs(ours - theirs).max() < 1e-6
    assert np.abs(ours - plain["position"].values).max() > 5e-6, "the setting makes no difference"


def test_a_drive_carries_them_out_alike() -> None:
    """The drive's commands at its samples agree with the continuous controller in a slow motion.

    In that motion neither the reset nor the hysteresis differ by a sample.
    """
    import sympy as sp

    chosen = machine({key: value for part in SETTINGS.values() for key, value in part.items()}, limit("3.5 N"))
    flat, t = {**chosen.flat(), "drive.sample_time": 1e-4}, 1e-4
    e, y = sp.symbols("e y", real=True)
    force, held = sampled_controller(controller_form(flat), Loop(e, y, sp.S.Zero, sp.S.Zero), 1)
    parts = (force, *(number.update for number in held))
    keys = {symbol: flat[str(symbol)] for part in parts for symbol in part.free_symbols if str(symbol) in flat}
    modules = [
        {
            "clipped": lambda value, end: min(max(value, -end), end),
            "sine": lambda turn: sin(2 * pi * turn),
        },
        "math",
    ]
    once = sp.lambdify([e, y, *keys, *(number.symbol for number in held)], parts, modules)
    times = np.arange(3000) * t
    errors = 2e-3 * np.cos(2 * np.pi * 5 * times)
    kept = [(-errors[0] if "position" in str(number.symbol) else errors[0]) if "before" in str(number.symbol) else 0.0
            for number in held]  # fmt: skip
    x, pauses, before, forces, ours = 0.0, False, errors[0], [], []
    for k, error in enumerate(errors):
        now, *kept = once(error, -error, *keys.values(), *kept)
        ours.append(now)
        speed = (error - (errors[k - 1] if k else error)) / t
        share = 0.4 if abs(error) < 300e-6 else 1.0
        pauses = abs(error) < (600e-6 if pauses else 100e-6) if k else abs(error) < 100e-6
        acting = error - min(max(error, -80e-6), 80e-6)
        added = t * share * acting

        def demand(
            x: float,
            share: float = share,
            error: float = error,
            acting: float = acting,
            speed: float = speed,
            k: int = k,
        ) -> float:
            push = 0.7 * (float(error > 150e-6) - float(error < -150e-6))
            return share * (KP * acting + KD * speed) + KI * x + push + 1.5 * sin(2 * pi * 30 * k * t)

        full = x + added
        winding = (demand(full) > 3.5 and added > 0) or (demand(full) < -3.5 and added < 0)
        winding |= (KI * full > 1.2 and added > 0) or (KI * full < -1.2 and added < 0)
        if before * error < 0:
            x = added
        elif not (pauses or winding):
            x = full
        x /= 1 + 2 * pi * 1.0 * t
        before = error
        forces.append(min(max(demand(x), -3.5), 3.5))
    assert np.abs(np.array(ours) - np.array(forces)).max() < 1e-9
    assert len({*np.round(forces, 3)}) > 500


def test_a_dead_zone_before_a_filter_runs_on_a_machine_as_built() -> None:
    """If the drive samples fast, it runs as in continuous time: the filter passes the error outside the dead zone."""
    move = there_and_back("0.4 s", "0.3 s").replace("100 m/s^2", "1 m/s^2").replace("30 ms", "50 ms")
    chosen = stage(move, friction=lugre(2), controller=van_dijk("8 Hz", 'error_deadband = "80 um"'))
    ideal = friso.simulate(chosen, 1e-8, 1e-3)["position"].values[:-1]
    task = MoveTask(motion.pieces(chosen.flat(), 1)[0], 0.4)
    (recorded,) = run(chosen.replace({"drive.sample_time": "20 us"}), task, [1], 1e-3)
    assert np.abs(recorded.true["position"][0][: len(ideal)] - ideal).max() < 1e-5
    without = friso.simulate(chosen.replace({"controller.error_deadband": "0.01 um"}), 1e-8, 1e-3)["position"].values
    assert np.abs(without[:-1] - ideal).max() > 5e-5


@pytest.mark.cases(first=2)
@pytest.mark.parametrize(
    "name", ["leak", "hysteresis", "push", "standstill", "wide deadband", "dead zone", "wide dead zone"]
)
def test_what_is_said_of_hunting_is_what_a_long_run_does(name: str) -> None:
    settings = {"hysteresis": {"integral_deadband": "2 um", "integral_deadband_exit": "6 um"},
                "leak": {"integral_leak": "10 mHz"},
                "wide deadband": {"integral_deadband": "2 mm"},
                "dead zone": {"error_deadband": "2 um"},
                "wide dead zone": {"error_deadband": "1.5 mm"},
                "standstill": {"standstill_window": "20 um", "standstill_factor": 0.5},
                "push": {"stiction_push": "0.3 N", "stiction_push_window": "20 um"}}[name]  # fmt: skip
    chosen = machine(settings, duration="40 s")
    hunting = hunting_of(chosen)
    run = friso.simulate(chosen, 1e-8, 1e-3)["position"]
    last = run.sel(time=slice(30, 40)).values
    swing = (last.max() - last.min()) / 2
    if name.startswith("wide"):
        assert swing < 1e-7
        assert (hunting.attracting, hunting.observed, hunting.certain) == ((), (), True)
        return
    sizes = [cycle.amplitude for cycle in hunting.attracting] + [swung.amplitude for swung in hunting.observed]
    assert min(abs(size / swing - 1) for size in sizes) < 5e-3


def test_an_integral_that_leaks_is_waited_for_until_it_changes_no_more() -> None:
    """At its initial rate the integral would take 60 000 s to reach the break-away force."""
    stages = Ensemble.held(machine(SETTINGS["leak"]).flat(), 1)
    begun = stuck(stages, 1e-6 * stages.length)
    waited = wait(stages, 1e-6 * stages.length)
    after, long_after = (stages.run(begun, times * waited, 1e-9).ends[0, stages.integral] for times in (1, 4))
    assert waited < 2.0
    assert after != begun[0, stages.integral]
    assert after == pytest.approx(long_after, rel=1e-3)


def test_nothing_is_sure_beyond_a_wide_dead_zone() -> None:
    """The break-away force deflects the loop by 1.5 mm; most starts are nearer than 3.5 mm to the reference."""
    wide = hunting_of(machine({"error_deadband": "3.5 mm"}))
    assert (wide.attracting, wide.observed, wide.certain) == ((), (), False)
    assert wide.reason == HuntingDoubt.BEYOND


@pytest.mark.parametrize("name", [name for name in SETTINGS if name != "leak"])
def test_small_motions_away_from_rest_know_none_of_them(name: str) -> None:
    """Bode plots are of the controller without them, but for a leak."""
    s = 2j * pi * np.array([0.1, 3.0, 200.0])
    seen, plain = (compensator(machine(settings).flat(), 1).at(s) for settings in (SETTINGS[name], {}))
    assert seen == pytest.approx(plain, rel=1e-12)


def test_dither_leaves_the_answer_to_runs() -> None:
    chosen = machine(SETTINGS["dither"], duration="2 s")
    hunting = hunting_of(chosen)
    assert (hunting.cycles, hunting.certain, hunting.reason) == ((), False, DITHERS)
    with pytest.raises(InputError, match="dither"):
        friso.boundary(chosen, {"controller.ki": "1e4 N/(m*s)..3e4 N/(m*s)"})
