"""The report of `friso check`: one page that opens offline, prints, and is the same bytes on every run."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from friso.views.check.cases import shown_cases
from friso.views.check.draws import Drawing, draws_figure, draws_sentences
from friso.views.check.figures import check_figures
from friso.views.check.table import rows
from friso.views.check.words import conclusion, verdict_sentence
from friso.views.pages import stage_page

if TYPE_CHECKING:
    from friso.hunting import Case


def write_report(cases: Mapping[str, Case], path: Path, drawing: Drawing | None = None) -> None:
    """Write `report_html(cases, drawing)` to `path` (OSError where that is impossible)."""
    path.write_text(report_html(cases, drawing), encoding="utf-8", newline="\n")


def report_html(cases: Mapping[str, Case], drawing: Drawing | None = None) -> str:
    """The whole page for the cases "given" and, with a joint, "locked" and "free"; traces may be missing. `drawing`
    adds what stages drawn from an uncertain one do."""
    shown = shown_cases(cases)
    stage = shown[0].case.stage if "given" not in cases else cases["given"].stage
    return stage_page(
        "report.html",
        stage,
        (*check_figures(cases), *([draws_figure(drawing)] if drawing else [])),
        shown=shown,
        sentences=[(item, verdict_sentence(item, cases)) for item in shown],
        conclusion=conclusion(cases),
        rows=rows(shown),
        draws=draws_sentences(drawing) if drawing else [],
        rtol=", ".join(sorted({f"{item.case.solver.rtol:g}" for item in shown})),
    )
