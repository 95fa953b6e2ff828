"""Define paths through stages: one parameter of a stage moves, and hunting begins and ends on the way.

Along a path, the orbits of one branch are closed to find where the branch ceases to attract.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from friso.equations.bandwidth import faster, least_static_factor, with_static_friction
from friso.hunting.attractors.survey import Swinging, of_cycles
from friso.hunting.cycle.ensemble import Ensemble, stuck
from friso.hunting.cycle.find import CYCLE_RTOL, described, kept
from friso.hunting.cycle.shooting import close


@dataclass(frozen=True)
class SearchLimits:
    """Range and steps of a search for hunting, for messages that quote them.

    Bandwidths are searched from `lowest_bandwidth` to `highest_bandwidth`, in units of the stage's own. Steps per
    factor of ten are `steps_to_edge` where an edge is looked for, and `steps_beyond` where hunting may come back.
    Windows narrower than a step may be missed. Static friction is searched up to `most_friction` times the stage's own,
    and down to its inverse, or to Coulomb friction. Advice stays `edge_distance`, a factor, away from an edge, because
    machines differ and searches may miss a window. A window is narrow if its ends differ by less than the factor
    `narrow_window`. Moves are drawn between `move_shares` of the acceleration, and of
    the acceleration time, in the stage file.
    """

    lowest_bandwidth: float = 0.25
    highest_bandwidth: float = 10.0
    steps_to_edge: int = 20
    steps_beyond: int = 10
    edge_distance: float = 1.2
    narrow_window: float = 1.01
    most_friction: float = 3.0
    move_shares: tuple[float, float] = (0.1, 2.0)


SEARCH_LIMITS = SearchLimits()

MORE_WORK = "more work than a check may"
"""Words of every message on what was given up for lack of work; beside them a check names the commands that go on."""


LossKind = Literal["flip", "fold", "torus", "lost", "seen"]
"""How attraction ends: the orbit flips, folds back or becomes a torus there, was lost, or surveys enclose the end."""


@dataclass(frozen=True)
class AttractionEnd:
    """Where attraction ends, between two factors of a parameter.

    The stage has an attractor at `inside` and none at `outside`. The end is `certain` under four conditions: an orbit
    was followed to its end or its loss at `inside`, or an attractor was seen there; no attractor exists at `outside`;
    all runs decided; and both factors are close together. `reserve` is the relative error, and `kind` says how
    attraction ends.
    """

    inside: float
    outside: float
    certain: bool
    kind: LossKind = "seen"

    @property
    def reserve(self) -> float:
        """Return the relative error of the end: by what fraction both factors differ."""
        return abs(self.outside / self.inside - 1)


@dataclass(frozen=True)
class BandwidthWindow:
    """A window of bandwidths in which a stage hunts, or its loop is unstable, by its ends `low` and `high`.

    The ends are in factors of the stage's own bandwidth (None: the window reaches the end of the search).
    """

    low: AttractionEnd | None
    high: AttractionEnd | None

    def holds(self, factor: float) -> bool:
        """Tell whether a factor of the stage's own bandwidth lies in this window."""
        low, high = self.low.inside if self.low else 0.0, self.high.inside if self.high else np.inf
        return low <= factor <= high

    def lies(self, side: int, factor: float) -> bool:
        """Tell whether this window lies above (`side` 1) or below (-1) a factor of the stage's own bandwidth."""
        near = self.low if side > 0 else self.high
        return near is not None and side * (near.inside - factor) > 0

    def without(self, other: BandwidthWindow) -> tuple[BandwidthWindow, ...]:
        """Return the parts of this window below and above another one; where both overlap, the other counts.

        A part that is narrower than the error of an end is left out.
        """
        if (other.high and not self._reaches(other.high, -1)) or (other.low and not self._reaches(other.low, 1)):
            return (self,)
        parts = []
        if other.low and self._reaches(other.low, -1):
            parts.append(
                BandwidthWindow(self.low, replace(other.low, inside=other.low.outside, outside=other.low.inside))
            )
        if other.high and self._reaches(other.high, 1):
            parts.append(
                BandwidthWindow(replace(other.high, inside=other.high.outside, outside=other.high.inside), self.high)
            )
        return tuple(parts)

    def _reaches(self, place: AttractionEnd, side: int) -> bool:
        """Tell whether part of this window surely lies above (`side` 1) or below (-1) the end of another one."""
        end = self.high if side > 0 else self.low
        return end is None or side * (end.inside / place.inside - 1) > end.reserve + place.reserve


@dataclass(frozen=True)
class ParameterPath:
    """Stages along which one parameter moves.

    `stages` makes them, with the parameter times factors (count,). `factors`, ascending, are those surveyed at first;
    the one numbered `own` is 1, the stage itself. `beyond` are the factors past an orbit's end at which other
    attractors are looked for.
    """

    stages: Callable[[np.ndarray], Ensemble]
    factors: np.ndarray
    own: int
    beyond: tuple[float, ...]

    @classmethod
    def of(
        cls,
        scaled: Callable[[np.ndarray], Mapping[str, Any]],
        below: np.ndarray,
        above: np.ndarray,
        beyond: tuple[float, ...],
    ) -> ParameterPath:
        """Make a path from ascending factors below and above 1, either of which may be empty.

        `scaled` gives the stages' keys in SI, with the parameter times factors (count,).
        """

        def stages(factors: np.ndarray) -> Ensemble:
            return Ensemble.held(scaled(factors), len(factors))

        return cls(stages, np.concatenate([below, [1.0], above]), len(below), beyond)

    def numbers(self, side: int) -> np.ndarray:
        """Return the numbers of the factors above (`side` 1) or below (-1) the stage's own, outward."""
        return np.arange(self.own + 1, len(self.factors)) if side > 0 else np.arange(self.own - 1, -1, -1)


BEYOND_BANDWIDTHS = (1.0095, 1.03, 1.06)
"""Factors beyond the end of an orbit in bandwidth at which other attractors are looked for. The first makes the
edge accurate to one per cent. Most windows to which no orbit leads lie at the others, and they are narrower than
the steps of a search through all bandwidths."""


def bandwidth_path(flat: Mapping[str, Any], attracting: bool) -> ParameterPath:
    """Return the path along which the whole controller of a stage becomes faster.

    `flat` has the stage's keys in SI. Factors lie closer on the side where an edge is expected: above for an
    `attracting` stage, else below.
    """
    fine, coarse = SEARCH_LIMITS.steps_to_edge, SEARCH_LIMITS.steps_beyond
    to_lower, to_higher = (coarse, fine) if attracting else (fine, coarse)
    lowest, highest = SEARCH_LIMITS.lowest_bandwidth, SEARCH_LIMITS.highest_bandwidth
    below = np.geomspace(lowest, 1.0, round(-to_lower * np.log10(lowest)), endpoint=False)
    above = np.geomspace(1.0, highest, round(to_higher * np.log10(highest)) + 1)[1:]
    return ParameterPath.of(lambda factors: faster(flat, factors), below, above, BEYOND_BANDWIDTHS)


def static_friction_path(flat: Mapping[str, Any]) -> ParameterPath:
    """Return the path along which static friction changes and Coulomb friction is held.

    It begins where both are equal, or at a fraction given by `SEARCH_LIMITS`. `flat` has the stage's keys in SI.
    """
    lowest = max(least_static_factor(flat), 1 / SEARCH_LIMITS.most_friction)
    return _path_of_factors(lambda factors: with_static_friction(flat, factors), lowest)


def key_path(flat: Mapping[str, Any], key: str) -> ParameterPath:
    """Return the path along which one key of a stage changes; `flat` has the stage's keys in SI."""
    return _path_of_factors(lambda factors: {**flat, key: flat[key] * factors}, 1 / SEARCH_LIMITS.most_friction)


MARGIN_STEPS = (0.04, 0.08, 0.13, 0.19, 0.28, 0.42, 0.65, 1.0)  # [of the log of the farthest factor]
"""Values tried first on either side of the stage's own. They lie closest together near it, and are as many as most
processors run at once."""

BEYOND_FACTORS = (1.03, 1.06)
"""Factors beyond the end of an orbit in another parameter, which is shown with fewer digits. Nearer, motions take
long to decay."""


def _path_of_factors(scaled: Callable[[np.ndarray], Mapping[str, Any]], lowest: float) -> ParameterPath:
    """Return a path from the factor `lowest`, at most 1, to the highest one; its steps grow outward."""
    steps = np.array(MARGIN_STEPS)
    below = lowest ** steps[::-1] if lowest < 1 else np.empty(0)
    return ParameterPath.of(scaled, below, SEARCH_LIMITS.most_friction**steps, BEYOND_FACTORS)


CHATTERING_EDGE_STEP = 2e-3  # [log of the parameter]
"""Step with a chattering limiter. Shorter steps follow the roughness of multipliers."""

FLIP_SEARCH_STEP = 1e-4  # [log of the parameter]
"""Precision of a flip; the edge is shown with four digits."""

LONGEST_EDGE_STEP = 0.12  # [log of the parameter]
"""Longest step between orbits that are closed on the way to an edge. Over more, Newton's method mostly fails."""

MET_MULTIPLIER_SHARE = 0.01
"""Largest difference of a multiplier from its limit at an orbit that is taken for the end. A multiplier that jumps
past its limit does not come so near."""


@dataclass
class OrbitLine:
    """Closed orbits of one branch along a path, stable or not, in the direction `ahead`: 1 up, -1 down.

    They are closed at `places`, logarithms of factors, ascending in that direction. There they have `states` (count,
    states), return after `times` [s], or to their mirror image if `sign` is -1, and have a `multiplier`, all (count,).
    `swings` counts swings in that time. Orbits are closed to the relative tolerance `rtol`.
    """

    path: ParameterPath
    rtol: float
    ahead: float
    sign: float
    swings: int
    places: np.ndarray
    states: np.ndarray
    times: np.ndarray
    multiplier: np.ndarray

    @classmethod
    def of(
        cls, path: ParameterPath, ahead: float, factor: float, motion: Swinging, rtol: float = CYCLE_RTOL
    ) -> OrbitLine:
        """Begin with the closed orbit of a motion of the stage at a factor."""
        assert motion.cycles is not None
        one = motion.cycles.take(np.array([motion.number]))
        orbits, places = one.orbits, np.log([factor])
        return cls(path, rtol, ahead, one.sign, one.swings, places, orbits.states, orbits.times, one.multiplier)

    def distance(self, factor: float) -> float:
        """Return the distance [m] at which the stage sticks on the orbit nearest to a factor."""
        nearest = int(np.abs(self.places - np.log(factor)).argmin())
        return float(self.states[nearest, self._stages(self.places[:1]).sticking])

    @np.errstate(all="ignore")  # runs that fail on the way leave infinities behind
    def close_at(self, place: float) -> tuple[Swinging, ...]:
        """Close the orbit at a further place, if that succeeds, and return it if it is stable.

        There is no orbit over half a period where the stage is not symmetric.
        """
        stages, (states, times) = self._stages(np.array([place])), self._guessed(place)
        if self.sign < 0 and not stages.symmetric[0]:
            return ()
        rtol = stages.searching_rtol(self.rtol)
        orbits = close(stages, states, times, self.sign, rtol, self.swings)
        orbits.closed[:] &= kept(stages, orbits, states[:, stages.sticking])
        cycles = described(stages, orbits, rtol)
        if not cycles.closed[0]:
            return ()
        k = int((self.ahead * self.places).searchsorted(self.ahead * place))
        self.places, self.states = np.insert(self.places, k, place), np.insert(self.states, k, orbits.states[0], axis=0)
        self.times = np.insert(self.times, k, orbits.times[0])
        self.multiplier = np.insert(self.multiplier, k, cycles.multiplier[0])
        return tuple(of_cycles(np.zeros(1, np.int64), cycles, stages.sticking))

    def _guessed(self, place: float) -> tuple[np.ndarray, np.ndarray]:
        """Predict the states, (1, states), and the time of return [s], (1,), of the orbit at a place.

        Both are extrapolated from closed orbits: of a state, how far it is from that of a stage that sticks at rest at
        the same distance, which scales with the controller.
        """
        known, weights = self._stages(self.places), _weights(self.places, place)
        sticks = self.states[:, known.sticking]
        off, logs = self.states - stuck(known, sticks), np.log([np.abs(sticks), self.times])
        distance, time = np.exp(logs @ weights)
        distances = np.copysign([distance], sticks[0])
        return stuck(self._stages(np.array([place])), distances) + weights @ off, np.array([time])

    def _stages(self, places: np.ndarray) -> Ensemble:
        """Return the stages at places, (count,)."""
        return self.path.stages(np.exp(places))

    def end(self, outside: float, farthest: float) -> tuple[float, LossKind] | None:
        """Find the last factor at which the branch attracts, from its first orbit on, and how it ends.

        The branch is followed to the factor `outside`, and on for as long as it attracts, up to the `farthest` one.
        Returns None if it attracts up to there. Between an orbit that attracts and one that does not, the end is where
        the multiplier passes its limit. Where it jumps past it, interpolation hardly moves one of both orbits: every
        third one is closed half-way.
        """
        chatters, last = self._stages(self.places[:1]).chatters, float(np.log(farthest))
        tolerance = CHATTERING_EDGE_STEP if chatters else FLIP_SEARCH_STEP
        step, tries = min(abs(float(np.log(outside)) - self.places[0]), LONGEST_EDGE_STEP), 0
        while True:
            at = self._last_stable
            low, beyond = float(self.places[at]), self.places[at + 1 :]
            if low == last:
                return None
            if beyond.size:
                target = self._root(at)
                near = int(np.abs(self.places - target).argmin())
                met = abs(abs(self.multiplier[near]) - 1) < MET_MULTIPLIER_SHARE
                if (met and abs(self.places[near] - target) < tolerance) or abs(beyond[0] - low) < tolerance:
                    return float(np.exp(target)), self._kind(at)
                tries += 1
                target = target if tries % 3 else (low + float(beyond[0])) / 2
            else:
                target = low + self.ahead * step if step < abs(last - low) else last
            self.close_at(target)
            closed = target in self.places
            step = min(1.5 * step, LONGEST_EDGE_STEP) if closed else step / 3
            if not closed and (beyond.size or step < max(tolerance, np.log(self.path.beyond[0]) / 32)):
                return float(np.exp(low)), "lost"

    @property
    def _last_stable(self) -> int:
        """Return the number of the last orbit up to which, from the first one on, all are stable."""
        unstable = np.flatnonzero(~(np.abs(self.multiplier) < 1))
        return int(unstable[0]) - 1 if unstable.size else len(self.places) - 1

    def _kind(self, at: int) -> LossKind:
        """Return how the branch ceases to attract between the orbit numbered `at` and the next."""
        return "flip" if self.multiplier[at + 1] < 0 else "fold" if self.multiplier[at] > 0 else "torus"

    def _root(self, at: int) -> float:
        """Return the place at which the multiplier passes its limit, between the orbit numbered `at` and the next.

        The place is interpolated as a polynomial of the multiplier.
        """
        limit = np.sign(self.multiplier[at + 1])
        for near in (slice(max(at - 1, 0), at + 3), slice(at, at + 2)):
            places, off = self.places[near], self.multiplier[near] - limit
            root = float(
                sum(p * np.prod([o / (o - own) for o in off if o != own]) for p, own in zip(places, off, strict=True))
            )
            if (root - self.places[at]) * (root - self.places[at + 1]) <= 0:
                break
        return root


def _weights(places: np.ndarray, place: float) -> np.ndarray:
    """Return the weights of values at `places`, (count,), that extrapolate them to a place by at most a parabola.

    The nearest places count, as far as they lie apart by half of the way to the nearest one.
    """
    chosen: list[int] = []
    for k in np.abs(places - place).argsort(kind="stable").tolist():
        apart = abs(places[chosen[0]] - place) / 2 if chosen else 0.0
        if all(abs(places[k] - places[other]) > apart for other in chosen):
            chosen.append(k)
        if len(chosen) == 3:
            break
    weights = np.zeros(len(places))
    for k in chosen:
        weights[k] = np.prod([(place - places[j]) / (places[k] - places[j]) for j in chosen if j != k])
    return weights
