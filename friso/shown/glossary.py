"""Link words on a page to the glossary at its end, each word at its first occurrence."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources

from markupsafe import Markup, escape

from friso.escapes import escaped

_ROW = re.compile(r"^\| ([^|]+) \| (.+) \|$", flags=re.MULTILINE)
_HEADING = "word"


@dataclass(frozen=True)
class GlossaryRow:
    """A row of the glossary: its words, and what they mean."""

    words: tuple[str, ...]
    meaning: str

    @property
    def name(self) -> str:
        """Return all words of the row as text."""
        return ", ".join(self.words)

    @property
    def place(self) -> str:
        """Return the row's anchor on a page."""
        return "word-" + re.sub(r"\W+", "-", self.words[0].lower())


@cache
def entries() -> Mapping[str, GlossaryRow]:
    """Return the rows of the glossary by their words in small letters.

    A word that has its meaning in one context only, such as "slope (of the return map)", is left out, because pages
    also use it in other contexts.
    """
    text = (resources.files("friso.shown") / "templates" / "glossary.md").read_text(encoding="utf-8")
    plain = re.sub(r"[*`]", "", text)
    rows = [
        GlossaryRow(tuple(words.split(", ")), meaning) for words, meaning in _ROW.findall(plain) if "(" not in words
    ]
    return {word.lower(): entry for entry in rows for word in entry.words if word != _HEADING}


@cache
def _any_word() -> re.Pattern[str]:
    """Return a pattern for any word of the glossary or its plural; longer words come first."""
    words = sorted(entries(), key=len, reverse=True)
    return re.compile(rf"(?<![\w-])({'|'.join(map(re.escape, words))})s?(?![\w-])", flags=re.IGNORECASE)


class Glossary:
    """The rows of the glossary used by one page, by the first occurrence of their words."""

    def __init__(self) -> None:
        self.used: dict[str, GlossaryRow] = {}

    def linked(self, text: str) -> Markup:
        """Return a text, escaped, with links from words that are new on the page."""
        parts, end = [], 0
        text = escaped(text)
        for match in _any_word().finditer(text):
            entry = entries()[match[1].lower()]
            if entry.name not in self.used:
                self.used[entry.name] = entry
                parts += [escape(text[end : match.start()]), self._link(match[0], entry)]
                end = match.end()
        return Markup("").join([*parts, escape(text[end:])])

    @staticmethod
    def _link(word: str, entry: GlossaryRow) -> Markup:
        """Return a link from a word to its row."""
        return Markup('<a class="word" href="#{}" title="{}">{}</a>').format(entry.place, entry.meaning, word)
