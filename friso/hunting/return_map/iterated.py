"""Iterate return maps to where they lead, those of many stages together.

Coordinates are logarithms of distance, shifted on the negative side (see `friso.hunting.return_map.landing_map`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from friso.hunting.attractors.rounds import LEAST_SWING, MOST_REPEATING_SWINGS
from friso.hunting.return_map.curve import NEGATIVE_SIDE_SHIFT, REST_COORDINATE, Cubics

MOST_PASSED_LANDINGS = 40  # [landings]
"""Most landings that are passed over at once. Over more, the slope of the map changes."""

SLOW_MOVE_LOG = 1e-3
"""Change of log distance over two landings below which it hardly changes."""

QUICK_ITERATIONS = (8, 24)  # [landings]
"""Iterations of the map, in rounds, in which most starts reach an attractor."""

MAP_ITERATIONS = (100, 200, 400)  # [landings]
"""Iterations, in further rounds, for starts that leave a cycle slowly. One that strays no more after a round than
after the one before is irregular."""

MOVE_ON_LANDINGS = 4  # [landings]
"""Landings after which distances that hardly change are moved on."""

ARRIVED_SHARE = 1e-6
"""Change of landings below which they have reached a cycle."""

SAME_ATTRACTOR_SHARE = 0.02
"""Largest difference between landings of one attractor reached from two starts."""


@dataclass(frozen=True)
class MapLine:
    """Return map of one stage, or of several on one line, as a function of coordinates."""

    curve: Cubics

    def next(self, places: np.ndarray, shifts: np.ndarray | float = 0.0) -> np.ndarray:
        """Return the coordinates of the landings that follow those at `places` of stages with `shifts`, (count,)."""
        after = self.curve(places, shifts)
        distance = after - NEGATIVE_SIDE_SHIFT * np.rint(after / NEGATIVE_SIDE_SHIFT)
        after[distance < np.log(LEAST_SWING)] = REST_COORDINATE
        return after

    def _moved_on(self, at: np.ndarray, shifts: np.ndarray) -> np.ndarray:
        """Move coordinates along where every second landing hardly moves: half-way to a cycle, or away from it.

        Two landings later, a small distance x to a cycle has become s x. Where s is near 1, coordinates move on by
        x / 2, the way that landings go, so that they reach or leave the cycle soon, but no farther than in the most
        landings that may be passed over.
        """
        after = self.next(at, shifts)
        slope = self.curve.slope(at, shifts) * self.curve.slope(after, shifts)
        step = self.next(after, shifts) - at
        with np.errstate(all="ignore"):
            times = np.minimum(0.5 / np.abs(1 - slope), MOST_PASSED_LANDINGS / 2)
        return np.where((times > 1) & (at > REST_COORDINATE) & (np.abs(step) < SLOW_MOVE_LOG), at + times * step, at)

    def followed(self, at: np.ndarray, shifts: np.ndarray) -> np.ndarray:
        """Iterate the maps of stages with these `shifts` from coordinates, both (points,), to their attractors.

        Returns their last landings: coordinates, shape (points, landings).
        """
        landings = 2 * MOST_REPEATING_SWINGS + 1
        paths, left = np.tile(at[:, None], landings), np.flatnonzero(at > REST_COORDINATE)
        before = np.zeros(len(at))
        for iterations in (*QUICK_ITERATIONS, *MAP_ITERATIONS):
            at, own = paths[left, -1], shifts[left]
            for number in range(iterations):
                if number % MOVE_ON_LANDINGS == 0:
                    goes = at > REST_COORDINATE
                    paths[left[~goes]] = REST_COORDINATE
                    left, at, own = left[goes], at[goes], own[goes]
                    if not left.size:
                        return paths
                    at = self._moved_on(at, own)
                at = self.next(at, own)
            for k in range(landings):
                paths[left, k], at = at, self.next(at, own)
            strays = _strays(paths[left])
            slow = strays > ARRIVED_SHARE
            if iterations in MAP_ITERATIONS:
                slow &= (strays > before[left]) | (strays < SAME_ATTRACTOR_SHARE)
                before[left] = strays
            left = left[slow]
            if not left.size:
                break
        return paths


def _strays(paths: np.ndarray) -> np.ndarray:
    """Return how far paths are from repeating, in coordinates on the map, shape (points,).

    Every landing is compared with the one some swings earlier, and the number of swings that fits best counts. Paths
    are coordinates on the map, shape (points, landings).
    """
    return np.min(
        [np.abs(paths[:, n:] - paths[:, :-n]).max(axis=1) for n in range(1, MOST_REPEATING_SWINGS + 1)],
        axis=0,
    )


SAME_LANDING_SHARE = 2e-3
"""Difference beyond which landings one cycle apart count as different."""


def repeats_after(paths: np.ndarray, symmetric: bool) -> np.ndarray:
    """Return after how many swings the landings on each of several paths repeat, 0 if they do not.

    `paths`, shape (points, landings), have coordinates on the map. Landings of a `symmetric` stage may repeat on the
    other side.
    """
    least, found = 1 if symmetric else 2, np.zeros(len(paths), np.int64)
    for swings in range(least, MOST_REPEATING_SWINGS + 1, least):
        again = np.all(np.abs(paths[:, swings:] - paths[:, :-swings]) < SAME_LANDING_SHARE, axis=1)
        found[again & (found == 0)] = swings
    return found
