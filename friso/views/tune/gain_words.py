"""The gains of the ways that work, in the terms of drives."""

from __future__ import annotations

from friso.cure.method import Advice
from friso.drives.gains import gains_of
from friso.views.export.words import rows


def gain_lines(tuning: Advice) -> list[str]:
    """The gains to type in for every way that works, none of a controller of another package."""
    lines = []
    for cure in tuning.working:
        table = rows(gains_of(cure.stage, {})) if cure.stage else []
        gains = [f"{symbol} = {value}{f' ({others})' if others else ''}" for _, (symbol, value, others) in table]
        if gains:
            lines.append(f"Gains of {cure.way.name} in the terms of drives: {', '.join(gains)} (friso export gains).")
    return lines
