"""Describe plant and loop by the numbers that one reads off Fig. 7 and 8.

Fig. 7 has the plant in each limit case, Fig. 8 the 8 Hz loop over the speed of the cart, as it prescribes it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.signal import find_peaks

from friso.equations.bandwidth import faster
from friso.equations.controllers.pid import CROSSOVER
from friso.frequency.bode import HIGHEST_CROSSOVER, PRESCRIBED_SPEEDS, Range, ranges_below
from friso.frequency.loops import DISTURBANCE, FORCE, STAGE, cart_states, closed_loop, operating_point, plant
from friso.frequency.margins import MARGIN_DENSITY, frequencies, loops, plant_poles, plants, spectral_abscissa
from friso.frequency.system import DriveTiming, Members, law_of, limit_cases, limiter_in_series, member, speeds
from friso.stage.tables import friction_law

SPEED_COUNT = 257
"""Number of speeds at which stability is checked before the ends of ranges are located."""

CROSSOVER_COUNT = 25
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
    size = np.abs(np.array([loops(flat, member(speed), tenth)[0] for speed in PRESCRIBED_SPEEDS]))
    slow, fast = (size.max(axis=0) / size.min(axis=0)).tolist()
    return Speeds(
        unstable=unstable[False],
        unstable_touched=unstable[True],
        undeflected=ranges_below(speeds(flat, SPEED_COUNT), lambda v: -abscissa_with_bristles(flat, v, 0.0)),
        incurable=_incurable(flat, unstable[False]),
        slow=slow,
        fast=fast,
    )


def _unstable(flat: Mapping[str, Any], touched: bool) -> tuple[Range, ...]:
    return ranges_below(speeds(flat, SPEED_COUNT), lambda v: -spectral_abscissa(flat, _sliding(v, touched)))


def _sliding(speed: np.ndarray, touched: bool = False) -> Members:
    """Return states that slide at these speeds [m/s], the limiter `touched` or free."""
    n = len(speed)
    return Members(speed, np.zeros(n), np.full(n, touched), np.full(n, True))


def _incurable(flat: Mapping[str, Any], unstable: tuple[Range, ...]) -> bool:
    """Tell whether no faster controller is stable in the middle of at least one unstable range."""
    crossover = np.geomspace(flat[CROSSOVER], HIGHEST_CROSSOVER, CROSSOVER_COUNT)
    many = faster(flat, crossover / flat[CROSSOVER])
    middles = [np.full(CROSSOVER_COUNT, np.sqrt(low * high)) for low, high in unstable]
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


PARASITIC_FREQUENCY = 300.0
"""Frequency [Hz] at which the thesis finds the parasitic mode (Sec. 3.4.2)."""

VISIBLE_PEAK = np.log(10) / 20
"""Least height of a resonance peak, in the logarithm of the magnitude: 1 dB."""

FINER_POINTS = 201
"""Number of frequencies between the neighbours of an extreme, for locating it."""


@dataclass(frozen=True)
class LowLines:
    """Lines that a plant follows far below its first resonance: stiffness [N/m], damping [N s/m] and mass [kg]."""

    stiffness: float
    damping: float
    mass: float

    @property
    def corner(self) -> float:
        """Return the frequency [Hz] below which the damper outweighs the mass."""
        return self.damping / self.mass / (2 * np.pi)


@dataclass(frozen=True)
class LimitCase:
    """Stage position over force in one limit case.

    `resonances` and `antiresonances` [Hz] ascend. `mass` [kg] is the mass whose line the response follows below the
    parasitic mode, at `mass_at` [Hz]; both are NaN without such a line. `low` has its lines below all resonances.
    """

    resonances: tuple[float, ...]
    antiresonances: tuple[float, ...]
    mass: float
    mass_at: float
    low: LowLines

    @property
    def parasitic(self) -> float:
        """Return the resonance closest to the thesis's parasitic mode [Hz]; NaN without any."""
        return min(self.resonances, key=lambda f: abs(np.log(f / PARASITIC_FREQUENCY)), default=np.nan)

    @property
    def first(self) -> float:
        """Return the first resonance [Hz]; NaN without any."""
        return self.resonances[0] if self.resonances else np.nan

    @property
    def pair_above(self) -> tuple[float, float] | None:
        """Return the first antiresonance above the parasitic mode, and the resonance after it [Hz].

        The result is None without them.
        """
        pairs = [(z, p) for z in self.antiresonances for p in self.resonances if self.parasitic < z < p]
        return min(pairs, default=None)


@dataclass(frozen=True)
class Springs:
    """Stiffness [N/m] of the `joint`, the cart's `bristles`, and the plant at 0 Hz (`both`)."""

    joint: float
    bristles: float
    both: float


def springs_of(flat: Mapping[str, Any]) -> Springs:
    """Return the stiffnesses of joint and bristles, and of the plant with the cart stuck."""
    machine = plant(flat, limit_cases(flat)["stuck"]).take((FORCE,), (STAGE,))
    both = float(1 / abs(machine.at(np.zeros(1))[0, 0, 0, 0]))
    bristles = friction_law(flat["friction.model"]).shown(flat).stiffness
    return Springs(flat["joint.stiffness"], bristles, both)


def limit_cases_of(flat: Mapping[str, Any]) -> dict[str, LimitCase]:
    """Return the plant in all limit cases, by name.

    Cases with a touched limiter are also computed by the formula of Table 1, with "-series" appended to the name.
    """
    cases = limit_cases(flat)
    series = limiter_in_series(flat)
    plain = {name: _limit_case(flat, member) for name, member in cases.items()}
    printed = {name: member.with_limiter(False) for name, member in cases.items() if member.touched[0]}
    return plain | {f"{name}-series": _limit_case(series, member) for name, member in printed.items()}


def _limit_case(flat: Mapping[str, Any], member: Members) -> LimitCase:
    omega = frequencies(flat, member, DriveTiming.of(flat), MARGIN_DENSITY, [plant_poles(flat, member)])
    resonances, antiresonances = (_peaks(flat, member, omega, sign) for sign in (1, -1))
    low = _low_lines(flat, member, omega[0])
    at = _mass_line(LimitCase(resonances, antiresonances, np.nan, np.nan, low))
    omega_at = np.array([2 * np.pi * at])
    mass = np.nan if np.isnan(at) else float(1 / (abs(plants(flat, member, omega_at)[0, 0]) * omega_at[0] ** 2))
    return LimitCase(resonances, antiresonances, mass, at, low)


def _low_lines(flat: Mapping[str, Any], member: Members, lowest: float) -> LowLines:
    """Return the lines of a plant at frequencies far below the `lowest` searched [rad/s], where nothing resonates."""
    omega = float(lowest) * np.array([1e-4, 1e-1])
    spring, force = (complex(value) for value in 1 / plants(flat, member, omega)[0])
    return LowLines(spring.real, force.imag / float(omega[1]), (spring.real - force.real) / float(omega[1]) ** 2)


def _peaks(flat: Mapping[str, Any], member: Members, omega: np.ndarray, sign: int) -> tuple[float, ...]:
    """Return at which frequencies [Hz] the plant of a limit case peaks, or dips if `sign` is -1.

    `omega` [rad/s] are the frequencies searched.
    """

    def height(at: np.ndarray) -> np.ndarray:
        return sign * np.log(np.abs(plants(flat, member, at)[0]))

    places, _ = find_peaks(height(omega), prominence=VISIBLE_PEAK)
    if not len(places):
        return ()
    finer = np.geomspace(omega[places - 1], omega[places + 1], FINER_POINTS, axis=1)
    best = height(finer.ravel()).reshape(finer.shape).argmax(axis=1)
    return tuple((finer[np.arange(len(places)), best] / (2 * np.pi)).tolist())


def _mass_line(case: LimitCase) -> float:
    """Return the frequency [Hz] in the middle of the mass line.

    The mass line lies between lower modes and the antiresonance of the parasitic mode.
    """
    high = max((f for f in case.antiresonances if f < case.parasitic), default=np.nan)
    low = max((f for f in case.resonances if f < high), default=high / 10)
    return float(np.sqrt(low * high))
