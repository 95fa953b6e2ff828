"""Serve the page: its files, its questions, its uploads, and its downloads."""

from __future__ import annotations

import json
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import cache, lru_cache, partial
from hashlib import sha256
from importlib.resources import files
from importlib.resources.abc import Traversable
from typing import Any

from starlette.applications import Starlette
from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, Response, StreamingResponse
from starlette.routing import Route
from starlette.types import ASGIApp

from friso.app.gate import Access, Gate
from friso.app.questions import FIRST, QUICK, PageRequest, job_of
from friso.app.uploads import Uploads
from friso.app.work import Workshop
from friso.errors import InputError

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
