"""How far a stage is from the edge of hunting: the crossover up to which something attracts that hunts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.equations.bandwidth import bandwidth, faster
from friso.hunting.attractors import Attractors, attractors
from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.cycle.find import Cycles, hunting_cycles
from friso.hunting.cycle.shooting import simplest
from friso.stage import Stage

FARTHEST = 10.0
"""Factor up to which the bandwidth is changed."""

STEPS, AT_ONCE = 41, 10
"""Bandwidths that are tried, from the highest down, and how many of them together."""

FINER, ROUNDS = 4, 2
"""Bandwidths between the two that enclose the edge at which is simulated, and how often."""

NEARER = 3
"""Those between two that enclose a flip at which a cycle is closed, each time."""

CHATTERING, ENOUGH = 9, 6
"""The same at once where a limiter chatters, and cycles of these that have to be known for a curve to be laid through
their multipliers, which are rough."""

ABOVE = 1.01
"""How far above the bandwidth at which a cycle flips nothing else may attract."""

ALONG = 1 + np.array([-0.08, -0.04, -0.02, -0.01, -0.005, 0.0, 0.005, 0.01, 0.02, 0.04, 0.08])
"""Distances from which a motion is followed from one bandwidth to the next, in units of its own."""


@dataclass(frozen=True)
class Margin:
    """The edge of hunting in bandwidth.

    For a stage that something attracts it is the last one: from there up to ten times the bandwidth nothing is known
    to attract. For others it is the nearest below: hunting is possible there. `factor` is the bandwidth at the edge
    over that of the stage, `crossover` [Hz] the crossover there (None for a controller given by its gains, all of whose
    poles and zeros the factor scales). It is `certain` where a cycle was followed to its flip, nothing else attracts
    just above, and no simulation beyond that failed or was stopped undecided; else it lies about there.
    """

    factor: float
    crossover: float | None
    certain: bool


def margin(stage: Stage, attracting: bool) -> Margin | None:
    """The last edge above the bandwidth of a stage that something attracts, or the next one below that of one that
    nothing does; None within a factor of ten."""
    flat, own = stage.flat(), bandwidth(stage.flat())
    factors = np.geomspace(FARTHEST, 1.0, STEPS) if attracting else np.geomspace(1.0, 1 / FARTHEST, STEPS)
    edge = _nearest(flat, factors, attracting)
    if edge is None:
        return None
    factor, certain = (1.0, False) if isinstance(edge, str) else _located(flat, edge)
    return Margin(factor, None if own is None else own * factor, certain)


class _Edge:
    """Two factors that enclose the edge: something attracts at the lower one, nothing does at the higher one."""

    def __init__(self, flat: Mapping[str, Any], factors: np.ndarray, known: Attractors, a: int, b: int) -> None:
        self.flat = flat
        self.low, self.high = float(factors[a]), float(factors[b])
        self.inside, self.outside = known.take(np.array([a])), known.take(np.array([b]))
        self.certain = bool(known.known[[a, b]].all())

    def narrow(self, factors: np.ndarray) -> None:
        """Take the last of some factors in between, ascending, at which something attracts, and the next one."""
        distances = np.outer([motion.distance for motion in self.inside.motions], ALONG).ravel()
        known = _known(self.flat, factors, np.tile(distances, (len(factors), 1)))
        attract = np.flatnonzero(known.attracts)
        last = int(attract[-1]) if attract.size else -1
        if last >= 0:
            self.low, self.inside = float(factors[last]), known.take(np.array([last]))
        if last < len(factors) - 1:
            self.high, self.outside = float(factors[last + 1]), known.take(np.array([last + 1]))
        self.certain &= bool(known.known[max(last, 0) :].all())

    def between(self, count: int) -> np.ndarray:
        """So many factors between the two."""
        return np.geomspace(self.low, self.high, count + 2)[1:-1]

    @property
    def may_flip(self) -> bool:
        """Whether what attracts at the lower factor is a cycle that goes towards a flip."""
        cycles = [motion.cycles for motion in self.inside.motions]
        return any(cycle is not None and cycle.swings == simplest(cycle.sign) for cycle in cycles)


def _nearest(flat: Mapping[str, Any], factors: np.ndarray, attracting: bool) -> _Edge | str | None:
    """The edge before the first of some factors, descending, at which something attracts; None if that is the first
    one, or there is none; "missed" if that contradicts what is known of the stage itself, at the factor 1."""
    told = True
    for start in range(0, len(factors), AT_ONCE):
        part = factors[max(start - 1, 0) : start + AT_ONCE]
        known = _known(flat, part)
        attract = np.flatnonzero(known.attracts)
        told &= bool(known.known[: attract[0] if attract.size else None].all())
        if attract.size and attract[0]:
            edge = _Edge(flat, part, known, int(attract[0]), int(attract[0]) - 1)
            edge.certain &= told
            return edge
        if attract.size:
            return None if attracting else "missed"
    return "missed" if attracting else None


@np.errstate(all="ignore")  # runs that fail on the way leave infinities behind
def _known(flat: Mapping[str, Any], factors: np.ndarray, tried: np.ndarray | None = None) -> Attractors:
    return attractors(Ensemble.held(faster(flat, factors), len(factors)), tried=tried)


@np.errstate(all="ignore")
def _cycles(flat: Mapping[str, Any], factors: np.ndarray) -> Cycles:
    return hunting_cycles(Ensemble.held(faster(flat, factors), len(factors)))


def _located(flat: Mapping[str, Any], edge: _Edge) -> tuple[float, bool]:
    """The factor at the edge, and whether it is certain: where a cycle flips, if nothing else attracts just above; else
    as far as motions were followed, which may end sooner than what attracts does."""
    flip = _flip(flat, edge.low, edge.high) if edge.may_flip else None
    if flip is not None:
        if flip * ABOVE < edge.high:
            edge.narrow(np.array([flip * ABOVE]))
        if edge.low < flip * ABOVE:
            return flip, edge.certain
    for _ in range(ROUNDS):
        edge.narrow(edge.between(FINER))
    return float(np.sqrt(edge.low * edge.high)), False


def _flip(flat: Mapping[str, Any], low: float, high: float) -> float | None:
    """The factor between two at which the cycle that attracts at the lower one begins to repel, from the multipliers in
    between (where a limiter chatters, from a curve through them); None if it does not."""
    chatters = Ensemble.held(flat, 1).chatters
    for last in (False, True):
        factors = np.geomspace(low, high, CHATTERING if chatters else NEARER + 2)
        cycles = _cycles(flat, factors)
        there = np.flatnonzero(cycles.found)
        off, places = np.abs(cycles.multiplier) - 1, np.log(factors / low)
        attract = there[off[there] < 0]
        beyond = there[(off[there] >= 0) & (there > attract.max(initial=-1))]
        if not attract.size or not beyond.size:
            return None
        a, b = attract[-1], beyond[0]
        if chatters and there.size >= ENOUGH:
            roots = np.roots(np.polyfit(places[there], off[there], 3))
            real = roots.real[np.abs(roots.imag) < 1e-9]
            inside = real[(real >= 0) & (real <= places[-1])]
            return float(low * np.exp(inside.max())) if inside.size else None
        if last:
            return float(factors[a] * (factors[b] / factors[a]) ** (-off[a] / (off[b] - off[a])))
        low, high = float(factors[a]), float(factors[b])
    return None
