"""How far a stage is from the edge of hunting: the crossover at which its hunting cycle stops attracting."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from friso.equations.bandwidth import bandwidth, faster
from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.cycle.find import Cycles, hunting_cycles
from friso.stage import Stage

FARTHEST = 10.0
"""Factor up to which the bandwidth is changed."""

STEPS, AT_ONCE = 41, 10
"""Bandwidths that are tried on the way there, and how many of them together on the way down."""

FINER, ROUNDS = 9, 2
"""Steps between the two that enclose the edge, and how often they are taken."""

ENOUGH = 6
"""Cycles of these steps that have to be known for a curve to be laid through their multipliers, which are rough where
a limiter chatters."""


@dataclass(frozen=True)
class Margin:
    """The edge of hunting in bandwidth.

    For a stage whose cycle attracts it is the last one: from there up to ten times the bandwidth no cycle is known to
    attract. For others it is the nearest below: hunting is possible there. `factor` is the bandwidth at the edge over
    that of the stage, `crossover` [Hz] the crossover there (None for a controller given by its gains, all of whose
    poles and zeros the factor scales). It is `certain` unless a cycle next to the edge could not be computed.
    """

    factor: float
    crossover: float | None
    certain: bool


def margin(stage: Stage, attracting: bool) -> Margin | None:
    """The last edge above the bandwidth of a stage whose cycle attracts, or the next one below that of one whose cycle
    does not; None within a factor of ten."""
    flat = stage.flat()
    factors = np.geomspace(1.0, FARTHEST if attracting else 1 / FARTHEST, STEPS)
    edge = _last(flat, factors) if attracting else _next(flat, factors)
    if edge is None:
        return None
    if Ensemble.held(flat, 1).chatters:
        edge = _smoothed(flat, edge)
    else:
        for _ in range(ROUNDS):
            edge = (_last if attracting else _next)(flat, np.geomspace(edge.low, edge.high, FINER)) or edge
    factor = edge.low * (edge.high / edge.low) ** edge.share
    own = bandwidth(flat)
    crossover = None if own is None else own * factor
    return Margin(factor, crossover, edge.certain)


def _smoothed(flat: Mapping[str, Any], edge: _Edge) -> _Edge:
    """The edge by a cubic through the multipliers between; as it is where too few are known."""
    places, share = np.linspace(0, 1, FINER), edge.share
    cycles = _cycles(flat, edge.low * (edge.high / edge.low) ** places)
    if np.count_nonzero(cycles.found) >= ENOUGH:
        off = np.abs(cycles.multiplier[cycles.found]) - 1
        roots = np.roots(np.polyfit(places[cycles.found], off, 3))
        inside = roots.real[(np.abs(roots.imag) < 1e-9) & (roots.real >= 0) & (roots.real <= 1)]
        share = float(inside[np.abs(inside - share).argmin()]) if inside.size else share
    return replace(edge, share=share)


@dataclass(frozen=True)
class _Edge:
    """Two factors that enclose the edge, where between them the multiplier passes 1, as a share of the way in their
    logarithms, and whether both cycles are known."""

    low: float
    high: float
    share: float
    certain: bool


def _last(flat: Mapping[str, Any], factors: np.ndarray) -> _Edge | None:
    """The edge behind the last factor at which the cycle attracts; None if that is the last one, or there is none."""
    cycles = _cycles(flat, factors)
    attract = np.flatnonzero(cycles.attracting)
    if not attract.size or attract[-1] == len(factors) - 1:
        return None
    return _edge(factors, cycles, int(attract[-1]), int(attract[-1]) + 1)


def _next(flat: Mapping[str, Any], factors: np.ndarray) -> _Edge | None:
    """The edge before the first factor at which the cycle attracts; None if that is the first one, or there is none."""
    for start in range(0, len(factors), AT_ONCE):
        part = factors[max(start - 1, 0) : start + AT_ONCE]
        cycles = _cycles(flat, part)
        attract = np.flatnonzero(cycles.attracting)
        if attract.size:
            return _edge(part, cycles, int(attract[0]) - 1, int(attract[0])) if attract[0] else None
    return None


@np.errstate(all="ignore")  # runs that fail on the way leave infinities behind
def _cycles(flat: Mapping[str, Any], factors: np.ndarray) -> Cycles:
    return hunting_cycles(Ensemble.held(faster(flat, factors), len(factors)))


def _edge(factors: np.ndarray, cycles: Cycles, a: int, b: int) -> _Edge:
    size = np.abs(cycles.multiplier)
    share = (1 - size[a]) / (size[b] - size[a])
    share = float(share) if np.isfinite(share) and 0 <= share <= 1 else 0.5  # the middle where one is unknown
    certain = not cycles.uncertain[[a, b]].any()
    return _Edge(float(factors[a]), float(factors[b]), share, bool(certain))
