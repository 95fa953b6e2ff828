"""The JSON document of `friso boundary`, and its files: the figure and the table of its points."""

from __future__ import annotations

from functools import partial
from itertools import repeat
from pathlib import Path
from typing import Any

import numpy as np

from friso.hunting.boundary import Diagram, Plane
from friso.views.boundary.data import Line, corner_verdicts, end_verdicts, lines, lost_places
from friso.views.boundary.figures import boundary_figure
from friso.views.boundary.words import ShownKey
from friso.views.documents import plain_json
from friso.views.drawing.matplotlib_renderer import FORMATS, save
from friso.views.files import Content


def boundary_document(found: Diagram | Plane, shown: tuple[ShownKey, ...]) -> dict[str, Any]:
    """The JSON document of `boundary`; values of the keys in the units of the command line."""
    document = _of_diagram(found, shown[0]) if isinstance(found, Diagram) else _of_plane(found, shown)
    return plain_json(document)


def _of_diagram(found: Diagram, key: ShownKey) -> dict[str, Any]:
    branches = lines(found)
    points = [_point(line, k, key) for line in branches for k in line.special]
    return {
        "key": key.key,
        "unit": key.unit,
        "points": sorted(points, key=lambda point: point["value"]),
        "ends": dict(zip(("low", "high"), end_verdicts(found), strict=True)),
        "branches": [_branch(line, key) for line in branches],
    }


def _point(line: Line, k: int, key: ShownKey) -> dict[str, Any]:
    return {
        "value": key.number(line.at[k, 0]),
        "kind": line.kinds[k],
        "error": key.number(line.error[k, 0]),
        "cycle": line.shape,
        "amplitude_m": float(line.amplitude[k]),
        "period_s": float(line.period[k]),
    }


def _branch(line: Line, key: ShownKey) -> dict[str, Any]:
    multiplier = line.multiplier[line.ordinary]
    return {
        "cycle": line.shape,
        "values": [key.number(value) for value in line.at[line.ordinary, 0].tolist()],
        "amplitude_m": line.amplitude[line.ordinary].tolist(),
        "period_s": line.period[line.ordinary].tolist(),
        "multiplier": multiplier.tolist(),
        "attracts": (abs(multiplier) < 1).tolist(),
        "ends": line.ends,
    }


def _of_plane(found: Plane, shown: tuple[ShownKey, ...]) -> dict[str, Any]:
    x, y = shown
    verdicts = [verdict for _, _, verdict in corner_verdicts(found)]
    return {
        "x": {"key": x.key, "unit": x.unit},
        "y": {"key": y.key, "unit": y.unit},
        "curves": [_curve(line, shown) for line in lines(found)],
        "lost": _numbers(lost_places(found), shown),
        "corners": dict(zip(("low low", "low high", "high low", "high high"), verdicts, strict=True)),
    }


def _curve(line: Line, shown: tuple[ShownKey, ...]) -> dict[str, Any]:
    return {
        "kind": line.kinds[0],
        "cycle": line.shape,
        "points": _numbers(line.at, shown),
        "error": _numbers(line.error, shown),
        "amplitude_m": line.amplitude.tolist(),
        "period_s": line.period.tolist(),
        "ends": line.ends,
    }


def _numbers(values: np.ndarray, shown: tuple[ShownKey, ...]) -> list[list[float]]:
    """Values of both keys [SI], shape (n, 2), in the units shown."""
    return [[key.number(value) for key, value in zip(shown, row, strict=True)] for row in values.tolist()]


def boundary_files(found: Diagram | Plane, shown: tuple[ShownKey, ...], name: str, stem: str) -> dict[str, Content]:
    """The figure in all formats, and the table of its points."""
    figure = boundary_figure(found, shown, name)
    drawn: dict[str, Content] = {f"{stem}.{form}": partial(save, figure) for form in FORMATS}
    return {**drawn, f"{stem}.csv": partial(_write_table, found)}


def _write_table(found: Diagram | Plane, path: Path) -> None:
    """One row per point of a line: special ones have a kind and an error."""
    import pandas as pd

    keys = [f"{one.key} [{one.unit}]" if one.unit else one.key for one in found.space.ranges]
    header = ["line", "cycle", "kind", *keys, *(f"error of {key}" for key in keys)]
    rows = [
        row
        for number, line in enumerate(lines(found))
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
