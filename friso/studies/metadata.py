"""Store and check a store's metadata: one file (.zmetadata) with its digest, and a copy.

Zarr's readers take everything but the numbers from this file. Files beside the arrays repeat it for other programs, and
are rewritten if they differ. The file also has the digests of the axes, and friso's own notes, such as the metric that
colours the map.
"""

from __future__ import annotations

import hashlib
import json
import logging
import math
import re
from collections import Counter
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from friso.errors import StoreError
from friso.escapes import one_line
from friso.platform.system import cause_of
from friso.studies.metric import every_variable
from friso.studies.store_files import digest_of, put, stored

logger = logging.getLogger("friso")

METADATA_FORMAT = 2
"""Version of friso's metadata in a store."""

_FILE, _COPY, _OWN, _ATTRIBUTES = ".zmetadata", ".zmetadata.copy", "friso", ".zattrs"
"""Names of the metadata file, its copy, friso's entry, and the entry with the attributes of the study."""

_NAMES = re.compile(r"(?:\w[\w.-]*/)?\.z(?:array|attrs|group)"), re.compile(r"\w[\w.-]*/\d+")
"""Patterns of metadata files beside the arrays, and of files of axes: the only files that metadata may name."""

_KIND, _CODECS = re.compile(r"[<>|](?P<letter>[bfiuU])(?P<size>[0-9]{1,4})"), {"blosc", "crc32"}
"""Allowed types of numbers and texts with their size, and allowed codecs, which only decode."""
LARGEST_CHUNK = 1 << 30
"""Largest chunk in memory [bytes]; a chunk may be a whole axis."""

_EXPECTED = "a store made by friso map, or a new name"
_EXAMPLE = "friso map STAGE.toml ... --out study.zarr"


@dataclass(frozen=True)
class Metadata:
    """Metadata of a store of studies.

    `document` has the contents of Zarr's files beside the arrays. Further fields are the digest of the original study,
    the SHA-256 of each file of the axes, and notes.
    """

    document: Mapping[str, Any]
    study: str
    axes: Mapping[str, str]
    notes: Mapping[str, Any]

    @property
    def files(self) -> dict[str, Any]:
        """Return the contents of Zarr's files, by their paths in the store."""
        return self.document["metadata"]

    @property
    def all_files(self) -> dict[str, Any]:
        """Return the contents of all metadata files by path, with the combined file and its copy."""
        return {**self.files, _FILE: self.document, _COPY: self.document}

    @property
    def attributes(self) -> dict[str, Any]:
        """Return the attributes of the study."""
        return dict(self.files[_ATTRIBUTES])

    def damaged_files(self, path: Path) -> list[str]:
        """Return the metadata files of the store at `path` that differ from these metadata."""
        return [name for name, content in self.all_files.items() if not _says(path / name, content)]

    def damaged_axes(self, path: Path) -> list[str]:
        """Return the files of the axes in the store at `path` that differ from what was written."""
        return [name for name, written in self.axes.items() if digest_of(path / name) != written]

    def mend(self, path: Path) -> None:
        """Rewrite the metadata files of the store at `path` that differ from these metadata.

        Raises OSError if a file cannot be written.
        """
        for name in self.damaged_files(path):
            if name == _FILE:
                logger.warning("%s: %s was damaged, and is written anew from its copy", path, name)
            (path / name).parent.mkdir(exist_ok=True)
            put(path / name, _text(self.all_files[name]))


def seal_metadata(path: Path, axes: Iterable[str]) -> None:
    """Record the digests of the `axes`, by name, in the metadata of a new store at `path`.

    From then on, changed metadata are detected. Raises OSError if files of the store cannot be read or written.
    """
    document = json.loads(stored(path / _FILE))
    files = [
        f"{name}/{file.name}" for name in axes for file in (path / name).iterdir() if not file.name.startswith(".")
    ]
    digests = {name: digest_of(path / name) or "" for name in sorted(files)}
    study = digest([document["metadata"], digests])
    _write(path, Metadata(document, study, digests, {}))


def annotate_metadata(path: Path, notes: Mapping[str, Any]) -> None:
    """Add friso's `notes` to the metadata of the store at `path`.

    Raises StoreError if the metadata are damaged or missing, and OSError if they cannot be written.
    """
    metadata = checked_metadata(path)
    _write(path, replace(metadata, notes={**metadata.notes, **notes}))


def _write(path: Path, metadata: Metadata) -> None:
    entry = {
        "format": METADATA_FORMAT,
        "study": metadata.study,
        "axes": dict(metadata.axes),
        "notes": dict(metadata.notes),
    }
    entry["sha256"] = digest([metadata.files, entry])
    sealed = replace(metadata, document={**metadata.document, _OWN: entry})
    put(path / _FILE, _text(sealed.document))
    sealed.mend(path)


def _text(content: Any) -> bytes:
    """Return JSON content as the bytes of a metadata file."""
    return json.dumps(content, indent=1, sort_keys=True).encode()


def checked_metadata(path: Path) -> Metadata:
    """Return the metadata of the store at `path`, after checking them.

    Raises StoreError if there is no store, or if it is damaged or of another version.
    """
    if not path.exists():
        raise StoreError("", "nothing there", _EXPECTED, _EXAMPLE, str(path))
    if not path.is_dir():
        raise StoreError("", "a file; nothing was overwritten", _EXPECTED, "--out study.zarr", str(path))
    try:
        return _metadata_in(path, _FILE)
    except _DamagedError:
        with suppress(StoreError):
            return _metadata_in(path, _COPY)
        raise


class _DamagedError(StoreError):
    """Error: a metadata file of a store is damaged or missing, but its copy may be intact."""


def _metadata_in(path: Path, file: str) -> Metadata:
    """Read the metadata in one `file` of the store at `path`.

    Raises StoreError if the file is missing, damaged, not friso's or of another version. It is a _DamagedError if a
    copy may still be intact.
    """
    try:
        document = json.loads(stored(path / file))
        entry, metadata = document.get(_OWN), document["metadata"]
        attributes = dict(metadata[_ATTRIBUTES])
        sealed = digest([metadata, {key: value for key, value in entry.items() if key != "sha256"}]) if entry else ""
        number = entry.get("format") if entry else None
        number = number if type(number) is int else None
    except FileNotFoundError:
        if is_store(path):
            raise _damaged(path, "is missing") from None
        actual = "a folder with other things in it; nothing was overwritten"
        raise StoreError("", actual, _EXPECTED, "--out study.zarr", str(path)) from None
    except OSError as error:
        raise StoreError.of(_damaged(path, f"cannot be read ({cause_of(error)})")) from None
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise _damaged(path, "is damaged") from None
    if number is not None and number > METADATA_FORMAT:
        actual = f"a store of a newer friso ({one_line(str(attributes.get('friso', 'unknown')))})"
        error = StoreError if entry.get("sha256") == sealed else _DamagedError
        raise error("", actual, "a store of this friso, or that one to read it", origin=str(path))
    if number == METADATA_FORMAT:
        study, axes, notes = (entry.get(name) for name in ("study", "axes", "notes"))
        complete = isinstance(study, str) and isinstance(axes, dict) and isinstance(notes, dict)
        if not complete or entry.get("sha256") != sealed or not _are_of_a_store(metadata, axes):
            raise _damaged(path, "is damaged")
        return Metadata(document, study, axes, notes)
    if "equations" in attributes:
        actual, expected = "a store of an earlier friso, or a damaged one", "to run the study again under a new name"
        raise _DamagedError("", actual, expected, _EXAMPLE, str(path))
    actual = "a Zarr store that friso map has not made; nothing was overwritten"
    raise StoreError("", actual, _EXPECTED, "--out study.zarr", str(path))


_WORDS = (b'"equations"', f'"{_OWN}"'.encode())
"""Texts that occur together only in the metadata of stores."""


def is_store(path: Path) -> bool:
    """Tell whether friso made the folder, by its metadata files, damaged or not."""
    return any(all(_mentions(path / name, words) for words in _WORDS) for name in (_FILE, _COPY, _ATTRIBUTES))


def _says(file: Path, content: Any) -> bool:
    """Tell whether a JSON file has exactly this content.

    The number 1 counts as different from 1.0 and from true.
    """
    try:
        return digest(json.loads(stored(file))) == digest(content)
    except (OSError, ValueError, RecursionError):
        return False


def _mentions(file: Path, words: bytes) -> bool:
    """Tell whether a file can be read and contains these words."""
    try:
        return words in stored(file)
    except OSError:
        return False


def _are_of_a_store(files: Mapping[str, Any], axes: Mapping[str, Any]) -> bool:
    """Tell whether all files that metadata name may belong to a store.

    No file may lie outside the store. Arrays must be numbers or texts as friso writes them, because other codecs may
    run code. Each axis must be complete.
    """
    if not all(name.fullmatch(file) for name, group in zip(_NAMES, (files, axes), strict=True) for file in group):
        return False
    try:
        arrays = {name.rpartition("/")[0]: content for name, content in files.items() if name.endswith("/.zarray")}
        indices = {name for name in arrays if files[f"{name}/.zattrs"]["_ARRAY_DIMENSIONS"] == [name]}
        chunks = Counter(file.rpartition("/")[0] for file in axes)
        lengths = {name: arrays[name]["shape"][0] for name in indices}
        return (
            arrays.keys() <= {*every_variable(), *chunks}
            and all(_is_plain(array) for array in arrays.values())
            and all(
                array["shape"] == [lengths[dimension] for dimension in files[f"{name}/.zattrs"]["_ARRAY_DIMENSIONS"]]
                for name, array in arrays.items()
            )
            and all(chunks[name] == _chunks(arrays[name]) for name in indices | chunks.keys())
        )
    except (KeyError, TypeError, ValueError, AttributeError, ArithmeticError):
        return False


def _is_plain(array: Mapping[str, Any]) -> bool:
    """Tell whether an array has numbers or texts, compressed and sized as friso writes them.

    `array` is Zarr's description of it.
    """
    kind = _KIND.fullmatch(array["dtype"])
    codecs = {codec["id"] for codec in [array["compressor"], *(array["filters"] or ())] if codec}
    laid_out = (array["order"], array.get("dimension_separator", "."))
    if kind is None or not codecs <= _CODECS or laid_out != ("C", ".") or min(*array["shape"], *array["chunks"]) < 1:
        return False
    size = int(kind["size"]) * (4 if kind["letter"] == "U" else 1)  # a character takes 4 bytes
    return size > 0 and size * math.prod(array["chunks"]) <= LARGEST_CHUNK


def _chunks(array: Mapping[str, Any]) -> int:
    """Return the number of chunks of an array, from Zarr's description of it."""
    return math.prod(-(-length // size) for length, size in zip(array["shape"], array["chunks"], strict=True))


def _damaged(path: Path, damage: str) -> _DamagedError:
    expected = "a copy of the store, or the study run again under a new name, or with --overwrite"
    return _DamagedError("", f"a store whose {_FILE} {damage}", expected, _EXAMPLE, str(path))


def digest(content: Any) -> str:
    """Return the SHA-256 of a JSON value, as hexadecimal digits."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
