"""CSV, TXT and TSV: one table of numbers, of any delimiter, decimal sign and encoding; packed, too."""

from __future__ import annotations

from friso.identification.logs.format import LogFormat
from friso.identification.logs.measured_response import is_response, response_of
from friso.identification.logs.sniff import layout
from friso.identification.logs.text import read_text

FORMAT = LogFormat(
    "CSV, TXT, TSV",
    lambda head: bool(head.lines),
    read_text,
    rank=2,
    times=False,
    of_lines=True,
    holds_response=lambda path: is_response(layout(path).names),
    read_response=lambda path: response_of(read_text(path), path),
)
