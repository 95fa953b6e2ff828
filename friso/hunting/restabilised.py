"""Find where unstable cycles become stable again, farther along their branch.

A cycle whose multiplier has passed -1 goes on as an unstable one. At a fold its multiplier is 1. To get there, the
multiplier has to come back through the stable range, unless the branch breaks off at a corner of the equations. This
happens next to the fold, where bandwidth hardly changes along the branch. Such windows of bandwidth may be as narrow as
1e-5 of it, and no survey of bandwidths meets them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import pairwise
from typing import Any

import numpy as np

from friso.engine.allowance import Exhausted, allowance
from friso.equations.bandwidth import faster
from friso.equations.structure import shared_structure
from friso.hunting.boundary.branch import END_OF_RANGE, Branch, Point, Tracer
from friso.hunting.boundary.locate import special_points, towards
from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.cycle.find import Cycles, families
from friso.hunting.cycle.shooting import Family
from friso.hunting.outward import AttractionEnd, BandwidthWindow
from friso.hunting.settings import EdgeSettings, ToleranceSettings

RTOL = ToleranceSettings().survey_rtol
"""Relative tolerance of the runs."""

Stretch = tuple[tuple[float, float], tuple[float, float] | None]
"""Places between which a cycle is stable, each with its error (None: up to the end of the family)."""


def windows_again(
    flat: Mapping[str, Any], at: float, farthest: float, besides: Sequence[BandwidthWindow]
) -> tuple[BandwidthWindow, ...]:
    """Find further windows in which a cycle is stable that is unstable at a factor `at` of the
    bandwidth.

    Nothing attracts at that factor. The cycle is followed to the `farthest` factor; windows in `besides` are left out.
    There are none where a limiter chatters, which makes multipliers rough, and no more once an allowance is used up.
    """
    settings = EdgeSettings.current()
    ahead, form = 1.0 if farthest > at else -1.0, shared_structure(flat)

    def factor(place: float | np.ndarray) -> Any:
        """Return the factor of the bandwidth at a place."""
        return at * np.exp(ahead * place)

    def family(_: np.ndarray, places: np.ndarray) -> Ensemble:
        """Return the stages at places along the bandwidth."""
        return Ensemble.held(faster(flat, factor(places)), len(places), form=form)

    def end(place: float, error: float, outward: float) -> AttractionEnd:
        inside = float(factor(place))
        return AttractionEnd(inside, inside * (1 + max(settings.least_window_error, error)) ** (ahead * outward), False)

    windows: list[BandwidthWindow] = []
    with allowance(), suppress(Exhausted):
        for first, last in _ranges(family, abs(float(np.log(farthest / at)))):
            ends = [end(*first, -1.0), end(*last, 1.0) if last else None]
            window = BandwidthWindow(*(ends if ahead > 0 else ends[::-1]))
            if not any(other.holds(float(factor(first[0]))) for other in (*besides, *windows)):
                windows.append(window)
    return tuple(windows)


@np.errstate(all="ignore")  # runs that fail on the way leave infinities behind
def _ranges(family: Family, farthest: float) -> Iterator[Stretch]:
    """Yield ranges in which cycles are stable that are unstable at place 0 of a family."""
    stages = family(np.zeros(1), np.zeros(1))
    if stages.chatters:
        return
    for cycles in families(stages):
        if cycles.closed[0] and not cycles.attracting[0]:
            yield from restabilised(family, cycles, farthest)


def restabilised(family: Family, cycle: Cycles, farthest: float) -> Iterator[Stretch]:
    """Yield ranges in which one cycle is stable that is unstable at place 0 of a family of
    stages.

    It is followed to the farthest place, or to where its branch first turns back or is lost.
    """
    settings = EdgeSettings.current()
    tracer = Tracer(
        family,
        cycle.sign,
        RTOL,
        farthest,
        cycle.swings,
        pace=settings.window_pace,
        shortest=settings.shortest_window_step,
        steepest=settings.steepest_window_multiplier,
    )
    start = Point.of(family(np.zeros(1), np.zeros(1)), 0.0, cycle)
    points, reason = tracer.walk(start, 1.0, lambda last, point: point.place < last.place)
    branch = Branch(cycle.sign, (start, *points), (reason, reason))
    specials = sorted(special_points(tracer, branch), key=lambda special: special.point.place)
    for first, last in pairwise(specials):
        if _attracts(_between(tracer, first.point, last.point)):
            yield (first.point.place, first.error), (last.point.place, last.error)
    if specials and _attracts(end := branch.points[-1]):
        first = specials[-1].point.place, specials[-1].error
        yield first, None if reason == END_OF_RANGE else (end.place, 0.0)


def _between(tracer: Tracer, first: Point, last: Point) -> Point | None:
    """Return the cycle half-way between two points of a branch."""
    return tracer.solve(first, (first.vector + last.vector) / 2, towards(first, last))


def _attracts(point: Point | None) -> bool:
    return point is not None and abs(point.multiplier) < 1
