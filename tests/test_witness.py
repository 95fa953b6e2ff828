"""The given controller as a witness: replayed on a log it tells clock, units, signs, gains and feedforward."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from friso.errors import InputError
from friso.identification.logs.assemble import read_log
from friso.identification.logs.log import Log
from friso.identification.witness import Witness, doubt_of, replayed, witnessed
from friso.stage import Stage

STEP = 1e-3

KP, KI, KD = 9e3, 7e4, 260.0

STAGE = Stage(
    masses={"cart": "4.2 kg"},
    controller={
        "kind": "pid",
        "kp": f"{KP} N/m",
        "ki": f"{KI} N/(m*s)",
        "kd": f"{KD} N*s/m",
        "derivative_on": "measurement",
    },
    motion={"kind": "step", "size": "1 mm", "duration": "5 s"},
)


def recorded(limit: float = np.inf, filtered: float = 0.0, move: float = 0.2) -> Log:
    """An axis of 4.2 kg with Coulomb friction of 5 N, moved there and back, its controller sampled at 1 kHz.

    Own equations, steps of 50 us, and a spring that yields at 5 N for friction; independent of friso. The derivative is
    `filtered` by a time constant [s].
    """
    time = np.arange(0.0, 6.0, STEP)
    phase = np.clip((time % 1.5) / move, 0, 1)
    there = phase**3 * (10 - 15 * phase + 6 * phase**2)
    reference = 0.02 * np.where((time // 1.5) % 2 == 0, there, 1 - there)
    position, force = np.zeros((2, len(time)))
    x = v = z = integral = before = rate = 0.0
    for k, wanted in enumerate(reference):
        integral += KI * (wanted - x) * STEP
        rate += ((x - before) / STEP - rate) * STEP / (filtered + STEP)
        command = KP * (wanted - x) + integral - KD * rate
        u = float(np.clip(command, -limit, limit))
        if u != command:
            integral -= KI * (wanted - x) * STEP
        before, position[k], force[k] = x, x, u
        for _ in range(20):
            z = float(np.clip(z + v * STEP / 20, -1e-5, 1e-5))
            v += (u - 5e5 * z - 14 * v) / 4.2 * STEP / 20
            x += v * STEP / 20
    signals = {"reference": reference, "position": position, "force": force}
    return Log("axis", time, STEP, signals, (slice(0, len(time)),))


LOG = recorded()
ACCELERATION = np.gradient(np.gradient(LOG["reference"], STEP), STEP)


def changed(**signals: np.ndarray) -> Log:
    return replace(LOG, signals={**LOG.signals, **signals})


def test_a_sound_record_agrees() -> None:
    """Slope 1 within 5 %, less than 10 % left, no lag of more than a sample."""
    best = Witness(LOG, STAGE.flat()).best()
    assert best.agrees
    assert best.slope == pytest.approx(1, abs=0.05)
    assert best.left < 0.1
    assert abs(best.lag) <= STEP
    assert (best.clock, best.mass) == (1, 0)


@pytest.mark.parametrize("factor", [2.0, 0.5, 10.0])
def test_a_wrong_clock_is_found_by_its_factor(factor: float) -> None:
    slow = replace(LOG, time=factor * LOG.time, sample_time=factor * STEP)
    best = Witness(slow, STAGE.flat()).best()
    assert best.agrees
    assert best.clock == pytest.approx(factor, rel=0.02)


@pytest.mark.parametrize("factor", [-1.0, 1e-3, 0.5, 2.0])
def test_a_wrong_scale_or_sign_of_the_force_is_its_slope(factor: float) -> None:
    best = Witness(changed(force=factor * LOG["force"]), STAGE.flat()).best()
    assert best.explains
    assert not best.agrees
    assert best.slope == pytest.approx(factor, rel=0.05)


@pytest.mark.parametrize("mass", [4.0, -4.0])
def test_feedforward_is_found_whether_the_force_has_it_or_lacks_it(mass: float) -> None:
    best = Witness(changed(force=LOG["force"] + mass * ACCELERATION), STAGE.flat()).best()
    assert best.agrees
    assert best.mass == pytest.approx(mass, rel=0.15)


def test_gains_that_are_switched_have_two_slopes() -> None:
    switched = np.where(LOG.time < 3.5, 1.0, 0.56) * LOG["force"]
    witness = Witness(changed(force=switched), STAGE.flat())
    assert not witness.best().explains
    slopes = witness.at_both_ends()
    assert slopes is not None
    assert slopes == pytest.approx((1.0, 0.56), rel=0.05)


def test_another_controller_is_none_of_these() -> None:
    other = STAGE.replace({"controller.kp": "1e3 N/m", "controller.ki": "2e6 N/(m*s)", "controller.kd": "5 N*s/m"})
    witness = Witness(LOG, other.flat())
    assert not witness.best().explains


def test_forces_at_a_limit_do_not_count() -> None:
    """An integral that is clamped at the limit restarts elsewhere: each stretch between limits has its own mean."""
    peak = float(np.abs(LOG["force"]).max())
    best = Witness(recorded(limit=0.6 * peak), STAGE.flat()).best()
    assert best.agrees


@pytest.mark.parametrize("share", [0.8, 0.6])
def test_a_noisy_force_at_the_limit_of_the_file_does_not_count(share: float) -> None:
    """Beyond it the command is what the force is not, though noise keeps the force from staying at one value."""
    limit = share * float(np.abs(LOG["force"]).max())
    log = recorded(limit=limit)
    noise = 2e-3 * limit * np.random.default_rng(2).standard_normal(len(log.time))
    noisy = replace(log, signals={**log.signals, "force": log["force"] + noise})
    replay = replayed(noisy, STAGE.replace({"controller.force_limit": f"{limit} N"}).flat())
    assert replay.agrees
    assert not replay.refutes


@pytest.mark.parametrize("place", [0.1, -3.0])
@pytest.mark.parametrize("begin", [0, 60, 130])
def test_filters_begin_in_the_state_that_the_record_shows(place: float, begin: int) -> None:
    """A record may begin anywhere, and within a move."""
    log = recorded(filtered=20e-3)
    shifted = {**log.signals, "position": log["position"] + place, "reference": log["reference"] + place}
    count = len(log.time) - begin
    cut = Log("axis", log.time[:count], STEP, {k: v[begin:] for k, v in shifted.items()}, (slice(0, count),))
    best = Witness(cut, STAGE.replace({"controller.tau": "20 ms"}).flat()).best()
    assert best.agrees
    assert best.left < 0.05


@pytest.mark.parametrize("place", [0.0, 0.1])
def test_samples_whose_time_stamps_scatter_are_tried_as_even(tmp_path: Path, place: float) -> None:
    """Even samples, stamped up to 0.15 ms off: interpolated by their stamps they would refute the controller."""
    log, jitter = recorded(), np.random.default_rng(7).uniform(-0.15e-3, 0.15e-3, len(LOG.time))
    columns = [log.time + jitter, log["reference"] + place, np.round(log["position"] + place, 8), log["force"]]
    path = tmp_path / "axis.csv"
    np.savetxt(path, np.column_stack(columns), delimiter=",", fmt="%.9g", comments="",
               header="t [s],reference [m],position [m],force [N]")  # fmt: skip
    read = read_log(path)
    assert Witness(read, STAGE.flat()).best().left > 0.15
    taken, replay = witnessed(read, STAGE.flat())
    assert replay.agrees
    assert replay.left < 0.05
    assert taken["position"] == pytest.approx(columns[2], abs=1e-12)
    other = STAGE.replace({"controller.kp": "1e3 N/m", "controller.ki": "2e6 N/(m*s)", "controller.kd": "5 N*s/m"})
    stamped, refuted = witnessed(read, other.flat())
    assert stamped is read
    assert refuted.refutes


def test_a_step_of_the_force_is_no_switch_of_gains() -> None:
    stepped = changed(force=LOG["force"] + 20.0 * (LOG.time > 3))
    replay = replayed(stepped, STAGE.flat())
    assert replay.steps
    assert not replay.refutes
    assert "constant force" in doubt_of(replay, stepped)


def test_a_unit_of_both_positions_is_not_told_as_a_scale_of_the_force() -> None:
    small = changed(position=1e-3 * LOG["position"], reference=1e-3 * LOG["reference"])
    with pytest.raises(InputError, match="force") as caught:
        replayed(small, STAGE.flat())
    assert "--unit" in caught.value.example
    with pytest.raises(InputError) as caught:
        replayed(changed(force=-LOG["force"]), STAGE.flat())
    assert "--scale" in caught.value.example


@pytest.mark.parametrize(
    "setting", [{"integral_limit": "2 N"}, {"integral_reset": True}, {"error_deadband": "1 um"}], ids=str
)
def test_settings_that_are_not_linear_are_not_replayed(setting: dict[str, Any]) -> None:
    keys = {f"controller.{key}": value for key, value in setting.items()}
    assert replayed(LOG, STAGE.replace(keys).flat()) is None


def test_a_log_in_which_nothing_varies_says_nothing() -> None:
    still = changed(force=np.zeros(len(LOG.time)))
    assert replayed(still, STAGE.flat()) is None
    brief = replace(LOG, time=LOG.time[:20], segments=(slice(0, 20),))
    assert replayed(replace(brief, signals={k: v[:20] for k, v in LOG.signals.items()}), STAGE.flat()) is None


@pytest.mark.parametrize("integral", [KI, 0.0])
def test_noise_of_the_force_is_no_other_controller(integral: float) -> None:
    """Noise of a fifth of the force hides nothing: the right controller explains the rest, another does not."""
    log = recorded()
    noise = 0.2 * np.std(log["force"]) * np.random.default_rng(1).standard_normal(len(log.time))
    noisy = replace(log, signals={**log.signals, "force": log["force"] + noise})
    replay = replayed(noisy, STAGE.flat() | {"controller.ki": integral})
    assert replay.explains == (integral > 0)
