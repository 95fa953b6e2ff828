"""Errors about inputs, each of which states in one clear message what is wrong; and safe texts for them.

Texts from files are escaped before they are shown. Their characters must not control a terminal, reverse the reading
direction, or become a formula.
"""

from __future__ import annotations

import json
import logging
import re
from collections.abc import Iterable
from difflib import get_close_matches
from typing import Self

_STEERING = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\xad\u061c\u180e\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb"
    "\ud800-\udfff\U000e0000-\U000e007f]"
)
"""Pattern of characters to escape.

They are control characters except line feed and tab, marks and overrides of the writing direction, characters without
width, surrogates, and tags."""

_MARKUP = re.compile(r"[\\`*\[\]<>&|~$#]|(?<![^\W_])_|_(?![^\W_])")
"""Pattern of characters with a meaning in Markdown, where they have one."""


def escaped(text: str) -> str:
    r"""Return a text with every unsafe character written out, such as "\x1b" or "\u202e"; lines are kept."""
    return _STEERING.sub(_written_out, text)


def one_line(text: str) -> str:
    """Return a text escaped on one line; line feeds and tabs are written out as well."""
    return escaped(text).replace("\n", "\\n").replace("\t", "\\t")


def markdown(text: str) -> str:
    """Return a text as Markdown that shows it as it is: what would be markup, HTML or a formula gets a backslash."""
    return _MARKUP.sub(r"\\\g<0>", text)


def toml_text(text: str) -> str:
    r"""Return the text as a quoted TOML string that reads back as the same text.

    Control characters are written as escapes, such as "\u202e".
    """
    return _STEERING.sub(_as_in_toml, json.dumps(text, ensure_ascii=False))


def _as_in_toml(match: re.Match[str]) -> str:
    code = ord(match[0])
    if 0xD800 <= code < 0xE000:  # half a character, for which TOML has no escape
        return match[0]
    return f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"


def _written_out(match: re.Match[str]) -> str:
    code = ord(match[0])
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"


def _escape_record(record: logging.LogRecord) -> bool:
    """Escape the message of a log record; return True, so that the record is logged."""
    record.msg, record.args = escaped(record.getMessage()), None
    return True


logging.getLogger("friso").addFilter(_escape_record)  # whoever collects the records gets safe texts, too


LONGEST_LINE = 1200
"""Largest number of characters shown of a line."""


class InputError(ValueError):
    """A wrong input: which key, what was given, what was expected, an example, and which file.

    `also` tells what else is wrong in the same file, as pairs of key and what was given.

    Examples
    --------
    >>> import friso
    >>> try:
    ...     friso.simulate(friso.example("thesis_rig"), rtol=2)
    ... except friso.InputError as error:
    ...     print(error.key)
    rtol
    """

    def __init__(
        self,
        key: str,
        actual: str,
        expected: str,
        example: str = "",
        origin: str = "",
        also: tuple[tuple[str, str], ...] = (),
    ) -> None:
        super().__init__(key, actual, expected, example, origin, also)
        self.key, self.actual, self.expected, self.example, self.origin = key, actual, expected, example, origin
        self.also = also

    def __str__(self) -> str:
        head = ": ".join(shortened(one_line(part)) for part in (self.origin, self.key) if part)
        rows = {"given:": f"{self.actual}{self._hint}", "expected:": self.expected, "example:": self.example}
        lines = [f"  {name:<9} {shortened(text)}" for name, text in rows.items() if text]
        lines += [f"  {'also:':<9} {shortened(f'{one_line(key)}: {actual}')}" for key, actual in self.also]
        return escaped("\n".join([head, *lines]).lstrip("\n"))

    @property
    def _hint(self) -> str:
        """Return which of the choices was meant, for a word that is nearly one of them; empty otherwise."""
        kind, _, choices = self.expected.partition("one of ")
        if kind or ";" in self.actual:
            return ""
        words = [part.strip("\"' ") for part in re.split(r", |; | or ", choices)]
        near = get_close_matches(self.actual.strip("\"'"), words, 1)
        return f"; did you mean {near[0]}?" if near else ""

    @classmethod
    def of(cls, error: InputError) -> Self:
        """Return an error of this class with the contents of another one."""
        return cls(error.key, error.actual, error.expected, error.example, error.origin, error.also)

    def under(self, table: str) -> Self:
        """Return a copy whose keys begin with the name of the table around them."""
        also = tuple((_dotted(table, key), actual) for key, actual in self.also)
        return type(self)(_dotted(table, self.key), self.actual, self.expected, self.example, self.origin, also)

    def found_in(self, origin: str) -> Self:
        """Return a copy that names the file or option it comes from."""
        return type(self)(self.key, self.actual, self.expected, self.example, origin, self.also)

    def together(self, others: Iterable[InputError]) -> Self:
        """Return a copy that also says what else is wrong, by the errors `others`."""
        also = (pair for error in others for pair in ((error.key, error.actual), *error.also))
        return type(self)(
            self.key, self.actual, self.expected, self.example, self.origin, tuple(dict.fromkeys((*self.also, *also)))
        )


def shortened(text: str) -> str:
    """Return a text with overlong lines cut."""
    return "\n".join(line if len(line) <= LONGEST_LINE else f"{line[:LONGEST_LINE]}..." for line in text.split("\n"))


def _dotted(table: str, key: str) -> str:
    return ".".join(part for part in (table, key) if part)


class StageError(InputError):
    """A wrong stage: its file, or the keys and values it was made from.

    Examples
    --------
    >>> import friso
    >>> try:
    ...     friso.loads('[masses]\\ncart = "1.2 m"')
    ... except friso.StageError as error:
    ...     print(error.key, error.example, sep=": ")
    masses.cart: cart = "1.2 kg"
    """


class SpecError(InputError):
    """A wrong specification of a design.

    Examples
    --------
    >>> import friso
    >>> try:
    ...     friso.design(friso.example("thesis_rig"), friso.example("thesis_rig"))
    ... except friso.SpecError as error:
    ...     print(error.actual)
    a stage file
    """


class LogError(InputError):
    """A log, or what is said about one, that cannot be read.

    Examples
    --------
    >>> import friso
    >>> try:
    ...     friso.logs("missing.csv")
    ... except friso.LogError as error:
    ...     print(error.expected)
    a log
    """


class StoreError(InputError):
    """A store that cannot be read or written.

    Examples
    --------
    >>> import friso
    >>> try:
    ...     friso.read_store("missing.zarr")
    ... except friso.StoreError as error:
    ...     print(error.actual)
    nothing there
    """
