"""The program that fills the cache entry of the compiled `friso.hunting.turning` (see `friso.engine.build`)."""

from __future__ import annotations

import inspect
import re
import sys
from pathlib import Path
from types import ModuleType

import numba
import numpy as np

from friso.engine.cache import keep
from friso.hunting import turning

_JIT = 'error_model="numpy", nogil=True'


def compile_run(module: ModuleType) -> None:
    """Compile (or load from Numba's cache) `run` for the arrays it is called with."""
    whole = np.zeros((2, 2))
    square, flat = whole[:, :1], whole[:, 0]  # as parts of larger arrays, for which whole ones can stand in
    marks, numbers = np.zeros((1, 1), np.bool_), np.zeros(1)
    arguments = (square, square, np.zeros(1, np.int64), flat, flat, marks, marks, numbers, numbers, numbers)
    module.run.compile(tuple(numba.typeof(argument) for argument in arguments))
    module.run.disable_compile()


def main(folder: Path) -> None:
    """Compiles the loops over turning points into a folder; prints the name of the entry."""
    source = re.sub(r"^def ", f"@njit({_JIT})\ndef ", inspect.getsource(turning), flags=re.MULTILINE)
    source = source.replace(f"@njit({_JIT})\ndef run(", f"@njit(cache=True, {_JIT})\ndef run(")
    source = source.replace("import numpy as np\n", "import numpy as np\nfrom numba import njit\n")
    print(keep(folder, source, compile_run), end="")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
