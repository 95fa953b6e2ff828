"""Say what an experiment of the rig shows."""

from __future__ import annotations

from typing import Any

from friso.shown.documents import entries, plain_json
from friso.shown.drawing.figure import Figure
from friso_thesis.studies.rig.experiments import RIG_EXPERIMENTS
from friso_thesis.studies.rig.outcome import Outcome


def sentences(outcome: Outcome) -> list[str]:
    """Return the results for the engineer who decides, the answer first.

    Logs that stopped early are reported before.
    """
    return [*_failures(outcome), *RIG_EXPERIMENTS[outcome.experiment].sentences(outcome)]


def _failures(outcome: Outcome) -> list[str]:
    """Say which logs stopped early, in one sentence for each reason."""
    by_reason: dict[str, list[str]] = {}
    for log in outcome.logs:
        if log.failure:
            when, _, reason = log.failure.partition(": ")
            by_reason.setdefault(reason or when, []).append(f"{log.name} {when}" if reason else log.name)
    return [
        f"{len(names)} of {len(outcome.logs)} logs stopped early: {reason} ({', '.join(names)})."
        for reason, names in by_reason.items()
    ]


def rig_document(outcome: Outcome) -> dict[str, Any]:
    """Return the results of an experiment, and its logs with the seeds of their noise."""
    logs = [{**entries(log, "name", "seed", "interval_s"), "failure": log.failure or None} for log in outcome.logs]
    return plain_json(
        {
            "conclusion": sentences(outcome)[0],
            "stage": outcome.stage.name,
            **entries(outcome, "experiment", "seed", "notes"),
            "logs": logs,
            "results": RIG_EXPERIMENTS[outcome.experiment].numbers(outcome),
        }
    )


def rig_figures(outcome: Outcome) -> list[Figure]:
    """Return the figures of an experiment, arranged as in the thesis."""
    return RIG_EXPERIMENTS[outcome.experiment].figures(outcome)
