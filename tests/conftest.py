"""Kernels of the test run are compiled into a folder of its own, which its worker processes share; each of these has a
core to itself, so that its BLAS takes no more."""

import gc
import os
import shutil
import signal
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from threading import TIMEOUT_MAX

import pytest
from hypothesis import settings
from patched import patched
from snapshots import Snapshots

import friso
from friso.hunting.margin import NOT_SOUGHT
from friso.stage import Stage

FOLDER = "FRISO_CACHE_DIR"
MADE = "FRISO_TEST_CACHE_DIR"
BLAS = "OPENBLAS_NUM_THREADS"

# The same examples for the same test, however slow the machine is: a change is refused for what it did. Others are
# drawn by `pytest --hypothesis-profile random`.
settings.register_profile("random", deadline=None)
settings.register_profile("repeatable", deadline=None, derandomize=True)
settings.load_profile("repeatable")

sys.path.append(str(Path(__file__).parents[1]))  # for benchmarks; last, so that friso is the one installed


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--refresh-snapshots", action="store_true", help="Write what commands say to tests/snapshots.")


def pytest_configure(config: pytest.Config) -> None:
    """Before the workers start, so that they inherit the variables; a folder already chosen is kept and left."""
    os.environ.setdefault(BLAS, "1")
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # a shell starts what runs in its background deaf to Ctrl-C
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if hasattr(signal, "SIGHUP") and signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:  # nohup
        signal.signal(signal.SIGHUP, signal.SIG_DFL)
    if FOLDER not in os.environ:
        os.environ[FOLDER] = os.environ[MADE] = tempfile.mkdtemp(prefix="friso-tests-")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the cases of a test that are not among the first `cases(first=, slow=)`, and whole studies, which use a
    fixture `thorough_...`."""
    seen = Counter[str]()
    for item in items:
        if any(name.startswith("thorough_") for name in getattr(item, "fixturenames", ())):
            item.add_marker("thorough")
        if cases := item.get_closest_marker("cases"):
            function = item.nodeid.partition("[")[0]
            number = seen[function] = seen[function] + 1
            first, slow = cases.kwargs.get("first", 0), cases.kwargs.get("slow", sys.maxsize)
            if number > first:
                item.add_marker("slow" if number - first <= slow else "thorough")


def pytest_collection_finish(session: pytest.Session) -> None:
    """Exclude all present imports from garbage collection, which would take a twentieth of the time."""
    gc.freeze()
    gc.set_threshold(20_000, 20, 10)


def pytest_make_parametrize_id(val: object, argname: str) -> str | None:
    """Arguments of a command name their test, folders left out; anything else as pytest has it."""
    if isinstance(val, list | tuple) and argname in ("arguments", "options", "given", "overrides"):
        return " ".join(part.name if isinstance(part, Path) else str(part) for part in val) or "nothing"
    return None


def pytest_unconfigure(config: pytest.Config) -> None:
    if not hasattr(config, "workerinput") and MADE in os.environ:
        shutil.rmtree(os.environ.pop(MADE), ignore_errors=True)
        os.environ.pop(FOLDER, None)


@pytest.fixture(scope="session")
def rig() -> Stage:
    """The thesis rig, its joint free."""
    return friso.load(Path(__file__).parent.parent / "examples" / "thesis_rig.toml")


@pytest.fixture(scope="session")
def locked(rig: Stage) -> Stage:
    """The thesis rig, its joint locked."""
    return rig.variants()["locked"]


@pytest.fixture(scope="session")
def built() -> Stage:
    """The thesis rig with its drive as built."""
    return friso.load(friso.example("thesis_drive"))


@pytest.fixture
def own_bandwidth(monkeypatch: pytest.MonkeyPatch) -> None:
    """Checks search no other bandwidths than a stage's own, which takes most of their time: what they say of the stage
    itself does not depend on it."""
    monkeypatch.setattr("friso.hunting.verdict.search_bandwidths", lambda *how: NOT_SOUGHT)


@pytest.fixture(scope="session", autouse=True)
def unprinted() -> Iterator[None]:
    """Pages hold empty prints, whose drawing takes most of a page's time; tests/test_check_views.py has one with its
    own. Figures that are files are drawn, but for tests that ask for `undrawn`."""
    from friso.shown import pages  # slow

    with patched({pages: {"image": lambda *_, **__: b""}}):
        yield


@pytest.fixture(scope="session", autouse=True)
def unhurried() -> Iterator[None]:
    """Suppress lines of progress, so that what commands say does not depend on how long they take."""
    from friso.cli import terminal

    with patched({terminal: {"LINE_INTERVAL": TIMEOUT_MAX}}):
        yield


@pytest.fixture
def printed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pages hold their prints all the same."""
    from friso.shown import blocks

    monkeypatch.setattr("friso.shown.pages.image", blocks.image)


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave image files empty, for tests of everything else."""
    monkeypatch.setattr("friso.shown.drawing.matplotlib_renderer.image", lambda *_, **__: b"")


@pytest.fixture(scope="session")
def snapshots(pytestconfig: pytest.Config) -> Snapshots:
    """Return the stored texts of commands, in tests/snapshots."""
    return Snapshots(bool(pytestconfig.getoption("--refresh-snapshots")))
