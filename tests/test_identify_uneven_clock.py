"""Logs without an even clock show mass and friction at their own stamps."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from refusals import refused

import friso
from friso.identification.logs.log import Log
from friso.identification.logs.time_base import is_uneven
from friso.identification.readings.friction_velocity import local_polynomials, stamped_friction

MOVE, DWELL, STROKE = 0.8, 0.3, 0.05
MASS, VISCOUS, COULOMB, OFFSET = "mass", "friction.viscous", "friction.coulomb", "bias.cart"


def uneven(rate: float, jitter: float, seconds: float, seed: int) -> np.ndarray:
    """Return instants [s] of a rate [Hz] whose steps scatter by the `jitter`, relative to them."""
    draws = np.random.default_rng(seed).standard_normal(round(rate * seconds)).clip(-2, 2)
    return np.cumsum((1 + jitter * draws) / rate)


def moved(time: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return position, velocity and acceleration of quintic moves to and fro with dwells."""
    place, phase = np.divmod(time, MOVE + DWELL)
    u, sign = np.clip(phase / MOVE, 0, 1), np.where(place % 2 == 0, 1, -1)
    way = u**3 * (10 - 15 * u + 6 * u * u)
    position = STROKE * np.where(sign > 0, way, 1 - way)
    velocity = sign * STROKE / MOVE * 30 * u**2 * (1 - u) ** 2
    return position, velocity, sign * STROKE / MOVE**2 * 60 * u * (1 - u) * (1 - 2 * u)


def log_of(time: np.ndarray, truth: dict[str, float], blur: float = 0.0, seed: int = 0, role: str = "velocity") -> Log:
    position, velocity, acceleration = moved(time)
    friction = truth[VISCOUS] * velocity + truth[COULOMB] * np.sign(velocity)
    force = truth[MASS] * acceleration + friction + truth[OFFSET]
    noise = np.random.default_rng(seed).standard_normal((2, len(time)))
    motion = {"velocity": velocity, "position": position}[role]
    signals = {
        role: motion + blur * np.abs(motion).max() * noise[0],
        "force": force + blur * np.abs(force).max() * noise[1],
    }
    return Log("uneven", time, float(np.median(np.diff(time))), signals, (slice(0, len(time)),), is_uneven=True)


TRUTHS = st.fixed_dictionaries(
    {MASS: st.floats(0.5, 20), VISCOUS: st.floats(2, 40), COULOMB: st.floats(1, 20), OFFSET: st.floats(-2, 2)}
)


@settings(max_examples=40, deadline=None)
@given(TRUTHS, st.floats(25, 100), st.floats(0.2, 0.4), st.sampled_from([0.0, 0.002]), st.integers(0, 99))
def test_mass_and_friction_come_back_from_uneven_clocks(
    truth: dict[str, float], rate: float, jitter: float, blur: float, seed: int
) -> None:
    shown = stamped_friction(log_of(uneven(rate, jitter, 18, seed), truth, blur, seed)).by_name
    size = max(truth[COULOMB], truth[MASS] * 0.45, truth[VISCOUS] * 0.1)  # the largest force
    for name, scale in ((MASS, 0.45), (VISCOUS, 0.1), (COULOMB, 1.0), (OFFSET, 1.0)):
        one = shown[name]
        middle = (one.low + one.high) / 2 if np.isfinite(one.high) else truth[name]
        assert abs(middle - truth[name]) * scale < 0.05 * size
        assert abs(truth[name] - middle) <= 2.5 * one.half_width + 1e-9


@pytest.mark.parametrize("rate", [50, 100])
def test_a_position_is_enough(rate: float) -> None:
    truth = {MASS: 4.0, VISCOUS: 20.0, COULOMB: 5.0, OFFSET: 0.5}
    shown = stamped_friction(log_of(uneven(rate, 0.3, 18, 1), truth, role="position")).by_name
    for name, value in truth.items():
        assert shown[name].value == pytest.approx(value, rel=0.05)


@pytest.mark.slow
def test_intervals_hold_the_truth_as_often_as_they_say() -> None:
    truth = {MASS: 4.0, VISCOUS: 20.0, COULOMB: 5.0, OFFSET: 0.5}
    held = [
        one.holds(truth[name])
        for seed in range(30)
        for name, one in stamped_friction(log_of(uneven(60, 0.3, 14, seed), truth, 0.003, seed)).by_name.items()
    ]
    assert np.mean(held) > 0.9


@pytest.mark.slow
@settings(max_examples=15, deadline=None)
@given(st.floats(0.01, 100), st.floats(0.1, 10), st.floats(-1e9, 1e9))
def test_units_and_the_origin_of_time_change_nothing(force: float, length: float, begin: float) -> None:
    log = log_of(uneven(60, 0.3, 12, 3), {MASS: 4.0, VISCOUS: 20.0, COULOMB: 5.0, OFFSET: 0.5}, 0.001)
    scaled = {"velocity": length * log["velocity"], "force": force * log["force"]}
    one, other = stamped_friction(log), stamped_friction(replace(log, time=log.time + begin, signals=scaled))
    for name, factor in ((MASS, force / length), (VISCOUS, force / length), (COULOMB, force), (OFFSET, force)):
        tolerance = 1e-6 + 1e-4 * abs(begin) / 1e9
        assert other.by_name[name].value == pytest.approx(factor * one.by_name[name].value, rel=tolerance)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 3), st.sampled_from([5, 7, 11]), st.integers(0, 99))
def test_local_polynomials_are_exact_for_polynomials(degree: int, width: int, seed: int) -> None:
    time = uneven(40, 0.3, 2, seed)
    curve = np.polynomial.Polynomial(np.random.default_rng(seed).standard_normal(degree + 1))
    inside = slice(width // 2, -(width // 2))
    for order, values in enumerate(local_polynomials(time, curve(time), 3, width)):
        truth = curve(time) if order == 0 else curve.deriv(order)(time)
        assert values[inside] == pytest.approx(truth[inside], rel=1e-6, abs=1e-6)


@settings(max_examples=30, deadline=None)
@given(st.floats(5, 2000), st.integers(0, 99), st.floats(0, 0.3))
def test_lost_rows_rounded_stamps_and_little_jitter_leave_a_clock_even(rate: float, seed: int, lost: float) -> None:
    draws = np.random.default_rng(seed)
    time = np.arange(400) / rate
    kept = time[draws.random(400) >= lost]
    assert not is_uneven(kept)
    assert not is_uneven(np.round(time * rate * 0.4) / (0.4 * rate))
    assert not is_uneven(time + 0.05 / rate * draws.standard_normal(400))
    assert is_uneven(uneven(rate, 0.35, 400 / rate, seed))


def test_one_direction_does_not_tell_friction_from_a_constant_force() -> None:
    log = log_of(uneven(80, 0.3, 10, 2), {MASS: 4.0, VISCOUS: 20.0, COULOMB: 5.0, OFFSET: 0.5})
    signals = {"velocity": np.abs(log["velocity"]), "force": log["force"] * np.sign(log["velocity"] + 1e-12)}
    shown = stamped_friction(replace(log, signals=signals)).by_name
    assert shown[MASS].value == pytest.approx(4.0, rel=0.05)
    assert not shown[COULOMB].determined
    assert not shown[OFFSET].determined


def test_too_few_samples_within_moves_are_refused() -> None:
    with refused("position"):
        stamped_friction(log_of(uneven(6, 0.3, 12, 2), {MASS: 4.0, VISCOUS: 20.0, COULOMB: 5.0, OFFSET: 0.5}))


def test_a_file_with_uneven_stamps_is_recognised_and_says_what_its_clock_denies(tmp_path: Path) -> None:
    log = log_of(uneven(50, 0.35, 12, 5), {MASS: 4.0, VISCOUS: 20.0, COULOMB: 5.0, OFFSET: 0.0})
    path = tmp_path / "serial.csv"
    columns = np.stack([log.time, log["velocity"], log["force"]], axis=1)
    np.savetxt(path, columns, delimiter=",", header="t [s],velocity [m/s],force [N]", comments="")
    answer = friso.identify(path)
    estimates = {one.name: one for one in answer.result.estimates}
    assert estimates["masses.cart"].holds(4.0) or estimates["masses.cart"].value == pytest.approx(4.0, rel=0.02)
    assert estimates["friction.coulomb"].value == pytest.approx(5.0, rel=0.05)
    for denied in ("friction.bristle_stiffness", "friction.bristle_damping", "friction.static"):
        assert not estimates[denied].determined
