"""Catalogue of a drive's settings against friction.

The catalogue lists the effect of each setting, its values for a machine, and the ranges in which it is tuned. The keys
of settings are declared in `friso.stage.controllers`, their equations in `continuous` and `sampled`. `friso compare
--also` tries one value of each setting; `friso tune` searches their ranges.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import pi, sqrt
from typing import Any

import numpy as np

from friso.equations.breakaway import breakaway, sliding
from friso.equations.continuous import slow_gains
from friso.errors import InputError
from friso.quantities import quoted
from friso.stage.controllers import INNER_WINDOWS, SCHEDULES, ControllerSection, controller_of, settings_of
from friso.stage.lists import element_keys
from friso.stage.tables import moving_mass

FlatMachine = Mapping[str, Any]
Sizes = Callable[[FlatMachine, float], dict[str, float]]
Ranges = Callable[[FlatMachine, float], dict[str, tuple[float, float]]]
"""Function of a stage's keys in SI and the position tolerance [m].

It returns values [SI], or ends of ranges, by name in the table [controller].
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

    `name` names it in words, and `says` tells its effect in words, with names of its keys in braces for their values.
    `integral` is true if it needs an integral. `sizes` computes values of its keys for a machine, and `tuned_in` the
    ranges in which it is tuned (None: it is not tuned).
    """

    name: str
    says: str
    integral: bool
    sizes: Sizes
    tuned_in: Ranges | None = None

    def numbers(self, flat: FlatMachine, within: float) -> dict[str, float]:
        """Compute the setting's keys in a stage file and their values [SI], for a machine.

        `within` [m] is the position tolerance.
        """
        return {ControllerSection.key(name): value for name, value in self.sizes(flat, within).items()}

    def ranges(self, flat: FlatMachine, within: float) -> dict[str, tuple[float, float]]:
        """Compute the setting's keys and the ranges [SI] in which they are tuned, for a machine.

        `within` [m] is the position tolerance. The result is empty if the setting is not tuned.
        """
        if self.tuned_in is None:
            return {}
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


def _leak(flat: FlatMachine, within: float) -> dict[str, float]:
    proportional, integral = slow_gains(flat)
    return {"integral_leak": integral / proportional / (2 * pi) / 10}


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


def _dither(flat: FlatMachine, within: float) -> dict[str, float]:
    return {
        "dither_amplitude": 0.5 * float(sliding(flat)),
        "dither_frequency": min(10 * _own_frequency(flat), 1 / (20 * flat["drive.sample_time"])),
    }


SETTINGS: Mapping[str, Setting] = {
    "limit": Setting(
        "integral limit",
        "the force that an integral holds stays below {integral_limit}",
        True,
        lambda flat, _: {"integral_limit": 1.2 * float(breakaway(flat))},
        _limits,
    ),
    "leak": Setting("leak of the integral", "the integral leaks below {integral_leak}", True, _leak, _leaks),
    "hysteresis": Setting(
        "deadband with hysteresis",
        "the integrator pauses from an error of {integral_deadband} on, until it is {integral_deadband_exit}",
        True,
        lambda _, within: {"integral_deadband": 0.5 * within, "integral_deadband_exit": 2 * within},
        lambda _, within: {
            "integral_deadband": _scaled(within, DEADBANDS),
            "integral_deadband_exit": _scaled(within, EXITS),
        },
    ),
    "standstill": Setting(
        "gains at standstill",
        "all gains times {standstill_factor} while the error is below {standstill_window}",
        False,
        lambda _, within: {"standstill_window": 5 * within, "standstill_factor": 0.5},
        _standstill,
    ),
    "push": Setting(
        "push",
        "a force of {stiction_push} towards the reference while that rests and the error is above "
        "{stiction_push_window}",
        False,
        lambda flat, within: {"stiction_push": 0.8 * float(sliding(flat)), "stiction_push_window": within},
    ),
    "dither": Setting(
        "dither", "a sinusoidal force of {dither_amplitude} at {dither_frequency}", False, _dither, _dithers
    ),
}
"""All settings against friction, by name. Sizes are our choice: an integral that can just break the machine loose; a
leak at a tenth of the integral's corner; integrals that pause within half the tolerance until the error exceeds twice
the tolerance; half the gains within five tolerances; a push of four fifths of Coulomb friction outside the tolerance;
and a dither of half of Coulomb friction at ten times the bandwidth, or with twenty samples a period."""


def settings_named(names: tuple[str, ...], others: tuple[str, ...] = ()) -> tuple[Setting, ...]:
    """Return the settings against friction with these names; "all" stands for all of them.

    `others` are further names that are allowed and select none. Raises InputError for an unknown name.
    """
    names_of_all = (*SETTINGS, *others)
    for name in names:
        if name not in (*names_of_all, "all"):
            raise InputError("--also", quoted(name), f"one of {', '.join(names_of_all)}, or all", "--also leak")
    return tuple(setting for name, setting in SETTINGS.items() if name in names or "all" in names)
