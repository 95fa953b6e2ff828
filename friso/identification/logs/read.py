"""Read files of logs: unpacked, within limits, by their format.

The content of a file tells its format, not its name. Every format gives a table of channels. `FORMATS` is the registry
of formats; some need optional libraries.

Files may be packed by gzip, bzip2 or xz, or be alone in a ZIP archive.

Binary logs are read in a separate process, in which a damaged or hostile file can crash only its own reader.

A sample of a large text is its beginning, middle and end, in a file of their own.
"""

from __future__ import annotations

import bz2
import gzip
import io
import lzma
import math
import os
import pickle
import signal
import subprocess
import sys
import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from pathlib import Path, PurePosixPath
from shutil import rmtree
from tempfile import mkdtemp
from threading import Timer
from typing import IO, Any
from weakref import finalize

import numpy as np

from friso.errors import InputError, LogError
from friso.identification.logs import binary
from friso.identification.logs.checks import absent, dropouts
from friso.identification.logs.log import Channel, ChannelTable
from friso.identification.logs.measured_response import MeasuredResponse
from friso.identification.logs.roles import role_of
from friso.identification.logs.settings import settings
from friso.identification.logs.sniff import decoded_head
from friso.platform.installed import install, is_installed
from friso.platform.system import LIMITS_MEMORY, cause_of, once_free
from friso.quantities import percent
from friso.registry import Registry

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


BYTES_OF_A_LOG = 2 << 30  # [B]
"""Largest file that is read, because all its channels are in memory at once."""


@lru_cache(maxsize=2)  # recognising a format and reading the file unpack one file
def _unpacked(path: Path, start: bytes, size: int, changed: int) -> UnpackedFile | None:
    """Unpack a file that begins with some bytes; `size` and the time of the last change identify its state."""
    names = members(path)
    if start.startswith(ZIP) and (is_workbook(names) or is_of_arrays(names)):
        return None
    if start.startswith(ZIP) and len(names) != 1:
        actual = f"a ZIP archive of {len(names)} files"
        raise LogError("log", actual, "an archive of one file, or the log unpacked from it", "", str(path))
    most = min(BYTES_OF_A_LOG, settings.bytes_unpacked + settings.bytes_unpacked_per_byte * size)
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


CPU_SIGNAL = getattr(signal, "SIGXCPU", 0)
"""Signal that ends a process that has used too much processor time, on systems that count it."""


def content(kind: str, path: Path) -> dict[str, Any]:
    """Read a binary log in a separate process; `kind` names a reader of `binary`.

    Raises LogError for a file that cannot be read within bounds of time, and of memory where the system has such limits
    (`LIMITS_MEMORY`).
    """
    status = path.stat()
    return _content(kind, path.resolve(), status.st_size, status.st_mtime_ns)


MEMORY_PER_BYTE = 12
"""Memory limit per byte of the file, because compressed files grow."""

SPEED_OF_READING = 5e6  # [B/s]
"""Reading speed from which the time limit follows. Sound files are read much faster."""


@lru_cache(maxsize=1)  # recognising a format and reading the file ask for one content
def _content(kind: str, path: Path, size: int, changed: int) -> dict[str, Any]:
    """Read a binary log in a separate process; the result is cached until the file changes.

    `size` [B] and the time of the last change, `changed`, identify its state. Raises LogError for a file that cannot be
    read.
    """
    memory = settings.memory_of_reading + MEMORY_PER_BYTE * size if LIMITS_MEMORY else 0
    seconds = settings.time_of_reading + size / SPEED_OF_READING
    patience = settings.patience_with_a_busy_machine * seconds
    command = [sys.executable, "-P", binary.__file__, kind, str(path), *map(str, (memory, seconds, 2 * patience))]
    try:
        answer = _answer(command, patience, binary.most_bytes(size))
    except TimeoutError:
        why = f"it was not read within {patience:.0f} s: the machine is busy, or the disk slow"
        raise broken(kind, why, path) from None
    if answer is None:
        raise broken(kind, f"reading it takes more than {seconds:.0f} s", path)
    try:
        read, message = _PlainUnpickler(io.BytesIO(answer)).load()
    except Exception:  # any failure of unpickling means that the output is not the reader's
        raise broken(kind, "it makes the library crash", path) from None
    if read is None:
        raise broken(kind, message, path)
    return read


def _answer(command: list[str], seconds: float, most: int) -> bytes | None:
    """Return the first `most` + 1 bytes of a program's output.

    Returns None if it exceeded its processor time. Raises TimeoutError if it takes longer than `seconds`.
    """
    environ = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}  # each of its threads reserves memory
    pipe, late = subprocess.PIPE, []
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=subprocess.DEVNULL, env=environ) as process:
        timer = Timer(seconds, lambda: (late.append(True), process.kill()))
        timer.start()
        try:
            assert process.stdout is not None
            answer = process.stdout.read(most + 1)
            if not answer:
                process.wait()
        finally:
            timer.cancel()
            process.kill()
    if late:
        raise TimeoutError
    return None if process.returncode == -CPU_SIGNAL < 0 else answer


class _PlainUnpickler(pickle.Unpickler):
    """Unpickler of plain types and NumPy arrays that refuses everything else."""

    def find_class(self, module: str, name: str) -> Any:
        """Return a class or function of which arrays consist, and refuse everything else."""
        if module.partition(".")[0] == "numpy" and name in ("ndarray", "dtype", "_reconstruct", "_frombuffer"):
            return super().find_class(module, name)
        raise pickle.UnpicklingError(f"{module}.{name}")


def broken(kind: str, why: str, path: Path) -> LogError:
    """Return the error for a file that cannot be read."""
    return LogError("log", f"a {kind} file that cannot be read ({why})", f"a complete {kind} file", "", str(path))


def content_by(library: str, kind: str, path: Path) -> dict[str, Any]:
    """Read the contents of a log in the format `kind`, which needs an optional library.

    Raises LogError, which says how to install a missing library.
    """
    if not is_installed(library):
        actual = f"a {kind} file, and the library {library} is not installed"
        raise LogError("log", actual, "the library", install(kind.lower()), str(path))
    return content(kind, path)


def cut_short(channels: Iterable[Channel], stated: Iterable[float | None]) -> list[str]:
    """Write a line for each channel that has fewer samples than the (truncated) file states.

    `stated` has the stated number for each channel, or None. Returns [] if no channel is shorter.
    """
    return [
        f"{channel.name} ends early: {channel.values.size} of {count:.15g} samples"
        for channel, count in zip(channels, stated, strict=True)
        if count is not None and channel.values.size < count < math.inf
    ]


def filled_table(kind: str, channels: list[Channel], notes: list[str], path: Path) -> ChannelTable:
    """Make a table of the channels with samples.

    Raises LogError if no channel has samples.
    """
    filled = tuple(channel for channel in channels if channel.values.size)
    if not filled:
        raise LogError("log", f"a {kind} file without numbers", "a file with channels", "", str(path))
    return ChannelTable(filled, {}, (f"format: {kind}", f"{len(filled)} channels", *notes))


@dataclass(frozen=True)
class TextSample:
    """Lines of a text in a `file` of their own.

    `growth` is the ratio of the sizes of text and sample; `later` counts the lines that do not stand at the beginning.
    """

    file: UnpackedFile
    growth: float
    later: int


BYTES_OF_A_PART = 1 << 19  # [B]
"""Size of the beginning, the middle and the end of a text of which a sample is read. Smaller texts are read as a
whole: that takes a second."""


def sample_of(path: Path) -> TextSample | None:
    """Take whole lines from the beginning, the middle and the end of a text.

    Returns None for a text that is hardly larger than its sample, or whose lines end with another sign than a line
    feed. Raises LogError for what is no text.
    """
    size, part = path.stat().st_size, BYTES_OF_A_PART
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


@dataclass(frozen=True)
class FileHead:
    """Data from which the format of a file is recognised: its path, and its first 520 bytes."""

    path: Path
    start: bytes

    @cached_property
    def lines(self) -> list[str]:
        """Return the first lines of the file; [] for one that is no text."""
        try:
            return decoded_head(self.path)[1]
        except LogError:
            return []


@dataclass(frozen=True)
class LogFormat:
    """A format of logs: its `title`, how it is recognised, and the reader of its channels.

    Formats are tried by rank: 0 for those recognised by their first bytes, 1 by their first lines, 2 for any text.
    `units` tells whether files can contain units; `times` whether channels come with their instants, so that no time
    column is needed. `of_lines` tells whether any lines of a file can be read without the others, below its first ones.
    `holds_response` tells whether a file contains a frequency response instead of signals over time,
    which `read_response` reads. Readers raise LogError.
    """

    title: str
    recognise: Callable[[FileHead], bool]
    read: Callable[[Path], ChannelTable]
    rank: int = 0
    units: bool = True
    times: bool = True
    of_lines: bool = False
    holds_response: Callable[[Path], bool] = lambda path: False
    read_response: Callable[[Path], MeasuredResponse] | None = None


FORMATS: Registry[LogFormat] = Registry("friso.identification.logs.formats", "FORMAT")
"""All log formats, in the table of `friso/identification/logs/formats/`."""


_SAVED = "the same saved as one of the formats that friso reads"
_OTHERS = {
    b"MDF ": ("a measurement in ASAM MDF (.mf4, .dat)", _SAVED),
    b"#ROSBAG": ("a bag of ROS", "one of its topics saved as CSV"),
    b"SQLite format 3": ("a data base of SQLite, as a bag of ROS 2 is", "one of its topics saved as CSV"),
}
"""First bytes of files that are no logs, with their kind and the advice on what to use instead."""


@contextmanager
def _plain(path: Path | str) -> Iterator[Path]:
    """Yield the file that is packed in another one, or the file itself; errors name the latter."""
    path = Path(path)
    kept = unpacked(path)
    if kept is None:
        yield path
        return
    try:
        yield kept.path
    except InputError as error:
        raise error.found_in(str(path)) from None


def file_format(path: Path) -> str:
    """Recognise the format of a file, packed or not, by its content, and return its name in `FORMATS`.

    Raises LogError for a path that is missing or a folder, and for a file that is empty, too large, or of no known
    format.
    """
    with _plain(path) as plain:
        return _plain_format(plain)


def _plain_format(path: Path) -> str:
    """Recognise the format of a file that is not packed.

    Raises LogError as `file_format` does.
    """
    try:
        if path.is_dir():
            raise LogError("log", "a folder", "a file", "friso identify log.csv", str(path))
        if path.exists() and not path.is_file():  # reading a device or a pipe may never end, or never begin
            raise LogError("log", "a device, pipe or socket", "a file", "friso identify log.csv", str(path))
        size = path.stat().st_size
        with once_free(partial(path.open, "rb")) as file:
            head = FileHead(path, file.read(520))
    except LogError:
        raise
    except (OSError, ValueError) as error:  # the name is too long for any file
        reason = cause_of(error) if isinstance(error, OSError) else "no name of a file"
        raise LogError("log", f"a file that cannot be opened ({reason})", "a log", "", str(path)) from None
    if size == 0:
        raise LogError("log", "an empty file (0 bytes)", "a heading and rows of numbers", "", str(path))
    if size > BYTES_OF_A_LOG:
        expected = f"at most {BYTES_OF_A_LOG / 2**30:.3g} GiB: cut the log, or save only the channels needed"
        raise LogError("log", f"a file of {size / 2**30:.3g} GiB", expected, "", str(path))
    for name in sorted(FORMATS, key=lambda name: FORMATS[name].rank):
        if FORMATS[name].recognise(head):
            return name
    titles = ", ".join(FORMATS[name].title for name in FORMATS)
    for mark, (what, remedy) in _OTHERS.items():
        if head.start.startswith(mark):
            raise LogError("log", what, f"{remedy} ({titles})", "", str(path))
    raise LogError("log", f"{size} bytes that are neither text nor a known format", titles, "", str(path))


def read_table(path: Path | str) -> ChannelTable:
    """Read the channels of a log of any format.

    Raises LogError for a file of unknown format, or one that its format cannot read.
    """
    return read_file(path).table


SAMPLES_OF_A_LOOK = 100_000
"""Number of first samples from which `friso logs` recognises the kind of experiment."""


@dataclass(frozen=True)
class ReadFile:
    """A file that was read: its format and channels.

    Of a large text the channels are a sample; `growth` is then the ratio of the file's size to that of the sample, and
    `begins` the number of samples that follow each other from the beginning on. Both are None if the whole file was
    read.
    """

    path: Path
    form: LogFormat
    table: ChannelTable
    growth: float | None = None
    begins: int | None = None

    @property
    def looked_at(self) -> int:
        """Return the number of samples from which the kind of experiment is recognised without waiting."""
        return SAMPLES_OF_A_LOOK if self.begins is None else min(self.begins, SAMPLES_OF_A_LOOK)

    @property
    def sampled(self) -> str:
        """Say which part of the file was looked at; "" for all of it."""
        if max((channel.values.size for channel in self.table.channels), default=0) <= self.looked_at:
            return ""
        parts = (
            "" if self.growth is None else f"{percent(1 / self.growth)} of the file were read: beginning, middle, end; "
        )
        return f"{parts}kind and notes rest on the first {self.looked_at} samples; friso identify reads the whole file"

    def beginning(self) -> ReadFile:
        """Return the file with the samples that are looked at."""
        most = slice(self.looked_at)
        cut = [
            replace(c, values=c.values[most], time=c.time if c.time is None else c.time[most])
            for c in self.table.channels
        ]
        return replace(self, table=replace(self.table, channels=tuple(cut)))


def read_file(path: Path | str) -> ReadFile:
    """Read the channels of a log of any format, with the format.

    Raises LogError as `read_table` does.
    """
    with _plain(path) as plain:
        form = FORMATS[_plain_format(plain)]
        return ReadFile(Path(path), form, _without_absent(form.read(plain)))


def glance(path: Path) -> ReadFile:
    """Read the channels of a log, of a large text only a sample.

    A sample that cannot be read is no reason to refuse the file: it is then read as a whole. Raises LogError as
    `read_table` does.
    """
    with _plain(path) as plain:
        form = FORMATS[_plain_format(plain)]
        if form.of_lines and (sample := sample_of(plain)) is not None:
            with suppress(LogError):
                table = _without_absent(form.read(sample.file.path))
                rows = max(channel.values.size for channel in table.channels)
                return ReadFile(path, form, table, sample.growth, rows - sample.later)
        return ReadFile(path, form, _without_absent(form.read(plain)))


def _without_absent(table: ChannelTable) -> ChannelTable:
    """Return a table without numbers that stand for no value, and without dropouts to 0, which count as lost."""
    channels, notes = list[Channel](), list[str]()
    for channel in table.channels:
        values = channel.values
        if (role_of(channel.name, channel.unit) or ("",))[0] != "time":
            found = {"of 0 between others": dropouts(values)}
            if (number := absent(values)) is not None:
                found[f"of {number:.10g}"] = values == number
            for what, lost in found.items():
                if lost.any():
                    values = np.where(lost, np.nan, values)
                    notes.append(f"{channel.name}: {np.count_nonzero(lost)} samples {what} count as lost")
        channels.append(replace(channel, values=values))
    return replace(table, channels=tuple(channels), warnings=(*table.warnings, *notes)) if notes else table


def is_frequency_response(path: Path | str) -> bool:
    """Tell whether a file has a frequency response instead of signals over time.

    Raises LogError for a file that cannot be opened or has no known format.
    """
    with _plain(path) as plain:
        return FORMATS[_plain_format(plain)].holds_response(plain)


def read_frequency_response(path: Path | str) -> MeasuredResponse:
    """Read the frequency response in a file.

    Raises LogError for a file that holds none.
    """
    with _plain(path) as plain:
        form = FORMATS[_plain_format(plain)]
        if form.read_response is None:
            expected = "a format that holds frequency responses"
            raise LogError("log", f"a file of format {form.title}", expected, "", str(path))
        return form.read_response(plain)
