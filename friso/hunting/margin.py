"""Find the edge of hunting in bandwidth: the crossover above which the stage does not hunt."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from friso.engine.allowance import Exhausted
from friso.equations.bandwidth import bandwidth
from friso.hunting.attractors import Attractors, attractors
from friso.hunting.cycle.ensemble import Ensemble, spans
from friso.hunting.loop import unstable_among
from friso.hunting.path import SEARCH_LIMITS, AttractionEnd, BandwidthWindow, LossKind, ParameterPath, bandwidth_path
from friso.hunting.path_search import PathSearch
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
    was followed to its end, or both are close together, and no run failed that was needed. `kind` says how attraction
    ends there.
    """

    factor: float
    crossover: float | None
    certain: bool
    quiet: float
    kind: LossKind = "seen"

    @property
    def end(self) -> AttractionEnd:
        """Return the bandwidths, over the stage's own, between which attraction ends."""
        return AttractionEnd(self.factor, self.quiet, self.certain, self.kind)

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
    path = bandwidth_path(flat, attracting)
    index = path.own
    survey = survey or attractors(Ensemble.held(flat, 1), thorough=True)
    try:
        grid = PathSearch(path, index if attracting else index // 2)
    except Exhausted:
        return replace(NOT_SOUGHT, undecided=True)
    grid.record(survey)
    edge = grid.last_edge(index, attracting)
    grid.search_below()
    edge = edge or grid.last_edge(index, attracting)
    lower = grid.lower_end(index) if attracting else None
    # a cycle of a window may be followed to the stage itself
    windows = grid.windows(index if edge is None else edge[0])
    contradicts = bool(grid.attracts[index]) and not attracting
    if edge is None:
        to_the_top = bool((grid.attracts & grid.decided)[index:].all())
        undecided = not (grid.decided | _unstable(path, path.factors))[grid.lowest :].all()
        return SearchedBandwidths(None, windows, lower, contradicts, to_the_top, undecided)
    _, end, certain = edge
    inside = None if crossover is None else crossover * end.inside
    outermost = Margin(end.inside, inside, certain and not contradicts, end.outside, end.kind)
    return SearchedBandwidths(outermost, windows, lower, contradicts)


LOOP_BANDWIDTHS = 200
"""Bandwidths at which the loop's stability is computed, 2 % apart, and again between two of these, 0.01 % apart."""


def unstable_bandwidths(stage: Stage) -> tuple[BandwidthWindow, ...]:
    """Find the bandwidths of `SEARCH_LIMITS` at which the loop of a stage is unstable, whatever the friction.

    The loop is unstable while the stage sticks, or while it slides. Windows narrower than a step may be missed.
    """
    count, path = LOOP_BANDWIDTHS, bandwidth_path(stage.flat(), attracting=True)

    def end(inside: float, outside: float) -> AttractionEnd:
        """Return where the loop becomes stable between a factor at which it is not, and one at which it is."""
        between = np.geomspace(inside, outside, count)
        last = int(np.flatnonzero(~_unstable(path, between))[0]) - 1
        return AttractionEnd(*between[last : last + 2].tolist(), certain=True)

    factors = np.geomspace(LOWEST, HIGHEST, count)
    places = factors.tolist()
    return tuple(
        BandwidthWindow(
            end(places[first], places[first - 1]) if first else None,
            end(places[last], places[last + 1]) if last + 1 < count else None,
        )
        for first, last in spans(_unstable(path, factors))
    )


def _unstable(path: ParameterPath, factors: np.ndarray) -> np.ndarray:
    """Return at which factors of a path the loop is unstable, whatever the friction, (count,)."""
    return np.any([*unstable_among(path.stages(factors)).values()], axis=0)
