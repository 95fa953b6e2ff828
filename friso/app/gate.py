"""Who is let in: the browser that was opened with the token, at the address that was printed, and nobody else."""

from __future__ import annotations

import logging
import secrets
import time
from dataclasses import dataclass, field
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse, RedirectResponse, Response
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
"""What goes with every response."""

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


@dataclass(frozen=True)
class Access:
    """The names by which the server may be addressed, with the port, and the secrets of its token and its cookie."""

    hosts: frozenset[str]
    cookie: str
    token: str = field(default_factory=lambda: secrets.token_urlsafe(32))
    session: str = field(default_factory=lambda: secrets.token_urlsafe(32))
    once: dict[str, tuple[float, str]] = field(default_factory=dict)
    """Tokens that are taken once, with the time [s] when each was made, and the session that it began, "" before."""
    ended: set[str] = field(default_factory=set)
    """Sessions that are over."""

    @classmethod
    def at(cls, host: str, port: int) -> Access:
        """The access to a server at this host and port; one on all addresses of the machine has any name."""
        named = f"[{host}]" if ":" in host else host
        names = {named, "localhost", "127.0.0.1", "[::1]"} if host in LOOPBACK else {named}
        hosts = {f"{name}:{port}" for name in names} | (names if port == HTTP else set())
        return cls(frozenset(hosts), f"friso-{port}")

    def token_for_once(self) -> str:
        """A token that is taken once: commands that are running, and the addresses in them, can be seen by others."""
        token = secrets.token_urlsafe(32)
        self.once[token] = time.monotonic(), ""
        return token

    def is_host(self, host: str) -> bool:
        """Whether the server goes by this name: another one was made to lead here."""
        return host in self.hosts

    def is_origin(self, origin: str | None) -> bool:
        """Whether a request comes from a page of this server, or from no page at all."""
        return origin is None or (origin.startswith("http://") and self.is_host(origin.removeprefix("http://")))

    def session_of(self, query: bytes, cookies: str = "") -> str:
        """The session that an address with a token begins, "" without one. A token that is taken once and comes again
        from another browser than the one with the session that it began, was seen by two: that session is over."""
        tokens = parse_qs(query.decode("latin-1")).get("token", [])
        if len(tokens) != 1:
            return ""
        for token, (made, session) in self.once.items():
            if not _same(tokens[0], token):
                continue
            if not session and time.monotonic() - made < FRESH:
                session = secrets.token_urlsafe(32)
                self.once[token] = made, session
                return session
            if session and session not in self.ended and not self._has(cookies, {session}):
                self.ended.add(session)
                LOGGER.warning(TWICE)
        return self.session if _same(tokens[0], self.token) else ""

    def has_cookie(self, header: str) -> bool:
        """Whether a request has the cookie."""
        begun = {session for _, session in self.once.values() if session}
        return self._has(header, {self.session, *begun} - self.ended)

    def _has(self, header: str, sessions: set[str]) -> bool:
        """Whether a header has the cookie of one of these sessions."""
        try:
            cookies = SimpleCookie(header)
        except CookieError:
            return False
        return self.cookie in cookies and any(_same(cookies[self.cookie].value, session) for session in sessions)


HTTP = 80
"""The port that browsers leave out of names."""

LOOPBACK = ("127.0.0.1", "localhost", "::1")
"""The names of this machine that no other machine can reach."""


class Gate:
    """Lets requests through to an application that have an access, and refuses all others with 403."""

    def __init__(self, application: ASGIApp, access: Access) -> None:
        self.application, self.access = application, access

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request: let it in, hand it a cookie for its token, or refuse it."""
        if scope["type"] == "lifespan":
            await self.application(scope, receive, send)
            return

        async def guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message).update(HEADERS)
            await send(message)

        refusal = self._refusal(scope) if scope["type"] == "http" else PlainTextResponse(REFUSED, 403)
        await (refusal or self.application)(scope, receive, guarded)

    def _refusal(self, scope: Scope) -> Response | None:
        headers, access = Headers(scope=scope), self.access
        if not access.is_host(headers.get("host", "")) or not access.is_origin(headers.get("origin")):
            return PlainTextResponse(REFUSED, 403)
        if headers.get("sec-fetch-site", "none") not in ("none", "same-origin") and scope["path"] != "/":
            return PlainTextResponse(REFUSED, 403)
        cookies = headers.get("cookie", "")
        if scope["path"] == "/" and (session := access.session_of(scope["query_string"], cookies)):
            response = RedirectResponse("/", 303)
            response.set_cookie(access.cookie, session, httponly=True, samesite="strict", path="/")
            return response
        return None if access.has_cookie(cookies) else PlainTextResponse(REFUSED, 403)


def _same(one: str, other: str) -> bool:
    return secrets.compare_digest(one.encode(), other.encode())
