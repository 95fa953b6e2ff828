"""Write the gains of a controller in words and numbers that terminal and page share."""

from __future__ import annotations

from typing import Any

from friso.drives.gains import Gains
from friso.quantities import as_toml
from friso.shown.blocks import AnswerBlock
from friso.shown.documents import entries, plain_json
from friso.stage.section import numeric_fields

COLUMNS = ("Symbol", "In this file", "In other units")

GAIN_DIGITS = 4
"""Significant digits of gains in sentences; parameters of a drive are written in full."""


def title(gains: Gains) -> str:
    """Return the title, which names the stage."""
    return f"Gains of {gains.stage.name or 'the stage'}"


def sentences(gains: Gains) -> list[str]:
    """Write the gains to type into a drive, and remarks on the numbers."""
    typed = [f"{row.symbol} = {_with_unit(row.values[min(1, len(row.values) - 1)])}" for row in gains.conversions]
    return [f"{title(gains)}, in units of drives: {', '.join(typed)}.", *(f"{note}." for note in notes(gains))]


def rows(gains: Gains) -> list[tuple[str, list[str]]]:
    """Return a row for each gain: its name, symbol, first value, and its values in other units."""
    return [
        (row.name, [row.symbol, _with_unit(row.values[0]), "; ".join(map(_with_unit, row.values[1:]))])
        for row in gains.conversions
    ]


def notes(gains: Gains) -> list[str]:
    """Write remarks on the numbers: what else the controller has, missing units, formulas used, and keys left out."""
    controller = gains.stage.controller
    gains_or_kind = {"kind", *numeric_fields(type(controller))}
    others = [
        f"{key} = {_in_one_line(value)}" for key, value in controller.as_written().items() if key not in gains_or_kind
    ]
    texts = [f"Also part of the controller: {'; '.join(others)}"] if others else []
    if not any("at the motor" in unit or "turn" in unit for row in gains.conversions for _, unit in row.values):
        texts.append('Units of a motor are added by --set travel_per_turn="10 mm" (or a [transmission])')
    if not gains.stage.axis_kind.exerts and not any(
        unit.startswith("A") for row in gains.conversions for _, unit in row.values
    ):
        texts.append('Amperes are added by --set motor_constant="30 N/A" (per turn: "0.5 N*m/A"; or an [actuator])')
    if gains.kind is not None:
        texts.append(f"Parameters by the formulas of {gains.kind.firmware} ({gains.kind.source})")
        if gains.not_held:
            texts.append(f"Not among them: {', '.join(gains.not_held)}")
    return texts


def _in_one_line(value: Any) -> str:
    """Write a value of a stage file as TOML in one line, tables and arrays too."""
    if isinstance(value, dict):
        return f"{{ {', '.join(f'{key} = {_in_one_line(entry)}' for key, entry in value.items())} }}"
    return f"[{', '.join(map(_in_one_line, value))}]" if isinstance(value, list) else as_toml(value)


def _with_unit(value: tuple[float, str]) -> str:
    """Write a value with its unit, rounded for people."""
    number, unit = value
    rounded = float(f"{number:.{GAIN_DIGITS}g}")
    return f"{rounded:.10g} {unit}".rstrip()


def gain_blocks(gains: Gains) -> list[AnswerBlock]:
    """Return the blocks: what to type in, the loop to which the gains belong, the gains, and a drive's parameters."""
    parameters = [AnswerBlock(title="Parameters", text=gains.text)] if gains.text else []
    return [
        AnswerBlock(sentences=sentences(gains), numbers=lambda: export_document(gains)),
        AnswerBlock(title="The loop that these gains belong to", text=gains.diagram),
        AnswerBlock(title=title(gains), columns=COLUMNS, rows=rows(gains)),
        *parameters,
    ]


def export_document(gains: Gains) -> dict[str, Any]:
    """Return the gains of a stage in all units, and the parameters of a drive.

    Without a kind of drive, parameters and firmware are None.
    """
    return plain_json(
        {
            "stage": gains.stage.name,
            "structure": gains.diagram.splitlines(),
            "gains": [
                {
                    **entries(row, "name", "symbol"),
                    "values": [{"value": value, "unit": unit} for value, unit in row.values],
                }
                for row in gains.conversions
            ],
            "firmware": gains.kind.firmware if gains.kind else None,
            "parameters": None if gains.parameters is None else dict(gains.parameters),
            "notes": notes(gains),
        }
    )
