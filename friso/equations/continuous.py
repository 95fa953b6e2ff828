"""Realise the blocks of controllers in continuous time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import sympy as sp

from friso.equations.blocks import (
    Blocks,
    Controller,
    Demand,
    Loop,
    Schedule,
    Signal,
    demanded,
    force_limit,
    loop_signals,
    unwinding_time,
    wound_up,
)
from friso.equations.component import STEADY, TIME, Component, Kink, Output, Piecewise, Role, State, Switch, sine, state
from friso.equations.structure import ControllerForm, controller_form
from friso.stage.controllers import BACK_CALCULATION, AntiWindup, FilterRule, Polynomial
from friso.stage.rig import IntegralRule

UNWINDING_BAND = sp.Rational(1, 1000)
"""Width of the band over which an integrator stops at the force limit, as a fraction of the limit. An abrupt stop would
make the right-hand side jump, and the solution would switch endlessly along the limit. Within the band the stop is
continuous, and the motion along the limit is ordinary, if stiff."""


def continuous_controller(form: ControllerForm, loop: Loop, length: sp.Expr, rate: sp.Expr) -> Controller:
    """Return a controller in continuous time, which acts on the inputs `loop`.

    `length` [m] and `rate` [1/s] scale its states.
    """
    blocks = Continuous(rate, form)
    demand = demanded(form, loop_signals(loop, length, rate), blocks)
    bound = ForceLimit.of(demand.force, form.anti_windup) if form.anti_windup else None
    force, kinks = (bound.force, bound.kinks) if bound else (demand.force.value, ())
    outputs = {"force": Output(force, "N", "actuator force")}
    outputs |= {
        f"force_{term}": Output(demand.shares[term].value, "N", f"{name} share")
        for term, name in form.section.shares.items()
        if term in demand.shares
    }
    states, resting = blocks.finished(demand, bound)
    sides: dict[Any, Any] = {}
    begun: list[Kink] = []
    for kink in (*blocks.kinks, *kinks, *resting):
        begun.append(kink.beginning(sides) if kink.at_start.free_symbols & {*sides} else kink)
        sides[kink.beyond] = Piecewise((1, begun[-1].at_start > 0), (0, True))
    return Controller(force, Component(states, tuple(begun), outputs))


FAR_ERROR = 1e9
"""An error [m] beyond all windows and deadbands."""


def slow_gains(flat: Mapping[str, Any]) -> tuple[float, float]:
    """Return proportional [N/m] and integral gain [N/(m s)] for slow, large errors.

    Such an error lies beyond all windows and deadbands, and the reference rests.
    """
    form = controller_form(flat)
    loop = Loop(STEADY.error, STEADY.position, sp.S.Zero, sp.S.Zero)
    blocks = Continuous(sp.S.One, form)
    force = demanded(form, loop_signals(loop, sp.S.One, sp.S.One), blocks).force.settled
    proportional, integral = _per_error(force), sp.S.Zero
    for x, integrand in blocks.integrands.items():
        gain = sp.diff(force, x)
        proportional -= gain * sp.diff(integrand, STEADY.velocity)  # the integral of a velocity acts as a displacement
        integral += gain * _per_error(integrand)
    values: dict[Any, Any] = {STEADY.error: FAR_ERROR}
    values |= {
        symbol: flat[str(symbol)]
        for gain in (proportional, integral)
        for symbol in gain.free_symbols
        if str(symbol) in flat
    }
    return float(proportional.subs(values)), float(integral.subs(values))


def _per_error(value: sp.Expr) -> sp.Expr:
    """Return the derivative of a value in steady motion by the error, at fixed reference."""
    return sp.diff(value, STEADY.error) - sp.diff(value, STEADY.position)


@dataclass(frozen=True)
class ForceLimit:
    """The force limit of a controller, in continuous time.

    `force` [N] is the limited force, `cut` [N] its difference to the demand, and `limit` [N] the limit. `kinks` are
    where the limit begins to act, so that derivatives jump. `anti_windup` is what integrators do there.
    """

    limit: sp.Expr
    force: sp.Expr
    kinks: tuple[Kink, ...]
    cut: sp.Expr
    anti_windup: AntiWindup

    @classmethod
    def of(cls, demand: Signal, anti_windup: AntiWindup) -> ForceLimit:
        """Make the force limit for a demanded force; integrators there follow `anti_windup`."""
        limit = force_limit()
        force, kinks = _clamped(demand.value, limit, "force")
        return cls(limit, force, kinks, force - demand.value, anti_windup)


@dataclass(frozen=True)
class _Integral:
    """An integrator in continuous time.

    `symbol` is its state, `integrand` its input, `settled` that input in a steady motion, and `output` what it adds to
    the force. The output may have a `limit`, and the state may `leak` at a rate [1/s].
    """

    symbol: sp.Symbol
    integrand: sp.Expr
    settled: sp.Expr
    scale: sp.Expr
    output: sp.Expr
    limit: sp.Expr | None
    leak: sp.Expr | None


class Continuous(Blocks):
    """Blocks of a controller in continuous time: every memory is a state.

    `rate` [1/s] is the natural frequency of the motion, which scales the states.
    """

    def __init__(self, rate: sp.Expr, form: ControllerForm | None = None) -> None:
        super().__init__(form)
        self.rate = rate
        self.states: list[State] = []
        self.kinks: list[Kink] = []
        self._integrals: list[_Integral] = []

    @property
    def integrands(self) -> dict[sp.Symbol, sp.Expr]:
        """Return the inputs of the integrators in a steady motion, by the symbols of their states."""
        return {integral.symbol: integral.settled for integral in self._integrals}

    def low_pass(self, signal: Signal, tau: sp.Expr, name: str, rule: FilterRule | None = None) -> Signal:
        """Return the signal behind the low-pass 1/(1 + tau s), tau [s], whose output is a state.

        `rule` has no effect in continuous time.
        """
        low = state(f"filtered_{name}")
        slope = (signal.value - low) / tau
        self.states.append(State(low, slope, "m", signal.scale, Role.FILTER, signal.settled))
        return replace(signal, value=low, rate=slope)

    def derivative(self, signal: Signal, name: str, tau: sp.Expr | None = None) -> Signal:
        """Return the derivative of a signal, filtered as s/(1 + tau s) by one state, tau [s].

        Without `tau` it is the signal's own rate. Raises ValueError if that rate is not known.
        """
        slope = signal.rate if tau is None else self.low_pass(signal, tau, name).rate
        if slope is None:
            raise ValueError(f"the derivative of {name} needs a filter")
        return Signal(slope, signal.scale * self.rate, signal.settled_rate, sp.S.Zero)

    def integral(
        self,
        signal: Signal,
        gain: sp.Expr,
        name: str = "integral",
        rule: IntegralRule = "bilinear",
        limit: sp.Expr | None = None,
        leak: sp.Expr | None = None,
    ) -> Signal:
        """Return the integral of a signal as `gain` times a state.

        The integrator follows the anti-windup at the force limit, and stops where its own output reaches `limit`. The
        state leaks at the rate `leak` [1/s], if given. `rule` has no effect in continuous time.
        """
        symbol = state(name)
        output = gain * symbol
        scale = signal.scale / self.rate
        self._integrals.append(_Integral(symbol, signal.value, signal.settled, scale, output, limit, leak))
        return Signal(output, gain * signal.scale / self.rate, output, sp.S.Zero, rate=gain * signal.value)

    def biquad(
        self, signal: Signal, upper: Polynomial, lower: Polynomial, name: str, rule: FilterRule | None = None
    ) -> Signal:
        """Return a signal behind a second-order transfer function, with two states.

        `upper` and `lower` are the coefficients of 1, s and s^2 of numerator and denominator; the first of `lower` is
        1. One state is the signal divided by the denominator, the other is its rate of change. `rule` has no effect in
        continuous time.
        """
        low, slope = state(f"filtered_{name}"), state(f"filtered_{name}_rate")
        bend = (signal.value - low - lower[1] * slope) / lower[2]
        self.states += [
            State(low, slope, "m", signal.scale, Role.FILTER, signal.settled - lower[1] * signal.settled_rate),
            State(slope, bend, "m/s", signal.scale * self.rate, Role.FILTER, signal.settled_rate),
        ]
        settled = upper[0] * signal.settled + (upper[1] - upper[0] * lower[1]) * signal.settled_rate
        value = upper[0] * low + upper[1] * slope + upper[2] * bend
        following = None if signal.rate is None else (signal.rate - slope - lower[1] * bend) / lower[2]
        straight = upper[0] * slope + upper[1] * bend
        changes = straight if upper[2] == 0 else None if following is None else straight + upper[2] * following
        return Signal(value, signal.scale, settled, upper[0] * signal.settled_rate, rate=changes)

    def limiter(self, signal: Signal, limit: sp.Expr, name: str) -> Signal:
        """Clip a signal to plus or minus `limit`.

        Each limit becomes a kink, named after `name`, at which derivatives jump.
        """
        value, kinks = _clamped(signal.value, limit, name)
        self.kinks += kinks
        between = 1 - kinks[0].beyond - kinks[1].beyond
        return replace(signal, value=value, rate=None if signal.rate is None else between * signal.rate)

    def within(self, window: str, resting: Signal) -> Signal:
        """Return 1 while a window against friction acts, and 0 elsewhere.

        Each of its ends is a kink, where derivatives jump, or a mode if the window remembers the past. A state counts
        the time to stay. Where `resting` is 0 the error counts as beyond the exit.
        """
        band, acts, square = self.key(window), 2 * resting.value - 1, self.error.value**2
        acting = resting.settled * Piecewise((1, self.error.settled**2 < band**2), (0, True))
        near = acts * band**2 - square
        if not self.settings.remembers(window):
            end = Kink(window, near)
            self.kinks.append(end)
            return replace(self.whole, value=end.beyond, settled=acting)
        leave = square - acts * self.exit_of(window) ** 2
        emptied = [integral.symbol for integral in self._integrals if window == "freeze_window"]
        empty: dict[sp.Symbol, sp.Expr] = dict.fromkeys(emptied, sp.S.Zero)
        inside = Switch(window, near, leave, near, empty, empty)
        if f"{window}_time" in self.settings:
            clock, time = state(f"{window}_clock"), self.key(f"{window}_time")
            stays = Switch(f"{window}_stays", near, -near, near, {clock: sp.S.Zero}, {clock: sp.S.Zero})
            inside = Switch(window, clock - time, leave, near, {**empty, clock: time}, {**empty, clock: sp.S.Zero})
            counts = stays.beyond * (1 - inside.beyond)
            self.states.append(State(clock, counts, "s", time, Role.FILTER, acting * time))
            self.kinks.append(stays)
        self.kinks.append(inside)
        return replace(self.whole, value=inside.beyond, settled=acting)

    def scheduled(self, signal: Signal, schedule: Schedule, name: str) -> Signal:
        """Return the factor of a schedule of gains for the size of a signal.

        At its places, and where the signal changes its sign, are kinks: derivatives jump.
        """
        positive = Kink(f"{name}_positive", signal.value)
        ends = [Kink(f"{name}_{k}", signal.value**2 - place**2) for k, place in enumerate(schedule.places)]
        self.kinks += [positive, *ends]
        value, size = schedule.factors[0], positive.sign * signal.value
        points = zip(ends, schedule.places, schedule.factors, strict=True)
        for (begin, low, first), (end, high, last) in pairwise(points):
            reached = begin.beyond * (size + end.beyond * (high - size) - low)
            value += (last - first) / (high - low) * reached
        return replace(self.whole, value=value, settled=schedule.at(sp.Abs(signal.settled)))

    @property
    def _holding(self) -> tuple[list[sp.Symbol], list[sp.Symbol]]:
        """Return the symbols of integrals in values and in settled values, which are the same."""
        symbols = [integral.symbol for integral in self._integrals]
        return symbols, symbols

    def push(self, direction: Signal) -> Signal:
        """Return the force that pushes towards the reference while the error exceeds the window.

        It acts while the reference rests, that is while its `direction` is 0. Each end of the window is a kink, where
        derivatives jump.
        """
        (push, window), error = map(self.key, ("stiction_push", "stiction_push_window")), self.error
        ahead, behind = Kink("push_ahead", error.value - window), Kink("push_behind", -error.value - window)
        self.kinks += [ahead, behind]
        side = Piecewise((1, error.settled > window), (-1, error.settled < -window), (0, True))
        resting = push * (1 - direction.value**2)
        return Signal(resting * (ahead.beyond - behind.beyond), push, push * side, sp.S.Zero)

    def dither(self) -> Signal:
        """Return the dither force over the time since the last corner of the reference."""
        amplitude, frequency = map(self.key, ("dither_amplitude", "dither_frequency"))
        return Signal(amplitude * sine(frequency * TIME), amplitude, sp.S.Zero, sp.S.Zero)

    def _begun_anew(self, error: sp.Expr) -> tuple[Kink, ...]:
        """Return a mode with memory for the sign of the error, at whose change integrals restart.

        They restart at 0. The result is empty if no integral restarts.
        """
        empty = {integral.symbol: sp.S.Zero for integral in self._integrals if "integral_reset" in self.settings}
        return (Switch("positive_error", error, -error, error, empty, empty),) if empty else ()

    def finished(self, demand: Demand, bound: ForceLimit | None) -> tuple[tuple[State, ...], tuple[Kink, ...]]:
        """Return all states and kinks, including what integrators do at limits.

        Kinks are where derivatives jump. Integrators follow the anti-windup where the demand exceeds its `bound`, and
        stop where their own output reaches a limit.
        """
        steady = wound_up(demand.force.settled, [integral.symbol for integral in self._integrals])
        states = [replace(part, settled=part.settled.xreplace(steady)) for part in self.states]
        clamp = bound if bound and bound.anti_windup == "clamp" else None
        far: list[Kink] = list(_far(clamp.kinks, clamp.limit, "rest")) if self._integrals and clamp else []
        winding: list[Kink] = []
        error = demand.error.value
        for integral in self._integrals:
            share = sp.S.One
            suffix = "" if str(integral.symbol) == "integral" else f"_{integral.symbol}"
            up = Kink(f"winding_up{suffix}", integral.integrand)
            if clamp:
                share *= 1 - _resting(clamp.kinks, tuple(far[:2]), up, clamp.limit)
            for output, limit, name in self._limits(integral, demand):
                _, ends = _clamped(output, limit, name)
                beyond = _far(ends, limit, f"rest_{name}")
                share *= 1 - _resting(ends, beyond, up, limit)
                far += [*ends, *beyond]
            if share != 1:
                winding.append(up)
            share *= self.winding[integral.symbol] * (1 - self.paused[integral.symbol])
            derivative = integral.integrand * share - self._losses(integral.symbol) * integral.symbol
            if integral.leak is not None:
                derivative -= integral.leak * integral.symbol
            if bound and bound.anti_windup == BACK_CALCULATION:  # Astrom and Hagglund, Advanced PID Control, 3.5
                gain = len(self._integrals) * sp.diff(demand.total.settled, integral.symbol)
                derivative += bound.cut / (gain * unwinding_time())
            states.append(
                State(integral.symbol, derivative, "m*s", integral.scale, Role.INTEGRAL, steady[integral.symbol])
            )
        return tuple(states), (*far, *winding, *self._begun_anew(error))

    def _limits(self, integral: _Integral, demand: Demand) -> list[tuple[sp.Expr, sp.Expr, str]]:
        """Return the limits of an integral, each as expression, limit and name; empty without any.

        An integral may have a limit of its output, and one of its part of the demanded force.
        """
        limits = [] if integral.limit is None else [(integral.output, integral.limit, str(integral.symbol))]
        if "integral_limit" in self.settings:
            force = sp.diff(demand.total.value, integral.symbol) * integral.symbol
            limits.append((force, self.key("integral_limit"), f"{integral.symbol}_force"))
        return limits


def _clamped(value: sp.Expr, limit: sp.Expr, name: str) -> tuple[sp.Expr, tuple[Kink, ...]]:
    """Return a value clamped to plus and minus a limit, and its kinks, where derivatives jump."""
    upper = Kink(f"{name}_upper", value - limit)
    lower = Kink(f"{name}_lower", -value - limit)
    return value + upper.beyond * (limit - value) - lower.beyond * (limit + value), (upper, lower)


def _far(limits: tuple[Kink, ...], limit: sp.Expr, name: str) -> tuple[Kink, ...]:
    """Return the kinks beyond which an integrator has stopped, a narrow band outside its limits.

    Kinks are where derivatives jump.
    """
    upper, lower = limits
    band = UNWINDING_BAND * limit
    return Kink(f"{name}_upper", upper.surface - band), Kink(f"{name}_lower", lower.surface - band)


def _resting(limits: tuple[Kink, ...], far: tuple[Kink, ...], winding: Kink, limit: sp.Expr) -> sp.Expr:
    """Return how far a limit stops an integrator: from 0 if it runs to 1 if it is stopped.

    The limit stops it where the value is beyond one of the `limits` and would be driven further, gradually until it is
    beyond `far`. `winding` tells in which direction it is driven.
    """
    band, rest = UNWINDING_BAND * limit, sp.S.Zero
    for kink, end, inwards in zip(limits, far, (winding.beyond, 1 - winding.beyond), strict=True):
        rest += inwards * (kink.beyond * (1 - end.beyond) * kink.surface / band + end.beyond)
    return rest
