"""Search a path for hunting: survey stages at a grid of factors, and follow attraction from there to its ends.

A closed orbit is followed to its end. If another attractor exists just beyond, its orbit is followed in turn, until
there is none. Where no orbit can be followed, surveys narrow down the edge between the last factor with an attractor
and the first one without.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from friso.engine.allowance import Exhausted, allowance, current_allowance
from friso.hunting.attractors import Attractors, attractors
from friso.hunting.attractors.survey import Swinging
from friso.hunting.cycle.ensemble import Ensemble, spans
from friso.hunting.cycle.hunting import surely_told
from friso.hunting.path import AttractionEnd, BandwidthWindow, LossKind, OrbitLine, ParameterPath
from friso.hunting.what_attracts import bends, has_a_map, sketched, what_attracts


@dataclass
class _Place:
    """Progress of a search: the factor `at` that it has come to, with attractors `motions`, and one without.

    At `outside` there seems to be no attractor. `kind` says how the orbit that was followed last has ended.
    """

    at: float
    motions: tuple[Swinging, ...]
    outside: float
    kind: LossKind = "seen"


class Beyond(Exception):
    """An attractor was followed to the end of the path."""


MOST_ORBITS_FOLLOWED = 8
"""Most orbits followed one after the other. More than eight in a row were not met."""

REACH_LOG = 0.06  # [log of bandwidth]
"""First distance ahead at which attractors are looked for. It doubles each time."""

BRACKET_STEPS = 5
"""Steps in which a bracket is divided. More take more surveys at once, fewer take more rounds."""

EDGE_BRACKET_SHARE = 0.02  # [of the bandwidth]
"""Widest bracket of an edge to which no orbit was followed. A narrower one takes more surveys."""


@dataclass(frozen=True)
class EdgeSearch:
    """Search for an edge of hunting along a path, towards the `farthest` factor.

    At the factor `settled`, if given, the stage does not hunt: an attractor beyond belongs to another window.
    """

    path: ParameterPath
    farthest: float
    settled: float | None = None

    def end(self, at: float, motions: tuple[Swinging, ...], outside: float) -> AttractionEnd:
        """Find where attraction ends between two factors, `at` and `outside`.

        At the first factor the stage has the attractors `motions`. Raises Beyond if an attractor exists up to the end
        of the search. If an allowance of work is used up, the end is as close as it was by then, and not certain;
        attraction may have been followed past `outside`.
        """
        place = _Place(at, motions, outside)
        try:
            return self._followed_to_the_end(place)
        except Exhausted:
            return AttractionEnd(place.at, place.outside, False, place.kind)

    def _followed_to_the_end(self, place: _Place) -> AttractionEnd:
        """Follow orbits to the edge of hunting, updating `place` on the way.

        Raises Beyond if an attractor exists up to the end of the search.
        """
        for _ in range(MOST_ORBITS_FOLLOWED):
            orbit = next((motion for motion in place.motions if motion.cycles is not None), None)
            if orbit is None:
                return self._bracketed(place)
            line = OrbitLine.of(self.path, self._ahead(place.at), place.at, orbit)
            found = line.end(place.outside, self.farthest)
            if found is None:
                raise Beyond
            end, place.kind = found
            distances = _followed_from([line.distance(end)])
            place.at = end
            next_to, farther = self._just_beyond(end)
            beyond, survey = self._proved(next_to, farther, distances)
            attracts = np.flatnonzero(survey.attracts)
            if not attracts.size:
                if again := line.close_at(float(np.log(next_to))):
                    if next_to == self.farthest:
                        raise Beyond
                    place.at, place.motions, place.outside = next_to, again, self._still_ahead(next_to, place.outside)
                    continue
                return AttractionEnd(end, next_to, bool(survey.decided.all()), place.kind)
            place.at, place.motions = float(beyond[attracts[-1]]), survey.take(attracts[-1:]).motions
            if place.at == self.farthest:
                raise Beyond
            place.outside = self._still_ahead(place.at, place.outside)
        return self._bracketed(place)

    def _proved(self, next_to: float, farther: np.ndarray, distances: np.ndarray) -> tuple[np.ndarray, Attractors]:
        """Look for attractors just beyond an orbit's end, at `next_to`, and at `farther` factors.

        Factors farther off are searched only where a sketch of their map shows an attractor, or a simulation without a
        map. Returns the searched factors and their attractors. Runs start from `distances` [m], too.
        """
        decided = True
        if farther.size and has_a_map(self.path.stages(farther)):
            farther = farther[sketched(self.path.stages(farther))[0]]
        elif farther.size:
            seen = attractors(self.path.stages(farther), cycles=False)
            decided, farther = bool(seen.decided[~seen.attracts].all()), farther[seen.attracts]
        beyond = np.append(next_to, farther)
        survey = self._told(beyond, distances)
        return beyond, survey if decided else replace(survey, decided=survey.decided & survey.attracts)

    def _just_beyond(self, end: float) -> tuple[float, np.ndarray]:
        """Return the factors beyond an orbit's end at which to look for attractors.

        The first result is the factor next to the end, or the end of the search if that is nearer. The second, shape
        (n,), has factors farther off and may be empty.
        """
        ahead = self._ahead(end)
        next_to, farther = (
            end * self.path.beyond[0] ** ahead,
            end * np.array(self.path.beyond[1:]) ** ahead,
        )
        if self.settled is not None and ahead * (self.settled - end) > 0:
            next_to = _nearer(ahead, next_to, self.settled)
        next_to = _nearer(ahead, next_to, self.farthest)
        within = ahead * (self.farthest - farther) >= 0
        if self.settled is not None:
            within &= (farther < self.settled) == (end < self.settled)
        return next_to, farther[within]

    def _bracketed(self, place: _Place) -> AttractionEnd:
        """Narrow down the edge by surveys where no orbit can be followed to it, updating `place`.

        Of several factors, the last with an attractor and the next one bracket the edge. The search repeats between
        them until they are close together. Raises Beyond if an attractor exists up to the end of the search. The edge
        is not certain where gains follow a schedule or windows remember the past: there a swing was found to attract
        again between the factors of the search, narrower than these are apart.
        """
        reach, ahead, place.kind = REACH_LOG, self._ahead(place.at), "seen"
        place.outside = _nearer(ahead, place.outside, self.farthest)
        while True:
            factors = np.geomspace(place.at, place.outside, BRACKET_STEPS + 2)[1:]
            survey = self._told(factors, _followed_from([motion.distance for motion in place.motions]))
            attracts = np.flatnonzero(survey.attracts)
            if attracts.size:
                place.at, place.motions = float(factors[attracts[-1]]), survey.take(attracts[-1:]).motions
            last = int(attracts[-1]) + 1 if attracts.size else 0
            if last == len(factors):
                if place.at == self.farthest:
                    raise Beyond
                place.outside = _nearer(ahead, place.at * np.exp(ahead * reach), self.farthest)
                reach = 2 * reach
                continue
            place.outside = float(factors[last])
            end = AttractionEnd(place.at, place.outside, bool(survey.decided[last:].all()))
            if end.reserve <= EDGE_BRACKET_SHARE:
                sure = end.certain and not bends(self.path.stages(np.array([place.at])))
                return replace(end, certain=sure and self._surely_attracts(place))

    def _surely_attracts(self, place: _Place) -> bool:
        """Tell whether the stage surely hunts at `place`, by a closed orbit or a thorough survey."""
        if any(motion.cycles is not None for motion in place.motions):
            return True
        distances = _followed_from([motion.distance for motion in place.motions])
        survey = attractors(self.path.stages(np.array([place.at])), thorough=True, distances=distances[None])
        return bool(survey.attracts[0] and survey.decided[0])

    def _told(self, factors: np.ndarray, distances: np.ndarray) -> Attractors:
        """Find the attractors at some factors; runs also start from `distances` [m], shape (n,)."""
        begun, stages = np.broadcast_to(distances, (len(factors), len(distances))), self.path.stages(factors)
        survey = what_attracts(stages, distances=begun)
        return replace(survey, decided=surely_told(stages, survey))

    def _ahead(self, at: float) -> float:
        """Return the direction of the search from the factor `at`: 1 up, -1 down."""
        return 1.0 if self.farthest >= at else -1.0

    def _still_ahead(self, at: float, outside: float) -> float:
        """Return `outside`, a factor without attractor, or one farther ahead if `at` has passed it."""
        ahead = self._ahead(at)
        return outside if ahead * (outside - at) > 0 else float(at * np.exp(ahead * REACH_LOG))


# [of the sticking distance]
FOLLOWED_STARTS = (0.92, 0.96, 0.98, 0.99, 0.995, 0.9975, 1.0, 1.0025, 1.005, 1.01, 1.02, 1.04, 1.08)
"""Starts from which a motion is followed to the next bandwidth. A motion moves by less than a tenth, and its basin
may be narrow."""


def _followed_from(distances: list[float]) -> np.ndarray:
    """Return start distances [m], shape (n,), from which motions are followed that stick at some distances [m]."""
    return np.outer(distances, FOLLOWED_STARTS).ravel()


def _nearer(ahead: float, one: float, other: float) -> float:
    """Return whichever of two factors comes first in the direction `ahead`: 1 up, -1 down."""
    return float(min(one, other) if ahead > 0 else max(one, other))


class Undecided(Exception):
    """Error: the search could not decide whether hunting begins or ends on a side."""


BANDWIDTHS_AT_ONCE = 8
"""Bandwidths surveyed at once, as many as stages in one register."""

SIMULATED_WORK_SHARE = 0.33  # [of the work left]
"""Work for simulations of the few stages whose maps do not decide. Beside an end of attraction these take long, and
following an orbit past them decides."""

INSIDE_END_LOG = 0.02  # [log of factor]
"""Distance from an end on the hunting side at which hunting is told. Nearer, a cycle attracts from hardly anywhere,
and motions take too long to decay."""

MOST_PROOFS = 6
"""Rounds of searches after which a side stays open because rough surveys were wrong."""

THOROUGH_MARGIN_STEPS = (1, 3, -1)
"""Numbers of the values, counted outward, that are searched thoroughly if a rough survey finds no change: 9 and
23 % off for a farthest factor of three, and the farthest, at which a rough survey once saw hunting that was not."""


class PathSearch:
    """Search for hunting along a path: what attracts the stage at each of its factors.

    The factors numbered `lowest` and higher were searched.
    """

    def __init__(self, path: ParameterPath, first: int = 0) -> None:
        """Survey the stage at the factors numbered `first` and higher.

        Raises Exhausted if an allowance of work is used up.
        """
        self.path, self.factors, self.lowest = path, path.factors, first
        factors = path.factors
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
        self.attracts[numbers], self.decided[numbers] = sketched(self._stages(numbers))
        left = numbers[~self.decided[numbers]]
        left = left[np.argsort(np.abs(np.log(self.factors[left])), kind="stable")]
        at_once, share = (
            (BANDWIDTHS_AT_ONCE, SIMULATED_WORK_SHARE)
            if 2 * len(left) < len(numbers)  # maps decide most
            else (len(left), 1.0)
        )
        around = current_allowance()
        work = share * around.left if around else np.inf
        with allowance(work) as simulated:
            try:
                for first in range(0, len(left), at_once):
                    some = left[first : first + at_once]
                    survey = attractors(self._stages(some), cycles=False)
                    self.attracts[some], self.decided[some] = survey.attracts, survey.decided
            except Exhausted:
                if share == 1 or not simulated.exhausted:
                    raise

    def _stages(self, numbers: np.ndarray) -> Ensemble:
        """Return the stages at some of the factors, by number."""
        return self.path.stages(self.factors[numbers])

    def record(self, survey: Attractors) -> None:
        """Record a thorough survey of the stage itself."""
        index = self.path.own
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

    def nearest(self, side: int) -> AttractionEnd | None:
        """Find where hunting first ends, or begins, above (`side` 1) or below (-1) the stage itself.

        Returns None if it does so nowhere. Raises Undecided if surveys leave that open, and Exhausted if an allowance
        of work is used up.
        """
        numbers, hunts = self.path.numbers(side), self.attracts[self.path.own]
        if not numbers.size:
            return None
        end = self.end(self.path.own, side) if hunts else self._beginning(numbers, side)
        if self.attracts[self.path.own] != hunts:
            raise Undecided
        if end is None and self.decided[numbers].all():
            return None
        if end is None:
            raise Undecided
        nearer = end.inside if hunts else end.outside
        before = numbers[side * np.log(self.factors[numbers] / nearer) <= 0]
        hunting_side = INSIDE_END_LOG * np.sign(np.log(end.inside / end.outside))
        inside = float(np.clip(end.inside * np.exp(hunting_side), self.factors[0], self.factors[-1]))
        if hunts and side * np.log(inside) < 0:
            inside = end.inside
        return replace(end, inside=inside, certain=end.certain and bool(self.decided[before].all()))

    def again(self, side: int, end: AttractionEnd) -> AttractionEnd | None:
        """Find where hunting begins again beyond its `end` above (`side` 1) or below (-1) the stage itself.

        Returns None if no factor surveyed shows it. Raises Undecided if that attraction reaches back to the end, which
        is none then, and Exhausted if an allowance of work is used up.
        """
        numbers = self.path.numbers(side)
        beyond = numbers[side * np.log(self.factors[numbers] / end.outside) > 0]
        while (hunts := beyond[self.attracts[beyond]]).size:
            begins = self.end(int(hunts[0]), -side)
            if begins is None and not self.attracts[hunts[0]]:
                continue
            if begins is None or side * (begins.outside - end.outside) < 0:
                raise Undecided
            return begins
        return None

    def _beginning(self, numbers: np.ndarray, side: int) -> AttractionEnd | None:
        """Find where hunting begins on a side; `numbers` are those of its factors, outward.

        Nearer factors, at which a rough survey found nothing, are searched thoroughly in part. Raises Undecided if
        rough surveys are wrong again and again.
        """
        for _ in range(MOST_PROOFS):
            hunts = numbers[self.attracts[numbers]]
            nearer = numbers if not hunts.size else numbers[np.abs(numbers - numbers[0]) < abs(hunts[0] - numbers[0])]
            searched = numbers[[*THOROUGH_MARGIN_STEPS]]
            left = np.setdiff1d(np.append(searched[np.isin(searched, nearer)], nearer[-1:]), [*self.inspected])
            if left.size:
                self._inspect(left)
            elif not hunts.size:
                return None
            elif end := self.end(int(hunts[0]), -side):
                return end
        raise Undecided

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
        """Find where attraction ends between the factor numbered `at` and a neighbour.

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
        """Follow attraction from the factor numbered `at` to its end.

        Attraction is followed up (`ahead` 1) or down (-1). Returns None if it reaches the end of the search, or if
        closer inspection shows no attractor. Raises Exhausted if an allowance of work is used up.
        """
        if not self.proved(at, ahead):
            return None
        outward = EdgeSearch(self.path, float(self.factors[-1 if ahead > 0 else 0]), self.settled)
        ahead_of = slice(at + ahead, None, ahead)
        beyond, quiet = self.factors[ahead_of], self.factors[ahead_of][~self.attracts[ahead_of]]
        try:
            end = outward.end(float(self.factors[at]), tuple(self.motions[at]), float([*quiet, beyond[-1]][0]))
        except Beyond:
            self._pass(ahead * (np.arange(len(self.factors)) - at) > 0)
            return None
        beyond = ahead * np.log(self.factors / end.inside)
        self._pass((ahead * (np.arange(len(self.factors)) - at) > 0) & (beyond <= 0))
        if ahead * (end.outside - end.inside) <= 0:  # the search was given up past `outside`
            settled = np.flatnonzero((beyond > 0) & ~self.attracts)[::ahead]
            if not settled.size:
                self._pass(beyond > 0)
                self.decided[beyond > 0] = False
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
        self.decided |= where
        self.inspected -= set(np.flatnonzero(where & [not motions for motions in self.motions]).tolist())

    def proved(self, at: int, ahead: int) -> bool:
        """Tell whether the stage hunts at the factor numbered `at`, after closing orbits.

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
                    self._inspect(np.array(some[:BANDWIDTHS_AT_ONCE]))
        return bool(self.attracts[at])

    def _inspect(self, numbers: np.ndarray) -> None:
        """Close orbits at the factors with these numbers, and record what attracts the stage there."""
        stages = self._stages(numbers)
        survey = what_attracts(stages)
        self.attracts[numbers] = survey.attracts | self.passed[numbers]
        self.decided[numbers] = surely_told(stages, survey)
        for k, number in enumerate(numbers.tolist()):
            self.motions[number] = list(survey.take(np.array([k])).motions)
        self.inspected |= set(numbers.tolist())

    def lower_end(self, index: int) -> AttractionEnd | None:
        """Find the end of attraction below the factor numbered `index`.

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
            windows = tuple(self._window(a, b) for a, b in spans(self.attracts) if not a <= besides <= b)
            if np.array_equal(before, self.attracts):
                return windows

    def _window(self, first: int, last: int) -> BandwidthWindow:
        """Return the window from the first to the last of neighbouring factors, with its ends."""
        return BandwidthWindow(
            self.end(first, -1) if first > self.lowest else None,
            self.end(last, 1) if last + 1 < len(self.factors) else None,
        )
