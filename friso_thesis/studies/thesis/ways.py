"""Apply the two criteria by which a stage is said to hunt.

The thesis's count of peaks judges its claims. Whether a cycle attracts the stage is stated beside the judgement.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from friso.hunting.criteria import COUNTED_ABOVE, FAILED, SWINGS
from friso.hunting.criteria import PEAK_CRITERION as PEAK_CRITERION
from friso_thesis.studies.thesis.claims import Evidence, Response

if TYPE_CHECKING:
    import xarray as xr

COUNT, CYCLE = "the thesis's count", "an attracting cycle"
"""Names of the two criteria of hunting: counted peaks (plain `findpeaks`, Sec. 3.2.2), and an attracting cycle,
whatever the move."""


def by_peak_count(runs: xr.Dataset) -> xr.Dataset:
    """Return the runs with the numbers that judges read, by the thesis's peak count.

    `keeps_moving` tells whether a peak is counted, and `count` how many are. `size` is the final swing, peak to peak,
    divided by the height above which peaks count. `lasts` tells whether the run still swings at its end.
    """
    return runs.assign(
        keeps_moving=(runs["peaks"] > 0).assign_attrs(criterion=PEAK_CRITERION),
        count=runs["peaks"],
        size=runs["peak_to_peak"] / COUNTED_ABOVE,
        lasts=runs["outcome"] == SWINGS,
    )


def by_attraction(runs: xr.Dataset, attracts: np.ndarray, decided: np.ndarray, apart: np.ndarray) -> xr.Dataset:
    """Return the runs with the numbers that judges read, by what attracts each stage.

    The arrays have the runs' shape; uncertain cells are left out. A stage with an attractor also `lasts`. How often a
    cycle repeats in a run is known only if the move ended in it. `apart` are the distances of the cells from the curves
    on which cycles stop attracting, in cells; limits are interpolated by them.
    """
    moving = runs["keeps_moving"].copy(data=attracts & decided).assign_attrs(criterion="a cycle attracts the stage")
    outcome = runs["outcome"].where(runs["keeps_moving"].copy(data=decided) | (runs["outcome"] == "invalid"), FAILED)
    count = runs["peaks"].where(moving & (runs["peaks"] > 0)).where(moving, 0.0)
    size = runs["peaks"].copy(data=np.exp(np.where(attracts, apart, -apart)))
    return runs.assign(keeps_moving=moving, count=count, outcome=outcome, lasts=moving, size=size)


def by_way(evidence: Evidence, read: Callable[[xr.Dataset], xr.Dataset]) -> Evidence:
    """Return a copy of the evidence with `read` applied to its maps and responses.

    `read` computes the numbers that judges read by one of the two criteria.
    """
    responses = {name: Response(read(item.cell), item.trace) for name, item in evidence.responses.items()}
    return replace(evidence, maps={name: read(runs) for name, runs in evidence.maps.items()}, responses=responses)
