"""How far a stage is from the edge of hunting: the crossover up to which something attracts that hunts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from friso.engine.allowance import Exhausted, allowance
from friso.equations.bandwidth import bandwidth, faster
from friso.hunting.attractors import Attractors, attractors
from friso.hunting.attractors.survey import Swinging
from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.limits import SEARCH_LIMITS
from friso.hunting.outward import AttractionEnd, BandwidthWindow, Beyond, EdgeSearch
from friso.hunting.restabilised import windows_again
from friso.hunting.settings import EdgeSettings
from friso.hunting.what_attracts import sketched, what_attracts
from friso.stage import Stage

LOWEST, HIGHEST = SEARCH_LIMITS.lowest_bandwidth, SEARCH_LIMITS.highest_bandwidth
"""Bandwidths between which is searched, in units of that of the stage."""


@dataclass(frozen=True)
class Margin:
    """The edge of hunting in bandwidth: the highest one, over the range searched, below which something attracts and
    above which nothing does, but in the windows told beside it. Of a stage that nothing attracts it is the nearest
    below.

    `factor` is the bandwidth at the edge over that of the stage, `crossover` [Hz] the crossover there (None for a
    controller given by its gains, all of whose poles and zeros the factor scales). At `quiet`, a factor just above,
    nothing attracts any more: the edge lies between both. It is `certain` where a closed orbit was followed to its end,
    or both are close together, and all that had to decide beyond it was completed.
    """

    factor: float
    crossover: float | None
    certain: bool
    quiet: float

    @property
    def end(self) -> AttractionEnd:
        """The end of what attracts, in factors of the bandwidth."""
        return AttractionEnd(self.factor, self.quiet, self.certain)

    @property
    def reserve(self) -> float:
        """Up to which share of it the edge is known."""
        return self.end.reserve


@dataclass(frozen=True)
class SearchedBandwidths:
    """What a search through the bandwidths showed.

    The `margin` (None: no such edge); the other `windows` in which something attracts; of a stage that something
    attracts the end below it of what does, `lower` (None: there is none). Whether the search `contradicts` that nothing
    attracts the stage itself, to which an orbit was followed; whether something attracts up to the highest bandwidth,
    so that there is no edge, `to_the_top`; whether no edge was found, but something may attract at a bandwidth for all
    that is known, `undecided`. The `last_returns`: factors at which a cycle may repel while none does at the next one,
    each with the end of the range on that side.
    """

    margin: Margin | None
    windows: tuple[BandwidthWindow, ...]
    lower: AttractionEnd | None = None
    contradicts: bool = False
    to_the_top: bool = False
    undecided: bool = False
    last_returns: tuple[tuple[float, float], ...] = ()


NOT_SOUGHT = SearchedBandwidths(None, ())
"""What is told of a stage that cannot hunt at any bandwidth."""


def find_margin(stage: Stage, attracting: bool) -> Margin | None:
    """Find the edge of hunting of a stage, whose own motion plays no part: above its bandwidth the last edge, if
    something is `attracting` it at that, else the next one below. None where there is none in the range searched."""
    return search_bandwidths(stage, attracting).margin


def search_bandwidths(stage: Stage, attracting: bool, survey: Attractors | None = None) -> SearchedBandwidths:
    """Where something attracts, over the bandwidths of `SEARCH_LIMITS`; `survey` is what attracts the stage itself,
    if that was surveyed. Where an allowance is used up, ends are where they are known to be by then, and not certain.
    """
    flat, crossover = stage.flat(), bandwidth(stage.flat())
    fine, coarse = SEARCH_LIMITS.steps_to_edge, SEARCH_LIMITS.steps_beyond
    to_lower, to_higher = (coarse, fine) if attracting else (fine, coarse)
    index, above = round(-to_lower * np.log10(LOWEST)), round(to_higher * np.log10(HIGHEST))
    below = np.geomspace(LOWEST, 1.0, index, endpoint=False)
    factors = np.concatenate([below, np.geomspace(1.0, HIGHEST, above + 1)])
    survey = survey or attractors(Ensemble.held(flat, 1), thorough=True)
    try:
        grid = _Grid(flat, factors, index if attracting else index // 2)
    except Exhausted:
        return replace(NOT_SOUGHT, undecided=True)
    grid.record(index, survey)
    edge = grid.last_edge(index, attracting)
    grid.search_below()
    edge = edge or grid.last_edge(index, attracting)
    lower = grid.lower_end(index) if attracting else None
    windows = grid.windows(index if edge is None else edge[0])  # these may be followed to the stage itself
    contradicts, returns = bool(grid.attracts[index]) and not attracting, grid.last_returns()
    if edge is None:
        to_the_top = bool((grid.attracts & grid.decided)[index:].all())
        undecided = not grid.decided[grid.lowest :].all()
        return SearchedBandwidths(None, windows, lower, contradicts, to_the_top, undecided, returns)
    _, end, certain = edge
    inside = None if crossover is None else crossover * end.inside
    outermost = Margin(end.inside, inside, certain and not contradicts, end.outside)
    return SearchedBandwidths(outermost, windows, lower, contradicts, last_returns=returns)


def followed_on(stage: Stage, sought: SearchedBandwidths) -> SearchedBandwidths:
    """What a search through the bandwidths showed, with the windows in which cycles attract again that repel: next to
    the folds in which these end. As far as an allowance reaches."""
    windows = sought.windows
    for at, farthest in sought.last_returns:
        windows += windows_again(stage.flat(), at, farthest, windows)
    return replace(sought, windows=windows)


class _Grid:
    """Factors, ascending, at which it is known whether something attracts, from the `lowest` that was searched on."""

    def __init__(self, flat: Mapping[str, Any], factors: np.ndarray, first: int) -> None:
        """Survey the stages at factors from the `first` on, by number. Raises Exhausted."""
        self.flat, self.factors, self.lowest = flat, factors, first
        self.attracts, self.decided, self.passed = (np.zeros(len(factors), bool) for _ in range(3))
        self.returns, self.resolved = np.zeros(len(factors), bool), np.zeros(len(factors), bool)
        self.motions: list[list[Swinging]] = [[] for _ in factors]
        self.ends: dict[tuple[int, int], AttractionEnd] = {}
        self.inspected: set[int] = set()
        self.settled: float | None = None
        self._survey(np.arange(first, len(factors)))

    def search_below(self) -> None:
        """Survey the stages at the other factors, whose motions are the slowest, as far as an allowance reaches."""
        try:
            self._survey(np.arange(self.lowest))
        except Exhausted:
            return
        self.lowest = 0

    def _survey(self, numbers: np.ndarray) -> None:
        """Sketch the stages at some factors, by number; those whose maps are not resolved are searched by simulations,
        the nearest to the stage itself first, as far as so much work suffices. Raises Exhausted."""
        settings = EdgeSettings.current()
        sketch = sketched(self._stages(numbers))
        self.attracts[numbers], self.decided[numbers] = sketch.attracts, sketch.decided
        self.returns[numbers], self.resolved[numbers] = sketch.returns, sketch.decided
        left = numbers[~sketch.decided]
        left = left[np.argsort(np.abs(np.log(self.factors[left])), kind="stable")]
        at_once, work = (
            (settings.bandwidths_at_once, settings.simulated_work) if sketch.decided.any() else (len(left), np.inf)
        )
        with allowance(work) as simulated:
            try:
                for first in range(0, len(left), at_once):
                    some = left[first : first + at_once]
                    survey = attractors(self._stages(some), cycles=False)
                    self.attracts[some], self.decided[some] = survey.attracts, survey.decided
            except Exhausted:
                if simulated.left < work - simulated.used or np.isinf(work):  # there is less left around this search
                    raise

    def _stages(self, numbers: np.ndarray) -> Ensemble:
        """The stage with its bandwidth multiplied by the factors with these numbers."""
        return Ensemble.held(faster(self.flat, self.factors[numbers]), len(numbers))

    def record(self, index: int, survey: Attractors) -> None:
        """Take over what a thorough survey of one of the stages shows."""
        self.attracts[index], self.decided[index] = survey.attracts[0], survey.decided[0]
        self.motions[index] = list(survey.motions)
        self.inspected.add(index)
        if self.decided[index] and not self.attracts[index]:
            self.settled = float(self.factors[index])

    def last_edge(self, index: int, above: bool) -> tuple[int, AttractionEnd, bool] | None:
        """The last factor, by number, at which something attracts while nothing does at the next one, of those from a
        number on if the edge is looked for `above`, else of those below it; the end of what attracts; and whether that
        is certain. None if there is no such factor."""
        while True:
            falls = np.flatnonzero(self.attracts[:-1] & ~self.attracts[1:])
            falls = falls[falls >= index] if above else falls[falls < index]
            if not falls.size:
                if above and self.attracts[-1] and not self._proved_at_the_top():
                    continue
                return None
            at = int(falls[-1])
            end = self.end(at, 1)
            if end is None:
                continue
            quiet = np.flatnonzero(self.factors > end.inside)
            hunts = quiet[self.attracts[quiet]]
            upper = quiet[quiet < hunts[0]] if hunts.size else quiet
            return at, end, bool(end.certain and self.decided[upper].all())

    def _proved_at_the_top(self) -> bool:
        """Whether something attracts at the highest factor, or that is not decided, as the allowance is used up."""
        try:
            return self.proved(len(self.factors) - 1, 1)
        except Exhausted:
            self.decided[-1] = False
            return True

    def end(self, at: int, ahead: int) -> AttractionEnd | None:
        """The end of what attracts at a factor, by number, while nothing does at the next one, above (`ahead` 1) or
        below (-1). None if it attracts as far as the search goes: then it is known to do so everywhere up to there; or
        if it does not attract on closer inspection, which is known then. Where the allowance is used up, an end that is
        not certain."""
        if (at, ahead) in self.ends:
            return self.ends[at, ahead]
        try:
            return self._followed(at, ahead)
        except Exhausted:
            end = AttractionEnd(float(self.factors[at]), float(self.factors[at + ahead]), False)
            return self.ends.setdefault((at, ahead), end)

    def _followed(self, at: int, ahead: int) -> AttractionEnd | None:
        """The end of what attracts at a factor (see `end`), which was not followed before. Raises Exhausted."""
        if not self.proved(at, ahead):
            return None
        outward = EdgeSearch(self.flat, HIGHEST if ahead > 0 else LOWEST, self.settled)
        try:
            end = outward.end(float(self.factors[at]), tuple(self.motions[at]), float(self.factors[at + ahead]))
        except Beyond:
            self._pass(ahead * (np.arange(len(self.factors)) - at) > 0)
            return None
        beyond = ahead * np.log(self.factors / end.inside)
        self._pass((ahead * (np.arange(len(self.factors)) - at) > 0) & (beyond <= 0))
        if ahead * (end.outside - end.inside) <= 0:  # the search was given up beyond it
            settled = np.flatnonzero((beyond > 0) & ~self.attracts)[::ahead]
            if not settled.size:
                self._pass(beyond > 0)
                return None
            end = AttractionEnd(end.inside, float(self.factors[settled[0]]), False)
        attracted = np.flatnonzero((ahead * (np.arange(len(self.factors)) - at) > 0) & (beyond <= 0))
        last = int(attracted[-1 if ahead > 0 else 0]) if attracted.size else at  # within its reserve it may lie before
        self.ends[at, ahead] = self.ends[last, ahead] = end
        return end

    def _pass(self, where: np.ndarray) -> None:
        """Take notice of factors, shape (count,), at which an orbit that was followed past them attracts."""
        self.passed |= where
        self.attracts |= where
        self.inspected -= set(np.flatnonzero(where & [not motions for motions in self.motions]).tolist())

    def proved(self, at: int, ahead: int) -> bool:
        """Whether something attracts at a factor, by number, once orbits were tried to be closed; if not, that is known
        of the next ones behind it as well, at which something seemed to attract."""
        if at not in self.inspected:
            self._inspect(np.array([at]))
            if not self.attracts[at]:
                behind = np.arange(at - ahead, -1 if ahead > 0 else len(self.factors), -ahead)
                end = np.flatnonzero(~self.attracts[behind])
                some = [k for k in behind[: end[0] if end.size else None].tolist() if k not in self.inspected]
                if some:
                    self._inspect(np.array(some[: EdgeSettings.current().bandwidths_at_once]))
        return bool(self.attracts[at])

    def _inspect(self, numbers: np.ndarray) -> None:
        """Close orbits at the factors with some numbers."""
        survey = what_attracts(self._stages(numbers))
        self.attracts[numbers] = survey.attracts | self.passed[numbers]
        self.decided[numbers] = survey.decided
        for k, number in enumerate(numbers.tolist()):
            self.motions[number] = list(survey.take(np.array([k])).motions)
        self.inspected |= set(numbers.tolist())

    def lower_end(self, index: int) -> AttractionEnd | None:
        """The end below of what attracts at a number; None if it attracts as far as the search goes, or if it is not
        known that nothing does below."""
        while self.attracts[index] and not self.attracts[self.lowest : index].all():
            first = self.lowest + int(np.flatnonzero(~self.attracts[self.lowest : index])[-1]) + 1
            end = self.end(first, -1)
            if end is None:
                continue
            quiet = np.flatnonzero(self.factors < end.inside)[-2:]
            return end if quiet.size and self.decided[quiet].all() and not self.attracts[quiet].any() else None
        return None

    def last_returns(self) -> tuple[tuple[float, float], ...]:
        """Factors at which nothing attracts, and cycles that repel end before the next one, each with the end of the
        range on that side."""
        ends = []
        for ahead, farthest in ((1, HIGHEST), (-1, LOWEST)):
            beyond = np.roll(~self.returns & self.resolved, -ahead)
            last = self.returns & self.resolved & beyond & ~self.attracts
            last[-1 if ahead > 0 else 0] = False
            ends += [(float(factor), farthest) for factor in self.factors[last]]
        return tuple(ends)

    def windows(self, besides: int) -> tuple[BandwidthWindow, ...]:
        """The windows of factors in which something attracts, besides that of the factor with a number."""
        while True:
            before = self.attracts.copy()
            windows = tuple(self._window(a, b) for a, b in self._spans() if not a <= besides <= b)
            if np.array_equal(before, self.attracts):
                return windows

    def _window(self, first: int, last: int) -> BandwidthWindow:
        """The window from the first to the last of neighbouring factors, with its ends."""
        return BandwidthWindow(
            self.end(first, -1) if first > self.lowest else None,
            self.end(last, 1) if last + 1 < len(self.factors) else None,
        )

    def _spans(self) -> list[tuple[int, int]]:
        """The first and last of neighbouring factors, by number, at which something attracts."""
        ends = np.flatnonzero(np.diff(self.attracts.astype(int), prepend=0, append=0))
        return [(int(first), int(after) - 1) for first, after in zip(ends[::2], ends[1::2], strict=True)]
