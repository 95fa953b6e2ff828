"""Confirm that a tuned stage does not hunt at its own bandwidth, nor at nearby ones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from friso.engine.allowance import Exhausted, allowance
from friso.engine.kernel import kernels
from friso.equations.bandwidth import faster
from friso.equations.structure import structure
from friso.hunting import Hunting, LoopState, find_attractors, hunting, judge_many, kernels_to_judge, unstable
from friso.remedies.goal import Goal
from friso.remedies.settings import settings
from friso.stage import Stage


@dataclass(frozen=True)
class Confirmation:
    """Result of searching for hunting at a stage's own bandwidth and at nearby ones.

    `hunting` are the limit cycles of the `stage` itself, searched as thoroughly as `friso check` does. `word` is the
    verdict on the stage's own motion from fewer starts; None if that takes too much work. `factors` are the other
    bandwidths, as multiples of the stage's own; `quiet` is true at those at which the stage certainly does not hunt.
    `unstable` are the states in which the loop of the stage is unstable.
    """

    stage: Stage
    hunting: Hunting
    word: str | None
    factors: np.ndarray
    quiet: np.ndarray
    unstable: tuple[LoopState, ...]

    @property
    def certain(self) -> bool:
        """Tell whether the verdict on hunting at the stage's own bandwidth is certain."""
        return self.hunting.certain

    @property
    def verdict(self) -> str:
        """Return the verdict at the stage's own bandwidth; "failed" if it was not computed."""
        own = self.word or "failed"
        return own if self.hunting.target is None or own != "settles" else "bistable"

    @property
    def doubts(self) -> tuple[str, ...]:
        """Return why the stage may still hunt, as names of `DOUBTS`; empty if it surely does not.

        `DOUBTS` are in `friso.questions.tune.present_words`. The reasons are the verdict, its certainty, and hunting at
        lower or higher bandwidths, or that the work was given up.
        """
        if self.word is None:
            return ("given up",)
        parts = {
            "verdict": self.verdict != "settles",
            "certain": not self.certain,
            "distance": not self.quiet[self.factors < 1].all(),
            "window": not self.quiet[self.factors > 1].all(),
        }
        return tuple(name for name, holds in parts.items() if holds)


@np.errstate(all="ignore")
def confirmed(stage: Stage, goal: Goal) -> Confirmation:
    """Judge a stage at its own bandwidth, and at others within the goal's distance.

    The bandwidths lie closer together than those at which `friso check` looks for an edge of hunting, and each is
    searched from more starts.
    """
    kernels(kernels_to_judge(structure(stage.flat())))
    steps = settings.bandwidths_beside
    factors = np.delete(goal.distance ** (np.arange(-steps, steps + 1) / steps), steps)
    flat, count = stage.flat(), len(factors)
    word, quiet = None, np.zeros(count, bool)
    attracting = hunting(stage, work=settings.confirming_work)
    with allowance(settings.confirming_work) as allowed:
        try:
            near = find_attractors(faster(flat, factors), count)
            quiet = near.certain & ~near.attracts
            word = str(judge_many(flat, 1, settings.move_rtol)[0])
        except Exhausted:
            if allowed.around is not None and allowed.around.left <= 0:
                raise
    return Confirmation(stage, attracting, word, factors, quiet, unstable(stage))
