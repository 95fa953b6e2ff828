"""Write the files of `friso convert`: the stage file and the figure."""

from __future__ import annotations

from friso.questions.convert.figures import convert_figures
from friso.shown.files import Content, image_files
from friso.studies.laws.conversion import LawConversion


def convert_files(conversion: LawConversion, stem: str) -> dict[str, Content]:
    """Return the stage file with the new law, and the figure, both named `stem`."""
    (figure,) = convert_figures(conversion)
    return {f"{stem}.toml": conversion.stage.to_toml(), **image_files(figure, stem, ["png"])}
