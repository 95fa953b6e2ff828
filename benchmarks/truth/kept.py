"""Keep attacks in a file, a line of JSON each, so that later runs continue."""

import json
import os
from collections.abc import Iterable
from dataclasses import dataclass, field
from datetime import date
from functools import cache
from pathlib import Path
from typing import Any

from benchmarks.code_digest import code_digest

CHECKED = ("stage", "equations", "engine", "hunting")
"""Folders of friso that determine the answers of a check."""

ATTACKING = ("attack", "../by_hand", "claims", "cycles", "draws", "refute", "second_opinion", "swings", "trials")
"""Modules of this adversary that determine its own answers."""

Record = dict[str, Any]
Key = tuple[str, int, int]
"""Series, seed and number of a stage."""


@cache
def code_version() -> str:
    """Return the code version of attacks: digests of friso's code and of the adversary's.

    Comments and words are left out.
    """
    own = [str((Path(__file__).parent / f"{name}.py").resolve()) for name in ATTACKING]
    return f"{code_digest(CHECKED)}-{code_digest(own)}"


@dataclass
class KeptAttacks:
    """The attacks in a file, one for each stage.

    It is the last attack by the present code, or else by any other. Unreadable lines stay, and `damaged` holds their
    numbers.
    """

    file: Path
    records: dict[Key, Record] = field(default_factory=dict)
    damaged: list[int] = field(default_factory=list)

    def __post_init__(self) -> None:
        lines = self.file.read_bytes().splitlines() if self.file.exists() else []
        for number, line in enumerate(lines, 1):
            try:
                self._take(json.loads(line))
            except (ValueError, TypeError, KeyError):
                self.damaged.append(number)

    def _take(self, record: Record) -> None:
        key = (record["series"], record["seed"], record["number"])
        if is_current(record) or key not in self.records or not is_current(self.records[key]):
            self.records[key] = record

    def add(self, record: Record) -> Record:
        """Append an attack to the file, with code version and day; it is on disk on return."""
        record = dated(record)
        self.file.parent.mkdir(parents=True, exist_ok=True)
        with self.file.open("ab+", buffering=0) as stream:
            stream.seek(max(stream.seek(0, os.SEEK_END) - 1, 0))
            end = b"\n" if stream.read(1) not in (b"", b"\n") else b""  # after a line that was cut off
            stream.write(end + json.dumps(record).encode() + b"\n")
            os.fsync(stream.fileno())
        self._take(record)
        return record

    def of(self, series: str, seed: int, numbers: Iterable[int]) -> list[Record]:
        """Return the attacks on numbered stages."""
        keys = [(series, seed, number) for number in numbers]
        return [self.records[key] for key in keys if key in self.records]


def dated(record: Record) -> Record:
    """Return a record with the version of the present code and the day."""
    return record | {"code": code_version(), "day": date.today().isoformat()}


def is_current(record: Record) -> bool:
    """Tell whether an attack was made with the present code."""
    return record["code"] == code_version()
