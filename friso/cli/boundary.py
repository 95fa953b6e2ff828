"""`friso boundary`: where hunting ends, over one key or in the plane of two."""

from __future__ import annotations

import json
import re
from itertools import repeat
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from friso.cli.common import (
    AsJson,
    OutFolder,
    Overrides,
    StageFile,
    Tolerance,
    finite,
    key_values,
    made_folder,
    read_stage,
    read_tolerance,
)
from friso.cli.progress import busy
from friso.quantities import Quantity, any_sign

if TYPE_CHECKING:
    import numpy as np

    from friso.hunting.boundary import Diagram, Plane, Range
    from friso.views.boundary.data import Line
    from friso.views.boundary.words import Shown

RANGE = 'KEY="FIRST..LAST"'


def boundary(
    stage_file: StageFile,
    x: Annotated[str, typer.Option(metavar=RANGE, help="The key over which cycles are followed.")],
    y: Annotated[str | None, typer.Option(metavar=RANGE, help="A second key: curves in the plane of both.")] = None,
    link: Annotated[
        list[str] | None, typer.Option(metavar="KEY=EXPRESSION", help='A key tied to others: masses.cart="0.7 * mass".')
    ] = None,
    log: Annotated[
        bool, typer.Option("--log", help="Make both ranges logarithmic; for a single one, append :log.")
    ] = False,
    overrides: Overrides = None,
    rtol: Tolerance = "1e-9",
    out: OutFolder = None,
    as_json: AsJson = False,
) -> None:
    """Where hunting ends: the values at which the hunting cycle stops attracting, over one key or two.

    Example: friso boundary rig.toml --set joint.locked=true --x controller.crossover="1 Hz..40 Hz" --out edge
    """
    stage, tolerance = read_stage(stage_file, overrides), read_tolerance(rtol)
    axes = key_values([("--x", x)] + ([("--y", y)] if y else []), '--x controller.crossover="1 Hz..40 Hz"')
    links = key_values([("--link", text) for text in link or []], '--link masses.cart="0.7 * mass"')
    folder = None if out is None else made_folder(out)
    from friso.studies.boundary import boundary as boundary_of

    with busy(f"following cycles over {' and '.join(axes)}"):
        found = boundary_of(stage, axes, links, tolerance, log)
    shown = tuple(_shown(one, text) for one, text in zip(found.space.ranges, axes.values(), strict=True))
    files = [] if folder is None else _write(found, shown, stage.name, folder / f"{stage_file.stem}_boundary")
    if as_json:
        print(json.dumps(_document(found, shown), allow_nan=False))
    else:
        from friso.views.boundary.words import sentences

        print("\n".join([*sentences(found, shown), *(f"wrote {file}" for file in files)]))


def _shown(one: Range, text: str) -> Shown:
    """A key in the unit in which its range was given, that of the last value."""
    from friso.views.boundary.words import Shown

    match = re.search(r"\.\.\s*[-+.\deE]*\s*([^:]*)", text)
    unit = match[1].strip() if match else ""
    return Shown(one.key, unit, Quantity(one.unit, any_sign, "").factor(unit)) if unit else Shown(one.key)


def _document(found: Diagram | Plane, shown: tuple[Shown, ...]) -> dict[str, Any]:
    """The JSON document of `boundary`; values of the keys in the units of the command line."""
    from friso.hunting.boundary import Diagram

    return _of_diagram(found, shown[0]) if isinstance(found, Diagram) else _of_plane(found, shown)


def _of_diagram(found: Diagram, key: Shown) -> dict[str, Any]:
    from friso.views.boundary.data import end_verdicts, lines

    branches = lines(found)
    points = [_point(line, k, key) for line in branches for k in line.special]
    return {
        "key": key.key,
        "unit": key.unit,
        "points": sorted(points, key=lambda point: point["value"]),
        "ends": dict(zip(("low", "high"), end_verdicts(found), strict=True)),
        "branches": [_branch(line, key) for line in branches],
    }


def _point(line: Line, k: int, key: Shown) -> dict[str, Any]:
    return {
        "value": key.number(line.at[k, 0]),
        "kind": line.kinds[k],
        "error": finite(key.number(line.error[k, 0])),
        "cycle": line.shape,
        "amplitude_m": float(line.amplitude[k]),
        "period_s": float(line.period[k]),
    }


def _branch(line: Line, key: Shown) -> dict[str, Any]:
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


def _of_plane(found: Plane, shown: tuple[Shown, ...]) -> dict[str, Any]:
    from friso.views.boundary.data import corner_verdicts, lines, lost_places

    x, y = shown
    verdicts = [verdict for _, _, verdict in corner_verdicts(found)]
    return {
        "x": {"key": x.key, "unit": x.unit},
        "y": {"key": y.key, "unit": y.unit},
        "curves": [_curve(line, shown) for line in lines(found)],
        "lost": _numbers(lost_places(found), shown),
        "corners": dict(zip(("low low", "low high", "high low", "high high"), verdicts, strict=True)),
    }


def _curve(line: Line, shown: tuple[Shown, ...]) -> dict[str, Any]:
    return {
        "kind": line.kinds[0],
        "cycle": line.shape,
        "points": _numbers(line.at, shown),
        "error": _numbers(line.error, shown),
        "amplitude_m": line.amplitude.tolist(),
        "period_s": line.period.tolist(),
        "ends": line.ends,
    }


def _numbers(values: np.ndarray, shown: tuple[Shown, ...]) -> list[list[float | None]]:
    """Values of both keys [SI], shape (n, 2), in the units shown."""
    return [[finite(key.number(value)) for key, value in zip(shown, row, strict=True)] for row in values.tolist()]


def _write(found: Diagram | Plane, shown: tuple[Shown, ...], name: str, stem: Path) -> list[Path]:
    """The figure in all formats, and the table of its points."""
    from friso.views.boundary.figures import boundary_figure
    from friso.views.drawing.matplotlib_renderer import FORMATS, save

    figure = boundary_figure(found, shown, name)
    pictures = [stem.with_name(f"{stem.name}.{form}") for form in FORMATS]
    for path in pictures:
        save(figure, path)
    table = stem.with_name(f"{stem.name}.csv")
    _write_table(found, table)
    return [*pictures, table]


def _write_table(found: Diagram | Plane, path: Path) -> None:
    """One row per point of a line: special ones have a kind and an error."""
    import pandas as pd

    from friso.views.boundary.data import lines

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
