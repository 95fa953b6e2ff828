"""Serve the app to this machine, and open the browser.

Clients may hold only so many connections, and only for so long. So a client without a key cannot keep others from the
server.
"""

from __future__ import annotations

import asyncio
import errno
import logging
import os
import signal
import socket
import webbrowser
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any

import uvicorn
from starlette.types import ASGIApp
from uvicorn.protocols.http.h11_impl import H11Protocol

from friso.app.server import LET_IN, Access, application
from friso.app.work import Workshop
from friso.engine.cache import cache_folder
from friso.errors import InputError
from friso.interface.starting import example
from friso.platform.early import SIGNALS
from friso.stage.arguments import load
from friso.stage.tables_of_files import text_of

MOST_CONNECTIONS = 64
"""Largest number of connections. Browsers open six to a server, and systems allow a process 256 open files or more."""

HEADERS_TIME = 10.0
"""Time limit [s] for a request up to its body, which a browser sends at once."""

SENDING_TIME = 120.0
"""Time limit [s] for a client without a key to read the public files, 5 MB."""

LOGGER = logging.getLogger("friso.app")

OUT_OF_FILES = (
    "this system has no room for more connections to friso app, which goes on as soon as others end: ulimit -n says "
    "how many files and connections a process may have open"
)


class Connection(H11Protocol):
    """A connection that is closed when idle too long, or when held too long without a key.

    The key is that of a session (`friso.app.server`). If too many connections are open, the one that has been idle
    longest is closed. A connection that answers a client with a key is never closed.
    """

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin the connection; if too many are open, abort the one that has been idle longest."""
        super().connection_made(transport)
        self._since, self._timer = self.loop.time(), self.loop.call_later(HEADERS_TIME, self._look)
        held = [one for one in self.connections if isinstance(one, Connection) and not one.transport.is_closing()]
        if len(held) > MOST_CONNECTIONS:
            resting = [one for one in held if not one.is_at_work]
            min(resting, key=lambda one: one._since).transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        """Stop the timer of a connection that has ended."""
        self._timer.cancel()
        super().connection_lost(exc)

    def on_response_complete(self) -> None:
        """Start the idle time before the next request."""
        self._since = self.loop.time()
        super().on_response_complete()

    def _unsupported_upgrade_warning(self) -> None:
        """Stay silent about a WebSocket, which this server has none of: any page may ask for one."""

    @property
    def is_at_work(self) -> bool:
        """Tell whether the connection is answering a client with a key."""
        return self._is_answering and LET_IN in self.scope

    @property
    def _is_answering(self) -> bool:
        return self.cycle is not None and not self.cycle.response_complete

    def _look(self) -> None:
        """Close the connection if its time is over; otherwise schedule the next check."""
        allowed = SENDING_TIME if self._is_answering else HEADERS_TIME
        left = HEADERS_TIME if self.is_at_work else self._since + allowed - self.loop.time()
        if left <= 0:
            self.transport.abort()
        else:
            self._timer = self.loop.call_later(left, self._look)


class Once(logging.Filter):
    """A filter that lets each message, with its error, through only once.

    Anybody who reaches the server can repeat a request that fails, which would otherwise fill the log.
    """

    def __init__(self) -> None:
        super().__init__()
        self._said: set[tuple[str, str]] = set()

    def filter(self, record: logging.LogRecord) -> bool:
        """Tell whether the message has not been let through before."""
        said = str(record.msg), repr(record.exc_info[1]) if record.exc_info else ""
        new = said not in self._said
        self._said.add(said)
        return new


def failed(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    """Log an error of the server's event loop.

    Too many open connections are reported in one sentence, without a traceback.
    """
    error = context.get("exception")
    if isinstance(error, OSError) and error.errno in (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM):
        LOGGER.warning(OUT_OF_FILES)
    else:
        loop.default_exception_handler(context)


ADDRESS = "127.0.0.1"
"""Address of the server: that of this machine for itself."""

DEFAULT_PORT = 8741
"""Default port. Browsers keep the contents of a page by its port."""

LONGEST_END = 2
"""Longest wait [s] at the end for questions in progress. When stopped they end within 0.1 s, except in the middle of a
figure or a solution."""

LOGS = ("uvicorn.error", "asyncio", "friso.app")
"""Loggers whose messages any client can cause."""

FURTHER_PORTS = 20
"""Number of further ports that are tried if the default is taken."""


def serve(stage: Path | None, port: int | None, browser: bool) -> None:
    """Print the address of the page and serve it until interrupted.

    The page begins with the file `stage`, or with an example. With `browser`, the address is also opened. Raises
    InputError for a stage file that cannot be read, or if no port is free.
    """
    file = example("thesis_rig") if stage is None else stage
    load(file)
    begin = {"name": file.name, "text": text_of(file, "a stage file"), "asked": stage is not None}
    listener = listening(port)
    own = listener.getsockname()[1]
    access = Access.at(own, cache_folder() / f"app-{own}.secret")
    address = f"http://{ADDRESS}:{own}/?token="
    print(f"friso app: {address}{access.token}\nCtrl-C ends it.", flush=True)
    if browser:
        webbrowser.open(f"{address}{access.token_for_once()}")
    workshop = Workshop()
    app = application(access, begin, workshop)
    server = Server(app, workshop)
    server.run([listener])
    if server.ended_by:
        signal.raise_signal(server.ended_by)


class Server(uvicorn.Server):
    """A server that shuts down in good order on any signal.

    Questions in progress are ended before the server waits for their answers. Afterwards the signal takes its usual
    effect.
    """

    def __init__(self, app: ASGIApp, workshop: Workshop, grace: int = LONGEST_END) -> None:
        """Configure the server; `grace` [s] is the longest wait for answers at the end."""
        config = uvicorn.Config(
            app,
            log_level="warning",
            loop="asyncio",
            http=Connection,
            ws="none",
            lifespan="on",
            timeout_graceful_shutdown=grace,
            backlog=MOST_CONNECTIONS,  # this many are accepted before closed ones have ended
        )
        super().__init__(config)
        self.workshop = workshop
        self.once = Once()
        self.ended_by = 0

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Handle the signals while the server runs, except ignored ones, as under nohup."""
        taken = {number: handler for number in SIGNALS if (handler := signal.getsignal(number)) is not signal.SIG_IGN}
        for number in taken:
            signal.signal(number, self.handle_exit)
        try:
            yield
        finally:
            for number, handler in taken.items():
                signal.signal(number, handler)

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """Note that the server is to end, and by which signal."""
        self.ended_by = self.ended_by or sig
        self.should_exit = True

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Start the server; from here on, repeated errors are logged once."""
        asyncio.get_running_loop().set_exception_handler(failed)
        for name in LOGS:
            logging.getLogger(name).addFilter(self.once)
        await super().startup(sockets)

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Stop the questions that are being computed, then close the connections.

        An upload in progress is cut off; this is not logged as an error.
        """
        self.workshop.overtake()
        errors = logging.getLogger("uvicorn.error")
        usual = errors.level
        errors.setLevel(logging.CRITICAL)
        try:
            await super().shutdown(sockets)
            if cut_off := [*self.server_state.tasks]:
                await asyncio.wait(cut_off, timeout=LONGEST_END)
        finally:
            errors.setLevel(usual)
            for name in LOGS:
                logging.getLogger(name).removeFilter(self.once)


def listening(port: int | None) -> socket.socket:
    """Return a socket that listens at a free port of this machine, which no other machine reaches.

    The port is the one asked for; without one, the first free port from the usual one on. Raises InputError if none is
    free.
    """
    wanted = [port] if port is not None else [*range(DEFAULT_PORT, DEFAULT_PORT + FURTHER_PORTS)]
    problem = ""
    for number in wanted:
        listener = socket.socket(socket.AF_INET)
        try:
            if os.name == "posix":  # otherwise the port stays taken for a minute after a server has ended
                listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listener.bind((ADDRESS, number))
            listener.listen()
            return listener
        except OSError as error:
            problem = str(error.strerror or error).lower()
            listener.close()
    raise InputError(
        "--port", f"{wanted[0]}: {problem}", "a port that is free", f"--port {DEFAULT_PORT + FURTHER_PORTS}"
    )
