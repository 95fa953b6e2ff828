"""Write the page of `friso design`: one file that opens offline and prints.

Every run of the command gives the same bytes.
"""

from __future__ import annotations

from markupsafe import Markup

from friso.design_method.method import Design, UnfinishedDesign
from friso.materials import materials
from friso.questions.design.figures import design_figures
from friso.questions.design.steps import requirement_rows, steps
from friso.questions.design.words import headline
from friso.questions.flexure.drawing import drawing_svg
from friso.shown.files import Content
from friso.shown.pages import Report

LEAVES_STEP = 2
"""Number of the step that shows the drawing and the requirements."""


NOT_VERIFIED = "design-not-verified.toml"
"""Name of the stage file of an unfinished design."""


def design_files(design: Design | UnfinishedDesign) -> dict[str, Content]:
    """Return the stage files, the page, the drawing, and every figure in all formats.

    The stage files are the design and the worst machine that was tried with it; of an unfinished design, the stage
    so far is the only file.
    """
    if isinstance(design, UnfinishedDesign):
        return {NOT_VERIFIED: design.stage.to_toml()}
    drawing = Markup(_drawing(design))
    report = Report.of_stage(
        "design",
        design.stage,
        design_figures(design),
        spec=design.spec,
        verdicts=headline(design),
        steps=steps(design),
        leaves=LEAVES_STEP,
        drawing=drawing,
        requirements=requirement_rows(design),
    )
    return {
        NOT_VERIFIED: None,
        "design.toml": design.stage.to_toml(),
        "worst.toml": design.verification.worst.to_toml(),
        **report.files({"design_drawing.svg": drawing}),
    }


def _drawing(design: Design) -> str:
    """Return the dimensioned drawing of the leaf springs as SVG."""
    choice = design.fitted.choice
    data = materials()[choice.geometry.sheet.material]
    material = f"{data.name}, {data.grade}"
    return drawing_svg(choice.beams.mechanism, design.fitted.task.stroke, title=design.stage.name, material=material)
