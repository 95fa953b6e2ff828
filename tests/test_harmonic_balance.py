"""Harmonic balance of a loop with friction: where it works, and that for hunting it does not until very late."""

from collections.abc import Callable

import numpy as np
import pytest
from refusals import refused
from scipy.integrate import solve_ivp
from variants import DAHL, HOLD, LOCKED, MEASURED, NO_FRICTION, PARASITIC, gains, lugre, stage, stribeck, van_dijk

from benchmarks import by_hand as plain
from friso.hunting import Ensemble, find_cycles
from friso.stage import Stage
from friso_thesis.studies.describing.balance import DEFAULT_FREQUENCIES, receptance, single_harmonic
from friso_thesis.studies.describing.function import dynamic_stiffness
from friso_thesis.studies.describing.multi import (
    DONE,
    OPEN,
    REST,
    HarmonicSeries,
    OneStateLaw,
    balanced,
    friction_answer,
)
from friso_thesis.studies.harmonic_balance import harmonic_balance

GRID = (np.geomspace(1e-8, 1, 81), np.geomspace(1e-3, 1e3, 91))

KP, KI, KD, MASS, COULOMB = 1000.0, 15_000.0, 20.0, 1.7, 1.0


def unstable(bristles: str) -> Stage:
    """Too much integral action, k_i m > k_p k_d: it grows unless friction takes out more than is fed."""
    friction = DAHL.replace("1e5 N/m", bristles).replace("0.5 N*s/m", "0 N*s/m")
    return stage(HOLD, friction=friction, controller=gains(KP, KI, KD, extra=MEASURED))


def hunting(crossover: float, joint: str = "", parasitic: str = "") -> Stage:
    """Table 2 of the thesis: one rigid mass of 1.7 kg, or with the joint locked."""
    controller = van_dijk(f"{crossover!r} Hz")
    return stage(HOLD, friction=lugre(2), joint=joint, parasitic=parasitic, controller=controller)


def near_sine() -> tuple[float, float]:
    """Amplitude and angular frequency at which Coulomb friction takes out what the integrator feeds: the real part of
    the balance is k_p = m omega^2, the imaginary one 4 F_c/(pi A) = k_i/omega - k_d omega."""
    omega = np.sqrt(KP / MASS)
    return 4 * COULOMB / np.pi / (KI / omega - KD * omega), omega


# where it works


@pytest.mark.slow
def test_single_harmonic_balance_finds_a_cycle_that_is_there() -> None:
    amplitude, omega = near_sine()
    harmonic = single_harmonic(unstable("1e8 N/m"), *GRID)
    assert harmonic.amplitudes == pytest.approx(
        [amplitude], rel=2e-3
    )  # but for the angle over which friction turns round
    assert harmonic.frequencies == pytest.approx([omega / (2 * np.pi)], rel=2e-4)
    assert np.all(harmonic.residuals < 1e-9)


@pytest.mark.slow
def test_multi_harmonic_balance_finds_it_too() -> None:
    """With one harmonic it equals single-harmonic balance; with many, the motion comes back to its start."""
    amplitude, omega = near_sine()
    times = np.arange(1024) * 2 * np.pi / omega / 1024
    flat = unstable("1e5 N/m").flat()
    one, many = (balanced(flat, times, amplitude * np.cos(omega * times), highest) for highest in (1, 151))
    harmonic = single_harmonic(unstable("1e5 N/m"), *GRID)
    assert (one.status, many.status) == (DONE, DONE)
    assert [one.amplitude, one.omega / (2 * np.pi)] == pytest.approx(
        [harmonic.amplitudes[0], harmonic.frequencies[0]], rel=1e-5
    )
    start = at_start(flat, many)
    held = plain.rates({**flat, "motion.kind": "hold"}, tuple(start))
    end = solve_ivp(held, (0, many.period), [*start.values()], "LSODA", rtol=1e-9, atol=1e-13, max_step=1e-3).y[:, -1]
    sizes = many.amplitude * np.array([1, omega, 1 / omega])
    assert np.max(np.abs(end[:3] - [*start.values()][:3]) / sizes) < 1e-4
    assert many.amplitude / one.amplitude - 1 == pytest.approx(-0.0156, abs=2e-4)


def at_start(flat: dict[str, float], series: HarmonicSeries) -> dict[str, float]:
    """States of a balanced motion of the rigid mass with Dahl friction at time 0."""
    turns = 1j * series.orders * series.omega
    middles = np.outer((np.arange(8192) + 0.5) / 8192 * series.period, turns)
    answer = friction_answer(
        OneStateLaw.of(flat), np.real(np.exp(middles) @ (turns * series.cart)), series.period / 8192, 1.0
    )
    return {
        "position": float(np.sum(np.real(series.cart))),
        "velocity": float(np.sum(np.real(turns * series.cart))),
        "integral": float(np.sum(np.real(-series.cart / turns))),
        "bristle_deflection": float(answer.force[0] + answer.force[-1]) / 2 / flat["friction.bristle_stiffness"],
    }


@pytest.mark.parametrize("friction", [lugre(2), DAHL, stribeck(2) + "asymmetry = 0.2\n"])
def test_friction_on_a_sine_has_its_describing_function(friction: str) -> None:
    """The chain of midpoints against the engine, over half a period or a whole one: of second order in the interval."""
    flat, frequency = hunting(8.0).flat() | stage(HOLD, friction=friction, controller=gains()).flat(), 5.0
    halves, sign = (2, 1.0) if "asymmetry" in friction else (1, -1.0)
    for amplitude in (1e-5, 1e-3):
        expected = dynamic_stiffness(flat, np.array([amplitude]), np.array([frequency]))[0]
        errors = []
        for count in (2000, 8000):
            angles = halves * np.pi * (np.arange(count) + 0.5) / count
            velocity = -2 * np.pi * frequency * amplitude * np.sin(angles)
            force = friction_answer(OneStateLaw.of(flat), velocity, halves / (2 * frequency * count), sign).force
            errors.append(abs(2 * np.mean(force * np.exp(-1j * angles)) / amplitude / expected - 1))
        assert errors[1] < 1e-4
        assert errors[1] < errors[0] / 10 or errors[1] < 1e-7


def test_derivative_of_the_force_by_the_motion() -> None:
    flat, rng = hunting(8.0).flat(), np.random.default_rng(1)
    angles = np.pi * (np.arange(400) + 0.5) / 400
    velocity = 3e-3 * np.sin(angles) + 1e-3 * np.sin(3 * angles + 1)
    aside = rng.normal(size=(400, 2)) * 1e-9
    law, interval = OneStateLaw.of(flat), 1e-3
    result = friction_answer(law, velocity, interval, -1.0).along(aside)
    for k in range(2):
        ahead, behind = (friction_answer(law, velocity + s * aside[:, k], interval, -1.0).force for s in (1, -1))
        assert (ahead - behind) / 2 == pytest.approx(result[:, k], rel=1e-4, abs=1e-4 * np.max(np.abs(result)))


def test_receptance_is_that_of_the_closed_loop() -> None:
    """For one mass, x = -F/(m s^2 + C(s)), with the controller of Eq. 7 and 8 written out.

    At 0.1 mHz the integrator exceeds the mass by ten orders of magnitude.
    """
    frequencies = np.array([1e-4, 0.3, 5.0, 40.0])
    s, omega = 2j * np.pi * frequencies, 2 * np.pi * 8.0
    tau_z, k_p = np.sqrt(10) / omega, 1.7 * omega**2 / np.sqrt(10)
    control = k_p * (1 + 1 / 2 + tau_z * s + 1 / (2 * tau_z * s)) / (1 + s / (omega * np.sqrt(10)))
    cart, moved = receptance(hunting(8.0).flat(), frequencies)
    loop = -1 / cart
    assert np.real(loop) == pytest.approx(np.real(1.7 * s**2 + control), rel=1e-6)
    assert np.imag(loop) == pytest.approx(np.imag(control), rel=1e-9)
    assert cart == pytest.approx(moved, rel=1e-12)


# where it does not


@pytest.mark.thorough
def test_hunting_by_harmonic_balance() -> None:
    """One harmonic finds no cycle; with many, the amplitude is off by 0.6 % at the 101st, 0.01 % at the 201st."""
    result = harmonic_balance(hunting(8.0), [8.0], (1, 25, 51, 101, 201)).squeeze()
    assert float(result["period"]) == pytest.approx(1.62757, abs=1e-4)
    assert float(result["amplitude"]) == pytest.approx(0.5202e-3, rel=1e-3)
    assert int(result["solutions"]) == 0
    assert result["multiplier"].attrs["of"].startswith("the symmetric cycle")
    assert "approximation" in result["period_error"].attrs["of"]
    assert float(result["least_residual"]) > 0.25
    assert set(result["status"].values[:3]) <= {REST, OPEN}
    assert set(result["status"].values[3:]) == {DONE}
    assert np.all(np.isnan(result["amplitude_error"].values[:3]))
    assert result["amplitude_error"].values[3:] == pytest.approx([-6.3e-3, -1.35e-4], rel=0.02)
    assert result["period_error"].values[3:] == pytest.approx([2.69e-3, 4.1e-5], rel=0.02)


@pytest.mark.slow
def test_no_single_harmonic_answer_from_4_to_9_5_hz() -> None:
    for crossover, least in ((4.0, 0.17), (6.0, 0.22), (9.5, 0.30)):
        harmonic = single_harmonic(hunting(crossover), *GRID)
        assert harmonic.amplitudes.size == 0
        assert harmonic.least == pytest.approx(least, abs=0.01)
        assert GRID[1][0] < harmonic.least_frequency < GRID[1][-1]


@pytest.mark.slow
def test_where_the_integrator_can_drive_the_loop_is_a_spring_too() -> None:
    """Why: friction that damps (Im N > 0) needs a frequency at which the loop feeds, and there the loop is a spring, so
    that friction would have to be a negative one, which it is by far too little there."""
    for crossover in (4.0, 6.0, 8.0, 9.5):
        flat = hunting(crossover).flat()
        loop = -1 / receptance(flat, DEFAULT_FREQUENCIES)[0]
        feeds = np.imag(loop) < 0
        spring = np.min(np.real(loop[feeds]))
        amplitudes, frequencies = map(np.ravel, np.meshgrid(np.geomspace(1e-8, 1, 31), DEFAULT_FREQUENCIES[feeds]))
        assert spring > 0
        assert np.min(np.real(dynamic_stiffness(flat, amplitudes, frequencies))) > -spring / 10


def test_any_linear_mechanics() -> None:
    """The thesis rig with its joint locked, from the motion of the rigid mass: 0.520 mm at 8 Hz, of simulated turning
    points (references.md, section 2)."""
    rigid = one_period(hunting(8.0))
    locked = hunting(8.0, LOCKED, PARASITIC).flat()
    result = balanced(locked, *rigid, 201)
    assert result.status == DONE
    assert result.amplitude == pytest.approx(0.520e-3, abs=1e-6)
    assert np.abs(result.stage - result.cart).max() > 0


@pytest.mark.slow
def test_intervals_are_fine_enough() -> None:
    flat, motion = hunting(8.0).flat(), one_period(hunting(8.0))
    usual, fine = (balanced(flat, *motion, 201, intervals=item * 201) for item in (32, 128))
    left = 1 - 0.5202174e-3 / np.array([usual.amplitude, fine.amplitude])  # the simulated cycle
    assert left[1] / left[0] == pytest.approx(1.0, abs=0.05)


def one_period(one: Stage) -> tuple[np.ndarray, np.ndarray]:
    """A period of hunting, sampled: times [s] and positions [m]."""
    stages = Ensemble.held(one.flat(), 1)
    cycle = find_cycles(stages)
    run = stages.run(cycle.states, cycle.period, 1e-9, interval=cycle.period[0] / 8192)
    times = np.arange(8192) * cycle.period[0] / 8192
    return times, run.samples[0, :8192, stages.sticking]


@pytest.mark.parametrize(
    ("key", "ask"),
    [
        ("friction.model", lambda: harmonic_balance(stage(HOLD, friction=NO_FRICTION, controller=van_dijk()), [8.0])),
        (None, lambda: harmonic_balance(hunting(8.0), [-1.0])),
        (None, lambda: harmonic_balance(unstable("1e5 N/m"), [8.0])),
        (None, lambda: harmonic_balance(hunting(8.0), [300.0])),
        (None, lambda: single_harmonic(stage(HOLD, friction=NO_FRICTION, controller=van_dijk()))),
        (None, lambda: single_harmonic(hunting(8.0), [], [1.0])),
    ],
)
def test_bad_input(key: str | None, ask: Callable[[], object]) -> None:
    with refused(key):
        ask()
