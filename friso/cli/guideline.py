"""`friso guideline`: the design guideline, every number and chart of it computed anew."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from friso.cli.common import AsJson, OutFolder, made_folder, say
from friso.cli.progress import step_bar

UNFINISHED = ".guideline"
"""Folder beside the page for what is done until all is."""


def guideline(
    samples: Annotated[
        int,
        typer.Option(
            metavar="NUMBER", help="Number of samples for the locked law, 64 or more; the other sweeps scale with it."
        ),
    ] = 512,
    out: OutFolder = Path("guideline"),
    as_json: AsJson = False,
) -> None:
    """The design guideline: guideline.md, its charts, guideline_edges.csv. Ten minutes on two cores, twenty if shared.

    Example: friso guideline --out docs
    A quick try: friso guideline --samples 64 --out /tmp/guideline
    """
    from friso.studies.guideline import guideline as compute
    from friso.studies.guideline.compute import checked_samples

    checked_samples(samples)
    folder = made_folder(out or Path("guideline"))
    from friso.studies.guideline.sweeps import Keep
    from friso.views.guideline.page import guideline_document, write_guideline
    from friso.views.guideline.words import percent

    keep = Keep(folder / UNFINISHED)
    try:
        with step_bar() as progress:
            found = compute(samples, keep.folder, progress)
    except KeyboardInterrupt:
        say(f"{keep.count} parts of the sweeps are kept in {keep.folder}; the same command resumes from there")
        raise
    files = write_guideline(found, folder)
    keep.clear()
    if as_json:
        print(json.dumps(guideline_document(found) | {"files": [str(path) for path in files]}, allow_nan=False))
        return
    for name, fit in (("locked", found.locked), ("free", found.free)):
        errors = fit.on_test
        print(
            f"{name}: {errors.count} held-out samples, rms error {percent(errors.rms)}, worst {percent(errors.worst)}"
        )
    print("\n".join(f"wrote {path}" for path in files))
