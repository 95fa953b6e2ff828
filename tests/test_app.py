"""Test the server of `friso app`: whom it lets in, what it accepts, and that its answers are friso's."""

import asyncio
import base64
import contextlib
import errno
import hmac
import http.client
import io
import json
import logging
import os
import socket
import struct
import subprocess
import sys
import threading
import time
import zipfile
from collections.abc import AsyncIterator, Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from urllib.parse import quote

import log_files
import numpy as np
import psutil
import pytest
import uvicorn
from patience import LIMIT, wait_until

import friso
from friso.app import machine, questions, serve, server
from friso.app.machine import Machine, machine_on_page
from friso.app.maps import ghosts_of
from friso.app.questions import QUESTIONS
from friso.app.serve import Connection, Server, listening
from friso.app.server import Access, application
from friso.app.work import KEPT_ANSWERS, KeptAnswers, Work, Workshop
from friso.axis import LINEAR
from friso.engine.settings import BuildSettings
from friso.engine.side_by_side import Overtaken, ended_by, go_on, going_first, is_first
from friso.errors import InputError, LogError
from friso.identification.logs.roles import sidecar
from friso.shown.drawing.drawable import drawable
from friso.shown.drawing.figure import Axis, Cloud, Figure, Panel, Series
from friso.stage.controllers import controller_of
from friso.studies.sweep import local_crew

RIG = Path(friso.example("thesis_rig"))
STICK_SLIP = Path(friso.example("lugre_stick_slip"))


def served_clients() -> set[tuple[str, int]]:
    """Return the addresses of all who are connected to this process."""
    return {tuple(connection.raddr) for connection in psutil.Process().net_connections("tcp4")}


@dataclass
class Served:
    """A server at a port of this machine."""

    port: int
    access: Access
    headers: dict[str, str] = field(default_factory=dict)

    def request(self, method: str, path: str, body: bytes = b"", **headers: str | None) -> tuple[int, Any, bytes]:
        """Status, headers and body; headers that are None are left out."""
        host, usual = f"127.0.0.1:{self.port}", {"Authorization": f"Bearer {self.access.session}"}
        sent = {"Host": host, "Content-Type": "application/json", **usual}
        sent |= {name.replace("_", "-"): value for name, value in headers.items()}
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=LIMIT)
        connection.putrequest(method, path, skip_host=True)
        for name, value in {**sent, "Content-Length": str(len(body))}.items():
            if value is not None:
                connection.putheader(name, value)
        connection.endheaders(body)
        response = connection.getresponse()
        content = response.read()
        connection.close()
        return response.status, response.headers, content

    def ask(
        self, question: str, stage: Path, changes: dict[str, Any] | None = None, pinned: bool = False, **options: Any
    ) -> list[Any]:
        """Return the parts of an answer; the stage as it is may be `pinned`."""
        machine = {"name": stage.name, "text": stage.read_text(encoding="utf-8")}
        body = {"machine": {**machine, "changes": changes or {}}, "pinned": machine if pinned else None}
        body |= {"options": options, "page": "test", "lane": question}
        status, _, content = self.request("POST", f"/ask/{question}", json.dumps(body).encode())
        assert status == 200, content
        return [*parts(content)]

    def keep(self, name: str, log: bytes) -> str:
        """The name under which the server keeps a log."""
        status, _, content = self.request("POST", f"/logs/{name}", log)
        assert status == 200, content
        return json.loads(content)["file"]


def parts(content: bytes) -> Iterator[Any]:
    """The values of frames; arrays as NumPy has them."""
    while content:
        text, numbers = struct.unpack("<II", content[:8])
        array = content[8 + text : 8 + text + numbers]
        yield unpacked(json.loads(content[8 : 8 + text]), array)
        content = content[8 + text + numbers :]


def unpacked(value: Any, numbers: bytes) -> Any:
    if isinstance(value, list):
        return [unpacked(item, numbers) for item in value]
    if isinstance(value, dict) and isinstance(value.get("shape"), list):
        count = int(np.prod(value["shape"]))
        return np.frombuffer(numbers, "<f4", count, value["array"]).reshape(value["shape"])
    return {key: unpacked(item, numbers) for key, item in value.items()} if isinstance(value, dict) else value


@pytest.fixture(scope="module")
def served() -> Iterator[Served]:
    config = uvicorn.Config(lambda scope: None, log_level="warning", ws="none", port=0)
    listener = config.bind_socket()
    access = Access.at(listener.getsockname()[1])
    begin = {"name": RIG.name, "text": RIG.read_text(encoding="utf-8"), "asked": True}
    app = application(access, begin, Workshop())
    server = uvicorn.Server(uvicorn.Config(app, log_level="warning", ws="none", http=Connection))
    thread = threading.Thread(target=server.run, args=([listener],))
    thread.start()
    while not server.started:
        time.sleep(0.01)
    yield Served(listener.getsockname()[1], access)
    server.should_exit = True
    thread.join()
    listener.close()


# ---------------------------------------------------------------- who is let in

HALF = b"POST /ask/machine HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Slow: "


def half_sent(port: int, number: int) -> list[socket.socket]:
    """Connections over which the first half of a request was sent."""
    held = []
    for _ in range(number):
        held.append(socket.create_connection(("127.0.0.1", port), timeout=LIMIT))
        held[-1].sendall(HALF)
    return held


def is_closed(connection: socket.socket) -> bool:
    """Whether the server closes it before it has answered."""
    try:
        return connection.recv(1) == b""
    except ConnectionResetError:
        return True


def test_half_sent_requests_keep_nobody_out_and_end_soon(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    held = half_sent(served.port, 3 * serve.MOST_CONNECTIONS)
    try:
        assert served.request("GET", "/begin")[0] == 200
        assert all(map(is_closed, held[: 2 * serve.MOST_CONNECTIONS]))  # those that came first made way
    finally:
        for one in held:
            one.close()
    monkeypatch.setattr(serve, "HEADERS_TIME", 0.05)
    (one,) = half_sent(served.port, 1)
    with one:
        for _ in range(3):
            one.sendall(b"x")  # so that it does not rest
        assert is_closed(one)


def test_whoever_has_no_key_and_reads_slowly_is_cut_off_and_a_question_is_not(
    served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun, goes_on = threading.Event(), threading.Event()

    def long(asked: Any, work: Work) -> Iterator[dict[str, Any]]:
        begun.set()
        goes_on.wait(LIMIT)
        yield {"kind": "answer"}

    monkeypatch.setitem(QUESTIONS, "machine", long)  # type: ignore[arg-type]
    monkeypatch.setattr(serve, "HEADERS_TIME", 1.0)
    monkeypatch.setattr(serve, "SENDING_TIME", 1.0)
    with ThreadPoolExecutor(1) as pool, contextlib.ExitStack() as opened:
        answer = pool.submit(served.ask, "machine", RIG)
        assert begun.wait(LIMIT)
        slow = opened.enter_context(socket.create_connection(("127.0.0.1", served.port), timeout=LIMIT))
        slow.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 65536)
        slow.sendall(f"GET /plotly.js HTTP/1.1\r\nHost: 127.0.0.1:{served.port}\r\n\r\n".encode())
        wait_until(lambda: slow.getsockname() in served_clients())
        wait_until(lambda: slow.getsockname() not in served_clients())
        assert len(served.request("GET", "/plotly.js")[2]) > 1_000_000
        size = 0
        with contextlib.suppress(ConnectionResetError):
            while chunk := slow.recv(65536):
                size += len(chunk)
        assert size < 4_000_000
        goes_on.set()
        assert answer.result(LIMIT)[-1]["kind"] == "answer"


def test_a_later_server_lets_in_who_proves_the_secret_and_nobody_else(tmp_path: Path) -> None:
    store = tmp_path / "secret"
    first = Access.at(8000, store)
    later = Access.at(8000, store)

    def proof(secret: str, challenge: str) -> str:
        return hmac.new(secret.encode(), challenge.encode(), "sha256").hexdigest()

    assert later.is_proven(proof(first.secret, later.challenge))
    assert not later.is_proven(proof(first.secret, first.challenge))
    assert not later.is_proven(proof("", later.challenge))
    token = later.token_for_once()
    later.session_of(token)
    later.session_of(token)  # somebody else has seen it, and perhaps the secret
    assert not later.is_proven(proof(first.secret, later.challenge))
    assert Access.at(8000, store).secret == later.secret != first.secret


def test_what_the_secret_let_in_is_out_once_two_have_seen_a_token(tmp_path: Path) -> None:
    """Who takes the token of another user also learns the secret: both end as the owner comes."""
    access = Access.at(8000, tmp_path / "secret")
    token = access.token_for_once()
    thief, again = access.session_of(token), access.entered_again
    assert access.has(thief)
    assert access.has(again)
    assert again != access.session
    access.session_of(token)
    assert not access.has(thief)
    assert not access.has(again)
    assert access.has(access.session)


def test_a_page_with_a_key_is_told_the_secret_again(served: Served) -> None:
    """No browser stores it: a page that is loaded again asks for it."""
    status, _, content = served.request("POST", "/enter")
    assert (status, json.loads(content)["secret"]) == (200, served.access.secret)
    proof = hmac.new(served.access.secret.encode(), served.access.challenge.encode(), "sha256").hexdigest()
    status, _, content = served.request("POST", "/enter", Authorization=None, Friso_Proof=proof)
    assert (status, json.loads(content)["key"]) == (200, served.access.entered_again)


def test_that_there_is_no_room_for_connections_is_said_once(caplog: pytest.LogCaptureFixture) -> None:
    once, loop = serve.Once(), asyncio.new_event_loop()
    logging.getLogger("friso.app").addFilter(once)
    try:
        for _ in range(100):
            context = {"message": "socket.accept()", "exception": OSError(errno.EMFILE, "Too many open files")}
            serve.failed(loop, context)
    finally:
        logging.getLogger("friso.app").removeFilter(once)
        loop.close()
    assert [record.exc_info for record in caplog.records] == [None]
    assert "ulimit" in caplog.records[0].getMessage()


@pytest.mark.parametrize("path", ["/plotly.js", "/main.js", "/"])
def test_a_browser_that_has_a_file_is_sent_it_again_only_when_it_is_another(served: Served, path: str) -> None:
    status, headers, content = served.request("GET", path)
    assert (status, len(content)) == (200, int(headers["Content-Length"]))
    status, again, nothing = served.request("GET", path, If_None_Match=headers["ETag"])
    assert (status, nothing, again["ETag"]) == (304, b"", headers["ETag"])
    assert served.request("GET", path, If_None_Match='"another"')[2] == content
    assert served.request("GET", "/begin")[1]["Cache-Control"] == "no-store"


def test_the_token_is_exchanged_for_a_key_and_for_no_cookie(served: Served) -> None:
    """A cookie would go to every server of this name, whatever its port."""
    status, headers, content = served.request("POST", "/enter", Authorization=None, Friso_Token=served.access.token)
    assert (status, headers["Set-Cookie"], json.loads(content)) == (
        200,
        None,
        {"key": served.access.session, "secret": served.access.secret},
    )
    for token in ("", "wrong", "\xe4", None):
        assert served.request("POST", "/enter", Authorization=None, Friso_Token=token)[0] == 403


FOREIGN = ("http://evil.example", "null", "https://127.0.0.1", "http://127.0.0.1:1")
HOSTS = ("evil.example", "127.0.0.1", "127.0.0.1:1", "localhost.evil.example", "", None)
OUTSIDE = ("/../server.py", "/%2e%2e/server.py", "/..%2fserver.py", "/page/main.js", "//etc/passwd", "/server.py")
WHOLE = json.dumps({"machine": {"name": "x", "text": RIG.read_text(encoding="utf-8")}}).encode()
UNREAD = (b"", b"[]", b"{", b'{"machine": 3}', b'{"machine": {"text": 1}}', b"[" * 100000, b'"' + 9_000_000 * b"a")
REQUESTS: list[tuple[int, str, str, dict[str, Any]]] = [
    *(
        (403, method, path, {"Authorization": key})
        for path in ("/begin", "/enter", "/nothing", "/ask/machine", "/logs/x.csv", "/plotly.js")
        for key in (None, "", "Bearer ", "Bearer wrong", "Bearer \xe4")
        for method in ("GET", "POST", "DELETE")
    ),
    *((200, "GET", path, {"Authorization": None}) for path in ("/", "/main.js", "/style.css", "/?token={token}")),
    (200, "GET", "/", {"Authorization": None, "Sec_Fetch_Site": "cross-site"}),  # a link that holds a machine
    *(
        (403, "GET", path, {"Sec_Fetch_Site": f"{one}-site"})
        for path in ("/begin", "/main.js")
        for one in ("cross", "same")
    ),
    *((403, "POST", "/ask/machine", {"Origin": origin}) for origin in FOREIGN),
    *((200, "GET", "/begin", {"Origin": f"http://{name}:{{port}}"}) for name in ("127.0.0.1", "localhost")),
    *(
        (403, method, path, {"Host": host, "Friso_Token": "{token}"})
        for host in HOSTS
        for method, path in (("GET", "/"), ("POST", "/enter"))
    ),
    (200, "GET", "/begin", {"Host": "LocalHost:{port}", "Cookie": 'theme={{"dark":true}}; ;=a b'}),
    (403, "GET", "/begin", {"Authorization": None, "Cookie": "friso-8741=x"}),
    *((404, "GET", path, {}) for path in OUTSIDE),
    (404, "POST", "/ask/nothing", {"body": WHOLE}),
    (405, "GET", "/ask/machine", {}),
    (422, "POST", "/ask/machine", {"body": WHOLE, "Content_Type": "text/plain"}),
    *((422, "POST", "/ask/machine", {"body": body}) for body in UNREAD),
]


def test_requests_have_the_status_of_who_asks_for_what(served: Served) -> None:
    """Without a host a request is malformed: 400."""
    known = {"token": served.access.token, "port": served.port}

    def filled(value: Any) -> Any:
        return value.format(**known) if isinstance(value, str) else value

    for status, method, path, more in REQUESTS:
        got = served.request(method, filled(path), **{name: filled(value) for name, value in more.items()})
        assert got[0] in (status, *([400] if "Host" in more else [])), (method, path, more)
        assert status == 200 or b"import" not in got[2]
    assert max(len(served.request("GET", path)[2]) for path in ("/", "/main.js", "/style.css")) < 65536  # sent at once
    assert [Access.at(port).is_host("localhost") for port in (80, 8741)] == [True, False]  # the usual port is left out


def test_a_token_for_once_is_taken_once_and_whoever_was_faster_than_the_browser_is_shut_out(
    served: Served, caplog: pytest.LogCaptureFixture
) -> None:
    token = served.access.token_for_once()
    content = served.request("POST", "/enter", Friso_Token=token, Authorization=None)[2]
    key = f"Bearer {json.loads(content)['key']}"
    assert served.request("GET", "/begin", Authorization=key)[0] == 200
    for _ in range(2):
        assert served.request("POST", "/enter", Friso_Token=token, Authorization=None)[0] == 403
    assert [record.name for record in caplog.records].count("friso") == 1
    assert [served.request("GET", "/begin", Authorization=value)[0] for value in (key, None)] == [403, 403]
    assert served.request("GET", "/begin")[0] == 200


def test_a_token_for_once_is_taken_soon_or_never_and_the_browser_that_took_it_may_show_it_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    access = Access.at(8000)
    token = access.token_for_once()
    key = access.session_of(token)
    monkeypatch.setattr(server, "TOKEN_LIFE", 0.0)
    assert (access.session_of(token, key), access.has(key)) == ("", True)  # out of its history
    assert access.session_of(access.token_for_once()) == ""
    assert (access.session_of(token), access.has(key)) == ("", False)  # however late another comes


def test_the_port_takes_connections_before_the_browser_opens_and_is_free_again_at_once() -> None:
    with listening(0) as first:
        port = first.getsockname()[1]
        with pytest.raises(InputError, match=f"{port}: "):
            listening(port)
        with socket.create_connection(("127.0.0.1", port), timeout=LIMIT) as browser:
            first.accept()[0].close()
            assert browser.recv(1) == b""
    listening(port).close()


@pytest.mark.parametrize("path", ["/", "/begin", "/nothing"])
@pytest.mark.parametrize("more", [{}, {"Authorization": None}])
def test_every_response_says_what_a_page_may_load(served: Served, path: str, more: dict[str, Any]) -> None:
    headers = served.request("GET", path, **more)[1]
    rules = dict(rule.split(" ", 1) for rule in headers["Content-Security-Policy"].split("; "))
    assert (rules["default-src"], rules["script-src"], rules["connect-src"]) == ("'none'", "'self' blob:", "'self'")
    assert headers["X-Content-Type-Options"] == "nosniff"


# ---------------------------------------------------------------- what is taken


LOG = b"time [s],position [m]\n" + b"".join(b"%g,%g\n" % (k / 1000, k % 7) for k in range(50))


def test_what_is_wrong_or_names_a_file_is_refused(served: Served) -> None:
    opened, part = served.ask("machine", RIG, {"masses.cart": "3 N"})
    assert (part["kind"], part["key"], opened["toml"]) == ("refused", "masses.cart", friso.load(RIG).to_toml())
    for question in ("check", "map", "boundary", "tune", "design", "run"):
        for options in ({"out": "/tmp/x"}, {"spec": "/etc/passwd"}, {"export": ["/tmp/x.csv"]}):
            assert served.ask(question, RIG, {}, **options)[-1]["kind"] == "refused"


def test_logs_are_kept_under_names_of_the_server_and_no_others_are_read(served: Served) -> None:
    kept = served.keep("..%5C..%5Cmy%20log.csv", LOG)
    assert kept.partition("/")[2] == "my log.csv"
    part = served.ask("logs", RIG, files=[kept])[-1]
    assert part["channels"] == ["time", "position"]
    assert "position" in part["roles"]
    for name in ("/etc/passwd", f"../{kept}", str(RIG), 3):
        assert served.ask("identify", RIG, files=[name])[0]["kind"] == "refused"
    assert served.request("POST", "/logs/x.csv", LOG, Origin="http://evil.example")[0] == 403
    for letters in ("ä", "x"):
        assert served.keep(quote(f"{letters * 300}.csv"), b"1").endswith(".csv")


def test_no_mapping_of_the_user_s_has_a_say_in_what_was_dropped(
    served: Served, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A mapping is kept beside a log of the same name, in the folder where the server was started."""
    for place in (tmp_path / "mine.csv.friso.toml", sidecar(tmp_path / "elsewhere" / "mine.csv", tmp_path)):
        place.write_text('not = "a mapping"', encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "mine.csv").write_bytes(LOG)
    with pytest.raises(LogError, match=r"mine\.csv\..*friso\.toml"):
        friso.identify(tmp_path / "elsewhere" / "mine.csv")
    kept = served.keep("mine.csv", LOG)
    for question in ("logs", "identify"):
        assert "friso.toml" not in str(served.ask(question, RIG, files=[kept]))


def log_that_is_elsewhere(folder: Path) -> bytes:
    """A MAT file whose values stand in another file of this machine."""
    import h5py

    with h5py.File(folder / "secret.h5", "w") as file:
        file["secret"] = np.arange(400.0)
    with h5py.File(folder / "a.mat", "w") as file:
        file["time"] = np.arange(400) * 1e-3
        file["x"] = h5py.ExternalLink(str(folder / "secret.h5"), "secret")
    return (folder / "a.mat").read_bytes()


def log_that_crashes(folder: Path) -> bytes:
    """A MAT file of cells in cells, which ends the process that reads it."""
    log_files.cells_in_cells_as_mat(folder / "a.mat", 200_000)
    return (folder / "a.mat").read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize("made", [log_that_is_elsewhere, log_that_crashes])
def test_a_hostile_log_is_refused_and_the_server_goes_on(
    served: Served, tmp_path: Path, made: Callable[[Path], bytes]
) -> None:
    kept = served.keep("a.mat", made(tmp_path))
    assert served.ask("logs", RIG, files=[kept])[-1]["kind"] == "refused"
    assert served.ask("machine", RIG)[-1]["kind"] != "refused"


@pytest.fixture
def kept() -> Iterator[machine.Uploads]:
    kept = machine.Uploads()
    yield kept
    kept.remove()


def test_logs_that_come_at_the_same_time_are_both_kept(kept: machine.Uploads) -> None:
    async def half(text: bytes, other: asyncio.Event, own: asyncio.Event) -> AsyncIterator[bytes]:
        own.set()
        await other.wait()
        yield text

    async def both() -> list[str]:
        one, other = asyncio.Event(), asyncio.Event()
        halves = half(b"1", other, one), half(b"2", one, other)
        return await asyncio.gather(*(kept.keep("a.csv", part) for part in halves))

    assert [kept.path(name).read_bytes() for name in asyncio.run(both())] == [b"1", b"2"]


async def one_byte() -> AsyncIterator[bytes]:
    yield b"1"


def test_a_name_means_no_other_file_to_a_later_server(kept: machine.Uploads) -> None:
    """A page that was left open would identify it in place of its own, or twice."""
    first = machine.Uploads()
    names = [asyncio.run(server.keep("log.csv", one_byte())) for server in (first, kept)]
    first.remove()
    assert kept.path(names[1]).read_bytes() == b"1"
    with pytest.raises(InputError, match="while this server ran"):
        kept.path(names[0])


def test_a_log_that_is_let_go_gives_its_place_to_another(
    kept: machine.Uploads, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(machine, "MOST_FILES", 1)
    name = asyncio.run(kept.keep("a.csv", one_byte()))
    with pytest.raises(InputError, match="Other files"):
        asyncio.run(kept.keep("b.csv", one_byte()))
    kept.let_go(name)
    other = asyncio.run(kept.keep("b.csv", one_byte()))
    assert [path.name for path in kept.folder.glob("*/*")] == ["b.csv"]
    assert kept.path(other).is_file()


def test_the_page_lets_logs_go_by_their_names_alone(served: Served) -> None:
    kept = served.keep("a%20log.csv", b"1")
    names = [quote(kept), quote(kept), "..%2f/a.csv", "x/y"]
    assert [served.request("DELETE", f"/logs/{name}")[0] for name in names] == [204, 404, 404, 404]
    assert served.ask("logs", RIG, files=[kept])[0]["kind"] == "refused"


def test_what_a_killed_server_left_goes_with_the_next(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    left, alive = tmp_path / f"{machine.PREFIX}left", machine.Uploads()
    (left / "1").mkdir(parents=True)
    (left / "1" / "log.csv").write_bytes(b"1")
    for folder in (left, alive.folder):
        os.utime(folder, (0, 0))
    second = machine.Uploads()
    assert {*tmp_path.iterdir()} == {alive.folder, second.folder}
    alive.remove()
    second.remove()
    assert [*tmp_path.iterdir()] == []


def test_a_log_that_is_too_large_or_finds_no_room_is_refused(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    async def full(*_: object) -> str:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(machine, "MOST_BYTES", 100)
        status, _, content = served.request("POST", "/logs/large.csv", 1000 * b"1")
        assert (status, "friso identify" in json.loads(content)["text"]) == (413, True)
    monkeypatch.setattr(machine.Uploads, "keep", full)
    status, _, content = served.request("POST", "/logs/x.csv", b"1")
    assert (status, "space" in json.loads(content)["text"]) == (507, True)


@pytest.mark.parametrize("path", ["/logs/x.csv", "/ask/machine"])
def test_a_browser_that_leaves_in_the_middle_of_a_request_is_no_error(path: str) -> None:
    access = Access.at(80)
    headers = {b"host": b"127.0.0.1", b"authorization": f"Bearer {access.session}".encode()}
    headers |= {b"content-type": b"application/json"}
    scope = {"type": "http", "method": "POST", "path": path, "headers": [*headers.items()], "query_string": b""}
    messages = [{"type": "http.request", "body": b"{", "more_body": True}, {"type": "http.disconnect"}]

    async def receive() -> Any:
        return messages.pop(0)

    async def send(message: Any) -> None: ...

    asyncio.run(application(access, {}, Workshop())(scope, receive, send))  # raises nothing
    assert not messages


# ---------------------------------------------------------------- what is answered


def test_a_machine_has_the_keys_of_its_file_with_what_they_take(served: Served) -> None:
    (part,) = served.ask("machine", RIG, {"masses.cart": "1.5 kg"})
    keys = {key["path"]: key for table in part["tables"] for key in table["keys"]}
    cart, alpha = keys["masses.cart"], keys["controller.alpha"]["range"]
    assert (cart["value"], cart["si"], cart["unit"]) == ("1.5 kg", 1.5, "kg")
    assert keys["joint.locked"]["kind"] == "switch"
    assert keys["friction.model"]["options"] == ["lugre"]
    assert keys["controller.crossover"]["range"] == {"low": 0.8, "high": 80.0, "log": True}
    assert 0 < alpha["low"] < alpha["high"] < 1
    assert friso.loads(part["toml"]) == friso.load(RIG).replace({"masses.cart": "1.5 kg"})
    added = Machine.of({"text": RIG.read_text(encoding="utf-8"), "changes": {"controller.force_limit": None}})
    assert added.stage == friso.load(RIG)  # a key added on the page can be taken away again


@pytest.mark.cases(first=10)
@pytest.mark.parametrize("name", [name for name in friso.interface.starting.example_names() if "/" not in name])
def test_every_example_is_shown(name: str) -> None:
    path = Path(friso.example(name))
    part = machine_on_page(Machine(path.read_text(encoding="utf-8"), path.name))
    written = friso.load(path).as_written()
    tables = {table["name"]: table for table in part["tables"] if table["present"]}
    assert {name for name, value in written.items() if isinstance(value, dict)} == set(tables)
    for table in tables.values():
        values = {key["path"].split(".")[1]: key["value"] for key in table["keys"] if key["value"] is not None}
        assert values == written[table["name"]]


KINDS = ("pid by crossover", "pid", "adrc", "cascade", "transfer_function", "state_space")


@pytest.mark.parametrize("name", ["thesis_rig", "robot_wrist", "twincat_cascade", "controllers/state_space"])
def test_every_kind_of_controller_can_be_chosen_and_keeps_crossover_and_limit(served: Served, name: str) -> None:
    """It is the crossover of the gains; from a kind by gains to another, these stay, too."""
    path, limit = Path(friso.example(name)), {"controller.force_limit": "90 N*m" if "wrist" in name else "90 N"}
    before = friso.load(path).replace(limit).flat()
    pid = controller_of(before).as_pid(before)
    (part,) = served.ask("machine", path, limit)
    (kind,) = (key for table in part["tables"] for key in table["keys"] if key["path"] == "controller.kind")
    assert {*KINDS} <= {*kind["options"]}  # a package may add others
    for chosen in KINDS:
        (part,) = served.ask("controller", path, limit, name=chosen)
        changes = limit | part["changes"]
        machine = Machine.of({"text": path.read_text(encoding="utf-8"), "changes": changes})
        flat, (shown,) = machine.stage.flat(), served.ask("machine", path, changes)
        assert {key["own"] for table in shown["tables"] for key in table["keys"] if "own" in key} == {chosen}
        now = controller_of(flat).as_pid(flat)
        assert (now.crossover, flat["controller.force_limit"]) == (pytest.approx(pid.crossover, rel=1e-3), 90.0)
        assert chosen in ("pid by crossover", "adrc") or now[:3] == pytest.approx(pid[:3], rel=2e-3)
    assert served.ask("controller", path, name="nothing")[-1]["kind"] == "refused"


def test_a_run_is_that_of_friso(served: Served) -> None:
    """The picture comes before it is measured for its sentence."""
    part, words = (part for part in served.ask("run", STICK_SLIP) if part["kind"] != "message")
    answer = friso.simulate(STICK_SLIP)
    assert (part["kind"], part["sentences"]) == ("partly", [])
    assert words["sentences"] == [*answer.sentences()]
    assert part["command"] == words["command"] == "friso simulate lugre_stick_slip.toml"
    lines = [trace for trace in part["figures"][0]["data"] if trace["name"] == "position"]
    assert lines[0]["y"].dtype == np.float32
    expected = drawable(answer.figures()[0]).panels[1].series[1].y
    assert np.array_equal(lines[0]["y"], expected.astype(np.float32))


@pytest.mark.slow
def test_the_loops_of_the_limit_cases_come_before_those_of_the_family(served: Served) -> None:
    """The family comes next, and then how fast the controller may be, which takes longer; friso says all of it."""
    answer = friso.bode(RIG)
    first, family, words = (part for part in served.ask("bode", RIG) if part["kind"] != "message")
    drawn = [[figure["name"] for figure in part["figures"]] for part in (first, family)]
    assert drawn[0] == ["bode_loop", "bode_plant"]
    assert [*drawn[0], *drawn[1]] == family["names"] == [figure.name for figure in answer.figures()]
    assert first["names"] is None
    assert (words["sentences"], "figures" in words) == ([*answer.sentences()], False)
    *_, last = served.ask("loops", RIG)
    assert (last["names"], last["sentences"]) == (family["names"], [])


AXES = {"x": "masses.stage=0.8 kg..1.2 kg", "y": "friction.static=6 N..12 N"}
EDGE = Series(np.array([0.9, 1.1]), np.array([7.0, 9.0]), "flip of the hunting cycle", "#222222")


class OwnEdge:
    """In place of `friso.boundary`, which takes too long here."""

    axis_kind, tables, details, failure = LINEAR, list, list, ""

    def __init__(self, stage: friso.Stage) -> None:
        logging.getLogger("friso").warning("static friction of %g N", stage.flat()["friction.static"])

    def sentences(self) -> list[str]:
        return ["Hunting ends there."]

    def figures(self) -> list[Figure]:
        cloud = Cloud(np.ones(1), np.ones(1), np.ones(1), "", "")
        panel = Panel("", Axis("Stage mass", "kg"), Axis("Static friction", "N"), (EDGE,), clouds=(cloud,))
        return [Figure("boundary", "Edge of hunting", "", (panel,))]


def test_the_edge_of_hunting_is_drawn_over_a_map_and_beside_the_pinned_one(
    served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A stage that cannot hunt has none, and the reason of `friso.boundary` stands below its map."""

    def shown(question: str, **options: Any) -> list[Any]:
        return [part for part in served.ask(question, STICK_SLIP, **options) if "figures" in part]

    without = shown("map", **AXES, edge=True)[-1]
    assert "cannot hunt" in without["sentences"][-1]
    asked = []
    monkeypatch.setattr(friso, "boundary", lambda stage, **options: asked.append(options) or OwnEdge(stage))
    answers = shown("map", **AXES, log=True, edge=True)
    drawn = [[trace.get("name") for trace in part["figures"][0]["data"]].count(EDGE.label) for part in answers]
    assert not any(drawn[:-1])
    assert drawn[-1] > 0
    assert [{name: one[name] for name in "xy"} for one in asked] == [
        {name: f"{text}:log" for name, text in AXES.items()}
    ]
    assert answers[-1]["sentences"] == [*answers[-2]["sentences"], "Hunting ends there."]
    assert answers[-1]["figures"][0]["layout"]["xaxis"]["type"] == "log"
    axes = {"x": "friction.coulomb=1 N..2 N", "y": "friction.static=6 N..12 N"}
    for pictures in (["map-sketch", "boundary", "boundary"], ["boundary", "boundary"]):  # the edges are kept
        parts = shown("boundary", changes={"friction.static": "9 N"}, pinned=True, **axes)
        assert [part["figures"][0]["name"] for part in parts] == pictures
        assert {trace.get("name") for trace in parts[-1]["figures"][0]["data"]} >= {
            EDGE.label,
            "pinned",
            "this machine",
        }
        assert parts[-1]["notes"] == ["static friction of 9 N"]
    assert len(asked) == 3
    monkeypatch.undo()
    refused = shown("boundary", **axes)
    assert [part["figures"][0]["name"] for part in refused] == ["map-sketch"] * 2
    assert "cannot hunt" in refused[-1]["sentences"][0]


@pytest.mark.slow
def test_a_map_comes_from_coarse_to_fine_and_ends_as_that_of_friso(
    served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What a page shows before its check has ended is two pictures, unless the whole map is there."""
    monkeypatch.setattr(questions, "COARSE_TO_FINE", (2, 3, 5))
    axes = {"x": "controller.crossover=7 Hz..12 Hz", "y": "friction.static=2.5 N..3.5 N"}
    given, locked = {**axes, "metric": "sketch"}, {"joint.locked": True}

    def rows(coarse: bool) -> list[int]:
        """Return the number of rows of each picture that is shown."""
        shown = [part for part in served.ask("map", RIG, locked, **given, coarse=coarse) if "figures" in part]
        return [len(part["places"]["y"]) for part in shown]

    assert rows(coarse=True) == [2, 3]
    assert rows(coarse=True) == [3]
    whole = served.ask("map", RIG, locked, **given)[-1]
    expected = friso.sweep(RIG, set=locked, metric="sketch", **{name: f"{text}:5" for name, text in axes.items()})
    assert whole["sentences"] == [*expected.sentences()]
    assert whole["figures"][0]["title"] == expected.figures()[0].title
    assert rows(coarse=True) == [5]


@pytest.mark.parametrize(
    ("own", "other", "alike"),
    [
        ("Locked (as given): position", "Locked: position", True),
        ("Free", "Free (as given)", True),
        ("leaf bending, in phase, 377 Hz", "leaf bending, in phase, 1.04 kHz", True),
        ("leaf bending, in phase, 377 Hz", "leaf bending, out of phase, 377 Hz", False),
        ("Locked", "Free", False),
    ],
)
def test_what_is_pinned_stands_behind_what_is_alike(own: str, other: str, alike: bool) -> None:
    """Whichever case is given there, and whatever a mode's frequency is."""
    line = Series(np.arange(2.0), np.arange(2.0), "a line", "#222222")

    def figure(title: str) -> Figure:
        return Figure("f", "", "", (Panel(title, Axis("x", "m"), Axis("y", "m"), (line,)),))

    class Pinned:
        figures = staticmethod(lambda: [figure(other)])

    (panel,) = ghosts_of(Pinned())(figure(own)).panels  # type: ignore[arg-type]
    assert [series.label for series in panel.series] == [*["pinned"] * alike, "a line"]


@pytest.mark.slow
def test_a_cell_of_a_map_and_the_leaf_springs_have_what_is_pinned(served: Served) -> None:
    """A cell shows the error of its run."""
    heavier = {"masses.stage": "1.1 kg"}
    part = served.ask("cell", STICK_SLIP, heavier)[-1]
    assert part["sentences"] == [*friso.simulate(STICK_SLIP, set=heavier).sentences()]
    assert [trace.get("name") for trace in part["figures"][0]["data"]] == ["error"]
    part = served.ask("cell", STICK_SLIP, heavier, pinned=True)[-1]
    assert "pinned" in [trace["name"] for trace in part["figures"][0]["data"]]
    leaves = Path(friso.example("thesis_leaves"))
    part = served.ask("flexure", leaves, {"flexure.thickness": "0.2 mm"}, pinned=True)[-1]
    assert "flexure_drawing" in [figure["name"] for figure in part["figures"]]


def test_a_report_has_page_figures_document_and_stage_file(served: Served, undrawn: None) -> None:
    for command, figure in {"check": "settled", "simulate": "response"}.items():
        asked = served.ask({"simulate": "run"}.get(command, command), STICK_SLIP)[-1]["asked"]
        part = served.ask(f"{asked['name']}.zip", STICK_SLIP, **asked["options"])[-1]
        names = set(zipfile.ZipFile(io.BytesIO(base64.b64decode(part["base64"]))).namelist())
        assert {f"{command}.json", "lugre_stick_slip.toml"} <= names
        assert {f"{figure}.{form}" for form in ("png", "svg", "pdf")} <= names


def test_a_line_gives_the_same_and_names_what_was_said(served: Served) -> None:
    """Of a machine made on the page the lines are those of the file saved there."""
    part = served.ask("run", STICK_SLIP, {"masses.stage": "1.1 kg"})[-1]
    assert part["command"] == 'friso simulate lugre_stick_slip.toml --set masses.stage="1.1 kg"'
    assert part["python"] == "friso.simulate('lugre_stick_slip.toml', set={'masses.stage': '1.1 kg'})"
    made = served.ask("run", STICK_SLIP, {"motion.jerk": None})[-1]
    assert (made["of"], "--set" in made["command"]) == ("the stage file saved here", False)
    kept = served.keep("my%20log.csv", LOG.replace(b"time [s],position [m]", b"t,x"))
    part = served.ask("logs", RIG, files=[kept], map={"position": "x", "time": "t"}, dt="1 ms", assumed=True)[-1]
    assert part["command"] == 'friso logs "my log.csv" --map position=x --map time=t --dt "1 ms"'


@pytest.mark.parametrize(
    ("name", "plain"),
    [
        ("../../x.toml", "x.toml"),
        ("--out=x", "out_x"),
        ("", "stage.toml"),
        ("..", "stage.toml"),
        ('a/"b\n.toml', "_b_.toml"),
    ],
)
def test_the_name_of_a_machine_is_that_of_a_file(name: str, plain: str) -> None:
    assert Machine.of({"text": "", "name": name}).name == plain


def test_an_uncertain_value_is_shown_as_one_and_warned_of_every_time(served: Served) -> None:
    uncertain = {"masses.stage": "1 kg .. 1.2 kg"}
    (part,) = served.ask("machine", STICK_SLIP, uncertain)
    key = next(key for table in part["tables"] for key in table["keys"] if key["path"] == "masses.stage")
    assert (key["plain"], key["si"], key["unit"]) == (False, pytest.approx(1.1), "kg")
    for _ in range(2):
        part = served.ask("run", STICK_SLIP, uncertain)[-1]
        assert any("masses.stage" in note for note in part["notes"])
    assert served.ask("run", STICK_SLIP)[-1]["notes"] == []


UNSTABLE = {"controller.alpha": 0.99, "controller.beta": 1, "controller.crossover": "40 Hz"}


def test_an_answer_is_there_at_once_for_whoever_comes_back_with_what_was_noted() -> None:
    """The latest answer of each kind is kept; other options make another answer, and an overtaken one is none."""
    asked: list[tuple[Any, ...]] = []

    def question(stage: Any, *, draws: int = 0, progress: Any) -> Any:
        asked.append((stage.name, draws))
        progress(0, 1, "")
        work.notes.append("a note")
        return object()

    kept, rig = KeptAnswers(), Machine(RIG.read_text(encoding="utf-8"), "rig.toml")
    work = Work(lambda part: None)
    first = kept.answer(question, rig, work)
    assert kept.answer(question, rig, work, {"draws": 10}) is not first
    work = Work(lambda part: None)
    assert (kept.answer(question, rig, work), work.notes, len(asked)) == (first, ["a note"], 2)
    work.overtake()
    other = replace(rig, changed='{"controller.crossover": "9 Hz"}')
    with pytest.raises(Overtaken), ended_by(work.flag):
        kept.answer(question, other, work)
    work = Work(lambda part: None)
    for crossover in range(KEPT_ANSWERS):
        kept.answer(question, replace(rig, changed=f'{{"controller.crossover": "{9 + crossover} Hz"}}'), work)
    assert kept.answer(question, rig, work) is not first


@pytest.mark.slow
def test_an_unstable_loop_is_mentioned_while_its_answer_is_computed(served: Served) -> None:
    """Before that, whose sentences say it; the words of a slider do not, and have it as a note."""
    *said, last = served.ask("check", RIG, UNSTABLE)
    first = next(part for part in said if part.get("lasts"))  # a kernel may be compiled before
    assert "unstable while" in first["text"]
    assert "unstable while" in last["sentences"][0]
    assert last["notes"] == []
    assert served.ask("verdict", RIG, UNSTABLE)[-1]["notes"] == [first["text"]]


@pytest.mark.cases(first=1)
@pytest.mark.parametrize(
    ("question", "certain", "in_short"),
    [
        ("verdict", False, "unstable with its delay; without: settles"),
        ("check", True, "unstable with its delay; as built: settles"),
    ],
)
def test_a_verdict_says_whether_it_leaves_out_a_drive(
    served: Served, question: str, certain: bool, in_short: str
) -> None:
    """The loop of the wrist of the examples is unstable with its delays, while friction holds it at rest."""
    answer = served.ask(question, Path(friso.example("robot_wrist")))[-1]
    assert (answer["verdict"], answer["certain"], answer["in_short"]) == ("settles", certain, in_short)
    assert served.ask(question, RIG)[-1]["certain"]


@pytest.mark.slow
def test_the_cures_of_a_machine_are_those_of_its_check_and_stop_its_hunting(served: Served) -> None:
    """A machine that does not hunt has none."""
    check = served.ask("check", RIG, {"joint.locked": True})[-1]
    faster, free = check["cures"]
    assert faster["label"].removeprefix("Raise to ") in " ".join(check["sentences"])
    assert free["values"] == {"joint.locked": False}
    raised = {"joint.locked": True, "controller.crossover": f"{faster['values']['controller.crossover']} Hz"}
    assert served.ask("verdict", RIG, raised)[-1]["verdict"] == "settles"
    assert served.ask("check", RIG)[-1]["cures"] == []


def test_tracks_have_the_verdicts_at_their_values_and_other_values_are_refused(served: Served) -> None:
    tracks = served.ask("tracks", RIG, {"joint.locked": True}, values={"controller.crossover": [8.0, 12.0]})
    assert tracks[-1]["tracks"] == {"controller.crossover": ["hunts", "settles"]}
    unusable = (["8 Hz"], [1.0] * 100, [10**400])
    for values in ([1.0], *({"controller.crossover": column} for column in unusable)):
        assert served.ask("tracks", RIG, {}, values=values)[-1]["kind"] == "refused"


def test_a_reference_that_keeps_moving_has_no_verdict(served: Served, tmp_path: Path) -> None:
    """The word of the slider is that of the check; values that nobody knows are said beside it."""
    sine = tmp_path / "sine.toml"
    sine.write_text(Path(friso.example("motions/sine")).read_text(encoding="utf-8"), encoding="utf-8")
    assert served.ask("verdict", sine)[-1]["verdict"] == "none"
    guessed = tmp_path / "guessed.toml"
    guessed.write_text(friso.load(RIG).replace({"unknown": "friction.static"}).to_toml(), encoding="utf-8")
    answer = served.ask("verdict", guessed)[-1]
    assert answer["verdict"] == served.ask("verdict", RIG)[-1]["verdict"]
    assert any(note.startswith("If friction.static") for note in answer["notes"])


# ---------------------------------------------------------------- overtaken


async def frames(workshop: Workshop, lane: str, number: int, job: Any, quick: bool = False) -> list[bytes]:
    """The answer to one question."""
    return [frame async for frame in workshop.answer("", lane, number, job, quick)]


def test_a_question_that_computes_nothing_does_not_wait_for_those_that_do() -> None:
    async def asked() -> list[bytes]:
        workshop, go = Workshop(), threading.Event()
        slow = [frames(workshop, str(k), 0, lambda _: iter([{}][: go.wait(LIMIT)])) for k in range(20)]
        waiting = [asyncio.create_task(one) for one in slow]
        try:
            await asyncio.sleep(0)
            return await frames(workshop, "quick", 0, lambda _: iter([{"kind": "answer"}]), True)
        finally:
            go.set()
            await asyncio.gather(*waiting)
            workshop.close()

    (frame,) = asyncio.run(asked())
    assert b"answer" in frame


IMPORTED = """
import sys
from importlib import import_module
from friso.app.work import Workshop
sys.setswitchinterval(1e-6)
list(Workshop().pool.map(import_module, ["dask.array.ma", "dask.array", "dask.array.routines", "dask.array.core"]))
"""


@pytest.mark.slow
def test_questions_that_begin_at_once_import_what_they_need() -> None:
    """Two threads that import modules which import one another each found one half done."""
    subprocess.run([sys.executable, "-c", IMPORTED], check=True)


def test_at_the_end_answers_end_before_what_computes_notices() -> None:
    async def asked() -> list[bytes]:
        workshop, begun, go = Workshop(), threading.Event(), threading.Event()

        def job(work: Work) -> Iterator[dict[str, Any]]:
            begun.set()
            go.wait(LIMIT)
            yield {}

        answered = asyncio.create_task(frames(workshop, "tune", 1, job))
        try:
            while not begun.is_set():
                await asyncio.sleep(0.001)
            workshop.overtake()
            return await asyncio.wait_for(answered, 30)
        finally:
            go.set()
            workshop.close()

    (frame,) = asyncio.run(asked())
    assert b"overtaken" in frame


def test_a_log_that_is_cut_off_by_the_end_of_the_server_is_no_error(capsys: pytest.CaptureFixture[str]) -> None:
    """Requests by others to the same server in this process still get their errors afterwards."""

    async def ended() -> None:
        with listening(0) as listener:
            port, workshop = listener.getsockname()[1], Workshop()
            access = Access.at(port)
            app = application(access, {}, workshop)
            server = Server(app, workshop, grace=0)
            served = asyncio.create_task(server.serve([listener]))
            while not server.started:
                await asyncio.sleep(0.001)
            _, writer = await asyncio.open_connection("127.0.0.1", port)
            head = f"Host: 127.0.0.1:{port}\r\nAuthorization: Bearer {access.session}\r\nContent-Length: 1000\r\n\r\n"
            writer.write(f"POST /logs/a.csv HTTP/1.1\r\n{head}1,2\n".encode())
            while not server.server_state.tasks:
                await asyncio.sleep(0.001)
            server.should_exit = True
            await served
            writer.close()

    asyncio.run(ended())
    assert capsys.readouterr().err == ""
    assert logging.getLogger("uvicorn.error").isEnabledFor(logging.ERROR)


def test_a_browser_that_disconnects_ends_what_it_asked(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    """A request ends at once although nothing is being sent.

    Starlette listens for a disconnect only with ASGI up to 2.3.
    """
    begun, ended, given_up = threading.Event(), threading.Event(), threading.Event()

    def job(asked: Any, work: Work) -> Iterator[dict[str, Any]]:
        begun.set()
        while not work.flag[0] and not given_up.is_set():
            time.sleep(0.001)
        if work.flag[0]:
            ended.set()
        yield {"kind": "answer"}

    monkeypatch.setitem(QUESTIONS, "run", job)  # type: ignore[arg-type]
    body = json.dumps({"machine": {"text": ""}}).encode()
    head = f"Host: 127.0.0.1:{served.port}\r\nAuthorization: Bearer {served.access.session}\r\n"
    head += f"Content-Type: application/json\r\nContent-Length: {len(body)}\r\n\r\n"
    try:
        with socket.create_connection(("127.0.0.1", served.port)) as browser:
            browser.sendall(f"POST /ask/run HTTP/1.1\r\n{head}".encode() + body)
            assert begun.wait(LIMIT)
            assert not ended.is_set()
        assert ended.wait(LIMIT)
    finally:
        given_up.set()


def test_a_question_that_arrives_late_does_not_overtake_a_newer_one() -> None:
    """Two connections are read in any order."""

    async def asked() -> list[list[bytes]]:
        workshop, go = Workshop(), threading.Event()

        def job(work: Work) -> Iterator[dict[str, Any]]:
            assert go.wait(LIMIT)
            go_on()
            yield {"kind": "answer"}

        newer = asyncio.create_task(frames(workshop, "run", 2, job))
        await asyncio.sleep(0)
        late = await frames(workshop, "run", 1, job)
        go.set()
        answers = [late, await newer]
        workshop.close()
        return answers

    (late,), (newer,) = asyncio.run(asked())
    assert b"overtaken" in late
    assert b"answer" in newer


def test_what_fails_once_it_is_overtaken_is_logged_alone(
    capsys: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    """When the server ends, pools take no more work."""
    caplog.set_level("DEBUG", "friso")

    def job(work: Work) -> Iterator[dict[str, Any]]:
        if overtaken:
            work.overtake()
        raise RuntimeError("cannot schedule new futures after interpreter shutdown")
        yield {}

    for overtaken, kind in [(False, "failed"), (True, "overtaken")]:
        parts: list[Any] = []
        Work(parts.append).run(job)
        assert [part and part["kind"] for part in parts] == [kind, None]
        assert ("Traceback" in capsys.readouterr().err) == (not overtaken)
        assert ("cannot schedule" in caplog.text) == overtaken


def test_work_that_is_overtaken_ends_at_the_next_batch_and_leaves_nothing() -> None:
    flag = np.zeros(1, np.int64)
    with ended_by(flag):
        before = friso.simulate(STICK_SLIP)["position"].values
        flag[0] = 1
        with pytest.raises(Overtaken):
            friso.simulate(STICK_SLIP)
        with pytest.raises(Overtaken):
            go_on()
    assert np.array_equal(friso.simulate(STICK_SLIP)["position"].values, before)


def test_all_other_work_waits_at_its_next_batch_while_something_goes_first() -> None:
    """The threads of the work that goes first do not wait, and nobody waits for slow work."""
    order = []

    def other() -> None:
        begun.set()
        go_on()
        order.append("other")

    begun = threading.Event()
    with BuildSettings(priority_time=60.0).in_use(), going_first(), local_crew() as crew:
        thread = threading.Thread(target=other)
        thread.start()
        begun.wait(LIMIT)
        crew.executor.submit(go_on).result(LIMIT)
        go_on()
        order.append("first")
    thread.join()
    assert order == ["first", "other"]
    with BuildSettings(priority_time=0.0).in_use(), going_first():
        thread = threading.Thread(target=other)
        thread.start()
        thread.join()
    assert order == ["first", "other", "other"]


def test_a_question_goes_first_until_its_picture_is_there() -> None:
    """Work after the picture waits for another question's picture, as all work does."""
    firsts: list[bool] = []

    def job(_: Work) -> Iterator[dict[str, Any]]:
        for kind in ("partly", "answer"):
            firsts.append(is_first())
            yield {"kind": kind}

    for first in (True, False):
        Work(lambda _: None, first=first).run(job)
    assert firsts == [True, False, False, False]
