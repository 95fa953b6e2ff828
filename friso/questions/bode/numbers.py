"""Name the states of a linear analysis, and write their numbers for the table.

A state has one name and one colour in every figure, sentence and table. Each row of the table names a quantity and has
its text for each state.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import get_args

import numpy as np

from friso.frequency.bode import Bode, CascadeLoop
from friso.frequency.margins import Margins
from friso.frequency.system import Members
from friso.shown.drawing.figure import BLUE, GREY, ORANGE, SKY, VERMILLION, Dash
from friso.shown.text import NOTHING, with_unit
from friso.stage.tables import leading_friction

SERIES = "-series"
"""Suffix of the name of a case whose limiter follows the series formula in Table 1 of the thesis."""

COLOURS = {"given": BLUE, "stuck": BLUE, "sliding": VERMILLION, "stuck-touched": SKY, "sliding-touched": ORANGE}
_ENDINGS = {"touched": "limiter touched", "touched-series": "limiter in series"}


@dataclass(frozen=True)
class ShownState:
    """A state of the loop with its margins, label and colour.

    `where` describes the state if the label does not. `loops` has the margins of each loop of a cascade; it is empty
    unless the state is a limit case.
    """

    label: str
    colour: str
    where: str
    margins: Margins
    loops: Mapping[CascadeLoop, Margins] = field(default_factory=dict)


def shown_states(bode: Bode) -> tuple[ShownState, ...]:
    """Return the limit cases, the worst settled state, and the worst state of all.

    Settled states are the limit cases, and all states stuck under a bias force. If the worst state of all is settled,
    it comes once. Without friction, there are only limit cases.
    """
    cases = [
        ShownState(label(name), colour(name), _speed(case.members), case.margins, _loops(bode, name))
        for name, case in bode.cases.items()
    ]
    if not has_family(bode):
        return tuple(cases)
    for title, (member, margins, gains) in {"Worst settled": bode.settled, "Worst of the family": bode.worst}.items():
        cases.append(ShownState(title, GREY, with_gains(place(member, bode), gains), margins))
    if bode.worst[0] == bode.settled[0] and bode.worst[2] == bode.settled[2]:
        cases.pop()
    return tuple(cases)


def _loops(bode: Bode, name: str) -> Mapping[CascadeLoop, Margins]:
    """Return the margins of a cascade's loops in a limit case; empty for other controllers."""
    return bode.cascades[name].margins if name in bode.cascades else {}


def label(name: str) -> str:
    """Return a limit case in words: "stuck-touched" is "Stuck, limiter touched"."""
    move, _, rest = name.partition("-")
    first = {"given": "As given"}.get(move, move.capitalize())
    return ", ".join([first, *([_ENDINGS[rest]] if rest else [])])


def colour(name: str) -> str:
    """Return the colour of a limit case."""
    return COLOURS[name.removesuffix(SERIES)]


def dash(name: str) -> Dash:
    """Return the line style of a limit case: dashed where the limiter acts in series."""
    return "dashed" if name.endswith(SERIES) else "solid"


def place(member: Members, bode: Bode) -> str:
    """Return a state in words that tell it from others: "sliding at 1.78 mm/s, limiter free"."""
    return in_words(cart(member, bode), bool(member.touched[0]), has_limiter(bode))


def in_words(cart: str, touched: bool, limited: bool) -> str:
    """Describe a state: what the cart does, and whether the limiter is `touched` or free.

    The limiter is left out unless it can be both (`limited`).
    """
    return ", ".join([*([cart] if cart else []), *([f"limiter {side(touched)}"] if limited else [])]) or "as given"


def with_gains(state: str, gains: str) -> str:
    """Add to a state in words the gains that act in it, unless they are those far from the reference at rest."""
    return f"{state}, with {gains}" if gains else state


def cart(member: Members, bode: Bode) -> str:
    """Say what the cart does: it sticks, or slides at a speed; empty without friction.

    The highest speed analysed is called fast sliding: friction no longer falls there, and no motion need be so fast.
    """
    if not has_friction(bode):
        return ""
    if not member.stuck[0]:
        if member.speed[0] == bode.scan.members.speed.max():
            return f"sliding fast{'' if member.forward[0] else ' backwards'}"
        return f"sliding{'' if member.forward[0] else ' backwards'} at {with_unit(member.speed[0], 'm/s')}"
    return f"stuck under a bias force of {with_unit(member.bias[0], 'N')}" if member.bias[0] else "stuck"


def side(touched: bool) -> str:
    """Return the limiter's state in a word: "touched" or "free"."""
    return "touched" if touched else "free"


def has_limiter(bode: Bode) -> bool:
    """Tell whether the limiter can be both free and touched.

    If the joint is locked or has no stroke, only one of these states is possible.
    """
    return bool(np.ptp(bode.scan.members.touched.astype(int)))


def has_family(bode: Bode) -> bool:
    """Tell whether there are more states than the limit cases; only friction creates some."""
    return len(bode.scan.members) * len(bode.scans) > len(bode.cases)


def has_friction(bode: Bode) -> bool:
    """Tell whether the stage has a friction law, of the guide or of the motor."""
    return leading_friction(bode.stage.flat())["friction.model"] != "none"


def _speed(member: Members) -> str:
    """Return the sliding speed in words; empty for a stuck state."""
    return "" if member.stuck[0] else f"at {with_unit(member.speed[0], 'm/s')}"


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
