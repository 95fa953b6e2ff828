"""Stiffness of the joint by position steps, with the cart fixed.

Thesis, Sec. 4.2.2, Fig. 19.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.equations.continuous import slow_gains
from friso.progress import Progress
from friso.shown.drawing.figure import BLUE, LIGHT, VERMILLION, Axis, Figure, Panel, Series
from friso.shown.text import range_with_unit, with_unit
from friso.stage import Stage
from friso.stage.controllers import as_tuned
from friso.virtual_rig.run import run
from friso.virtual_rig.task import staircase
from friso_thesis.studies.identification.steps import StepStiffness, stiffness_from_steps
from friso_thesis.studies.rig.experiments import RigExperiment
from friso_thesis.studies.rig.outcome import FIXED_MASS, Outcome, RigLog, freed, interval, pace, rig_log

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


class StiffnessExperiment(RigExperiment):
    """Position steps with the cart fixed, which show the stiffness of the joint."""

    def run(self, stage: Stage, seed: int, progress: Progress) -> Outcome:
        """Run reference steps with the cart fixed. Raises InputError for a stage without a joint."""
        progress(0, 1, "position steps")
        log = steps(stage, seed)
        progress(1, 1, "")
        flat = stage.flat()
        result = Stiffness(
            stiffness_from_steps(log.log),
            float(flat["joint.stiffness"]),
            float(flat.get("drive.motor_constant_ratio", 1)),
        )
        return Outcome("stiffness", stage, seed, (log,), result, _notes(stage))

    def sentences(self, outcome: Outcome) -> list[str]:
        """Say which joint stiffness the steps give, beside the true one."""
        result: Stiffness = outcome.result
        read = result.steps.stiffness
        if not read.determined:
            return [f"The steps do not show the joint's stiffness: {read.reason}."]
        lines = [
            f"The steps give a joint stiffness of {with_unit(read.value, 'N/m', 4)} (95 %: "
            f"{range_with_unit(read.low, read.high, 'N/m', 4)}); the true value is {with_unit(result.true, 'N/m', 4)}."
        ]
        if result.motor_constant_ratio != 1:
            lines.append(
                f"The motor gives {result.motor_constant_ratio:g} times the assumed force; that alone would make the "
                f"stiffness read {with_unit(result.apparent, 'N/m', 4)}."
            )
        return lines

    def figures(self, outcome: Outcome) -> list[Figure]:
        """Draw position and force over time in the experiment with position steps."""
        result: Stiffness = outcome.result
        (log,) = outcome.logs
        time, seconds = result.steps.time, Axis("Time", "s")
        panels = (
            Panel(
                "",
                seconds,
                Axis("Position", "m"),
                (
                    Series(time, log.logged["position"], "measured", BLUE),
                    Series(time, log.logged["reference"], "reference", VERMILLION, "dashed", 1.0),
                ),
            ),
            Panel(
                "",
                seconds,
                Axis("Force", "N"),
                (
                    Series(time, log.logged["force"], "commanded", LIGHT, width=0.8),
                    Series(time, result.steps.force, "low-passed", BLUE),
                ),
            ),
        )
        caption = "Position steps with the cart fixed; the differences of the settled levels give the stiffness."
        return [Figure("rig_stiffness", "Joint stiffness by steps", caption, panels, subject=outcome.stage.name)]

    def numbers(self, outcome: Outcome) -> dict[str, Any]:
        """Return the results for the JSON document."""
        result: Stiffness = outcome.result
        read = result.steps.stiffness
        return {
            "stiffness_n_per_m": read.value,
            "interval_n_per_m": [read.low, read.high],
            "true_n_per_m": result.true,
            "motor_constant_ratio": result.motor_constant_ratio,
            "apparent_n_per_m": result.apparent,
        }


EXPERIMENT = StiffnessExperiment()
