"""Isolator or firmware, drawn: which machines swing on, when they settle, how still they stand."""

from __future__ import annotations

import numpy as np

from friso.equations.motion import last_corner
from friso.studies.compare.study import LONGER, Comparison, Result
from friso.studies.shares import Share
from friso.views.compare.words import label
from friso.views.drawing.figure import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PINK,
    SKY,
    VERMILLION,
    Axis,
    Dash,
    Figure,
    Markers,
    Panel,
    Series,
)
from friso.views.drawing.prefixes import with_unit

LINES: dict[str, tuple[str, Dash]] = {
    "a": (INK, "solid"),
    "b": (BLUE, "solid"),
    "c": (VERMILLION, "solid"),
    "d": (ORANGE, "dashed"),
    "e": (PINK, "dashed"),
    "f": (SKY, "dashed"),
    "g": (GREEN, "solid"),
}
"""Colour and dash of the options."""

BESIDE = 0.16
"""Distance between the markers of an option, in distances between options."""

MOST = (5, 95)
"""Percentiles between which most machines are."""


def figures(found: Comparison) -> list[Figure]:
    """Probabilities, settling times and standstill in one figure."""
    within = with_unit(found.within, "m")
    caption = (
        f"{found.machines.count} machines drawn with seed {found.seed}, the same in all options; in position is within "
        f"{within}. Bars of probabilities are 95 % intervals. Machines that never settle keep the line of the "
        "settling times below 100 %; for standstill, the thin bars contain 90 % of the machines, the thick ones are "
        "95 % "
        "intervals of "
        "the median."
    )
    if not found.shaken:
        caption += " No floor vibration is included: a machine at rest here need not stand still in a real room."
    panels = (_probabilities(found), _settling(found, within), _standstill(found))
    return [Figure("compare", "Isolator or firmware?", caption, panels, subject=found.stage.name)]


def _names(found: Comparison) -> Axis:
    """The options side by side."""
    return Axis("Option", "", (-0.5, len(found.results) - 0.5), words=tuple(map(label, found.results)))


def _probabilities(found: Comparison) -> Panel:
    kinds = (
        ("swings at the end", VERMILLION, [each.swinging for each in found.results]),
        ("not in position at the end", BLUE, [_other(each.settled) for each in found.results]),
        (f"does not stay there ({LONGER} times as long)", GREY, [_other(each.stays) for each in found.results]),
    )
    series, markers = [], []
    for number, (name, colour, shares) in enumerate(kinds):
        x = np.arange(len(shares), dtype=np.float64) + (number - 1) * BESIDE
        series.append(_bars(x, [(each.low, each.high) for each in shares], colour, 100))
        heights = np.array([100 * each.probability for each in shares])
        markers.append(Markers(x, heights, name, colour))
    y = Axis("Share of machines", "%", (-3.0, 103.0))
    return Panel("Machines that do not stand still", _names(found), y, tuple(series), tuple(markers))


def _other(share: Share) -> Share:
    """The probability of the contrary."""
    return Share(1 - share.probability, 1 - share.high, 1 - share.low)


def _bars(
    x: np.ndarray, ends: list[tuple[float, float]], colour: str, factor: float = 1.0, width: float = 1.4
) -> Series:
    """Upright bars as one line with gaps."""
    places = np.repeat(x, 3)
    heights = np.array([value for low, high in ends for value in (factor * low, factor * high, np.nan)])
    return Series(places, heights, "", colour, width=width)


def _settling(found: Comparison, within: str) -> Panel:
    flat, count = found.stage.flat(), found.machines.count
    end = flat["motion.duration"] - float(last_corner(flat))
    times = [np.sort(each.found.settling[np.isfinite(each.found.settling)]) for each in found.results]
    first = min((float(each[0]) for each in times if each.size), default=end)
    start = max(first, 1e-3 * end) / 1.3
    series = []
    for result, ordered in zip(found.results, times, strict=True):
        colour, dash = LINES[result.letter]
        x = np.concatenate([[start], np.repeat(np.maximum(ordered, start), 2), [end]])
        steps = 100 * np.arange(len(ordered) + 1) / count
        series.append(Series(x, np.repeat(steps, 2), label(result), colour, dash))
    axis = Axis("Time since the end of the move", "s", (start, end), log=True, prefixed=False)
    return Panel(f"In position for good, within {within}", axis, Axis("Share", "%", (-3.0, 103.0)), tuple(series))


def _standstill(found: Comparison) -> Panel:
    x, medians = np.arange(len(found.results), dtype=np.float64), [each.in_position for each in found.results]
    middle = np.array([each.value for each in medians])
    series = (
        _bars(x, [_most(each) for each in found.results], GREY),
        _bars(x, [(each.low, each.high) for each in medians], BLUE, width=4.0),
    )
    y = Axis("In-position RMS", "m", log=True)
    title = "How still they stand" if found.shaken else "Whether they are at rest, without a floor"
    return Panel(title, _names(found), y, series, (Markers(x, middle, "median", BLUE),))


def _most(result: Result) -> tuple[float, float]:
    known = result.found.in_position[np.isfinite(result.found.in_position)]
    if not known.size:
        return np.nan, np.nan
    low, high = np.percentile(known, MOST)
    return float(low), float(high)
