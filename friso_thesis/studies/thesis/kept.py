"""Keep finished parts of a long reproduction in a folder until all is done.

An interrupted run continues from them.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from friso.studies.metadata import digest
from friso.studies.metric import form_of
from friso.studies.store_files import keep_arrays, kept_arrays, put, stored
from friso.studies.study import Study
from friso.studies.sweep import dataset
from friso_thesis.studies.kept_work import KeptWork
from friso_thesis.studies.thesis.claims import Finding, Part
from friso_thesis.studies.thesis.studies import thesis_rig
from friso_thesis.studies.thesis.taken_apart import put_together, taken_apart

if TYPE_CHECKING:
    import xarray as xr

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
    *("axis.py", "evidence.py", "evidence.toml", "intervals.py", "materials.py", "materials.toml", "shares.py"),
)
"""Folders and files, besides the equations, whose contents decide on saved results. Paths start from the package
friso."""

Findings = dict[str, Finding]
"""Findings by name, such as that of a claim."""


class Kept(KeptWork):
    """Folders in which maps, experiments and findings of the thesis are saved."""

    sources = SOURCES

    def runs(self, study: Study, verify: float, make: Callable[[], xr.Dataset]) -> xr.Dataset:
        """Return the runs of a study from the folder; otherwise `make` and save them.

        `verify` is the fraction of the cells that has to be run again more accurately.
        """
        axes = [(axis.name, axis.values.tolist()) for axis in study.axes]
        file = self._file("npz", study.stage.to_toml(), axes, dict(study.links), study.rtol, study.metrics, verify)
        columns = None if file is None else kept_arrays(file)
        notes = None if columns is None else columns.pop("notes", None)
        if columns is not None and notes is not None and columns.keys() == set(study.metrics):
            runs = dataset(study, {name: values.reshape(study.shape) for name, values in columns.items()})
            runs.attrs |= json.loads(str(notes))
            return runs
        runs = make()
        if file is not None:
            arrays: dict[str, Any] = {name: runs[name].values.astype(form_of(name)) for name in study.metrics}
            verified = {name: value for name, value in runs.attrs.items() if name.startswith("verified")}
            keep_arrays(file, {"notes": np.array(json.dumps(verified)), **arrays})
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

    def findings(self, about: tuple[Any, ...], make: Callable[[], Findings]) -> Findings:
        """Return the findings saved under `about`; otherwise `make` and save them."""
        file = self._file("json", "findings", *about)
        if file is not None and (kept := kept_findings(file)) is not None:
            return kept
        findings = make()
        if file is not None:
            document = {name: [asdict(part) for part in item.parts] for name, item in findings.items()}
            file.parent.mkdir(parents=True, exist_ok=True)
            put(file, json.dumps({"findings": document, "sha256": digest([file.name, document])}).encode("utf-8"))
        return findings

    def _file(self, suffix: str, *about: Any) -> Path | None:
        return super()._file(suffix, thesis_rig().to_toml(), *about)


NOT_KEPT = Kept()
"""A store that saves nothing."""


def kept_findings(file: Path) -> Findings | None:
    """Return the findings in a file; None if it is missing, damaged, or of another kind."""
    try:
        kept = json.loads(stored(file))
        document = kept["findings"]
        if kept["sha256"] != digest([file.name, document]):
            return None
        return {name: Finding(tuple(Part(**part) for part in parts)) for name, parts in document.items()}
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return None
