"""Build the JSON document of `friso rig`, in SI with the unit as suffix of each key."""

from __future__ import annotations

from typing import Any

from friso.questions.rig.outcome_view import view_of
from friso.questions.rig.words import sentences
from friso.shown.documents import plain_json
from friso.studies.rig.outcome import Outcome


def rig_document(outcome: Outcome) -> dict[str, Any]:
    """Return the results of an experiment, and its logs with the seeds of their noise."""
    logs = [
        {"name": log.name, "seed": log.seed, "interval_s": log.interval, "failure": log.failure or None}
        for log in outcome.logs
    ]
    view = view_of(outcome.experiment)
    head = {
        "conclusion": sentences(outcome)[0],
        "experiment": outcome.experiment,
        "stage": outcome.stage.name,
        "seed": outcome.seed,
        "logs": logs,
    }
    return plain_json({**head, "results": view.numbers(outcome), "notes": [*outcome.notes]})
