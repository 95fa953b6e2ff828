"""Reference numbers of the equations, which change with the physics alone.

They stay if code is rearranged. A few stages that between them use every friction law, joint and controller are
followed through the declared equations from rest, by the classical Runge-Kutta method with a fixed step in plain
Python. Outputs over time are stored, which depend neither on the names nor on the order of states or files, nor on the
solver. Evidence states the revision of the equations it was computed with (`friso.evidence`), and a revision is such a
set of numbers.
"""

import math
import sys
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import sympy as sp

from friso.equations import motion
from friso.equations.as_built import AsBuilt, as_built
from friso.equations.component import TICK, TIME
from friso.equations.model import Model, assemble
from friso.equations.structure import structure
from friso.stage import Stage
from friso.virtual_rig.run import as_built_keys

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))
import variants as v

STEP, STEPS, KEPT = 1e-5, 6000, 6
"""Step [s], number of steps, and number of instants, evenly spread, at which outputs are kept."""

OUTPUTS = ("position", "cart_position", "force", "friction_force")

FAST = v.step("2 mm")

DRIVE = {
    "sample_time": "0.1 ms",
    "delay": "0.1 ms",
    "current_bandwidth": "500 Hz",
    "encoder_resolution": "1 um",
    "motor_constant_ratio": 0.9,
    "feedforward_coulomb": "0.5 N",
    "integrator_deadband": "10 um",
}

STAGES: Mapping[str, Stage] = {
    "rigid, van Dijk, limit": v.stage(FAST, friction=v.lugre(2), controller=v.van_dijk("60 Hz", v.limit("60 N"))),
    "rigid, Dahl, PI": v.stage(FAST, "cart", v.DAHL, controller=v.gains(2e4, 1e5)),
    "rigid, LuGre 0.7, PID measured": v.stage(
        FAST, friction=v.lugre(0.7), controller=v.gains(2e4, 1e5, 120, 1e-3, v.MEASURED)
    ),
    "locked, Stribeck 3, PID": v.stage(
        FAST, friction=v.stribeck(3), joint=v.LOCKED, controller=v.gains(2e4, 1e5, 120, 1e-3)
    ),
    "free, parasitic": v.stage(
        v.there_and_back(), friction=v.lugre(2), joint=v.free(), parasitic=v.PARASITIC, controller=v.van_dijk("60 Hz")
    ),
    "touching": v.stage(FAST, friction=v.stribeck(1.5), joint=v.TOUCHING, controller=v.van_dijk("60 Hz")),
}

BUILT = v.stage(FAST, friction=v.lugre(2), joint=v.free(), controller=v.van_dijk("60 Hz", v.limit("60 N")))
"""The stage with a real drive."""

Flat = Mapping[str, Any]


@cache
def reference_numbers() -> dict[str, dict[str, list[float]]]:
    """Return the outputs [SI] of each stage at the stored instants, to 12 digits."""
    numbers = {}
    for name, stage in STAGES.items():
        flat = stage.flat()
        numbers[name] = _followed(assemble(structure(flat)), flat)
    flat = {**as_built_keys(BUILT.replace({"drive": DRIVE})), "drive.seed": 1.0}
    numbers["free, drive as built"] = _followed(as_built(AsBuilt.of(flat)), flat)
    return numbers


def differ(numbers: Mapping[str, Mapping[str, list[float]]], tolerance: float = 1e-7) -> list[str]:
    """Return the stages and outputs that the equations now give differently.

    A difference counts if it exceeds a share of the largest number.
    """
    now = reference_numbers()
    return [
        f"{stage}: {output}"
        for stage, outputs in numbers.items()
        for output, values in outputs.items()
        if not np.allclose(now[stage][output], values, rtol=0, atol=tolerance * np.abs(values).max())
    ]


def _followed(model: Model, flat: Flat) -> dict[str, list[float]]:
    """Return the outputs of a run from rest.

    Flags of kinks follow their surfaces at every stage of the method.
    """
    names = [str(parameter) for parameter in model.parameters]
    values = {**flat, "motion.size": float(motion.size(flat))}
    numbers = [float(values[name]) for name in names]
    flags = [kink.beyond for kink in model.kinks]
    seen = model.clock.seen if model.clock else {}
    arguments = [*model.symbols, *flags, *model.fixed, *seen, TIME, TICK, *model.parameters]
    functions = {"quantised": _quantised, "gaussian": lambda seed, tick: 0.0}
    functions |= {
        "clipped": lambda value, end: min(max(value, -end), end),
        "sine": lambda turn: math.sin(2 * math.pi * turn),
    }

    def compiled(expressions: Any) -> Any:
        return sp.lambdify([*arguments], list(expressions), modules=[functions, "math"], cse=True)

    shown = [name for name in OUTPUTS if name in model.outputs]
    rhs, surfaces = compiled(model.rhs), compiled(kink.surface for kink in model.kinks)
    outputs = compiled(model.outputs[name].expression for name in shown)
    updates = compiled(value.update for value in model.held)
    rows = motion.pieces(flat, 1)[0]
    period = round(float(flat["drive.sample_time"]) / STEP) if model.clock else 0
    tabled = _neutral(model)
    x, held, kept = np.zeros(len(model.states)), [0.0] * len(model.held), []
    for number in range(STEPS):
        row = rows[np.searchsorted(rows[:, 0], (number + 0.5) * STEP, side="right") - 1]
        since, reference, tick = number * STEP - row[0], row[1:], float(number // period) if period else 0.0

        def all_of(x: np.ndarray, later: float) -> list[Any]:
            constant = [*reference, *held, *tabled]  # noqa: B023
            measured = [x[model.symbols.index(state)] for state in seen.values()]
            rest = [*constant, *measured, since + later, tick, *numbers]  # noqa: B023
            off = [0.0] * len(flags)
            return [*x, *(float(side > 0) for side in surfaces(*x, *off, *rest)), *rest]

        if period and number % period == 0:
            held = [float(value) for value in updates(*all_of(x, 0.0))]
        k_1 = np.array(rhs(*all_of(x, 0.0)), float)
        k_2 = np.array(rhs(*all_of(x + STEP / 2 * k_1, STEP / 2)), float)
        k_3 = np.array(rhs(*all_of(x + STEP / 2 * k_2, STEP / 2)), float)
        k_4 = np.array(rhs(*all_of(x + STEP * k_3, STEP)), float)
        x = x + STEP / 6 * (k_1 + 2 * k_2 + 2 * k_3 + k_4)
        if (number + 1) % (STEPS // KEPT) == 0:
            kept.append([float(value) for value in outputs(*all_of(x, STEP))])
    return {name: [float(f"{value:.12g}") for value in column] for name, *column in zip(shown, *kept, strict=True)}


def _neutral(model: Model) -> list[float]:
    """Return table values for a clock: factors of friction and motor, a force, a moving floor.

    The factors differ from 1.
    """
    if model.clock is None:
        return []
    return [0.9 + 0.05 * k for k in range(len(model.clock.places))] + [0.1] * len(model.clock.times)


def _quantised(value: float, digit: float) -> float:
    return digit * math.floor(value / digit + 0.5) if digit else value
