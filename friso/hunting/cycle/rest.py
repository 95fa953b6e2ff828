"""Stages stuck off their reference, from where hunting starts."""

from __future__ import annotations

import numpy as np

from friso.hunting.cycle.ensemble import Ensemble


def stuck(stages: Ensemble, displacement: np.ndarray) -> np.ndarray:
    """States, shape (count, states), of stages at rest that are displaced [m] (count,), the bristles relaxed and the
    integrator such that the actuator exerts no force.

    A stage that sticks winds up from here until it breaks away, and has forgotten by then how it came to stick: these
    states are a line through all hunting cycles with sticking, and the distance to the reference alone tells what
    follows.
    """
    states = displaced(stages, displacement)
    integral = stages.index("integral")
    free = stages.force(states)
    states[:, integral] = 1.0
    states[:, integral] = -free / (stages.force(states) - free)
    return states


def displaced(stages: Ensemble, displacement: np.ndarray, velocity: np.ndarray | float = 0.0) -> np.ndarray:
    """States of stages displaced [m] and pushed [m/s], all masses alike, with everything else at zero but for filters,
    which have followed the displacement."""
    states = np.zeros((stages.count, len(stages.kernel.states)))
    for i, name in enumerate(stages.kernel.states):
        if name in ("position", "cart_position", "parasitic_position", "filtered_position"):
            states[:, i] = displacement
        elif name == "filtered_error":
            states[:, i] = -displacement
        elif name in ("velocity", "cart_velocity", "parasitic_velocity"):
            states[:, i] = velocity
    return states


def wait(stages: Ensemble, displacement: np.ndarray) -> np.ndarray:
    """Time [s] that the integrator takes to wind up to the break-away force while a stage sticks, shape (count,)."""
    states = stuck(stages, displacement)
    ramp = states + stages.rates(states) * (np.arange(states.shape[1]) == stages.index("integral"))
    return stages.number("breakaway") / np.abs(stages.force(ramp) - stages.force(states))
