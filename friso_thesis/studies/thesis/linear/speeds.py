"""Compute the 8 Hz loop over the speed of the cart, as Fig. 8 prescribes it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.equations.bandwidth import faster
from friso.equations.controllers.van_dijk import CROSSOVER
from friso.frequency.bode import PRESCRIBED
from friso.frequency.crossover import Range, ranges_below
from friso.frequency.family import loops, spectral_abscissa
from friso.frequency.friction import law_of, speeds
from friso.frequency.loops import closed_loop
from friso.frequency.members import Members, member
from friso.frequency.parts import DISTURBANCE, cart_states, operating_point
from friso.frequency.settings import settings

SPEEDS = 257
"""Number of speeds at which stability is checked before the ends of ranges are located."""

CROSSOVERS = 25
"""Number of faster controllers that are tried if the cart is unstable."""


@dataclass(frozen=True)
class Speeds:
    """Stability of the loop with the cart at prescribed speeds [m/s].

    - `unstable`: ranges of speed in which the loop is unstable with the limiter free; `unstable_touched`: with it
      touched.
    - `undeflected`: these ranges with bristles that the motion has not deflected yet (z = 0), where a linearisation
      about an initial speed begins.
    - `incurable`: whether no faster controller, up to 10 kHz, is stable in the middle of at least one unstable range.
    - `slow`, `fast`: ratio of the greatest to the least magnitude of the loop over the prescribed speeds, at a tenth
      and at ten times the crossover.
    """

    unstable: tuple[Range, ...]
    unstable_touched: tuple[Range, ...]
    undeflected: tuple[Range, ...]
    incurable: bool
    slow: float
    fast: float


def loop_over_speed(flat: Mapping[str, Any]) -> Speeds:
    """Compute how stability of the loop depends on the speed of the cart."""
    unstable = {touched: _unstable(flat, touched) for touched in (False, True)}
    tenth = 2 * np.pi * flat[CROSSOVER] * np.array([0.1, 10.0])
    size = np.abs(np.array([loops(flat, member(speed), tenth)[0] for speed in PRESCRIBED]))
    slow, fast = (size.max(axis=0) / size.min(axis=0)).tolist()
    return Speeds(
        unstable=unstable[False],
        unstable_touched=unstable[True],
        undeflected=ranges_below(speeds(flat, SPEEDS), lambda v: -abscissa_with_bristles(flat, v, 0.0)),
        incurable=_incurable(flat, unstable[False]),
        slow=slow,
        fast=fast,
    )


def _unstable(flat: Mapping[str, Any], touched: bool) -> tuple[Range, ...]:
    return ranges_below(speeds(flat, SPEEDS), lambda v: -spectral_abscissa(flat, _sliding(v, touched)))


def _sliding(speed: np.ndarray, touched: bool = False) -> Members:
    """Return states that slide at these speeds [m/s], the limiter `touched` or free."""
    n = len(speed)
    return Members(speed, np.zeros(n), np.full(n, touched), np.full(n, True))


def _incurable(flat: Mapping[str, Any], unstable: tuple[Range, ...]) -> bool:
    """Tell whether no faster controller is stable in the middle of at least one unstable range."""
    crossover = np.geomspace(flat[CROSSOVER], settings.highest_crossover, CROSSOVERS)
    many = faster(flat, crossover / flat[CROSSOVER])
    middles = [np.full(CROSSOVERS, np.sqrt(low * high)) for low, high in unstable]
    return any(bool((spectral_abscissa(many, _sliding(speed)) > 0).all()) for speed in middles)


def abscissa_with_bristles(flat: Mapping[str, Any], speed: np.ndarray, share: float) -> np.ndarray:
    """Return the real part [1/s] of the loop's rightmost pole, at speeds (n,) [m/s].

    Friction is linearised at these speeds. The bristles are deflected by the fraction `share` of what belongs to the
    speed in steady state.
    """
    law = law_of(flat)
    assert law is not None  # the rig has friction
    sliding = _sliding(speed)
    at = {**flat, "velocity": speed} | operating_point(flat, sliding)
    at |= {name: share * at[name] for name in law.states}
    friction = law.declared.at(at, len(speed))
    loop = closed_loop({**flat, "friction.model": "none"}, sliding)
    push = loop.b[:, :, [loop.inputs.index(DISTURBANCE)]]
    cart = np.eye(len(loop.states))[[loop.states.index(cart_states(flat)[1])]]
    above = np.concatenate([loop.a - push @ friction.d @ cart, -push @ friction.c], axis=2)
    below = np.concatenate([friction.b @ cart, friction.a], axis=2)
    return np.linalg.eigvals(np.concatenate([above, below], axis=1)).real.max(axis=1)
