"""The reference stays where the stage is."""

from typing import Literal

from friso.stage.rig import Motion, register_motion


@register_motion
class Hold(Motion):
    """The reference stays 0."""

    kind: Literal["hold"]
