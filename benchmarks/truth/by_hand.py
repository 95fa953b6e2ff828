"""Write a stage's equations by hand, for SciPy.

Only the reading of the stage file is shared with friso. Sources: thesis, Eq. 3 to 8 and Fig. 3; LuGre:
doi:10.1109/9.376053; regularised Stribeck friction: doi:10.1016/0005-1098(94)90209-7; Dahl 1968; active disturbance
rejection with its observer: doi:10.1007/s11768-023-00129-y; leaks and limits of integrals: docs/controllers.md. There
are no events: the solver's own error control finds every kink. (Settings that act within a window of the error are left
out, because the solver steps over windows that a motion passes fast.)
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from scipy.integrate import solve_ivp

STATES = ("x", "v", "x_cart", "v_cart", "x_part", "v_part", "z", "filtered", "integral", "rate")
X, V, XC, VC, XP, VP, Z, LOW, INTEGRAL, RATE = range(len(STATES))
"""Indices of the states. The last three are, for an observer, its estimates of the error, the disturbance and the rate
of the error."""

KINDS = ("pid", "adrc")
JOINTS = ("rigid", "locked", "touching", "free")
WINDUPS = ("none", "clamp", "back_calculation")
LAWS = ("none", "lugre", "dahl", "stribeck")

NAMES = (
    *("cart", "stage", "part", "mode_stiffness", "mode_damping", "joint"),
    *("k_joint", "d_joint", "stroke", "k_limiter", "d_limiter"),
    *("law", "static", "coulomb", "v_stribeck", "exponent", "sigma0", "sigma1", "viscous"),
    *("asymmetry", "viscous_asymmetry", "v_regular", "tuned", "kp", "ki", "kd", "tau", "on_error", "limit"),
    *("windup", "unwinding", "bias_cart", "bias_stage"),
    *("deadband", "motor", "k_drive", "d_drive", "play", "at_motor"),
    *("leak", "most", "observer", "feedback", "believed"),
)
"""Names of the numbers in the equations, in the order of `_rate`."""

WRITTEN = (
    *("masses.", "friction.", "joint.", "parasitic.", "bias.", "motion.", "transmission.", "encoder."),
    *("controller.kind", "controller.crossover", "controller.alpha", "controller.beta", "controller.tuned_mass"),
    *("controller.kp", "controller.ki", "controller.kd", "controller.tau", "controller.derivative_on"),
    *("controller.force_limit", "controller.anti_windup", "controller.error_deadband"),
    *("controller.bandwidth", "controller.observer_ratio", "controller.integral_leak", "controller.integral_limit"),
)
"""Beginnings of the keys that the equations contain."""

REST_BAND = 1e-3
"""Band beyond the force limit, as a fraction of it, over which the integrator comes to rest (clamping)."""


class NotWritten(Exception):
    """Error: the equations of a stage are not among those written here."""


@dataclass(frozen=True)
class ByHand:
    """The equations of one stage.

    `numbers` are in the order of `NAMES`. The pieces of its reference, (pieces, 4), are start [s], position [m],
    velocity [m/s] and acceleration [m/s^2].
    """

    numbers: np.ndarray
    pieces: np.ndarray

    def rate(self, time: float, y: np.ndarray, piece: np.ndarray) -> np.ndarray:
        return _rate(time, y, piece, self.numbers)

    def jacobian(self, time: float, y: np.ndarray, piece: np.ndarray) -> np.ndarray:
        return _jacobian(time, y, piece, self.numbers, np.maximum(np.abs(y), self.scales))

    @property
    def scales(self) -> np.ndarray:
        """Return the magnitudes of the states.

        They are the deflections of loop and bristles by friction, per time of the loop for velocities.
        """
        n = dict(zip(NAMES, self.numbers, strict=True))
        length, omega = self.length, self.omega
        bristle = n["static"] / n["sigma0"] if n["sigma0"] else 1.0
        integral = length * omega**2 if n["observer"] else length / omega
        return np.array([*[length, length * omega] * 3, bristle, length, integral, length * omega])

    @property
    def measured(self) -> int:
        """Return the index of the state that the encoder measures."""
        return XP if self.numbers[NAMES.index("at_motor")] else X

    @property
    def stiffness(self) -> float:
        """Return the proportional stiffness of the loop [N/m]."""
        return float(self.numbers[NAMES.index("kp")])

    @property
    def omega(self) -> float:
        """Return the natural frequency of mass and loop [1/s]."""
        n = dict(zip(NAMES, self.numbers, strict=True))
        return float(np.sqrt(n["kp"] / (n["cart"] + n["stage"] + n["part"] + n["motor"])))

    @property
    def length(self) -> float:
        """Return the deflection of the loop by the break-away force [m].

        Without friction it is the deflection by the bias, or 1 mm.
        """
        n = dict(zip(NAMES, self.numbers, strict=True))
        force = n["static"] or abs(n["bias_cart"]) + abs(n["bias_stage"])
        return float(force / n["kp"]) or 1e-3

    @property
    def wait(self) -> float:
        """Return the time [s] in which the integrator of a stage stuck at `length` winds up.

        It winds up to break-away.
        """
        n = dict(zip(NAMES, self.numbers, strict=True))
        return float(n["kp"] / n["ki"]) if n["ki"] else np.inf

    def held(self) -> ByHand:
        """Return the same stage with its reference at 0 for ever."""
        return ByHand(self.numbers, np.zeros((1, 4)))

    def start(self, displacement: float = 0.0) -> np.ndarray:
        """Return a start at rest, held by hand at a displacement [m] until filters have settled.

        The integral holds nothing of the error.
        """
        y = np.zeros(len(STATES))
        y[[X, XC, XP]] = displacement
        n = dict(zip(NAMES, self.numbers, strict=True))
        error = -displacement - min(max(-displacement, -n["deadband"]), n["deadband"])
        y[LOW] = error if n["on_error"] else displacement
        if observer := n["observer"]:  # a held error winds the disturbance up at a constant rate, with a constant lag
            feedback = n["feedback"]
            lag = feedback**2 * error / (3 * observer**2 + 6 * observer * feedback + feedback**2)
            y[LOW], y[RATE] = error - lag, -3 * observer * lag
            y[INTEGRAL] = n["kp"] * error / n["believed"] - feedback**2 * y[LOW] - 2 * feedback * y[RATE]
        return y

    def run(self, y: np.ndarray, times: np.ndarray, rtol: float = 1e-9, most: int = 4_000_000) -> np.ndarray:
        """Return states at the times [s], shape (times, states), from `y` at the first time.

        They are NaN after a failure.
        """
        out = np.full((len(times), len(STATES)), np.nan)
        edges = [*self.pieces[1:, 0], np.inf]
        left = most
        out[0] = y
        for piece, end in zip(self.pieces, edges, strict=True):
            stop = min(end, times[-1])
            start = max(piece[0], times[0])
            if stop <= start:
                continue
            at = times[(times > start) & (times <= stop)]
            solution = solve_ivp(
                self.rate,
                (start, stop),
                y,
                "LSODA",
                t_eval=np.unique([*at, stop]),
                args=(piece,),
                rtol=rtol,
                atol=rtol * self.scales,
                jac=self.jacobian,
                max_step=(stop - start) / 50,
            )
            left -= solution.nfev
            if not solution.success or left < 0:
                return out
            y = solution.y[:, -1]
            here = np.isin(times, at)
            out[here] = solution.y[:, np.searchsorted(solution.t, times[here])].T
        return out


def by_hand(flat: Mapping[str, Any]) -> ByHand:
    """Return the equations of a stage given as flat keys to SI numbers. Raises NotWritten."""
    law, joint = flat["friction.model"], joint_state(flat)
    if law not in LAWS:
        raise NotWritten(law)
    if missing := [key for key in flat if not key.startswith(WRITTEN)]:
        raise NotWritten(", ".join(missing))
    if joint != "rigid" and "transmission.mass" in flat:
        raise NotWritten("a transmission before a joint")
    windup = flat.get("controller.anti_windup", "none")
    if flat["controller.kind"] not in KINDS or windup not in WINDUPS:
        raise NotWritten(f"{flat['controller.kind']}, {windup}")
    part = flat.get("parasitic.mass", 0.0) if joint != "rigid" else 0.0
    stage = flat.get("masses.stage", 0.0) - part
    reduced = part * stage / (part + stage) if part else 0.0
    mode = 2 * np.pi * flat.get("parasitic.frequency", 0.0)
    values = {
        "cart": flat.get("masses.cart", 0.0),
        "stage": stage,
        "part": part,
        "mode_stiffness": mode**2 * reduced,
        "mode_damping": 2 * flat.get("parasitic.damping_ratio", 0.0) * mode * reduced,
        "joint": JOINTS.index(joint),
        "k_joint": flat.get("joint.stiffness", 0.0),
        "d_joint": flat.get("joint.damping", 0.0),
        "stroke": flat.get("joint.stroke", 0.0),
        "k_limiter": flat.get("joint.limiter_stiffness", 0.0),
        "d_limiter": flat.get("joint.limiter_damping", 0.0),
        "law": LAWS.index(law),
        "static": flat.get("friction.static", flat.get("friction.coulomb", 0.0)),
        "coulomb": flat.get("friction.coulomb", 0.0),
        "v_stribeck": flat.get("friction.stribeck_velocity", 1.0),
        "exponent": flat.get("friction.stribeck_exponent", 2.0),
        "sigma0": flat.get("friction.bristle_stiffness", 0.0),
        "sigma1": flat.get("friction.bristle_damping", 0.0),
        "viscous": flat.get("friction.viscous", 0.0),
        "asymmetry": flat.get("friction.asymmetry", 0.0),
        "viscous_asymmetry": flat.get("friction.viscous_asymmetry", 0.0),
        "v_regular": flat.get("friction.regularisation_velocity", 1.0),
        "limit": flat.get("controller.force_limit", np.inf),
        "windup": WINDUPS.index(windup),
        "unwinding": flat.get("controller.anti_windup_time", 1.0),
        "bias_cart": flat.get("bias.cart", 0.0),
        "bias_stage": flat.get("bias.stage", 0.0),
        "deadband": flat.get("controller.error_deadband", 0.0),
        "motor": flat.get("transmission.mass", 0.0),
        "k_drive": flat.get("transmission.stiffness", 0.0),
        "d_drive": flat.get("transmission.damping", 0.0),
        "play": flat.get("transmission.backlash", 0.0),
        "at_motor": _side(flat),
        "leak": 2 * np.pi * flat.get("controller.integral_leak", 0.0),
        "most": flat.get("controller.integral_limit", np.inf),
        **_gains(flat),
    }
    return ByHand(np.array([float(values[name]) for name in NAMES]), _pieces(flat))


def _side(flat: Mapping[str, Any]) -> float:
    """Return the side of the encoder: 1 at the motor, 0 at the load."""
    sides = {flat.get(f"encoder.{name}", "load") for name in ("position", "velocity")}
    if len(sides) > 1:
        raise NotWritten("two encoders")
    return float("motor" in sides)


def joint_state(flat: Mapping[str, Any]) -> str:
    """Return which of `JOINTS` a stage has."""
    if "joint.limiter_stiffness" not in flat:
        return "rigid"
    if flat["joint.locked"]:
        return "locked"
    return "free" if flat["joint.stroke"] else "touching"


def _gains(flat: Mapping[str, Any]) -> dict[str, float]:
    """Return the gains of a PID, or of an observer and its feedback."""
    if flat["controller.kind"] == "adrc":
        return _observer(flat)
    return {"observer": 0.0, "feedback": 0.0, "believed": 0.0, **_pid(flat)}


def _observer(flat: Mapping[str, Any]) -> dict[str, float]:
    """Return the observer and its feedback, with the resulting proportional and integral gain."""
    if {"controller.force_limit", "controller.integral_leak", "controller.integral_limit"} & set(flat):
        raise NotWritten("an observer with a limit or a leak")
    feedback, mass = 2 * np.pi * flat["controller.bandwidth"], flat["controller.tuned_mass"]
    observer = flat["controller.observer_ratio"] * feedback
    whole = 3 * observer**2 + 6 * observer * feedback + feedback**2
    integral = observer**3 * feedback**2 / whole
    linear = 3 * observer**2 * feedback**2 + 2 * observer**3 * feedback
    proportional = (linear - integral * (3 * observer + 2 * feedback)) / whole
    gains = {"kp": mass * proportional, "ki": mass * integral, "kd": 0.0, "tau": 0.0, "on_error": 0.0, "tuned": 0.0}
    return gains | {"observer": observer, "feedback": feedback, "believed": mass}


def _pid(flat: Mapping[str, Any]) -> dict[str, float]:
    """Return the gains of a PID.

    They are the gains of Eq. 6, or van Dijk's rules (Eq. 7, 8) with kp, ki, kd of (s tau_z + 1)(s tau_i + 1) k_p/(s
    tau_i), multiplied out.
    """
    if "controller.crossover" in flat:
        omega, alpha = 2 * np.pi * flat["controller.crossover"], flat["controller.alpha"]
        gain = flat["controller.tuned_mass"] * omega**2 * np.sqrt(alpha)
        tau_z = 1 / (omega * np.sqrt(alpha))
        tau_i = flat["controller.beta"] * tau_z
        tau_p = np.sqrt(alpha) / omega
        p, i, d = gain * (1 + tau_z / tau_i), gain / tau_i, gain * tau_z
        return {"tuned": 1.0, "kp": p, "ki": i, "kd": d, "tau": tau_p, "on_error": 1.0}
    gains = {name: flat[f"controller.{name}"] for name in ("kp", "ki", "kd", "tau")}
    return {"tuned": 0.0, **gains, "on_error": float(flat["controller.derivative_on"] == "error")}


def _pieces(flat: Mapping[str, Any]) -> np.ndarray:
    kind = flat["motion.kind"]
    if kind == "there_and_back":
        a, ramp, back = (flat[f"motion.{name}"] for name in ("acceleration", "acceleration_time", "return_at"))
        far, fast = a * ramp**2, a * ramp
        there = [[0.0, 0.0, 0.0, a], [ramp, far / 2, fast, -a], [2 * ramp, far, 0.0, 0.0]]
        home = [[back, far, 0.0, -a], [back + ramp, far / 2, -fast, a], [back + 2 * ramp, 0.0, 0.0, 0.0]]
        return np.array(there + home)
    if kind == "ramp":
        return np.array([[0.0, 0.0, flat["motion.velocity"], 0.0]])
    return np.array([[0.0, flat["motion.size"] if kind == "step" else 0.0, 0.0, 0.0]])


@njit(cache=True)
def _rate(time, y, piece, n):  # type: ignore[no-untyped-def]
    (cart, stage, part, mode_k, mode_d, joint, k_j, d_j, stroke, k_l, d_l) = n[:11]
    (law, static, coulomb, v_s, exponent, sigma0, sigma1, viscous) = n[11:19]
    (asymmetry, viscous_asymmetry, v_r, tuned, kp, ki, kd, tau, on_error, limit) = n[19:29]
    (windup, unwinding, bias_cart, bias_stage) = n[29:33]
    (deadband, motor, k_drive, d_drive, play, at_motor) = n[33:39]
    (leak, most, observer, feedback, believed) = n[39:]
    out = np.zeros(10)
    since = time - piece[0]
    r = piece[1] + since * (piece[2] + since * piece[3] / 2)
    place, pace = (y[4], y[5]) if at_motor > 0 else (y[0], y[1])
    e = r - place
    e -= min(max(e, -deadband), deadband)

    integrand = e
    if tuned > 0:
        integrand = y[7]
        demand = kp * y[7] + ki * y[8] + kd * (e - y[7]) / tau
        out[7] = (e - y[7]) / tau
    else:
        source = e if on_error > 0 else place
        rise = 0.0
        if tau > 0 and kd > 0:
            rise = (source - y[7]) / tau
            out[7] = rise
        elif kd > 0:
            rise = pace
        demand = kp * e + ki * y[8] + (kd * rise if on_error > 0 else -kd * rise)
    share = 1.0
    beyond = abs(demand) - limit
    if windup == 1 and beyond > 0 and demand * integrand > 0:
        share = max(0.0, 1 - beyond / (REST_BAND * limit))
    held = ki * y[8]
    if abs(held) > most and held * integrand > 0:
        share *= max(0.0, 1 - (abs(held) - most) / (REST_BAND * most))
    out[8] = integrand * share - leak * y[8]
    force = min(max(demand, -limit), limit)
    if windup == 2 and ki > 0:
        out[8] += (force - demand) / (ki * unwinding)
    if observer > 0:
        force = believed * (feedback**2 * y[7] + 2 * feedback * y[9] + y[8])
        short = e - y[7]
        out[7] = y[9] + 3 * observer * short
        out[9] = y[8] - force / believed + 3 * observer**2 * short
        out[8] = observer**3 * short

    v = y[1] if joint == 0 else y[3]
    sign = 1.0 if v > 0 else -1.0
    friction = 0.0
    if law > 0:
        steady = coulomb
        if law != 2:
            steady = coulomb + (static - coulomb) * np.exp(-(abs(v / v_s) ** exponent))
            steady *= 1 + asymmetry * sign
        rub = viscous * v * (1 + viscous_asymmetry * sign)
        if law == 3:
            friction = steady * np.tanh(v / v_r) + rub
        else:
            out[6] = v - sigma0 * abs(v) / steady * y[6]
            friction = sigma0 * y[6] + (sigma1 * out[6] if law == 1 else 0.0) + rub

    out[0] = y[1]
    if motor > 0:
        gap, pull = y[4] - y[0], 0.0
        if abs(gap) >= play / 2:
            pull = k_drive * (gap - (play / 2 if gap > 0 else -play / 2)) + d_drive * (y[5] - y[1])
        out[4] = y[5]
        out[5] = (force - pull) / motor
        out[1] = (pull + bias_cart + bias_stage - friction) / (cart + stage)
        return out
    if joint == 0:
        out[1] = (force + bias_cart + bias_stage - friction) / (cart + stage)
        return out
    gap, speed = y[0] - y[2], y[1] - y[3]
    contact = 0.0
    if joint == 3:
        if gap > stroke:
            contact = k_l * (gap - stroke) + d_l * speed
        elif gap < -stroke:
            contact = k_l * (gap + stroke) + d_l * speed
    else:
        contact = k_l * gap + d_l * speed
    leaves = k_j * gap + d_j * speed if joint > 1 else 0.0
    inner = 0.0
    if part > 0:
        inner = mode_k * (y[0] - y[4]) + mode_d * (y[1] - y[5])
        out[4] = y[5]
        out[5] = inner / part
    out[1] = (force + bias_stage - leaves - contact - inner) / stage
    out[2] = y[3]
    out[3] = (leaves + contact + bias_cart - friction) / cart
    return out


@njit(cache=True)
def _jacobian(time, y, piece, n, size):  # type: ignore[no-untyped-def]
    """Return the Jacobian by differences to the side on which each state is."""
    base = _rate(time, y, piece, n)
    out = np.zeros((10, 10))
    for k in range(10):
        step = 1e-7 * size[k]
        if (k == 1 or k == 3) and y[k] < 0:
            step = -step
        moved = y.copy()
        moved[k] += step
        out[:, k] = (_rate(time, moved, piece, n) - base) / (moved[k] - y[k])
    return out
