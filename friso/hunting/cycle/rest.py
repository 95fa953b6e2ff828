"""Make states of stages at rest or stuck off their reference, from which hunting starts."""

from __future__ import annotations

import numpy as np

from friso.equations.roles import Role, Steady
from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.cycle.settings import settings
from friso.stage.controllers import integral_leak


def stuck(stages: Ensemble, displacement: np.ndarray, wound: np.ndarray | float = 0.0) -> np.ndarray:
    """Return states of stages stuck at displacements [m] (count,), shape (count, states).

    Bristles are relaxed. The actuator exerts no force, or balances constant forces that friction does not hold.
    Integrals of outer loops have `wound` up for a time [s].

    A stage stuck there winds up until it breaks away, which erases its past. These states form a line through all
    cycles with sticking, and the distance to the reference decides what follows, unless several loops have integrals.
    """
    states = stages.settled(Steady(-displacement, displacement, force=stages.balancing))
    states[:, stages.outer_integrals] = np.reshape(-displacement * wound, (-1, 1))
    return states


def bent(stages: Ensemble, displacement: np.ndarray, *travels: np.ndarray) -> np.ndarray:
    """Return states of stages stuck at displacements [m], with bristles bent by earlier travels.

    The `travels` [m], slow and each of shape (count,), follow one another, and bend bristles no farther than break-away
    does. With several bristles some may stick while others slip, so that the distance alone does not decide what
    follows.
    """
    states, bristles = stuck(stages, displacement), stages.kernel.having(Role.BRISTLE)
    most = stages.scales[:, bristles]
    for travel in travels:
        states[:, bristles] = np.clip(states[:, bristles] + travel[:, None], -most, most)
    return states


def pushed(stages: Ensemble, velocity: np.ndarray) -> np.ndarray:
    """Return states of stages at their reference that move at a velocity [m/s], (count, states).

    All masses move alike; everything else is as from rest.
    """
    states = stages.at_rest(0.0)
    states[:, stages.kernel.having(Role.VELOCITY)] = velocity[:, None]
    return states


def wait(stages: Ensemble, displacement: np.ndarray) -> np.ndarray:
    """Return the time [s] in which the integrator winds up to break-away, (count,).

    The stage sticks meanwhile, at a `displacement` [m]. If the integrator pauses, the result is one period of the
    loop's natural frequency. With a leak it is at most a few time constants of the leak.
    """
    rate = np.abs(stages.rates(stuck(stages, displacement))[:, stages.integral] / stages.per_newton)
    with np.errstate(divide="ignore"):
        winding = np.where(rate > 0, stages.number("breakaway") / rate, 2 * np.pi / stages.number("rate"))
        return np.minimum(winding, settings.leak_time_constants / np.asarray(2 * np.pi * integral_leak(stages.flat)))


def spread_over(*ranges: tuple[float, float, int]) -> np.ndarray:
    """Return numbers, shape (n,), that are spread evenly in their logarithm over ranges: first, last and number."""
    return np.concatenate([np.geomspace(*one) for one in ranges])
