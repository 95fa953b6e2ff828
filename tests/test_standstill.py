"""What is said of hunting with settings against friction (dead band, leak, limits), beside any controller."""

from math import pi
from typing import Any

import numpy as np
import pytest
from variants import gains, lugre, release, stage, there_and_back, van_dijk

import friso
from friso.equations import motion
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
