"""`friso convert`: the same stage under another friction law."""

from __future__ import annotations

from typing import Annotated

import typer

from friso.cli.command import Choices, Command
from friso.cli.common import AsJson, Overrides, StageFile, print_table, print_wrapped, read_stage
from friso.cli.output import OutFolder, Overwrite, output_folder, print_document, print_written
from friso.errors import InputError

Law = Annotated[str, typer.Option("--friction", metavar="LAW", help="The friction law to convert to.")]
Elements = Annotated[
    int, typer.Option("--elements", metavar="N", help="Elements of a law that has several, side by side, 1 to 12.")
]


def convert(
    stage_file: StageFile,
    law: Law,
    elements: Elements = 6,
    overrides: Overrides = None,
    out: OutFolder = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """To another friction law that shows the same in measurements, and what could not be kept.

    Example: friso convert examples/thesis_rig.toml --friction gms --elements 6 --out gms
    """
    stage = read_stage(stage_file, overrides)
    if not 1 <= elements <= MOST:
        raise InputError("--elements", str(elements), f"a whole number from 1 to {MOST}", "--elements 6")
    target = output_folder("convert", out, overwrite, [stage_file])
    from friso.studies.laws.conversion import convert as convert_stage

    conversion = convert_stage(stage, law, elements)
    files = []
    if target is not None:
        from friso.views.convert.page import convert_files

        files = target.write(convert_files(conversion, f"{stage_file.stem}_{law}"))
    from friso.views.convert.words import COLUMNS, conversion_rows, conversion_sentences, friction_table

    if as_json:
        from friso.views.convert.document import convert_document

        print_document(convert_document(conversion), files)
        return
    for sentence in conversion_sentences(conversion):
        print_wrapped(sentence)
    print_table(stage.name, COLUMNS, conversion_rows(conversion))
    if target is None:
        print(f"\n{friction_table(conversion)}")
    print_written(files)


MOST = 12
"""Elements at most."""


def _laws() -> list[tuple[str, str]]:
    from friso.stage.tables import friction_law
    from friso.studies.laws.conversion import convertible

    return [(name, (friction_law(name).__doc__ or "").split(":")[0].split("\n")[0]) for name in convertible()]


COMMAND = Command(convert, 96, Choices("Laws", _laws))
