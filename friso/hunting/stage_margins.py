"""Find the margins of a stage in static friction and in its joint's design."""

from __future__ import annotations

import numpy as np

from friso.engine.allowance import Exhausted, allowance
from friso.equations.bandwidth import faster
from friso.equations.scaled_friction import least_static_factor, static_frictions, with_static_friction
from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.cycle.hunting import surely_surveyed
from friso.hunting.parameter_margin import ParameterMargin, Scaled, parameter_margin
from friso.hunting.search_limits import SEARCH_LIMITS
from friso.hunting.settings import edge_settings
from friso.hunting.verdict import Judgement
from friso.hunting.what_attracts import what_attracts
from friso.stage import Stage

JOINT_KEYS = "joint.stroke", "joint.stiffness"
"""Keys of a joint's design on which hunting depends."""


def friction_margin(stage: Stage, judgement: Judgement) -> ParameterMargin | None:
    """Find how much more or less static friction starts or ends hunting, Coulomb friction held.

    The range runs from static friction equal to Coulomb friction, or a fraction given by `SEARCH_LIMITS`, to a
    multiple. Returns None if the friction law lacks static or Coulomb friction, if the stage cannot hunt, or if its
    attractors are unknown.
    """
    flat = stage.flat()
    if not static_frictions(flat) or not _is_known(judgement):
        return None
    lowest = max(least_static_factor(flat), 1 / SEARCH_LIMITS.most_friction)
    return _margin(lambda factors: with_static_friction(flat, factors), judgement, lowest)


def joint_margins(stage: Stage, judgement: Judgement) -> dict[str, ParameterMargin]:
    """Find what change in stroke and stiffness of a free joint starts or ends hunting.

    The range is given by `SEARCH_LIMITS`. The margins are listed by key. There is none without a free joint, for a
    stage that cannot hunt, or for one whose attractors are unknown.
    """
    flat = stage.flat()
    if stage.joint is None or stage.joint.locked or not _is_known(judgement):
        return {}

    def scaled(key: str) -> Scaled:
        return lambda factors: {**flat, key: flat[key] * factors}

    keys = [key for key in JOINT_KEYS if flat.get(key)]
    with allowance(edge_settings.joint_margin_work):
        return {key: _margin(scaled(key), judgement, 1 / SEARCH_LIMITS.most_friction) for key in keys}


def _is_known(judgement: Judgement) -> bool:
    """Tell whether a judged stage may hunt, and it is certain whether something attracts it."""
    hunting, unclear = judgement.hunting, judgement.observed and judgement.hunting.target is None
    failed = judgement.verdict == "failed" or judgement.runs_away or hunting.passing
    return hunting.possible and hunting.certain and not failed and not unclear


@np.errstate(all="ignore")  # runs that fail on the way leave infinities behind
def _margin(scaled: Scaled, judgement: Judgement, lowest: float) -> ParameterMargin:
    """Find what change of a parameter starts or ends hunting of a stage with a certain verdict.

    `scaled` makes the stages, and `lowest` is the smallest factor of the parameter.
    """
    return parameter_margin(scaled, judgement.hunting.target is not None, lowest, SEARCH_LIMITS.most_friction)


def keeps_friction_margin(stage: Stage, factor: float, work: float) -> bool | None:
    """Tell whether a stage with a controller faster by `factor` does not hunt at other friction.

    Static friction is multiplied and divided by the factor by which advice keeps away from an edge; it stays at least
    Coulomb friction. Returns None for a law that lacks static or Coulomb friction. Returns None as well if this takes
    more than the given work, or is not certain.
    """
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
