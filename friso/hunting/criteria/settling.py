"""When a run has settled: the one definition of `friso check`, `compare`, `simulate`, `sweep`, `map` and `tune`.

At every place where the reference comes to stand, the time from its last corner until the deviation stays within a band
as long as it stands there; of a motion there and back the longer of the times at both ends. It is infinite where the
deviation is outside the band when the reference leaves, or the run ends: a stage that never leaves is in position once
the reference is back, and has not settled for that.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np

from friso.engine.batch import Runs
from friso.equations.motion import Stand, stands
from friso.hunting.criteria.run_outcome import last_outside

BandName = Literal["inner", "outer"]


def settling_of_runs(flat: Mapping[str, Any], runs: Runs, band: BandName) -> np.ndarray:
    """The settling times [s] of a chunk of runs into one of their bands, shape (runs,); the keys of the stages are
    `flat`, arrays of which have one entry per run of the chunk. Runs that were not completed have one all the same."""
    return _longest(_at_stands(flat, runs, band))


def settling_in_the_end(flat: Mapping[str, Any], runs: Runs, band: BandName) -> np.ndarray:
    """The settling times [s] of a chunk of runs (see `settling_of_runs`) at the last place alone where the reference
    stands, shape (runs,): the verdict on a stage asks no more."""
    return _at_stands(flat, runs, band)[-1]


def _at_stands(flat: Mapping[str, Any], runs: Runs, band: BandName) -> list[np.ndarray]:
    """Settling times [s] of runs at each place where the reference stands."""
    last, before = runs.statistic(f"{band}_exit"), runs.statistic(f"{band}_before")
    outside = [before, np.where(last < runs.statistic("ended"), last, np.inf)]
    places = stands(flat)
    return [_since(place, left) for place, left in zip(places, outside[-len(places) :], strict=True)]


def settling_of_traces(places: list[Stand], time: np.ndarray, deviation: np.ndarray, within: float) -> np.ndarray:
    """The settling times [s] at places where the reference stands of deviations [m], shape (runs, n), over times [s],
    shape (n,), shape (runs,): until the sample after the last one outside of the band, `within` [m]."""
    times = []
    for place in places:
        seen = time if place is places[-1] else time[time < place.until]
        following = np.searchsorted(seen, last_outside(seen, deviation[:, : len(seen)], within), side="right")
        times.append(_since(place, np.append(seen, np.inf)[following]))
    return _longest(times)


def _since(place: Stand, entered: np.ndarray) -> np.ndarray:
    return np.maximum(entered - place.corner, 0.0)


def _longest(times: list[np.ndarray]) -> np.ndarray:
    return np.max(times, axis=0)
