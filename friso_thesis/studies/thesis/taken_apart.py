"""Convert results to arrays and one text, and back, to save experiments."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from types import NoneType, UnionType
from typing import Any, TypeVar, Union, cast, get_args, get_origin, get_type_hints

import numpy as np

T = TypeVar("T")

_TREE = "tree"
_SCALARS = str, int, float, bool, NoneType


def taken_apart(result: Any) -> dict[str, np.ndarray]:
    """Return the arrays of a result, by their number, and the rest as a text in JSON.

    A result is a dataclass, a tuple, a mapping, an array, a slice, a number, a text or None, or made of these.
    """
    arrays: dict[str, np.ndarray] = {}
    tree = _tree(result, arrays)
    return {**arrays, _TREE: np.array(json.dumps(tree))}


def _tree(value: Any, arrays: dict[str, np.ndarray]) -> Any:
    if isinstance(value, np.ndarray):
        arrays[str(len(arrays))] = value.astype(str) if value.dtype == object else value
        return len(arrays) - 1
    if is_dataclass(value):
        return {field.name: _tree(getattr(value, field.name), arrays) for field in fields(value)}
    if isinstance(value, tuple):
        return [_tree(item, arrays) for item in value]
    if isinstance(value, Mapping):
        return [[_tree(key, arrays), _tree(item, arrays)] for key, item in value.items()]
    if isinstance(value, slice):
        return [value.start, value.stop]
    return value.item() if isinstance(value, np.generic) else value


def put_together(kind: type[T], arrays: Mapping[str, np.ndarray]) -> T:
    """Build a result of a kind, whose annotations define its parts, from arrays.

    Raises ValueError, TypeError, KeyError or RecursionError for arrays that do not belong to it.
    """
    return cast("T", _value(kind, json.loads(str(arrays[_TREE])), arrays))


def _value(kind: Any, tree: Any, arrays: Mapping[str, np.ndarray]) -> Any:
    origin, parts = get_origin(kind), get_args(kind)
    if is_dataclass(kind):
        hints = get_type_hints(kind)
        names = {field.name for field in fields(kind)}
        if not isinstance(tree, dict) or tree.keys() != names:
            raise TypeError(f"{kind}: expected {', '.join(sorted(names))}")
        return cast("Any", kind)(**{name: _value(hints[name], item, arrays) for name, item in tree.items()})
    if kind is np.ndarray:
        return arrays[str(tree)]
    if kind is slice:
        return slice(*tree)
    if origin is tuple:
        kinds = parts[:1] * len(tree) if parts[-1] is Ellipsis else parts
        return tuple(_value(part, item, arrays) for part, item in zip(kinds, tree, strict=True))
    if origin in (UnionType, Union):
        return None if tree is None else _value(next(part for part in parts if part is not NoneType), tree, arrays)
    if origin is not None:  # a mapping is the only other kind
        return {_value(parts[0], key, arrays): _value(parts[1], item, arrays) for key, item in tree}
    if not isinstance(tree, _SCALARS):
        raise TypeError(f"{kind}: expected a number or a text, got {type(tree).__name__}")
    return tree
