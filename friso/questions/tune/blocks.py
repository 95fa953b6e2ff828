"""Show the remedies that `friso tune` found: their gains in the terms of drives, figures, and blocks.

Figures show the same move before and after, the settling times of machines, and loops. Every remedy gets a stage file.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from friso.axis import axis_shown
from friso.drives.gains import gains_of
from friso.engine.batch import simulate
from friso.equations.motion import last_corner
from friso.frequency.loops import response
from friso.frequency.system import DriveTiming, limit_cases
from friso.questions.check.built_words import built_document
from friso.questions.export.words import rows as gain_rows
from friso.questions.tune.words import (
    COLUMNS,
    answer,
    assumptions,
    changes,
    explained,
    failing,
    rows,
    unsure_why,
    why_unmet,
)
from friso.remedies.catalogue import linear_flat
from friso.remedies.method import Advice, slowest
from friso.remedies.verified import Performance, RemedyOutcome
from friso.shown.blocks import AnswerBlock, Content
from friso.shown.documents import entries, plain_json
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
from friso.stage.correlations import correlations_file, correlations_text
from friso.virtual_rig.cures import Cure


def gain_lines(tuning: Advice) -> list[str]:
    """Return the gains to type in for every remedy that works."""
    return [
        f'The gains to type in for "{outcome.remedy.name}" are {gains} (friso export).'
        for outcome in tuning.working
        if (gains := gains_to_type_in(outcome, tuning))
    ]


def gains_to_type_in(outcome: RemedyOutcome, tuning: Advice) -> str:
    """Write symbols and values of a remedy's gains in all units that the drive uses."""
    table = gain_rows(gains_of(tuning.complete(outcome.stage), {})) if outcome.stage else []
    return ", ".join(f"{symbol} = {value}{f' ({others})' if others else ''}" for _, (symbol, value, others) in table)


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


TUNED = "tuned.toml"
"""Name of the stage file of the cheapest remedy that works."""

NOT_SURE = "-not-sure"
"""Suffix of stage files whose remedies are not sure to work."""

OF_LEAVES = "-of-leaf-springs"
"""Suffix of stage files with joints made of leaf springs."""


def basis(tuning: Advice) -> str:
    """Name the seed of the machines."""
    return f", seed {tuning.seed}"


def blocks(tuning: Advice) -> list[AnswerBlock]:
    """Return the blocks: what to change, what that brings, what does not work, and everything behind that."""
    behind = {
        "The numbers to type in, in the terms of drives (friso export)": gain_lines(tuning),
        "What is assumed, and how machines were drawn": assumptions(tuning),
    }
    return [
        AnswerBlock(
            title=tuning.stage.name,
            sentences=answer(tuning),
            columns=axis_shown().named(COLUMNS),
            rows=rows(tuning),
            numbers=partial(tune_document, tuning),
        ),
        AnswerBlock(
            title="What the changes bring and cost", details=explained(tuning), draw=partial(tune_figures, tuning)
        ),
        AnswerBlock(title="What does not work, and why", details=failing(tuning)),
        *(AnswerBlock(title=title, details=texts, behind=True) for title, texts in behind.items()),
    ]


def further_files(tuning: Advice) -> dict[str, Content]:
    """Return a stage file for every remedy with settings; unsure ones have names that say so."""
    files: dict[str, Content] = {}
    for outcome in tuning.outcomes:
        if outcome.stage is None:
            continue
        slug = outcome.remedy.name.replace(",", "").replace(" ", "-")
        unsure = "" if outcome.certainty == "works" else NOT_SURE
        files |= _stage_file(tuning, f"tuned-{slug}{unsure}.toml", outcome.stage)
    least = tuning.least
    return {**_stage_file(tuning, TUNED, least.stage if least else None), **files}


def _stage_file(tuning: Advice, name: str, stage: Stage | None) -> dict[str, Content]:
    """Return a stage file and the correlations of its uncertain keys; None removes an old file."""
    beside = correlations_file(Path(name)).name
    if stage is None:
        return {name: None, beside: None}
    correlations = tuning.correlations.among(stage.uncertain())
    return {
        name: tuning.complete(stage).to_toml(),
        beside: correlations_text(correlations, stage) if correlations.keys else None,
    }


def tune_document(tuning: Advice) -> dict[str, Any]:
    """Return the JSON document in SI, with the unit as suffix of each key.

    A settling time is null if it is never reached. The upper end of its interval is also null if the machines are too
    few to bound it.
    """
    goal = tuning.goal
    first, *further = answer(tuning)
    return plain_json(
        {
            "conclusion": first,
            "details": [*further, *explained(tuning), *failing(tuning)],
            "stage": tuning.stage.name,
            **entries(tuning, "interrupted", "needed", "seed"),
            "least_change": tuning.least.remedy.name if tuning.least else None,
            "machines": tuning.machines.count,
            "goal": {
                **entries(goal, "within_m", "settle_s", "force_limit_n", "bandwidth_limit_hz", "distance", "share"),
                "moves": None if goal.moves is None else asdict(goal.moves),
                "modulus_margin": goal.margin,
            },
            "as_is": _performance(tuning.present, tuning) | {"verdict": tuning.case.verdict, "doubts": [*tuning.unmet]},
            "as_built": tuning.built and built_document(tuning.built),
            "cures": {cure.kind: _cure(cure, tuning) for cure in tuning.cures},
            "ways": {outcome.remedy.name: _remedy(outcome, tuning) for outcome in tuning.outcomes},
        }
    )


def _cure(cure: Cure, tuning: Advice) -> dict[str, Any]:
    """Return a cure of the drive: what it changes, and what the machine as built then does."""
    return {"changes": changes(tuning.complete(tuning.stage), cure.stage), **built_document(cure.built)}


def _remedy(outcome: RemedyOutcome, tuning: Advice) -> dict[str, Any]:
    """Return one remedy: whether it works, what it changes, and how machines perform with it."""
    if outcome.stage is None or outcome.measured is None:
        why = unsure_why(outcome) if outcome.interrupted else why_unmet(outcome, tuning)
        return {"works": outcome.certainty, "why": why}
    confirmation = outcome.confirmation
    return {
        "works": outcome.certainty,
        "doubts": [*outcome.doubts],
        "changes": changes(tuning.stage, outcome.stage),
        "keys_changed": tuning.size(outcome).keys,
        "factor": tuning.size(outcome).factor,
        "verdict": confirmation.verdict if confirmation else None,
        "certain": bool(confirmation and confirmation.certain and not outcome.stage.assumed_keys),
        **_performance(outcome.measured, tuning),
    }


def _performance(measured: Performance, tuning: Advice) -> dict[str, Any]:
    """Return fractions, settling times, force and margin of machines."""
    goal = tuning.goal
    return {
        "moves_m": measured.held_moves(goal),
        "meets_goal": asdict(measured.share(goal)),
        "slowest_twentieth_s": measured.slowest(goal),
        "slowest_twentieth_interval_s": measured.slowest_interval(goal),
        "median_s": measured.median,
        "force_n": measured.force(goal),
        "modulus_margin": measured.least_margin(goal),
        "own_margin": measured.own_margin,
        "stiffness_n_per_m": measured.stiffness,
    }
