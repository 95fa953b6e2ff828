"""Who is let in: the browser that opened the address with the token, which has a key since, and nobody else."""

from __future__ import annotations

import logging
import secrets
import time
from collections.abc import Set
from dataclasses import dataclass, field

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import JSONResponse, PlainTextResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""What a page may load: all from this server, scripts from their files alone. plotly.js makes style elements itself."""

HEADERS = {
    "Content-Security-Policy": POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}
"""What goes with every response that says nothing else of the same."""

REFUSED = (
    "friso app answers only the browser that was opened with the address it printed: open that address. "
    "After a restart the server prints a new one.\n"
)


TWICE = (
    "the address with which friso started the browser was opened a second time: another user of this machine may have "
    "been first. That browser is shut out: open the address printed above"
)

FRESH = 60.0
"""Time [s] for which a token that is taken once can be taken: the browser that friso started is slower only by
seconds."""

LOGGER = logging.getLogger("friso")


ENTRY = "/enter"
"""Where a token is exchanged for a key."""

TOKEN = "friso-token"
"""The header that has a token."""

LET_IN = "friso.let_in"
"""Stands in the scope of a request that came with a key."""

BEARER = "Bearer "
"""What stands before a key in the header `Authorization`. Browsers add none of their own accord, as they do with
cookies, which also go to every other server of the same name, whatever its port."""


@dataclass(frozen=True)
class Access:
    """The names by which the server may be addressed, with the port, and the secrets of its token and its session."""

    hosts: frozenset[str]
    token: str = field(default_factory=lambda: secrets.token_urlsafe(32))
    session: str = field(default_factory=lambda: secrets.token_urlsafe(32))
    once: dict[str, tuple[float, str]] = field(default_factory=dict)
    """Tokens that are taken once, with the time [s] when each was made, and the session that it began, "" before."""
    ended: set[str] = field(default_factory=set)
    """Sessions that are over."""

    @classmethod
    def at(cls, host: str, port: int) -> Access:
        """The access to a server at this host and port; one on all addresses of the machine has any name."""
        named = (f"[{host}]" if ":" in host else host).lower()
        names = {named, "localhost", "127.0.0.1", "[::1]"} if host in LOOPBACK else {named}
        hosts = {f"{name}:{port}" for name in names} | (names if port == HTTP else set())
        return cls(frozenset(hosts))

    def token_for_once(self) -> str:
        """A token that is taken once: commands that are running, and the addresses in them, can be seen by others."""
        token = secrets.token_urlsafe(32)
        self.once[token] = time.monotonic(), ""
        return token

    def is_host(self, host: str) -> bool:
        """Whether the server goes by this name: another one was made to lead here. Names are the same in capitals."""
        return host.lower() in self.hosts

    def is_origin(self, origin: str | None) -> bool:
        """Whether a request comes from a page of this server, or from no page at all."""
        return origin is None or (origin.startswith("http://") and self.is_host(origin.removeprefix("http://")))

    def session_of(self, token: str, key: str = "") -> str:
        """The session that a token begins, "" for a wrong one. A token that is taken once and comes again from another
        browser than the one that has the session which it began as its key, was seen by two: that session is over."""
        for own, (made, session) in self.once.items():
            if not _same(token, own):
                continue
            if not session and time.monotonic() - made < FRESH:
                session = secrets.token_urlsafe(32)
                self.once[own] = made, session
                return session
            if session and session not in self.ended and not _same(key, session):
                self.ended.add(session)
                LOGGER.warning(TWICE)
        return self.session if _same(token, self.token) else ""

    def has(self, key: str) -> bool:
        """Whether a key is that of a session which goes on."""
        begun = {session for _, session in self.once.values() if session}
        return any(_same(key, session) for session in {self.session, *begun} - self.ended)


HTTP = 80
"""The port that browsers leave out of names."""

LOOPBACK = ("127.0.0.1", "localhost", "::1")
"""The names of this machine that no other machine can reach."""


class Gate:
    """Lets requests through to an application that have a key, and those for what it hands to anybody, `public` by
    path: the page itself, which holds nothing of the user's. All others are refused with 403."""

    def __init__(self, application: ASGIApp, access: Access, public: Set[str]) -> None:
        self.application, self.access, self.public = application, access, public

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request: let it in, hand it a key for its token, or refuse it."""
        if scope["type"] == "lifespan":
            await self.application(scope, receive, send)
            return

        async def guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in HEADERS.items():
                    headers.setdefault(name, value)
            await send(message)

        own = self._own(scope) if scope["type"] == "http" else _refused()
        await (own or self.application)(scope, receive, guarded)

    def _own(self, scope: Scope) -> Response | None:
        """The answer of the gate's own, None for what is let in."""
        headers, access, path = Headers(scope=scope), self.access, scope["path"]
        if not access.is_host(headers.get("host", "")) or not access.is_origin(headers.get("origin")):
            return _refused()
        if headers.get("sec-fetch-site", "none") not in ("none", "same-origin") and path != "/":  # which links lead to
            return _refused()
        key = headers.get("authorization", "").removeprefix(BEARER)
        if path == ENTRY and scope["method"] == "POST":
            session = access.session_of(headers.get(TOKEN, ""), key)
            return JSONResponse({"key": session}) if session else _refused()
        if access.has(key):
            scope[LET_IN] = True
            return None
        return None if path in self.public else _refused()


def _refused() -> Response:
    return PlainTextResponse(REFUSED, 403)


def _same(one: str, other: str) -> bool:
    return secrets.compare_digest(one.encode(), other.encode())
