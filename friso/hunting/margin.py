"""How far a stage is from the edge of hunting: the crossover up to which something attracts that hunts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from friso.engine.allowance import Exhausted
from friso.equations.bandwidth import bandwidth
from friso.hunting.attractors import Attractors, attractors
from friso.hunting.attractors.survey import Swinging
from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.limits import SEARCH_LIMITS
from friso.hunting.outward import ALONG, PRECISE, AttractionEnd, BandwidthWindow, Beyond, Outward
from friso.hunting.restabilised import windows_again
from friso.stage import Stage

FARTHEST = SEARCH_LIMITS.bandwidth_factor
"""Factor up to which the bandwidth is changed."""


@dataclass(frozen=True)
class Margin:
    """The edge of hunting in bandwidth: the highest one, over the range searched, below which something attracts and
    above which nothing does, but in the windows told beside it. Of a stage that nothing attracts it is the nearest
    below.

    `factor` is the bandwidth at the edge over that of the stage, `crossover` [Hz] the crossover there (None for a
    controller given by its gains, all of whose poles and zeros the factor scales). At `quiet`, a factor just above,
    simulations settle from everywhere that was tried. The edge is `certain` where a closed orbit was followed to its
    end there, or was lost while it attracted well, and all simulations beyond it that had to decide were completed;
    else it lies between the two. It is known up to a share of it, the `reserve`: where an orbit was lost up to the
    next bandwidth that was tried, and with a limiter that chatters multipliers scatter.
    """

    factor: float
    crossover: float | None
    certain: bool
    quiet: float
    reserve: float = PRECISE

    @property
    def end(self) -> AttractionEnd:
        """The end of what attracts, in factors of the bandwidth."""
        return AttractionEnd(self.factor, self.quiet, self.certain, self.reserve)


@dataclass(frozen=True)
class SearchedBandwidths:
    """What a search through the bandwidths showed: the `margin` (None: no such edge); the other `windows` in which
    something attracts; of a stage that something attracts the end below it of what does, `lower` (None: there is none);
    whether the search `contradicts` that nothing attracts the stage itself, to which an orbit was followed; and whether
    something attracts up to the highest bandwidth, so that there is no edge, `to_the_top`."""

    margin: Margin | None
    windows: tuple[BandwidthWindow, ...]
    lower: AttractionEnd | None = None
    contradicts: bool = False
    to_the_top: bool = False


NOT_SOUGHT = SearchedBandwidths(None, ())
"""What is told of a stage that cannot hunt at any bandwidth, or where the allowance does not suffice for a survey."""


def find_margin(stage: Stage, attracting: bool) -> Margin | None:
    """Find the edge of hunting of a stage, whose own motion plays no part: above its bandwidth the last edge, if
    something is `attracting` it at that, else the next one below. None where there is none within a factor of ten."""
    return search_bandwidths(stage, attracting).margin


def search_bandwidths(stage: Stage, attracting: bool, survey: Attractors | None = None) -> SearchedBandwidths:
    """Where something attracts, over bandwidths from a tenth to ten times that of a stage; `survey` is what
    attracts the stage itself, if that was surveyed. Where an allowance is used up, ends are where they are known to be
    by then, and not certain."""
    flat, crossover = stage.flat(), bandwidth(stage.flat())
    fine, coarse = SEARCH_LIMITS.steps_to_edge, SEARCH_LIMITS.steps_beyond
    index, above = (coarse, fine) if attracting else (fine, coarse)
    below = np.geomspace(1 / FARTHEST, 1.0, index, endpoint=False)
    factors = np.concatenate([below, np.geomspace(1.0, FARTHEST, above + 1)])
    survey = survey or attractors(Ensemble.held(flat, 1), thorough=True)
    try:
        grid = _Grid(flat, factors, index if attracting else index // 2)
    except Exhausted:
        return NOT_SOUGHT
    grid.record(index, survey)
    edge = grid.last_edge(index, attracting)
    grid.search_below()
    edge = edge or grid.last_edge(index, attracting)
    lower = grid.lower_end(index) if attracting else None
    contradicts = bool(grid.attracts[index]) and not attracting
    if edge is None:
        to_the_top = bool(grid.attracts[index:].all())
        return SearchedBandwidths(None, grid.windows(index), lower, contradicts, to_the_top)
    at, end, certain = edge
    conclusive = certain and not contradicts
    inside = None if crossover is None else crossover * end.inside
    outermost = Margin(end.inside, inside, conclusive, end.outside, end.reserve)
    return SearchedBandwidths(outermost, grid.windows(at), lower, contradicts)


def followed_on(stage: Stage, sought: SearchedBandwidths, attracting: bool) -> SearchedBandwidths:
    """The same, with the windows in which cycles attract again that repel just beyond the edge, or, without one, repel
    at the bandwidth of a stage that nothing attracts; as far as an allowance reaches."""
    nothing = not (attracting or sought.contradicts)
    starts = [(sought.margin.quiet, FARTHEST)] if sought.margin else [(1.0, FARTHEST), (1.0, 1 / FARTHEST)] * nothing
    windows = sought.windows
    for at, farthest in starts:
        windows += windows_again(stage.flat(), at, farthest, windows)
    return replace(sought, windows=windows)


class _Grid:
    """Factors, ascending, at which it is known whether something attracts, from the `lowest` that was searched on."""

    def __init__(self, flat: Mapping[str, Any], factors: np.ndarray, first: int) -> None:
        """Survey the stages at factors from the `first` on, by number. Raises Exhausted."""
        self.flat, self.factors, self.lowest = flat, factors, first
        self.attracts, self.decided = np.zeros(len(factors), bool), np.zeros(len(factors), bool)
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
        survey = Outward(self.flat, FARTHEST).surveyed(self.factors[numbers], cycles=False)
        self.attracts[numbers], self.decided[numbers] = survey.attracts, survey.decided
        for motion in survey.motions:
            self.motions[numbers[motion.stage]].append(motion)

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
                return None
            at = int(falls[-1])
            end = self.end(at, 1)
            if end is None:
                continue
            quiet = np.flatnonzero(self.factors > end.inside)
            hunts = quiet[self.attracts[quiet]]
            upper = quiet[quiet < hunts[0]] if hunts.size else quiet
            return at, end, bool(end.certain and self.decided[upper].all())

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
        """The same, of an end that was not followed before. Raises Exhausted."""
        outward = Outward(self.flat, FARTHEST**ahead, self.settled)
        if not self.proved(at, outward):
            return None
        try:
            end = outward.end(float(self.factors[at]), tuple(self.motions[at]), float(self.factors[at + ahead]))
        except Beyond:
            self.attracts[at + 1 if ahead > 0 else 0 : None if ahead > 0 else at] = True
            return None
        beyond = ahead * np.log(self.factors / end.inside)
        self.attracts |= (ahead * (np.arange(len(self.factors)) - at) > 0) & (beyond <= 0)
        if ahead * (end.outside - end.inside) <= 0:  # the search was given up beyond it
            settled = np.flatnonzero((beyond > 0) & ~self.attracts)[::ahead]
            if not settled.size:
                self.attracts |= beyond > 0
                return None
            end = replace(end, outside=float(self.factors[settled[0]]), certain=False)
        attracted = np.flatnonzero((ahead * (np.arange(len(self.factors)) - at) > 0) & (beyond <= 0))
        last = int(attracted[-1 if ahead > 0 else 0]) if attracted.size else at  # within its reserve it may lie before
        self.ends[at, ahead] = self.ends[last, ahead] = end
        return end

    def proved(self, at: int, outward: Outward) -> bool:
        """Whether something attracts at a factor, by number, once orbits were tried to be closed."""
        motions = self.motions[at]
        if motions and at not in self.inspected and all(motion.cycles is None for motion in motions):
            distances = np.outer([motion.distance for motion in motions], ALONG).ravel()
            survey = outward.surveyed_at_once(self.factors[at : at + 1], distances)
            self.attracts[at], self.decided[at] = survey.attracts[0], survey.decided[0]
            self.motions[at] = list(survey.motions)
        self.inspected.add(at)
        return bool(self.attracts[at])

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

    def windows(self, besides: int) -> tuple[BandwidthWindow, ...]:
        """The windows of factors in which something attracts, besides that of the factor with a number."""
        while True:
            before = self.attracts.copy()
            windows = tuple(self._window(a, b) for a, b in self._spans() if not a <= besides <= b)
            if np.array_equal(before, self.attracts):
                return windows

    def _window(self, first: int, last: int) -> BandwidthWindow:
        return BandwidthWindow(
            self.end(first, -1) if first > self.lowest else None,
            self.end(last, 1) if last + 1 < len(self.factors) else None,
        )

    def _spans(self) -> list[tuple[int, int]]:
        """The first and last of neighbouring factors, by number, at which something attracts."""
        ends = np.flatnonzero(np.diff(self.attracts.astype(int), prepend=0, append=0))
        return [(int(first), int(after) - 1) for first, after in zip(ends[::2], ends[1::2], strict=True)]
