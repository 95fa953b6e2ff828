"""Linear active disturbance rejection, which friso has as a transfer function, against the observer written by hand."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import lfilter, ss2tf
from test_cascade import sampled_forces
from variants import limit, lugre, stage, there_and_back

import friso
from friso.engine.batch import simulate
from friso.equations.bandwidth import faster
from friso.equations.controllers.pid import crossing_ratio
from friso.errors import InputError
from friso.frequency.margins import margins
from friso.frequency.system import limit_cases
from friso.remedies.catalogue import linear_flat
from friso.stage import Stage

MASS, RATIO = 1.7, 5.0
STATIC, COULOMB, STRIBECK, SIGMA_0, SIGMA_1, SIGMA_2 = 3.0, 1.0, 1.6e-3, 1e5, 1e5**0.5, 0.5


def rigid(bandwidth: float, duration: str = "20 s", extra: str = "") -> Stage:
    controller = f'kind = "adrc"\nbandwidth = "{bandwidth!r} Hz"\nobserver_ratio = {RATIO}\n{extra}'
    return stage(there_and_back(duration, "5 s", "100 m/s^2"), friction=lugre(2), controller=controller)


def observer(bandwidth: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A, B, C of the observer with its feedback, from the error to the force: states e1, e2, e3 (Gao 2003)."""
    wc = 2 * np.pi * bandwidth
    wo = RATIO * wc
    gains = np.array([3 * wo, 3 * wo**2, wo**3])
    feedback = np.array([wc**2, 2 * wc, 1.0])
    a = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]])
    a -= np.outer(gains, [1.0, 0.0, 0.0])
    a -= np.outer([0.0, 1.0, 0.0], feedback)
    return a, gains[:, None], MASS * feedback[None, :]


def by_radau(bandwidth: float, times: np.ndarray) -> np.ndarray:
    """Positions [m] at times [s] of the mass with LuGre friction, moved by 90 mm; observer and all by hand."""
    a, b, c = observer(bandwidth)
    acceleration, time = 100.0, 0.03

    def moved(t: float) -> float:
        return acceleration * (t**2 / 2 if t < time else time**2 - max(2 * time - t, 0.0) ** 2 / 2)

    def rates(t: float, x: np.ndarray) -> np.ndarray:
        level = COULOMB + (STATIC - COULOMB) * np.exp(-((x[1] / STRIBECK) ** 2))
        slip = x[1] - SIGMA_0 * abs(x[1]) * x[2] / level
        friction = SIGMA_0 * x[2] + SIGMA_1 * slip + SIGMA_2 * x[1]
        error = moved(t) - x[0]
        return np.array([x[1], (c[0] @ x[3:] - friction) / MASS, slip, *(a @ x[3:] + b[:, 0] * error)])

    x, positions = np.zeros(6), []
    for begin, end in pairwise([0.0, time, 2 * time, times[-1]]):
        inside = times[(times >= begin) & (times < end)]
        run = solve_ivp(rates, (begin, end), x, "Radau", [*inside, end], rtol=1e-8, atol=1e-11, max_step=5e-3)
        positions.append(run.y[0, :-1])
        x = run.y[:, -1]
    return np.append(np.concatenate(positions), x[0])


@pytest.mark.slow
def test_the_trace_is_that_of_the_observer() -> None:
    times = np.linspace(0, 2, 101)
    run = simulate(rigid(3.0, "10 s"), sample_time=0.02)
    assert run["position"].values[:101] == pytest.approx(by_radau(3.0, times), abs=2e-7)


def test_a_drive_carries_out_the_observer_by_the_bilinear_transform() -> None:
    flat = {**rigid(8.0).flat(), "drive.sample_time": 1e-3}
    error = np.random.default_rng(5).normal(size=300).cumsum() * 1e-4
    a, b, c = observer(8.0)
    ahead, back = np.eye(3) + a * 5e-4, np.linalg.inv(np.eye(3) - a * 5e-4)
    upper, lower = ss2tf(back @ ahead, back @ b * 1e-3, c @ back, c @ back @ b * 5e-4)
    assert sampled_forces(flat, error, 0 * error, 0 * error) == pytest.approx(lfilter(upper[0], lower, error), rel=1e-6)


def test_it_is_written_read_and_made_faster() -> None:
    machine = rigid(3.0, extra=limit("90 N"))
    assert friso.loads(machine.to_toml()) == machine
    assert faster(machine.flat(), 2.0)["controller.bandwidth"] == 6.0
    with pytest.raises(InputError, match=r"controller\.bandwidth"):
        machine.replace({"drive": {"sample_time": "20 ms"}})


def test_it_crosses_0_db_where_its_ratio_says() -> None:
    """For the mass that the controller believes in."""
    machine = rigid(3.0).replace({"controller.tuned_mass": f"{MASS} kg"})
    assert crossing(machine) == pytest.approx(crossing_ratio(RATIO) * 3.0, rel=0.02)


def crossing(machine: Stage) -> float:
    flat = linear_flat(machine, machine.flat())
    return min(margins(flat, limit_cases(flat)["sliding"]).crossovers)
