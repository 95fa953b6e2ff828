"""Limit how many connections clients hold, and for how long.

A client without a key cannot keep others from the server.
"""

from __future__ import annotations

import asyncio
import errno
import logging
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol

from friso.app.gate import LET_IN

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

    The key is that of a session (`friso.app.gate`). If too many connections are open, the one that has been idle
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
