"""Give the blocks of `friso identify`, and the files beside its page: the stage and its correlations."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from friso.axis import axis_shown, unit_shown
from friso.identification.estimate_documents import key_document
from friso.identification.kind import Source
from friso.identification.kinds import KINDS
from friso.identification.logs.log import Log
from friso.identification.method import Experiment, Identification, Prediction
from friso.identification.sources import LogFile
from friso.identification.stage_file import with_origins
from friso.questions.identify import words
from friso.questions.identify.against_words import against_document, against_sentences
from friso.questions.identify.figures import identify_figures
from friso.questions.identify.words import headline
from friso.shown.blocks import AnswerBlock, Content
from friso.shown.documents import entries, plain_json
from friso.shown.drawing.figure import ORANGE
from friso.stage.correlations import correlations_file, correlations_text

if TYPE_CHECKING:
    from friso.questions.identify.question import IdentifyAnswer

STAGE = "identified.toml"


def blocks(answer: IdentifyAnswer) -> list[AnswerBlock]:
    """Return the blocks: what was identified, and the verdict on the stage if that was asked for."""
    result, inputs, predictions, checked = answer.result, answer.inputs, answer.predictions, answer.checked
    identified = AnswerBlock(
        sentences=words.sentences(result, predictions),
        columns=words.COLUMNS[1:],
        rows=[(first, rest) for first, *rest in (row.texts for row in words.estimate_rows(result))],
        details=words.details(result, inputs),
        draw=lambda: identify_figures(result, predictions),
        numbers=lambda: identify_document(result, inputs, predictions),
    )
    besides = AnswerBlock(
        sentences=_compared(answer),
        numbers=lambda: plain_json({"against": [against_document(name, one) for name, one in answer.compared.items()]}),
    )
    against = [besides] if answer.suspect is not None else []
    if checked is None:
        return [*against, identified]
    verdict = AnswerBlock(sentences=checked.sentences(), numbers=lambda: {"check": checked.document()})
    tables = [
        AnswerBlock(title=table.title, columns=table.columns, rows=table.rows, behind=table.behind)
        for table in checked.tables()
    ]
    return [*against, verdict, identified, *tables]


def _compared(answer: IdentifyAnswer) -> list[str]:
    """Say of each log whether it contradicts the verdict on the suspected stage; nothing without one."""
    stage = answer.suspect
    if stage is None:
        return []
    return [text for name, one in answer.compared.items() for text in against_sentences(name, stage, one)]


def _asked_besides(answer: IdentifyAnswer) -> list[str]:
    """Return what the answer says besides the estimates: the comparison with a stage, and the verdict."""
    return [*_compared(answer), *(answer.checked.sentences() if answer.checked else [])]


def page_values(answer: IdentifyAnswer) -> dict[str, Any]:
    """Return what the page shows beside the figures: estimates, experiments, predictions, and logs as read."""
    identification = answer.result
    several = zip(identification.experiments, words.labels(identification), strict=True)
    return {
        "verdicts": [*((ORANGE, text) for text in _asked_besides(answer)), *words.headline(identification)],
        "columns": words.COLUMNS,
        "rows": words.estimate_rows(identification),
        "files": words.read_rows(answer.inputs),
        "parts": words.summaries(identification),
        "predicted": [words.prediction_line(prediction) for prediction in answer.predictions],
        "warnings": [axis_shown().text(warning) for warning in identification.warnings],
        "opening": [f"identify_{label}_{KINDS[experiment.kind].opening}" for experiment, label in several],
    }


def further_files(answer: IdentifyAnswer) -> dict[str, Content]:
    """Return the stage file, and the correlations of its keys.

    Those of an earlier run are removed if this run has none.
    """
    identification, stage, correlations = answer.result, answer.result.stage, None
    if stage is not None and identification.correlations.keys:
        correlations = correlations_text(identification.correlations, stage)
    return {
        STAGE: None if stage is None else with_origins(stage.to_toml(), identification.origins),
        correlations_file(Path(STAGE)).name: correlations,
    }


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
