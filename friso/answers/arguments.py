"""The types of arguments, by their annotations: one of another type is an InputError that names the argument."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import wraps
from inspect import signature
from numbers import Integral, Real
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import numpy as np

from friso.errors import InputError
from friso.quantities import quoted
from friso.stage import Stage

Arguments = ParamSpec("Arguments")
Returned = TypeVar("Returned")


def _is_path(value: Any) -> bool:
    return isinstance(value, str) or (isinstance(value, os.PathLike) and isinstance(os.fspath(value), str))


_KINDS: dict[str, tuple[Callable[[Any], bool], str]] = {
    "None": (lambda value: value is None, "None"),
    "str": (lambda value: isinstance(value, str), "a text"),
    "int": (lambda value: isinstance(value, Integral) and not isinstance(value, bool), "a whole number"),
    "float": (lambda value: isinstance(value, Real) and not isinstance(value, bool), "a number"),
    "bool": (lambda value: isinstance(value, bool | np.bool_), "True or False"),
    "os.PathLike[str]": (_is_path, "a path"),
    "Path": (lambda value: isinstance(value, Path), "a path"),
    "StageLike": (
        lambda value: isinstance(value, Stage | Mapping) or _is_path(value),
        "a stage, the path of a stage file, or its tables as a dictionary",
    ),
    "Changes": (
        lambda value: value is None or (isinstance(value, Iterable) and not isinstance(value, str | bytes)),
        "a dictionary of keys, or a list of texts KEY=VALUE",
    ),
    "LogFiles": (
        lambda value: _is_path(value) or (isinstance(value, Sequence) and all(map(_is_path, value))),
        "the path of a file, or a list of paths",
    ),
    "Iterable[str]": (
        lambda value: isinstance(value, list | tuple | set | frozenset) and all(isinstance(v, str) for v in value),
        "a list of texts",
    ),
}
"""What an annotation stands for: a test, and words. Arguments with another annotation are checked where they are
used."""


def checked(function: Callable[Arguments, Returned]) -> Callable[Arguments, Returned]:
    """A function that raises InputError for an argument of another type than is annotated."""
    parameters = signature(function)
    annotated = {name: str(parameter.annotation).split(" | ") for name, parameter in parameters.parameters.items()}
    kinds = {name: parts for name, parts in annotated.items() if _KINDS.keys() >= set(parts)}

    @wraps(function)
    def call(*arguments: Arguments.args, **options: Arguments.kwargs) -> Returned:
        for name, value in parameters.bind(*arguments, **options).arguments.items():
            expected = [_KINDS[part] for part in kinds.get(name, ())]
            if expected and not any(holds(value) for holds, _ in expected):
                words = [words for _, words in expected if words != "None"]
                raise InputError(name, quoted(value), " or ".join(dict.fromkeys(words)))
        return function(*arguments, **options)

    return call
