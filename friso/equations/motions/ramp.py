"""The reference moves at constant speed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal

import numpy as np

from friso.quantities import Quantity, Value, any_sign
from friso.stage.rig import DURATION, Motion, Piece, register_motion

VELOCITY = "motion.velocity"


@register_motion
class Ramp(Motion):
    """The reference moves at constant velocity."""

    kind: Literal["ramp"]
    velocity: Annotated[Value, Quantity("m/s", any_sign, "0.1 m/s")]

    rests = False

    @staticmethod
    def pieces(flat: Mapping[str, Any]) -> Sequence[Piece]:
        """Return the one piece of the reference: constant velocity, from position 0 at time 0."""
        return [(0.0, 0.0, flat[VELOCITY], 0.0)]

    @staticmethod
    def motion_size(flat: Mapping[str, Any]) -> Any:
        """Return the distance that the reference travels [m]."""
        return np.abs(flat[VELOCITY] * flat[DURATION])
