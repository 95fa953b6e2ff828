"""The summary of `friso reproduce` for print: all claims on one sheet."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from friso.version import VERSION
from friso.views.reproduce import words

if TYPE_CHECKING:
    from friso.studies.thesis import ClaimVerdict

_A4 = 8.27, 11.69
_COLUMNS = {"id": 0.05, "where": 0.11, "text": 0.23, "word": 0.70, "met": 0.80, "share": 0.86}
_LETTERS, _LINES = 76, 2


def save_summary(verdicts: Sequence[ClaimVerdict], conclusion: str, colours: Mapping[str, str], path: Path) -> None:
    """Write the sheet: every claim with the word of agreement, criteria met, and the draws in which it holds. Raises
    OSError."""
    from matplotlib.backends.backend_pdf import FigureCanvasPdf
    from matplotlib.figure import Figure

    sheet = Figure(figsize=_A4)
    FigureCanvasPdf(sheet)
    sheet.text(0.05, 0.965, "Reproduction of the thesis of J. A. Fix (Univ. of Twente)", size=12, weight="bold")
    sheet.text(0.05, 0.948, conclusion, size=8)
    heads = {"id": "claim", "where": "where", "text": "what the thesis says", "word": "agreement", "met": "criteria",
             "share": "holds in draws"}  # fmt: skip
    for name, head in heads.items():
        sheet.text(_COLUMNS[name], 0.925, head, size=6.5, weight="bold")
    rows = words.in_order(verdicts)
    step = 0.88 / max(1, len(rows))
    for number, verdict in enumerate(rows):
        y = 0.925 - (number + 0.75) * step
        claim, covered = verdict.claim, verdict.finding is not None
        text = textwrap.wrap(claim.text, _LETTERS)
        if len(text) > _LINES:
            text = [*text[: _LINES - 1], text[_LINES - 1].rsplit(" ", 1)[0] + " …"]
        space = verdict.space
        share = f"{space.count} of {space.draws}" if space else ""
        cells = {
            "id": claim.id,
            "where": claim.where,
            "text": "\n".join(text),
            "met": words.met(verdict),
            "share": share,
        }
        for name, cell in cells.items():
            sheet.text(_COLUMNS[name], y, cell.replace("$", r"\$"), size=6, va="center", linespacing=1.05)
        colour = colours[verdict.judgement]
        sheet.text(
            _COLUMNS["word"], y, words.AGREEMENT[verdict.judgement], size=6.5, va="center", color=colour,
            weight="bold" if covered else "normal",
        )  # fmt: skip
    sheet.text(
        0.05, 0.02, f"friso {VERSION}: friso reproduce. Criteria and numbers: reproduction.html, claims.json.", size=6
    )
    sheet.savefig(path, format="pdf", metadata={"CreationDate": None, "Creator": None, "Producer": None})
