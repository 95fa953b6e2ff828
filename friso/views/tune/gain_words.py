"""The gains of the remedies that work, in the terms of drives."""

from __future__ import annotations

from friso.drives.gains import gains_of
from friso.remedies.method import Advice
from friso.views.export.words import rows


def gain_lines(tuning: Advice) -> list[str]:
    """The gains to type in for every remedy that works."""
    lines = []
    for outcome in tuning.working:
        table = rows(gains_of(outcome.stage, {})) if outcome.stage else []
        gains = [f"{symbol} = {value}{f' ({others})' if others else ''}" for _, (symbol, value, others) in table]
        if gains:
            lines.append(
                f'The gains to type in for "{outcome.remedy.name}" are {", ".join(gains)} (friso export gains).'
            )
    return lines
