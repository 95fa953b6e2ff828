"""Unstructured samples of several keys at once: Sobol points and Latin hypercubes, through `scipy.stats.qmc`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from friso.errors import InputError
from friso.stage import Stage
from friso.studies.axes import SweptAxis, SweptRange, Values, read_axes

SAMPLE = "sample"
"""Name of the dimension along which samples lie."""

METHODS = ("sobol", "latin")


@dataclass(frozen=True)
class Samples:
    """Samples of the ranges (name to "1 Hz..40 Hz", with ":log" behind it if the points shall be even in the
    logarithm): `count` points by a method of `METHODS`, the same for the same `seed`. Where `ranges` holds lists or
    arrays of equal length instead, these are the points."""

    ranges: Mapping[str, Values]
    count: int | None = None
    method: str = "sobol"
    seed: int = field(default=0)


def sample_axes(stage: Stage, samples: Samples, free: frozenset[str], log: bool = False) -> tuple[SweptAxis, ...]:
    """The sampled axes, all of one length. Raises InputError."""
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
    """Points of the unit cube, shape (count, dimensions)."""
    from scipy.stats import qmc

    if samples.count is None or samples.count < 2:
        raise InputError("samples", f"{samples.count} points", "2 points or more", "1024")
    if samples.method == "sobol":
        sampler = qmc.Sobol(dimensions, rng=samples.seed)
        points = sampler.random_base2(int(np.ceil(np.log2(samples.count))))
        return points[: samples.count]
    if samples.method == "latin":
        return qmc.LatinHypercube(dimensions, rng=samples.seed).random(samples.count)
    raise InputError("samples", samples.method, f"one of {', '.join(METHODS)}", "sobol")
