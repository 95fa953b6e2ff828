"""The page of `friso tune`, its figures, and a stage file for every remedy."""

from __future__ import annotations

from collections.abc import Sequence

from friso.remedies.method import Advice
from friso.views.drawing.figure import Figure
from friso.views.files import Content, pictures
from friso.views.pages import Report
from friso.views.tune.figures import figures as tune_figures
from friso.views.tune.gain_words import gain_lines
from friso.views.tune.sensitivity_words import sensitivity_sentences
from friso.views.tune.words import COLUMNS, answer, assumptions, failing, rows, window_lines


def tune_files(tuning: Advice) -> dict[str, Content]:
    """The stage files, the page, and every figure in all formats; `tuned.toml` is the least change that works."""
    figures = tune_figures(tuning)
    return {**stage_files(tuning), "tune.html": page(tuning, figures), **pictures(figures)}


def stage_files(tuning: Advice) -> dict[str, Content]:
    """A stage file for every remedy for which there are settings; one that is not sure to work is named so."""
    files: dict[str, Content] = {}
    for outcome in tuning.outcomes:
        if outcome.stage is None:
            continue
        slug = outcome.remedy.name.replace(",", "").replace(" ", "-")
        unsure = "" if outcome.certainty == "works" else "-not-sure"
        files[f"tuned-{slug}{unsure}.toml"] = outcome.stage.to_toml()
    least = tuning.working[:1]
    return {"tuned.toml": least[0].stage.to_toml() if least and least[0].stage else None, **files}


def page(tuning: Advice, figures: Sequence[Figure]) -> str:
    """The page with its figures."""
    return Report.of_stage(
        "tune",
        tuning.stage,
        figures,
        sentences=answer(tuning),
        notes=[
            *failing(tuning),
            *gain_lines(tuning),
            *window_lines(tuning),
            *sensitivity_sentences(tuning),
            *assumptions(tuning),
        ],
        columns=COLUMNS,
        rows=rows(tuning),
        computed=f", seed {tuning.seed}",
    ).html()
