"""The declared equations against equations written by hand, and their derivatives against differences."""

import zlib
from collections.abc import Callable
from functools import cache
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import sympy as sp
from variants import VARIANTS, plain_module

from benchmarks import by_hand as plain
from friso.equations import motion
from friso.equations.component import TIME
from friso.equations.model import REFERENCE, Model, assemble
from friso.equations.structure import structure
from friso.frequency.system import sine

Point = tuple[np.ndarray, np.ndarray, float, np.ndarray]


@cache
def model(name: str) -> Model:
    return assemble(structure(VARIANTS[name].flat()))


@pytest.fixture(params=VARIANTS, scope="module")
def name(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture(scope="module")
def twin(name: str, tmp_path_factory: pytest.TempPathFactory) -> ModuleType:
    """The generated module of the variant, not compiled."""
    return plain_module(VARIANTS[name], tmp_path_factory.mktemp("kernel"))


def parameters(name: str) -> list[float]:
    flat = VARIANTS[name].flat()
    flat |= {"motion.size": float(motion.size(flat))}
    return [float(flat[str(symbol)]) for symbol in model(name).parameters]


def compiled(name: str, expressions: Any) -> Callable[[Point], np.ndarray]:
    """The expressions as a function of states, modes, time since the corner and the reference there."""
    m = model(name)
    symbols = [m.symbols, [k.beyond for k in m.kinks], TIME, REFERENCE, m.parameters]
    function, values = sp.lambdify(symbols, expressions, modules=[{"sine": sine}, "numpy"]), parameters(name)
    return lambda point: np.array(function(*point, values), dtype=float)


def active_piece(name: str, time: float) -> tuple[float, np.ndarray]:
    """Time since the last corner of the reference, and the reference there."""
    rows = motion.pieces(VARIANTS[name].flat(), 1)[0]
    row = rows[np.searchsorted(rows[:, 0], time, side="right") - 1]
    return time - row[0], row[1:]


def points(name: str, twin: ModuleType, count: int) -> list[tuple[float, Point]]:
    """States of the size that matters, on all sides of the kinks, each with its moment in the motion."""
    rng = np.random.default_rng(zlib.crc32(name.encode()))
    flat, values = VARIANTS[name].flat(), parameters(name)
    scales = np.array(twin.scales(values), dtype=float)
    scales[~np.isfinite(scales)] = 1e-3
    rows = []
    for i in range(count):
        time = flat["motion.duration"] * rng.uniform(0, 1) * (0.003 if i % 2 else 1)
        x = scales * rng.normal(size=scales.size) * 10.0 ** rng.uniform(-2, 1)
        if "cart_position" in twin.STATE_NAMES:  # the masses near each other, about as far apart as the stroke
            place = x[0]
            for body in ("cart_position", "parasitic_position"):
                if body in twin.STATE_NAMES:
                    x[twin.STATE_NAMES.index(body)] = place + flat.get("joint.stroke", 1e-5) * rng.normal()
        since, r = active_piece(name, time)
        modes = (np.array(twin.surfaces(x, since, r, values), dtype=float) > 0).astype(float)
        rows.append((time, (x, modes, since, r)))
    return rows


@pytest.mark.cases(first=13)
def test_right_hand_side_against_hand_written_equations(name: str, twin: ModuleType) -> None:
    by_hand = plain.rates(VARIANTS[name].flat(), twin.STATE_NAMES)
    values = parameters(name)
    sides = []
    for time, (x, modes, since, r) in points(name, twin, 60):
        ours = np.array(twin.right_hand_side(x, modes, since, r, values), dtype=float)
        theirs = np.array(by_hand(time, x))
        assert ours == pytest.approx(theirs, rel=1e-11, abs=1e-250), time
        sides.append(modes)
    if twin.KINK_NAMES:
        seen = np.array(sides)
        assert np.all(seen.max(axis=0) == 1), "a side of a kink was never looked at"
        assert np.all(seen.min(axis=0) == 0), "a side of a kink was never looked at"


@pytest.mark.cases(first=35)
def test_every_state_and_kink_matters(name: str) -> None:
    """No state or kink is dead: each is in the right-hand side, changes states, or decides on a mode."""
    used = set().union(*(sp.sympify(f).free_symbols for f in model(name).rhs))
    used |= set().union(*(switch.enter.free_symbols for switch in model(name).switches))
    used |= {kink.beyond for kink in model(name).jumps}
    dead = {kink.name for kink in model(name).kinks if kink.beyond not in used}
    assert dead == set()
    assert set(model(name).symbols) - {sp.Symbol("position", real=True)} <= used


@pytest.mark.cases(first=5, slow=21)
def test_jacobian_against_differences(name: str, twin: ModuleType) -> None:
    """SymPy's derivatives against central differences of the equations written by hand."""
    m, flat = model(name), VARIANTS[name].flat()
    jacobian = compiled(name, sp.Matrix(m.rhs).jacobian(sp.Matrix(m.symbols)))
    by_hand, values = plain.rates(flat, twin.STATE_NAMES), parameters(name)
    compared = 0
    for time, point in points(name, twin, 40):
        x, modes, since, r = point
        exact = jacobian(point)
        for j in range(x.size):
            h = 1e-5 * abs(x[j])
            shifts = [x + step * np.eye(x.size)[j] for step in (-2 * h, -h, h, 2 * h)]
            sides = [np.array(twin.surfaces(s, since, r, values), dtype=float) > 0 for s in shifts]
            if any(np.any(side != modes) for side in sides):
                continue
            f = [np.array(by_hand(time, s)) for s in shifts]
            difference = (f[0] - 8 * f[1] + 8 * f[2] - f[3]) / (12 * h)
            rounding = 1e-14 * np.max(np.abs(f), axis=0) / h
            assert np.all(np.abs(difference - exact[:, j]) <= 1e-7 * np.abs(exact[:, j]) + 4 * rounding)
            compared += 1
    assert compared > 20 * len(m.states)


def test_a_move_with_a_cruise_is_a_trapezoid_of_velocity() -> None:
    """The move accelerates, runs at constant speed for a multiple of that time, and brakes as long."""
    flat = {"motion.kind": "there_and_back", "motion.acceleration": 10.0, "motion.acceleration_time": 0.1}
    flat |= {"motion.return_at": 2.0, "motion.duration": 4.0, "motion.cruise_ratio": 1.5}
    time = np.linspace(0.0, 3.0, 30001)
    place = motion.reference(flat, time)
    speed = np.gradient(place, time)
    assert motion.size(flat) == pytest.approx(10.0 * 0.1**2 * 2.5) == pytest.approx(place.max())
    assert place[-1] == pytest.approx(0.0, abs=1e-12)
    assert speed.max() == pytest.approx(1.0, rel=1e-3) == pytest.approx(-speed.min(), rel=1e-3)
    assert (np.abs(speed) > 0.999).mean() * 3.0 == pytest.approx(2 * 1.5 * 0.1, rel=0.02)
    assert motion.last_corner(flat) == pytest.approx(2.0 + 3.5 * 0.1)
