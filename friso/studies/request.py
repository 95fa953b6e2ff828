"""Make a study from a user's variations, estimate its size, and run a trial."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from friso.engine.tolerance import checked_rtol
from friso.errors import InputError
from friso.stage import Stage
from friso.studies import links as linking
from friso.studies.axes import AxisValues, SweptAxis, SweptRange, read_axes
from friso.studies.metric import every_variable, in_order, usual_metrics
from friso.studies.samples import SAMPLE, Samples, sample_axes
from friso.studies.study import Dimension, Study

TRIED = 512
"""Cells of a trial run."""


@dataclass(frozen=True)
class Request:
    """A stage, its varied keys, and links, as the user's texts and arrays (see `friso.sweep`).

    With `log`, ranges that do not state their spacing are logarithmic.
    """

    stage: Stage
    axes: Mapping[str, AxisValues]
    samples: Samples | None = None
    links: Mapping[str, str] = field(default_factory=dict)
    log: bool = False

    def _read(self, axes: Mapping[str, AxisValues]) -> tuple[SweptAxis | SweptRange, ...]:
        return read_axes(self.stage, axes, linking.names(self.links), self.log)

    def size(self) -> int:
        """Return the number of cells of the study, without making any array.

        Raises InputError for an axis that the study could not have.
        """
        samples = 1 if self.samples is None or self.samples.count is None else self.samples.count
        return math.prod(_points(axis) for axis in self._read(self.axes)) * samples

    def trial(self) -> Study:
        """Return a study of a few cells drawn at random from one that may be too large to be made.

        The same request always gives the same cells. Raises InputError for an axis that the stage cannot have.
        """
        rng = np.random.default_rng(0)
        axes = []
        for axis in self._read({**self.axes, **(self.samples.ranges if self.samples else {})}):
            if isinstance(axis, SweptRange):
                axes.append(SweptAxis(axis.name, axis.at(rng.random(TRIED)), axis.unit, axis.scale))
            else:
                axes.append(replace(axis, values=rng.choice(axis.values, TRIED)))
        return Study(self.stage, (Dimension(SAMPLE, tuple(axes)),), dict(self.links), usual_metrics(), 1e-6)

    def study(self, metrics: Sequence[str] | None = None, rtol: float = 1e-6) -> Study:
        """Return the study of these axes with some metrics, by default the usual ones.

        Raises InputError for wrong axes, links, metrics or tolerance.
        """
        checked_rtol(rtol)
        read = self._read(self.axes)
        if not read and self.samples is None:
            example = '{"joint.stroke": ["0.1 mm", "1 mm"]}'
            raise InputError("axes", "none", "at least one key with its values", example)
        dimensions = [Dimension(axis.name, (_gridded(axis),)) for axis in read]
        if self.samples is not None:
            free = linking.names(self.links)
            dimensions.append(Dimension(SAMPLE, sample_axes(self.stage, self.samples, free, self.log)))
        names = [axis.name for dimension in dimensions for axis in dimension.axes]
        for name in names:
            if names.count(name) > 1 or name in (*every_variable(), SAMPLE):
                raise InputError(name, "a name that is taken", "each axis once, each under a different name")
        linking.check_links(self.stage, self.links, frozenset(names))
        return Study(self.stage, tuple(dimensions), dict(self.links), _checked_metrics(metrics), rtol)


def _points(axis: SweptAxis | SweptRange) -> int:
    if isinstance(axis, SweptAxis):
        return len(axis.values)
    if axis.count is None:
        text = f"{axis.first:g}..{axis.last:g} {axis.unit}, without a number of points"
        raise InputError(axis.name, text, "FIRST..LAST:POINTS", '"1 Hz..40 Hz:41"')
    return axis.count


def _gridded(axis: SweptAxis | SweptRange) -> SweptAxis:
    if isinstance(axis, SweptAxis):
        if len(np.unique(axis.values)) < len(axis.values):
            raise InputError(axis.name, "values that occur twice", "every value once", '["4 Hz", "8 Hz"]')
        return axis
    _points(axis)
    return axis.axis()


def _checked_metrics(names: Sequence[str] | None) -> tuple[str, ...]:
    """Return a study's requested variables, by default the usual ones, in their usual order.

    Raises InputError for an unknown name.
    """
    for name in names or ():
        if name not in every_variable():
            raise InputError("metrics", name, f"some of {', '.join(every_variable())}", '["peaks", "period"]')
    return in_order(names or usual_metrics())
