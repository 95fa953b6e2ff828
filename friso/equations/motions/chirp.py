"""A reference that swings ever faster, or ever more slowly."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal

from friso.quantities import Quantity, Value, non_negative, positive
from friso.stage.rig import DURATION, Motion, ReferenceForm, Tone, register_motion

AMPLITUDE, START, END = (f"motion.{name}" for name in ("amplitude", "start_frequency", "end_frequency"))


@register_motion
class Chirp(Motion):
    """The reference swings about 0; its frequency changes evenly over the duration."""

    kind: Literal["chirp"]
    amplitude: Annotated[Value, Quantity("m", positive, "1 mm")]
    start_frequency: Annotated[Value, Quantity("Hz", non_negative, "0.5 Hz")]
    end_frequency: Annotated[Value, Quantity("Hz", positive, "20 Hz")]

    rests = False

    @staticmethod
    def form(flat: Mapping[str, Any]) -> ReferenceForm:
        """Say that the reference consists of one sinusoid."""
        return ReferenceForm(tones=1)

    @staticmethod
    def tones(flat: Mapping[str, Any]) -> Sequence[Tone]:
        """Return the sinusoid, with its changing frequency."""
        return [Tone(flat[AMPLITUDE], 0.0, flat[START], (flat[END] - flat[START]) / flat[DURATION])]

    @staticmethod
    def motion_size(flat: Mapping[str, Any]) -> Any:
        """Return the amplitude [m]."""
        return flat[AMPLITUDE]
