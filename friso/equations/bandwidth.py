"""Find the bandwidth of a controller, and make the controller faster or slower as a whole."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from friso.stage import numeric_keys
from friso.stage.controllers import KIND, controller_of


def bandwidth(flat: Mapping[str, Any]) -> Any:
    """Return the bandwidth [Hz] that a controller's keys state, such as its crossover.

    The result is None if they state none, as for a controller by gains, or without a controller.
    """
    key = controller_of(flat).bandwidth_key if KIND in flat else None
    return None if key is None else flat[key]


def at_bandwidth(flat: Mapping[str, Any], bandwidth: Any) -> dict[str, Any]:
    """Return stages whose controllers are scaled to the given bandwidths [Hz].

    For a controller that states no bandwidth, `bandwidth` is a factor on its present speed.
    """
    key = controller_of(flat).bandwidth_key
    return faster(flat, bandwidth) if key is None else {**faster(flat, bandwidth / flat[key]), key: bandwidth}


def faster(flat: Mapping[str, Any], factor: Any) -> dict[str, Any]:
    """Return stages whose whole controller is faster by a factor, bandwidth included.

    All poles and zeros of the controller are multiplied by the factor. `flat` has the stages' keys in SI.
    """
    return {**flat, **sped_up(flat, factor)}


def sped_up(flat: Mapping[str, Any], factor: Any) -> dict[str, Any]:
    """Return the keys that change, with new values, when a controller is faster by a factor."""
    controller = controller_of(flat)
    powers = {controller.key(name): power for name, power in controller.speeds_up.items()}
    return {key: flat[key] * factor**power for key, power in powers.items() if key in flat}


def range_example(flat: Mapping[str, Any]) -> str:
    """Return a range of a typical key, as an example in a message.

    The key is the bandwidth if there is one, else the first gain, else a mass.
    """
    controller = controller_of(flat) if KIND in flat else None
    gains = [controller.bandwidth_key, *map(controller.key, controller.speeds_up)] if controller else []
    key = next(key for key in [*gains, "masses.stage", "masses.cart"] if key and flat.get(key))
    low, high, unit = flat[key] / 8, flat[key] * 5, getattr(numeric_keys(flat)[key], "unit", "")
    return f'{key}="{low:.3g} {unit}..{high:.3g} {unit}"' if unit else f'{key}="{low:.3g}..{high:.3g}"'


@dataclass(frozen=True)
class _Numbers:
    """A controller's keys as numbers, for `ControllerSection.stiffness`.

    That function usually gets symbols.
    """

    flat: Mapping[str, Any]

    def key(self, name: str) -> Any:
        return self.flat[controller_of(self.flat).key(name)]


def proportional_stiffness(flat: Mapping[str, Any]) -> float:
    """Return the proportional stiffness of a stage's loop [N/m]; `flat` has its keys in SI."""
    controller = controller_of(flat)
    return float(controller.stiffness(_Numbers(flat), controller.variant(flat)))
