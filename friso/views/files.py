"""The files of a command: names to what they hold."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path

from friso.views.drawing import matplotlib_renderer
from friso.views.drawing.figure import Figure

Content = str | bytes | Callable[[Path], object] | None
"""A text, bytes, or what writes the file to the path that it is called with; None: one of an earlier run is deleted."""

Files = Mapping[str, Content]
"""Names, relative to the folder of the command, to contents; in the order in which they are listed."""


def pictures(figures: Iterable[Figure], forms: Iterable[str] | None = None) -> dict[str, Content]:
    """Every figure in all forms ("png", "svg", "pdf"), each drawn when it is written."""
    forms = tuple(matplotlib_renderer.FORMATS if forms is None else forms)
    return {f"{figure.name}.{form}": partial(matplotlib_renderer.save, figure) for figure in figures for form in forms}
