"""`friso guideline`: the design guideline, every number and chart of it computed anew."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from friso.cli.asking import ask
from friso.cli.command import WHERE, Command
from friso.cli.common import AsJson
from friso.cli.output import DefaultFolder, Overwrite
from friso_thesis.commands.unfinished import kept_until_done


def guideline(
    samples: Annotated[
        int,
        typer.Option(
            metavar="NUMBER", help="Number of samples for the locked law, 64 or more; the other sweeps scale with it."
        ),
    ] = 512,
    out: DefaultFolder = Path("guideline"),
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Two formulas for the crossover at which hunting ends: guideline.md, its charts, guideline_edges.csv.

    Example: friso guideline --out guideline

    A quick try: friso guideline --samples 64 --out guideline
    """
    from friso.interface.output_folder import UNFINISHED
    from friso_thesis.questions.guideline.question import guideline as question
    from friso_thesis.studies.guideline.compute import checked_samples
    from friso_thesis.studies.guideline.sweeps import Keep

    checked_samples(samples)
    keep = Keep(out / UNFINISHED)
    shown = {"out": out, "overwrite": overwrite, "as_json": as_json}
    with kept_until_done(keep, "part of the sweeps", "parts of the sweeps"):
        ask("guideline", question, samples=samples, folder=keep.folder, **shown)


COMMAND = Command(guideline, 140, WHERE)
