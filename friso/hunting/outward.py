"""Where attraction ends: closed orbits followed through the bandwidth to their own ends, one after the other, until
nothing attracts just beyond."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.polynomial import polynomial

from friso.engine.allowance import Exhausted
from friso.equations.bandwidth import faster
from friso.hunting.attractors import Attractors, attractors
from friso.hunting.attractors.survey import Swinging, of_cycles
from friso.hunting.boundary.branch import END_OF_RANGE, NO_FARTHER, REACHED, Point, Tracer
from friso.hunting.boundary.crossing import ENOUGH, SPREAD, crossing
from friso.hunting.boundary.locate import TIGHTER, Bifurcation, changes, last_inside, smoothed, towards, turned
from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.cycle.find import RTOL, Cycles, described, families, find_cycles, kept
from friso.hunting.cycle.held import held_beside
from friso.hunting.cycle.multipliers import multipliers
from friso.hunting.cycle.shooting import close, swings_of_simplest

SCALE = 0.06
"""Change of the logarithm of the bandwidth over which is simulated where no orbit can be followed."""

PRECISE = 1e-5
"""Share of the bandwidth up to which the end of a branch is known."""

PACE, SHORTEST = 3.0, 1e-5
"""How much faster branches are followed than where they are drawn, and their shortest step: the end of a branch that is
lost is known to a thousandth at best."""

NARROW = 1e-3
"""Share of the bandwidth below which a window is narrow."""

FLAT = 3e-4
"""Step along a branch that ends the search for a fold: there the bandwidth changes with the square of it."""

BEYOND, CHATTERING = 1.01, 1.01
"""How far beyond the end of an orbit nothing may attract, as a factor; the same where a limiter chatters, which makes
multipliers rough."""

FARTHER = np.array([1.03, 1.06])
"""Factors beyond the end of an orbit at which it is looked whether something attracts again: windows that nothing
followed leads to lie there most often, and are narrower than the steps of a search through all bandwidths."""

BETWEEN = np.array([0.1, 0.3, 0.6])
"""Shares of the way there at which, as at its end, cycles, and motions beside those that repel, are looked for that
attract over less, or from a narrow range."""

NEAR = 1.03
"""The range of factors about the flip of the simplest cycle over which the curve through its multipliers is laid
again."""

CURVE = 2
"""Degree of the curve from which cycles are closed again there."""

FOUND, LOST, UNCLEAR = "found", "lost", "unclear"
"""What is known of the end of an orbit."""

FIRM = 0.95
"""Size of the multiplier below which an orbit attracts well, when it is lost: it has probably met a corner of the
friction or of a limiter there. Closer to 1 it may attract from too narrow a range for simulations to tell that it does
no more."""

HOPS = 8
"""Orbits that are followed one after the other at most: beyond the end of one another may attract."""

ALONG = 1 + np.array([-0.08, -0.04, -0.02, -0.01, -0.005, -0.0025, 0.0, 0.0025, 0.005, 0.01, 0.02, 0.04, 0.08])
"""Distances from which a motion is followed from one bandwidth to the next, in units of its own."""

AHEAD = np.array([0.04, 0.1, 0.2, 0.4, 0.7, 1.0, 2.0, 4.0])
"""Where it is looked for the end of what could not be followed to it, in units of the scale."""

BRACKET = 0.02
"""Widest share of a bandwidth between a proved attractor and the first bandwidth at which nothing attracts, for an edge
that no orbit was followed to."""

FINER = 4
"""Bandwidths between the two that enclose the end at which is simulated where no orbit can be followed."""


@dataclass(frozen=True)
class AttractionEnd:
    """Two factors of the bandwidth: something attracts at `inside`, nothing does at `outside`. It is `certain` where an
    orbit was followed to its end at `inside`, and simulations at `outside` all settled; or where it was lost at
    `inside`, while it attracted well, and simulations about it at factors in between all settled as well; or where both
    are close together and something was proved to attract at `inside`. That end is known up to a share of it, the
    `reserve`: of an orbit that was lost to the first of these, or as far as `outside`."""

    inside: float
    outside: float
    certain: bool
    reserve: float = PRECISE


@dataclass(frozen=True)
class BandwidthWindow:
    """Bandwidths at which something attracts: its ends, in factors of that of a stage. None: as far as the search
    goes."""

    low: AttractionEnd | None
    high: AttractionEnd | None

    @property
    def narrow(self) -> bool:
        """Whether no machine holds its bandwidth so exactly that it would stay in there (see `NARROW`)."""
        return bool(self.low and self.high and self.high.inside < self.low.inside * (1 + NARROW))

    def holds(self, factor: float) -> bool:
        """Whether something attracts at a factor."""
        low, high = self.low.inside if self.low else 0.0, self.high.inside if self.high else np.inf
        return low <= factor <= high


@dataclass
class _Place:
    """What is known on the way to an end: motions that attract at a factor, `at`; the one `outside` at which nothing
    does; and the last one up to which an orbit was followed that attracts, `proved`."""

    at: float
    motions: tuple[Swinging, ...]
    outside: float
    proved: float | None = None


@dataclass(frozen=True)
class _Suggested:
    """What return maps suggest at factors: `cycles`, of which those that attract are `motions`, and distances [m],
    (factors, n), in motions that go on beside those that repel, `held` (NaN: none)."""

    factors: np.ndarray
    cycles: tuple[Cycles, ...]
    motions: list[Swinging]
    held: np.ndarray

    def like(self, orbit: Swinging) -> np.ndarray:
        """At which factors there is a cycle of the kind of an orbit, attracting or not, (factors,)."""
        assert orbit.cycles is not None
        kind, closed = (orbit.cycles.sign, orbit.cycles.swings), np.zeros(len(self.factors), bool)
        for cycles in self.cycles:
            closed |= cycles.closed & ((cycles.sign, cycles.swings) == kind)
        return closed

    def of(self, numbers: np.ndarray) -> tuple[Cycles, ...]:
        """The cycles at the factors with these numbers."""
        return tuple(family.take(numbers) for family in self.cycles)


class Beyond(Exception):
    """What attracts was followed to the end of the range of bandwidths."""


@dataclass(frozen=True)
class Steps:
    """How orbits are followed to their ends: in steps along the branch from the `first` (None: as usual) to the
    `shortest`, flips and folds being found to steps of their own."""

    first: float | None = None
    shortest: float = SHORTEST
    flip: float = PRECISE
    fold: float = FLAT


@dataclass(frozen=True)
class Outward:
    """The search for the end of what attracts a stage, given as flat keys, from a bandwidth towards the `farthest` one
    (factors). Nothing attracts at the one that is `settled`, if any: a window beyond it is another one. Orbits are
    followed in `steps`."""

    flat: Mapping[str, Any]
    farthest: float
    settled: float | None = None
    steps: Steps = Steps()

    def end(self, at: float, motions: tuple[Swinging, ...], outside: float) -> AttractionEnd:
        """The end of what attracts: these motions do at a factor, nothing does at the one `outside`. Raises Beyond
        where orbits attract as far as the search goes. Where an allowance is used up on the way, the end is as close as
        it is known by then, and not certain: what attracts may have been followed past `outside` by then."""
        place = _Place(at, motions, outside)
        try:
            return self._followed_to_the_end(place)
        except Exhausted:
            return AttractionEnd(place.at, place.outside, False)

    def _followed_to_the_end(self, place: _Place) -> AttractionEnd:
        """The same; the place is what is known on the way."""
        beyond = CHATTERING if self._chatters else BEYOND
        for _ in range(HOPS):
            at, outside = place.at, place.outside
            orbit = next((motion for motion in place.motions if motion.cycles is not None), None)
            if orbit is None:
                place.at, place.motions, place.outside = self._simulated(at, place.motions, outside)
                closed = any(motion.cycles is not None for motion in place.motions)
                if not closed and max(place.outside / place.at, place.at / place.outside) < beyond:
                    break
                continue
            flip = self.flip(at, self._still_ahead(at, outside)) if self._chatters and _is_simple(orbit) else None
            if flip:
                (place.at, reserve), distance, end = flip, orbit.distance, FOUND
            else:
                place.at, distance, end, reserve = self.followed(at, orbit)
            place.proved = at = place.at
            next_to = at * max(beyond, 1 + 2 * reserve) ** self._ahead(at)
            if self._ahead(at) * (next_to - self.farthest) > 0:
                raise Beyond
            suggested = self._suggested(self._towards(at, next_to, reserve))
            starts = np.append(ALONG * distance, suggested.held[-1])
            survey = self.surveyed(np.array([next_to]), starts, suggested=suggested.of(np.array([-1])))
            if survey.attracts[0]:
                place.at, place.motions = next_to, survey.motions
                continue
            mapped = False if end == LOST else suggested.like(orbit)
            closer, decided = self._between(suggested, ALONG * distance, mapped)
            if closer is None:
                window, quiet = self.window_beyond(at)
                if window is not None:
                    place.at, place.motions = window
                    continue
                if end != FOUND:
                    reserve = max(reserve, _apart(float(suggested.factors[0 if end == LOST else -1]), at))
                return AttractionEnd(at, next_to, decided and bool(survey.decided[0]) and quiet, reserve)
            (place.at, place.motions), place.outside = closer, next_to
        return self._quiet_from(place)

    def _towards(self, at: float, next_to: float, reserve: float) -> np.ndarray:
        """Factors from the end of an orbit, known up to a share of it, to the one next to it."""
        factors = np.append(at * (next_to / at) ** BETWEEN, next_to)
        return factors[np.abs(np.log(factors / at)) > reserve]

    def _suggested(self, factors: np.ndarray) -> _Suggested:
        """What the return maps suggest at some factors."""
        stages = self._stages(factors)
        cycles = families(stages)
        motions = [m for family in cycles for m in of_cycles(np.arange(factors.size), family, stages.sticking)]
        return _Suggested(factors, cycles, motions, np.hstack([held_beside(stages, family) for family in cycles]))

    def _between(
        self, suggested: _Suggested, distances: np.ndarray, mapped: np.ndarray | bool
    ) -> tuple[tuple[float, tuple[Swinging, ...]] | None, bool]:
        """The last factor but that next to an end, at which nothing attracts, at which something does of what is
        suggested, or of what simulations find that begin at `distances` [m], (n,), about the orbit that ended, too;
        and what; None if there is none; and whether that is decided. At factors that are `mapped`, (factors,) or all,
        the return map tells what attracts beside that orbit, which repels there, and is tried alone."""
        last = len(suggested.factors) - 1
        motions, decided = [motion for motion in suggested.motions if motion.stage < last], True
        nearest = max((motion.stage for motion in motions), default=-1)
        mapped = np.broadcast_to(mapped, (last + 1,))[:last]
        about = np.where(mapped[:, None], np.nan, distances)
        starts = np.hstack([suggested.held[:last], about])
        doubtful = np.flatnonzero(np.isfinite(starts).any(axis=1))
        doubtful = doubtful[doubtful > nearest]
        if doubtful.size:
            survey = self.surveyed(suggested.factors[doubtful], starts[doubtful], suggested=suggested.of(doubtful))
            motions += [replace(motion, stage=int(doubtful[motion.stage])) for motion in survey.motions]
            decided = bool(survey.decided.all())
        if not motions:
            return None, decided
        at = max(motion.stage for motion in motions)
        return (float(suggested.factors[at]), tuple(motion for motion in motions if motion.stage == at)), decided

    def window_beyond(self, at: float) -> tuple[tuple[float, tuple[Swinging, ...]] | None, bool]:
        """The last of a few factors beyond the end of an orbit, `at`, at which something attracts again, and what; None
        if nothing does; and whether that is decided."""
        factors = at * FARTHER ** self._ahead(at)
        within = self._ahead(at) * (self.farthest - factors) >= 0
        if self.settled is not None:
            within &= (factors < self.settled) == (at < self.settled)
        factors = factors[within]
        if not factors.size:
            return None, True
        survey = self.surveyed(factors, cycles=False)
        decided = survey.decided.copy()
        for number in np.flatnonzero(survey.attracts)[::-1]:
            distances = [motion.distance for motion in survey.motions if motion.stage == number]
            proved = self.surveyed_at_once(factors[number : number + 1], np.outer(distances, ALONG).ravel())
            if proved.attracts[0]:
                return (float(factors[number]), proved.motions), True
            decided[number] = proved.decided[0]
        return None, bool(decided.all())

    def _quiet_from(self, place: _Place) -> AttractionEnd:
        """The first of a few factors ahead of a place from which on nothing was found to attract, by simulations alone
        and by all that the return maps suggest there; certain where that is close to what is proved to attract."""
        at, ahead = place.at, self._ahead(place.at)
        factors = at * np.exp(ahead * SCALE * AHEAD)
        factors = factors[ahead * (self.farthest - factors) >= 0]
        distances = np.outer([motion.distance for motion in place.motions], ALONG).ravel()
        if not factors.size:
            raise Beyond
        survey = self.surveyed(factors, distances)
        attracts, decided = survey.attracts, survey.decided
        for number in range(int(np.flatnonzero(np.append(True, attracts))[-1]), len(factors)):
            outside = factors[number : number + 1]
            suggested = self._suggested(outside)
            confirmed = self.surveyed(
                outside, np.append(distances, suggested.held[0]), suggested=suggested.of(np.zeros(1, np.int64))
            )
            if not confirmed.attracts[0]:
                break
        else:
            raise Beyond
        inside = float(factors[number - 1]) if number else at
        end = AttractionEnd(inside, float(outside[0]), False)
        sure = bool(confirmed.decided[0] and decided[number:].all())
        return self._proved(end, place.proved, distances) if sure else end

    def _proved(self, end: AttractionEnd, proved: float | None, distances: np.ndarray) -> AttractionEnd:
        """An end that simulations tell, certain if it is close to an orbit that was followed, at a factor, or to what a
        thorough survey, from distances [m] as well, shows to attract."""
        if proved is None or _apart(end.outside, proved) > BRACKET:
            proved = end.inside
            survey = attractors(self._stages(np.array([proved])), thorough=True, distances=distances[None, :])
            if not (survey.attracts[0] and survey.decided[0]):
                return end
        apart = _apart(end.outside, proved)
        return AttractionEnd(proved, end.outside, True, apart) if apart <= BRACKET else end

    @np.errstate(all="ignore")  # runs that fail on the way leave infinities behind
    def surveyed(
        self,
        factors: np.ndarray,
        distances: np.ndarray | None = None,
        cycles: bool = True,
        suggested: tuple[Cycles, ...] = (),
    ) -> Attractors:
        """What attracts at some factors, tried from distances [m] as well, the same (n,) for all or (factors, n), all
        starts at once where the cycles that the return maps suggest are known, `suggested`. Without `cycles`
        simulations alone tell: orbits that attract from a narrow range show where they are followed from wider
        ones."""
        begins = None if distances is None else np.broadcast_to(distances, (len(factors), np.shape(distances)[-1]))
        return attractors(self._stages(factors), distances=begins, cycles=cycles, suggested=suggested)

    def surveyed_at_once(self, factors: np.ndarray, distances: np.ndarray) -> Attractors:
        """The same from all starts at once, beside the cycles that the return maps suggest: where motions leave slowly
        what repels, that takes a third of the work."""
        return self.surveyed(factors, distances, suggested=families(self._stages(factors)))

    def _stages(self, factors: np.ndarray) -> Ensemble:
        return Ensemble.held(faster(self.flat, factors), len(factors))

    @property
    def _chatters(self) -> bool:
        return Ensemble.held(self.flat, 1).chatters

    def _ahead(self, at: float) -> float:
        return 1.0 if self.farthest >= at else -1.0

    def _still_ahead(self, at: float, outside: float) -> float:
        """A factor at which nothing attracts; where it was passed, one ahead instead."""
        ahead = self._ahead(at)
        return outside if ahead * (outside - at) > 0 else float(at * np.exp(ahead * SCALE))

    @np.errstate(all="ignore")
    def followed(self, at: float, orbit: Swinging) -> tuple[float, float, str, float]:
        """The last factor at which a closed orbit attracts, the distance [m] at which the stage sticks there; whether
        its end was `FOUND`: a flip, a fold or a torus, or it was `LOST` on the way, where it attracted well, or that is
        `UNCLEAR`; and up to what share of it the factor is known."""
        ahead, cycles = self._ahead(at), orbit.cycles
        assert cycles is not None

        def family(_: np.ndarray, places: np.ndarray) -> Ensemble:
            return self._stages(at * np.exp(ahead * places))

        length = abs(float(np.log(self.farthest / at)))
        how = self.steps
        tracer = Tracer(
            family,
            cycles.sign,
            farthest=length,
            swings=cycles.swings,
            pace=PACE,
            shortest=how.shortest,
            first=how.first,
        )
        start = Point.of(family(np.zeros(1), np.zeros(1)), 0.0, cycles.take(np.array([orbit.number])))
        farthest, reserve = start, PRECISE

        def over(_: Point, point: Point) -> bool:
            nonlocal farthest
            ended = not abs(point.multiplier) < 1 or point.place <= farthest.place
            farthest = farthest if ended else point
            return ended

        points, reason = tracer.walk(start, 1.0, over)
        ended = reason == REACHED
        first, second = ([start, *points])[-2:] if points else (start, start)
        if points and not abs(second.multiplier) < 1 and reason in (REACHED, END_OF_RANGE):
            kind = _kind(first, second)
            last = last_inside(tracer, first, second, kind, how.fold if kind == "fold" else how.flip)
            ended = last is not None
            farthest = max(farthest, last or first, key=lambda point: point.place)
            if last is not None and kind == "fold" and self._chatters:
                turn = turned(tracer, last, towards(first, second))
                ended = turn is not None
                if turn:
                    farthest, reserve = replace(farthest, place=turn.place), max(PRECISE, turn.reserve)
            elif last is not None and self._chatters:
                passed = smoothed(tracer, last, kind)
                ended = passed is not None and (passed.slope < 0) == (kind == "flip")  # beyond it, the orbit repels
                if passed and ended:
                    farthest, reserve = replace(farthest, place=passed.place), max(PRECISE, passed.reserve)
            elif last is not None and kind == "flip":
                rough = _rough(tracer, last, first, second)
                ended, reserve = bool(np.isfinite(rough)), float(np.fmax(PRECISE, rough))
        elif tracer.reaches(points, reason):
            raise Beyond
        lost = LOST if reason.startswith(NO_FARTHER) and abs(farthest.multiplier) < FIRM else UNCLEAR
        end = FOUND if ended else lost
        return float(at * np.exp(ahead * farthest.place)), orbit_distance(farthest, orbit), end, reserve

    @np.errstate(all="ignore")
    def flip(self, at: float, outside: float) -> tuple[float, float] | None:
        """The factor between two at which the simplest cycle begins to repel, and up to what share of it that is known,
        from a curve through its multipliers in between: each of them is rough where a limiter chatters. The curve is
        laid twice, the second time over less; what both differ by, and twice what the multipliers scatter about the
        second one in terms of the factor, is the reserve. None if it does not, or too few are known."""
        factors = np.geomspace(at, outside, SPREAD)
        beyond = find_cycles(self._stages(factors[ENOUGH:]))
        if not np.any(_excess(beyond) > 0):  # it ends in another way
            return None
        within = find_cycles(self._stages(factors[:ENOUGH]))
        first = _crossed(factors, np.append(_excess(within), _excess(beyond)))
        if first is None:
            return None
        near = NEAR ** self._ahead(at)
        closer = np.geomspace(first[0] / near, first[0] * near, SPREAD)
        second = _crossed(closer, _excess(self._interpolated(factors, (within, beyond), closer)))
        return (second[0], max(second[1], abs(second[0] / first[0] - 1))) if second else first

    def _interpolated(self, factors: np.ndarray, parts: tuple[Cycles, ...], wanted: np.ndarray) -> Cycles:
        """The cycles at `wanted` factors, closed from a curve through those at some factors, `parts`."""
        closed = np.concatenate([cycles.closed for cycles in parts])
        states = np.concatenate([cycles.states for cycles in parts])[closed]
        times = np.concatenate([cycles.orbits.times for cycles in parts])[closed]
        scale = np.log(factors[0])
        through = polynomial.polyfit(np.log(factors[closed]) - scale, np.column_stack([states, np.log(times)]), CURVE)
        guess = polynomial.polyval(np.log(wanted) - scale, through).T
        stages = self._stages(wanted)
        orbits = close(stages, guess[:, :-1], np.exp(guess[:, -1]), parts[0].sign, RTOL)
        orbits.closed[~kept(stages, orbits, guess[:, stages.sticking])] = False
        return described(stages, orbits, RTOL)

    def _simulated(
        self, at: float, motions: tuple[Swinging, ...], outside: float
    ) -> tuple[float, tuple[Swinging, ...], float]:
        """The last of some factors at which something attracts that simulations follow from motions at one, `at`, with
        what it is, and the next one, at which nothing does. They may lose it before it ceases to attract."""
        ahead = self._ahead(at)
        farther = self._still_ahead(at, outside)
        factors = np.geomspace(at, farther, FINER + 2)[1:]
        survey = self.surveyed(factors, np.outer([motion.distance for motion in motions], ALONG).ravel())
        attract = np.flatnonzero(survey.attracts)
        if not attract.size:
            return at, motions, float(factors[0])
        last = int(attract[-1])
        beyond = float(factors[last + 1]) if last + 1 < len(factors) else farther * np.exp(ahead * SCALE)
        if ahead * (beyond - self.farthest) > 0:
            raise Beyond
        return float(factors[last]), survey.take(attract[-1:]).motions, beyond


def _apart(factor: float, other: float) -> float:
    """By what share of the other a factor differs from it."""
    return abs(factor / other - 1)


def _excess(cycles: Cycles) -> np.ndarray:
    """By how much the sizes of multipliers exceed 1 (NaN where no cycle was closed)."""
    return np.where(cycles.closed, np.abs(cycles.multiplier) - 1, np.nan)


def _crossed(factors: np.ndarray, excess: np.ndarray) -> tuple[float, float] | None:
    """The factor at which a cycle begins to repel, of some from where it attracts, and up to what share of it that is
    known, by the `excess` of its multipliers; None if it does not, or too few of these are known."""
    closed = np.isfinite(excess)
    if not np.any(excess < 0) or not np.any(excess > 0):
        return None
    passed = crossing(np.linspace(0, 1, len(factors))[closed], excess[closed])
    if passed is None or passed.slope < 0:
        return None
    length = float(np.log(factors[-1] / factors[0]))
    return float(factors[0] * np.exp(passed.place * length)), passed.reserve * abs(length)


def _is_simple(orbit: Swinging) -> bool:
    return orbit.cycles is not None and orbit.cycles.swings == swings_of_simplest(orbit.cycles.sign)


def orbit_distance(point: Point, orbit: Swinging) -> float:
    """The distance [m] at which a stage sticks on an orbit, on the side on which it was followed."""
    return float(np.copysign(np.exp(point.distance), orbit.distance))


def _rough(tracer: Tracer, last: Point, first: Point, second: Point) -> float:
    """Up to what share of its bandwidth a flip is known, between two points, of which `last` is the last before it:
    twice by what the multiplier changes at a tighter tolerance, over its slope. It is rough where a law turns
    sharply, as rolling friction at full deflection. Not finite: it is not known."""
    stages = tracer.family(np.zeros(1, np.int64), np.array([last.place]))
    tight = multipliers(stages, last.cycle.orbits, TIGHTER * tracer.rtol)
    slope = (second.multiplier - first.multiplier) / (second.place - first.place)
    return float(2 * abs(tight.local[0, 0].real - last.multiplier) / abs(slope))


def _kind(first: Point, second: Point) -> Bifurcation:
    """How the orbit ceases to attract from one point to the next, beyond which it repels."""
    kinds = changes(first, second)
    return kinds[0] if kinds else "torus"
