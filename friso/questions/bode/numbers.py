"""Write the numbers of a linear analysis as texts for the table.

Each row names a quantity and has its text for each state.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import get_args

import numpy as np

from friso.frequency.bode import CascadeLoop
from friso.frequency.margins import Margins
from friso.questions.bode.states import ShownState
from friso.shown.text import NOTHING, with_unit

OF_LOOPS = ("Stable", "0 dB crossings", "Phase margin", "Gain margin", "Modulus margin")
"""Names of the rows of each loop of a cascade."""

ANY = "no limit"
"""Text of a margin that is unlimited, because nothing brings the loop to the edge of stability."""


def rows(states: tuple[ShownState, ...]) -> list[tuple[str, list[str]]]:
    """Return the rows of the table, one text for each state; rows without entries are left out."""
    texts = [("State", [item.where or NOTHING for item in states])]
    texts += [(name, [text(item.margins) for item in states]) for name, text in _ROWS.items()]
    for loop in get_args(CascadeLoop):
        texts += [
            (f"{loop.capitalize()} loop: {name[0].lower()}{name[1:]}", [_of_loop(item, loop, name) for item in states])
            for name in OF_LOOPS
        ]
    return [(name, row) for name, row in texts if set(row) != {NOTHING}]


def _of_loop(item: ShownState, loop: CascadeLoop, name: str) -> str:
    """Write the entry of the row `name` for one loop of a cascade."""
    return _ROWS[name](item.loops[loop]) if loop in item.loops else NOTHING


def decibels(factor: float) -> float:
    """Convert a factor on an amplitude to decibels: 10 is 20 dB."""
    return 20 * math.log10(factor)


def growth(margins: Margins) -> str:
    """Say how fast a deviation from an unstable state grows.

    On the edge of stability it neither decays nor grows.
    """
    if margins.on_the_edge:
        return "neither decays nor grows"
    pole = margins.poles[margins.poles.real.argmax()]
    swings = f", swinging at {with_unit(abs(pole.imag) / (2 * np.pi), 'Hz')}" if pole.imag else ""
    return f"grows e-fold in {with_unit(1 / pole.real, 's')}{swings}"


def _number(value: float, none: float, text: Callable[[float], str]) -> str:
    """Write a margin by `text`; a dash if it is NaN.

    `none` is the value of a margin that allows any change; the text then says so.
    """
    if math.isnan(value):
        return NOTHING
    return ANY if value == none else text(value)


def _factor(value: float) -> str:
    """Write a gain margin, given as a factor, in dB with its sign."""
    return _signed(decibels(value), "+")


def _signed(size: float, sign: str = "") -> str:
    """Write a number in dB, never as minus zero; `sign` = "+" adds a plus."""
    return f"{round(size, 1) + 0.0:{sign}.1f} dB".replace("-", "−")


def _peak(margins: Margins) -> str:
    """Write the peak sensitivity as a factor and in dB."""
    peak = margins.peak_sensitivity
    return f"{peak:.3g} ({_signed(decibels(peak))})" if margins.stable else NOTHING


def _slowest(margins: Margins) -> str:
    """Write the time constant of the slowest pole [s]."""
    return with_unit(-1 / margins.abscissa, "s") if margins.stable else NOTHING


def _least_damped(margins: Margins) -> str:
    """Write the damping ratio and the frequency of the least damped pole."""
    swinging = margins.poles[margins.poles.imag != 0]
    if not margins.stable or not swinging.size:
        return NOTHING
    damping = -swinging.real / np.abs(swinging)
    k = int(damping.argmin())
    return f"ζ = {damping[k]:.2g} at {with_unit(abs(swinging[k]) / (2 * np.pi), 'Hz')}"


_ROWS: dict[str, Callable[[Margins], str]] = {
    "Stable": lambda margins: "yes" if margins.stable else ("on the edge" if margins.on_the_edge else "no"),
    "0 dB crossings": lambda margins: ", ".join(with_unit(f, "Hz") for f in margins.crossovers) or "none",
    "Phase margin": lambda margins: _number(margins.phase_margin, math.inf, "{:.1f}°".format),
    "Gain margin": lambda margins: _number(margins.gain_margin, math.inf, _factor),
    "Gain margin downwards": lambda margins: _number(margins.gain_reduction, 0.0, _factor),
    "Delay margin": lambda margins: _number(margins.delay_margin, math.inf, lambda time: with_unit(time, "s")),
    "Modulus margin": lambda margins: _number(margins.modulus_margin, math.inf, "{:.3g}".format),
    "Peak sensitivity": _peak,
    "Closest to −1": lambda margins: with_unit(margins.closest, "Hz"),
    "Slowest time constant": _slowest,
    "Least damped pole": _least_damped,
    "Unstable": lambda margins: NOTHING if margins.stable else growth(margins),
}
