"""Draw the summary of `friso reproduce` for print: all claims on one sheet."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from friso.version import VERSION
from friso_thesis.questions.reproduce import words

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from friso_thesis.studies.thesis.verdicts import ClaimVerdict

A4_SIZE = 8.27, 11.69
_COLUMNS = {"id": 0.05, "where": 0.105, "text": 0.22, "word": 0.71, "met": 0.80, "share": 0.87}
LETTERS_PER_LINE = 84
PAGE_TOP, PAGE_BOTTOM = 0.915, 0.035
ROW_SPACE = 0.6
"""Space between two rows, in lines of text."""


def save_summary(verdicts: Sequence[ClaimVerdict], conclusion: str, colours: Mapping[str, str], path: Path) -> None:
    """Write the summary sheet to a PDF file; raises OSError if that is not possible.

    The `conclusion` stands at its head, and `colours` has a colour for each judgement.
    """
    metadata = {"CreationDate": None, "Creator": None, "Producer": None}
    summary_sheet(verdicts, conclusion, colours).savefig(path, format="pdf", metadata=metadata)


def summary_sheet(verdicts: Sequence[ClaimVerdict], conclusion: str, colours: Mapping[str, str]) -> Figure:
    """Draw every claim with its whole text on one sheet.

    A row has the word of agreement and the criteria met. It also says in how many random choices of open values the
    claim holds. Rows are as high as their texts need.
    """
    from matplotlib.backends.backend_pdf import FigureCanvasPdf
    from matplotlib.figure import Figure

    sheet = Figure(figsize=A4_SIZE)
    FigureCanvasPdf(sheet)
    sheet.text(0.05, 0.965, "Reproduction of the thesis of J. A. Fix (Univ. of Twente)", size=12, weight="bold")
    sheet.text(0.05, 0.948, conclusion, size=8)
    heads = {"id": "claim", "where": "where", "text": "what the thesis claims, in short", "word": "agreement",
             "met": "criteria", "share": "holds in draws"}  # fmt: skip
    for name, head in heads.items():
        sheet.text(_COLUMNS[name], 0.925, head, size=6.5, weight="bold")
    rows = [(verdict, textwrap.wrap(verdict.claim.text, LETTERS_PER_LINE)) for verdict in words.in_order(verdicts)]
    line = (PAGE_TOP - PAGE_BOTTOM) / max(1.0, sum(len(text) + ROW_SPACE for _, text in rows))
    y = PAGE_TOP
    for verdict, text in rows:
        middle = y - (len(text) + ROW_SPACE) / 2 * line
        y -= (len(text) + ROW_SPACE) * line
        space = verdict.space
        cells = {
            "id": verdict.claim.id,
            "where": verdict.claim.where,
            "text": "\n".join(text),
            "met": words.met(verdict),
            "share": f"{space.count} of {space.draws}" if space else "",
        }
        for name, cell in cells.items():
            sheet.text(_COLUMNS[name], middle, cell.replace("$", r"\$"), size=6, va="center", linespacing=1.05)
        sheet.text(
            _COLUMNS["word"], middle, words.AGREEMENT[verdict.judgement], size=6.5, va="center",
            color=colours[verdict.judgement], weight="bold" if verdict.finding else "normal",
        )  # fmt: skip
    sheet.text(
        0.05, 0.02, f"friso {VERSION}: friso reproduce. Criteria and numbers: reproduction.html, claims.json.", size=6
    )
    return sheet
