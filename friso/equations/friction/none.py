"""No friction at all."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Literal

from friso.stage import FrictionSection, register_friction

if TYPE_CHECKING:
    import sympy as sp


@register_friction
class NoFriction(FrictionSection):
    """A bearing without friction, such as an air bearing."""

    model: Literal["none"]

    @staticmethod
    def variant(flat: Mapping[str, Any]) -> None:
        return None

    @staticmethod
    def declare(velocity: sp.Symbol, variant: None) -> None:
        return None
