"""Make machine code by LLVM from its language, load object files, and call their functions.

Code is compiled for one processor, which is described here.

Arguments of compiled loops have declared kinds, and are packed as 64-bit words. The loops are written for
`friso.engine.scalar_code`.

The numbers of all runs computed at once lie in one flat float64 buffer, one row after another. A row has a number of
each run, in its lane, side by side.
"""

from __future__ import annotations

import ctypes
import os
import struct
from collections import namedtuple
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import accumulate
from threading import Lock
from typing import Any

import llvmlite.binding as llvm
import numpy as np
from llvmlite import ir

from friso.platform.system import HAS_JIT_LINK

PROCESSOR_VARIABLE = "FRISO_PROCESSOR"
"""Environment variable with a lesser processor of the same family to compile for, by its LLVM name: x86-64-v3 has AVX2
but not AVX-512. For `python -m benchmarks.processors`, and for a cache that different machines share."""


@dataclass(frozen=True)
class Processor:
    """A processor as LLVM describes it: the platform's triple, a name, and features.

    Features are those beyond what the name implies ("+avx2,-fma").
    """

    triple: str
    name: str
    features: str = ""

    @property
    def lanes(self) -> int:
        """Return the number of float64 in a register.

        It is 8 with AVX-512, 4 with AVX, 2 with SSE2 and NEON. More lanes are no faster, and take longer to compile
        (docs/platforms.md).
        """
        features = self.features.split(",")
        if "+avx512f" in features or self.name == "x86-64-v4":
            return 8
        return 4 if "+avx" in features or self.name == "x86-64-v3" else 2

    def target_machine(self) -> llvm.TargetMachine:
        """Return LLVM's code generator for the processor.

        Raises RuntimeError for a triple that LLVM does not know.
        """
        target = llvm.Target.from_triple(self.triple)
        return target.create_target_machine(self.name, self.features, opt=3, reloc="pic", codemodel="small")


@cache
def processor() -> Processor:
    """Return this machine's processor, or the lesser one named in the environment."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    triple = loadable(llvm.get_process_triple())
    if name := os.environ.get(PROCESSOR_VARIABLE):
        return Processor(triple, name)
    return Processor(triple, llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten())


def loadable(triple: str) -> str:
    """Return the target triple whose object files LLVM can load on a platform.

    On Windows it is that of Linux files (ELF), because LLVM misplaces the constants of Windows' own format (COFF).
    Numba does the same.
    """
    return f"{triple}-elf" if "windows" in triple else triple


@dataclass(frozen=True)
class NumberKind:
    """A kind of number: "int", "float" or "truth"; the last occurs only inside compiled code."""

    name: str

    @property
    def form(self) -> str:
        """Return the format of the number for `struct`."""
        return "d" if self.name == "float" else "q"

    def words(self, value: Any) -> list[Any]:
        """Return a number as a list of one value, for one 64-bit word.

        Raises TypeError for a value of another kind.
        """
        if not isinstance(value, float if self.name == "float" else int):
            raise TypeError(f"{value!r} where a number is expected: {self.name}")
        return [value]


_DTYPES = {name: np.dtype(name) for name in ("int64", "float64", "bool")}


@dataclass(frozen=True)
class ArrayKind:
    """Arrays of numbers of a type, with the last index running fastest."""

    dtype: str
    dimensions: int

    @property
    def form(self) -> str:
        """Return the format of the array's address and shape for `struct`."""
        return "q" * (1 + self.dimensions)

    def words(self, value: Any) -> list[Any]:
        """Return the address of an array and its shape, as values for 64-bit words.

        Raises TypeError for an array of another type or number of dimensions, or one that is not contiguous.
        """
        if not (value.dtype == _DTYPES[self.dtype] and value.ndim == self.dimensions and value.flags.c_contiguous):
            raise TypeError(f"an array of {value.dtype}, strides {value.strides}, where {self} is expected")
        return [value.__array_interface__["data"][0], *value.shape]


@dataclass(frozen=True)
class RecordKind:
    """Named tuples whose `fields` have these names and kinds."""

    fields: tuple[tuple[str, CompiledKind], ...]

    @property
    def form(self) -> str:
        """Return the format of the record's fields for `struct`, one after another."""
        return "".join(kind.form for _, kind in self.fields)

    def words(self, value: Any) -> list[Any]:
        """Return the fields of a named tuple as values for 64-bit words, one field after another.

        Raises TypeError if a field is of another kind.
        """
        return [word for (_, kind), part in zip(self.fields, value, strict=True) for word in kind.words(part)]


CompiledKind = NumberKind | ArrayKind | RecordKind
INT, FLOAT, TRUTH = NumberKind("int"), NumberKind("float"), NumberKind("truth")


def argument_kind(example: Any) -> CompiledKind:
    """Return the kind of an argument, from an example of it.

    Raises TypeError if compiled loops take no such argument.
    """
    if isinstance(example, np.ndarray) and example.dtype.name in _DTYPES:
        return ArrayKind(example.dtype.name, example.ndim)
    names = getattr(example, "_fields", None)
    if isinstance(example, tuple) and names is not None:
        return RecordKind(tuple((name, argument_kind(value)) for name, value in zip(names, example, strict=True)))
    if isinstance(example, float | int) and not isinstance(example, bool):
        return FLOAT if isinstance(example, float) else INT
    raise TypeError(f"compiled loops are not given anything like {example!r}")


class Packing:
    """Layout of arguments of given kinds, one after another."""

    def __init__(self, kinds: Sequence[CompiledKind]) -> None:
        self._kinds, self._struct = tuple(kinds), struct.Struct("".join(kind.form for kind in kinds))

    def packed(self, arguments: Sequence[Any]) -> bytes:
        """Return the arguments as 64-bit words; arrays must outlive the words.

        Raises TypeError for arguments of other kinds.
        """
        words = (word for kind, argument in zip(self._kinds, arguments, strict=True) for word in kind.words(argument))
        return self._struct.pack(*words)


LANES = processor().lanes
"""Number of runs side by side: the float64 that fit one register."""

SCALARS = (
    "time",
    "old_time",
    "stop",
    "start",
    "trial",
    "longest",
    "taken",
    "fraction",
    "rejected_last",
    "attempted",
    "rejected",
    "event",
    "next_sample",
    "record_from",
    "force_peak",
    "deviation_max",
    "deviation_min",
    "inner_exit",
    "outer_exit",
    "turns",
    "last_kind",
)
"""Names of rows of one number per lane. time, old_time, stop: present time, time before the step and next corner, all
since the last corner of the reference, which was at start; trial, longest, taken: step to try next, its limit, and
last step; fraction: its accepted part; event: 1 if the lane needs attention, 2 if a turning point or the entry into a
band is inside the step, 3 if the run diverged, otherwise 0; turns: number of stored turning points; last_kind: kind of
the last one, 1 for a maximum, -1 for a minimum."""

DRIVER = ("run", "segment", "inner_before", "outer_before")
"""Names of rows that only the driver uses: the number of the lane's run, negative for none, and of its piece of the
reference; and the longest times of entry into the two bands at places that the reference has left."""

CLOCK = ("period", "tick", "due", "ticked", "noted", "left")
"""Names of rows for a model with a sampling clock. period: sample time; tick: number of the next sample; due: when its
result acts, since the last corner of the reference; ticked: 1 if the last step ended there; noted: 1 if that sample
is to be written; left: 1 if a table cell was left."""

ROW = namedtuple("ROW", SCALARS + CLOCK + DRIVER)(*range(len(SCALARS + CLOCK + DRIVER)))
"""Numbers of the rows common to all models, at the beginning of the buffer."""

AXES = ("first", "density", "last")
"""Axis of a table: its first place or time, points per unit, and number of the last point."""

SIZES = (
    "lanes",
    "states",
    "dense_terms",
    "constants",
    "kinks",
    "inputs",
    "held",
    "modes",
    "tabled",
    "places",
    "clocked",
    "position",
    "velocity",
    "degree",
    "tones",
)
"""Names of the sizes of a model: lanes, states, terms of the dense output of each, constants, kinks, reference inputs,
held numbers, and how many of these are modes with memory; the first held number from tables, and the number of tables
over position; 1 for a drive with a clock; the indices of position and velocity of the stage; degree and tones of the
reference."""

LOOKED_UP = ("place_states", "walked")
"""Names of arrays of a model with a clock: states over which tables are looked up, and for each table the index of that
state (or of time, after them)."""

FUNCTIONS = ("step", "locate", "update")
"""Names of the functions written for each model, which the driver calls."""

BLOCKS = (
    "x",
    "old",
    "end",
    "dense",
    "tolerance",
    "constant",
    "mode",
    "reference",
    "seen",
    "axis",
    "piece_before",
    "cell",
    "base",
    "slope",
)
"""Names of blocks of rows whose first row depends on the model; the buffer ends after the last."""

ModelLayout = namedtuple("ModelLayout", (*SIZES, *BLOCKS, "rows", "stands_since", *LOOKED_UP, *FUNCTIONS))
"""Layout of a model for the driver: sizes, first rows of blocks, arrays, and addresses of functions. One further row
holds the time since which the reference stands."""


@dataclass(frozen=True)
class Layout:
    """Layout of the buffer with the runs that are computed at once.

    `walks` are the quantities over which tables are looked up: states, and time. For each, a `cell` is the interval
    between two points of its tables, with a `base` and a `slope` for every table. `seen` has the states and modes at
    the drive's sample. `piece_before` has the length and the inputs of the previous piece of the reference. A sample
    may lie there whose command acts only after the corner.
    """

    states: int
    dense: int
    constants: int
    kinks: int
    fixed: int
    seen: int
    tables: int
    walks: int
    inputs: int

    @property
    def first_rows(self) -> dict[str, int]:
        """Return the first row of each block, and how many `rows` there are."""
        axis, before = self.walks and 2 * len(AXES), self.walks and 1 + self.inputs
        sizes = (self.states, self.states, self.states, self.dense * self.states, self.states)
        sizes += (self.constants, self.kinks, self.fixed, self.seen, axis, before, self.walks, self.tables, self.tables)
        return dict(zip((*BLOCKS, "rows"), accumulate(sizes, initial=len(ROW)), strict=True))


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
