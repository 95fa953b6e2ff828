"""Read the cells of a text with one table of numbers, all of them in one number format."""

from __future__ import annotations

import codecs
import re
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, TextIO

import numpy as np
import pandas as pd

from friso.errors import LogError
from friso.identification.logs.number_format import (
    DECIMAL_SIGNS,
    NumberFormat,
    are_grouped,
    are_numbers,
    are_whole,
    fitting,
    formats_with,
    may_be_grouped,
    number_texts,
)
from friso.identification.logs.sniff import DOS_END, TextLayout, split_line
from friso.quantities import quoted


def read_cells(path: Path, form: TextLayout) -> tuple[TextLayout, Any]:
    """Read all cells from the first row of numbers on; columns without text are floats.

    The layout comes back with the number format that fits all columns together. Raises LogError for ragged rows, for
    columns that no format fits together, and where nothing tells whether digits are decimals or grouped.
    """
    first = _Reading.of(path, form)
    if first.numbers is not None and first.is_settled:
        return replace(form, numbers=first.numbers), first.frame
    second = _Reading.of(path, replace(form, numbers=NumberFormat(first.other_sign)))
    fits = [reading for reading in (first, second) if reading.numbers is not None]
    if not fits:
        cells = "; ".join(dict(sorted((first.misfits | second.misfits).items())).values())
        expected = "one decimal sign, one sign that groups thousands, and groups in all numbers of a column or in none"
        raise LogError("log", f"numbers in more than one format: {cells}", expected, "1234,5 and 0,5", str(path))
    plain = [reading for reading in fits if not reading.groups]
    grouped = [reading for reading in fits if reading.groups]
    if len(fits) == 2 and (not plain or any(len(reading.groups) > 1 for reading in grouped)):
        sign = grouped[0].other_sign
        actual = f"{' beside '.join((grouped[0].groups + grouped[-1].groups)[:2])}: decimals or thousands"
        example = f"1234 and 512, or 1{sign}234 and 512{sign}000"
        raise LogError("log", actual, "thousands that are not grouped, or all decimals written", example, str(path))
    chosen = (plain or fits)[0]
    return replace(form, numbers=chosen.numbers), chosen.frame


@dataclass(frozen=True)
class _Reading:
    """The cells of a table, read with one decimal sign.

    `texts` are the different cells that are numbers in any format, by column, of columns that pandas leaves as texts.
    """

    form: TextLayout
    frame: Any
    texts: dict[int, Any]

    @classmethod
    def of(cls, path: Path, form: TextLayout) -> _Reading:
        """Read all cells with the decimal sign of a layout."""
        frame = read_frame(path, form)
        columns = enumerate(frame.iloc[:, i] for i in range(frame.shape[1]))
        texts = {i: _number_cells(cells) for i, cells in columns if not pd.api.types.is_numeric_dtype(cells.dtype)}
        return cls(form, frame, {i: cells for i, cells in texts.items() if cells.size})

    @property
    def other_sign(self) -> str:
        """Return the decimal sign that is not read as one here, and may group digits."""
        return next(sign for sign in DECIMAL_SIGNS if sign != self.form.numbers.decimal)

    @cached_property
    def numbers(self) -> NumberFormat | None:
        """Return the format that fits all columns, without a sign for grouping if no digits are grouped."""
        fits = next((numbers for numbers in self._formats if not self._first(_misfits, numbers)), None)
        return fits if fits is None or self._first(are_grouped, fits) else NumberFormat(fits.decimal)

    @property
    def _formats(self) -> list[NumberFormat]:
        return formats_with(self.form.numbers.decimal)

    @property
    def misfits(self) -> dict[tuple[int, int], str]:
        """Return by its place the first cell that does not fit, of each format."""
        cells = (self._first(_misfits, numbers) for numbers in self._formats)
        return {cell: self._shown(cell) for cell in cells if cell}

    @cached_property
    def groups(self) -> tuple[str, ...]:
        """Return a cell in which the other decimal sign groups digits, and a whole number of the same column, if any.

        A column with both comes first. Without any such cell, the result is empty.
        """
        if self.numbers is None or self.numbers.grouping != self.other_sign:
            return ()
        pairs = []
        for i, texts in self.texts.items():
            rows = [texts.index[cells] for cells in (are_grouped(texts, self.numbers), are_whole(texts))]
            if rows[0].size:
                pairs.append(tuple(self._shown((int(of_kind[0]), i)) for of_kind in rows if of_kind.size))
        return max(pairs, key=len)

    @property
    def is_settled(self) -> bool:
        """Tell whether a number has this decimal sign in any format, or no number may have one."""
        columns = (self.frame.iloc[:, i] for i in range(self.frame.shape[1]))
        floats = [cells.to_numpy() for cells in columns if pd.api.types.is_float_dtype(cells.dtype)]
        if not self.texts and all(np.isnan(values).all() for values in floats):
            return True
        if any((~may_be_grouped(values)).any() for values in floats):
            return True
        return any((~are_numbers(cells, self.other_sign)).any() for cells in self.texts.values())

    def _first(self, test: Callable[[Any, NumberFormat], np.ndarray], numbers: NumberFormat) -> tuple[int, int] | None:
        """Return row and column of the first cell that passes a test; None for none."""
        passed = {i: np.flatnonzero(test(cells, numbers)) for i, cells in self.texts.items()}
        return min(((int(self.texts[i].index[rows[0]]), i) for i, rows in passed.items() if rows.size), default=None)

    def _shown(self, cell: tuple[int, int]) -> str:
        """Describe a cell by its text, line and column."""
        row, column = cell
        name = self.form.names[column] if any(self.form.names) else str(column + 1)
        text = quoted(str(self.frame.iloc[row, column]).strip())
        return f"{text} in line {self.form.first + 1 + row}, column {name or 'without a name'}"


def _misfits(texts: Any, numbers: NumberFormat) -> np.ndarray:
    """Tell which texts of a column are no numbers in a format."""
    return ~fitting(texts, numbers)


def _number_cells(cells: Any) -> Any:
    """Return the first of equal cells of a column that are numbers in any format; none if most cells are words."""
    texts = number_texts(cells)
    numbers = are_numbers(texts)
    return texts[numbers].drop_duplicates() if 2 * numbers.sum() >= (texts != "").sum() else texts[:0]


def read_frame(path: Path, form: TextLayout) -> Any:
    """Read all cells from the first row of numbers on, with the decimal sign of a layout.

    Columns without text are floats. Lines before the table are skipped here, because pandas would take a lone quotation
    mark in them as opening. Raises LogError for ragged rows.
    """
    options: dict[str, Any] = {
        "header": None, "decimal": form.numbers.decimal,
        "skip_blank_lines": False, "low_memory": False, "names": range(form.columns + 1),
        "index_col": False, "sep": form.delimiter, "skipinitialspace": not form.exact,
    }  # fmt: skip
    if form.delimiter == " " and not form.exact:
        options["sep"] = r"\s+"
    try:
        with path.open(encoding=form.encoding, errors=_AS_WINDOWS, newline="") as file:
            for _ in range(form.first):
                file.readline()
            with warnings.catch_warnings():
                warnings.simplefilter("error", pd.errors.ParserWarning)  # pandas warns that cells are dropped
                frame = pd.read_csv(_WithoutDosEnd(file), **options, on_bad_lines="error")  # pyright: ignore
    except (pd.errors.ParserError, pd.errors.ParserWarning, ValueError) as error:
        raise ragged(path, form, str(error)) from None
    if frame.iloc[:, -1].notna().any():  # one cell more than columns: a row may end with a delimiter
        raise ragged(path, form)
    return frame.iloc[:, :-1]


def _as_windows(error: UnicodeError) -> tuple[str, int]:
    """Read bytes that are no UTF-8 as cp1252: the first no-break space of a file may be what tells them apart."""
    if not isinstance(error, UnicodeDecodeError):
        raise error
    return error.object[error.start : error.end].decode("cp1252", "replace"), error.end


_AS_WINDOWS = "friso.identification.logs.cells"
"""Name by which decoders find what to do with such bytes."""
codecs.register_error(_AS_WINDOWS, _as_windows)


class _WithoutDosEnd:
    """A text file without the end mark of DOS programs."""

    def __init__(self, file: TextIO) -> None:
        """Wrap a text file, from whose text the mark is removed."""
        self._file = file

    def read(self, size: int = -1) -> str:
        """Read `size` characters (-1: all), without the mark."""
        return self._file.read(size).replace(DOS_END, "")

    def __iter__(self) -> Iterator[str]:
        """Yield lines without the mark."""
        return (line.replace(DOS_END, "") for line in self._file)


def ragged(path: Path, form: TextLayout, why: str = "") -> LogError:
    """Return the error for a line with too many cells, or an unclosed quotation mark.

    Other errors of the parser are quoted in its own words.
    """
    with path.open(encoding=form.encoding, errors="replace") as file:
        for number, line in enumerate(file, 1):
            cells = split_line(line.rstrip("\r\n"), form.delimiter) if number > form.first else []
            if len(cells) > form.columns and any(cells[form.columns :]):
                actual = f"{len(cells)} cells in line {number}"
                return LogError("log", actual, f"{form.columns} cells in every row", "", str(path))
    if quote := re.search(r"EOF inside string starting at row (\d+)", why):
        why = f"a quotation mark in line {form.first + 1 + int(quote[1])} that is not closed"
    return LogError("log", why.strip(), f"rows of {form.columns} numbers", "", str(path))
