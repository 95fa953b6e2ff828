"""Draw samples of several keys at once as Sobol points or Latin hypercubes.

They come from `scipy.stats.qmc`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from numbers import Integral

import numpy as np

from friso.errors import InputError
from friso.quantities import quoted
from friso.stage import Stage
from friso.studies.axes import AxisValues, SweptAxis, SweptRange, read_axes
from friso.studies.settings import settings

SAMPLE = "sample"
"""Name of the dimension along which samples lie."""

METHODS = ("sobol", "latin")


@dataclass(frozen=True)
class Samples:
    """Samples of ranges: `count` points by a method of `METHODS`, the same for the same `seed`.

    `ranges` are name to "1 Hz..40 Hz", with ":log" behind it if the points shall be even in the logarithm. Lists or
    arrays of equal length are the points themselves.

    Examples
    --------
    >>> import friso
    >>> points = friso.Samples({"joint.stroke": "0.2 mm..1 mm", "controller.crossover": "4 Hz..12 Hz"}, count=8)
    >>> friso.sweep(friso.example("thesis_rig"), samples=points).sizes["sample"]
    8
    """

    ranges: Mapping[str, AxisValues]
    count: int | None = None
    method: str = "sobol"
    seed: int = field(default=0)

    def __post_init__(self) -> None:
        """Check the fields. Raises InputError for other types."""
        if not isinstance(self.ranges, Mapping):
            raise InputError(
                "ranges", quoted(self.ranges), "a dictionary of keys to ranges", 'ranges={"joint.stroke": "0 m..1 mm"}'
            )
        for name, number, least in (("samples", self.count, 2), ("seed", self.seed, 0)):
            whole = (
                isinstance(number, Integral)
                and not isinstance(number, bool)
                and least <= number <= settings.most_axis_points
            )
            if not (whole or (number is None and name == "samples")):
                expected = f"a whole number from {least} to {settings.most_axis_points:,}"
                raise InputError(name, quoted(number), expected, f"{name}=1024")
        if self.method not in METHODS:
            raise InputError("method", quoted(self.method), f"one of {', '.join(METHODS)}", 'method="sobol"')


def sample_axes(stage: Stage, samples: Samples, free: frozenset[str], log: bool = False) -> tuple[SweptAxis, ...]:
    """Return the axes of samples, all of one length, from ranges or from lists.

    `free` are names that links use, and `log` makes ranges logarithmic. Raises InputError for ranges with a number of
    points, for lists of unequal length, and for ranges together with lists.
    """
    read = read_axes(stage, samples.ranges, free, log)
    ranges = [axis for axis in read if isinstance(axis, SweptRange)]
    if not ranges:
        return _values(read)
    if len(ranges) < len(read):
        raise InputError("samples", "ranges together with lists", "one or the other", '{"joint.stroke": "0 m..1 mm"}')
    for axis in ranges:
        if axis.count is not None:
            raise InputError(axis.name, f"a range with {axis.count} points", "for samples, FIRST..LAST alone")
    points = _points(len(ranges), samples)
    return tuple(SweptAxis(axis.name, axis.at(points[:, i]), axis.unit, axis.scale) for i, axis in enumerate(ranges))


def _values(read: tuple[SweptAxis | SweptRange, ...]) -> tuple[SweptAxis, ...]:
    axes = tuple(axis for axis in read if isinstance(axis, SweptAxis))
    if len({len(axis.values) for axis in axes}) != 1:
        lengths = ", ".join(f"{axis.name} {len(axis.values)}" for axis in axes) or "none"
        raise InputError("samples", f"lengths: {lengths}", "keys with equally many values each")
    return axes


def _points(dimensions: int, samples: Samples) -> np.ndarray:
    """Return points in the unit cube, shape (count, dimensions).

    Raises InputError if the samples have no count.
    """
    from scipy.stats import qmc

    if samples.count is None:
        raise InputError("samples", "no number of points", "2 points or more", "samples=1024")
    if samples.method == "sobol":
        sampler = qmc.Sobol(dimensions, rng=samples.seed)
        points = sampler.random_base2(int(np.ceil(np.log2(samples.count))))
        return points[: samples.count]
    return qmc.LatinHypercube(dimensions, rng=samples.seed).random(samples.count)
