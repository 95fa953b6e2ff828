"""Define what is compared: hunting peaks, settled cycle, distance from a reference."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

COUNTED_AFTER, COUNTED_ABOVE, APART = 10.0, 1e-4, 0.5
"""The thesis's hunting metric: maxima after 10 s, above 0.1 mm, 0.5 s apart, the tallest kept first."""


def maxima(times: np.ndarray, values: np.ndarray, beyond: float = -np.inf) -> tuple[np.ndarray, np.ndarray]:
    """Return times [s] and heights [m] of the counted maxima among turning points.

    `beyond` stands before the first and after the last value: with -inf the ends count, with inf they do not.
    """
    inner = np.pad(values, 1, constant_values=beyond)
    top = (inner[1:-1] > inner[:-2]) & (inner[1:-1] >= inner[2:])
    chosen: list[int] = []
    for i in np.argsort(-values):
        counts = top[i] and times[i] >= COUNTED_AFTER and values[i] > COUNTED_ABOVE
        if counts and all(abs(times[i] - times[j]) >= APART for j in chosen):
            chosen.append(int(i))
    chosen.sort()
    return times[chosen], values[chosen]


def sampled_maxima(times: np.ndarray, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the counted maxima of a sampled trace, refined by parabolas."""
    at_maxima, _ = maxima(times, position, np.inf)
    at = np.clip(np.searchsorted(times, at_maxima), 1, len(times) - 2)
    y0, y1, y2 = position[at - 1], position[at], position[at + 1]
    bend = y0 - 2 * y1 + y2
    shift = np.where(bend < 0, (y0 - y2) / (2 * np.where(bend < 0, bend, 1.0)), 0.0)
    step = times[1] - times[0]
    return times[at] + shift * step, y1 - (y0 - y2) * shift / 4


@dataclass(frozen=True)
class Cycle:
    """Peak count, mean height [m] and mean spacing [s] of the counted maxima; NaN without any."""

    peaks: int
    amplitude: float
    period: float


def cycle(turns: tuple[np.ndarray, np.ndarray]) -> Cycle:
    """Return the cycle to which the counted maxima belong."""
    times, heights = turns
    amplitude = float(heights.mean()) if len(heights) else np.nan
    return Cycle(len(times), amplitude, float(np.diff(times).mean()) if len(times) > 1 else np.nan)


@dataclass(frozen=True)
class Distance:
    """Errors of a trace [m]: largest early and over all, root mean square over all and late.

    Early: in the first 0.1 s. Late: after 10 s.
    """

    early: float
    largest: float
    rms: float
    late: float


def distance(times: np.ndarray, trace: np.ndarray, reference: np.ndarray) -> Distance:
    """Return how far a trace is from the reference at the same times."""
    off = np.abs(trace - reference)

    def rms(part: np.ndarray) -> float:
        return float(np.sqrt(np.mean(part**2)))

    late = times >= COUNTED_AFTER
    return Distance(float(off[times <= 0.1].max()), float(off.max()), rms(off), rms(off[late]))
