"""Write stages under laws with several kinds of bristle by hand, from the papers.

They run event by event. SciPy's Radau is stopped where the velocity passes zero, an element reaches its limit, or the
stroke limiter is touched or left. Only the names of keys are shared with friso.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numba import njit
from scipy.integrate import solve_ivp

X, V, XC, VC, LOW, INTEGRAL, BRISTLES = range(7)
LAWS = ("dahl", "elasto_plastic", "rolling", "gms")
JOINTS = ("rigid", "locked", "free")
ROUNDED = 1e-4
"""Fraction of the level below which bristles of rolling friction give way in proportion (docs/friction.md)."""

ROUNDING = 1e-7
"""Fraction of its limit by which an element may fall short and still slip at the start, the accuracy of a state."""

EVENTS = 20_000
"""Most events of a run."""


@dataclass(frozen=True)
class Stage:
    """Equations of a stage whose reference stays at 0.

    `numbers` are in the order of `_rates`; elements have stiffness [N/m], share and damping [N s/m]. States are
    position and velocity of the stage and of the cart (the latter stay 0 for a rigid stage), filtered error, integral,
    and deflections of the bristles [m].
    """

    law: str
    joint: str
    numbers: np.ndarray
    elements: np.ndarray
    scales: np.ndarray
    last: dict[str, Any] = field(default_factory=dict)

    def state(self, names: Mapping[str, float]) -> np.ndarray:
        """Return friso's states by their names as states of this module."""
        order = ["position", "velocity", "cart_position", "cart_velocity", "filtered_error", "integral"]
        bristles = [name for name in names if "deflection" in name]
        return np.array([names.get(name, 0.0) for name in (*order, *bristles)])

    def run(self, y: np.ndarray, duration: float, rtol: float) -> tuple[np.ndarray, np.ndarray, float, float]:
        """Run the stage from a state.

        Returns the states at the end, their rates there, and the highest and lowest position [m] on the way.
        """
        body = V if self.joint == "rigid" else VC
        slips = np.zeros(len(self.elements[0]))
        t, y, touch = 0.0, np.array(y, dtype=float), self._touches(y)
        way = float(np.sign(y[body])) or float(np.sign(self._rates(y, slips, 1.0, touch)[body]))
        if self.law == "gms":  # an element at its share continues to slip
            bearing = [self._lacks(y, n, way, body) for n in range(len(slips))]
            slips = (np.array(bearing) <= ROUNDING * self.elements[1] * _level(y[body], self.numbers)).astype(float)
        high = low = y[X]
        for _ in range(EVENTS):
            surfaces = self._surfaces(body, slips, way, touch)
            events = [_falls(function) for function, _ in surfaces]
            result = solve_ivp(
                lambda _, y, s=slips, w=way, c=touch: self._rates(y, s, w, c),
                (t, duration), y, "Radau", events=events, rtol=rtol, atol=rtol * 1e-2 * self.scales,
            )  # fmt: skip
            if not result.success:
                break
            high, low = max(high, result.y[X].max()), min(low, result.y[X].min())
            t, y = float(result.t[-1]), result.y[:, -1].copy()
            if result.status == 0:
                return y, self._rates(y, slips, way, touch), high, low
            happened = next(k for k, times in enumerate(result.t_events) if len(times))
            what = surfaces[happened][1]
            if what == "turns":
                slips, way, y[body] = np.zeros(len(slips)), -way, 0.0
            elif what == "contact":
                touch = 0.0 if touch else float(np.sign(y[X] - y[XC]))
            else:
                slips = slips.copy()
                slips[int(what)] = 1.0
        return np.full(len(y), np.nan), np.full(len(y), np.nan), high, low

    def _rates(self, y: np.ndarray, slips: np.ndarray, way: float, touch: float) -> np.ndarray:
        return _rates(y, slips, way, touch, LAWS.index(self.law), JOINTS.index(self.joint), self.numbers, self.elements)

    def _touches(self, y: np.ndarray) -> float:
        gap, stroke = y[X] - y[XC], self.numbers[STROKE]
        return float(np.sign(gap)) if self.joint == "free" and abs(gap) > stroke else 0.0

    def _surfaces(self, body: int, slips: np.ndarray, way: float, touch: float) -> list[tuple[Any, str]]:
        """Return functions that fall through 0 at an event, each with the event's name."""
        surfaces: list[tuple[Any, str]] = [(lambda t, y: way * y[body], "turns")]
        if self.law == "gms":
            for n in np.flatnonzero(slips == 0):
                surfaces.append((lambda t, y, n=n: self._lacks(y, int(n), way, body), str(n)))
        if self.joint == "free":
            stroke = self.numbers[STROKE]
            if touch:
                surfaces.append((lambda t, y: touch * (y[X] - y[XC]) - stroke, "contact"))
            else:
                surfaces.append((lambda t, y: stroke - abs(y[X] - y[XC]), "contact"))
        return surfaces

    def _lacks(self, y: np.ndarray, n: int, way: float, body: int) -> float:
        """Return by how much an element's force is below its share of the level [N].

        The force is that along the motion.
        """
        stiffness, share, _ = self.elements
        return float(share[n] * _level(y[body], self.numbers) - way * stiffness[n] * y[BRISTLES + n])


STROKE = 10


def by_hand(flat: Mapping[str, Any]) -> Stage:
    """Return the equations of a stage given as flat keys to SI numbers.

    The controller follows van Dijk's rules (Eq. 7, 8), without limit or bias.
    """
    law = flat["friction.model"]
    joint = "rigid" if "joint.stiffness" not in flat else "locked" if flat["joint.locked"] else "free"
    count = sum(key.startswith("friction.element_stiffness.") for key in flat)
    f = {key.removeprefix("friction."): value for key, value in flat.items() if key.startswith("friction.")}
    elements = (
        np.array(
            [
                [f.get(f"element_{name}.{n + 1}", 0.0) for n in range(count)]
                for name in ("stiffness", "share", "damping")
            ]
        )
        if count
        else np.array([[f["bristle_stiffness"]], [1.0], [f.get("bristle_damping", 0.0)]])
    )
    omega, alpha = 2 * np.pi * flat["controller.crossover"], flat["controller.alpha"]
    gain, tau_z = flat["controller.tuned_mass"] * omega**2 * np.sqrt(alpha), 1 / (omega * np.sqrt(alpha))
    tau_i, tau_p = flat["controller.beta"] * tau_z, np.sqrt(alpha) / omega
    static = f.get("static", f["coulomb"])
    joints = [flat.get(f"joint.{name}", 0.0) for name in ("stiffness", "damping", "limiter_stiffness")]
    numbers = np.array(
        [
            *(gain * (1 + tau_z / tau_i), gain / tau_i, gain * tau_z, tau_p),
            *(flat["masses.cart"], flat["masses.stage"]),
            *(*joints, flat.get("joint.limiter_damping", 0.0), flat.get("joint.stroke", 0.0)),
            *(static, f["coulomb"], f.get("stribeck_velocity", 1.0), f.get("stribeck_exponent", 2.0), f["viscous"]),
            *(f.get("breakaway_deflection", 0.0), f.get("rolling_exponent", 1.0), f.get("attraction", 0.0)),
        ]
    )  # fmt: skip
    length = static / numbers[0]
    stiff = float(elements[0].sum())
    scales = np.array([length, length * omega, length, length * omega, length, length / omega])
    return Stage(law, joint, numbers, elements, np.concatenate([scales, np.full(len(elements[0]), static / stiff)]))


def _falls(function: Any) -> Any:
    function.terminal, function.direction = True, -1.0
    return function


@njit(cache=True)
def _level(v, n):  # type: ignore[no-untyped-def]
    return n[12] + (n[11] - n[12]) * np.exp(-(abs(v / n[13]) ** n[14]))


@njit(cache=True)
def _rates(y, slips, way, touch, law, joint, n, elements):  # type: ignore[no-untyped-def]
    kp, ki, kd, tau, cart, stage, k_j, d_j, k_l, d_l, stroke = n[:11]
    out = np.zeros(len(y))
    v = y[1] if joint == 0 else y[3]
    level = _level(v, n)
    drag = n[15] * v
    for i in range(len(y) - 6):
        stiffness, z = elements[0, i], y[6 + i]
        if law == 0:  # Dahl: no Stribeck effect
            rate = v - stiffness * way * v / n[12] * z
        elif law == 1:
            most, begins = level / stiffness, n[16]
            alpha = 0.0
            if way * z > begins:
                alpha = 1.0
                if way * z < most:
                    alpha = 0.5 + 0.5 * np.sin(np.pi * (way * z - (most + begins) / 2) / (most - begins))
            rate = v * (1 - alpha * way * z / most)
        elif law == 2:
            lacks = 1 - way * stiffness * z / level
            power = (n[17] - 1) / 2
            rate = v * lacks * ((lacks * lacks + ROUNDED**2) / (1 + ROUNDED**2)) ** power
        elif slips[i] > 0:
            rate = n[18] * (elements[1, i] * way - stiffness * z / level) / stiffness
        else:
            rate = v
        out[6 + i] = rate
        drag += stiffness * z + elements[2, i] * rate
    error = -y[0]
    out[4] = (error - y[4]) / tau
    out[5] = y[4]
    force = kp * y[4] + ki * y[5] + kd * out[4]
    out[0] = y[1]
    if joint == 0:
        out[1] = (force - drag) / (cart + stage)
        return out
    gap, speed = y[0] - y[2], y[1] - y[3]
    if joint == 1:
        between = k_l * gap + d_l * speed
    else:
        between = k_j * gap + d_j * speed
        if touch != 0:
            between += k_l * (gap - touch * stroke) + d_l * speed
    out[1] = (force - between) / stage
    out[2] = y[3]
    out[3] = (between - drag) / cart
    return out
