"""How far a map can be trusted: a sample of its cells run again at a tighter tolerance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from friso.engine.tolerance import TIGHTEST
from friso.studies.cells import INFERRED
from friso.studies.execute import Crew, run_scattered
from friso.studies.study import Study

if TYPE_CHECKING:
    import xarray as xr

TIGHTER = 100.0
"""By how much the tolerance of the second run is tighter."""

LEAST = 50
"""Cells that are checked at least, as far as there are so many: of fewer no share can be told."""

WANTED = 0.99
"""Share of the verdicts that shall survive at an automatic tolerance."""

CANDIDATES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
"""Tolerances among which the automatic one is chosen, the loosest first."""

TRIED = 400
"""Cells on which a tolerance is chosen: 1 % of them are four."""


def verified(study: Study, runs: xr.Dataset, crew: Crew, share: float) -> dict[str, Any]:
    """Run a share of the cells again at rtol/100; attributes that tell how many verdicts survived.

    The same cells for the same study. Cells that were not run (invalid ones, and those of a refined map that were
    inferred) are left out; nothing is told where there are no others, or no share was asked for.
    """
    count = max(LEAST, round(share * study.cells)) if share else 0
    picked = drawn(study, count, lambda cells: _ran(runs, study, cells))
    if not picked.size:
        return {}
    rtol = max(study.rtol / TIGHTER, TIGHTEST)
    again = run_scattered(replace(study, rtol=rtol), picked, crew)["verdict"]
    surviving = int(np.sum(_at(runs["verdict"], study, picked) == again))
    return {"verified_cells": len(picked), "verified_surviving": surviving, "verified_rtol": rtol}


def loosest_rtol(study: Study, crew: Crew) -> tuple[float, dict[float, float]]:
    """The loosest tolerance at which `WANTED` of the verdicts survive, and the surviving share at each one tried.

    If none is good enough it is the one at which most survive.
    """
    picked = drawn(study, TRIED, lambda cells: np.ones(len(cells), bool))
    verdicts = {}

    def at(rtol: float) -> np.ndarray:
        if rtol not in verdicts:
            verdicts[rtol] = run_scattered(replace(study, rtol=rtol), picked, crew)["verdict"]
        return verdicts[rtol]

    shares: dict[float, float] = {}
    for rtol in CANDIDATES:
        shares[rtol] = float(np.mean(at(rtol) == at(float(f"{rtol / TIGHTER:.0e}"))))
        if shares[rtol] >= WANTED:
            break
    return max(shares, key=lambda rtol: shares[rtol]), shares


def drawn(study: Study, count: int, wanted: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Up to `count` numbers of different cells for which `wanted` holds, drawn evenly, rising; always the same."""
    rng = np.random.default_rng(0)
    if not count:
        return np.empty(0, int)
    if study.cells <= 8 * count:
        order = rng.permutation(study.cells)
        return np.sort(order[wanted(order)][:count])
    found = np.empty(0, int)
    for _ in range(20):  # of a map nearly all of which is unwanted, fewer must do
        new = rng.integers(0, study.cells, 2 * count)
        found = np.unique(np.concatenate([found, new[wanted(new)]]))
        if len(found) >= count:
            break
    return np.sort(rng.permutation(found)[:count])


def _at(values: xr.DataArray, study: Study, cells: np.ndarray) -> np.ndarray:
    """The values of single cells, of which a store reads those blocks only that they lie in."""
    import xarray as xr

    places = np.unravel_index(cells, study.shape)
    indexers = {name: xr.DataArray(place, dims="cell") for name, place in zip(study.names, places, strict=True)}
    return values.isel(indexers).values


def _ran(runs: xr.Dataset, study: Study, cells: np.ndarray) -> np.ndarray:
    status = _at(runs["status"], study, cells).astype(str)
    return ~(np.char.startswith(status, "invalid") | np.char.startswith(status, INFERRED))
