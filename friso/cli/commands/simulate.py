"""`friso simulate`: a time response, of a stage file or of a cell of a study."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from friso.cli.command import Command
from friso.cli.common import (
    RTOL_HELP,
    AsJson,
    Overrides,
    leave,
    print_wrapped,
    read_sample_time,
    read_stage,
    read_tolerance,
    with_overrides,
)
from friso.cli.output import DefaultFolder, OutputFolder, Overwrite, print_document, print_written
from friso.errors import InputError
from friso.stage import Stage


def simulate(
    arguments: Annotated[
        list[str], typer.Argument(metavar="STAGE.toml", help="The stage file; with --cell, the cell's numbers: 3 4.")
    ],
    overrides: Overrides = None,
    cell: Annotated[
        Path | None, typer.Option(metavar="STORE", help="Run one cell of a study again, by itself.")
    ] = None,
    rtol: Annotated[str | None, typer.Option("--rtol", metavar="NUMBER", help=RTOL_HELP)] = None,
    sample_time: Annotated[str | None, typer.Option(metavar="TIME", help='Sampling interval, such as "1 ms".')] = None,
    out: DefaultFolder = Path("response"),
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Time response of the stage to its motion: NetCDF, CSV and a plot.

    Example: friso simulate examples/lugre_stick_slip.toml --sample-time "1 ms" --out response
    A cell of a map: friso simulate --cell rig_map.zarr 3 4
    """
    interval = None if sample_time is None else read_sample_time(sample_time)
    tolerance = None if rtol is None else read_tolerance(rtol)
    stage, name, usual_rtol = _stage(arguments, overrides) if cell is None else _cell(cell, arguments, overrides)
    target = OutputFolder("simulate", out, overwrite, [] if cell else [Path(arguments[0])])
    from friso.engine.simulate import simulate as simulate_stage
    from friso.hunting.measures import measured_run
    from friso.views.simulate.document import simulate_document
    from friso.views.simulate.page import simulate_files
    from friso.views.simulate.words import conclusion

    response = simulate_stage(stage, rtol=tolerance or usual_rtol, sample_time=interval)
    measures = measured_run(stage, tolerance or usual_rtol)
    files = simulate_files(response, f"{name}_response")
    written = target.write(files if cell is None else {**files, f"{name}.toml": stage.to_toml()})
    deviation = float(response["position"][-1] - response["reference"][-1])
    sentence = conclusion(name if cell else stage.name or name, measures, deviation)
    if as_json:
        print_document(simulate_document(response, measures, stage.name, sentence), written)
    else:
        print_wrapped(sentence)
        print(f"{response.attrs['steps']} steps of the solver, {response.attrs['rejected']} rejected")
        print_written(written)
    leave(response.attrs["status"] == "done")


def _stage(arguments: list[str], overrides: list[str] | None) -> tuple[Stage, str, float]:
    """The stage of the one file given, a name for it, and the usual tolerance. Raises InputError."""
    from friso.engine.simulate import RTOL

    if len(arguments) != 1:
        raise InputError("STAGE.toml", " ".join(arguments), "one stage file", "friso simulate rig.toml")
    return read_stage(Path(arguments[0]), overrides), Path(arguments[0]).stem, RTOL


def _cell(store: Path, arguments: list[str], overrides: list[str] | None) -> tuple[Stage, str, float]:
    """The stage of a cell, a name for it, and the tolerance it was run at. Raises InputError."""
    from friso.studies.store import read_store
    from friso.studies.study import study_of

    study = study_of(read_store(store))
    sizes = ", ".join(f"{name} 0 to {size - 1}" for name, size in zip(study.names, study.shape, strict=True))
    index = [int(text) if text.isascii() and text.isdigit() else -1 for text in arguments]
    inside = len(index) == len(study.shape) and all(0 <= k < n for k, n in zip(index, study.shape, strict=True))
    if not inside:
        raise InputError(f"--cell {store}", " ".join(arguments), f"one number per axis: {sizes}", "3 4")
    name = f"{store.with_suffix('').name}_cell_{'_'.join(arguments)}"
    return with_overrides(study.cell_stage(index), overrides), name, study.rtol


COMMAND = Command(simulate, 30)
