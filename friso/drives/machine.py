"""Turn a machine with its friction into a plant of fixed steps, to run beside a controller that left friso.

The equations are those of `friso.equations.as_built`. A sample is some equal steps of the Rosenbrock method ROS2
(Verwer et al. 1999, SIAM J. Sci. Comput. 20, 1456), which is implicit, L-stable and of second order. Sides of kinks are
taken at the beginning of a step, and modes change at its end, so that a step in which either changes is of first order.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import exp, floor, sqrt, tanh
from typing import Any

import numpy as np
import sympy as sp

from friso.drives.languages import PYTHON
from friso.drives.program import (
    PER_NEWTON,
    Assignment,
    constants_as_numbers,
    identifier,
    in_arithmetic,
    neutral,
    straight,
    with_values,
)
from friso.engine.printing import Constants
from friso.equations.as_built import COMMANDED, PLACES, RATED, TIMES, AsBuilt, as_built
from friso.equations.component import STEADY, Piecewise, Switch, state
from friso.errors import InputError

GAMMA = 1 - 1 / sqrt(2)
"""Parameter of ROS2 with which it is L-stable and its error is least."""

FORCE = state("actuator_force")
"""Symbol of the force that the actuator exerts, in newtons as the drive commands it."""


@dataclass(frozen=True)
class StraightCode:
    """Assignments, and then the values that follow from them."""

    steps: Sequence[Assignment]
    values: Sequence[sp.Expr]


@dataclass(frozen=True)
class PlantCode:
    """A machine as a plant of fixed steps.

    - `parameters`: keys of the stage file by symbol, in SI; `constants` follow from them by `prepared`.
    - `states`, of which `position` is measured, and `rated` at the encoder of the velocity (None: one encoder).
    - `started`: the states at rest, in terms of `STEADY`.
    - `kinks`: symbols of their sides, which follow from the states by `sides`.
    - `modes`: numbers, 0 or 1, that change with states by `changes` at the end of a step.
    - `rates` of the states, and the entries of their Jacobian that are not 0, at `places` (row, column).
    - `waiting`: whole samples after which a command acts, and `late`, the rest of the delay [s]. `period` [s] is the
      sample time.
    """

    parameters: Mapping[sp.Symbol, float]
    constants: Sequence[sp.Symbol]
    prepared: Sequence[Assignment]
    states: Sequence[sp.Symbol]
    position: sp.Symbol
    rated: sp.Symbol | None
    started: StraightCode
    kinks: Sequence[sp.Symbol]
    sides: StraightCode
    modes: Sequence[sp.Symbol]
    mode_starts: StraightCode
    changes: StraightCode
    rates: StraightCode
    places: Sequence[tuple[int, int]]
    jacobian: StraightCode
    waiting: int
    late: float
    period: float


def machine_of(flat: Mapping[str, Any]) -> PlantCode:
    """Return the machine of a stage with a complete drive, whose keys are in `flat`, in SI.

    Raises InputError for what changes along the rail or over time other than by the actuator.
    """
    if varied := [key for key in flat if key.startswith(("rail.", "floor.", "drive.ripple"))]:
        expected = "a machine that is alike along its travel, and stands on a floor at rest"
        raise InputError(varied[0], "a machine that differs along its travel", expected, "remove [rail] and the ripple")
    form = AsBuilt.of(flat)
    model = as_built(form)
    assert model.clock is not None
    acting = state(f"waiting_{form.delay_samples}" if form.delay_samples else COMMANDED)
    plain: dict[Any, Any] = {acting: FORCE, **dict.fromkeys(map(state, PLACES), sp.S.One)}
    plain |= dict.fromkeys(map(state, TIMES), sp.S.Zero) | neutral(flat)
    states, switches = model.symbols, model.switches
    kinks = [kink for kink in model.kinks if not isinstance(kink, Switch)]
    rates = [with_values(one, plain) for one in model.rhs]
    entries = {(i, j): d for i, f in enumerate(rates) for j, x in enumerate(states) if (d := sp.diff(f, x)) != 0}
    steady = {STEADY.error: 0, STEADY.velocity: 0, STEADY.reference_velocity: 0, STEADY.deflected: 1}
    groups: dict[str, list[Any]] = {
        "started": [with_values(part.settled, steady) for part in model.states],
        "sides": [Piecewise((1, kink.at_start > 0), (0, True)) for kink in kinks],
        "mode_starts": [Piecewise((1, one.begins > 0), (0, True)) for one in switches],
        "changes": _changes(switches, states, plain),
        "rates": rates,
        "jacobian": [*entries.values()],
    }
    groups = {name: [with_values(value, plain) for value in values] for name, values in groups.items()}
    own = {*states, *(kink.beyond for kink in model.kinks), FORCE, STEADY.position, STEADY.force}
    free: set[Any] = {one for values in groups.values() for value in values for one in sp.sympify(value).free_symbols}
    keys = sorted(free - own, key=str)
    if others := [str(one) for one in keys if str(one) not in flat]:
        raise InputError("STAGE", f"equations with {', '.join(others)}", "a machine moved by its actuator alone")
    constants = Constants(keys)
    hoisted = {
        name: [constants.hoist(in_arithmetic(sp.sympify(one))) for one in values] for name, values in groups.items()
    }
    prepared, names, _ = constants_as_numbers(constants, [])
    parts = {name: StraightCode(*straight(values, name[0])) for name, values in hoisted.items()}
    return PlantCode(
        parameters={one: float(flat[str(one)]) for one in keys},
        constants=names,
        prepared=prepared,
        states=states,
        position=model.stage.position,
        rated=model.clock.seen.get(state(RATED)),
        kinks=[kink.beyond for kink in kinks],
        modes=[one.beyond for one in switches],
        places=[*entries],
        waiting=form.delay_samples,
        late=float(flat["drive.late"]),
        period=float(flat["drive.sample_time"]),
        **parts,
    )


def _changes(switches: Sequence[Switch], states: Sequence[sp.Symbol], plain: Mapping[Any, Any]) -> list[Any]:
    """Return new states, and then new modes, at the end of a step; one mode after another may change."""
    now: dict[Any, Any] = {one: one for one in (*states, *(switch.beyond for switch in switches))}
    for switch in switches:
        half = sp.Rational(1, 2)
        enters = sp.And(switch.beyond < half, with_values(switch.enter, plain) > 0)
        leaves = sp.And(switch.beyond > half, with_values(switch.leave, plain) > 0)
        changes = sp.Or(enters, leaves).xreplace(now)
        new = {x: with_values(value, plain).xreplace(now) for x, value in switch.becomes.items()}
        new[switch.beyond] = 1 - switch.beyond
        now |= {x: Piecewise((value, changes), (now[x], True)) for x, value in new.items()}
    return [*now.values()]


@dataclass(frozen=True)
class MachineRun:
    """A machine, and its run in fixed steps that starts at rest and follows the outputs of a run of friso's own.

    `rows` are output and position [m]: those of the start, and then at each sample, with `steps` in a sample.
    `differences` [m] are the largest from friso's own position, by the steps in a sample. `per_newton` is the output
    per newton, and `tolerance` [m] the difference that rounding explains.
    """

    machine: PlantCode
    steps: int
    rows: Sequence[tuple[float, float]]
    differences: Mapping[int, float]
    per_newton: float
    tolerance: float


MACHINE_STEPS = (1, 4, 16)
"""Steps in a sample for which the difference of a machine from friso is told; sixteen take seconds."""

USUAL_STEPS = 4
"""Steps in a sample of a machine as a plant: with one, the contact of a limiter is a few steps long."""

MACHINE_ROUNDING = 1e-9
"""Difference between a machine in C and in Python that rounding explains, relative to the largest position. Kinks
magnify rounding."""


def machine_run(
    machine: PlantCode, flat: Mapping[str, Any], outputs: np.ndarray, positions: np.ndarray, held: float
) -> MachineRun:
    """Return the run of a machine that follows `outputs`, shape (n,), beside friso's own `positions` [m], shape (n,).

    The run begins with the output `held`; `flat` has the keys of the stage with its drive.
    """
    per_newton, ways = flat[str(PER_NEWTON)], MACHINE_STEPS
    runs: dict[int, list[float]] = {}
    for steps in ways:
        running = Running(machine, float(positions[0]), held / per_newton, steps)
        runs[steps] = []
        for output in outputs.tolist():
            runs[steps].append(running.position)
            running.sample(output / per_newton)
    own = runs[USUAL_STEPS]
    rows = [(held, float(positions[0])), *zip(outputs.tolist(), own, strict=True)]
    differences = {steps: float(np.abs(np.array(one) - positions).max()) for steps, one in runs.items()}
    tolerance = MACHINE_ROUNDING * float(np.abs(positions).max())
    return MachineRun(machine, USUAL_STEPS, rows, differences, per_newton, tolerance)


class Running:
    """A machine that runs in Python, as the code that left friso does."""

    def __init__(self, machine: PlantCode, position: float, force: float, steps: int) -> None:
        """Begin at rest at a position [m], held by a `force` [N]; a sample has so many `steps`."""
        self.machine, self.steps = machine, steps
        self._scope: dict[str, Any] = {"abs": abs, "exp": exp, "floor": floor, "sqrt": sqrt, "tanh": tanh}
        values = {identifier(str(key)): value for key, value in machine.parameters.items()}
        exec("\n".join(PYTHON.lines(machine.prepared, identifier)), self._scope, values)
        self._scope |= {str(one): values[str(one)] for one in machine.constants}
        names = [*map(str, machine.states)]
        modes = [*names, *map(str, machine.modes)]
        every = [*modes, *map(str, machine.kinks), str(FORCE)]
        start = self._function(machine.started, [str(STEADY.position), str(STEADY.force)])
        self._sides = self._function(machine.sides, names)
        self._changes = self._function(machine.changes, [*modes, *map(str, machine.kinks)])
        self._rates, self._jacobian = (self._function(part, every) for part in (machine.rates, machine.jacobian))
        self.states = np.array(start(position, force), float)
        self.modes = [*self._function(machine.mode_starts, names)(*self.states)]
        self.waiting = [force] * (machine.waiting + 1)

    def _function(self, part: StraightCode, names: Sequence[str]) -> Any:
        """Return a function of the named numbers that computes the values of a part."""
        values = ", ".join(PYTHON.expression(value, identifier) for value in part.values)
        lines = [*PYTHON.lines(part.steps, identifier), f"return [{values}]"]
        text = "\n".join([f"def function({', '.join(map(identifier, names))}):", *(f"    {line}" for line in lines)])
        exec(text, self._scope)
        return self._scope["function"]

    @property
    def position(self) -> float:
        """Return the measured position [m]."""
        return float(self.states[[*self.machine.states].index(self.machine.position)])

    def sample(self, command: float) -> None:
        """Go on for a sample, at the beginning of which the drive gives a `command` [N]."""
        machine = self.machine
        self._go_on(machine.late)
        self.waiting = [command, *self.waiting[:-1]]
        self._go_on(machine.period - machine.late)

    def _go_on(self, duration: float) -> None:
        """Go on for a duration [s] in equal steps."""
        if duration <= 0:
            return
        h = duration / self.steps
        n = len(self.states)
        for _ in range(self.steps):
            sides, force = self._sides(*self.states), self.waiting[-1]
            matrix = np.eye(n)
            along = (*self.states, *self.modes, *sides, force)
            for place, entry in zip(self.machine.places, self._jacobian(*along), strict=True):
                matrix[place] -= GAMMA * h * entry
            first = np.linalg.solve(matrix, self._rates(*along))
            later = self._rates(*(self.states + h * first), *self.modes, *sides, force)
            second = np.linalg.solve(matrix, np.array(later) - 2 * first)
            self.states = self.states + h * (1.5 * first + 0.5 * second)
            changed = self._changes(*self.states, *self.modes, *self._sides(*self.states))
            self.states, self.modes = np.array(changed[:n], float), changed[n:]
