"""Compile models' code, and the loops that run it, in the process that fills the cache.

`friso.engine.builder` starts that process.
"""

from __future__ import annotations

import inspect
import pickle
from functools import cache
from pathlib import Path
from types import ModuleType

from friso.engine import driver, scalar_code, vector_code
from friso.engine.cache import keep
from friso.engine.kernel import KernelForm, driver_kinds
from friso.engine.layout import FUNCTIONS
from friso.engine.machine_code import object_code
from friso.engine.module_source import write_module
from friso.engine.tableaus import TABLEAUS
from friso.equations.as_built import AsBuilt, as_built
from friso.equations.dragged import Dragged, dragged
from friso.equations.driven import Driven, driven
from friso.equations.imposed import Imposed, imposed
from friso.equations.model import Model, assemble
from friso.equations.variational import variational
from friso.stage.plug_ins import PlugIn


def build(folder: Path, task: bytes) -> str:
    """Compile a model's code, for the request in a pickled task.

    Without a task, the loops that run any model's code are compiled. The code goes into a `folder` of the cache.
    Returns the name of the entry.
    """
    if not task:
        return keep(folder, inspect.getsource(driver), _loops_code)
    plug_ins, pickled = pickle.loads(task)
    for plug_in in plug_ins:
        _load(plug_in)
    request = pickle.loads(pickled)
    model = _model(request.structure)
    model = variational(model) if request.variational else model
    source = write_module(model, TABLEAUS[request.method], repr(request), request.lanes)
    return keep(folder, source, _code)


@cache
def _load(plug_in: PlugIn) -> None:
    """Load a plug-in once, which registers its names."""
    plug_in.load()


def _loops_code(module: ModuleType) -> bytes:
    """Return the machine code of the loops that run any model's code."""
    return object_code(scalar_code.scalar_llvm(module.run, driver_kinds()))


def _code(module: ModuleType) -> bytes:
    """Return the machine code of the functions in a model's module."""
    functions = {name: getattr(module, name) for name in FUNCTIONS if hasattr(module, name)}
    return object_code(vector_code.vector_llvm(functions, module.LAYOUT["lanes"]))


def _model(form: KernelForm) -> Model:
    if isinstance(form, Dragged):
        return dragged(form)
    if isinstance(form, Imposed):
        return imposed(form)
    if isinstance(form, AsBuilt):
        return as_built(form)
    return driven(form) if isinstance(form, Driven) else assemble(form)
