"""What an experiment of the rig shows: words, numbers, figures, a page; each experiment has a module of its own."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from friso.studies.rig.outcome import Outcome
from friso.views.documents import plain_json
from friso.views.drawing.figure import Figure
from friso.views.pages import stage_page
from friso.views.rig.outcome_view import OUTCOME_VIEWS


def sentences(outcome: Outcome) -> list[str]:
    """What was found, for the engineer who has to decide with it."""
    return OUTCOME_VIEWS[outcome.experiment].sentences(outcome)


def figures(outcome: Outcome) -> list[Figure]:
    """The figures, in the arrangement of the thesis."""
    return OUTCOME_VIEWS[outcome.experiment].figures(outcome)


def document(outcome: Outcome) -> dict[str, Any]:
    """The JSON document: SI units, the unit in the key's suffix; seeds included."""
    logs = [
        {"name": log.name, "seed": log.seed, "interval_s": log.interval, "failure": log.failure or None}
        for log in outcome.logs
    ]
    head = {"experiment": outcome.experiment, "stage": outcome.stage.name, "seed": outcome.seed, "logs": logs}
    return plain_json({**head, "found": OUTCOME_VIEWS[outcome.experiment].numbers(outcome), "notes": [*outcome.notes]})


def page(outcome: Outcome, drawn: Sequence[Figure]) -> str:
    """The page with its figures."""
    return stage_page(
        "rig.html",
        outcome.stage,
        drawn,
        experiment=outcome.experiment,
        seed=outcome.seed,
        sentences=sentences(outcome),
        notes=outcome.notes,
        logs=outcome.logs,
    )
