"""The metadata of a store: one file (.zmetadata), written at once, with the digest of what it says.

Zarr's readers take everything but the numbers from it; what stands beside the arrays is for other programs.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from friso.engine.private import write_private
from friso.errors import StoreError

FORMAT = 1
"""Version of what friso writes into a store."""

_FILE, _OWN, _ATTRIBUTES = ".zmetadata", "friso", ".zattrs"
"""The file, friso's own entry in it, and the entry with the attributes of the study."""

_EXAMPLE = "friso map STAGE.toml ... --out study.zarr"


def seal_metadata(path: Path, attributes: Mapping[str, Any] | None = None) -> None:
    """Write the digest of the metadata as they stand there, with further attributes."""
    document = json.loads((path / _FILE).read_bytes())
    metadata = document["metadata"]
    metadata[_ATTRIBUTES] |= dict(attributes or {})
    if attributes:  # also for other readers; first, so that a kill in between has it all done again
        write_private(path / _ATTRIBUTES, json.dumps(metadata[_ATTRIBUTES], indent=1).encode())
    sealed = {**document, _OWN: {"format": FORMAT, "sha256": _digest(metadata)}}
    write_private(path / _FILE, json.dumps(sealed, indent=1, sort_keys=True).encode())


def checked_metadata(path: Path) -> dict[str, Any]:
    """The attributes of the study in the store at `path`. Raises StoreError where there is no store, or it is damaged
    or of another version."""
    expected = "a store made by friso map, or a new name"
    if not path.exists():
        raise StoreError("", "nothing there", expected, _EXAMPLE, str(path))
    if not path.is_dir():
        raise StoreError("", "a file; nothing was overwritten", expected, "--out study.zarr", str(path))
    try:
        document = json.loads((path / _FILE).read_bytes())
        checked, metadata = document.get(_OWN), document["metadata"]
        attributes = dict(metadata[_ATTRIBUTES])
        intact = isinstance(checked, dict) and checked.get("sha256") == _digest(metadata)
    except FileNotFoundError:
        if is_store(path):
            raise _damaged(path, "is missing") from None
        actual = "a folder with other things in it; nothing was overwritten"
        raise StoreError("", actual, expected, "--out study.zarr", str(path)) from None
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise _damaged(path, "is damaged") from None
    if isinstance(checked, dict) and isinstance(number := checked.get("format"), int) and number > FORMAT:
        actual = f"a store of a newer friso ({attributes.get('friso', 'unknown')})"
        raise StoreError("", actual, "a store of this friso, or that one to read it", origin=str(path))
    if intact:
        return attributes
    if isinstance(checked, dict):
        raise _damaged(path, "is damaged")
    if "equations" in attributes:
        actual, expected = "a store of an earlier friso, without checksums", "to run the study again under a new name"
        raise StoreError("", actual, expected, _EXAMPLE, str(path))
    actual = "a Zarr store that friso map has not made; nothing was overwritten"
    raise StoreError("", actual, expected, "--out study.zarr", str(path))


def is_store(path: Path) -> bool:
    """Whether friso made the folder, as far as what stands beside the arrays tells."""
    try:
        return (path / ".zgroup").is_file() and b'"equations"' in (path / _ATTRIBUTES).read_bytes()
    except OSError:
        return False


LOCK = ".friso.lock"
"""The file that is locked while a store is written to."""


def _damaged(path: Path, how: str) -> StoreError:
    expected = "a copy of the store, or the study run again under a new name, or with --overwrite"
    return StoreError("", f"a store whose {_FILE} {how}", expected, _EXAMPLE, str(path))


def _digest(metadata: Any) -> str:
    return hashlib.sha256(json.dumps(metadata, sort_keys=True).encode()).hexdigest()
