"""Settings against friction that drives have, each as a further option, sized by the machine of the stage file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import pi, sqrt
from typing import Any

from friso.equations.breakaway import breakaway, sliding
from friso.equations.continuous import slow_gains
from friso.errors import InputError
from friso.quantities import quoted
from friso.stage.controllers import CONTROLLER
from friso.stage.transmission import moving_mass

Sizes = Callable[[Mapping[str, Any], float], dict[str, float]]


@dataclass(frozen=True)
class Setting:
    """A setting: the `letter` and `name` of the option, whether it needs an integral, and its keys in [controller] for
    the flat keys of a stage and the tolerance for being in position [m]."""

    letter: str
    name: str
    integral: bool
    keys: Sizes

    def numbers(self, flat: Mapping[str, Any], within: float) -> dict[str, float]:
        """Its keys in a stage file, and their values [SI]."""
        return {f"{CONTROLLER}.{key}": value for key, value in self.keys(flat, within).items()}


def _leak(flat: Mapping[str, Any], within: float) -> dict[str, float]:
    proportional, integral = slow_gains(flat)
    return {"integral_leak": integral / proportional / (2 * pi) / 10}


def _dither(flat: Mapping[str, Any], within: float) -> dict[str, float]:
    proportional, _ = slow_gains(flat)
    fast = 10 * sqrt(proportional / moving_mass(flat)) / (2 * pi)
    return {
        "dither_amplitude": 0.5 * float(sliding(flat)),
        "dither_frequency": min(fast, 1 / (20 * flat["drive.sample_time"])),
    }


SETTINGS: Mapping[str, Setting] = {
    "limit": Setting("h", "integral limit", True, lambda f, _: {"integral_limit": 1.2 * float(breakaway(f))}),
    "leak": Setting("i", "leak", True, _leak),
    "hysteresis": Setting(
        "j", "hysteresis", True, lambda _, w: {"integral_deadband": 0.5 * w, "integral_deadband_exit": 2 * w}
    ),
    "standstill": Setting(
        "k", "standstill gain", False, lambda _, w: {"standstill_window": 5 * w, "standstill_factor": 0.5}
    ),
    "push": Setting(
        "l", "push", False, lambda f, w: {"stiction_push": 0.8 * float(sliding(f)), "stiction_push_window": w}
    ),
    "dither": Setting("m", "dither", False, _dither),
}
"""Sizes are our choice: an integral that can just break the machine loose; a leak at a tenth of the integral's corner;
integrals that pause within half the tolerance until twice the tolerance is exceeded; half the gains within five
tolerances; a push of four fifths of Coulomb friction outside the tolerance; a dither of half of it at ten times the
bandwidth, or with twenty samples a period."""


def settings_named(names: tuple[str, ...]) -> tuple[Setting, ...]:
    """Settings by their names, "all" for all of them. Raises InputError for an unknown one."""
    for name in names:
        if name != "all" and name not in SETTINGS:
            raise InputError("--also", quoted(name), f"one of {', '.join(SETTINGS)}, or all", "--also leak")
    return tuple(setting for name, setting in SETTINGS.items() if name in names or "all" in names)
