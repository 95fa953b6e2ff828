"""The loop of a controller, drawn in characters, so that nobody has to guess which structure its gains are of."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from friso.stage.controllers import FILTERS_KEY, FORCE_LIMIT, controller_of
from friso.stage.filters import FEEDBACK, FORWARD
from friso.stage.lists import row_keys

ABOVE, MAIN, BELOW, LAST, LOWEST = range(5)
"""Lines of a drawing."""

ASIDE = 6
"""By how many characters what is added from below stands before its sum."""


class Canvas:
    """A drawing from the error to the force, to which boxes and sums are added from left to right."""

    def __init__(self, flat: Mapping[str, Any]) -> None:
        self.paths = {flat[f"{place}.path"] for place in row_keys(flat, FILTERS_KEY)}
        self.limited = FORCE_LIMIT in flat
        self.lines = [""] * 5
        self.lines[MAIN] = "r --(+)-- e --"
        self._put(BELOW, 5, "| -")
        self._put(LAST, 5, "y")

    @property
    def filtered(self) -> bool:
        """Whether what is fed back is filtered."""
        return FEEDBACK in self.paths

    def box(self, text: str) -> None:
        """What the signal goes through next."""
        line = self.lines[MAIN]
        self.lines[MAIN] = f"{line}{'' if line.endswith('-') else '--'}[ {text} ]"

    def sum(self, above: str = "", below: str = "", minus: bool = True, deep: bool = False) -> None:
        """A sum with what comes from above, and what from below, subtracted or (`minus` False) added; `deep`, one line
        further down."""
        self.lines[MAIN] += "--(+)"
        place = len(self.lines[MAIN]) - 2
        if above:
            self._put(ABOVE, place, f"v  {above}")
        if below:
            self._put(BELOW, place, "| -" if minus else "|")
            if deep:
                self._put(LAST, place, "|")
            self._put(LOWEST if deep else LAST, place if minus else place - ASIDE, below)

    def text(self) -> str:
        """The drawing, the force behind filters and limit."""
        boxes = [*(["filters"] if FORWARD in self.paths else []), *(["limit"] if self.limited else [])]
        for name in boxes:
            self.box(name)
        self.lines[MAIN] += "--> F"
        return "\n".join(line.rstrip() for line in self.lines if line.strip())

    def _put(self, line: int, place: int, text: str) -> None:
        """Write at a place of a line, behind what stands there."""
        self.lines[line] = f"{self.lines[line]:<{place}}{text}"


def loop_diagram(flat: Mapping[str, Any]) -> str:
    """The loop of a stage given as flat keys, with the terms that it has, as its controller draws it."""
    canvas = Canvas(flat)
    controller_of(flat).draw(canvas, flat)
    return canvas.text()
