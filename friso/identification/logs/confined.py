"""Binary logs, read in a process of their own: a damaged or hostile file may crash or exhaust the library of its
format, which is then an error of that file and of nothing else."""

from __future__ import annotations

import io
import os
import pickle
import signal
import subprocess
import sys
from functools import lru_cache
from pathlib import Path
from threading import Timer
from typing import Any

from friso.errors import LogError
from friso.identification.logs import binary
from friso.identification.logs.settings import LogSettings
from friso.platform.system import LIMITS_MEMORY

CPU_SIGNAL = getattr(signal, "SIGXCPU", 0)
"""What ends a process that has taken a processor's time for too long, where the system counts that."""


def content(kind: str, path: Path) -> dict[str, Any]:
    """Read what a file of a `kind` of `friso.identification.logs.binary` holds.

    Raises LogError where it cannot be read within bounds of time, and of memory where the system keeps such
    (`LIMITS_MEMORY`).
    """
    status = path.stat()
    return _content(kind, path.resolve(), status.st_size, status.st_mtime_ns)


@lru_cache(maxsize=1)  # a file is asked for its kind first, and read then
def _content(kind: str, path: Path, size: int, changed: int) -> dict[str, Any]:
    """Read a file that has not changed since it was last asked for only once."""
    settings = LogSettings.current()
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
    except Exception:  # whatever is wrong with what came, it is not what the reader writes
        raise broken(kind, "it makes the library crash", path) from None
    if read is None:
        raise broken(kind, message, path)
    return read


def _answer(command: list[str], seconds: float, most: int) -> bytes | None:
    """Return what a program says, of more than `most` bytes the first.

    None where it took more of a processor's time than it may. Raises TimeoutError where it takes longer.
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
    """A reader of plain types and NumPy arrays that refuses anything else."""

    def find_class(self, module: str, name: str) -> Any:
        """Return what an array of numbers is made of, and nothing else."""
        if module.partition(".")[0] == "numpy" and name in ("ndarray", "dtype", "_reconstruct", "_frombuffer"):
            return super().find_class(module, name)
        raise pickle.UnpicklingError(f"{module}.{name}")


def broken(kind: str, why: str, path: Path) -> LogError:
    """The error for a file that cannot be read."""
    return LogError("log", f"a {kind} file that cannot be read ({why})", f"a complete {kind} file", "", str(path))
