"""Read a file by its content, not by its name; every format gives a table of channels."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from friso.errors import InputError, LogError
from friso.identification.logs.channel import ChannelTable
from friso.identification.logs.format import FORMATS, FileHead, LogFormat
from friso.identification.logs.measured_response import MeasuredResponse
from friso.identification.logs.packed import unpacked
from friso.identification.logs.sample import sample_of
from friso.identification.logs.settings import settings
from friso.platform.system import cause_of, once_free
from friso.quantities import percent

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
        return settings.samples_of_a_look if self.begins is None else min(self.begins, settings.samples_of_a_look)

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
    return ReadFile(Path(path), FORMATS[file_format(Path(path))], read_table(path))


def glance(path: Path) -> ReadFile:
    """Read the channels of a log, of a large text only a sample.

    A sample that cannot be read is no reason to refuse the file: it is then read as a whole. Raises LogError as
    `read_table` does.
    """
    with _plain(path) as plain:
        form = FORMATS[_plain_format(plain)]
        if form.of_lines and (sample := sample_of(plain)) is not None:
            with suppress(LogError):
                table = form.read(sample.file.path)
                rows = max(channel.values.size for channel in table.channels)
                return ReadFile(path, form, table, sample.growth, rows - sample.later)
        return ReadFile(path, form, form.read(plain))


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
