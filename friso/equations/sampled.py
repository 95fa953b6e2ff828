"""Realise controllers as a sampled drive computes them.

The force changes at each sample and is held until the next. Filters and integrals are discretised block by block, by
the rules of the drive (Franklin, Powell, Workman 1998, Digital Control of Dynamic Systems, chapter 6). Without a filter
a derivative is a difference over samples. Bode plots of a sampled drive use these equations too
(`friso.frequency.loops`).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any, get_args

import sympy as sp

from friso.equations.blocks import (
    Blocks,
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
from friso.equations.component import STEADY, Held, Piecewise, Role, clipped, key, sine, state
from friso.equations.structure import ControllerForm
from friso.stage.controllers import BACK_CALCULATION, AntiWindup, FilterRule, Polynomial
from friso.stage.rig import IntegralRule

SAMPLE_TIME = key("drive.sample_time")


def counter(loop: str) -> sp.Symbol:
    """Return the held number that counts samples since the "position" or "velocity" loop ran."""
    return state(f"samples_of_{loop}")


@dataclass(frozen=True)
class Rest:
    """Conditions at a sample under which integrators pause (`rests`) or restart (`restarts`).

    The force limit is not among them.
    """

    rests: Any = sp.false
    restarts: Any = sp.false


def sampled_controller(
    form: ControllerForm, loop: Loop, velocity_samples: int, extra: sp.Expr = sp.S.Zero, rest: Rest = Rest()
) -> tuple[sp.Expr, tuple[Held, ...]]:
    """Return the force [N] that a drive commands at a sample, and the numbers that it keeps.

    An `extra` force is added before the limit. `loop` holds what is measured at the sample. A derivative without a
    filter is a difference over `velocity_samples`. At the force limit an integrator follows its anti-windup; with
    clamping, it pauses at samples where it would drive the force further beyond the limit. `rest` has further
    conditions for integrators.
    """
    blocks = Sampled(velocity_samples, form)
    demand = demanded(form, loop_signals(loop, sp.S.One, sp.S.One), blocks)
    limit = force_limit() if form.anti_windup else None
    pushed = replace(demand.force, value=demand.force.value + extra)
    force, held = blocks.finished(replace(demand, force=pushed), form.anti_windup, rest)
    within: Any = force if limit is None else clipped(force, limit)
    return within, held


@dataclass(frozen=True)
class _Integral:
    """An integrator of a drive: the symbols of its number and of the number's next value.

    `share` is the increment of the number per sample; the output is the number times `gain`, at most `limit`. `leak`
    [1/s] is its leak, and `period` [s] that of its loop. `due` is the condition for the loop to run (None: at every
    sample).
    """

    symbol: sp.Symbol
    next: sp.Symbol
    share: sp.Expr
    gain: sp.Expr
    limit: sp.Expr | None
    leak: sp.Expr | None
    period: sp.Expr
    due: Any

    def when_due(self, value: Any, otherwise: Any = 0) -> Any:
        """Return `value` at samples where the integrator's loop runs, else `otherwise`.

        Without a condition (`due` is None) the loop always runs.
        """
        return value if self.due is None else Piecewise((value, self.due), (otherwise, True))


@dataclass(frozen=True)
class DiscreteRate:
    """Discrete-time substitute for s: 2 (1 - 1/z)/(step (1 + weight/z)), step [s]."""

    step: sp.Expr
    weight: sp.Integer

    @classmethod
    def by(cls, rule: FilterRule, period: sp.Expr, exact_at: sp.Expr) -> DiscreteRate:
        """Return the substitute for s by a discretisation rule, for a sample time `period` [s].

        The rule "prewarped" is exact at the angular frequency `exact_at` [rad/s].
        """
        if rule == "backward_euler":
            return cls(2 * period, sp.S.Zero)
        if rule == "prewarped":
            turn = exact_at * period / (4 * sp.pi)
            tangent: Any = sine(turn) / sine(turn + sp.Rational(1, 4))  # type: ignore[operator]
            return cls(2 * tangent / exact_at, sp.S.One)
        return cls(period, sp.S.One)

    def scale(self, period: sp.Expr) -> sp.Expr:
        """Return the ratio of the substitute to s at low frequencies; 1 unless it is prewarped.

        `period` [s] is the sample time.
        """
        return 2 * period / (self.step * (1 + self.weight))

    def polynomial(self, polynomial: Polynomial) -> Polynomial:
        """Return the coefficients of 1, 1/z and 1/z^2 of a polynomial in s, times (1 + weight/z)^2."""
        double, weight = 2 / self.step, self.weight
        p0, p1, p2 = polynomial[0], polynomial[1] * double, polynomial[2] * double**2
        return p0 + p1 + p2, 2 * weight * p0 + (weight - 1) * p1 - 2 * p2, weight**2 * p0 - weight * p1 + p2


class Sampled(Blocks):
    """Blocks of a controller as a sampled drive has them: memories are held between samples."""

    def __init__(self, velocity_samples: int, form: ControllerForm | None = None) -> None:
        super().__init__(form)
        self.velocity_samples = velocity_samples
        self.held: list[Held] = []
        self.restarts: dict[sp.Symbol, Any] = {}
        """Conditions under which settings against friction empty integrals, by the integrals' settled values."""
        self.period: sp.Expr = SAMPLE_TIME
        self.due: Any = None  # condition under which the present loop runs at a sample; None: always
        self._integrals: list[_Integral] = []

    @contextmanager
    def loop(self, name: str) -> Iterator[None]:
        """Mark blocks made in this context as parts of the loop `name`.

        Their numbers change only at samples at which that loop runs.
        """
        if self.form is None or name not in self.form.loops:
            yield
            return
        before, first = (self.period, self.due), len(self.held)
        passed = counter(name)
        self.period, self.due = key(f"drive.{name}_sample_time"), passed < sp.Rational(1, 2)
        yield
        due = self.due
        self.held[first:] = [
            replace(number, update=Piecewise((number.update, due), (number.symbol, True)))
            for number in self.held[first:]
        ]
        next_passed = passed + 1 > self.period / SAMPLE_TIME - sp.Rational(1, 2)
        self.held.append(Held(passed, Piecewise((0, next_passed), (passed + 1, True))))
        self.period, self.due = before

    def handed_on(self, signal: Signal, name: str) -> Signal:
        """Pass a signal to a faster loop, which holds the value while the slower loop does not run."""
        if self.due is None:
            return signal
        kept = self._previous(f"{name}_handed_on", signal.value, signal.settled)
        return replace(signal, value=Piecewise((signal.value, self.due), (kept, True)), rate=None, before=None)

    def _previous(self, name: str, value: sp.Expr, settled: sp.Expr) -> sp.Symbol:
        """Hold an expression for a sample; return the symbol of its value at the previous sample.

        `settled` is its value in a steady motion.
        """
        symbol = state(name)
        self.held.append(Held(symbol, value, settled))
        return symbol

    def low_pass(self, signal: Signal, tau: sp.Expr, name: str, rule: FilterRule | None = None) -> Signal:
        """Return the signal behind the low-pass 1/(1 + tau s), tau [s], computed at every sample.

        The low-pass is discretised by `rule`, or by the drive's own rule if it is None.
        """
        before, low = state(f"signal_before_{name}"), state(f"low_passed_{name}")
        rate = DiscreteRate.by(rule or self._own_rule, self.period, 1 / tau)
        seen = signal.value + rate.weight * before
        passed = ((2 * tau - rate.weight * rate.step) * low + rate.step * seen) / (2 * tau + rate.step)
        if rate.weight:
            self.held.append(Held(before, signal.value, signal.settled))
        self.held.append(Held(low, passed, signal.settled))
        return replace(signal, value=passed, rate=None, before=low)

    @property
    def _own_rule(self) -> FilterRule:
        """Return the discretisation rule for low-passes of the controller itself."""
        return "backward_euler" if self.form and self.form.filter_rule == "backward_euler" else "bilinear"

    def derivative(self, signal: Signal, name: str, tau: sp.Expr | None = None) -> Signal:
        """Return the derivative of a signal, filtered as s/(1 + tau s) with tau [s].

        The filter is discretised by the drive's own rule. Without `tau`, the result is a difference over
        `velocity_samples`.
        """
        scale = signal.scale / self.period
        if tau is not None:
            slope = (signal.value - self.low_pass(signal, tau, name).value) / tau
            return Signal(slope, scale, signal.settled_rate, sp.S.Zero)
        count, past = self.velocity_samples, signal.value
        for n in range(1, count + 1):
            past = self._previous(f"{name}_before_{n}", past, signal.settled - n * self.period * signal.settled_rate)
        return Signal((signal.value - past) / (count * self.period), scale, signal.settled_rate, sp.S.Zero)

    def integral(
        self,
        signal: Signal,
        gain: sp.Expr,
        name: str = "integral",
        rule: IntegralRule = "bilinear",
        limit: sp.Expr | None = None,
        leak: sp.Expr | None = None,
    ) -> Signal:
        """Return the integral of a signal as `gain` times a number that changes at every sample.

        A rule of the drive replaces `rule`. The integrator stops where its output reaches `limit`, and leaks at the
        rate `leak` [1/s], if given. Raises ValueError for an unknown `rule`.
        """
        if rule not in get_args(IntegralRule):
            raise ValueError(f"rule: {rule!r}; expected one of {', '.join(get_args(IntegralRule))}")
        symbol, following = state(name), state(f"next_{name}")
        rule = (self.form.integral_rule if self.form else None) or rule
        share = self.period * signal.value
        if rule != "backward_euler":
            before = signal.before
            if before is None:
                before = self._previous(f"{name}_signal_before", signal.value, signal.settled)
            share = self.period * before if rule == "forward_euler" else self.period / 2 * (signal.value + before)
        integral = _Integral(symbol, following, share, gain, limit, leak, self.period, self.due)
        self._integrals.append(replace(integral, share=integral.when_due(share)))
        return Signal(gain * following, gain * signal.scale * self.period, gain * symbol, sp.S.Zero)

    def biquad(
        self, signal: Signal, upper: Polynomial, lower: Polynomial, name: str, rule: FilterRule | None = None
    ) -> Signal:
        """Return a signal behind a second-order transfer function, computed at every sample.

        `upper` and `lower` are the coefficients of 1, s and s^2 of numerator and denominator. The function is
        discretised by `rule`, or by the drive's own rule if it is None.
        """
        rate = DiscreteRate.by(rule or self._own_rule, self.period, 1 / sp.sqrt(lower[2]))
        (b0, b1, b2), (a0, a1, a2) = map(rate.polynomial, (upper, lower))
        lag = (upper[1] - upper[0] * lower[1]) * rate.scale(self.period)
        settled = upper[0] * signal.settled + lag * signal.settled_rate
        back = self.period * signal.settled_rate
        u1, u2 = state(f"signal_before_{name}"), state(f"signal_before_{name}_2")
        y1, y2 = state(f"filtered_{name}"), state(f"filtered_{name}_2")
        value = (b0 * signal.value + b1 * u1 + b2 * u2 - a1 * y1 - a2 * y2) / a0
        self.held += [
            Held(u1, signal.value, signal.settled - back),
            Held(u2, u1, signal.settled - 2 * back),
            Held(y1, value, settled - upper[0] * back),
            Held(y2, y1, settled - 2 * upper[0] * back),
        ]
        return Signal(value, signal.scale, settled, upper[0] * signal.settled_rate, before=y1)

    def limiter(self, signal: Signal, limit: sp.Expr, name: str) -> Signal:
        """Clip a signal to plus or minus `limit` at every sample."""
        return replace(signal, value=clipped(signal.value, limit), rate=None, before=None)

    def within(self, window: str, resting: Signal) -> Signal:
        """Return 1 at samples at which a window against friction acts, and 0 at others.

        Held numbers remember whether it acted at the last sample, and for how long the error has been small. At samples
        where `resting` is 0 the window does not act.
        """
        band, size = self.key(window), sp.Abs(self.error.value)
        near: Any = size < band
        far: Any = size > self.exit_of(window)
        if resting is not self.whole:
            moves = resting.value < sp.Rational(1, 2)
            near, far = sp.And(near, sp.Not(moves)), sp.Or(far, moves)
        acting = resting.settled * Piecewise((1, self.error.settled**2 < band**2), (0, True))
        acts: Any = Piecewise((1, near), (0, True))
        if self.settings.remembers(window):
            inside, enters = state(f"{window}_acts"), near
            if f"{window}_time" in self.settings:
                clock, time = state(f"{window}_clock"), self.key(f"{window}_time")
                counted = Piecewise((0, sp.Not(near)), (clock + self.period, clock < time), (clock, True))
                self.held.append(Held(clock, counted, acting * time))
                enters = sp.And(near, clock > time - self.period / 2)
            acts = Piecewise((1, enters), (0, far), (inside, True))
            self.held.append(Held(inside, acts, acting))
        if window == "freeze_window":
            begins: Any = acts > 0 if self.due is None else sp.And(acts > 0, self.due)
            self.restarts |= dict.fromkeys(self._holding[1], begins)
        return replace(self.whole, value=acts, settled=acting)

    def scheduled(self, signal: Signal, schedule: Schedule, name: str) -> Signal:
        """Return the factor of a schedule of gains for the size of a signal at a sample."""
        value, settled = (schedule.at(sp.Abs(part)) for part in (signal.value, signal.settled))
        return replace(self.whole, value=value, settled=settled)

    @property
    def _holding(self) -> tuple[list[sp.Symbol], list[sp.Symbol]]:
        """Return the symbols of integrals in values, which are the next, and in settled values."""
        return [integral.next for integral in self._integrals], [integral.symbol for integral in self._integrals]

    def push(self, direction: Signal) -> Signal:
        """Return the force that pushes towards the reference, by the error at a sample.

        It acts while the reference rests, that is while its `direction` is 0.
        """
        push, window = map(self.key, ("stiction_push", "stiction_push_window"))
        way, settled = (
            Piecewise((1, part > window), (-1, part < -window), (0, True))
            for part in (self.error.value, self.error.settled)
        )
        return Signal(push * way * (1 - direction.value**2), push, push * settled, sp.S.Zero)

    def dither(self) -> Signal:
        """Return the dither force at a sample.

        Its number of turns is a held number, which grows at each sample.
        """
        amplitude, frequency = map(self.key, ("dither_amplitude", "dither_frequency"))
        turn = state("dither_turn")
        following = turn + frequency * SAMPLE_TIME
        self.held.append(Held(turn, Piecewise((following - 1, following > 1), (following, True))))
        return Signal(amplitude * sine(turn), amplitude, sp.S.Zero, sp.S.Zero)

    def _begun_anew(self, error: sp.Expr) -> Any:
        """Return the condition under which the error has changed its sign, at which integrals restart."""
        if "integral_reset" not in self.settings or not self._integrals:
            return sp.false
        before = state("error_at_change")
        self.held.append(Held(before, Piecewise((error, error**2 > 0), (before, True)), STEADY.error))
        return error * before < 0

    def finished(self, demand: Demand, anti_windup: AntiWindup | None, rest: Rest) -> tuple[sp.Expr, tuple[Held, ...]]:
        """Return the force before its limit, and all held numbers.

        `demand` is what the controller asks for, and `rest` has conditions under which integrators pause or restart.
        Integrators follow the anti-windup where the force would exceed its limit. They stop where their output would
        exceed a limit of its own.
        """
        anew = sp.Or(rest.restarts, self._begun_anew(demand.error.value))
        new: dict[Any, Any] = {}
        for integral in self._integrals:
            new[integral.next] = integral.symbol + self.winding[integral.symbol] * integral.share.xreplace(new)
        unlimited = demand.force.value.xreplace(new)
        updates: dict[Any, Any] = {}
        for integral in self._integrals:
            share: Any = self.winding[integral.symbol] * integral.share.xreplace(updates)
            rests = sp.Or(rest.rests, self.paused[integral.symbol] > 0)
            restarts = sp.Or(anew, self.restarts.get(integral.symbol, sp.false))
            clamp = force_limit() if anti_windup == "clamp" else None
            limits = [(unlimited, clamp), (integral.gain * new[integral.next], integral.limit)]
            if "integral_limit" in self.settings:
                held_force = sp.diff(demand.total.value, integral.next) * new[integral.next]
                limits.append((held_force, self.key("integral_limit")))
            for value, end in limits:
                if end is not None:
                    winding = sp.Or(sp.And(value > end, share > 0), sp.And(value < -end, share < 0))
                    rests = sp.Or(rests, winding)
            following = integral.symbol + share
            if anti_windup == BACK_CALCULATION:
                within: Any = clipped(unlimited, force_limit())
                cut = within - unlimited
                gain = len(self._integrals) * sp.diff(demand.total.settled, integral.symbol)
                following += integral.when_due(integral.period * cut / (gain * unwinding_time()))
            kept = Piecewise((share, restarts), (integral.symbol, rests), (following, True))
            leak = self._losses(integral.symbol) + (integral.leak or 0)
            left = 1 + integral.when_due(leak * integral.period) if leak else 1  # leak by backward Euler
            updates[integral.next] = kept / left
        steady: dict[Any, Any] = {**wound_up(demand.force.settled, [integral.symbol for integral in self._integrals])}
        updated: list[tuple[Any, Any]] = [(held.update, held.settled) for held in self.held]
        held = [
            replace(number, update=update.xreplace(updates), settled=settled.xreplace(steady))
            for number, (update, settled) in zip(self.held, updated, strict=True)
        ]
        held += [Held(i.symbol, updates[i.next], steady[i.symbol], Role.INTEGRAL) for i in self._integrals]
        force: Any = demand.force.value
        return force.xreplace(updates), tuple(held)
