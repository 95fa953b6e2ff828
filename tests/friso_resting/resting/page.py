"""The page."""

from friso.shown.files import Files
from friso.shown.pages import Report
from friso_resting.resting.question import RestingAnswer


def resting_files(answer: RestingAnswer) -> Files:
    """The page alone."""
    page = Report.of_stage("resting", answer.stage, (), templates="friso_resting", sentences=answer.sentences())
    return {"resting.html": page.html()}
