"""Say which parts of the goal the stage misses as it is."""

from __future__ import annotations

import math

import numpy as np

from friso.frequency.bode import loop_bandwidth
from friso.quantities import percent
from friso.remedies.machines import MoveRange
from friso.remedies.method import Advice
from friso.shown.text import listed, range_with_unit, with_unit

DOUBTS = {
    "verdict": "its own motion does not settle, or something attracts it",
    "certain": "it is not certain that nothing attracts it",
    "given up": "what attracts it takes too much computing",
    "distance": "something attracts it at a bandwidth nearer below than wanted, or may",
    "bandwidth": "its bandwidth is above your limit, or not known",
    "window": "something attracts it at a bandwidth little above its own, or may",
    "own margin": "a settled state of the stage itself has less margin than wanted",
    "hunting": "something attracts too many of the machines, or may",
    "settling": "too many of the machines are not in position in time",
    "margin": "too many of the machines have less modulus margin than wanted",
    "force": "too many of the machines take more force than there is",
    "as built": "as built, with its drive, it hunts, or may",
    "together": "too many of the machines miss one part of the goal or another",
}
"""Why a stage is not sure to meet the goal."""


def moves_words(moves: MoveRange) -> str:
    """Write from which sizes and accelerations moves are drawn."""
    sizes = f"moves of {range_with_unit(moves.smallest, moves.largest, 'm')}"
    return f"{sizes} with {range_with_unit(*moves.accelerations, 'm/s^2')}" if moves.accelerations else sizes


def as_it_is(tuning: Advice) -> str:
    """Say whether the stage as it is hunts, and on how many machines it misses which goal."""
    verdict, certain = tuning.case.verdict, tuning.case.judgement.hunting.certain
    if verdict in ("hunts", "bistable"):
        own = "a limit cycle, and" if verdict == "hunts" else "a limit cycle after other moves than its own, and"
    else:
        surely_none = certain and verdict != "failed" and "verdict" not in tuning.unmet
        own = f"{'no' if surely_none else 'perhaps a'} limit cycle, but"
    names = [*tuning.unmet, *(["together"] if _others_miss_too(tuning) else [])]
    return f"As it is: {own} {listed([_missed(name, tuning) for name in names], 'and')}."


def _others_miss_too(tuning: Advice) -> bool:
    """Tell whether clearly more machines miss the goal than miss the parts of it that are named."""
    meets = tuning.present.meets(tuning.goal)
    missing = [float(np.mean(~meets[name])) for name in tuning.unmet if name in meets]
    together = float(np.mean(~np.all([*meets.values()], axis=0)))
    return bool(missing) and "hunting" not in tuning.unmet and together >= sum(missing) + 0.01


def _missed(name: str, tuning: Advice) -> str:
    """Say that the stage misses the part `name` of the goal, and on which fraction of machines."""
    present, goal = tuning.present, tuning.goal
    meets = present.meets(goal)
    every = np.all([*meets.values()], axis=0)
    moving = np.all([met for part, met in meets.items() if part != "hunting"], axis=0)
    if name == "hunting":
        return f"{percent(float(np.mean(~every[moving])))} of the machines that meet the rest hunt or may hunt"
    if name == "bandwidth" and math.isfinite(own := loop_bandwidth(tuning.stage)):
        return f"its bandwidth, {with_unit(own, 'Hz')}, is above your limit"
    if name not in meets and name != "together":
        return DOUBTS[name]
    missing = percent(float(np.mean(~meets.get(name, every))))
    late = "before the return or the end of the run" if goal.settle is None else f"within {with_unit(goal.settle, 's')}"
    made = "moves" if present.moves_drawn is None else moves_words(present.moves_drawn)
    return {
        "settling": f"{missing} of {len(every)} {made} do not settle {late}",
        "margin": f"{missing} of {len(every)} machines have less modulus margin than {goal.margin:g}",
        "force": f"{missing} of {len(every)} {made} take more force than {with_unit(goal.force_limit or 0.0, 'N')}",
        "together": f"{missing} of {len(every)} machines and {made} miss one part of the goal or another",
    }[name]
