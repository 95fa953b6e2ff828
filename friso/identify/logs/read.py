"""Reading a file by what is in it, not by its name: every format ends in the same table of channels."""

from __future__ import annotations

from pathlib import Path

from friso.errors import LogError
from friso.identify.logs.channel import Table
from friso.identify.logs.frequency_text import (
    MeasuredResponse,
    is_response,
    read_response_text,
    read_response_uff,
)
from friso.identify.logs.instruments import read_lvm, read_tdms
from friso.identify.logs.mat import HDF5, read_mat
from friso.identify.logs.sniff import decoded_head, layout
from friso.identify.logs.text import read_text
from friso.identify.logs.twincat import is_twincat, read_twincat
from friso.identify.logs.uff import FREQUENCY_RESPONSE, is_uff, read_uff, sets_58

MOST_BYTES = 2 << 30
"""Largest file that is read, 2 GiB: all its channels are held in memory at once, about as large again."""


def file_format(path: Path) -> str:
    """The format of a file by its content: "mat", "tdms", "uff", "lvm", "twincat" or "text".

    Raises LogError for what cannot be read: missing, a folder, empty, too large, no text and no known format.
    """
    try:
        if path.is_dir():
            raise LogError("log", "a folder", "a file", "friso identify log.csv", str(path))
        size = path.stat().st_size
        with path.open("rb") as file:
            head = file.read(520)
    except OSError as error:
        raise LogError("log", f"a file that cannot be opened ({error.strerror})", "a log", "", str(path)) from None
    if size == 0:
        raise LogError("log", "an empty file (0 bytes)", "a heading and rows of numbers", "", str(path))
    if size > MOST_BYTES:
        expected = f"at most {MOST_BYTES / 2**30:.3g} GiB: cut the log, or save the channels needed alone"
        raise LogError("log", f"a file of {size / 2**30:.3g} GiB", expected, "", str(path))
    if head.startswith(b"MATLAB ") or HDF5 in (head[:8], head[512:520]) or path.suffix.lower() == ".mat":
        return "mat"
    if head.startswith(b"TDSm"):
        return "tdms"
    if is_uff(head):
        return "uff"
    if head.lstrip(b"\xef\xbb\xbf").startswith(b"LabVIEW Measurement"):
        return "lvm"
    return "twincat" if is_twincat(decoded_head(path)[1]) else "text"


_READERS = {
    "mat": read_mat,
    "tdms": read_tdms,
    "uff": read_uff,
    "lvm": read_lvm,
    "twincat": read_twincat,
    "text": read_text,
}


def read_table(path: Path | str) -> Table:
    """The channels of a log of any format. Raises LogError."""
    path = Path(path)
    return _READERS[file_format(path)](path)


def is_frequency_response(path: Path | str) -> bool:
    """Whether a file holds a frequency response instead of signals over time. Raises LogError as `file_format`."""
    path = Path(path)
    form = file_format(path)
    if form == "uff":
        return any(data["func_type"] == FREQUENCY_RESPONSE for data in sets_58(path))
    return form == "text" and is_response(layout(path).names)


def read_frequency_response(path: Path | str) -> MeasuredResponse:
    """The frequency response in a text or universal file. Raises LogError."""
    path = Path(path)
    return read_response_uff(path) if file_format(path) == "uff" else read_response_text(path)
