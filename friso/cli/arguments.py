"""Check the arguments of every command before it runs."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from functools import wraps
from inspect import signature
from itertools import pairwise
from pathlib import Path
from typing import Any, get_args, get_type_hints

from typer import BadParameter
from typer.models import ArgumentInfo

from friso.errors import InputError
from friso.platform import files
from friso.platform.system import shell_word


def refuse_empty(arguments: Iterable[str]) -> None:
    """Raise InputError for an empty argument, as a shell passes for a variable that is not set."""
    option = ""
    for argument in arguments:
        name, _, value = argument.partition("=")
        of_option = name.startswith("--") and "=" in argument
        if not (value if of_option else argument):
            place = name if of_option else option or "the arguments"
            raise InputError(place, "an empty text", "a value, or to be left out", f"{option or name} VALUE".lstrip())
        option = argument if argument.startswith("-") else ""


def with_checked_paths(function: Callable[..., None]) -> Callable[..., None]:
    """Wrap a command so that it refuses malformed paths with InputError."""

    @wraps(function)
    def command(**options: Any) -> None:
        """Check every path among the options, then call the function."""
        for name, value in options.items():
            for path in value if isinstance(value, list) else [value]:
                if isinstance(path, Path) and (flaw := files.flaw_of(path)):
                    key, example = _named(function, name)
                    raise InputError(key, flaw, files.EXPECTED, example)
        function(**options)

    return command


def _named(function: Callable[..., None], name: str) -> tuple[str, str]:
    """Return the name of a path's option on the command line, and an example of its use.

    `function` is the command, and `name` the option's name in Python.
    """
    (info,) = get_type_hints(function, include_extras=True)[name].__metadata__
    if isinstance(info, ArgumentInfo):
        return str(info.metavar), "rig.toml"
    option = next(iter(info.param_decls or ()), f"--{name.replace('_', '-')}")
    return option, f"{option} report"


_NUMBERS = {int: "a whole number", float: "a number"}


def number_refused(
    error: BaseException, arguments: Sequence[str], function_of: Callable[[str], Callable[..., None] | None]
) -> InputError | None:
    """Return friso's error for an option with a missing number, or one out of range.

    `function_of` returns the function of a command by its name (None: no such command). Returns None for any other
    error.
    """
    parameter, context = (getattr(error, name, None) for name in ("param", "ctx"))
    function = function_of(getattr(context, "info_name", None) or "")
    if not isinstance(error, BadParameter) or parameter is None or function is None:
        return None
    name = str(parameter.name)
    asked = get_type_hints(function, include_extras=True)[name]
    wanted, info = asked.__origin__, asked.__metadata__[0]
    kind = next((kind for kind in (wanted, *get_args(wanted)) if kind in _NUMBERS), None)
    if kind is None:
        return None
    option, expected = parameter.opts[0], _NUMBERS[kind]
    if info.min is not None and info.max is not None:
        expected += f" from {info.min:g} to {info.max:g}"
    default = signature(function).parameters[name].default
    example = default if isinstance(default, int | float) else info.max or 4
    return InputError(option, _value_of(option, arguments), expected, f"{option} {example}")


def _value_of(option: str, arguments: Sequence[str]) -> str:
    """Return the last value of an option on the command line, in quotes."""
    values = [value for before, value in pairwise(arguments) if before == option]
    values += [argument.partition("=")[2] for argument in arguments if argument.startswith(f"{option}=")]
    from friso.quantities import quoted  # imported only here, because it is rarely needed

    return quoted(values[-1]) if values else "no number"


def parted_path(words: Sequence[str]) -> str:
    """Return a hint to use quotes if several words together are the path of an existing file.

    Such a path contains blanks and lacks its quotes. Otherwise the hint is empty.
    """
    paths = (" ".join(words[first : first + count]) for first in range(len(words) - 1) for count in range(2, 7))
    path = next((path for path in paths if os.path.isfile(path)), "")
    return f"\n  a path with blanks needs quotes: {shell_word(path)}" if path else ""
