"""The bandwidth of a stage: what its controller states, or where the gain of its loop is 1."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from friso.equations.bandwidth import bandwidth
from friso.frequency.loops import open_loop
from friso.frequency.margins import margins
from friso.frequency.members import Members, limit_cases
from friso.stage import Stage

GRID = np.geomspace(0.01, 1e4, 800)
"""Frequencies [Hz] at which the loops of many points are looked at for their bandwidth."""


def loop_bandwidth(stage: Stage) -> float:
    """The bandwidth [Hz] that the controller states; else the last frequency at which the loop's gain is 1 while the
    stage slides (NaN: there is none): stuck, its bearing holds it, and the loop hardly moves it."""
    flat = stage.flat()
    stated = bandwidth(flat)
    if stated is not None:
        return float(stated)
    crossings = margins(flat, _sliding(stage)).crossovers
    return float(crossings[-1]) if crossings else float("nan")


@np.errstate(all="ignore")
def loop_bandwidths(stage: Stage, changes: Mapping[str, Any], count: int) -> np.ndarray:
    """The same [Hz] of a stage with changes, arrays of shape (count,): to a share of 1e-3, as loops are looked at on a
    grid of frequencies and their gain is taken to be a power of it in between."""
    flat = {**stage.flat(), **changes}
    stated = bandwidth(flat)
    if stated is not None:
        return np.array(np.broadcast_to(stated, (count,)), float)
    loops = open_loop(flat, _sliding(stage).repeated(count)).at(2j * np.pi * GRID)[:, :, 0, 0]
    gain, frequency = np.log(np.abs(loops)), np.log(GRID)
    falls = (gain[:, :-1] >= 0) & (gain[:, 1:] < 0)
    last = falls.shape[1] - 1 - falls[:, ::-1].argmax(axis=1)
    rows = np.arange(count)
    before, after = gain[rows, last], gain[rows, last + 1]
    at = frequency[last] + (frequency[last + 1] - frequency[last]) * before / (before - after)
    return np.where(falls.any(axis=1), np.exp(at), np.nan)


def _sliding(stage: Stage) -> Members:
    """The limit case in which the stage slides."""
    return next(case for name, case in limit_cases(stage.flat()).items() if not name.startswith("stuck"))
