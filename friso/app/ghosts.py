"""What stands in a figure beside its own: the pinned machine in grey; on maps, machines and the edge of hunting."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from friso.stage import Stage
from friso.views.drawing.figure import GREY, INK, Figure, Markers, Panel

if TYPE_CHECKING:
    from friso.answers.answer import Answer

GHOST = "#a9a9a9"
"""Colour of what is pinned."""


def ghosts_of(pinned: Answer | None) -> Callable[[Figure], Figure]:
    """What puts the lines of a pinned machine's answer behind those of a figure of the same name."""
    if pinned is None:
        return lambda figure: figure
    others = {figure.name: figure for figure in pinned.figures()}
    return lambda figure: _ghosted(figure, others[figure.name]) if figure.name in others else figure


def _ghosted(figure: Figure, other: Figure) -> Figure:
    """The figure with the lines of another one's panels behind its own: of those that show the same."""
    ghosts = {_subject(panel): panel for panel in other.panels}

    def both(panel: Panel) -> Panel:
        ghost = ghosts.get(_subject(panel))
        if ghost is None or not ghost.series:
            return panel
        lines = [replace(line, colour=GHOST, label="", width=1.0) for line in ghost.series]
        lines[-1] = replace(lines[-1], label="pinned")
        return replace(panel, series=(*lines, *panel.series))

    return replace(figure, panels=tuple(map(both, figure.panels)))


_OWN = re.compile(r" \(as given\)|, \S+ k?Hz$")
"""What a title says of the machine alone: which of its cases it is in, and the frequency of a mode."""


def _subject(panel: Panel) -> tuple[str, str, str]:
    return _OWN.sub("", panel.title), panel.x.label, panel.y.label


def with_places(figure: Figure, stands: Sequence[tuple[str, Stage]], keys: Sequence[str]) -> Figure:
    """A map over two keys with the places of some stages, by label, that have both."""
    markers = []
    for label, stage in stands:
        right, up = (stage.flat().get(key) for key in keys)
        if isinstance(right, float) and isinstance(up, float):
            colour = GREY if label == "pinned" else INK
            markers.append(Markers(np.array([right]), np.array([up]), label, colour, "target"))
    panels = tuple(replace(panel, markers=(*panel.markers, *markers)) for panel in figure.panels)
    return replace(figure, panels=panels)


def with_edge(figure: Figure, edge: Answer | None) -> Figure:
    """A map over two keys with the curves on which hunting ends over the same two."""
    if edge is None:
        return figure
    curves = edge.figures()[0].panels[0].series
    return replace(figure, panels=tuple(replace(panel, series=(*panel.series, *curves)) for panel in figure.panels))
