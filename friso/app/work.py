"""Answer the questions of the page: run each in a thread, pack its answer in frames, and keep it for later.

A question runs until it is answered or superseded. Progress and messages are sent to the page meanwhile.

A frame begins with two whole numbers of four bytes, least significant byte first: the lengths of the text, which is
JSON, and of the numbers in binary. Both follow. In the text, an array is an object {"array": index of its first byte,
"shape": [...]}. Arrays are float32.

Answers are kept because the same machine is often asked about again: a tab is opened again, a change is undone, a
machine is pinned, or the files of an answer are downloaded.
"""

from __future__ import annotations

import asyncio
import json
import logging
import math
import struct
import time
import traceback
from collections import OrderedDict
from collections.abc import AsyncIterator, Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, nullcontext, suppress
from contextvars import copy_context
from dataclasses import dataclass, field
from threading import Lock
from typing import Any

import numpy as np

from friso.app.machine import Machine
from friso.engine.side_by_side import ASKER, Overtaken, ended_by, go_on, going_first
from friso.errors import InputError
from friso.interface.answer import Answer
from friso.shown.documents import entries
from friso.shown.drawing import plotly_renderer
from friso.shown.drawing.figure import Figure


def frame(value: Any) -> bytes:
    """Return a value as a frame.

    The value may hold dictionaries, lists, texts, numbers and NumPy arrays. Numbers that are not finite become null; in
    arrays they become NaN.
    """
    arrays = _Arrays()
    text = json.dumps(_plain(value, arrays), separators=(",", ":"), allow_nan=False).encode()
    numbers = b"".join(arrays.parts)
    return struct.pack("<II", len(text), len(numbers)) + text + numbers


def figure_on_page(figure: Figure) -> dict[str, Any]:
    """Return a figure as the page draws it: name, title, caption and plotly's data.

    The data serve wide and narrow pages.
    """
    return {**entries(figure, "name", "title", "caption"), **plotly_renderer.parts_of_both(figure)}


class _Arrays:
    """The numbers of a frame's arrays in binary, one array behind the other."""

    def __init__(self) -> None:
        self.parts: list[bytes] = []
        self.size = 0

    def add(self, numbers: bytes) -> int:
        """Add an array, and return the index of its first byte among the numbers."""
        place, self.size = self.size, self.size + len(numbers)
        self.parts.append(numbers)
        return place


def _plain(value: Any, arrays: _Arrays) -> Any:
    """Replace arrays by references and numbers by what JSON can hold.

    Arrays are added to `arrays` as float32. Numbers that are not finite become None.
    """
    if isinstance(value, np.ndarray) and value.dtype.kind in "fiub" and value.size:
        place = arrays.add(np.ascontiguousarray(value, "<f4").tobytes())
        return {"array": place, "shape": [*value.shape]}
    if isinstance(value, dict):
        return {str(name): _plain(item, arrays) for name, item in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [_plain(item, arrays) for item in (value.tolist() if isinstance(value, np.ndarray) else value)]
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    return value.item() if isinstance(value, np.generic) else value


Job = Callable[["Work"], Iterator[dict[str, Any]]]
"""A function that answers a question and yields the parts of its answer."""

REPORT_INTERVAL = 0.1
"""Time [s] between two reports of progress."""

MOST_AT_ONCE = 16
"""Number of questions in progress at one time. Many wait for a kernel, or for earlier computations."""


@dataclass(eq=False)
class Work:
    """A question in progress.

    `put` sends a part of its answer to the page. `number` is larger for later questions of a page. Another thread sets
    `flag` to end the work.
    """

    put: Callable[[dict[str, Any] | None], object]
    number: int = 0
    first: bool = False
    """Whether all other questions wait for the first part of this answer."""
    flag: np.ndarray = field(default_factory=lambda: np.zeros(1, np.int64))
    last: float = 0.0
    notes: list[str] = field(default_factory=list)
    """Warnings so far, each once; they are sent with the answer."""
    meanwhile: list[str] = field(default_factory=list)
    """Messages logged early, most of which the answer repeats."""

    def overtake(self) -> None:
        """Ask this question to stop; any thread may call this."""
        self.flag[0] = 1

    def progress(self, done: int, total: int, label: str, /) -> None:
        """Report progress. Raises Overtaken once nobody waits for the answer."""
        go_on()
        now = time.monotonic()
        if now - self.last > REPORT_INTERVAL:
            self.last = now
            self.put({"kind": "progress", "done": done, "total": total, "label": label})

    def _put_part(self, part: dict[str, Any]) -> None:
        self.put({**part, "notes": [*dict.fromkeys(self.notes)]})

    def run(self, job: Job) -> None:
        """Do the job in this thread and send each part of its answer.

        Errors become parts, too: a page is answered whatever happens. None is sent last.
        """
        token = ASKER.set(self)
        try:
            with ended_by(self.flag):
                go_on()
                parts = job(self)
                with going_first() if self.first else nullcontext():
                    self._put_part(next(parts))
                for part in parts:
                    self._put_part(part)
        except Overtaken:
            self.put({"kind": "overtaken"})
        except InputError as error:
            self.put({"kind": "refused", "key": error.key, "text": str(error)})
        except Exception as error:  # a page is answered whatever happens; the terminal has the rest
            if self.flag[0]:  # nobody waits, and pools take no more work while the process ends
                logging.getLogger("friso").debug("failed once it was overtaken", exc_info=True)
                self.put({"kind": "overtaken"})
            else:
                traceback.print_exc()
                self.put({"kind": "failed", "key": "", "text": f"the computation could not be completed: {error}"})
        finally:
            ASKER.reset(token)
            self.put(None)


class Messages(logging.Handler):
    """A log handler that sends each message to the question that caused it.

    Messages stay on the page below the answer, except those marked as `passing`, such as that a kernel is compiled.
    """

    def emit(self, record: logging.LogRecord) -> None:
        """Send a message to the question in whose context it was logged."""
        work, text = ASKER.get(), record.getMessage()
        if not isinstance(work, Work):
            return
        lasts = not getattr(record, "passing", False)
        if lasts:
            (work.meanwhile if getattr(record, "meanwhile", False) else work.notes).append(text)
        work.put({"kind": "message", "text": text, "lasts": lasts})


def _import_libraries() -> None:
    """Import libraries that two threads cannot import at once.

    Their modules import one another, which deadlocks or fails in two threads.
    """
    with _IMPORTING, suppress(ImportError):  # of an extra; xarray imports it where it is installed
        import dask.array  # noqa: F401


_IMPORTING = Lock()


class Workshop:
    """The questions in progress: on each page at most one of a kind, which is called a lane.

    A newer question, which has a larger number, ends the older one on its lane. The order of arrival does not matter.
    """

    def __init__(self) -> None:
        self.pool = ThreadPoolExecutor(MOST_AT_ONCE, thread_name_prefix="friso-app", initializer=_import_libraries)
        self.quick = ThreadPoolExecutor(2, thread_name_prefix="friso-app-quick")
        self.lanes: dict[tuple[str, str], Work] = {}

    async def answer(
        self, page: str, lane: str, number: int, job: Job, quick: bool = False, first: bool = False
    ) -> AsyncIterator[bytes]:
        """Yield the frames of an answer as they come. The work ends when the reader stops.

        The question ends an older one of the `page` on this `lane`, which has a smaller `number`. A `quick` question
        computes nothing and does not wait for others. All others wait for the first part of a question that goes
        `first`.
        """
        loop, parts = asyncio.get_running_loop(), asyncio.Queue[dict[str, Any] | None]()

        def put(part: dict[str, Any] | None) -> None:
            if not loop.is_closed():
                loop.call_soon_threadsafe(parts.put_nowait, part)

        work, place = Work(put, number, first), (page, lane)
        if before := self.lanes.get(place):
            if before.number > number:
                yield frame({"kind": "overtaken"})
                return
            before.overtake()
        self.lanes[place] = work
        try:
            context = copy_context()
            loop.run_in_executor(self.quick if quick else self.pool, lambda: context.run(work.run, job))
            while (part := await parts.get()) is not None:
                yield frame(part)
        finally:
            work.overtake()
            if self.lanes.get(place) is work:
                del self.lanes[place]

    @contextmanager
    def listening(self) -> Iterator[None]:
        """Send what friso logs to the questions that it concerns."""
        log, messages = logging.getLogger("friso"), Messages(logging.INFO)
        log.addHandler(messages)
        level = log.level
        log.setLevel(logging.INFO)
        try:
            yield
        finally:
            log.setLevel(level)
            log.removeHandler(messages)

    def overtake(self) -> None:
        """End all questions in progress. Pages are answered at once, before computations notice."""
        for work in [*self.lanes.values()]:
            work.overtake()
            for part in ({"kind": "overtaken"}, None):
                work.put(part)

    def close(self) -> None:
        """End all questions and take no more."""
        self.overtake()
        for pool in (self.pool, self.quick):
            pool.shutdown(wait=False, cancel_futures=True)


KEPT_ANSWERS = 4
"""Number of latest answers that are kept of each function. An answer with a Bode plot takes 20 MB."""


class KeptAnswers:
    """Answers of friso's functions about machines, with the warnings that came with each.

    Only the latest answers are kept. Several threads may use the object.
    """

    def __init__(self) -> None:
        self._kept: dict[Callable[..., Answer], OrderedDict[tuple[Machine, str], tuple[Answer, list[str]]]] = {}
        self._turn = Lock()

    def answer(
        self,
        function: Callable[..., Any],
        machine: Machine,
        work: Work,
        options: Mapping[str, Any] | None = None,
        compute: Callable[[], Any] | None = None,
    ) -> Any:
        """Return a function's answer about a machine, computed now or kept from before.

        `options` are those of the function. `compute` computes the same answer from what is there already. The warnings
        that came with a kept answer are added to the `work` again.
        Raises whatever the function raises.
        """
        place = _place(machine, options)
        with self._turn:
            kept = self._kept.setdefault(function, OrderedDict())
            if there := kept.get(place):
                kept.move_to_end(place)
                work.notes += there[1]
                return there[0]
        before = len(work.notes)
        answer = compute() if compute else function(machine.stage, **(options or {}), progress=work.progress)
        with self._turn:
            kept[place] = answer, work.notes[before:]
            while len(kept) > KEPT_ANSWERS:
                kept.popitem(last=False)
        return answer

    def holds(self, function: Callable[..., Any], machine: Machine, options: Mapping[str, Any] | None = None) -> bool:
        """Tell whether a function's answer about a machine, with these `options`, is kept."""
        with self._turn:
            return _place(machine, options) in self._kept.get(function, ())


def _place(machine: Machine, options: Mapping[str, Any] | None) -> tuple[Machine, str]:
    return machine, json.dumps(options or {}, sort_keys=True)
