"""Whether a run swings on for ever, from its turning points alone: this adversary's own criterion.

A stage that sticks winds up the longer the nearer it is to its reference, so that a swing that shrinks by a fixed
share every time shrinks in time as 1/t, and looks almost steady; a cycle near its edge takes hundreds of swings to
leave or to be reached. So legs are compared with legs, of the last quarter with those of the quarter before, and where
that does not tell the run is followed longer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

RESTS, SWINGS, UNSURE, FAILED = "rests", "swings", "unsure", "failed"

STEADY = 1e-3
"""Share by which the largest leg of a quarter may differ from that of the one before where a run swings on."""

LASTING, LEGS = 0.95, 6
"""The same where it was followed to the end of patience (chaotic swings vary; one that decays is far below by then),
and the legs in the last quarter that a swing has at least."""


@dataclass(frozen=True)
class Legs:
    """The largest legs of the third and of the last quarter of a run [m], and the number of large ones in the last."""

    before: float
    last: float
    count: int


def legs(times: np.ndarray, values: np.ndarray, end: float) -> Legs:
    """The legs of a zigzag between turning points, `times` [s] and `values` [m], of a run that ended at `end` [s]."""
    lengths = np.abs(np.diff(values))
    at = times[1:]
    last, before = at >= 0.75 * end, (at >= 0.5 * end) & (at < 0.75 * end)
    largest = float(lengths[last].max(initial=0.0))
    return Legs(float(lengths[before].max(initial=0.0)), largest, int(np.sum(lengths[last] > 0.3 * largest)))


def judge(seen: Legs, spread: float, small: float, patient: bool) -> str:
    """The word for a run whose deviation spreads over so much in its last quarter [m]; less than `small` [m] is none.
    `patient`: it was followed as long as it will be."""
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
