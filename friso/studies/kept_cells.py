"""Store results of cells until a refined study is done, so that none is run twice."""

from __future__ import annotations

from itertools import count
from pathlib import Path

import numpy as np

from friso.platform.system import remove_folder
from friso.studies.cells import Columns
from friso.studies.metric import form_of
from friso.studies.refine import Ask, asked_for
from friso.studies.store_files import keep_arrays, kept_arrays
from friso.studies.study import Study


class KeptCells:
    """Stored results of cells, in a folder, with the digest of their study.

    Damaged results, and those of another study, are computed again.
    """

    def __init__(self, folder: Path, study: Study, digest: str) -> None:
        self.folder, self.metrics, self.digest = folder, asked_for(study).metrics, digest

    def keeping(self, ask: Ask) -> Ask:
        """Return the function `ask`, changed to store its answers or to take stored ones.

        `ask` computes the metrics of cells from the cells' indices.
        """
        self.folder.mkdir(exist_ok=True)
        number = count()

        def kept_or_asked(cells: np.ndarray) -> Columns:
            file = self.folder / f"{next(number)}.npz"
            if (kept := self._kept(file, cells)) is not None:
                return kept
            columns = ask(cells)
            arrays = {name: columns[name].astype(form_of(name)) for name in self.metrics}
            keep_arrays(file, {"cells": cells, **arrays}, self.digest)
            return columns

        return kept_or_asked

    def forget(self) -> None:
        """Remove the stored results once the blocks of the study contain them."""
        remove_folder(self.folder)

    def _kept(self, file: Path, cells: np.ndarray) -> Columns | None:
        """Return the results stored for exactly these cells, or None."""
        forms = {name: np.dtype(form_of(name)) for name in self.metrics}
        most = cells.nbytes + cells.size * sum(form.itemsize for form in forms.values()) + 1024 * (2 + len(forms))
        columns = kept_arrays(file, self.digest, most)
        if columns is None or not np.array_equal(columns.pop("cells", ()), cells):
            return None
        same = {name: column.dtype for name, column in columns.items()} == forms
        return columns if same and all(column.shape == cells.shape for column in columns.values()) else None
