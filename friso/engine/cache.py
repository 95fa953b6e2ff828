"""Compiled code on disk, private to the user.

An entry is a folder with machine code, the module that it was made of, and a manifest of checksums, written last.
Whatever does not match its manifest is built anew; locks keep processes that build at the same time out of each other's
way.

An entry is named after what was generated, the compiler and the processor; a request, after what was asked for and
friso's own sources, names its entry. So a start with friso unchanged generates nothing, and a change of friso that
leaves the generated code as it was compiles nothing. What has not been used for long is deleted (`prune`).
"""

from __future__ import annotations

import ast
import atexit
import hashlib
import importlib.util
import json
import logging
import os
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path
from types import ModuleType

import llvmlite
import llvmlite.binding as llvm
import numpy as np
from filelock import FileLock, Timeout
from platformdirs import user_cache_dir

from friso.system import check_private
from friso.version import VERSION

logger = logging.getLogger("friso")

FOLDER_VARIABLE = "FRISO_CACHE_DIR"

MODULE, CODE, MANIFEST = "kernel.py", "code.o", "manifest.json"
"""Files of an entry."""

DAY = 86_400.0
"""In seconds; so often it is noted that something is in use."""

KEPT_FOR, KEPT_IN_ALL = 60 * DAY, 200_000_000
"""How long [s] what is not used is kept, and how much [bytes]; what was used within a day is kept in any case."""


@cache
def cache_folder() -> Path:
    """The folder of compiled code, mode 0700; a temporary one, with a warning, where that cannot be had."""
    folder = Path(os.environ.get(FOLDER_VARIABLE) or user_cache_dir("friso")) / "kernels"
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        check_private(folder)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError as error:
        logger.warning("kernels are compiled into a temporary folder and not kept: %s", error)
        passing = Path(tempfile.mkdtemp(prefix="friso-kernels-"))
        atexit.register(shutil.rmtree, passing, ignore_errors=True)
        return passing


@cache
def code_digest(*parts: str) -> str:
    """A digest of the sources in these folders (and files) of the package."""
    code = hashlib.sha256()
    for part in parts:
        place = Path(__file__).parent.parent / part
        for file in sorted(place.rglob("*.py")) if place.is_dir() else [place]:
            code.update(file.read_bytes())
    return code.hexdigest()


@cache
def machine() -> str:
    """What decides on the last bits of a run besides friso's code: processor and compiler."""
    return f"{llvm.get_host_cpu_name()}, llvmlite {llvmlite.__version__}, numpy {np.__version__}"


@cache
def environment() -> str:
    """What machine code depends on besides its source: the compilers and the processor."""
    processor = (llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten())
    return repr((sys.version, np.__version__, llvmlite.__version__, processor))


@dataclass(frozen=True)
class CodeRequest:
    """What is to be compiled: its `name` in full, a `title` for people, the module whose `build(folder, task)` keeps it
    in the cache (`keep`) and returns the name of its entry, and the task that it is given."""

    name: str
    title: str
    builder: str
    task: bytes = b""

    @property
    def file(self) -> Path:
        """The file that names the entry."""
        asked = (self.name, VERSION, code_digest("equations", "engine"), version("sympy"), environment())
        return cache_folder() / f"{_digest(*asked)}.request"

    def lock(self) -> FileLock:
        """Held by who builds what is requested; a request for something else may share it."""
        return FileLock(cache_folder() / f"{self.file.name[:2]}.request-lock", mode=0o600)

    def entry(self) -> Path | None:
        """The entry, intact; None where there is none. That it is in use is noted."""
        try:
            name = self.file.read_text(encoding="ascii")
        except (OSError, ValueError):
            return None
        if not re.fullmatch("[0-9a-f]{24}", name):
            return None
        entry = self.file.parent / name
        if not _intact(entry):
            return None
        _note_use(self.file, entry / MANIFEST)
        return entry


def _digest(*parts: str) -> str:
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:24]


def _note_use(*files: Path) -> None:
    for file in files:
        if time.time() - file.stat().st_mtime > DAY:
            os.utime(file)


def keep(folder: Path, source: str, code_of: Callable[[ModuleType], bytes]) -> str:
    """Keep a module and the machine code that `code_of` makes of it in the cache `folder`, unless the same is there
    already; the name of its entry."""
    entry = folder / _digest(_without_words(source), _compiled_with(), environment())
    with _entry_lock(entry):
        if not _intact(entry):
            shutil.rmtree(entry, ignore_errors=True)
            entry.mkdir(mode=0o700)
            (entry / MODULE).write_text(source, encoding="utf-8")
            (entry / CODE).write_bytes(code_of(import_entry(entry)))
            (entry / MANIFEST).write_text(json.dumps(_checksums(entry)), encoding="utf-8")
    return entry.name


def _entry_lock(entry: Path) -> FileLock:
    """Held by who writes or deletes an entry; another one may share it."""
    return FileLock(entry.parent / f"{entry.name[:2]}.lock", mode=0o600)


def _without_words(source: str) -> str:
    """The syntax of a module, without comments and docstrings."""
    tree = ast.parse(source)
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.FunctionDef | ast.ClassDef) and ast.get_docstring(node) is not None:
            del node.body[0]
    return ast.dump(tree)


def _compiled_with() -> str:
    """What compiled code takes from friso."""
    files = (Path(__file__).parent / f"{name}.py" for name in _INCLUDED)
    return _digest(*(_without_words(file.read_text(encoding="utf-8")) for file in files))


_INCLUDED = ("arrays", "kinds", "layout", "machine_code", "roots", "scalar_code", "simd_math", "vector_code")


def _checksums(entry: Path) -> dict[str, str]:
    files = [entry / MODULE, entry / CODE]
    return {file.name: hashlib.sha256(file.read_bytes()).hexdigest() for file in files}


def _intact(entry: Path) -> bool:
    """Whether the entry is there, whole and unchanged."""
    try:
        return json.loads((entry / MANIFEST).read_text(encoding="utf-8")) == _checksums(entry)
    except (OSError, ValueError):
        return False


def import_entry(entry: Path) -> ModuleType:
    """The module of an entry."""
    spec = importlib.util.spec_from_file_location(f"friso_kernel_{entry.name}", entry / MODULE)
    if spec is None or spec.loader is None:
        raise ImportError(f"no module can be made of {entry / MODULE}")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def prune(folder: Path) -> None:
    """Delete what has not been used for long, and then what has not been used for longest as long as there is too much.
    What another process is writing is left alone."""
    try:
        with FileLock(folder / "prune.lock", blocking=False, mode=0o600):
            size, now = 0, time.time()
            for used, path, bytes_ in sorted(_used(folder), reverse=True):
                size += bytes_
                age = now - used
                if age > KEPT_FOR or (age > DAY and size > KEPT_IN_ALL):
                    _delete(path)
    except (Timeout, OSError) as error:  # another process is at it; it is no reason to stop
        logger.debug("old kernels are left: %s", error)


def _used(folder: Path) -> Iterator[tuple[float, Path, int]]:
    """When each entry and request was used last [s], and its size [bytes]."""
    for path in folder.iterdir():
        if path.is_dir():
            files = [file for file in path.rglob("*") if file.is_file()]
            marks = [file for file in files if file.name == MANIFEST] or [path]
            yield marks[0].stat().st_mtime, path, sum(file.stat().st_size for file in files)
        elif path.suffix == ".request":
            yield path.stat().st_mtime, path, 0


def _delete(path: Path) -> None:
    if not path.is_dir():
        path.unlink()
        return
    try:
        with _entry_lock(path).acquire(blocking=False):
            (path / MANIFEST).unlink(missing_ok=True)
            shutil.rmtree(path)
    except Timeout:
        return
