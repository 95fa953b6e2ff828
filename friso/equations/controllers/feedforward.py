"""Describe the feedforward terms of controllers in tables of gains and in drawings of loops."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from friso.stage import ControllerSection
from friso.stage.tables import moving_mass

SYMBOLS: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "acceleration_feedforward": ("feedforward of acceleration", "m"),
        "jerk_feedforward": ("feedforward of jerk", "mj"),
        "viscous_feedforward": ("feedforward of viscous friction", "d"),
        "coulomb_feedforward": ("feedforward of Coulomb friction", "Fc"),
    }
)

TERMS = {
    "acceleration_feedforward": "m d²r/dt²",
    "jerk_feedforward": "mj d³r/dt³",
    "viscous_feedforward": "d dr/dt",
    "coulomb_feedforward": "Fc sign(dr/dt)",
}


def fed_forward(flat: Mapping[str, Any]) -> str:
    """Return the feedforward terms of a controller in words; "" without any."""
    return " + ".join(term for name, term in TERMS.items() if flat.get(ControllerSection.key(name)))


def feedforward_of_moves(flat: Mapping[str, Any], *names: str) -> dict[str, float]:
    """Return the feedforward that moving mass and viscous friction require, by key [SI].

    `names` are the feedforward keys that the controller can have. Only keys among these whose value is not 0, and that
    the stage does not set yet, are in the result.
    """
    needed = {"acceleration_feedforward": moving_mass(flat), "viscous_feedforward": flat.get("friction.viscous", 0.0)}
    return {
        ControllerSection.key(name): float(value)
        for name, value in needed.items()
        if name in names and value and not flat.get(ControllerSection.key(name))
    }
