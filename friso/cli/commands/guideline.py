"""`friso guideline`: the design guideline, every number and chart of it computed anew."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from friso.cli.command import Command
from friso.cli.common import AsJson, print_wrapped, say
from friso.cli.output import DefaultFolder, OutputFolder, Overwrite, print_document, print_written
from friso.cli.progress import ProgressBar


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
    """The design guideline: guideline.md, its charts, guideline_edges.csv.

    Example: friso guideline --out guideline
    A quick try: friso guideline --samples 64 --out /tmp/guideline
    """
    from friso.studies.guideline import guideline as compute
    from friso.studies.guideline.compute import checked_samples

    checked_samples(samples)
    target = OutputFolder("guideline", out, overwrite)
    from friso.studies.guideline.sweeps import Keep
    from friso.views.guideline.document import guideline_document
    from friso.views.guideline.page import guideline_files
    from friso.views.guideline.words import accuracy

    keep = Keep(target.unfinished)
    try:
        with ProgressBar() as progress:
            result = compute(samples, keep.folder, progress)
            files = target.write(guideline_files(result), progress)
    except KeyboardInterrupt:
        say(f"{keep.count} parts of the sweeps are kept in {keep.folder}; the same command resumes from there")
        raise
    keep.clear()
    if as_json:
        print_document(guideline_document(result), files)
        return
    for sentence in accuracy(result):
        print_wrapped(sentence)
    print_written(files)


COMMAND = Command(guideline, 140)
