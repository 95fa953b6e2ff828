"""What an experiment of the rig shows: words, numbers, figures, a page; each experiment has a module of its own."""

from __future__ import annotations

from collections.abc import Sequence

from friso.questions.rig.log_files import log_files, stage_text
from friso.questions.rig.outcome_view import view_of
from friso.shown.drawing.figure import Figure
from friso.shown.files import Content, pictures
from friso.shown.pages import Report
from friso.studies.rig.outcome import Outcome


def sentences(outcome: Outcome) -> list[str]:
    """The results, the answer first, for the engineer who has to decide with them; before it, what failed."""
    return [*_failures(outcome), *view_of(outcome.experiment).sentences(outcome)]


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
    return view_of(outcome.experiment).figures(outcome)


def rig_files(outcome: Outcome) -> dict[str, Content]:
    """The page, the logs with how they are to be read, the truth in a folder of its own, and every figure in all
    formats."""
    drawn = figures(outcome)
    images = pictures(drawn)
    logs = {name: content for log in outcome.logs for name, content in log_files(log, outcome.stage).items()}
    return {
        "rig.html": page(outcome, drawn),
        **logs,
        "truth/stage.toml": stage_text(outcome.stage, outcome.seed),
        **images,
    }


def page(outcome: Outcome, figures: Sequence[Figure]) -> str:
    """The page with its figures."""
    return Report.of_stage(
        f"rig {outcome.experiment}",
        outcome.stage,
        figures,
        sentences=sentences(outcome),
        notes=outcome.notes,
        columns=("Kind", "Seed", "Sample time", "Ended"),
        rows=[
            (log.name, [log.kind or "", str(log.seed), f"{log.interval * 1e3:.3g} ms", log.failure or "as planned"])
            for log in outcome.logs
        ],
        computed=f" on a drive as built, seed {outcome.seed}; {len(outcome.logs)} log{'s' * (len(outcome.logs) != 1)}",
    ).html()
