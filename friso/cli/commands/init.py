"""`friso init`: a stage file to start from."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any

import typer

from friso.cli.command import Command
from friso.cli.common import Overrides, print_wrapped
from friso.cli.output import Overwrite, refuse_device, write
from friso.errors import InputError
from friso.stage import load, parse_set

STAGE = Path("stage.toml")
"""The file that is written where none is named."""

Source = Annotated[
    Path | None,
    typer.Option(
        "--from",
        metavar="FILE",
        help="Parameter file of a drive, such as a LinuxCNC INI; friso export --help lists them.",
    ),
]
Axis = Annotated[
    str | None, typer.Option("--axis", metavar="NAME", help="Which axis of that file, where it has several.")
]


def init(
    path: Annotated[Path, typer.Argument(metavar="STAGE.toml", help="The file to write.")] = STAGE,
    spec_of: Annotated[
        Path | None,
        typer.Option("--spec", metavar="STAGE.toml", help="Write a specification for friso design of this stage."),
    ] = None,
    source: Source = None,
    axis: Axis = None,
    overrides: Overrides = None,
    overwrite: Overwrite = False,
) -> None:
    """Write a stage file to start from: a commented one, or with --from that of an axis in a drive's parameter file; or
    with --spec a specification.

    What a parameter file does not tell, of the machine above all, is asked for in one list; --set answers.

    Example: friso init my_stage.toml
    """
    told = dict(parse_set(text) for text in overrides or [])
    if source is None and (axis is not None or told):
        raise InputError(
            "--set" if told else "--axis", "no --from", "a parameter file that it is about", "--from machine.ini"
        )
    path = Path("spec.toml") if spec_of is not None and path == STAGE else path
    refuse_device("STAGE.toml", path)
    if path.exists() and not overwrite:
        expected = "a new file, or --overwrite; nothing was overwritten"
        raise InputError("STAGE.toml", f"{path}, which already exists", expected, "friso init new.toml")
    text, left_out = _text(spec_of, source, axis, told)
    try:
        path.parent.stat()  # a folder that is missing is a mistake, not one to make
        write({path: text})
    except OSError as error:
        expected = f"a new file in a folder that can be written ({error.strerror}); nothing was overwritten"
        raise InputError("STAGE.toml", str(path), expected, "friso init new.toml") from None
    for sentence in left_out:
        print_wrapped(f"left out: {sentence}")
    then = f"friso check {path}" if spec_of is None else f"friso design {spec_of} {path}"
    print(f"wrote {path}; {'look at it' if source else 'edit it'}, then: {then}")


def _text(
    spec_of: Path | None, source: Path | None, axis: str | None, told: dict[str, Any]
) -> tuple[str, tuple[str, ...]]:
    """What is written: a specification, the stage of an axis in a parameter file, or the commented stage file; and what
    a parameter file has that the stage leaves out. Raises InputError."""
    if spec_of is not None:
        from friso.design_method.outline import outline

        if source is not None:
            raise InputError("--spec", "together with --from", "one of the two", "friso init --from machine.ini")
        return outline(load(spec_of)), ()
    if source is not None:
        from friso.drives.read import stage_from

        drawn = stage_from(source, axis, told)
        return drawn.text(), drawn.left_out
    return files("friso").joinpath("templates/stage.toml").read_text(encoding="utf-8"), ()


COMMAND = Command(init, 10)
