"""How numbers are written in a text log: one decimal sign and one sign that groups thousands, told by all its cells."""

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

import friso
from friso.errors import LogError
from friso.identification.logs.assemble import read_log
from friso.identification.logs.read import read_table

NO_BREAK, NARROW, THIN, MINUS, QUOTE = "\u00a0", "\u202f", "\u2009", "\u2212", "\u2019"
ROWS_BEYOND_A_HEAD = 60_000


def written(path: Path, lines: list[str], heading: str = "") -> Path:
    path.write_text("\n".join([heading, *lines] if heading else lines) + "\n", encoding="utf-8")
    return path


def values(path: Path) -> list[list[float]]:
    return [channel.values.tolist() for channel in read_table(path).channels]


def grouped_log(path: Path) -> tuple[Path, np.ndarray, np.ndarray]:
    """A log as a German spreadsheet writes it: whole micrometres in groups, seconds and newtons with commas."""
    time = 1e-3 * np.arange(2000)
    micrometres = np.round(20_000 * np.sin(7 * time) - 100).astype(int)
    force = np.round(12 * np.cos(7 * time), 3)
    cells = (
        (f"{t:.3f}".replace(".", ","), f"{x:,}".replace(",", "."), f"{f:.3f}".replace(".", ","))
        for t, x, f in zip(time, micrometres, force, strict=True)
    )
    return written(path, ["\t".join(row) for row in cells], "Zeit [s]\tLage [µm]\tKraft [N]"), micrometres, force


def test_points_group_thousands_where_commas_begin_the_decimals(tmp_path: Path) -> None:
    path, micrometres, force = grouped_log(tmp_path / "grouped.txt")
    table = read_table(path)
    assert [(item.name, item.unit) for item in table.channels] == [("Zeit", "s"), ("Lage", "µm"), ("Kraft", "N")]
    assert np.array_equal(table.channels[1].values, micrometres)
    assert np.array_equal(table.channels[2].values, force)
    assert "decimal comma, thousands grouped by points" in table.read[0]
    log = read_log(path)
    assert log["position"] == pytest.approx(1e-6 * micrometres, abs=1e-15)
    assert log["force"] == pytest.approx(force)
    shown = friso.logs(path).to_dict()["logs"][0]["channels"][1]
    assert (shown["low"], shown["high"]) == (micrometres.min(), micrometres.max())


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        (["1;1.234", "2;2.345"], [1.234, 2.345]),
        (["1;1,234", "2;2,345"], [1.234, 2.345]),
        (["1;1.234", "2;1.5"], [1.234, 1.5]),
        (["1;1.234", "2;1500"], [1.234, 1500]),
        (["1;1.234", "2;0.234"], [1.234, 0.234]),
        (["1;1.234e2", "2;512"], [123.4, 512]),
        (["1;1.2340", "2;512"], [1.234, 512]),
    ],
)
def test_decimals_that_nothing_speaks_against_are_decimals(
    rows: list[str], expected: list[float], tmp_path: Path
) -> None:
    assert values(written(tmp_path / "a.txt", rows, "t;x"))[1] == expected


@pytest.mark.cases(first=1, slow=3)
@pytest.mark.parametrize(
    ("first", "last", "expected"),
    [
        ("{0},5;5", "1,5;1.234", 1234),
        ("{0}.5;5", "1.5;1,234", 1234),
        ("{0};1.234", "1;0,5", 0.5),
        ("{0};1.234", "1;0.5", 0.5),
        ("{0},5;5", f"1,5;1{NO_BREAK}234", 1234),
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "cp1252"])
def test_what_decides_may_come_last(first: str, last: str, expected: float, encoding: str, tmp_path: Path) -> None:
    lines = ["t;x", *(first.format(i) for i in range(ROWS_BEYOND_A_HEAD)), last]
    (tmp_path / "a.txt").write_text("\n".join(lines) + "\n", encoding=encoding)
    column = values(tmp_path / "a.txt")[1]
    assert (len(column), column[-1]) == (ROWS_BEYOND_A_HEAD + 1, expected)
    assert column[0] == (5 if first.endswith("5;5") else 1234 if "," in last else 1.234)


def test_thousands_of_a_twincat_export(tmp_path: Path) -> None:
    rows = [f"{i}\t{i + 1}.234\t{i},5" for i in range(60)]
    head = ["Name\trig", "SampleTime[ms]\t1", "", "Name\tpos\tforce", "SampleTime[ms]\t1", ""]
    pos, force = values(written(tmp_path / "a.csv", [*head, *rows, "EOF"]))
    assert pos == [1000 * (i + 1) + 234 for i in range(60)]
    assert force == [i + 0.5 for i in range(60)]


@pytest.mark.parametrize(
    ("line", "step"), [("Abtastrate: 10.000 Hz", None), ("Abtastrate: 500,0 Hz", 2e-3), ("dt = 0,001 s", 1e-3)]
)
def test_a_rate_above_a_table_is_read_with_its_decimal_sign(line: str, step: float | None, tmp_path: Path) -> None:
    path = written(tmp_path / "a.txt", [line, "pos [mm];force [N]", *(f"{i},5;0,25" for i in range(60))])
    time = read_table(path).channels[0].time
    assert (None if time is None else pytest.approx(time[1])) == step


@pytest.mark.cases(first=2)
@pytest.mark.parametrize("rows", [f"0.5{NO_BREAK};{NO_BREAK}5", f"{NO_BREAK}0.5\t5{NO_BREAK}", f"0.5 {NO_BREAK}5"])
def test_spaces_around_numbers_are_no_part_of_them(rows: str, tmp_path: Path) -> None:
    """Words beside numbers with commas leave the delimiter."""
    heading = re.sub(r"[\d.]+", "x", rows)
    assert values(written(tmp_path / "a.txt", [rows] * 60, heading)) == [[0.5] * 60, [5] * 60]
    beside = values(written(tmp_path / "a.txt", ["0,5\t19.876\tRUN\t1,5", "1,5\t12\tSTOP\t2,5"] * 30))
    assert [column[:2] for column in beside] == [[0.5, 1.5], [19876, 12], [1.5, 2.5]]


SIGNS = [(".", sign) for sign in ("", ",", NO_BREAK, NARROW, THIN, " ", "'", QUOTE)]
SIGNS += [(",", sign) for sign in ("", ".", NO_BREAK, NARROW, THIN, " ", "'", QUOTE)]


@st.composite
def columns(draw: st.DrawFn, decimal: str, grouping: str, minus: str, rows: int) -> tuple[list[str], list[float]]:
    """The cells of a column in a number format, and their values; zeros at the end of decimals may be left out."""
    places, largest = draw(st.sampled_from((0, 0, 3, 3, 2, 4))), 10 ** draw(st.integers(3, 9))
    least = draw(st.sampled_from((-largest, min(largest, 1000 * 10**places))))
    numbers = draw(st.lists(st.integers(least, largest), min_size=rows, max_size=rows))
    grouped, stripped = draw(st.booleans()), draw(st.booleans())
    cells = []
    for number in numbers:
        whole, rest = divmod(abs(number), 10**places)
        decimals = f"{rest:0{places}d}" if places else ""
        decimals = decimals.rstrip("0") if stripped else decimals
        whole_text = f"{whole:,}".replace(",", grouping) if grouped else str(whole)
        cells.append((minus if number < 0 else "") + whole_text + (decimal + decimals if decimals else ""))
    return cells, [number / 10**places for number in numbers]


@st.composite
def tables(draw: st.DrawFn, telling: bool) -> tuple[str, list[list[str]], list[list[float]], str]:
    """The text of a table in any number format, its columns, their values, and the sign that groups digits.

    With `telling`, one column shows the decimal sign, and there is a heading where blanks may divide the cells.
    """
    decimal, grouping = draw(st.sampled_from(SIGNS))
    delimiter = draw(st.sampled_from([sign for sign in ";\t, " if sign not in (decimal, grouping)]))
    minus, rows = draw(st.sampled_from(("-", MINUS))), draw(st.integers(2, 12))
    count = draw(st.integers(1 if telling else 2, 3))
    drawn = [draw(columns(decimal, grouping, minus, rows)) for _ in range(count)]
    if telling:
        time = ([f"0{decimal}{i:03d}" for i in range(rows)], [i / 1000 for i in range(rows)])
        drawn.insert(draw(st.integers(0, count)), time)
    cells, numbers = [cells for cells, _ in drawn], [numbers for _, numbers in drawn]
    named = draw(st.booleans()) or (telling and " " in (delimiter, grouping))
    heading = [delimiter.join(f"c{i}" for i in range(len(cells)))] if named else []
    text = "\n".join([*heading, *(delimiter.join(row) for row in zip(*cells, strict=True))]) + "\n"
    return text, cells, numbers, grouping


FREELY = settings(max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture])


@pytest.mark.slow
@FREELY
@given(tables(telling=True))
def test_numbers_in_any_format_come_back_where_one_column_tells_it(tmp_path: Path, table: tuple) -> None:
    text, _, expected, _ = table
    (tmp_path / "a.txt").write_text(text, encoding="utf-8")
    assert values(tmp_path / "a.txt") == expected


@pytest.mark.slow
@FREELY
@given(tables(telling=False))
def test_no_number_in_any_format_is_read_as_another(tmp_path: Path, table: tuple) -> None:
    """Except where all cells are what three decimals look like, too: those are read as decimals."""
    text, cells, expected, grouping = table
    if grouping in (".", ","):
        three = re.compile(rf"[-{MINUS}]?[1-9]\d{{0,2}}[{grouping}]\d{{3}}")
        signed = [column for column in cells if any(re.search("[.,]", cell) for cell in column)]
        assume(not signed or not all(three.fullmatch(cell) for column in signed for cell in column))
    (tmp_path / "a.txt").write_text(text, encoding="utf-8")
    try:
        read = values(tmp_path / "a.txt")
    except LogError as error:
        reason = error.actual
    else:
        assert read == expected
        return
    assert re.search("decimals or thousands|which may be", reason)
