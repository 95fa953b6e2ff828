"""Decide whether a run swings for ever, from its turning points alone.

This criterion is the adversary's own. A stage that sticks winds up the longer the nearer it is to its reference, so
that a swing that shrinks by a fixed fraction every time shrinks in time as 1/t, and looks almost steady. A cycle near
its edge takes hundreds of swings to leave or to reach. So legs of the last quarter are compared with legs of the
quarter before, and if that does not decide, the run is followed longer.
"""

from dataclasses import dataclass

import numpy as np

RESTS, SWINGS, UNSURE, FAILED = "rests", "swings", "unsure", "failed"

STEADY = 1e-3
"""Largest relative difference between the largest legs of successive quarters of a lasting swing."""

LASTING, LEGS = 0.95, 6
"""Least ratio of these legs at the end of the longest run (chaotic swings vary; one that decays is far smaller by
then), and fewest legs of a swing in the last quarter."""


@dataclass(frozen=True)
class Legs:
    """Largest legs of the third and last quarter [m], and the number of large legs at last."""

    before: float
    last: float
    count: int


def legs(times: np.ndarray, values: np.ndarray, end: float) -> Legs:
    """Return the legs of a zigzag between turning points, `times` [s] and `values` [m].

    The run ended at `end` [s].
    """
    lengths = np.abs(np.diff(values))
    at = times[1:]
    last, before = at >= 0.75 * end, (at >= 0.5 * end) & (at < 0.75 * end)
    largest = float(lengths[last].max(initial=0.0))
    return Legs(float(lengths[before].max(initial=0.0)), largest, int(np.sum(lengths[last] > 0.3 * largest)))


def judge(seen: Legs, spread: float, small: float, patient: bool) -> str:
    """Return the word for a run from its legs and the spread [m] of its last quarter.

    A spread below `small` [m] is rest. `patient`: the run will not be followed longer.
    """
    if spread < small:
        return RESTS
    if seen.count < LEGS or not seen.before:
        return UNSURE
    share = seen.last / seen.before
    if abs(share - 1) < STEADY:
        return SWINGS
    if not patient:
        return UNSURE
    return SWINGS if share > LASTING else RESTS
