"""The page of `friso identify`: one file that opens offline, prints, and is the same bytes on every run."""

from __future__ import annotations

from collections.abc import Sequence

from friso.identify.method import Identification, Prediction
from friso.identify.sources import Given
from friso.views.drawing.figure import Figure
from friso.views.identify.words import COLUMNS, estimate_rows, headline, parts, prediction, read_rows
from friso.views.pages import stage_page


def identify_html(
    found: Identification, given: Sequence[Given], predictions: Sequence[Prediction], figures: Sequence[Figure]
) -> str:
    """The whole page of an identification and its figures."""
    return stage_page(
        "identify.html",
        found.stage,
        figures,
        ", ".join(each.path.name for each in given),
        verdicts=headline(found),
        columns=COLUMNS,
        rows=estimate_rows(found),
        files=read_rows(given),
        parts=parts(found),
        predicted=[prediction(each) for each in predictions],
        warnings=found.warnings,
    )
