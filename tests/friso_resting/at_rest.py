"""Nothing moves, and the force is the seed."""

from __future__ import annotations

from typing import Any

import numpy as np

from friso.progress import Progress
from friso.stage import Stage
from friso_thesis.studies.rig.experiments import RigExperiment
from friso_thesis.studies.rig.outcome import Outcome, RigLog


class AtRest(RigExperiment):
    """A stage at rest."""

    def run(self, stage: Stage, seed: int, progress: Progress) -> Outcome:
        """A log of a stage at rest."""
        logged = {"position": np.zeros(100), "force": np.full(100, float(seed))}
        return Outcome("at-rest", stage, seed, (RigLog("rested", None, 1e-3, logged, logged, stage, seed),), None)

    def sentences(self, outcome: Outcome) -> list[str]:
        return ["It rests."]

    def numbers(self, outcome: Outcome) -> dict[str, Any]:
        return {"rests": 1}


EXPERIMENT = AtRest()
