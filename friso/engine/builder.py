"""Program that fills the cache: ``python -m friso.engine.builder FOLDER``.

It receives pairs, the name of a module and a task (`friso.platform.interrupts`). The module's `build(folder, task)`
compiles the task into the cache's FOLDER. The program returns the name of the entry, or the OSError that prevented it.
"""

from __future__ import annotations

import gc
import sys
from importlib import import_module
from pathlib import Path

from friso.platform.helper_process import answer_questions

BUILDER_GARBAGE_THRESHOLDS = (100_000, 50, 100)
"""Thresholds of the garbage collector of a builder. With the usual ones collection takes a tenth of the time."""


def main(folder: Path) -> None:
    """Compile the requests that arrive, into a folder of the cache."""
    gc.set_threshold(*BUILDER_GARBAGE_THRESHOLDS)

    def built(asked: tuple[str, bytes]) -> str | OSError:
        """Build one request; return the name of its entry, or the error that prevented it."""
        builder, task = asked
        try:
            return import_module(builder).build(folder, task)
        except OSError as error:  # a full disk is not the fault of the built code, so no traceback helps
            return error

    answer_questions(built)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
