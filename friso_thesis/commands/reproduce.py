"""`friso reproduce`: the thesis's figures and claims, computed again and judged."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from friso.cli.asking import Details, ask
from friso.cli.command import WHY, Command
from friso.cli.common import AsJson, Tolerance
from friso.cli.output import OutFolder, Overwrite
from friso_thesis.commands.unfinished import kept_until_done


def reproduce(
    names: Annotated[
        list[str] | None, typer.Argument(metavar="[STUDY]...", help="Studies of Table 3 by name; default: all of them.")
    ] = None,
    points: Annotated[int, typer.Option(metavar="NUMBER", help="Values per axis of every map.")] = 41,
    only: Annotated[
        list[str] | None, typer.Option(metavar="CLAIM", help="Judge this claim alone, such as F15B; may be repeated.")
    ] = None,
    draws: Annotated[
        int, typer.Option(metavar="NUMBER", help="Joint draws of the values that the thesis does not state.")
    ] = 48,
    rtol: Tolerance = "1e-6",
    laws: Annotated[bool, typer.Option("--laws", help="Judge the conclusions under every friction law too.")] = False,
    out: OutFolder = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
    details: Details = False,
) -> None:
    """Every figure and claim of the thesis that computation can decide, judged: reproduction.html, claims.json.

    Writes into the folder reproduction; single claims go into one such as reproduction-F15B.
    An interrupted run keeps what it has finished; the same command resumes it.

    Example: friso reproduce --points 21 --draws 12 --out reproduction

    One claim: friso reproduce --only F15B
    """
    from friso.interface.output_folder import UNFINISHED
    from friso_thesis.questions.reproduce.question import reproduce as question
    from friso_thesis.studies.thesis.kept import Kept

    folder = out or Path("-".join(("reproduction", *sorted({claim.upper() for claim in only or ()}))))
    kept = Kept(folder / UNFINISHED)
    shown = {"out": folder, "overwrite": overwrite, "as_json": as_json, "details": details}
    asked = {"points": points, "only": only, "draws": draws, "rtol": rtol, "laws": laws}
    with kept_until_done(kept, "piece of the work", "pieces of the work"):
        ask("reproduce", question, names, **asked, folder=kept.folder, **shown)


COMMAND = Command(reproduce, 130, WHY)
