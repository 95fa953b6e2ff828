"""Take a sample of a large text: its beginning, middle and end, in a file of their own."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from friso.identification.logs.packed import UnpackedFile
from friso.identification.logs.settings import settings
from friso.identification.logs.sniff import decoded_head


@dataclass(frozen=True)
class TextSample:
    """Lines of a text in a `file` of their own.

    `growth` is the ratio of the sizes of text and sample; `later` counts the lines that do not stand at the beginning.
    """

    file: UnpackedFile
    growth: float
    later: int


def sample_of(path: Path) -> TextSample | None:
    """Take whole lines from the beginning, the middle and the end of a text.

    Returns None for a text that is hardly larger than its sample, or whose lines end with another sign than a line
    feed. Raises LogError for what is no text.
    """
    size, part = path.stat().st_size, settings.bytes_of_a_part
    encoding = decoded_head(path)[0]
    if size < 2 * 3 * part or encoding.startswith("utf-16"):
        return None
    pieces = []
    with path.open("rb") as file:
        for place in (0, size // 2, size - part):
            file.seek(place)
            piece = file.read(part)
            first, last = piece.find(b"\n") + 1 if place else 0, piece.rfind(b"\n") + 1
            pieces.append(piece[first:last])
    if not all(pieces):
        return None
    sample = UnpackedFile(path.name)
    sample.path.write_bytes(b"".join(pieces))
    return TextSample(sample, size / sum(map(len, pieces)), sum(piece.count(b"\n") for piece in pieces[1:]))
