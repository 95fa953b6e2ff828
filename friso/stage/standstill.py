"""Declare the keys of [controller] against friction, which any controller may have."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, NamedTuple, Self

import numpy as np
from pydantic import model_validator

from friso.errors import StageError
from friso.quantities import Number, Quantity, Value, non_negative, positive
from friso.stage.section import UncertainSection


class AgainstFriction(UncertainSection):
    """Settings of a drive against friction."""

    kind: Any
    integral_limit: Annotated[Value | None, Quantity("N", positive, "2 N")] = None
    """Largest force that each integral holds."""
    integral_leak: Annotated[Value | None, Quantity("Hz", positive, "0.1 Hz")] = None
    """Corner frequency below which an integral acts as a low-pass."""
    error_deadband: Annotated[Value | None, Quantity("m", positive, "1 um")] = None
    """Amount by which the error is reduced, at most to 0, before anything acts on it."""
    integral_deadband: Annotated[Value | None, Quantity("m", positive, "1 um")] = None
    """Error below which integrals pause."""
    integral_deadband_exit: Annotated[Value | None, Quantity("m", positive, "3 um")] = None
    """Larger error at which paused integrals continue; default: the deadband itself."""
    integral_reset: bool | None = None
    """Whether integrals restart when the error changes sign."""
    standstill_window: Annotated[Value | None, Quantity("m", positive, "5 um")] = None
    """Error below which the gains are multiplied by `standstill_factor`; integrals keep their force."""
    standstill_factor: Annotated[float | None, Number(positive, "0.5")] = None
    stiction_push: Annotated[Value | None, Quantity("N", positive, "1 N")] = None
    """Force towards the reference while the reference rests and the error exceeds `stiction_push_window`."""
    stiction_push_window: Annotated[Value | None, Quantity("m", non_negative, "2 um")] = None
    dither_amplitude: Annotated[Value | None, Quantity("N", positive, "0.5 N")] = None
    """Amplitude of a sinusoidal force, whose phase is 0 at every corner of the reference."""
    dither_frequency: Annotated[Value | None, Quantity("Hz", positive, "200 Hz")] = None

    @model_validator(mode="after")
    def _settings_are_whole(self) -> Self:
        for first, second in PAIRS:
            for key, other in ((first, second), (second, first)):
                if getattr(self, key) is not None and getattr(self, other) is None:
                    raise StageError(other, "nothing", f"what belongs to {key}", EXAMPLES[other])
        if self.integral_deadband_exit is not None and self.integral_deadband is None:
            key = "integral_deadband"
            raise StageError(key, "nothing", "what belongs to integral_deadband_exit", EXAMPLES[key])
        return self


PAIRS = (
    ("standstill_window", "standstill_factor"),
    ("stiction_push", "stiction_push_window"),
    ("dither_amplitude", "dither_frequency"),
)
"""Keys that must be given together."""

EXAMPLES = {
    "integral_deadband": 'integral_deadband = "1 um"',
    "standstill_window": 'standstill_window = "5 um"',
    "standstill_factor": "standstill_factor = 0.5",
    "stiction_push": 'stiction_push = "1 N"',
    "stiction_push_window": 'stiction_push_window = "2 um"',
    "dither_amplitude": 'dither_amplitude = "0.5 N"',
    "dither_frequency": 'dither_frequency = "200 Hz"',
}


class FrictionSettings(NamedTuple):
    """Which settings against friction a controller has."""

    limit: bool = False
    leak: bool = False
    deadband: bool = False
    hysteresis: bool = False
    reset: bool = False
    gains: bool = False
    push: bool = False
    dither: bool = False
    dead_zone: bool = False


NO_SETTINGS = FrictionSettings()


def settings_of(flat: Mapping[str, Any]) -> FrictionSettings:
    """Return which settings against friction a stage's controller has; `flat` has its keys."""
    names = ("integral_limit", "integral_leak", "integral_deadband", "integral_deadband_exit")
    limit, leak, deadband, hysteresis = (f"controller.{name}" in flat for name in names)
    gains, push, dither = (f"controller.{first}" in flat for first, _ in PAIRS)
    reset = bool(flat.get("controller.integral_reset", False))
    dead_zone = "controller.error_deadband" in flat
    return FrictionSettings(limit, leak, deadband, hysteresis, reset, gains, push, dither, dead_zone)


def dead_band(flat: Mapping[str, Any]) -> Any:
    """Return the error [m] up to which the controller exerts no force; 0 without a dead zone."""
    return flat.get("controller.error_deadband", 0.0)


def integral_leak(flat: Mapping[str, Any]) -> Any:
    """Return the frequency [Hz] below which integrals leak; 0 without a leak."""
    own = flat.get("controller.parts.leak", 0.0) * flat.get("controller.speed", 1.0) / (2 * np.pi)
    return flat.get("controller.integral_leak", 0.0) + own
