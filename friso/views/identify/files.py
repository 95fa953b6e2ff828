"""The files of `friso identify`: the stage, the correlations beside it, the page, and every figure in all formats."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from friso.identify.logs.mapping import mapping_text
from friso.identify.method import Identification, Prediction
from friso.identify.sources import LogFile
from friso.stage.correlations import beside, correlations_text
from friso.views.files import Content, pictures
from friso.views.identify.figures import identify_figures
from friso.views.identify.page import identify_html

STAGE = "identified.toml"


def identify_files(
    found: Identification, given: Sequence[LogFile], predictions: Sequence[Prediction]
) -> dict[str, Content]:
    """All files; a stage file and correlations of an earlier run go where there are none now."""
    stage, correlations = found.stage, None
    if stage is not None and found.correlations.keys:
        correlations = correlations_text(found.correlations, stage)
    figures = identify_figures(found, predictions)
    return {
        STAGE: None if stage is None else stage.to_toml(),
        beside(Path(STAGE)).name: correlations,
        "identify.html": identify_html(found, given, predictions, figures),
        **pictures(figures),
    }


def mappings(given: Sequence[LogFile]) -> dict[Path, Content]:
    """How the logs were read, each where it is kept for the next time."""
    return {each.kept: mapping_text(each.mapping) for each in given if each.kept is not None}
