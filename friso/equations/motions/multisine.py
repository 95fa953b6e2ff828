"""A reference that is the sum of several swings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from math import lcm, pi
from typing import Annotated, Any, ClassVar, Literal

from friso.equations.motions.settings import MotionSettings
from friso.quantities import Quantity, any_sign, positive
from friso.stage.rig import DURATION, Motion, ReferenceForm, Tone, register_motion
from friso.stage.section import Rule, Several, Values, element_keys
from friso.stage.tables import TIME_ROUNDING

AMPLITUDE, FREQUENCY, PHASE = (f"motion.{name}" for name in ("amplitude", "frequency", "phase"))


def _numbers(flat: Mapping[str, Any], key: str) -> list[Any]:
    return [flat[name] for name in element_keys(flat, key)]


_MOST = MotionSettings().most_tones


@register_motion
class Multisine(Motion):
    """The reference is a sum of sinusoids."""

    kind: Literal["multisine"]
    amplitude: Annotated[Values, Several(Quantity("m", positive, "1 mm"), ("1 mm", "0.5 mm"), 2, _MOST)]
    frequency: Annotated[Values, Several(Quantity("Hz", positive, "1 Hz"), ("1 Hz", "3 Hz"), 2, _MOST)]
    phase: Annotated[Values | None, Several(Quantity("rad", any_sign, "0 deg"), ("0 deg", "90 deg"), 2, _MOST)] = None
    """Phases at time 0; default: 0."""

    rests = False
    rules: ClassVar[tuple[Rule, ...]] = (
        Rule(
            (AMPLITUDE, FREQUENCY, PHASE),
            lambda f: (
                len(_numbers(f, AMPLITUDE)) == len(_numbers(f, FREQUENCY))
                and len(_numbers(f, PHASE)) in (0, len(_numbers(f, FREQUENCY)))
            ),
            "as many amplitudes as frequencies, and as many phases, if any",
            'amplitude = ["1 mm", "0.5 mm"], frequency = ["1 Hz", "3 Hz"]',
        ),
    )

    @staticmethod
    def form(flat: Mapping[str, Any]) -> ReferenceForm:
        """Say of how many sinusoids the reference consists: one for each frequency."""
        return ReferenceForm(tones=len(_numbers(flat, FREQUENCY)))

    @staticmethod
    def tones(flat: Mapping[str, Any]) -> Sequence[Tone]:
        """Return the sinusoids."""
        amplitudes, frequencies = _numbers(flat, AMPLITUDE), _numbers(flat, FREQUENCY)
        phases = _numbers(flat, PHASE) or [0.0] * len(frequencies)
        return [Tone(a, phase / (2 * pi), f) for a, f, phase in zip(amplitudes, frequencies, phases, strict=True)]

    @staticmethod
    def motion_size(flat: Mapping[str, Any]) -> Any:
        """Return the sum of the amplitudes [m]."""
        return sum(_numbers(flat, AMPLITUDE))

    @staticmethod
    def period(flat: Mapping[str, Any]) -> float | None:
        """Return the time [s] after which all sinusoids repeat.

        The result is None if they never repeat together, or only after more than the duration.
        """
        first, *others = (float(frequency) for frequency in _numbers(flat, FREQUENCY))
        most = max(1, int(first * flat[DURATION]))
        ratios = [Fraction(other / first).limit_denominator(most) for other in others]
        exact = all(
            abs(other / first - ratio) <= TIME_ROUNDING * ratio for other, ratio in zip(others, ratios, strict=True)
        )
        periods = lcm(*(ratio.denominator for ratio in ratios))
        return periods / first if exact and periods <= most else None
