"""Find an edge of hunting along a path: the factor of a parameter beyond which the stage has no attractor.

A closed orbit is followed to its end: a flip, a fold, a torus, or the loss of the orbit. If another attractor exists
just beyond, its orbit is followed in turn, until there is none. Where no orbit can be followed, surveys narrow down the
edge between the last factor with an attractor and the first one without.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from friso.engine.allowance import Exhausted
from friso.hunting.attractors import Attractors, attractors
from friso.hunting.attractors.survey import Swinging
from friso.hunting.cycle.hunting import surely_surveyed
from friso.hunting.orbit_line import OrbitLine
from friso.hunting.path import AttractionEnd, LossKind, ParameterPath
from friso.hunting.settings import edge_settings
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
        for _ in range(edge_settings.most_orbits_followed):
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
                if again := tuple(line.close_at(float(np.log(next_to)))):
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
        reach, ahead, place.kind = edge_settings.reach_log, self._ahead(place.at), "seen"
        place.outside = _nearer(ahead, place.outside, self.farthest)
        while True:
            factors = np.geomspace(place.at, place.outside, edge_settings.bracket_steps + 2)[1:]
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
            if end.reserve <= edge_settings.edge_bracket_share:
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
        return replace(survey, decided=survey.decided & (survey.attracts | surely_surveyed(stages, survey)))

    def _ahead(self, at: float) -> float:
        """Return the direction of the search from the factor `at`: 1 up, -1 down."""
        return 1.0 if self.farthest >= at else -1.0

    def _still_ahead(self, at: float, outside: float) -> float:
        """Return `outside`, a factor without attractor, or one farther ahead if `at` has passed it."""
        ahead = self._ahead(at)
        return outside if ahead * (outside - at) > 0 else float(at * np.exp(ahead * edge_settings.reach_log))


def _followed_from(distances: list[float]) -> np.ndarray:
    """Return start distances [m], shape (n,), from which motions are followed that stick at some distances [m]."""
    return np.outer(distances, edge_settings.followed_starts).ravel()


def _nearer(ahead: float, one: float, other: float) -> float:
    """Return whichever of two factors comes first in the direction `ahead`: 1 up, -1 down."""
    return float(min(one, other) if ahead > 0 else max(one, other))
