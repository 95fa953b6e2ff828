"""Has processes of its own compile what is missing in the cache, as many at a time as there are cores.

They are processes of their own so that what runs is always what is kept, loaded from its file, and so that a command
which finds everything compiled loads neither SymPy nor a compiler's front end.
"""

from __future__ import annotations

import atexit
import os
import pickle
import subprocess
import sys
import tempfile
from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from threading import Lock

from filelock import Timeout

from friso.engine.cache import CodeRequest, Compiled, cache_folder, logger
from friso.engine.prune import prune
from friso.system import usable_cores

_PATIENCE = 0.1
"""How long [s] another process that builds the same is waited for before it is looked whether there is still need."""


def built_entries(requests: Iterable[CodeRequest]) -> list[Compiled]:
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
        self._busy: list[_Builder] = []
        self._given_up = False

    def finish(self) -> None:
        """Meet all of them. Whatever ends it early ends the builders too."""
        cores = min(self._count, usable_cores())
        with ThreadPoolExecutor(cores) as pool:
            try:
                for job in as_completed([pool.submit(self._meet) for _ in range(cores)]):
                    job.result()
            except BaseException:
                self._given_up = True  # before any is ended: one that starts now ends itself
                for builder in list(self._busy):
                    builder.kill()
                raise

    def _meet(self) -> None:
        while not self._given_up:
            try:
                number, request = self._waiting.popleft()
            except IndexError:
                return
            with self._turn(request):
                if request.entry() is None:  # no other process has built it meanwhile
                    place = f"{number} of {self._count}"
                    logger.warning("compiling, once on this machine, %s: %s", place, request.title)
                    request.answer(self._built(request))

    @contextmanager
    def _turn(self, request: CodeRequest) -> Iterator[None]:
        """Hold the lock of what is requested, once no other process does. Raises RuntimeError where the work is given
        up meanwhile."""
        lock = request.lock()
        while not lock.is_locked:
            self._go_on()
            with suppress(Timeout):
                lock.acquire(timeout=_PATIENCE)
        try:
            yield
        finally:
            lock.release()

    def _go_on(self) -> None:
        if self._given_up:
            raise RuntimeError("the kernels were not compiled: interrupted")

    def _built(self, request: CodeRequest) -> str:
        """Build what is requested, by a builder that waits where there is one; the name of the entry."""
        surroundings = _Surroundings(os.getpid(), cache_folder(), tuple(filter(None, sys.path)), request.plug_ins)
        while True:
            waiting = _taken(surroundings)
            builder = waiting or _Builder(surroundings)
            self._busy.append(builder)
            if self._given_up:
                builder.kill()
            name = builder.build(request)
            self._busy.remove(builder)
            if name:
                _waiting.append(builder)
                return name
            message = builder.end()
            self._go_on()
            if waiting is None:  # one that has waited may have ended meanwhile
                raise RuntimeError(f"the kernel could not be compiled:\n{message}")


@dataclass(frozen=True)
class _Surroundings:
    """What a builder is started with and what it has loaded: by which process (one that was forked has none of its
    own), for which cache, where modules are, which plug-ins."""

    process: int
    folder: Path
    paths: tuple[str, ...]
    plug_ins: str


class _Builder:
    """A process that builds what it is sent (`friso.engine.builder`). It waits for more when it is done, and ends by
    itself if nothing comes for a while, or with the process that started it."""

    def __init__(self, surroundings: _Surroundings) -> None:
        self.surroundings = surroundings
        self._messages = tempfile.TemporaryFile()  # noqa: SIM115, open as long as the process lives
        environ = {**os.environ, "PYTHONPATH": os.pathsep.join(surroundings.paths)}
        command = [sys.executable, "-P", "-m", "friso.engine.builder", str(surroundings.folder)]
        pipe = subprocess.PIPE
        self._process = subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=self._messages, env=environ)

    def build(self, request: CodeRequest) -> str:
        """Build what is requested; the name of its entry, "" where the process ended instead."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        with suppress(OSError):  # nobody reads it any more: the process ended, and says why
            pickle.dump((request.builder, request.task), self._process.stdin)
            self._process.stdin.flush()
        return self._process.stdout.readline().decode("ascii").strip()

    def end(self) -> str:
        """End the process; what it has said on standard error."""
        with suppress(OSError):
            self._process.communicate()
        self._messages.seek(0)
        message = self._messages.read().decode(errors="replace")
        self._messages.close()
        return message

    def kill(self) -> None:
        """End the process, whatever it is at."""
        self._process.kill()


_waiting: list[_Builder] = []


def _taken(surroundings: _Surroundings) -> _Builder | None:
    """A builder that waits in these surroundings, and no longer does; None if there is none."""
    with _taking:
        for builder in _waiting:
            if builder.surroundings == surroundings:
                _waiting.remove(builder)
                return builder
    return None


_taking = Lock()


@atexit.register
def _dismiss() -> None:
    """End the builders of this process that wait."""
    for builder in _waiting:
        if builder.surroundings.process == os.getpid():
            builder.kill()
            builder.end()
