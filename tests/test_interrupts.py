"""Ctrl-C and a termination at any moment: one line, and the status that shells know."""

import os
import random
import re
import signal
import subprocess
import sys
import time
from importlib import import_module
from pathlib import Path
from typing import Any
from urllib.error import HTTPError
from urllib.request import urlopen

import pytest
from inside import friso_inside
from patience import LIMIT, wait_until
from systems import posix

from friso.interface.output_folder import write_file
from friso.platform import early, interrupts

pytestmark = posix  # elsewhere a process cannot send itself such a signal, but is ended

RIG = Path(__file__).parent.parent / "examples" / "thesis_rig.toml"
COMMAND = [sys.executable, "-X", "importtime", "-m", "friso", "bode", str(RIG)]


@pytest.mark.cases(first=1, slow=1)
@pytest.mark.parametrize("seed", range(2))
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


FULL = "end, full = os.pipe(); os.dup2(full, 2); os.write(2, bytes(2**16))"


@pytest.mark.cases(first=1)
@pytest.mark.parametrize(
    "way",
    ["import endless", "pbkdf2_hmac('sha256', b'', b'', 2 * 10**9)", "swallow()", "write()", f"{FULL}; swallow()"],
)
def test_a_command_that_cannot_be_interrupted_is_ended(tmp_path: Path, way: str) -> None:
    """A command stuck in an import, in a library or in code that swallows the exception is ended.

    A file that must be written completely is finished first. Its last word may go into a pipe that is full.
    """
    program = [sys.executable, "-c", STUCK.replace("WAY", way)]
    done = subprocess.run(program, cwd=tmp_path, capture_output=True, text=True, timeout=LIMIT)
    silent = way.startswith(FULL)
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


class Going:
    """An object that raises SIGINT in its destructor, where Python ignores exceptions."""

    def __del__(self) -> None:
        signal.raise_signal(signal.SIGINT)


def test_ctrl_c_while_an_object_goes_is_not_lost_and_nothing_is_said(capfd: pytest.CaptureFixture[str]) -> None:
    def let_go_and_wait() -> None:
        Going()
        time.sleep(10)

    hook = sys.unraisablehook
    with pytest.raises(KeyboardInterrupt), interrupts.raising():
        let_go_and_wait()
    assert capfd.readouterr().err == ""
    assert sys.unraisablehook is hook


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
        address = re.search(r"http://[^/]+", process.stdout.readline())
        wait_until(lambda: _answers(address[0]))
        for number in signals:
            process.send_signal(number)
        assert process.wait(LIMIT) == 128 + signals[0]
        assert process.stderr.read() == f"friso: {'interrupted' if signals[0] == signal.SIGINT else 'terminated'}\n"
