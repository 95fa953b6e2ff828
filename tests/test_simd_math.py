"""The functions of straight-line code against NumPy, and whether the steps are vector instructions."""

import re
from collections.abc import Callable

import numpy as np
import pytest
from compiled import in_all
from variants import VARIANTS

from friso.engine import simd_math, vector_code
from friso.engine import simd_math as roots
from friso.engine.kernel import kernel
from friso.engine.machine_code import LANES, optimised, processor
from friso.equations.structure import structure

WIDE = {8: "zmm|ymm", 4: "ymm"}.get(LANES, "")
VECTORS = pytest.mark.skipif(not WIDE, reason="this processor has no 256-bit arithmetic")


@pytest.fixture(scope="module")
def rng() -> np.random.Generator:
    return np.random.default_rng(0)


def exps(B):
    B[1] = simd_math.exp(B[0])


def logs(B):
    B[1] = simd_math.log(B[0])


def tanhs(B):
    B[1] = simd_math.tanh(B[0])


def powers(B):
    B[1] = simd_math.power(B[0], 1.7)


def values(function: Callable[..., None], x: np.ndarray) -> np.ndarray:
    """Return the compiled function's value for each number."""
    return in_all(function, np.stack([x, x]))[1]


@pytest.mark.slow
def test_exp(rng: np.random.Generator) -> None:
    x = np.concatenate([rng.uniform(-300, 700, 20_000), rng.uniform(-1, 1, 20_000), [0.0, 1e-300, -1e-300]])
    assert values(exps, x) == pytest.approx(np.exp(x.astype(np.longdouble)).astype(float), rel=1e-15)


def test_exp_beyond_its_range() -> None:
    assert values(exps, np.array([-1e300, -np.inf])) == pytest.approx(np.exp(-300), rel=1e-15)
    assert values(exps, np.array([1e300, np.inf])) == pytest.approx(np.exp(700), rel=1e-15)


def test_log(rng: np.random.Generator) -> None:
    """Near 1 the result is small; there too the error is relative to it."""
    x = np.concatenate([10.0 ** rng.uniform(-300, 300, 20_000), 1 + rng.uniform(-0.3, 0.5, 20_000), [1.0]])
    exact = np.log(x.astype(np.longdouble))
    assert np.all(np.abs(values(logs, x) - exact) <= 1e-15 * np.abs(exact))


@pytest.mark.slow
def test_tanh(rng: np.random.Generator) -> None:
    x = np.concatenate([rng.uniform(-30, 30, 20_000), rng.uniform(-1, 1, 20_000), [0.0, 1e6, -1e6]])
    assert values(tanhs, x) == pytest.approx(np.tanh(x), abs=1e-15, rel=0)


def test_power(rng: np.random.Generator) -> None:
    """The relative error grows with the exponent of the result."""
    x = 10.0 ** rng.uniform(-60, 60, 20_000)
    exact = x.astype(np.longdouble) ** np.longdouble(1.7)
    size = 1 + np.abs(1.7 * np.log(x))
    assert np.all(np.abs(values(powers, x) - exact) <= 1e-15 * size * exact)


def packed(assembly: str) -> int:
    """Instructions that do arithmetic on whole registers."""
    operation = rf"\bv(?:f[n]?m(?:add|sub)\d+|mul|add|sub|div)pd\b[^\n]*(?:{WIDE})"
    return len(re.findall(operation, assembly))


@pytest.mark.parametrize("function", [exps, logs, tanhs, powers], ids=["exp", "log", "tanh", "power"])
def test_compiled_functions_are_those_of_plain_python(function: Callable[..., None], rng: np.random.Generator) -> None:
    x = rng.uniform(0.1, 10, 64)
    both = np.stack([x, x])
    for column in both.T:
        function(column)
    assert values(function, x) == pytest.approx(both[1], rel=1e-14)


@VECTORS
def test_steps_are_vectorised() -> None:
    """The step of a kernel works on whole registers; hardly anything is done lane by lane."""
    written = vector_code.vector_llvm({"step": kernel(structure(VARIANTS["rigid"].flat())).module.step}, LANES)
    machine = processor().target_machine()
    assembly = machine.emit_assembly(optimised(written, machine))
    scalar = len(re.findall(r"\bv(?:f[n]?m(?:add|sub)\d+|mul|add|sub|div)sd\b", assembly))
    assert packed(assembly) > 500
    assert scalar < packed(assembly) / 10


def first_crossing(B):
    p0, p1, p2, p3 = B[0], B[1], B[2], B[3]
    guess = roots.first_guess(p0, p1, p2, p3)
    root = roots.crossing(p0, p1, p2, p3, guess)
    B[4] = guess
    B[5] = root
    B[6] = roots.cubic(p0, p1, p2, p3, root)


@pytest.mark.cases(first=1)
@pytest.mark.parametrize("seed", range(5))
def test_first_crossing_of_a_cubic(seed: int) -> None:
    """Found exactly where the polynomial's roots say there is one, also in a dip between the thirds; and never before
    the first of them."""
    rng = np.random.default_rng(seed)
    rows = np.zeros((7, 2000))
    rows[:4] = rng.normal(size=(4, 2000)) + rng.choice([0.0, 0.3, 1.0], size=2000)
    rows[0] = np.abs(rows[0])
    dips = 0
    for *p, guess, result, there in in_all(first_crossing, rows).T:
        zeros = np.roots(np.polyfit(np.array([0, 1, 2, 3]) / 3, p, 3))
        inside = np.sort([z.real for z in zeros if abs(z.imag) < 1e-12 and 1e-9 < z.real < 1 - 1e-9])
        assert (guess < 2.0) == bool(inside.size)
        if inside.size:
            dips += all(point > 0 for point in p)
            assert there <= 0.01 * p[0] + 1e-12
            assert inside[0] - 0.02 <= result <= 1.0 or there > 0
    assert dips > 20


@pytest.mark.parametrize("bend", [0.0, 1e-9, 1e-3, 0.3])
def test_crossing_of_a_surface_that_is_almost_straight(bend: float) -> None:
    """Over long steps the secant hits the zero at once; what has been found must not be lost again by bisection."""
    rng = np.random.default_rng(0)
    zero, size = rng.uniform(0.01, 0.99, 2000), 10 ** rng.uniform(-9, 0, 2000)
    rows = np.zeros((7, 2000))
    for row, theta in enumerate((0, 1 / 3, 2 / 3, 1)):
        rows[row] = size * (zero - theta) * (1 + bend * (theta - zero) ** 2)
    assert in_all(first_crossing, rows)[5] == pytest.approx(zero, abs=1e-9)
