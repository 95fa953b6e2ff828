"""Find the margins of a stage in static friction and in its joint's design, and the bandwidths to advise.

Bandwidths are advised to a stage that hunts, at a distance from the edge.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from friso.engine.allowance import Exhausted, allowance
from friso.equations.bandwidth import faster, least_static_factor, static_frictions, with_static_friction
from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.cycle.hunting import surely_surveyed
from friso.hunting.path import (
    SEARCH_LIMITS,
    AttractionEnd,
    BandwidthWindow,
    ParameterPath,
    key_path,
    static_friction_path,
)
from friso.hunting.path_search import PathSearch, Undecided
from friso.hunting.verdict import Judgement
from friso.hunting.what_attracts import what_attracts
from friso.stage import Stage

JOINT_KEYS = "joint.stroke", "joint.stiffness"
"""Keys of a joint's design on which hunting depends."""


@dataclass(frozen=True)
class ParameterMargin:
    """Range of a parameter over which a stage keeps hunting, or keeps not hunting.

    `attracts` is true if it hunts. `below` and `above` are the nearest ends of attraction, in factors of the parameter
    (None: there is none up to the end of the `range`). On the `open_sides`, -1 or 1, this is not known. A stage that
    hunts does so `again` beyond an end, by the side. Nothing of it is certain unless the stage's values are `sure`.
    """

    attracts: bool
    below: AttractionEnd | None
    above: AttractionEnd | None
    range: tuple[float, float]
    open_sides: tuple[int, ...] = ()
    sure: bool = True
    again: Mapping[int, AttractionEnd] = field(default_factory=dict)

    @property
    def certain(self) -> bool:
        """Tell whether no side is open, the stage is sure, and both ends, if there are any, are certain.

        Between the tried values, hunting may still begin and end unnoticed.
        """
        return self.sure and not self.open_sides and all(end.certain for end in (self.below, self.above) if end)

    def uncertain(self) -> ParameterMargin:
        """Return the margin with its ends marked as not certain, of a stage that is not sure."""
        below, above = (end and replace(end, certain=False) for end in (self.below, self.above))
        return replace(self, below=below, above=above, sure=False)

    def end(self, side: int) -> AttractionEnd | None:
        """Return the end below (`side` -1) or above (1) the stage's own value; None without one."""
        return self.below if side < 0 else self.above

    def same(self, end: AttractionEnd) -> float:
        """Return the factor at an end up to which the stage hunts, or does not, as at its own value."""
        return end.inside if self.attracts else end.outside

    def other(self, end: AttractionEnd) -> float:
        """Return the factor at an end at which the stage does the opposite."""
        return end.outside if self.attracts else end.inside


def friction_margin(stage: Stage, judgement: Judgement) -> ParameterMargin | None:
    """Find how much more or less static friction starts or ends hunting, Coulomb friction held.

    The range runs from static friction equal to Coulomb friction, or a fraction given by `SEARCH_LIMITS`, to a
    multiple. Returns None if the friction law lacks static or Coulomb friction, if the stage cannot hunt, or if its
    attractors are unknown.
    """
    flat = stage.flat()
    if not static_frictions(flat) or not _is_known(judgement):
        return None
    return _margin(static_friction_path(flat), judgement)


JOINT_MARGIN_WORK = 2e8
"""Work for the margins of a joint, which only --details needs: a quarter of a check's time."""


def joint_margins(stage: Stage, judgement: Judgement) -> dict[str, ParameterMargin]:
    """Find what change in stroke and stiffness of a free joint starts or ends hunting.

    The range is given by `SEARCH_LIMITS`. The margins are listed by key. There is none without a free joint, for a
    stage that cannot hunt, or for one whose attractors are unknown.
    """
    flat = stage.flat()
    if stage.joint is None or stage.joint.locked or not _is_known(judgement):
        return {}
    with allowance(JOINT_MARGIN_WORK):
        return {key: _margin(key_path(flat, key), judgement) for key in JOINT_KEYS if flat.get(key)}


def _is_known(judgement: Judgement) -> bool:
    """Tell whether a judged stage may hunt, and it is certain whether something attracts it."""
    hunting, unclear = judgement.hunting, judgement.observed and judgement.hunting.target is None
    failed = judgement.verdict == "failed" or judgement.runs_away or hunting.passing
    return hunting.possible and hunting.certain and not failed and not unclear


@np.errstate(all="ignore")  # runs that fail on the way leave infinities behind
def _margin(path: ParameterPath, judgement: Judgement) -> ParameterMargin:
    """Find the nearest ends of attraction on a path through a stage whose attractors are known.

    A side is open if an allowance of work is used up, or the search does not decide.
    """
    survey, factors = judgement.hunting.surveyed, path.factors
    assert survey is not None
    attracts, span = bool(survey.attracts[0]), (float(factors[0]), float(factors[-1]))
    ends, open_sides, again = dict[int, AttractionEnd | None](), list[int](), dict[int, AttractionEnd]()
    try:
        search = PathSearch(path)
    except Exhausted:
        return ParameterMargin(attracts, None, None, span, (-1, 1))
    search.record(survey)
    for side in (-1, 1):
        try:
            ends[side] = end = search.nearest(side)
        except (Exhausted, Undecided):
            open_sides.append(side)
            continue
        try:
            if attracts and end and (begins := search.again(side, end)):
                again[side] = begins
        except Exhausted:
            continue
        except Undecided:
            ends[side] = end and replace(end, certain=False)
    return ParameterMargin(attracts, ends.get(-1), ends.get(1), span, tuple(open_sides), again=again)


def keeps_friction_margin(stage: Stage, factor: float, work: float) -> bool | None:
    """Tell whether a stage with a controller faster by `factor` does not hunt at other friction.

    Static friction is multiplied and divided by the factor by which advice keeps away from an edge; it stays at least
    Coulomb friction. Returns None for a law that lacks static or Coulomb friction. Returns None as well if this takes
    more than the given work, or is not certain.
    """
    flat = stage.flat()
    if not static_frictions(flat):
        return None
    distance = SEARCH_LIMITS.edge_distance
    factors = np.array([max(1 / distance, least_static_factor(flat)), distance])
    try:
        with allowance(work):
            changed = with_static_friction(faster(flat, factor), factors)
            stages = Ensemble.held(changed, len(factors))
            survey = what_attracts(stages)
    except Exhausted:
        return None
    if survey.attracts.any():
        return False
    return True if surely_surveyed(stages, survey).all() else None


@dataclass(frozen=True)
class BandwidthAdvice:
    """A bandwidth at which a stage stops hunting, as a `factor` of its own.

    It keeps a distance from the `edge` of hunting, or lies `just_beyond` it, because the stage hunts again, or its loop
    is unstable, close by (or the search ends there). `keeps_friction` is true if the stage does not hunt there either
    with that distance more or less static friction (None: not known).
    """

    factor: float
    edge: AttractionEnd
    just_beyond: bool
    keeps_friction: bool | None


ADVICE_WORK_SHARE = 0.1
"""Work for two stages that show whether a bandwidth advised keeps a margin, as a fraction of that of a case."""


def advised(
    stage: Stage,
    judgement: Judgement,
    unstable: tuple[BandwidthWindow, ...],
    margin: ParameterMargin | None,
    work: float,
) -> tuple[BandwidthAdvice | None, BandwidthAdvice | None]:
    """Return the higher and the lower bandwidth advised to a stage; None where there is none.

    Both keep a distance from the edge of hunting. A stage that settles, but begins to hunt with little change of static
    friction (its `margin`), is advised a higher one. If hunting returns there with other static friction, bandwidths
    farther off are tried. At those in `unstable` the loop is unstable. Other static friction is examined within a
    fraction of the `work`, and only if there is a margin.
    """
    windows = (*judgement.windows, *unstable)
    share = ADVICE_WORK_SHARE * work if margin else 0.0
    if judgement.swing is None:
        thin = margin is not None and _is_thin(margin)
        return _beyond(stage, AttractionEnd(1.0, 1.0, True), windows, share) if thin else None, None
    higher, lower = judgement.margin and judgement.margin.end, judgement.lower
    return (
        _beyond(stage, higher, windows, share) if higher else None,
        _beyond(stage, lower, windows, share) if lower else None,
    )


def _is_thin(margin: ParameterMargin) -> bool:
    """Tell whether a stage that does not hunt begins to within the distance that advice keeps."""
    ends = [end.outside for end in (margin.below, margin.above) if end and not margin.attracts]
    return any(max(end, 1 / end) < SEARCH_LIMITS.edge_distance for end in ends)


ADVISED_STEPS = 4
"""Bandwidths tried for advice, each farther from the edge by the distance that advice keeps: up to twice."""


def _beyond(
    stage: Stage, edge: AttractionEnd, windows: tuple[BandwidthWindow, ...], work: float
) -> BandwidthAdvice | None:
    """Return the bandwidth advised beyond an edge of hunting; None if the loop is unstable or the stage hunts there.

    `windows` are bandwidths at which the stage hunts again or its loop is unstable.
    """
    ahead = -1 if edge.outside < edge.inside else 1
    if _within(windows, edge.outside, edge.outside):
        return None
    first: BandwidthAdvice | None = None
    for steps in range(1, ADVISED_STEPS + 1):
        factor = edge.outside * SEARCH_LIMITS.edge_distance ** (ahead * steps)
        within = SEARCH_LIMITS.lowest_bandwidth <= factor <= SEARCH_LIMITS.highest_bandwidth
        reach = factor * SEARCH_LIMITS.edge_distance**ahead
        if not within or _within(windows, *sorted((edge.outside, reach))):
            break
        kept = keeps_friction_margin(stage, factor, work) if work else None
        first = first or BandwidthAdvice(factor, edge, False, kept)
        if kept is not False:
            return BandwidthAdvice(factor, edge, False, kept)
    settles = edge.inside == edge.outside  # at its own bandwidth already
    return first or (None if settles else BandwidthAdvice(edge.outside, edge, True, None))


def _within(windows: Iterable[BandwidthWindow], low: float, high: float) -> bool:
    """Tell whether a window overlaps the bandwidths from `low` to `high`, unless it is narrow and well inside."""
    return any(
        (window.low is None or window.low.inside <= high)
        and (window.high is None or window.high.inside >= low)
        and not _passed_over(window, low, high)
        for window in windows
    )


def _passed_over(window: BandwidthWindow, low: float, high: float) -> bool:
    """Tell whether a window is narrow, and lies between two bandwidths at a distance from both."""
    if window.low is None or window.high is None or low == high:
        return False
    width = SEARCH_LIMITS.narrow_window
    return (
        window.high.inside <= width * window.low.inside
        and window.high.inside * width <= high
        and window.low.inside >= width * low
    )
