"""The command and the line of Python that give what the page shows."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from typing import Any

from friso.app.machine import Machine
from friso.quantities import as_toml


def command_line(command: str, machine: Machine, options: Mapping[str, Any]) -> str:
    """The command, as a POSIX shell takes it."""
    sets = [("set", f"{key}={_bare(value)}") for key, value in machine.changes.items() if value is not None]
    words = ["friso", command, machine.name]
    for name, value in [*sets, *options.items()]:
        option = f"--{name.strip('_').replace('_', '-')}"
        words += [option] if value is True else [option, str(value)]
    return " ".join(map(shlex.quote, words))


def python_line(function: str, machine: Machine, options: Mapping[str, Any]) -> str:
    """The same in Python."""
    changed = {"set": machine.changes} if machine.changes else {}
    arguments = [repr(machine.name), *(f"{name}={value!r}" for name, value in {**changed, **options}.items())]
    return f"friso.{function}({', '.join(arguments)})"


def _bare(value: Any) -> str:
    """A value behind KEY=: texts without quotes, as the command line reads them."""
    return value if isinstance(value, str) else as_toml(value)
