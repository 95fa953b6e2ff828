"""Read maps for judges: where runs keep moving, limits, trends, and squares at rest."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import rankdata

from friso.hunting.criteria import FAILED
from friso.quantities import percent

if TYPE_CHECKING:
    import xarray as xr


def verdict_table(runs: xr.Dataset, rows: str, columns: str) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return values of rows and columns [SI], which runs keep moving, and which are valid.

    The last two results are booleans of shape (rows, columns). The criterion for moving is an attribute of the runs:
    the thesis's count, or the end of the run.
    """
    moving, outcome = (runs[name].transpose(rows, columns).values for name in ("keeps_moving", "outcome"))
    valid = (outcome != "invalid") & (outcome != FAILED)
    return runs[rows].values, runs[columns].values, moving & valid, valid


def peak_counts(runs: xr.Dataset, rows: str, columns: str) -> np.ndarray:
    """Return the counted peaks, shape (rows, columns)."""
    return runs["count"].transpose(rows, columns).values


def sizes(runs: xr.Dataset, rows: str, columns: str) -> np.ndarray | None:
    """Return swings at the end over the least swing that counts, shape (rows, columns).

    Returns None for a map without swings.
    """
    return runs["size"].transpose(rows, columns).values if "size" in runs else None


def ends(values: np.ndarray, moving: np.ndarray, size: np.ndarray | None = None) -> np.ndarray:
    """Return, for each column of `moving`, (n, columns), the value at which runs stop moving.

    `values` ascend, shape (n,). This limit lies between the last value with which a run keeps moving and the next:
    where the `size` of the swings, interpolated in its logarithm, is 1. The limit is halfway between both values if
    sizes are unknown, lie on one side of 1, or nothing is left of the swing beyond. A limit outside the range becomes
    the end of the range.
    """
    last = np.where(moving.any(axis=0), len(values) - 1 - np.argmax(moving[::-1], axis=0), -1)
    after = np.minimum(last + 1, len(values) - 1)
    share = np.full(last.shape, 0.5)
    if size is not None:
        columns = np.arange(len(last))
        with np.errstate(divide="ignore", invalid="ignore"):
            inside, outside = (np.log(size[row, columns]) for row in (last, after))
            between = inside / (inside - outside)
        share = np.where((inside > 0) & (outside < 0) & (outside > np.log(GONE_SWING)), between, share)
    within = values[last] + share * (values[after] - values[last])
    return np.where(last < 0, values[0], within)


def begins(values: np.ndarray, moving: np.ndarray, size: np.ndarray | None = None) -> np.ndarray:
    """Return for each column of `moving`, (n, columns), below which value no run keeps moving.

    `values` ascend, shape (n,). With the `size` of swings over the least that counts, limits are interpolated;
    otherwise they lie halfway between two values.
    """
    return -ends(-values[::-1], moving[::-1], None if size is None else size[::-1])


def limit_error(values: np.ndarray, limits: int = 1) -> float:
    """Return the error of a limit along `values`, or of the mean of several `limits`.

    A limit may lie anywhere between two neighbouring values; the error covers it with 95 %.
    """
    step = float(np.diff(values).max())
    return min(step / 2, step / (3 * limits) ** 0.5)


GONE_SWING = 1e-3
"""Swing, over the least that counts, below which no swing is left."""


def trend(x: np.ndarray, y: np.ndarray) -> float:
    """Return Spearman's rank correlation of the pairs of x and y in which both are known.

    The result is NaN for fewer than three pairs, or if x or y is constant.
    """
    defined = ~(np.isnan(x) | np.isnan(y))
    ranks = [rankdata(values[defined]) for values in (x, y)]
    if defined.sum() < 3 or any(np.ptp(rank) == 0 for rank in ranks):
        return np.nan
    return float(np.corrcoef(*ranks)[0, 1])


def trend_text(correlation: float) -> str:
    """Return a rank correlation in words; for NaN, say that it is undefined."""
    return f"{correlation:.2f}" if np.isfinite(correlation) else "undefined (too few cells, or all equal)"


def free_square(moving: np.ndarray, valid: np.ndarray) -> float:
    """Return the fraction of the valid cells in the largest square in which all come to rest."""
    free = valid & ~moving
    side = free.astype(int)  # size of the largest free square whose last corner is the cell
    for i in range(1, side.shape[0]):
        for j in range(1, side.shape[1]):
            if free[i, j]:
                side[i, j] = 1 + min(side[i - 1, j], side[i, j - 1], side[i - 1, j - 1])
    return float(side.max(initial=0) ** 2 / max(1, valid.sum()))


def overlap(part: np.ndarray, total: np.ndarray) -> float:
    """Return the fraction of cells of `total` that are also in `part`; NaN if `total` has none."""
    return float((part & total).sum() / total.sum()) if total.any() else np.nan


def overlap_text(moving: np.ndarray, cells: np.ndarray) -> str:
    """Write which fraction of `cells` keeps moving, or "none" without cells."""
    return f"{percent(overlap(moving, cells))}" if cells.any() else "none"
