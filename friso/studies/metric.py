"""Define metrics of a map: how a cell's value is computed, coloured and named.

A metric is an entry in the table of `metrics`, or a module of `metrics` named after it, which defines `METRIC`.
Installed packages name such modules in the entry points `friso.metrics`. Stores, columns of files, axis labels,
legends, sentences and `--metric` all follow from the metric.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from friso.registry import Registry

if TYPE_CHECKING:
    import numpy as np

    from friso.axis import AxisKind
    from friso.engine.batch import Runs
    from friso.hunting import Motions, StageAttractors
    from friso.hunting.measures import Measures

MetricBasis = Literal["run", "sketch", "survey"]
"""Basis of a metric: the run of a cell, a sketch of the attractors of its stage, or a full survey of them."""


@dataclass(frozen=True)
class RunEvidence:
    """Runs of cells: the keys of their stages with SI values, the runs, and their measures."""

    flat: Mapping[str, Any]
    runs: Runs
    measures: Measures


@dataclass(frozen=True)
class StageEvidence:
    """What is known of the stages of cells: keys with SI values, attractors and motions.

    The function `verdicts` runs further simulations, and returns a word for each stage.
    """

    flat: Mapping[str, Any]
    attracted: StageAttractors
    motions: Motions
    verdicts: Callable[[], np.ndarray]


@dataclass(frozen=True)
class Word:
    """A word that a cell of a map can have.

    The word has a colour (a name of the palette of maps, or "#rrggbb"), a meaning, and a label for legends if that is
    longer. Words that are verbs stand in the third person ("swings"), for sentences that count cells. With `is_open`,
    the word says that a cell's result is not certain: findings are stated of the other cells.
    """

    text: str
    colour: str
    meaning: str = ""
    label: str = ""
    is_open: bool = False


@dataclass(frozen=True)
class MapFinding:
    """A statement on a map: which fraction of its cells has one of the `words`, and where.

    For counts, the fraction is that of cells above 0. With `if_any` the statement is left out if no cell has the word.
    """

    clause: str
    words: tuple[str, ...] = ()
    if_any: bool = False


@dataclass(frozen=True)
class Metric:
    """A quantity or word that every cell of a map has.

    Parameters
    ----------
    title : str
        What axes, legends and tables call it.
    compute : callable
        Returns one entry per cell, from `RunEvidence` (source "run") or `StageEvidence`.
    source : str
        What it is computed from: the cell's run, or a sketch or full survey of what attracts its stage.
    unit : str
        SI unit of numbers, "1" of counts; "" of words.
    words : tuple of Word
        The words that a cell can have, the worst first; none for numbers.
    usual : bool
        Whether it is computed along with any other metric of its source, since that costs next to nothing.
    place : int
        Number that orders the variables of a study: lower numbers come first.
    criterion : str
        The criterion by which the value is decided, stored with the values.
    band : float, optional
        The deviation [m] that counts as at rest or settled, stored with the values.
    missing : str
        Why a cell that was run has no number.
    reasons : str
        Name of the metric whose words say why a cell has no number, computed beside this one.
    limits : tuple, optional
        Ends of the colour scale; from the data otherwise.
    counts : bool
        Whether the numbers are counts that say whether something occurs: 0 has the colour of rest.
    verdict : bool
        Whether the words are verdicts of `friso.hunting.criteria`: maps then show the edge of hunting.
    basis : str
        Words added to the verdict on the user's own stage, such as "by this sketch".
    findings : tuple of MapFinding
        Statements on a map about this metric; none: those of `answered_by`.
    doubt : tuple
        A word, and a sentence about the cells with this word, with {count} and {share} of the map.
    answered_by : str
        Name of the metric whose statements are used where this one has none.
    shown_as : str
        Name of the metric of the stage that a map shows if this metric of a run is asked for.
    tallied : bool
        Whether sentences and tables count the cells of every word.
    """

    title: str
    compute: Callable[[Any], np.ndarray]
    source: MetricBasis = "run"
    unit: str = ""
    words: tuple[Word, ...] = ()
    usual: bool = False
    place: int = 1000
    criterion: str = ""
    band: float | None = None
    missing: str = "no value"
    reasons: str = ""
    limits: tuple[float, float] | None = None
    counts: bool = False
    verdict: bool = False
    basis: str = ""
    findings: tuple[MapFinding, ...] = ()
    doubt: tuple[str, str] | None = None
    answered_by: str = "outcome"
    shown_as: str = ""
    tallied: bool = True

    @property
    def form(self) -> str:
        """Return the NumPy type in which the metric's values are stored.

        Words have room for "invalid" and all words of friso.
        """
        return f"<U{max(9, *(len(word.text) for word in self.words))}" if self.words else "f8"

    def attributes(self, kind: AxisKind) -> dict[str, Any]:
        """Return unit, band and criterion of the metric, as attributes of a study's variable.

        `kind` is the kind of axis of the stages.
        """
        attributes: dict[str, Any] = {} if self.words else {"units": kind.unit(self.unit)}
        attributes |= {} if self.band is None else {kind.suffix("band_m"): self.band}
        return attributes | ({"criterion": kind.text(self.criterion)} if self.criterion else {})


METRICS: Registry[Metric] = Registry("friso.studies.metrics", "METRIC", "friso.metrics", Metric, dashes=False)
"""All metrics of maps, by name."""

STATUS, STATUS_FORM = "status", "<U160"
"""Name and type of a study's variable with the status of every cell.

It is completed, or why not; longer texts are cut.
"""


def metrics() -> dict[str, Metric]:
    """Return all metrics by name, in the order in which studies hold them."""
    return dict(sorted(METRICS.items(), key=lambda item: item[1].place))


def usual_metrics() -> tuple[str, ...]:
    """Return the variables of every study: all measures of a run, and its status."""
    return *(name for name, metric in metrics().items() if metric.usual and metric.source == "run"), STATUS


def with_usual(metric: str) -> tuple[str, ...]:
    """Return the variables of a study for a map of one metric.

    All metrics that cost nothing beside it are included.
    """
    every = metrics()
    wanted = every[every[metric].shown_as or metric]
    along = [name for name, other in every.items() if other.usual and other.source in ("run", wanted.source)]
    return in_order((*along, metric))


def in_order(names: Iterable[str]) -> tuple[str, ...]:
    """Sort names of variables as studies hold them, without repetitions.

    Outcome, status and the reasons for missing numbers are added.
    """
    every, wanted = metrics(), {"outcome", STATUS, *names}
    wanted |= {every[name].reasons for name in wanted if name in every}
    return tuple(name for name in every_variable() if name in wanted)


def form_of(variable: str) -> str:
    """Return the NumPy type in which a variable is stored."""
    return STATUS_FORM if variable == STATUS else metrics()[variable].form


def every_variable() -> tuple[str, ...]:
    """Return all variables that a study may hold: the metrics, and the status."""
    return *metrics(), STATUS


def attributes_of(variable: str, kind: AxisKind) -> dict[str, Any]:
    """Return unit, band and criterion of a study's variable, as its attributes.

    `kind` is the kind of axis of the stages.
    """
    return {} if variable == STATUS else metrics()[variable].attributes(kind)


def is_text(variable: str) -> bool:
    """Tell whether a variable of a study holds texts."""
    return form_of(variable).startswith("<U")


def worded(verdicts: bool = False) -> list[str]:
    """Return the metrics with words; with `verdicts`, only the outcome and the verdicts."""
    every = metrics().items()
    return [name for name, one in every if one.words and (one.verdict or name == "outcome" or not verdicts)]
