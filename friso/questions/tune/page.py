"""Write the page of `friso tune`, its figures, and a stage file for every remedy."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from friso.axis import axis_shown
from friso.questions.tune.figures import tune_figures
from friso.questions.tune.gain_words import gain_facts
from friso.questions.tune.sensitivity_words import sensitivity_sentences
from friso.questions.tune.words import COLUMNS, answer, assumptions, explained, failing, rows
from friso.remedies.method import Advice
from friso.shown.files import Content
from friso.shown.pages import Report
from friso.stage import Stage
from friso.stage.correlations import correlations_file, correlations_text

NOT_SURE, LARGE_MOVES = "-not-sure", "-for-large-moves"
"""Suffixes of stage files whose remedies are not sure to work, or work for large moves only."""

OF_LEAVES = "-of-leaf-springs"
"""Suffix of stage files with joints made of leaf springs."""


class Behind(NamedTuple):
    """A part of the page that can be folded: title, sentences and facts.

    `open` is true if it is unfolded at first.
    """

    title: str
    sentences: Sequence[str]
    facts: Sequence[tuple[str, str]] = ()
    open: bool = False


def tune_files(tuning: Advice) -> dict[str, Content]:
    """Return the stage files, the page, and every figure in all formats.

    `tuned.toml` is the least change that works.
    """
    behind = [
        Behind("What the changes bring and cost", explained(tuning), open=True),
        Behind("What does not work, and why", failing(tuning), open=True),
        Behind("The numbers to type in, in the terms of drives (friso export gains)", (), gain_facts(tuning)),
        Behind("What matters for the edge of hunting", sensitivity_sentences(tuning)),
        Behind("What is assumed, and how machines were drawn", assumptions(tuning)),
    ]
    report = Report.of_stage(
        "tune",
        tuning.stage,
        tune_figures(tuning),
        sentences=answer(tuning),
        details=[more for more in behind if more.sentences or more.facts],
        columns=axis_shown().named(COLUMNS),
        rows=rows(tuning),
        computed=f", seed {tuning.seed}",
    )
    return {**stage_files(tuning), **report.files()}


def stage_files(tuning: Advice) -> dict[str, Content]:
    """Return a stage file for every remedy with settings; unsure ones have names that say so."""
    files: dict[str, Content] = {}
    for outcome in tuning.outcomes:
        if outcome.stage is None:
            continue
        slug = outcome.remedy.name.replace(",", "").replace(" ", "-")
        unsure = {"works": "", "large moves": LARGE_MOVES}.get(outcome.certainty, NOT_SURE)
        files |= _stage_file(tuning, f"tuned-{slug}{unsure}.toml", outcome.stage)
    least = tuning.least
    return {**_stage_file(tuning, "tuned.toml", least.stage if least else None), **files}


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
