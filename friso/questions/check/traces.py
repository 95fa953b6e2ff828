"""Read from time responses what the figures of a check need."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr

from friso.shown.cases import ShownCase
from friso.shown.drawing.figure import Array


def trace_of(item: ShownCase) -> xr.Dataset:
    """Return the time response of a case that was run."""
    assert item.case.trace is not None  # check_figures let no other through
    return item.case.trace


def samples(trace: xr.Dataset, name: str) -> Array:
    """Return a variable of a time response as an array of numbers, in its own unit."""
    return np.asarray(trace[name].values, dtype=float)


def common_range(arrays: Sequence[Array], least: float = 0.0) -> tuple[float, float] | None:
    """Return a range that holds all finite data with a margin, at least `least` wide.

    Returns None if the range would be empty.
    """
    gathered = np.concatenate([np.empty(0), *arrays])
    finite = gathered[np.isfinite(gathered)]
    if finite.size == 0 or max(np.ptp(finite), least) == 0:
        return None
    low, high = float(finite.min()), float(finite.max())
    margin = max(0.06 * (high - low), (least - (high - low)) / 2)
    return low - margin, high + margin


def subject(cases: Sequence[ShownCase]) -> str:
    """Return the name of the stage, as figures show it."""
    return str(cases[0].case.stage.name)
