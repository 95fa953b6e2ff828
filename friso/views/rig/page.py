"""What an experiment of the rig shows: words, numbers, figures, a page; each experiment has a module of its own."""

from __future__ import annotations

from collections.abc import Sequence

from friso.studies.rig.outcome import Outcome
from friso.views.drawing.figure import Figure
from friso.views.files import Content, pictures
from friso.views.pages import Report
from friso.views.rig.log_files import log_files, stage_text
from friso.views.rig.outcome_view import OUTCOME_VIEWS


def sentences(outcome: Outcome) -> list[str]:
    """The results, the answer first, for the engineer who has to decide with them; before it, what failed."""
    return [*_failures(outcome), *OUTCOME_VIEWS[outcome.experiment].sentences(outcome)]


def _failures(outcome: Outcome) -> list[str]:
    """The logs that stopped early, in a sentence for each reason: they end where the run stopped."""
    by_reason: dict[str, list[str]] = {}
    for log in outcome.logs:
        if log.failure:
            when, _, reason = log.failure.partition(": ")
            by_reason.setdefault(reason or when, []).append(f"{log.name} {when}" if reason else log.name)
    return [
        f"{len(names)} of {len(outcome.logs)} logs stopped early: {reason} ({', '.join(names)})."
        for reason, names in by_reason.items()
    ]


def figures(outcome: Outcome) -> list[Figure]:
    """The figures, in the arrangement of the thesis."""
    return OUTCOME_VIEWS[outcome.experiment].figures(outcome)


def rig_files(outcome: Outcome) -> dict[str, Content]:
    """The page, the logs with how they are to be read, the truth in a folder of its own, and every figure in all
    formats."""
    images = figures(outcome)
    logs = {name: content for log in outcome.logs for name, content in log_files(log, outcome.stage).items()}
    return {
        "rig.html": page(outcome, images),
        **logs,
        "truth/stage.toml": stage_text(outcome.stage, outcome.seed),
        **pictures(images),
    }


def page(outcome: Outcome, figures: Sequence[Figure]) -> str:
    """The page with its figures."""
    return Report.of_stage(
        "rig.html",
        outcome.stage,
        figures,
        experiment=outcome.experiment,
        seed=outcome.seed,
        sentences=sentences(outcome),
        notes=outcome.notes,
        logs=outcome.logs,
    ).html()
