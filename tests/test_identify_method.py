"""From estimates to a stage: how they are combined, which the stage file takes, and how its keys are related."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter1d
from scipy.signal import lfilter

import friso
from friso.errors import InputError
from friso.identification.combine import combined, correlation_length, correlations
from friso.identification.estimate import Estimate
from friso.identification.logs.log import Log
from friso.identification.method import identify
from friso.identification.output_error.problem import why_continuous
from friso.identification.readings.common import record
from friso.identification.readings.course import external
from friso.identification.readings.friction_velocity import friction_velocity
from friso.identification.response.analysis import analyse
from friso.identification.sources import recognised
from friso.identification.stage_file import fitting, identified_stage
from friso.stage import Stage
from friso.stage.correlations import Correlations, draw

STEP = 1e-3
STATIC, COULOMB = "friction.static", "friction.coulomb"
normal, unknown = Estimate.normal, Estimate.unknown


@pytest.fixture(scope="module")
def base() -> Stage:
    return friso.load(Path(__file__).parents[1] / "examples" / "emps_axis.toml")


# several estimates of one key


def test_estimates_and_bounds_of_one_key_are_combined() -> None:
    """Estimates far beyond their intervals disagree, as does a value beyond what another leaves possible."""
    (one,), text = combined([normal("k", "N", 1.0, 0.0102, "a"), normal("k", "N", 1.07, 0.0102, "b")])
    assert len(text) == 1
    assert (one.low, one.high) == pytest.approx((0.98, 1.09), abs=1e-3)
    (one,), text = combined([normal(STATIC, "N", 3.0, 0.1, "moves"), unknown(STATIC, "N", "stick-slip", "stops", 5.0)])
    assert (one.value, len(text)) == (3.0, 1)
    (one,), text = combined([unknown(STATIC, "N", "moves", "no"), unknown(STATIC, "N", "stick-slip", "stops", 5.0)])
    assert (one.low, one.high, one.reason, text) == (5.0, np.inf, "stops", [])
    (both,), text = combined([one, unknown(STATIC, "N", "ramps", "few", 2.0, 8.0)])
    assert (both.low, both.high, text) == (5.0, 8.0, [])
    (hull,), text = combined([one, unknown(STATIC, "N", "ramps", "few", 2.0, 4.0)])
    assert (hull.low, hull.high, len(text)) == (2.0, np.inf, 1)


def test_what_is_systematic_does_not_average_out() -> None:
    """Nine readings whose intervals of 0.3 are by a third noise: the noise becomes a third, the rest stays."""
    item = Estimate("k", "N", 5.0, 4.7, 5.3, "a", systematic=0.2)
    (one,), _ = combined([item] * 9)
    assert one.half_width == pytest.approx(0.2 + 0.1 / 3)
    assert one.systematic == pytest.approx(0.2)


@pytest.mark.slow
@given(st.integers(0, 2**31), st.integers(3, 8))
@settings(max_examples=8)
def test_places_that_differ_show_the_mean_of_all_places(seed: int, count: int) -> None:
    """Places that scatter by far more than their own errors, one known much less: the mean of all is held as often as
    95 % intervals should, and the one that is not known does not widen it."""
    rng = np.random.default_rng(seed)
    cases = [[normal("k", "N", rng.normal(5, 0.5), 0.02, "a") for _ in range(count)] for _ in range(200)]
    answers = [combined(case)[0][0] for case in cases]
    assert sum(answer.holds(5) for answer in answers) > 170
    vague = [combined([*case, normal("k", "N", 55.0, 50.0, "b")])[0][0] for case in cases]
    wider = [more.half_width / answer.half_width for more, answer in zip(vague, answers, strict=True)]
    assert np.median(wider) == pytest.approx(1, abs=0.02)


@pytest.mark.slow
@given(st.integers(0, 2**31), st.integers(2, 6))
@settings(max_examples=20)
def test_repeated_measurements_agree_about_as_often_as_they_should(seed: int, count: int) -> None:
    """1 in 100 disagrees by chance: of 200 cases more than 12 have a probability below 1e-6."""
    rng = np.random.default_rng(seed)
    spread = rng.uniform(0.5, 2, count)
    cases = [[normal("k", "N", rng.normal(5, s), s, "a") for s in spread] for _ in range(200)]
    answers = [combined(case) for case in cases]
    assert sum(bool(text) for _, text in answers) <= 14
    assert sum(result[0].holds(5) for result, _ in answers) > 170


# how they hang together


@given(st.integers(0, 2**31))
@settings(max_examples=30)
def test_correlations_of_means_are_those_of_drawn_means(seed: int) -> None:
    """Against weighted means of errors drawn from each log's own distribution."""
    rng = np.random.default_rng(seed)
    groups, means, precision = [], 0.0, 0.0
    for _ in range(2):
        root = rng.normal(size=(3, 3))
        covariance = root @ root.T + 0.1 * np.eye(3)
        size = np.sqrt(np.diag(covariance))
        groups.append(([normal(f"k{i}", "N", 0.0, size[i], "a") for i in range(3)], covariance / np.outer(size, size)))
        means = means + rng.multivariate_normal(np.zeros(3), covariance, 20000) / size**2
        precision = precision + 1 / size**2
    keys, matrix = correlations([one for group, _ in groups for one in group], groups)
    assert keys == ("k0", "k1", "k2")
    assert matrix == pytest.approx(np.corrcoef(np.asarray(means / precision).T), abs=0.05)
    assert Correlations(keys, matrix).keys == keys


# what the stage file takes

ODD = {
    "Coulomb above the static friction of the stage": [normal(COULOMB, "N", 25.0, 0.1, "x")],
    "Coulomb of one speed": [unknown(COULOMB, "N", "x", "one speed", 0.0, 7.0)],
    "negative, but not for sure": [normal(COULOMB, "N", -0.1, 0.3, "x")],
    "negative": [normal(COULOMB, "N", -0.1, 0.01, "x"), normal("friction.viscous", "N s/m", 5.0, 1.0, "x")],
    "Stribeck velocity from 0": [unknown("friction.stribeck_velocity", "m/s", "x", "no slow motion", 0.0, 0.015)],
    "static at least": [unknown(STATIC, "N", "x", "stops", 35.0)],
    "static below Coulomb": [normal(STATIC, "N", 2.0, 0.1, "x"), normal(COULOMB, "N", 4.0, 0.1, "x")],
    "static below the stage's Coulomb": [normal(STATIC, "N", 2.0, 0.1, "x")],
    "range of static about Coulomb": [unknown(STATIC, "N", "x", "r", 10.0, 30.0), normal(COULOMB, "N", 25.0, 0.1, "x")],
    "asymmetry without any knowledge": [normal("friction.viscous_asymmetry", "", 0.1, 300.0, "x")],
    "a body that is not there": [normal("bias.stage", "N", 2.0, 0.1, "x"), normal("bias.cart", "N", 2.0, 0.1, "x")],
    "nothing": [unknown("masses.cart", "kg", "x", "no motion")],
}


@pytest.mark.parametrize("case", ODD)
def test_the_stage_is_always_written(case: str, base: Stage) -> None:
    fit = fitting(base, ODD[case])
    stage = identified_stage(base, fit.estimates, ["log"])
    flat = stage.flat()
    assert flat[STATIC] >= flat[COULOMB]
    assert fit.notes or fit.left
    if stage.uncertain():
        assert draw(stage, Correlations(), 16, 1).count == 16


def test_what_the_stage_file_takes_of_ranges_and_bounds(base: Stage) -> None:
    """Ranges begin above zero, static friction moves along with Coulomb friction, and is no less than its bound."""
    (speed,) = fitting(base, ODD["Stribeck velocity from 0"]).estimates
    assert (speed.low, speed.high) == pytest.approx((1.5e-5, 0.015))
    fit = fitting(base, ODD["Coulomb above the static friction of the stage"])
    assert dict(fit.follows) == {STATIC: COULOMB}
    assert {estimate.name: estimate.value for estimate in fit.estimates} == {COULOMB: 25.0, STATIC: 25.0}
    stage = identified_stage(base, fitting(base, ODD["static at least"]).estimates, ["log"])
    assert stage.uncertain()[STATIC].low == 35.0
    fit = fitting(base, [unknown(STATIC, "N", "x", "stops", 15.0)])
    assert fit.estimates == ()


def test_the_drive_of_a_stage_is_simulated_in_a_log_at_its_rate_alone(base: Stage) -> None:
    sampled = base.replace({"drive.sample_time": "1 ms"}).flat()
    assert why_continuous(sampled, 0.99998e-3) == ""
    assert why_continuous(sampled, 2e-3)
    assert why_continuous(base.flat(), 1e-3) == ""


def steady(speeds: list[float], rng: np.random.Generator) -> Log:
    """Stretches of constant velocity under Coulomb friction of 5 N and viscous friction of 30 N s/m, of 20 kg."""
    velocity = gaussian_filter1d(np.repeat(speeds, 600), 20)
    position = np.cumsum(velocity) * STEP + 1e-7 * rng.standard_normal(velocity.size)
    force = 20 * np.gradient(velocity, STEP) + 5 * np.sign(velocity) + 30 * velocity
    return record("steady", STEP, position=position, force=force + 0.02 * rng.standard_normal(velocity.size))


@pytest.mark.parametrize("speeds", [[0.05, -0.05], [0.02, -0.02, 0.05, -0.05, 0.1, -0.1]], ids=["one", "three"])
def test_constant_speed_without_a_stribeck_curve_gives_a_stage(speeds: list[float], base: Stage) -> None:
    low = base.replace({"masses.cart": "20 kg", STATIC: "2 N", COULOMB: "2 N"})
    identification = identify([(steady(speeds * 4, np.random.default_rng(1)), "constant-speed")], low)
    interval = identification.stage.uncertain()[COULOMB]
    assert interval.low < 5 < interval.high
    if len(speeds) > 2:
        assert {COULOMB, "friction.viscous", STATIC} <= {*identification.correlations.keys}
        matrix, keys = identification.correlations.matrix, identification.correlations.keys
        assert matrix[keys.index(COULOMB), keys.index(STATIC)] == pytest.approx(1)
        assert matrix[keys.index(COULOMB), keys.index("friction.viscous")] < -0.3


def test_settling_after_steps_of_force_is_not_friction() -> None:
    """Speeds that still approach their end are read with the inertia of the mass that the log itself shows.

    The axis of 8 kg has Coulomb friction of 10 N and viscous friction of 80 N s/m, hence a time constant of 0.1 s.
    """
    rng = np.random.default_rng(2)
    force = np.repeat([0, 15, 0, -40, 0, 25, 0, -15, 0, 40, 0, -25, 0, 30, 0, -30, 0.0], 1000)
    velocity = np.zeros(force.size)
    for k in range(force.size - 1):
        friction = 80 * velocity[k] + 10 * np.sign(velocity[k] or force[k])
        after = velocity[k] + STEP * (force[k] - friction) / 8
        velocity[k + 1] = 0.0 if velocity[k] * after < 0 or (abs(force[k]) < 10 and not velocity[k]) else after
    position = np.cumsum(velocity) * STEP + 1e-7 * rng.standard_normal(force.size)
    log = record("steps", STEP, position=position, force=force + 0.02 * rng.standard_normal(force.size))
    both = friction_velocity(log).both
    for estimate, value in ((both.coulomb, 10.0), (both.viscous, 80.0)):
        assert estimate.low <= value <= estimate.high
        assert (estimate.high - estimate.low) / value < 0.02
    assert both.curve is None


# which experiment a log is


def excited(lines: range, rng: np.random.Generator, periods: int = 6) -> Log:
    """A mass of 2 kg under a multisine of 2 s."""
    time, phases = np.arange(2000 * periods) * STEP, rng.uniform(0, 2 * np.pi, len(lines))
    force = sum(np.cos(np.pi * k * time + phase) for k, phase in zip(lines, phases, strict=True))
    position = sum(-np.cos(np.pi * k * time + p) / (2 * (np.pi * k) ** 2) for k, p in zip(lines, phases, strict=True))
    return record("excited", STEP, position=np.asarray(position), force=force + 0.01 * rng.standard_normal(time.size))


def repeated(acceleration: float, rest: int, rng: np.random.Generator) -> Log:
    """A move there and back within 2 s, repeated."""
    ramp = np.arange(1000 - rest)
    shape = np.clip(np.minimum(ramp, ramp[-1] - ramp) * STEP * acceleration, 0, 0.1)
    one = np.concatenate([shape, np.zeros(rest), -shape, np.zeros(rest)])
    velocity = gaussian_filter1d(np.tile(one, 5), 5, mode="wrap")
    force = 20 * np.gradient(velocity, STEP) + 30 * velocity + 5 * np.tanh(velocity / 1e-3)
    return record("moves", STEP, position=np.cumsum(velocity) * STEP, force=force + 0.02 * rng.standard_normal(10000))


@pytest.mark.cases(first=4)
@pytest.mark.parametrize("lines", [range(1, 9), range(1, 100), range(20, 100), range(10, 20)], ids=str)
@pytest.mark.parametrize("seed", range(3))
def test_a_multisine_is_an_excitation(lines: range, seed: int) -> None:
    assert recognised(excited(lines, np.random.default_rng(seed)), Path("log.csv"))[0] == "frequency"


@pytest.mark.cases(first=6)
@pytest.mark.parametrize("acceleration", [0.5, 1.0, 5.0])
@pytest.mark.parametrize("rest", [0, 100, 250, 400])
def test_a_repeated_move_is_none(acceleration: float, rest: int) -> None:
    """Where the stage rests briefly and accelerates hard, the command asks which kind of experiment it is instead."""
    log = repeated(acceleration, rest, np.random.default_rng(2))
    try:
        kind = recognised(log, Path("log.csv"))[0]
    except InputError as error:
        kind = error.example
    assert kind in (["moves"] if rest == 400 or acceleration < 5 else ["moves", "--as moves"])


# what moves a loop from outside


@pytest.mark.thorough
def test_the_injected_force_makes_the_estimate_indirect() -> None:
    """A mass of 2 kg in a loop, with forces from elsewhere that bias the direct estimate."""
    rng = np.random.default_rng(0)
    injected = np.asarray(excited(range(1, 80), rng, 10)["force"])
    elsewhere = 4 * gaussian_filter1d(rng.standard_normal(injected.size), 4, mode="wrap") * 4
    position, force = np.zeros(injected.size), np.zeros(injected.size)
    x = v = 0.0
    for i in range(injected.size):
        position[i], force[i] = x, -2 * 60.0**2 * x - 2 * 80.0 * v + injected[i]
        v += (force[i] + elsewhere[i]) / 2 * STEP
        x += v * STEP
    held = {"position": position, "force": force, "reference": np.zeros(injected.size)}
    assert external(record("held", STEP, **held)) is None
    labels = record("told", STEP, **held, disturbance=injected)
    assert external(labels) == "disturbance"
    off = {}
    for log in (labels, record("held", STEP, **held)):
        bench = analyse([log])
        model = -1 / (2 * (2 * np.pi * bench.driven.frequency) ** 2)
        off[log.name] = np.median(np.abs(bench.driven.response / model - 1))
        if log is labels:
            assert not any("give the" in text for text in bench.warnings)
    assert off["told"] < 0.5 * off["held"]


@pytest.mark.parametrize("share", [0.0, 0.5, 0.9])
def test_residuals_are_correlated_over_the_length_of_their_model(share: float) -> None:
    """For a first-order autoregression, of whatever size, the autocorrelation sums to (1 + share) / (1 - share)."""
    noise = 1e-6 * np.random.default_rng(5).standard_normal(60_000)
    rows = lfilter([1.0], [1.0, -share], noise)
    assert correlation_length(rows) == pytest.approx((1 + share) / (1 - share), rel=0.2, abs=0.5)
