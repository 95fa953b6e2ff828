"""The margins of a stage in what nobody knows exactly, or may build otherwise: static friction, and its joint."""

from __future__ import annotations

import numpy as np

from friso.engine.allowance import Exhausted, allowance
from friso.equations.bandwidth import faster
from friso.equations.scaled_friction import least_static_factor, static_frictions, with_static_friction
from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.cycle.hunting import surely_surveyed
from friso.hunting.limits import SEARCH_LIMITS
from friso.hunting.parameter_margin import ParameterMargin, Scaled, parameter_margin
from friso.hunting.settings import EdgeSettings
from friso.hunting.verdict import Judgement
from friso.hunting.what_attracts import what_attracts
from friso.stage import Stage

JOINT_KEYS = "joint.stroke", "joint.stiffness"
"""What of a joint's design hunting depends on."""


def friction_margin(stage: Stage, judgement: Judgement) -> ParameterMargin | None:
    """The margin of a stage in static friction, its Coulomb friction held, from where both are equal to so many times
    its own as `SEARCH_LIMITS` tell. None where a friction law does not tell both, and of a stage that cannot hunt, or
    of which it is not known what attracts it."""
    flat = stage.flat()
    if not static_frictions(flat) or not _is_known(judgement):
        return None
    lowest = max(least_static_factor(flat), 1 / SEARCH_LIMITS.most_friction)
    return _margin(lambda factors: with_static_friction(flat, factors), judgement, lowest)


def joint_margins(stage: Stage, judgement: Judgement) -> dict[str, ParameterMargin]:
    """The margins of a stage with a free joint in the joint's stroke and stiffness, by their keys, within so many times
    their values as `SEARCH_LIMITS` tell; none of a stage that cannot hunt, or of which it is not known what attracts
    it."""
    flat = stage.flat()
    if stage.joint is None or stage.joint.locked or not _is_known(judgement):
        return {}

    def scaled(key: str) -> Scaled:
        return lambda factors: {**flat, key: flat[key] * factors}

    keys = [key for key in JOINT_KEYS if flat.get(key)]
    with allowance(EdgeSettings.current().joint_margin_work):
        return {key: _margin(scaled(key), judgement, 1 / SEARCH_LIMITS.most_friction) for key in keys}


def _is_known(judgement: Judgement) -> bool:
    """Whether it is known what attracts a stage that may hunt."""
    hunting, unclear = judgement.hunting, judgement.observed and judgement.hunting.target is None
    failed = judgement.verdict == "failed" or judgement.runs_away or hunting.passing
    return hunting.possible and hunting.certain and not failed and not unclear


@np.errstate(all="ignore")  # runs that fail on the way leave infinities behind
def _margin(scaled: Scaled, judgement: Judgement, lowest: float) -> ParameterMargin:
    """The margin in a parameter, where it is known whether something attracts the stage itself."""
    return parameter_margin(scaled, judgement.hunting.target is not None, lowest, SEARCH_LIMITS.most_friction)


def keeps_friction_margin(stage: Stage, factor: float, work: float) -> bool | None:
    """Whether nothing attracts a stage whose controller is faster by a factor, also with as much more, or less, static
    friction as advice keeps off an edge. None where that takes more than so much work, or is not certain."""
    flat = stage.flat()
    if not static_frictions(flat):
        return None
    distance = SEARCH_LIMITS.edge_distance
    factors = np.array([max(1 / distance, least_static_factor(flat)), distance])
    try:
        with allowance(work):
            changed = with_static_friction(faster(flat, factor), factors)
            stages = Ensemble.held(changed, len(factors))
            survey = what_attracts(stages)
    except Exhausted:
        return None
    if survey.attracts.any():
        return False
    return True if surely_surveyed(stages, survey).all() else None
