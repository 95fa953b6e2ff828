"""The gains of a controller, in words and numbers that the terminal and the page share."""

from __future__ import annotations

from friso.drives.gains import Gains

COLUMNS = ("Symbol", "In this file", "In other units")

DIGITS = 6


def title(gains: Gains) -> str:
    """The stage."""
    return f"Gains of {gains.stage.name or 'the stage'}"


def rows(gains: Gains) -> list[tuple[str, list[str]]]:
    """Each gain with its symbol and its values."""
    return [
        (row.name, [row.symbol, _with_unit(row.values[0]), "; ".join(map(_with_unit, row.values[1:]))])
        for row in gains.conversions
    ]


def notes(gains: Gains) -> list[str]:
    """What to know of the numbers."""
    found = []
    if not gains.conversions:
        found.append("This controller is not one of friso's own: its gains have no other units than those of its file.")
    if not any("at the motor" in unit or "turn" in unit for row in gains.conversions for _, unit in row.values):
        found.append('Units of a motor are added by --set travel_per_turn="10 mm" (or a [transmission]).')
    if gains.kind is not None:
        found.append(f"Parameters by the formulas of {gains.kind.firmware} ({gains.kind.source}).")
        left = lost(gains)
        if left:
            found.append(f"Not among them: {', '.join(left)}.")
    return found


def lost(gains: Gains) -> list[str]:
    """What the stage has and the parameters have no place for."""
    flat = gains.stage.flat()
    names = (
        "integral_deadband",
        "integral_leak",
        "integral_reset",
        "standstill_factor",
        "stiction_push",
        "dither_amplitude",
    )
    left = [f"controller.{name}" for name in names if flat.get(f"controller.{name}")]
    held = " ".join(gains.parameters or ())
    taken = ["feedback"] if "encoder.config.bandwidth" in held else []
    paths = [value for key, value in flat.items() if key.startswith("controller.filters.") and key.endswith(".path")]
    filters = ["the filters"] if any(path not in taken for path in paths) else []
    return [*left, *filters, *_feedforward(gains)]


def _feedforward(gains: Gains) -> list[str]:
    """Feedforwards that are in none of the parameters."""
    flat, held = gains.stage.flat(), " ".join(gains.parameters or ())
    in_file = {"coulomb_feedforward": "no", "viscous_feedforward": "FF1", "acceleration_feedforward": "FF2"}
    if "inertia" in held:
        in_file["acceleration_feedforward"] = "inertia"
    elif flat["controller.kind"] == "cascade":
        in_file = dict.fromkeys(in_file, "no")
    if flat["controller.kind"] == "cascade":
        in_file["viscous_feedforward"] = "no"
    return [
        f"controller.{name}" for name, place in in_file.items() if flat.get(f"controller.{name}") and place not in held
    ]


def _with_unit(value: tuple[float, str]) -> str:
    number, unit = value
    return f"{number:.{DIGITS}g} {unit}".rstrip()
