"""Store a study on disk, in a Zarr store that is written block by block and can be resumed.

The store is made complete, without results, elsewhere and then moved into place. A block is done once its digests are
recorded (`Ledger`), after its chunks were written, each moved into place by Zarr. A block whose chunks differ from the
record is run again. Other programs get studies as NetCDF and CSV.
"""

from __future__ import annotations

import asyncio
import json
import logging
import math
import os
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from friso.engine.cache import machine
from friso.errors import StoreError
from friso.escapes import one_line, table_cell
from friso.platform.system import cause_of, once_free, path_of
from friso.stage.arguments import check_arguments
from friso.studies.metadata import annotate_metadata, checked_metadata, is_store, seal_metadata
from friso.studies.metric import attributes_of, every_variable, form_of, is_text
from friso.studies.settings import settings
from friso.studies.store_files import (
    Ledger,
    exchange,
    lock_store,
    make,
    refuse_foreign,
    refuse_others_files,
    remove_leftovers,
    remove_partial_files,
    where_links_lead,
)
from friso.studies.study import CellBlock, Study, study_of

if TYPE_CHECKING:
    import xarray as xr


def export(runs: xr.Dataset, path: Path) -> None:
    """Write a study as NetCDF (".nc") or as CSV with one row per cell (".csv").

    Columns of a CSV file are named with their units. Raises ValueError for another suffix.
    """
    if path.suffix == ".nc":
        texts = [name for name in every_variable() if name in runs and is_text(name)]
        converted = {name: runs[name].copy(data=_bytes(runs[name].values)) for name in texts}
        runs.assign(converted).to_netcdf(path, engine="scipy")
    elif path.suffix == ".csv":
        _write_csv(runs, path)
    else:
        raise ValueError(f"export: given {path.suffix}, expected .nc or .csv")


def _bytes(texts: np.ndarray) -> np.ndarray:
    """Return texts as UTF-8 bytes, in an array wide enough for the longest of them."""
    import pandas as pd

    codes, words = pd.factorize(texts.ravel())
    return np.array([str(word).encode() for word in words])[codes].reshape(texts.shape)


def _write_csv(runs: xr.Dataset, path: Path) -> None:
    """Write a study as a table of comma-separated values, one row per cell."""
    import pandas as pd

    dims = [str(dim) for dim in runs["outcome"].dims]
    shape = runs["outcome"].shape
    rows = max(1, settings.rows_together // max(1, int(np.prod(shape[1:]))))
    with path.open("w", encoding="utf-8", newline="") as file:
        for first in range(0, shape[0], rows):
            part = runs.isel({dims[0]: slice(first, first + rows)})
            frame: pd.DataFrame = part.to_dataframe(dim_order=dims).reset_index()
            named = {name: table_cell(_with_unit(runs, str(name))) for name in frame.columns}
            for name in frame.columns[[kind.kind not in "biuf" for kind in frame.dtypes]]:
                frame[name] = frame[name].astype(str).map(table_cell)
            frame.rename(columns=named).to_csv(file, index=False, header=first == 0)


def _with_unit(runs: xr.Dataset, name: str) -> str:
    unit = runs[name].attrs.get("units", "")
    return f"{name} [{unit}]" if unit not in ("", "1") else name


logger = logging.getLogger("friso")

ZARR_FORMAT = 2
"""Version of the Zarr format that every reader supports, and in which fixed-length texts are specified."""

COORDINATES = "coordinates"
"""Attribute in which xarray stores the coordinates that belong to no variable."""


class Store:
    """The store of a study in a folder at `path`, locked by this process while open."""

    def __init__(self, path: Path, study: Study) -> None:
        self.path, self.study = path, study
        usual = min(
            settings.surveyed_block if study.cycles else settings.stored_block, study.cells // settings.least_blocks
        )
        self.blocks = study.block_shape(
            max(16, usual, min(settings.largest_stored_block, study.cells // settings.usual_blocks))
        )

    @classmethod
    @contextmanager
    def opened(cls, path: Path, study: Study, overwrite: bool = False) -> Iterator[Store]:
        """Open the store of a study, created if it is not there.

        With `overwrite`, the store of another study, or a damaged one, is replaced. Raises StoreError if the folder
        holds anything else or another study, or is in use by another process.
        """
        remove_leftovers(path)
        path = where_links_lead(path)
        store = cls(path, study)
        with _refused(path):
            if not path.exists() or (path.is_dir() and not any(path.iterdir())):
                make(path, store._fill)
            elif overwrite and path.is_dir() and is_store(path):
                store._replace()
        checked_metadata(path)
        with lock_store(path):
            refuse_other(path, study)
            _warn_of_another_machine(path)
            remove_partial_files(path)
            checked_metadata(path).mend(path)  # read again: another process may have added a note
            yield store

    def _replace(self) -> None:
        """Replace the present store by one of this study, unless it already is this study's."""
        with lock_store(self.path) as lock:
            try:
                refuse_other(self.path, self.study)
            except StoreError:
                refuse_others_files(self.path)
                exchange(self.path, self._fill, lock)
                logger.warning("replaced (--overwrite): %s, which held another study, or a damaged one", self.path)

    def _fill(self, folder: Path) -> None:
        """Write the store without results into a new folder."""
        import xarray as xr
        import zarr
        from numcodecs import CRC32

        study, coordinates = self.study, self.study.coordinates()
        # arrays start with one empty cell, which is not written, and then get their size, so that nothing is computed
        cells = {
            name: np.full((1,) * len(study.names), "" if is_text(name) else np.nan, form_of(name))
            for name in study.metrics
        }
        variables = {
            name: (study.names, cell, attributes_of(name, study.stage.axis_kind)) for name, cell in cells.items()
        }
        checked = {"filters": [CRC32()]}  # for readers of single chunks
        encoding: dict[str, dict[str, Any]] = {name: {"chunks": self.blocks, **checked} for name in study.metrics}
        for name in encoding:
            encoding[name] |= {} if is_text(name) else {"_FillValue": np.nan}
        own: dict[str, dict[str, Any]] = dict.fromkeys(coordinates, checked)
        beside = " ".join(name for name, (dimension, *_) in coordinates.items() if name != dimension)
        attributes = study.attributes() | ({COORDINATES: beside} if beside else {})
        parts = [
            (xr.Dataset(coords=coordinates, attrs=study.attributes()), own, "w"),
            (xr.Dataset(variables, attrs=attributes), encoding, "a"),
        ]
        try:
            with zarr.config.set({"array.write_empty_chunks": False}):
                for part, how, mode in parts:
                    part.to_zarr(folder, mode=mode, encoding=how, zarr_format=ZARR_FORMAT, consolidated=False)  # type: ignore[call-overload]
            indent = zarr.config.get("json_indent")
            for name in study.metrics:  # Zarr's own resize would list every possible chunk
                place = folder / name / ".zarray"
                array = json.loads(place.read_text(encoding="utf-8"))
                place.write_text(
                    json.dumps({**array, "shape": study.shape}, indent=indent), encoding="utf-8", newline=""
                )
            zarr.consolidate_metadata(str(folder), zarr_format=ZARR_FORMAT)
        except OSError:
            _let_zarr_finish()
            raise
        seal_metadata(folder, coordinates)

    @property
    def ledger(self) -> Ledger:
        """Return the records of the blocks that were written."""
        return Ledger(self.path, checked_metadata(self.path).study, self.study.metrics)

    def missing(self) -> Iterator[CellBlock]:
        """Yield the blocks that must be run: those not done, and damaged ones with a log message."""
        ledger = self.ledger
        for block in self.study.blocks(self.blocks):
            number = self._number(block)
            if not ledger.has(number):
                yield block
            elif not ledger.is_whole(number):
                logger.warning("%s: block %s is damaged and is run again", self.path, number)
                yield block

    def done(self) -> list[str]:
        """Return the names of the completed blocks, as in Zarr.

        The names are read from existing files, because a store may claim any size.
        """
        return [number for number in self.ledger.entered() if self._is_of_block(number)]

    @property
    def is_done(self) -> bool:
        """Tell whether all blocks are recorded as written."""
        return len(self.done()) == self._count

    def state(self) -> StoreState:
        """Return how much of the study is done, and which of its parts are damaged or unreadable."""
        ledger, done = self.ledger, self.done()
        damaged: list[str] = []
        unreadable: list[str] = []
        for number in done:
            try:
                if not ledger.is_whole(number):
                    damaged.append(number)
            except PermissionError as error:
                unreadable.append(path_of(error) or number)
        files = checked_metadata(self.path).damaged_files(self.path)
        return StoreState(self._count, len(done), damaged, files, unreadable)

    @property
    def _counts(self) -> list[int]:
        """Return the number of blocks along each axis."""
        return [-(-length // size) for length, size in zip(self.study.shape, self.blocks, strict=True)]

    @property
    def _count(self) -> int:
        return math.prod(self._counts)

    def _is_of_block(self, number: str) -> bool:
        """Tell whether a name, such as "0.3", is one of a block of this study."""
        parts = number.split(".")
        return len(parts) == len(self._counts) and all(
            re.fullmatch("0|[1-9][0-9]{0,17}", part) and int(part) < count
            for part, count in zip(parts, self._counts, strict=True)
        )

    def _number(self, block: CellBlock) -> str:
        """Return the name of a block's files, such as "0.3"."""
        return ".".join(str(part.start // size) for part, size in zip(block, self.blocks, strict=True))

    def write(self, block: CellBlock, columns: Mapping[str, np.ndarray]) -> None:
        """Write the metrics of a block, and record it. Raises OSError if the disk is full.

        `columns` are arrays of shape (cells,) by name.
        """
        import zarr

        shape = tuple(part.stop - part.start for part in block)
        # empty chunks are written too, because the record lists every chunk
        with zarr.config.set({"array.write_empty_chunks": True}):
            group: Any = zarr.open_group(self.path, mode="r+", zarr_format=ZARR_FORMAT, use_consolidated=True)
            for name in self.study.metrics:
                values = columns[name].astype(form_of(name)).reshape(shape)
                once_free(partial(group[name].__setitem__, block, values))
        self.ledger.enter(self._number(block))

    @property
    def notes(self) -> Mapping[str, Any]:
        """Return friso's own notes on the store, such as the metric that colours its map."""
        return checked_metadata(self.path).notes

    def note(self, **notes: Any) -> None:
        """Add friso's own notes to the store, by name, which are no part of the study."""
        annotate_metadata(self.path, notes)

    def read(self) -> xr.Dataset:
        """Return the study in the store as a dataset whose values are read on access."""
        return read_store(self.path)


@check_arguments
def read_store(path: str | os.PathLike[str]) -> xr.Dataset:
    """Return the study in the store at `path` as a dataset whose values are read on access.

    The study may be unfinished; cells that were not run yet are empty. Raises StoreError if there is no store, if its
    metadata or axes are damaged, or if anything but files is in it. It is also raised on access to damaged cells.

    Examples
    --------
    >>> import friso
    >>> friso.read_store("rig.zarr")["outcome"]  # doctest: +SKIP
    """
    import xarray as xr

    from friso.studies.sealed_store import SealedStore

    metadata = checked_metadata(Path(path))
    refuse_foreign(Path(path), metadata.all_files)
    try:
        if metadata.damaged_axes(Path(path)):
            raise ValueError("other axes than were written")
        runs = xr.open_zarr(SealedStore.at(Path(path), metadata), chunks=None, zarr_format=ZARR_FORMAT)
        runs.attrs = {name: value for name, value in metadata.attributes.items() if name != COORDINATES}
        runs = runs.assign_coords({name: axis.load() for name, axis in runs.coords.items()})
        runs.encoding["source"] = os.path.abspath(path)
        study = study_of(runs)
        blocks = Store(Path(path), study).blocks
        if any(runs[name].encoding["chunks"] != blocks for name in study.metrics):
            raise ValueError("other chunks than friso writes")
        return runs
    except Exception:  # any error of a codec, or of a damaged study
        expected = "a copy of the store, or the study run again under a new name, or with --overwrite"
        actual = "a store whose axes are damaged, or whose study this friso cannot read"
        raise StoreError("", actual, expected, "friso map STAGE.toml ... --out study.zarr", str(path)) from None


@dataclass(frozen=True)
class StoreState:
    """State of a study's store.

    Fields are the number of blocks, how many are done, and the names of damaged blocks. Further fields list damaged
    files of metadata, which the next run writes anew, and chunks that cannot be read for lack of permission.
    """

    blocks: int
    done: int
    damaged: list[str]
    files: list[str]
    unreadable: list[str]

    @property
    def is_whole(self) -> bool:
        """Tell whether all blocks are done, undamaged and readable."""
        return self.done == self.blocks and not (self.damaged or self.unreadable)


def check_store(path: Path) -> StoreState:
    """Read all of the store at `path`, compare it with its digests, and return its state.

    Raises StoreError if its metadata or axes are damaged, or there is none.
    """
    return Store(path, study_of(read_store(path))).state()


def holds_all(path: Path, study: Study) -> bool:
    """Tell whether the store at `path` is complete, undamaged, and of this study."""
    try:
        refuse_other(path, study)
        return check_store(path).is_whole
    except StoreError:
        return False


def in_memory(runs: xr.Dataset) -> xr.Dataset:
    """Load the study of an opened store into memory, keeping each distinct text only once.

    Statuses in their stored form take a hundred times the memory.
    """
    words = [name for name in every_variable() if name in runs and is_text(name)]
    loaded = runs.drop_vars(words).load()
    return loaded.assign({name: (runs[name].dims, _shared(runs[name]), runs[name].attrs) for name in words})


def _shared(texts: xr.DataArray) -> np.ndarray:
    """Return stored texts as an array of Python's, in which equal texts are one object."""
    import pandas as pd

    words_once: dict[str, str] = {}
    decoded = np.empty(texts.shape, dtype=object)
    rows = max(1, settings.largest_stored_block // max(1, int(np.prod(texts.shape[1:]))))
    for first in range(0, texts.shape[0], rows):
        codes, words = pd.factorize(texts[first : first + rows].values.ravel())
        once = np.array([words_once.setdefault(str(word), str(word)) for word in words], dtype=object)
        decoded[first : first + rows] = once[codes].reshape(decoded[first : first + rows].shape)
    return decoded


def _let_zarr_finish() -> None:
    """Wait for Zarr's other writes after one of them has failed."""
    from zarr.core.sync import sync

    async def others() -> None:
        tasks = asyncio.all_tasks() - {asyncio.current_task()}
        await asyncio.gather(*tasks, return_exceptions=True)

    sync(others())


def refuse_other(path: Path, study: Study) -> None:
    """Check that the store at `path` has this study. Raises StoreError if it has another one."""
    with read_store(path) as dataset:
        differences = study.differences(study_of(dataset), str(dataset.attrs.get("equations")))
    if differences:
        text = "a store of another study:\n            " + "\n            ".join(map(one_line, differences))
        expected = "the same study, to resume it, another --out, or --overwrite, which replaces the store"
        raise StoreError("", text, expected, origin=str(path))


def _warn_of_another_machine(path: Path) -> None:
    with read_store(path) as dataset:
        machine_stored = one_line(str(dataset.attrs.get("machine")))
    if machine_stored != machine():
        logger.warning(
            "the store was begun on %s, here is %s: cells may differ in their last bits", machine_stored, machine()
        )


@contextmanager
def _refused(path: Path) -> Iterator[None]:
    """Raise StoreError if a store cannot be written within the block."""
    try:
        yield
    except OSError as error:
        expected = f"a folder that can be written ({cause_of(error)})"
        raise StoreError("--out", str(path), expected, "--out study.zarr") from None
