"""A store as Zarr reads it, with metadata that were checked. Imports zarr, which takes 0.4 s."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from zarr.storage import LocalStore, WrapperStore

if TYPE_CHECKING:
    from zarr.abc.buffer import Buffer
    from zarr.abc.store import ByteRequest
    from zarr.core.buffer import BufferPrototype


class SealedStore(WrapperStore[LocalStore]):
    """A store in whose `files` of metadata, by their names, stands what is told, whatever they say: some versions of
    Zarr read them one by one, others the one that holds them all."""

    def __init__(self, store: LocalStore, files: Mapping[str, Any]) -> None:
        super().__init__(store)
        self.files = files

    @classmethod
    def at(cls, path: Path, files: Mapping[str, Any]) -> SealedStore:
        """The store at `path`, to be read alone."""
        return cls(LocalStore(path, read_only=True), files)

    def _with_store(self, store: LocalStore) -> SealedStore:
        return type(self)(store, self.files)

    def with_read_only(self, read_only: bool = False) -> SealedStore:
        """The same store, for reading alone or not: Zarr before 3.1.6 has it for no store of this kind."""
        return self._with_store(self._store.with_read_only(read_only))

    async def get(self, key: str, prototype: BufferPrototype, byte_range: ByteRequest | None = None) -> Buffer | None:
        if key in self.files:
            return prototype.buffer.from_bytes(json.dumps(self.files[key]).encode())
        return await super().get(key, prototype, byte_range)
