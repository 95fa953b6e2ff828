"""Write the files of `friso export`: a page, and the parameter file of the drive."""

from __future__ import annotations

from friso.drives.gains import Gains
from friso.questions.export.words import COLUMNS, rows, sentences, title
from friso.shown.files import Content
from friso.shown.pages import Report


def export_files(gains: Gains) -> dict[str, Content]:
    """Return the page, and the parameter file if a kind of drive was named."""
    files: dict[str, Content] = {"gains.html": export_html(gains)}
    if gains.kind is not None:
        files[f"parameters{gains.kind.suffix}"] = gains.text
    return files


def export_html(gains: Gains) -> str:
    """Return the page with loop, gains and parameters."""
    values = {
        "sentences": sentences(gains),
        "columns": COLUMNS,
        "rows": rows(gains),
        "drawing_of_loop": gains.diagram,
        "parameters": gains.text,
    }
    return Report.of_stage("export", gains.stage, (), title(gains), condition="", **values).html()
