"""Make machine code by LLVM from its language, load object files, and call their functions."""

from __future__ import annotations

import ctypes
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from threading import Lock
from typing import Any

import llvmlite.binding as llvm
from llvmlite import ir

from friso.engine.kinds import CompiledKind, Packing
from friso.engine.processor import processor
from friso.platform.system import HAS_JIT_LINK


def object_code(module: ir.Module) -> bytes:
    """Return the object file of a module, optimised for this processor."""
    machine = processor().target_machine()
    return machine.emit_object(optimised(module, machine))


def optimised(module: ir.Module, machine: llvm.TargetMachine) -> llvm.ModuleRef:
    """Return a module as optimised by LLVM for a processor."""
    parsed = llvm.parse_assembly(str(module))
    parsed.triple, parsed.data_layout = machine.triple, str(machine.target_data)
    parsed.verify()
    options = llvm.create_pipeline_tuning_options(speed_level=2)
    options.slp_vectorization = options.loop_vectorization = False
    passes = llvm.create_pass_builder(machine, options)
    passes.getModulePassManager().run(parsed, passes)
    return parsed


def load_object(code: bytes, functions: Iterable[str]) -> Mapping[str, int]:
    """Load an object file, `code`, and return the addresses of the named functions.

    The code stays loaded until the process ends. Raises RuntimeError if it cannot be linked.
    """
    library = llvm.JITLibraryBuilder().add_object_img(code).add_current_process()
    for function in functions:
        library.export_symbol(function)
    with _linking:
        loaded = library.link(_linker(), f"library {len(_libraries)}")
        _libraries.append(loaded)
    return {function: loaded[function] for function in functions}


_linking = Lock()
_libraries: list[llvm.ResourceTracker] = []


@cache
def _linker() -> llvm.LLJIT:
    return llvm.create_lljit_compiler(processor().target_machine(), use_jit_link=HAS_JIT_LINK)


class Loops:
    """Compiled loops (`friso.engine.scalar_code`), called without the interpreter's lock."""

    def __init__(self, address: int, kinds: Sequence[CompiledKind]) -> None:
        self._call, self._packing = ctypes.CFUNCTYPE(None, ctypes.c_char_p)(address), Packing(kinds)

    def __call__(self, *arguments: Any) -> None:
        """Call the loops. Raises TypeError for arguments of other kinds than compiled for."""
        self._call(self._packing.packed(arguments))
