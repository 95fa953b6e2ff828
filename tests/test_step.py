"""The generated step against a Rosenbrock step in plain Python, on every variant; compiled against not compiled."""

import zlib
from collections.abc import Callable
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
import rosenbrock
import sympy as sp
from compiled import aligned, step
from variants import VARIANTS, plain_module

from friso.engine.kernel import Kernel, kernel
from friso.engine.machine_code import ROW
from friso.engine.simd_math import quarter_sine
from friso.engine.tableaus import TABLEAUS
from friso.equations import motion
from friso.equations.component import TIME
from friso.equations.model import REFERENCE, assemble
from friso.equations.structure import structure

EVERY = [(name, "Rodas5P") for name in VARIANTS]
EVERY += [("free, parasitic", "Rodas4"), ("rigid, LuGre 0.7, PID measured", "Rodas4")]
COMPILED = ("rigid", "free, parasitic")
Real = np.longdouble
RTOL = 1e-6


class Lanes:
    """A lane buffer with a different state, step and moment in each lane."""

    def __init__(self, name: str, module: ModuleType) -> None:
        rng = np.random.default_rng(zlib.crc32(name.encode()))
        flat = VARIANTS[name].flat()
        flat |= {"motion.size": float(motion.size(flat))}
        self.module, self.layout, self.count = module, SimpleNamespace(**module.LAYOUT), module.LAYOUT["lanes"]
        self.values = [float(flat[key]) for key in module.PARAMETERS]
        scales = np.array(module.scales(self.values), dtype=float)
        scales[~np.isfinite(scales)] = 1e-3
        shape = (self.count, scales.size)
        self.x = scales * rng.normal(size=shape) * 10.0 ** rng.uniform(-2, 1, size=(self.count, 1))
        for body in ("cart_position", "parasitic_position"):
            if body in module.STATE_NAMES:
                apart = flat.get("joint.stroke", 1e-6) * rng.normal(size=self.count)
                self.x[:, module.STATE_NAMES.index(body)] = self.x[:, 0] + apart
        self.h = 10.0 ** rng.uniform(-6, -3, size=self.count)
        self.t = rng.uniform(0, 0.02, size=self.count)
        pieces = motion.pieces(flat, 1)[0]
        self.r = pieces[rng.integers(len(pieces), size=self.count), 1:]
        sides = [module.surfaces(x, t, r, self.values) for x, t, r in zip(self.x, self.t, self.r, strict=True)]
        self.modes = (np.array(sides, dtype=float).reshape(self.count, -1) > 0).astype(float)
        self.buffer = aligned(np.zeros(self.layout.rows * self.count))
        self._fill(scales)

    def row(self, first: int, rows: int) -> np.ndarray:
        """A block of the buffer as a view, shape (rows, lanes)."""
        return self.buffer[first * self.count : (first + rows) * self.count].reshape(rows, self.count)

    def dense(self) -> np.ndarray:
        """The terms of the dense output, shape (terms, states, lanes)."""
        terms, states = self.layout.dense_terms, self.layout.states
        return self.row(self.layout.dense, terms * states).reshape(terms, states, self.count)

    def _fill(self, scales: np.ndarray) -> None:
        m = self.layout
        constants = np.array(self.module.constants(self.values), dtype=float)
        self.row(m.x, m.states)[:] = self.x.T
        self.row(m.tolerance, m.states)[:] = RTOL * scales[:, None]
        self.row(m.constant, m.constants)[:] = constants[:, None]
        self.row(m.mode, m.kinks)[:] = self.modes.T
        self.row(m.reference, 3)[:] = self.r.T
        self.row(ROW.time, 1)[:] = self.t
        self.row(ROW.stop, 1)[:] = 1e3
        self.row(ROW.trial, 1)[:] = self.h
        self.row(ROW.longest, 1)[:] = 1.0

    def step(self, compiled: Kernel | None = None) -> list[bool]:
        """Take a step; which lanes want attention."""
        numbers = RTOL, 1e-6, 1e-5, 1e6
        if compiled:
            bits = step(compiled, self.buffer, *numbers)
            return [bool(bits >> lane & 1) for lane in range(self.count)]
        with np.errstate(all="ignore"):  # the expressions are meant for selects, which compute both of their sides
            return [bool(self.module.step(column, *numbers)) for column in self.row(0, self.layout.rows).T]


def sine(turn: Any) -> Any:
    """Return the sine of a turn as the engine computes it, in more digits than a float has.

    The engine's rounding to whole turns needs a float.
    """
    return quarter_sine(0.25 - abs((turn + 0.25) % 1 - 0.5))


class Twin:
    """A variant's step in plain Python and extended precision."""

    def __init__(self, name: str, method: str) -> None:
        self.model, self.tableau = assemble(structure(VARIANTS[name].flat())), TABLEAUS[method]
        rates = sp.Matrix(self.model.rhs)
        self._rates = self._function(list(rates))
        self._jacobian = self._function(rates.jacobian(sp.Matrix(self.model.symbols)).tolist())
        self._drift = self._function(list(rates.diff(TIME)))

    def _function(self, expressions: list[Any]) -> Callable[..., list[Any]]:
        m = self.model
        symbols = [m.symbols, TIME, [kink.beyond for kink in m.kinks], REFERENCE, m.parameters]
        return sp.lambdify(symbols, expressions, modules=[{"sine": sine}, "numpy"], cse=True)

    def step(self, lanes: Lanes, lane: int, x: np.ndarray) -> rosenbrock.Step:
        """Raises FloatingPointError where the step goes so far astray that a power overflows."""
        t, rest = lanes.t[lane], (lanes.modes[lane], lanes.r[lane], lanes.values)

        def numbers(function: Callable[..., list[Any]], x: np.ndarray, t: float) -> np.ndarray:
            return np.array(function(x, t, *rest), dtype=Real)

        with np.errstate(over="raise"):
            return rosenbrock.step(
                self.tableau,
                lambda x, t: numbers(self._rates, x, t),
                numbers(self._jacobian, x, t),
                numbers(self._drift, x, t),
                x,
                t,
                lanes.h[lane],
            )


@pytest.mark.cases(first=4, slow=7)
@pytest.mark.parametrize(("name", "method"), EVERY)
def test_step_against_plain_python(name: str, method: str, tmp_path: Path) -> None:
    """End of the step and dense output agree to what rounding of the state and of the stages may change in them."""
    module = plain_module(VARIANTS[name], tmp_path, method)
    twin, lanes = Twin(name, method), Lanes(name, module)
    lanes.step()
    compared = 0
    for lane in range(lanes.count):
        x = lanes.x[lane].astype(Real)
        try:
            expected = twin.step(lanes, lane, x)
            sizes, last = np.abs(expected.k), np.abs(np.array([*twin.tableau.a[-1], 1.0]))
            magnitude = np.abs(x) + last @ sizes  # of the terms that are summed in a stage of the method
            nudged = twin.step(lanes, lane, x + 1e-15 * np.cos(np.arange(x.size)) * magnitude)
        except FloatingPointError:
            continue
        spread = 4 * np.abs(nudged.k - expected.k)
        end = lanes.row(lanes.layout.end, lanes.layout.states)[:, lane]
        rounding = last @ spread + 1e-14 * magnitude
        assert np.all(np.abs(end - expected.end) <= rounding)
        dense = lanes.dense()[:, :, lane]
        weights = np.abs(np.array([row + (0.0,) * (len(sizes) - len(row)) for row in twin.tableau.dense]))
        rounding = weights @ (spread + 1e-14 * sizes)
        assert np.all(np.abs(dense - expected.dense) <= rounding)
        compared += 1
    assert compared >= lanes.count / 2


@pytest.mark.parametrize("name", COMPILED)
def test_compiled_step_against_the_same_code_line_by_line(name: str) -> None:
    """Compiling (with fused multiply-adds and selects) changes nothing but rounding, nor which lanes want attention."""
    compiled = kernel(structure(VARIANTS[name].flat()))
    slow, fast = Lanes(name, compiled.module), Lanes(name, compiled.module)
    assert fast.step(compiled) == slow.step()
    layout = slow.layout
    rows = fast.row(layout.end, layout.states), slow.row(layout.end, layout.states)
    k = np.abs(slow.dense()).sum(axis=0)
    assert np.all(np.abs(rows[0] - rows[1]) <= 1e-10 * (np.abs(slow.x.T) + k))
    for row in (layout.mode, ROW.event):
        assert np.array_equal(fast.row(row, 1), slow.row(row, 1))
