"""Write the page of `friso bode`: one file that opens offline and prints.

Every run of the command gives the same bytes.
"""

from __future__ import annotations

from collections.abc import Sequence

from friso.frequency.bode import Bode
from friso.questions.bode.figures import bode_figures
from friso.questions.bode.states import shown_states
from friso.questions.bode.table import rows
from friso.questions.bode.words import caveats, crossover_heading, crossover_meaning, crossovers, stability
from friso.shown.cases import COLOURS
from friso.shown.drawing.figure import GREEN, VERMILLION, Figure
from friso.shown.files import Content, pictures
from friso.shown.pages import Report

DEFINITIONS = (
    "Margins follow their definitions: how much gain, phase or delay takes the loop to the edge of stability; phase "
    "margins count both lag and lead"
)


def bode_files(bode: Bode) -> dict[str, Content]:
    """Return the page, and every figure in all formats, by file name."""
    figures = bode_figures(bode)
    images = pictures(figures)
    return {"bode.html": bode_html(bode, figures), **images}


def bode_html(bode: Bode, figures: Sequence[Figure]) -> str:
    """Return the page of a linear analysis with its figures."""
    states = shown_states(bode)
    verdict, *further = stability(bode)
    return Report.of_stage(
        "bode",
        bode.stage,
        figures,
        verdicts=[(GREEN if bode.settled[1].stable else VERMILLION, verdict)],
        sentences=further,
        heading=crossover_heading(bode),
        crossovers=[(COLOURS[name], sentence) for name, sentence in crossovers(bode).items()],
        caveats=[*crossover_meaning(bode), *caveats(bode)],
        columns=states,
        rows=rows(states),
        computed=f" from the equations of the simulation, linearised in {len(bode.scan.members)} states. {DEFINITIONS}",
    ).html()
