"""Friction force at constant speed along the rail.

Thesis, Sec. 4.2.3, Fig. 21. More speeds than the thesis's two show friction over velocity.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.identification.estimate import Estimate, with_interval
from friso.identification.experiments.slow_sliding import slow_sliding_caption, slow_sliding_panels
from friso.identification.readings.friction_position import FrictionPosition, friction_position
from friso.identification.readings.friction_velocity import FrictionVelocity, friction_velocity
from friso.progress import Progress
from friso.shown.documents import entries
from friso.shown.drawing.figure import BLUE, GREEN, ORANGE, PINK, VERMILLION, Axis, Figure, Markers, Panel, Series
from friso.shown.text import listed, with_unit
from friso.stage import Stage
from friso.stage.tables import moving_mass
from friso.virtual_rig.run import run
from friso.virtual_rig.task import legs
from friso_thesis.studies.rig.experiments import RigExperiment
from friso_thesis.studies.rig.many_speeds import (
    SAMPLES_PER_PERIOD,
    STANDING_TIME,
    ManySpeeds,
    PlaceOnRail,
    Slow,
    many_speeds,
    mean_friction,
    slow_sliding,
)
from friso_thesis.studies.rig.outcome import (
    Outcome,
    RigLog,
    freed,
    interval,
    locked_stage,
    longest_travel,
    pace,
    rig_log,
    stopped,
    travel,
)

PASS_DURATIONS = (480.0, 120.0)
"""Durations of the two passes in periods of the crossover. On the thesis's rig they give 2.5 and 10 mm/s."""


@dataclass(frozen=True)
class Passes:
    """Results of passes at constant speed along the rail, with the joint "free" or "locked".

    Fields are the log, and friction over position and over velocity. `true` is the true mean dynamic friction [N] over
    the way, at the two speeds, shape (2,).
    """

    name: str
    log: RigLog
    place: FrictionPosition
    velocity: FrictionVelocity
    true: np.ndarray


@dataclass(frozen=True)
class ConstantSpeedResult:
    """Results of the experiment at constant speed.

    `speeds` [m/s] are the two speeds of the thesis, and `cases` the passes at these speeds with the joint free and
    locked. `many` are passes at many speeds. `slow` is the slow sliding, empty if friction has no bristles.
    """

    speeds: tuple[float, ...]
    cases: tuple[Passes, ...]
    many: ManySpeeds
    slow: tuple[Slow, ...]


def pass_speeds(stage: Stage) -> tuple[float, ...]:
    """Return the two speeds [m/s] of the thesis for a stage, the slow one first."""
    return tuple(longest_travel(stage) * pace(stage) / periods for periods in PASS_DURATIONS)


def _passes(name: str, stage: Stage, seed: int) -> Passes:
    log, mass = passes_log(name, stage, seed), moving_mass(stage.flat())
    cart = log.true["cart_position"]
    if not len(cart):
        raise stopped(log)
    place = friction_position(log.log, mass, pace(stage))
    true = mean_friction(stage, np.array(pass_speeds(stage)), np.linspace(cart.min(), cart.max(), 1000))
    return Passes(name, log, place, friction_velocity(log.log, mass), true)


def passes_log(name: str, stage: Stage, seed: int) -> RigLog:
    """Return the log of passes to and fro at both speeds of the thesis.

    `name` says whether the joint of the stage is free or locked.
    """
    period, parts = 1 / pace(stage), [(0.0, STANDING_TIME / pace(stage))]
    for speed, periods in zip(pass_speeds(stage), PASS_DURATIONS, strict=True):
        for velocity in (speed, -speed):
            parts += [(velocity, periods * period), (0.0, STANDING_TIME * period)]
    task = legs(travel(stage)[0], parts)
    (recorded,) = run(stage, task, [seed], interval(stage, period / SAMPLES_PER_PERIOD))
    return rig_log(recorded, 0, name, "constant-speed", stage, seed)


COLOURS = (BLUE, VERMILLION, GREEN, ORANGE, PINK)
"""Colours of the places."""


def _slow(result: ConstantSpeedResult) -> list[str]:
    """Say what slow sliding shows of friction; empty if it was not tried."""
    if not result.slow:
        return []
    head = "Slow sliding, joint locked, at the edge of steady motion, with the true mass and bristles:"
    return [head, *map(_slow_place, result.slow)]


def _slow_place(sliding: Slow) -> str:
    """Write the friction identified at one place, beside its true values."""
    names = ("Coulomb friction", "static friction", "the Stribeck velocity")
    flat = sliding.log.stage.flat()
    true = [*sliding.true, flat["friction.stribeck_velocity"]]
    estimates = [
        with_interval(estimate) if estimate.determined else f"not shown ({estimate.reason})"
        for estimate in sliding.result.estimates
    ]
    texts = [
        f"{name} {text} (true: {with_unit(float(value), unit)})"
        for name, text, value, unit in zip(names, estimates, true, ("N", "N", "m/s"), strict=True)
    ]
    return f"From {_start(sliding.log)} on: {'; '.join(texts)}."


def _start(log: RigLog) -> str:
    """Write the position at which a log begins."""
    places = log.true.get("cart_position", log.true["position"])
    return with_unit(float(places[0]), "m") if len(places) else "nowhere"


def _many(result: ConstantSpeedResult) -> list[str]:
    """Say what many speeds show of friction at each place."""
    crossover = with_unit(result.many.crossover, "Hz")
    head = f"Many speeds, joint locked, crossover {crossover}:"
    return [head, *(_place(number, place) for number, place in enumerate(result.many.places, start=1))]


def _place(number: int, place: PlaceOnRail) -> str:
    """Write the friction identified at one place, with the speeds reached and what stays unknown."""
    both, reached = place.velocity.both, np.abs(place.velocity.velocities)
    named = (("Coulomb friction", both.coulomb), ("viscous friction", both.viscous))
    named += (("static friction", both.static), ("the Stribeck velocity", both.stribeck_velocity))
    certain = [f"{words} {with_interval(estimate)}" for words, estimate in named if estimate.determined]
    hidden = {
        estimate.reason: [words for words, named_estimate in named if named_estimate.reason == estimate.reason]
        for _, estimate in named
    }
    unknown = [f"not shown: {listed(words, 'and')} ({reason})" for reason, words in hidden.items() if reason]
    ends = [with_unit(float(end(reached)), "m/s") for end in (np.min, np.max) if len(reached)]
    passed = f"{len(reached)} steady passes{' from ' if ends else ''}{' to '.join(ends)}"
    head = f"Place {number}, from {_start(place.log)} on, {passed}"
    stopped = [f"the log stopped {place.log.failure}"] if place.log.failure else []
    return f"{head}: {'; '.join([*stopped, *certain, *unknown])}."


def _in_slow_sliding(outcome: Outcome) -> list[Figure]:
    """Draw the friction in slow sliding at the first place that shows it; empty if none does."""
    result: ConstantSpeedResult = outcome.result
    places = [sliding.result for sliding in result.slow if len(sliding.result.model)]
    if not places:
        return []
    caption, panels = slow_sliding_caption(places[0]), slow_sliding_panels(places[0])
    return [Figure("rig_slow_sliding", "Friction in slow sliding", caption, panels, subject=outcome.stage.name)]


def _over_velocity(outcome: Outcome) -> Figure:
    """Draw friction over speed, as measured and as it truly is, for each place."""
    many: ManySpeeds = outcome.result.many
    lines, points = [], []
    for number, (place, colour) in enumerate(zip(many.places, COLOURS, strict=False), start=1):
        lines.append(Series(place.speeds, place.true, f"true, place {number}", colour))
        points.append(Markers(np.abs(place.velocity.velocities), place.friction, f"place {number}", colour))
    return Figure(
        "rig_friction_over_velocity",
        "Friction over velocity, joint locked",
        f"Crossover {with_unit(many.crossover, 'Hz')}. Mean commanded force of each steady pass, there and back, "
        "without the force of inertia and the constant pull of the cables; the lines are the true friction, including "
        "the drag of the cables, averaged over the stretch that all passes share. Speeds without a mark were not "
        "steady.",
        (Panel("", Axis("Speed", "m/s", log=True), Axis("Friction", "N"), tuple(lines), markers=tuple(points)),),
        subject=outcome.stage.name,
    )


def _lines(passes: Passes, speeds: tuple[float, ...]) -> list[Series]:
    """Return the force over position of each forward pass."""
    forward = [record for record in passes.place.passes if record.velocity > 0]
    return [
        Series(record.places, record.force, with_unit(speed, "m/s"), colour)
        for record, speed, colour in zip(forward, speeds, (BLUE, VERMILLION), strict=False)
    ]


def _place_numbers(place: PlaceOnRail) -> dict[str, Any]:
    """Return the friction measured at one place, beside the true friction."""
    velocity = place.velocity
    both = (velocity.both.coulomb, velocity.both.viscous, velocity.both.static, velocity.both.stribeck_velocity)
    return {
        **entries(velocity, "velocities_m_per_s", "forces_n"),
        **entries(place, "friction_n"),
        "true_speeds_m_per_s": place.speeds,
        "true_dynamic_friction_n": place.true,
        **_estimates_document(both),
    }


def _estimates_document(estimates: Sequence[Estimate]) -> dict[str, Any]:
    """Return identified estimates with intervals, and the reason for each that is missing."""
    return {
        "shown": {
            estimate.name: entries(estimate, "value", "low", "high", "unit")
            for estimate in estimates
            if estimate.determined
        },
        "not_shown": {estimate.name: estimate.reason for estimate in estimates if not estimate.determined},
    }


def _numbers(passes: Passes) -> dict[str, Any]:
    """Return friction along the rail with the joint in one state."""
    coulomb = passes.velocity.both.coulomb
    return {
        **entries(passes.place, "separated", "verdict"),
        "repeatability": passes.place.repeatability.value,
        "passes": [
            {"velocity_m_per_s": record.velocity, "mean_force_n": record.mean.value, "deviation_n": record.spread}
            for record in passes.place.passes
        ],
        "coulomb_n": coulomb.value,
        "coulomb_reason": coulomb.reason,
        "true_dynamic_friction_n": np.asarray(passes.true).tolist(),
    }


class ConstantSpeedExperiment(RigExperiment):
    """Passes at constant speed along the rail, and slow sliding."""

    def run(self, stage: Stage, seed: int, progress: Progress) -> Outcome:
        """Run passes at two speeds with the joint free and locked, then many speeds with it locked.

        Slow sliding follows, also with the joint locked. Raises InputError for a stage without joint.
        """
        cases = []
        for number, (name, machine) in enumerate((("free", freed(stage)), ("locked", locked_stage(stage)))):
            progress(number, 4, f"constant speed, joint {name}")
            cases.append(_passes(name, machine, seed))
        progress(2, 4, "many speeds, joint locked, faster controller")
        many = many_speeds(locked_stage(stage), seed)
        progress(3, 4, "slow sliding, joint locked")
        slow = slow_sliding(locked_stage(stage), [place.log for place in many.places], seed)
        progress(4, 4, "")
        logs = tuple(recorded.log for recorded in (*cases, *many.places, *slow))
        return Outcome(
            "constant-speed", stage, seed, logs, ConstantSpeedResult(pass_speeds(stage), tuple(cases), many, slow)
        )

    def sentences(self, outcome: Outcome) -> list[str]:
        """Say what the experiment shows of friction along the rail and over speed.

        True values stand beside the measured ones.
        """
        result: ConstantSpeedResult = outcome.result
        lines = [f"Joint {case.name}: {case.place.verdict}" for case in result.cases]
        for case in result.cases:
            coulomb = case.velocity.both.coulomb
            level = with_unit(coulomb.value, "N") if coulomb.determined else f"not shown ({coulomb.reason})"
            lines.append(f"Joint {case.name}: Coulomb friction {level}.")
        true = listed(
            [
                f"{with_unit(float(force), 'N')} at {with_unit(speed, 'm/s')}"
                for force, speed in zip(result.cases[0].true, result.speeds, strict=True)
            ],
            "and",
        )
        return [*lines, f"The true mean dynamic friction along the travel is {true}.", *_many(result), *_slow(result)]

    def figures(self, outcome: Outcome) -> list[Figure]:
        """Draw force over position at both speeds, friction over velocity, and slow sliding."""
        result: ConstantSpeedResult = outcome.result
        panels = tuple(
            Panel(
                f"joint {case.name}",
                Axis("Position", "m"),
                Axis("Force", "N"),
                tuple(_lines(case, result.speeds)),
            )
            for case in result.cases
        )
        caption = "Commanded force of the forward pass, averaged over places; the log also has the return."
        title = "Force at constant speed"
        return [
            Figure("rig_constant_speed", title, caption, panels, columns=1, subject=outcome.stage.name),
            _over_velocity(outcome),
            *_in_slow_sliding(outcome),
        ]

    def numbers(self, outcome: Outcome) -> dict[str, Any]:
        """Return the results for the JSON document."""
        result: ConstantSpeedResult = outcome.result
        return {"speeds_m_per_s": [*result.speeds], "cases": {case.name: _numbers(case) for case in result.cases}} | {
            "many_speeds": {
                "crossover_hz": result.many.crossover,
                "places": [_place_numbers(place) for place in result.many.places],
            },
            "slow_sliding": [_estimates_document(sliding.result.estimates) for sliding in result.slow],
        }


EXPERIMENT = ConstantSpeedExperiment()
