"""`friso reproduce`: the thesis's figures and claims, computed again and judged."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Annotated

import typer

from friso.cli.common import AsJson, OutFolder, Tolerance, made_folder, read_tolerance
from friso.cli.progress import step_bar


def reproduce(
    names: Annotated[
        list[str] | None, typer.Argument(metavar="[STUDY]...", help="Studies of Table 3 by name; default: all of them.")
    ] = None,
    points: Annotated[int, typer.Option(metavar="NUMBER", help="Values per axis of every map.")] = 41,
    rtol: Tolerance = "1e-6",
    out: OutFolder = Path("reproduction"),
    as_json: AsJson = False,
) -> None:
    """Every figure and claim of the thesis that computation decides, judged: reproduction.html, claims.json.

    Example: friso reproduce --points 21 --out reproduction
    One study: friso reproduce isolator-crossover
    """
    tolerance = read_tolerance(rtol)
    folder = made_folder(out or Path("reproduction"))
    from friso.studies.thesis.reproduce import reproduce as reproduce_thesis
    from friso.views.reproduce.page import claims_document, write_reproduction

    with step_bar() as progress:
        found = reproduce_thesis(names, points, tolerance, progress)
    files = write_reproduction(found, folder)
    document = claims_document(found)
    if as_json:
        print(json.dumps(document | {"files": [str(path) for path in files]}, allow_nan=False))
        return
    for claim in document["claims"]:
        if claim["judgement"] != "not yet covered":
            print(f"{claim['id']:5} {claim['judgement']:14} {claim['number']}")
    for name, cells in document["cycles"].items():
        print(
            f"{name}: of {cells['cells']} cells {cells['transient']} count peaks although no cycle attracts, and "
            f"{cells['dormant']} count none although one does"
        )
    counts = Counter(claim["judgement"] for claim in document["claims"])
    print(", ".join(f"{count} {judgement}" for judgement, count in counts.items()))
    print("\n".join(f"wrote {path}" for path in files if path.suffix in (".html", ".json")))
