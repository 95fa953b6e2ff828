"""Start the server of the page and open the browser."""

from __future__ import annotations

import asyncio
import logging
import os
import signal
import socket
import webbrowser
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

import uvicorn
from starlette.types import ASGIApp

from friso.app.connections import MOST_CONNECTIONS, Connection, Once, failed
from friso.app.gate import Access
from friso.app.server import application
from friso.app.work import Workshop
from friso.engine.cache import cache_folder
from friso.errors import InputError
from friso.interface.starting import example
from friso.platform.early import SIGNALS
from friso.stage.arguments import load
from friso.stage.tables_of_files import text_of

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
