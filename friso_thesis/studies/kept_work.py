"""Keep finished pieces of long work in a folder until all is done.

An interrupted run continues from them.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from friso.engine.cache import code_digest, machine
from friso.platform.system import remove_folder
from friso.studies.store_files import keep_arrays, kept_arrays
from friso.studies.study import equations_version


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
        return sum(1 for file in self.folder.iterdir() if file.suffix in (".npz", ".json"))

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
