"""Describe the files of a command: names, and what the files hold."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path

from friso.shown.drawing.figure import IMAGE_FORMATS, Figure

Content = str | bytes | Callable[[Path], object] | None
"""Content of a file: a text, bytes, or a function that writes the file to a given path. None deletes the file of an
earlier run."""

Files = Mapping[str, Content]
"""Contents of files by name, relative to the folder of the command, in the order in which they are listed."""


def pictures(figures: Iterable[Figure], forms: Iterable[str] | None = None) -> dict[str, Content]:
    """Return the files of figures in several formats ("png", "svg", "pdf"), by name.

    `forms` are the formats, by default all. An image is drawn when its file is written.
    """
    forms = IMAGE_FORMATS if forms is None else (*forms,)
    several = [image_files(figure, figure.name, forms) for figure in figures]
    return {name: content for images in several for name, content in images.items()}


def image_files(figure: Figure, stem: str, forms: Iterable[str] = IMAGE_FORMATS) -> dict[str, Content]:
    """Return the files of a figure in some formats, with names that begin with `stem`."""
    return {f"{stem}.{form}": partial(save, figure) for form in forms}


def save(figure: Figure, path: Path) -> None:
    """Write a figure to a path in the format of its suffix.

    Raises ValueError for an unknown format.
    """
    path.write_bytes(image(figure, path.suffix.removeprefix(".").lower()))


def image(figure: Figure, form: str, headed: bool = True) -> bytes:
    """Return an image of a figure as the bytes of a file, with its heading if `headed`.

    `form` is one of the formats of images. Raises ValueError for any other.
    """
    from friso.shown.drawing import matplotlib_renderer  # slow

    return matplotlib_renderer.image(figure, form, headed)
