"""Write the files of `friso simulate`: a time response."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import xarray as xr

from friso.questions.check.figures import response_figure
from friso.shown.files import Content, image_files


def simulate_files(response: xr.Dataset, stem: str) -> dict[str, Content]:
    """Return NetCDF with everything, CSV with the samples, and PNG with the plot, named `stem`."""
    return {
        f"{stem}.nc": lambda path: response.to_netcdf(path, engine="scipy"),
        f"{stem}.csv": partial(_write_samples, response),
        **image_files(response_figure(response), stem, ["png"]),
    }


def _write_samples(response: xr.Dataset, path: Path) -> None:
    """Write the samples of a response as CSV, with units in the header."""
    samples = response.drop_dims("turning_point", errors="ignore").to_dataframe()
    units = {name: f"{name} [{response[name].attrs['units']}]" for name in samples}
    samples.rename(columns=units).to_csv(path, index_label="time [s]")
