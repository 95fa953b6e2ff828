"""The command line: `friso COMMAND STAGE.toml`. Reads what the analyses return and prints or draws it.

Exit status: 0 done, 1 the computation could not be completed, 2 the input is wrong, 130 interrupted.
"""

from __future__ import annotations

import io
import json
import logging
import math
import sys
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from friso.quantities import Quantity, StageError, positive
from friso.stage import Stage, load, parse_set
from friso.version import VERSION

if TYPE_CHECKING:
    import xarray as xr

    from friso.hunting import Case

app = typer.Typer(
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

INTERRUPTED = 130

StageFile = Annotated[Path, typer.Argument(metavar="STAGE.toml", help="The stage file.")]
Overrides = Annotated[
    list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help='Override a key: controller.crossover="12 Hz".')
]
Tolerance = Annotated[
    str, typer.Option("--rtol", metavar="NUMBER", help="Relative tolerance of the solver, 1e-12 to 1e-2.")
]
AsJson = Annotated[bool, typer.Option("--json", help="One JSON document on standard output, nothing else.")]
OutFolder = Annotated[Path | None, typer.Option("--out", metavar="DIR", help="Folder for the files written.")]


def main() -> NoReturn:
    """Run the command line; wrong input ends in one message and status 2, never in a traceback."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal that knows no dash still gets its answer
    if len(sys.argv) == 1:
        sys.argv.append("--help")
    logging.basicConfig(format="friso: %(message)s", level=logging.WARNING, stream=sys.stderr)
    try:
        status = app(standalone_mode=False) or 0
        if status == INTERRUPTED:  # typer's word for Ctrl-C
            _say("interrupted")
        sys.exit(status)
    except typer.Exit as leave:
        sys.exit(leave.exit_code)
    except (typer.Abort, KeyboardInterrupt):
        _say("interrupted")
        sys.exit(INTERRUPTED)
    except BrokenPipeError:
        sys.stderr.close()
        sys.exit(1)
    except StageError as error:
        _say(str(error))
        sys.exit(2)
    except Exception as error:
        usage = getattr(error, "format_message", None)
        if usage is not None:
            _say(f"{usage()}\n  try: friso --help")
            sys.exit(2)
        if isinstance(error, RuntimeError | OSError | MemoryError):
            _say(f"the computation could not be completed: {error}")
            sys.exit(1)
        raise


def _say(message: str) -> None:
    print(f"friso: {message}", file=sys.stderr)


def _version(wanted: bool) -> None:
    if wanted:
        print(f"friso {VERSION}")
        raise typer.Exit


@app.callback()
def friso(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Does a positioning stage on contact bearings hunt, why, and what stops it?

    Start with: friso init stage.toml && friso check stage.toml
    """


@app.command()
def init(
    path: Annotated[Path, typer.Argument(metavar="STAGE.toml", help="The file to write.")] = Path("stage.toml"),
) -> None:
    """Write a commented stage file to start from.

    Example: friso init my_stage.toml
    """
    template = files("friso").joinpath("templates/stage.toml").read_text(encoding="utf-8")
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(template)
    except OSError as error:
        expected = f"a new file in a folder that can be written ({error.strerror}); nothing was overwritten"
        raise StageError("STAGE.toml", str(path), expected, "friso init new.toml") from None
    print(f"wrote {path}; edit it, then: friso check {path}")


@app.command()
def check(
    stage_file: StageFile,
    overrides: Overrides = None,
    rtol: Tolerance = "1e-6",
    out: OutFolder = None,
    as_json: AsJson = False,
) -> None:
    """Does the stage hunt: as given, and with its joint locked and free.

    Example: friso check examples/thesis_rig.toml --set controller.crossover="12 Hz" --out report
    """
    stage, tolerance = _stage(stage_file, overrides), _tolerance(rtol)
    folder = None if out is None else _folder(out)
    from friso.hunting import check as check_stage

    cases = check_stage(stage, rtol=tolerance, traces=folder is not None)
    if folder is not None:
        from friso.views.report import write_report

        write_report(cases, folder / "report.html")
    if as_json:
        print(json.dumps(_check_document(stage, cases), allow_nan=False))
    else:
        _print_cases(stage, cases)
        if folder is not None:
            print(f"report: {folder / 'report.html'}")
    _leave(all(case.solver.done for case in cases.values()))


@app.command()
def simulate(
    stage_file: StageFile,
    overrides: Overrides = None,
    rtol: Tolerance = "1e-6",
    sample_time: Annotated[str | None, typer.Option(metavar="TIME", help='Sampling interval, such as "1 ms".')] = None,
    out: OutFolder = None,
    as_json: AsJson = False,
) -> None:
    """Time response of the stage to its motion: NetCDF, CSV and a plot.

    Example: friso simulate examples/lugre_stick_slip.toml --sample-time "1 ms" --out response
    """
    stage, tolerance = _stage(stage_file, overrides), _tolerance(rtol)
    interval = None if sample_time is None else _sample_time(sample_time)
    folder = _folder(out or Path("."))
    from friso.engine.simulate import simulate as simulate_stage

    response = simulate_stage(stage, rtol=tolerance, sample_time=interval)
    written = _write_response(response, folder / f"{stage_file.stem}_response")
    status = response.attrs["status"]
    if as_json:
        solver = {"status": status, "steps": response.attrs["steps"], "rejected": response.attrs["rejected"]}
        document = {"stage": stage.name, "files": [str(path) for path in written]}
        print(json.dumps(document | {"solver": solver | {"rtol": tolerance}}))
    else:
        print(f"{stage.name or stage_file.stem}: {status} ({response.attrs['steps']} steps)")
        print("\n".join(f"wrote {path}" for path in written))
    _leave(status == "done")


def _leave(done: bool) -> None:
    if not done:
        _say("the computation could not be completed; see the status above")
        raise typer.Exit(1)


def _stage(path: Path, overrides: list[str] | None) -> Stage:
    """The stage of the file with the overrides. Raises StageError."""
    changes = dict(parse_set(text) for text in overrides or [])
    stage = load(path)
    return stage.replace(changes) if changes else stage


def _folder(path: Path) -> Path:
    """The folder, made if it is not there. Raises StageError."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        expected = f"a folder that can be written ({error.strerror})"
        raise StageError("--out", str(path), expected, "--out report") from None
    return path


def _tolerance(text: str) -> float:
    from friso.engine.tolerance import checked_rtol

    try:
        return checked_rtol(float(text))
    except ValueError:
        raise StageError("--rtol", text, "a number from 1e-12 to 1e-2", "--rtol 1e-6") from None


def _sample_time(text: str) -> float:
    try:
        return Quantity("s", positive, "1 ms").read(text)
    except StageError as error:
        raise error.under("--sample-time") from None


def _write_response(response: xr.Dataset, stem: Path) -> list[Path]:
    """NetCDF with everything, CSV with the samples, PNG with the plot."""
    from friso.views.check_figures import response_figure
    from friso.views.matplotlib_renderer import save

    paths = [stem.with_name(f"{stem.name}.{ending}") for ending in ("nc", "csv", "png")]
    response.to_netcdf(paths[0], engine="scipy")
    samples = response.drop_dims("turning_point").to_dataframe()
    units = {name: f"{name} [{response[name].attrs['units']}]" for name in samples}
    samples.rename(columns=units).to_csv(paths[1], index_label="time [s]")
    save(response_figure(response), paths[2])
    return paths


def _check_document(stage: Stage, cases: dict[str, Case]) -> dict[str, Any]:
    """The JSON document of `check` (design.md, section 3)."""
    return {"stage": stage.name, "cases": {name: _case_document(case) for name, case in cases.items()}}


def _case_document(case: Case) -> dict[str, Any]:
    into_1um, into_10um = case.settling_time.values()
    return {
        "verdict": case.verdict,
        "peaks": case.peaks,
        "peak_to_peak_m": _finite(case.peak_to_peak),
        "period_s": case.period,
        "settling_time_s": into_1um,
        "settling_time_10um_s": into_10um,
        "largest_force_n": _finite(case.largest_force),
        "cycle": None,
        "solver": {
            "status": case.solver.status,
            "steps": case.solver.steps,
            "rejected": case.solver.rejected,
            "rtol": case.solver.rtol,
        },
    }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _print_cases(stage: Stage, cases: dict[str, Case]) -> None:
    """A sentence per case, and the short table of `check`."""
    from rich.console import Console
    from rich.table import Table

    from friso.views.cases import shown_cases
    from friso.views.summary import conclusion, rows, verdict_sentence

    shown = shown_cases(cases)
    console = Console(highlight=False, markup=False)
    table = Table("", *(item.label for item in shown), title=stage.name or None, title_justify="left")
    for label, texts in rows(shown):
        table.add_row(label, *texts)
    console.print(table)
    for sentence in [f"{item.label}: {verdict_sentence(item)}" for item in shown]:
        console.print(sentence)
    if found := conclusion(cases):
        console.print(found)


if __name__ == "__main__":
    main()
