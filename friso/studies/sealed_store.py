"""Give Zarr a store of studies whose metadata and chunks are checked as they are read.

The module imports zarr, which takes 0.4 s.
"""

from __future__ import annotations

import json
import re
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING

from zarr.storage import LocalStore, WrapperStore

from friso.errors import StoreError
from friso.platform.system import cause_of, shell_word
from friso.studies.metadata import Metadata
from friso.studies.metric import every_variable
from friso.studies.store_files import Ledger

if TYPE_CHECKING:
    from zarr.abc.buffer import Buffer
    from zarr.abc.store import ByteRequest
    from zarr.core.buffer import BufferPrototype


class SealedStore(WrapperStore[LocalStore]):
    """A store whose metadata come from `metadata`, whatever its files contain.

    Some versions of Zarr read the metadata files one by one, others the combined file. Chunks must be those recorded
    for completed blocks.
    """

    def __init__(self, store: LocalStore, metadata: Metadata) -> None:
        super().__init__(store)
        self.metadata, self.files = metadata, metadata.all_files
        self.ledger = Ledger(store.root, metadata.study, every_variable())

    @classmethod
    def at(cls, path: Path, metadata: Metadata) -> SealedStore:
        """Return the store in the folder `path`, for reading only."""
        return cls(LocalStore(path, read_only=True), metadata)

    def _with_store(self, store: LocalStore) -> SealedStore:
        return type(self)(store, self.metadata)

    def with_read_only(self, read_only: bool = False) -> SealedStore:
        """Return the store as a read-only or writable one.

        Zarr before 3.1.6 lacks this for such a store.
        """
        return self._with_store(self._store.with_read_only(read_only))

    async def get(self, key: str, prototype: BufferPrototype, byte_range: ByteRequest | None = None) -> Buffer | None:
        if key in self.files:
            return prototype.buffer.from_bytes(json.dumps(self.files[key]).encode())
        variable, _, number = key.partition("/")
        if variable not in self.ledger.metrics or not re.fullmatch(r"[0-9.]+", number):
            return await super().get(key, prototype, byte_range)
        try:
            digest = self.ledger.digest(number, variable)
            chunk = None if digest is None else await super().get(key, prototype, byte_range)
        except OSError as error:
            raise self._unread(variable, number, f"cannot be read ({cause_of(error)})") from None
        if digest != (None if chunk is None else sha256(chunk.to_bytes()).hexdigest()):
            raise self._unread(variable, number, "are not what was written")
        return chunk

    def _unread(self, variable: str, number: str, problem: str) -> StoreError:
        """Return the error for a chunk of a variable that is damaged or unreadable.

        `number` is the chunk's name in Zarr, and `problem` says what is wrong with it.
        """
        array, names = (self.files[f"{variable}/{name}"] for name in (".zarray", ".zattrs"))
        cells = ", ".join(
            f"{int(part) * size}:{min((int(part) + 1) * size, length)}"
            for part, size, length in zip(number.split("."), array["chunks"], array["shape"], strict=True)
        )
        actual = f"{variable}[{cells}] ({', '.join(names['_ARRAY_DIMENSIONS'])}), which {problem}"
        expected = "a copy of the store, or the study resumed, which runs damaged blocks again"
        path = str(self.ledger.path)
        return StoreError("", actual, expected, f"friso map {shell_word(path)}", path)
