"""Find the edge of hunting in bandwidth: the crossover above which the stage does not hunt."""

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
from friso.hunting.loop import unstable_among
from friso.hunting.outward import AttractionEnd, BandwidthWindow, Beyond, EdgeSearch
from friso.hunting.search_limits import SEARCH_LIMITS
from friso.hunting.settings import check_settings, edge_settings
from friso.hunting.what_attracts import sketched, what_attracts
from friso.stage import Stage

LOWEST, HIGHEST = SEARCH_LIMITS.lowest_bandwidth, SEARCH_LIMITS.highest_bandwidth
"""Lowest and highest bandwidth that is searched, in units of the stage's own."""


@dataclass(frozen=True)
class Margin:
    """The edge of hunting in bandwidth: the stage hunts below it and does not hunt above it.

    It is the highest edge in the range searched; windows above it are listed separately. For a stage without an
    attractor it is the nearest edge below. `factor` is the bandwidth at the edge over the stage's own. `crossover` [Hz]
    is the crossover there; None for a controller given by its gains, all of whose poles and zeros the factor scales. At
    `quiet`, a factor just above, the stage does not hunt: the edge lies between both. It is `certain` if a closed orbit
    was followed to its end, or both are close together, and no run failed that was needed.
    """

    factor: float
    crossover: float | None
    certain: bool
    quiet: float

    @property
    def end(self) -> AttractionEnd:
        """Return the bandwidths, over the stage's own, between which attraction ends."""
        return AttractionEnd(self.factor, self.quiet, self.certain)

    @property
    def reserve(self) -> float:
        """Return the relative error of the edge."""
        return self.end.reserve


@dataclass(frozen=True)
class SearchedBandwidths:
    """Result of a search through the bandwidths for hunting.

    - `margin`: the edge of hunting (None: there is no edge).
    - `windows`: other bandwidths at which the stage hunts.
    - `lower`: for a stage that hunts, the bandwidth below which it does not (None: there is none).
    - `contradicts`: an orbit was followed to a stage that seemed to have no attractor.
    - `to_the_top`: the stage hunts up to the highest bandwidth, so that there is no edge.
    - `undecided`: no edge was found, but the stage may hunt at some bandwidth at which its loop is stable.
    """

    margin: Margin | None
    windows: tuple[BandwidthWindow, ...]
    lower: AttractionEnd | None = None
    contradicts: bool = False
    to_the_top: bool = False
    undecided: bool = False


NOT_SOUGHT = SearchedBandwidths(None, ())
"""Result for a stage that cannot hunt at any bandwidth, so that no search is needed."""


def find_margin(stage: Stage, attracting: bool) -> Margin | None:
    """Find the edge of hunting of a stage, whatever its own motion.

    If the stage hunts (`attracting`), it is the last edge above its bandwidth, else the nearest one below. Returns None
    if there is no edge in the range searched.
    """
    return search_bandwidths(stage, attracting).margin


def search_bandwidths(stage: Stage, attracting: bool, survey: Attractors | None = None) -> SearchedBandwidths:
    """Search the bandwidths of `SEARCH_LIMITS` for attractors of a stage.

    `attracting` is true if something attracts the stage itself, and `survey` is its survey, if there was one. If an
    allowance of work is used up, the ends are as good as they were by then, and not certain.
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
    # a cycle of a window may be followed to the stage itself
    windows = grid.windows(index if edge is None else edge[0])
    contradicts = bool(grid.attracts[index]) and not attracting
    if edge is None:
        to_the_top = bool((grid.attracts & grid.decided)[index:].all())
        undecided = not (grid.decided | _unstable(flat, factors))[grid.lowest :].all()
        return SearchedBandwidths(None, windows, lower, contradicts, to_the_top, undecided)
    _, end, certain = edge
    inside = None if crossover is None else crossover * end.inside
    outermost = Margin(end.inside, inside, certain and not contradicts, end.outside)
    return SearchedBandwidths(outermost, windows, lower, contradicts)


def unstable_bandwidths(stage: Stage) -> tuple[BandwidthWindow, ...]:
    """Find the bandwidths of `SEARCH_LIMITS` at which the loop of a stage is unstable, whatever the friction.

    The loop is unstable while the stage sticks, or while it slides. Windows narrower than a step may be missed.
    """
    count, flat = check_settings.loop_bandwidths, stage.flat()

    def end(inside: float, outside: float) -> AttractionEnd:
        """Return where the loop becomes stable between a factor at which it is not, and one at which it is."""
        between = np.geomspace(inside, outside, count)
        last = int(np.flatnonzero(~_unstable(flat, between))[0]) - 1
        return AttractionEnd(*between[last : last + 2].tolist(), certain=True)

    factors = np.geomspace(LOWEST, HIGHEST, count)
    places = factors.tolist()
    changes = np.flatnonzero(np.diff(_unstable(flat, factors).astype(int), prepend=0, append=0))
    return tuple(
        BandwidthWindow(
            end(places[first], places[first - 1]) if first else None,
            end(places[after - 1], places[after]) if after < count else None,
        )
        for first, after in zip(changes[::2], changes[1::2], strict=True)
    )


def _unstable(flat: Mapping[str, Any], factors: np.ndarray) -> np.ndarray:
    """Return at which factors of its bandwidth the loop of a stage is unstable, whatever the friction, (count,)."""
    states = unstable_among(Ensemble.held(faster(flat, factors), len(factors)))
    return np.any([*states.values()], axis=0)


class _Grid:
    """Ascending factors of the bandwidth, and what attracts the stage at each of them.

    The factors numbered `lowest` and higher were searched.
    """

    def __init__(self, flat: Mapping[str, Any], factors: np.ndarray, first: int) -> None:
        """Survey the stage at the bandwidth factors numbered `first` and higher.

        `flat` has the stage's keys in SI. Raises Exhausted if an allowance of work is used up.
        """
        self.flat, self.factors, self.lowest = flat, factors, first
        self.attracts, self.decided, self.passed = (np.zeros(len(factors), bool) for _ in range(3))
        self.motions: list[list[Swinging]] = [[] for _ in factors]
        self.ends: dict[tuple[int, int], AttractionEnd] = {}
        self.inspected: set[int] = set()
        self.settled: float | None = None
        self._survey(np.arange(first, len(factors)))

    def search_below(self) -> None:
        """Survey the lower factors, whose motions are slowest, until the work is used up."""
        try:
            self._survey(np.arange(self.lowest))
        except Exhausted:
            return
        self.lowest = 0

    def _survey(self, numbers: np.ndarray) -> None:
        """Sketch the stages at factors given by number; simulate those that the sketch leaves open.

        Factors nearest to 1 come first, until a fraction of the work is used up. Raises Exhausted if the allowance
        around the whole search is used up.
        """
        sketch = sketched(self._stages(numbers))
        self.attracts[numbers], self.decided[numbers] = sketch.attracts, sketch.decided
        left = numbers[~sketch.decided]
        left = left[np.argsort(np.abs(np.log(self.factors[left])), kind="stable")]
        at_once, work = (
            (edge_settings.bandwidths_at_once, edge_settings.simulated_work)
            if sketch.decided.any()
            else (len(left), np.inf)
        )
        with allowance(work) as simulated:
            try:
                for first in range(0, len(left), at_once):
                    some = left[first : first + at_once]
                    survey = attractors(self._stages(some), cycles=False)
                    self.attracts[some], self.decided[some] = survey.attracts, survey.decided
            except Exhausted:
                # the allowance around this search has less left
                if simulated.left < work - simulated.used or np.isinf(work):
                    raise

    def _stages(self, numbers: np.ndarray) -> Ensemble:
        """Return the stage with its bandwidth multiplied by some of the factors, by number."""
        return Ensemble.held(faster(self.flat, self.factors[numbers]), len(numbers))

    def record(self, index: int, survey: Attractors) -> None:
        """Record a thorough survey of the stage at the bandwidth factor numbered `index`."""
        self.attracts[index], self.decided[index] = survey.attracts[0], survey.decided[0]
        self.motions[index] = list(survey.motions)
        self.inspected.add(index)
        if self.decided[index] and not self.attracts[index]:
            self.settled = float(self.factors[index])

    def last_edge(self, index: int, above: bool) -> tuple[int, AttractionEnd, bool] | None:
        """Find the last factor at which the stage hunts while it does not at the next one.

        Factors from number `index` upwards count if `above`, otherwise those below it. Returns the number, the end of
        attraction, and whether it is certain; None if there is no such factor.
        """
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
        """Tell whether the stage hunts at the highest factor.

        The result is true as well if the allowance is used up before that is decided.
        """
        try:
            return self.proved(len(self.factors) - 1, 1)
        except Exhausted:
            self.decided[-1] = False
            return True

    def end(self, at: int, ahead: int) -> AttractionEnd | None:
        """Find where attraction ends between the bandwidth factor numbered `at` and a neighbour.

        The neighbour is the next factor above (`ahead` 1) or below (-1). Returns None if attraction reaches the end of
        the search, which is then recorded for all factors up to there. Returns None as well if closer inspection shows
        no attractor at `at`. If the allowance is used up, the end is not certain.
        """
        if (at, ahead) in self.ends:
            return self.ends[at, ahead]
        try:
            return self._followed(at, ahead)
        except Exhausted:
            end = AttractionEnd(float(self.factors[at]), float(self.factors[at + ahead]), False)
            return self.ends.setdefault((at, ahead), end)

    def _followed(self, at: int, ahead: int) -> AttractionEnd | None:
        """Follow attraction from the bandwidth factor numbered `at` to its end.

        Attraction is followed up (`ahead` 1) or down (-1). Returns None if it reaches the end of the search, or if
        closer inspection shows no attractor. Raises Exhausted if an allowance of work is used up.
        """
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
        if ahead * (end.outside - end.inside) <= 0:  # the search was given up past `outside`
            settled = np.flatnonzero((beyond > 0) & ~self.attracts)[::ahead]
            if not settled.size:
                self._pass(beyond > 0)
                return None
            end = AttractionEnd(end.inside, float(self.factors[settled[0]]), False)
        attracted = np.flatnonzero((ahead * (np.arange(len(self.factors)) - at) > 0) & (beyond <= 0))
        # within its error the end may lie before the first factor
        last = int(attracted[-1 if ahead > 0 else 0]) if attracted.size else at
        self.ends[at, ahead] = self.ends[last, ahead] = end
        return end

    def _pass(self, where: np.ndarray) -> None:
        """Record that the stage hunts at the factors past which a stable orbit was followed.

        `where`, shape (count,), is true for these factors.
        """
        self.passed |= where
        self.attracts |= where
        self.inspected -= set(np.flatnonzero(where & [not motions for motions in self.motions]).tolist())

    def proved(self, at: int, ahead: int) -> bool:
        """Tell whether the stage hunts at the bandwidth factor numbered `at`, after closing orbits.

        If it does not, neighbouring factors that seemed to have an attractor are inspected too: those below if `ahead`
        is 1, above if it is -1.
        """
        if at not in self.inspected:
            self._inspect(np.array([at]))
            if not self.attracts[at]:
                behind = np.arange(at - ahead, -1 if ahead > 0 else len(self.factors), -ahead)
                end = np.flatnonzero(~self.attracts[behind])
                some = [k for k in behind[: end[0] if end.size else None].tolist() if k not in self.inspected]
                if some:
                    self._inspect(np.array(some[: edge_settings.bandwidths_at_once]))
        return bool(self.attracts[at])

    def _inspect(self, numbers: np.ndarray) -> None:
        """Close orbits at the factors with these numbers, and record what attracts the stage there."""
        survey = what_attracts(self._stages(numbers))
        self.attracts[numbers] = survey.attracts | self.passed[numbers]
        self.decided[numbers] = survey.decided
        for k, number in enumerate(numbers.tolist()):
            self.motions[number] = list(survey.take(np.array([k])).motions)
        self.inspected |= set(numbers.tolist())

    def lower_end(self, index: int) -> AttractionEnd | None:
        """Find the end of attraction below the bandwidth factor numbered `index`.

        Returns None if attraction reaches the end of the search, or if it is not certain that the stage does not hunt
        below.
        """
        while self.attracts[index] and not self.attracts[self.lowest : index].all():
            first = self.lowest + int(np.flatnonzero(~self.attracts[self.lowest : index])[-1]) + 1
            end = self.end(first, -1)
            if end is None:
                continue
            quiet = np.flatnonzero(self.factors < end.inside)[-2:]
            return end if quiet.size and self.decided[quiet].all() and not self.attracts[quiet].any() else None
        return None

    def windows(self, besides: int) -> tuple[BandwidthWindow, ...]:
        """Return the windows of factors with an attractor, except the one with factor `besides`.

        `besides` is the number of a factor.
        """
        while True:
            before = self.attracts.copy()
            windows = tuple(self._window(a, b) for a, b in self._spans() if not a <= besides <= b)
            if np.array_equal(before, self.attracts):
                return windows

    def _window(self, first: int, last: int) -> BandwidthWindow:
        """Return the window from the first to the last of neighbouring factors, with its ends."""
        return BandwidthWindow(
            self.end(first, -1) if first > self.lowest else None,
            self.end(last, 1) if last + 1 < len(self.factors) else None,
        )

    def _spans(self) -> list[tuple[int, int]]:
        """Return the first and last numbers of each group of bandwidth factors with an attractor.

        The factors of a group are neighbours.
        """
        ends = np.flatnonzero(np.diff(self.attracts.astype(int), prepend=0, append=0))
        return [(int(first), int(after) - 1) for first, after in zip(ends[::2], ends[1::2], strict=True)]
