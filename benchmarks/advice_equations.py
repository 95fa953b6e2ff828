"""Move the machines of `benchmarks.advice` by equations written by hand, solved by SciPy's LSODA.

Only the reading of the stage file is shared with friso. Sources: thesis, Fig. 3 and 4 and Eq. 3 to 8 (masses, LuGre,
PID); cascade, filters and transmission: docs/controllers.md and docs/drives.md.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import pairwise
from math import exp, pi, sqrt
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

Y, V, MOTOR, MOTOR_V, CART, CART_V, PART, PART_V, Z, MOTOR_Z, LOW, INTEGRAL, NOTCH, NOTCH_RATE = range(14)
"""Places and velocities of stage, motor, cart and the part on a mode; bristles; states of the controller."""

RTOL, STEP = 1e-6, 2e-3
"""Relative tolerance, and largest step [s]."""

KINDS = ("pid", "cascade")


def settling(flat: Mapping[str, Any], within: float) -> float:
    """Return the longer settling time [s] of a move there and back, into a band [m]; infinite if it stays out.

    The position is the one that the controller is given, of a screw the motor's if its encoder is there.
    """
    acceleration, ramp, back = (flat[f"motion.{key}"] for key in ("acceleration", "acceleration_time", "return_at"))
    far = acceleration * ramp**2
    corners = [0.0, ramp, 2 * ramp, back, back + ramp, back + 2 * ramp, flat["motion.duration"]]
    pieces = [(0.0, 0.0, acceleration), (far / 2, acceleration * ramp, -acceleration), (far, 0.0, 0.0)]
    pieces += [(far - place, -speed, -rate) for place, speed, rate in pieces]
    state, longest = np.zeros(14), 0.0
    if load := flat.get("bias.stage", 0.0):
        state[INTEGRAL] = -load / gains(flat)["ki"]
    scales = np.full(14, 1e-10)
    scales[[V, MOTOR_V, CART_V, PART_V, NOTCH_RATE]] = 1e-8
    scales[[INTEGRAL, NOTCH]] = 1e-10, 1e-6
    rates, seen = equations(flat), MOTOR if flat.get("encoder.position") == "motor" else Y
    for number, ((begin, end), piece) in enumerate(zip(pairwise(corners), pieces, strict=True)):
        run = solve_ivp(rates, (0.0, end - begin), state, "LSODA", rtol=RTOL, atol=scales, max_step=STEP, args=piece)
        state = run.y[:, -1]
        if number in (2, 5):
            outside = np.flatnonzero(np.abs(run.y[seen] - piece[0]) > within)
            last = outside[-1] if outside.size else -1
            longest = max(longest, np.inf if last == run.t.size - 1 else run.t[last + 1])
    return float(longest)


def gains(flat: Mapping[str, Any]) -> dict[str, float]:
    """Return the gains of a PID; those of van Dijk's rules follow from crossover and mass."""
    get = {name.removeprefix("controller."): value for name, value in flat.items() if name.startswith("controller.")}
    assert get["kind"] in KINDS
    if "crossover" not in get:
        return {name: get.get(name, 0.0) for name in ("kp", "ki", "kd", "tau")}
    omega, root = 2 * pi * get["crossover"], sqrt(get["alpha"])
    gain, lead = get["tuned_mass"] * omega**2 * root, 1 / (omega * root)
    reset = get["beta"] * lead
    return {"kp": gain * (1 + lead / reset), "ki": gain / reset, "kd": gain * lead, "tau": root / omega}


def rubs(flat: Mapping[str, Any], table: str) -> Callable[[float, float], tuple[float, float]]:
    """Return a function of velocity and bristle that gives LuGre's force and the bristle's rate."""
    names = ("static", "coulomb", "stribeck_velocity", "stribeck_exponent", "bristle_stiffness", "bristle_damping")
    static, coulomb, peak, exponent, stiffness, damping = (flat[f"{table}.{name}"] for name in names)
    viscous = flat[f"{table}.viscous"]

    def force(v: float, z: float) -> tuple[float, float]:
        level = coulomb + (static - coulomb) * exp(-((abs(v) / peak) ** exponent))
        rate = v - stiffness * abs(v) / level * z
        return stiffness * z + damping * rate + viscous * v, rate

    return force


def equations(flat: Mapping[str, Any]) -> Callable[..., np.ndarray]:
    """Return the rates by time, state, and the reference at the beginning of its piece (place, speed, rate)."""
    get, keys = flat.get, gains(flat)
    cascade, screw, cart = flat["controller.kind"] == "cascade", get("transmission.mass", 0.0), get("masses.cart", 0.0)
    by_rules, on_error = "controller.crossover" in flat, get("controller.derivative_on") == "error"
    kp, ki, kd, tau = (keys[name] for name in ("kp", "ki", "kd", "tau"))
    most, notch = get("controller.force_limit", np.inf), 2 * pi * get("controller.filters.1.frequency", 0.0)
    width, depth = 2 * pi * get("controller.filters.1.width", 0.0), get("controller.filters.1.depth", 0.0)
    part = get("parasitic.mass", 0.0)
    body = flat["masses.stage"] - part
    mode = (2 * pi * get("parasitic.frequency", 0.0)) ** 2 * part * body / (part + body)
    mode_d = 2 * get("parasitic.damping_ratio", 0.0) * sqrt(mode * part * body / (part + body))
    held, held_d = get("joint.limiter_stiffness", 0.0), get("joint.limiter_damping", 0.0)
    drive, drive_d, play = (get(f"transmission.{name}", 0.0) for name in ("stiffness", "damping", "backlash"))
    place_at_motor, pace_at_motor = (get(f"encoder.{name}") == "motor" for name in ("position", "velocity"))
    friction = rubs(flat, "friction")
    motor_friction = rubs(flat, "motor_friction") if screw else None
    bias, jointed = get("bias.stage", 0.0), bool(get("joint.locked"))
    kv, per_time, ahead = (
        get(f"controller.{name}", 0.0) for name in ("kv", "velocity_integral_time", "velocity_feedforward")
    )

    def rates(t: float, x: np.ndarray, place: float, speed: float, rate: float) -> np.ndarray:
        out = np.zeros(14)
        e = place + speed * t + rate * t * t / 2 - (x[MOTOR] if place_at_motor else x[Y])
        pace = x[MOTOR_V] if pace_at_motor else x[V]
        if cascade:
            winding = kv * e + ahead * (speed + rate * t) - pace
            demand = kp * (winding + x[INTEGRAL] / per_time)
        elif by_rules:
            out[LOW] = (e - x[LOW]) / tau
            winding, demand = x[LOW], kp * x[LOW] + ki * x[INTEGRAL] + kd * out[LOW]
        else:
            rise = -pace
            if tau:
                out[LOW] = rise = ((e if on_error else e - (place + speed * t + rate * t * t / 2)) - x[LOW]) / tau
            winding, demand = e, kp * e + ki * x[INTEGRAL] + kd * rise
        if notch:
            out[NOTCH], out[NOTCH_RATE] = x[NOTCH_RATE], notch**2 * (demand - x[NOTCH]) - width * x[NOTCH_RATE]
            demand = x[NOTCH] + ((1 - depth) * width * x[NOTCH_RATE] + out[NOTCH_RATE]) / notch**2
        force = min(max(demand, -most), most)
        out[INTEGRAL] = 0.0 if demand != force and winding * demand > 0 else winding
        out[Y] = x[V]
        drag, out[Z] = friction(x[CART_V] if jointed else x[V], x[Z])
        if motor_friction is not None:
            gap, pull = x[MOTOR] - x[Y], 0.0
            if abs(gap) > play / 2:
                pull = drive * (gap - (play if gap > 0 else -play) / 2) + drive_d * (x[MOTOR_V] - x[V])
            rub, out[MOTOR_Z] = motor_friction(x[MOTOR_V], x[MOTOR_Z])
            out[MOTOR], out[MOTOR_V] = x[MOTOR_V], (force - pull - rub) / screw
            force = pull
        if part:
            inner = mode * (x[Y] - x[PART]) + mode_d * (x[V] - x[PART_V])
            out[PART], out[PART_V] = x[PART_V], inner / part
            force -= inner
        if jointed:
            pull = held * (x[Y] - x[CART]) + held_d * (x[V] - x[CART_V])
            out[CART], out[CART_V] = x[CART_V], (pull - drag) / cart
            drag = pull
        out[V] = (force + bias - drag) / (body if jointed or not cart else body + cart)
        return out

    return rates
