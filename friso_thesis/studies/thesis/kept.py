"""Keep finished parts of a long reproduction in a folder until all is done.

An interrupted run continues from them. Results are kept as arrays and one text.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import fields, is_dataclass
from pathlib import Path
from types import NoneType, UnionType
from typing import TYPE_CHECKING, Any, TypeVar, Union, cast, get_args, get_origin, get_type_hints

import numpy as np

from friso.studies.metric import form_of
from friso.studies.study import Study
from friso.studies.sweep import dataset
from friso_thesis.studies.kept_work import KeptWork, keep_arrays, kept_arrays
from friso_thesis.studies.thesis.studies import thesis_rig

if TYPE_CHECKING:
    import xarray as xr

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


T = TypeVar("T")

SOURCES = (
    *(
        "../friso_thesis/studies",
        "studies",
        "virtual_rig",
        "frequency",
        "identification",
        "leaf_springs",
        "design_method",
    ),
    *("axis.py", "evidence.py", "evidence.toml", "intervals.py", "materials.py", "materials.toml"),
)
"""Folders and files, besides the equations, whose contents decide on saved results. Paths start from the package
friso."""


class Kept(KeptWork):
    """Folders in which maps, experiments and findings of the thesis are saved."""

    sources = SOURCES

    def runs(self, study: Study, make: Callable[[], xr.Dataset]) -> xr.Dataset:
        """Return the runs of a study from the folder; otherwise `make` and save them."""
        axes = [(axis.name, axis.values.tolist()) for axis in study.axes]
        file = self._file("npz", study.stage.to_toml(), axes, dict(study.links), study.rtol, study.metrics)
        columns = None if file is None else kept_arrays(file)
        if columns is not None and columns.keys() == set(study.metrics):
            return dataset(study, {name: values.reshape(study.shape) for name, values in columns.items()})
        runs = make()
        if file is not None:
            keep_arrays(file, {name: runs[name].values.astype(form_of(name)) for name in study.metrics})
        return runs

    def flags(self, about: tuple[Any, ...], make: Callable[[], Mapping[str, np.ndarray]]) -> Mapping[str, np.ndarray]:
        """Return arrays saved under `about`; otherwise `make` and save them."""
        return self.arrays(("flags", *about), make)

    def result(self, about: tuple[Any, ...], kind: type[T], make: Callable[[], T]) -> T:
        """Return a result of a kind saved under `about`; otherwise `make` and save it.

        Kinds that can be saved are listed at `taken_apart`.
        """
        file = self._file("npz", "result", *about)
        columns = None if file is None else kept_arrays(file)
        if columns is not None:
            with suppress(ValueError, TypeError, KeyError, RecursionError):
                return put_together(kind, columns)
        made = make()
        if file is not None:
            keep_arrays(file, taken_apart(made))
        return made

    def _file(self, suffix: str, *about: Any) -> Path | None:
        return super()._file(suffix, thesis_rig().to_toml(), *about)


NOT_KEPT = Kept()
"""A store that saves nothing."""
