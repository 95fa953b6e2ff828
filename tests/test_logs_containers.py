"""One table in many containers: arrays, JSON, Parquet, workbooks and packed files give the same channels."""

import bz2
import gzip
import json
import lzma
import zipfile
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from refusals import refused

from friso.errors import LogError
from friso.identification.logs import read
from friso.identification.logs.assemble import read_log
from friso.identification.logs.read import file_format, read_table
from friso.identification.logs.settings import LogSettings

T = 1e-3 * np.arange(600)
X = 2e-3 * (1 - np.cos(20 * T))
F = 5 * np.sign(np.sin(20 * T)) + np.cos(20 * T)
NAMES = ["time [s]", "position [m]", "force [N]"]
FRAME = pd.DataFrame(dict(zip(NAMES, (T, X, F), strict=True)))
TEXT = FRAME.to_csv(index=False)


def written(text: str) -> Callable[[Path], object]:
    return lambda path: path.write_text(text, encoding="utf-8")


def lines(records: list[dict[str, object]]) -> str:
    return "\n".join(map(json.dumps, records))


def zipped(name: str, text: str = TEXT) -> Callable[[Path], object]:
    def write(path: Path) -> None:
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr(name, text)

    return write


ROWS = [NAMES, *FRAME.to_numpy().tolist()]


def excel(path: Path) -> None:
    """Write a workbook with a title, a heading, a blank row and the table, and a second sheet."""

    def sheet(rows: list[list[object]]) -> str:
        def cell(value: object) -> str:
            number = isinstance(value, float)
            return f"<c><v>{value!r}</v></c>" if number else f'<c t="inlineStr"><is><t>{value}</t></is></c>'

        inner = "".join(f"<row>{''.join(map(cell, row))}</row>" for row in rows)
        return f'<worksheet xmlns="{main}"><sheetData>{inner}</sheetData></worksheet>'

    schemas = "http://schemas.openxmlformats.org"
    main, links = f"{schemas}/spreadsheetml/2006/main", f"{schemas}/officeDocument/2006/relationships"
    sheets = "".join(f'<sheet name="{name}" sheetId="{i}" r:id="r{i}"/>' for i, name in ((1, "Notes"), (2, "Run 7")))
    kind = f'Type="{links}/worksheet"'
    targets = "".join(f'<Relationship Id="r{i}" {kind} Target="worksheets/sheet{i}.xml"/>' for i in (1, 2))
    relations = f'<Relationships xmlns="{schemas}/package/2006/relationships">{{}}</Relationships>'
    book = f'<Relationship Id="r1" Type="{links}/officeDocument" Target="xl/workbook.xml"/>'
    parts = {
        "_rels/.rels": relations.format(book),
        "xl/workbook.xml": f'<workbook xmlns="{main}" xmlns:r="{links}"><sheets>{sheets}</sheets></workbook>',
        "xl/_rels/workbook.xml.rels": relations.format(targets),
        "xl/worksheets/sheet1.xml": sheet([["Made by hand"]]),
        "xl/worksheets/sheet2.xml": sheet([["Measured on Monday"], *ROWS]),
    }
    packed(path, parts)


def packed(path: Path, parts: dict[str, str]) -> None:
    """Write an archive of these files."""
    with zipfile.ZipFile(path, "w") as archive:
        for name, text in parts.items():
            archive.writestr(name, text)


def open_document(path: Path) -> None:
    def cell(value: object) -> str:
        kind = f'"float" office:value="{value!r}"' if isinstance(value, float) else '"string"'
        return f"<table:table-cell office:value-type={kind}><text:p>{value}</text:p></table:table-cell>"

    of = "urn:oasis:names:tc:opendocument:xmlns"
    rows = "".join(f"<table:table-row>{''.join(map(cell, row))}</table:table-row>" for row in ROWS)
    names = "".join(f' xmlns:{name}="{of}:{name}:1.0"' for name in ("office", "table", "text"))
    body = f'<office:spreadsheet><table:table table:name="Run 7">{rows}</table:table></office:spreadsheet>'
    content = f"<office:document-content{names}><office:body>{body}</office:body></office:document-content>"
    manifest = f'<manifest:manifest xmlns:manifest="{of}:manifest:1.0"/>'
    kind = "application/vnd.oasis.opendocument.spreadsheet"
    packed(path, {"mimetype": kind, "META-INF/manifest.xml": manifest, "content.xml": content})


RECORDS: list[dict[str, object]] = [dict(zip(NAMES, row, strict=True)) for row in FRAME.to_numpy().tolist()]
STAMPED = [
    {"stamp": 1.7e9 + t, "pose": {"position_mm": 1e3 * x}, "force_N": f} for t, x, f in zip(T, X, F, strict=True)
]
ARRAYS: dict[str, Any] = {name: FRAME[name].to_numpy() for name in NAMES}
CONTAINERS: dict[str, Callable[[Path], object]] = {
    "arrays.npz": lambda path: np.savez(path, **ARRAYS),
    "packed.npz": lambda path: np.savez_compressed(path, **ARRAYS),
    "fields.npy": lambda path: np.save(path, FRAME.to_records(index=False)),
    "columns.json": written(json.dumps({name: FRAME[name].tolist() for name in NAMES})),
    "nested.json": written(json.dumps({"name": "run 7", "log": {name: FRAME[name].tolist() for name in NAMES}})),
    "pandas.json": lambda path: FRAME.to_json(path, double_precision=15),
    "split.json": lambda path: FRAME.to_json(path, orient="split", double_precision=15),
    "records.json": written(json.dumps(RECORDS, indent=1)),
    "rows.json": written(json.dumps([NAMES, *FRAME.to_numpy().tolist()])),
    "lines.jsonl": written(lines(RECORDS)),
    "stamped.jsonl": written(lines(STAMPED)),
    "packed.csv.gz": lambda path: path.write_bytes(gzip.compress(TEXT.encode())),
    "packed.csv.bz2": lambda path: path.write_bytes(bz2.compress(TEXT.encode())),
    "packed.csv.xz": lambda path: path.write_bytes(lzma.compress(TEXT.encode())),
    "packed.zip": zipped("run 7/log.csv"),
    "lines.jsonl.gz": lambda path: path.write_bytes(gzip.compress(lines(RECORDS).encode())),
    "drawn.txt": written("\n".join(f"| {line.replace(',', ' | ')} |" for line in TEXT.splitlines())),
    "fortran.txt": written(
        "time[s] position[m] force[N]\n"
        + "\n".join(f"{t:.9E} {x:.9E} {f:.9E}".replace("E", "D") for t, x, f in zip(T, X, F, strict=True))
    ),
    "minutes.csv": written(
        "time,position [m],force [N]\n"
        + "\n".join(
            f"{int(59.9 + t) // 60 + 7:02d}:{(59.9 + t) % 60:06.3f},{x:.12f},{f:.8f}"
            for t, x, f in zip(T, X, F, strict=True)
        )
    ),
}  # fmt: skip
WITH_LIBRARY: dict[str, tuple[str, str, Callable[[Path], object]]] = {
    "a.parquet": ("pyarrow", "parquet", lambda path: FRAME.to_parquet(path)),
    "a.feather": ("pyarrow", "parquet", lambda path: FRAME.to_feather(path)),
    "a.xlsx": ("python_calamine", "workbook", excel),
    "a.ods": ("python_calamine", "workbook", open_document),
}


def check_table(path: Path) -> None:
    """Compare the signals of a log with what was written, in SI units at instants from 0 on."""
    log = read_log(path, needed=("position", "force"))
    assert log["position"] == pytest.approx(X, abs=2e-9)
    assert log["force"] == pytest.approx(F, abs=1e-7)
    assert log.time - log.time[0] == pytest.approx(T, abs=1e-6)


@pytest.mark.parametrize("name", CONTAINERS)
def test_one_table_in_any_container(tmp_path: Path, name: str) -> None:
    CONTAINERS[name](tmp_path / name)
    check_table(tmp_path / name)


@pytest.mark.parametrize("name", WITH_LIBRARY)
def test_containers_that_need_a_library(tmp_path: Path, name: str) -> None:
    library, _, write = WITH_LIBRARY[name]
    if find_spec(library) is None:
        pytest.skip(f"{library} is not installed")
    write(tmp_path / name)
    check_table(tmp_path / name)


@pytest.mark.parametrize(("name", "start"), [("a.parquet", b"PAR1"), ("a.feather", b"ARROW1"), ("a.xlsx", b"")])
def test_a_missing_library_is_told_with_what_installs_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, start: bytes
) -> None:
    excel(tmp_path / name)
    if start:
        (tmp_path / name).write_bytes(start + bytes(60))
    monkeypatch.setattr(read, "is_installed", lambda library: False)
    with pytest.raises(LogError) as error:
        read_table(tmp_path / name)
    assert error.value.example == f'pip install "friso[{WITH_LIBRARY[name][1]}]"'


def test_names_without_units_are_asked_for(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", t=T, position=X, force=F, gain=3.0)
    with pytest.raises(LogError) as error:
        read_log(tmp_path / "a.npz", needed=("position", "force"))
    assert {"--unit t=s", "--unit position=m"} <= {*getattr(error.value, "options", ())}
    assert read_table(tmp_path / "a.npz").scalars == {"gain": 3.0}


def test_a_matrix_has_a_channel_for_each_column(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.stack([T, X, F]))
    assert [channel.values.size for channel in read_table(tmp_path / "a.npy").channels] == [600] * 3


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("cut.csv.gz", gzip.compress(TEXT.encode())[:-500]),
        ("cut.csv.xz", lzma.compress(TEXT.encode())[:-500]),
        ("cut.npz", b"PK\x03\x04" + bytes(300)),
        ("objects.npy", None),
    ],
)
def test_damaged_containers_are_refused_with_their_own_name(tmp_path: Path, name: str, content: bytes | None) -> None:
    path = tmp_path / name
    if content is None:
        np.save(path, np.array([{}, {}], dtype=object), allow_pickle=True)
    else:
        path.write_bytes(content)
    with pytest.raises(LogError) as error:
        read_table(path)
    assert error.value.origin == str(path)


def test_what_unpacks_to_too_much_is_refused(tmp_path: Path) -> None:
    (tmp_path / "bomb.csv.gz").write_bytes(gzip.compress(bytes(1 << 22)))
    with LogSettings(bytes_unpacked=1 << 16, bytes_unpacked_per_byte=1).in_use(), refused("log"):
        read_table(tmp_path / "bomb.csv.gz")


def test_an_archive_of_several_files_is_refused(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        for name in ("a.csv", "b.csv"):
            archive.writestr(name, TEXT)
    with refused("log"):
        file_format(tmp_path / "a.zip")


@pytest.mark.parametrize("slower", [1, 2, 10])
@pytest.mark.parametrize("late", [0.0, 2.1e-4])
def test_topics_of_their_own_rates_share_one_clock(tmp_path: Path, slower: int, late: float) -> None:
    """Rows of a topic leave the cells of others empty; none is lost, and each has its own instants."""
    rows = [(1.7e9 + t, f"{x:.9g},{f:.9g},") for t, x, f in zip(T, X, F, strict=True)]
    rows += [(1.7e9 + t + late, f",,{x:.9g}") for t, x in zip(T[::slower], X[::slower], strict=True)]
    heading = "__time,/axis/position_m,/axis/force_N,/cmd/position_m\n"
    path = tmp_path / "topics.csv"
    path.write_text(heading + "\n".join(f"{t:.6f},{cells}" for t, cells in sorted(rows)))
    by_name = {channel.name: channel for channel in read_table(path).channels}
    assert [by_name[name].unit for name in ("__time", "/axis/force_N")] == ["s", "N"]
    for name, values in (("/axis/position_m", X), ("/cmd/position_m", X[::slower])):
        held = by_name[name].values
        assert held[np.isfinite(held)] == pytest.approx(values, abs=1e-9)
    log = read_log(path, needed=("position", "force"), mapping=None)
    assert log.sample_time == pytest.approx(1e-3 * slower, rel=1e-6)
