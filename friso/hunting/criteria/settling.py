"""Define the settling time for friso check, compare, simulate, sweep, map and tune.

The time runs from the last corner of the reference until the deviation stays within a band while the reference stands
there. For a motion that stands at several places it is the longest of these times. It is infinite if the deviation is
outside the band when the reference leaves, or when the run ends. So a stage that does not move at all has not settled,
although it is in position once the reference is back.
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
    """Return the settling times [s] of a chunk of runs into one of their bands, shape (runs,).

    `flat` has the keys of the stages, such as "friction.static", in SI; arrays have one entry per run of the chunk.
    Runs that were not completed get a time as well.
    """
    return _longest(_at_stands(flat, runs, band))


def settling_in_the_end(flat: Mapping[str, Any], runs: Runs, band: BandName) -> np.ndarray:
    """Return the settling times [s] of runs at the last place of the reference, shape (runs,).

    The verdict on a stage needs no other place. `flat` has the keys of the stages in SI.
    """
    return _at_stands(flat, runs, band)[-1]


def _at_stands(flat: Mapping[str, Any], runs: Runs, band: BandName) -> list[np.ndarray]:
    """Return settling times [s] at the places that the reference leaves, and at its last place.

    Both arrays have the shape (runs,). The first has the longest time over all places that the reference leaves. A time
    is infinite for a run that is outside its `band` when the reference leaves or the run ends.
    """
    last, before = runs.statistic(f"{band}_exit"), runs.statistic(f"{band}_before")
    in_the_end = _since(stands(flat)[-1], np.where(last < runs.statistic("ended"), last, np.inf))
    return [np.maximum(before, 0.0), in_the_end]


def settling_of_traces(places: list[Stand], time: np.ndarray, deviation: np.ndarray, within: float) -> np.ndarray:
    """Return the longest settling time [s] of sampled runs over the reference's places, (runs,).

    The deviations [m] have the shape (runs, n), the times [s] (n,). A run has settled at the sample after the last one
    outside of the band, `within` [m].
    """
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
