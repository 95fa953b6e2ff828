"""What is wrong with an input: one clear message, whoever reads it."""

from typing import Self


class InputError(ValueError):
    """A wrong input: which key, what was given, what was expected, a correct example, and which file."""

    def __init__(self, key: str, actual: str, expected: str, example: str = "", origin: str = "") -> None:
        super().__init__(key, actual, expected, example, origin)
        self.key, self.actual, self.expected, self.example, self.origin = key, actual, expected, example, origin

    def __str__(self) -> str:
        head = ": ".join(part for part in (self.origin, self.key) if part)
        rows = {"given:": self.actual, "expected:": self.expected, "example:": self.example}
        return "\n".join([head, *(f"  {name:<9} {text}" for name, text in rows.items() if text)]).lstrip("\n")

    @classmethod
    def of(cls, error: "InputError") -> Self:
        """The same error as one of this kind."""
        return cls(error.key, error.actual, error.expected, error.example, error.origin)

    def under(self, table: str) -> Self:
        """The same error, its key seen from one level further out."""
        key = ".".join(part for part in (table, self.key) if part)
        return type(self)(key, self.actual, self.expected, self.example, self.origin)

    def found_in(self, origin: str) -> Self:
        """The same error, saying which file or option it comes from."""
        return type(self)(self.key, self.actual, self.expected, self.example, origin)


class StageError(InputError):
    """A wrong stage: its file, or the keys and values it was made from."""


class SpecError(InputError):
    """A wrong specification of a design."""


class LogError(InputError):
    """A log, or what is said about one, that cannot be read."""


class StoreError(InputError):
    """A store that cannot be read or written."""
