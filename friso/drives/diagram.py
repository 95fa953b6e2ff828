"""Draw the loop of a controller in characters, to show to which structure its gains belong."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from friso.stage.controllers import FEEDBACK, FILTERS_KEY, FORCE_LIMIT, FORWARD, controller_of
from friso.stage.section import row_keys

ABOVE, MAIN, BELOW, LAST, LOWEST = range(5)
"""Lines of a drawing, from top to bottom."""

SUM_DISTANCE = 6
"""Characters between a signal from below and its summing point."""


class Canvas:
    """Drawing of the loop from the error to the force.

    Boxes and sums are added from left to right. Feedback and feedforward enter on lines above and below.
    """

    def __init__(self, flat: Mapping[str, Any]) -> None:
        """Start the drawing with the reference, the first sum and the fed-back position.

        `flat` is the stage as flat keys; its keys tell which filters and limits to draw.
        """
        self.paths = {flat[f"{place}.path"] for place in row_keys(flat, FILTERS_KEY)}
        self.limited = FORCE_LIMIT in flat
        self.lines = [""] * 5
        self.lines[MAIN] = "r --(+)-- e --"
        self._put(BELOW, 5, "| -")
        self._put(LAST, 5, "y")

    @property
    def filtered(self) -> bool:
        """Tell whether a filter acts on the fed-back position."""
        return FEEDBACK in self.paths

    def box(self, text: str) -> None:
        """Add a box with a text that the signal passes through next."""
        line = self.lines[MAIN]
        self.lines[MAIN] = f"{line}{'' if line.endswith('-') else '--'}[ {text} ]"

    def sum(self, above: str = "", below: str = "", minus: bool = True, deep: bool = False) -> None:
        """Add a sum of the signal and of what enters from above or below.

        What enters from below is subtracted, or added if `minus` is False, and drawn one line lower if `deep`.
        """
        self.lines[MAIN] += "--(+)"
        place = len(self.lines[MAIN]) - 2
        if above:
            self._put(ABOVE, place, f"v  {above}")
        if below:
            self._put(BELOW, place, "| -" if minus else "|")
            if deep:
                self._put(LAST, place, "|")
            self._put(LOWEST if deep else LAST, place if minus else place - SUM_DISTANCE, below)

    def text(self) -> str:
        """Finish the drawing with output filters and force limit, and return its lines as text."""
        boxes = [*(["filters"] if FORWARD in self.paths else []), *(["limit"] if self.limited else [])]
        for name in boxes:
            self.box(name)
        self.lines[MAIN] += "--> F"
        return "\n".join(line.rstrip() for line in self.lines if line.strip())

    def _put(self, line: int, place: int, text: str) -> None:
        """Write a text at column `place` of a line, padding the line with spaces up to there."""
        self.lines[line] = f"{self.lines[line]:<{place}}{text}"


def loop_diagram(flat: Mapping[str, Any]) -> str:
    """Draw the loop of a stage with the terms that its controller has."""
    canvas = Canvas(flat)
    controller_of(flat).draw(canvas, flat)
    return canvas.text()
