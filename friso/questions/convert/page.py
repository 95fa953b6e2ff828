"""The files of `friso convert`: the stage file, and the figure."""

from __future__ import annotations

from typing import TYPE_CHECKING

from friso.questions.convert.figures import conversion_figure
from friso.shown.files import Content, image_files

if TYPE_CHECKING:
    from friso.studies.laws.conversion import LawConversion


def convert_files(conversion: LawConversion, stem: str) -> dict[str, Content]:
    """The stage file with the law, and the figure."""
    image = image_files(conversion_figure(conversion), stem, ["png"])
    return {f"{stem}.toml": conversion.stage.to_toml(), **image}
