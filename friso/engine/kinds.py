"""Define argument kinds of compiled loops, and pack arguments as 64-bit words.

The loops are written for `friso.engine.scalar_code`.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class NumberKind:
    """A kind of number: "int", "float" or "truth"; the last occurs only inside compiled code."""

    name: str

    @property
    def form(self) -> str:
        """Return the format of the number for `struct`."""
        return "d" if self.name == "float" else "q"

    def words(self, value: Any) -> list[Any]:
        """Return a number as a list of one value, for one 64-bit word.

        Raises TypeError for a value of another kind.
        """
        if not isinstance(value, float if self.name == "float" else int):
            raise TypeError(f"{value!r} where a number is expected: {self.name}")
        return [value]


_DTYPES = {name: np.dtype(name) for name in ("int64", "float64", "bool")}


@dataclass(frozen=True)
class ArrayKind:
    """Arrays of numbers of a type, with the last index running fastest."""

    dtype: str
    dimensions: int

    @property
    def form(self) -> str:
        """Return the format of the array's address and shape for `struct`."""
        return "q" * (1 + self.dimensions)

    def words(self, value: Any) -> list[Any]:
        """Return the address of an array and its shape, as values for 64-bit words.

        Raises TypeError for an array of another type or number of dimensions, or one that is not contiguous.
        """
        if not (value.dtype == _DTYPES[self.dtype] and value.ndim == self.dimensions and value.flags.c_contiguous):
            raise TypeError(f"an array of {value.dtype}, strides {value.strides}, where {self} is expected")
        return [value.__array_interface__["data"][0], *value.shape]


@dataclass(frozen=True)
class RecordKind:
    """Named tuples whose `fields` have these names and kinds."""

    fields: tuple[tuple[str, CompiledKind], ...]

    @property
    def form(self) -> str:
        """Return the format of the record's fields for `struct`, one after another."""
        return "".join(kind.form for _, kind in self.fields)

    def words(self, value: Any) -> list[Any]:
        """Return the fields of a named tuple as values for 64-bit words, one field after another.

        Raises TypeError if a field is of another kind.
        """
        return [word for (_, kind), part in zip(self.fields, value, strict=True) for word in kind.words(part)]


CompiledKind = NumberKind | ArrayKind | RecordKind
INT, FLOAT, TRUTH = NumberKind("int"), NumberKind("float"), NumberKind("truth")


def argument_kind(example: Any) -> CompiledKind:
    """Return the kind of an argument, from an example of it.

    Raises TypeError if compiled loops take no such argument.
    """
    if isinstance(example, np.ndarray) and example.dtype.name in _DTYPES:
        return ArrayKind(example.dtype.name, example.ndim)
    names = getattr(example, "_fields", None)
    if isinstance(example, tuple) and names is not None:
        return RecordKind(tuple((name, argument_kind(value)) for name, value in zip(names, example, strict=True)))
    if isinstance(example, float | int) and not isinstance(example, bool):
        return FLOAT if isinstance(example, float) else INT
    raise TypeError(f"compiled loops are not given anything like {example!r}")


class Packing:
    """Layout of arguments of given kinds, one after another."""

    def __init__(self, kinds: Sequence[CompiledKind]) -> None:
        self._kinds, self._struct = tuple(kinds), struct.Struct("".join(kind.form for kind in kinds))

    def packed(self, arguments: Sequence[Any]) -> bytes:
        """Return the arguments as 64-bit words; arrays must outlive the words.

        Raises TypeError for arguments of other kinds.
        """
        words = (word for kind, argument in zip(self._kinds, arguments, strict=True) for word in kind.words(argument))
        return self._struct.pack(*words)
