"""A study on disk: a Zarr store that is written block by block and resumed where it was left.

The store is made whole, without results, under another name and then moved into place; a block's outcomes are
written after its other variables, and Zarr moves each file into place. So a block whose outcomes are there is done,
whenever the process was killed. Every chunk holds a checksum: blocks that are damaged are run again.
"""

from __future__ import annotations

import logging
import os
import shutil
import uuid
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from filelock import FileLock, Timeout

from friso.engine.cache import machine
from friso.errors import StoreError
from friso.studies.answers import PARTIAL, Answers
from friso.studies.cells import UNITS, WORDS, attributes_of
from friso.studies.metadata import LOCK, checked_metadata, is_store, seal_metadata
from friso.studies.study import Block, Study, study_of

if TYPE_CHECKING:
    import xarray as xr

LEAST_BLOCKS, BLOCK, BLOCKS, LARGEST_BLOCK = 8, 1024, 250, 16384
"""A study has at least `LEAST_BLOCKS` blocks, so that an interruption loses a part of it only; `BLOCK` cells in each,
more from `BLOCKS` blocks on, so that writing does not hold up the workers, and `LARGEST_BLOCK` at most. A store has
the same blocks on every machine."""

logger = logging.getLogger("friso")

_FORMAT = 2
"""Version of the Zarr format: the one that every reader knows, and in which fixed-length texts are specified."""


class Store:
    """The results of a study in a folder, locked by this process while it is open."""

    def __init__(self, path: Path, study: Study) -> None:
        self.path, self.study = path, study
        large = min(LARGEST_BLOCK, study.cells // BLOCKS)
        self.blocks = study.block_shape(max(16, min(BLOCK, study.cells // LEAST_BLOCKS), large))

    @classmethod
    @contextmanager
    def opened(cls, path: Path, study: Study, overwrite: bool = False) -> Iterator[Store]:
        """The store of a study, made if it is not there; with `overwrite` in place of that of another study, or of a
        damaged one.

        Raises StoreError if the folder holds anything else, another study, or is in use by another process.
        """
        store = cls(path, study)
        if overwrite and path.is_dir() and is_store(path):
            store._replace()
        if not path.exists() or (path.is_dir() and not any(path.iterdir())):
            store._make()
        checked_metadata(path)
        with _locked(path):
            _refuse_other(path, study)
            _warn_of_another_machine(path)
            for leftover in path.rglob(f"*{PARTIAL}"):  # of a file that was being written when its process was killed
                leftover.unlink(missing_ok=True)
            yield store

    def _replace(self) -> None:
        """Delete the store that is there, unless it is that of this study."""
        with _locked(self.path):
            try:
                _refuse_other(self.path, self.study)
            except StoreError:
                gone = _beside(self.path)
                self.path.rename(gone)
                shutil.rmtree(gone, ignore_errors=True)

    def _make(self) -> None:
        import dask.array as da
        import xarray as xr
        from numcodecs import CRC32

        study = self.study
        kinds = {name: WORDS.get(name, "f8") for name in study.metrics}
        # One lazy chunk stands for the whole array, whatever its size; none of it is ever computed.
        empty = {
            name: da.full(study.shape, "" if name in WORDS else np.nan, chunks=-1, dtype=kind)
            for name, kind in kinds.items()
        }
        variables = {name: (study.names, array, attributes_of(name)) for name, array in empty.items()}
        checked = {"filters": [CRC32()]}
        encoding: dict[str, dict[str, Any]] = {name: {"chunks": self.blocks, **checked} for name in study.metrics}
        coordinates = study.coordinates()
        encoding |= dict.fromkeys(coordinates, checked)
        for name in UNITS:
            if name in encoding:
                encoding[name]["_FillValue"] = np.nan
        template = xr.Dataset(variables, coords=coordinates, attrs=study.attributes())
        _remove_leftovers(self.path)
        draft = _beside(self.path)
        try:
            draft.mkdir(parents=True)
            with FileLock(draft / LOCK), warnings.catch_warnings():  # locked, it is no leftover
                warnings.filterwarnings("ignore", "Object at", UserWarning)  # the lock is no part of the hierarchy
                template.to_zarr(draft, "a", compute=False, encoding=encoding, zarr_format=_FORMAT, consolidated=True)
                seal_metadata(draft)
            draft.rename(self.path)
        except OSError as error:
            if self.path.exists():
                return  # another process was quicker; whose study it is will be seen
            expected = f"a folder that can be written ({error.strerror or error})"
            raise StoreError("--out", str(self.path), expected, "--out study.zarr") from None
        finally:
            shutil.rmtree(draft, ignore_errors=True)

    def missing(self) -> Iterator[Block]:
        """The blocks not yet done, and those that are damaged, which is logged."""
        runs = self.read()
        for block in self.study.blocks(self.blocks):
            if not self.is_there(block):
                yield block
            elif not self._is_whole(block, runs):
                logger.warning("%s: block %s is damaged and is run again", self.path, self._number(block))
                yield block

    def damaged(self) -> list[str]:
        """The numbers of the blocks that are there, but are not what was written."""
        runs = self.read()
        there = [block for block in self.study.blocks(self.blocks) if self.is_there(block)]
        return [self._number(block) for block in there if not self._is_whole(block, runs)]

    def _number(self, block: Block) -> str:
        """The name of the files of a block."""
        return ".".join(str(part.start // size) for part, size in zip(block, self.blocks, strict=True))

    def is_there(self, block: Block) -> bool:
        """Whether the outcomes of a block were written, which are the last of it."""
        return (self.path / "outcome" / self._number(block)).exists()

    def _is_whole(self, block: Block, runs: xr.Dataset) -> bool:
        """Whether all of a block agrees with its checksums; a missing file would be read as empty cells."""
        number = self._number(block)
        if not all((self.path / name / number).exists() for name in self.study.metrics):
            return False
        try:
            columns = {name: runs[name][block].values for name in self.study.metrics}
        except Exception:  # whatever a codec makes of what it cannot read
            return False
        return not np.any(columns["outcome"] == "")

    def write(self, block: Block, columns: Mapping[str, np.ndarray]) -> None:
        """Write the measures of a block, its outcomes last. Raises OSError where the disk is full."""
        import zarr

        shape = tuple(part.stop - part.start for part in block)
        names = [*(name for name in self.study.metrics if name != "outcome"), "outcome"]
        # an empty chunk is written too: its presence marks the block as done
        with zarr.config.set({"array.write_empty_chunks": True}):
            group: Any = zarr.open_group(self.path, mode="r+", zarr_format=_FORMAT, use_consolidated=True)
            for name in names:
                group[name][block] = columns[name].astype(WORDS.get(name, "f8")).reshape(shape)

    @property
    def answers(self) -> Answers:
        """What a refined study keeps until it is done."""
        return Answers(self.path / ".answers")

    def annotate(self, attributes: Mapping[str, Any]) -> None:
        """Add attributes to the store."""
        seal_metadata(self.path, attributes)

    def read(self) -> xr.Dataset:
        """The store as a dataset whose values are read when they are looked at."""
        return read_store(self.path)


def read_store(path: str | os.PathLike[str]) -> xr.Dataset:
    """The study in the store at `path`, finished or not, as a dataset whose values are read when they are looked at.

    Raises StoreError if there is none, or its metadata or axes are damaged; RuntimeError where a damaged value is
    looked at.
    """
    import xarray as xr

    attributes = checked_metadata(Path(path))
    try:
        runs = xr.open_zarr(path, chunks=None, zarr_format=_FORMAT)
        runs.attrs = attributes
        return runs.assign_coords({name: axis.load() for name, axis in runs.coords.items()})
    except Exception:  # whatever a codec makes of what it cannot read
        expected = "a copy of the store, or the study run again under a new name, or with --overwrite"
        actual = "a store whose axes are damaged"
        raise StoreError("", actual, expected, "friso map STAGE.toml ... --out study.zarr", str(path)) from None


@dataclass(frozen=True)
class StoreState:
    """How many blocks a study has, how many of them are done, and the numbers of those that are damaged."""

    blocks: int
    done: int
    damaged: list[str]


def check_store(path: Path) -> StoreState:
    """Read all of the store at `path` and compare it with its checksums. Raises StoreError where its metadata or axes
    are damaged, or there is none."""
    study = study_of(read_store(path))
    store = Store(path, study)
    blocks = list(study.blocks(store.blocks))
    return StoreState(len(blocks), sum(map(store.is_there, blocks)), store.damaged())


def in_memory(runs: xr.Dataset) -> xr.Dataset:
    """The study of an opened store in memory, each text once: as stored, a status takes a hundred times the room."""
    words = [name for name in WORDS if name in runs]
    loaded = runs.drop_vars(words).load()
    return loaded.assign({name: (runs[name].dims, _shared(runs[name]), runs[name].attrs) for name in words})


def _shared(texts: xr.DataArray) -> np.ndarray:
    """The texts as objects, equal ones being one object."""
    import pandas as pd

    words_once: dict[str, str] = {}
    decoded = np.empty(texts.shape, dtype=object)
    rows = max(1, LARGEST_BLOCK // max(1, int(np.prod(texts.shape[1:]))))
    for first in range(0, texts.shape[0], rows):
        codes, words = pd.factorize(texts[first : first + rows].values.ravel())
        once = np.array([words_once.setdefault(str(word), str(word)) for word in words], dtype=object)
        decoded[first : first + rows] = once[codes].reshape(decoded[first : first + rows].shape)
    return decoded


def _beside(path: Path) -> Path:
    """A name that is free, for a store that is not there yet, or no more."""
    return path.with_name(f".{path.name}.{uuid.uuid4().hex}")


def _remove_leftovers(path: Path) -> None:
    """Remove drafts of this store that killed processes left: nobody holds their lock."""
    for draft in path.parent.glob(f".{path.name}.{'[0-9a-f]' * 32}"):
        try:
            with FileLock(draft / LOCK, blocking=False):
                shutil.rmtree(draft, ignore_errors=True)
        except (OSError, Timeout):  # it is being made
            continue


def _refuse_other(path: Path, study: Study) -> None:
    """Raises StoreError if the store holds another study than this."""
    with read_store(path) as dataset:
        differences = study.differences(study_of(dataset), dataset.attrs["equations"])
    if differences:
        text = "a store of another study:\n            " + "\n            ".join(differences)
        expected = "the same study to go on with, or another --out; nothing was overwritten"
        raise StoreError("", text, expected, origin=str(path))


def _warn_of_another_machine(path: Path) -> None:
    with read_store(path) as dataset:
        there = dataset.attrs["machine"]
    if there != machine():
        logger.warning("the store was begun on %s, here is %s: cells may differ in their last bits", there, machine())


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Keep other processes out. Raises StoreError if one is in."""
    lock = FileLock(path / LOCK)
    try:
        lock.acquire(timeout=0)
    except Timeout:
        raise StoreError(
            "", "a store that another friso is writing to", "to wait, or another --out", origin=str(path)
        ) from None
    except OSError as error:
        expected = f"a store that can be written to ({error.strerror})"
        raise StoreError("", "a store that cannot be written to", expected, origin=str(path)) from None
    try:
        yield
    finally:
        lock.release()
