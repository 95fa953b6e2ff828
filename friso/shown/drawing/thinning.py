"""Thin long lines by minimum and maximum, so that a spike of one sample survives."""

from __future__ import annotations

import numpy as np

from friso.shown.drawing.figure import Array

BUCKETS = 1500  # about one per pixel of a page-wide panel
KEPT = 5  # at most this many samples of a bucket are kept: the extremes of x and of y, and a gap


def thin(x: Array, y: Array, buckets: int = BUCKETS) -> tuple[Array, Array]:
    """Return samples of the line (x, y), in order, that look like the whole line.

    x and y have shape (n,) and any unit; NaN breaks the line. Lines of up to KEPT * buckets samples are returned as
    they are. Of a longer line, the first and last sample are kept. In each bucket of neighbouring samples, the ones
    with the smallest and largest y and x are kept, and the first gap. Of equal samples, the first counts.

    Buckets hold equally many samples. If x runs to and fro, as in a loop, they are equally long pieces of the path
    instead. A state that rests for seconds then takes no samples from one that moves.
    """
    if len(x) <= KEPT * buckets:
        return x, y
    starts = _starts(x, y, buckets)
    bucket = np.zeros(len(x), int)
    bucket[starts[1:]] = 1
    bucket = np.cumsum(bucket)
    kept = np.zeros(len(x), bool)
    kept[[0, -1]] = True
    for values in (x, y):
        finite = np.isfinite(values)
        least = np.minimum.reduceat(np.where(finite, values, np.inf), starts)[bucket]
        greatest = np.maximum.reduceat(np.where(finite, values, -np.inf), starts)[bucket]
        for wanted in (finite & (values == least), finite & (values == greatest), ~finite):
            places = np.flatnonzero(wanted)
            kept[places[np.diff(bucket[places], prepend=-1) > 0]] = True
    return x[kept], y[kept]


def _starts(x: Array, y: Array, buckets: int) -> np.ndarray:
    """Return the index of the first sample of every bucket, strictly rising."""
    count = len(x)
    if not np.any(np.diff(x) < 0):
        return count * np.arange(buckets) // buckets
    path = np.cumsum(_steps(x) + _steps(y))
    inner = np.searchsorted(path, path[-1] * np.arange(1, buckets) / buckets)
    return np.unique(np.concatenate(([0], inner[inner < count])))


def _steps(values: Array) -> Array:
    """Return the length of each step along one axis as a fraction of the axis, shape (n,).

    Gaps have no length.
    """
    finite = values[np.isfinite(values)]
    span = float(np.ptp(finite)) if finite.size else 0.0
    if span == 0.0:
        return np.zeros(len(values))
    return np.nan_to_num(np.abs(np.diff(values, prepend=values[0])) / span, posinf=0.0)
