"""The gains of a controller, in words and numbers that the terminal and the page share."""

from __future__ import annotations

from friso.drives.gains import Gains
from friso.interface.answer import AnswerTable

COLUMNS = ("Symbol", "In this file", "In other units")

DIGITS = 4
"""Significant digits of gains for people; parameters of a drive have all that they need."""


def title(gains: Gains) -> str:
    """The stage."""
    return f"Gains of {gains.stage.name or 'the stage'}"


def sentences(gains: Gains) -> list[str]:
    """The gains as they are typed into a drive, each in one of its units, and what to know of them."""
    typed = [f"{row.symbol} = {_with_unit(row.values[min(1, len(row.values) - 1)])}" for row in gains.conversions]
    return [f"{title(gains)}, in units of drives: {', '.join(typed)}.", *(f"{note}." for note in notes(gains))]


def rows(gains: Gains) -> list[tuple[str, list[str]]]:
    """Each gain with its symbol and its values."""
    return [
        (row.name, [row.symbol, _with_unit(row.values[0]), "; ".join(map(_with_unit, row.values[1:]))])
        for row in gains.conversions
    ]


def notes(gains: Gains) -> list[str]:
    """What to know of the numbers."""
    texts = []
    if not any("at the motor" in unit or "turn" in unit for row in gains.conversions for _, unit in row.values):
        texts.append('Units of a motor are added by --set travel_per_turn="10 mm" (or a [transmission])')
    if gains.kind is not None:
        texts.append(f"Parameters by the formulas of {gains.kind.firmware} ({gains.kind.source})")
        if gains.not_held:
            texts.append(f"Not among them: {', '.join(gains.not_held)}")
    return texts


def _with_unit(value: tuple[float, str]) -> str:
    number, unit = value
    rounded = float(f"{number:.{DIGITS}g}")
    return f"{rounded:.10g} {unit}".rstrip()


def tables(gains: Gains) -> list[AnswerTable]:
    """Each gain with its symbol and its values."""
    return [AnswerTable(title(gains), COLUMNS, rows(gains))]


def blocks(gains: Gains) -> list[str]:
    """The loop drawn, and the parameters of a drive."""
    return [text for text in (gains.diagram, gains.text) if text]
