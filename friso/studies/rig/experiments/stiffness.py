"""Stiffness of the joint by position steps, with the cart fixed.

Thesis, Sec. 4.2.2, Fig. 19.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from friso.equations.continuous import slow_gains
from friso.identification.experiments.steps import StepStiffness, stiffness_from_steps
from friso.progress import Progress
from friso.stage import Stage
from friso.stage.controllers import as_tuned
from friso.studies.rig.outcome import FIXED_MASS, Outcome, RigLog, freed, interval, pace, rig_log
from friso.virtual_rig.run import run
from friso.virtual_rig.task import staircase

STEP_SIZE, STEP_DIRECTIONS = 0.3, (1, 1, -1, -1, 1, -1)
"""Size of a step in strokes (0.3 mm on the thesis's rig, Sec. 4.2.2), and directions of the steps (friso's choice)."""

STANDING_TIME, LONGEST_STAND, SETTLED_TIME, SAMPLES_PER_PERIOD = 16.0, 64.0, 5.0, 125.0
"""Timing of the steps, all friso's choice.

Each step stands for STANDING_TIME (2 s on the thesis's rig) to LONGEST_STAND periods of the crossover. In between, it
stands for SETTLED_TIME time constants of the integrator against the joint. SAMPLES_PER_PERIOD are those of the log per
period (1 ms apart).
"""


@dataclass(frozen=True)
class Stiffness:
    """Results of the stiffness experiment: the fit to the log, and the true stiffness [N/m].

    `motor_constant_ratio`, of true to assumed motor constant, is the factor by which the drive's newtons are too small.
    """

    steps: StepStiffness
    true: float
    motor_constant_ratio: float

    @property
    def apparent(self) -> float:
        """Return the stiffness [N/m] that a log shows whose newtons are too small."""
        return self.true / self.motor_constant_ratio


def run_experiment(stage: Stage, seed: int, progress: Progress) -> Outcome:
    """Run reference steps with the cart fixed. Raises InputError for a stage without a joint."""
    progress(0, 1, "position steps")
    log = steps(stage, seed)
    progress(1, 1, "")
    flat = stage.flat()
    result = Stiffness(
        stiffness_from_steps(log.log), float(flat["joint.stiffness"]), float(flat.get("drive.motor_constant_ratio", 1))
    )
    return Outcome("stiffness", stage, seed, (log,), result, _notes(stage))


def steps(stage: Stage, seed: int) -> RigLog:
    """Return the log of position steps of a stage with its joint free and its cart fixed."""
    free, period = freed(stage), 1 / pace(stage)
    step = STEP_SIZE * stage.flat()["joint.stroke"]
    stands = np.clip(SETTLED_TIME * pulling_time(free), STANDING_TIME * period, LONGEST_STAND * period)
    task = staircase([sign * step for sign in STEP_DIRECTIONS], float(stands))
    held = {"masses.cart": np.array([FIXED_MASS])}
    held |= {key: np.array([value]) for key, value in as_tuned(stage.flat()).items()}
    (recorded,) = run(free, task, [seed], interval(stage, period / SAMPLES_PER_PERIOD), held)
    return rig_log(recorded, 0, "steps", "steps", free, seed)


def pulling_time(stage: Stage) -> float:
    """Return the time constant [s] with which the integrator moves the joint to the reference.

    The cart is fixed. The time is the proportional gain plus the joint's stiffness, over the integral gain; 0 without
    an integrator.
    """
    flat = stage.flat()
    proportional, integral = slow_gains(flat)
    return float((proportional + flat["joint.stiffness"]) / integral) if integral > 0 else 0.0


def _notes(stage: Stage) -> tuple[str, ...]:
    """Return notes on how the stage was set up, and on what its stiffness includes."""
    notes = ["the cart is fixed and the limiters are far away, as an engineer would set them up; the joint is free"]
    if stage.flat().get("cable.stiffness", 0.0) > 0:
        notes.append("the cables move with the stage: their stiffness is included in the result")
    return tuple(notes)
