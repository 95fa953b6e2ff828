"""Define metrics of a map: how a cell's value is computed, coloured and named.

Each metric is a module of `metrics`. Such a module has `METRIC` and the name of the metric; installed packages name
theirs in the entry points `friso.metrics`. Stores, columns of files, axis labels, legends, sentences and `--metric` all
follow from it.
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
    """Runs of cells: the flat keys of their stages, the simulated runs, and their measures."""

    flat: Mapping[str, Any]
    runs: Runs
    measures: Measures


@dataclass(frozen=True)
class StageEvidence:
    """Evidence on the stages of cells: flat keys, attractors and motions.

    The function `verdicts` runs further simulations, and returns a word for each stage.
    """

    flat: Mapping[str, Any]
    attracted: StageAttractors
    motions: Motions
    verdicts: Callable[[], np.ndarray]


@dataclass(frozen=True)
class Word:
    """A word that a cell can have.

    It has a colour (a name of the palette of maps, or "#rrggbb"), a meaning, and a label in legends if that is longer.
    A paler colour marks cells whose word was inferred. Words that are verbs stand in the third person ("swings"), for
    sentences that count cells.
    """

    text: str
    colour: str
    meaning: str = ""
    label: str = ""
    inferred: str = ""


@dataclass(frozen=True)
class MapFinding:
    """A statement on a map: which fraction of cells has one of the `words`, and where they lie.

    For counts, it is the fraction of cells above 0. With `if_any` the statement is left out if no cell has the word.
    """

    clause: str
    words: tuple[str, ...] = ()
    if_any: bool = False


@dataclass(frozen=True)
class Metric:
    """A quantity or word of every cell of a map.

    Parameters
    ----------
    title : str
        What axes, legends and tables call it.
    compute : callable
        Returns one entry per cell, from `RunEvidence` (source "run") or `StageEvidence`.
    source : str
        What it is computed from.
    unit : str
        SI unit of numbers, "1" of counts; "" of words.
    words : tuple of Word
        The words that a cell can have, the worst first; none for numbers.
    usual : bool
        Whether it is computed along with every other metric of its source, since that costs next to nothing.
    place : int
        Its place among the variables of a study: lower numbers come first.
    criterion : str
        The criterion by which it decides, stored with the numbers.
    band : float, optional
        The deviation [m] that it looks at, stored with the numbers.
    missing : str
        Why a cell that was run has no number.
    reasons : str
        The metric whose words say why a cell has no number, computed beside this one.
    limits : tuple, optional
        Ends of the colour scale; from the data otherwise.
    counts : bool
        Whether the numbers are counts that say whether something occurs: 0 has the colour of rest.
    verdict : bool
        Whether the words are verdicts of `friso.hunting.criteria`: maps then show the edge of hunting.
    basis : str
        What the verdict on the user's own stage is qualified by.
    findings : tuple of MapFinding
        What the sentences on a map state; none: those of `answered_by`.
    doubt : tuple
        A word, and a sentence about its cells, with {count} and {share} of the map.
    answered_by : str
        The metric whose findings are stated where this one has none.
    shown_as : str
        The metric of the stage that a map shows where this one of a run is asked for.
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
        """Return the NumPy type in which the metric is stored.

        Words have room for "invalid" and all words of friso.
        """
        return f"<U{max(9, *(len(word.text) for word in self.words))}" if self.words else "f8"

    def attributes(self, kind: AxisKind) -> dict[str, Any]:
        """Return the attributes of the metric's variable, for stages with that kind of axis."""
        attributes: dict[str, Any] = {} if self.words else {"units": kind.unit(self.unit)}
        attributes |= {} if self.band is None else {kind.suffix("band_m"): self.band}
        return attributes | ({"criterion": kind.text(self.criterion)} if self.criterion else {})


METRICS: Registry[Metric] = Registry("friso.studies.metrics", "METRIC", "friso.metrics", Metric, dashes=False)
"""All metrics, by name."""

STATUS, STATUS_FORM = "status", "<U160"
"""Name and type of the variable with the status of every cell: completed, or why not; longer texts are cut."""


def metrics() -> dict[str, Metric]:
    """Return all metrics by name, in the order in which studies hold them."""
    return dict(sorted(METRICS.items(), key=lambda item: item[1].place))


def usual_metrics() -> tuple[str, ...]:
    """Return the variables of every study: all measures of a run, and its status."""
    return *(name for name, metric in metrics().items() if metric.usual and metric.source == "run"), STATUS


def with_usual(metric: str) -> tuple[str, ...]:
    """Return the variables of a study for a map of a metric.

    All metrics that cost nothing beside it are included.
    """
    every = metrics()
    wanted = every[every[metric].shown_as or metric]
    along = [name for name, other in every.items() if other.usual and other.source in ("run", wanted.source)]
    return in_order((*along, metric))


def in_order(names: Iterable[str]) -> tuple[str, ...]:
    """Sort variables as studies hold them.

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
    """Return the attributes of a variable of a study, for stages with that kind of axis."""
    return {} if variable == STATUS else metrics()[variable].attributes(kind)


def is_text(variable: str) -> bool:
    """Tell whether a variable of a study holds texts."""
    return form_of(variable).startswith("<U")


def worded(verdicts: bool = False) -> list[str]:
    """List the metrics with words; with `verdicts`, only the outcome and the verdicts."""
    every = metrics().items()
    return [name for name, one in every if one.words and (one.verdict or name == "outcome" or not verdicts)]
