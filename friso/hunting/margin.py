"""How far a stage is from the edge of hunting: the crossover up to which something attracts that hunts."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from friso.equations.bandwidth import bandwidth
from friso.hunting.attractors import Attractors, attractors
from friso.hunting.attractors.survey import Swinging
from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.outward import AttractionEnd, Beyond, Outward
from friso.stage import Stage

FARTHEST = 10.0
"""Factor up to which the bandwidth is changed."""

STEPS, COARSE = 20, 10
"""Steps to a factor of ten in bandwidth where an edge is looked for, and beyond, where something may attract again:
windows narrower than a step may be missed."""


@dataclass(frozen=True)
class Margin:
    """The edge of hunting in bandwidth: the highest one, over the range searched, below which something attracts and
    above which nothing does. Of a stage that nothing attracts it is the nearest below.

    `factor` is the bandwidth at the edge over that of the stage, `crossover` [Hz] the crossover there (None for a
    controller given by its gains, all of whose poles and zeros the factor scales). At `quiet`, a factor just above,
    simulations settle from everywhere that was tried. The edge is `certain` where a closed orbit was followed to its
    end there, and all simulations beyond it that had to decide were completed; else it lies between the two.
    """

    factor: float
    crossover: float | None
    certain: bool
    quiet: float


@dataclass(frozen=True)
class BandwidthWindow:
    """Bandwidths, as factors of that of a stage, outside of which nothing attracts next to them: something does at some
    in between. None: as far as the search goes."""

    low: float | None
    high: float | None


@dataclass(frozen=True)
class Searched:
    """What a search through the bandwidths showed: the `margin` (None: no such edge); the other `windows` in which
    something attracts, to the step of the search; of a stage that something attracts the next factor below at which
    nothing does, `lower` (None: there is none); and whether the search `contradicts` that nothing attracts the stage
    itself, to which an orbit was followed."""

    margin: Margin | None
    windows: tuple[BandwidthWindow, ...]
    lower: float | None = None
    contradicts: bool = False


NOT_SOUGHT = Searched(None, ())
"""What is told of a stage that cannot hunt at any bandwidth."""


def margin(stage: Stage, attracting: bool) -> Margin | None:
    """The last edge above the bandwidth of a stage that something attracts, or the next one below that of one that
    nothing does; None within a factor of ten."""
    return searched(stage, attracting).margin


def searched(stage: Stage, attracting: bool, survey: Attractors | None = None) -> Searched:
    """Where something attracts, over bandwidths from a tenth to ten times that of a stage; `survey` is what
    attracts the stage itself, if that was surveyed."""
    flat, crossover = stage.flat(), bandwidth(stage.flat())
    here, above = (COARSE, STEPS) if attracting else (STEPS, COARSE)
    below = np.geomspace(1 / FARTHEST, 1.0, here, endpoint=False)
    factors = np.concatenate([below, np.geomspace(1.0, FARTHEST, above + 1)])
    grid = _Grid(Outward(flat, FARTHEST), factors)
    grid.know(here, survey or attractors(Ensemble.held(flat, 1), thorough=True))
    edge = grid.last_edge(here, attracting)
    contradicts = bool(grid.attracts[here]) and not attracting
    own_window = next((window for window in grid.windows() if _holds(window, 1.0)), BandwidthWindow(None, None))
    lower = grid.quiet_below(here) if attracting else None
    if edge is None:
        others = tuple(window for window in grid.windows() if window != own_window)
        return Searched(None, others, lower, contradicts)
    at, end, certain = edge
    sure = certain and not contradicts
    outermost = Margin(end.inside, None if crossover is None else crossover * end.inside, sure, end.outside)
    others = tuple(window for window in grid.windows() if not _holds(window, factors[at]))
    return Searched(outermost, others, lower, contradicts)


class _Grid:
    """Factors, ascending, at which it is known whether something attracts."""

    def __init__(self, outward: Outward, factors: np.ndarray) -> None:
        self.outward, self.factors = outward, factors
        survey = outward.surveyed(factors, cycles=False)
        self.attracts, self.decided = survey.attracts, survey.decided
        self.motions: list[list[Swinging]] = [[] for _ in factors]
        for motion in survey.motions:
            self.motions[motion.stage].append(motion)

    def know(self, here: int, survey: Attractors) -> None:
        """Take over what a thorough survey of one of the stages shows."""
        self.attracts[here], self.decided[here] = survey.attracts[0], survey.decided[0]
        self.motions[here] = list(survey.motions)

    def last_edge(self, here: int, above: bool) -> tuple[int, AttractionEnd, bool] | None:
        """The last factor, by number, at which something attracts while nothing does at the next one, of those from a
        number on if the edge is looked for `above`, else of those below it; the end of what attracts; and whether that
        is certain. None if there is no such factor."""
        while True:
            falls = np.flatnonzero(self.attracts[:-1] & ~self.attracts[1:])
            falls = falls[falls >= here] if above else falls[falls < here]
            if not falls.size:
                return None
            at = int(falls[-1])
            try:
                end = self.outward.end(float(self.factors[at]), tuple(self.motions[at]), float(self.factors[at + 1]))
            except Beyond:
                self.attracts[at + 1 :] = True
                continue
            passed = (self.factors > self.factors[at]) & (self.factors <= end.inside)
            self.attracts |= passed
            quiet = np.flatnonzero(self.factors > end.inside)
            if end.outside <= end.inside:  # the search was given up beyond it
                settled = quiet[~self.attracts[quiet]]
                if not settled.size:
                    return None
                end = replace(end, outside=float(self.factors[settled[0]]))
            hunts = quiet[self.attracts[quiet]]
            upper = quiet[quiet < hunts[0]] if hunts.size else quiet
            return at, end, bool(end.certain and self.decided[upper].all())

    def quiet_below(self, here: int) -> float | None:
        """The next factor below a number at which nothing attracts, nor at the one below that, if both are known."""
        quiet = np.flatnonzero(~self.attracts[:here])
        if not quiet.size:
            return None
        both = slice(max(int(quiet[-1]) - 1, 0), int(quiet[-1]) + 1)
        sure = not self.attracts[both].any() and bool(self.decided[both].all())
        return float(self.factors[quiet[-1]]) if sure else None

    def windows(self) -> list[BandwidthWindow]:
        """All windows of factors in which something attracts."""
        ends = np.flatnonzero(np.diff(self.attracts.astype(int), prepend=0, append=0))
        last = len(self.factors) - 1
        return [
            BandwidthWindow(
                None if first == 0 else float(self.factors[first - 1]),
                None if after > last else float(self.factors[after]),
            )
            for first, after in zip(ends[::2], ends[1::2], strict=True)
        ]


def _holds(window: BandwidthWindow, factor: float) -> bool:
    return (window.low or 0.0) < factor < (window.high or np.inf)
