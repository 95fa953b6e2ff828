"""`friso schema`: the JSON Schema of the stage file, by which editors complete and check it."""

from __future__ import annotations

import json
from typing import Annotated

import typer

from friso.cli.asking import named_as_options
from friso.cli.command import Command
from friso.interface.question import HELP


def schema(
    of: Annotated[
        str, typer.Option("--of", metavar="stage|specification", help="Which of the two files it describes.")
    ] = "stage",
) -> None:
    """JSON Schema of the stage file, or of the specification of a design: for completion in editors.

    Example: friso schema > stage.schema.json
    """
    from friso.interface.starting import schema as schema_of

    with named_as_options({"of": of}):
        print(json.dumps(schema_of(of), indent=2, ensure_ascii=False))


COMMAND = Command(schema, 146, HELP)
