"""Write the shell command and the line of Python that repeat what the page shows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from friso.platform.system import shell_word
from friso.quantities import as_toml


def command_line(command: str, files: Sequence[str], options: Mapping[str, Any]) -> str:
    """Return a friso command with its files and options, quoted for this system's shell.

    `options` holds the options by their names in Python.
    """
    words = ["friso", command, *files]
    for name, value in _each(options):
        option = f"--{name.strip('_').replace('_', '-')}"
        words += [option] if value is True else [option, str(value)]
    return " ".join(map(shell_word, words))


def python_line(function: str, files: Sequence[str], options: Mapping[str, Any]) -> str:
    """Return the call of a friso function with its files and options as a line of Python."""
    first = repr(files[0] if len(files) == 1 else [*files])
    return f"friso.{function}({', '.join([first, *(f'{name}={value!r}' for name, value in options.items())])})"


def _each(options: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Yield every option with its value; an option for several keys comes once per key."""
    for name, value in options.items():
        if isinstance(value, Mapping):
            yield from ((name, f"{key}={_bare(item)}") for key, item in value.items())
        else:
            yield name, value


def _bare(value: Any) -> str:
    """Write a value behind KEY= as the command line reads it, texts without quotes."""
    return value if isinstance(value, str) else as_toml(value)
