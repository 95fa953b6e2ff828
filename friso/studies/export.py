"""Write studies for other programs, as NetCDF and CSV."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from friso.escapes import table_cell
from friso.studies.metric import every_variable, is_text
from friso.studies.settings import settings

if TYPE_CHECKING:
    import xarray as xr


def export(runs: xr.Dataset, path: Path) -> None:
    """Write a study as NetCDF (".nc") or as CSV with one row per cell (".csv").

    Columns of a CSV file are named with their units. Raises ValueError for another suffix.
    """
    if path.suffix == ".nc":
        texts = [name for name in every_variable() if name in runs and is_text(name)]
        converted = {name: runs[name].copy(data=_bytes(runs[name].values)) for name in texts}
        runs.assign(converted).to_netcdf(path, engine="scipy")
    elif path.suffix == ".csv":
        _write_csv(runs, path)
    else:
        raise ValueError(f"export: given {path.suffix}, expected .nc or .csv")


def _bytes(texts: np.ndarray) -> np.ndarray:
    """Return texts as UTF-8 bytes, in an array wide enough for the longest of them."""
    import pandas as pd

    codes, words = pd.factorize(texts.ravel())
    return np.array([str(word).encode() for word in words])[codes].reshape(texts.shape)


def _write_csv(runs: xr.Dataset, path: Path) -> None:
    """Write a study as a table of comma-separated values, one row per cell."""
    import pandas as pd

    dims = [str(dim) for dim in runs["outcome"].dims]
    shape = runs["outcome"].shape
    rows = max(1, settings.rows_together // max(1, int(np.prod(shape[1:]))))
    with path.open("w", encoding="utf-8", newline="") as file:
        for first in range(0, shape[0], rows):
            part = runs.isel({dims[0]: slice(first, first + rows)})
            frame: pd.DataFrame = part.to_dataframe(dim_order=dims).reset_index()
            named = {name: table_cell(_with_unit(runs, str(name))) for name in frame.columns}
            for name in frame.columns[[kind.kind not in "biuf" for kind in frame.dtypes]]:
                frame[name] = frame[name].astype(str).map(table_cell)
            frame.rename(columns=named).to_csv(file, index=False, header=first == 0)


def _with_unit(runs: xr.Dataset, name: str) -> str:
    unit = runs[name].attrs.get("units", "")
    return f"{name} [{unit}]" if unit not in ("", "1") else name
