"""`friso reproduce`: the thesis's figures and claims, computed again and judged."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from friso.cli.command import Command
from friso.cli.common import AsJson, Tolerance, print_wrapped, read_tolerance
from friso.cli.output import DefaultFolder, OutputFolder, Overwrite, print_document, print_written
from friso.cli.progress import ProgressBar


def reproduce(
    names: Annotated[
        list[str] | None, typer.Argument(metavar="[STUDY]...", help="Studies of Table 3 by name; default: all of them.")
    ] = None,
    points: Annotated[int, typer.Option(metavar="NUMBER", help="Values per axis of every map.")] = 41,
    rtol: Tolerance = "1e-6",
    out: DefaultFolder = Path("reproduction"),
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Every figure and claim of the thesis that computation decides, judged: reproduction.html, claims.json.

    Example: friso reproduce --points 21 --out reproduction
    One study: friso reproduce isolator-crossover
    """
    tolerance = read_tolerance(rtol)
    target = OutputFolder("reproduce", out, overwrite)
    from friso.studies.thesis.reproduce import reproduce as reproduce_thesis
    from friso.views.reproduce.document import reproduce_document
    from friso.views.reproduce.page import reproduce_files

    with ProgressBar() as progress:
        result = reproduce_thesis(names, points, tolerance, progress)
        files = target.write(reproduce_files(result), progress)
    document = reproduce_document(result)
    if as_json:
        print_document(document, files)
        return
    print_wrapped(document["conclusion"])
    for claim in document["claims"]:
        if claim["judgement"] != "not yet covered":
            print(f"{claim['id']:5} {claim['judgement']:14} {claim['number']}")
    for name, cells in document["cycles"].items():
        print_wrapped(
            f"{name}: in {cells['counted_only']} of {cells['cells']} cells peaks are counted although no cycle "
            f"attracts; in {cells['attracted_only']} none are counted although one does"
        )
    print_written(path for path in files if path.suffix in (".html", ".json"))


COMMAND = Command(reproduce, 130)
