"""Unpack files that are packed by gzip, bzip2 or xz, or alone in a ZIP archive."""

from __future__ import annotations

import bz2
import gzip
import lzma
import zipfile
import zlib
from contextlib import suppress
from functools import lru_cache
from pathlib import Path, PurePosixPath
from shutil import rmtree
from tempfile import mkdtemp
from typing import IO, Any
from weakref import finalize

from friso.errors import LogError
from friso.identification.logs.settings import settings

_OPENERS = {b"\x1f\x8b": gzip.open, b"BZh": bz2.open, b"\xfd7zXZ\x00": lzma.open}
"""First bytes of packed files, with what opens them."""
ZIP = b"PK\x03\x04"
"""First bytes of a ZIP archive."""


class UnpackedFile:
    """A file unpacked into a folder of its own, which lasts as long as this object."""

    def __init__(self, name: str) -> None:
        """Make the folder for a file of a name."""
        folder = mkdtemp(prefix="friso-")
        finalize(self, rmtree, folder, ignore_errors=True)
        self.path = Path(folder) / (name or "log")


def members(path: Path) -> list[str]:
    """Return the names of the files in a ZIP archive; [] for another file."""
    with suppress(OSError, zipfile.BadZipFile, ValueError, NotImplementedError):
        if _start(path).startswith(ZIP):
            with zipfile.ZipFile(path) as archive:
                return [name for name in archive.namelist() if not name.endswith("/")]
    return []


def _start(path: Path) -> bytes:
    """Return the first six bytes of a file."""
    with path.open("rb") as file:
        return file.read(6)


def unpacked(path: Path) -> UnpackedFile | None:
    """Unpack a packed file; None for a file that is not packed.

    Archives that are workbooks or arrays are no packed files. Raises LogError for a damaged file, for one that grows
    too much, and for an archive of several files.
    """
    try:
        start = _start(path) if path.is_file() else b""
    except (OSError, ValueError):  # the reading of the file says why
        return None
    if not start.startswith((*_OPENERS, ZIP)):
        return None
    status = path.stat()
    return _unpacked(path.resolve(), start, status.st_size, status.st_mtime_ns)


@lru_cache(maxsize=2)  # recognising a format and reading the file unpack one file
def _unpacked(path: Path, start: bytes, size: int, changed: int) -> UnpackedFile | None:
    """Unpack a file that begins with some bytes; `size` and the time of the last change identify its state."""
    names = members(path)
    if start.startswith(ZIP) and (is_workbook(names) or is_of_arrays(names)):
        return None
    if start.startswith(ZIP) and len(names) != 1:
        actual = f"a ZIP archive of {len(names)} files"
        raise LogError("log", actual, "an archive of one file, or the log unpacked from it", "", str(path))
    most = min(settings.bytes_of_a_log, settings.bytes_unpacked + settings.bytes_unpacked_per_byte * size)
    kept = UnpackedFile(PurePosixPath(names[0].replace("\\", "/")).name if names else path.stem)
    try:
        if names:
            with zipfile.ZipFile(path) as archive, archive.open(names[0]) as packed:
                written = _copied(packed, kept.path, most)
        else:
            opener = next(_OPENERS[mark] for mark in _OPENERS if start.startswith(mark))
            with opener(path, "rb") as packed:
                written = _copied(packed, kept.path, most)
    except (OSError, EOFError, lzma.LZMAError, zlib.error, zipfile.BadZipFile, RuntimeError, ValueError) as error:
        why = str(error) or type(error).__name__
        raise LogError(
            "log", f"a packed file that cannot be unpacked ({why})", "a complete file", "", str(path)
        ) from None
    if written > most:
        actual = f"a packed file of {size / 1e6:.3g} MB that holds more than {most / 1e6:.3g} MB"
        raise LogError("log", actual, "the log unpacked from it", "", str(path))
    return kept


def is_workbook(names: list[str]) -> bool:
    """Tell whether the files in an archive make it a workbook, of Excel or OpenDocument."""
    return "xl/workbook.xml" in names or {"mimetype", "content.xml"} <= {*names}


def is_of_arrays(names: list[str]) -> bool:
    """Tell whether all files in an archive are arrays of NumPy."""
    return bool(names) and all(name.endswith(".npy") for name in names)


def _copied(packed: IO[Any], path: Path, most: int) -> int:
    """Copy at most a little over `most` bytes into a file; return how many."""
    written = 0
    with path.open("wb") as file:
        while written <= most and (block := packed.read(1 << 20)):
            written += file.write(block)
    return written
