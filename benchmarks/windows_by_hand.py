"""Write stages whose drive has windows against friction by hand, for fixed steps.

A rigid mass on LuGre friction (doi:10.1109/9.376053) under a PID with the derivative of the measurement. Of friso, only
the reading of the stage file and the pieces of its reference are used. A window of the error acts below a first error,
after a time there, until a second error. Modes change between steps (in continuous time) or at samples (in a drive).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numba import njit

from friso.equations import motion
from friso.stage import element_keys

WINDOWS = ("error_deadband", "integral_deadband", "standstill_window", "freeze_window")
ERROR, INTEGRAL, GAINS, FREEZE = range(len(WINDOWS))

NAMES = (
    *("kp", "ki", "kd", "mass", "static", "coulomb", "v_stribeck", "sigma0", "sigma1", "viscous"),
    *("reduces", "left", "decay", "in_moves", "factor", "integral_factor", "at_rest", "moving", "over_speed"),
)
"""Names of the numbers in the equations, in the order of `_force`."""


def by_hand(flat: Mapping[str, Any]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the numbers of a stage, in the order of `NAMES`, its windows (4, 3), and its schedule of gains (2, n).

    `flat` has the stage's keys in SI. A window has the error at which it is entered and left [m], and its time [s]. A
    window of 0 never acts. The schedule has places and factors.
    """
    key = {name.removeprefix("controller."): value for name, value in flat.items() if name.startswith("controller.")}
    windows = np.zeros((len(WINDOWS), 3))
    for row, name in zip(windows, WINDOWS, strict=True):
        row[:] = key.get(name, 0.0), key.get(f"{name}_exit", key.get(name, 0.0)), key.get(f"{name}_time", 0.0)
    factor = key.get("standstill_factor", 1.0)
    values = {
        **{name: key[name] for name in ("kp", "ki", "kd")},
        **{name: flat[f"friction.{name}"] for name in ("static", "coulomb", "viscous")},
        "mass": sum(flat.get(f"masses.{name}", 0.0) for name in ("cart", "stage")),
        "v_stribeck": flat["friction.stribeck_velocity"],
        "sigma0": flat["friction.bristle_stiffness"],
        "sigma1": flat["friction.bristle_damping"],
        "reduces": not {"error_deadband_exit", "error_deadband_time"} & {*key},
        "left": key.get("error_deadband_gain", 0.0),
        "decay": 1 / key["integral_deadband_decay"] if "integral_deadband_decay" in key else 0.0,
        "in_moves": not key.get("integral_rests_in_moves", False),
        "factor": factor,
        "integral_factor": key.get("standstill_integral_factor", factor),
        "at_rest": key.get("windows_at_rest", False),
        "moving": key.get("moving_factor", 1.0),
        "over_speed": "schedule_speed.1" in key,
    }
    over = "schedule_speed" if values["over_speed"] else "schedule_error"
    rows = [[flat[at] for at in element_keys(flat, f"controller.{name}")] for name in (over, "schedule_factor")]
    schedule = np.array(rows if rows[0] else [[0.0], [1.0]])
    return np.array([float(values[name]) for name in NAMES]), windows, schedule


@njit(cache=True)
def _pass_on(windows, at_rest, rests, error, dt, inside, clock):  # type: ignore[no-untyped-def]
    """Change the modes of the windows for an error after a time `dt` [s]."""
    for k in range(4):
        may = rests or not (at_rest > 0.0 or k == 3)
        near = may and abs(error) < windows[k, 0]
        if inside[k] > 0.0:
            if not may or abs(error) > windows[k, 1]:
                inside[k] = 0.0
        elif near and clock[k] >= windows[k, 2] - 0.5 * dt:
            inside[k] = 1.0
        clock[k] = clock[k] + dt if near else 0.0


@njit(cache=True)
def _shares(n, schedule, inside, rests, error, speed):  # type: ignore[no-untyped-def]
    """Return the error that acts, the factor on the gains, and that on what the integral takes in."""
    band = inside[4]
    if n[10] > 0.0:
        acts = rests or n[16] == 0.0
        lost = (1.0 - n[11]) if acts else 0.0
        acting = error - lost * min(max(error, -band), band)
    else:
        acting = error * (n[11] if inside[0] > 0.0 else 1.0)
    size = abs(speed) if n[18] > 0.0 else abs(error)
    gains = np.interp(size, schedule[0], schedule[1]) * (1.0 if rests else n[17])
    winds = gains * (n[15] if inside[2] > 0.0 else 1.0)
    gains *= n[14] if inside[2] > 0.0 else 1.0
    if inside[1] > 0.0 or inside[3] > 0.0 or (n[13] == 0.0 and not rests):
        winds = 0.0
    return acting, gains, winds


@njit(cache=True)
def _rates(n, schedule, inside, rests, ref, y, held, sampled):  # type: ignore[no-untyped-def]
    """Return the rates of position, velocity, bristle and integral."""
    x, v, z, i = y
    error = ref - x
    acting, gains, winds = _shares(n, schedule, inside, rests, error, v)
    force = gains * (n[0] * acting - n[2] * v) + n[1] * i
    if inside[3] > 0.0:
        force = 0.0
    if sampled:
        force, winds = held, 0.0
    level = n[5] + (n[4] - n[5]) * np.exp(-((v / n[6]) ** 2))
    z_rate = v - n[7] * abs(v) / level * z
    drag = n[7] * z + n[8] * z_rate + n[9] * v
    decay = n[12] * i if inside[1] > 0.0 and not sampled else 0.0
    return v, (force - drag) / n[3], z_rate, winds * acting - decay


@njit(cache=True)
def _moved(y, h, k):  # type: ignore[no-untyped-def]
    """Return the state after a time `h` [s] at the rates `k`."""
    return y[0] + h * k[0], y[1] + h * k[1], y[2] + h * k[2], y[3] + h * k[3]


@njit(cache=True)
def follow(n, windows, schedule, pieces, start, times, step, sample):  # type: ignore[no-untyped-def]
    """Return positions [m] at times [s], by steps of about `step` [s].

    `pieces`, (n, 4), are start, position, velocity and acceleration of the reference; `start` is position, velocity,
    bristle and integral. With a `sample` time [s] above 0, a drive computes the force at samples and holds it.
    """
    out, now = np.empty(len(times)), times[0]
    y = (start[0], start[1], start[2], start[3])
    inside, clock = np.zeros(5), np.zeros(4)
    inside[4] = windows[0, 0]
    piece, ticks, held, before, begun = 0, 0, 0.0, start[0], False
    out[0] = y[0]
    for number in range(1, len(times)):
        while now < times[number] - 1e-12:
            while piece + 1 < len(pieces) and pieces[piece + 1, 0] <= now + 1e-12:
                piece += 1
            p = pieces[piece]
            rests = p[2] == 0.0 and p[3] == 0.0
            end = min(times[number], pieces[piece + 1, 0]) if piece + 1 < len(pieces) else times[number]
            if not begun:
                error = p[1] - y[0]
                for k in range(4):
                    may = rests or not (n[16] > 0.0 or k == 3)
                    if may and abs(error) < windows[k, 0]:
                        inside[k], clock[k] = 1.0, windows[k, 2]
                begun = True
            if sample > 0.0:
                if now > (ticks - 1e-9) * sample:
                    t = now - p[0]
                    error = p[1] + p[2] * t + 0.5 * p[3] * t * t - y[0]
                    _pass_on(windows, n[16], rests, error, sample, inside, clock)
                    speed = (y[0] - before) / sample
                    acting, gains, winds = _shares(n, schedule, inside, rests, error, speed)
                    i = y[3] + sample * winds * acting
                    if inside[1] > 0.0:
                        i /= 1.0 + n[12] * sample
                    if inside[3] > 0.0:
                        i = 0.0
                    y = (y[0], y[1], y[2], i)
                    held = gains * (n[0] * acting - n[2] * speed) + n[1] * i
                    if inside[3] > 0.0:
                        held = 0.0
                    before = y[0]
                    ticks += 1
                end = min(end, ticks * sample)
            h = min(step, end - now)
            t = now - p[0]
            r0 = p[1] + p[2] * t + 0.5 * p[3] * t * t
            r1 = p[1] + p[2] * (t + h / 2) + 0.5 * p[3] * (t + h / 2) ** 2
            r2 = p[1] + p[2] * (t + h) + 0.5 * p[3] * (t + h) ** 2
            k1 = _rates(n, schedule, inside, rests, r0, y, held, sample > 0.0)
            k2 = _rates(n, schedule, inside, rests, r1, _moved(y, h / 2, k1), held, sample > 0.0)
            k3 = _rates(n, schedule, inside, rests, r1, _moved(y, h / 2, k2), held, sample > 0.0)
            k4 = _rates(n, schedule, inside, rests, r2, _moved(y, h, k3), held, sample > 0.0)
            y = _moved(_moved(_moved(_moved(y, h / 6, k1), h / 3, k2), h / 3, k3), h / 6, k4)
            now += h
            if sample == 0.0:
                froze = inside[3]
                _pass_on(windows, n[16], rests, r2 - y[0], h, inside, clock)
                if inside[3] != froze:
                    y = (y[0], y[1], y[2], 0.0)
        out[number] = y[0]
    return out


def relaxed(flat: Mapping[str, Any], displacement: float) -> float:
    """Return the integral [m s] with which the drive of a displaced stage at rest exerts no force."""
    numbers, windows, schedule = by_hand(flat)
    inside = np.append((displacement < windows[:, 0]).astype(float), windows[0, 0])
    acting, gains, _ = _shares(numbers, schedule, inside, True, -displacement, 0.0)
    return float(-gains * numbers[0] * acting / numbers[1])


def trace(
    flat: Mapping[str, Any], start: np.ndarray, times: np.ndarray, step: float, sample: float = 0.0
) -> np.ndarray:
    """Return positions [m] of a stage at times [s], from position, velocity, bristle and integral at the first.

    `flat` has its keys in SI, with the motion that its reference makes. `sample` [s] is the time of a drive that
    computes at samples; 0 stands for continuous time.
    """
    numbers, windows, schedule = by_hand(flat)
    pieces = np.ascontiguousarray(motion.pieces(flat, 1)[0][:, :4])
    return follow(numbers, windows, schedule, pieces, np.asarray(start, dtype=float), times, step, sample)
