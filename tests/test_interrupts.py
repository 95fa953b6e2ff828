"""Ctrl-C and a termination at any moment: one line, and the status that shells know."""

import os
import random
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from threading import Event, Timer
from typing import Any
from urllib.error import HTTPError
from urllib.request import urlopen

import numpy as np
import pytest
from filelock import FileLock
from inside import friso_inside
from patience import LIMIT, wait_until
from systems import posix

from friso.engine import building
from friso.engine.overtaken import Overtaken, ended_by
from friso.interface.output_folder import write_file
from friso.platform import early, interrupts

pytestmark = posix  # elsewhere a process cannot send itself such a signal, but is ended

RIG = Path(__file__).parent.parent / "examples" / "thesis_rig.toml"
COMMAND = [sys.executable, "-X", "importtime", "-m", "friso", "bode", str(RIG)]


@pytest.mark.cases(first=1, slow=1)
@pytest.mark.parametrize("seed", range(4))
def test_a_signal_while_friso_starts_is_one_line(tmp_path: Path, seed: int) -> None:
    """After a random one of the modules that are imported."""
    number = [signal.SIGINT, signal.SIGTERM][seed % 2]
    wanted = random.Random(seed).randrange(10, 400)
    with subprocess.Popen(COMMAND, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        imported, line = 0, ""
        for line in process.stderr:
            imported += imported > 0 or "friso.platform.early" in line
            if imported == wanted:
                process.send_signal(number)
        assert process.wait() == 128 + number
    assert line == f"friso: {'interrupted' if number == signal.SIGINT else 'terminated'}\n"


@pytest.mark.parametrize("number", early.SIGNALS)
@pytest.mark.parametrize("becomes", [None, ImportError("a library that is half there"), SystemExit(0)])
def test_a_signal_that_a_library_turns_into_something_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: signal.Signals, becomes: BaseException | None
) -> None:
    def interrupted(*_: Any, **__: Any) -> None:
        try:
            os.kill(os.getpid(), number)
            time.sleep(10)
        except KeyboardInterrupt:
            if becomes is not None:
                raise becomes from None
            raise

    monkeypatch.setattr("friso.questions.bode.question.read_stage", interrupted)
    before = signal.getsignal(number)
    done = friso_inside(tmp_path, "bode", RIG)
    assert done.returncode == 128 + number
    assert done.stderr == f"friso: {'interrupted' if number == signal.SIGINT else 'terminated'}\n"
    assert signal.getsignal(number) is before


AT_THE_END = """
import atexit, signal, sys

atexit.register(lambda: print(signal.getsignal(signal.SIGTERM) is signal.SIG_IGN))
sys.argv[0] = "friso"
import friso.platform.interrupts
"""


def test_a_command_that_is_done_is_not_ended_by_a_signal() -> None:
    """Without protection it would be, once Python has removed its signal handlers at exit."""
    done = subprocess.run([sys.executable, "-c", AT_THE_END], capture_output=True, text=True)
    assert done.stdout == "True\n", done.stderr


def test_a_termination_in_code_from_a_text_has_its_own_status(tmp_path: Path) -> None:
    """Python remembers that such code ended in a KeyboardInterrupt, and would end by SIGINT."""
    lines = ["from friso.cli import app", f"app._run = lambda: exec({_TERMINATION!r})", "app.main()"]
    (tmp_path / "terminated.py").write_text("\n".join(lines), "utf-8")
    environ = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])}
    done = subprocess.run(
        [sys.executable, "-m", "terminated"], cwd=tmp_path, capture_output=True, text=True, env=environ
    )
    assert (done.returncode, done.stderr) == (128 + signal.SIGTERM, "friso: terminated\n")


_TERMINATION = "import signal; signal.raise_signal(signal.SIGTERM)"


HALF_THERE = "import os, signal\nos.kill(os.getpid(), signal.SIGINT)\nwhole = True\n"


@pytest.mark.cases(first=2)
@pytest.mark.parametrize("then", ["wait", "whole", "file"])
def test_ctrl_c_during_an_import(then: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The import ends first, and what must be whole after it; files that would be put in place after it are not."""
    (tmp_path / f"half_there_{then}.py").write_text(HALF_THERE)
    monkeypatch.syspath_prepend(tmp_path)
    if then == "file":  # which is written before the signal comes again
        monkeypatch.setattr(interrupts, "IMPORT_CHECK_INTERVAL", 0.3)
    done: list[str] = []

    def import_and_go_on() -> None:
        import_module(f"half_there_{then}")
        if then == "file":
            write_file("FILE", tmp_path / "a.txt", "a", False)
        elif then == "whole":
            with interrupts.hold_interrupts():
                time.sleep(0.1)
                done.append("whole")
        time.sleep(10)
        done.append("not interrupted")

    with pytest.raises(KeyboardInterrupt), interrupts.raising():
        import_and_go_on()
    assert sys.modules[f"half_there_{then}"].whole
    assert done == ["whole"] * (then == "whole")
    assert not (tmp_path / "a.txt").exists()


STUCK = """
import os, signal, sys, time
from hashlib import pbkdf2_hmac
from threading import Timer

sys.argv[0] = "friso"
from friso.platform import interrupts

def swallow():
    while True:
        try:
            time.sleep(60)
        except KeyboardInterrupt:
            pass

def write():
    try:
        with interrupts.hold_interrupts():
            time.sleep(1)
            open("whole", "w").close()
    except KeyboardInterrupt:
        swallow()

def answer():
    interrupts.answers_interrupts()
    try:
        time.sleep(60)
    except KeyboardInterrupt:
        time.sleep(1)
        print("the best so far")

interrupts.ENDING_TIME = 0.2
open("endless.py", "w").write("import time\\ntime.sleep(60)\\n")
sys.path.insert(0, "")
with interrupts.raising():
    Timer(0.3, os.kill, (os.getpid(), signal.SIGTERM)).start()
    WAY
"""


CLOSED, FULL = "os.close(2)", "end, full = os.pipe(); os.dup2(full, 2); os.write(2, bytes(2**16))"


@pytest.mark.cases(first=1)
@pytest.mark.parametrize(
    "way",
    ["import endless", "pbkdf2_hmac('sha256', b'', b'', 2 * 10**9)", "swallow()", "write()"]
    + [f"{closed}; swallow()" for closed in (CLOSED, FULL)],
)
def test_a_command_that_cannot_be_interrupted_is_ended(tmp_path: Path, way: str) -> None:
    """A command stuck in an import, in a library or in code that swallows the exception is ended.

    A file that must be written completely is finished first. Its last word may go to a terminal that is closed, or into
    a pipe that is full.
    """
    program = [sys.executable, "-c", STUCK.replace("WAY", way)]
    done = subprocess.run(program, cwd=tmp_path, capture_output=True, text=True, timeout=LIMIT)
    silent = way.startswith((CLOSED, FULL))
    assert (done.returncode, done.stderr) == (128 + signal.SIGTERM, "" if silent else "friso: terminated\n")
    assert (tmp_path / "whole").exists() == (way == "write()")


def test_a_signal_that_is_ignored_is_so_where_others_wait() -> None:
    """friso under nohup ignores the closing of its terminal in the same way."""
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with interrupts.hold_interrupts():
            assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)


@pytest.mark.slow
def test_a_command_that_answers_an_interrupt_has_the_time_for_it(tmp_path: Path) -> None:
    program = [sys.executable, "-c", STUCK.replace("WAY", "answer()")]
    done = subprocess.run(program, cwd=tmp_path, capture_output=True, text=True, timeout=LIMIT)
    assert (done.returncode, done.stdout, done.stderr) == (0, "the best so far\n", "")


WAITING = """
import os, signal, sys, time

sys.argv[0] = "friso"
from friso.platform import interrupts
from friso.platform.system import interrupts_held

with interrupts.raising():
    try:
        with interrupts_held():
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.5)
            print("whole")
        time.sleep(10)
    except KeyboardInterrupt:
        print("interrupted")
"""


def test_ctrl_c_that_the_main_thread_does_not_take_waits() -> None:
    """The thread that watches for signals takes none for it."""
    done = subprocess.run([sys.executable, "-c", WAITING], capture_output=True, text=True, timeout=LIMIT)
    assert (done.stdout, done.stderr) == ("whole\ninterrupted\n", "")


class Going:
    """An object that raises SIGINT in its destructor, where Python ignores exceptions."""

    def __del__(self) -> None:
        signal.raise_signal(signal.SIGINT)


class Cut:
    """An object whose finalizer fails on what an interrupt has left undone."""

    def __del__(self) -> None:
        raise ValueError("created in a different Context")


def _let_go_and_wait() -> None:
    Going()
    time.sleep(10)


def _stumble() -> None:
    try:
        signal.raise_signal(signal.SIGINT)
    finally:
        Cut()


@pytest.mark.parametrize("work", [_let_go_and_wait, _stumble])
def test_ctrl_c_while_an_object_goes_is_not_lost_and_nothing_is_said(
    work: Callable[[], None], capfd: pytest.CaptureFixture[str]
) -> None:
    hook = sys.unraisablehook
    with pytest.raises(KeyboardInterrupt), interrupts.raising():
        work()
    assert capfd.readouterr().err == ""
    assert sys.unraisablehook is hook


class Builder:
    """Stands in for a process that builds: it ends, with nothing built, when it is killed."""

    def __init__(self, *_: object) -> None:
        self.killed = Event()

    def build(self, request: object) -> str:
        self.killed.wait(LIMIT)
        return ""

    def kill(self) -> None:
        self.killed.set()

    def end(self) -> str:
        return "ended"


@dataclass(frozen=True)
class Request:
    """A file to be built, with a lock of its own."""

    file: Path
    title: str = "a kernel"
    plug_ins: str = ""

    def lock(self) -> FileLock:
        return FileLock(self.file)

    def entry(self) -> None:
        return None

    def answer(self, name: str) -> None:
        pass


def requests(folder: Path, count: int) -> list[Any]:
    return [Request(folder / f"{n}.lock") for n in range(count)]


def test_compiling_that_is_given_up_is_not_begun_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    waiting, started = [Builder()], []

    class Failing(Builder):
        def build(self, request: object) -> str:
            started.append(self)
            return ""

    monkeypatch.setattr(building, "usable_cores", lambda: 2)
    monkeypatch.setattr(building, "_taken", lambda surroundings: waiting.pop() if waiting else None)
    monkeypatch.setattr(building, "_Builder", Failing)
    with pytest.raises(RuntimeError, match="could not be compiled"):
        building._Work().finish(requests(tmp_path, 2))
    assert len(started) == 1  # the builder that was killed is not replaced


def test_what_is_compiled_when_its_question_is_overtaken_is_there_for_the_next(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun, go = [], Event()

    class Building(Builder):
        def build(self, request: object) -> str:
            begun.append(request)
            go.wait(LIMIT)
            return "name"

    monkeypatch.setattr(building, "_taken", lambda surroundings: None)
    monkeypatch.setattr(building, "_waiting", [])
    monkeypatch.setattr(building, "_Builder", Building)
    work, flag = building._Work(), np.zeros(1, np.int64)
    asked = requests(tmp_path, 1)
    Timer(0.3, lambda: flag.fill(1)).start()
    with pytest.raises(Overtaken), ended_by(flag):
        work.finish(asked)
    Timer(0.3, go.set).start()
    work.finish(asked)
    assert len(begun) == 1


def test_who_waits_for_another_that_compiles_can_be_interrupted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(building, "usable_cores", lambda: 1)
    interrupts.signal_later(0.3, lambda *_: os.kill(os.getpid(), signal.SIGINT))
    with FileLock(tmp_path / "0.lock"), pytest.raises(KeyboardInterrupt), interrupts.raising():
        building._Work().finish(requests(tmp_path, 1))


def _answers(address: str) -> bool:
    try:
        urlopen(address, timeout=LIMIT)
    except HTTPError:  # it refuses one without a token
        return True
    except OSError:
        return False
    return True


@pytest.mark.slow
@pytest.mark.parametrize("signals", [[signal.SIGHUP], [signal.SIGINT, signal.SIGINT]])
def test_the_app_ends_in_one_line(signals: list[signal.Signals]) -> None:
    """The app also does so if the terminal is closed, and if an impatient user presses Ctrl-C again."""
    command = [sys.executable, "-m", "friso", "app", str(RIG), "--no-browser"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        address = re.search(r"http://[^/]+", process.stdout.readline())
        assert address is not None
        wait_until(lambda: _answers(address[0]))
        for number in signals:
            process.send_signal(number)
        assert process.wait(LIMIT) == 128 + signals[0]
        assert process.stderr is not None
        assert process.stderr.read() == f"friso: {'interrupted' if signals[0] == signal.SIGINT else 'terminated'}\n"
