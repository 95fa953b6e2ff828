"""Read binary logs in a separate process, in which a damaged or hostile file can crash only its own reader.

Some formats need optional libraries.
"""

from __future__ import annotations

import io
import math
import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path
from threading import Timer
from typing import Any

from friso.errors import LogError
from friso.identification.logs import binary
from friso.identification.logs.channel import Channel, ChannelTable
from friso.identification.logs.settings import settings
from friso.platform.installed import install, is_installed
from friso.platform.system import LIMITS_MEMORY

CPU_SIGNAL = getattr(signal, "SIGXCPU", 0)
"""Signal that ends a process that has used too much processor time, on systems that count it."""


def content(kind: str, path: Path) -> dict[str, Any]:
    """Read a binary log in a separate process; `kind` names a reader of `binary`.

    Raises LogError for a file that cannot be read within bounds of time, and of memory where the system has such limits
    (`LIMITS_MEMORY`).
    """
    status = path.stat()
    return _content(kind, path.resolve(), status.st_size, status.st_mtime_ns)


@lru_cache(maxsize=1)  # recognising a format and reading the file ask for one content
def _content(kind: str, path: Path, size: int, changed: int) -> dict[str, Any]:
    """Read a binary log in a separate process; the result is cached until the file changes.

    `size` [B] and the time of the last change, `changed`, identify its state. Raises LogError for a file that cannot be
    read.
    """
    memory = settings.memory_of_reading + settings.memory_per_byte * size if LIMITS_MEMORY else 0
    seconds = settings.time_of_reading + size / settings.speed_of_reading
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
