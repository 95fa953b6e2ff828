"""Add to a figure what it is compared with.

On most figures that is the machine pinned for comparison, in grey; on a map it is the edge of hunting; on a run it is
the other state of the joint, and a logged run.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from friso.app.settings import app_settings
from friso.identification.logs.log import Log
from friso.interface.answer import Answer
from friso.shown.drawing.figure import BLUE, PINK, Figure, Panel, Series

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


def with_other_joint(figure: Figure, other: Figure, own: tuple[str, str], others: tuple[str, str]) -> Figure:
    """Lay the run of the other state of the joint under a run; `own` and `others` are label and colour of each."""
    under = {panel.title: panel for panel in other.panels}

    def both(panel: Panel) -> Panel:
        """Draw the lines of both runs in a panel, within the limits of both."""
        named, there = _named(panel, *own), under.get(panel.title)
        if there is None:
            return named
        lines = tuple(line for line in _named(there, *others).series if line.label == others[0])
        ends = [limits for limits in (panel.y.limits, there.y.limits) if limits]
        limits = (min(low for low, _ in ends), max(high for _, high in ends)) if ends else None
        return replace(named, y=replace(panel.y, limits=limits), series=(*lines, *named.series))

    return replace(figure, panels=tuple(map(both, figure.panels)))


def _named(panel: Panel, label: str, colour: str) -> Panel:
    """Give the lines of a run, not its reference, a label and a colour."""
    lines = (replace(line, label=label, colour=colour) if line.colour == BLUE else line for line in panel.series)
    return replace(panel, series=tuple(lines))


def with_log(figure: Figure, log: Log, reference: np.ndarray, time: np.ndarray) -> Figure:
    """Lay a logged run over a simulated one, whose `reference` [m] over `time` [s] begins to move at the same instant.

    Positions count from the first one. The error is drawn if the log has the reference.
    """
    signals, commanded = log.signals, "reference" if "reference" in log.signals else "position"
    drawn = {"Position": signals["position"] - signals["position"][0], "Actuator force": signals.get("force")}
    if commanded == "reference":
        drawn["Error"] = signals["reference"] - signals["position"]
    logged = log.time - log.time[_begin(signals[commanded])] + time[_begin(reference)]

    def over(panel: Panel) -> Panel:
        """Draw what the log has of a panel over its lines."""
        values = drawn.get(panel.title)
        if values is None:
            return panel
        inside = (logged >= time[0]) & (logged <= time[-1])
        return replace(panel, series=(*panel.series, Series(logged[inside], values[inside], "logged", PINK)))

    return replace(figure, panels=tuple(map(over, figure.panels)))


def _begin(values: np.ndarray) -> int:
    """Return the index of the last value before a quantity leaves its first value."""
    away = np.abs(values - values[0]) > app_settings.begun_share * np.ptp(values)
    return max(int(away.argmax()) - 1, 0)
