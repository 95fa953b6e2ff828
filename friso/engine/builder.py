"""The program that fills the cache: ``python -m friso.engine.builder FOLDER``.

It reads pickled pairs from standard input, the name of a module and a task, has the module's `build(folder, task)` keep
what the task asks for in the cache's FOLDER, and prints the name of the entry, until there are no more, or none comes
for a while.
"""

from __future__ import annotations

import os
import pickle
import signal
import sys
from importlib import import_module
from pathlib import Path
from threading import Timer

PATIENCE = 60.0  # [s] it holds 150 MB


def main(folder: Path) -> None:
    """Build what is asked for on standard input."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # of a terminal: who started this one ends it
    answers, sys.stdout = sys.stdout, sys.stderr  # what plug-ins print is no answer
    while True:
        patience = Timer(PATIENCE, os._exit, (0,))
        patience.daemon = True
        patience.start()
        try:
            builder, task = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        patience.cancel()
        try:
            print(import_module(builder).build(folder, task), file=answers, flush=True)
        except OSError as error:  # the disk is full: no fault of what is built, whose traceback would help
            sys.exit(f"{folder}: {error.strerror or error}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
