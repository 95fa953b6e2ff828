"""Store a study on disk, in a Zarr store that is written block by block and can be resumed.

The store is made complete, without results, elsewhere and then moved into place. A block is done once it is recorded
(`Records`), after its chunks were written, each moved into place by Zarr. A block whose chunks differ from the record
is run again.
"""

from __future__ import annotations

import json
import logging
import math
import os
import re
import warnings
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import BaseModel, Field

from friso.engine.cache import machine
from friso.errors import StoreError, one_line
from friso.platform.system import cause_of, delete_file, once_free
from friso.stage.arguments import check_arguments
from friso.studies.metric import attributes_of, every_variable, form_of, is_text
from friso.studies.store_files import (
    CHUNK,
    DESCRIPTION,
    OWN,
    Records,
    exchange,
    is_old_store,
    is_store,
    lock_store,
    make,
    refuse_links,
    refuse_others_files,
    remove_leftovers,
    remove_partial_files,
    stored,
    where_links_lead,
)
from friso.studies.study import CellBlock, Study, study_of

if TYPE_CHECKING:
    import xarray as xr


logger = logging.getLogger("friso")

FORMAT = 3
"""Version of friso's stores."""

ZARR_FORMAT = 3

AXIS_CHUNK = 1 << 20
"""Most values of an axis in a chunk."""


class Own(BaseModel, frozen=True):
    """What friso notes in its folder of a store: the metric that colours the map, and a checksum (`_sum_at`)."""

    format: int
    metric: str
    checksum: int


class _Attributes(BaseModel, extra="forbid"):
    """The attributes of a store: those of its study (`Study.attributes`), and xarray's."""

    name: str
    stage: str
    friso: str
    equations: str
    machine: str
    rtol: float
    axes: str
    links: str
    coordinates: str


class _Array(BaseModel):
    shape: tuple[int, ...]


class _Arrays(BaseModel):
    metadata: dict[Annotated[str, Field(pattern=r"^\w[\w.-]*$")], _Array]


class _Description(BaseModel):
    """Zarr's description of a store with all of its arrays."""

    attributes: _Attributes
    consolidated_metadata: _Arrays


def _sum_at(path: Path, metric: str) -> int:
    """Return the checksum of all that is written only once into a store: descriptions, axes, and the `metric`.

    Raises OSError if a file cannot be read, and ValueError for a description that is not a store's.
    """
    parts = [metric.encode(), stored(path / DESCRIPTION)]
    arrays = _Description.model_validate_json(parts[-1]).consolidated_metadata.metadata
    for name, array in arrays.items():
        parts.append(stored(path / name / DESCRIPTION))
        if name not in every_variable():
            chunks = math.ceil(math.prod(array.shape) / AXIS_CHUNK)
            parts += [stored(path / name / f"{CHUNK}{number}") for number in range(chunks)]
    return zlib.crc32(b"\0".join(parts))


_EXPECTED = "a store made by friso map, or a new name"
_EXAMPLE = "friso map STAGE.toml ... --out study.zarr"
_ANEW = "the study run again under a new name, or with --overwrite"


def own_at(path: Path) -> Own:
    """Return friso's notes in the store at `path`, after checking all that is written only once.

    Raises StoreError if there is no store, or if it is damaged or of another version.
    """
    if not path.exists():
        raise StoreError("", "nothing there", _EXPECTED, _EXAMPLE, str(path))
    if not path.is_dir():
        raise StoreError("", "a file; nothing was overwritten", _EXPECTED, "--out study.zarr", str(path))
    if is_old_store(path):
        raise StoreError("", "a store of friso 0.3 or earlier", _ANEW, _EXAMPLE, str(path))
    if not is_store(path):
        actual = "a folder with other things in it; nothing was overwritten"
        raise StoreError("", actual, _EXPECTED, "--out study.zarr", str(path))
    damage = "are damaged"
    try:
        own = Own.model_validate(json.loads(stored(path / OWN / DESCRIPTION))["attributes"])
        if own.format != FORMAT:
            damage = f"are of another friso: in form {own.format} instead of {FORMAT}"
        elif own.checksum == _sum_at(path, own.metric):
            return own
    except OSError as error:
        damage = f"cannot be read ({cause_of(error)})"
    except (ValueError, LookupError, TypeError, RecursionError):
        pass
    actual = f"a store whose attributes or axes {damage}"
    raise StoreError("", actual, f"a copy of it, or {_ANEW}", _EXAMPLE, str(path))


SURVEYED_BLOCK = 32
"""Cells of a block with surveys of a hundred runs each, so that an interruption costs seconds."""

STORED_BLOCK = 1024
"""Cells of a block in a study with at most the usual number of blocks."""

LEAST_BLOCKS = 8
"""Fewest blocks of a store, so that an interruption loses an eighth of a study at most."""

LARGEST_STORED_BLOCK = 16384
"""Largest block of a store [cells]. A larger one is read whole for a single cell."""

USUAL_BLOCKS = 250
"""Usual most blocks of a store. With more, writing delays the workers."""


class Store:
    """The store of a study in a folder at `path`, locked by this process while open."""

    def __init__(self, path: Path, study: Study) -> None:
        self.path, self.study = path, study
        usual = min(SURVEYED_BLOCK if study.cycles else STORED_BLOCK, study.cells // LEAST_BLOCKS)
        self.blocks = study.block_shape(max(16, usual, min(LARGEST_STORED_BLOCK, study.cells // USUAL_BLOCKS)))

    @classmethod
    @contextmanager
    def opened(cls, path: Path, study: Study, overwrite: bool = False, metric: str = "outcome") -> Iterator[Store]:
        """Open the store of a study; if it is not there, make it, with the `metric` that colours its map.

        With `overwrite`, the store of another study, or a damaged one, is replaced. Raises StoreError if the folder
        holds anything else or another study, or is in use by another process.
        """
        remove_leftovers(path)
        path = where_links_lead(path)
        store = cls(path, study)
        fill = partial(store._fill, metric)
        with _refused(path):
            if not path.exists() or (path.is_dir() and not any(path.iterdir())):
                make(path, fill)
            elif overwrite and path.is_dir() and is_store(path):
                refuse_others_files(path)
                with lock_store(path) as lock:
                    try:
                        refuse_other(path, study)
                    except StoreError:
                        exchange(path, fill, lock)
                        logger.warning("replaced (--overwrite): %s, which held another study, or a damaged one", path)
        if is_store(path):
            refuse_links(path)
        own_at(path)
        with lock_store(path):
            refuse_other(path, study)
            _warn_of_another_machine(path)
            remove_partial_files(path)
            yield store

    def _fill(self, metric: str, folder: Path) -> None:
        """Write the store without results into a new folder."""
        import zarr
        from zarr.codecs import BloscCodec, Crc32cCodec

        study, coordinates = self.study, self.study.coordinates()
        beside = " ".join(name for name, (dimension, *_) in coordinates.items() if name != dimension)
        group = zarr.create_group(
            folder, zarr_format=ZARR_FORMAT, attributes=study.attributes() | {"coordinates": beside}
        )
        create = partial(
            group.create_array,
            compressors=(BloscCodec(), Crc32cCodec()),
            chunk_key_encoding={"name": "default", "separator": "."},
        )
        with zarr.config.set({"array.write_empty_chunks": True}):
            for name, (dimension, values, *about) in coordinates.items():
                array = create(
                    name,
                    shape=values.shape,
                    chunks=(min(len(values), AXIS_CHUNK),),
                    dtype=_zarr_type(values.dtype),
                    dimension_names=(dimension,),
                    attributes=dict(*about),
                )
                array[...] = values
        for name in study.metrics:
            create(
                name,
                shape=study.shape,
                chunks=self.blocks,
                dtype=_zarr_type(np.dtype(form_of(name))),
                fill_value="" if is_text(name) else np.nan,
                dimension_names=study.names,
                attributes=attributes_of(name, study.stage.axis_kind),
            )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Zarr's specification has no consolidated descriptions yet
            zarr.consolidate_metadata(str(folder), zarr_format=ZARR_FORMAT)
        own = Own(format=FORMAT, metric=metric, checksum=_sum_at(folder, metric))
        zarr.create_group(folder / OWN, zarr_format=ZARR_FORMAT, attributes=own.model_dump())

    @cached_property
    def records(self) -> Records:
        """Return the records of the blocks that were written."""
        return Records(self.path, own_at(self.path).checksum)

    def missing(self) -> Iterator[CellBlock]:
        """Yield the blocks that must be run: those not done, and damaged ones with a log message."""
        records = self.records
        for block in self.study.blocks(self.blocks):
            number = self._number(block)
            if not records.is_whole(number, self.study.metrics):
                if records.file(number).exists():
                    logger.warning("%s: block %s is damaged and is run again", self.path, number)
                yield block

    @property
    def is_done(self) -> bool:
        """Tell whether all blocks are recorded as written."""
        counts = [math.ceil(length / size) for length, size in zip(self.study.shape, self.blocks, strict=True)]
        return sum(1 for file in (self.path / OWN).iterdir() if _NUMBER.fullmatch(file.name)) >= math.prod(counts)

    def _number(self, block: CellBlock) -> str:
        """Return the name of a block's files, such as "0.3"."""
        return ".".join(str(part.start // size) for part, size in zip(block, self.blocks, strict=True))

    def write(self, block: CellBlock, columns: Mapping[str, np.ndarray]) -> None:
        """Write the metrics of a block, and record it. Raises OSError if the disk is full.

        `columns` are arrays of shape (cells,) by name.
        """
        import zarr

        number, records = self._number(block), self.records
        shape = tuple(part.stop - part.start for part in block)
        delete_file(records.file(number))  # a damaged block is not done until all of it is written again
        # empty chunks are written too, because the record lists every chunk
        with zarr.config.set({"array.write_empty_chunks": True}):
            group: Any = zarr.open_group(self.path, mode="r+", zarr_format=ZARR_FORMAT)
            for name in self.study.metrics:
                values = columns[name].astype(form_of(name)).reshape(shape)
                once_free(partial(group[name].__setitem__, block, values))
        records.enter(number, self.study.metrics)

    def read(self) -> xr.Dataset:
        """Return the study in the store as a dataset whose values are read on access."""
        return read_store(self.path)


_NUMBER = re.compile(r"[0-9]+(\.[0-9]+)*")


def _zarr_type(kind: np.dtype) -> Any:
    """Return the type of Zarr's arrays for a NumPy type: texts of any length, for which Zarr 3 has a specification."""
    return str if kind.kind in "UTO" else kind


@check_arguments
def read_store(path: str | os.PathLike[str]) -> xr.Dataset:
    """Return the study in the store at `path` as a dataset whose values are read on access.

    The study may be unfinished; cells that were not run yet are empty. Raises StoreError if there is no store, or if
    its attributes or axes are damaged. It is also raised on access to damaged cells.

    Examples
    --------
    >>> import friso
    >>> friso.read_store("rig.zarr")["outcome"]  # doctest: +SKIP
    """
    import xarray as xr
    import zarr
    from xarray.core.indexing import LazilyIndexedArray

    from friso.studies.checked_store import CheckedStore, Texts

    path = Path(path)
    own = own_at(path)
    try:
        source = CheckedStore(path, checksum=own.checksum)
        read = xr.open_zarr(source, chunks=None, consolidated=True, zarr_format=ZARR_FORMAT)
        axes = {name: axis.load() for name, axis in read.coords.items()}
        words = {name: np.array(axis.values.tolist()) for name, axis in axes.items() if axis.dtype.kind == "T"}
        axes |= {name: axes[name].copy(data=values) for name, values in words.items()}
        runs = read[[name for name in every_variable() if name in read]].assign_coords(axes)
        runs.encoding["source"] = os.path.abspath(path)
        study = study_of(runs)
        blocks = Store(path, study).blocks
        if any(runs[name].encoding["chunks"] != blocks for name in study.metrics):
            raise ValueError("other chunks than friso writes")
        group: Any = zarr.open_group(source, mode="r", zarr_format=ZARR_FORMAT)
        texts = {name: Texts(group[name], form_of(name)) for name in study.metrics if is_text(name)}
        return runs.assign(
            {name: (runs[name].dims, LazilyIndexedArray(text), runs[name].attrs) for name, text in texts.items()}
        )
    except Exception:  # any error of a codec, or of a damaged study
        actual = "a store whose axes are damaged, or whose study this friso cannot read"
        raise StoreError("", actual, f"a copy of it, or {_ANEW}", _EXAMPLE, str(path)) from None


def holds_all(path: Path, study: Study) -> bool:
    """Tell whether the store at `path` is complete, undamaged, and of this study."""
    try:
        refuse_other(path, study)
        return next(Store(path, study).missing(), None) is None
    except (StoreError, PermissionError):
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
    rows = max(1, LARGEST_STORED_BLOCK // max(1, int(np.prod(texts.shape[1:]))))
    for first in range(0, texts.shape[0], rows):
        codes, words = pd.factorize(texts[first : first + rows].values.ravel())
        once = np.array([words_once.setdefault(str(word), str(word)) for word in words], dtype=object)
        decoded[first : first + rows] = once[codes].reshape(decoded[first : first + rows].shape)
    return decoded


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
