"""Define the block: one part of an answer, which terminal, page, notebook and JSON document show alike."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from friso.quantities import NOTHING

if TYPE_CHECKING:
    from friso.shown.drawing.figure import Figure


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
