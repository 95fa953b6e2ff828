"""The program that fills a cache entry: writes a kernel's module, and compiles it so that Numba keeps the machine code.

Run by `friso.engine.cache` as ``python -m friso.engine.build FOLDER``, with the task pickled on standard input; prints
the name of the entry in the cache's FOLDER.
"""

from __future__ import annotations

import pickle
import sys
from pathlib import Path

from friso.engine.cache import keep
from friso.engine.kernel import Form, compile_driver
from friso.engine.module_source import write_module
from friso.engine.tableaus import TABLEAUS
from friso.equations.as_built import AsBuilt, as_built
from friso.equations.driven import Driven, driven
from friso.equations.imposed import Imposed, imposed
from friso.equations.model import Model, assemble
from friso.equations.variational import variational


def main(folder: Path, task: bytes) -> None:
    """Generates and compiles the kernel that a pickled task asks for into a folder; prints the name of its entry."""
    plug_ins, pickled = pickle.loads(task)
    for plug_in in plug_ins:
        plug_in.load()
    request = pickle.loads(pickled)
    model = _model(request.structure)
    model = variational(model) if request.variational else model
    source = write_module(model, TABLEAUS[request.method], repr(request), request.lanes)
    print(keep(folder, source, compile_driver), end="")


def _model(form: Form) -> Model:
    if isinstance(form, Imposed):
        return imposed(form)
    if isinstance(form, AsBuilt):
        return as_built(form)
    return driven(form) if isinstance(form, Driven) else assemble(form)


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.stdin.buffer.read())
