"""Answer where hunting ends, over one key or in the plane of two.

Give the blocks of `friso boundary`, and the table of points that it writes.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from friso.axis import AxisKind
from friso.equations.bandwidth import range_example
from friso.hunting import CYCLE_RTOL, Diagram, KeyRange, Plane
from friso.interface import inputs
from friso.interface.answer import Answer, question
from friso.interface.inputs import AxisRange, Changes, StageLike, Tolerance
from friso.progress import Progress, silent
from friso.quantities import Quantity, any_sign
from friso.questions.boundary.words import ShownKey, answer, conclusion, details
from friso.shown.blocks import AnswerBlock, Files
from friso.shown.documents import entries, plain_json
from friso.stage import Stage
from friso.stage.contacts import followed
from friso.studies import boundary as study
from friso.studies.boundary import Line, lines

if TYPE_CHECKING:
    from friso.shown.drawing.figure import Figure


class BoundaryAnswer(Answer):
    """The values at which hunting ends, over one key or two.

    `result` is a `Diagram` over one key or a `Plane` of two. `texts` holds the ranges
    as the user gave them.
    """

    stage: Stage
    texts: Sequence[str]
    name: str

    @property
    def condition(self) -> str:
        """Say on which unknown values the answer rests, and that it leaves out a drive that makes the loop unstable."""
        from friso.shown.text import without_drive

        return super().condition + without_drive(self.stage)

    @property
    def varied(self) -> Sequence[str]:
        """Return the keys over which cycles are followed."""
        return [swept.key for swept in self.result.space.ranges]

    @cached_property
    def keys(self) -> tuple[ShownKey, ...]:
        """Return the keys in the units in which their ranges were given."""
        ranges = zip(self.result.space.ranges, self.texts, strict=True)
        varied = frozenset((*self.varied, *followed(self.stage, dict.fromkeys(self.varied, 1.0))))
        return tuple(replace(_in_its_unit(swept, text, self.axis_kind), varied=varied) for swept, text in ranges)

    @property
    def subject(self) -> BoundaryAnswer:
        """Return the answer itself, which has the keys."""
        return self

    def files(self) -> Files:
        """Return the page, the figure, and the table of points, named after the stage's file."""

        from friso.shown.blocks import image_files

        stem, (figure,) = f"{self.name}_boundary", self.figures()
        images = image_files(figure, stem)
        return {f"{stem}.html": self.page().html(), **images, f"{stem}.csv": partial(write_table, self.result)}


@question
def boundary(
    stage: StageLike,
    axes: Mapping[str, str] | None = None,
    *,
    x: AxisRange | None = None,
    y: AxisRange | None = None,
    rtol: Tolerance = CYCLE_RTOL,
    set: Changes = None,
    progress: Progress = silent,
) -> BoundaryAnswer:
    """Where hunting ends: the values at which the hunting cycle stops attracting, over one key or two.

    Parameters
    ----------
    axes : dict, optional
        One key or two with their ranges, ``{"joint.stroke": "0.1 mm..2 mm"}``; behind ":log", logarithmic.
    x : str, optional
        The key over which cycles are followed, controller.crossover="1 Hz..40 Hz"; required.
    y : str, optional
        A second key: curves in the plane of both.
    rtol : float
        Relative tolerance of the solver, at most 1e-6.

    Returns
    -------
    BoundaryAnswer
        All branches of cycles over one key, or the curves in the plane of two on which hunting ends.

    Raises
    ------
    InputError
        For a range or a stage that is not usable, such as one that cannot hunt.

    Examples
    --------
    >>> import friso
    >>> friso.boundary(friso.example("thesis_rig"), x="controller.crossover=1 Hz..40 Hz")  # doctest: +SKIP
    """
    chosen, tolerance = inputs.read_stage(stage, set), inputs.tolerance_of(rtol)
    example = range_example(chosen.flat())
    ranges = inputs.axes_of(axes or {}, {"x": x, "y": y}, example)
    if not ranges or (y and not (x or axes)):
        raise inputs.wrong("x", "no key", "one key or two with their ranges", example)
    from friso.studies.boundary import boundary as traced_boundary

    def begins() -> None:
        """Report what is computed, and whether the loop is unstable, before the work starts."""
        inputs.mention_unstable_loop(chosen)
        progress(0, 0, f"following cycles over {' and '.join(ranges)}")

    traced = traced_boundary(chosen, ranges, tolerance, begins, progress)
    return BoundaryAnswer(traced, stage=chosen, texts=[*ranges.values()], name=inputs.stem_of(stage))


def _in_its_unit(swept: KeyRange, text: str, axis: AxisKind) -> ShownKey:
    """Return a key with the unit in which its range was given.

    `text` is the range as the user wrote it. The unit of its upper end counts; without one, values are in SI.
    """
    from friso.questions.boundary.words import ShownKey

    match = re.search(r"\.\.\s*[-+.\deE]*\s*([^:]*)", text)
    unit = match[1].strip() if match else ""
    field = Quantity(swept.unit, any_sign, "").on(axis)
    return ShownKey(swept.key, unit, field.factor(unit)) if unit else ShownKey(swept.key)


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
    from friso.questions.map.cells import SHOWN, with_places

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
            for number, curve in enumerate(study.curves(traced))
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
    branches = study.lines(traced)
    points = [_point(line, k, key) for line in branches for k in line.special]
    return {
        **entries(key, "key", "unit"),
        "points": sorted(points, key=lambda point: point["value"]),
        "ends": dict(zip(("low", "high"), study.end_verdicts(traced), strict=True)),
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
    verdicts = [verdict for _, _, verdict in study.corner_verdicts(traced)]
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
            for curve in study.curves(traced)
        ],
        "corners": dict(zip(("low low", "low high", "high low", "high high"), verdicts, strict=True)),
    }


def _numbers(values: np.ndarray, keys: tuple[ShownKey, ...]) -> list[list[float]]:
    """Return values of both keys [SI], shape (n, 2), in the units shown."""
    return [[key.number(value) for key, value in zip(keys, row, strict=True)] for row in values.tolist()]
