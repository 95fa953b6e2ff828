"""Write the page of `friso flexure`: one file that opens offline and prints.

Every run of the command gives the same bytes.
"""

from __future__ import annotations

from markupsafe import Markup

from friso.leaf_springs.both_models import BothModels
from friso.materials import materials
from friso.questions.flexure.drawing import drawing_svg
from friso.questions.flexure.figures import COLOURS, flexure_figures
from friso.questions.flexure.table import rows
from friso.questions.flexure.words import assumptions, findings, warnings
from friso.shown.drawing.figure import Category
from friso.shown.drawing.palette import GREEN, VERMILLION
from friso.shown.files import Content
from friso.shown.pages import Report

BASIS = (
    "geometrically exact beams, corrected for what clamps do to a wide leaf, and closed forms (Soemers, Design "
    "Principles for Precision Mechanisms; Awtar, Slocum and Sevincer, doi:10.1115/1.2717231). Modes with the cart held "
    "and the leaves straight; a mode interferes with control where actuator and sensor both see it. The drawing is no "
    "substitute for one with tolerances"
)


def flexure_files(flexure: BothModels) -> dict[str, Content]:
    """Return the page, the drawing, and every figure in all formats."""
    drawing = Markup(_drawing(flexure))
    joint, *further = findings(flexure)
    return Report.of_stage(
        "flexure",
        flexure.stage,
        flexure_figures(flexure),
        verdicts=[(GREEN, joint), *((VERMILLION, warning) for warning in warnings(flexure))],
        sentences=[*further, *assumptions(flexure.stage)],
        drawing=drawing,
        columns=[Category(name, COLOURS[name]) for name in flexure.models],
        rows=rows(flexure),
        computed=f": {BASIS}",
    ).files({"flexure_drawing.svg": drawing})


def _drawing(flexure: BothModels) -> str:
    """Return the dimensioned drawing of the mechanism as SVG."""
    data = materials().get(str(flexure.stage.flat().get("flexure.material")))
    material = f"{data.name}, {data.grade}" if data else ""
    return drawing_svg(flexure.mechanism, flexure.best.stroke, title=flexure.stage.name, material=material)
