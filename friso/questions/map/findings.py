"""A map in sentences: what share of it swings or hunts and where, how far that can be trusted, what words mean."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from friso.axis import axis_shown
from friso.hunting.criteria import ATTRACTED, BAND, CREEPS, LASTING, RESTS, SWINGS
from friso.quantities import percent
from friso.questions.map.cells import SAMPLE, CellAxis, axes_of, dims_of
from friso.questions.map.words import (
    AT_ONCE,
    CATEGORIES,
    INVALID,
    NOT_RUN,
    failures,
    grouped,
    in_sentence,
    tally,
    text_counts,
    word_counts,
)
from friso.shares import share_interval
from friso.shown.drawing.prefixes import listed, percentage
from friso.shown.loop_words import unstable_loop
from friso.studies.cells import CYCLE, CYCLE_UNITS, SKETCH, SWING, UNKNOWN, VERDICTS
from friso.studies.scalings import SCALINGS

if TYPE_CHECKING:
    import xarray as xr

    from friso.stage import Stage
    from friso.studies.study import Study

_OF_VERDICTS = {
    "hunts": "a cycle of the stage attracts, and the motion of the stage file ends in it",
    "bistable": "a cycle attracts, but this motion comes to rest; a kick or another move can start hunting",
    "transient": "no cycle attracts, but this motion is not at rest by its end",
    "settles": "no cycle attracts, and this motion comes to rest",
}
MEANINGS = {
    "outcome": {
        SWINGS: f"the run still swings at its end: periodically, more than {2e6 * BAND:g} µm peak to peak in the last "
        f"quarter, by at least {percent(LASTING)} of what it swings in the last half",
        CREEPS: f"the run ends more than {1e6 * BAND:g} µm off its reference without swinging: it drifts, sticks or "
        "decays",
        RESTS: f"the run comes to rest within {1e6 * BAND:g} µm of its reference",
    },
    **dict.fromkeys(VERDICTS, _OF_VERDICTS),
}
"""What the words of a map mean, by variable."""

_NO_RESULT = {"failed": "the run was not completed", "invalid": "these values are not a valid stage"}

PEAKS = ("peaks", "distinct_peaks")


@dataclass(frozen=True)
class MapFinding:
    """What a map is asked first: in which cells the `variable` has one of the `words` (of counts: is more than 0), and
    the subject and verb of the answer."""

    variable: str
    clause: str
    words: tuple[str, ...] = ()

    def holds(self, values: np.ndarray) -> np.ndarray:
        """Where it does."""
        if self.variable in PEAKS:
            return values.astype(float) > 0
        return np.isin(values.astype(str), self.words)


_HUNTS = MapFinding("verdict", "The stage hunts", ("hunts",))
_BISTABLE = MapFinding("verdict", "It is bistable (a kick or another move can start hunting)", ("bistable",))
_QUIET = ("transient", "settles")
_ATTRACTS = MapFinding("attractor", "A lasting swing attracts the stage", (CYCLE, SWING))
_SWINGS = MapFinding("outcome", "The run swings at its end", (SWINGS,))


def headline(runs: xr.Dataset, metric: str) -> str:
    """What share of the map swings (of a map of verdicts: hunts, or is bistable; of counts: has counted peaks; of
    measures of what attracts: has a swing that attracts), and where: the ranges of the axes outside of which no cell
    does. Empty where the runs do not say."""
    if metric in VERDICTS and metric in runs:
        bistable = [_BISTABLE] if text_counts(runs, metric).get("bistable") else []
        return " ".join(_answer(runs, replace(question, variable=metric)) for question in [_HUNTS, *bistable])
    if metric in CYCLE_UNITS and "attractor" in runs:
        unknown = text_counts(runs, "attractor").get(UNKNOWN, 0)
        doubt = f"In {grouped(unknown)} of the cells it is not certain what attracts." if unknown else ""
        return " ".join(filter(None, (_answer(runs, _ATTRACTS), doubt)))
    if metric in PEAKS and metric in runs:
        return _answer(runs, MapFinding(metric, "Peaks are counted"))
    return " ".join([_answer(runs, _SWINGS), *_creeping(runs)]) if "outcome" in runs else ""


def _creeping(runs: xr.Dataset) -> list[str]:
    """What it means that runs creep: the next breakaway may come after their end."""
    creeping = text_counts(runs, "outcome").get(CREEPS, 0)
    if not creeping:
        return []
    where = f"in {_percent(creeping, runs['outcome'].size)} of the map"
    shows = "a longer run, or the verdict of every cell (--metric sketch), shows whether it hunts there"
    return [f"It still creeps at its end {where}: {shows}."]


def _answer(runs: xr.Dataset, question: MapFinding) -> str:
    """In what share of the map it holds, and where."""
    holds, completed = _flags(runs, question)
    if not completed.any():
        return "No cell of the map has a result."
    if not holds.any() or np.array_equal(holds, completed):
        return f"{question.clause} in {'every' if holds.any() else 'no'} cell of the map."
    share = f"{question.clause} in {_percent(holds.sum(), completed.sum())} of the map"
    axes, inside = axes_of(runs), completed.copy()
    where = []
    for k, axis in enumerate(axes):
        dim = dims_of(runs).index(SAMPLE) if SAMPLE in runs.dims else k
        line = np.asarray(holds.any(axis=tuple(other for other in range(holds.ndim) if other != dim)))
        box = _box(axis, line[axis.places])
        where += [_range(axis, box)] if not box.all() else []
        along = np.zeros(len(line), bool)
        along[axis.places] = box
        inside &= along.reshape([-1 if other == dim else 1 for other in range(holds.ndim)])
    if not where:
        return f"{share}, over the whole range of {'the axis' if len(axes) == 1 else 'every axis'}."
    part = f"{_percent(holds.sum(), inside.sum())} of the cells in that range"
    filled = "all cells in that range" if np.array_equal(inside, holds) else part
    return f"{share}: at {listed(where, 'and')} ({filled})."


def _flags(runs: xr.Dataset, question: MapFinding) -> tuple[np.ndarray, np.ndarray]:
    """Where it holds, and where runs have a result, both of the shape of the runs: a large store is read in parts."""
    values = runs[question.variable]
    holds, completed = np.zeros(values.shape, bool), np.zeros(values.shape, bool)
    rows = max(1, AT_ONCE // max(1, int(np.prod(values.shape[1:]))))
    for first in range(0, len(values), rows):
        part = np.asarray(values[first : first + rows].values)
        ran = (
            np.isfinite(part) if question.variable in PEAKS else ~np.isin(part.astype(str), ["", *_NO_RESULT, UNKNOWN])
        )
        completed[first : first + rows] = ran
        holds[first : first + rows] = ran & question.holds(part)
    return holds, completed


def _box(axis: CellAxis, cells: np.ndarray) -> np.ndarray:
    """Which positions of an axis lie between the first and the last at which it holds (of words: at which it does)."""
    held = axis.positions[cells]
    if axis.words:
        return np.isin(axis.positions, held)
    return (axis.positions >= held.min()) & (axis.positions <= held.max())


def _range(axis: CellAxis, box: np.ndarray) -> str:
    """The positions of a box along an axis in words."""
    name, inside = in_sentence(axis.key), axis.positions[box]
    if axis.words:
        return f"{name} {listed([axis.words[int(k)] for k in np.unique(inside)], 'or')}"
    low, high = (axis.value(int(np.flatnonzero(axis.positions == end)[0])) for end in (inside.min(), inside.max()))
    if inside.min() == inside.max():
        return f"{name} {low}"
    if inside.min() == axis.positions.min():
        return f"{name} up to {high}"
    return f"{name} from {low}" if inside.max() == axis.positions.max() else f"{name} from {low} to {high}"


def _percent(part: int, total: int) -> str:
    """A share, which looks like 0 or 100 % only where it is."""
    share = 100 * part / total
    if 1 <= share <= 99:
        return f"{share:.0f} %"
    return f"{share:.2g} %" if share < 1 else f"{np.floor(share * 10) / 10:g} %"


def verification(runs: xr.Dataset) -> str:
    """How many of the outcomes checked survive a tighter tolerance, with its 95 % interval (Clopper, Pearson)."""
    checked = int(runs.attrs.get("verified_cells", 0))
    if not checked:
        return "Not verified: no outcome was checked at a tighter tolerance."
    surviving = int(runs.attrs["verified_surviving"])
    low, high = share_interval(surviving, checked)
    rtol = float(runs.attrs["verified_rtol"])
    text = (
        f"{percent(surviving / checked, 3)} of {grouped(checked)} outcomes are the same at rtol {rtol:g} "
        f"(95 % confidence: {percentage(low)} to {percentage(high)} %)."
    )
    if inferred := int(runs.attrs.get("inferred_checked", 0)):
        confirmed = int(runs.attrs["inferred_confirmed"])
        text += f" Of {grouped(inferred)} inferred outcomes {percent(confirmed / inferred, 3)} are confirmed by a run."
    return text


def statement(runs: xr.Dataset, metric: str) -> str:
    """What stands on every figure of a map: what it says first, its verification, its tolerance and number of runs."""
    caveat = " ".join(caveats(runs, metric))
    return "\n".join(text for text in (headline(runs, metric), verification(runs), _extent(runs), caveat) if text)


def meanings(runs: xr.Dataset) -> list[tuple[str, str]]:
    """What the words mean that stand in a map."""
    return [
        (word, axis_shown().text(text))
        for name, texts in MEANINGS.items()
        for word in word_counts(runs, name)
        if (text := (texts | _NO_RESULT).get(word))
    ]


def caveats(runs: xr.Dataset, metric: str) -> list[str]:
    """Where the peak count, if a map shows it, says something else than the end of the run."""
    if metric not in PEAKS or not {metric, "outcome"} <= set(runs.data_vars):
        return []
    counted, outcome = runs[metric].values > 0, runs["outcome"].values
    over, missed = (
        int((counted & (outcome == RESTS)).sum()),
        int(((runs[metric].values == 0) & (outcome == SWINGS)).sum()),
    )
    over_text = [f"In {grouped(over)} of the cells with counted peaks the run rests at its end."] if over else []
    return over_text + ([f"In {grouped(missed)} of the cells without any the run swings."] if missed else [])


def _extent(runs: xr.Dataset) -> str:
    cells = int(np.prod(list(runs.sizes.values())))
    status = text_counts(runs, "status")
    inferred = sum(number for reason, number in status.items() if reason.startswith("inferred"))
    words = word_counts(runs, "outcome")
    idle = sum(words.get(category.label, 0) for category in (INVALID, NOT_RUN))
    text = f"{grouped(cells - idle - inferred)} runs at rtol {float(runs.attrs['rtol']):g}"
    if inferred:
        text += f", {grouped(inferred)} cells inferred from their neighbours"
    listing = "; ".join(filter(None, (tally(runs, name) for name in CATEGORIES)))
    return f"{text}: {listing}." if listing else f"{text}."


def sentences(runs: xr.Dataset, study: Study, metric: str) -> list[str]:
    """All that is said on the terminal: first whether the loop is unstable, then what share of the map swings, and
    where."""
    words = "; ".join(filter(None, (tally(runs, name) for name in CATEGORIES)))
    size = " x ".join(map(str, study.shape))
    reasons = [f"{count} cells without a result: {reason}" for reason, count in failures(runs).items()]
    extent = f"{study.stage.name or 'stage'}: {size} cells at rtol {study.rtol:g}: {words}"
    answer = [*loop_first(study.stage), headline(runs, metric)]
    return [*answer, *own_place(runs, study, metric), extent, verification(runs), *caveats(runs, metric), *reasons]


def own_place(runs: xr.Dataset, study: Study, metric: str) -> list[str]:
    """How far, along each axis of a map of verdicts, the stage as its file gives it is from the next edge of hunting;
    none where it is not on the map."""
    if metric not in VERDICTS or metric not in runs or study.links or SAMPLE in runs.dims:
        return []
    axes, flat = axes_of(runs), {**dict.fromkeys(SCALINGS, 1.0), **study.stage.flat()}
    own = [flat[axis.key] for axis in axes if axis.key in flat and _spans(axis, flat[axis.key])]
    if len(own) < len(axes):
        return []
    words = np.asarray(runs[metric].transpose(*(axis.key for axis in axes)).values).astype(str)
    words = words[np.ix_(*(axis.places for axis in axes))]
    at = tuple(int(np.abs(np.log(axis.positions / value)).argmin()) for axis, value in zip(axes, own, strict=True))
    if words[at] not in (*ATTRACTED, *_QUIET):
        return []
    ways = []
    for k, axis in enumerate(axes):
        ways += _changes(axis, words[(*at[:k], slice(None), *at[k + 1 :])], at[k])
    exact = all(np.isclose(axis.positions[k], value, rtol=1e-3) for axis, value, k in zip(axes, own, at, strict=True))
    subject = "Your stage" if exact else "The cell nearest to your stage"
    verb = words[at] if words[at] in ("hunts", "settles") else f"is {words[at]}"
    by = " by this sketch" if metric == SKETCH else ""
    does = "begins" if words[at] in _QUIET else "ends"
    where = f"; hunting {does} at {listed(ways, 'or')}" if ways else ""
    return [f"{subject} {verb}{by}{where}."]


def _spans(axis: CellAxis, value: float) -> bool:
    """Whether a value is within the range of an axis of numbers."""
    return bool(not axis.words and 0 < axis.positions.min() <= value <= axis.positions.max())


def _changes(axis: CellAxis, words: np.ndarray, at: int) -> list[str]:
    """Between which cells along an axis, of verdicts in words, it changes whether something attracts, next to a cell on
    either side; on a side on which a cell without a verdict lies nearer, nowhere."""
    attracted = np.isin(words, ATTRACTED)
    differ = np.flatnonzero((attracted != attracted[at]) | ~np.isin(words, (*ATTRACTED, *_QUIET)))
    ends = [(k, k + 1) for k in differ[differ < at][-1:] if words[k] in (*ATTRACTED, *_QUIET)]
    ends += [(k - 1, k) for k in differ[differ > at][:1] if words[k] in (*ATTRACTED, *_QUIET)]
    return [f"{in_sentence(axis.key)} {axis.value(low)} to {axis.value(high)}" for low, high in ends]


def loop_first(stage: Stage) -> list[str]:
    """That the loop of the stage as its file gives it is unstable, if it is."""
    from friso.hunting import unstable  # looking at a map needs no engine

    return unstable_loop(unstable(stage))
