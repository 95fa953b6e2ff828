"""Remedies, drawn: the same move before and after, settling times of the machines, and loops."""

from __future__ import annotations

import numpy as np

from friso.engine.simulate import simulate
from friso.equations.motion import last_corner
from friso.frequency.drive import DriveTiming
from friso.frequency.loops import response
from friso.frequency.members import limit_cases
from friso.remedies.method import Advice
from friso.remedies.verified import RemedyOutcome
from friso.stage import Stage
from friso.views.drawing.figure import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PINK,
    SKY,
    VERMILLION,
    Axis,
    Figure,
    Panel,
    Series,
)
from friso.views.drawing.prefixes import with_unit

COLOURS = (BLUE, VERMILLION, GREEN, ORANGE, PINK, SKY)
"""Of the remedies, in their order; more than these begin again."""

SAMPLES = 4000
"""Samples of a time response."""

RTOL = 1e-7
"""Relative tolerance of the responses that are drawn."""


def figures(tuning: Advice) -> list[Figure]:
    """The response, the settling times and the sensitivities."""
    stages = shown(tuning)
    panels = (_response(tuning, stages), _settling(tuning), _sensitivity(stages))
    caption = (
        "Deviation of the stage of the file from its reference after the last corner of its own motion; the share of "
        f"fresh machines in position within {with_unit(tuning.goal.within, 'm')}; the sensitivity of the loop in its "
        "limit cases, whose largest value is one over the modulus margin."
    )
    return [Figure("tune", "Before and after", caption, panels, subject=tuning.stage.name)]


def shown(tuning: Advice) -> list[tuple[str, Stage, str]]:
    """The stages that are drawn, with names and colours: as it is, and with each remedy that has a stage."""
    remedies = [outcome for outcome in tuning.outcomes if outcome.stage is not None]
    return [
        ("as it is", tuning.stage, INK),
        *((_name(outcome), outcome.stage, colour(tuning, outcome)) for outcome in remedies if outcome.stage),
    ]


def colour(tuning: Advice, outcome: RemedyOutcome) -> str:
    """The colour of a remedy."""
    return COLOURS[tuning.outcomes.index(outcome) % len(COLOURS)]


def _name(outcome: RemedyOutcome) -> str:
    return outcome.remedy.name if outcome.certainty == "works" else f"{outcome.remedy.name} (not sure)"


def _response(tuning: Advice, stages: list[tuple[str, Stage, str]]) -> Panel:
    flat = tuning.stage.flat()
    corner, series = float(last_corner(flat)), []
    for name, stage, line in stages:
        trace = simulate(stage, RTOL, flat["motion.duration"] / SAMPLES)
        after = np.asarray(trace["time"]) >= corner
        off = np.asarray(trace["position"] - trace["reference"])[after]
        series.append(Series(np.asarray(trace["time"])[after] - corner, off, name, line))
    y = Axis("Deviation", "m", (-20 * tuning.goal.within, 20 * tuning.goal.within))
    return Panel("The same move", Axis("Time after the move", "s"), y, tuple(series))


def _settling(tuning: Advice) -> Panel:
    flat = tuning.stage.flat()
    end = flat["motion.duration"] - float(last_corner(flat))
    rows = [("as it is", tuning.present.moves.settling[0], INK)]
    rows += [
        (_name(outcome), outcome.measured.moves.settling[0], colour(tuning, outcome))
        for outcome in tuning.outcomes
        if outcome.measured is not None
    ]
    start = 1e-3 * end
    series = []
    for name, times, line in rows:
        ordered = np.maximum(np.sort(times[np.isfinite(times)]), start)
        x = np.concatenate([[start], np.repeat(ordered, 2), [end]])
        series.append(Series(x, np.repeat(100 * np.arange(len(ordered) + 1) / len(times), 2), name, line))
    axis = Axis("Time after the move", "s", (start, end), log=True, prefixed=False)
    return Panel("In position for good", axis, Axis("Share of machines", "%", (-3.0, 103.0)), tuple(series))


def _sensitivity(stages: list[tuple[str, Stage, str]]) -> Panel:
    omega, series = np.geomspace(1.0, 2e4, 600), []
    for name, stage, line in stages:
        flat = stage.flat()
        worst = np.max(
            [1 / np.abs(1 + response(flat, case, DriveTiming.of(flat))(omega)) for case in limit_cases(flat).values()],
            axis=0,
        )
        series.append(Series(omega / (2 * np.pi), worst, name, line))
    limit = Series(np.array([omega[0], omega[-1]]) / (2 * np.pi), np.full(2, 2.0), "margin of 0.5", GREY, "dashed")
    return Panel(
        "Loops: the largest sensitivity of the limit cases",
        Axis.of_frequency(omega / (2 * np.pi)),
        Axis("Sensitivity", "", (1e-2, 10.0), log=True),
        (*series, limit),
    )
