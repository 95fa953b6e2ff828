"""Draw remedies: the same move before and after, settling times of machines, and loops."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from friso.engine.batch import simulate
from friso.equations.motion import last_corner
from friso.frequency.loops import response
from friso.frequency.system import DriveTiming, limit_cases
from friso.remedies.catalogue import linear_flat
from friso.remedies.method import Advice, slowest
from friso.remedies.verified import RemedyOutcome
from friso.shown.drawing.figure import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PINK,
    SKY,
    VERMILLION,
    Axis,
    Dash,
    Figure,
    Panel,
    Series,
)
from friso.shown.text import with_unit
from friso.stage import Stage

COLOURS = (BLUE, VERMILLION, GREEN, ORANGE, PINK, SKY)
"""Colours of remedies with settings, in order; further remedies repeat them, dashed."""

RESPONSE_SAMPLES = 4000
"""Number of samples of a time response."""

SHOWN_SETTLING_TIMES = 3.0
"""Duration of drawn responses, relative to the settling time that 95 % of machines reach with a working remedy."""

RESPONSE_RTOL = 1e-7
"""Relative tolerance of drawn responses."""


def tune_figures(tuning: Advice) -> list[Figure]:
    """Return one figure of the response, settling times and sensitivities."""
    lines = drawn_stages(tuning)
    panels = (_response(tuning, lines), _settling(tuning, lines), _sensitivity(tuning, lines))
    caption = (
        "Deviation of the stage of the file from its reference after the last corner of its own motion; the share of "
        f"fresh machines in position within {with_unit(tuning.goal.within, 'm')}; the sensitivity of the loop in its "
        "limit cases, whose largest value is one over the modulus margin. Drawn are what changes least and what "
        "settles soonest, with the controller alone and with a joint; the table has all."
    )
    return [Figure("tune", "Before and after", caption, panels, subject=tuning.stage.name)]


class RemedyLine(NamedTuple):
    """How the lines of one stage look: label, colour and dashes."""

    label: str
    colour: str
    dash: Dash


ShownRemedy = tuple[Stage, RemedyOutcome | None, RemedyLine]
Lines = Sequence[ShownRemedy]


def drawn_stages(tuning: Advice) -> list[ShownRemedy]:
    """Return the stages that are drawn, with their lines.

    The stage as it is comes first. Then come the least change and the fastest remedy: of those that need no new joint,
    then of those that do. If no remedy works, all that have a stage are drawn.
    """
    lines: list[ShownRemedy] = [(tuning.stage, None, RemedyLine("as it is", INK, "solid"))]
    for outcome in _shown(tuning):
        assert outcome.stage is not None
        again, number = divmod(len(lines) - 1, len(COLOURS))
        line = RemedyLine(_name(outcome), COLOURS[number], "dashed" if again else "solid")
        lines.append((outcome.stage, outcome, line))
    return lines


def _shown(tuning: Advice) -> list[RemedyOutcome]:
    """Select the remedies to plot: the first and the quickest, without and with a bought joint.

    If no remedy works, all that have a stage are selected.
    """
    if not tuning.working:
        return [outcome for outcome in tuning.outcomes if outcome.stage is not None]
    listed: list[RemedyOutcome] = []
    for joint in (False, True):
        some = [outcome for outcome in tuning.working if outcome.remedy.buys_joint == joint]
        if some:
            soonest = min(some, key=lambda outcome: slowest(outcome, tuning.goal))
            listed += [some[0]] if soonest is some[0] else [some[0], soonest]
    return listed


def _name(outcome: RemedyOutcome) -> str:
    """Return the name of a remedy, marked if it is not sure to work."""
    return f"{outcome.remedy.name}{'' if outcome.certainty == 'works' else ' (not sure)'}"


def _response(tuning: Advice, lines: Lines) -> Panel:
    """Return the panel of the deviation after the move, for each stage drawn.

    The range of the axis shows the final behaviour of the stage as it is.
    """
    flat = tuning.stage.flat()
    corner, series, shown_to = float(last_corner(flat)), [], 20 * tuning.goal.within
    for stage, outcome, line in lines:
        trace = simulate(stage, RESPONSE_RTOL, flat["motion.duration"] / RESPONSE_SAMPLES)
        after = np.asarray(trace["time"]) >= corner
        off = np.asarray(trace["position"] - trace["reference"])[after]
        series.append(Series(np.asarray(trace["time"])[after] - corner, off, *line))
        if outcome is None:  # the final behaviour must be visible
            shown_to = max(shown_to, 1.2 * float(np.abs(off[len(off) // 2 :]).max()))
    y = Axis("Deviation", "m", (-shown_to, shown_to))
    settled = [slowest(outcome, tuning.goal) for _, outcome, _ in lines if outcome]
    end = min(
        flat["motion.duration"] - corner,
        SHOWN_SETTLING_TIMES * max((time for time in settled if np.isfinite(time)), default=np.inf),
    )
    return Panel("The same move", Axis("Time after the move", "s", (0.0, end)), y, tuple(series))


def _settling(tuning: Advice, lines: Lines) -> Panel:
    """Return the panel of the fraction of machines in position over the time since the move."""
    flat = tuning.stage.flat()
    drawn = [(outcome.measured if outcome else tuning.present, line) for _, outcome, line in lines]
    longest = max(
        np.max(measured.moves.settling, where=np.isfinite(measured.moves.settling), initial=0.0)
        for measured, _ in drawn
        if measured
    )
    end = max(flat["motion.duration"] - float(last_corner(flat)), float(longest))  # the move itself may take longer
    start = 1e-3 * end
    series = []
    for measured, line in drawn:
        if measured is not None:
            times = measured.moves.settling[0]
            ordered = np.maximum(np.sort(times[np.isfinite(times)]), start)
            x = np.concatenate([[start], np.repeat(ordered, 2), [end]])
            series.append(Series(x, np.repeat(100 * np.arange(len(ordered) + 1) / len(times), 2), *line))
    axis = Axis("Time after the move", "s", (start, end), log=True, prefixed=False)
    return Panel("In position to stay", axis, Axis("Share of machines", "%", (-3.0, 103.0)), tuple(series))


def _sensitivity(tuning: Advice, lines: Lines) -> Panel:
    """Draw each stage's sensitivity over frequency, the largest of all limit cases.

    The loops include the drive as built, up to half its sampling rate, just as the margins do.
    """
    omega, series = np.geomspace(1.0, 2e4, 600), []
    for stage, _, line in lines:
        built = tuning.complete(stage)
        flat = linear_flat(built, built.flat())
        drive = DriveTiming.of(flat)
        within = omega[omega <= drive.highest]
        loops = [response(flat, case, drive)(within) for case in limit_cases(flat).values()]
        worst = np.max([1 / np.abs(1 + loop) for loop in loops], axis=0)
        series.append(Series(within / (2 * np.pi), worst, *line))
    limit = Series(
        np.array([omega[0], omega[-1]]) / (2 * np.pi),
        np.full(2, 1 / tuning.goal.margin),
        f"margin of {tuning.goal.margin:g}",
        GREY,
        "dashed",
    )
    return Panel(
        "Loops: the largest sensitivity of the limit cases",
        Axis.of_frequency(omega / (2 * np.pi)),
        Axis("Sensitivity", "", (0.05, 5.0), log=True),
        (*series, limit),
    )
