"""MATLAB files, up to version 7 (scipy) and 7.3 (HDF5): arrays, structures with time, dSPACE recordings."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from friso.errors import LogError
from friso.identification.logs.binary import OBJECT, is_hdf5
from friso.identification.logs.log import Channel, ChannelTable
from friso.identification.logs.read import FileHead, LogFormat, content, content_by
from friso.identification.logs.units import split_heading


@dataclass
class _Contents:
    """Contents of a MAT file, collected while walking through its tree."""

    channels: list[Channel] = field(default_factory=list)
    scalars: dict[str, float] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    objects: list[str] = field(default_factory=list)


def read_mat(path: Path) -> ChannelTable:
    """Read the channels and single numbers of a MAT file of any version.

    Raises LogError for a file that holds none.
    """
    with path.open("rb") as file:
        newer = is_hdf5(file.read(520))
    walk = _Contents()
    for name, node in (content_by("h5py", "MAT", path) if newer else content("MAT", path)).items():
        _walk(node, name, walk)
    if walk.objects:
        walk.notes.append(f"left out: objects {', '.join(walk.objects)}: save them as structure with time")
    if not walk.channels:
        actual = f"no arrays, but objects: {', '.join(walk.objects)}" if walk.objects else "no arrays of numbers"
        raise LogError("log", actual, "signals: save as structure with time", "", str(path))
    name = "MATLAB 7.3 (HDF5)" if newer else "MATLAB up to 7"
    channels = _plainly_named(walk.channels)
    return ChannelTable(channels, walk.scalars, (f"format: {name}", f"{len(channels)} channels", *walk.notes))


def _plainly_named(channels: list[Channel]) -> tuple[Channel, ...]:
    """Leave the variable's name out of the names of channels that stay unique without it."""
    short = [channel.name.rpartition("/")[2] for channel in channels]
    names = [s if short.count(s) == 1 else c.name.replace("/", ".") for s, c in zip(short, channels, strict=True)]
    return tuple(replace(channel, name=name) for channel, name in zip(channels, names, strict=True))


def _walk(node: Any, name: str, walk: _Contents, unit: str = "") -> None:
    """Collect the channels, numbers and objects below a node (dict, list, array, str) in `walk`.

    `name` is the node's name in the file, and `unit` the one that stands beside it.
    """
    if isinstance(node, dict) and OBJECT in node:
        walk.objects.append(f"{name} ({node[OBJECT]})")
    elif isinstance(node, dict) and any("Data" in curve for curve in _structures(node.get("Y")) if "X" in node):
        walk.channels += _dspace(node, name)
    elif isinstance(node, dict) and {"time", "signals"} <= set(node):
        walk.channels += _with_time(node, name, walk)
    elif isinstance(node, dict):
        unit = next((_text(text) for key, text in node.items() if key.lower() in ("unit", "units")), "")
        numbers = [key for key, child in node.items() if isinstance(child, np.ndarray)]
        for key, child in node.items():
            own = bool(unit) and numbers == [key]  # a structure of one array and its unit is that array
            _walk(child, name if own else f"{name}.{key}", walk, unit if own else "")
    elif isinstance(node, list):
        for i, child in enumerate(node):
            _walk(child, f"{name}({i + 1})", walk)
    elif isinstance(node, np.ndarray) and node.dtype.kind in "buif":
        _array(node, name, walk, unit)
    elif isinstance(node, np.ndarray) and node.dtype.kind == "c":
        walk.notes.append(f"left out: {name}, complex numbers")


COLUMNS_OF_A_MATRIX = 64
"""Largest number of columns of a matrix that is read as channels. Larger ones are images or response matrices."""


def _array(values: np.ndarray, name: str, walk: _Contents, unit: str) -> None:
    """Add an array to the contents: as one number, one channel, or one channel per column.

    Without a `unit` beside it, its name may tell one.
    """
    heading, named = split_heading(name)
    name, unit = (name, unit) if unit else (heading, named)
    values = np.squeeze(values)
    if values.ndim == 0:
        walk.scalars[name] = float(values)
    elif values.ndim == 1 and values.size > 1:
        walk.channels.append(Channel(name, unit, values.astype(float), None, name))
    elif values.ndim == 2 and min(values.shape) <= COLUMNS_OF_A_MATRIX:
        for i, column in enumerate(values.T if values.shape[0] >= values.shape[1] else values):
            label = f"{name}(:,{i + 1})" if values.shape[0] >= values.shape[1] else f"{name}({i + 1},:)"
            walk.channels.append(Channel(label, unit, column.astype(float), None, label))
    elif values.size:
        walk.notes.append(f"left out: {name}, an array of {' x '.join(map(str, values.shape))}")


def _structures(node: Any) -> list[dict[str, Any]]:
    """Return a structure array, or a single structure, as a list of structures."""
    return [item for item in (node if isinstance(node, list) else [node]) if isinstance(item, dict)]


def _dspace(node: dict[str, Any], name: str) -> list[Channel]:
    """Return the channels of a dSPACE recording: `Y(i).Data` over `X(XIndex).Data` in seconds."""
    axes = _structures(node["X"])
    out = []
    for i, curve in enumerate(_structures(node["Y"])):
        values = np.atleast_1d(np.squeeze(np.asarray(curve["Data"], dtype=float)))
        index = int(np.asarray(curve.get("XIndex", 1)).ravel()[0]) - 1 if np.size(curve.get("XIndex", 1)) else 0
        axis = axes[index].get("Data") if 0 <= index < len(axes) else None
        time = None if axis is None else np.atleast_1d(np.squeeze(np.asarray(axis, dtype=float)))
        if time is not None and time.shape != values.shape:
            time = None
        heading, unit = split_heading(_text(curve.get("Name")) or f"Y({i + 1})")
        out.append(Channel(f"{name}/{heading}", unit or _text(curve.get("Unit")), values, time, f"{name}.Y({i + 1})"))
    return out


def _with_time(node: dict[str, Any], name: str, walk: _Contents) -> list[Channel]:
    """Return the channels of Simulink's structure with time.

    The channels are `signals(i).values` over `time` [s].
    """
    time = np.squeeze(np.asarray(node["time"], dtype=float))
    out = []
    for i, curve in enumerate(_structures(node["signals"])):
        source = f"{name}.signals({i + 1})"
        values = np.squeeze(np.asarray(curve.get("values", []), dtype=float))
        values = values.T if values.ndim == 2 and values.shape[0] != time.size else values
        if time.ndim != 1 or values.ndim not in (1, 2) or values.shape[0] != time.size:
            walk.notes.append(f"left out: {source}, {values.shape} values for {time.size} time stamps")
            continue
        block = _text(curve.get("blockName")).rpartition("/")[2]
        heading, unit = split_heading(_text(curve.get("label")) or block or source)
        columns = values.reshape(time.size, -1).T
        named = [part.strip() for part in heading.split(",")]  # several signals share one line of the Simulink model
        for k, column in enumerate(columns):
            label = heading if len(columns) == 1 else named[k] if len(named) == len(columns) else f"{heading}({k + 1})"
            out.append(Channel(f"{name}/{label}", unit, column, time, source))
    return out


def _text(node: Any) -> str:
    """Return the text of a node; "" if it is no text."""
    return node.strip() if isinstance(node, str) else ""


def _recognise(head: FileHead) -> bool:
    """Recognise a MAT file by its first bytes or by its name."""
    start = head.start
    return start.startswith(b"MATLAB ") or is_hdf5(start) or head.path.suffix.lower() == ".mat"


FORMAT = LogFormat("MAT", _recognise, read_mat, units=False)
