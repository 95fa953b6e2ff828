"""`friso init`: a stage file to start from, or a specification."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from friso.cli.asking import named_as_options
from friso.cli.command import Command
from friso.cli.common import Overrides, Replace
from friso.interface.question import MACHINE
from friso.platform.system import shell_word

SourceArgument = Annotated[
    Path | None,
    typer.Option(
        "--from",
        metavar="FILE",
        help="Parameter file of a drive, such as a LinuxCNC INI; friso export --help lists them.",
    ),
]
AxisNameOption = Annotated[
    str | None, typer.Option("--axis", metavar="NAME", help="Which axis of that file, where it has several.")
]


def init(
    path: Annotated[
        Path | None, typer.Argument(metavar="STAGE.toml", help="The file to write; default: stage.toml, or spec.toml.")
    ] = None,
    spec_of: Annotated[
        Path | None,
        typer.Option("--spec", metavar="STAGE.toml", help="Write a specification for friso design of this stage."),
    ] = None,
    source: SourceArgument = None,
    axis: AxisNameOption = None,
    overrides: Overrides = None,
    overwrite: Replace = False,
) -> None:
    """Write a stage file to start from: a commented one, that of an axis of a drive (--from), or a specification.

    What a parameter file does not tell, of the machine above all, is asked for in one list; --set answers.

    Example: friso init my_stage.toml
    """
    from friso.interface.starting import init as write_start

    options = {"spec": spec_of, "from_": source, "axis": axis, "set": overrides}
    with named_as_options(options):
        written = write_start(path, overwrite, **options)
    then = ["check"] if spec_of is None else ["design", str(spec_of)]
    command = " ".join(map(shell_word, ["friso", *then, str(written)]))
    print(f"wrote {written}; {'look at it' if source else 'edit it'}, then: {command}")


COMMAND = Command(init, 10, MACHINE)
