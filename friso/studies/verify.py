"""Estimate how far a map can be trusted: run some of its cells again at a tighter tolerance."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from operator import index
from typing import TYPE_CHECKING, Any

import numpy as np

from friso.engine.tolerance import TIGHTEST_RTOL, checked_rtol
from friso.errors import InputError
from friso.studies.cells import INFERRED, allowed_cells
from friso.studies.execute import Crew, run_scattered
from friso.studies.metric import in_order
from friso.studies.settings import settings
from friso.studies.study import Study

if TYPE_CHECKING:
    import xarray as xr


TRIED_CELLS = 400
"""Number of cells on which a tolerance is chosen: 1 % of them are four."""


def checked_share(share: float) -> float:
    """Return the fraction of cells to verify, unchanged. Raises InputError if it is no fraction."""
    if not 0 <= share <= 1:
        raise InputError("verify", f"{share:g}", "a share of the cells, from 0 to 1", "--verify 0.05")
    return share


def verify_cells(study: Study, runs: xr.Dataset, crew: Crew, share: float) -> dict[str, Any]:
    """Run a fraction of the cells again at rtol/100, and count the outcomes that survive.

    The counts are returned as attributes for the study. A study always verifies the same cells. In a refined map,
    inferred cells are run too, and counted apart (inferred_checked, inferred_confirmed). Invalid and failed cells have
    no outcome that could survive. The result is empty if there are no others, if `share` is 0, or if the tolerance
    cannot be tightened. It is also empty if the attributes of the runs state the counts already.
    """
    if (
        share in (0, runs.attrs.get("verified_share")) or study.rtol < 10 * TIGHTEST_RTOL
    ):  # no tighter tolerance is available
        return {}
    count, rtol = (
        max(settings.least_verified, round(share * study.cells)),
        max(study.rtol / settings.tighter_factor, TIGHTEST_RTOL),
    )
    tighter = replace(study, rtol=rtol, metrics=in_order(()))

    def same(kind: str) -> tuple[int, int]:
        picked = random_cells(study, count, lambda cells: _kinds(runs, study, cells) == kind)
        again = run_scattered(tighter, picked, crew)["outcome"] if picked.size else np.empty(0)
        return len(picked), int(np.sum(_at(runs["outcome"], study, picked) == again))

    cells, surviving = same("run")
    if not cells:
        return {}
    columns = {"verified_share": share, "verified_rtol": rtol, "verified_cells": cells, "verified_surviving": surviving}
    if study.refined:
        checked, confirmed = same(INFERRED)
        columns |= {"inferred_checked": checked, "inferred_confirmed": confirmed}
    return columns


def check_verified(attributes: Mapping[str, Any], cells: int) -> None:
    """Check the counts of verified cells in the attributes of a store.

    Another program may have written them. Raises ValueError, TypeError or KeyError for counts or a tolerance that
    `verify_cells` cannot have written for a study with `cells` cells.
    """
    for checked, same in (("verified_cells", "verified_surviving"), ("inferred_checked", "inferred_confirmed")):
        if checked in attributes and not 0 <= index(attributes[same]) <= index(attributes[checked]) <= cells:
            raise ValueError(f"{checked} is no number of cells")
    if "verified_cells" in attributes:
        checked_rtol(float(attributes["verified_rtol"]))


def loosest_rtol(study: Study, crew: Crew) -> tuple[float, dict[float, float], int]:
    """Return the loosest tolerance at which enough outcomes survive a tighter one.

    How many are enough is the setting `wanted_survival`. Also returns the surviving fraction at each tolerance tried,
    and the number of cells used. If no tolerance is good enough, the one at which most outcomes survive is returned. If
    no cell has a valid stage, there are no fractions, and the tightest tolerance is returned.
    """
    picked = random_cells(
        study, TRIED_CELLS, lambda cells: allowed_cells(study.stage, study.links, study.columns(cells))
    )
    if not picked.size:
        return settings.candidate_rtols[-1], {}, 0
    outcomes: dict[float, np.ndarray] = {}

    def at(rtol: float) -> np.ndarray:
        if rtol not in outcomes:
            outcomes[rtol] = run_scattered(replace(study, rtol=rtol, metrics=in_order(())), picked, crew)["outcome"]
        return outcomes[rtol]

    shares: dict[float, float] = {}
    for rtol in settings.candidate_rtols:
        loose, tight = at(rtol), at(float(f"{rtol / settings.tighter_factor:.0e}"))
        shares[rtol] = float(np.mean((loose == tight) & (loose != "failed")))
        if shares[rtol] >= settings.wanted_survival:
            break
    return max(shares, key=lambda rtol: shares[rtol]), shares, len(picked)


def random_cells(study: Study, count: int, condition: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Return up to `count` indices of cells for which `condition` holds, ascending.

    `condition` takes indices and returns which of them pass. The cells are drawn evenly, and always the same.
    """
    rng = np.random.default_rng(0)
    if study.cells <= 8 * count:
        order = rng.permutation(study.cells)
        return np.sort(order[condition(order)][:count])
    accepted = np.empty(0, int)
    for _ in range(20):  # give up with fewer if nearly all cells of the map are unwanted
        new = rng.integers(0, study.cells, 2 * count)
        accepted = np.unique(np.concatenate([accepted, new[condition(new)]]))
        if len(accepted) >= count:
            break
    return np.sort(rng.permutation(accepted)[:count])


def _at(values: xr.DataArray, study: Study, cells: np.ndarray) -> np.ndarray:
    """Return the values of single cells, (cells,); a store reads only the blocks that hold them."""
    import xarray as xr

    places = np.unravel_index(cells, study.shape)
    indexers = {name: xr.DataArray(place, dims="cell") for name, place in zip(study.names, places, strict=True)}
    return values.isel(indexers).values


def _kinds(runs: xr.Dataset, study: Study, cells: np.ndarray) -> np.ndarray:
    """Return for each cell "run" if it ran to its end, `INFERRED` if it was inferred, else ""."""
    status, outcome = (_at(runs[name], study, cells).astype(str) for name in ("status", "outcome"))
    kinds = np.where(np.isin(outcome, ["invalid", "failed", ""]), "", "run")
    return np.where(np.char.startswith(status, INFERRED), INFERRED, kinds)
