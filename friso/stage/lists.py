"""Define keys that take an array: of values, or of tables.

Examples are `element_stiffness = ["40 N/um", "30 N/um"]` and `[[controller.filters]]`. In `Stage.flat` every element
has a key of its own, numbered from 1, such as friction.element_stiffness.2. A table in an array has such a key for each
of its own keys, such as controller.filters.2.frequency.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import count, takewhile
from math import isfinite
from typing import Any, Self

from pydantic import GetCoreSchemaHandler, ValidationInfo
from pydantic_core import CoreSchema, core_schema

from friso.axis import LINEAR, AxisKind
from friso.errors import InputError
from friso.quantities import Number, Quantity, as_toml, quoted

_WORDS = {1: "one", 2: "two"}


class Values(tuple[Any, ...]):
    """An array of values, dimensioned or bare."""

    @property
    def text(self) -> list[Any]:
        """Return the values, each as the user wrote it."""
        return [getattr(value, "text", value) for value in self]


class Rows(tuple[Any, ...]):
    """An array of tables."""

    @property
    def text(self) -> list[Any]:
        """Return the rows as the user wrote them."""
        return [row.as_written() for row in self]


@dataclass(frozen=True)
class Several:
    """A key that takes an array of at least `least` and, if stated, at most `most` values.

    `examples` are two such values. With `alone`, a single value may stand for an array of one.
    """

    of: Quantity | Number
    examples: tuple[str, ...]
    least: int = 2
    most: int | None = None
    alone: bool = False

    def on(self, kind: AxisKind) -> Self:
        """Return this declaration for an axis of another kind, with its units."""
        examples = tuple(replace(self.of, example=text).on(kind).example for text in self.examples)
        return replace(self, of=self.of.on(kind), examples=examples)

    @property
    def expected(self) -> str:
        """Say in words what values the key accepts."""
        if self.alone:
            return f"one value or an array of up to {self.most}, each {self.of.expected}"
        count = f"{_WORDS[self.least]} or more" if self.most is None else f"{self.least} to {self.most}"
        return f"an array of {count}, each {self.of.expected}"

    @property
    def written_example(self) -> str:
        """Return an example of the array as it stands in a file."""
        quote = '"' if isinstance(self.of, Quantity) else ""
        return f"[{', '.join(f'{quote}{example}{quote}' for example in self.examples)}]"

    def read(self, raw: Any, read_one: Callable[[Any], Any] | None = None) -> Values:
        """Return the values of an array, or with `alone` of a single value, too.

        Each element is read by `read_one`, by default as `of` reads it. Raises InputError for a wrong length or a wrong
        element, whose number it names.
        """
        if self.alone and not isinstance(raw, list | tuple):
            raw = [raw]
        size = len(raw) if isinstance(raw, list | tuple) else None
        if size is None or size < self.least or size > (self.most or size):
            hint = "not an array" if size is None else f"of {size}"
            raise InputError("", quoted(raw if size is None else [*raw], hint), self.expected, self.written_example)
        read, values = read_one or self.of.read, []
        for number, item in enumerate(raw, start=1):
            try:
                values.append(read(item))
            except InputError as error:
                raise error.under(str(number)) from None
        return Values(values)

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.with_info_plain_validator_function(self._read_on_axis)

    def _read_on_axis(self, raw: Any, info: ValidationInfo) -> Values:
        return self.on(info.context or LINEAR).read(raw)


@dataclass(frozen=True)
class Coefficients:
    """A key that takes an array of numbers that are varied only together.

    `roots` may be complex, written as texts.
    """

    examples: tuple[Any, ...]
    roots: bool = False

    @property
    def expected(self) -> str:
        """Say in words what values the key accepts."""
        return f"an array of numbers{', complex ones as texts' if self.roots else ''}"

    @property
    def written_example(self) -> str:
        """Return an example of the array as it stands in a file."""
        return f"[{', '.join(as_toml(example) for example in self.examples)}]"

    def read(self, raw: Any) -> Values:
        """Return the values of an array of numbers; complex numbers stay texts.

        Raises InputError for anything but an array, or under the number of an element that is no finite number. Only
        `roots` may be written as texts.
        """
        if not isinstance(raw, list | tuple):
            raise InputError("", quoted(raw), self.expected, self.written_example)
        for number, item in enumerate(raw, start=1):
            try:
                fine = not isinstance(item, bool) and isfinite(abs(complex(item)))
                fine = fine and (self.roots or not isinstance(item, str))
            except (TypeError, ValueError):
                fine = False
            if not fine:
                raise InputError(str(number), quoted(item), self.expected, self.written_example)
        return Values(item if isinstance(item, str) else float(item) for item in raw)

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(self.read)


def element_keys(flat: Mapping[str, Any], key: str) -> list[str]:
    """Return the keys of an array's elements in a stage, such as "friction.element_stiffness.2".

    They are in order; there are none if the stage lacks the array.
    """
    return [*takewhile(flat.__contains__, (f"{key}.{number}" for number in count(1)))]


def row_keys(flat: Mapping[str, Any], key: str) -> list[str]:
    """Return the names of an array's tables in a stage, such as "controller.filters.2".

    They are in order; there are none if the stage lacks the array.
    """
    places = (f"{key}.{number}" for number in count(1))
    return [*takewhile(lambda place: any(name.startswith(f"{place}.") for name in flat), places)]
