"""Build the compiled `friso.hunting.turning`.

This runs in the process that fills the cache (`friso.engine.builder`).
"""

from __future__ import annotations

import inspect
from pathlib import Path

from friso.engine.cache import keep
from friso.engine.machine_code import object_code
from friso.engine.scalar_code import scalar_llvm
from friso.hunting import turning
from friso.hunting.turning import KINDS


def build(folder: Path, task: bytes) -> str:
    """Compile the loops over turning points into a folder of the cache.

    Returns the name of the entry.
    """
    return keep(folder, inspect.getsource(turning), lambda module: object_code(scalar_llvm(module.run, KINDS)))
