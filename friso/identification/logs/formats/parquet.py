"""Parquet and Feather (Arrow): tables in columns."""

from __future__ import annotations

from friso.identification.logs.columns import table_of_columns
from friso.identification.logs.confined import content_by
from friso.identification.logs.format import LogFormat

FORMAT = LogFormat(
    "Parquet, Feather",
    lambda head: head.start.startswith((b"PAR1", b"ARROW1", b"FEA1")),
    lambda path: table_of_columns("Parquet", content_by("pyarrow", "Parquet", path), path),
    times=False,
)
