"""The files of `friso identify`: the stage, the correlations beside it, the page, and every figure in all formats."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from friso.identify.method import Identification, Prediction
from friso.identify.sources import LogFile
from friso.stage.correlations import beside, correlations_text
from friso.views.files import Content, pictures
from friso.views.identify.figures import identify_figures
from friso.views.identify.page import identify_html

STAGE = "identified.toml"


def identify_files(
    identification: Identification, logs: Sequence[LogFile], predictions: Sequence[Prediction]
) -> dict[str, Content]:
    """All files; a stage file and correlations of an earlier run go where there are none now."""
    stage, correlations = identification.stage, None
    if stage is not None and identification.correlations.keys:
        correlations = correlations_text(identification.correlations, stage)
    figures = identify_figures(identification, predictions)
    return {
        STAGE: None if stage is None else stage.to_toml(),
        beside(Path(STAGE)).name: correlations,
        "identify.html": identify_html(identification, logs, predictions, figures),
        **pictures(figures),
    }
