"""What is checked of the arguments of every command, before it begins."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import wraps
from pathlib import Path
from typing import Any, get_type_hints

from typer.models import ArgumentInfo

from friso import paths
from friso.errors import InputError


def refuse_empty(arguments: Iterable[str]) -> None:
    """Raises InputError for an empty argument: what a shell makes of a variable that is not set."""
    option = ""
    for argument in arguments:
        name, _, value = argument.partition("=")
        of_option = name.startswith("--") and "=" in argument
        if not (value if of_option else argument):
            place = name if of_option else option or "the arguments"
            raise InputError(place, "an empty text", "a value, or to be left out", f"{option or name} VALUE".lstrip())
        option = argument if argument.startswith("-") else ""


def with_checked_paths(function: Callable[..., None]) -> Callable[..., None]:
    """The function of a command, which raises InputError for a path that is none."""

    @wraps(function)
    def command(**options: Any) -> None:
        for name, value in options.items():
            for path in value if isinstance(value, list) else [value]:
                if isinstance(path, Path) and (flaw := paths.flaw_of(path)):
                    key, example = _named(function, name)
                    raise InputError(key, flaw, paths.EXPECTED, example)
        function(**options)

    return command


def _named(function: Callable[..., None], name: str) -> tuple[str, str]:
    """What a path is called on the command line, and an example of it."""
    (info,) = get_type_hints(function, include_extras=True)[name].__metadata__
    if isinstance(info, ArgumentInfo):
        return str(info.metavar), "rig.toml"
    option = next(iter(info.param_decls or ()), f"--{name.replace('_', '-')}")
    return option, f"{option} report"
