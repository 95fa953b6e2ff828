"""Suggest an isolator for a rigid stage that hunts, from a survey of a few joints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from friso.design_method.prepare import isolated
from friso.equations.bandwidth import faster
from friso.equations.breakaway import least_breakaway
from friso.equations.scaled_friction import least_static_factor, static_frictions, with_static_friction
from friso.errors import InputError
from friso.frequency.crossover import settled_margin
from friso.hunting import find_attractors
from friso.remedies.catalogue import DAMPING_RATIOS, Remedy, joint_variables
from friso.remedies.machines import Goal
from friso.remedies.settings import settings
from friso.stage import Stage

DAMPING = (0.05, DAMPING_RATIOS[1])
"""Damping ratios that are tried for a suggested joint."""


@dataclass(frozen=True)
class Suggestion:
    """A joint tried in a rigid stage, and the `stage` with that joint.

    `settles` is true if the stage does not hunt, neither as it is, nor with its bandwidth divided by `Goal.distance`,
    nor with static friction multiplied or divided by it, down to Coulomb friction. `margin` is the least modulus margin
    of the limit cases, and of all states stuck under a bias force. If no joint settles, this is the last one tried.
    """

    stage: Stage
    settles: bool
    margin: float


@np.errstate(all="ignore")  # runs that fail leave infinities behind
def suggestion(stage: Stage) -> Suggestion | None:
    """Return the isolator with the shortest of a few strokes that settles a stage.

    At full stroke, an isolator pushes with a fixed fraction of static friction, so that the cart does not move. If none
    settles the stage, the last one tried is returned. Returns None for a stage that has a joint or cannot have one.
    """
    if stage.joint:
        return None
    friction = float(least_breakaway(stage.flat()))
    if friction <= 0:
        return None
    try:
        free = isolated(stage)
    except InputError:
        return None
    remedy, tried = (
        Remedy("", free, joint_variables(friction), True),
        [(stroke, d) for stroke in settings.suggested_strokes for d in DAMPING],
    )
    shares = np.array([_shares(remedy, stroke, damping) for stroke, damping in tried])
    numbers = remedy.changes(shares)
    flat = {**free.flat(), **numbers, "motion.kind": "release"}  # only attractors matter, not the motion
    attracts = np.zeros(len(tried), bool)
    machines = [flat, faster(flat, 1 / Goal.distance)]
    if static_frictions(flat):
        factors = max(1 / Goal.distance, least_static_factor(flat)), Goal.distance
        machines += [with_static_friction(flat, factor) for factor in factors]
    for machine in machines:
        attracted = find_attractors(machine, len(tried), close_orbits=False)
        attracts |= attracted.attracts | ~attracted.certain
    for number in np.flatnonzero(~attracts):
        settled = remedy.tuned(shares[number])
        margin = settled_margin(settled.flat())
        if margin > 0:
            return Suggestion(settled, True, margin)
    return Suggestion(remedy.tuned(shares[-1]), False, 0.0)


def _shares(remedy: Remedy, stroke: float, damping: float) -> list[float]:
    """Return coordinates, from 0 to 1, of a joint's stroke [m], force and damping ratio.

    The scale is logarithmic. The force is `RemedySettings.suggested_force`.
    """
    wanted = (stroke, settings.suggested_force, damping)
    return [
        float(np.log(value / variable.low) / np.log(variable.high / variable.low))
        for value, variable in zip(wanted, remedy.variables, strict=True)
    ]
