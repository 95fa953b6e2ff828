"""The reference jumps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal

import numpy as np

from friso.quantities import Quantity, Value, any_sign
from friso.stage.rig import Motion, Piece, register_motion

SIZE = "motion.size"


@register_motion
class Step(Motion):
    """The reference jumps at the start."""

    kind: Literal["step"]
    size: Annotated[Value, Quantity("m", any_sign, "1 mm")]

    @staticmethod
    def pieces(flat: Mapping[str, Any]) -> Sequence[Piece]:
        """Return the one piece of the reference: it stands at the end of the step from the start."""
        return [(0.0, flat[SIZE], 0.0, 0.0)]

    @staticmethod
    def motion_size(flat: Mapping[str, Any]) -> Any:
        """Return the size of the step [m]."""
        return np.abs(flat[SIZE])

    @staticmethod
    def stretched(flat: Mapping[str, Any], factor: Any) -> Mapping[str, Any]:
        """Return the size of a step that is larger by a factor, by key [SI].

        The result is empty for a step of 0.
        """
        return {SIZE: flat[SIZE] * factor} if np.any(flat[SIZE]) else {}
