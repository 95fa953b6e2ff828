"""The claims of the thesis and how they were judged: parts that hold or not, by a criterion stated in words."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Literal

from friso.stage import Stage
from friso_thesis.studies.thesis.studies import thesis_rig

if TYPE_CHECKING:
    import xarray as xr

    from friso_thesis.studies.thesis.experiments import Experiments
    from friso_thesis.studies.thesis.linear import Linear

ClaimJudgement = Literal["holds", "depends", "holds in part", "differs", "cannot be decided", "not yet covered"]
"""The judgement of a claim. "depends": it holds for some plausible values of what the thesis leaves open, and not for
others. "cannot be decided": it rests on what no simulation shows, or on a number beside its threshold."""


@dataclass(frozen=True)
class Claim:
    """One row of the table of claims: `text` is the claim in short, as it is judged."""

    id: str
    where: str
    text: str
    section: str
    quotes: tuple[str, ...]
    """Words of the thesis that state the claim."""
    listed: bool = True
    """Whether the project's first list of claims contains it; other claims were found later."""

    @property
    def place(self) -> tuple[int, ...]:
        """Return the section of the thesis with the claim, to sort by."""
        return tuple(int(number) for number in self.section.split("."))


@cache
def claims() -> tuple[Claim, ...]:
    """Return all claims of the thesis, in its order."""
    text = files("friso_thesis.studies.thesis").joinpath("claims.toml").read_text(encoding="utf-8")
    return tuple(Claim(**{**row, "quotes": tuple(row["quotes"])}) for row in tomllib.loads(text)["claim"])


@dataclass(frozen=True)
class Part:
    """One testable statement of a claim: the criterion in words, whether it is met, and the number found.

    `why` is the reason found where it is not met, in whole sentences, the first of which says the most. `printed` is a
    number that the thesis prints and `read` the same as friso finds it, both in the same unit, NaN where there is none.
    A `self_test` checks that friso finds what friso entered: it says nothing of the thesis, and counts for no
    judgement. A part that is `undecided` counts for none either; the text says why: no simulation can decide it, or
    the number lies beside its threshold within its error.
    """

    criterion: str
    holds: bool
    number: str
    why: str = ""
    printed: float = math.nan
    read: float = math.nan
    self_test: bool = False
    undecided: str = ""


BESIDE = "The number lies beside its threshold, within its error."
"""Reason for which a part is undecided."""


def beside(value: float, thresholds: Iterable[float], error: float) -> str:
    """Return `BESIDE` if a value lies within its error of one of the thresholds, else an empty text."""
    return BESIDE if any(abs(value - threshold) <= error for threshold in thresholds) else ""


@dataclass(frozen=True)
class FindingTable:
    """Numbers of a finding that a sentence would bury: columns, and rows of as many texts."""

    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Finding:
    """Result of judging a claim, with a table of numbers if there is one."""

    parts: tuple[Part, ...]
    table: FindingTable | None = None

    @property
    def stated(self) -> tuple[Part, ...]:
        """Return the parts that say something of the thesis."""
        return tuple(part for part in self.parts if not part.self_test)

    @property
    def pattern(self) -> tuple[bool | None, ...]:
        """Return which of the stated parts hold; None for those that are undecided."""
        return tuple(None if part.undecided else part.holds for part in self.stated)

    @property
    def judgement(self) -> ClaimJudgement:
        """ "holds" if all decided parts are met, "differs" if none is, else "holds in part";
        "cannot be decided" if no part is decided."""
        decided = [holds for holds in self.pattern if holds is not None]
        if not decided:
            return "cannot be decided"
        return "holds" if all(decided) else "holds in part" if any(decided) else "differs"


def number_text(value: float, form: str = ".3g", unit: str = "") -> str:
    """Return a number with its unit, or that there is none (NaN)."""
    return f"{value:{form}} {unit}".rstrip() if math.isfinite(value) else "none"


@dataclass(frozen=True)
class Response:
    """One run: `cell`, the scalars of a sweep (peaks, peak_to_peak [m], period [s], verdict); `trace`, its time
    response as `friso.simulate` gives it."""

    cell: xr.Dataset
    trace: xr.Dataset


@dataclass(frozen=True)
class Evidence:
    """Evidence that a judge may use.

    It has maps by study name, responses by name, the linear analysis of the rig, and its identification by experiments,
    each None if not made. It also has the rig itself.
    """

    maps: Mapping[str, xr.Dataset]
    responses: Mapping[str, Response]
    linear: Linear | None = None
    identified: Experiments | None = None
    rig: Stage = field(default_factory=thesis_rig)

    @property
    def analysis(self) -> Linear:
        """Return the linear analysis, for a judge that needs a part of it."""
        assert self.linear is not None
        return self.linear

    @property
    def experiments(self) -> Experiments:
        """Return the experiments, for a judge that needs one of them."""
        assert self.identified is not None
        return self.identified


Judge = Callable[[Evidence], Finding]


@dataclass(frozen=True)
class Registered:
    """A judge, the figure (or equation) that shows its evidence, and the names of the maps, responses, parts of the
    linear analysis and experiments that it needs; on what it hangs that no draw changes (`undrawn`); and whether it is
    about runs alone (`of_runs`), so that what attracts does not enter."""

    judge: Judge
    figure: str
    needs: frozenset[str]
    undrawn: str = ""
    of_runs: bool = False


_JUDGES: dict[str, Registered] = {}


def judges(
    claim: str, figure: str, needs: tuple[str, ...] = (), undrawn: str = "", of_runs: bool = False
) -> Callable[[Judge], Judge]:
    """Register the decorated function as judge of a claim; `undrawn` are assumed values that decide on it and are in no
    draw, and a claim `of_runs` is not judged by what attracts. Raises ValueError for an unknown or taken claim."""
    if claim not in {entry.id for entry in claims()}:
        raise ValueError(f"judge of {claim!r}: expected a claim of claims.toml, such as 'F11A'")
    if claim in _JUDGES:
        raise ValueError(f"judge of {claim!r}: the claim has one already, {_JUDGES[claim].judge.__qualname__}")

    def register(judge: Judge) -> Judge:
        _JUDGES[claim] = Registered(judge, figure, frozenset(needs), undrawn, of_runs)
        return judge

    return register


def registered() -> Mapping[str, Registered]:
    """Return the judges by claim, those that stand in `friso_thesis.studies.thesis.judges` and
    any registered later."""
    import friso_thesis.studies.thesis.judges  # noqa: F401 (registers them)

    return dict(_JUDGES)
