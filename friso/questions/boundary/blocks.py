"""Give the blocks of `friso boundary`, and the table of points that it writes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from friso.hunting import Diagram, Plane
from friso.questions.boundary.words import ShownKey, answer, conclusion, details
from friso.shown.blocks import AnswerBlock
from friso.shown.documents import entries, plain_json
from friso.studies import boundary
from friso.studies.boundary import Line, lines

if TYPE_CHECKING:
    from friso.questions.boundary.question import BoundaryAnswer
    from friso.shown.drawing.figure import Figure


def blocks(boundaries: BoundaryAnswer) -> list[AnswerBlock]:
    """Return the blocks: where hunting ends, and every point, branch or curve."""
    traced, keys = boundaries.result, boundaries.keys
    return [
        AnswerBlock(
            title=boundaries.stage.name,
            sentences=answer(traced, keys),
            draw=lambda: [_figure(boundaries)],
            numbers=lambda: boundary_document(traced, keys),
        ),
        AnswerBlock(title="Points and curves", details=details(traced, keys)),
    ]


def _figure(boundaries: BoundaryAnswer) -> Figure:
    """Draw the branches of cycles, or the curves on which hunting ends with the place of the stage between them."""
    from friso.questions.boundary.figures import boundary_figure  # 0.9 s to import
    from friso.questions.map.places import SHOWN, with_places

    figure = boundary_figure(boundaries.result, boundaries.keys, boundaries.stage.name, boundaries.condition)
    if isinstance(boundaries.result, Plane):
        return with_places(figure, [(SHOWN, boundaries.stage)], [key.key for key in boundaries.keys])
    return figure


def write_table(traced: Diagram | Plane, path: Path) -> None:
    """Write a CSV table with one row per point of a branch or curve.

    Points of a curve, and flips, folds and other special points of a branch, also have a kind and an error.
    """
    import pandas as pd

    keys = [f"{swept.key} [{swept.unit}]" if swept.unit else swept.key for swept in traced.space.ranges]
    errors, cycles = [f"error of {key}" for key in keys], ["amplitude [m]", "period [s]", "multiplier"]
    if isinstance(traced, Diagram):
        rows = [
            (number, line.shape, *row)
            for number, line in enumerate(lines(traced))
            for row in zip(
                line.kinds, *line.at.T, *line.error.T, line.amplitude, line.period, line.multiplier, strict=True
            )
        ]
        table = pd.DataFrame(rows, columns=["line", "cycle", "kind", *keys, *errors, *cycles])
    else:
        rows = [
            (number, *row)
            for number, curve in enumerate(boundary.curves(traced))
            for row in zip(curve.kinds, *curve.at.T, *curve.error.T, strict=True)
        ]
        table = pd.DataFrame(rows, columns=["line", "kind", *keys, *errors])
    table.to_csv(path, index=False)


def boundary_document(traced: Diagram | Plane, keys: tuple[ShownKey, ...]) -> dict[str, Any]:
    """Return the JSON document of a boundary, in the units in which the ranges were given."""
    document = _of_diagram(traced, keys[0]) if isinstance(traced, Diagram) else _of_plane(traced, keys)
    return plain_json({"conclusion": conclusion(traced, keys), **document})


def _of_diagram(traced: Diagram, key: ShownKey) -> dict[str, Any]:
    """Return flips, folds and other special points, branches, and the verdicts at both ends."""
    branches = boundary.lines(traced)
    points = [_point(line, k, key) for line in branches for k in line.special]
    return {
        **entries(key, "key", "unit"),
        "points": sorted(points, key=lambda point: point["value"]),
        "ends": dict(zip(("low", "high"), boundary.end_verdicts(traced), strict=True)),
        "branches": [_branch(line, key) for line in branches],
    }


def _point(line: Line, k: int, key: ShownKey) -> dict[str, Any]:
    """Return a special point of a branch, such as a fold: its value, kind, error, and cycle."""
    return {
        "value": key.number(line.at[k, 0]),
        "kind": line.kinds[k],
        "error": key.number(line.error[k, 0]),
        "cycle": line.shape,
        "amplitude_m": float(line.amplitude[k]),
        "period_s": float(line.period[k]),
    }


def _branch(line: Line, key: ShownKey) -> dict[str, Any]:
    """Return a branch of cycles with amplitude, period and multiplier along the key."""
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


def _of_plane(traced: Plane, keys: tuple[ShownKey, ...]) -> dict[str, Any]:
    """Return the curves in the plane of two keys, how they end, and the corner verdicts."""
    x, y = keys
    verdicts = [verdict for _, _, verdict in boundary.corner_verdicts(traced)]
    return {
        "x": entries(x, "key", "unit"),
        "y": entries(y, "key", "unit"),
        "curves": [
            {
                "points": _numbers(curve.at, keys),
                "error": _numbers(curve.error, keys),
                "kinds": list(curve.kinds),
                "ends": list(curve.ends),
            }
            for curve in boundary.curves(traced)
        ],
        "corners": dict(zip(("low low", "low high", "high low", "high high"), verdicts, strict=True)),
    }


def _numbers(values: np.ndarray, keys: tuple[ShownKey, ...]) -> list[list[float]]:
    """Return values of both keys [SI], shape (n, 2), in the units shown."""
    return [[key.number(value) for key, value in zip(keys, row, strict=True)] for row in values.tolist()]
