"""Close the orbits of one branch along a path, and find where the branch ceases to attract."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from friso.hunting.attractors.survey import Swinging, of_cycles
from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.cycle.find import CYCLE_RTOL, described, kept
from friso.hunting.cycle.rest import stuck
from friso.hunting.cycle.shooting import close
from friso.hunting.path import LossKind, ParameterPath
from friso.hunting.settings import edge_settings


@dataclass
class OrbitLine:
    """Closed orbits of one branch along a path, stable or not, in the direction `ahead`: 1 up, -1 down.

    They are closed at `places`, logarithms of factors, ascending in that direction. There they have `states` (count,
    states), return after `times` [s], or to their mirror image if `sign` is -1, and have a `multiplier`, all (count,).
    `swings` counts swings in that time.
    """

    path: ParameterPath
    ahead: float
    sign: float
    swings: int
    places: np.ndarray
    states: np.ndarray
    times: np.ndarray
    multiplier: np.ndarray

    @classmethod
    def of(cls, path: ParameterPath, ahead: float, factor: float, motion: Swinging) -> OrbitLine:
        """Begin with the closed orbit of a motion of the stage at a factor."""
        assert motion.cycles is not None
        one = motion.cycles.take(np.array([motion.number]))
        orbits, places = one.orbits, np.log([factor])
        return cls(path, ahead, one.sign, one.swings, places, orbits.states, orbits.times, one.multiplier)

    def distance(self, factor: float) -> float:
        """Return the distance [m] at which the stage sticks on the orbit nearest to a factor."""
        nearest = int(np.abs(self.places - np.log(factor)).argmin())
        return float(self.states[nearest, self._stages(self.places[:1]).sticking])

    @np.errstate(all="ignore")  # runs that fail on the way leave infinities behind
    def close_at(self, place: float) -> list[Swinging]:
        """Close the orbit at a further place, if that succeeds, and return it as a list if it is stable."""
        stages, (states, times) = self._stages(np.array([place])), self._guessed(place)
        rtol = stages.searching_rtol(CYCLE_RTOL)
        orbits = close(stages, states, times, self.sign, rtol, self.swings)
        orbits.closed[:] &= kept(stages, orbits, states[:, stages.sticking])
        cycles = described(stages, orbits, rtol)
        if not cycles.closed[0]:
            return []
        k = int((self.ahead * self.places).searchsorted(self.ahead * place))
        self.places, self.states = np.insert(self.places, k, place), np.insert(self.states, k, orbits.states[0], axis=0)
        self.times = np.insert(self.times, k, orbits.times[0])
        self.multiplier = np.insert(self.multiplier, k, cycles.multiplier[0])
        return of_cycles(np.zeros(1, np.int64), cycles, stages.sticking)

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
        the multiplier passes its limit.
        """
        chatters, last = self._stages(self.places[:1]).chatters, float(np.log(farthest))
        tolerance = edge_settings.chattering_edge_step if chatters else edge_settings.flip_search_step
        step = min(abs(float(np.log(outside)) - self.places[0]), edge_settings.longest_edge_step)
        while True:
            at = self._last_stable
            low, beyond = float(self.places[at]), self.places[at + 1 :]
            if low == last:
                return None
            if beyond.size:
                target = self._root(at)
                if min(abs(self.places - target)) < tolerance or abs(beyond[0] - low) < tolerance:
                    return float(np.exp(target)), self._kind(at)
            else:
                target = low + self.ahead * step if step < abs(last - low) else last
            self.close_at(target)
            closed = target in self.places
            step = min(1.5 * step, edge_settings.longest_edge_step) if closed else step / 3
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
