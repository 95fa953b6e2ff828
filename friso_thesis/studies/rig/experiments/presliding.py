"""Stiffness and damping of the bearing's bristles, from small motion before it slides.

Loops up to break-away tell friction laws apart. The joint is locked. The thesis has no such experiment, but the
bristles decide whether a machine near the boundary of hunting hunts.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from friso.errors import InputError
from friso.identification.estimate import with_interval
from friso.identification.experiments.presliding import (
    Presliding,
    bristles_from_presliding,
    presliding_caption,
    presliding_panels,
)
from friso.identification.readings.at_bearing import machine_between
from friso.progress import Progress
from friso.quantities import percent
from friso.shown.drawing.figure import BLUE, Axis, Figure, Panel, Series
from friso.shown.text import with_unit
from friso.stage import Stage
from friso.stage.controllers import FORCE_LIMIT
from friso.stage.tables import friction_law
from friso.virtual_rig.run import as_built_keys, run
from friso.virtual_rig.task import standing
from friso_thesis.studies.rig.experiments import RigExperiment
from friso_thesis.studies.rig.outcome import (
    Excitation,
    Outcome,
    RigLog,
    excite,
    friction,
    interval,
    locked_stage,
    pace,
    rig_log,
    travel,
)

TRAVEL_PLACES = 3
"""Number of places along the travel (friso's choice)."""

GENTLE, LONGEST_EXCITATION = Excitation(0.05, 12.0, 60, 160.0), 1e-3
"""Excitation with an RMS of a twentieth of static friction, up to 96 Hz on the thesis's rig, logged every 0.75 ms; and
the longest sample time [s], for slower rigs."""

LOOP_AMPLITUDES = np.linspace(0.2, 0.9, 8)
"""Force amplitudes of loops over static friction.

At the largest, some places along the rail break away.
"""

LOOP_PERIOD, LOOP_COUNT, SAMPLES_PER_PERIOD = 4.0, 4, 125.0
"""Periods of the crossover that a loop takes, and number of loops.

SAMPLES_PER_PERIOD are those of the log per period of the crossover. On the thesis's rig a loop takes 0.5 s, with
samples 1 ms apart.
"""


@dataclass(frozen=True)
class Bristles:
    """Results of the presliding experiment: fits by place, logs of loops, and true bristles.

    The true `stiffness` is in [N/m], and the true `damping` in [N s/m].
    """

    by_place: tuple[Presliding, ...]
    stiffness: float
    damping: float
    loops: tuple[RigLog, ...]


def presliding_log(stage: Stage, name: str, place: float, seed: int) -> RigLog:
    """Return the log of a small multisine (sum of sines) at a place [m] on the rail."""
    kind = replace(GENTLE, samples=max(GENTLE.samples, 1 / (LONGEST_EXCITATION * pace(stage))))
    return rig_log(excite(stage, place, seed, kind=kind), 0, name, "presliding", stage, seed)


def loop_log(stage: Stage, name: str, place: float, seed: int, share: float) -> RigLog:
    """Return the log of loops at a place [m], made by a sinusoidal force.

    The amplitude of the force is a fraction `share` of static friction.
    """
    step = as_built_keys(stage)["drive.sample_time"]
    samples = round(LOOP_PERIOD / pace(stage) / step)
    turn = share * friction(stage) * np.sin(2 * np.pi * np.arange(samples) / samples)
    task = standing(place, LOOP_COUNT * samples * step)
    task = replace(task, injected=np.tile(turn, LOOP_COUNT), injected_each=step)
    (recorded,) = run(stage, task, [seed], interval(stage, 1 / (SAMPLES_PER_PERIOD * pace(stage))))
    return rig_log(recorded, 0, name, "presliding", stage, seed)


LOOP_ROWS = 4
"""Number of rows of loops in the figure."""


def _place(result: Presliding) -> str:
    """Write stiffness and damping of the bristles, and the mass, as identified at one place."""
    estimates = {"stiffness": result.stiffness, "damping": result.damping, "moving mass": result.mass}
    return "; ".join(
        f"{words} {with_interval(estimate)}" if estimate.determined else f"{words} not shown ({estimate.reason})"
        for words, estimate in estimates.items()
    )


def _small(result: Presliding, outcome: Outcome) -> Figure:
    """Draw small motion before sliding, with the model of mass and bristles."""
    title = "Small motion before sliding"
    return Figure(
        "rig_presliding", title, presliding_caption(result), presliding_panels(result), subject=outcome.stage.name
    )


def _loops(bristles: Bristles, outcome: Outcome) -> Figure:
    """Draw force over displacement, from the smallest loop to the largest."""
    panels = []
    for share, log in zip(LOOP_AMPLITUDES, bristles.loops, strict=True):
        displacement = log.logged["position"] - log.logged["position"][:1]
        line = Series(displacement, log.logged["force"], "", BLUE, width=1.0)
        title = f"To {percent(share)} of static friction"
        panels.append(Panel(title, Axis("Displacement", "m"), Axis("Force", "N"), (line,)))
    caption = "Commanded force over displacement at one place, four turns each. One far wider than others broke away."
    columns = len(LOOP_AMPLITUDES) // LOOP_ROWS
    return Figure(
        "rig_presliding_loops", "Loops before sliding", caption, tuple(panels), columns, subject=outcome.stage.name
    )


class PreslidingExperiment(RigExperiment):
    """Small motion and loops of force before the bearing slides."""

    def run(self, stage: Stage, seed: int, progress: Progress) -> Outcome:
        """Run a small multisine (sum of sines) at each place, and loops of force at the middle one.

        Raises InputError for a stage whose friction has no bristles.
        """
        flat = stage.flat()
        measured = friction_law(flat["friction.model"]).shown(flat) if "friction.model" in flat else None
        if measured is None or not measured.stiffness > 0:
            actual = f"model = {flat.get('friction.model', 'none')!r}"
            raise InputError("friction.model", actual, "friction with bristles", 'model = "lugre"')
        held = locked_stage(stage) if stage.joint else stage
        places = np.linspace(*travel(stage), TRAVEL_PLACES)
        logs, loops, count = [], [], TRAVEL_PLACES + len(LOOP_AMPLITUDES)
        for number, place in enumerate(places):
            progress(number, count, f"place {number + 1} of {TRAVEL_PLACES}")
            logs.append(presliding_log(held, f"presliding_{number + 1}", place, seed + number))
        for number, share in enumerate(LOOP_AMPLITUDES):
            progress(TRAVEL_PLACES + number, count, f"loop {number + 1} of {len(LOOP_AMPLITUDES)}")
            name, own_seed = f"presliding_loop_{number + 1}", seed + TRAVEL_PLACES + number
            loops.append(loop_log(held, name, float(places[TRAVEL_PLACES // 2]), own_seed, float(share)))
        progress(count, count, "")
        contact = machine_between(as_built_keys(stage))
        results = tuple(bristles_from_presliding(log.log, contact) for log in logs)
        shown = Bristles(results, measured.stiffness, measured.damping, tuple(loops))
        notes = ["the joint is held by its limiter, as an engineer would clamp it"] if stage.joint else []
        reach = flat.get(FORCE_LIMIT, np.inf) / friction(stage)
        if reach < LOOP_AMPLITUDES[-1]:
            notes.append(f"the force limit is {percent(reach)} of static friction: larger loops are cut off there")
        return Outcome("presliding", stage, seed, (*logs, *loops), shown, tuple(notes))

    def sentences(self, outcome: Outcome) -> list[str]:
        """Say which stiffness and damping of the bristles each place shows, beside the true values."""
        result: Bristles = outcome.result
        lines = [f"Place {number}: {_place(place)}." for number, place in enumerate(result.by_place, start=1)]
        stiffness, damping = with_unit(result.stiffness, "N/m", 4), with_unit(result.damping, "N*s/m", 4)
        loops = (
            f"{len(result.loops)} loops of force over displacement, to {percent(LOOP_AMPLITUDES[0])} up to "
            f"{percent(LOOP_AMPLITUDES[-1])} of "
            "static friction, tell friction laws apart."
        )
        return [*lines, f"True bristles: stiffness {stiffness}, damping {damping}.", loops]

    def figures(self, outcome: Outcome) -> list[Figure]:
        """Draw force and model at the first place that shows the bristles, and the loops."""
        bristles: Bristles = outcome.result
        result = next((place for place in bristles.by_place if len(place.model)), None)
        small = [] if result is None else [_small(result, outcome)]
        return [*small, _loops(bristles, outcome)]

    def numbers(self, outcome: Outcome) -> dict[str, Any]:
        """Return the results for the JSON document."""
        bristles: Bristles = outcome.result
        places = [
            {
                "stiffness_n_per_m": [result.stiffness.value, result.stiffness.low, result.stiffness.high],
                "damping_n_s_per_m": [result.damping.value, result.damping.low, result.damping.high],
                "mass_kg": [result.mass.value, result.mass.low, result.mass.high],
                "unexplained": result.unexplained,
            }
            for result in bristles.by_place
        ]
        return {
            "places": places,
            "true_stiffness_n_per_m": bristles.stiffness,
            "true_damping_n_s_per_m": bristles.damping,
            "loops_share_of_static": [*LOOP_AMPLITUDES],
        }


EXPERIMENT = PreslidingExperiment()
