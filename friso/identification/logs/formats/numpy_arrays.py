"""Arrays of NumPy, NPY and NPZ: one column each, or a matrix with a column for each channel."""

from __future__ import annotations

from friso.identification.logs.columns import table_of_columns
from friso.identification.logs.confined import content
from friso.identification.logs.format import LogFormat
from friso.identification.logs.packed import is_of_arrays, members

FORMAT = LogFormat(
    "NPY, NPZ",
    lambda head: head.start.startswith(b"\x93NUMPY") or is_of_arrays(members(head.path)),
    lambda path: table_of_columns("NumPy", content("NumPy", path), path),
    times=False,
)
