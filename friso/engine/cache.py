"""Compiled kernels on disk, private to the user.

An entry is a folder with the generated module, the machine code that Numba puts beside it, and a manifest of
checksums, written last. Whatever does not match its manifest is built anew; a lock per entry keeps processes that
build at the same time out of each other's way.

An entry is named after what was generated, the compiler and the processor; a request, after what was asked for and
friso's own sources, names its entry. So a start with friso unchanged generates nothing, and a change of friso that
leaves the generated code as it was compiles nothing.
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
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable
from functools import cache
from importlib.metadata import version
from pathlib import Path
from types import ModuleType

import llvmlite
import llvmlite.binding as llvm
import numba
import numba.core.config as numba_config
import numpy as np
from filelock import FileLock
from platformdirs import user_cache_dir

from friso.system import check_private
from friso.version import VERSION

logger = logging.getLogger("friso")

FOLDER_VARIABLE = "FRISO_CACHE_DIR"

_numba_folder = threading.Lock()
_building: set[subprocess.Popen[bytes]] = set()


@cache
def cache_folder() -> Path:
    """The folder of the kernels, mode 0700; a temporary one, with a warning, where that cannot be had."""
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
    return f"{llvm.get_host_cpu_name()}, numba {numba.__version__}, numpy {np.__version__}"


@cache
def environment() -> str:
    """What machine code depends on besides its source: the compilers, their settings, and the processor."""
    versions = (sys.version, np.__version__, numba.__version__, llvmlite.__version__)
    processor = (llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten())
    settings = sorted(
        (name, value) for name, value in os.environ.items() if name.startswith("NUMBA_") and name != "NUMBA_CACHE_DIR"
    )
    return repr((versions, processor, settings))


def load_or_build(name: str, builder: str, task: bytes, load: Callable[[ModuleType], None]) -> ModuleType:
    """The module called `name` from the cache, built there first if need be, and prepared by `load`.

    `builder` is a module that, run as a program with the cache folder as argument and `task` on standard input, keeps
    the module (`keep`) and prints the name of its entry. It is a process of its own so that what runs is always what
    is kept: code that is compiled and run in one process may round differently from the same code loaded. Raises
    RuntimeError with the builder's message if it fails, OSError where the cache folder cannot be written.
    """
    asked = (name, VERSION, code_digest("equations", "engine"), version("sympy"), environment())
    request = cache_folder() / f"{_digest(*asked)}.request"
    with FileLock(request.with_suffix(".lock"), mode=0o600):
        entry = _entry(request)
        if entry is None or not _intact(entry):
            entry = _build(builder, request, task)
        module = import_entry(entry)
        load(module)
        if module.run.stats.cache_misses:  # Numba did not take the machine code: the files were copied, for one
            shutil.rmtree(entry, ignore_errors=True)
            module = import_entry(_build(builder, request, task))
            load(module)
        return module


def _digest(*parts: str) -> str:
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:24]


def _entry(request: Path) -> Path | None:
    """The entry that a request names; None where it names none."""
    try:
        name = request.read_text(encoding="ascii")
    except (OSError, ValueError):
        return None
    return request.parent / name if re.fullmatch("[0-9a-f]{24}", name) else None


def _build(builder: str, request: Path, task: bytes) -> Path:
    logger.warning("compiling; the next run finds it compiled")
    environ = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    command = [sys.executable, "-P", "-m", builder, str(request.parent)]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe, env=environ) as process:
        _building.add(process)
        try:
            name, message = process.communicate(task)
        except BaseException:
            process.kill()
            raise
        finally:
            _building.discard(process)
    if process.returncode:
        raise RuntimeError(f"the kernel could not be compiled:\n{message.decode(errors='replace')}")
    request.write_bytes(name)
    return request.parent / name.decode("ascii")


def keep(folder: Path, source: str, compile_module: Callable[[ModuleType], None]) -> str:
    """Compile a module by `compile_module` and keep it in the cache `folder`, unless the same one is there already;
    the name of its entry."""
    entry = folder / _digest(_without_words(source), _compiled_with(), environment())
    with FileLock(entry.with_suffix(".lock"), mode=0o600):
        if not _intact(entry):
            shutil.rmtree(entry, ignore_errors=True)
            entry.mkdir(mode=0o700)
            (entry / "kernel.py").write_text(source, encoding="utf-8")
            compile_module(import_entry(entry))
            (entry / "manifest.json").write_text(json.dumps(_checksums(entry)), encoding="utf-8")
    return entry.name


def _without_words(source: str) -> str:
    """The syntax of a module, without comments and docstrings."""
    tree = ast.parse(source)
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.FunctionDef | ast.ClassDef) and ast.get_docstring(node) is not None:
            del node.body[0]
    return ast.dump(tree)


def _compiled_with() -> str:
    """What the generated modules take from friso."""
    files = (Path(__file__).parent / f"{name}.py" for name in _INCLUDED)
    return _digest(*(_without_words(file.read_text(encoding="utf-8")) for file in files))


_INCLUDED = ("arrays", "roots", "shared_queue", "simd_math", "vector_code")


def stop_building() -> None:
    """End what other threads are building."""
    for process in list(_building):
        process.kill()


def _checksums(entry: Path) -> dict[str, str]:
    files = sorted(entry.rglob("*.py")) + sorted(entry.rglob("*.nb[ci]"))
    return {str(file.relative_to(entry)): hashlib.sha256(file.read_bytes()).hexdigest() for file in files}


def _intact(entry: Path) -> bool:
    """Whether the entry is there, whole and unchanged."""
    try:
        return json.loads((entry / "manifest.json").read_text(encoding="utf-8")) == _checksums(entry)
    except (OSError, ValueError):
        return False


def import_entry(entry: Path) -> ModuleType:
    """The module of an entry; Numba finds its machine code beside it, whatever NUMBA_CACHE_DIR says."""
    spec = importlib.util.spec_from_file_location(f"friso_kernel_{entry.name}", entry / "kernel.py")
    if spec is None or spec.loader is None:
        raise ImportError(f"no module can be made of {entry / 'kernel.py'}")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    with _numba_folder:
        elsewhere = getattr(numba_config, "CACHE_DIR")  # noqa: B009 (set at import, unknown to type checkers)
        setattr(numba_config, "CACHE_DIR", "")  # noqa: B010
        try:
            spec.loader.exec_module(module)
        finally:
            setattr(numba_config, "CACHE_DIR", elsewhere)  # noqa: B010
    return module
