"""Draw how soon machines settle with each stage, and how many do not come to rest."""

from __future__ import annotations

import textwrap

import numpy as np

from friso.equations.motion import last_corner
from friso.intervals import Share
from friso.remedies.comparison import Comparison
from friso.shown.drawing.figure import (
    BLUE,
    GREEN,
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
from friso.shown.text import with_unit

COLOURS = (INK, BLUE, VERMILLION, GREEN, ORANGE, PINK, SKY)
DASHES: tuple[Dash, ...] = ("solid", "dashed", "dotted")
"""Colours and dashes of the stages' curves, in their order; the dash changes where colours begin again."""

MARKER_DISTANCE = 0.16
"""Distance between the markers of one stage, relative to the distance between stages."""


def compare_figures(comparison: Comparison, title: str) -> list[Figure]:
    """Draw how soon the machines settle with each stage, and how many keep moving; the `title` is the answer."""
    caption = (
        f"{comparison.machines.count} machines drawn with seed {comparison.seed}, the same for all stages. The curve "
        "of a stage ends at the share of machines that settle at all. Bars are 95 % intervals."
    )
    panels = (_settling(comparison), _moving(comparison))
    return [Figure("compare", title, caption, panels, subject=comparison.stage.name)]


def _settling(comparison: Comparison) -> Panel:
    """Return the panel of the fraction of machines that have settled over the time since the move."""
    times = [np.sort(result.measures.settling) for result in comparison.results]
    flats = [result.stage.flat() for result in comparison.results]
    end = max(flat["motion.duration"] - float(last_corner(flat)) for flat in flats)
    first = min((float(ordered[0]) for ordered in times if np.isfinite(ordered[0])), default=end)
    start = max(first, 1e-3 * end) / 1.3
    series = []
    for number, (result, ordered) in enumerate(zip(comparison.results, times, strict=True)):
        settled = ordered[np.isfinite(ordered)]
        x = np.concatenate([[start], np.repeat(np.maximum(settled, start), 2), [end]])
        y = np.repeat(100 * np.arange(len(settled) + 1) / len(ordered), 2)
        dash = DASHES[number // len(COLOURS) % len(DASHES)]
        series.append(Series(x, y, result.name, COLOURS[number % len(COLOURS)], dash))
    axis = Axis("Time after the move", "s", (start, end), log=True, prefixed=False)
    within = with_unit(comparison.within, "m")
    return Panel(f"In position to stay, within {within}", axis, Axis("Share", "%", (-3.0, 103.0)), tuple(series))


def _moving(comparison: Comparison) -> Panel:
    """Return the panel of the machines that swing at the end, or are not in position."""
    kinds = (
        ("swings at the end", VERMILLION, [result.swinging for result in comparison.results]),
        ("not in position at the end", BLUE, [_other(result.resting) for result in comparison.results]),
    )
    series, markers = [], []
    for number, (name, colour, shares) in enumerate(kinds):
        x = np.arange(len(shares), dtype=np.float64) + (number - 0.5) * MARKER_DISTANCE
        bars = np.array([100 * end for share in shares for end in (share.low, share.high, np.nan)])
        series.append(Series(np.repeat(x, 3), bars, "", colour))
        markers.append(Markers(x, np.array([100 * share.probability for share in shares]), name, colour))
    names = tuple("\n".join(textwrap.wrap(result.name, 14)) for result in comparison.results)
    axis = Axis("", "", (-0.5, len(names) - 0.5), words=names)
    y = Axis("Share of machines", "%", (-3.0, 103.0))
    return Panel("Machines that do not come to rest", axis, y, tuple(series), tuple(markers))


def _other(share: Share) -> Share:
    """Return the probability that something does not happen, with its interval."""
    return Share(1 - share.probability, 1 - share.high, 1 - share.low)
