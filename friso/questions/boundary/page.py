"""Write the files of `friso boundary`: the page, the figure, and the table of points."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from itertools import repeat
from pathlib import Path

from friso.hunting import Diagram, Plane
from friso.questions.boundary.figures import boundary_figure
from friso.questions.boundary.words import ShownKey, answer, details
from friso.questions.map.places import SHOWN, with_places
from friso.shown.drawing.figure import Figure
from friso.shown.files import Content, image_files
from friso.shown.pages import Report
from friso.shown.unknown import unknown_condition
from friso.stage import Stage
from friso.studies.boundary import lines


def boundary_files(traced: Diagram | Plane, keys: tuple[ShownKey, ...], stage: Stage, stem: str) -> dict[str, Content]:
    """Return the page, the figure in all formats, and the table of points, all named `stem`."""
    condition = unknown_condition(stage, [swept.key for swept in traced.space.ranges])
    figure = boundary_figure(traced, keys, stage.name, condition)
    if isinstance(traced, Plane):
        figure = with_places(figure, [(SHOWN, stage)], [key.key for key in keys])
    images = image_files(figure, stem)
    page = boundary_html(traced, keys, stage, figure, condition)
    return {f"{stem}.html": page, **images, f"{stem}.csv": partial(_write_table, traced)}


def boundary_html(
    traced: Diagram | Plane, keys: tuple[ShownKey, ...], stage: Stage, figure: Figure, condition: str = ""
) -> str:
    """Return the page of a boundary with its figure; it holds under a `condition`."""
    values = {
        "condition": condition,
        "sentences": answer(traced, keys),
        "details": details(traced, keys),
        "note": figure.note,
    }
    return Report.of_stage("boundary", stage, [replace(figure, note="")], **values).html()


def _write_table(traced: Diagram | Plane, path: Path) -> None:
    """Write a CSV table with one row per point of a branch or curve.

    Flips, folds and other special points also have a kind and an error.
    """
    import pandas as pd

    keys = [f"{swept.key} [{swept.unit}]" if swept.unit else swept.key for swept in traced.space.ranges]
    header = ["line", "cycle", "kind", *keys, *(f"error of {key}" for key in keys)]
    rows = [
        row
        for number, line in enumerate(lines(traced))
        for row in zip(
            repeat(number),
            repeat(line.shape),
            line.kinds,
            *line.at.T,
            *line.error.T,
            line.amplitude,
            line.period,
            line.multiplier,
        )
    ]
    table = pd.DataFrame(rows, columns=[*header, "amplitude [m]", "period [s]", "multiplier"])
    table.to_csv(path, index=False)
