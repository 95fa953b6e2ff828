"""Write the page of `friso bode`: one file that opens offline and prints.

Every run of the command gives the same bytes.
"""

from __future__ import annotations

from friso.frequency.bode import Bode
from friso.questions.bode.figures import bode_figures
from friso.questions.bode.states import shown_states
from friso.questions.bode.table import rows
from friso.questions.bode.words import details, sentences
from friso.shown.drawing.palette import GREEN, VERMILLION
from friso.shown.files import Content
from friso.shown.pages import Report

DEFINITIONS = (
    "Margins follow their definitions: how much gain, phase or delay takes the loop to the edge of stability; phase "
    "margins count both lag and lead"
)


def bode_files(bode: Bode) -> dict[str, Content]:
    """Return the page, and every figure in all formats, by file name."""
    states = shown_states(bode)
    verdict, *further = sentences(bode)
    return Report.of_stage(
        "bode",
        bode.stage,
        bode_figures(bode),
        verdicts=[(GREEN if bode.settled[1].stable else VERMILLION, verdict)],
        sentences=[*further, *details(bode)],
        columns=states,
        rows=rows(states),
        computed=f" from the equations of the simulation, linearised in {len(bode.scan.members)} states. {DEFINITIONS}",
    ).files()
