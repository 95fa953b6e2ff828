"""Stages stuck off their reference, from where hunting starts."""

from __future__ import annotations

import numpy as np

from friso.equations.roles import Role, Steady
from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.cycle.settings import OrbitSettings
from friso.stage.standstill import integral_leak


def stuck(stages: Ensemble, displacement: np.ndarray, wound: np.ndarray | float = 0.0) -> np.ndarray:
    """States, shape (count, states), of stages at rest that are displaced [m] (count,), the bristles relaxed and the
    integrator such that the actuator exerts no force, or balances constant forces that friction does not hold; but
    integrals of outer loops have `wound` up for a time [s].

    A stage that sticks winds up from here until it breaks away, and has forgotten by then how it came to stick: these
    states are a line through all hunting cycles with sticking, and the distance to the reference alone tells what
    follows, unless there are integrals in several loops.
    """
    states = stages.settled(Steady(-displacement, displacement, force=stages.balancing))
    states[:, stages.outer_integrals] = np.reshape(-displacement * wound, (-1, 1))
    return states


def bent(stages: Ensemble, displacement: np.ndarray, *travels: np.ndarray) -> np.ndarray:
    """Stuck states as `stuck` gives them, with the bristles bent by slow travels of the masses.

    The `travels` [m], each of shape (count,), follow one another, and bend bristles no farther than break-away does.

    Of several bristles some stick on while others slip. What breaks away has not forgotten these then, and the distance
    alone does not tell what follows.
    """
    states, bristles = stuck(stages, displacement), stages.kernel.having(Role.BRISTLE)
    most = stages.scales[:, bristles]
    for travel in travels:
        states[:, bristles] = np.clip(states[:, bristles] + travel[:, None], -most, most)
    return states


def pushed(stages: Ensemble, velocity: np.ndarray) -> np.ndarray:
    """States of stages at their reference, all masses moving at a velocity [m/s], all else zero."""
    states = np.zeros((stages.count, len(stages.kernel.states)))
    states[:, stages.kernel.having(Role.VELOCITY)] = velocity[:, None]
    return states


def wait(stages: Ensemble, displacement: np.ndarray) -> np.ndarray:
    """Time [s] that the integrator takes to wind up to the break-away force while a stage sticks, shape (count,); where
    it pauses instead, a time in which the loop moves. No longer than an integrator with a leak winds at all."""
    settings = OrbitSettings.current()
    rate = np.abs(stages.rates(stuck(stages, displacement))[:, stages.integral] / stages.per_newton)
    with np.errstate(divide="ignore"):
        winding = np.where(rate > 0, stages.number("breakaway") / rate, 2 * np.pi / stages.number("rate"))
        return np.minimum(winding, settings.leak_time_constants / np.asarray(2 * np.pi * integral_leak(stages.flat)))
