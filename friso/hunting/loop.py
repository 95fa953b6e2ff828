"""Whether the loop of a stage is stable, friction aside: where it is not, tuning is to blame, and not friction."""

from __future__ import annotations

from typing import Literal

import numpy as np

from friso.equations.roles import Role, Steady
from friso.hunting.cycle.ensemble import Ensemble
from friso.stage import Stage
from friso.stage.transmission import BACKLASH, MOTOR_MASS, MOTOR_STATES

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


def _motor_state(stages: Ensemble, which: int) -> int:
    """Which state is the position (0) or the velocity (1) of the motor; the first without a transmission."""
    names = stages.kernel.states
    return names.index(MOTOR_STATES[which]) if stages.structure.transmission else 0


def _moved(stages: Ensemble) -> list[np.ndarray]:
    """Each state moved a little from rest at the reference, all others at rest."""
    return list((STEP * np.diag(stages.scales[0]))[:, None])


def _rates(stages: Ensemble) -> np.ndarray:
    """Derivatives of the rates at rest by the states, in units of the magnitudes of these."""
    flank = np.zeros((1, len(stages.kernel.states)))
    if stages.structure.plays:  # the loop is open within a backlash
        flank[0, _motor_state(stages, 0)] = stages.flat[BACKLASH]
    moved = ((flank + step, flank - step) for step in _moved(stages))
    columns = [(stages.rates(ahead) - stages.rates(behind))[0] / (2 * STEP) for ahead, behind in moved]
    return np.array(columns).T / stages.scales[0][:, None]


def _sliding(stages: Ensemble, stuck: np.ndarray) -> np.ndarray:
    """The same without friction but for its viscous share; without the states of the friction law."""
    kernel = stages.kernel
    bodies = ("cart", "stage") if stages.structure.joint == "rigid" else ("cart",)
    mass = sum(float(stages.flat.get(f"masses.{body}", 0.0)) for body in bodies)
    matrix = stuck.copy()
    for output, body, own in (
        ("friction_force", kernel.cart_velocity, mass),
        ("motor_friction_force", _motor_state(stages, 1), float(stages.flat.get(MOTOR_MASS, 0.0))),
    ):
        if output not in kernel.outputs:
            continue
        unit = stages.scales[0, body]
        for k, step in enumerate(_moved(stages)):
            change = _force(stages, step, output) - _force(stages, -step, output)
            matrix[body, k] += change / (2 * STEP * own * unit)
        matrix[body, body] -= _viscous(stages, FAST * unit, output) / own
    bristles = kernel.having(Role.BRISTLE)
    return np.delete(np.delete(matrix, bristles, 0), bristles, 1)


def _viscous(stages: Ensemble, speed: float, output: str) -> float:
    """By how much a friction force rises with speed [N s/m] beyond a high one [m/s]."""
    slow, fast = (_force(stages, _slid(stages, times * speed), output) for times in (1.0, 2.0))
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


def _force(stages: Ensemble, states: np.ndarray, output: str) -> float:
    """A force [N] among the outputs."""
    kernel = stages.kernel
    modes = kernel.modes(states.T, 0.0, np.zeros(3), stages.values)
    rows = kernel.module.outputs(states.T, modes, 0.0, np.zeros(3), stages.values)
    return float(np.ravel(rows[list(kernel.outputs).index(output)])[0])
