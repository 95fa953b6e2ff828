"""Program that reads binary logs by the libraries of their formats, run by `friso.identification.logs.read`.

The program imports nothing of friso, so that it starts quickly: ``python binary.py KIND FILE MEMORY CPU SECONDS``, with
the memory in bytes (0 for no limit), and the processor time [s], which not every system limits. The program writes a
pickle with the contents of the file (plain dicts, lists, texts, numbers and NumPy arrays) and the error message. It
ends after SECONDS whatever the library does, and at once when its standard input is closed because the parent was
killed.
"""

from __future__ import annotations

import faulthandler
import json
import logging
import math
import os
import pickle
import re
import sys
import threading
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

OBJECT = "\0object"
"""Key that marks an object whose content only MATLAB can read (timeseries, Dataset, tf), with its class."""

HDF5 = b"\x89HDF\r\n\x1a\n"
"""First bytes of an HDF5 file."""


MOST_CONTENT_BYTES, PER_BYTE = 256 << 20, 16
"""Limit on the bytes of the contents: a fixed number, plus a multiple of the file's size."""


def is_hdf5(head: bytes) -> bool:
    """Tell whether the first 520 bytes of a file are HDF5; MATLAB puts a block of 512 before."""
    return HDF5 in (head[:8], head[512:520])


def mat_tree(path: Path) -> dict[str, Any]:
    """Read a MAT file of any version into a tree whose top level has the variables by name."""
    with path.open("rb") as file:
        head = file.read(520)
    return _read_hdf5(path) if is_hdf5(head) else _read_old(path)


def _object(kind: str) -> dict[str, str]:
    """Return a placeholder for an object of class `kind` whose content only MATLAB can read."""
    return {OBJECT: kind}


def _read_old(path: Path) -> dict[str, Any]:
    """Read the tree of a MAT file of format version 7 or older, by scipy."""
    from scipy.io import loadmat

    tree: dict[str, Any] = {}
    for name, value in loadmat(path, squeeze_me=True, struct_as_record=False).items():
        node = _from_scipy(value)
        if str(name) == "None" and isinstance(node, dict) and OBJECT in node:  # scipy before 1.18 lost such names
            name = value[0]["s0"].decode() if isinstance(value[0]["s0"], bytes) else "object"
        if not str(name).startswith("__"):
            tree[str(name)] = node
    return tree


def _from_scipy(value: Any) -> Any:
    """Convert results of scipy into a tree of dict, list, array and str."""
    from scipy.sparse import issparse

    if hasattr(value, "_fieldnames"):
        return {key: _from_scipy(getattr(value, key)) for key in value._fieldnames}
    if type(value).__name__ in ("MatlabOpaque", "MatlabFunction"):
        named = {*(value.dtype.names or ())} & {"s2", "_Class"}  # classes of scipy before 1.18 and since
        kind = value[0][named.pop()] if named else "function"
        return _object(kind.decode() if isinstance(kind, bytes) else str(kind))
    if isinstance(value, np.ndarray) and value.dtype == object:
        return [_from_scipy(item) for item in value.ravel()]
    if isinstance(value, np.ndarray) and value.dtype.kind in "US":
        return str(value) if value.ndim == 0 else "".join(map(str, value.ravel()))
    if issparse(value):
        return value.toarray()  # pyright: ignore[reportAttributeAccessIssue]
    return value if isinstance(value, str | np.ndarray) else np.asarray(value)


def _read_hdf5(path: Path) -> dict[str, Any]:
    """Read the tree of a MAT file of format version 7.3 (HDF5)."""
    import h5py

    with h5py.File(path, "r") as file:
        return {str(name): _from_hdf5(_own(file, name), file) for name in file if not str(name).startswith("#")}


def _own(group: Any, name: Any) -> Any:
    """Return an item of an HDF5 group, and refuse links.

    Raises ValueError for a link, because it may lead to any file of the system.
    """
    import h5py

    if not isinstance(group.get(name, getlink=True), h5py.HardLink):
        raise ValueError(f"{name} is a link, which may lead to another file")
    return group[name]


def _from_hdf5(item: Any, file: Any) -> Any:
    """Convert an HDF5 group or data set into a tree of dict, list, array and str.

    Raises ValueError for a link, for values in another file, and for values too large for the file.
    """
    import h5py

    if isinstance(item, h5py.Dataset) and (item.external or item.is_virtual):  # references may lead to any data set
        raise ValueError(f"the values of {item.name} lie in another file")
    kind = item.attrs.get("MATLAB_class", b"")
    kind = kind.decode() if isinstance(kind, bytes) else str(kind)
    if "MATLAB_object_decode" in item.attrs or kind in ("function_handle", "table", "timeseries"):
        return _object(kind or "object")
    if isinstance(item, h5py.Group):
        children = {str(name): _from_hdf5(_own(item, name), file) for name in item}
        return _structures(item, children)
    if item.dtype == h5py.ref_dtype:
        return [_from_hdf5(file[reference], file) for reference in np.ravel(item[()], order="F")]
    if item.attrs.get("MATLAB_empty", 0):
        return "" if kind == "char" else np.empty(0)
    most = most_bytes(file.id.get_filesize())
    if item.nbytes > most:  # a sparse matrix is hardly filled
        raise ValueError(_too_much(item.nbytes, most))
    values = np.asarray(item[()])
    if kind == "char":
        return "".join(map(chr, values.ravel(order="F")))
    return np.squeeze(values.T) if values.dtype.kind in "buifc" else _object(kind or str(values.dtype))


def _structures(item: Any, children: dict[str, Any]) -> Any:
    """Return a MATLAB structure as a dict, or an array of structures as a list of dicts.

    `item` is the HDF5 group, and `children` are its fields, converted. If all fields hold references, `item` is an
    array of structures.
    """
    import h5py

    references = [isinstance(item[name], h5py.Dataset) and item[name].dtype == h5py.ref_dtype for name in item]
    classes = [item[name].attrs.get("MATLAB_class") for name in item]
    if (
        children and all(references) and all(array_class is None for array_class in classes)
    ):  # a cell array has its class
        length = min(len(array) for array in children.values())
        return [{name: array[i] for name, array in children.items()} for i in range(length)]
    return children


def uff_datasets(path: Path) -> dict[str, Any]:
    """Read the datasets of type 58 of a universal file, and the code of its units."""
    import pyuff

    file: Any = pyuff.UFF(str(path))
    kinds = list(file.get_set_types())
    sets = [file.read_sets(i) for i, kind in enumerate(kinds) if kind == 58]
    return {"sets": sets, "units": [file.read_sets(i)["units_code"] for i, kind in enumerate(kinds) if kind == 164]}


def lvm_content(path: Path) -> dict[str, Any]:
    """Read the content of a measurement text of LabVIEW."""
    import lvm_read

    _no_words_among_numbers(path)
    return {str(key): part for key, part in lvm_read.read(str(path), read_from_pickle=False, dump_file=False).items()}


_ODD = re.compile(r"[^\s\d.,;+\-eE]")
"""A sign that stands in no plain number and separates none."""
_PLAIN = re.compile(r"[+-]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][+-]?\d+)?|[+-]?(?:nan|inf)", re.IGNORECASE)


def _no_words_among_numbers(path: Path) -> None:
    """Check the rows of a measurement text of LabVIEW.

    Raises ValueError, with the line, for a cell that is no number: the library reads 1_0 as 10, and a word as a gap.
    """
    names: list[str] = []
    with path.open(encoding="utf-8", errors="replace") as file:
        for number, line in enumerate(file, 1):
            if line.startswith(("X_Value", "***")) or not line.strip():
                names = line.rstrip("\r\n").split("\t") if line.startswith("X_Value") else []
            elif names and _ODD.search(line):
                cells = zip(line.rstrip("\r\n").split("\t"), names, strict=False)
                for cell in (cell.strip() for cell, name in cells if name != "Comment"):
                    if cell and _PLAIN.fullmatch(cell) is None:
                        raise ValueError(f"{cell[:40]!r} in line {number} is no number")


def tdms_channels(path: Path) -> dict[str, Any]:
    """Read the channels of a TDMS file, and the library's messages.

    A truncated file is read as far as possible.
    """
    import nptdms

    heard, logger = _Heard(), logging.getLogger("nptdms")
    logger.handlers = [heard]
    with path.open("rb") as opened:  # by name, it would read an index file
        file = nptdms.TdmsFile.read(opened)
    channels = [
        {
            "group": group.name,
            "name": item.name,
            "values": values if (values := np.asarray(item[:])).dtype.kind in "buif" else None,
            "step": float(item.properties.get("wf_increment", 0)),
            "start": float(item.properties.get("wf_start_offset", 0.0)),
            "unit": str(item.properties.get("unit_string") or item.properties.get("NI_UnitDescription") or ""),
        }
        for group in file.groups()
        for item in group.channels()
    ]
    return {"channels": channels, "heard": heard.lines}


class _Heard(logging.Handler):
    """Handler that stores a library's log messages as lines."""

    def __init__(self) -> None:
        """Start without lines."""
        super().__init__(logging.WARNING)
        self.lines: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Store a record as a line."""
        self.lines.append(record.getMessage()[:120])


def array_columns(path: Path) -> dict[str, Any]:
    """Read the arrays of a file of NumPy (.npy, .npz), without objects."""
    file = np.load(path, allow_pickle=False)
    arrays = {path.stem: file} if isinstance(file, np.ndarray) else {name: file[name] for name in file.files}
    return _content({name: values for whole, array in arrays.items() for name, values in _of_array(whole, array)})


def _of_array(name: str, array: np.ndarray) -> list[tuple[str, Any]]:
    """Return the columns of an array by name: its fields, or the columns of its longer side."""
    if array.dtype.names:
        return [(field, array[field].ravel()) for field in array.dtype.names]
    array = np.squeeze(array)
    if array.ndim != 2:
        return [(name, array.item() if array.ndim == 0 else array)] if array.ndim < 2 else []
    array = array if array.shape[0] >= array.shape[1] else array.T
    return [(f"{name}[{i}]", column) for i, column in enumerate(array.T)]


def json_columns(path: Path) -> dict[str, Any]:
    """Read columns from JSON: lists by name, a list of records or rows, or one record a line."""
    text = path.read_text(encoding="utf-8-sig")
    try:
        node = json.loads(text)
    except json.JSONDecodeError as error:
        if error.msg != "Extra data":
            raise
        node = [json.loads(line) for line in text.splitlines() if line.strip()]
    return _content(_of_json(node, ""))


def _of_json(node: Any, name: str) -> dict[str, Any]:
    """Return the columns below a node of JSON, and its single numbers, by name."""
    if isinstance(node, dict) and isinstance(node.get("data"), list) and isinstance(node.get("columns"), list):
        node = [dict(zip(map(str, node["columns"]), row, strict=False)) for row in node["data"]]
    if isinstance(node, list) and node and all(isinstance(item, dict) for item in node):
        import pandas as pd

        frame = pd.json_normalize(node, sep="/")
        return {f"{name}{column}": frame[column].tolist() for column in map(str, frame.columns)}
    if isinstance(node, list) and node and all(isinstance(item, list) for item in node):
        named = len(node) > 1 and all(isinstance(cell, str) for cell in node[0])
        heads = node[0] if named else [f"{name}column {i + 1}" for i in range(max(map(len, node)))]
        rows = node[1:] if named else node
        return {head: [row[i] if i < len(row) else None for row in rows] for i, head in enumerate(heads)}
    if isinstance(node, dict) and len(node) > 1 and all(str(key).isdecimal() for key in node):
        node = [*node.values()]  # as pandas writes a column, by the numbers of its rows
    if isinstance(node, dict):
        return {key: part for head, item in node.items() for key, part in _of_json(item, f"{name}{head}/").items()}
    return {name.removesuffix("/") or "column 1": node}


def frame_columns(path: Path) -> dict[str, Any]:
    """Read the columns of a table in Parquet or Feather."""
    import pandas as pd

    with path.open("rb") as file:
        frame = pd.read_parquet(path) if file.read(4) == b"PAR1" else pd.read_feather(path)
    named = frame.reset_index() if frame.index.name else frame
    return _content({str(name): named[name] for name in named.columns})


def _content(columns: dict[str, Any]) -> dict[str, Any]:
    """Return columns as arrays of numbers or lists of texts, with single numbers apart.

    Dates and times become seconds since the first of them.
    """
    import pandas as pd

    content: dict[str, Any] = {"columns": {}, "scalars": {}}
    for name, values in columns.items():
        if isinstance(values, int | float):
            content["scalars"][name] = float(values)
        if not isinstance(values, list | np.ndarray | pd.Series) or len(values) < 2:
            continue
        series = pd.Series(values)
        if series.dtype.kind in "mM":
            name, series = f"{name} [s]", (series - series.dropna().iloc[0]) / pd.Timedelta(seconds=1)
        if series.dtype.kind in "biuf":
            content["columns"][name] = series.to_numpy(dtype=float, na_value=np.nan)
        elif series.dtype.kind == "O" or pd.api.types.is_string_dtype(series):
            content["columns"][name] = series.map(str, na_action="ignore").fillna("").tolist()
    return content


def sheet_text(path: Path) -> dict[str, Any]:
    """Read the largest sheet of a workbook as text, with tabs between its cells."""
    book = import_module("python_calamine").CalamineWorkbook.from_path(str(path))
    sheets = {name: book.get_sheet_by_name(name).to_python(skip_empty_area=False) for name in book.sheet_names}
    name = max(sheets, key=lambda name: sum(map(len, sheets[name])))
    lines = ["\t".join(map(_cell, row)) for row in sheets[name]]
    return {"sheet": name, "others": [other for other in sheets if other != name], "text": "\n".join(lines) + "\n"}


def _cell(value: Any) -> str:
    """Return the text of a cell of a sheet on one line; times as in ISO 8601, durations in seconds."""
    if hasattr(value, "total_seconds"):
        return repr(value.total_seconds())
    text = value.isoformat() if hasattr(value, "isoformat") else repr(value) if isinstance(value, float) else str(value)
    return " ".join(text.split())


READERS: dict[str, Callable[[Path], dict[str, Any]]] = {
    "MAT": mat_tree,
    "UFF": uff_datasets,
    "LVM": lvm_content,
    "TDMS": tdms_channels,
    "NumPy": array_columns,
    "JSON": json_columns,
    "Parquet": frame_columns,
    "Workbook": sheet_text,
}


def _plain(node: Any) -> Any:
    """Convert a tree into plain types, because the receiver unpickles no others."""
    if isinstance(node, dict):
        return {str(key): _plain(value) for key, value in node.items()}
    if isinstance(node, list | tuple):
        return [_plain(value) for value in node]
    if isinstance(node, np.ndarray | np.generic):
        values = np.asarray(node)
        return np.ascontiguousarray(values) if values.dtype.kind in "buifc" else str(node)
    return node if node is None or type(node) in (bool, int, float, str) else str(node)


def most_bytes(size: int) -> int:
    """Return how many bytes a file's pickled contents may have, by the file's `size` [B]."""
    return MOST_CONTENT_BYTES + PER_BYTE * size


def _too_much(size: int, most: int) -> str:
    """Return the message on a file of a `size` [B] that would take over `most` bytes of memory."""
    return f"it would take {size / 1e6:.0f} MB of memory, and a file of its size has at most {most / 1e6:.0f} MB"


def _end_with_parent() -> None:
    """Wait until standard input is closed, then end the process."""
    while os.read(0, 1):
        pass
    os._exit(1)


def main(kind: str, path: Path, memory: int, cpu: float, seconds: float) -> None:
    """Read a file within limits of memory [B], processor time [s] and elapsed time [s].

    `kind` names the reader. The contents, or an error message, are written to standard output.
    """
    faulthandler.dump_traceback_later(seconds, exit=True)  # this thread does not need the interpreter's lock
    threading.Thread(target=_end_with_parent, daemon=True).start()
    if sys.platform != "win32":
        import resource

        _, allowed = resource.getrlimit(resource.RLIMIT_CPU)
        limit = math.ceil(cpu)
        resource.setrlimit(resource.RLIMIT_CPU, (limit if allowed < 0 else min(limit, allowed), allowed))
    if sys.platform != "win32" and memory:
        import resource

        _, allowed = resource.getrlimit(resource.RLIMIT_AS)
        limit = memory if allowed == resource.RLIM_INFINITY else min(memory, allowed)
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    answer, message = b"", ""
    try:
        answer = pickle.dumps((_plain(READERS[kind](path)), ""), protocol=5)
        if len(answer) > (most := most_bytes(path.stat().st_size)):
            message = _too_much(len(answer), most)
    except MemoryError:
        message = "it needs too much memory"
    except RecursionError:
        message = "it is nested too deeply"
    except Exception as error:  # the libraries raise any exception for a broken file
        message = str(error)[:500] or type(error).__name__
    sys.stdout.buffer.write(pickle.dumps((None, message)) if message else answer)


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]), int(sys.argv[3]), float(sys.argv[4]), float(sys.argv[5]))
