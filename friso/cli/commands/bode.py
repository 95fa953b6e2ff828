"""`friso bode`: limit cases, margins, and how fast the controller may be."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from friso.cli.command import Command
from friso.cli.common import (
    AS_BUILT,
    AsJson,
    Overrides,
    StageFile,
    print_answer,
    read_stage,
    say,
)
from friso.cli.output import OutFolder, Overwrite, output_folder, print_document, print_written
from friso.cli.progress import ProgressBar
from friso.errors import InputError
from friso.quantities import Bound, Quantity, quoted
from friso.stage import Stage

if TYPE_CHECKING:
    from friso.frequency.bode import Bode

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
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Is the controller stable and robust, stuck or sliding, and how fast may it be: margins and Bode plots.

    Example: friso bode examples/thesis_rig.toml --frequencies "0.1 Hz..1 kHz" --out bode
    """
    stage = read_stage(stage_file, overrides, leaves_out=AS_BUILT[1:])
    if stage.drive and stage.drive.velocity_samples is not None:
        say("drive.velocity_samples is ignored: the derivative is that of the bilinear transform")
    states = None if frequencies is None else _read_frequencies(frequencies, stage)
    target = output_folder("bode", out, overwrite, [stage_file])
    from friso.frequency.bode import bode as analysis

    files = []
    with ProgressBar("analysing all states") as progress:
        result = analysis(stage, states, series)
        if target is not None:
            from friso.views.bode.page import bode_files

            files = target.write(bode_files(result), progress)
    if as_json:
        from friso.views.bode.document import bode_document

        print_document(bode_document(result), files)
        return
    _print(result)
    print_written(files)


def _read_frequencies(text: str, stage: Stage) -> tuple[float, float]:
    """Both ends [Hz] of a range of frequencies that the drive knows. Raises InputError."""
    first, _, last = text.partition("..")
    if not (first.strip() and last.strip()):
        raise InputError("--frequencies", quoted(text), "a range of frequencies, FIRST..LAST", EXAMPLE)
    try:
        low, high = float(FREQUENCY.read(first)), float(FREQUENCY.read(last))
    except InputError as error:
        raise InputError("--frequencies", error.actual, error.expected, EXAMPLE) from None
    if not low < high:
        order = "empty" if low == high else "reversed"
        raise InputError("--frequencies", quoted(text, f"{order} range"), "an increasing range", EXAMPLE)
    sample_time = stage.flat().get("drive.sample_time")
    if sample_time and high > 0.5 / sample_time:
        half = f"frequencies of up to {0.5 / sample_time:g} Hz, half the sampling frequency (drive.sample_time)"
        raise InputError("--frequencies", quoted(text), half, f'--frequencies "0.1 Hz..{0.5 / sample_time:g} Hz"')
    return low, high


def _print(result: Bode) -> None:
    from friso.views.bode.states import shown_states
    from friso.views.bode.table import rows
    from friso.views.bode.words import sentences

    states = shown_states(result)
    print_answer(sentences(result), result.stage.name, [item.label for item in states], rows(states))


COMMAND = Command(bode, 50)
