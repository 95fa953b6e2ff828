"""Findings of friso's own computations that take too long to repeat where they are stated.

`evidence.toml` keeps them. Each has the command that computes it again, the date, the revision of the equations, and a
digest of the code used. ``python -m benchmarks.evidence`` lists the entries, computes them again, and says which are
older than equations or code.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import date
from functools import cache
from importlib.resources import files


@dataclass(frozen=True)
class Entry:
    """A finding: its subject, its values, and the command that computes them.

    `about` says what it is. `values` are numbers by name, with the unit as suffix, and `command` computes them.
    `computed` is the day, and `equations` the revision of the equations, in `evidence.toml`, that was used. The finding
    also `rests_on` modules for criteria, methods and experiments, given as paths from the package friso. `code` is
    their digest (`benchmarks.code_digest`); it is empty if the finding is older than digests. `stated` has, for each
    document, the phrases that state the finding. `note` says where the values come from if the command did not write
    them itself.
    """

    name: str
    about: str
    values: Mapping[str, float]
    command: str
    computed: date
    equations: int
    rests_on: tuple[str, ...] = ()
    code: str = ""
    stated: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    note: str = ""

    @property
    def day(self) -> str:
        """Return the day of the computation, as documents write it."""
        return f"{self.computed.day} {self.computed:%B %Y}"


@dataclass(frozen=True)
class Equations:
    """A revision of the equations: its number, its day, and reference numbers.

    The reference numbers (`benchmarks.canonical`), by stage and output [SI], differ from those of other revisions.
    """

    revision: int
    since: date
    numbers: Mapping[str, Mapping[str, list[float]]]


@cache
def findings_on_file() -> Mapping[str, Entry]:
    """Return all findings on file by name."""
    return {name: _entry(name, row) for name, row in _file()["finding"].items()}


@cache
def equations() -> Equations:
    """Return the latest revision of the equations on file."""
    row = _file()["equations"]
    return Equations(row["revision"], row["since"], row["numbers"])


def value(entry: str, name: str) -> float:
    """Return one number of a finding [SI, or as its unit says].

    Raises KeyError for one that is not on file.
    """
    return findings_on_file()[entry].values[name]


def _entry(name: str, row: dict) -> Entry:
    stated = {document: tuple(phrases) for document, phrases in row.pop("stated", {}).items()}
    return Entry(name=name, stated=stated, rests_on=tuple(row.pop("rests_on", ())), **row)


def _file() -> dict:
    return tomllib.loads(files("friso").joinpath("evidence.toml").read_text(encoding="utf-8"))
