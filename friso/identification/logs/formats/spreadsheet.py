"""Workbooks of Excel (XLSX, XLS) and OpenDocument (ODS): the table on the largest sheet."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from friso.identification.logs.channel import ChannelTable
from friso.identification.logs.confined import content_by
from friso.identification.logs.format import LogFormat
from friso.identification.logs.packed import UnpackedFile, is_workbook, members
from friso.identification.logs.text import read_text

_OLD = b"\xd0\xcf\x11\xe0"
"""First bytes of a workbook of an old Excel."""


def read_sheet(path: Path) -> ChannelTable:
    """Read the table on the largest sheet of a workbook, as the text of its cells is read.

    Raises LogError if the library python-calamine is missing, and for a sheet without a table.
    """
    content = content_by("python_calamine", "Workbook", path)
    text = UnpackedFile(path.stem)
    text.path.write_text(content["text"], encoding="utf-8")
    table = read_text(text.path)
    others = content["others"]
    left = [f"left out: the other sheets, {', '.join(others)}"] if others else []
    return replace(table, read=(f"format: workbook, sheet {content['sheet']}", *table.read[1:], *left))


FORMAT = LogFormat(
    "XLSX, ODS, XLS",
    lambda head: head.start.startswith(_OLD) or is_workbook(members(head.path)),
    read_sheet,
    times=False,
)
