"""The describing function of friction: closed forms, python-control, plain integration, and invariants."""

from collections.abc import Callable
from typing import Any

import control
import numpy as np
import pytest
from refusals import refused
from scipy.integrate import solve_ivp
from scipy.special import dawsn
from variants import (
    DAHL,
    HOLD,
    NO_FRICTION,
    dwell,
    elasto_plastic,
    free,
    gms,
    load_dependent,
    lugre,
    maxwell,
    rolling,
    stage,
    stribeck,
    van_dijk,
)

from benchmarks import by_hand as plain
from friso.stage import Stage
from friso.stage.tables import FRICTION
from friso_thesis.studies.describing.balance import TOUCHES
from friso_thesis.studies.describing.function import Imposition, describing, dynamic_stiffness, steady
from friso_thesis.studies.describing.response import NOT_FOUND, mass_line, plant_response
from friso_thesis.studies.describing.settings import DescribingSettings

LAWS = {
    "lugre": lugre(2),
    "dahl": DAHL,
    "stribeck": stribeck(2) + "asymmetry = 0.2\n",
    "maxwell_slip": maxwell(),
    "elasto_plastic": elasto_plastic(),
    "gms": gms(),
    "rolling": rolling(),
    "dwell": dwell(),
    "load_dependent": load_dependent(),
}
STICKING = {"maxwell_slip", "elasto_plastic", "gms"}
"""Laws of which all or a part follows small motions as a spring."""


def rigid(friction: str) -> Stage:
    return stage(HOLD, friction=friction, controller=van_dijk())


def test_every_law_with_a_force_is_tried() -> None:
    assert {name.split()[0] for name in FRICTION.classes} - {"none"} <= set(LAWS)


def of(flat: dict[str, Any], amplitude: Any, frequency: Any, **how: Any) -> np.ndarray:
    pairs = np.broadcast_arrays(np.atleast_1d(amplitude).astype(float), frequency)
    return dynamic_stiffness(flat, *(np.array(pair, dtype=float) for pair in pairs), **how)


def changed(law: str, **values: float) -> dict[str, Any]:
    return rigid(law).flat() | {f"friction.{name}": value for name, value in values.items()}


def order(errors: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Observed orders of convergence in 1/size."""
    return -np.diff(np.log(errors)) / np.diff(np.log(sizes))


# closed forms


STIFFNESSES = np.array([1e8, 1e9, 1e10])


def test_static_limit_is_coulomb_plus_stiction() -> None:
    """Bristles without deflection and damping: F = g(v) sign(v) + sigma_2 v, g = F_c + (F_s - F_c) exp(-(v/v_s)^2).

    F_1 = i 4/pi (F_c + (F_s - F_c) D(a)/a) + i omega sigma_2 A, a = A omega/v_s, D Dawson's function, since the
    integral of exp(-a^2 sin^2 t) sin t over a quarter period is D(a)/a. At the turn of the motion the force changes
    over a way of F_s/sigma_0 and so over an angle that falls with its square root, which the real part feels, and the
    imaginary part (the loss) by its square.
    """
    speeds = np.array([0.05, 0.5, 1.0, 3.0, 20.0]) * 1.6e-3
    frequency = 2.0
    amplitudes = speeds / (2 * np.pi * frequency)
    level = 1 + 2 * dawsn(speeds / 1.6e-3) / (speeds / 1.6e-3)
    expected = 4 / np.pi * level / amplitudes + 2 * np.pi * frequency * 0.5
    laws = [changed(LAWS["lugre"], bristle_stiffness=sigma_0, bristle_damping=0.0) for sigma_0 in STIFFNESSES]
    off = np.array([of(law, amplitudes, frequency) for law in laws]) / expected - 1j
    assert np.max(np.abs(np.imag(off[-1]))) < 1e-4
    for one in off.T:
        assert order(np.abs(np.imag(one)), STIFFNESSES) == pytest.approx(1.0, abs=0.02)
        assert order(np.real(one), STIFFNESSES) == pytest.approx(0.5, abs=0.02)


def test_relay_of_python_control() -> None:
    """Coulomb friction is a relay on the velocity: N = i omega DF(A omega); Dahl's loses F_c/(sigma_0 A) less."""
    relay = control.relay_hysteresis_nonlinearity(1.0, 0.0)
    expected = 6 * np.pi * np.real(control.describing_function(relay, [6 * np.pi * 1e-3]))
    laws = [changed(DAHL, bristle_stiffness=sigma_0, viscous=0.0) for sigma_0 in STIFFNESSES]
    off = np.array([of(law, 1e-3, 3.0) for law in laws])[:, 0] / expected - 1j
    assert np.imag(off) == pytest.approx(-1.0 / (STIFFNESSES * 1e-3), rel=1e-3)
    assert order(np.real(off), STIFFNESSES) == pytest.approx(0.5, abs=0.02)


def test_static_law_equals_python_control() -> None:
    """A curve of force against velocity, here larger forwards, has N = i omega DF(A omega), with no limit taken."""
    flat = rigid(LAWS["stribeck"]).flat()
    amplitudes, omega = np.array([2e-5, 1e-4, 1e-3]), 2 * np.pi * 5.0

    def curve(v: float) -> float:
        return plain.friction(flat, v, 0.0)[0]

    result = control.describing_function(curve, amplitudes * omega, num_points=4000)
    assert of(flat, amplitudes, 5.0) == pytest.approx(1j * omega * result, rel=1e-7)


def test_presliding_limit() -> None:
    """Amplitudes far below break-away: sigma_0 + i omega (sigma_1 + sigma_2), up to terms proportional to A."""
    flat, frequency = rigid(LAWS["lugre"]).flat(), 7.0
    expected = 1e5 + 2j * np.pi * frequency * (flat["friction.bristle_damping"] + 0.5)
    amplitudes = np.array([1e-8, 1e-9, 1e-10])
    errors = np.abs(of(flat, amplitudes, frequency) / expected - 1)
    assert errors[-1] < 1e-5
    assert order(errors, 1 / amplitudes) == pytest.approx(1.0, abs=0.1)
    (dahl,) = of(rigid(DAHL).flat(), 1e-10, frequency)
    assert dahl == pytest.approx(1e5 + 2j * np.pi * frequency * 0.5, rel=2e-5)


# independent integration


def settled(flat: dict[str, Any], amplitude: float, frequency: float, periods: int) -> complex:
    """F_1/A from SciPy's Radau over periods of which the last one counts; the first one starts from z = 0."""
    omega = 2 * np.pi * frequency

    def velocity(t: float) -> float:
        return -amplitude * omega * np.sin(omega * t)

    def rates(t: float, y: np.ndarray) -> list[float]:
        force, z_rate = plain.friction(flat, velocity(t), y[0])
        return [z_rate, 2 * force * np.cos(omega * t), -2 * force * np.sin(omega * t)]

    start, end, y = 0.0, 0.0, np.zeros(3)
    for half in range(2 * periods):  # from kink to kink, at which the velocity is zero
        start, end = end, (half + 1) / (2 * frequency)
        if half == 2 * periods - 2:
            y[1:] = 0.0
        solution = solve_ivp(rates, (start, end), y, "Radau", rtol=1e-9, atol=1e-12, max_step=(end - start) / 40)
        y = solution.y[:, -1]
    return complex(y[1], y[2]) * frequency / amplitude


@pytest.mark.slow
@pytest.mark.parametrize(
    ("amplitude", "frequency", "periods"), [(3e-5, 0.1, 7), (1e-4, 100.0, 2), (1e-3, 5.0, 2), (2e-2, 2.0, 2)]
)
def test_plain_integration(amplitude: float, frequency: float, periods: int) -> None:
    """The reference is the law written by hand."""
    flat = rigid(LAWS["lugre"]).flat()
    (value,) = of(flat, amplitude, frequency)
    assert abs(value / settled(flat, amplitude, frequency, periods) - 1) < 1e-8


def test_long_memory_is_solved_for() -> None:
    """At 10 nm a state takes thousands of periods to forget its start: settling for three periods is not enough."""
    flat = rigid(LAWS["lugre"]).flat()
    friction = Imposition.of(flat, np.array([1e-8]), np.array([10.0]), 1e-10)
    steady_state = steady(friction)
    (_, results), *_ = friction.run(steady_state.inner, 1.0)
    z = friction.kernel.states.index("bristle_deflection")
    assert results.ends[0, z] == pytest.approx(steady_state.inner[0, 0], rel=1e-6)
    (_, three), *_ = friction.run(np.zeros((1, 1)), 3.0)
    assert abs(three.ends[0, z] / steady_state.inner[0, 0] - 1) > 0.5


# how exact, and invariants


@pytest.mark.parametrize("rtol", [1e-2, 1e-3, 1e-4])
def test_loose_tolerance_still_finds_the_periodic_state(rtol: float) -> None:
    """The gap that counts as none does not grow with the tolerance without end."""
    flat, amplitudes = rigid(LAWS["lugre"]).flat(), [1e-8, 1e-5, 3e-5, 1e-3]
    assert np.max(np.abs(of(flat, amplitudes, 10.0, rtol=rtol) / of(flat, amplitudes, 10.0) - 1)) < 1e-6
    assert float(describing(rigid(LAWS["lugre"]), amplitudes, [10.0], rtol=rtol)["gap"].max()) < 1e-4


def test_sampled_harmonics_converge_with_the_square_of_the_samples() -> None:
    many = np.array([1024, 4096, 16384])
    result = [describing(rigid(LAWS["lugre"]), [0.1], [100.0], 9, int(samples)) for samples in many]
    errors = np.array([float(entry["aliasing"].item()) for entry in result])
    assert errors[-1] < 2e-5
    assert order(errors, many) == pytest.approx(2.0, abs=0.1)
    third = [item["force"].values[0, 0, 3] for item in result]
    assert abs(third[1] / third[2] - 1) < 1e-2


@pytest.mark.cases(first=5)
@pytest.mark.parametrize("law", LAWS)
def test_whole_and_half_period_agree(law: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A symmetric law followed over a whole period has the harmonics of half a period and no even ones; what sticks
    throughout, as some of it does at less than 1 mm, bears a constant force, which depends on where it started."""
    amplitudes, frequencies = np.array([1e-6, 3e-5, 1e-3]), [0.5, 20.0]
    half = describing(rigid(LAWS[law]), amplitudes, frequencies, 5)
    monkeypatch.setattr(Imposition, "symmetric", False)
    whole = describing(rigid(LAWS[law]), amplitudes, frequencies, 5)
    assert set(np.ravel(whole["status"])) == {"done"}
    off, even = np.abs(half["force"] - whole["force"]).values, np.abs(whole["force"].values[..., ::2])
    if law in STICKING:
        off[:2, :, 0] = even[:2, :, 0] = 0.0
    assert np.max(off) < 1e-6
    assert (np.max(even) < 1e-6) == (law != "stribeck")


def test_asymmetric_sliding_has_a_mean_force() -> None:
    """Levels (1 +- 0.2) F_c at speed: a mean of 0.2 F_c, and Coulomb's N on average."""
    responses = describing(rigid(LAWS["stribeck"]), [0.2], [1.0], 3)
    assert responses["force"].values[0, 0, 0] == pytest.approx(0.2, rel=0.02)
    assert np.imag(responses["stiffness"].item()) == pytest.approx(4 / np.pi / 0.2 + np.pi, rel=0.01)


def test_friction_may_differ_from_pair_to_pair() -> None:
    flat, levels = rigid(LAWS["lugre"]).flat(), np.array([1.5, 3.0])
    both = of(flat | {"friction.static": levels}, [1e-4, 1e-4], 2.0)
    assert both == pytest.approx([of(flat | {"friction.static": level}, 1e-4, 2.0)[0] for level in levels], rel=1e-12)


# what a user may get wrong


@pytest.mark.parametrize(
    "ask",
    [
        lambda: describing(rigid(NO_FRICTION), [1e-3], [1.0]),
        lambda: describing(rigid(DAHL), [0.0], [1.0]),
        lambda: describing(rigid(DAHL), [1.0], [np.nan]),
        lambda: describing(rigid(DAHL), [1.0], [1.0], 0),
        lambda: describing(rigid(DAHL), [1.0], [1.0], 9, 32),
        lambda: plant_response(rigid(DAHL), [-1.0], [1.0]),
        lambda: plant_response(rigid(NO_FRICTION), [1.0], [1.0]),
    ],
)
def test_bad_input(ask: Callable[[], object]) -> None:
    with refused():
        ask()


def test_a_state_that_does_not_close_is_said_so(monkeypatch: pytest.MonkeyPatch) -> None:
    with DescribingSettings(secant_steps=1).in_use():
        responses = describing(rigid(LAWS["lugre"]), [1e-5], [1.0])
        assert responses["status"].item() not in ("", "done")
        assert np.isnan(responses["stiffness"].item())


# the plant


def compliance(frequency: float) -> complex:
    """A mass of 1.7 kg on bristles that do not slip."""
    omega = 2 * np.pi * frequency
    return 1 / (1e5 - 1.7 * omega**2 + 1j * omega * (316.2277660168379 + 0.5))


def test_small_forces_see_the_bristles_and_large_ones_the_mass() -> None:
    response = plant_response(rigid(LAWS["lugre"]), [1e-4], [1.0, 38.0, 200.0])
    expected = [compliance(frequency) for frequency in (1.0, 38.0, 200.0)]
    assert response["up"].values[0] == pytest.approx(np.array(expected), rel=1e-4)
    large, omega = plant_response(rigid(LAWS["lugre"]), [300.0], [5.0]), 2 * np.pi * 5
    assert large["up"].item() == pytest.approx(1 / (-1.7 * omega**2 + 0.5j * omega), rel=0.01)


def driven(force: Callable[[float], float], frequency: float, start: list[float], cycles: int) -> complex:
    """Return the first harmonic of the position of 1.7 kg under a sinusoidal force, in the last cycle (LSODA)."""
    flat, omega, samples = rigid(LAWS["lugre"]).flat(), 2 * np.pi * frequency, 512

    def rates(t: float, y: np.ndarray) -> list[float]:
        friction, z_rate = plain.friction(flat, y[1], y[2])
        return [y[1], (force(t) * np.cos(omega * t) - friction) / 1.7, z_rate]

    times = np.arange(cycles * samples) / samples / frequency
    how = {"rtol": 1e-8, "atol": [1e-11, 1e-10, 1e-12], "max_step": 0.01 / frequency}
    position = solve_ivp(rates, (0, cycles / frequency), start, "LSODA", times, **how).y[0, -samples:]
    return complex(2 * np.mean(position * np.exp(-2j * np.pi * np.arange(samples) / samples)))


@pytest.mark.cases(first=1)
@pytest.mark.parametrize(
    ("size", "frequency", "error"), [(0.5, 5.0, 0.003), (5.0, 10.0, 0.02), (3.0, 20.0, 0.05), (10.0, 60.0, 0.01)]
)
def test_response_against_simulation(size: float, frequency: float, error: float) -> None:
    """The first harmonic alone acts on the friction: a few percent (docs/evidence/describing.md has the table)."""
    response = plant_response(rigid(LAWS["lugre"]), [size], [frequency])
    assert response["answers"].item() == 1
    start = complex(size * response["up"].item())
    velocity = (2j * np.pi * frequency * start).real
    simulated = driven(lambda _: size, frequency, [start.real, velocity, 0.0], 20)
    assert abs(start / simulated - 1) < error


@pytest.mark.slow
def test_two_motions_under_one_force() -> None:
    """1.8 N at 5 Hz: stuck if it comes from rest, sliding if it slid before, and nothing between that lasts."""
    result = plant_response(rigid(LAWS["lugre"]), [1.8], [5.0]).squeeze()
    assert result["lasting"].values.tolist() == [1.0, 0.0, 1.0]
    assert np.max(result["error"]) < 1e-9
    stuck, _, sliding = 1.8 * result["response"].values
    from_rest = driven(lambda t: 1.8 * min(1.0, t * 5 / 20), 5.0, [0.0, 0.0, 0.0], 60)
    start = [sliding.real, (10j * np.pi * sliding).real, 0.0]
    assert abs(from_rest / stuck - 1) < 0.15  # near break-away, of which the first harmonic knows little: it is 0.142
    assert abs(driven(lambda _: 1.8, 5.0, start, 30) / sliding - 1) < 0.2  # 24 % too large: 0.193


@pytest.mark.slow
def test_absurd_forces_and_frequencies_have_a_status() -> None:
    response = plant_response(rigid(LAWS["lugre"]), [1e-300, 1.0, 1e300], [1e-6, 1.0, 1e6])
    assert set(np.ravel(response["status"].values[[0, 2]])) == {NOT_FOUND}
    assert np.all(np.isnan(response["up"].values[[0, 2]]))
    assert set(response["status"].values[1]) == {"done"}


@pytest.mark.slow
def test_an_analyser_shows_the_branch_it_comes_from() -> None:
    response = plant_response(rigid(LAWS["lugre"]), [2.0], np.geomspace(1, 20, 30))
    several = response["answers"].values[0] == 3
    assert several.any()
    assert not several.all()
    up, down = np.abs(response["up"].values[0]), np.abs(response["down"].values[0])
    assert np.all(down[several] > 10 * up[several])
    assert up[~several] == pytest.approx(down[~several])


JOINED = stage(HOLD, masses="both", friction=lugre(2), joint=free("100 mm"), controller=van_dijk())


def against_simulation(size: float, frequency: float, cycles: int = 25) -> complex:
    """Return the response of stage and cart on a free joint over that of the equations (LSODA), in the last cycle."""
    result, flat, samples = plant_response(JOINED, [size], [frequency]), JOINED.flat(), 512
    omega, cart, moved = (
        2 * np.pi * frequency,
        *(size * result[n].values[0, 0, 0] for n in ("cart_response", "response")),
    )

    def rates(t: float, y: np.ndarray) -> list[float]:
        friction, z_rate = plain.friction(flat, y[1], y[4])
        pull = plain.joint(flat, y[2] - y[0], y[3] - y[1])
        drive = (size * np.cos(omega * t) - pull) / flat["masses.stage"]
        return [y[1], (pull - friction) / flat["masses.cart"], y[3], drive, z_rate]

    start = [cart.real, (1j * omega * cart).real, moved.real, (1j * omega * moved).real, 0.0]
    times = np.arange(cycles * samples) / samples / frequency
    how = {"rtol": 1e-8, "atol": 1e-12, "max_step": 0.01 / frequency}
    position = solve_ivp(rates, (0, cycles / frequency), start, "LSODA", times, **how).y[2, -samples:]
    return complex(moved / (2 * np.mean(position * np.exp(-2j * np.pi * np.arange(samples) / samples))))


@pytest.mark.slow
@pytest.mark.parametrize(("size", "frequency", "error"), [(1.0, 3.0, 1e-3), (6.0, 20.0, 5e-3)])
def test_free_joint_against_simulation(size: float, frequency: float, error: float) -> None:
    """docs/evidence/describing.md has more of them."""
    assert abs(abs(against_simulation(size, frequency)) - 1) < error


@pytest.mark.thorough
def test_free_joint_has_its_resonances_and_its_stroke() -> None:
    """Stuck cart: 11.03 Hz; sliding cart: antiresonance 7.12 Hz, resonance 13.12 Hz (references.md, section 5)."""
    joined = stage(HOLD, masses="both", friction=lugre(2), joint=free("1 mm"), controller=van_dijk())
    frequencies = np.linspace(5, 16, 111)
    small = plant_response(joined, [1e-3], frequencies)
    assert frequencies[np.argmax(np.abs(small["up"].values[0]))] == pytest.approx(11.03, abs=0.15)
    large = plant_response(joined, [1e3], frequencies)
    answer = np.abs(large["up"].values[0])
    assert frequencies[np.argmax(answer)] == pytest.approx(13.12, abs=0.15)
    assert frequencies[np.argmin(answer)] == pytest.approx(7.12, abs=0.15)
    assert set(np.ravel(small["status"])) == {"done"}
    assert TOUCHES in np.ravel(large["status"])


def test_mass_line_scatters_where_friction_matters() -> None:
    places = [{"friction.static": f"{level!r} N", "friction.coulomb": f"{level / 3!r} N"} for level in (1.0, 1.75, 2.5)]
    line = mass_line(rigid(LAWS["lugre"]), places, [3.0], [20.0, 400.0])
    assert float(line["spread_magnitude"].values[0, 0]) > 0.02
    assert float(line["spread_magnitude"].values[0, 1]) < 1e-3
    assert line["magnitude"].values[:, 0, 1] == pytest.approx(np.ones(3), abs=0.03)
