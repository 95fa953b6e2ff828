"""Write the gains of the remedies that work in the terms of drives."""

from __future__ import annotations

from friso.drives.gains import gains_of
from friso.questions.export.words import rows
from friso.remedies.method import Advice
from friso.remedies.verified import RemedyOutcome


def gain_lines(tuning: Advice) -> list[str]:
    """Return the gains to type in for every remedy that works."""
    return [
        f'The gains to type in for "{outcome.remedy.name}" are {gains} (friso export).'
        for outcome in tuning.working
        if (gains := gains_to_type_in(outcome, tuning))
    ]


def gains_to_type_in(outcome: RemedyOutcome, tuning: Advice) -> str:
    """Write symbols and values of a remedy's gains in all units that the drive uses."""
    table = rows(gains_of(tuning.complete(outcome.stage), {})) if outcome.stage else []
    return ", ".join(f"{symbol} = {value}{f' ({others})' if others else ''}" for _, (symbol, value, others) in table)
