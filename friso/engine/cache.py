"""Store compiled code on disk, private to the user.

An entry is a file with machine code and its module. Only code that this user alone can have written is loaded
(`friso.platform.files`); anything else, and a damaged file, is built anew. Locks separate processes that build at the
same time.

An entry is named after the generated source, the compiler and the processor. A request is named after the task and
friso's own sources; it gives the name of its entry. So a start of an unchanged friso generates nothing, and a change of
friso that does not change the generated code compiles nothing.

Code that has not been used for long is deleted (`prune`).
"""

from __future__ import annotations

import atexit
import hashlib
import logging
import marshal
import os
import re
import sys
import time
import zlib
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cache
from importlib.abc import InspectLoader
from importlib.metadata import version
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path
from threading import Lock
from types import CodeType, ModuleType

import llvmlite
import numpy as np
from filelock import FileLock, Timeout
from platformdirs import user_cache_dir

from friso.engine.machine_code import processor
from friso.engine.settings import build_settings
from friso.platform.files import PARTIAL, make_private, read_private, write_private
from friso.platform.leftovers import locked_folder, temporary_folder
from friso.platform.system import cause_of, path_of, remove_folder
from friso.version import VERSION

logger = logging.getLogger("friso")

FOLDER_VARIABLE = "FRISO_CACHE_DIR"

ENTRY, REQUEST = ".kernel", ".request"
"""Suffixes of files with code, and of files that name such a file."""

SECONDS_OF_A_DAY = 86_400.0
"""Seconds of a day, the interval at which use is recorded."""


@cache
def cache_folder() -> Path:
    """Return the folder of compiled code, mode 0700.

    If it cannot be made, the result is a temporary folder, with a warning.
    """
    try:
        for error in _UNWRITABLE:
            raise error
        chosen = Path(os.environ.get(FOLDER_VARIABLE) or user_cache_dir("friso")).expanduser()
        folder = (chosen / "kernels").absolute()
        make_private(folder)
        with locked_folder(folder, "trial-", "lock"):
            return folder
    except (OSError, RuntimeError) as error:  # RuntimeError: a user without a home
        logger.warning(
            "kernels are compiled into a temporary folder and not kept: %s; %s names another folder",
            _in_words(error),
            FOLDER_VARIABLE,
        )
        held = ExitStack()
        folder = held.enter_context(temporary_folder(_PASSING)) / "kernels"
        folder.mkdir(mode=0o700)
        atexit.register(held.close)
        return folder


_UNWRITABLE: list[OSError] = []
"""Errors that prevented storing compiled code."""


def leave_cache(folder: Path, error: OSError) -> None:
    """Compile kernels into a temporary folder from now on, because `folder` cannot be written.

    Its disk may be full. Raises the error if the folder is already temporary.
    """
    if is_passing(folder):
        raise error
    with _LEAVING:
        if cache_folder() == folder:  # unless another thread has left it meanwhile
            _UNWRITABLE[:] = [error]
            cache_folder.cache_clear()


_LEAVING = Lock()


def _in_words(error: OSError | RuntimeError) -> str:
    """Return why a folder cannot be used, without the system's error number."""
    if not isinstance(error, OSError):
        return str(error)
    return f"{cause_of(error)} ({path_of(error)})".removesuffix(" ()")


_PASSING = "friso-kernels-"
"""Prefix of the names of temporary cache folders."""


def is_passing(folder: Path) -> bool:
    """Tell whether a cache is in a temporary folder."""
    return folder.parent.name.startswith(_PASSING)


def remove_if_passing(folder: Path) -> None:
    """Remove a cache in a temporary folder."""
    if is_passing(folder):
        remove_folder(folder.parent)


@cache
def code_digest(*parts: str) -> str:
    """Return a digest of the sources in some folders and files.

    Their paths start from the package friso.
    """
    code = hashlib.sha256()
    for part in parts:
        place = Path(__file__).parent.parent / part
        for file in sorted(place.rglob("*.py")) if place.is_dir() else [place]:
            code.update(file.read_bytes())
    return code.hexdigest()


@cache
def machine() -> str:
    """Name processor and compiler, on which the last bits of a run depend besides friso's code."""
    return f"{processor().name}, llvmlite {llvmlite.__version__}, numpy {np.__version__}"


@cache
def environment() -> str:
    """Describe compilers and processor, on which machine code depends besides its source."""
    return repr((sys.version, np.__version__, llvmlite.__version__, processor()))


@dataclass(frozen=True)
class Compiled:
    """Cache entry of one module: its name, source, byte code and machine code."""

    name: str
    source: str
    bytecode: bytes
    code: bytes

    def module(self) -> ModuleType:
        """Execute the module, and return it."""
        return _module(self.name, self.source, marshal.loads(self.bytecode))


@dataclass(frozen=True)
class CodeRequest:
    """Request to compile code.

    It has the full `name`, a `title` for messages, and the `task`. `builder` is a module whose `build(folder, task)`
    stores the code in the cache (`keep`) and returns the name of the entry. The request also holds the digests of
    loaded plug-ins.
    """

    name: str
    title: str
    builder: str
    task: bytes = b""
    plug_ins: str = ""

    @property
    def file(self) -> Path:
        """Return the file that names the cache entry of this request."""
        asked = (self.name, VERSION, code_digest("equations", "engine"), version("sympy"), environment())
        return cache_folder() / f"{_digest(*asked)}{REQUEST}"

    def lock(self) -> FileLock:
        """Return the lock of the request; requests for other code may share it."""
        return FileLock(cache_folder() / f"{self.file.name[:2]}.request-lock", mode=0o600)

    def answer(self, name: str) -> None:
        """Store the name of the cache entry that fulfils the request."""
        _write(self.file, name.encode("ascii"))

    def entry(self) -> Compiled | None:
        """Return the cache entry, or None if it is missing or damaged, and record its use."""
        file = self.file
        name = (_read(file) or b"").decode("ascii")
        if not re.fullmatch("[0-9a-f]{24}", name):
            return None
        stored = _stored(file.parent / f"{name}{ENTRY}")
        if stored is not None:
            _note_use(file, file.with_name(f"{name}{ENTRY}"))
        return stored


def _digest(*parts: str) -> str:
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:24]


def _note_use(*files: Path) -> None:
    for file in files:
        if time.time() - file.stat().st_mtime > SECONDS_OF_A_DAY:
            os.utime(file)


def _stored(file: Path) -> Compiled | None:
    """Return the entry in a file; None for one that friso did not write."""
    content = _read(file)
    return None if content is None else Compiled(file.stem, *marshal.loads(content))


def _write(path: Path, content: bytes) -> None:
    """Write a file for this user alone, with a check sum before its content."""
    write_private(path, _check_sum(content) + content)


def _read(path: Path) -> bytes | None:
    """Return the content of a file; None if it is missing or damaged, or another user can have written it."""
    try:
        make_private(path.parent)  # a folder on the way may have been opened since
        kept = read_private(path)
    except OSError:
        return None
    content = kept[_CHECK_SUM_BYTES:]
    return content if kept == _check_sum(content) + content else None


def _check_sum(content: bytes) -> bytes:
    return zlib.crc32(content).to_bytes(_CHECK_SUM_BYTES, "little")


_CHECK_SUM_BYTES = 4


def keep(folder: Path, source: str, code_of: Callable[[ModuleType], bytes]) -> str:
    """Store a module and its machine code, made by `code_of`, in the cache `folder`.

    An equal entry is not written again. Returns the name of the entry.
    """
    name = _digest(_without_words(source), _compiled_with(), environment())
    file = folder / f"{name}{ENTRY}"
    with entry_lock(file):
        if _stored(file) is None:
            compiled = compile(source, _file_name(name), "exec")
            code = code_of(_module(name, source, compiled))
            _write(file, marshal.dumps((source, marshal.dumps(compiled), code)))
    return name


def entry_lock(file: Path) -> FileLock:
    """Return the lock for writing or deleting the entry in a `file`; entries may share a lock."""
    return FileLock(file.parent / f"{file.name[:2]}.lock", mode=0o600)


def _without_words(source: str) -> str:
    """Return a module's bytecode without comments, docstrings and line numbers.

    A change of these alone thus compiles nothing anew.
    """
    return repr(_plain(compile(source, "", "exec", dont_inherit=True, optimize=2)))


def _plain(part: object) -> object:
    """Return a part of code, or a constant, in a form that is equal in every process."""
    if isinstance(part, CodeType):
        names = (part.co_name, part.co_names, part.co_varnames, part.co_freevars, part.co_cellvars)
        takes = (part.co_argcount, part.co_posonlyargcount, part.co_kwonlyargcount, part.co_flags)
        return names, takes, part.co_code, part.co_exceptiontable, [_plain(constant) for constant in part.co_consts]
    if isinstance(part, frozenset):  # its own order differs in each process
        return sorted(map(repr, part))
    return [_plain(one) for one in part] if isinstance(part, tuple) else part


@cache
def _compiled_with() -> str:
    """Return a digest of the modules of friso whose code is part of compiled code."""
    files = (Path(__file__).parent / f"{name}.py" for name in _INCLUDED)
    return _digest(*(_without_words(file.read_text(encoding="utf-8")) for file in files))


_INCLUDED = ("arrays", "machine_code", "scalar_code", "simd_math", "vector_code")


def _file_name(name: str) -> str:
    return f"friso_kernel_{name}.py"


class _Loader(InspectLoader):
    """Loader of a module from its code, which also returns the source."""

    def __init__(self, source: str, compiled: CodeType) -> None:
        self._source, self._compiled = source, compiled

    def get_source(self, fullname: str) -> str:
        """Return the source, for tools that inspect functions of the module."""
        return self._source

    def get_code(self, fullname: str) -> CodeType:
        """Return the code that is executed."""
        return self._compiled


def _module(name: str, source: str, compiled: CodeType) -> ModuleType:
    """Run the code of a cache entry as a module with this name, and return the module."""
    loader = _Loader(source, compiled)
    spec = spec_from_loader(Path(_file_name(name)).stem, loader)
    assert spec is not None
    module = module_from_spec(spec)
    sys.modules[spec.name] = module
    loader.exec_module(module)
    return module


KEPT_TIME = 60 * 86_400.0  # [s]
"""Time after which unused code is deleted."""


def prune(folder: Path) -> None:
    """Delete compiled code that has not been used for long, and leftovers of killed processes.

    If the folder is still too large, the code unused for longest goes next. Files that another process is writing stay.
    """
    try:
        with FileLock(folder / "prune.lock", blocking=False, mode=0o600):
            size, now = 0, time.time()
            for used, file, length in sorted(_used(folder), reverse=True):
                size += length
                age = now - used
                unfinished = file.suffix == PARTIAL and age > SECONDS_OF_A_DAY
                if unfinished or age > KEPT_TIME or (age > SECONDS_OF_A_DAY and size > build_settings.kept_size):
                    _delete(file)
    except (Timeout, OSError) as error:  # another process is pruning, too
        logger.debug("old kernels are left: %s", error)


def _used(folder: Path) -> Iterator[tuple[float, Path, int]]:
    """Yield each entry, request and draft: time of its last use [s], path, and size [bytes]."""
    for file in folder.iterdir():
        if file.suffix in (ENTRY, REQUEST, PARTIAL):
            status = file.lstat()
            yield status.st_mtime, file, status.st_size


def _delete(file: Path) -> None:
    try:
        with entry_lock(file).acquire(blocking=False):
            file.unlink()
    except (Timeout, PermissionError):  # it is in use
        return
