"""Compile code that is missing in the cache, in separate processes, one per core at a time.

With separate processes, the running code is always loaded from the cache. A command that finds everything compiled
loads neither SymPy nor a compiler's front end.
"""

from __future__ import annotations

import atexit
import os
import sys
from collections.abc import Iterable, Iterator
from concurrent.futures import FIRST_EXCEPTION, Future, wait
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from threading import Lock, Semaphore, Thread

from filelock import FileLock, Timeout

from friso.engine.cache import CodeRequest, Compiled, cache_folder, leave_cache, logger
from friso.engine.overtaken import ASKER, Overtaken, go_on
from friso.engine.prune import prune
from friso.engine.settings import build_settings
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

    Each request is compiled once for all threads that wait for it.
    """

    def __init__(self) -> None:
        self._cores, self._turn = Semaphore(usable_cores()), Lock()
        self._jobs: dict[CodeRequest, _Job] = {}

    def finish(self, requests: list[CodeRequest]) -> None:
        """Fulfil all requests, and wait until they are.

        If an error ends the wait early, jobs for which nobody else waits are ended. If nobody wants the results any
        more (Overtaken), jobs already being compiled go on.
        """
        requests = list(dict.fromkeys(requests))
        jobs: list[_Job] = []
        overtaken = False
        try:
            for number, request in enumerate(requests, 1):
                jobs.append(self._joined(request, f"{number} of {len(requests)}"))
            _wait(jobs)
        except Overtaken:
            overtaken = True
            raise
        finally:
            wait(job.met for job in self._leave(jobs, overtaken))

    def end(self) -> None:
        """End all jobs."""
        with self._turn:
            jobs = [*self._jobs.values()]
            for job in jobs:
                job.give_up()
        wait([job.met for job in jobs], build_settings.ending_time)

    def _joined(self, request: CodeRequest, place: str) -> _Job:
        """Return the job of a request, started if necessary, and count one more waiting thread.

        `place` is the rank of a new job in the queue, in words. An abandoned job is started again.
        """
        with self._turn:
            job = self._jobs.get(request)
            if job is None or job.given_up:
                job = _Job(request, place, self._cores)
                Thread(target=self._do, args=[job], daemon=True).start()  # a daemon does not keep the process alive
                self._jobs[request] = job
            job.waiting += 1
            return job

    def _leave(self, jobs: list[_Job], overtaken: bool) -> list[_Job]:
        """Stop waiting for jobs; abandon and return those for which nobody else waits.

        If the wait was `overtaken`, jobs that are being compiled go on.
        """
        with self._turn:
            for job in jobs:
                job.waiting -= 1
            left = [job for job in jobs if not job.waiting and not (overtaken and job.builds)]
            for job in left:  # mark all before ending any: a builder that starts now then ends itself
                job.give_up()
        return left

    def _do(self, job: _Job) -> None:
        """Build one job in a process, and pass its result to all waiting threads."""
        error: BaseException | None = None
        try:
            job.meet()
        except BaseException as raised:
            error = raised
        with self._turn:
            if self._jobs.get(job.request) is job:
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
        done, waiting = wait(waiting, build_settings.waiting_interval, FIRST_EXCEPTION)
        for job in jobs:
            job.announce()
        for met in done:
            met.result()


class _Job:
    """A request to compile an entry of the cache, in progress.

    `place` is its rank in the queue, `waiting` the number of waiting threads. `builds` is true while it is compiled,
    and `given_up` if it was abandoned.
    """

    def __init__(self, request: CodeRequest, place: str, cores: Semaphore) -> None:
        self.request, self.met, self.waiting = request, Future[None](), 0
        self.builds = self.given_up = False
        self._announced: set[object] = set()
        self._place, self._cores = place, cores
        self._builder: _Builder | None = None

    def give_up(self) -> None:
        """Abandon the job as soon as possible."""
        self.given_up = True  # set before the builder is ended: a builder that starts now then ends itself
        if builder := self._builder:
            builder.kill()

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
        with self._held(self.request.lock()):
            if self.request.entry() is None:  # another process may have built it meanwhile
                with self._core():
                    self.request.answer(self._built())

    @contextmanager
    def _held(self, lock: FileLock) -> Iterator[None]:
        """Hold the lock of the request in the `with` block, once no other process holds it."""
        while not lock.is_locked:
            self._go_on()
            with suppress(Timeout):
                lock.acquire(timeout=build_settings.waiting_interval)
        try:
            yield
        finally:
            lock.release()

    @contextmanager
    def _core(self) -> Iterator[None]:
        """Occupy a core in the `with` block, while building."""
        while not self._cores.acquire(timeout=build_settings.waiting_interval):
            self._go_on()
        try:
            self.builds = True
            self._go_on()
            yield
        finally:
            self._cores.release()

    def _go_on(self) -> None:
        if self.given_up:
            raise RuntimeError("the kernels were not compiled: interrupted")

    def _built(self) -> str:
        """Build the request with an idle builder if there is one; return the name of the entry."""
        surroundings = _Surroundings(os.getpid(), cache_folder(), tuple(sys.path), self.request.plug_ins)
        while True:
            waiting = _taken(surroundings)
            self._builder = builder = waiting or _Builder(surroundings)
            if self.given_up:
                builder.kill()
            name = builder.build(self.request)
            self._builder = None
            if name:
                _waiting.append(builder)
                return name
            message = builder.end()
            self._go_on()
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
    _work().end()
    for builder in _waiting:
        if builder.surroundings.process == os.getpid():
            builder.kill()
            builder.end()
