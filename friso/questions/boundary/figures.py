"""Draw a boundary of hunting: branches of cycles over one key, or curves in the plane of two."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from friso.hunting import Diagram, KeyRange, Plane
from friso.questions.boundary.words import MEANINGS, ShownKey, answer, end_sentence
from friso.questions.map.words import QUIET, quantity
from friso.shown.drawing.figure import (
    BLUE,
    GREY,
    INK,
    LIGHT,
    VERMILLION,
    Axis,
    Category,
    Cloud,
    Figure,
    Lettering,
    Limit,
    Markers,
    Panel,
    Series,
    Symbol,
)
from friso.studies import boundary
from friso.studies.boundary import ATTRACTS, INVALID, REPELS, UNKNOWN, CycleShape, Line

NAMES: dict[CycleShape, str] = {
    "symmetric": "hunting cycle",
    "asymmetric": "asymmetric cycle",
    "whole": "hunting cycle",
}
COLOURS: dict[CycleShape, str] = {"symmetric": INK, "asymmetric": BLUE, "whole": INK}
SYMBOLS: dict[str, Symbol] = {"flip": "circle", "fold": "triangle", "torus": "patch"}
NODES = {
    ATTRACTS: Category("hunting is possible", VERMILLION),
    REPELS: Category("no hunting was found", QUIET),
    UNKNOWN: Category("unknown", "#ffffff"),
    INVALID: Category("invalid stage", LIGHT),
}

LARGEST_MULTIPLIER = 2.5
"""Largest Floquet multiplier that is shown."""

LOGARITHMIC_RATIO = 30.0
"""Ratio of the largest to the smallest amplitude above which the axis is logarithmic."""

LABEL_WIDTH = 1 / 3
"""Width of a label of a point on a page of 400 px, as a fraction of the axis. Closer ones are one label."""

PLANE_MARGIN = 0.02
"""Margin around the plane of two keys, as a fraction of the range, so that nodes at its sides are fully visible."""


def boundary_figure(
    traced: Diagram | Plane, keys: tuple[ShownKey, ...], subject: str = "", condition: str = ""
) -> Figure:
    """Return the figure of a boundary, whose title is the answer; points such as folds are named in the units shown.

    It holds under a `condition`, with which its note begins.
    """
    figure = _diagram(traced, keys[0]) if isinstance(traced, Diagram) else _plane(traced)
    title = answer(traced, keys)[int(traced.unstable.any())].rstrip(".")  # behind a sentence on unstable loops
    return replace(figure, title=title, subject=subject, note=condition + figure.note)


def _diagram(traced: Diagram, key: ShownKey) -> Figure:
    """Draw amplitude, period and multiplier of all cycles over one key.

    The legend stands above the first panel.
    """
    branches = boundary.lines(traced)
    x = _told(branches, _axis(traced.space.ranges[0]))
    sizes = [size for line in branches for size in line.amplitude]
    log = max(sizes, default=0.0) > LOGARITHMIC_RATIO * min(sizes, default=0.0)
    panels = (
        _panel(branches, "amplitude", x, Axis("Amplitude", "m", log=log), key),
        _panel(branches, "period", x, Axis("Period", "s")),
        _panel(branches, "multiplier", x, Axis("Multiplier", "", (-LARGEST_MULTIPLIER, LARGEST_MULTIPLIER))),
    )
    bounds = Limit((-1.0, 1.0), "", GREY, "dotted")
    panels = (*panels[:2], replace(panels[2], title="A cycle attracts between −1 and 1", limits=(bounds,)))
    styles = "Solid: the cycle attracts, nearby motions end in it. Dashed: it repels."
    note = f"{styles if branches else 'No cycle was found.'} {end_sentence(traced, key)}"
    return Figure("boundary", "Hunting cycles", "", panels, note=note)


AXIS_BEYOND = 0.15
"""How far an axis goes on beyond the last cycle, as a share of what has cycles. It shows that none is there."""


def _told(branches: tuple[Line, ...], axis: Axis) -> Axis:
    """Return an axis that ends a little beyond the last change of a branch, if none is left there."""
    at = np.concatenate([np.empty(0), *(line.at[:, 0] for line in branches)])
    if not at.size or axis.limits is None:
        return axis
    low, high = axis.limits
    ends = (float(at.min()), float(at.max()))
    if axis.log:
        gap = (ends[1] / ends[0]) ** AXIS_BEYOND
        return replace(axis, limits=(max(low, ends[0] / gap), min(high, ends[1] * gap)))
    gap = AXIS_BEYOND * (ends[1] - ends[0])
    return replace(axis, limits=(max(low, ends[0] - gap), min(high, ends[1] + gap)))


def _panel(branches: tuple[Line, ...], measure: str, x: Axis, y: Axis, key: ShownKey | None = None) -> Panel:
    """Draw one measure of all branches, such as the period, with folds and other special points.

    `measure` is a field of `Line`. Lines and points are labelled only if there is a `key`, in whose unit values are
    written.
    """
    labels: set[str] = set()
    series = []
    for line in branches:
        for attracts, run in _runs(line):
            label = f"{NAMES[line.shape]} {'attracts' if attracts else 'repels'}"
            text = label if key and label not in labels else ""
            labels.add(label)
            style = ("solid", 2.0) if attracts else ("dashed", 1.4)
            series.append(Series(line.at[run, 0], getattr(line, measure)[run], text, COLOURS[line.shape], *style))
    turns = sorted(((line, k) for line in branches for k in line.special), key=lambda turn: turn[0].at[turn[1], 0])
    markers, words, shares = [], list[Lettering](), list[float]()
    scale = np.log if x.log else np.asarray
    low, high = scale(x.limits or (0.0, 1.0))
    for line, k in turns:
        at, value = float(line.at[k, 0]), float(getattr(line, measure)[k])
        markers.append(Markers(np.array([at]), np.array([value]), "", COLOURS[line.shape], SYMBOLS[line.kinds[k]]))
        if not key:
            continue
        text = f"{line.kinds[k]} at {key.as_known(line.at[k, 0], line.error[k, 0])}"
        share = float(np.clip((scale(at) - low) / (high - low), LABEL_WIDTH / 2, 1 - LABEL_WIDTH / 2))
        if words and share - shares[-1] < LABEL_WIDTH:
            colour = words[-1].colour if words[-1].colour == COLOURS[line.shape] else INK
            text, above = f"{words[-1].text}\n{text}", max(words[-1].y, value)
            words[-1] = replace(words[-1], y=above, text=text, colour=colour)
        else:
            shares.append(share)
            beside = float(low + share * (high - low))
            words.append(Lettering(np.exp(beside) if x.log else beside, value, text, COLOURS[line.shape], "above"))
    return Panel("", x, y, tuple(series), tuple(markers), words=tuple(words))


def _runs(line: Line) -> Iterator[tuple[bool, np.ndarray]]:
    """Yield the parts of a branch between changes of stability, for drawing.

    Each part is a pair: whether its cycles attract, and the indices of its points.
    """
    changes = np.flatnonzero(np.diff(line.attracts)) + 1
    for legs in np.split(np.arange(line.attracts.size), changes):
        if legs.size:
            yield bool(line.attracts[legs[0]]), np.append(legs, legs[-1] + 1)


def _plane(traced: Plane) -> Figure:
    """Draw the curves on which hunting ends, and the verdicts at the nodes of the grid."""
    x, y = (_axis(swept, PLANE_MARGIN) for swept in traced.space.ranges)
    curves = boundary.curves(traced)
    series = tuple(Series(curve.at[:, 0], curve.at[:, 1], "", INK, width=2.2) for curve in curves)
    across, up, verdicts = zip(*boundary.node_verdicts(traced), strict=True)
    codes = np.array([list(NODES).index(verdict) for verdict in verdicts], dtype=float)
    numbers = np.full(codes.shape, np.nan)
    nodes = Cloud(np.array(across), np.array(up), numbers, "", "", categories=tuple(NODES.values()), codes=codes)
    kinds = dict.fromkeys(kind for curve in curves for kind in curve.kinds if kind in MEANINGS)
    note = " ".join(f"Beyond a {kind} of a cycle, {MEANINGS[kind]}." for kind in kinds)
    return Figure("boundary", "Edge of hunting", "", (Panel("", x, y, series, clouds=(nodes,)),), note=note)


def _axis(swept: KeyRange, margin: float = 0.0) -> Axis:
    """Return the axis of a key over its range, widened on both sides by the fraction `margin`."""
    low, high = swept.at(np.array([-margin, 1 + margin])).tolist()
    return Axis(quantity(swept.key), swept.unit, (low, high), swept.log)
