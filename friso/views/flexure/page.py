"""The page of `friso flexure`: one file that opens offline, prints, and is the same bytes on every run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from markupsafe import Markup

from friso.materials import materials
from friso.views.drawing.figure import GREEN, VERMILLION, Figure
from friso.views.flexure.drawing import drawing_svg
from friso.views.flexure.findings import COLOURS, Found
from friso.views.flexure.table import rows
from friso.views.flexure.words import assumptions, findings, warnings
from friso.views.pages import stage_page


class Column(NamedTuple):
    """A model at the head of the table."""

    label: str
    colour: str


def flexure_html(found: Found, figures: Sequence[Figure]) -> str:
    """The whole page of a mechanism and its figures."""
    joint, *further = findings(found)
    return stage_page(
        "flexure.html",
        found.stage,
        figures,
        verdicts=[(GREEN, joint), *((VERMILLION, warning) for warning in warnings(found))],
        further=[*further, *assumptions(found.stage)],
        drawing=Markup(drawing(found)),
        shown=[Column(name, COLOURS[name]) for name in found.models],
        rows=rows(found),
    )


def drawing(found: Found) -> str:
    """The dimensioned drawing of the mechanism, SVG."""
    known = materials().get(str(found.stage.flat().get("flexure.material")))
    material = f"{known.name}, {known.grade}" if known else ""
    return drawing_svg(found.mechanism, found.best.stroke, title=found.stage.name, material=material)
