"""`friso bode`: limit cases, margins, and how fast the controller may be."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from friso.cli.common import (
    AS_BUILT,
    AsJson,
    OutFolder,
    Overrides,
    StageFile,
    finite,
    made_folder,
    print_table,
    read_stage,
    say,
)
from friso.cli.progress import busy
from friso.errors import InputError
from friso.quantities import Bound, Quantity, quoted
from friso.stage import Stage

if TYPE_CHECKING:
    from friso.frequency.bode import Bode
    from friso.frequency.crossover import Limits
    from friso.frequency.margins import Margins
    from friso.frequency.members import Members

FREQUENCY = Quantity("Hz", Bound("from 1 uHz to 1 GHz", lambda value: (value >= 1e-6) & (value <= 1e9)), "0.1 Hz")
EXAMPLE = '--frequencies "0.1 Hz..1 kHz"'


def bode(
    stage_file: StageFile,
    overrides: Overrides = None,
    frequencies: Annotated[
        str | None,
        typer.Option(metavar='"FIRST..LAST"', help="Frequency range of the figures; default: all that is relevant."),
    ] = None,
    series: Annotated[
        bool, typer.Option("--series", help="Also show the thesis's formula for a touched limiter.")
    ] = False,
    out: OutFolder = None,
    as_json: AsJson = False,
) -> None:
    """Is the controller stable and robust, stuck or sliding, and how fast may it be: margins and Bode plots.

    Example: friso bode examples/thesis_rig.toml --frequencies "0.1 Hz..1 kHz" --out bode
    """
    stage = read_stage(stage_file, overrides, leaves_out=AS_BUILT[1:])
    if stage.drive and stage.drive.velocity_samples is not None:
        say("drive.velocity_samples is ignored: the derivative is that of the bilinear transform")
    shown = None if frequencies is None else _read_frequencies(frequencies, stage)
    folder = None if out is None else made_folder(out)
    from friso.frequency.bode import bode as analysis

    with busy("analysing all states"):
        found = analysis(stage, shown, series)
        files = [] if folder is None else _write(found, folder)
    if as_json:
        print(json.dumps(bode_document(found), allow_nan=False))
        return
    _print(found)
    if files:
        print("\n".join(f"wrote {file}" for file in files))


def _read_frequencies(text: str, stage: Stage) -> tuple[float, float]:
    """Both ends [Hz] of a range of frequencies that the drive knows. Raises InputError."""
    first, _, last = text.partition("..")
    if not (first.strip() and last.strip()):
        raise InputError("--frequencies", quoted(text), "a range of frequencies, FIRST..LAST", EXAMPLE)
    try:
        low, high = float(FREQUENCY.read(first)), float(FREQUENCY.read(last))
    except InputError as error:
        raise InputError("--frequencies", error.given, error.expected, EXAMPLE) from None
    if not low < high:
        order = "empty" if low == high else "reversed"
        raise InputError("--frequencies", quoted(text, f"{order} range"), "an increasing range", EXAMPLE)
    sample_time = stage.flat().get("drive.sample_time")
    if sample_time and high > 0.5 / sample_time:
        half = f"frequencies of up to {0.5 / sample_time:g} Hz, half the sampling frequency (drive.sample_time)"
        raise InputError("--frequencies", quoted(text), half, f'--frequencies "0.1 Hz..{0.5 / sample_time:g} Hz"')
    return low, high


def bode_document(found: Bode) -> dict[str, Any]:
    """The JSON document of `bode`; infinite and undefined numbers are null."""
    given = found.stage.joint
    own = "given" if given is None else ("locked" if given.locked else "free")
    crossover = found.stage.controller.bandwidth_key is not None
    return {
        "stage": found.stage.name,
        "cases": {name: _margins(case.margins) for name, case in found.cases.items()},
        "worst": _at(found, *found.worst),
        "worst_settled": _at(found, *found.settled),
        "unstable_speeds_m_per_s": [
            {"low": each.low, "high": each.high, "limiter": _limiter(found, each.touched), "forward": each.forward}
            for each in found.unstable
        ],
        "limits": {name: _limits(known, "hz" if crossover else "factor") for name, known in found.limits.items()},
        "highest_stable_crossover_hz": found.limits[own].highest_stable if crossover else None,
        "still_stable_there": found.limits[own].open_ended,
    }


def _margins(known: Margins) -> dict[str, Any]:
    return {
        "stable": known.stable,
        "crossovers_hz": list(known.crossovers),
        "phase_margin_deg": finite(known.phase_margin),
        "gain_margin": finite(known.gain_margin),
        "gain_reduction": finite(known.gain_reduction),
        "delay_margin_s": finite(known.delay_margin),
        "modulus_margin": finite(known.modulus_margin),
        "peak_sensitivity": finite(known.peak_sensitivity),
        "closest_hz": finite(known.closest),
        "poles": [[pole.real, pole.imag] for pole in known.poles.tolist()],
    }


def _at(found: Bode, one: Members, known: Margins) -> dict[str, Any]:
    """The margins of a member of the family, and which one it is."""
    at = {
        "bias_n": float(one.bias[0]),
        "speed_m_per_s": float(one.speed[0]),
        "limiter": _limiter(found, bool(one.touched[0])),
        "forward": bool(one.forward[0]),
    }
    return {**_margins(known), "at": at}


def _limiter(found: Bode, touched: bool) -> str | None:
    from friso.views.bode.states import has_limiter, side

    return side(touched) if has_limiter(found) else None


def _limits(known: Limits, unit: str) -> dict[str, Any]:
    return {
        f"highest_stable_crossover_{unit}": known.highest_stable,
        "still_stable_there": known.open_ended,
        f"stable_{unit}": known.stable,
        f"modulus_margin_above_half_{unit}": known.comfortable,
        f"searched_{unit}": known.searched,
    }


def _print(found: Bode) -> None:
    from friso.views.bode.states import shown_states
    from friso.views.bode.table import rows
    from friso.views.bode.words import sentences

    shown = shown_states(found)
    print_table(found.stage.name, [item.label for item in shown], rows(shown), sentences(found))


def _write(found: Bode, folder: Path) -> list[Path]:
    """The page, and every figure in all formats."""
    from friso.views.bode.figures import bode_figures
    from friso.views.bode.page import bode_html
    from friso.views.drawing.matplotlib_renderer import FORMATS, save

    figures = bode_figures(found)
    pictures = {folder / f"{figure.name}.{form}": figure for figure in figures for form in FORMATS}
    for path, figure in pictures.items():
        save(figure, path)
    page = folder / "bode.html"
    page.write_text(bode_html(found, figures), encoding="utf-8", newline="\n")
    return [page, *pictures]
