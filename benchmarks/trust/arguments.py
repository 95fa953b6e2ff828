"""Test arguments of every public function and every command.

They are of other types, empty, thousands of characters long, or out of range. They must be accepted, or refused in one
clear message with nothing written. Nothing is computed.
"""

import inspect
import random
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from functools import cache
from io import StringIO
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import typer

import friso
from benchmarks.trust.inputs import DRIVE, LEAVES, RIG, SPEC, ready
from friso.cli import main
from friso.cli.app import command_line
from friso.engine.cache import CodeRequest
from friso.errors import InputError
from friso.shown.drawing import matplotlib_renderer

CALLS: dict[str, dict[str, Any]] = {
    **{name: {"stage": RIG} for name in ("bode", "check", "simulate", "tune")},
    "boundary": {"stage": RIG, "x": "controller.crossover=4 Hz..8 Hz"},
    "compare": {"stage": DRIVE, "machines": 20},
    "design": {"stage": RIG, "spec": SPEC},
    "doctor": {},
    "example": {"name": "thesis_rig"},
    "export": {"stage": RIG},
    "flexure": {"stage": LEAVES},
    "guideline": {"samples": 64},
    "identify": {"logs": "log.csv"},
    "init": {"path": "new.toml"},
    "linear": {"stage": RIG},
    "load": {"path": RIG},
    "loads": {"text": "", "origin": "file"},
    "logs": {"logs": "log.csv"},
    "member": {},
    "read_store": {"path": "a.zarr"},
    "reproduce": {},
    "rig": {"experiment": "stiffness", "stage": DRIVE},
    "save": {"stage": RIG, "path": "saved.toml"},
    "schema": {},
    "sweep": {"stage": RIG, "x": "controller.crossover=2 Hz..16 Hz:3"},
    "tuning": {"crossover": 8.0, "alpha": 0.1, "beta": 2.0, "mass": 1.7},
}
"""Valid arguments of every public function."""


_LONG = ("x" * 201, "x" * 256, "x" * 5000, "x/" * 700, "9" * 400, "9" * 5000, "a." * 10_000, "[" * 3000)
TEXTS = (
    *("", " ", ".", "..", "/", "-", "=", ":", "..:", "\n", "\t", "\x1b[31m", "\u202e", "\udc80", "\u0663", "a=b", "=b"),
    *("nan", "inf", "-1", "0", "1e400", "1e-400", "1.5", "true", "none", "{}", "[]", '"', "'", "8 Hz", "1 s", "-1 s"),
    *("1 Hz..", "..2 Hz", "2 Hz..1 Hz:5", "1 Hz..2 Hz:1", "1 Hz..2 Hz:1e9", "masses.stage", "masses.stage=", "name={"),
    *("controller.crossover=1 Hz..1e400 Hz:3", "nothing.key=1 Hz..2 Hz:3", "position=", "position=nothing", "a=1=2"),
    *("/dev/null", "/dev/full", "/dev/zero", "/proc/self/mem", "nowhere/a", "log.csv", "log.csv/a", "a.nc", "a.csv"),
    *("folder", "folder.nc", "a.zarr", "tcp://", "tcp://127.0.0.1:1", "http://[", *_LONG),
)
"""Texts that a user or a script may give, by mistake or on purpose."""

VALUES: tuple[Any, ...] = (
    *("a\0b", None, True, 0, -1, 1, 10**18, 10**400, 10**5000, 1.5, float("nan"), float("inf"), 1e300, 1e-300, 1j),
    *(b"x", [], [None], [3], [""], ["x" * 300], ["a.nc"], {}, {"x": 1}, {3: 4}, {"masses.stage": None}, {"": ""}, ()),
    *((1, 2), {1, 2}, object(), print, RuntimeError, Path(), Path("nowhere/a"), Path("x" * 300), np.zeros(0)),
    *(np.zeros((2, 2)), np.array([1.0, np.nan]), np.array(["x"]), np.float64(3.0), np.int64(3), iter([1]), range(3)),
)
"""Values of other types, and extreme values."""


class Computed(BaseException):
    """Error: computation would begin, because all arguments were accepted."""


def arguments(rng: random.Random, folder: Path) -> None:
    """Replace one argument of a public function."""
    name = rng.choice([*CALLS])
    function = getattr(friso, name)
    sound = {key: friso.load(value) if _wants_stage(name, key) else value for key, value in CALLS[name].items()}
    names = [key for key in inspect.signature(function).parameters if key not in ("progress", "keep")]
    if not names:
        return
    key, value = rng.choice(names), rng.choice((*VALUES, *TEXTS))
    what = f"{name}({key}={_shown(value)})"
    with ready(folder), nothing_computed(), redirect_stdout(StringIO()):
        before = _tree(folder)
        try:
            function(**{**sound, key: value})
        except InputError as error:
            assert_clear(what, str(error))
            assert _tree(folder) == before, f"{what}: wrote {_tree(folder) - before}"
        except Computed:
            pass
        except Exception as error:
            raise AssertionError(f"{what}: {type(error).__name__}: {str(error)[:200]}") from error


def options(rng: random.Random, folder: Path) -> None:
    """Replace or add one argument or option of a command."""
    valued_options = _valued_options()
    name = rng.choice([*valued_options])
    valued = valued_options[name]
    line, text = line_of(name, valued), rng.choice(TEXTS).replace("\0", "")
    place = rng.randrange(len(line) + 2 * len(valued))
    if 0 < place < len(line):
        line[place] = text
    elif valued:
        line += [rng.choice(valued), text]
    what = _shown(line)
    with ready(folder), nothing_computed():
        before = _tree(folder)
        try:
            status, err = _run(["friso", *line])
        except Computed:
            return
        except Exception as error:
            raise AssertionError(f"{what}: {type(error).__name__}: {str(error)[:200]}") from error
        assert status in (0, 1, 2), f"{what}: status {status}"
        assert "could not be completed" not in err, f"{what}: {err[:300]}"
        if status == 2:
            assert_clear(what, err)
            assert _tree(folder) == before, f"{what}: refused, but wrote {_tree(folder) - before}"


def line_of(name: str, valued: list[str]) -> list[str]:
    """Return a valid line of a command, some of whose options take a value."""
    if name == "app":
        return [name, RIG, "--no-browser"]
    words = [name]
    for key, value in CALLS["sweep" if name == "map" else name].items():
        words += [f"--{key}", str(value)] if f"--{key}" in valued else [str(value)]
    return words


def _run(line: list[str]) -> tuple[int, str]:
    """Return status and errors of a command in this process."""
    err = StringIO()
    with mock.patch.object(sys, "argv", line), redirect_stdout(StringIO()), redirect_stderr(err):
        try:
            main()
        except SystemExit as end:
            return int(end.code or 0), err.getvalue()


def assert_clear(what: str, message: str) -> None:
    """Check that a message is clear.

    Raises AssertionError for an empty message, or one that is longer than anyone reads.
    """
    assert message.strip(), f"{what}: a refusal without words"
    longest = max(map(len, message.splitlines()))
    assert longest < 2000, f"{what}: a line of {longest} characters"


def _wants_stage(name: str, key: str) -> bool:
    annotation = inspect.signature(getattr(friso, name)).parameters[key].annotation
    return str(annotation) == "Stage"


@cache
def _valued_options() -> dict[str, list[str]]:
    """Return the options of every command that take a value."""
    commands = typer.main.get_command(command_line()).commands  # type: ignore[attr-defined]
    return {
        name: [param.opts[0] for param in command.params if param.opts[0].startswith("--") and not param.is_flag]
        for name, command in commands.items()
    }


@contextmanager
def nothing_computed() -> Iterator[None]:
    """Prevent computation in the block: Computed is raised instead.

    Kernels are neither built nor loaded, loaded ones are hidden, and nothing is served. Pictures are empty.
    """

    def computed(*_: object, **__: object) -> None:
        raise Computed

    with (
        mock.patch.object(CodeRequest, "entry", computed),
        mock.patch("friso.engine.kernel._kernels", {}),
        mock.patch("uvicorn.Server.run", computed),
        mock.patch.object(matplotlib_renderer, "image", return_value=b""),
    ):
        yield


def _shown(value: object) -> str:
    try:
        text = repr(value)
    except ValueError:  # a whole number of thousands of digits
        text = type(value).__name__
    return text if len(text) < 100 else f"{text[:80]}... ({len(text)})"


def _tree(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


ARGUMENTS = {"arguments": arguments, "options": options}
"""Campaigns by name."""
