"""The program that fills the cache: ``python -m friso.engine.builder FOLDER``.

It reads pickled pairs from standard input, the name of a module and a task, has the module's `build(folder, task)` keep
what the task asks for in the cache's FOLDER, and prints the name of the entry, until there are no more.
"""

from __future__ import annotations

import pickle
import sys
from importlib import import_module
from pathlib import Path


def main(folder: Path) -> None:
    """Build what is asked for on standard input."""
    answers, sys.stdout = sys.stdout, sys.stderr  # what plug-ins print is no answer
    while True:
        try:
            builder, task = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        try:
            print(import_module(builder).build(folder, task), file=answers, flush=True)
        except OSError as error:  # the disk is full: no fault of what is built, whose traceback would help
            sys.exit(f"{folder}: {error.strerror or error}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
