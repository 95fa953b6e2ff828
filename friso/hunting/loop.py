"""Whether the loop of a stage is stable, friction aside: where it is not, tuning is to blame, and not friction."""

from __future__ import annotations

from typing import Literal

import numpy as np

from friso.equations.roles import Role, Steady
from friso.hunting.cycle.ensemble import Ensemble
from friso.stage import Stage

LoopState = Literal["sticks", "slides"]

STEP = 1e-6
"""Share of the magnitude of a state by which it is moved to take derivatives."""

GROWTH = 1e-5
"""Share of the natural frequency of mass and loop below which a growth rate is rounding: that of a stage which sticks
has poles at 0."""

FAST = 1e3
"""Speed at which friction is viscous and no more, in units of that of the loop's own motion."""


@np.errstate(all="ignore")  # absurd gains leave infinities behind
def unstable(stage: Stage) -> tuple[LoopState, ...]:
    """In which of its states the loop is not stable, the limiter not touched: while the stage sticks, held by its
    bristles, and while it slides, with no friction but its viscous share."""
    stages = Ensemble.held(stage.flat(), 1)
    stuck = _rates(stages)
    loops: dict[LoopState, np.ndarray] = {"sticks": stuck, "slides": _sliding(stages, stuck)}
    limit = GROWTH * stages.number("rate")[0]
    return tuple(state for state, matrix in loops.items() if np.linalg.eigvals(matrix).real.max() > limit)


def _moved(stages: Ensemble) -> list[np.ndarray]:
    """Each state moved a little from rest at the reference, all others at rest."""
    return list((STEP * np.diag(stages.scales[0]))[:, None])


def _rates(stages: Ensemble) -> np.ndarray:
    """Derivatives of the rates at rest by the states, in units of the magnitudes of these."""
    columns = [(stages.rates(step) - stages.rates(-step))[0] / (2 * STEP) for step in _moved(stages)]
    return np.array(columns).T / stages.scales[0][:, None]


def _sliding(stages: Ensemble, stuck: np.ndarray) -> np.ndarray:
    """The same without friction but for its viscous share; without the states of the friction law."""
    kernel = stages.kernel
    if "friction_force" not in kernel.outputs:
        return stuck
    cart, unit = kernel.cart_velocity, stages.scales[0, kernel.cart_velocity]
    bodies = ("cart", "stage") if stages.structure.joint == "rigid" else ("cart",)
    mass = sum(float(stages.flat.get(f"masses.{body}", 0.0)) for body in bodies)
    matrix = stuck.copy()
    for k, step in enumerate(_moved(stages)):
        matrix[cart, k] += (_friction(stages, step) - _friction(stages, -step)) / (2 * STEP * mass * unit)
    matrix[cart, cart] -= _viscous(stages, FAST * unit) / mass
    bristles = kernel.having(Role.BRISTLE)
    return np.delete(np.delete(matrix, bristles, 0), bristles, 1)


def _viscous(stages: Ensemble, speed: float) -> float:
    """By how much friction rises with speed [N s/m] beyond a high one [m/s]."""
    slow, fast = (_friction(stages, _slid(stages, times * speed)) for times in (1.0, 2.0))
    return (fast - slow) / speed


def _slid(stages: Ensemble, speed: float) -> np.ndarray:
    """States of a stage that has slid for long at a speed [m/s]: those of the friction law do not change any more."""
    states = stages.settled(Steady(0.0, 0.0, speed))
    bristles = stages.kernel.having(Role.BRISTLE)
    begun = stages.rates(states)[0, bristles]
    changes = np.empty((len(bristles), len(bristles)))
    for column, k in enumerate(bristles):
        moved = states.copy()
        moved[0, k] += stages.scales[0, k]
        changes[:, column] = (stages.rates(moved)[0, bristles] - begun) / stages.scales[0, k]
    states[0, bristles] -= np.linalg.lstsq(changes, begun, rcond=None)[0]
    return states


def _friction(stages: Ensemble, states: np.ndarray) -> float:
    """Friction force [N]."""
    kernel = stages.kernel
    modes = kernel.modes(states.T, 0.0, np.zeros(3), stages.values)
    rows = kernel.module.outputs(states.T, modes, 0.0, np.zeros(3), stages.values)
    return float(np.ravel(rows[list(kernel.outputs).index("friction_force")])[0])
