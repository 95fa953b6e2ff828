"""Read numbers as they are written: with one decimal sign, and one sign between groups of three digits.

A number such as 1.234 has one value with a decimal point and another with grouped thousands: a cell alone does not tell
them apart, but the other cells of its file may.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

DECIMAL_SIGNS = (".", ",")
SPACES = "\u00a0\u2009\u202f"
"""Spaces that stand within numbers and not between columns: no-break, thin, and narrow no-break."""
NUMBER = r"(?:\d+(?:\.\d*)?|\.\d+)(?:[eEdD][+-]?\d+)?"
"""Pattern of a plain number, with E or Fortran's D. A run of digits is read in one way: thousands take no time."""
_SPACE, _APOSTROPHE = "\u00a0", "'"
_ALIKE = str.maketrans({" ": _SPACE, "\u2009": _SPACE, "\u202f": _SPACE, "\u2019": _APOSTROPHE, "\u2212": "-"})
"""Signs by the one that is read in their place: all spaces are one, and the minus of typesetters is a hyphen."""
_GROUPED_BY = {".": "points", ",": "commas", _SPACE: "spaces", _APOSTROPHE: "apostrophes"}


class NumberFormat(NamedTuple):
    """A way to write numbers: the decimal sign, and the sign between groups of three digits, or "" for none."""

    decimal: str
    grouping: str = ""

    @property
    def in_words(self) -> str:
        """Return the format in words."""
        grouped = f", thousands grouped by {_GROUPED_BY[self.grouping]}" if self.grouping else ""
        return f"decimal {'comma' if self.decimal == ',' else 'point'}{grouped}"


def formats_with(decimal: str) -> list[NumberFormat]:
    """Return the formats with a decimal sign, one for each sign that may group digits."""
    return [NumberFormat(decimal, sign) for sign in (*DECIMAL_SIGNS, _SPACE, _APOSTROPHE) if sign != decimal]


def _pattern(decimal: str, groupings: str) -> str:
    """Return the pattern of numbers with a decimal sign, whose digits one of the signs may group.

    A group has three digits, and the first one to three without a 0 in front. An exponent excludes groups.
    """
    plain, point = NUMBER.replace(r"\.", re.escape(decimal)), re.escape(decimal)
    name = "a" if decimal == "." else "b"  # both patterns may be parts of one
    grouped = rf"[1-9]\d{{0,2}}(?P<{name}>[{groupings}])\d{{3}}(?:(?P={name})\d{{3}})*(?:{point}\d*)?|"
    return rf"[+-]?(?:{grouped if groupings else ''}{plain}|nan|inf(?:inity)?)|true|false"


_PATTERNS = {form: _pattern(*form) for sign in DECIMAL_SIGNS for form in (NumberFormat(sign), *formats_with(sign))}
_ANY = {sign: _pattern(sign, "".join(form.grouping for form in formats_with(sign))) for sign in DECIMAL_SIGNS}
"""Patterns of numbers with a decimal sign, whatever groups their digits."""
_NUMBERS = re.compile("|".join(_ANY.values()), re.IGNORECASE)
_ONLY_WITH_COMMA = re.compile(rf"(?!(?:{_ANY['.']})$)(?:{_ANY[',']})", re.IGNORECASE)


def is_number(cell: str) -> bool:
    """Tell whether a cell is a number, whatever its decimal sign and the sign that groups its digits."""
    return _NUMBERS.fullmatch(cell.translate(_ALIKE)) is not None


def likely_format(cells: Iterable[str]) -> NumberFormat:
    """Return a format by some cells of a file: with a decimal comma if one of them is a number with no other sign."""
    has_comma = any("," in cell and _ONLY_WITH_COMMA.fullmatch(cell.translate(_ALIKE)) for cell in cells)
    return NumberFormat("," if has_comma else ".")


def number_texts(cells: Any) -> Any:
    """Return cells as texts in which signs that look alike are one; "" where there is none."""
    texts = cells.astype(str).str.strip().fillna("")
    odd = ~texts.map(str.isascii).astype(bool) | texts.str.contains(" ", regex=False)
    return texts.where(~odd, texts.str.translate(_ALIKE)) if odd.any() else texts


def are_numbers(texts: Any, decimal: str | None = None) -> np.ndarray:
    """Tell which texts of a column are numbers with a decimal sign, or with any, whatever groups their digits."""
    return _matches(texts, _ANY[decimal] if decimal else _NUMBERS.pattern)


def fitting(texts: Any, form: NumberFormat) -> np.ndarray:
    """Tell which texts of a column are numbers in a format.

    A column whose digits are grouped has them grouped in all numbers from some length on: 1.234 does not fit beside
    1500.
    """
    fits = _matches(texts, _PATTERNS[form])
    grouped = fits & are_grouped(texts, form)
    if form.grouping not in DECIMAL_SIGNS or not grouped.any():
        return fits
    size = np.abs(_values(texts.where(fits), form))
    longest = size[~grouped & np.isfinite(size)].max(initial=0)
    return fits & ~(grouped & (longest >= 10 ** np.floor(np.log10(size[grouped].min()))))


def are_grouped(texts: Any, form: NumberFormat) -> np.ndarray:
    """Tell in which of the texts, all of them numbers in a format, digits are grouped."""
    return texts.str.contains(form.grouping, regex=False).to_numpy(dtype=bool)


def are_whole(texts: Any) -> np.ndarray:
    """Tell which texts of a column are digits alone."""
    return _matches(texts, r"[+-]?\d+")


def _matches(texts: Any, pattern: str) -> np.ndarray:
    return texts.str.fullmatch(pattern, case=False).to_numpy(dtype=bool)


def may_be_grouped(values: np.ndarray) -> np.ndarray:
    """Tell which values could come from texts such as 1.234 and 512, whose digits may be grouped.

    The texts alone are certain: 1.2340 has the value of one, and is none.
    """
    with np.errstate(all="ignore"):
        size = np.abs(values)
        thousandths = np.abs(size * 1000 - np.round(size * 1000)) < 1e-6
        return ~np.isfinite(values) | (size % 1 == 0) | ((size > 1) & (size < 1000) & thousandths)


def as_floats(texts: Any, form: NumberFormat) -> np.ndarray:
    """Return the values of the texts of a column that are numbers in a format, and NaN for other texts."""
    return _values(texts.where(fitting(texts, form)), form)


def _values(texts: Any, form: NumberFormat) -> np.ndarray:
    """Return the values of texts that are numbers in a format."""
    texts = texts.str.replace(form.grouping, "", regex=False) if form.grouping else texts
    texts = texts.str.replace(form.decimal, ".", regex=False)
    words = {
        word: value for name, value in (("true", "1"), ("false", "0")) for word in (name, name.title(), name.upper())
    }
    return as_numbers(texts.replace(words).str.replace(r"(?<=[\d.])[dD]", "e", regex=True))


def as_numbers(texts: Any) -> np.ndarray:
    """Return texts as floats, NaN for other texts."""
    numbers: Any = pd.to_numeric(texts, errors="coerce")
    return numbers.to_numpy(dtype=float)
