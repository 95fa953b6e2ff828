"""`friso reproduce`: the thesis's figures and claims, computed again and judged."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from friso.cli.asking import Details, ask
from friso.cli.command import WHY, Command
from friso.cli.common import AsJson, Tolerance
from friso.cli.output import DefaultFolder, Overwrite


def reproduce(
    names: Annotated[
        list[str] | None, typer.Argument(metavar="[STUDY]...", help="Studies of Table 3 by name; default: all of them.")
    ] = None,
    points: Annotated[int, typer.Option(metavar="NUMBER", help="Values per axis of every map.")] = 41,
    rtol: Tolerance = "1e-6",
    laws: Annotated[bool, typer.Option("--laws", help="Judge the conclusions under every friction law too.")] = False,
    out: DefaultFolder = Path("reproduction"),
    overwrite: Overwrite = False,
    as_json: AsJson = False,
    details: Details = False,
) -> None:
    """Every figure and claim of the thesis that computation decides, judged: reproduction.html, claims.json.

    Example: friso reproduce --points 21 --out reproduction
    One study: friso reproduce isolator-crossover
    """
    from friso.answers.reproduce import reproduce as question

    shown = {"out": out, "overwrite": overwrite, "as_json": as_json, "details": details}
    ask("reproduce", question, names, points=points, rtol=rtol, laws=laws, **shown)


COMMAND = Command(reproduce, 130, WHY)
