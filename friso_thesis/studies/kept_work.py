"""Keep finished pieces of long work in a folder until all is done.

An interrupted run continues from them.
"""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from friso.engine.cache import code_digest, machine
from friso.platform.files import whole_file
from friso.platform.system import remove_folder
from friso.studies.store_files import stored
from friso.studies.study import equations_version

MOST_EXPANDED = 1 << 30
"""Most bytes of the arrays in an archive of results.

It limits them because a small archive may claim any size.
"""


def kept_arrays(file: Path) -> dict[str, np.ndarray] | None:
    """Return the arrays that `keep_arrays` wrote into a file, or None.

    The result is None if the arrays are missing or damaged. It is also None if they take more than MOST_EXPANDED bytes;
    no array is expanded then.
    """
    try:
        content = stored(file)
        digest, archive = content[:_DIGEST], io.BytesIO(content[_DIGEST:])
        if digest != _digest(file, archive.getvalue()):
            return None
        with zipfile.ZipFile(archive) as members:
            if sum(member.file_size for member in members.infolist()) > MOST_EXPANDED:
                return None
        archive.seek(0)
        with np.load(archive, allow_pickle=False) as arrays:
            return dict(arrays)
    except Exception:  # any error of NumPy in an archive that others gave a valid digest
        return None


def keep_arrays(file: Path, arrays: Mapping[str, Any]) -> None:
    """Store arrays in an archive, behind a digest that detects damage and exchanged files.

    The digest covers the arrays and the name of the file. Raises OSError if the file cannot be written.
    """
    archive = io.BytesIO()
    np.savez_compressed(archive, **arrays)
    content = archive.getvalue()
    file.parent.mkdir(parents=True, exist_ok=True)
    put(file, _digest(file, content) + content)


_DIGEST = hashlib.sha256().digest_size


def _digest(file: Path, content: bytes) -> bytes:
    return hashlib.sha256(f"{file.name}\n".encode() + content).digest()


def put(file: Path, content: bytes) -> None:
    """Write a file completely or not at all, with the user's usual permissions.

    Raises OSError if the file cannot be written.
    """
    with whole_file(file) as stream:
        stream.write(content)


def digest(content: Any) -> str:
    """Return the SHA-256 of a JSON value, as hexadecimal digits."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


@dataclass(frozen=True)
class KeptWork:
    """Folder in which pieces of work are saved; None saves nothing.

    Pieces that are damaged, or were computed by other code, are computed again.
    """

    folder: Path | None = None

    sources: ClassVar[tuple[str, ...]]
    """Folders and files, besides the equations, whose contents decide on saved results. Paths start from the package
    friso."""

    @property
    def count(self) -> int:
        """Return the number of pieces kept."""
        if self.folder is None or not self.folder.exists():
            return 0
        return sum(1 for file in self.folder.iterdir() if file.suffix == ".npz")

    def clear(self) -> None:
        """Delete all saved pieces."""
        if self.folder is not None:
            remove_folder(self.folder)

    def arrays(
        self, about: tuple[Any, ...], make: Callable[[], Mapping[str, np.ndarray]], names: Collection[str] | None = None
    ) -> Mapping[str, np.ndarray]:
        """Return arrays by name, as saved under `about`; otherwise `make` and save them.

        A saved piece must have exactly the given `names`.
        """
        file = self._file("npz", *about)
        columns = None if file is None else kept_arrays(file)
        if columns is not None and (names is None or columns.keys() == {*names}):
            return columns
        arrays = make()
        if file is not None:
            keep_arrays(file, arrays)
        return arrays

    def _file(self, suffix: str, *about: Any) -> Path | None:
        if self.folder is None:
            return None
        settings = repr((equations_version(), code_digest(*self.sources), _built_on(), about))
        return self.folder / f"{hashlib.sha256(settings.encode()).hexdigest()[:24]}.{suffix}"


@cache
def _built_on() -> str:
    """Return a text on machine and libraries: all that decides on a result besides friso's code."""
    return f"{machine()}, scipy {version('scipy')}"
