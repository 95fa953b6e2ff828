"""Thinning of long lines by minimum and maximum, so that a spike of one sample survives."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from friso.views.drawing.figure import Array

BUCKETS = 1500  # about one per pixel of a page-wide panel
KEPT = 5  # at most this many samples of a bucket are kept: the extremes of x and of y, and a gap


def thin(x: Array, y: Array, buckets: int = BUCKETS) -> tuple[Array, Array]:
    """Samples of the line (x, y), in order, that look like all of it.

    x, y: shape (n,), any unit, NaN where the line is broken. Lines of up to KEPT * buckets samples come back
    as they are. Of a longer one are kept: its first and last sample and, in each bucket of neighbouring
    samples, those with the smallest and largest y and x and the first gap. Buckets hold equally many samples;
    where x runs to and fro (a loop) they are equally long pieces of the path instead, so that a state that
    rests for seconds takes no samples from one that moves.
    """
    if len(x) <= KEPT * buckets:
        return x, y
    edges = _edges(x, y, buckets)
    keep = {0, len(x) - 1}
    for start, stop in pairwise(edges):
        for values in (x[start:stop], y[start:stop]):
            finite = np.isfinite(values)
            if finite.any():
                keep.add(start + int(np.argmin(np.where(finite, values, np.inf))))
                keep.add(start + int(np.argmax(np.where(finite, values, -np.inf))))
            if not finite.all():
                keep.add(start + int(np.argmin(finite)))
    chosen = np.array(sorted(keep))
    return x[chosen], y[chosen]


def _edges(x: Array, y: Array, buckets: int) -> list[int]:
    """First sample of every bucket, and n: strictly rising."""
    count = len(x)
    if not np.any(np.diff(x) < 0):
        return [count * bucket // buckets for bucket in range(buckets + 1)]
    path = np.cumsum(_steps(x) + _steps(y))
    inner = np.searchsorted(path, path[-1] * np.arange(1, buckets) / buckets)
    return np.unique(np.concatenate(([0], inner, [count]))).tolist()


def _steps(values: Array) -> Array:
    """Length of each step along one axis, as a fraction of the axis; gaps count as no way. Shape (n,)."""
    finite = values[np.isfinite(values)]
    span = float(np.ptp(finite)) if finite.size else 0.0
    if span == 0.0:
        return np.zeros(len(values))
    return np.nan_to_num(np.abs(np.diff(values, prepend=values[0])) / span, posinf=0.0)
