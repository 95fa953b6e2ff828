"""Simulate the eight machines of `benchmarks.eight_machines` by equations written by hand, compiled by numba.

Only the reading of the stage file is shared with friso. Sources: thesis, Fig. 3 and 4 and Eq. 3 to 8 (masses, joint,
LuGre, PID); generalised Maxwell-slip: doi:10.1109/TAC.2005.858676; observer of disturbance rejection:
doi:10.1007/s11768-023-00129-y; cascade, filters and transmission: docs/controllers.md and docs/drives.md. The
integrator is the Rosenbrock method of `benchmarks.oracles.plain_runs`, whose equations have no reference that moves, no
cascade, no second encoder and no elements. Only elements that stick or slip need events: a
step across a change is halved until it hardly passes the change.
"""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from math import exp, pi, sqrt
from typing import Any

import numpy as np
from numba import njit

from benchmarks.oracles.plain_runs import factored, solved

STATES = (
    *("y", "v", "cart", "cart_v", "part", "part_v", "motor", "motor_v", "motor_z", "z1", "z2", "z3", "z4"),
    *("low", "integral", "third", "notch", "notch_rate", "passed"),
)
"""States: places and velocities, bristles, the filter of a PID, its integral, and the filters of a cascade.

An observer keeps its estimates of the error, the disturbance and the rate of the error in `low`, `integral`, `third`.
"""

Y, V, YC, VC, YP, VP, YM, VM, ZM, Z1, Z2, Z3, Z4, LOW, INTEGRAL, THIRD, NOTCH, NOTCH_RATE, PASSED = range(len(STATES))

PASSED_BY, FINEST_STEP = 1e-6, 1e-9
"""How far a step may pass the change of an element, as a fraction of its limit or of the Stribeck velocity; and the
step [s] that may pass it farther."""

REST_BAND = 1e-3
"""Band beyond the force limit in which a clamped integrator comes to rest, as a fraction of the force limit."""

WRITTEN = (
    *("masses.", "friction.", "motor_friction.", "joint.", "parasitic.", "bias.", "motion.", "transmission.", "drive."),
    *("axis.", "encoder.", "controller.kind", "controller.crossover", "controller.alpha", "controller.beta"),
    *("controller.tuned_mass", "controller.kp", "controller.ki", "controller.kd", "controller.tau", "controller.kv"),
    *("controller.derivative_on", "controller.force_limit", "controller.anti_windup", "controller.bandwidth"),
    *("controller.observer_ratio", "controller.velocity_", "controller.acceleration_feedforward"),
    *("controller.coulomb_feedforward", "controller.viscous_feedforward", "controller.proportional_on"),
    *("controller.filters.1.", "controller.filters.2."),
)
"""Beginnings of the keys that the equations contain, or whose values they assert."""

RTOL, LARGEST_STEP = 1e-7, 1e-2
"""Relative tolerance, and largest step [s]."""

MOST_STEPS = 50_000_000
"""Steps after which a part of a run counts as failed. Elements that stick and slip in turn at zero velocity take more.
"""

FRICTION = ("static", "coulomb", "stribeck_velocity", "stribeck_exponent", "bristle_stiffness", "bristle_damping")

Numbers = namedtuple(
    "Numbers",
    (
        *("stage", "cart", "part", "joined", "locked", "leaf", "leaf_d", "stroke", "limiter", "limiter_d"),
        *("mode", "mode_d", "bias", "bias_cart"),
        *("gms", "attraction", "static", "coulomb", "v_s", "exponent", "sigma_0", "sigma_1", "viscous"),
        *("k1", "k2", "k3", "k4", "a1", "a2", "a3", "a4", "s1", "s2", "s3", "s4"),
        *("screw", "drive", "drive_d", "play", "place_at_motor", "pace_at_motor"),
        *("m_static", "m_coulomb", "m_v_s", "m_exponent", "m_sigma_0", "m_sigma_1", "m_viscous"),
        *("kind", "kp", "ki", "kd", "tau", "on_error", "limit", "observer", "feedback", "believed"),
        *("kv", "per_time", "v_forward", "a_forward", "notch", "width", "depth", "pole"),
        *("acceleration", "ramp", "back"),
    ),
)
"""Numbers of the equations. `kind` is 0 for a PID with its error filtered, 1 for gains, 2 for a cascade and 3 for an
observer."""


@dataclass(frozen=True)
class Machine:
    """A machine by hand: its `numbers`, its state at rest, and the magnitudes of its states, both (states,).

    `live` has the indices of the states that move.
    """

    numbers: Any
    rest: np.ndarray
    scales: np.ndarray
    live: np.ndarray

    def settling(self, within: float, duration: float) -> float:
        """Return the longer settling time [s] of a move there and back, into a band [m].

        It is infinite if the stage stays out of the band, and NaN if the run failed.
        """
        n, state, slips = self.numbers, self.rest, np.zeros(4)
        longest, far = 0.0, n.acceleration * n.ramp**2
        corners = [0.0, n.ramp, 2 * n.ramp, n.back, n.back + n.ramp, n.back + 2 * n.ramp, duration]
        for number, (low, high) in enumerate(pairwise(corners)):
            target = far if number < 3 else 0.0
            since, state, done = _followed(
                low, high, number, target, within, state, slips, self.scales, self.live, n, RTOL
            )
            if not done:
                return np.nan
            if number in (2, 5):
                longest = max(longest, since - low)
        return longest


def machine(flat: Mapping[str, Any]) -> Machine:
    """Return the machine given by flat keys to SI numbers."""
    laws, kinds = ("lugre", "gms"), ("pid", "cascade", "adrc")
    assert not [key for key in flat if not key.startswith(WRITTEN)]
    assert not [key for key in ("asymmetry", "viscous_asymmetry") if flat.get(f"friction.{key}")]
    assert flat["friction.model"] in laws
    assert flat.get("motor_friction.model", "lugre") == "lugre"
    assert ("transmission.mass" in flat) == ("motor_friction.model" in flat)
    assert flat["controller.kind"] in kinds
    assert flat["motion.kind"] == "there_and_back"
    get = flat.get
    part = get("parasitic.mass", 0.0)
    body = get("masses.stage", 0.0) - part
    joined = "joint.limiter_stiffness" in flat
    reduced, omega = part * body / (part + body) if part else 0.0, 2 * pi * get("parasitic.frequency", 0.0)
    rubs = {name: get(f"friction.{name}", 1.0) for name in FRICTION}
    motor = {name: get(f"motor_friction.{name}", 1.0) for name in FRICTION}
    elements = {
        f"{letter}{k}": get(f"friction.element_{name}.{k}", 0.0)
        for letter, name in (("k", "stiffness"), ("a", "share"), ("s", "damping"))
        for k in range(1, 5)
    }
    numbers = Numbers(
        stage=body if joined else body + part + get("masses.cart", 0.0),
        cart=get("masses.cart", 0.0),
        part=part if joined else 0.0,
        joined=joined,
        locked=get("joint.locked", True),
        leaf=get("joint.stiffness", 0.0),
        leaf_d=get("joint.damping", 0.0),
        stroke=get("joint.stroke", 0.0),
        limiter=get("joint.limiter_stiffness", 0.0),
        limiter_d=get("joint.limiter_damping", 0.0),
        mode=reduced * omega**2,
        mode_d=2 * reduced * omega * get("parasitic.damping_ratio", 0.0),
        bias=get("bias.stage", 0.0),
        bias_cart=get("bias.cart", 0.0),
        gms=flat["friction.model"] == "gms",
        attraction=get("friction.attraction", 0.0),
        **dict(zip(("static", "coulomb", "v_s", "exponent", "sigma_0", "sigma_1"), rubs.values(), strict=True)),
        viscous=get("friction.viscous", 0.0),
        **elements,
        screw=get("transmission.mass", 0.0),
        drive=get("transmission.stiffness", 0.0),
        drive_d=get("transmission.damping", 0.0),
        play=get("transmission.backlash", 0.0),
        place_at_motor=get("encoder.position") == "motor",
        pace_at_motor=get("encoder.velocity") == "motor",
        **dict(
            zip(("m_static", "m_coulomb", "m_v_s", "m_exponent", "m_sigma_0", "m_sigma_1"), motor.values(), strict=True)
        ),
        m_viscous=get("motor_friction.viscous", 0.0),
        **_controller(flat),
        acceleration=flat["motion.acceleration"],
        ramp=flat["motion.acceleration_time"],
        back=flat["motion.return_at"],
    )
    numbers = Numbers(*(float(value) for value in numbers))
    present = {
        **{Y: 1, V: 1, YC: joined, VC: joined, YP: numbers.part, VP: numbers.part, Z1: 1, INTEGRAL: 1},
        **{YM: numbers.screw, VM: numbers.screw, ZM: numbers.screw},
        **{Z2: elements["k2"], Z3: elements["k3"], Z4: elements["k4"], LOW: numbers.kind != 2 and numbers.kind != 1},
        **{THIRD: numbers.kind == 3, NOTCH: numbers.notch, NOTCH_RATE: numbers.notch, PASSED: numbers.pole},
    }
    if numbers.kind == 1:
        present[LOW] = numbers.tau > 0
    length, bristle = 1e-5, numbers.static / max(numbers.sigma_0, numbers.k1)
    pace = 2 * pi * 10 * length
    scales = np.full(len(STATES), length)
    scales[[V, VC, VP, VM, THIRD, PASSED]] = pace
    scales[[ZM, Z1, Z2, Z3, Z4]] = bristle
    scales[INTEGRAL] = length / 60 if numbers.kind != 3 else length * 60**2
    scales[NOTCH], scales[NOTCH_RATE] = numbers.static, numbers.static * numbers.notch
    rest = np.zeros(len(STATES))
    if load := numbers.bias + numbers.bias_cart:
        assert numbers.kind < 2
        rest[INTEGRAL] = -load / numbers.ki
    return Machine(numbers, rest, scales, np.array([k for k, live in sorted(present.items()) if live]))


def _controller(flat: Mapping[str, Any]) -> dict[str, float]:
    """Return the numbers of the controller, 0 where it has none of a kind."""
    get = {name.removeprefix("controller."): value for name, value in flat.items() if name.startswith("controller.")}
    kind, limit = get["kind"], get.get("force_limit", np.inf)
    assert limit == np.inf or (get["anti_windup"] == "clamp" and kind != "adrc")
    assert kind == "cascade" or not [key for key in get if key.startswith(("filters", "acceleration", "velocity"))]
    assert "transmission.mass" not in flat or get["tau"] == 0
    zero = ("kp", "ki", "kd", "tau", "on_error", "observer", "feedback", "believed", "kv", "per_time", "v_forward")
    numbers = dict.fromkeys((*zero, "a_forward", "notch", "width", "depth", "pole"), 0.0) | {"limit": limit}
    if kind == "adrc":
        feedback = 2 * pi * get["bandwidth"]
        own = {"kind": 3, "feedback": feedback, "observer": get["observer_ratio"] * feedback}
        return numbers | own | {"believed": get["tuned_mass"]}
    if kind == "cascade":
        assert get["proportional_on"] == "error"
        assert not any(get[f"{name}"] for name in ("velocity_filter", "coulomb_feedforward", "viscous_feedforward"))
        assert not {"position_integral_time", "filters.3.kind"} & set(get)
        assert (get["filters.1.kind"], get["filters.1.path"]) == ("notch", "forward")
        assert (get["filters.2.kind"], get["filters.2.path"], get["filters.2.order"]) == ("low_pass", "feedback", 1)
        return numbers | {
            "kind": 2,
            "kv": get["kv"],
            "kp": get["kp"],
            "per_time": 1 / get["velocity_integral_time"],
            "v_forward": get["velocity_feedforward"],
            "a_forward": get["acceleration_feedforward"],
            "notch": 2 * pi * get["filters.1.frequency"],
            "width": 2 * pi * get["filters.1.width"],
            "depth": get["filters.1.depth"],
            "pole": 2 * pi * get["filters.2.frequency"],
        }
    if "crossover" in get:
        omega, root = 2 * pi * get["crossover"], sqrt(get["alpha"])
        gain, lead = get["tuned_mass"] * omega**2 * root, 1 / (omega * root)
        reset = get["beta"] * lead
        gains = {"kp": gain * (1 + lead / reset), "ki": gain / reset, "kd": gain * lead, "tau": root / omega}
        return numbers | gains | {"kind": 0, "on_error": 1}
    gains = {name: get[name] for name in ("kp", "ki", "kd", "tau")}
    return numbers | gains | {"kind": 1, "on_error": get["derivative_on"] == "error"}


@njit(cache=True)
def _level(v, static, coulomb, v_s, exponent):  # type: ignore[no-untyped-def]
    return coulomb + (static - coulomb) * exp(-(abs(v / v_s) ** exponent))


@njit(cache=True)
def _rates(t, number, x, slips, n):  # type: ignore[no-untyped-def]
    """Return dx/dt at the time t in the part of the motion with this number, of six."""
    out = np.zeros(19)
    far = n.acceleration * n.ramp**2
    since = t - n.back if number > 2 else t
    r, r_v, r_a = far, 0.0, 0.0
    if number % 3 == 0:
        r, r_v, r_a = n.acceleration * since**2 / 2, n.acceleration * since, n.acceleration
    elif number % 3 == 1:
        left = 2 * n.ramp - since
        r, r_v, r_a = far - n.acceleration * left**2 / 2, n.acceleration * left, -n.acceleration
    if number > 2:
        r, r_v, r_a = far - r, -r_v, -r_a

    place = x[YM] if n.place_at_motor > 0 else x[Y]
    pace = x[VM] if n.pace_at_motor > 0 else x[V]
    e = r - place
    winding = e
    if n.kind == 0:
        out[LOW] = (e - x[LOW]) / n.tau
        demand = n.kp * x[LOW] + n.ki * x[INTEGRAL] + n.kd * out[LOW]
        winding = x[LOW]
    elif n.kind == 1:
        rise = -pace
        if n.tau > 0:
            out[LOW] = ((e if n.on_error > 0 else -place) - x[LOW]) / n.tau
            rise = out[LOW]
        demand = n.kp * e + n.ki * x[INTEGRAL] + n.kd * rise
    elif n.kind == 2:
        out[PASSED] = n.pole * (pace - x[PASSED])
        winding = n.kv * e + n.v_forward * r_v - x[PASSED]
        before = n.kp * (winding + n.per_time * x[INTEGRAL]) + n.a_forward * r_a
        out[NOTCH] = x[NOTCH_RATE]
        out[NOTCH_RATE] = n.notch**2 * (before - x[NOTCH]) - n.width * x[NOTCH_RATE]
        demand = x[NOTCH] + ((1 - n.depth) * n.width * x[NOTCH_RATE] + out[NOTCH_RATE]) / n.notch**2
    else:
        demand = n.believed * (n.feedback**2 * x[LOW] + 2 * n.feedback * x[THIRD] + x[INTEGRAL])
        miss = e - x[LOW]
        out[LOW] = x[THIRD] + 3 * n.observer * miss
        out[THIRD] = x[INTEGRAL] - demand / n.believed + 3 * n.observer**2 * miss
        out[INTEGRAL] = n.observer**3 * miss
    if n.kind < 3:
        beyond, out[INTEGRAL] = abs(demand) - n.limit, winding
        if beyond > 0 and winding * demand > 0:
            out[INTEGRAL] *= max(0.0, 1 - beyond / (REST_BAND * n.limit))
    force = min(max(demand, -n.limit), n.limit)

    v = x[VC] if n.joined > 0 else x[V]
    level, drag = _level(v, n.static, n.coulomb, n.v_s, n.exponent), n.viscous * v
    if n.gms > 0:
        sign = 1.0 if v > 0 else -1.0
        for k, (stiff, share, damp) in enumerate(
            ((n.k1, n.a1, n.s1), (n.k2, n.a2, n.s2), (n.k3, n.a3, n.s3), (n.k4, n.a4, n.s4))
        ):
            rate = n.attraction * (sign * share - stiff * x[Z1 + k] / level) / stiff if slips[k] > 0 else v
            out[Z1 + k] = rate
            drag += stiff * x[Z1 + k] + damp * rate
    else:
        out[Z1] = v - n.sigma_0 * abs(v) / level * x[Z1]
        drag += n.sigma_0 * x[Z1] + n.sigma_1 * out[Z1]

    out[Y] = x[V]
    if n.screw > 0:
        gap, pull = x[YM] - x[Y], 0.0
        if abs(gap) > n.play / 2:
            pull = n.drive * (gap - (n.play if gap > 0 else -n.play) / 2) + n.drive_d * (x[VM] - x[V])
        level = _level(x[VM], n.m_static, n.m_coulomb, n.m_v_s, n.m_exponent)
        out[ZM] = x[VM] - n.m_sigma_0 * abs(x[VM]) / level * x[ZM]
        out[YM] = x[VM]
        rubs = n.m_sigma_0 * x[ZM] + n.m_sigma_1 * out[ZM] + n.m_viscous * x[VM]
        out[VM] = (force - pull - rubs) / n.screw
        out[V] = (pull + n.bias - drag) / n.stage
        return out
    force += n.bias
    if n.joined == 0:
        out[V] = (force + n.bias_cart - drag) / n.stage
        return out
    gap, speed = x[Y] - x[YC], x[V] - x[VC]
    pull = n.leaf * gap + n.leaf_d * speed
    if n.locked > 0:
        pull = n.limiter * gap + n.limiter_d * speed
    elif abs(gap) > n.stroke or n.stroke == 0:
        pull += n.limiter * (gap - (n.stroke if gap > 0 else -n.stroke)) + n.limiter_d * speed
    if n.part > 0:
        inner = n.mode * (x[Y] - x[YP]) + n.mode_d * (x[V] - x[VP])
        out[YP], out[VP] = x[VP], inner / n.part
        force -= inner
    out[V] = (force - pull) / n.stage
    out[YC], out[VC] = x[VC], (pull + n.bias_cart - drag) / n.cart
    return out


@njit(cache=True)
def _slopes(t, number, x, base, slips, scales, live, n):  # type: ignore[no-untyped-def]
    """Return the Jacobian of the moving states by differences, to the side on which a velocity is."""
    out = np.zeros((len(live), len(live)))
    moved = x.copy()
    for column, k in enumerate(live):
        step = 1e-7 * max(abs(x[k]), scales[k])
        moved[k] += -step if k in (V, VC, VM) and x[k] < 0 else step
        out[:, column] = (_rates(t, number, moved, slips, n)[live] - base) / (moved[k] - x[k])
        moved[k] = x[k]
    return out


@njit(cache=True)
def _passes(before, after, slips, n):  # type: ignore[no-untyped-def]
    """Return how far a step passes a change of any element, 0 if it passes none.

    It is 1 at the largest that is allowed. An element slips from its limit on, until the motion turns.
    """
    row = VC if n.joined > 0 else V
    v, worst = after[row], 0.0
    level = _level(v, n.static, n.coulomb, n.v_s, n.exponent)
    for k, (stiff, share) in enumerate(((n.k1, n.a1), (n.k2, n.a2), (n.k3, n.a3), (n.k4, n.a4))):
        if slips[k] > 0:
            if before[row] * v < 0:
                worst = max(worst, min(abs(v), abs(before[row])) / (PASSED_BY * n.v_s))
        elif v * after[Z1 + k] > 0:
            limit = share * level
            worst = max(worst, (stiff * abs(after[Z1 + k]) - limit) / (PASSED_BY * limit))
    return worst


@njit(cache=True)
def _changed(before, after, slips, n):  # type: ignore[no-untyped-def]
    """Let elements slip that have reached their limit, and stick where the motion has turned."""
    row = VC if n.joined > 0 else V
    v = after[row]
    level = _level(v, n.static, n.coulomb, n.v_s, n.exponent)
    for k, (stiff, share) in enumerate(((n.k1, n.a1), (n.k2, n.a2), (n.k3, n.a3), (n.k4, n.a4))):
        if slips[k] > 0:
            slips[k] = 1.0 if before[row] * v > 0 else 0.0
        elif v * after[Z1 + k] > 0:
            slips[k] = 1.0 if stiff * abs(after[Z1 + k]) >= share * level else 0.0


@njit(cache=True)
def _followed(start, end, number, target, within, x, slips, scales, live, n, rtol):  # type: ignore[no-untyped-def]
    """Run one part of the motion; return from when on it is in the band, the state, and whether it was run.

    The time is that of the first step inside, infinite for a stage out of the band at the end.
    """
    t, h, since = start, 1e-7, start if abs(x[Y] - target) <= within else np.inf
    base = _rates(t, number, x, slips, n)[live]
    for _ in range(MOST_STEPS):
        if t >= end:
            return since, x, True
        h = min(h, end - t, LARGEST_STEP)
        if not h > 1e-15:
            break
        slopes = _slopes(t, number, x, base, slips, scales, live, n)
        later = _rates(t + 1e-3 * h, number, x, slips, n)[live]
        forcing = (later - base) / (1e-3 * h)  # df/dt
        while True:
            lu = np.eye(len(live)) * (2.0 / h) - slopes
            order = factored(lu)
            moved = x.copy()
            g1 = solved(lu, order, base + h * forcing / 2)
            moved[live] = x[live] + 2.0 * g1
            second = _rates(t + h, number, moved, slips, n)[live]
            g2 = solved(lu, order, second - 1.5 * h * forcing - 8.0 / h * g1)
            moved[live] = x[live] + 48 / 25 * g1 + 6 / 25 * g2
            third = _rates(t + 0.6 * h, number, moved, slips, n)[live]
            g3 = solved(lu, order, third + 121 / 50 * h * forcing + (372 / 25 * g1 + 12 / 5 * g2) / h)
            g4 = solved(lu, order, third + 29 / 250 * h * forcing - (112 / 125 * g1 + 54 / 125 * g2 + 2 / 5 * g3) / h)
            moved[live] = x[live] + 19 / 9 * g1 + g2 / 2 + 25 / 108 * g3 + 125 / 108 * g4
            error = 17 / 54 * g1 + 7 / 36 * g2 + 125 / 108 * g4
            size = 0.0
            for row, k in enumerate(live):
                size = max(size, abs(error[row]) / (rtol * max(scales[k], abs(x[k]), abs(moved[k]))))
            if not size <= 1.0:  # NaN counts as too large
                h *= max(0.2, 0.9 * size ** (-1 / 3)) if size < np.inf else 0.2
            elif n.gms > 0 and h > FINEST_STEP and _passes(x, moved, slips, n) > 1.0:
                h /= 2
            else:
                break
            if not h > 1e-15:
                return since, x, False
        t += h
        if n.gms > 0:
            _changed(x, moved, slips, n)
        x = moved
        if abs(x[Y] - target) > within:
            since = np.inf
        elif since == np.inf:
            since = t
        h *= min(4.0, 0.9 * size ** (-1 / 4)) if size > 0 else 4.0
        base = _rates(t, number, x, slips, n)[live]
    return since, x, False
