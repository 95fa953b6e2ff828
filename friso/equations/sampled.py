"""The PID controller as a drive carries it out: a force computed at every sample and held until the next."""

from __future__ import annotations

import sympy as sp

from friso.equations.component import Component, Output, State, key, state
from friso.equations.pid import Controller, Loop
from friso.equations.structure import ControllerForm

SAMPLE_TIME = key("drive.sample_time")


def is_known(form: ControllerForm) -> bool:
    """Whether the discrete form of a controller is known: of gains, with a derivative of the measurement or none."""
    return not form.tuned and not form.filtered and form.derivative_on != "error"


def sampled_controller(form: ControllerForm, loop: Loop, velocity_samples: int, length: sp.Expr) -> Controller:
    """The controller of Eq. 6 at samples: the velocity is a difference over `velocity_samples`, the integral a sum.

    An integrator that would drive a force beyond its limit further rests for the sample. `length` [m] is the scale of
    the positions kept.
    """
    kp, ki, kd = (key(f"controller.{name}") for name in ("kp", "ki", "kd"))
    past = (
        [state(f"position_before_{n}") for n in range(1, velocity_samples + 1)] if form.derivative_on != "none" else []
    )
    demand = kp * loop.error
    if past:
        demand -= kd * (loop.position - past[-1]) / (velocity_samples * SAMPLE_TIME)
    updates = dict(zip(past, [loop.position, *past], strict=False))
    if form.integral:
        demand, updates[state("integral")] = _with_integral(form, ki, demand, loop.error)
    force = state("held_force")
    limit = key("controller.force_limit")
    updates[force] = sp.Max(-limit, sp.Min(limit, demand)) if form.limited else demand
    held = tuple(State(x, sp.S.Zero, "", scale=length, controlled=False) for x in updates)
    return Controller(force, Component(held, (), {"force": Output(force, "N", "actuator force")}), updates)


def _with_integral(form: ControllerForm, ki: sp.Expr, demand: sp.Expr, error: sp.Expr) -> tuple[sp.Expr, sp.Expr]:
    """The demanded force [N] with its integral share, and the new integral [m s]."""
    old = state("integral")
    new = old + SAMPLE_TIME * error
    if form.limited:
        wanted, limit = demand + ki * new, key("controller.force_limit")
        winding = sp.Or(sp.And(wanted > limit, error > 0), sp.And(wanted < -limit, error < 0))
        new = sp.Piecewise((old, winding), (new, True))
    return demand + ki * new, new
