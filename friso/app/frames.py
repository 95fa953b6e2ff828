"""Pack answers for the page: frames of a JSON text and of its numbers in binary.

A frame begins with two whole numbers of four bytes, least significant byte first: the lengths of the text and of the
numbers, which follow. In the text, an array is an object {"array": index of its first byte, "shape": [...]}. Arrays are
float32.
"""

from __future__ import annotations

import json
import math
import struct
from typing import Any

import numpy as np

from friso.shown.documents import entries
from friso.shown.drawing import plotly_renderer
from friso.shown.drawing.figure import Figure


def frame(value: Any) -> bytes:
    """Return a value as a frame.

    The value may hold dictionaries, lists, texts, numbers and NumPy arrays. Numbers that are not finite become null; in
    arrays they become NaN.
    """
    arrays = _Arrays()
    text = json.dumps(_plain(value, arrays), separators=(",", ":"), allow_nan=False).encode()
    numbers = b"".join(arrays.parts)
    return struct.pack("<II", len(text), len(numbers)) + text + numbers


def figure_on_page(figure: Figure) -> dict[str, Any]:
    """Return a figure as the page draws it: name, title, caption and plotly's data.

    The data serve wide and narrow pages.
    """
    return {**entries(figure, "name", "title", "caption"), **plotly_renderer.parts_of_both(figure)}


class _Arrays:
    """The numbers of a frame's arrays in binary, one array behind the other."""

    def __init__(self) -> None:
        self.parts: list[bytes] = []
        self.size = 0

    def add(self, numbers: bytes) -> int:
        """Add an array, and return the index of its first byte among the numbers."""
        place, self.size = self.size, self.size + len(numbers)
        self.parts.append(numbers)
        return place


def _plain(value: Any, arrays: _Arrays) -> Any:
    """Replace arrays by references and numbers by what JSON can hold.

    Arrays are added to `arrays` as float32. Numbers that are not finite become None.
    """
    if isinstance(value, np.ndarray) and value.dtype.kind in "fiub" and value.size:
        place = arrays.add(np.ascontiguousarray(value, "<f4").tobytes())
        return {"array": place, "shape": [*value.shape]}
    if isinstance(value, dict):
        return {str(name): _plain(item, arrays) for name, item in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [_plain(item, arrays) for item in (value.tolist() if isinstance(value, np.ndarray) else value)]
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    return value.item() if isinstance(value, np.generic) else value
