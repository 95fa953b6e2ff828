"""The page of `friso bode`: one file that opens offline, prints, and is the same bytes on every run."""

from __future__ import annotations

from collections.abc import Sequence

from friso.frequency.bode import Bode
from friso.views.bode.figures import bode_figures
from friso.views.bode.states import shown_states
from friso.views.bode.table import rows
from friso.views.bode.words import caveats, crossover_heading, crossovers, stability
from friso.views.check.cases import COLOURS
from friso.views.drawing.figure import GREEN, VERMILLION, Figure
from friso.views.files import Content, pictures
from friso.views.pages import Report


def bode_files(bode: Bode) -> dict[str, Content]:
    """The page, and every figure in all formats."""
    figures = bode_figures(bode)
    return {"bode.html": bode_html(bode, figures), **pictures(figures)}


def bode_html(bode: Bode, figures: Sequence[Figure]) -> str:
    """The whole page of a linear analysis and its figures."""
    states = shown_states(bode)
    verdict, *further = stability(bode)
    return Report.of_stage(
        "bode.html",
        bode.stage,
        figures,
        verdict=(GREEN if bode.settled[1].stable else VERMILLION, verdict),
        further=further,
        heading=crossover_heading(bode),
        crossovers=[(COLOURS[name], sentence) for name, sentence in crossovers(bode).items()],
        caveats=caveats(bode),
        shown=states,
        rows=rows(states),
        states=len(bode.scan.members),
    ).html()
