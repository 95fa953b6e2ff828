"""Maps of the thesis's studies, made up to hold and to fail."""

from collections.abc import Callable
from typing import Any

import numpy as np
import xarray as xr

from friso_thesis.studies.thesis.claims import by_peak_count
from friso_thesis.studies.thesis.studies import STUDIES

Cells = Callable[[np.ndarray, np.ndarray], Any]
POINTS = 21


def made(
    name: str, peaks: Cells, words: Cells | None = None, swing: Cells | None = None, points: int = POINTS
) -> xr.Dataset:
    """A map of the study `name` whose peak counts are a function of both coordinates; negative is invalid.

    Runs swing where peaks are counted, unless `words` says otherwise, by `swing` [m].
    """
    spans = STUDIES[name].spans
    x, y = (np.geomspace(s.low, s.high, points) if s.log else np.linspace(s.low, s.high, points) for s in spans)
    grid, dims = np.meshgrid(x, y, indexing="ij"), tuple(span.key for span in spans)
    counts = np.broadcast_to(np.asarray(peaks(*grid), float), (points, points))
    swings = counts > 0 if words is None else words(*grid)
    values = {
        "peaks": np.where(counts < 0, np.nan, counts),
        # halfway in the logarithm lies 0.1 mm
        "peak_to_peak": np.where(counts > 0, 1e-2, 1e-6) if swing is None else swing(*grid),
        "outcome": np.where(counts < 0, "invalid", np.where(swings, "swings", "rests")),
    }
    cells = {key: (dims, value) for key, value in values.items()}
    return by_peak_count(xr.Dataset(cells, coords=dict(zip(dims, (x, y), strict=True))))
