"""Define the parts of controllers: signals, and blocks that act on them.

A controller is declared once, in terms of `Blocks`. Two kinds of blocks give its two realisations.
`friso.equations.continuous` serves cycles, verdicts and Bode plots; `friso.equations.sampled` computes as a drive does.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import defaultdict
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import sympy as sp

from friso.equations.component import STEADY, TIME, Component, Held, Piecewise, key
from friso.equations.structure import ControllerForm
from friso.stage.controllers import (
    ANTI_WINDUP_TIME,
    FEEDBACK,
    FILTERS_KEY,
    FORCE_LIMIT,
    FORWARD,
    INNER_WINDOWS,
    SCHEDULES,
    ControllerSection,
    FilterRule,
    FrictionSettings,
    Polynomial,
)
from friso.stage.rig import IntegralRule


@dataclass(frozen=True)
class Loop:
    """Inputs of a controller.

    They are the error [m], the position [m] and its rate, and the rate [m/s], acceleration [m/s^2] and jerk [m/s^3] of
    the reference. The direction of the reference is 1 ahead, -1 back, 0 at rest. `rated` is the position [m] at the
    encoder of the velocity, if that is another encoder; in a steady motion it is `rated_ahead` [m] of the position.
    """

    error: sp.Expr
    position: sp.Expr
    velocity: sp.Expr
    reference_velocity: sp.Expr
    reference_acceleration: sp.Expr = sp.S.Zero
    reference_direction: sp.Expr = sp.S.Zero
    rated: sp.Expr | None = None
    reference_jerk: sp.Expr = sp.S.Zero
    rated_ahead: sp.Expr = sp.S.Zero


def sign_of_motion(*rates: sp.Expr) -> sp.Expr:
    """Return the sign (1, -1 or 0) of the first of some rates that is not 0.

    The rates are velocity, acceleration and so on, so it is the direction in which a motion goes on.
    """
    cases = [case for rate in rates for case in ((sp.S.One, rate > 0), (sp.S.NegativeOne, rate < 0))]
    return Piecewise(*cases, (sp.S.Zero, True))


@dataclass(frozen=True)
class Controller:
    """A controller: its force [N], its part of the model, and its held numbers.

    Held numbers keep their values between samples.
    """

    force: sp.Expr
    component: Component
    held: tuple[Held, ...] = ()


@dataclass(frozen=True)
class Signal:
    """A signal in a controller, which can be added to others and multiplied by gains.

    `value` is what it is now, and `scale` the magnitude below which it does not matter. `settled` and `settled_rate`
    are its value and rate in a steady motion that has lasted, in terms of `STEADY`. `rate` is its rate in continuous
    time, and `before` its value at the sample before, if known.
    """

    value: sp.Expr
    scale: sp.Expr
    settled: sp.Expr
    settled_rate: sp.Expr
    rate: sp.Expr | None = None
    before: sp.Expr | None = None

    def __add__(self, other: Signal) -> Signal:
        """Add two signals, with all their expressions."""
        return Signal(
            self.value + other.value,
            self.scale or other.scale,
            self.settled + other.settled,
            self.settled_rate + other.settled_rate,
            None if self.rate is None or other.rate is None else self.rate + other.rate,
            None if self.before is None or other.before is None else self.before + other.before,
        )

    def __mul__(self, gain: Any) -> Signal:
        """Multiply a signal, with all its expressions, by a gain."""
        return Signal(
            gain * self.value,
            sp.Abs(gain) * self.scale,
            gain * self.settled,
            gain * self.settled_rate,
            None if self.rate is None else gain * self.rate,
            None if self.before is None else gain * self.before,
        )

    def __truediv__(self, divisor: Any) -> Signal:
        return self * (1 / sp.sympify(divisor))

    def shared(self, share: Signal) -> Signal:
        """Multiply a signal by a share, which is constant but for jumps."""
        rate = None if self.rate is None else share.value * self.rate
        value, settled = share.value * self.value, share.settled * self.settled
        return Signal(value, self.scale, settled, share.settled * self.settled_rate, rate)

    def __neg__(self) -> Signal:
        return self * -1

    def __sub__(self, other: Signal) -> Signal:
        return self + -other


@dataclass(frozen=True)
class Measured:
    """Measured inputs of a controller, as signals.

    From encoders come error and position [m], and `rated`: the position from which the velocity is taken, perhaps of
    another encoder. Of the reference come velocity [m/s], acceleration [m/s^2], direction (1, -1, 0) and jerk [m/s^3].
    """

    error: Signal
    position: Signal
    rated: Signal
    reference_velocity: Signal
    reference_acceleration: Signal
    reference_direction: Signal
    reference_jerk: Signal


def loop_signals(loop: Loop, length: sp.Expr, rate: sp.Expr) -> Measured:
    """Make signals of a controller's inputs, `loop`, scaled by a length [m] and a rate [1/s]."""
    drift = STEADY.reference_velocity - STEADY.velocity
    position = Signal(loop.position, length, STEADY.position, STEADY.velocity, rate=loop.velocity)
    rated = position
    if loop.rated is not None:
        rated = replace(position, value=loop.rated, settled=STEADY.position + loop.rated_ahead)
    return Measured(
        Signal(loop.error, length, STEADY.error, drift, rate=loop.reference_velocity - loop.velocity),
        position,
        rated,
        Signal(
            loop.reference_velocity,
            length * rate,
            STEADY.reference_velocity,
            sp.S.Zero,
            rate=loop.reference_acceleration,
        ),
        Signal(loop.reference_acceleration, length * rate**2, sp.S.Zero, sp.S.Zero, rate=loop.reference_jerk),
        Signal(loop.reference_direction, sp.S.One, sign_of_motion(STEADY.reference_velocity), sp.S.Zero),
        Signal(loop.reference_jerk, length * rate**3, sp.S.Zero, sp.S.Zero, rate=sp.diff(loop.reference_jerk, TIME)),
    )


@dataclass(frozen=True)
class Schedule:
    """A schedule of gains: `factors` at rising `places`, linear between them and constant beyond."""

    places: tuple[sp.Expr, ...]
    factors: tuple[sp.Expr, ...]

    def at(self, size: sp.Expr) -> sp.Expr:
        """Return the factor for the size of a signal."""
        cases: list[Any] = [(self.factors[0], size <= self.places[0])]
        points = zip(self.places, self.factors, strict=True)
        for (low, first), (high, last) in pairwise(points):
            cases.append((first + (last - first) * (size - low) / (high - low), size <= high))
        return Piecewise(*cases, (self.factors[-1], True))


class Blocks(ABC):
    """Building blocks of a controller, such as filters and integrals.

    `name` distinguishes a block from others of its kind.
    """

    def __init__(self, form: ControllerForm | None = None) -> None:
        self.form = form
        self.error = self.nothing
        """The measured error, at which windows against friction look."""
        self.winding: dict[sp.Symbol, Any] = defaultdict(lambda: sp.S.One)
        """Factors that settings against friction put on what integrals take in, by the integrals' settled values."""
        self.paused: dict[sp.Symbol, Any] = defaultdict(lambda: sp.S.Zero)
        """Numbers that are 1 while a deadband pauses integrals, by the same."""

    nothing = Signal(sp.S.Zero, sp.S.Zero, sp.S.Zero, sp.S.Zero, sp.S.Zero, sp.S.Zero)
    """A signal that is always 0."""
    whole = Signal(sp.S.One, sp.S.One, sp.S.One, sp.S.Zero, sp.S.Zero, sp.S.One)
    """A signal that is always 1."""

    @contextmanager
    def loop(self, name: str) -> Iterator[None]:
        """Mark blocks that are made in this context as parts of the "position" or "velocity" loop.

        A drive may run the position loop at a lower rate.
        """
        yield

    def handed_on(self, signal: Signal, name: str) -> Signal:
        """Pass a signal from a slower loop to a faster one, which holds it between slow samples.

        `name` names the held value. Without sample times the signal is unchanged.
        """
        return signal

    def key(self, name: str) -> sp.Symbol:
        """Return the symbol of the key `name` of the table [controller], in SI units."""
        return key(ControllerSection.key(name))

    @property
    def settings(self) -> FrictionSettings:
        """Return the settings against friction that the controller has."""
        return self.form.settings if self.form else FrictionSettings()

    @abstractmethod
    def low_pass(self, signal: Signal, tau: sp.Expr, name: str, rule: FilterRule | None = None) -> Signal:
        """Return a signal behind the low-pass 1/(1 + tau s), tau [s].

        A drive discretises the low-pass by `rule`; None stands for the drive's own rule.
        """

    @abstractmethod
    def derivative(self, signal: Signal, name: str, tau: sp.Expr | None = None) -> Signal:
        """Return the derivative of a signal, filtered as s/(1 + tau s) with tau [s].

        Without `tau` it is the rate of the measured quantity; a drive takes differences over samples.
        """

    @abstractmethod
    def integral(
        self,
        signal: Signal,
        gain: sp.Expr,
        name: str = "integral",
        rule: IntegralRule = "bilinear",
        limit: sp.Expr | None = None,
        leak: sp.Expr | None = None,
    ) -> Signal:
        """Return a signal integrated: gain/s of it, or gain/(s + leak).

        The gain is positive, and the controller's force rises with the output. At the force limit the integrator
        follows the anti-windup. An integrator whose own output reaches `limit` stops. A drive integrates by `rule`,
        unless it has a rule of its own.
        """

    @abstractmethod
    def biquad(
        self, signal: Signal, upper: Polynomial, lower: Polynomial, name: str, rule: FilterRule | None = None
    ) -> Signal:
        """Return a signal behind a second-order transfer function, such as a notch.

        `upper` and `lower` are the coefficients of 1, s and s^2 of numerator and denominator; the first of `lower` is
        1. A drive discretises the function by `rule`; None stands for the drive's own rule.
        """

    @abstractmethod
    def limiter(self, signal: Signal, limit: sp.Expr, name: str) -> Signal:
        """Return the signal clamped to plus and minus a limit; `name` names the clamp."""

    @abstractmethod
    def within(self, window: str, resting: Signal) -> Signal:
        """Return a signal that is 1 while a window against friction acts, and 0 elsewhere.

        `window` is its key. It acts while the error is small, and has been so for its time if it has one, until the
        error is larger than its exit. It does not act where `resting` is 0 instead of 1.
        """

    @property
    @abstractmethod
    def _holding(self) -> tuple[list[sp.Symbol], list[sp.Symbol]]:
        """Return the symbols of the integrals made so far, in values and in settled values."""

    def exit_of(self, window: str) -> sp.Symbol:
        """Return the error [m] at which a window ceases to act: its exit, or itself without one."""
        return self.key(f"{window}_exit" if f"{window}_exit" in self.settings else window)

    def _inside(self, window: str, direction: Signal) -> Signal:
        """Return 1 while a window acts, else 0; `direction` is that of the reference: 1, -1 or 0."""
        at_rest = window == "freeze_window" or "windows_at_rest" in self.settings
        return self.within(window, resting(direction) if at_rest else self.whole)

    def dead_zone(self, error: Signal, direction: Signal) -> Signal:
        """Return the error behind the dead zone.

        The error is reduced by the deadband, or is 0 within it if the dead zone remembers the past. `direction` is that
        of the reference: 1, -1 or 0.
        """
        band, lost = self.key("error_deadband"), sp.S.One
        if "error_deadband_gain" in self.settings:
            lost -= self.key("error_deadband_gain")
        if self.settings.remembers("error_deadband"):
            return error.shared(self.whole - self._inside("error_deadband", direction) * lost)
        limited = Piecewise((band, error.settled > band), (-band, error.settled < -band), (error.settled, True))
        clipped = replace(self.limiter(error, band, "error_deadband"), settled=limited)
        acts = resting(direction) if "windows_at_rest" in self.settings else self.whole
        return error - (clipped * lost).shared(acts)

    @abstractmethod
    def scheduled(self, signal: Signal, schedule: Schedule, name: str) -> Signal:
        """Return the factor of a schedule of gains for the size of a signal; `name` names it."""

    def _factors(self, seen: Measured) -> list[tuple[Signal, sp.Expr]]:
        """Return the factors that settings put on the gains, each with that on what integrals take in.

        The settings are a window for standstill, a factor in moves, and a schedule over the size of the measured error
        or of the velocity.
        """
        settings, direction = self.settings, seen.reference_direction
        factors: list[tuple[Signal, sp.Expr]] = []
        if "standstill_window" in settings:
            inside, factor = self._inside("standstill_window", direction), self.key("standstill_factor")
            own = "standstill_integral_factor"
            integral = self.key(own) if own in settings else factor
            factors.append((self.whole + inside * (factor - 1), 1 + (integral - 1) * inside.value))
        if "moving_factor" in settings:
            factor = self.whole + (self.whole - resting(direction)) * (self.key("moving_factor") - 1)
            factors.append((factor, factor.value))
        for name in SCHEDULES:
            if name in settings:
                signal = self.error if name == "schedule_error" else self.derivative(seen.rated, name)
                factor = self.scheduled(signal, self._schedule(name), name)
                factors.append((factor, factor.value))
        return factors

    def _schedule(self, name: str) -> Schedule:
        """Return the schedule of gains whose places have the key `name`."""
        numbers = range(1, self.settings.points + 1)
        return Schedule(
            *(tuple(self.key(f"{array}.{number}") for number in numbers) for array in (name, "schedule_factor"))
        )

    def _wind(self, factor: sp.Expr) -> None:
        """Multiply by a factor what the integrals made so far take in."""
        for integral in self._holding[1]:
            self.winding[integral] *= factor

    def with_gains(self, total: Signal, seen: Measured) -> Signal:
        """Return a force or command with the factors of settings on its gains, and let its integrals pause.

        `total` is that without them. The integrals keep what they had.
        """
        self._pause_integrals(seen.reference_direction)
        factors, gains = self._factors(seen), self.whole
        if not factors:
            return total
        for factor, winding in factors:
            gains = gains.shared(factor)
            self._wind(winding)
        held, settled = (
            sum((sp.diff(part, x) * x for x in integrals), start=sp.S.Zero)
            for part, integrals in zip((total.value, total.settled), self._holding, strict=True)
        )
        kept = Signal(held, total.scale, settled, sp.S.Zero)
        return kept + (total - kept).shared(gains)

    def frozen(self, force: Signal, seen: Measured) -> Signal:
        """Return a force or command, switched off while the reference rests and the error is within the window.

        Its integrals are emptied as the window begins to act.
        """
        if "freeze_window" not in self.settings:
            return force
        engaged = 1 - self._inside("freeze_window", seen.reference_direction).value
        self._wind(engaged)
        return replace(force, value=engaged * force.value, rate=None, before=None)

    def in_position_loop(self, command: Signal, seen: Measured) -> Signal:
        """Return the command of a position loop above another loop, with the settings that act on it alone."""
        return self.frozen(self.with_gains(command, seen), seen) if INNER_WINDOWS in self.settings else command

    def _pause_integrals(self, direction: Signal) -> None:
        """Let integrals pause as settings against friction say; `direction` is that of the reference: 1, -1 or 0."""
        integrals = self._holding[1]
        if integrals and "integral_deadband" in self.settings:
            self.paused |= dict.fromkeys(integrals, self._inside("integral_deadband", direction).value)
        if "integral_rests_in_moves" in self.settings:
            self._wind(resting(direction).value)

    def _losses(self, integral: sp.Symbol) -> sp.Expr:
        """Return the rate [1/s] at which settings against friction let an integral decay."""
        leak = 2 * sp.pi * self.key("integral_leak") if "integral_leak" in self.settings else sp.S.Zero
        decays = "integral_deadband_decay"
        return leak + (self.paused[integral] / self.key(decays) if decays in self.settings else sp.S.Zero)

    @abstractmethod
    def push(self, direction: Signal) -> Signal:
        """Return a constant force towards the reference, which acts while the reference rests.

        The force acts only if the error is not small. `direction` is that of the reference: 1, -1 or 0.
        """

    @abstractmethod
    def dither(self) -> Signal:
        """Return a sinusoidal dither force."""

    def fed_back(self, signal: Signal) -> Signal:
        """Return a measured signal behind the filters of the feedback path."""
        return self._filtered(signal, FEEDBACK)

    def fed_forward(self, signal: Signal) -> Signal:
        """Return a demanded force, `signal`, behind the filters of the forward path."""
        return self._filtered(signal, FORWARD)

    def _filtered(self, signal: Signal, path: str) -> Signal:
        """Return a signal behind the filters of a path, in the order of the stage file."""
        for number, part in enumerate(self.form.filters if self.form else (), start=1):
            if part.path == path:
                row = _Row(f"{FILTERS_KEY}.{number}")
                upper, lower = part.section.transfer(row, part.variant)
                signal = self.transfer(signal, upper, lower, f"filter_{number}", part.discretisation)
        return signal

    def transfer(
        self, signal: Signal, upper: Polynomial, lower: Polynomial, name: str, rule: FilterRule | None = None
    ) -> Signal:
        """Return a signal behind a first- or second-order transfer function.

        `upper` and `lower` are the coefficients of 1, s and s^2 of numerator and denominator; the first of `lower` is
        1. A drive discretises the function by `rule`; None stands for the drive's own rule.
        """
        if lower[2] != 0:
            return self.biquad(signal, upper, lower, name, rule)
        through = sp.sympify(upper[1]) / lower[1]
        return self.low_pass(signal, lower[1], name, rule) * (upper[0] - through) + signal * through

    def lead(self, signal: Signal, zero: sp.Expr, pole: sp.Expr, name: str) -> Signal:
        """Return a signal behind (1 + zero s)/(1 + pole s), both times in [s].

        It is a lead where `zero` exceeds `pole`, else a lag.
        """
        return signal + self.derivative(signal, name, pole) * (zero - pole)


class _Row(dict[str, sp.Symbol]):
    """The keys of one row in an array of tables, such as a filter's, as symbols."""

    def __init__(self, place: str) -> None:
        super().__init__()
        self.place = place

    def __missing__(self, name: str) -> sp.Symbol:
        return key(f"{self.place}.{name}")


@dataclass(frozen=True)
class Demand:
    """The force that a controller demands.

    `shares` are its terms by name, and `total` is their sum. `force` [N] is the total after filters and settings
    against friction. `error` [m] is the measured error.
    """

    shares: Mapping[str, Signal]
    total: Signal
    force: Signal
    error: Signal


def demanded(form: ControllerForm, seen: Measured, blocks: Blocks) -> Demand:
    """Return the force that a controller demands for the measured inputs `seen`."""
    error, settings = seen.error, form.settings
    blocks.error = error
    if form.section.feeds_back == "position":
        position = blocks.fed_back(seen.position)
        rated = position if seen.rated is seen.position else seen.rated
        seen = replace(seen, position=position, rated=rated, error=seen.error + seen.position - position)
    if "error_deadband" in settings:
        seen = replace(seen, error=blocks.dead_zone(seen.error, seen.reference_direction))
    all_of_it = INNER_WINDOWS not in settings
    shares = form.section.declare(seen, blocks, form.variant)
    total = sum(shares.values(), start=Blocks.nothing)
    added = blocks.with_gains(total, seen) if all_of_it else total
    if "stiction_push" in settings:
        added += blocks.push(seen.reference_direction)
    if "dither_amplitude" in settings:
        added += blocks.dither()
    if all_of_it:
        added = blocks.frozen(added, seen)
    return Demand(shares, total, blocks.fed_forward(added), error)


def resting(direction: Signal) -> Signal:
    """Return 1 while the reference rests and 0 while it moves, from its `direction`: 1, -1 or 0."""
    return replace(Blocks.whole, value=1 - direction.value**2, settled=1 - direction.settled**2)


def force_limit() -> sp.Symbol:
    """Return the limit of the controller's force [N]."""
    return key(FORCE_LIMIT)


def unwinding_time() -> sp.Symbol:
    """Return the time constant [s] with which back-calculation unwinds an integrator."""
    return key(ANTI_WINDUP_TIME)


def wound_up(force: sp.Expr, integrals: list[sp.Symbol]) -> dict[sp.Symbol, sp.Expr]:
    """Return the states of integrators in a steady motion with some force of the controller.

    That force is the symbol `STEADY.force`; the innermost integral, the last of `integrals`, supplies what is missing,
    and the others are 0. The argument `force` is what the controller computes in the steady motion, in terms of the
    integrals. The result maps integrals to states, and is empty without integrals.
    """
    if not integrals:
        return {}
    *outer, innermost = integrals
    rest = force.xreplace(dict.fromkeys(integrals, sp.S.Zero))
    return {innermost: (STEADY.force - rest) / sp.diff(force, innermost), **dict.fromkeys(outer, sp.S.Zero)}
