"""`friso export`: what a stage file says, in the terms of a drive."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from friso.cli.command import Choices, Command
from friso.cli.common import AsJson, StageFile, in_units_of, print_table, print_wrapped
from friso.cli.output import OutFolder, Overwrite, output_folder, print_document, print_written
from friso.errors import InputError
from friso.quantities import quoted
from friso.stage import load, parse_set

if TYPE_CHECKING:
    from friso.drives.gains import Gains

What = Annotated[str, typer.Argument(metavar="gains", help="The gains of the controller.")]
Told = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="KEY=VALUE", help='Override a key, or say what no stage file does: travel_per_turn="10 mm".'
    ),
]
To = Annotated[str | None, typer.Option("--to", metavar="FORMAT", help="Also the parameters of a drive; see below.")]


def export(
    what: What,
    stage_file: StageFile,
    told: Told = None,
    to: To = None,
    out: OutFolder = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """The gains in the units of drives, with a drawing of the loop that they belong to, and as a drive's parameters.

    travel_per_turn and motor_constant ("0.5 N*m/A") add the units of a motor.

    Example: friso export gains examples/twincat_cascade.toml --set travel_per_turn="10 mm"
    """
    from friso.drives.gains import gains_of

    if what != "gains":
        raise InputError("WHAT", quoted(what), "gains", "friso export gains stage.toml")
    pairs = dict(parse_set(text) for text in told or [])
    overrides = {key: value for key, value in pairs.items() if "." in key}
    stage = load(stage_file)
    stage = in_units_of(stage.replace(overrides) if overrides else stage)
    answers = {key: value for key, value in pairs.items() if key not in overrides}
    gains = gains_of(stage, answers, to)
    target = output_folder("export", out, overwrite, [stage_file])
    files = []
    if target is not None:
        from friso.views.export.page import export_files

        files = target.write(export_files(gains))
    if as_json:
        from friso.views.export.document import export_document

        print_document(export_document(gains), files)
    else:
        _print(gains)
        print_written(files)


def _print(gains: Gains) -> None:
    from friso.views.export.words import COLUMNS, notes, rows, title

    if gains.drawing:
        print(f"{gains.drawing}\n")
    print_table(title(gains), COLUMNS, rows(gains))
    if gains.parameters:
        print(gains.text)
    for note in notes(gains):
        print_wrapped(f"note: {note}")


def listed_formats() -> list[tuple[str, str]]:
    """The kinds of parameter files, each in one line."""
    from friso.drives.format import FORMATS

    return [(name, FORMATS.one_line(name)) for name in FORMATS]


COMMAND = Command(export, 95, Choices("Formats of --to, and of friso init --from", listed_formats))
