"""A controller made faster or slower as a whole."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def faster(flat: Mapping[str, Any], factor: Any) -> dict[str, Any]:
    """Stages whose controller is faster by a factor, all its poles and zeros and the crossover being scaled."""
    if "controller.crossover" in flat:
        return {**flat, "controller.crossover": flat["controller.crossover"] * factor}
    powers = {"kp": 2, "ki": 3, "kd": 1, "tau": -1}
    return {**flat, **{f"controller.{name}": flat[f"controller.{name}"] * factor**n for name, n in powers.items()}}
