"""What a refined study was told of its cells, kept until it is done: asked the same again, it needs no runs."""

from __future__ import annotations

from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from friso.studies.cells import WORDS, Columns
from friso.studies.refine import Ask
from friso.studies.store_files import stored_arrays
from friso.system import remove_folder
from friso.whole_file import whole_file


class KeptCells:
    """Answers kept in a folder; what is damaged there is asked for again: the files are archives with checksums."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def keeping(self, ask: Ask) -> Ask:
        """`ask` with its answers kept."""
        self.folder.mkdir(exist_ok=True)
        number = count()

        def kept_or_asked(cells: np.ndarray) -> Columns:
            file = self.folder / f"{next(number)}.npz"
            if (stored := _kept(file, cells)) is not None:
                return stored
            columns = ask(cells)
            with whole_file(file) as stream:
                arrays: dict[str, Any] = {name: columns[name].astype(WORDS.get(name, "f8")) for name in columns}
                np.savez_compressed(stream, cells=cells, **arrays)
            return columns

        return kept_or_asked

    def forget(self) -> None:
        """Remove what was kept: the blocks of the study hold it by now."""
        remove_folder(self.folder)


def _kept(file: Path, cells: np.ndarray) -> Columns | None:
    """What was kept about just these cells, None if nothing."""
    columns = stored_arrays(file)
    about = None if columns is None else columns.pop("cells", None)
    return columns if about is not None and np.array_equal(about, cells) else None
