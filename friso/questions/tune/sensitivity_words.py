"""Say which keys matter most for the edge of hunting."""

from __future__ import annotations

from friso.quantities import percent
from friso.remedies.method import Advice
from friso.remedies.sensitivities import Sensitivities
from friso.shown.drawing.prefixes import with_unit

MOST_KEYS, LEAST_EFFECT = 4, 0.02
"""Largest number of keys named, and least effect of a named key relative to the strongest."""


def sensitivity_sentences(tuning: Advice) -> list[str]:
    """Say how far 1 % of each key moves the edge of hunting of the stage as it is.

    The list is empty if derivatives of the edge were not computed.
    """
    return ranked_sentences(tuning.sensitivities) if tuning.sensitivities else []


def ranked_sentences(sensitivities: Sensitivities) -> list[str]:
    """Rank keys by how far 1 % of each moves the edge of hunting, the most important first.

    The list is empty without an edge, and if no key moves it.
    """
    ranked = sensitivities.ranked()
    if not ranked or ranked[0][1] == 0:
        return []
    largest = abs(ranked[0][1])
    named = [(key, move) for key, move in ranked[:MOST_KEYS] if abs(move) >= LEAST_EFFECT * largest]
    unit = "Hz" if sensitivities.stage.controller.bandwidth_key else ""
    parts = [f"1 % more of {key} moves it by {_signed(move, unit)}" for key, move in named]
    return [f"What matters for the edge of hunting, most first: {'; '.join(parts)}."]


def _signed(move: float, unit: str) -> str:
    """Write by how much the edge moves, in hertz or in percent of the bandwidth."""
    if not unit:
        return f"{percent(move, signed=True)} of the bandwidth"
    return f"{'+' if move > 0 else '-'}{with_unit(abs(move), unit, 2)}"
