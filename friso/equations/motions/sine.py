"""A reference that swings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal

from friso.quantities import Quantity, Value, positive
from friso.stage.rig import Motion, ReferenceForm, Tone, register_motion

AMPLITUDE, FREQUENCY = "motion.amplitude", "motion.frequency"


@register_motion
class Sine(Motion):
    """The reference swings about 0, forward at first."""

    kind: Literal["sine"]
    amplitude: Annotated[Value, Quantity("m", positive, "1 mm")]
    frequency: Annotated[Value, Quantity("Hz", positive, "2 Hz")]

    rests = False

    @staticmethod
    def form(flat: Mapping[str, Any]) -> ReferenceForm:
        """Say that the reference consists of one sinusoid."""
        return ReferenceForm(tones=1)

    @staticmethod
    def tones(flat: Mapping[str, Any]) -> Sequence[Tone]:
        """Return the sinusoid."""
        return [Tone(flat[AMPLITUDE], 0.0, flat[FREQUENCY])]

    @staticmethod
    def motion_size(flat: Mapping[str, Any]) -> Any:
        """Return the amplitude [m]."""
        return flat[AMPLITUDE]

    @staticmethod
    def period(flat: Mapping[str, Any]) -> float | None:
        """Return the period [s]."""
        return 1 / flat[FREQUENCY]
