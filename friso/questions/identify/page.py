"""Write the files of `friso identify`.

The files are the stage, its correlations, a page that opens offline, and every figure.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from friso.axis import axis_shown
from friso.identification.kinds import KINDS
from friso.identification.method import Identification, Prediction
from friso.identification.sources import LogFile
from friso.identification.stage_file import with_origins
from friso.questions.identify import words
from friso.questions.identify.figures import identify_figures
from friso.shown.files import Content
from friso.shown.pages import Report
from friso.stage.correlations import correlations_file, correlations_text

STAGE = "identified.toml"


def identify_files(
    identification: Identification, logs: Sequence[LogFile], predictions: Sequence[Prediction]
) -> dict[str, Content]:
    """Return all files of an identification.

    A stage file or correlations of an earlier run are removed if this run has none.
    """
    stage, correlations = identification.stage, None
    if stage is not None and identification.correlations.keys:
        correlations = correlations_text(identification.correlations, stage)
    several = zip(identification.experiments, words.labels(identification), strict=True)
    report = Report.of_stage(
        "identify",
        stage,
        identify_figures(identification, predictions),
        ", ".join(file.path.name for file in logs),
        condition="",
        verdicts=words.headline(identification),
        columns=words.COLUMNS,
        rows=words.estimate_rows(identification),
        files=words.read_rows(logs),
        parts=words.summaries(identification),
        predicted=[words.prediction_line(prediction) for prediction in predictions],
        warnings=[axis_shown().text(warning) for warning in identification.warnings],
        opening=[f"identify_{label}_{KINDS[experiment.kind].opening}" for experiment, label in several],
    )
    return {
        STAGE: None if stage is None else with_origins(stage.to_toml(), identification.origins),
        correlations_file(Path(STAGE)).name: correlations,
        **report.files(),
    }
