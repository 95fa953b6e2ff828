"""Catalogue of a drive's settings against friction.

The catalogue lists the ranges in which `friso tune` searches each setting. The keys of settings are declared in
`friso.stage.controllers`, their equations in `continuous` and `sampled`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import pi, sqrt
from typing import Any

import numpy as np

from friso.equations.bandwidth import breakaway, sliding
from friso.equations.continuous import slow_gains
from friso.stage.controllers import INNER_WINDOWS, SCHEDULES, ControllerSection, controller_of, settings_of
from friso.stage.section import element_keys
from friso.stage.tables import moving_mass

FlatMachine = Mapping[str, Any]
Ranges = Callable[[FlatMachine, float], dict[str, tuple[float, float]]]
"""Function of a stage's keys in SI and the position tolerance [m].

It returns ends of ranges [SI], by name in the table [controller].
"""

LIMITS, LEAKS = (0.05, 2.0), (1e-3, 0.3)
"""Ranges of the integral limit, relative to break-away friction, and of the leak, relative to the bandwidth.

Where no key states a bandwidth, the leak is relative to 1 Hz."""

DEADBANDS, EXITS = (0.1, 0.9), (1.0, 10.0)
"""Ranges of the deadband, and of the error that ends it, relative to the tolerance."""

WINDOWS, FACTORS = (0.5, 100.0), (0.05, 4.0)
"""Ranges of the standstill window, relative to the tolerance, and of the factor on the gains within it."""

AMPLITUDES, FREQUENCIES = (0.1, 1.5), (3.0, 30.0)
"""Ranges of a dither's amplitude, relative to sliding friction, and of its frequency, relative to the natural frequency
of the mass on the loop's stiffness."""


@dataclass(frozen=True)
class Setting:
    """A setting of a controller against friction.

    `name` names it in words. `integral` is true if it needs an integral. `tuned_in` computes the ranges in which its
    keys are tuned.
    """

    name: str
    integral: bool
    tuned_in: Ranges

    def ranges(self, flat: FlatMachine, within: float) -> dict[str, tuple[float, float]]:
        """Compute the setting's keys and the ranges [SI] in which they are tuned, for a machine.

        `within` [m] is the position tolerance.
        """
        return {ControllerSection.key(name): ends for name, ends in self.tuned_in(flat, within).items()}


def gain_states(flat: FlatMachine) -> list[FlatMachine]:
    """Return a stage's keys once for each set of gains that its loop may have.

    The first set is that far from the reference at rest, the last that at the reference. A standstill window, a factor
    in moves and the points of a schedule add sets.
    """
    return [state for _, state in _sets_of_gains(flat)]


def named_gains(flat: FlatMachine) -> dict[str, FlatMachine]:
    """Return the keys of `gain_states` by words on the gains; "" for those far from the reference at rest."""
    return dict(_sets_of_gains(flat))


def _sets_of_gains(flat: FlatMachine) -> list[tuple[str, FlatMachine]]:
    controller, schedules = controller_of(flat), tuple(map(ControllerSection.key, (*SCHEDULES, "schedule_factor")))
    in_loop = INNER_WINDOWS in settings_of(flat)
    slow = controller.position_loop
    gain = [name for name in slow if name not in controller.integral_gain] if in_loop else controller.loop_gain
    plain = {key: value for key, value in flat.items() if not key.startswith(schedules)}
    far, *nearer = [flat[key] for key in element_keys(flat, schedules[-1])][::-1] or [1.0]
    moving = flat.get(ControllerSection.key("moving_factor"), 1.0)
    in_moves = [moving * factor for factor in (far, *nearer) if moving != 1]
    inner = flat.get(ControllerSection.key("standstill_factor"))
    near = [] if inner is None else [inner * (far, *nearer)[-1]]
    states = [
        {**plain, **{key: factor * flat[key] for key in map(controller.key, gain)}}
        for factor in (far, *in_moves, *nearer, *near)
    ]
    names = ["", *(f"{factor:.3g} times the gains, in moves" for factor in in_moves)]
    names += [*(f"{factor:.3g} times the gains" for factor in nearer), *("the gains of standstill" for _ in near)]
    if inner is not None:
        own = flat.get(ControllerSection.key("standstill_integral_factor"), inner) / inner
        for name, power in controller.integral_gain.items():
            if (key := controller.key(name)) in flat and (name in slow or not in_loop):
                states[-1][key] = states[-1][key] * np.power(own, float(power))
    return [*zip(names, states, strict=True)]


def _scaled(scale: float, ends: tuple[float, float]) -> tuple[float, float]:
    low, high = ends
    return scale * low, scale * high


def _limits(flat: FlatMachine, within: float) -> dict[str, tuple[float, float]]:
    return {"integral_limit": _scaled(float(breakaway(flat)), LIMITS)}


def _leaks(flat: FlatMachine, within: float) -> dict[str, tuple[float, float]]:
    stated = controller_of(flat).bandwidth_key
    return {"integral_leak": _scaled(flat[stated] if stated else 1.0, LEAKS)}


def _standstill(flat: FlatMachine, within: float) -> dict[str, tuple[float, float]]:
    return {"standstill_window": _scaled(within, WINDOWS), "standstill_factor": FACTORS}


def _dithers(flat: FlatMachine, within: float) -> dict[str, tuple[float, float]]:
    if _own_frequency(flat) <= 0:
        return {}
    return {
        "dither_amplitude": _scaled(float(sliding(flat)), AMPLITUDES),
        "dither_frequency": _scaled(_own_frequency(flat), FREQUENCIES),
    }


def _own_frequency(flat: FlatMachine) -> float:
    """Return the natural frequency [Hz] of the moving mass on the loop's proportional stiffness.

    It is 0 without that stiffness.
    """
    proportional, _ = slow_gains(flat)
    return sqrt(max(proportional, 0.0) / moving_mass(flat)) / (2 * pi)


def _hysteresis(flat: FlatMachine, within: float) -> dict[str, tuple[float, float]]:
    return {"integral_deadband": _scaled(within, DEADBANDS), "integral_deadband_exit": _scaled(within, EXITS)}


SETTINGS: Mapping[str, Setting] = {
    "limit": Setting("integral limit", True, _limits),
    "leak": Setting("leak of the integral", True, _leaks),
    "hysteresis": Setting("deadband with hysteresis", True, _hysteresis),
    "standstill": Setting("gains at standstill", False, _standstill),
    "dither": Setting("dither", False, _dithers),
}
"""The settings against friction that are tuned, by name."""
