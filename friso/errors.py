"""Errors about inputs: each states in one clear message what is wrong."""

import re
from collections.abc import Iterable
from difflib import get_close_matches
from typing import Self

from friso.escapes import escaped, one_line

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
    def of(cls, error: "InputError") -> Self:
        """Return an error of this class with the contents of another one."""
        return cls(error.key, error.actual, error.expected, error.example, error.origin, error.also)

    def under(self, table: str) -> Self:
        """Return a copy whose keys begin with the name of the table around them."""
        also = tuple((_dotted(table, key), actual) for key, actual in self.also)
        return type(self)(_dotted(table, self.key), self.actual, self.expected, self.example, self.origin, also)

    def found_in(self, origin: str) -> Self:
        """Return a copy that names the file or option it comes from."""
        return type(self)(self.key, self.actual, self.expected, self.example, origin, self.also)

    def together(self, others: "Iterable[InputError]") -> Self:
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
