"""Choose the bandwidths that are advised to a stage that hunts, at a distance from the edge."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from friso.hunting.path import AttractionEnd, BandwidthWindow
from friso.hunting.search_limits import SEARCH_LIMITS
from friso.hunting.settings import check_settings
from friso.hunting.stage_margins import ParameterMargin, keeps_friction_margin
from friso.hunting.verdict import Judgement
from friso.stage import Stage


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
    share = check_settings.advice_work_share * work if margin else 0.0
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
    for steps in range(1, check_settings.advised_steps + 1):
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
