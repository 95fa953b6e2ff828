"""Static friction by stick-slip in slow motion.

Thesis, Sec. 4.2.3, Fig. 20.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.equations.conditions import anywhere, level_under_conditions
from friso.equations.rail import friction_factors
from friso.errors import InputError
from friso.progress import Progress
from friso.shown.drawing.figure import BLUE, GREEN, INK, VERMILLION, Array, Axis, Band, Figure, Markers, Panel, Series
from friso.shown.text import range_with_unit, with_unit
from friso.stage import Stage
from friso.virtual_rig.run import RecordedRuns, run
from friso.virtual_rig.task import legs
from friso_thesis.studies.identification.stick_slip import StickSlip, static_from_stick_slip
from friso_thesis.studies.rig.experiments import RigExperiment
from friso_thesis.studies.rig.outcome import Outcome, RigLog, freed, friction, interval, pace, rig_log, travel

STICTION_RAILS = 10
"""Number of rails, each drawn anew (friso's choice); the thesis has "multiple experiments"."""

LOADING_TIME, STANDING_TIME, SAMPLES_PER_PERIOD = 16.0, 16.0, 125.0
"""Timing of the experiment in periods of the crossover, and samples of the log per period.

LOADING_TIME is the time in which the joint is loaded up to the friction force (2 s on the thesis's rig, at 0.63 mm/s).
STANDING_TIME is the time for which the reference stands between velocities. Samples are 1 ms apart on the thesis's rig.
"""

LOADINGS_PER_LEG = 8
"""Number of times that the joint is loaded in each leg."""

SPEED_MULTIPLES = (1, 2, -1, -2)
"""Successive velocities as multiples of the slow speed: forward and back (friso's choice)."""


@dataclass(frozen=True)
class Stiction:
    """Results of the stiction experiment.

    The logs are evaluated with the joint's true stiffness. For each rail, `true` has the least and greatest true static
    friction [N] where the cart went, shape (rails, 2). `speed` [m/s] is that of the slow motion.
    """

    by_rail: tuple[StickSlip, ...]
    true: np.ndarray
    speed: float

    @property
    def forces(self) -> np.ndarray:
        """Return the break-away forces [N] of all slips, shape (slips,)."""
        return np.concatenate([slips.forces for slips in self.by_rail])


def _note(flat: Mapping[str, Any]) -> str:
    """Say to which stroke the limiters are set."""
    stroke = f"{flat['joint.stroke'] * 1e3:g} mm"
    return f"the limiters are set to {stroke}, which is recorded beside the logs for friso identify"


def slow_speed(stage: Stage) -> float:
    """Return the speed [m/s] that loads a sticking cart up to its friction in `LOADING_TIME` periods.

    The periods are those of the crossover.
    """
    return friction(stage) / freed(stage).flat()["joint.stiffness"] * pace(stage) / LOADING_TIME


def slow_legs(stage: Stage, seed: int, rails: int = STICTION_RAILS) -> tuple[RigLog, ...]:
    """Return logs of slow motion to and fro, on `rails` rails of successive seeds.

    All motions start from the same place.
    """
    free, period, slow = freed(stage), 1 / pace(stage), slow_speed(stage)
    parts = [(0.0, STANDING_TIME * period / 4)]
    for factor in SPEED_MULTIPLES:
        parts += [
            (factor * slow, LOADINGS_PER_LEG * LOADING_TIME * period / abs(factor)),
            (0.0, STANDING_TIME * period),
        ]
    task = legs(travel(stage)[0], parts)
    rails_of_runs = {"rail.seed": stage.flat()["rail.seed"] + np.arange(rails)} if stage.rail else {}
    logs: list[RigLog] = []
    for chunk in run(
        free,
        task,
        [seed + number for number in range(rails)],
        interval(stage, period / SAMPLES_PER_PERIOD),
        rails_of_runs,
    ):
        logs += [_log(free, chunk, row, int(number), seed) for row, number in enumerate(chunk.numbers)]
    return tuple(logs)


def _log(free: Stage, chunk: RecordedRuns, row: int, number: int, seed: int) -> RigLog:
    """Return the log of one rail, with the stage that has this rail.

    The run is the one in `row` of a chunk of runs, and `number` is the rail's index.
    """
    on_rail = free.with_numbers({"rail.seed": free.flat()["rail.seed"] + number}) if free.rail else free
    return rig_log(chunk, row, f"rail_{number + 1:02d}", "stick-slip", on_rail, seed + number)


def true_range(log: RigLog) -> tuple[float, float]:
    """Return the least and greatest static friction [N] where the cart of a log went."""
    flat = anywhere(log.stage.flat())
    along = level_under_conditions(flat, "static") * friction_factors(flat, log.true["cart_position"])[0]
    return float(along.min()), float(along.max())


def rails_within_interval(result: Stiction) -> np.ndarray:
    """Tell on which rails the estimated interval contains the true static friction, (rails,).

    The true value is the middle between the least and the greatest friction on the rail.
    """
    middles = result.true.mean(axis=1)
    return np.array([slips.static.holds(middle) for slips, middle in zip(result.by_rail, middles, strict=True)])


def _rails(result: Stiction, subject: str) -> Figure:
    """Draw the break-away forces of each rail, over the range of its true static friction."""
    numbers_ = np.arange(1.0, len(result.by_rail) + 1)
    rows = np.concatenate([np.full(len(slips.forces), n) for n, slips in zip(numbers_, result.by_rail, strict=True)])
    truth = Band(numbers_, result.true[:, 0], result.true[:, 1], "true static friction along the travel", "#cfdfee")
    top = 1.1 * max(float(result.true.max()), float(result.forces.max(initial=0.0)))
    panel = Panel(
        "",
        Axis("Stretch of rail", "", (0.5, len(numbers_) + 0.5), step=1.0),
        Axis("Break-away force", "N", (0.0, top)),
        markers=(Markers(rows, result.forces, "read at a slip", INK),),
        bands=(truth,),
    )
    caption = "At a finite force rate the cart breaks away slightly before its static friction is reached."
    return Figure("rig_stiction_rails", "Break-away along the rail", caption, (panel,), subject=subject)


class StictionExperiment(RigExperiment):
    """Slow motion that sticks and slips, on several rails."""

    def run(self, stage: Stage, seed: int, progress: Progress) -> Outcome:
        """Run slow motion to and fro on several rails, and evaluate the break-away forces.

        Raises InputError for a stage without a joint, or without static friction.
        """
        if "friction.static" not in stage.flat():
            actual = f"model = {stage.flat().get('friction.model', 'none')!r}"
            raise InputError("friction.model", actual, "friction with a static level", 'model = "lugre"')
        progress(0, 1, f"slow motion on {STICTION_RAILS} rails")
        logs = slow_legs(stage, seed)
        progress(1, 1, "")
        flat = freed(stage).flat()
        results = tuple(
            static_from_stick_slip(log.log, flat["joint.stiffness"], flat["masses.stage"], flat["joint.stroke"])
            for log in logs
        )
        true = np.array([true_range(log) for log in logs])
        return Outcome("stiction", stage, seed, logs, Stiction(results, true, slow_speed(stage)), (_note(flat),))

    def sentences(self, outcome: Outcome) -> list[str]:
        """Say at which forces the cart breaks away, beside the true static friction."""
        result: Stiction = outcome.result
        forces, within = result.forces, rails_within_interval(result)
        rails = len(result.by_rail)
        truth = range_with_unit(float(result.true.min()), float(result.true.max()), "N")
        if not len(forces):
            return [
                f"The cart does not slip on any of {rails} stretches of rail; the true static friction there is "
                f"{truth}."
            ]
        return [
            f"At {with_unit(result.speed, 'm/s')} and {with_unit(SPEED_MULTIPLES[1] * result.speed, 'm/s')} the cart "
            "breaks away "
            f"{len(forces)} times on {rails} stretches of rail, at "
            f"{range_with_unit(float(forces.min()), float(forces.max()), 'N')}.",
            f"The true static friction there is {truth}; its mean along the travel lies within the 95 % interval on "
            f"{int(within.sum())} of {rails}.",
        ]

    def figures(self, outcome: Outcome) -> list[Figure]:
        """Draw the motion over time on the first rail, and the break-away forces on all rails."""
        result: Stiction = outcome.result
        log, first = outcome.logs[0], result.by_rail[0]
        time: Array = np.arange(len(first.pull), dtype=np.float64) * log.interval
        seconds = Axis("Time", "s")
        reference, start = log.logged["reference"], log.logged["reference"][0]
        panels = (
            Panel(
                "",
                seconds,
                Axis("Position", "m"),
                (
                    Series(time, log.logged["position"] - start, "measured", BLUE),
                    Series(time, reference - start, "reference", VERMILLION, "dashed", 1.0),
                ),
            ),
            Panel(
                "",
                seconds,
                Axis("Relative position", "m"),
                (Series(time, log.logged["relative_position"], "", GREEN, width=1.0),),
                (Markers(first.times, first.directions * first.deflections, "break-away", INK),),
            ),
            Panel("", seconds, Axis("Cart velocity", "m/s"), (Series(time, first.cart_velocity, "", BLUE, width=1.0),)),
        )
        caption = (
            "The joint deflects while the cart sticks; at each peak the cart breaks away, and its velocity spikes."
        )
        typical = Figure("rig_stiction", "Slow motion with stick-slip", caption, panels, subject=outcome.stage.name)
        return [typical, _rails(result, outcome.stage.name)]

    def numbers(self, outcome: Outcome) -> dict[str, Any]:
        """Return the results for the JSON document."""
        result: Stiction = outcome.result
        rows = [
            {
                "static_n": slips.static.value,
                "interval_n": [slips.static.low, slips.static.high],
                "break_away_n": slips.forces.tolist(),
                "true_range_n": true.tolist(),
            }
            for slips, true in zip(result.by_rail, result.true, strict=True)
        ]
        return {"speed_m_per_s": result.speed, "rails": rows}


EXPERIMENT = StictionExperiment()
