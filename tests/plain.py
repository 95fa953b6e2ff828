"""The equations of a stage written by hand, with live absolute values and conditions, to test the declared ones.

Thesis: Fig. 3 and 4 (masses, joint, limiter in parallel), Eq. 3 to 5 (LuGre), Eq. 6 to 8 (PID); design.md, section 1.
Nothing here is shared with friso but the names of states and of the keys of the stage file.
"""

from collections.abc import Callable, Mapping, Sequence
from math import cos, exp, hypot, pi, sin, sqrt, tanh
from typing import Any

Flat = Mapping[str, Any]
State = Mapping[str, float]


def reference(flat: Flat, t: float) -> tuple[float, float, float]:
    """Position [m], velocity [m/s] and acceleration [m/s^2] of the reference."""
    kind = flat["motion.kind"]
    if kind == "step":
        return flat["motion.size"], 0.0, 0.0
    if kind == "ramp":
        return flat["motion.velocity"] * t, flat["motion.velocity"], 0.0
    if kind in ("hold", "release"):
        return 0.0, 0.0, 0.0
    if kind in ("sine", "multisine", "chirp"):
        return _swings(flat, t)
    if kind == "profile":
        return _profile(flat, t)
    a, ramp, back = (flat[f"motion.{name}"] for name in ("acceleration", "acceleration_time", "return_at"))
    there, here = _stroke(a, ramp, t), _stroke(a, ramp, t - back)
    return there[0] - here[0], there[1] - here[1], there[2] - here[2]


def _stroke(a: float, ramp: float, t: float) -> tuple[float, float, float]:
    """Return a step of the reference: accelerate at a for the time `ramp`, brake for as long, stay."""
    if t <= 0:
        return 0.0, 0.0, 0.0
    if t < ramp:
        return a * t * t / 2, a * t, a
    if t < 2 * ramp:
        left = 2 * ramp - t
        return a * ramp * ramp - a * left * left / 2, a * left, -a
    return a * ramp * ramp, 0.0, 0.0


def _swings(flat: Flat, t: float) -> tuple[float, float, float]:
    """A sum of sinusoids, or one whose frequency rises evenly."""
    get = {name.removeprefix("motion."): value for name, value in flat.items() if name.startswith("motion.")}
    if get["kind"] == "chirp":
        rise = (get["end_frequency"] - get["start_frequency"]) / get["duration"]
        parts = [(get["amplitude"], 0.0, get["start_frequency"], rise)]
    elif get["kind"] == "sine":
        parts = [(get["amplitude"], 0.0, get["frequency"], 0.0)]
    else:
        parts = [(get[f"amplitude.{n}"], get.get(f"phase.{n}", 0.0), get[f"frequency.{n}"], 0.0) for n in (1, 2)]
    r = v = a = 0.0
    for size, phase, frequency, rise in parts:
        angle, rate = phase + 2 * pi * (frequency * t + rise * t * t / 2), 2 * pi * (frequency + rise * t)
        r, v = r + size * sin(angle), v + size * rate * cos(angle)
        a += size * (2 * pi * rise * cos(angle) - rate**2 * sin(angle))
    return r, v, a


def s_curve_times(distance: float, velocity: float, acceleration: float, jerk: float) -> tuple[float, float, float]:
    """Times of constant jerk, of constant acceleration and of constant velocity of an S-curve, case by case."""
    tj = min((distance / (2 * jerk)) ** (1 / 3), (velocity / jerk) ** 0.5, acceleration / jerk)
    ta = 0.0
    if tj == acceleration / jerk:  # 2 (tj + ta) and the cruise make the distance: acceleration (tj + ta)(2 tj + ta)
        reached = -1.5 * tj + (tj * tj / 4 + distance / acceleration) ** 0.5
        ta = max(0.0, min(velocity / acceleration - tj, reached))
    top = jerk * tj * (tj + ta)
    return tj, ta, max(0.0, distance / top - 2 * tj - ta)


def _profile(flat: Flat, t: float) -> tuple[float, float, float]:
    """Moves with bounded jerk, one after the other, each of seven phases, integrated one by one."""
    get = {name.removeprefix("motion."): value for name, value in flat.items() if name.startswith("motion.")}
    here, number = 0.0, 1
    while f"distance.{number}" in get:
        distance = get[f"distance.{number}"]
        sign = 1.0 if distance > 0 else -1.0
        tj, ta, tv = s_curve_times(abs(distance), get["velocity"], get["acceleration"], get["jerk"])
        r = v = a = 0.0
        for jerk, lasts in ((1, tj), (0, ta), (-1, tj), (0, tv), (-1, tj), (0, ta), (1, tj)):
            j, h = jerk * get["jerk"], min(max(t, 0.0), lasts)
            r, v, a = r + v * h + a * h * h / 2 + j * h**3 / 6, v + a * h + j * h * h / 2, a + j * h
            if t < lasts:
                return here + sign * r, sign * v, sign * a
            t -= lasts
        here += distance
        if t < get["dwell"]:
            break
        t, number = t - get["dwell"], number + 1
    return here, 0.0, 0.0


def under_conditions(flat: Flat, acceleration: float) -> Flat:
    """Return the flat keys with static and Coulomb friction under the conditions (no rail)."""
    if "conditions.load" not in flat:
        return flat
    get = {name.removeprefix("conditions."): value for name, value in flat.items() if name.startswith("conditions.")}
    load = get["load"] + get["load_per_acceleration"] * abs(acceleration)
    cold = 1 + (get["cold"] - 1) * exp(-get["running_time"] / get["warm_up_time"])
    factor = (1 + get["load_share"] * (load - 1)) * cold
    return {**flat, **{key: factor * flat[key] for key in ("friction.static", "friction.coulomb")}}


def stribeck_level(flat: Flat, v: float) -> float:
    ratio = abs(v / flat["friction.stribeck_velocity"]) ** flat["friction.stribeck_exponent"]
    gap = flat["friction.static"] - flat["friction.coulomb"]
    return flat["friction.coulomb"] + gap * exp(-ratio)


def friction(flat: Flat, v: float, z: float) -> tuple[float, float]:
    """Friction force [N] against the velocity v, and the rate of the bristles [m/s]."""
    law = flat["friction.model"]
    if law == "none":
        return 0.0, 0.0
    viscous = flat["friction.viscous"] * v
    if law == "stribeck":
        return stribeck_level(flat, v) * tanh(v / flat["friction.regularisation_velocity"]) + viscous, 0.0
    sigma_0 = flat["friction.bristle_stiffness"]
    if law == "dahl":
        return sigma_0 * z + viscous, v - sigma_0 * abs(v) / flat["friction.coulomb"] * z
    z_rate = v - sigma_0 * abs(v) / stribeck_level(flat, v) * z
    if law == "load_dependent":
        corner = 1e-7 * flat["friction.static"]
        share, load = flat["friction.load_coefficient"], hypot(flat["drive"], corner) - corner
        z_rate = v - sigma_0 * abs(v) / ((1 - share) * stribeck_level(flat, v) + share * load) * z
        viscous *= 1 - share
    if law == "elasto_plastic":
        begins, limit = flat["friction.breakaway_deflection"], stribeck_level(flat, v) / sigma_0
        rising = 0.5 * (1 + sin(pi * (abs(z) - (limit + begins) / 2) / (limit - begins)))
        alpha = 0.0 if abs(z) < begins or z * v < 0 else 1.0 if abs(z) >= limit else rising
        z_rate = v * (1 - alpha * abs(z) / limit)
    if law == "rolling":
        more = flat["friction.rolling_exponent"] - 1
        lacking = 1 - (1 if v > 0 else -1) * sigma_0 * z / stribeck_level(flat, v)
        z_rate = v * lacking * hypot(lacking, 1e-4) ** more / hypot(1, 1e-4) ** more
    return sigma_0 * z + flat["friction.bristle_damping"] * z_rate + viscous, z_rate


def aged(flat: Flat, v: float, s: State) -> tuple[float, dict[str, float]]:
    """Return force and rates of bristles whose level follows a Stribeck curve with a delay."""
    sigma_0, z, lack = flat["friction.bristle_stiffness"], s["bristle_deflection"], s["lack"]
    z_rate = v - sigma_0 * abs(v) / (flat["friction.static"] - lack) * z
    force = sigma_0 * z + flat["friction.bristle_damping"] * z_rate + flat["friction.viscous"] * v
    slides = 1 + abs(v) / flat["friction.stribeck_velocity"]
    missing = flat["friction.static"] - stribeck_level(flat, v) - lack
    return force, {"bristle_deflection": z_rate, "lack": slides * missing / flat["friction.dwell_time"]}


def elements(flat: Flat, v: float, s: State) -> tuple[float, dict[str, float]]:
    """Friction force [N] of elements that stick or slip against the velocity v, and their rates [m/s], in the mode in
    which a run begins in this state."""
    force, rate = flat["friction.viscous"] * v, {}
    for number in range(1, 4):
        stiffness, z = flat[f"friction.element_stiffness.{number}"], s[f"deflection_{number}"]
        at_limit = abs(z) >= flat[f"friction.element_strength.{number}"] / stiffness
        slips = at_limit and z * v > 0 and "friction.kinetic_share" not in flat
        rate[f"deflection_{number}"] = 0.0 if slips else v
        force += stiffness * z
    return force, rate


def generalised_elements(flat: Flat, v: float, s: State) -> tuple[float, dict[str, float]]:
    """Return force and rates of elements that slip towards their share of a Stribeck curve."""
    level, pull = stribeck_level(flat, v), flat["friction.attraction"]
    force, rate, number = flat["friction.viscous"] * v, {}, 1
    while (name := f"deflection_{number}") in s:
        z = s[name]
        stiffness, share, damping = (
            flat.get(f"friction.element_{key}.{number}", 0.0) for key in ("stiffness", "share", "damping")
        )
        slips = z * v > 0 and stiffness * abs(z) >= share * level
        rate[name] = pull * (share * (1 if v > 0 else -1) - stiffness * z / level) / stiffness if slips else v
        force += stiffness * z + damping * rate[name]
        number += 1
    return force, rate


def cascade(
    flat: Flat, s: State, error: float, v: float, y: float, r_rate: float, r_bend: float
) -> tuple[float, dict[str, float]]:
    """Return force and rates of a position loop over a velocity loop, with the force limit."""
    keys = {name.removeprefix("controller."): value for name, value in flat.items() if name.startswith("controller.")}
    rates: dict[str, float] = {}
    if keys["velocity_filter"] > 0:
        rates["filtered_velocity"] = (v - s["filtered_velocity"]) / keys["velocity_filter"]
        v = s["filtered_velocity"]
    v = filtered(flat, s, "feedback", v, rates)
    wanted = keys["kv"] * error + keys["velocity_feedforward"] * r_rate
    if "position_integral_time" in keys:
        rates["position_integral"] = error
        wanted += keys["kv"] / keys["position_integral_time"] * s["position_integral"]
    demand = keys["kp"] * ((wanted if keys["proportional_on"] == "error" else 0.0) - v)
    if "velocity_integral_time" in keys:
        rates["velocity_integral"] = wanted - v
        demand += keys["kp"] / keys["velocity_integral_time"] * s["velocity_integral"]
    demand += keys["acceleration_feedforward"] * r_bend + keys["viscous_feedforward"] * r_rate
    demand += keys["coulomb_feedforward"] * (float(r_rate > 0) - float(r_rate < 0))
    demand = filtered(flat, s, "forward", demand, rates)
    if "force_limit" not in keys:
        return demand, rates
    bound = keys["force_limit"]
    rest = min(max((abs(demand) - bound) / (bound / 1000), 0.0), 1.0)
    for name in {"position_integral", "velocity_integral"} & {*rates}:
        rates[name] *= 1 - rest * (rates[name] * demand > 0)
    return min(max(demand, -bound), bound), rates


def filtered(flat: Flat, s: State, path: str, u: float, rates: dict[str, float]) -> float:
    """A signal behind the filters of a path, whose states' rates are added to the `rates`."""
    for n in range(1, 13):
        row = f"controller.filters.{n}"
        if f"{row}.path" not in flat:
            break
        if flat[f"{row}.path"] != path:
            continue
        kind, name = flat[f"{row}.kind"], f"filtered_filter_{n}"
        low, slope = s[name], s.get(f"{name}_rate", 0.0)
        if kind == "lead_lag" or flat.get(f"{row}.order") == 1:
            pole = 2 * pi * flat[f"{row}.{'pole_' if kind == 'lead_lag' else ''}frequency"]
            rates[name] = (u - low) * pole
            u = low + (rates[name] / (2 * pi * flat[f"{row}.zero_frequency"]) if kind == "lead_lag" else 0.0)
            continue
        if kind == "notch":
            w, width = 2 * pi * flat[f"{row}.frequency"], 2 * pi * flat[f"{row}.width"]
            numerator = (1.0, (1 - flat[f"{row}.depth"]) * width / w**2, 1 / w**2)
            denominator = (1.0, width / w**2, 1 / w**2)
        elif kind == "sampled_biquad":  # z^-1 = (1 - s T/2)/(1 + s T/2), a power of (1 + s T/2)^2 left out
            h = flat[f"{row}.sample_time"] / 2
            b = [flat[f"{row}.numerator.{k}"] for k in (1, 2, 3)]
            a = [1.0, *(flat[f"{row}.denominator.{k}"] for k in (1, 2))]
            numerator, denominator = (
                tuple(c / sum(a) for c in (p[0] + p[1] + p[2], 2 * h * (p[0] - p[2]), h * h * (p[0] - p[1] + p[2])))
                for p in (b, a)
            )
        else:
            w = 2 * pi * flat[f"{row}.{'pole_' if kind == 'biquad' else ''}frequency"]
            zeta = flat[f"{row}.{'pole_damping' if kind == 'biquad' else 'damping_ratio'}"]
            denominator, numerator = (1.0, 2 * zeta / w, 1 / w**2), (1.0, 0.0, 0.0)
            if kind == "biquad":
                w_z = 2 * pi * flat[f"{row}.zero_frequency"]
                numerator = (1.0, 2 * flat[f"{row}.zero_damping"] / w_z, 1 / w_z**2)
        bend = (u - low - denominator[1] * slope) / denominator[2]
        rates |= {name: slope, f"{name}_rate": bend}
        u = numerator[0] * low + numerator[1] * slope + numerator[2] * bend
    return u


def control(
    flat: Flat, s: State, y: float, v: float, r: float, r_rate: float, r_bend: float
) -> tuple[float, dict[str, float]]:
    """Actuator force [N] and the rates of the controller's states."""
    error = r - y
    if flat["controller.kind"] == "cascade":
        return cascade(flat, s, error, v, y, r_rate, r_bend)
    of_filters: dict[str, float] = {}
    y = filtered(flat, s, "feedback", y, of_filters)
    error = r - y
    if "controller.crossover" in flat:
        omega = 2 * pi * flat["controller.crossover"]
        alpha = flat["controller.alpha"]
        tau_z = sqrt(1 / alpha) / omega
        tau_i = flat["controller.beta"] * tau_z
        tau_p = 1 / (omega * sqrt(1 / alpha))
        k_p = flat["controller.tuned_mass"] * omega**2 / sqrt(1 / alpha)
        passed = s["filtered_error"]
        slope = (error - passed) / tau_p
        demand = k_p * ((1 + tau_z / tau_i) * passed + s["integral"] / tau_i + tau_z * slope)
        rates, winding = {"filtered_error": slope}, passed
    else:
        kp, ki, kd, tau = (flat[f"controller.{name}"] for name in ("kp", "ki", "kd", "tau"))
        rates = {}
        if flat["controller.derivative_on"] == "error":
            slope = (error - s["filtered_error"]) / tau if "filtered_error" in s else 0.0
            rates["filtered_error"] = slope
        else:
            slope = -(y - s["filtered_position"]) / tau if "filtered_position" in s else -v
            rates["filtered_position"] = -slope
        demand = kp * error + ki * s.get("integral", 0.0) + kd * slope
        winding = error
    rates |= {"integral": winding, **of_filters}
    demand = filtered(flat, s, "forward", demand, rates)
    if "controller.force_limit" not in flat:
        return demand, rates
    bound, anti_windup = flat["controller.force_limit"], flat.get("controller.anti_windup", "clamp")
    if anti_windup == "back_calculation":
        gain = k_p / tau_i if "controller.crossover" in flat else flat["controller.ki"]
        rates["integral"] += (min(max(demand, -bound), bound) - demand) / gain / flat["controller.anti_windup_time"]
    if anti_windup == "clamp" and winding * demand > 0:  # it rests beyond the limit and a 1000th
        rates["integral"] = winding * (1 - min(max((abs(demand) - bound) / (bound / 1000), 0.0), 1.0))
    return min(max(demand, -bound), bound), rates


def joint(flat: Flat, deflection: float, rate: float) -> float:
    """Force [N] of the joint on the cart; the limiter works beside the leaf springs once it touches."""
    stiff, damp = flat["joint.limiter_stiffness"], flat["joint.limiter_damping"]
    if flat["joint.locked"]:
        return stiff * deflection + damp * rate
    force = flat["joint.stiffness"] * deflection + flat["joint.damping"] * rate
    stroke = flat["joint.stroke"]
    pulls = flat.get("joint.limiter_pulls", True)
    if deflection > stroke:
        touch = stiff * (deflection - stroke) + damp * rate
        return force + (touch if pulls else max(touch, 0.0))
    if deflection < -stroke:
        touch = stiff * (deflection + stroke) + damp * rate
        return force + (touch if pulls else min(touch, 0.0))
    if stroke == 0:
        return force + damp * rate
    return force


SIDE_BY_SIDE = {"maxwell_slip": elements, "gms": generalised_elements, "dwell": aged}


def rates(flat: Flat, names: Sequence[str]) -> Callable[[float, Sequence[float]], list[float]]:
    """dx/dt as a function of time [s] and the states called `names`."""

    def right_hand_side(t: float, x: Sequence[float]) -> list[float]:
        s = dict(zip(names, x, strict=True))
        y, v = s["position"], s["velocity"]
        force, rate = control(flat, s, y, v, *reference(flat, t))
        driven, force = force, force + flat.get("bias.stage", 0.0)
        rate |= {"position": v}
        cart_velocity, rubbing = s.get("cart_velocity", v), under_conditions(flat, reference(flat, t)[2])
        rubbing = {**rubbing, "drive": driven}
        if flat["friction.model"] in SIDE_BY_SIDE:
            drag, rates_within = SIDE_BY_SIDE[flat["friction.model"]](rubbing, cart_velocity, s)
            rate |= rates_within
        else:
            drag, rate["bristle_deflection"] = friction(rubbing, cart_velocity, s.get("bristle_deflection", 0.0))
        drag -= flat.get("bias.cart", 0.0)
        if "joint.limiter_stiffness" not in flat:
            rate["velocity"] = (force - drag) / (flat.get("masses.cart", 0.0) + flat.get("masses.stage", 0.0))
            return [rate[name] for name in names]
        mass = flat["masses.stage"]
        inner = 0.0
        if "parasitic.frequency" in flat:
            part = flat["parasitic.mass"]
            mass -= part
            reduced = 1 / (1 / part + 1 / mass)
            omega = 2 * pi * flat["parasitic.frequency"]
            stretch, opening = y - s["parasitic_position"], v - s["parasitic_velocity"]
            inner = reduced * (omega**2 * stretch + 2 * flat["parasitic.damping_ratio"] * omega * opening)
            rate |= {"parasitic_position": s["parasitic_velocity"], "parasitic_velocity": inner / part}
        pull = joint(flat, y - s["cart_position"], v - cart_velocity)
        rate["velocity"] = (force - pull - inner) / mass
        rate["cart_position"] = cart_velocity
        rate["cart_velocity"] = (pull - drag) / flat["masses.cart"]
        return [rate[name] for name in names]

    return right_hand_side
