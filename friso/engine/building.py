"""Compile code that is missing in the cache, in separate processes, one per core at a time.

With separate processes, the running code is always loaded from the cache. A command that finds everything compiled
loads neither SymPy nor a compiler's front end.
"""

from __future__ import annotations

import atexit
import os
import sys
from collections.abc import Iterable
from concurrent.futures import FIRST_EXCEPTION, Future, wait
from dataclasses import dataclass
from pathlib import Path
from threading import Lock, Semaphore, Thread

from friso.engine.cache import CodeRequest, Compiled, cache_folder, leave_cache, logger, prune
from friso.engine.side_by_side import ASKER, WAITING_INTERVAL, go_on
from friso.platform.helper_process import HelperProcess
from friso.platform.system import usable_cores
from friso.progress import WORK_CLOCK


def built_entries(requests: Iterable[CodeRequest]) -> list[Compiled]:
    """Return the requested cache entries, and build missing ones, with messages in the log.

    Raises RuntimeError with the builder's message if a build fails, and OSError if no folder can be written. Raises
    Overtaken if nobody waits for the entries any more; builds in progress are then finished for later requests.
    """
    requests, folder = list(requests), cache_folder()
    compiled = {request: request.entry() for request in requests}
    if missing := [request for request, entry in compiled.items() if entry is None]:
        try:
            with WORK_CLOCK.stands():
                _work().finish(missing)
        except OSError as error:
            leave_cache(folder, error)
            return built_entries(requests)
        prune(cache_folder())
        compiled |= {request: request.entry() for request in missing}
    if dropped := [request.title for request, entry in compiled.items() if entry is None]:
        raise RuntimeError(f"what was compiled is not in {cache_folder()}: {', '.join(dropped)}")
    return [entry for request in requests if (entry := compiled[request]) is not None]


class _Work:
    """Compilations in progress in this process, as many at a time as there are cores.

    Each request is compiled once for all threads that wait for it. What has begun goes on, whoever still waits.
    """

    def __init__(self) -> None:
        self._cores, self._turn = Semaphore(usable_cores()), Lock()
        self._jobs: dict[CodeRequest, _Job] = {}

    def finish(self, requests: list[CodeRequest]) -> None:
        """Fulfil all requests, and wait until they are. Raises the error of the first that fails."""
        requests = list(dict.fromkeys(requests))
        _wait([self._begun(request, f"{number} of {len(requests)}") for number, request in enumerate(requests, 1)])

    def _begun(self, request: CodeRequest, place: str) -> _Job:
        """Return the job of a request, started if necessary, at a `place` in the queue, in words."""
        with self._turn:
            if (job := self._jobs.get(request)) is None:
                job = self._jobs[request] = _Job(request, place, self._cores)
                Thread(target=self._do, args=[job], daemon=True).start()  # a daemon does not keep the process alive
            return job

    def _do(self, job: _Job) -> None:
        """Build one job in a process, and pass its result to all waiting threads."""
        error: BaseException | None = None
        try:
            job.meet()
        except BaseException as raised:
            error = raised
        with self._turn:
            del self._jobs[job.request]
        if error is None:
            job.met.set_result(None)
        else:
            job.met.set_exception(error)


_works: dict[int, _Work] = {}


def _work() -> _Work:
    """Return the builds of this process; a forked process has its own."""
    return _works.get(os.getpid()) or _works.setdefault(os.getpid(), _Work())


def _wait(jobs: list[_Job]) -> None:
    """Wait until all jobs are done. Raises the error of the first job that failed."""
    waiting = {job.met for job in jobs}
    while waiting:
        go_on()
        done, waiting = wait(waiting, WAITING_INTERVAL, FIRST_EXCEPTION)
        for job in jobs:
            job.announce()
        for met in done:
            met.result()


class _Job:
    """A request to compile an entry of the cache, in progress.

    `place` is its rank in the queue; `builds` is true once it is compiled.
    """

    def __init__(self, request: CodeRequest, place: str, cores: Semaphore) -> None:
        self.request, self.met, self.builds = request, Future[None](), False
        self._announced: set[object] = set()
        self._place, self._cores = place, cores

    def announce(self) -> None:
        """Tell the asker in whose thread this is called, once, that the job is being built.

        The message goes to the log. Nothing is said before building begins.
        """
        asker = ASKER.get()
        if self.builds and asker not in self._announced:
            self._announced.add(asker)
            words = (self._place, self.request.title)
            logger.warning("compiling, once on this machine, %s: %s", *words, extra={"passing": True})

    def meet(self) -> None:
        """Fulfil the request, unless another process has done so meanwhile."""
        with self.request.lock():
            if self.request.entry() is None:
                with self._cores:
                    self.builds = True
                    self.request.answer(self._built())

    def _built(self) -> str:
        """Build the request with an idle builder if there is one; return the name of the entry."""
        surroundings = _Surroundings(os.getpid(), cache_folder(), tuple(sys.path), self.request.plug_ins)
        while True:
            waiting = _taken(surroundings)
            builder = waiting or _Builder(surroundings)
            if name := builder.build(self.request):
                _waiting.append(builder)
                return name
            _builders.discard(builder)
            message = builder.end()
            if waiting is None:  # an idle builder may have ended meanwhile
                raise RuntimeError(f"the kernel could not be compiled:\n{message}")


@dataclass(frozen=True)
class _Surroundings:
    """Conditions under which a builder was started: process, cache, module folders, plug-ins.

    Another builder is needed if one of them changes. The process is the one that started it.
    """

    process: int
    folder: Path
    paths: tuple[str, ...]
    plug_ins: str


class _Builder(HelperProcess):
    """A process that builds the requests it receives (`friso.engine.builder`)."""

    def __init__(self, surroundings: _Surroundings) -> None:
        self.surroundings = surroundings
        super().__init__("friso.engine.builder", str(surroundings.folder), paths=surroundings.paths)
        _builders.add(self)

    def build(self, request: CodeRequest) -> str:
        """Build a request; return the name of its entry, or "" if the process ended.

        Raises OSError if the entry cannot be stored.
        """
        try:
            answer = self.ask((request.builder, request.task))
        except EOFError:
            return ""
        if isinstance(answer, OSError):
            _waiting.append(self)
            raise answer
        return answer


_builders: set[_Builder] = set()
_waiting: list[_Builder] = []


def _taken(surroundings: _Surroundings) -> _Builder | None:
    """Take an idle builder with these surroundings; None if there is none."""
    with _taking:
        for builder in _waiting:
            if builder.surroundings == surroundings:
                _waiting.remove(builder)
                return builder
    return None


_taking = Lock()


@atexit.register
def _dismiss() -> None:
    """End the builders of this process."""
    for builder in tuple(_builders):
        if builder.surroundings.process == os.getpid():
            builder.kill()
            builder.end()
