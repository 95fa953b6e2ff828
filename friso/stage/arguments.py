"""The types of arguments, by their annotations: one of another type is an InputError that names the argument."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping, Sequence, Set
from functools import wraps
from inspect import signature
from numbers import Integral, Real
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import numpy as np

from friso.errors import InputError
from friso.quantities import quoted
from friso.stage.stage import Stage

Arguments = ParamSpec("Arguments")
Returned = TypeVar("Returned")


def _is_text(value: Any) -> bool:
    return isinstance(value, str)


def _is_path(value: Any) -> bool:
    return _is_text(value) or (isinstance(value, os.PathLike) and _is_text(os.fspath(value)))


def _has_text_keys(value: Any) -> bool:
    return isinstance(value, Mapping) and all(map(_is_text, value))


def _is_list(value: Any, of: Callable[[Any], bool]) -> bool:
    return isinstance(value, Sequence | Set) and not isinstance(value, str | bytes) and all(map(of, value))


def _is_number(value: Any) -> bool:
    """Whether a value is one number that a float can be."""
    if not isinstance(value, Real) or isinstance(value, bool):
        return False
    try:
        float(value)
    except (OverflowError, ValueError):
        return False
    return True


def _are_numbers(value: Any) -> bool:
    try:
        np.asarray(value, dtype=float)
    except (TypeError, ValueError, OverflowError):
        return False
    return True


MOST_INT = 10**18
"""Whole numbers are smaller, whatever they count."""

_ALTERNATIVES = re.compile(r" \| (?![^\[]*\])")

_KINDS: dict[str, tuple[Callable[[Any], bool], str]] = {
    "None": (lambda value: value is None, "None"),
    "str": (_is_text, "a text"),
    "int": (
        lambda value: isinstance(value, Integral) and not isinstance(value, bool) and abs(int(value)) < MOST_INT,
        "a whole number",
    ),
    "float": (_is_number, "a number"),
    "bool": (lambda value: isinstance(value, bool | np.bool_), "True or False"),
    "os.PathLike[str]": (_is_path, "a path"),
    "Path": (lambda value: isinstance(value, Path), "a path"),
    "Stage": (lambda value: isinstance(value, Stage), "a stage, such as friso.load(path)"),
    "StageLike": (
        lambda value: isinstance(value, Stage) or _has_text_keys(value) or _is_path(value),
        "a stage, the path of a stage file, or its tables as a dictionary",
    ),
    "Changes": (
        lambda value: value is None or _has_text_keys(value) or _is_list(value, _is_text),
        "a dictionary of keys, or a list of texts KEY=VALUE",
    ),
    "Spec": (lambda value: type(value).__name__ == "Spec", "a specification"),
    "tuple[float, float]": (
        lambda value: _is_list(value, lambda end: _is_number(end) or _is_text(end)) and len(value) == 2,
        "both ends of a range",
    ),
    "Sequence[int | str]": (
        lambda value: _is_list(value, lambda item: _is_path(item) or isinstance(item, Integral)),
        "the numbers of a cell",
    ),
    "Iterable[str | os.PathLike[str]]": (lambda value: _is_list(value, _is_path), "a list of paths"),
    "Mapping[str, str]": (_has_text_keys, "a dictionary of keys to ranges"),
    "Mapping[str, Values]": (_has_text_keys, "a dictionary of keys to ranges or values"),
    "LogFiles": (lambda value: _is_path(value) or _is_list(value, _is_path), "the path of a file, or a list of paths"),
    "Iterable[str]": (lambda value: _is_list(value, _is_text), "a list of texts"),
    "Sequence[str]": (lambda value: _is_list(value, _is_text), "a list of texts"),
    "Sequence[float]": (_are_numbers, "numbers"),
    "np.ndarray": (_are_numbers, "numbers"),
}
"""What an annotation stands for: a test, and words. Arguments with another annotation are checked where they are
used."""


def check_arguments(function: Callable[Arguments, Returned]) -> Callable[Arguments, Returned]:
    """A function that raises InputError for an argument of another type than is annotated."""
    parameters = signature(function)
    annotated = {
        name: _ALTERNATIVES.split(str(parameter.annotation)) for name, parameter in parameters.parameters.items()
    }
    kinds = {name: parts for name, parts in annotated.items() if _KINDS.keys() >= set(parts)}

    @wraps(function)
    def call(*arguments: Arguments.args, **options: Arguments.kwargs) -> Returned:
        for name, value in parameters.bind(*arguments, **options).arguments.items():
            expected = [_KINDS[part] for part in kinds.get(name, ())]
            if expected and not any(holds(value) for holds, _ in expected):
                words = [words for _, words in expected if words != "None"]
                meant = 'set={"masses.stage": "0.6 kg"}' if "set" in kinds and isinstance(value, Mapping) else ""
                raise InputError(name, quoted(value), " or ".join(dict.fromkeys(words)), meant)
        return function(*arguments, **options)

    return call
