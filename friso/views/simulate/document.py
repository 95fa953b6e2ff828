"""A time response as a document and as files."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from friso.hunting.criteria.run_outcome import CRITERION
from friso.hunting.measures import Measures
from friso.views.check.figures import response_figure
from friso.views.documents import plain_json
from friso.views.drawing.matplotlib_renderer import save
from friso.views.files import Content

if TYPE_CHECKING:
    import xarray as xr


def simulate_document(
    response: xr.Dataset, measures: Measures, name: str, conclusion: str, files: list[Path]
) -> dict[str, Any]:
    """What the run of the stage of that name does, the files written, and how the solver fared."""
    into_1um, into_10um = measures.settling_time
    return plain_json(
        {
            "conclusion": conclusion,
            "stage": name,
            "outcome": measures.outcome[0],
            "criterion": CRITERION,
            "peak_to_peak_m": measures.peak_to_peak[0],
            "period_s": measures.period[0],
            "settling_time_s": into_1um[0],
            "settling_time_10um_s": into_10um[0],
            "files": [str(file) for file in files],
            "solver": {key: response.attrs[key] for key in ("status", "steps", "rejected", "rtol")},
        }
    )


def simulate_files(response: xr.Dataset, stem: str) -> dict[str, Content]:
    """NetCDF with everything, CSV with the samples, PNG with the plot."""
    return {
        f"{stem}.nc": lambda path: response.to_netcdf(path, engine="scipy"),
        f"{stem}.csv": partial(_write_samples, response),
        f"{stem}.png": partial(save, response_figure(response)),
    }


def _write_samples(response: xr.Dataset, path: Path) -> None:
    samples = response.drop_dims("turning_point").to_dataframe()
    units = {name: f"{name} [{response[name].attrs['units']}]" for name in samples}
    samples.rename(columns=units).to_csv(path, index_label="time [s]")
