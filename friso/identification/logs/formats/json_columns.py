"""JSON: lists of numbers by name, a list of records or rows, or one record a line."""

from __future__ import annotations

import re

from friso.identification.logs.columns import table_of_columns
from friso.identification.logs.confined import content
from friso.identification.logs.format import LogFormat

_BEGINS = re.compile(rb"(?:\xef\xbb\xbf)?\s*(?:\{\s*\"|\[\s*[\[{])")
"""Beginning of an object with a name, or of a list of objects or lists."""

FORMAT = LogFormat(
    "JSON",
    lambda head: _BEGINS.match(head.start) is not None,
    lambda path: table_of_columns("JSON", content("JSON", path), path),
    times=False,
)
