"""The PID controller as a drive carries it out: a force computed at every sample and held until the next.

Filters and what they feed are discretised by the bilinear transform (Tustin), as in `friso.frequency.drive`: Eq. 7
wholly, Eq. 6 but for its integral, which is a sum. Without a filter the velocity is a difference of positions.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import sympy as sp

from friso.equations.component import STEADY, Held, key, state
from friso.equations.pid import Loop, van_dijk_gains
from friso.equations.structure import ControllerForm

SAMPLE_TIME = key("drive.sample_time")


@dataclass(frozen=True)
class Rest:
    """When the integrator rests for a sample, and when it begins anew, besides at the limit of the force."""

    rests: Any = sp.false
    restarts: Any = sp.false


def sampled_controller(
    form: ControllerForm, loop: Loop, velocity_samples: int, extra: sp.Expr = sp.S.Zero, rest: Rest = Rest()
) -> tuple[sp.Expr, tuple[Held, ...]]:
    """The force [N] commanded at a sample, an `extra` one added before it is limited, and what is kept for the next.

    `loop` holds what is known at the sample. The velocity of a controller without a filter is a difference over
    `velocity_samples`. An integrator that would drive a force beyond its limit further rests for the sample.
    """
    terms = _filtered if form.tuned or form.filtered else _differences
    demand, gain, share, held = terms(form, loop, velocity_samples)
    demand += extra
    if form.integral:
        integral = _integral(form, gain, share, demand, rest)
        demand, held = demand + gain * integral.update, (*held, integral)
    limit = key("controller.force_limit")
    return sp.Max(-limit, sp.Min(limit, demand)) if form.limited else demand, held


Terms = tuple[sp.Expr, sp.Expr, sp.Expr, tuple[Held, ...]]
"""Proportional and derivative share [N], gain of the integral [N/(m s)], what a sample adds to it [m s], and what is
kept."""


def _differences(form: ControllerForm, loop: Loop, velocity_samples: int) -> Terms:
    """Eq. 6 without a filter."""
    kp, ki, kd = (key(f"controller.{name}") for name in ("kp", "ki", "kd"))
    demand, held = kp * loop.error, ()
    if form.derivative_on != "none":
        past = [state(f"position_before_{n}") for n in range(1, velocity_samples + 1)]
        demand -= kd * (loop.position - past[-1]) / (velocity_samples * SAMPLE_TIME)
        held = tuple(
            Held(old, new, STEADY.position - n * SAMPLE_TIME * STEADY.velocity)
            for n, (old, new) in enumerate(zip(past, [loop.position, *past], strict=False), start=1)
        )
    return demand, ki, SAMPLE_TIME * loop.error, held


def _filtered(form: ControllerForm, loop: Loop, velocity_samples: int) -> Terms:
    """Eq. 7 with its low-pass before everything, or Eq. 6 with one before the derivative alone."""
    on_error = form.tuned or form.derivative_on == "error"
    signal = loop.error if on_error else -loop.position
    before, low = state("signal_before"), state("low_passed")
    gains = van_dijk_gains()
    tau = gains["tau_p"] if form.tuned else key("controller.tau")
    passed = ((2 * tau - SAMPLE_TIME) * low + SAMPLE_TIME * (signal + before)) / (2 * tau + SAMPLE_TIME)
    settled = STEADY.error if on_error else -STEADY.position
    held = (Held(before, signal, settled), Held(low, passed, settled))
    if form.tuned:
        k_p, tau_z, tau_i = gains["k_p"], gains["tau_z"], gains["tau_i"]
        demand = k_p * (1 + tau_z / tau_i) * passed + k_p * tau_z / tau * (signal - passed)
        return demand, k_p / tau_i, SAMPLE_TIME / 2 * (passed + low), held
    kp, ki, kd = (key(f"controller.{name}") for name in ("kp", "ki", "kd"))
    return kp * loop.error + kd * (signal - passed) / tau, ki, SAMPLE_TIME * loop.error, held


def _integral(form: ControllerForm, gain: sp.Expr, share: sp.Expr, demand: sp.Expr, rest: Rest) -> Held:
    """The integral [m s], which a sample adds a share to unless it rests; `demand` [N] is the rest of the force."""
    old = state("integral")
    new, rests = old + share, rest.rests
    if form.limited:
        wanted, limit = demand + gain * new, key("controller.force_limit")
        winding = sp.Or(sp.And(wanted > limit, share > 0), sp.And(wanted < -limit, share < 0))
        rests = sp.Or(rests, winding)
    return Held(old, sp.Piecewise((share, rest.restarts), (old, rests), (new, True)))
