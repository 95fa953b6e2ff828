"""Define the block: one part of an answer, which terminal, page, notebook and JSON document show alike.

The files of a command are described here too: names, and what the files hold.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any, Protocol, TypeVar

from friso.quantities import NOTHING
from friso.shown.drawing.figure import IMAGE_FORMATS, Figure


class ColouredLabel(Protocol):
    """The heading of a column that has a colour."""

    @property
    def label(self) -> str:
        """Return the heading."""
        ...

    @property
    def colour(self) -> str:
        """Return the colour, which the page shows beside the heading."""
        ...


Row = TypeVar("Row", bound=tuple[str, Sequence[str]])


def filled(rows: Iterable[Row]) -> list[Row]:
    """Return the rows of a table without those that have nothing but dashes and zeros."""
    return [row for row in rows if not {*row[1]} <= {NOTHING, "0"}]


@dataclass(frozen=True, kw_only=True)
class AnswerBlock:
    """One part of an answer: sentences, a picture, a table, details, and numbers for the JSON document.

    A page shows a block without a title, or with the name of the stage for a title, at its head; other blocks are
    sections. What takes work is a function, which is called when it is shown.
    """

    title: str = ""
    sentences: Sequence[str] = ()

    colours: Sequence[str] = ()
    """Colours of the first sentences, if these are verdicts."""

    caption: str = ""
    """Explanation below the title, which the page alone shows."""

    text: str = ""
    """Drawing or file as text for a fixed-width font."""

    columns: Sequence[str | ColouredLabel] = ()
    rows: Sequence[tuple[str, Sequence[str]]] = ()
    """Rows of the table: a name, and a text for each column."""

    behind: bool = False
    """Whether the table is shown only with the details, and the page folds it."""

    details: Sequence[str] = ()
    """Further paragraphs, which the terminal shows with `--details`."""

    long_details: Callable[[], Sequence[str]] = tuple
    """Function that works out more paragraphs for `--details`, which the page leaves out."""

    draw: Callable[[], Sequence[Figure]] = tuple
    """Function that makes the figures, the most important one first."""

    numbers: Callable[[], Mapping[str, Any]] = dict
    """Function that returns what the block adds to the JSON document, in SI, with the unit in each key's suffix."""

    def __post_init__(self) -> None:
        """Leave out the empty rows of the table."""
        object.__setattr__(self, "rows", filled(self.rows))

    @property
    def labels(self) -> list[str]:
        """Return the headings of the columns as texts."""
        return [column if isinstance(column, str) else column.label for column in self.columns]

    @cached_property
    def figures(self) -> Sequence[Figure]:
        """Return the figures, which are made once."""
        return self.draw()


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
