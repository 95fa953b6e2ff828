"""Give the blocks of `friso tune`, and a stage file for every remedy."""

from __future__ import annotations

from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from friso.axis import axis_shown
from friso.questions.tune.figures import tune_figures
from friso.questions.tune.gain_words import gain_lines
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
from friso.remedies.method import Advice
from friso.remedies.verified import Performance, RemedyOutcome
from friso.shown.blocks import AnswerBlock, Content
from friso.shown.documents import entries, plain_json
from friso.stage import Stage
from friso.stage.correlations import correlations_file, correlations_text

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
            "ways": {outcome.remedy.name: _remedy(outcome, tuning) for outcome in tuning.outcomes},
        }
    )


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
