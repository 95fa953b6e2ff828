"""Compute the friction force on any periodic motion, and its derivative by the motion.

Multi-harmonic balance uses both. The period is divided into M equal intervals, at whose middles the velocity is given.
The friction law has one state of its own, which obeys a differential equation. The implicit midpoint rule makes this a
chain of M steps, which must end where it began. Over half a period of a symmetric motion it ends at the mirror image.
The force at the middles follows. The rule is of second order, and a fast state settles on its steady value however long
the intervals are.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import sympy as sp
from scipy.linalg import solve_banded

from friso.equations.component import Switch, state
from friso.equations.friction.common import DIRECTION, direction
from friso.equations.imposed import Imposed, imposed_form
from friso.errors import InputError
from friso.frequency.settings import settings
from friso.stage.tables import friction_law


@dataclass(frozen=True)
class OneStateLaw:
    """A friction law with at most one state z, as functions of parameters, velocity and z.

    The functions return the rate of change of z and the force, each with its derivatives by z and velocity.
    """

    values: Mapping[str, Any]
    function: Callable[..., list[Any]]
    names: tuple[str, ...]
    remembers: bool

    @classmethod
    def of(cls, flat: Mapping[str, Any]) -> OneStateLaw:
        """Make the functions from a stage's friction law; `flat` has its keys in SI.

        Raises InputError for a stage without friction, or a law with more states or with modes that have a memory.
        """
        form = imposed_form(flat)
        function, names, remembers = _compiled(form)
        return cls({name: flat[name] for name in names}, function, names, remembers)

    def at(self, velocity: np.ndarray, z: np.ndarray) -> list[np.ndarray]:
        """Return the rate of z and the force [N], at velocities [m/s] and states z.

        Each is followed by its derivatives by z and by velocity.
        """
        values = self.function(velocity, z, (velocity > 0).astype(float), *self.values.values())
        return [np.broadcast_to(np.asarray(value, dtype=float), velocity.shape) for value in values]


@cache
def _compiled(form: Imposed) -> tuple[Callable[..., list[Any]], tuple[str, ...], bool]:
    velocity, none = state("velocity"), state("no_state")
    friction = friction_law(form.friction).declare(velocity, form.friction_variant)
    inner = friction.component.states
    if any(isinstance(kink, Switch) for kink in friction.component.kinks):
        actual = f'"{form.friction}", with modes that remember'
        raise InputError("friction.model", actual, "a law that is smooth but for the direction", 'model = "lugre"')
    if any(kink.name != DIRECTION for kink in friction.component.kinks):
        actual = f'"{form.friction}", with kinks of its own'
        raise InputError("friction.model", actual, "a law that is smooth but for the direction", 'model = "lugre"')
    if len(inner) > 1:
        law = f'"{form.friction}", with {len(inner)} states of its own'
        raise InputError("friction.model", law, "a law with at most one", 'model = "lugre"')
    z, rate = (inner[0].symbol, inner[0].derivative) if inner else (none, sp.S.Zero)
    forward = direction(velocity).beyond
    parts = [e for f in (rate, friction.force) for e in (f, sp.diff(f, z), sp.diff(f, velocity))]
    names = sorted(set[Any]().union(*(e.free_symbols for e in parts)) - {velocity, z, forward}, key=str)
    function = sp.lambdify([velocity, z, forward, *names], parts, "numpy", cse=True)
    return function, tuple(map(str, names)), bool(inner)


@dataclass(frozen=True)
class FrictionAnswer:
    """Friction force [N] at the middles of intervals (M,), and what its derivative is made of.

    The derivative is by the velocities at the middles; `along` applies it.
    """

    force: np.ndarray
    by_velocity: np.ndarray
    by_state: np.ndarray
    chain: Chain | None
    pushed: np.ndarray

    def along(self, velocities: np.ndarray) -> np.ndarray:
        """Return how the force [N] changes with changes of the velocities [m/s], both (M, columns)."""
        direct = self.by_velocity[:, None] * velocities
        if self.chain is None:
            return direct
        return direct + self.by_state[:, None] * _middles(self.chain.solve(self.pushed[:, None] * velocities))


@dataclass(frozen=True)
class Chain:
    """Equations of a chain of states, z_0 to z_M: after[k] z_(k+1) - before[k] z_k = right side.

    The chain ends where it began, or at the mirror image: z_M = sign z_0.
    """

    after: np.ndarray
    before: np.ndarray
    sign: float

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Return the states, shape (M + 1, columns), for right sides (M, columns) of the equations."""
        count = len(self.after)
        bands = np.zeros((2, count + 1))
        bands[0, 0], bands[0, 1:], bands[1, :-1] = 1.0, self.after, -self.before
        start = np.zeros((count + 1, right.shape[1] + 1))
        start[1:, :-1], start[0, -1] = right, 1.0
        solution = solve_banded((1, 0), bands, start, check_finite=False)
        forced, free = solution[:, :-1], solution[:, -1:]
        return forced + free * (forced[-1] / (self.sign - free[-1]))


def _middles(z: np.ndarray) -> np.ndarray:
    return (z[:-1] + z[1:]) / 2


def friction_answer(law: OneStateLaw, velocity: np.ndarray, interval: float, sign: float) -> FrictionAnswer:
    """Compute the friction force on a periodic motion from velocities [m/s], shape (M,).

    Velocities are taken at the middles of M intervals, each an `interval` [s] long. After these the motion is back at
    its start (`sign` 1), or at the mirror image (-1).
    """
    z = np.zeros(len(velocity) + 1)
    chain, pushed = None, np.zeros(0)
    for _ in range(settings.state_newton_steps if law.remembers else 0):
        rate, by_z, by_velocity, *_ = law.at(velocity, _middles(z))
        chain = Chain(1 - interval * by_z / 2, 1 + interval * by_z / 2, sign)
        missed = interval * rate - np.diff(z)
        step = chain.solve(missed[:, None])[:, 0]
        z, pushed = z + step, interval * by_velocity
        if np.max(np.abs(step)) <= settings.state_error * np.max(np.abs(z)):
            break
    _, _, _, force, by_state, by_velocity = law.at(velocity, _middles(z))
    return FrictionAnswer(force, by_velocity, by_state, chain, pushed)
