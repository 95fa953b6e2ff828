"""Give Zarr a store of studies whose blocks are checked as they are read, and xarray its texts.

The module imports xarray and zarr, which takes a second.
"""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from xarray.backends import BackendArray
from xarray.core import indexing
from zarr import Array
from zarr.storage import LocalStore

from friso.errors import StoreError
from friso.platform.system import cause_of, shell_word
from friso.studies.metric import every_variable
from friso.studies.store_files import CHUNK, Records, stored

if TYPE_CHECKING:
    from zarr.abc.store import ByteRequest
    from zarr.core.buffer import Buffer, BufferPrototype


class CheckedStore(LocalStore):
    """A store for reading; `checksum` is the store's.

    Only regular files are read. Chunks of a block without a record are empty, and others must be as recorded.
    """

    def __init__(self, root: Path | str, *, read_only: bool = True, checksum: int = 0) -> None:
        super().__init__(root, read_only=read_only)
        self.records = Records(self.root, checksum)

    def with_read_only(self, read_only: bool = False) -> CheckedStore:
        """Return the same store as a read-only or writable one."""
        return type(self)(self.root, read_only=read_only, checksum=self.records.checksum)

    async def get(
        self, key: str, prototype: BufferPrototype | None = None, byte_range: ByteRequest | None = None
    ) -> Buffer | None:
        from zarr.core.buffer import default_buffer_prototype

        content = await asyncio.to_thread(self._content, key)
        return None if content is None else (prototype or default_buffer_prototype()).buffer.from_bytes(content)

    def _content(self, key: str) -> bytes | None:
        """Return the content of a file, or None if there is none. Raises StoreError for a damaged one."""
        name, _, chunk = key.rpartition("/")
        of_block = name in every_variable() and chunk.startswith(CHUNK)
        try:
            return self.records.chunk(name, chunk.removeprefix(CHUNK)) if of_block else stored(self.root / key)
        except FileNotFoundError:
            return None
        except OSError as error:
            problem = f"cannot be read ({cause_of(error)})"
        except ValueError:
            problem = "is not what was written"
        expected = "a copy of the store, or the study resumed, which runs damaged blocks again"
        path = str(self.root)
        raise StoreError("", f"a store whose {key} {problem}", expected, f"friso map {shell_word(path)}", path)


class Texts(BackendArray):
    """Texts of a store, read on access, as NumPy's of fixed length, to which everything can be cast."""

    def __init__(self, array: Array, form: str) -> None:
        self.array, self.shape, self.dtype = array, array.shape, np.dtype(form)

    def __getitem__(self, key: indexing.ExplicitIndexer) -> np.ndarray:
        return indexing.explicit_indexing_adapter(key, self.shape, indexing.IndexingSupport.BASIC, self._read)

    def _read(self, key: tuple[int | slice, ...]) -> np.ndarray:
        return np.asarray(self.array[key]).astype(self.dtype)
