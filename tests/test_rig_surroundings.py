"""Rail and floor of the virtual test rig: reproducible, and with the statistics that the stage file states.

Bounds are five standard errors of the estimate, computed for the sample that it comes from.
"""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from refusals import refused
from scipy.signal import welch
from scipy.stats import norm

from friso.equations.rail import friction_factors, gaussian_field
from friso.stage.rig import Floor
from friso.virtual_rig.task import floor_acceleration, variance_below

SURE = 5.0
"""Standard errors within which an estimate has to lie: 1 in 1.7 million does not."""

seeds = st.integers(0, 10**15 - 1)
lengths = st.floats(1e-4, 0.1)
deviations = st.floats(0.01, 0.9)


def rail(**changes: float) -> dict[str, Any]:
    """Flat keys of a rail with nothing on it but the changes."""
    names = ("offset", "static_deviation", "coulomb_deviation", "first_harmonic", "second_harmonic", "third_harmonic")
    return {f"rail.{key}": value for key, value in {**dict.fromkeys(names, 0.0), "seed": 1.0, **changes}.items()}


def spectrum(*points: tuple[float, float]) -> Floor:
    """A floor from frequencies [Hz] and densities [m/s^2/Hz^0.5]."""
    frequency, density = zip(*points, strict=True)
    return Floor(
        frequency=[f"{item!r} Hz" for item in frequency],  # pyright: ignore[reportArgumentType]
        acceleration=[f"{entry!r} m/s^2/Hz^0.5" for entry in density],  # pyright: ignore[reportArgumentType]
    )


@settings(max_examples=40)
@given(seeds, lengths, deviations, deviations, st.floats(-0.9, 2.0))
def test_factors_are_positive_and_follow_one_field(
    seed: int, length: float, static: float, coulomb: float, offset: float
) -> None:
    shares = {"first_harmonic": 0.5, "second_harmonic": 0.3, "third_harmonic": 0.19, "rolling_pitch": 4e-3}
    flat = rail(static_deviation=static, coulomb_deviation=coulomb, correlation_length=length, offset=offset, **shares)
    places = np.linspace(-0.2, 0.2, 501)
    factors = friction_factors(flat, places, seed)
    assert factors.shape == (2, 501)
    assert factors.min() > 0
    common = friction_factors({**flat, "rail.static_deviation": 0.0, "rail.coulomb_deviation": 0.0}, places, seed)
    widths = np.sqrt(np.log1p(np.array([[static], [coulomb]]) ** 2))
    first, second = (np.log(factors / common) + widths**2 / 2) / widths
    np.testing.assert_allclose(first, second, atol=1e-9)
    assert np.ptp(first) > 0


@pytest.mark.slow
@settings(max_examples=6)
@given(st.integers(0, 10**6), lengths, deviations, st.floats(-3, 3))
def test_mean_and_deviation_over_rails(first: int, length: float, deviation: float, place: float) -> None:
    """The statistics are those at one place of many rails."""
    count = 1500
    flat = rail(static_deviation=deviation, correlation_length=length)
    values = np.array([friction_factors(flat, np.array([place]), first + k)[:, 0] for k in range(count)])
    assert np.all(values[:, 1] == 1)
    width = np.log1p(deviation**2)
    logs = (np.log(values[:, 0]) + width / 2) / np.sqrt(width)
    assert abs(values[:, 0].mean() - 1) < SURE * deviation / np.sqrt(count)
    assert abs(logs.mean()) < SURE / np.sqrt(count)
    assert abs(logs.var() - 1) < SURE * np.sqrt(2 / count)


@pytest.mark.slow
@settings(max_examples=10)
@given(seeds, lengths, deviations)
def test_deviation_and_correlation_length_along_one_rail(seed: int, length: float, deviation: float) -> None:
    """Autocovariance of the field at lags of 0 to 4 lengths; its standard error by Bartlett's formula."""
    count, spacing = 200_000, 0.5
    places = np.arange(count) * spacing * length
    factor = friction_factors(rail(coulomb_deviation=deviation, correlation_length=length), places, seed)[1]
    width = np.log1p(deviation**2)
    field = (np.log(factor) + width / 2) / np.sqrt(width)
    lags = np.arange(9)
    values = np.array([np.mean(field[: count - lag] * field[lag:]) for lag in lags])
    far = np.arange(-40, 41)
    error = np.sqrt([np.sum(of_theory(far) ** 2 + of_theory(far + lag) * of_theory(far - lag)) / count for lag in lags])
    correlation = of_theory(lags)
    assert np.all(np.abs(values - correlation) < SURE * error)
    # The factor itself: a lognormal field's covariance, exp(s^2 rho) - 1, tells the variance of its mean.
    mean_error = np.sqrt(np.sum(np.expm1(width * of_theory(far))) / count)
    assert abs(factor.mean() - 1) < SURE * mean_error
    for wrong in (0.95, 1.05):  # the bounds tell a length that is 5 % off
        assert np.any(np.abs(of_theory(lags, wrong) - correlation) > SURE * error)


def of_theory(lags: np.ndarray, length: float = 1.0) -> np.ndarray:
    """The correlation that the stage file states, at lags of half a length."""
    return np.exp(-((0.5 * lags / length) ** 2) / 2)


def test_the_field_is_gaussian() -> None:
    field = gaussian_field(np.arange(100_000) * 8.0, 1.0, 3)  # 8 lengths apart: independent
    assert abs(np.mean(field**3)) < SURE * np.sqrt(15 / len(field))
    assert abs(np.mean(field**4) - 3) < SURE * np.sqrt(96 / len(field))


@settings(max_examples=40)
@given(seeds, lengths, st.floats(-1, 1), st.floats(1e-3, 0.5), st.integers(1, 7))
def test_what_stands_at_a_place_depends_on_nothing_else(
    seed: int, length: float, start: float, span: float, every: int
) -> None:
    flat = rail(static_deviation=0.4, correlation_length=length, rolling_pitch=4e-3, first_harmonic=0.2)
    places = np.linspace(start, start + span, 301)
    whole = friction_factors(flat, places, seed)
    np.testing.assert_array_equal(friction_factors(flat, places, seed), whole)
    np.testing.assert_array_equal(friction_factors(flat, places[100:150:every], seed), whole[:, 100:150:every])
    np.testing.assert_array_equal(friction_factors({**flat, "rail.seed": float(seed)}, places), whole)


@settings(max_examples=40)
@given(seeds, seeds, lengths)
def test_other_seeds_are_other_rails(seed: int, other: int, length: float) -> None:
    """Independent, also where the seeds are neighbours: their fields, 8 lengths apart, do not correlate."""
    other = seed + 1 if other == seed else other
    places = np.arange(2000) * 8 * length
    one, two = gaussian_field(places, length, seed), gaussian_field(places, length, other)
    assert abs(np.mean(one * two)) < SURE / np.sqrt(len(places))


def test_field_against_its_sum_over_cells() -> None:
    """The slow twin: each place's sum over 12 lengths of white noise, read one number at a time."""
    length, places = 5e-3, np.array([-0.0301, -1e-9, 0.0, 0.00125, 0.0062, 1.7])
    for place, result in zip(places, gaussian_field(places, length, 11), strict=True):
        cells = np.arange(round(place / length * 2) - 24, round(place / length * 2) + 25)
        noise = np.array([white_noise(int(cell), 11) for cell in cells])
        kernel = np.exp(-((place / length - cells / 2) ** 2))
        assert result == pytest.approx(noise @ kernel / np.sqrt(kernel @ kernel), abs=1e-7)


def white_noise(cell: int, seed: int) -> float:
    """The white noise of one cell."""
    key = [seed, int.from_bytes(b"field")]
    word = int(np.random.Philox(key=key, counter=(cell // 4) % 2**256).random_raw(4)[cell % 4])
    return float(norm.ppf(((word >> 11) + 0.5) / 2**53))


@settings(max_examples=40)
@given(seeds, st.floats(1e-3, 0.02), st.lists(st.floats(0, 0.3), min_size=3, max_size=3))
def test_harmonics_of_the_rolling_elements(seed: int, pitch: float, shares: list[float]) -> None:
    harmonics = dict(zip(("first_harmonic", "second_harmonic", "third_harmonic"), shares, strict=True))
    factors = friction_factors(rail(offset=0.5, rolling_pitch=pitch, **harmonics), np.arange(64) * pitch / 64, seed)
    result = np.fft.rfft(factors[0]) / 64
    np.testing.assert_array_equal(factors[0], factors[1])
    np.testing.assert_allclose(np.abs(result[:5]), [1.5, *(0.75 * share for share in shares), 0], atol=1e-12)


def test_a_rail_without_variation_is_even() -> None:
    places = np.linspace(0, 0.1, 5)
    np.testing.assert_array_equal(friction_factors({"friction.static": 3.0}, places), np.ones((2, 5)))
    np.testing.assert_array_equal(friction_factors(rail(offset=0.25), places), np.full((2, 5), 1.25))


def test_a_field_too_fine_for_its_rail_and_a_floor_faster_than_it_is_sampled() -> None:
    with refused("rail.correlation_length"):
        friction_factors(rail(static_deviation=0.1, correlation_length=1e-9), np.linspace(0, 0.1, 100))
    with refused("floor.frequency"):
        floor_acceleration(spectrum((1, 1e-4), (100, 1e-4)), 1.0, 0.01, 0)


points = st.lists(
    st.tuples(st.floats(0.5, 200.0), st.floats(1e-6, 1e-2)), min_size=2, max_size=5, unique_by=lambda sample: sample[0]
).filter(lambda several: min(np.diff(sorted(f for f, _ in several))) > 1e-3)


@pytest.mark.slow
@settings(max_examples=40)
@given(points)
def test_variance_of_a_floor_is_the_integral_of_its_spectrum(several: list[tuple[float, float]]) -> None:
    frequency, density = np.array(sorted(several)).T
    fine = np.unique(np.concatenate([np.geomspace(frequency[0], frequency[-1], 200_001), frequency]))
    power = np.exp(2 * np.interp(np.log(fine), np.log(frequency), np.log(density)))
    variance = variance_below(spectrum(*sorted(several)), np.array([0.0, frequency[0], frequency[-1], 1e4]))
    np.testing.assert_allclose(variance, [0, 0, *[np.trapezoid(power, fine)] * 2], rtol=1e-5)


@settings(max_examples=10)
@given(seeds, st.floats(-1.5, 1.5), st.floats(-1.5, 1.5))
def test_spectrum_is_recovered(seed: int, first: float, second: float) -> None:
    """Welch's estimate in tenths of the band, each within five standard errors of the spectrum's mean there."""
    floor = spectrum((2.0, 1e-4), (10.0, 1e-4 * 5**first), (100.0, 1e-4 * 5**first * 10**second))
    interval, window = 1 / 400, 2000
    acceleration = floor_acceleration(floor, 400.0, interval, seed)
    frequency, power = welch(acceleration, 1 / interval, nperseg=window, detrend=False)  # pyright: ignore[reportArgumentType]
    density = np.interp(np.log(np.maximum(frequency, 1)), np.log(floor.frequency), np.log(floor.acceleration))
    inside = np.flatnonzero((frequency > 3) & (frequency < 97))
    ratio = power[inside] / np.exp(2 * density[inside])
    for part in np.array_split(ratio, 10):
        # Hann windows that overlap by half count for 0.95 independent ones each, and of bins, whose neighbours
        # correlate by (2/3)^2, half do (Welch 1967, doi.org/10.1109/TAU.1967.1161901).
        error = 1 / np.sqrt(len(acceleration) / window * 2 * 0.95 * len(part) / 2)
        assert abs(part.mean() - 1) < SURE * error
    assert power[frequency < 1].max() < 1e-3 * power[inside].max()
    assert power[frequency > 101].max() < 1e-3 * power[inside].max()


@pytest.mark.slow
@settings(max_examples=8)
@given(st.integers(0, 10**6), st.floats(0.005, 3.0))
def test_variance_of_a_floor_however_short(first: int, duration: float) -> None:
    """Over many seeds at one time, and not only of the waves that fit into the record."""
    floor, count = spectrum((0.2, 1e-3), (5.0, 1e-4), (90.0, 1e-4)), 1500
    values = np.array([floor_acceleration(floor, duration, 1 / 400, first + k)[-1] for k in range(count)])
    expected = variance_below(floor, np.array([1e3]))[0]
    assert abs(values.mean()) < SURE * np.sqrt(expected / count)
    assert abs(np.mean(values**2) / expected - 1) < SURE * np.sqrt(2 / count)


@settings(max_examples=30)
@given(seeds, st.integers(1, 5000), st.sampled_from([5e-5, 1e-3, 0.005]))
def test_a_floor_is_sampled_from_start_to_end(seed: int, steps: int, interval: float) -> None:
    floor = spectrum((1.0, 1e-4), (100.0, 1e-4))
    acceleration = floor_acceleration(floor, steps * interval, interval, seed)
    assert acceleration.shape == (steps + 1,)
    np.testing.assert_array_equal(acceleration, floor_acceleration(floor, steps * interval, interval, seed))
    assert np.any(acceleration != floor_acceleration(floor, steps * interval, interval, seed + 1))
