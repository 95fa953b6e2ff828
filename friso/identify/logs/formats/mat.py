"""MATLAB files, up to version 7 (scipy) and 7.3 (HDF5): arrays, structures with time, dSPACE recordings."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from friso.errors import LogError
from friso.identify.logs.channel import Channel, ChannelTable
from friso.identify.logs.format import FileHead, LogFormat
from friso.identify.logs.text import unique
from friso.identify.logs.units import split_heading

MOST_COLUMNS = 64
"""A matrix with more columns is no set of channels (an image, a response matrix)."""
HDF5 = b"\x89HDF\r\n\x1a\n"


@dataclass(frozen=True)
class Opaque:
    """An object whose content only MATLAB can read (timeseries, Dataset, tf), of this class."""

    kind: str


@dataclass
class _Found:
    """What was found on the walk through a file."""

    channels: list[Channel] = field(default_factory=list)
    scalars: dict[str, float] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    objects: list[str] = field(default_factory=list)


def read_mat(path: Path) -> ChannelTable:
    """The channels and single numbers of a MAT file of any version. Raises LogError for a file that holds none."""
    with path.open("rb") as file:
        head = file.read(520)
    newer = head.startswith(HDF5) or HDF5 in head[504:]
    try:
        tree = _read_hdf5(path) if newer else _read_old(path)
    except Exception as error:  # scipy and h5py let through whatever a broken file makes them stumble over
        raise LogError(
            "log", f"a MAT file that cannot be read ({error})", "a complete MAT file", "", str(path)
        ) from None
    found = _Found()
    for name, node in tree.items():
        _walk(node, name, found)
    if found.objects:
        found.notes.append(f"left out: objects {', '.join(found.objects)}: save them as structure with time")
    if not found.channels:
        given = f"no arrays, but objects: {', '.join(found.objects)}" if found.objects else "no arrays of numbers"
        raise LogError("log", given, "signals: save as structure with time", "", str(path))
    name = "MATLAB 7.3 (HDF5)" if newer else "MATLAB up to 7"
    channels = _plainly_named(found.channels)
    return ChannelTable(channels, found.scalars, (f"format: {name}", f"{len(channels)} channels", *found.notes))


def _plainly_named(channels: list[Channel]) -> tuple[Channel, ...]:
    """The channels without the name of the variable they stand in, where they are told apart without it."""
    short = [channel.name.rpartition("/")[2] for channel in channels]
    names = [s if short.count(s) == 1 else c.name.replace("/", ".") for s, c in zip(short, channels, strict=True)]
    return tuple(replace(channel, name=name) for channel, name in zip(channels, unique(names), strict=True))


def _walk(node: Any, name: str, found: _Found) -> None:
    """Take the channels, numbers and objects of a node of the tree (dict, list, array, str, Opaque)."""
    if isinstance(node, Opaque):
        found.objects.append(f"{name} ({node.kind})")
    elif isinstance(node, dict) and {"X", "Y"} <= set(node) and any("Data" in each for each in _listed(node["Y"])):
        found.channels += _dspace(node, name)
    elif isinstance(node, dict) and {"time", "signals"} <= set(node):
        found.channels += _with_time(node, name, found)
    elif isinstance(node, dict):
        for key, child in node.items():
            _walk(child, f"{name}.{key}", found)
    elif isinstance(node, list):
        for i, child in enumerate(node):
            _walk(child, f"{name}({i + 1})", found)
    elif isinstance(node, np.ndarray) and node.dtype.kind in "buif":
        _array(node, name, found)
    elif isinstance(node, np.ndarray) and node.dtype.kind == "c":
        found.notes.append(f"left out: {name}, complex numbers")


def _array(values: np.ndarray, name: str, found: _Found) -> None:
    """An array as one number, one channel, or one channel per column."""
    values = np.squeeze(values)
    if values.ndim == 0:
        found.scalars[name] = float(values)
    elif values.ndim == 1 and values.size > 1:
        found.channels.append(Channel(name, "", values.astype(float), None, name))
    elif values.ndim == 2 and min(values.shape) <= MOST_COLUMNS:
        for i, column in enumerate(values.T if values.shape[0] >= values.shape[1] else values):
            label = f"{name}(:,{i + 1})" if values.shape[0] >= values.shape[1] else f"{name}({i + 1},:)"
            found.channels.append(Channel(label, "", column.astype(float), None, label))
    elif values.size:
        found.notes.append(f"left out: {name}, an array of {' x '.join(map(str, values.shape))}")


def _listed(node: Any) -> list[dict[str, Any]]:
    """A structure array as a list of structures, one alone too."""
    return [each for each in (node if isinstance(node, list) else [node]) if isinstance(each, dict)]


def _dspace(node: dict[str, Any], name: str) -> list[Channel]:
    """The channels of a dSPACE recording: `Y(i).Data` over `X(XIndex).Data` in seconds."""
    axes = _listed(node["X"])
    out = []
    for i, each in enumerate(_listed(node["Y"])):
        values = np.atleast_1d(np.squeeze(np.asarray(each["Data"], dtype=float)))
        index = int(np.asarray(each.get("XIndex", 1)).ravel()[0]) - 1 if np.size(each.get("XIndex", 1)) else 0
        axis = axes[index].get("Data") if 0 <= index < len(axes) else None
        time = None if axis is None else np.atleast_1d(np.squeeze(np.asarray(axis, dtype=float)))
        if time is not None and time.shape != values.shape:
            time = None
        heading, unit = split_heading(_text(each.get("Name")) or f"Y({i + 1})")
        out.append(Channel(f"{name}/{heading}", unit or _text(each.get("Unit")), values, time, f"{name}.Y({i + 1})"))
    return out


def _with_time(node: dict[str, Any], name: str, found: _Found) -> list[Channel]:
    """The channels of Simulink's structure with time: `signals(i).values` over `time` in seconds."""
    time = np.squeeze(np.asarray(node["time"], dtype=float))
    out = []
    for i, each in enumerate(_listed(node["signals"])):
        source = f"{name}.signals({i + 1})"
        values = np.squeeze(np.asarray(each.get("values", []), dtype=float))
        values = values.T if values.ndim == 2 and values.shape[0] != time.size else values
        if time.ndim != 1 or values.ndim not in (1, 2) or values.shape[0] != time.size:
            found.notes.append(f"left out: {source}, {values.shape} values for {time.size} time stamps")
            continue
        heading, unit = split_heading(
            _text(each.get("label")) or _text(each.get("blockName")).rpartition("/")[2] or source
        )
        columns = values.reshape(time.size, -1).T
        for k, column in enumerate(columns):
            label = heading if len(columns) == 1 else f"{heading}({k + 1})"
            out.append(Channel(f"{name}/{label}", unit, column, time, source))
    return out


def _text(node: Any) -> str:
    """A text node, "" for anything else."""
    return node.strip() if isinstance(node, str) else ""


def _read_old(path: Path) -> dict[str, Any]:
    """The tree of a file up to version 7."""
    from scipy.io import loadmat

    tree: dict[str, Any] = {}
    for name, value in loadmat(path, squeeze_me=True, struct_as_record=False).items():
        node = _from_scipy(value)
        if isinstance(node, Opaque) and str(name) == "None":  # scipy has no name for a variable that is an object
            name = value[0]["s0"].decode() if isinstance(value[0]["s0"], bytes) else "object"
        if not str(name).startswith("__"):
            tree[str(name)] = node
    return tree


def _from_scipy(value: Any) -> Any:
    """What scipy read, as a tree of dict, list, array, str and Opaque."""
    from scipy.sparse import issparse

    if hasattr(value, "_fieldnames"):
        return {key: _from_scipy(getattr(value, key)) for key in value._fieldnames}
    if type(value).__name__ in ("MatlabOpaque", "MatlabFunction"):
        named = {*(value.dtype.names or ())} & {"s2", "_Class"}  # of scipy before 1.18, and since
        kind = value[0][named.pop()] if named else "function"
        return Opaque(kind.decode() if isinstance(kind, bytes) else str(kind))
    if isinstance(value, np.ndarray) and value.dtype == object:
        return [_from_scipy(each) for each in value.ravel()]
    if isinstance(value, np.ndarray) and value.dtype.kind in "US":
        return str(value) if value.ndim == 0 else "".join(map(str, value.ravel()))
    if issparse(value):
        return value.toarray()  # pyright: ignore[reportAttributeAccessIssue]
    return value if isinstance(value, str | np.ndarray) else np.asarray(value)


def _read_hdf5(path: Path) -> dict[str, Any]:
    """The tree of a file of version 7.3."""
    import h5py

    with h5py.File(path, "r") as file:
        return {str(name): _from_hdf5(_own(file, name), file) for name in file if not str(name).startswith("#")}


def _own(group: Any, name: Any) -> Any:
    """An item of a group. Raises ValueError for one whose values lie in another file, which the log would show as its
    own: links and data sets may name any file of the system."""
    import h5py

    if isinstance(group.get(name, getlink=True), h5py.ExternalLink):
        raise ValueError(f"{name} is a link to another file")
    item = group[name]
    if isinstance(item, h5py.Dataset) and (item.external or item.is_virtual):
        raise ValueError(f"the values of {name} lie in another file")
    return item


def _from_hdf5(item: Any, file: Any) -> Any:
    """A group or data set as a tree of dict, list, array, str and Opaque. MATLAB's arrays stand transposed."""
    import h5py

    kind = item.attrs.get("MATLAB_class", b"")
    kind = kind.decode() if isinstance(kind, bytes) else str(kind)
    if "MATLAB_object_decode" in item.attrs or kind in ("function_handle", "table", "timeseries"):
        return Opaque(kind or "object")
    if isinstance(item, h5py.Group):
        children = {str(name): _from_hdf5(_own(item, name), file) for name in item}
        return _structures(item, children)
    if item.dtype == h5py.ref_dtype:
        return [_from_hdf5(file[reference], file) for reference in np.ravel(item[()], order="F")]
    if item.attrs.get("MATLAB_empty", 0):
        return "" if kind == "char" else np.empty(0)
    values = np.asarray(item[()])
    if kind == "char":
        return "".join(map(chr, values.ravel(order="F")))
    return np.squeeze(values.T) if values.dtype.kind in "buifc" else Opaque(kind or str(values.dtype))


def _structures(item: Any, children: dict[str, Any]) -> Any:
    """A structure, or the structure array whose fields are lists of references."""
    import h5py

    references = [isinstance(item[name], h5py.Dataset) and item[name].dtype == h5py.ref_dtype for name in item]
    classes = [item[name].attrs.get("MATLAB_class") for name in item]
    if children and all(references) and all(each is None for each in classes):  # a cell array has its class
        length = min(len(each) for each in children.values())
        return [{name: each[i] for name, each in children.items()} for i in range(length)]
    return children


def _recognise(head: FileHead) -> bool:
    """By its first bytes, or those behind the block that MATLAB puts before HDF5; or by its name."""
    start = head.start
    return start.startswith(b"MATLAB ") or HDF5 in (start[:8], start[512:520]) or head.path.suffix.lower() == ".mat"


FORMAT = LogFormat("MAT", _recognise, read_mat, units=False)
