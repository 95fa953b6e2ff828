"""The command and the line of Python that give what the page shows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from friso.platform.system import shell_word
from friso.quantities import as_toml


def command_line(command: str, files: Sequence[str], options: Mapping[str, Any]) -> str:
    """A command with files and options by their names in Python, as the shell of this system takes it."""
    words = ["friso", command, *files]
    for name, value in _each(options):
        option = f"--{name.strip('_').replace('_', '-')}"
        words += [option] if value is True else [option, str(value)]
    return " ".join(map(shell_word, words))


def python_line(function: str, files: Sequence[str], options: Mapping[str, Any]) -> str:
    """The same in Python."""
    first = repr(files[0] if len(files) == 1 else [*files])
    return f"friso.{function}({', '.join([first, *(f'{name}={value!r}' for name, value in options.items())])})"


def _each(options: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """The options of a command; of one that is given for several keys, each."""
    for name, value in options.items():
        if isinstance(value, Mapping):
            yield from ((name, f"{key}={_bare(item)}") for key, item in value.items())
        else:
            yield name, value


def _bare(value: Any) -> str:
    """A value behind KEY=: texts without quotes, as the command line reads them."""
    return value if isinstance(value, str) else as_toml(value)
