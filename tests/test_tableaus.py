"""The methods' coefficients: observed order of solution, error estimate and dense output, and stability."""

import numpy as np
import pytest
import rosenbrock

from friso.engine.tableaus import TABLEAUS, Tableau

METHODS = pytest.mark.parametrize("method", TABLEAUS.values(), ids=TABLEAUS)
Real = np.longdouble


def rhs(x: np.ndarray, t: float) -> np.ndarray:
    """A pendulum, driven at a rising pitch, with damping that depends on place: nothing cancels by symmetry."""
    return np.array([x[1], -np.sin(x[0]) - 0.3 * x[1] * (1 + x[0] ** 2) + np.cos(t + t * t / 2)])


def derivatives(x: np.ndarray, t: float) -> tuple[np.ndarray, np.ndarray]:
    jacobian = [[0, 1], [-np.cos(x[0]) - 0.6 * x[0] * x[1], -0.3 * (1 + x[0] ** 2)]]
    return np.array(jacobian, dtype=Real), np.array([0, -np.sin(t + t * t / 2) * (1 + t)], dtype=Real)


START = np.array([0.5, 0.2], dtype=Real)


def march(method: Tableau, x: np.ndarray, steps: int, length: float = 1.0) -> np.ndarray:
    h = Real(length) / steps
    for i in range(steps):
        x = rosenbrock.step(method, rhs, *derivatives(x, i * h), x, i * h, h).end
    return x


@pytest.fixture(scope="module")
def exact() -> np.ndarray:
    """The state after 1 s, by steps so fine that only rounding is left."""
    return march(TABLEAUS["Rodas5P"], START, 1200)


def order(errors: list[float], ratio: float = 2.0) -> float:
    return float(np.log(errors[-2] / errors[-1]) / np.log(ratio))


@pytest.mark.slow
@METHODS
def test_order_of_the_solution(method: Tableau, exact: np.ndarray) -> None:
    errors = [float(np.linalg.norm(march(method, START, n) - exact)) for n in (40, 80)]
    assert order(errors) == pytest.approx(method.order, abs=0.1)


@METHODS
def test_order_of_the_error_estimate(method: Tableau) -> None:
    """The estimate of one step is of the embedded method's order plus one."""
    jacobian, drift = derivatives(START, 0)
    errors = [
        float(np.linalg.norm(rosenbrock.step(method, rhs, jacobian, drift, START, 0, h).error))
        for h in (1 / 128, 1 / 256)
    ]
    assert order(errors) == pytest.approx(method.error_order + 1, abs=0.1)


@pytest.mark.cases(first=2)
@METHODS
@pytest.mark.parametrize("theta", [0.2, 0.5, 0.8])
def test_order_of_the_dense_output(method: Tableau, theta: float) -> None:
    """Within a step the local error has one order more than the dense output: 4 (Rodas5P), 3 (Rodas4)."""
    jacobian, drift = derivatives(START, 0)
    errors = []
    for h in (1 / 64, 1 / 128):
        taken = rosenbrock.step(method, rhs, jacobian, drift, START, 0, h)
        there = march(TABLEAUS["Rodas5P"], START, 40, theta * h)
        errors.append(float(np.linalg.norm(rosenbrock.between(START, taken, theta) - there)))
    assert order(errors) == pytest.approx(method.order, abs=0.1)


@METHODS
def test_l_stability(method: Tableau) -> None:
    """For x' = -lambda x an infinitely fast decay vanishes in one step.

    No step grows on the imaginary axis or to its left.
    """

    def growth(z: complex) -> float:
        """abs(R(z)) through the real 2 x 2 system with eigenvalue z."""
        matrix = np.array([[z.real, -z.imag], [z.imag, z.real]], dtype=Real)
        x, still = np.array([1, 0], dtype=Real), np.zeros(2, Real)
        return float(np.linalg.norm(rosenbrock.step(method, lambda x, t: matrix @ x, matrix, still, x, 0, 1).end))

    assert growth(-1e12) < 1e-10
    axis = np.geomspace(1e-2, 1e4, 60)
    assert max(growth(1j * w) for w in axis) <= 1 + 1e-12
    assert max(growth(-w + 1j * w) for w in axis) < 1


@METHODS
def test_stiffly_accurate(method: Tableau) -> None:
    """The last stages start from the embedded solution at the end of the step, so that the estimate is the last k."""
    assert method.a[-1][-1] == 1.0
    assert method.a[-1][:-1] == method.a[-2]
    assert method.time[-2:] == (1.0, 1.0)
    assert method.rate[-1] == 0.0
