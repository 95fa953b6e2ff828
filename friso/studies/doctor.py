"""Check that friso works on this machine, and describe the machine for a bug report.

The report leaves out names of users and folders.
"""

from __future__ import annotations

import getpass
import os
import pickle
import platform
import re
import struct
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, requires, version
from importlib.resources import files
from pathlib import Path

from friso.platform.installed import EXTRAS, install
from friso.platform.leftovers import temporary_folder
from friso.platform.system import LIBRARIES, MODES_TELL, is_open_to_others, usable_cores
from friso.stage import Stage
from friso.stage.arguments import loads
from friso.studies.settings import settings
from friso.version import VERSION


@dataclass(frozen=True)
class DoctorCheck:
    """One check of the installation: its subject, the result as text, and whether it works.

    `remedy` is advice if it does not work.
    """

    subject: str
    text: str
    works: bool = True
    remedy: str = ""


def checks() -> Iterator[DoctorCheck]:
    """Yield all checks of the installation, one by one, as they are made.

    Paths below the user's home folder begin with ~.
    """
    yield DoctorCheck("friso", VERSION)
    yield DoctorCheck(
        "Python", f"{platform.python_implementation()} {platform.python_version()}, {8 * struct.calcsize('P')} bit"
    )
    yield DoctorCheck("system", f"{platform.system()} {platform.release()}, {platform.machine()}")
    yield from _packages()
    steps: tuple[tuple[str, Callable[[], str], str], ...] = (
        ("processor", _processor, LIBRARIES),
        ("cores", lambda: f"{usable_cores()} of {os.cpu_count()} may be used", ""),
        ("kept code", _kept_code, "name another folder in FRISO_CACHE_DIR"),
        ("compiling", _compiling, LIBRARIES),
        ("running", _running, "empty the folder of kept code, then try again; if it stays, report it with this text"),
    )
    for subject, look, remedy in steps:
        try:
            yield DoctorCheck(subject, look())
        except Exception as error:  # any failure is a result of the check
            yield DoctorCheck(subject, _without_names(f"{type(error).__name__}: {error}"), False, remedy)


def _packages() -> Iterator[DoctorCheck]:
    """Yield the versions of required packages, and of those for further file formats."""
    try:
        needed = requires("friso") or []
    except PackageNotFoundError:
        yield DoctorCheck("packages", "friso is run from a folder, not installed")
        return
    present: list[str] = []
    for line in needed:
        name = re.split(r"[^\w.-]", line)[0]
        extra = re.search(r"extra == ['\"](\w+)['\"]", line)
        try:
            installed = f"{name} {version(name)}"
        except PackageNotFoundError:
            if extra is None:
                yield DoctorCheck("packages", f"{name} is missing", False, f"pip install {name}")
            elif extra[1] in EXTRAS:
                yield DoctorCheck(f"extra {extra[1]}", f"{name} is not installed; for it: {install(extra[1])}")
            elif extra[1] not in DEVELOPMENT:
                yield DoctorCheck(f"{extra[1]} files", f"not installed; for them: {install(extra[1])}")
            continue
        if extra is None or extra[1] in EXTRAS:
            present.append(installed)
        elif extra[1] not in DEVELOPMENT:
            yield DoctorCheck(f"{extra[1]} files", f"read by {installed}")
    yield DoctorCheck("packages", ", ".join(present))


DEVELOPMENT = ("test", "docs", "bench")
"""Extras that only developers need."""


def _processor() -> str:
    """Return the processor for which code is compiled, and its register width."""
    from friso.engine.machine_code import processor

    chosen = processor()
    return f"{chosen.name}, {chosen.triple}: registers of {chosen.lanes} numbers ({64 * chosen.lanes} bits)"


def _kept_code() -> str:
    """Check the folder of compiled code: its size, whether it is permanent, and who can read it."""
    from friso.engine.cache import ENTRY, cache_folder, is_passing

    folder = cache_folder()
    sizes = [file.stat().st_size for file in folder.glob(f"*{ENTRY}")]
    text = f"{len(sizes)} kernels, {sum(sizes) / 1e6:.1f} MB, in {_without_names(str(folder))}"
    if is_passing(folder):
        text += ", which is deleted at the end"
    if MODES_TELL:
        text += f", {'open' if is_open_to_others(folder.stat()) else 'closed'} to other users"
    return text


def _compiling() -> str:
    """Compile the kernel of the template's stage into a folder that is deleted."""
    from friso.engine.build import build
    from friso.engine.kernel import KernelRequest
    from friso.equations.structure import structure

    request = KernelRequest(structure(_stage().flat()))
    with temporary_folder("friso-doctor-") as folder:
        begin = time.perf_counter()
        build(folder, pickle.dumps(((), pickle.dumps(request))))
        return f"a kernel in {time.perf_counter() - begin:.1f} s ({request.title})"


TIMED_RUNS = 64
"""Runs that `friso doctor` times. Fewer measure the start of the threads, not the solver."""

SWING_ERROR = 0.02
"""Largest relative error of the expected amplitude. Processors agree to a thousandth; a broken kernel is off by far
more."""


def _running() -> str:
    """Run the template's stage, which hunts with its joint locked, and report the speed.

    Raises RuntimeError if it does not swing as it should.
    """
    from friso.engine.batch import run_chunks
    from friso.engine.kernel import kernel
    from friso.equations.structure import structure
    from friso.hunting.measures import measure_runs, measuring_options

    flat = _stage().flat()
    options = measuring_options(1e-6, threads=1)
    shape = kernel(structure(flat))
    begin = time.perf_counter()
    (runs,) = run_chunks(shape, flat, TIMED_RUNS, options)
    seconds, steps = time.perf_counter() - begin, runs.statistic("attempted").sum()
    swings = measure_runs(flat, runs).peak_to_peak
    if not abs(swings / settings.expected_swing - 1).max() < SWING_ERROR:
        raise RuntimeError(
            f"the template's stage swings by {swings.min():g} to {swings.max():g} m, not {settings.expected_swing:g} m"
        )
    return f"{steps / seconds / 1e6:.2g} million steps of the solver per second on one core; the result is right"


def _stage() -> Stage:
    template = files("friso").joinpath("templates/stage.toml").read_text(encoding="utf-8")
    return loads(template, "the template").replace({"joint.locked": True})


def _without_names(text: str) -> str:
    """Return a text with home folders as ~, and the user's name elsewhere in paths as USER."""
    home = user = ""
    with suppress(RuntimeError):  # raised for a user without a home
        home = str(Path.home())
    with suppress(OSError, KeyError, ImportError):  # raised for a user without a name
        user = getpass.getuser()
    written = (home, repr(home)[1:-1]) if len(home) > 3 else ()  # skip the root; messages double backslashes
    word = r"""[^\s\\/'":;,]+"""
    name = rf"""(?:{word}(?: {word})*(?=[\\/'"])|{word})"""  # such as ANNMIL~1, or Ann Miller before a subfolder
    homes = [*map(re.escape, written), rf"(?<!\w)([a-z]:)?[\\/]+(home|users)[\\/]+{name}"]
    text = re.sub(rf"({'|'.join(homes)})(?!\w)", "~", text, flags=re.IGNORECASE)
    return re.sub(rf"(?<=[\\/._-]){re.escape(user)}(?![^\W_])", "USER", text, flags=re.IGNORECASE) if user else text
