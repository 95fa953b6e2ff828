"""Make images of figures for files and pages.

A command that writes files has its figures drawn in other processes (`friso.shown.drawing.artist`) while it works. A
figure takes up to half a second, and matplotlib as long to load.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path
from typing import NamedTuple

from friso.axis import AxisKind, axis_shown
from friso.platform.helper_process import HelperProcess
from friso.platform.system import usable_cores
from friso.shown.drawing.figure import Figure

PROGRAM, MOST_PROCESSES = "friso.shown.drawing.artist", 2
"""Module that a drawing process runs, and the largest number of such processes."""


class Image(NamedTuple):
    """What is wanted of a figure's image: its format, and whether it has heading and note.

    The format is one of `IMAGE_FORMATS`. An image without heading or note is cut off there.
    """

    form: str
    headed: bool = True
    noted: bool = True


ON_PAGE = Image("svg", headed=False)
"""Image of most figures when a page is printed, or when no script runs."""


def image(figure: Figure, form: str, headed: bool = True, noted: bool = True) -> bytes:
    """Return an image of a figure as the bytes of a file.

    It has the heading if `headed`, and the note if `noted`. `form` is one of the formats
    of images. Raises ValueError for any other.
    """
    if artists := _ARTISTS.get():
        drawn = artists.drawn(figure, Image(form, headed, noted))
        if drawn is not None:
            return drawn
    from friso.shown.drawing import matplotlib_renderer

    return matplotlib_renderer.image(figure, form, headed, noted)


def save(figure: Figure, path: Path) -> None:
    """Write a figure to a path in the format of its suffix.

    Raises ValueError for an unknown format.
    """
    path.write_bytes(image(figure, path.suffix.removeprefix(".").lower()))


def draw_beforehand(figures: Iterable[Figure], images: Iterable[Image]) -> None:
    """Begin to draw images that will be needed, if other processes draw."""
    if artists := _ARTISTS.get():
        artists.begin(figures, tuple(images))


@contextmanager
def drawing_beside() -> Iterator[Artists | None]:
    """Let other processes draw figures in the `with` block.

    The first process loads what it needs at once. Without a second core, no process is started, and the block gets
    None.
    """
    if usable_cores() < 2:
        yield None
        return
    artists = Artists()
    token = _ARTISTS.set(artists)
    try:
        yield artists
    finally:
        _ARTISTS.reset(token)
        artists.end()


_Job = Future[dict[Image, bytes]]


class Artists:
    """Processes that draw, and the images in progress."""

    def __init__(self) -> None:
        """Start the first process; others follow when they are needed."""
        self.processes = [_artist()]
        self._free = [*self.processes]
        self._threads = ThreadPoolExecutor(MOST_PROCESSES, thread_name_prefix="friso-artist")
        self._begun: dict[tuple[int, Image], tuple[Figure, _Job]] = {}
        self._ended = False

    def begin(self, figures: Iterable[Figure], images: tuple[Image, ...]) -> None:
        """Begin to draw images of figures, except those already begun."""
        for figure in figures:
            new = [wanted for wanted in images if (id(figure), wanted) not in self._begun]
            if new:
                job = self._threads.submit(self._draw, figure, axis_shown(), new)
                self._begun |= {(id(figure), wanted): (figure, job) for wanted in new}

    def drawn(self, figure: Figure, wanted: Image) -> bytes | None:
        """Return an image that was begun, once it is ready.

        Returns None for any other image, or if the process that drew it has ended.
        """
        begun = self._begun.get((id(figure), wanted))
        return begun[1].result().get(wanted) if begun else None

    def end(self) -> None:
        """End all processes; no other process takes over their images."""
        self._ended = True
        self._threads.shutdown(wait=False, cancel_futures=True)
        for artist in self.processes:
            artist.kill()
        self._threads.shutdown()
        for artist in self.processes:
            artist.end()

    def _draw(self, figure: Figure, axis: AxisKind, images: Sequence[Image]) -> dict[Image, bytes]:
        """Draw images of a figure in a free process; return nothing if every process has ended."""
        for artist in self._candidates():
            with suppress(EOFError):
                drawn = artist.ask((figure, axis, images))
                self._free.append(artist)
                return drawn
        return {}

    def _candidates(self) -> Iterator[HelperProcess]:
        """Yield processes to draw in: free ones, some of which may have ended, then a new one."""
        with suppress(IndexError):
            while True:
                yield self._free.pop()
        if not self._ended:
            self.processes.append(_artist())
            yield self.processes[-1]


def _artist() -> HelperProcess:
    """Start a process that draws."""
    return HelperProcess(PROGRAM, paths=sys.path)


_ARTISTS: ContextVar[Artists | None] = ContextVar("artists", default=None)
