"""No friction at all."""

from __future__ import annotations

from typing import Literal

from friso.stage import FrictionSection, register_friction


@register_friction
class NoFriction(FrictionSection):
    """A bearing without friction, such as an air bearing."""

    model: Literal["none"]
