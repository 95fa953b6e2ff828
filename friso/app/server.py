"""Serve the page: its files, its questions, its uploads and its downloads, behind a gate.

The gate lets in the browser that opened the address with the token, and nobody else. The browser exchanges the token
for a key, which it sends with every later request.
"""

from __future__ import annotations

import hmac
import json
import logging
import secrets
import time
from collections.abc import AsyncIterator, Set
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, field
from functools import cache, lru_cache, partial
from hashlib import sha256
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, PlainTextResponse, Response, StreamingResponse
from starlette.routing import Route
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from friso.app.machine import Uploads
from friso.app.questions import FIRST, QUICK, PageRequest, job_of
from friso.app.work import Workshop
from friso.errors import InputError
from friso.platform.files import read_private, write_private

POLICY = (
    "default-src 'none'; script-src 'self' blob:; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""Sources that a page may load: this server alone, scripts from files and from what the page has fetched with its key
(plotly.js, which makes style elements itself)."""

HEADERS = {
    "Content-Security-Policy": POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}
"""Headers of every response that does not set them otherwise."""

REFUSED = (
    "friso app answers only the browser that was opened with the address it printed: open that address. "
    "After a restart at another port the server prints a new one.\n"
)


TWICE = (
    "the address with which friso started the browser was opened a second time: another user of this machine may have "
    "been first. That browser is shut out: open the address printed above"
)

TOKEN_LIFE = 60.0
"""Time [s] for which a one-time token is valid. The browser that friso starts needs it within seconds."""

LOGGER = logging.getLogger("friso")


ENTRY = "/enter"
"""Path at which a token is exchanged for a key."""

TOKEN = "friso-token"
"""Header that holds a token."""

PROOF, CHALLENGE = "friso-proof", "friso-challenge"
"""Headers by which a page that an earlier server at this port let in proves it: it knows the secret, which it never
sends, so that no other program at this port learns it."""

LET_IN = "friso.let_in"
"""Marker in the scope of a request that came with a key."""

BEARER = "Bearer "
"""Text before a key in the header `Authorization`. Browsers never add this header by themselves. Cookies, by contrast,
are sent to all servers of the same name, whatever their port."""


@dataclass
class Access:
    """The names under which the server answers, and the secrets that let a browser in.

    `hosts` holds names with the port. `token` stands in the address that friso prints, and stays valid. A browser
    exchanges it for `session`, the key of later requests, and for the `secret` by which it enters a later server at
    the same port, with the key `entered_again`. The secret is kept in the file `store`, if there is one; with it ends
    the key.
    """

    hosts: frozenset[str]
    token: str = field(default_factory=lambda: secrets.token_urlsafe(32))
    session: str = field(default_factory=lambda: secrets.token_urlsafe(32))
    once: dict[str, tuple[float, str]] = field(default_factory=dict)
    """One-time tokens, each with the time [s] at which it was made and the session that it began, "" before."""
    ended: set[str] = field(default_factory=set)
    """Sessions that are over."""
    challenge: str = field(default_factory=lambda: secrets.token_urlsafe(32))
    """Text from which this server's proofs are made."""
    store: Path | None = None
    secret: str = ""
    entered_again: str = field(default_factory=lambda: secrets.token_urlsafe(32))

    def __post_init__(self) -> None:
        with suppress(OSError, UnicodeDecodeError):
            self.secret = read_private(self.store).decode("ascii") if self.store else ""
        if not self.secret:
            self._renew()

    def _renew(self) -> None:
        """Make a new secret: no earlier page enters with the old one, and what entered with it is out."""
        self.secret, self.entered_again = secrets.token_urlsafe(32), secrets.token_urlsafe(32)
        if self.store:
            with suppress(OSError):  # then pages are not let in again
                write_private(self.store, self.secret.encode("ascii"))

    def is_proven(self, proof: str) -> bool:
        """Tell whether a proof was made from this server's challenge by a page that knows the secret."""
        return _same(proof, hmac.new(self.secret.encode(), self.challenge.encode(), "sha256").hexdigest())

    @classmethod
    def at(cls, port: int, store: Path | None = None) -> Access:
        """Return the access to a server at a port of this machine, whose secret is kept in the file `store`."""
        hosts = {f"{name}:{port}" for name in LOOPBACK} | (LOOPBACK if port == HTTP_PORT else set())
        return cls(frozenset(hosts), store=store)

    def token_for_once(self) -> str:
        """Return a new token that is valid once, for the address that friso opens in a browser.

        Other users of this machine can see its running commands, and with them this address.
        """
        token = secrets.token_urlsafe(32)
        self.once[token] = time.monotonic(), ""
        return token

    def is_host(self, host: str) -> bool:
        """Tell whether the server goes by this name, in small or capital letters.

        A request under another name means that some site has made its own name lead to this server.
        """
        return host.lower() in self.hosts

    def is_origin(self, origin: str | None) -> bool:
        """Tell whether a request comes from a page of this server, or from no page (None)."""
        return origin is None or (origin.startswith("http://") and self.is_host(origin.removeprefix("http://")))

    def session_of(self, token: str, key: str = "") -> str:
        """Return the key of the session that a token begins; "" for a wrong, used or old token.

        `key` is the one that the browser already has. If a token that is valid once is used again without its session's
        key, two people have seen it: the session ends.
        """
        for own, (made, session) in self.once.items():
            if not _same(token, own):
                continue
            if not session and time.monotonic() - made < TOKEN_LIFE:
                session = secrets.token_urlsafe(32)
                self.once[own] = made, session
                return session
            if session and session not in self.ended and not _same(key, session):
                self.ended.add(session)
                self._renew()
                LOGGER.warning(TWICE)
        return self.session if _same(token, self.token) else ""

    def has(self, key: str) -> bool:
        """Tell whether a key belongs to a session that has not ended."""
        begun = {session for _, session in self.once.values() if session}
        return any(_same(key, session) for session in {self.session, self.entered_again, *begun} - self.ended)


HTTP_PORT = 80
"""Port that browsers leave out of addresses."""

LOOPBACK = {"127.0.0.1", "localhost"}
"""Names under which this machine alone reaches the server."""


class Gate:
    """Pass requests with a key on to the application, and refuse all others with status 403.

    Paths in `public` need no key: they are the page itself, which holds nothing of the user's.
    """

    def __init__(self, application: ASGIApp, access: Access, public: Set[str]) -> None:
        self.application, self.access, self.public = application, access, public

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request: let it in, exchange its token for a key, or refuse it."""
        if scope["type"] == "lifespan":
            await self.application(scope, receive, send)
            return

        async def guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in HEADERS.items():
                    headers.setdefault(name, value)
            await send(message)

        own = self._own(scope) if scope["type"] == "http" else _not_let_in()
        await (own or self.application)(scope, receive, guarded)

    def _own(self, scope: Scope) -> Response | None:
        """Return the gate's own answer, or None for a request that is let in.

        Requests under foreign names and from foreign pages are refused first.
        """
        headers, access, path = Headers(scope=scope), self.access, scope["path"]
        if not access.is_host(headers.get("host", "")) or not access.is_origin(headers.get("origin")):
            return _not_let_in()
        # links from other pages lead to "/"
        if headers.get("sec-fetch-site", "none") not in ("none", "same-origin") and path != "/":
            return _not_let_in()
        key = headers.get("authorization", "").removeprefix(BEARER)
        if path == ENTRY and scope["method"] == "POST":
            session = access.session_of(headers.get(TOKEN, ""), key)
            if not session and access.is_proven(headers.get(PROOF, "")):
                session = access.entered_again
            elif not session and access.has(key):
                session = key
            entered = {"key": session, "secret": access.secret}
            return JSONResponse(entered) if session else _not_let_in({CHALLENGE: access.challenge})
        if access.has(key):
            scope[LET_IN] = True
            return None
        return None if path in self.public else _not_let_in()


def _not_let_in(headers: dict[str, str] | None = None) -> Response:
    return PlainTextResponse(REFUSED, 403, headers)


def _same(one: str, other: str) -> bool:
    return secrets.compare_digest(one.encode(), other.encode())


MOST_BYTES = 8_000_000
"""Largest size of a question in bytes: two stage files of 4 MB, one of them pinned."""

KINDS = {".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}

BINARY = "application/octet-stream"

PLOTLY = "/plotly.js"


def application(access: Access, begin: dict[str, Any], workshop: Workshop) -> ASGIApp:
    """Build the web application of the page; all but its public files need a key.

    `begin` holds the name and text of the first stage file, and whether the user asked for that file. `access` decides
    who is let in. When the server ends, questions in progress are stopped and uploads are deleted.
    """
    uploads = Uploads()

    async def ask(request: Request) -> Response:
        """Answer a question of the page in frames, or refuse it with the reason."""
        name = request.path_params["question"]
        job = job_of(name)
        if job is None:
            return _refused(f"there is no question {name[:40]!r}", 404)
        try:
            data = await _json(request)
            asked = PageRequest.of(data, uploads)
        except InputError as error:
            return _refused(str(error), 422)
        page, lane = str(data.get("page", ""))[:80], str(data.get("lane", name))[:80]
        number = data.get("number")
        number = number if isinstance(number, int) else 0
        frames = workshop.answer(page, lane, number, partial(job, asked), name in QUICK, name in FIRST)
        return StreamingResponse(frames, media_type=BINARY)

    async def started_with(request: Request) -> Response:
        return JSONResponse(begin)

    async def upload(request: Request) -> Response:
        """Keep a dropped file, or say why it cannot be kept."""
        try:
            return JSONResponse({"file": await uploads.keep(request.path_params["name"], request.stream())})
        except InputError as error:
            return _refused(str(error), 413)
        except OSError as error:
            return _refused(f"the file could not be kept: {str(error.strerror or error).lower()}", 507)

    async def let_go(request: Request) -> Response:
        try:
            uploads.let_go("{folder}/{name}".format(**request.path_params))
        except InputError as error:
            return _refused(str(error), 404)
        return Response(status_code=204)

    @asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        with workshop.listening():
            yield
        workshop.close()
        uploads.remove()

    routes = [
        Route("/ask/{question}", ask, methods=["POST"]),
        Route("/begin", started_with),
        Route("/logs/{name}", upload, methods=["POST"]),
        Route("/logs/{folder}/{name}", let_go, methods=["DELETE"]),
        Route(PLOTLY, _plotly),
        Route("/", _page),
        Route("/{file}", _page),
    ]
    gone = {ClientDisconnect: _gone}
    public = {"/", *(f"/{name}" for name in _page_files())}  # small: a slow reader of the large one needs the key
    return Gate(Starlette(routes=routes, lifespan=lifespan, exception_handlers=gone), access, public)


async def _gone(request: Request, error: Exception) -> Response:
    """Answer a request whose client has disconnected."""
    return Response(status_code=400)


def _page_files() -> dict[str, Traversable]:
    """Return the files of the page by name."""
    held = files("friso.app").joinpath("page").iterdir()
    return {item.name: item for item in held if item.is_file() and _suffix(item.name) in KINDS}


def _suffix(name: str) -> str:
    return name[name.rfind(".") :]


async def _page(request: Request) -> Response:
    """Send a file of the page."""
    name, held = request.path_params.get("file", "index.html"), _page_files()
    if name not in held:
        return _refused("there is no such page", 404)
    return _file(request, held[name].read_bytes(), KINDS[_suffix(name)])


async def _plotly(request: Request) -> Response:
    """Send plotly.js from the installed package plotly."""
    return _file(request, _plotly_js(), KINDS[".js"])


@cache
def _plotly_js() -> bytes:
    return files("plotly").joinpath("package_data", "plotly.min.js").read_bytes()


CHUNK_BYTES = 65536
"""Bytes of a file that are buffered for a slow reader."""


def _file(request: Request, content: bytes, kind: str) -> Response:
    """Send a file in chunks, or only confirm that the browser already has this content."""
    mark = _mark(content)
    headers = {"ETag": mark, "Cache-Control": "no-cache"}  # the browser must ask whether the file has changed
    if mark in request.headers.get("if-none-match", ""):
        return Response(status_code=304, headers=headers)

    async def chunks() -> AsyncIterator[bytes]:
        for start in range(0, len(content), CHUNK_BYTES):
            yield content[start : start + CHUNK_BYTES]

    headers["Content-Length"] = str(len(content))
    return StreamingResponse(chunks(), headers=headers, media_type=kind)


@lru_cache(64)
def _mark(content: bytes) -> str:
    return f'"{sha256(content).hexdigest()}"'


async def _json(request: Request) -> dict[str, Any]:
    """Return the JSON object in the body of a request.

    Raises InputError for another content type, a body that is too large, or anything but a JSON object.
    """
    if request.headers.get("content-type", "").partition(";")[0] != "application/json":
        raise InputError("Content-Type", request.headers.get("content-type", "nothing")[:60], "application/json")
    body = bytearray()
    async for chunk in request.stream():
        body += chunk
        if len(body) > MOST_BYTES:
            raise InputError("", f"more than {MOST_BYTES / 1e6:g} MB", "a stage file, which is shorter")
    try:
        data = json.loads(body)
    except (ValueError, RecursionError):
        raise InputError("", "no JSON", "a question") from None
    if not isinstance(data, dict):
        raise InputError("", "no JSON object", "a question")
    return data


def _refused(text: str, status: int) -> Response:
    return JSONResponse({"text": text}, status)
