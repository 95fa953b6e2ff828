"""Define the claims of the thesis and their judgement.

A claim consists of parts that hold or not, each by a criterion in words. A stage hunts by two criteria: the thesis's
count of peaks judges its claims, and whether a cycle attracts the stage is stated beside the judgement.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Literal

import numpy as np

from friso.hunting.criteria import COUNTED_ABOVE, FAILED, SWINGS
from friso.hunting.criteria import PEAK_CRITERION as PEAK_CRITERION
from friso.stage import Stage
from friso_thesis.studies.thesis.studies import thesis_rig

if TYPE_CHECKING:
    import xarray as xr

    from friso_thesis.studies.thesis.experiments import Experiments
    from friso_thesis.studies.thesis.linear import Linear

ClaimJudgement = Literal[
    "holds",
    "depends",
    "holds in part",
    "differs",
    "not decided enough",
    "not decided yet",
    "cannot be decided",
    "not yet covered",
]
"""Judgement of a claim. "depends": it holds for some plausible values of what the thesis leaves open, and not for
others. "not decided enough": too few draws of these values decide. "not decided yet": a number lies beside its
threshold, within its error, and more work would decide. "cannot be decided": no simulation shows it."""


@dataclass(frozen=True)
class Claim:
    """One row of the table of claims.

    `text` is the claim in short, in the words in which it is judged.
    """

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
        """Return the section of the thesis with the claim, for sorting."""
        return tuple(int(number) for number in self.section.split("."))


@cache
def claims() -> tuple[Claim, ...]:
    """Return all claims of the thesis, in its order."""
    text = files("friso_thesis.studies.thesis").joinpath("claims.toml").read_text(encoding="utf-8")
    return tuple(Claim(**{**row, "quotes": tuple(row["quotes"])}) for row in tomllib.loads(text)["claim"])


@dataclass(frozen=True)
class Part:
    """One testable statement of a claim: its criterion, whether it is met, and the number.

    `why` gives the reason if it is not met, in whole sentences, the most important first. `printed` is a number that
    the thesis prints and `read` the one that friso finds, both in the same unit, NaN without one. A `self_test` checks
    that friso finds what friso entered: it says nothing about the thesis, and counts for no judgement. A part
    `beyond` simulation counts for none either; the text says why. A part that is `undecided` could be decided, but was
    not: its text says that the number lies beside its threshold, within its error, or that there was nothing to
    compare.
    """

    criterion: str
    holds: bool
    number: str
    why: str = ""
    printed: float = math.nan
    read: float = math.nan
    self_test: bool = False
    beyond: str = ""
    undecided: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "holds", bool(self.holds))  # NumPy's is no bool of JSON, in which findings are kept

    @property
    def open(self) -> str:
        """Return why the criterion is not decided; "" if it is."""
        return self.beyond or self.undecided


BESIDE = "The number lies beside its threshold, within its error."
"""Reason for which a part is undecided."""


NOTHING_TO_COMPARE = "One of the two does not stick in both directions: there is nothing to compare."
"""Reason for which a comparison is undecided."""


def beside(value: float, thresholds: Iterable[float], error: float) -> str:
    """Return `BESIDE` if a value lies within its error of one of the thresholds, else ""."""
    return BESIDE if any(abs(value - threshold) <= error for threshold in thresholds) else ""


@dataclass(frozen=True)
class FindingTable:
    """Numbers of a finding that would fill a sentence: columns, and rows of as many texts."""

    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Finding:
    """What a judge finds on a claim: its parts, and a table of numbers if there is one."""

    parts: tuple[Part, ...]
    table: FindingTable | None = None

    @classmethod
    def of(cls, *parts: Part, table: FindingTable | None = None) -> Finding:
        """Return the finding of these parts."""
        return cls(parts, table)

    @property
    def stated(self) -> tuple[Part, ...]:
        """Return the criteria that say something about the thesis, without friso's tests of itself."""
        return tuple(part for part in self.parts if not part.self_test)

    @property
    def pattern(self) -> tuple[bool | None, ...]:
        """Return for each criterion about the thesis whether it is met; None if it is not decided."""
        return tuple(None if part.open else part.holds for part in self.stated)

    @property
    def judgement(self) -> ClaimJudgement:
        """Return the judgement that follows from the criteria of the claim, without those beyond simulation.

        The judgement is "holds" if all are met, "differs" if none is, and "holds in part" if some are met and some are
        not. If one that is undecided could turn "holds" or "differs", it is "not decided yet". If there are no criteria
        but those beyond simulation, it is "cannot be decided".
        """
        criteria = [part for part in self.stated if not part.beyond]
        decided = {part.holds for part in criteria if not part.undecided}
        if len(decided) == 2:
            return "holds in part"
        if not criteria:
            return "cannot be decided"
        if any(part.undecided for part in criteria):
            return "not decided yet"
        return "holds" if decided == {True} else "differs"


def number_text(value: float, form: str = ".3g", unit: str = "") -> str:
    """Return a number with its unit as text; "none" if it is NaN or infinite."""
    return f"{value:{form}} {unit}".rstrip() if math.isfinite(value) else "none"


@dataclass(frozen=True)
class Response:
    """One run.

    `cell` has the scalars of a sweep (peaks, peak_to_peak [m], period [s], verdict), and `trace` the time response as
    `friso.simulate` gives it.
    """

    cell: xr.Dataset
    trace: xr.Dataset


@dataclass(frozen=True)
class Evidence:
    """Evidence that a judge, a function that judges a claim, may use.

    Evidence has maps by study name, responses by name, the linear analysis of the rig, and its identification by
    experiments, each None if not made. The rig itself is included, too. `force_noise` is the noise of the drive's force
    over what rounding makes.
    """

    maps: Mapping[str, xr.Dataset]
    responses: Mapping[str, Response]
    linear: Linear | None = None
    identified: Experiments | None = None
    rig: Stage = field(default_factory=thesis_rig)
    force_noise: float = 1.0

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
    """A judge, which is a function that judges a claim, and what it needs.

    `figure` names the figure (or equation) that shows its evidence. `needs` has the names of maps, responses, parts of
    the linear analysis and experiments. `undrawn` names assumptions that decide on the claim but are in no draw of open
    values. If `of_runs` is true, the claim is about runs alone, so that attractors do not matter.
    """

    judge: Judge
    figure: str
    needs: frozenset[str]
    undrawn: str = ""
    of_runs: bool = False


_JUDGES: dict[str, Registered] = {}


def judges(
    claim: str, figure: str, needs: tuple[str, ...] = (), undrawn: str = "", of_runs: bool = False
) -> Callable[[Judge], Judge]:
    """Register the decorated function as judge of a claim.

    `figure` shows its evidence, and `needs` names the evidence. `undrawn` are assumed values that decide on the claim
    but are in no draw of open values. A claim `of_runs` is not judged by attractors. Raises ValueError for an unknown
    or taken claim.
    """
    if claim not in {entry.id for entry in claims()}:
        raise ValueError(f"judge of {claim!r}: expected a claim of claims.toml, such as 'F11A'")
    if claim in _JUDGES:
        raise ValueError(f"judge of {claim!r}: the claim has one already, {_JUDGES[claim].judge.__qualname__}")

    def register(judge: Judge) -> Judge:
        _JUDGES[claim] = Registered(judge, figure, frozenset(needs), undrawn, of_runs)
        return judge

    return register


def registered() -> Mapping[str, Registered]:
    """Return the judges, which are functions that judge a claim, by the name of the claim.

    Judges are declared in `friso_thesis.studies.thesis.judges`, or were registered later.
    """
    import friso_thesis.studies.thesis.judges  # noqa: F401 (registers them)

    return dict(_JUDGES)


COUNT, CYCLE = "the thesis's count", "an attracting cycle"
"""Names of the two criteria of hunting: counted peaks (plain `findpeaks`, Sec. 3.2.2), and an attracting cycle,
whatever the move."""


def by_peak_count(runs: xr.Dataset) -> xr.Dataset:
    """Return the runs with the numbers that judges read, by the thesis's peak count.

    `keeps_moving` tells whether a peak is counted, and `count` how many are. `size` is the final swing, peak to peak,
    divided by the height above which peaks count. `lasts` tells whether the run still swings at its end.
    """
    return runs.assign(
        keeps_moving=(runs["peaks"] > 0).assign_attrs(criterion=PEAK_CRITERION),
        count=runs["peaks"],
        size=runs["peak_to_peak"] / COUNTED_ABOVE,
        lasts=runs["outcome"] == SWINGS,
    )


def by_attraction(runs: xr.Dataset, attracts: np.ndarray, decided: np.ndarray, apart: np.ndarray) -> xr.Dataset:
    """Return the runs with the numbers that judges read, by what attracts each stage.

    The arrays have the runs' shape; uncertain cells are left out. A stage with an attractor also `lasts`. How often a
    cycle repeats in a run is known only if the move ended in it. `apart` are the distances of the cells from the curves
    on which cycles stop attracting, in cells; limits are interpolated by them.
    """
    moving = runs["keeps_moving"].copy(data=attracts & decided).assign_attrs(criterion="a cycle attracts the stage")
    outcome = runs["outcome"].where(runs["keeps_moving"].copy(data=decided) | (runs["outcome"] == "invalid"), FAILED)
    count = runs["peaks"].where(moving & (runs["peaks"] > 0)).where(moving, 0.0)
    size = runs["peaks"].copy(data=np.exp(np.where(attracts, apart, -apart)))
    return runs.assign(keeps_moving=moving, count=count, outcome=outcome, lasts=moving, size=size)


def by_way(evidence: Evidence, read: Callable[[xr.Dataset], xr.Dataset]) -> Evidence:
    """Return a copy of the evidence with `read` applied to its maps and responses.

    `read` computes the numbers that judges read by one of the two criteria.
    """
    responses = {name: Response(read(item.cell), item.trace) for name, item in evidence.responses.items()}
    return replace(evidence, maps={name: read(runs) for name, runs in evidence.maps.items()}, responses=responses)
