"""Choose the sentences of an answer from a table of conditions and templates.

A table has one row of alternatives for every sentence of an answer. An alternative is a condition with a template; the
first one whose condition holds is said. Names in braces stand for numbers and words, which are computed when said.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Generic, TypeVar

Subject = TypeVar("Subject")
Alternatives = Sequence[tuple[Callable[[Subject], object], str]]
Words = Mapping[str, Callable[[Subject], str]]


def say(subject: Subject, table: Sequence[Alternatives[Subject]], words: Words[Subject]) -> list[str]:
    """Return the sentences of a table that hold for a subject, at most one per row, each with a capital letter."""
    written = _Written(subject, words)
    chosen = (next((text for holds, text in row if holds(subject)), "") for row in table)
    sentences = (text.format_map(written) for text in chosen if text)
    return [f"{sentence[:1].upper()}{sentence[1:]}" for sentence in sentences]


def say_all(subject: Subject, rows: Alternatives[Subject], words: Words[Subject]) -> list[str]:
    """Return every sentence of a list whose condition holds for a subject."""
    return say(subject, [[row] for row in rows], words)


def always(subject: object) -> bool:
    """Hold for every subject, as the last alternative of a row."""
    return True


class _Written(dict[str, str], Generic[Subject]):
    """Words of a subject by name, each written when it is first read."""

    def __init__(self, subject: Subject, words: Words[Subject]) -> None:
        super().__init__()
        self._subject, self._words = subject, words

    def __missing__(self, name: str) -> str:
        self[name] = self._words[name](self._subject)
        return self[name]
