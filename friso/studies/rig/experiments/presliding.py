"""Stiffness and damping of the bearing's bristles by small motion before it slides.

The joint is locked. The thesis has no such experiment, but the bristles decide whether a machine near the boundary of
hunting hunts.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from friso.errors import InputError
from friso.identification.experiments.presliding import Presliding, bristles_from_presliding
from friso.identification.readings.at_bearing import machine_between
from friso.progress import Progress
from friso.stage import Stage
from friso.studies.rig.excitation import Excitation, excite
from friso.studies.rig.outcome import Outcome, RigLog, rig_log
from friso.studies.rig.sizes import locked_stage, pace, travel
from friso.virtual_rig.run import as_built_keys

PLACES = 3
"""Places along the travel: our choice."""

GENTLE, LONGEST = Excitation(0.05, 12.0, 60, 160.0), 1e-3
"""A twentieth of static friction, RMS, up to 96 Hz on the thesis's rig, logged every 0.75 ms; longest time [s] from
sample to sample on slower ones."""


@dataclass(frozen=True)
class Bristles:
    """What the log of each place shows, and the bristles' true stiffness [N/m] and damping [N s/m]."""

    by_place: tuple[Presliding, ...]
    stiffness: float
    damping: float


def run_experiment(stage: Stage, seed: int, progress: Progress) -> Outcome:
    """A small multisine at each place. Raises InputError for a stage whose friction has no bristles."""
    flat = stage.flat()
    if "friction.bristle_stiffness" not in flat:
        actual = f"model = {flat.get('friction.model', 'none')!r}"
        raise InputError("friction.model", actual, "friction with bristles", 'model = "lugre"')
    held = locked_stage(stage) if stage.joint else stage
    places = np.linspace(*travel(stage), PLACES)
    logs = []
    for number, place in enumerate(places):
        progress(number, PLACES, f"place {number + 1} of {PLACES}")
        logs.append(presliding_log(held, f"presliding_{number + 1}", place, seed + number))
    progress(PLACES, PLACES, "")
    contact = machine_between(as_built_keys(stage))
    results = tuple(bristles_from_presliding(log.log, contact) for log in logs)
    true = (flat["friction.bristle_stiffness"], flat.get("friction.bristle_damping", 0.0))
    notes = ("the joint is held by its limiter, as an engineer would clamp it",) if stage.joint else ()
    return Outcome("presliding", stage, seed, tuple(logs), Bristles(results, *map(float, true)), notes)


def presliding_log(stage: Stage, name: str, place: float, seed: int) -> RigLog:
    """The log of one small excitation at a place [m]."""
    kind = replace(GENTLE, samples=max(GENTLE.samples, 1 / (LONGEST * pace(stage))))
    return rig_log(excite(stage, place, seed, kind=kind), 0, name, "presliding", stage, seed)
