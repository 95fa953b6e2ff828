"""Add to a figure what it is compared with.

On most figures that is the machine pinned for comparison, in grey; on a map it is the edge of hunting.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace

from friso.interface.answer import Answer
from friso.shown.drawing.figure import Figure, Panel

GHOST = "#a9a9a9"
"""Colour of lines of the pinned machine."""


def ghosts_of(pinned: Answer | None) -> Callable[[Figure], Figure]:
    """Return a function that adds the pinned machine's lines, in grey, to a figure.

    Figures are matched by name. Without a pinned answer, figures stay as they are.
    """
    if pinned is None:
        return lambda figure: figure
    others = {figure.name: figure for figure in pinned.figures()}
    return lambda figure: _ghosted(figure, others[figure.name]) if figure.name in others else figure


def _ghosted(figure: Figure, other: Figure) -> Figure:
    """Add the lines of another figure, in grey, behind the lines of a figure.

    Panels are matched by title and axis labels.
    """
    ghosts = {_subject(panel): panel for panel in other.panels}

    def both(panel: Panel) -> Panel:
        """Draw the other figure's lines in grey behind those of a panel."""
        ghost = ghosts.get(_subject(panel))
        if ghost is None or not ghost.series:
            return panel
        lines = [replace(line, colour=GHOST, label="", width=1.0) for line in ghost.series]
        lines[-1] = replace(lines[-1], label="pinned")
        return replace(panel, series=(*lines, *panel.series))

    return replace(figure, panels=tuple(map(both, figure.panels)))


_OWN = re.compile(r" \(as given\)|, \S+ k?Hz$")
"""Pattern of the part of a title that belongs to one machine: its case, or the frequency of a mode."""


def _subject(panel: Panel) -> tuple[str, str, str]:
    """Return title and axis labels of a panel.

    The part of the title that belongs to one machine is left out.
    """
    return _OWN.sub("", panel.title), panel.x.label, panel.y.label


def with_edge(figure: Figure, edge: Answer | None) -> Figure:
    """Add to a map over two keys the curves on which hunting ends.

    `edge` is the answer of `friso boundary`; with None the map stays as it is.
    """
    if edge is None:
        return figure
    curves = edge.figures()[0].panels[0].series
    return replace(figure, panels=tuple(replace(panel, series=(*panel.series, *curves)) for panel in figure.panels))
