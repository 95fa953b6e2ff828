"""Describe the files of a command: names, and what the files hold."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path

from friso.shown.drawing.figure import IMAGE_FORMATS, Figure
from friso.shown.drawing.images import ON_PAGE, Image, draw_beforehand, save

Content = str | bytes | Callable[[Path], object] | None
"""Content of a file: a text, bytes, or a function that writes the file to a given path. None deletes the file of an
earlier run."""

Files = Mapping[str, Content]
"""Contents of files by name, relative to the folder of the command, in the order in which they are listed."""


def pictures(figures: Iterable[Figure], forms: Iterable[str] | None = None) -> dict[str, Content]:
    """Return the files of figures in several formats ("png", "svg", "pdf"), by name.

    `forms` are the formats, by default all. An image is drawn when its file is written, or when a page shows it.
    """
    forms = IMAGE_FORMATS if forms is None else (*forms,)
    several = [image_files(figure, figure.name, forms, shown=[ON_PAGE]) for figure in figures]
    return {name: content for images in several for name, content in images.items()}


def image_files(
    figure: Figure, stem: str, forms: Iterable[str] = IMAGE_FORMATS, shown: Iterable[Image] = ()
) -> dict[str, Content]:
    """Return the files of a figure in some formats, with names that begin with `stem`.

    Other processes, if there are any, begin to draw them at once. They also draw `shown`, images of the figure that a
    page will need; these are not returned.
    """
    forms = [*forms]
    draw_beforehand([figure], [*shown, *map(Image, forms)])
    return {f"{stem}.{form}": partial(save, figure) for form in forms}
