"""The masses begin displaced and are released; the reference stands still."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

import numpy as np

from friso.quantities import Quantity, Value, any_sign
from friso.stage.rig import Motion, register_motion

DISPLACEMENT = "motion.displacement"


@register_motion
class Release(Motion):
    """Everything displaced and at rest, the reference 0."""

    kind: Literal["release"]
    displacement: Annotated[Value, Quantity("m", any_sign, "2 mm")]

    @staticmethod
    def motion_size(flat: Mapping[str, Any]) -> Any:
        """Return the initial displacement of the masses [m]."""
        return np.abs(flat[DISPLACEMENT])

    @staticmethod
    def initial_displacement(flat: Mapping[str, Any]) -> Any:
        """Return the position from which the masses are released [m]."""
        return flat[DISPLACEMENT]

    @staticmethod
    def stretched(flat: Mapping[str, Any], factor: Any) -> Mapping[str, Any]:
        """Return the displacement of a motion that is larger by a factor, by key [SI].

        The result is empty for a displacement of 0.
        """
        return {DISPLACEMENT: flat[DISPLACEMENT] * factor} if np.any(flat[DISPLACEMENT]) else {}
