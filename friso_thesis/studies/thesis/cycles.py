"""Find the attractors in the thesis's maps, and compare them with the peak count.

The module also follows the curves on which cycles stop attracting.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from friso.hunting import KeyRange, Space, plane
from friso.studies.cells import by_words, cell_attractors, flat_cells
from friso.studies.study import study_of
from friso_thesis.studies.thesis.claims import by_attraction, by_peak_count
from friso_thesis.studies.thesis.kept import NOT_KEPT, Kept
from friso_thesis.studies.thesis.studies import ThesisStudy

if TYPE_CHECKING:
    import xarray as xr

SURVEYED_VALUES = 14
"""Approximate number of values per axis at which stages are surveyed. Each survey takes a hundred runs."""

CURVE_NODES = 9
"""Number of stages along either axis from which curves are searched for."""

SMALLEST_SHARE = 1e-3
"""Start of curves on a linear range that begins at zero, as a fraction of the range. There may be no stage at zero."""


@dataclass(frozen=True)
class Edge:
    """A curve in a map of two keys on which hunting ends: its points [SI] along both axes, shape (points,) each."""

    x: np.ndarray
    y: np.ndarray


@dataclass(frozen=True)
class PeaksAgainstCycles:
    """Agreement of the peak count with the survey, in numbers of cells.

    - `both`: peaks are counted, and something attracts.
    - `neither`: no peaks, and nothing attracts.
    - `counted_only`: peaks, although nothing attracts.
    - `attracted_only`: no peaks, although something attracts; another move would start it.
    - `unknown`: the answer is uncertain.
    """

    cells: int
    both: int
    neither: int
    counted_only: int
    attracted_only: int
    unknown: int


@dataclass(frozen=True)
class CyclesOnMap:
    """Curves over a map of the thesis, and the comparison of attractors with its peak counts."""

    edges: tuple[Edge, ...]
    comparison: PeaksAgainstCycles


@dataclass(frozen=True)
class Surveyed:
    """Evenly spread cells of a map, and whether anything attracts the stage of each.

    `attracts` says so, and `decided` whether that is certain, in the shape of the `runs`.
    """

    runs: xr.Dataset
    attracts: np.ndarray
    decided: np.ndarray

    def attracted(self, edges: Sequence[Edge]) -> xr.Dataset:
        """Return the runs judged by what attracts, with distances of cells from the `edges`."""
        return by_attraction(by_peak_count(self.runs), self.attracts, self.decided, cells_apart(self.runs, edges))


def cells_apart(runs: xr.Dataset, edges: Sequence[Edge]) -> np.ndarray:
    """Return the distances of a map's cells from the nearest of some curves, in cells.

    The result has the shape of the runs, and is infinite without a curve.
    """
    axes = [runs[name].values for name in runs.dims]
    rows, columns = np.meshgrid(*(np.arange(len(axis), dtype=float) for axis in axes), indexing="ij")
    nearest = np.full(rows.shape, np.inf)
    for edge in edges:
        line = [
            np.interp(values, axis, np.arange(len(axis))) for values, axis in zip((edge.x, edge.y), axes, strict=True)
        ]
        points = np.stack(line, axis=1)
        for first, last in pairwise(points):
            along, away = last - first, np.stack([rows - first[0], columns - first[1]], axis=-1)
            share = np.clip(away @ along / max(float(along @ along), np.finfo(float).tiny), 0.0, 1.0)
            nearest = np.minimum(nearest, np.hypot(*np.moveaxis(away - share[..., None] * along, -1, 0)))
    return nearest


def map_cycles(study: ThesisStudy, runs: xr.Dataset, surveyed: Surveyed, kept: Kept = NOT_KEPT) -> CyclesOnMap:
    """Follow the curves on a study's map where cycles stop attracting.

    The survey of what attracts is also compared with the peaks counted in the runs.
    """
    ends = [(name, float(runs[name].values[0]), float(runs[name].values[-1])) for name in runs.dims]
    about = ("curves on which hunting ends", runs.attrs["stage"], runs.attrs["links"], ends)
    arrays = kept.flags(about, lambda: _as_arrays(_edges(study, runs)))
    return CyclesOnMap(_from_arrays(arrays), _comparison(surveyed))


def _as_arrays(edges: tuple[Edge, ...]) -> dict[str, np.ndarray]:
    """Return curves as arrays, each named by the number of the curve and its field."""
    return {f"{n}.{key}": np.asarray(value) for n, edge in enumerate(edges) for key, value in vars(edge).items()}


def _from_arrays(arrays: Mapping[str, np.ndarray]) -> tuple[Edge, ...]:
    whole = ({key: arrays[f"{n}.{key}"] for key in ("x", "y")} for n in range(len(arrays) // 2))
    return tuple(Edge(**edge) for edge in whole)


def survey(runs: xr.Dataset, kept: Kept = NOT_KEPT) -> Surveyed:
    """Survey evenly spread cells of a map for anything that attracts their stages.

    Results in `kept` are not computed again.
    """
    coarse = runs.isel({name: slice(None, None, every(size)) for name, size in runs.sizes.items()})
    axes = [(name, coarse[name].values.tolist()) for name in coarse.dims]
    flags = kept.flags(("survey", coarse.attrs["stage"], coarse.attrs["links"], axes), lambda: _survey(coarse))
    shape = coarse["outcome"].shape
    return Surveyed(coarse, flags["attracts"].reshape(shape), flags["decided"].reshape(shape))


def every(values: int) -> int:
    """Return the step between surveyed values on a map axis that has `values` values."""
    return max(1, round((values - 1) / (SURVEYED_VALUES - 1)))


def _survey(coarse: xr.Dataset) -> dict[str, np.ndarray]:
    study = study_of(coarse)
    valid = (coarse["outcome"].values != "invalid").ravel()
    attracts, decided = np.zeros(study.cells, bool), np.zeros(study.cells, bool)
    parts = by_words(study.stage, study.links, study.columns(np.arange(study.cells)))
    for _, cells, attracted in cell_attractors(parts, valid):
        attracts[cells], decided[cells] = attracted.attracts, attracted.certain
    return {"attracts": attracts, "decided": decided & valid}


def _comparison(surveyed: Surveyed) -> PeaksAgainstCycles:
    runs, attracts, decided = by_peak_count(surveyed.runs), surveyed.attracts, surveyed.decided
    valid = runs["outcome"].values != "invalid"
    peaks = runs["keeps_moving"].values
    return PeaksAgainstCycles(
        cells=int(valid.sum()),
        both=int((decided & attracts & peaks).sum()),
        neither=int((decided & ~attracts & ~peaks).sum()),
        counted_only=int((decided & ~attracts & peaks).sum()),
        attracted_only=int((decided & attracts & ~peaks).sum()),
        unknown=int((valid & ~decided).sum()),
    )


def _edges(study: ThesisStudy, runs: xr.Dataset) -> tuple[Edge, ...]:
    """Return the curves over a map on which hunting ends.

    There are none if the axes belong to the motion, which does not affect them.
    """
    if study.of_motion:
        return ()
    source = study_of(runs)
    ranges = tuple(_range(runs[span.key].values, span.key, span.log) for span in study.spans)
    space = Space(ranges, lambda values: flat_cells(source.stage, source.links, values))
    lines = (space.values(curve.points) for curve in plane(space, nodes=CURVE_NODES).curves)
    x, y = (swept.key for swept in ranges)
    return tuple(Edge(line[x], line[y]) for line in lines)


def _range(values: np.ndarray, key: str, log: bool) -> KeyRange:
    low, high = float(values[0]), float(values[-1])
    return KeyRange(key, low if low > 0 else SMALLEST_SHARE * high, high, log)
