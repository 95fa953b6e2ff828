"""The files of `friso boundary`: the figure, and the table of its points."""

from __future__ import annotations

from functools import partial
from itertools import repeat
from pathlib import Path

from friso.hunting import Diagram, Plane
from friso.studies.boundary_lines import lines
from friso.views.boundary.figures import boundary_figure
from friso.views.boundary.words import ShownKey
from friso.views.files import Content, image_files


def boundary_files(traced: Diagram | Plane, keys: tuple[ShownKey, ...], name: str, stem: str) -> dict[str, Content]:
    """The figure in all formats, and the table of its points."""
    figure = boundary_figure(traced, keys, name)
    return {**image_files(figure, stem), f"{stem}.csv": partial(_write_table, traced)}


def _write_table(traced: Diagram | Plane, path: Path) -> None:
    """One row per point of a line: special ones have a kind and an error."""
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
