"""Record the digests of the chunks of each block of a store, in a file per block.

The digests include the study, the block and the variable. So they detect exchanged chunks, unlike checksums inside the
chunks. The file of a block is written last: a block with a file is complete.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

from friso.studies.store_files import BLOCKS, digest_of, put, stored


@dataclass(frozen=True)
class Ledger:
    """The records of the blocks of a store at `path`: digests of their chunks.

    The records are for a `study`, by its digest, and its metrics.
    """

    path: Path
    study: str
    metrics: tuple[str, ...]

    def has(self, number: str) -> bool:
        """Tell whether a block, by its `number` as in Zarr, is recorded as written."""
        return self._file(number).exists()

    def entered(self) -> list[str]:
        """Return the numbers of the recorded blocks, as texts, sorted.

        Raises OSError if the folder of records cannot be read.
        """
        return [] if not self._file("").exists() else sorted(file.name for file in self._file("").iterdir())

    def enter(self, number: str) -> None:
        """Record a block after its chunks were written.

        Raises OSError if the record cannot be written.
        """
        self._file(number).parent.mkdir(exist_ok=True)
        put(self._file(number), self._entry(number))

    def is_whole(self, number: str) -> bool:
        """Tell whether a block is recorded, and all of its chunks are unchanged since then.

        Raises PermissionError if the record or a chunk cannot be read.
        """
        try:
            return stored(self._file(number)) == self._entry(number)
        except PermissionError:
            raise
        except OSError:
            return False

    def digest(self, number: str, name: str) -> str | None:
        """Return the recorded digest of a metric's chunk in a block.

        The result is None if the block was not recorded, and "" if the record is damaged or of another study. Raises
        PermissionError if the record cannot be read.
        """
        try:
            entry = json.loads(stored(self._file(number)))
            return entry["sha256"][name] if (entry["study"], entry["block"]) == (self.study, number) else ""
        except PermissionError:
            raise
        except FileNotFoundError:
            return None
        except (OSError, ValueError, LookupError, TypeError, RecursionError):
            return ""

    def _entry(self, number: str) -> bytes:
        digests = {name: digest_of(self.path / name / number) for name in self.metrics}
        return json.dumps({"study": self.study, "block": number, "sha256": digests}, indent=1).encode()

    def _file(self, number: str) -> Path:
        return self.path / BLOCKS / number
