"""Define a study as data, and make it from a user's variations.

A study has its stage, variations, tolerance, cells, and blocks of cells. Its size is estimated, and a trial is run.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from friso.engine.allowance import checked_rtol
from friso.engine.cache import code_digest, machine
from friso.equations.motion import rests
from friso.errors import InputError
from friso.hunting import cannot_hunt
from friso.stage import Stage, loads
from friso.studies.axes import (
    SAMPLE,
    SCALINGS,
    AxisValues,
    Samples,
    SweptAxis,
    SweptRange,
    check_links,
    linked_names,
    read_axes,
    sample_axes,
)
from friso.studies.cells import flat_cells
from friso.studies.metric import every_variable, in_order, metrics, usual_metrics
from friso.version import VERSION

if TYPE_CHECKING:
    import xarray as xr

CellBlock = tuple[slice, ...]
"""A rectangle of cells, one slice per dimension."""


@dataclass(frozen=True)
class Dimension:
    """A dimension of a study: one axis, or several that vary together (samples)."""

    name: str
    axes: tuple[SweptAxis, ...]

    def __len__(self) -> int:
        return len(self.axes[0].values)


@dataclass(frozen=True)
class Study:
    """A study: a stage, its variations, and all else that determines the result.

    Cells are the combinations of the dimensions' values, in C order.
    """

    stage: Stage
    dimensions: tuple[Dimension, ...]
    links: Mapping[str, str]
    metrics: tuple[str, ...]
    rtol: float

    @property
    def shape(self) -> tuple[int, ...]:
        """Return the numbers of values along the dimensions."""
        return tuple(len(dimension) for dimension in self.dimensions)

    @property
    def cells(self) -> int:
        """Return the number of cells."""
        return math.prod(self.shape)

    @property
    def cycles(self) -> bool:
        """Tell whether any requested metric needs a survey of attractors."""
        every = metrics()
        return any(name in every and every[name].source == "survey" for name in self.metrics)

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of the dimensions."""
        return tuple(dimension.name for dimension in self.dimensions)

    @property
    def axes(self) -> tuple[SweptAxis, ...]:
        """Return the axes of all dimensions."""
        return tuple(axis for dimension in self.dimensions for axis in dimension.axes)

    def columns(self, cells: np.ndarray) -> dict[str, np.ndarray]:
        """Return the values of every axis at cells, by name, (cells,).

        `cells` are indices in C order.
        """
        places = np.unravel_index(cells, self.shape)
        return {
            axis.name: axis.values[place]
            for dimension, place in zip(self.dimensions, places, strict=True)
            for axis in dimension.axes
        }

    def block_columns(self, block: CellBlock) -> dict[str, np.ndarray]:
        """Return the values of every axis at the cells of a block, by name, in C order."""
        picked = [np.arange(len(dimension))[part] for dimension, part in zip(self.dimensions, block, strict=True)]
        places = [place.ravel() for place in np.meshgrid(*picked, indexing="ij")]
        return {
            axis.name: axis.values[place]
            for dimension, place in zip(self.dimensions, places, strict=True)
            for axis in dimension.axes
        }

    def block_shape(self, target: int) -> tuple[int, ...]:
        """Return the shape of blocks of about `target` cells.

        Blocks span the last dimensions whole. The dimension before these is divided into nearly equal parts, and along
        all earlier ones a block has one value.
        """
        shape = [1] * len(self.shape)
        for i in reversed(range(len(shape))):
            room = max(1, target // math.prod(shape))
            shape[i] = math.ceil(self.shape[i] / math.ceil(self.shape[i] / room))
            if shape[i] < self.shape[i]:
                break
        return tuple(shape)

    def blocks(self, shape: Sequence[int]) -> Iterator[CellBlock]:
        """Yield all blocks of a shape (numbers of cells); those at the ends are cut to fit."""
        starts = (range(0, size, step) for size, step in zip(self.shape, shape, strict=True))
        for corner in product(*starts):
            yield tuple(slice(k, min(k + step, size)) for k, step, size in zip(corner, shape, self.shape, strict=True))

    def cell_stage(self, index: Sequence[int]) -> Stage:
        """Return the stage of one cell, whose run alone gives the numbers of the study.

        `index` has the cell's index along each dimension. Raises InputError for an invalid cell.
        """
        columns = self.columns(np.array([np.ravel_multi_index(tuple(index), self.shape)]))
        numeric = {axis.name: axis for axis in self.axes if axis.numeric}
        words = {name: column[0].item() for name, column in columns.items() if name not in numeric}
        stage = self.stage.replace(words)
        flat = flat_cells(stage, self.links, {name: columns[name] for name in numeric})
        changed = {key for key in (*numeric, *self.links) if key in flat}
        if scalings := (SCALINGS.keys() & numeric.keys()) - linked_names(self.links):
            before = flat_cells(stage, self.links, {name: columns[name] for name in numeric.keys() - scalings})
            changed |= {key for key in flat if np.any(flat[key] != before[key])}
        return stage.with_numbers({key: float(np.ravel(flat[key])[0]) for key in sorted(changed)})

    def at(self, cells: np.ndarray) -> Study:
        """Return a study of only some cells, as samples; `cells` are their indices in C order."""
        columns = self.columns(cells)
        axes = tuple(
            SweptAxis(axis.name, columns[axis.name], axis.unit, axis.scale, axis.numeric) for axis in self.axes
        )
        return replace(self, dimensions=(Dimension(SAMPLE, axes),))

    def coordinates(self) -> dict[str, Any]:
        """Return the axes as coordinates for xarray, by name: SI values with units and scale."""
        coordinates: dict[str, Any] = {}
        for dimension in self.dimensions:
            if dimension.name == SAMPLE:
                coordinates[SAMPLE] = (SAMPLE, np.arange(len(dimension)))
            for axis in dimension.axes:
                coordinates[axis.name] = (dimension.name, axis.values, {"units": axis.unit, "scale": axis.scale})
        return coordinates

    def attributes(self) -> dict[str, Any]:
        """Return the attributes stored with results, from which any cell can be run again alone."""
        return {
            "name": self.stage.name,
            "stage": self.stage.to_toml(),
            "friso": VERSION,
            "equations": equations_version(),
            "machine": machine(),
            "rtol": self.rtol,
            "axes": json.dumps([axis.name for axis in self.axes]),
            "links": json.dumps(dict(self.links)),
        }

    def _named(self) -> str:
        """Return the names of the axes, grouped by dimension."""
        return ", ".join(" with ".join(axis.name for axis in dimension.axes) for dimension in self.dimensions)

    def differences(self, other: Study, its_equations: str) -> list[str]:
        """Describe in words how a stored study, `other`, differs from this one.

        `its_equations` is the version of friso's equations that made the stored study.
        """
        differences = _stage_differences(self.stage, other.stage)
        if its_equations != equations_version():
            differences.append(f"version of the equations: {its_equations} there, {equations_version()} here")
        if self._named() != other._named():
            differences.append(f"axes: {other._named()} there, {self._named()} here")
        else:
            differences += [
                f"axis {mine.name}: {_described(its)} there, {_described(mine)} here"
                for mine, its in zip(self.axes, other.axes, strict=True)
                if _described(mine) != _described(its)
            ]
        if list(self.links.items()) != list(other.links.items()):  # the order counts: a link sees the links before it
            differences.append(f"links: {_links(other)} there, {_links(self)} here")
        if lacking := [name for name in self.metrics if name not in other.metrics]:
            differences.append(f"measures: none of {', '.join(lacking)} there")
        if more := [name for name in other.metrics if name not in self.metrics]:
            differences.append(f"measures: {', '.join(more)} only there")
        if self.rtol != other.rtol:
            differences.append(f"rtol: {other.rtol:g} there, {self.rtol:g} here")
        return differences


def cells_of(block: CellBlock) -> int:
    """Return the number of cells of a block."""
    return math.prod(part.stop - part.start for part in block)


_STUDIES = ("axes", "cells", "metric", "metrics", "settings", "study")
_DECISIVE = (
    *("quantities.py", "stage", "equations", "engine", "hunting"),
    *(f"studies/{name}.py" for name in _STUDIES),
)
"""Parts of the package that determine the numbers of a cell."""


def equations_version() -> str:
    """Return a digest of friso's code that determines the numbers of a cell."""
    return f"{VERSION} ({code_digest(*_DECISIVE)[:12]})"


def study_of(runs: xr.Dataset) -> Study:
    """Return the study whose results are in a dataset or an opened store."""
    dimensions, order = [], json.loads(runs.attrs["axes"])
    for name in runs["outcome"].dims:
        axes = tuple(_stored_axis(runs[axis]) for axis in order if runs[axis].dims == (name,))
        dimensions.append(Dimension(str(name), axes))
    stage = loads(runs.attrs["stage"])
    names = tuple(name for name in every_variable() if name in runs)
    links, rtol = dict(json.loads(runs.attrs["links"])), checked_rtol(float(runs.attrs["rtol"]))
    return Study(stage, tuple(dimensions), links, names, rtol)


def _stored_axis(coordinate: xr.DataArray) -> SweptAxis:
    values = coordinate.values
    attributes = coordinate.attrs
    return SweptAxis(
        str(coordinate.name), values, attributes["units"], attributes["scale"], values.dtype.kind not in "bU"
    )


def _described(axis: SweptAxis) -> str:
    """Describe an axis in short; equal texts mean equal values."""
    digest = hashlib.sha256(np.ascontiguousarray(axis.values).tobytes()).hexdigest()[:8]
    first, last = axis.values[0], axis.values[-1]
    ends = f"{first:g}..{last:g} {axis.unit}" if axis.numeric else f"{first}..{last}"
    return f"{ends} in {len(axis.values)} ({digest})"


def _links(study: Study) -> str:
    """Return the links of a study as text, as the user wrote them."""
    return ", ".join(f"{key}={expression}" for key, expression in study.links.items()) or "none"


def _stage_differences(mine: Stage, its: Stage) -> list[str]:
    a, b = mine.flat(), its.flat()
    keys = sorted(key for key in a.keys() | b.keys() if a.get(key) != b.get(key))
    return [f"{key}: {b.get(key, 'absent')} there, {a.get(key, 'absent')} here" for key in keys]


TRIAL_CELLS = 512
"""Cells of a trial run."""


@dataclass(frozen=True)
class Request:
    """A stage, its varied keys, and links, as the user's texts and arrays (see `friso.sweep`)."""

    stage: Stage
    axes: Mapping[str, AxisValues]
    samples: Samples | None = None
    links: Mapping[str, str] = field(default_factory=dict)

    def _read(self, axes: Mapping[str, AxisValues]) -> tuple[SweptAxis | SweptRange, ...]:
        return read_axes(self.stage, axes, linked_names(self.links))

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
                axes.append(SweptAxis(axis.name, axis.at(rng.random(TRIAL_CELLS)), axis.unit, axis.scale))
            else:
                axes.append(replace(axis, values=rng.choice(axis.values, TRIAL_CELLS)))
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
            free = linked_names(self.links)
            dimensions.append(Dimension(SAMPLE, sample_axes(self.stage, self.samples, free)))
        names = [axis.name for dimension in dimensions for axis in dimension.axes]
        for name in names:
            if names.count(name) > 1 or name in (*every_variable(), SAMPLE):
                raise InputError(name, "a name that is taken", "each axis once, each under a different name")
        check_links(self.stage, self.links, frozenset(names))
        study = Study(self.stage, tuple(dimensions), dict(self.links), _checked_metrics(metrics), rtol)
        _check_verdicts(study)
        return study


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


MOST_MOTIONS = 100_000
"""Most cells whose motions are looked at before a study begins. More take seconds; larger maps over a motion have
their extremes among fewer."""


def _check_verdicts(study: Study) -> None:
    """Refuse verdicts on stages whose reference keeps moving, since there are none.

    Raises InputError if the study has a metric that rests on a stage's attractors, and the reference keeps moving in
    the stage file or, where axes or links vary the motion, in some cell. A stage that cannot hunt has a verdict.
    """
    flat, every = study.stage.flat(), metrics()
    if not any(every[name].source != "run" for name in study.metrics if name in every):
        return
    cells, varied = [flat], (*(axis.name for axis in study.axes), *study.links)
    if cannot_hunt(study.stage) and not any(name.startswith("controller.") for name in varied):
        return
    if any(name.startswith("motion.") for name in varied):
        numeric = {axis.name for axis in study.axes if axis.numeric}
        columns = study.columns(np.arange(min(study.cells, MOST_MOTIONS)))
        cells.append(flat_cells(study.stage, study.links, {name: columns[name] for name in numeric}))
    if not all(map(rests, cells)):
        actual = f'verdicts, with motion.kind = "{flat["motion.kind"]}", whose reference keeps moving'
        expected = "what the runs do, as there is a verdict on hunting only where the reference comes to stand"
        raise InputError("metric", actual, expected, "metric=outcome")


def _checked_metrics(names: Sequence[str] | None) -> tuple[str, ...]:
    """Return a study's requested variables, by default the usual ones, in their usual order.

    Raises InputError for an unknown name.
    """
    for name in names or ():
        if name not in every_variable():
            raise InputError("metrics", name, f"some of {', '.join(every_variable())}", '["peaks", "period"]')
    return in_order(names or usual_metrics())
