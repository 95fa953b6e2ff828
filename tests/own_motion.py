"""A motion that is declared outside friso: a polynomial and a tone."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal

from friso.quantities import Quantity, Value, any_sign, positive
from friso.stage.rig import Motion, Piece, ReferenceForm, Tone, register_motion


@register_motion
class Spiral(Motion):
    """The reference swings about a place that moves on."""

    kind: Literal["spiral"]
    radius: Annotated[Value, Quantity("m", positive, "1 mm")]
    turn: Annotated[Value, Quantity("Hz", positive, "4 Hz")]
    drift: Annotated[Value, Quantity("m/s", any_sign, "1 mm/s")]

    rests = False

    @staticmethod
    def form(flat: Mapping[str, Any]) -> ReferenceForm:
        return ReferenceForm(tones=1)

    @staticmethod
    def pieces(flat: Mapping[str, Any]) -> Sequence[Piece]:
        return [(0.0, 0.0, flat["motion.drift"], 0.0)]

    @staticmethod
    def tones(flat: Mapping[str, Any]) -> Sequence[Tone]:
        return [Tone(flat["motion.radius"], 0.0, flat["motion.turn"])]

    @staticmethod
    def motion_size(flat: Mapping[str, Any]) -> Any:
        return flat["motion.radius"]
