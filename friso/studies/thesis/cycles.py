"""What attracts the stages of the thesis's maps: the curves on which cycles stop attracting, and the agreement of the
peak count with what attracts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from friso.hunting.boundary import KeyRange, Kind, Space, plane
from friso.studies.cells import by_words, cell_attractors, flat_cells
from friso.studies.study import study_of
from friso.studies.thesis.studies import ThesisStudy

if TYPE_CHECKING:
    import xarray as xr

EVERY = 2
"""The stage is surveyed at every so many values of each axis, to compare what attracts it with the peak count."""

NODES = 9
"""Stages along either axis from which curves are looked for."""

SMALLEST = 1e-3
"""Share of a linear range at which curves begin that would begin at zero, where there may be no stage."""


@dataclass(frozen=True)
class Edge:
    """A curve on which a cycle stops attracting: its kind, whether it is of the symmetric cycle, and its points [SI]
    along the two axes of the map, shape (points,) each."""

    kind: Kind
    symmetric: bool
    x: np.ndarray
    y: np.ndarray


@dataclass(frozen=True)
class PeaksAgainstCycles:
    """What the peak count and the survey say of the cells compared: peaks counted where something attracts (`both`)
    or `neither`, peaks counted although nothing attracts (`counted_only`), something that attracts although no peaks
    are counted (`attracted_only`: another move would start it), and cells of which it is not certain."""

    cells: int
    both: int
    neither: int
    counted_only: int
    attracted_only: int
    unknown: int


@dataclass(frozen=True)
class CyclesOnMap:
    """The curves over a map of the thesis, and the comparison with its peak counts."""

    edges: tuple[Edge, ...]
    comparison: PeaksAgainstCycles


def map_cycles(study: ThesisStudy, runs: xr.Dataset) -> CyclesOnMap:
    """The hunting cycles over a map of the thesis, from the study and its runs."""
    return CyclesOnMap(_edges(study, runs), _comparison(runs))


def _comparison(runs: xr.Dataset) -> PeaksAgainstCycles:
    coarse = runs.isel(dict.fromkeys(runs.dims, slice(None, None, EVERY)))
    study = study_of(coarse)
    valid = (coarse["outcome"].values != "invalid").ravel()
    attracts, decided = np.zeros(study.cells, bool), np.zeros(study.cells, bool)
    parts = by_words(study.stage, study.links, study.columns(np.arange(study.cells)))
    for _, cells, survey in cell_attractors(parts, valid):
        attracts[cells], decided[cells] = (False, True) if survey is None else (survey.attracts, survey.decided)
    peaks = coarse["keeps_moving"].values.ravel()
    decided &= valid
    return PeaksAgainstCycles(
        cells=int(valid.sum()),
        both=int((decided & attracts & peaks).sum()),
        neither=int((decided & ~attracts & ~peaks).sum()),
        counted_only=int((decided & ~attracts & peaks).sum()),
        attracted_only=int((decided & attracts & ~peaks).sum()),
        unknown=int((valid & ~decided).sum()),
    )


def _edges(study: ThesisStudy, runs: xr.Dataset) -> tuple[Edge, ...]:
    """The curves over a map; none where the axes belong to the motion, which plays no part."""
    if any(span.key.startswith("motion.") for span in study.spans):
        return ()
    source = study_of(runs)
    ranges = tuple(_range(runs[span.key].values, span.key, span.log) for span in study.spans)
    space = Space(ranges, lambda values: flat_cells(source.stage, source.links, values))
    curves = plane(space, nodes=NODES).curves
    lines = [space.values(curve.points) for curve in curves]
    x, y = (swept.key for swept in ranges)
    return tuple(Edge(curve.kind, curve.sign < 0, line[x], line[y]) for curve, line in zip(curves, lines, strict=True))


def _range(values: np.ndarray, key: str, log: bool) -> KeyRange:
    low, high = float(values[0]), float(values[-1])
    return KeyRange(key, low if low > 0 else SMALLEST * high, high, log)
