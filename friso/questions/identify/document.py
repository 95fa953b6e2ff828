"""Build the JSON document of an identification, in SI with the unit in the key or beside it.

Numbers that are unknown become null.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from friso.axis import axis_shown, unit_shown
from friso.identification.estimate_documents import key_document
from friso.identification.kind import Source
from friso.identification.kinds import KINDS
from friso.identification.logs.log import Log
from friso.identification.method import Experiment, Identification, Prediction
from friso.identification.sources import LogFile
from friso.questions.identify.words import headline
from friso.shown.documents import entries, plain_json


def identify_document(
    identification: Identification, files: Sequence[LogFile], predictions: Sequence[Prediction]
) -> dict[str, Any]:
    """Return the JSON document of an identification, without the files written.

    It has the conclusion, the logs, the experiments with their numbers, all estimates, and predictions of other logs.
    """
    document = {
        "conclusion": headline(identification)[0][1],
        "stage": identification.stage.name if identification.stage else None,
        "logs": [_log(file) for file in files],
        "estimates": [key_document(estimate) for estimate in identification.estimates],
        "experiments": [_experiment(experiment) for experiment in identification.experiments],
        "predictions": [
            {"log": prediction.log.name, **KINDS[prediction.kind].prediction_numbers(prediction.result)}
            for prediction in predictions
        ],
        "failed": identification.failed,
        "doubts": [axis_shown().text(doubt) for doubt in identification.doubts],
        "warnings": [axis_shown().text(warning) for warning in identification.warnings],
    }
    return plain_json(document)


def _log(file: LogFile) -> dict[str, Any]:
    """Return for the document which kind of log a file holds and why, and what was read."""
    return {
        "file": str(file.path),
        **entries(file, "kind", "reason"),
        "mapping_file": None if file.mapping_file is None else str(file.mapping_file),
        **_content(file.source),
        **entries(file.source, "read"),
    }


def _content(source: Source) -> dict[str, Any]:
    """Return what a file holds: signals over time, or a response."""
    if not isinstance(source, Log):
        return {"roles": {}, "lines": len(source.frequency), "unit": source.unit, "warnings": []}
    return {
        "roles": {role: unit_shown(source.unit(role)) for role in source.signals},
        "samples": len(source.time),
        **entries(source, "sample_time_s", "warnings"),
        "segments": len(source.segments),
    }


def _experiment(experiment: Experiment) -> dict[str, Any]:
    """Return an experiment with its numbers and estimates, for the document."""
    return {
        "kind": experiment.kind,
        "logs": [log.name for log in experiment.logs],
        **KINDS[experiment.kind].numbers(experiment.result),
        "estimates": [key_document(estimate) for estimate in experiment.estimates],
    }
