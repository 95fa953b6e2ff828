"""Where hunting ends, over the bandwidth: the return maps of many bandwidths tell where, an orbit tells exactly."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from friso.equations.bandwidth import bandwidth, faster
from friso.hunting.attractors.survey import Swinging
from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.limits import SEARCH_LIMITS
from friso.hunting.margin import Margin, SearchedBandwidths
from friso.hunting.outward import FOUND, LOST, AttractionEnd, BandwidthWindow, Beyond, Outward, Steps
from friso.hunting.restabilised import windows_again
from friso.hunting.return_map.attracting import of_stages, survey_maps
from friso.hunting.return_map.mapped import Mapped, map_stages

GRID = np.concatenate([[0.003], np.geomspace(0.02, 3.0, 14)])
"""Distances at which stages are stuck at first, in units of the deflection of the loop by the break-away force."""

SKETCH = 1e-5
"""Relative tolerance of the runs."""

BETWEEN = 4
"""Bandwidths between the end of an orbit and the next one of the grid at which it is looked for what else attracts."""

BEYOND = np.array([1.003, 1.01])
"""Factors beyond the end of an orbit at which nothing may attract."""

STEPS = Steps(first=0.03, shortest=5e-4, flip=1e-4, fold=1e-3)
"""How orbits are followed: a grid's step is 0.1 to 0.2."""

HOPS = 4
"""Orbits that are followed one after the other at most: beyond the end of one another may attract."""


class MapsOverBandwidth:
    """What attracts a stage, given as flat keys, over factors of its bandwidth, ascending."""

    def __init__(
        self, flat: Mapping[str, Any], factors: np.ndarray, decided: Mapping[int, tuple[Swinging, ...]]
    ) -> None:
        """Look at all factors but the `decided` ones, whose motions that attract are given by number."""
        self.flat, self.factors = flat, factors
        self.mapped = self.maps(factors, 1)
        self.attracts = self.mapped.attracts
        self.motions = dict(decided)
        for number, motions in decided.items():
            self.attracts[number] = bool(motions)
        self.confirmed()

    def maps(self, factors: np.ndarray, rounds: int = 2) -> Mapped:
        """The return maps at some factors."""
        return map_stages(Ensemble.held(faster(self.flat, factors), len(factors)), GRID, rounds, SKETCH, sparse=True)

    def confirmed(self) -> None:
        """Close orbits at the ends of what seems to attract, until they do."""
        while True:
            ends = {end for span in spans(self.attracts) for end in span} - self.motions.keys()
            if not ends:
                return
            numbers = np.array(sorted(ends))
            for number, motions in zip(numbers.tolist(), _attracting(self.mapped.take(numbers)), strict=True):
                self.motions[number] = motions
                self.attracts[number] = bool(motions)

    def end(self, inside: int, outside: int) -> AttractionEnd | None:
        """The end of what attracts at a factor of the grid, but not at the next one; None: as far as the grid goes."""
        low, high = float(self.factors[inside]), float(self.factors[outside])
        ahead = 1 if high > low else -1
        motions = self.motions[inside]
        outward = Outward(self.flat, SEARCH_LIMITS.bandwidth_factor**ahead, steps=STEPS)
        for _ in range(HOPS):
            orbit = next((motion for motion in motions if motion.cycles is not None), None)
            if orbit is None:
                return AttractionEnd(low, high, False)
            try:
                end, reserve, how = _followed(outward, low, orbit, high)
            except Beyond:
                return None
            apart = reserve if how == FOUND else max(reserve, BEYOND[0] - 1)
            beyond = end * (1 + max(apart, 1e-4)) ** ahead * BEYOND**ahead
            if ahead * np.log(high / beyond[-1]) > BEYOND[-1] - 1:
                beyond = np.append(beyond, np.geomspace(beyond[-1], high, BETWEEN + 2)[1:-1])
            after = survey_maps(Ensemble.held(faster(self.flat, beyond), len(beyond)))
            if not after.attracts.any():
                return AttractionEnd(end, float(beyond[1]), bool(after.resolved.all()), apart)
            last = int(np.flatnonzero(after.attracts)[-1])
            low, motions = float(beyond[last]), tuple(m for m in after.motions if m.stage == last)
            high = high if ahead * (high - low) > 0 else low * 1.03**ahead
        return AttractionEnd(low, high, False)

    def windows(self) -> list[BandwidthWindow]:
        """The windows of factors in which something attracts, ascending."""
        windows: list[BandwidthWindow] = []
        last = len(self.factors) - 1
        for low, high in spans(self.attracts):
            if windows and windows[-1].holds(float(self.factors[low])):
                continue  # it attracts farther than the grid showed
            lower = self.end(low, low - 1) if low else None
            windows.append(BandwidthWindow(lower, self.end(high, high + 1) if high < last else None))
        return windows


def _attracting(mapped: Mapped) -> list[tuple[Swinging, ...]]:
    """What attracts each of the stages."""
    survey = survey_maps(mapped.stages, mapped=mapped)
    return of_stages(survey.motions, mapped.stages.count)


def _followed(outward: Outward, at: float, orbit: Swinging, outside: float) -> tuple[float, float, str]:
    """The factor at which an orbit ceases to attract, up to what share of it that is known, and how (see `Outward`)."""
    stages = Ensemble.held(outward.flat, 1)
    if stages.chatters and orbit.swings == 2:
        flip = outward.flip(at, outside)
        if flip:
            return flip[0], flip[1], FOUND
    end, _, how, reserve = outward.followed(at, orbit)
    return end, reserve, FOUND if how == FOUND else LOST


def search_by_maps(flat: Mapping[str, Any], own: tuple[Swinging, ...]) -> SearchedBandwidths:
    """Where something attracts, over bandwidths from a tenth to ten times that of a stage, which its `own` motions
    attract."""
    crossover, farthest = bandwidth(flat), SEARCH_LIMITS.bandwidth_factor
    fine, coarse = SEARCH_LIMITS.steps_to_edge, SEARCH_LIMITS.steps_beyond
    index, above = (coarse, fine) if own else (fine, coarse)
    below = np.geomspace(1 / farthest, 1.0, index, endpoint=False)
    factors = np.concatenate([below, np.geomspace(1.0, farthest, above + 1)])
    maps = MapsOverBandwidth(flat, factors, {index: own})
    windows = maps.windows()
    edges = [window.high for window in windows if window.high and (window.high.inside >= 1) == bool(own)]
    end, again = edges[-1] if edges else None, _again(flat, maps, windows)
    margin = end and Margin(
        end.inside, None if crossover is None else crossover * end.inside, end.certain, end.outside, end.reserve
    )
    home = next((window for window in windows if own and window.holds(1.0)), None)
    others = tuple(window for window in windows if end is None or window.high is not end)
    return SearchedBandwidths(margin, (*others, *again), home.low if home else None)


def _again(
    flat: Mapping[str, Any], maps: MapsOverBandwidth, besides: Sequence[BandwidthWindow]
) -> tuple[BandwidthWindow, ...]:
    """Windows in which cycles that repel attract again, next to the folds in which they end."""
    returns = np.array([landing_map.returns for landing_map in maps.mapped.maps])
    windows: list[BandwidthWindow] = []
    for ahead in (1, -1):
        order = np.arange(len(maps.factors))[::ahead]
        for here, there in pairwise(order.tolist()):
            if not (returns[here] and not returns[there] and not maps.attracts[here]):
                continue
            between = np.geomspace(maps.factors[here], maps.factors[there], 6)
            finer = [k for k, landing_map in enumerate(maps.maps(between).maps) if landing_map.returns]
            at = float(between[finer[-1]]) if finer else float(maps.factors[here])
            windows += windows_again(flat, at, float(maps.factors[there]), (*besides, *windows))
    return tuple(windows)


def spans(attracts: np.ndarray) -> list[tuple[int, int]]:
    """The first and last of neighbouring factors, by number, at which something attracts."""
    ends = np.flatnonzero(np.diff(attracts.astype(int), prepend=0, append=0))
    return [(int(first), int(after) - 1) for first, after in zip(ends[::2], ends[1::2], strict=True)]
