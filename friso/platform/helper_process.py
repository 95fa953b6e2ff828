"""Run Python processes that answer questions of this one, one at a time.

A process ends by itself if no question comes for a while, or its parent has ended.
"""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable
from contextlib import suppress
from threading import Thread, Timer
from typing import Any

QUESTION_WAIT = 60.0
"""Time [s] to wait for the next question. Longer waits keep 150 MB per process."""


class HelperProcess:
    """A process that runs a module with `answer_questions`; `paths` are its import paths."""

    def __init__(self, module: str, *arguments: str, paths: Iterable[str]) -> None:
        self._messages = tempfile.TemporaryFile()  # noqa: SIM115, open as long as the process lives
        environ = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths)), "PYTHONIOENCODING": "utf-8"}
        command = [sys.executable, "-P", "-m", module, *arguments]
        pipe = subprocess.PIPE
        self._process = subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=self._messages, env=environ)
        Thread(target=self._process.wait, daemon=True).start()  # so that a process that has ended is no zombie

    def ask(self, question: object) -> Any:
        """Ask the process a question, and return its answer.

        Raises EOFError if it has ended.
        """
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        with suppress(OSError):  # the process has ended, and says why
            pickle.dump(question, self._process.stdin)
            self._process.stdin.flush()
        try:
            return pickle.load(self._process.stdout)
        except pickle.UnpicklingError as error:  # it ended while answering
            raise EOFError(str(error)) from None

    def end(self) -> str:
        """End the process, and return its standard error output."""
        with suppress(OSError):
            self._process.communicate()
        self._messages.seek(0)
        message = self._messages.read().decode(errors="replace")
        self._messages.close()
        return message

    def kill(self) -> None:
        """Kill the process at once."""
        self._process.kill()


def answer_questions(answer: Callable[[Any], Any]) -> None:
    """Answer the questions on standard input until there are no more, or none comes for a while."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C on a terminal: the parent ends this process
    answers, sys.stdout = sys.stdout, sys.stderr  # output of plug-ins must not mix with answers
    while True:
        patience = Timer(QUESTION_WAIT, os._exit, (0,))
        patience.daemon = True
        patience.start()
        try:
            question = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        patience.cancel()
        pickle.dump(answer(question), answers.buffer)
        answers.buffer.flush()
