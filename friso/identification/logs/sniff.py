"""Find how a text is written: its numbers, and the layout of its table.

A number has one decimal sign, and one sign between groups of three digits. A number such as 1.234 has one value with a
decimal point and another with grouped thousands. A cell alone does not tell them apart, but the other cells of its file
may.

The first lines tell the layout: encoding, delimiter, first row of numbers.
"""

from __future__ import annotations

import codecs
import csv
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from friso.errors import LogError
from friso.identification.logs.units import is_unit, split_heading
from friso.quantities import quoted

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
    return rf"[+-]?(?:{grouped if groupings else ''}{plain}|nan|inf(?:inity)?|∞)|true|false"


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
    for name, value in (("true", "1"), ("false", "0"), ("[+-]?∞", "inf")):
        if texts.str.fullmatch(name, case=False).any():
            texts = texts.str.replace(f"^{name}$", value, case=False, regex=True)
    return as_numbers(texts.str.replace(r"(?<=[\d.])[dD]", "e", regex=True))


def as_numbers(texts: Any) -> np.ndarray:
    """Return texts as floats, NaN for other texts."""
    numbers: Any = pd.to_numeric(texts, errors="coerce")
    return numbers.to_numpy(dtype=float)


REMEMBERED_LAYOUTS = 4
"""Number of files whose layout is cached, because each file is examined several times."""
_BYTE_ORDER_MARKS = ((codecs.BOM_UTF8, "utf-8-sig"), (codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16"))
_DELIMITERS = (";", "\t", "|", ",", " ")
"""Delimiters; of two that fit equally well the first is taken."""
CLOCK = r"(\d{1,2}):(\d{2})(?::(\d{2})(?:[.,:](\d+))?)?(?: ?([AaPp])\.?[Mm]\.?)?"
"""A time of day: hours, minutes, seconds, their fraction, and the half of the day."""
MINUTES = r"(\d{1,3}):([0-5]\d[.,]\d+)"
"""Minutes, seconds and their fraction, as stop watches show them."""
_DATE = r"(?:\d{4}[-/.]\d{1,2}[-/.]\d{1,2}|\d{1,2}[-/.]\d{1,2}[-/.](?:\d{4}|\d{2}))"
_GROUPED = re.compile(r"[+\-\u2212]?\d{1,3}(?: \d{3}|,\d{3}[.,])")
"""Digits in groups, between which stands a sign that delimits cells in other texts."""
_BLANKS = re.compile(rf"[^\S{SPACES}]+")
DOS_END = "\x1a"
"""Ctrl-Z, with which DOS programs end a text."""
ISO = re.compile(r"\d{4}-\d{2}-\d{2}(?:[T ]\d{2}:\d{2}(?::\d{2}(?:[.,]\d+)?)?(?:Z|[+-]\d{2}:?\d{2})?)?")
STAMP = re.compile(rf"(?:{ISO.pattern}|(?:{_DATE}[T ]+)?{CLOCK}|{MINUTES})")
"""A date and time as in ISO 8601, or a time of day, behind a date or not, or minutes and seconds."""


@dataclass(frozen=True)
class TextLayout:
    """Layout of a text.

    `numbers` is how numbers are written, as far as the first lines show it. `first` is the number of lines before the
    numbers, and `above` has these lines; `names` and `units` are per column. With `exact` every delimiter ends a cell,
    so that several spaces are empty cells.
    """

    encoding: str
    delimiter: str
    numbers: NumberFormat
    first: int
    columns: int
    names: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    above: tuple[str, ...] = ()
    exact: bool = False

    @property
    def in_words(self) -> str:
        """Return the layout in words."""
        names = {"\t": "tab", " ": "spaces", ",": "comma", ";": "semicolon", ":": "colon", "|": "bar"}
        return (
            f"delimiter {names[self.delimiter]}, {self.numbers.in_words}, "
            f"encoding {self.encoding}, {self.first} line{'' if self.first == 1 else 's'} before the numbers"
        )


BYTES_OF_A_HEAD = 1 << 18  # [B]
"""Size of the beginning of a text file that is examined to find its layout."""


def decoded_head(path: Path) -> tuple[str, list[str]]:
    """Return encoding and first lines of a text file.

    Raises LogError for what is no text.
    """
    with path.open("rb") as file:
        decoded = _decoded(file.read(BYTES_OF_A_HEAD))
    if decoded is None:
        raise LogError(
            "log", f"{path.stat().st_size} bytes that are neither text nor a known format",
            "a text", "", str(path),
        )  # fmt: skip
    encoding, lines = decoded
    return encoding, [*lines]


@lru_cache(REMEMBERED_LAYOUTS)
def _decoded(head: bytes) -> tuple[str, tuple[str, ...]] | None:
    """Return encoding and lines of the beginning of a file; None if it is no text."""
    encoding = next((name for mark, name in _BYTE_ORDER_MARKS if head.startswith(mark)), "")
    if not encoding and b"\0" in head:
        even, odd = head[0:4000:2].count(0), head[1:4000:2].count(0)
        if max(even, odd) < len(head[:4000]) // 4 or min(even, odd) > 0:  # Latin text in UTF-16 has a 0 in each pair
            return None
        encoding = "utf-16-le" if odd > even else "utf-16-be"
    if not encoding:
        encoding = "utf-8"
        try:
            codecs.getincrementaldecoder("utf-8")().decode(head)  # the last character may be cut off
        except UnicodeDecodeError:
            encoding = "cp1252"
    text = codecs.getincrementaldecoder(encoding)("replace").decode(head).replace(DOS_END, "")
    odd = sum(times for character, times in Counter(text).items() if not _may_stand_in_text(character))
    if odd > 0.02 * len(text):
        return None
    lines = re.split(r"\r\n|\n|\r", text)
    is_cut = len(head) == BYTES_OF_A_HEAD and len(lines) > 1
    return encoding, tuple(lines[:-1] if is_cut or not lines[-1] else lines)


def _may_stand_in_text(character: str) -> bool:
    """Tell whether a character may occur in a text file."""
    return character.isprintable() or character in f"\t\r\n\f{SPACES}"


def split_line(line: str, delimiter: str) -> list[str]:
    """Split a line into cells without quotes and blanks; spaces in brackets do not split."""
    if delimiter == " ":
        if '"' not in line:
            line = re.sub(r"(?<!\s)\s+(?=[\[(])", "\0", line.strip())  # "Time (s)" is one heading
            return [cell.strip().replace("\0", " ") for cell in _BLANKS.split(line) if cell]
        return [cell for cell in csv_cells(line.strip(), " ", skipinitialspace=True) if cell]
    return [cell.strip() for cell in csv_cells(line, delimiter, skipinitialspace=True)]


def csv_cells(line: str, delimiter: str, skipinitialspace: bool = False) -> list[str]:
    """Split a line as CSV; return it whole if a cell is longer than Python's reader takes."""
    try:
        return next(csv.reader([line], delimiter=delimiter, skipinitialspace=skipinitialspace), [])
    except csv.Error:
        return [line]


def _is_row(cells: list[str], numeric: list[bool], words: bool) -> bool:
    """Tell whether cells, of which some are `numeric`, are a row of values.

    A row has numbers, empty cells and time stamps. With `words`, it may have a few words instead, such as a state.
    """
    numbers = sum(numeric)
    rest = [cell for cell, number in zip(cells, numeric, strict=True) if cell and not number]
    if words:
        return numbers >= 2 and len(rest) <= numbers
    return numbers > 0 and len(rest) <= 0.5 * numbers + 1 and all(STAMP.fullmatch(cell) for cell in rest)


LINES_OF_A_HEAD = 1000
"""Number of first lines of a text file that are tried with each delimiter."""

COLUMNS_OF_A_TABLE = 2000
"""Largest number of columns of a table. Asking more for their roles takes ten seconds."""


def layout(path: Path) -> TextLayout:
    """Find the layout of a text file with one table of numbers.

    Words are accepted in its rows only if nearly all rows have some. Raises LogError if there is no table.
    """
    encoding, lines = decoded_head(path)
    lines = lines[:LINES_OF_A_HEAD]
    fits = _best_fit(encoding, tuple(lines))
    if fits is not None:
        best, rival = fits[0].layout, fits[1]
        if rival is not None:
            row = fits[0].grouped or rival.grouped
            actual = f"{quoted(row)}, which may be {best.columns} or {rival.columns} numbers"
            expected = "a heading for every column, or another delimiter than the sign that groups thousands"
            raise LogError("log", actual, expected, "1,234.5;0.5 or 1234.5,0.5", str(path))
        _no_number_in_parts(lines, best, path)
        if best.columns > COLUMNS_OF_A_TABLE:
            expected = f"at most {COLUMNS_OF_A_TABLE}: one a channel, one row a sample"
            raise LogError("log", f"{best.columns} columns", expected, "", str(path))
        _no_open_quote(lines[: best.first], best.delimiter, path)
        return best
    actual = "no row of numbers" + (f" after the heading {lines[0][:60]!r}" if lines else "")
    expected = "a heading and rows of numbers" + ("; a stage file is for friso check" if path.suffix == ".toml" else "")
    raise LogError("log", actual, expected, "time [s];position [mm];force [N]", str(path))


_IN_PARTS = re.compile(r"(?<![\d.])[1-9]\d{0,2}[ ,]\d{3}(?!\d)")
"""Two cells that may be one number, whose thousands are grouped by the sign between the cells."""


def _no_number_in_parts(lines: Sequence[str], form: TextLayout, path: Path) -> None:
    """Check that no number was divided at its decimal comma, or where its thousands are grouped.

    Raises LogError where headings are fewer than cells, and that may be why.
    """
    heading = _filled(split_line(lines[form.first - 1], form.delimiter)) if form.first else []
    if form.delimiter not in (",", " ") or not 1 < len(heading) < form.columns:
        return
    halves = form.delimiter == "," and form.columns == 2 * len(heading)
    row = next((line for line in lines[form.first :] if line.strip() and (halves or _IN_PARTS.search(line))), "")
    if row:
        actual = f"{quoted(row)} below {len(heading)} headings, which may be {form.columns} or {len(heading)} numbers"
        expected = "a heading for every column, or another delimiter than the signs within numbers"
        raise LogError("log", actual, expected, "1,234.5;0.5 or 1234.5,0.5", str(path))


@lru_cache(REMEMBERED_LAYOUTS)
def _best_fit(encoding: str, lines: Sequence[str]) -> tuple[_Fit, _Fit | None] | None:
    """Return the layout that fits lines best, with one that divides them otherwise and fits as well; None for none."""
    fits = [_fits(lines, encoding, delimiter) for delimiter in _DELIMITERS]
    plain, worded = ([fit for fit in by if fit] for by in zip(*fits, strict=True))
    rows = max((fit.rows for fit in worded if fit.layout.delimiter in (";", "\t", "|")), default=0)
    worded = [fit for fit in worded if fit.layout.delimiter != "," or fit.rows > rows]  # commas may begin decimals
    best, best_worded = (max(by, key=lambda fit: fit.score, default=None) for by in (plain, worded))
    if best_worded is not None and (best is None or best_worded.rows > 2 * best.rows):
        return best_worded, None
    return best and (best, next((fit for fit in plain if best.is_rivalled_by(fit)), None))


def _no_open_quote(above: list[str], delimiter: str, path: Path) -> None:
    """Check that every quotation mark in a heading is closed.

    Raises LogError for an open one, because all cells after it would be read as one.
    """
    number, heading = next(((n, line) for n, line in reversed([*enumerate(above, 1)]) if line.strip()), (0, ""))
    with suppress(csv.Error):
        lines = [f"{heading.strip()}\n", "below"]
        if len([*csv.reader(lines, delimiter=delimiter, skipinitialspace=True)]) == 1:
            actual = f"a quotation mark in line {number} that is not closed"
            raise LogError("log", actual, "a heading with its quotation marks closed", "", str(path))


class _Fit(NamedTuple):
    """A layout and how well it fits: rows of numbers, whether all columns have names, and columns.

    `grouped` is the first row in which a sign groups digits that delimits cells elsewhere; "" for none.
    """

    rows: int
    named: bool
    columns: int
    grouped: str
    layout: TextLayout

    @property
    def score(self) -> tuple[int, bool, int]:
        """Return what decides between layouts, most important first."""
        return self.rows, self.named, self.columns

    def is_rivalled_by(self, other: _Fit) -> bool:
        """Tell whether another layout fits as well, and its numbers are others because of a sign that groups digits."""
        divides_otherwise = other.columns != self.columns and bool(self.grouped or other.grouped)
        as_well = self.columns == 1 or (other.columns > 1 and other.named == self.named)
        return other.rows == self.rows and divides_otherwise and as_well


def _fits(lines: Sequence[str], encoding: str, delimiter: str) -> tuple[_Fit | None, _Fit | None]:
    """Rate how well a delimiter fits the lines of a text.

    The first result accepts no words in rows of numbers, the second does. Each is None if no row fits.
    """
    rows = [split_line(line, delimiter) for line in lines]
    numeric = [[is_number(cell) for cell in cells] for cells in rows]

    def fit(words: bool) -> _Fit | None:
        is_row = [_is_row(cells, numbers, words) for cells, numbers in zip(rows, numeric, strict=True)]
        return _fit(lines, encoding, delimiter, rows, is_row) if any(is_row) else None

    return fit(words=False), fit(words=True)


def _fit(lines: Sequence[str], encoding: str, delimiter: str, rows: list[list[str]], is_row: list[bool]) -> _Fit:
    """Rate a delimiter, given which rows, of which there are some, are numbers."""
    first = next(i for i, row in enumerate(is_row) if row and _goes_on(is_row, rows, i))
    columns = Counter(len(cells) for cells in rows[first : first + 50] if any(cells)).most_common(1)[0][0]
    names, units = _headings(lines, first, columns, delimiter)
    below = [i for i, row in enumerate(is_row) if row and i >= first]
    grouped = next((lines[i] for i in below if any(map(_GROUPED.match, rows[i]))), "")
    numbers = likely_format(cell for i in below for cell in rows[i])
    form = TextLayout(encoding, delimiter, numbers, first, columns, names, units, tuple(lines[:first]))
    return _Fit(len(below), all(names) and bool(names), columns, grouped, form)


ROWS_OF_A_TABLE_BEGUN = 50
"""Number of rows within which another one has the length of the first row of a table."""


def _goes_on(is_row: list[bool], rows: list[list[str]], i: int) -> bool:
    """Tell whether a row of numbers is followed by a row of numbers, and some row of equal length, as in a table.

    Rows of several topics differ in length, but each kind comes again.
    """
    following = [j for j in range(i + 1, len(rows)) if any(rows[j])][:ROWS_OF_A_TABLE_BEGUN]
    if not following or not any(is_row[i + 1 :]):
        return True
    length = len(_filled(rows[i]))
    return is_row[following[0]] and any(is_row[j] and len(_filled(rows[j])) == length for j in following)


def _headings(
    lines: Sequence[str], first: int, columns: int, delimiter: str
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return names and units per column from one or two lines above the numbers; () for none.

    The numbers begin at line `first`, counted from 0, in as many columns as `columns` says.
    """
    above = [lines[i].lstrip("#% ") for i in range(first) if lines[i].strip()]
    heads = [_heading_cells(line, columns, delimiter) for line in above[-2:]]
    heads = [head[:columns] + _filled(head[columns:]) for head in heads]  # a line may end with a delimiter
    heads = [head + [""] * (columns - len(head)) for head in heads if columns >= len(head) >= max(1, columns - 1)]
    if not heads:
        return (), ()
    last = heads[-1]
    bare = ["" if is_number(cell) else cell.strip("[]()") for cell in last]  # single values beside a table
    cells = [cell for cell in bare if cell and cell != "-"]
    if len(heads) == 2 and cells and sum(is_unit(cell) for cell in cells) >= 0.5 * len(cells):
        return tuple(heads[0]), tuple(bare)
    if 2 * sum(is_number(cell) for cell in last) >= sum(map(bool, last)):
        return (), ()  # a row of values with a word among them
    names, units = zip(*(split_heading(cell) for cell in last), strict=True)
    return tuple(names), tuple(units)


def _filled(cells: list[str]) -> list[str]:
    """Return the cells up to the last non-empty one."""
    return cells[: max((i + 1 for i, cell in enumerate(cells) if cell), default=0)]


def _heading_cells(line: str, columns: int, delimiter: str) -> list[str]:
    """Return the headings in a line.

    Names separated by spaces may have several words, if each ends with its unit in brackets.
    """
    cells = split_line(line, delimiter)
    if delimiter == " " and len(cells) != columns:
        closed = line[: max(map(line.rfind, ")]")) + 1]  # stop at an opening bracket without an end
        named = re.findall(r"(?<![^\[\]()])[^\[\]()]+[\[(][^\])]*[\])]", closed)
        return [name.strip() for name in named] if len(named) == columns else cells
    return cells
