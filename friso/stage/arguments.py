"""Check the arguments of functions by their annotations, and load and save stage files.

A wrong type gives an InputError that names the argument. A stage may come as its file, as tables or as text. For
`--help` and reports, controllers and friction laws from outside friso are listed.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from functools import wraps
from inspect import signature
from numbers import Integral, Real
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import numpy as np

from friso.errors import InputError
from friso.platform import files
from friso.platform.files import whole_file
from friso.platform.system import check_free
from friso.quantities import quoted
from friso.stage.controllers import CONTROLLERS
from friso.stage.section import load_installed, plug_in_of
from friso.stage.stage import Stage
from friso.stage.tables import FRICTION
from friso.stage.tables_of_files import read_stage, reason_of, stage_of

Arguments = ParamSpec("Arguments")
Returned = TypeVar("Returned")


TEXT_KINDS = {
    "AxisRange": 'KEY="FIRST..LAST"',
    "AxisPoints": 'KEY="FIRST..LAST:POINTS"',
    "FrequencyBand": '"FIRST..LAST"',
    "LengthRange": '"SMALLEST..LARGEST"',
    "Changeable": "PART",
    "KindName": "KIND",
    "MetricName": "NAME",
    "FormatName": "FORMAT",
    "ExperimentName": "EXPERIMENT",
    "StudyName": "STUDY",
    "ClaimName": "CLAIM",
    "Address": "ADDRESS",
}
"""Annotations of texts, and the placeholder of each on the command line."""

PAIR_KINDS = {
    "Roles": "ROLE=CHANNEL",
    "ChannelUnits": "CHANNEL=UNIT",
    "RoleScales": "ROLE=SCALE",
}
"""Annotations of dictionaries, and the placeholder of a pair on the command line."""

QUANTITY_KINDS = ("LengthLike", "TimeLike", "ForceLike", "FrequencyLike", "RatioLike")
"""Annotations of numbers with a unit: "1 um", or a number in SI."""


def _is_text(value: Any) -> bool:
    return isinstance(value, str)


def _is_path(value: Any) -> bool:
    return _is_text(value) or (isinstance(value, os.PathLike) and _is_text(os.fspath(value)))


def _has_text_keys(value: Any) -> bool:
    return isinstance(value, Mapping) and all(map(_is_text, value))


def _is_list(value: Any, of: Callable[[Any], bool]) -> bool:
    return isinstance(value, Sequence | Set) and not isinstance(value, str | bytes) and all(map(of, value))


def _is_whole(value: Any) -> bool:
    return isinstance(value, Integral) and not isinstance(value, bool)


def _is_number(value: Any) -> bool:
    """Tell whether a value is a single number that fits a float."""
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
"""Bound for all whole numbers, whatever they count."""

MOST_SEED = 2**31 - 1
"""Largest seed that every random number generator accepts."""


@dataclass(frozen=True)
class ArgumentKind:
    """What an argument of a public function may be, chosen by its annotation.

    `holds` tests a value, `words` describe values that pass, and `example` shows one. On the command line, `metavar`
    stands for the value ("": the name of the parameter), and `command_type` is the type of one value (None: it cannot
    be given there); there may be `several`.
    """

    holds: Callable[[Any], bool]
    words: str
    example: str = ""
    metavar: str = ""
    command_type: type | None = str
    several: bool = False


_TEXT = ArgumentKind(_is_text, "a text")
_PATHS = ArgumentKind(
    lambda value: _is_list(value, _is_path), "a list of paths", '["map.nc"]', "FILE", Path, several=True
)
_TEXTS = ArgumentKind(lambda value: _is_list(value, _is_text), "a list of texts", several=True)
_FUNCTION = ArgumentKind(callable, "a function", command_type=None)
_STAGE = ArgumentKind(
    lambda value: isinstance(value, Stage) or _has_text_keys(value) or _is_path(value),
    "a stage, the path of a stage file, or its tables as a dictionary",
    '"rig.toml"',
    "STAGE.toml",
    Path,
)
_CHANGES = ArgumentKind(
    lambda value: value is None or _has_text_keys(value) or _is_list(value, _is_text),
    "a dictionary of keys, or a list of texts KEY=VALUE",
    '{"masses.stage": "0.6 kg"}',
    "KEY=VALUE",
    several=True,
)
_WHOLE = ArgumentKind(_is_whole, "a whole number", "6", "N", int)
_PATH = ArgumentKind(_is_path, "a path", '"report"', "FILE", Path)
_QUANTITY = ArgumentKind(lambda value: _is_number(value) or _is_text(value), "a number or a text")

KINDS: dict[str, ArgumentKind] = {
    "None": ArgumentKind(lambda value: value is None, "", command_type=None),
    "str": _TEXT,
    **{name: replace(_TEXT, metavar=metavar) for name, metavar in TEXT_KINDS.items()},
    "int": replace(_WHOLE, holds=lambda value: _is_whole(value) and abs(int(value)) < MOST_INT, example="64"),
    "Whole": _WHOLE,
    "Seed": replace(
        _WHOLE,
        holds=lambda value: _is_whole(value) and 0 <= value <= MOST_SEED,
        words=f"a whole number from 0 to {MOST_SEED}",
        example="1",
    ),
    "float": ArgumentKind(_is_number, "a number", metavar="NUMBER", command_type=float),
    **{name: replace(_QUANTITY, metavar=name.removesuffix("Like").upper()) for name in QUANTITY_KINDS},
    "Tolerance": replace(_QUANTITY, metavar="NUMBER"),
    "bool": ArgumentKind(lambda value: isinstance(value, bool | np.bool_), "True or False", "True", "", bool),
    "os.PathLike[str]": _PATH,
    "Path": replace(_PATH, holds=lambda value: isinstance(value, Path), example='Path("report")'),
    **dict.fromkeys(("Stage", "StageLike"), _STAGE),
    "StageLikes": replace(
        _STAGE,
        holds=lambda value: _STAGE.holds(value) or _is_list(value, _STAGE.holds),
        words=f"{_STAGE.words}, or a list of these",
        several=True,
    ),
    "Changes": _CHANGES,
    **{name: replace(_CHANGES, metavar=metavar) for name, metavar in PAIR_KINDS.items()},
    "Spec": ArgumentKind(lambda value: type(value).__name__ == "Spec", "a specification", "", "SPEC.toml", Path),
    "Samples": ArgumentKind(lambda value: type(value).__name__ == "Samples", "friso.Samples", command_type=None),
    "Members": ArgumentKind(lambda value: type(value).__name__ == "Members", "friso.Members"),
    "Margin": ArgumentKind(lambda value: type(value).__name__ == "Margin", "the edge of hunting of a stage"),
    "tuple[float, float]": ArgumentKind(
        lambda value: _is_list(value, lambda end: _is_number(end) or _is_text(end)) and len(value) == 2,
        "both ends of a range",
    ),
    "Sequence[int | str]": ArgumentKind(
        lambda value: _is_list(value, lambda item: _is_path(item) or _is_whole(item)),
        "the numbers of a cell",
        several=True,
    ),
    "Sequence[int]": ArgumentKind(lambda value: _is_list(value, _is_whole), "whole numbers"),
    "Iterable[str | os.PathLike[str]]": _PATHS,
    "Mapping[str, str]": ArgumentKind(_has_text_keys, "a dictionary of keys to ranges", command_type=None),
    "Mapping[str, AxisValues]": ArgumentKind(
        _has_text_keys, "a dictionary of keys to ranges or values", command_type=None
    ),
    "Sequence[Mapping[str, Any]]": ArgumentKind(
        lambda value: _is_list(value, _has_text_keys), "a list of dictionaries"
    ),
    "LogFiles": ArgumentKind(
        lambda value: _is_path(value) or _is_list(value, _is_path),
        "the path of a file, or a list of paths",
        '"log.csv"',
        "LOG",
        Path,
        several=True,
    ),
    "Iterable[str]": _TEXTS,
    **{f"Iterable[{name}]": replace(_TEXTS, metavar=metavar) for name, metavar in TEXT_KINDS.items()},
    "Sequence[str]": _TEXTS,
    "Sequence[float]": ArgumentKind(_are_numbers, "numbers"),
    "np.ndarray": ArgumentKind(_are_numbers, "numbers"),
    "Progress": _FUNCTION,
    "MappingKeeper": _FUNCTION,
    "FileKeeper": _FUNCTION,
}
"""What arguments may be, by the annotations of public functions."""

_PATH_KINDS = {
    "os.PathLike[str]",
    "Path",
    "Stage",
    "StageLike",
    "StageLikes",
    "LogFiles",
    "Iterable[str | os.PathLike[str]]",
}


def alternatives(annotation: str) -> list[str]:
    """Split an annotation into its alternatives, at its outer bars.

    "int | None" has two parts, "Iterable[str | None]" has one.
    """
    parts, depth = [""], 0
    for sign in annotation:
        depth += (sign == "[") - (sign == "]")
        if sign == "|" and depth == 0:
            parts.append("")
        else:
            parts[-1] += sign
    return [part.strip() for part in parts]


def check_arguments(function: Callable[Arguments, Returned]) -> Callable[Arguments, Returned]:
    """Return a function that checks its arguments against their annotations.

    It raises InputError for an argument of another type, or for a path that does not exist, and TypeError for an
    unknown keyword. Where a Stage is expected, its file or tables are accepted as well. Raises KeyError for an
    annotation that is not in `KINDS`.
    """
    parameters = signature(function)
    kinds = {
        name: {part: KINDS[part] for part in alternatives(str(parameter.annotation))}
        for name, parameter in parameters.parameters.items()
        if parameter.kind is not parameter.VAR_KEYWORD
    }

    makes_stage = str(parameters.return_annotation).rpartition(".")[2].strip("'>") == "Stage"
    takes_no_others = len(kinds) == len(parameters.parameters)

    @wraps(function)
    def call(*arguments: Arguments.args, **options: Arguments.kwargs) -> Returned:
        """Check the arguments, then call the function."""
        extra = [
            *arguments[len(parameters.parameters) :],
            *map(options.get, options.keys() - parameters.parameters.keys()),
        ]
        changes = '; keys are set so: friso.load(path).replace({"joint.locked": True})'
        how = changes if makes_stage and any(isinstance(value, Mapping) for value in extra) else ""
        if unknown := options.keys() - parameters.parameters.keys() if takes_no_others else ():
            nearest = near_words(min(unknown), parameters.parameters)
            raise TypeError(f"{function.__name__}() has no keyword {min(unknown)!r}{how or nearest}")
        try:
            bound = parameters.bind(*arguments, **options)
        except TypeError as error:
            raise TypeError(f"{function.__name__}(): {error}{how}") from None
        for name, value in bound.arguments.items():
            _check(name, value, kinds.get(name, {}), "set" in kinds)
            if "Stage" in kinds.get(name, {}) and not isinstance(value, Stage):
                bound.arguments[name] = _read_stage(value)
        return function(*bound.args, **bound.kwargs)

    return call


def near_words(word: str, words: Iterable[str]) -> str:
    """Return a suggestion for an unknown word: the nearest of some `words`, or all of them."""
    from difflib import get_close_matches

    near = get_close_matches(word, words := [*words], 1)
    return f"; did you mean {near[0]!r}?" if near else f"; it has {', '.join(words)}"


def _read_stage(source: Any) -> Stage:
    """Return the stage of a file, or of tables in a mapping."""
    return Stage(**source) if isinstance(source, Mapping) else read_stage(source)


def _check(name: str, value: Any, kinds: Mapping[str, ArgumentKind], sets: bool) -> None:
    """Raise InputError for an argument of a wrong type, or for an unusable path.

    `kinds` say what the argument may be. With `sets`, the function has an option to set keys, and the error suggests it
    for a dictionary.
    """
    if kinds and not any(kind.holds(value) for kind in kinds.values()):
        words = " or ".join(dict.fromkeys(kind.words for kind in kinds.values() if kind.words))
        key = "set" if sets and isinstance(value, Mapping) else name
        named = [KINDS["Changes"]] if key == "set" else kinds.values()
        example = next((kind.example for kind in named if kind.example), "")
        raise InputError(name, quoted(value), words, f"{key}={example}" if example else "")
    if _PATH_KINDS & {*kinds}:
        for path in value if _is_list(value, _is_path) else [value]:
            if _is_path(path) and (flaw := files.flaw_of(path)):
                example = next(kind.example for part, kind in kinds.items() if part in _PATH_KINDS)
                raise InputError(name, flaw, files.EXPECTED, f"{name}={example}")


@check_arguments
def load(path: str | os.PathLike[str]) -> Stage:
    """Return the stage of the TOML file at `path`. Raises StageError.

    Examples
    --------
    >>> import friso
    >>> friso.load(friso.example("thesis_rig")).joint.stiffness.text
    '2.4 N/mm'
    """
    return read_stage(path)


@check_arguments
def loads(text: str, origin: str = "stage file") -> Stage:
    """Return the stage of a TOML text; `origin` names it in errors. Raises StageError.

    Examples
    --------
    >>> import friso
    >>> stage = friso.load(friso.example("thesis_rig"))
    >>> friso.loads(stage.to_toml()) == stage
    True
    """
    return stage_of(text, origin)


@check_arguments
def save(stage: Stage, path: str | os.PathLike[str], overwrite: bool = False) -> None:
    """Write a stage file to `path`, all of it or nothing.

    A file that is overwritten keeps its permissions, a link to it stays. Raises InputError where there is a file
    already (unless `overwrite`), or one that is read-only, or the place cannot be written to.

    Examples
    --------
    >>> import friso
    >>> stage = friso.load("rig.toml").replace({"masses.stage": "0.6 kg"})  # doctest: +SKIP
    >>> friso.save(stage, "heavier.toml")  # doctest: +SKIP
    """
    place = Path(path)
    if why := files.unwritable(place):
        raise InputError("path", *why, 'path="stage.toml"')
    if os.path.lexists(place) and not (overwrite and place.is_file()):
        raise InputError("", "a file that already exists", "a new file, or overwrite=True", origin=str(place))
    place = Path(os.path.realpath(place))  # write through a link, so that the link stays
    try:
        if place.exists():
            check_free(place)
        with whole_file(place, new=not overwrite, kept=True) as file:
            file.write(stage.to_toml().encode())
    except OSError as error:
        raise InputError("", reason_of(error), "a writable location", origin=str(place)) from error


def foreign() -> list[str]:
    """Return the loaded controllers and friction laws from outside friso, with their modules."""
    kinds = {
        "controller": [(name, form) for name, forms in CONTROLLERS.forms.items() for form in forms],
        "friction law": FRICTION.classes.items(),
    }
    return [
        f"{kind} {name} ({cls.__module__})"
        for kind, classes in kinds.items()
        for name, cls in classes
        if plug_in_of(cls)
    ]


def installed() -> list[str]:
    """Return controllers and friction laws from outside friso, loaded or installed."""
    for registry in (CONTROLLERS, FRICTION):
        load_installed(registry.group)
    return foreign()
