"""Nothing moves, and the force is the seed."""

from __future__ import annotations

import numpy as np

from friso.progress import Progress
from friso.questions.rig.outcome_view import OutcomeView
from friso.stage import Stage
from friso.studies.rig.outcome import Outcome, RigLog


def run_experiment(stage: Stage, seed: int, progress: Progress) -> Outcome:
    """A log of a stage at rest."""
    logged = {"position": np.zeros(100), "force": np.full(100, float(seed))}
    return Outcome("at-rest", stage, seed, (RigLog("rested", None, 1e-3, logged, logged, stage, seed),), None)


VIEW = OutcomeView(lambda outcome: ["It rests."], lambda outcome: [], lambda outcome: {"rests": 1})
