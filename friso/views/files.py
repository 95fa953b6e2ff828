"""The files of a command: names to what they hold."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path

from friso.views.drawing.figure import Figure
from friso.views.drawing.images import FORMATS, ON_PAGE, Image, draw_beforehand, save

Content = str | bytes | Callable[[Path], object] | None
"""A text, bytes, or what writes the file to the path that it is called with; None: one of an earlier run is deleted."""

Files = Mapping[str, Content]
"""Names, relative to the folder of the command, to contents; in the order in which they are listed."""


def pictures(figures: Iterable[Figure], forms: Iterable[str] | None = None) -> dict[str, Content]:
    """Every figure in all forms ("png", "svg", "pdf"), each drawn when it is written, or as it goes on a page, at the
    latest."""
    figures, forms = [*figures], FORMATS if forms is None else (*forms,)
    draw_beforehand(figures, [ON_PAGE, *map(Image, forms)])
    return {f"{figure.name}.{form}": partial(save, figure) for figure in figures for form in forms}
