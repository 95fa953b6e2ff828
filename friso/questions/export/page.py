"""The files of `friso export`: a page, and the parameters as a drive's file holds them."""

from __future__ import annotations

from friso.drives.gains import Gains
from friso.questions.export.words import COLUMNS, rows, sentences, title
from friso.shown.files import Content
from friso.shown.pages import Report


def export_files(gains: Gains) -> dict[str, Content]:
    """The page, and the parameters where a kind of drive was asked for."""
    files: dict[str, Content] = {"gains.html": export_html(gains)}
    if gains.kind is not None:
        files[f"parameters{gains.kind.suffix}"] = gains.text
    return files


def export_html(gains: Gains) -> str:
    """The whole page."""
    values = {
        "sentences": sentences(gains),
        "columns": COLUMNS,
        "rows": rows(gains),
        "drawing_of_loop": gains.diagram,
        "parameters": gains.text,
    }
    return Report.of_stage("export", gains.stage, (), title(gains), **values).html()
