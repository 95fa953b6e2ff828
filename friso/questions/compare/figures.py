"""Draw which machines swing on, when they settle, and how still they stand, for each option."""

from __future__ import annotations

import textwrap

import numpy as np

from friso.equations.motion import last_corner
from friso.questions.compare.words import label
from friso.shares import Share
from friso.shown.drawing.figure import Axis, Figure, Markers, Panel, Series
from friso.shown.drawing.palette import BLUE, GREEN, GREY, INK, ORANGE, PINK, SKY, VERMILLION
from friso.shown.drawing.prefixes import with_unit
from friso.studies.compare.study import LONGER_FACTOR, Comparison, OptionResult

_NAMES = ("ink", "blue", "vermillion", "orange", "pink", "sky", "green")
COLOURS: dict[str, str] = dict(zip(_NAMES, (INK, BLUE, VERMILLION, ORANGE, PINK, SKY, GREEN), strict=True))
"""Colours of options, by the colour name that an option declares."""

MARKER_DISTANCE = 0.16
"""Distance between the markers of one option, relative to the distance between options."""

BAR_PERCENTILES = (5, 95)
"""Percentiles of machines that a bar spans."""


def compare_figures(comparison: Comparison) -> list[Figure]:
    """Draw how many machines keep moving, how fast they settle and, if a floor shakes them, how still they stand.

    The one figure has a panel for each, and shows every option of the comparison.
    """
    within = with_unit(comparison.within, "m")
    caption = (
        f"{comparison.machines.count} machines drawn with seed {comparison.seed}, the same in all options; in position "
        f"means within {within}. Bars of probabilities are 95 % intervals. The settling curve of an option ends at the "
        "share of machines that settle at all."
    )
    panels = (_probabilities(comparison), _settling(comparison, within))
    if comparison.shaken:
        caption += " Standstill: thin bars contain 90 % of the machines, thick bars are 95 % intervals of the median."
        panels += (_standstill(comparison),)
    else:
        caption += (
            " The stage file has no table [floor], the vibration of the floor: a machine at rest here need not stand "
            "still in a real room."
        )
    return [Figure("compare", "Isolator or firmware?", caption, panels, subject=comparison.stage.name)]


def _names(comparison: Comparison) -> Axis:
    """Return the axis of options by name, broken into lines of a word or two."""
    names = tuple("\n".join(textwrap.wrap(label(result), 14)) for result in comparison.results)
    return Axis("", "", (-0.5, len(names) - 0.5), words=names)


def _probabilities(comparison: Comparison) -> Panel:
    """Return the panel of machines that swing, miss their position, or do not stay there."""
    kinds = (
        ("swings at the end", VERMILLION, [result.swinging for result in comparison.results]),
        ("not in position at the end", BLUE, [_other(result.settled) for result in comparison.results]),
        (
            f"does not stay there ({LONGER_FACTOR} times as long)",
            GREY,
            [_other(result.stays) for result in comparison.results],
        ),
    )
    series, markers = [], []
    for number, (name, colour, shares) in enumerate(kinds):
        x = np.arange(len(shares), dtype=np.float64) + (number - 1) * MARKER_DISTANCE
        series.append(_bars(x, [(share.low, share.high) for share in shares], colour, 100))
        heights = np.array([100 * share.probability for share in shares])
        markers.append(Markers(x, heights, name, colour))
    y = Axis("Share of machines", "%", (-3.0, 103.0))
    return Panel("Machines that do not come to rest", _names(comparison), y, tuple(series), tuple(markers))


def _other(share: Share) -> Share:
    """Return the probability that something does not happen, with its interval."""
    return Share(1 - share.probability, 1 - share.high, 1 - share.low)


def _bars(
    x: np.ndarray, ends: list[tuple[float, float]], colour: str, factor: float = 1.0, width: float = 1.4
) -> Series:
    """Return vertical bars at `x`, drawn as one line with gaps between them.

    A bar runs from the low to the high value of its `ends`, both times `factor`. `width` is that of the line.
    """
    places = np.repeat(x, 3)
    heights = np.array([value for low, high in ends for value in (factor * low, factor * high, np.nan)])
    return Series(places, heights, "", colour, width=width)


def _settling(comparison: Comparison, within: str) -> Panel:
    """Return the panel of the fraction of machines in position over the time since the move.

    `within` is the tolerance that counts as in position, as text.
    """
    flat, count = comparison.stage.flat(), comparison.machines.count
    end = flat["motion.duration"] - float(last_corner(flat))
    times = [np.sort(result.measures.settling[np.isfinite(result.measures.settling)]) for result in comparison.results]
    first = min((float(ordered[0]) for ordered in times if ordered.size), default=end)
    start = max(first, 1e-3 * end) / 1.3
    series = []
    for result, ordered in zip(comparison.results, times, strict=True):
        colour, dash = result.option.kind.line
        x = np.concatenate([[start], np.repeat(np.maximum(ordered, start), 2), [end]])
        steps = 100 * np.arange(len(ordered) + 1) / count
        series.append(Series(x, np.repeat(steps, 2), label(result), COLOURS[colour], dash))
    axis = Axis("Time after the move", "s", (start, end), log=True, prefixed=False)
    return Panel(f"In position to stay, within {within}", axis, Axis("Share", "%", (-3.0, 103.0)), tuple(series))


def _standstill(comparison: Comparison) -> Panel:
    """Return the panel of the in-position RMS [m] of each option, with its spread."""
    x, medians = (
        np.arange(len(comparison.results), dtype=np.float64),
        [result.in_position for result in comparison.results],
    )
    middle = np.array([median.value for median in medians])
    most = [_most(result) for result in comparison.results]
    series = (
        _bars(x, most, GREY),
        _bars(x, [(median.low, median.high) for median in medians], BLUE, width=4.0),
    )
    moves = max((high for _, high in most if high > 0), default=0.0) > 0  # none rests from the start
    y = Axis("In-position RMS", "m", log=moves)
    return Panel("Standstill", _names(comparison), y, series, (Markers(x, middle, "median", BLUE),))


def _most(result: OptionResult) -> tuple[float, float]:
    """Return the range of the in-position RMS [m] in which most machines lie.

    Its ends are two percentiles of the finite values; NaN if there are none.
    """
    finite = result.measures.in_position[np.isfinite(result.measures.in_position)]
    if not finite.size:
        return np.nan, np.nan
    low, high = np.percentile(finite, BAR_PERCENTILES)
    return float(low), float(high)
