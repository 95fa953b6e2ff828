"""A study on disk: a Zarr store that is written block by block and resumed where it was left.

The store is made whole, without results, under another name and then moved into place; a block's outcomes are
written after its other variables, and Zarr moves each file into place. So a block whose outcomes are there is done,
whenever the process was killed.
"""

from __future__ import annotations

import logging
import os
import shutil
import uuid
import warnings
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from filelock import FileLock, Timeout

from friso.engine.cache import machine
from friso.errors import StoreError
from friso.studies.cells import UNITS, WORDS, Columns, attributes_of
from friso.studies.refine import Ask
from friso.studies.study import Block, Study, study_of

if TYPE_CHECKING:
    import xarray as xr

LEAST_BLOCKS, BLOCK, BLOCKS, LARGEST_BLOCK = 8, 1024, 250, 16384
"""A study has at least `LEAST_BLOCKS` blocks, so that an interruption loses a part of it only; `BLOCK` cells in each,
more from `BLOCKS` blocks on, so that writing does not hold up the workers, and `LARGEST_BLOCK` at most. A store has
the same blocks on every machine."""

logger = logging.getLogger("friso")

_ANSWERS = ".answers"

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
    def opened(cls, path: Path, study: Study) -> Iterator[Store]:
        """The store of a study, made if it is not there.

        Raises StoreError if the folder holds anything else, another study, or is in use by another process.
        """
        store = cls(path, study)
        if not path.exists() or (path.is_dir() and not any(path.iterdir())):
            store._make()
        _refuse_foreign(path)
        with _locked(path):
            _refuse_other(path, study)
            _warn_of_another_machine(path)
            for leftover in path.rglob("*.partial"):  # of a file that was being written when its process was killed
                leftover.unlink(missing_ok=True)
            yield store

    def _make(self) -> None:
        import dask.array as da
        import xarray as xr

        study = self.study
        kinds = {name: WORDS.get(name, "f8") for name in study.metrics}
        # One lazy chunk stands for the whole array, whatever its size; none of it is ever computed.
        empty = {
            name: da.full(study.shape, "" if name in WORDS else np.nan, chunks=-1, dtype=kind)
            for name, kind in kinds.items()
        }
        variables = {name: (study.names, array, attributes_of(name)) for name, array in empty.items()}
        encoding: dict[str, dict[str, Any]] = {name: {"chunks": self.blocks} for name in study.metrics}
        for name in UNITS:
            if name in encoding:
                encoding[name]["_FillValue"] = np.nan
        template = xr.Dataset(variables, coords=study.coordinates(), attrs=study.attributes())
        draft = self.path.with_name(f".{self.path.name}.{uuid.uuid4().hex}")
        try:
            template.to_zarr(draft, compute=False, encoding=encoding, zarr_format=_FORMAT, consolidated=True)
            draft.rename(self.path)
        except OSError as error:
            if self.path.exists():
                return  # another process was quicker; whose study it is will be seen
            expected = f"a folder that can be written ({error.strerror or error})"
            raise StoreError("--out", str(self.path), expected, "--out study.zarr") from None
        finally:
            shutil.rmtree(draft, ignore_errors=True)

    def missing(self) -> Iterator[Block]:
        """The blocks not yet done."""
        outcomes = self.read()["outcome"]
        for block in self.study.blocks(self.blocks):
            if not self._is_done(block, outcomes):
                yield block

    def _is_done(self, block: Block, outcomes: xr.DataArray) -> bool:
        """Whether all files of a block are there and its outcomes can be read; a power cut may take either."""
        number = ".".join(str(part.start // size) for part, size in zip(block, self.blocks, strict=True))
        if not all((self.path / name / number).exists() for name in self.study.metrics):
            return False
        try:
            return not np.any(outcomes[block].values == "")
        except (OSError, RuntimeError, ValueError):
            return False

    def write(self, block: Block, columns: Mapping[str, np.ndarray]) -> None:
        """Write the measures of a block, its outcomes last. Raises OSError where the disk is full."""
        shape = tuple(part.stop - part.start for part in block)
        region = dict(zip(self.study.names, block, strict=True))
        self._write([name for name in self.study.metrics if name != "outcome"], columns, shape, region)
        self._write(["outcome"], columns, shape, region)

    def _write(
        self, names: list[str], columns: Mapping[str, np.ndarray], shape: tuple[int, ...], region: dict[str, slice]
    ) -> None:
        import xarray as xr

        arrays = {name: columns[name].astype(WORDS.get(name, "f8")).reshape(shape) for name in names}
        part = xr.Dataset({name: (self.study.names, array) for name, array in arrays.items()})
        # an empty chunk is written too: its presence marks the block as done
        part.to_zarr(self.path, region=region, zarr_format=_FORMAT, consolidated=True, write_empty_chunks=True)

    def keeping(self, ask: Ask) -> Ask:
        """`ask` with its answers kept in the store: asked the same questions again, they need no runs."""
        folder = self.path / _ANSWERS
        folder.mkdir(exist_ok=True)
        number = count()

        def answer(cells: np.ndarray) -> Columns:
            file = folder / f"{next(number)}.npz"
            if (stored := _answer(file, cells)) is not None:
                return stored
            columns = ask(cells)
            draft = file.with_suffix(".partial")
            with draft.open("wb") as stream:
                arrays: dict[str, Any] = {name: columns[name].astype(WORDS.get(name, "f8")) for name in columns}
                np.savez_compressed(stream, cells=cells, **arrays)
            draft.rename(file)
            return columns

        return answer

    def forget_answers(self) -> None:
        """Remove what `keeping` kept: the blocks hold it by now."""
        shutil.rmtree(self.path / _ANSWERS, ignore_errors=True)

    def annotate(self, attributes: Mapping[str, Any]) -> None:
        """Add attributes to the store."""
        import zarr

        group = zarr.open_group(self.path, mode="r+", zarr_format=_FORMAT)
        group.attrs.update(dict(attributes))
        with warnings.catch_warnings():  # about the lock, which is no part of the Zarr hierarchy
            warnings.filterwarnings("ignore", "Object at", UserWarning)
            zarr.consolidate_metadata(group.store, zarr_format=_FORMAT)

    def read(self) -> xr.Dataset:
        """The store as a dataset whose values are read when they are looked at."""
        return read_store(self.path)


def read_store(path: str | os.PathLike[str]) -> xr.Dataset:
    """The study in the store at `path`, finished or not, as a dataset whose values are read when they are looked at.

    Raises StoreError if there is none.
    """
    import xarray as xr

    _refuse_foreign(Path(path))
    return xr.open_zarr(path, chunks=None, zarr_format=_FORMAT)


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


def _answer(file: Path, cells: np.ndarray) -> Columns | None:
    """What was kept about just these cells, None if nothing."""
    try:
        with np.load(file) as stored:
            answer = dict(stored)
    except (OSError, ValueError, zipfile.BadZipFile):
        return None
    return answer if np.array_equal(answer.pop("cells"), cells) else None


def _refuse_foreign(path: Path) -> None:
    """Raises StoreError for anything but a store that friso has made."""
    import xarray as xr

    expected = "a store made by friso map, or a new name"
    if not path.exists():
        raise StoreError("", "nothing there", expected, "friso map STAGE.toml ... --out study.zarr", str(path))
    try:
        with xr.open_zarr(path, chunks=None, zarr_format=_FORMAT) as dataset:
            if "equations" in dataset.attrs and "outcome" in dataset:
                return
            old = "equations" in dataset.attrs and "verdict" in dataset
    except (OSError, ValueError, KeyError):
        old = False
    if old:
        actual = "a store of an earlier friso, whose verdicts are by the peak count of the runs"
        expected = "a store that tells what the runs did (outcome): run the study again under a new name"
        raise StoreError("", actual, expected, "friso map STAGE.toml ... --out study.zarr", str(path))
    actual = "a folder with other things in it" if path.is_dir() else "a file"
    raise StoreError("", f"{actual}; nothing was overwritten", expected, "--out study.zarr", str(path))


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
    lock = FileLock(path / ".friso.lock")
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
