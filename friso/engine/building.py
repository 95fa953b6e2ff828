"""Has processes of its own compile what is missing in the cache, as many at a time as there are cores.

They are processes of their own so that what runs is always what is kept, loaded from its file, and so that a command
which finds everything compiled loads neither SymPy nor a compiler's front end.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import tempfile
from collections import deque
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, suppress
from types import TracebackType

from friso.engine.cache import CodeRequest, Compiled, cache_folder, logger
from friso.engine.prune import prune
from friso.system import usable_cores


def entries(requests: Iterable[CodeRequest]) -> list[Compiled]:
    """The entries of what is requested; what is missing in the cache is built, and what is said about it logged.
    Raises RuntimeError with the builder's message if that fails, OSError where the cache cannot be written."""
    requests = list(requests)
    compiled = {request: request.entry() for request in requests}
    if missing := [request for request, entry in compiled.items() if entry is None]:
        _Work(missing).finish()
        prune(cache_folder())
        compiled |= {request: request.entry() for request in missing}
    if dropped := [request.title for request, entry in compiled.items() if entry is None]:
        raise RuntimeError(f"what was compiled is not in {cache_folder()}: {', '.join(dropped)}")
    return [entry for request in requests if (entry := compiled[request]) is not None]


class _Work:
    """Requests that are still to be met, taken by builders one by one."""

    def __init__(self, requests: list[CodeRequest]) -> None:
        self._count, self._waiting = len(requests), deque(enumerate(requests, 1))
        self._builders: list[_Builder] = []

    def finish(self) -> None:
        """Meet all of them. Whatever ends it early ends the builders too."""
        cores = min(self._count, usable_cores())
        with ThreadPoolExecutor(cores) as pool:
            try:
                for job in [pool.submit(self._meet) for _ in range(cores)]:
                    job.result()
            except BaseException:
                self._waiting.clear()
                for builder in list(self._builders):
                    builder.kill()
                raise

    def _meet(self) -> None:
        with _Builder() as builder:
            self._builders.append(builder)
            while True:
                try:
                    number, request = self._waiting.popleft()
                except IndexError:
                    return
                with request.lock():
                    if request.entry() is None:  # no other process has built it meanwhile
                        place = f"{number} of {self._count}"
                        logger.warning("compiling, once on this machine, %s: %s", place, request.title)
                        request.answer(builder.build(request))


class _Builder:
    """A process that builds what it is sent (`friso.engine.builder`); it is started when it is needed."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._open = ExitStack()

    def __enter__(self) -> _Builder:
        self._messages = self._open.enter_context(tempfile.TemporaryFile())
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if self._process is not None:
            if error is not None:
                self._process.kill()
            self._process.communicate()
        self._open.close()

    def build(self, request: CodeRequest) -> str:
        """Build what is requested; the name of its entry."""
        process = self._process = self._process or self._started()
        assert process.stdin is not None
        assert process.stdout is not None
        with suppress(BrokenPipeError):  # it says why
            pickle.dump((request.builder, request.task), process.stdin)
            process.stdin.flush()
        name = process.stdout.readline().decode("ascii").strip()
        if not name:
            process.wait()
            self._messages.seek(0)
            message = self._messages.read().decode(errors="replace")
            raise RuntimeError(f"the kernel could not be compiled:\n{message}")
        return name

    def kill(self) -> None:
        """End the process, whatever it is at."""
        if self._process is not None:
            self._process.kill()

    def _started(self) -> subprocess.Popen[bytes]:
        environ = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
        command = [sys.executable, "-P", "-m", "friso.engine.builder", str(cache_folder())]
        pipe = subprocess.PIPE
        return subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=self._messages, env=environ)
