"""The PID controller: van Dijk's form (thesis, Eq. 7 and 8) or plain gains (Eq. 6), with optional force limit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import sympy as sp

from friso.equations.component import STEADY, Component, Held, Kink, Output, Role, State, key, state
from friso.equations.structure import ControllerForm

UNWINDING_BAND = sp.Rational(1, 1000)
"""Share of the force limit over which the integrator is brought to rest.

An integrator that stops dead at the limit makes the right-hand side jump, and the solution slides along the limit
switching for ever; over this narrow band the stop is continuous and the slide is an ordinary, stiff, motion."""


@dataclass(frozen=True)
class Loop:
    """What the controller sees: error [m], position [m], its rate and that of the reference [m/s]."""

    error: sp.Expr
    position: sp.Expr
    velocity: sp.Expr
    reference_velocity: sp.Expr


@dataclass(frozen=True)
class Controller:
    """Actuator force [N], its component, and the numbers that it holds between samples."""

    force: sp.Expr
    component: Component
    held: tuple[Held, ...] = ()


def controller(form: ControllerForm, loop: Loop, length: sp.Expr, rate: sp.Expr) -> Controller:
    """The controller of the given form; `length` [m] and `rate` [1/s] are the scales of its states."""
    terms = _van_dijk if form.tuned else _gains
    shares, integrand, states = terms(form, loop, length)
    demand = shares["p"] + shares["i"] + shares["d"]
    force, kinks = _limit(demand) if form.limited else (demand, ())
    if form.integral:
        rest, resting = _rest(demand, integrand, kinks) if form.limited else (sp.S.One, ())
        kinks = (*kinks, *resting)
        integral = State(state("integral"), integrand * rest, "m*s", length / rate, Role.INTEGRAL)
        states = (*states, integral)
    outputs = {"force": Output(force, "N", "actuator force")}
    names = {"p": "proportional", "i": "integral", "d": "derivative"}
    outputs |= {f"force_{term}": Output(shares[term], "N", f"{name} share") for term, name in names.items()}
    return Controller(force, Component(states, kinks, outputs))


def loop_stiffness(form: ControllerForm | None) -> sp.Expr:
    """Proportional stiffness of the loop [N/m]; 0 without a controller."""
    if form is None:
        return sp.S.Zero
    return van_dijk_gains()["k_p"] if form.tuned else key("controller.kp")


Terms = tuple[dict[str, sp.Expr], sp.Expr, tuple[State, ...]]


def van_dijk_gains() -> dict[str, sp.Expr]:
    """Eq. 8: time constants tau_z, tau_i, tau_p [s] and gain k_p [N/m] from crossover, alpha, beta and mass."""
    omega = 2 * sp.pi * key("controller.crossover")
    root = sp.sqrt(1 / key("controller.alpha"))
    tau_z = root / omega
    return {
        "tau_z": tau_z,
        "tau_i": key("controller.beta") * tau_z,
        "tau_p": 1 / (omega * root),
        "k_p": key("controller.tuned_mass") * omega**2 / root,
    }


def van_dijk_numbers(flat: Mapping[str, Any]) -> dict[str, float]:
    """The same as numbers [SI], of a stage given as flat keys."""
    return {
        name: float(expression.subs({symbol: flat[str(symbol)] for symbol in expression.free_symbols}))
        for name, expression in van_dijk_gains().items()
    }


def _van_dijk(form: ControllerForm, loop: Loop, length: sp.Expr) -> Terms:
    """Eq. 7: the low-pass of time constant tau_p comes first, and the three terms act on what it lets through."""
    gains = van_dijk_gains()
    k_p, tau_z, tau_i, tau_p = gains["k_p"], gains["tau_z"], gains["tau_i"], gains["tau_p"]
    filtered = state("filtered_error")
    rate = (loop.error - filtered) / tau_p
    shares = {
        "p": k_p * (1 + tau_z / tau_i) * filtered,
        "i": k_p / tau_i * state("integral"),
        "d": k_p * tau_z / tau_p * (loop.error - filtered),
    }
    return shares, filtered, (State(filtered, rate, "m", length, Role.FILTER, STEADY.error),)


def _gains(form: ControllerForm, loop: Loop, length: sp.Expr) -> Terms:
    """Eq. 6: the filter of time constant tau acts on the derivative alone."""
    kp, ki, kd, tau = (key(f"controller.{name}") for name in ("kp", "ki", "kd", "tau"))
    derivative, states = _derivative(form, loop, tau, length)
    shares = {
        "p": kp * loop.error,
        "i": ki * state("integral") if form.integral else sp.S.Zero,
        "d": kd * derivative,
    }
    return shares, loop.error, states


def _derivative(form: ControllerForm, loop: Loop, tau: sp.Expr, length: sp.Expr) -> tuple[sp.Expr, tuple[State, ...]]:
    """What the derivative gain acts on [m/s], and the state of its filter."""
    if form.derivative_on == "none":
        return sp.S.Zero, ()
    on_error = form.derivative_on == "error"
    signal = loop.error if on_error else -loop.position
    if not form.filtered:
        return (loop.reference_velocity if on_error else 0) - loop.velocity, ()
    name = "filtered_error" if on_error else "filtered_position"
    low_passed = state(name) if on_error else -state(name)
    rate = (signal - low_passed) / tau
    settled = STEADY.error if on_error else STEADY.position
    return rate, (State(state(name), rate if on_error else -rate, "m", length, Role.FILTER, settled),)


def _limit(demand: sp.Expr) -> tuple[sp.Expr, tuple[Kink, ...]]:
    """The force clamped to its limit, and the kinks at the upper and the lower limit."""
    limit = key("controller.force_limit")
    upper = Kink("force_upper", demand - limit)
    lower = Kink("force_lower", -demand - limit)
    return demand + upper.beyond * (limit - demand) - lower.beyond * (limit + demand), (upper, lower)


def _rest(demand: sp.Expr, integrand: sp.Expr, limits: tuple[Kink, ...]) -> tuple[sp.Expr, tuple[Kink, ...]]:
    """The share at which the integrator runs, and its kinks.

    The integrator rests while the demanded force is beyond the limit and the error would drive it further.
    """
    upper, lower = limits
    band = UNWINDING_BAND * key("controller.force_limit")
    upper_rest = Kink("rest_upper", upper.surface - band)
    lower_rest = Kink("rest_lower", lower.surface - band)
    winding = Kink("winding_up", integrand)
    rest = sp.S.One
    for kink, far, inwards in ((upper, upper_rest, winding.beyond), (lower, lower_rest, 1 - winding.beyond)):
        held = kink.beyond * (1 - far.beyond) * kink.surface / band + far.beyond
        rest -= inwards * held
    return rest, (upper_rest, lower_rest, winding)
