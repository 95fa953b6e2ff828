"""The page of `friso identify`: one file that opens offline, prints, and is the same bytes on every run."""

from __future__ import annotations

from collections.abc import Sequence

from friso.identify.method import Identification, Prediction
from friso.identify.sources import LogFile
from friso.views.drawing.figure import Figure
from friso.views.identify.words import COLUMNS, estimate_rows, headline, prediction_line, read_rows, summaries
from friso.views.pages import Report


def identify_html(
    identification: Identification,
    files: Sequence[LogFile],
    predictions: Sequence[Prediction],
    figures: Sequence[Figure],
) -> str:
    """The whole page of an identification and its figures."""
    return Report.of_stage(
        "identify",
        identification.stage,
        figures,
        ", ".join(file.path.name for file in files),
        verdicts=headline(identification),
        columns=COLUMNS,
        rows=estimate_rows(identification),
        files=read_rows(files),
        parts=summaries(identification),
        predicted=[prediction_line(prediction) for prediction in predictions],
        warnings=identification.warnings,
    ).html()
