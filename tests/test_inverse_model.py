"""The inverse model: exact without noise, at rest without a say, and the published values of the EMPS record."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from emps import emps_log
from hypothesis import given, settings
from hypothesis import strategies as st
from refusals import refused

from friso.errors import InputError
from friso.identification.inverse_model import bandwidth_of, inverse_model
from friso.identification.logs.log import Log
from friso.identification.readings.common import record

EMPS = Path(__file__).parents[2] / "shared" / "data" / "emps" / "DATA_EMPS.mat"
DT = 1e-3
SIZES = st.floats(0.1, 10.0)


def swinging(
    mass: float, viscous: float, coulomb: float, offset: float, seconds: float = 10.0, speed: float = 0.2
) -> Log:
    """Two slow sines of the position, and the force of the inverse model on them."""
    time = np.arange(round(seconds / DT)) * DT
    rates = 2 * np.pi * np.array([[0.5], [0.8]])
    shares = speed / rates
    position = np.sum(shares * np.sin(rates * time), axis=0)
    velocity = np.sum(shares * rates * np.cos(rates * time), axis=0)
    acceleration = -np.sum(shares * rates**2 * np.sin(rates * time), axis=0)
    force = mass * acceleration + viscous * velocity + coulomb * np.sign(velocity) + offset
    return record("swinging", DT, position=position, force=force)


def values(log: Log, bandwidth: float | None = 10.0, by_direction: bool = False) -> dict[str, float]:
    return {estimate.name: estimate.value for estimate in inverse_model(log, bandwidth, by_direction).estimates}


@pytest.mark.slow
@settings(max_examples=20)
@given(SIZES, SIZES, SIZES, st.floats(-1.0, 1.0))
def test_without_noise_all_is_found(mass: float, viscous: float, coulomb: float, offset: float) -> None:
    """Errors come only from the filters, which smear the turning points."""
    numbers = values(swinging(mass, viscous, coulomb, offset))
    scale = mass + viscous + coulomb  # of accelerations and speeds of about 1
    for name, truth in zip(numbers, (mass, viscous, coulomb, offset), strict=True):
        assert numbers[name] == pytest.approx(truth, rel=1e-2, abs=0.02 * scale)


def test_smooth_forces_are_found_exactly() -> None:
    """Without Coulomb friction nothing is smeared but the end of the record, where the filters swing out."""
    numbers = values(swinging(2.0, 5.0, 0.0, -0.3))
    assert numbers["mass"] == pytest.approx(2.0, rel=2e-4)
    assert numbers["viscous"] == pytest.approx(5.0, rel=2e-3)
    assert numbers["coulomb"] == pytest.approx(0.0, abs=2e-3)
    assert numbers["offset"] == pytest.approx(-0.3, abs=2e-3)


@pytest.mark.parametrize("every", [20, 50, 100])
def test_coarse_sampling_does_not_make_the_mass_larger(every: int) -> None:
    """Down to six samples in a period at the bandwidth; central differences make it 7 % there."""
    log = swinging(2.0, 5.0, 0.0, -0.3)
    signals = {role: values[::every] for role, values in log.signals.items()}
    coarse = record("coarse", every * DT, **signals)
    assert inverse_model(coarse, 1.6).value("mass") == pytest.approx(2.0, rel=1e-2)


@pytest.mark.parametrize(
    ("line", "scale"),
    [
        ("force: F (column 3), as specified; in N", "-1 N/N"),
        ("force: u (column 3), as specified; 35.15 N/V", "-35.15 N/V"),
        ("force: u (column 3), as specified; -3e2 mN/V, its values taken to be in V as the scale implies", "3e2 mN/V"),
    ],
)
def test_a_force_of_the_wrong_sign_is_refused_with_its_scale_turned(line: str, scale: str) -> None:
    log = swinging(-2.0, -5.0, -1.0, 0.0)
    with pytest.raises(InputError) as refusal:
        inverse_model(replace(log, read=(line,)), 10.0)
    assert refusal.value.example == f'--scale force="{scale}"'


def test_directions_are_told_apart() -> None:
    log = swinging(2.0, 0.0, 0.0, 0.0)
    speed = np.gradient(log["position"], DT)
    friction = np.where(speed > 0, 3 + 2 * speed, -1 + 4 * speed)
    numbers = values(replace(log, signals={**log.signals, "force": log["force"] + friction}), by_direction=True)
    expected = {"mass": 2, "viscous forward": 2, "coulomb forward": 3, "viscous backward": 4, "coulomb backward": 1}
    assert list(numbers) == list(expected)
    for name, truth in expected.items():
        assert numbers[name] == pytest.approx(truth, rel=0.05), name


def test_a_long_rest_says_nothing_of_friction() -> None:
    """At rest the sign of a noisy velocity is random, and the force is what the controller happens to hold."""
    rng, log = np.random.default_rng(3), swinging(2.0, 1.0, 4.0, 0.5)
    rest = 20_000
    position = np.concatenate([log["position"], np.full(rest, log["position"][-1])])
    force = np.concatenate([log["force"], np.full(rest, -2.0)])
    position += 1e-7 * rng.standard_normal(len(position))
    model = inverse_model(record("rests", DT, position=position, force=force), 10.0)
    assert model.value("coulomb") == pytest.approx(4.0, rel=0.02)
    assert model.value("offset") == pytest.approx(0.5, abs=0.05)
    assert model.time[-1] < 10.2  # the filters smear


@pytest.mark.parametrize("slow", [0.0, 100.0])
def test_slow_hunting_does_not_hide_the_bandwidth(slow: float) -> None:
    """A force of a few newtons at 5 Hz, and one of 100 N that takes the whole record."""
    time = np.arange(20_000) * DT
    force = 3 * np.sin(2 * np.pi * 5 * time) + slow * np.sin(2 * np.pi * 0.05 * time)
    force += 0.01 * np.random.default_rng(0).standard_normal(len(time))
    assert bandwidth_of(record("slow", DT, position=force)) == pytest.approx(5, rel=0.1)


@pytest.mark.parametrize(("share", "expected"), [(0.045, 2.0), (0.055, 10.0)])
def test_the_bandwidth_holds_95_percent_of_the_accelerations_power(share: float, expected: float) -> None:
    """The faster of two sines has this share of the acceleration's power, and far less of that of the position."""
    time, slow, fast = np.arange(40_000) * DT, 2.0, 10.0
    powers = np.array([1 - share, share])
    amplitudes = np.sqrt(powers) / (2 * np.pi * np.array([slow, fast])) ** 2
    position = amplitudes[0] * np.sin(2 * np.pi * slow * time) + amplitudes[1] * np.sin(2 * np.pi * fast * time)
    position += 1e-9 * np.random.default_rng(1).standard_normal(len(time))
    log = record("sines", DT, position=position)
    assert bandwidth_of(log) == pytest.approx(expected, rel=0.15)
    jump = np.where(np.arange(len(time)) < 9000, 0.0, 10 * amplitudes[0])
    parts = (slice(0, 9000), slice(9000, len(time)))
    assert bandwidth_of(replace(log, signals={"position": position + jump}, segments=parts)) == pytest.approx(
        expected, rel=0.15
    )


@pytest.mark.slow
def test_intervals_hold_the_truth() -> None:
    """Force with correlated errors: of 60 records about 95 % of the intervals hold mass and viscous friction."""
    rng, log, held = np.random.default_rng(5), swinging(2.0, 5.0, 0.0, 0.0), np.zeros(2)
    for _ in range(60):
        noise = np.convolve(rng.standard_normal(len(log.time) + 49), np.ones(50) / 50, "valid")
        model = inverse_model(replace(log, signals={**log.signals, "force": log["force"] + noise}), 10.0)
        held += [model.estimates[0].holds(2.0), model.estimates[1].holds(5.0)]
    assert np.all(held >= 50)


def test_the_cart_of_a_joint_has_the_friction() -> None:
    """A stage of 0.6 kg swings on its cart of 1.4 kg; the friction acts on the cart."""
    log = swinging(2.0, 1.0, 4.0, 0.5)
    swing = 1e-3 * np.sin(2 * np.pi * 3 * log.time)
    force = log["force"] + 0.6 * np.gradient(np.gradient(swing, DT), DT)
    signals = {"position": log["position"] + swing, "cart_position": log["position"], "force": force}
    both = record("joint", DT, **signals)
    relative = record("joint", DT, position=signals["position"], relative_position=swing, force=force)
    one, other = (inverse_model(item, 10.0, cart_share=0.7) for item in (both, relative))
    assert one.value("mass") == pytest.approx(2.0, rel=5e-3)
    assert one.value("coulomb") == pytest.approx(4.0, rel=0.02)
    assert [estimate.value for estimate in other.estimates] == pytest.approx(
        [estimate.value for estimate in one.estimates], rel=1e-9
    )
    assert inverse_model(both, 10.0).value("mass") != pytest.approx(2.0, rel=0.02)


def test_too_little_motion_is_refused() -> None:
    log = swinging(2.0, 1.0, 4.0, 0.5, seconds=0.3)
    with refused("position"):
        inverse_model(log, 4.0)


# --- the record of the EMPS benchmark (Janot, Gautier, Brunot 2019) ------------------------------------------------


@pytest.fixture(scope="module")
def emps(tmp_path_factory: pytest.TempPathFactory) -> Log:
    return emps_log(tmp_path_factory.mktemp("emps"))


PUBLISHED = {
    "mass": (95.1089, 2e-3),
    "viscous": (203.5034, 5e-3),
    "coulomb": (20.3935, 5e-3),
    "offset": (-3.1648, 0.02),
}
PER_DIRECTION = {
    "mass": (95.1540, 2e-3),
    "viscous forward": (166.71, 5e-3),
    "viscous backward": (240.42, 5e-3),
    "coulomb forward": (20.14, 5e-3),
    "coulomb backward": (20.63, 5e-3),
}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("by_direction", "published", "error"), [(False, PUBLISHED, 4.0834), (True, PER_DIRECTION, 3.1117)]
)
def test_emps(emps: Log, by_direction: bool, published: dict[str, tuple[float, float]], error: float) -> None:
    model = inverse_model(emps, 20.0, by_direction)
    for name, (value, tolerance) in published.items():
        assert model.value(name) == pytest.approx(value, rel=tolerance), name
        assert next(estimate for estimate in model.estimates if estimate.name == name).holds(value)
    assert 100 * model.error <= error + 5e-5


@pytest.mark.slow
def test_emps_by_its_own_bandwidth(emps: Log) -> None:
    """Near the published one, 20 Hz, and so are the values."""
    model = inverse_model(emps)
    assert 15 < model.bandwidth < 35
    assert model.value("mass") == pytest.approx(95.1089, rel=5e-3)
