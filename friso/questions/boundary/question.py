"""Answer where hunting ends, over one key or in the plane of two."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from typing import TYPE_CHECKING

from friso.axis import AxisKind
from friso.equations.bandwidth import range_example
from friso.hunting import CYCLE_RTOL, KeyRange
from friso.interface import inputs
from friso.interface.answer import Answer, question
from friso.interface.inputs import AxisRange, Changes, StageLike, Tolerance
from friso.progress import Progress, silent
from friso.quantities import Quantity, any_sign
from friso.stage import Stage
from friso.stage.contacts import followed

if TYPE_CHECKING:
    from friso.questions.boundary.words import ShownKey
    from friso.shown.blocks import Files


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
        from friso.questions.boundary.blocks import write_table
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
