"""Read a file by its content, not by its name; every format gives a table of channels."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from friso.errors import InputError, LogError
from friso.identification.logs.channel import ChannelTable
from friso.identification.logs.format import FORMATS, FileHead
from friso.identification.logs.measured_response import MeasuredResponse
from friso.identification.logs.packed import unpacked
from friso.identification.logs.settings import settings
from friso.platform.system import cause_of, once_free

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
    if size > settings.bytes_of_a_log:
        expected = f"at most {settings.bytes_of_a_log / 2**30:.3g} GiB: cut the log, or save only the channels needed"
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
    with _plain(path) as plain:
        return FORMATS[_plain_format(plain)].read(plain)


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
