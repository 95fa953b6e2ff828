"""The command and the line of Python that give what the page shows."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from friso.app.machine import Machine
from friso.quantities import as_toml
from friso.system import shell_word


def command_line(command: str, machine: Machine, options: Mapping[str, Any]) -> str:
    """The command, as the shell of this system takes it."""
    sets = [("set", f"{key}={_bare(value)}") for key, value in _set(machine).items()]
    words = ["friso", command, machine.name]
    for name, value in [*sets, *options.items()]:
        option = f"--{name.strip('_').replace('_', '-')}"
        words += [option] if value is True else [option, str(value)]
    return " ".join(map(shell_word, words))


def python_line(function: str, machine: Machine, options: Mapping[str, Any]) -> str:
    """The same in Python."""
    changed = {"set": _set(machine)} if _set(machine) else {}
    arguments = [repr(machine.name), *(f"{name}={value!r}" for name, value in {**changed, **options}.items())]
    return f"friso.{function}({', '.join(arguments)})"


def _set(machine: Machine) -> dict[str, Any]:
    """The keys to be set: none in the stage file that the page saves, which has them."""
    return {} if machine.is_of_page else machine.changes


def _bare(value: Any) -> str:
    """A value behind KEY=: texts without quotes, as the command line reads them."""
    return value if isinstance(value, str) else as_toml(value)
