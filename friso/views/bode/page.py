"""The page of `friso bode`: one file that opens offline, prints, and is the same bytes on every run."""

from __future__ import annotations

from collections.abc import Sequence

from friso.frequency.bode import Bode
from friso.views.bode.states import shown_states
from friso.views.bode.table import rows
from friso.views.bode.words import caveats, crossover_heading, crossovers, stability
from friso.views.check.cases import COLOURS
from friso.views.drawing.figure import GREEN, VERMILLION, Figure
from friso.views.pages import stage_page


def bode_html(found: Bode, figures: Sequence[Figure]) -> str:
    """The whole page of a linear analysis and its figures."""
    shown = shown_states(found)
    verdict, *further = stability(found)
    return stage_page(
        "bode.html",
        found.stage,
        figures,
        verdict=(GREEN if found.settled[1].stable else VERMILLION, verdict),
        further=further,
        heading=crossover_heading(found),
        crossovers=[(COLOURS[name], sentence) for name, sentence in crossovers(found).items()],
        caveats=caveats(found),
        shown=shown,
        rows=rows(shown),
        states=len(found.scan.members),
    )
