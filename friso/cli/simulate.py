"""`friso simulate`: a time response, of a stage file or of a cell of a study."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from friso.cli.common import (
    RTOL_HELP,
    AsJson,
    OutFolder,
    Overrides,
    leave,
    made_folder,
    read_sample_time,
    read_stage,
    read_tolerance,
    with_overrides,
)
from friso.errors import InputError
from friso.stage import Stage, save

if TYPE_CHECKING:
    import xarray as xr


def simulate(
    given: Annotated[
        list[str], typer.Argument(metavar="STAGE.toml", help="The stage file; with --cell, the cell's numbers: 3 4.")
    ],
    overrides: Overrides = None,
    cell: Annotated[
        Path | None, typer.Option(metavar="STORE", help="Run one cell of a study again, by itself.")
    ] = None,
    rtol: Annotated[str | None, typer.Option("--rtol", metavar="NUMBER", help=RTOL_HELP)] = None,
    sample_time: Annotated[str | None, typer.Option(metavar="TIME", help='Sampling interval, such as "1 ms".')] = None,
    out: OutFolder = None,
    as_json: AsJson = False,
) -> None:
    """Time response of the stage to its motion: NetCDF, CSV and a plot.

    Example: friso simulate examples/lugre_stick_slip.toml --sample-time "1 ms" --out response
    A cell of a map: friso simulate --cell rig_map.zarr 3 4
    """
    interval = None if sample_time is None else read_sample_time(sample_time)
    tolerance = None if rtol is None else read_tolerance(rtol)
    stage, name, its_rtol = _given(given, overrides) if cell is None else _cell(cell, given, overrides)
    folder = made_folder(out or Path("."))
    from friso.engine.simulate import simulate as simulate_stage

    response = simulate_stage(stage, rtol=tolerance or its_rtol, sample_time=interval)
    written = _write_response(response, folder / f"{name}_response")
    if cell is not None:
        written.append(folder / f"{name}.toml")
        save(stage, written[-1], overwrite=True)
    status = response.attrs["status"]
    if as_json:
        solver = {"status": status, "steps": response.attrs["steps"], "rejected": response.attrs["rejected"]}
        document = {"stage": stage.name, "files": [str(path) for path in written]}
        print(json.dumps(document | {"solver": solver | {"rtol": response.attrs["rtol"]}}))
    else:
        print(f"{name if cell else stage.name or name}: {status} ({response.attrs['steps']} steps)")
        print("\n".join(f"wrote {path}" for path in written))
    leave(status == "done")


def _given(given: list[str], overrides: list[str] | None) -> tuple[Stage, str, float]:
    """The stage of the one file given, a name for it, and the usual tolerance. Raises InputError."""
    if len(given) != 1:
        raise InputError("STAGE.toml", " ".join(given), "one stage file", "friso simulate rig.toml")
    return read_stage(Path(given[0]), overrides), Path(given[0]).stem, 1e-6


def _cell(store: Path, given: list[str], overrides: list[str] | None) -> tuple[Stage, str, float]:
    """The stage of a cell, a name for it, and the tolerance it was run at. Raises InputError."""
    from friso.studies.store import read_store
    from friso.studies.study import study_of

    study = study_of(read_store(store))
    sizes = ", ".join(f"{name} 0 to {size - 1}" for name, size in zip(study.names, study.shape, strict=True))
    index = [int(text) if text.isascii() and text.isdigit() else -1 for text in given]
    inside = len(index) == len(study.shape) and all(0 <= k < n for k, n in zip(index, study.shape, strict=True))
    if not inside:
        raise InputError(f"--cell {store}", " ".join(given), f"one number per axis: {sizes}", "3 4")
    name = f"{store.with_suffix('').name}_cell_{'_'.join(given)}"
    return with_overrides(study.cell_stage(index), overrides), name, study.rtol


def _write_response(response: xr.Dataset, stem: Path) -> list[Path]:
    """NetCDF with everything, CSV with the samples, PNG with the plot."""
    from friso.views.check.figures import response_figure
    from friso.views.drawing.matplotlib_renderer import save as save_figure

    paths = [stem.with_name(f"{stem.name}.{ending}") for ending in ("nc", "csv", "png")]
    response.to_netcdf(paths[0], engine="scipy")
    samples = response.drop_dims("turning_point").to_dataframe()
    units = {name: f"{name} [{response[name].attrs['units']}]" for name in samples}
    samples.rename(columns=units).to_csv(paths[1], index_label="time [s]")
    save_figure(response_figure(response), paths[2])
    return paths
