"""Equations of a stage written by hand, from the papers: the reference of tests and benchmarks.

Nothing is shared with friso but the names of the keys of a stage file and of states. There are two sets. The first
(`by_hand`) is a stage in continuous time. SciPy follows it, from event to event (`followed`) or by its control of the
error alone (`run`); over thousands of periods it is followed by the Rosenbrock method of Kaps and Rentrop with
Shampine's coefficients (`long_run`, `settling`; ACM Trans. Math. Software 8, 1982, doi:10.1145/355993.355994). The
second (`trace`) is a drive with windows against friction, in fixed steps, with modes that change between steps or at
samples.

Sources: thesis, Fig. 3 and 4 and Eq. 3 to 8 (masses, joint, limiter in parallel, LuGre, PID); LuGre:
doi:10.1109/9.376053; regularised Stribeck friction: doi:10.1016/0005-1098(94)90209-7; Dahl 1968; generalised
Maxwell-slip: doi:10.1109/TAC.2005.858676; Maxwell-slip: Iwan 1966, doi:10.1115/1.3625199; observer of disturbance
rejection: doi:10.1007/s11768-023-00129-y; other laws: docs/friction.md; cascade, filters, leaks and limits of
integrals: docs/controllers.md; transmission: docs/drives.md.
"""

from __future__ import annotations

import warnings
from collections import namedtuple
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from scipy.integrate import ODEintWarning, odeint, solve_ivp

Flat = Mapping[str, Any]

X, V, XC, VC, XF, VF, ZM, LACK, LOW, INTEGRAL, OUTER, PACE, RATE, Z = range(14)
"""States: places and velocities of stage, cart, and the motor or the part on a mode; the motor's bristle; the lack of a
level that follows late; filter and integral of the controller (of an observer its error and disturbance), the integral
of a position loop, a filtered velocity, the observed rate of the error. From `Z` on: bristles or elements, and then two
states for each filter."""

NAMES: dict[str, int] = {
    **{"position": X, "velocity": V, "cart_position": XC, "cart_velocity": VC, "motor_position": XF},
    **{"motor_velocity": VF, "parasitic_position": XF, "parasitic_velocity": VF, "bristle_deflection": Z, "lack": LACK},
    **{"motor_bristle_deflection": ZM, "filtered_error": LOW, "filtered_position": LOW, "integral": INTEGRAL},
    **{"velocity_integral": INTEGRAL, "position_integral": OUTER, "filtered_velocity": PACE},
}
"""States by friso's names, but for elements and filters, which are numbered."""

LAWS = (
    *("none", "lugre", "dahl", "stribeck", "dwell", "load_dependent", "elasto_plastic", "rolling"),
    *("gms", "maxwell_slip"),
)
NONE, LUGRE, DAHL, STRIBECK, DWELL, LOAD, PLASTIC, ROLLING, GMS, MAXWELL = range(len(LAWS))
KINDS = ("pid", "cascade", "adrc")
PID, CASCADE, OBSERVER = range(len(KINDS))
JOINTS = ("rigid", "locked", "touching", "free")
RIGID, LOCKED, TOUCHING, FREE = range(len(JOINTS))
WINDUPS = ("none", "clamp", "back_calculation")
FORWARD, FEEDBACK = 0.0, 1.0
MOST_FILTERS = 12

RUBS = {
    **dict.fromkeys(("law", "static", "coulomb", "bristle_stiffness", "bristle_damping", "viscous"), 0.0),
    **dict.fromkeys(("asymmetry", "viscous_asymmetry", "breakaway_deflection", "attraction", "load_coefficient"), 0.0),
    **dict.fromkeys(("stribeck_velocity", "regularisation_velocity", "rolling_exponent", "dwell_time"), 1.0),
    **{"stribeck_exponent": 2.0, "kinetic_share": 1.0},
}
"""Keys of friction, and what they are if they are not given."""

KEYS = {
    **{"cart": "masses.cart", "stage": "masses.stage", "bias_cart": "bias.cart", "bias_stage": "bias.stage"},
    **{"k_joint": "joint.stiffness", "d_joint": "joint.damping", "stroke": "joint.stroke"},
    **{"k_limiter": "joint.limiter_stiffness", "d_limiter": "joint.limiter_damping", "pulls": "joint.limiter_pulls"},
    **{"part": "parasitic.mass", "motor": "transmission.mass", "k_drive": "transmission.stiffness"},
    **{"d_drive": "transmission.damping", "play": "transmission.backlash", "load": "conditions.load"},
    **{"load_share": "conditions.load_share", "load_per_acceleration": "conditions.load_per_acceleration"},
    **{"deadband": "controller.error_deadband", "limit": "controller.force_limit"},
    **{"most": "controller.integral_limit", "unwinding": "controller.anti_windup_time"},
    **{"kp": "controller.kp", "ki": "controller.ki", "kd": "controller.kd", "tau": "controller.tau"},
    **{"kv": "controller.kv", "pace_time": "controller.velocity_filter"},
    **{"v_forward": "controller.velocity_feedforward", "a_forward": "controller.acceleration_feedforward"},
    **{"coulomb_forward": "controller.coulomb_feedforward", "viscous_forward": "controller.viscous_feedforward"},
}
"""Numbers of the equations that are keys of the stage file."""

UNLESS_GIVEN = {"pulls": 1.0, "load": 1.0, "limit": np.inf, "most": np.inf, "unwinding": 1.0}

MORE = (
    *("joint", "mode_k", "mode_d", "place_at_motor", "pace_at_motor", "cold", "kind", "windup", "tuned", "on_error"),
    *("leak", "observer", "feedback", "believed", "outer", "inner", "on_target"),
)

NUMBERS = np.dtype([(name, float) for name in (*KEYS, *MORE)])
RUB = np.dtype([(name, float) for name in RUBS])

OTHER_KEYS = (
    *("kind", "crossover", "alpha", "beta", "tuned_mass", "derivative_on", "anti_windup", "bandwidth"),
    *("observer_ratio", "integral_leak", "position_integral_time", "velocity_integral_time", "proportional_on"),
)
WRITTEN = (
    *("masses.", "friction.", "motor_friction.", "joint.", "parasitic.", "bias.", "motion.", "transmission.", "axis."),
    *("encoder.", "conditions.", "controller.filters."),
    *(f"controller.{key}" for key in OTHER_KEYS),
    *(key for key in KEYS.values() if key.startswith("controller.")),
)
"""Beginnings of the keys that the equations contain."""

REST_BAND = 1e-3
"""Band beyond a limit, as a fraction of it, over which an integral comes to rest (clamping)."""

ROUNDED = 1e-4
"""Fraction of the level below which bristles of rolling friction give way in proportion (docs/friction.md)."""

ROUNDING = 1e-7
"""Fraction of its limit by which an element may fall short and still slip at the start, the accuracy of a state."""

PASSED_BY, FINEST_STEP = 1e-6, 1e-9
"""How far a step of a long run may pass the change of an element, as a fraction of its limit or of the Stribeck
velocity; and the step [s] that may pass it farther."""

SPEED = {"kp": 2, "ki": 3, "kd": 1, "tau": -1}
"""Powers of the factor by which the gains of a PID change when it becomes faster as a whole."""

MOST_EVENTS, MOST_TURNS, MOST_STEPS, MOST_RATES = 20_000, 20_000, 500_000, 4_000_000
"""Most events of a run, turning points that are stored, steps of a long run, and rates that SciPy asks for."""

MOST_STEPS_OF_A_MOVE = 50_000_000
"""Steps of one part of a move. Elements that stick and slip in turn at zero velocity take many."""

AWAY = 1e6
"""Distance, in deflections at break-away, beyond which a long run is given up because the loop is unstable."""


class NotWritten(Exception):
    """Error: the equations of a stage are not among those written here."""


Arrays = namedtuple("Arrays", ("numbers", "rubs", "elements", "filters", "tones"))
"""What the equations read: numbers (`NUMBERS`), friction at load and motor (twice `RUB`), stiffness, share, damping and
strength of the elements (4, n), filters (n, 6), sinusoids of the reference (n, 4)."""


class Run(NamedTuple):
    """Result of a long run.

    It has times [s] and places [m] of the turning points, the last state, the spread of the place in the last quarter
    [m], the time [s] from which on the place is in a band, and the steps. `done`: it took few enough steps, and did not
    diverge.
    """

    times: np.ndarray
    places: np.ndarray
    state: np.ndarray
    spread: float
    since: float
    steps: int
    done: bool


class Followed(NamedTuple):
    """Result of a run from event to event.

    It has times [s], states and slipping of elements at the start, the events and the end, the rates at the end, and
    the highest and lowest position [m]. States at the end are NaN after a failure.
    """

    times: np.ndarray
    states: np.ndarray
    slips: np.ndarray
    rates: np.ndarray
    high: float
    low: float


@dataclass(frozen=True)
class ByHand:
    """The equations of one stage.

    The pieces of its reference, (pieces, 5), are start [s], position, velocity, acceleration and jerk.
    """

    arrays: Arrays
    pieces: np.ndarray

    @property
    def numbers(self) -> Any:
        return self.arrays.numbers.view(NUMBERS).view(np.recarray)[0]

    @property
    def rubs(self) -> Any:
        """Return friction at the load and at the motor."""
        return self.arrays.rubs.view(RUB).view(np.recarray)

    @property
    def remembers(self) -> bool:
        """Tell whether elements stick or slip."""
        return bool(self.rubs[0].law in (GMS, MAXWELL))

    @property
    def size(self) -> int:
        return Z + self.arrays.elements.shape[1] + 2 * len(self.arrays.filters)

    def places(self, names: Sequence[str]) -> np.ndarray:
        """Return the indices of states called so by friso. Raises NotWritten."""
        known, count = dict(NAMES), self.arrays.elements.shape[1]
        known |= {f"deflection_{n + 1}": Z + n for n in range(count)}
        for n in range(len(self.arrays.filters)):
            known |= {f"filtered_filter_{n + 1}{more}": Z + count + 2 * n + k for k, more in enumerate(("", "_rate"))}
        if missing := [name for name in names if name not in known]:
            raise NotWritten(", ".join(missing))
        return np.array([known[name] for name in names])

    def state(self, names: Sequence[str], values: Sequence[float] | np.ndarray) -> np.ndarray:
        """Return values of states by friso's names as a state. Raises NotWritten."""
        y = np.zeros(self.size)
        y[self.places(names)] = values
        return y

    def rate(self, time: float, y: np.ndarray, piece: np.ndarray | None = None) -> np.ndarray:
        """Return dy/dt; elements slip, and a joint touches, as in a run that begins in the state."""
        row = _row(self.pieces, time) if piece is None else piece
        return _rate(time, y, row, np.full(self.arrays.elements.shape[1], np.nan), np.nan, np.nan, self.arrays)

    @property
    def stiffness(self) -> float:
        """Return the proportional stiffness of the loop [N/m]."""
        n = self.numbers
        if n.kind != CASCADE:
            return float(n.kp)
        return float(n.kp * (n.kv * n.on_target + n.inner * (1 if n.inner else 0)))

    @property
    def winding(self) -> float:
        """Return the integral gain of the loop [N/(m s)]."""
        n = self.numbers
        return float(n.ki if n.kind != CASCADE else n.kp * n.kv * (n.inner + n.outer * n.on_target))

    @property
    def omega(self) -> float:
        """Return the natural frequency of mass and loop [1/s]."""
        n = self.numbers
        return float(np.sqrt(self.stiffness / (n.cart + n.stage + n.part + n.motor)))

    @property
    def length(self) -> float:
        """Return the deflection of the loop [m] by the forces at which frictions break away.

        Without friction it is the deflection by the bias, or 1 mm.
        """
        force = float(self.rubs.static.sum()) or abs(self.numbers.bias_cart) + abs(self.numbers.bias_stage)
        return float(force / self.stiffness) or 1e-3

    @property
    def wait(self) -> float:
        """Return the time [s] in which the integral of a stage stuck at `length` winds up to break-away."""
        return self.stiffness / self.winding if self.winding else np.inf

    @property
    def period(self) -> float:
        """Return roughly the time [s] between two departures to the same side.

        It is two waits at a third of `length`, and two swings.
        """
        return 2 * (3 * self.wait + 2 * np.pi / self.omega)

    @property
    def scales(self) -> np.ndarray:
        """Return the magnitudes of the states.

        They are the deflections of loop and bristles by friction, per time of the loop for velocities.
        """
        n, rubs, length, omega = self.numbers, self.rubs, self.length, self.omega
        scales = np.full(self.size, length)
        scales[[V, VC, VF, PACE, RATE]] = length * omega
        scales[ZM] = rubs[1].static / rubs[1].bristle_stiffness if rubs[1].bristle_stiffness else 1.0
        scales[LACK] = rubs[0].static or 1.0
        scales[[INTEGRAL, OUTER]] = length * omega**2 if n.kind == OBSERVER else length / omega
        stiff, first = float(self.arrays.elements[0].sum()), Z + self.arrays.elements.shape[1]
        scales[Z:first] = rubs[0].static / stiff if stiff else 1.0
        for k, row in enumerate(self.arrays.filters):
            passed = self.stiffness * length if row[0] == FORWARD else length * (omega if n.kind == CASCADE else 1)
            scales[first + 2 * k : first + 2 * k + 2] = passed, passed / np.sqrt(row[2]) if row[2] else 1.0
        return scales

    @property
    def live(self) -> np.ndarray:
        """Return the indices of the states that ever move."""
        n, (rub, second) = self.numbers, self.rubs
        far, filtered = n.part or n.motor, n.kind == OBSERVER or (n.tau > 0 and (n.tuned or n.kd > 0))
        moves = [1, 1, n.joint, n.joint, far, far, second.bristle_stiffness, rub.law == DWELL, filtered, 1]
        moves += [n.outer, n.pace_time, n.observer, *self.arrays.elements[0]]
        return np.flatnonzero([*moves, *np.ravel([(1, row[2]) for row in self.arrays.filters])])

    @property
    def measured(self) -> int:
        """Return the index of the place that the encoder measures."""
        return XF if self.numbers.place_at_motor else X

    def held(self) -> ByHand:
        """Return the same stage with its reference at 0 for ever."""
        still = self.arrays._replace(tones=np.zeros((0, 4)))
        return ByHand(still, np.zeros((1, 5)))

    def faster(self, factor: float) -> ByHand:
        """Return the stage with its PID faster as a whole by a factor. Raises NotWritten for other controllers."""
        if self.numbers.kind != PID:
            raise NotWritten(f"the bandwidth of {KINDS[int(self.numbers.kind)]}")
        numbers = self.arrays.numbers.copy()
        for name, power in SPEED.items():
            numbers.view(NUMBERS)[name] *= factor**power
        return replace(self, arrays=self.arrays._replace(numbers=numbers))

    def rest(self) -> np.ndarray:
        """Return a start at rest on the reference, where the integral holds the constant forces."""
        y, n = np.zeros(self.size), self.numbers
        if load := n.bias_stage + n.bias_cart:
            gain = n.kp * n.inner if n.kind == CASCADE else n.ki
            if n.kind == OBSERVER or not gain:
                raise NotWritten("a constant force that no integral holds")
            y[INTEGRAL] = -load / gain
        return y

    def start(self, displacement: float = 0.0) -> np.ndarray:
        """Return a start at rest, held by hand at a displacement [m] until filters have settled.

        The integral holds nothing of the error. Raises NotWritten for a cascade and for filters.
        """
        y, n = np.zeros(self.size), self.numbers
        if displacement and (n.kind == CASCADE or len(self.arrays.filters)):
            raise NotWritten("filters and cascades that are held by hand")
        y[[X, XC, XF]] = displacement
        error = -displacement - min(max(-displacement, -n.deadband), n.deadband)
        y[LOW] = error if n.on_error else displacement
        if observer := n.observer:  # a held error winds the disturbance up at a constant rate, with a constant lag
            feedback = n.feedback
            lag = feedback**2 * error / (3 * observer**2 + 6 * observer * feedback + feedback**2)
            y[LOW], y[RATE] = error - lag, -3 * observer * lag
            y[INTEGRAL] = n.kp * error / n.believed - feedback**2 * y[LOW] - 2 * feedback * y[RATE]
        return y

    def jumped(self, displacement: float) -> np.ndarray:
        """Return a start at rest at a displacement [m] after a jump of the reference, which filters do not know yet."""
        y = self.start(displacement)
        if self.numbers.on_error or self.numbers.observer:
            y[[LOW, RATE, INTEGRAL]] = 0.0
        return y

    def stuck(self, displacement: float) -> np.ndarray:
        """Return a start at rest at a displacement [m], where the integral balances the proportional force."""
        y, n = self.start(displacement), self.numbers
        if n.tuned or (n.tau and n.on_error):
            y[LOW] = -displacement
        y[INTEGRAL] = displacement * n.kp / n.ki
        return y

    def run(self, y: np.ndarray, times: np.ndarray, rtol: float = 1e-9, most: int = MOST_RATES) -> np.ndarray:
        """Return states at the times [s], (times, states), from `y` at the first time, by LSODA without events.

        They are NaN after a failure. Raises NotWritten for elements that stick or slip.
        """
        if self.remembers:
            raise NotWritten("elements without events")
        out, left, live = np.full((len(times), self.size), np.nan), most, self.live
        out[0], scales, inner = y, self.scales, np.ix_(live, live)
        idle = np.zeros(self.arrays.elements.shape[1])

        def rate(t: float, y: np.ndarray, piece: np.ndarray) -> np.ndarray:
            return _rate(t, y, piece, idle, np.nan, np.nan, self.arrays)

        def slopes(t: float, y: np.ndarray, piece: np.ndarray) -> np.ndarray:
            whole = np.zeros((self.size, self.size))
            whole[inner] = _slopes(t, y, rate(t, y, piece), scales, live, piece, idle, self.arrays)
            return whole

        for piece, end in zip(self.pieces, [*self.pieces[1:, 0], np.inf], strict=True):
            stop, start = min(end, times[-1]), max(piece[0], times[0])
            if stop <= start:
                continue
            at = (times > start) & (times <= stop)
            with warnings.catch_warnings(action="ignore", category=ODEintWarning):
                states, told = odeint(
                    rate, y, np.unique([start, *times[at], stop]), (piece,), slopes, tfirst=True, full_output=True,
                    rtol=rtol, atol=rtol * scales, tcrit=[stop], hmax=(stop - start) / 50, mxstep=left,
                )  # fmt: skip
            left -= int(told["nfe"][-1])
            if told["message"] != "Integration successful." or left <= 0:
                return out
            y, out[at] = states[-1], states[1 : 1 + np.count_nonzero(at)]
        return out

    def followed(self, y: np.ndarray, duration: float, rtol: float, method: str = "Radau") -> Followed:
        """Follow a stage whose reference rests from a state, from event to event.

        SciPy is stopped where the velocity passes zero, an element reaches its limit, or the limiter is touched or
        left.
        """
        n, m, piece = self.numbers, self.arrays, self.pieces[-1]
        body, count, t, y = V if n.joint == RIGID else VC, m.elements.shape[1], 0.0, np.array(y, dtype=float)
        gap, slips, scales = y[X] - y[XC], np.zeros(m.elements.shape[1]), self.scales
        touch = float(np.sign(gap)) if n.joint == FREE and abs(gap) > n.stroke else 0.0
        way = float(np.sign(y[body]) or np.sign(_rate(t, y, piece, slips, 1.0, touch, m)[body]))
        if self.remembers and self.rubs[0].kinetic_share == 1:  # an element at its limit continues to slip
            limits = np.array([_limit(k, y[body], 1.0, m) for k in range(count)])
            slips = (way * m.elements[0] * y[Z : Z + count] >= (1 - ROUNDING) * limits).astype(float)
        high, low, history, rates = y[X], y[X], [(t, y, slips)], np.full(len(y), np.nan)

        def lacks(k: int) -> Callable[[float, np.ndarray], float]:
            return lambda _, y: _limit(k, y[body], 1.0, m) - way * m.elements[0, k] * y[Z + k]

        for _ in range(MOST_EVENTS):
            surfaces: list[tuple[Any, Any]] = [(lambda _, y, way=way: way * y[body], "turns")]
            if self.remembers:
                surfaces += [(lacks(int(k)), int(k)) for k in np.flatnonzero(slips == 0)]
            if n.joint == FREE and touch:
                surfaces.append((lambda _, y, side=touch: side * (y[X] - y[XC]) - n.stroke, "contact"))
            elif n.joint == FREE:
                surfaces.append((lambda _, y: n.stroke - abs(y[X] - y[XC]), "contact"))
            for function, _ in surfaces:
                function.terminal, function.direction = True, -1.0
            result = solve_ivp(
                lambda t, y, s=slips, w=way, c=touch: _rate(t, y, piece, s, w, c, m), (t, duration), y, method,
                events=[function for function, _ in surfaces], rtol=rtol, atol=rtol * 1e-3 * scales,
            )  # fmt: skip
            if not result.success:
                break
            high, low = max(high, result.y[X].max()), min(low, result.y[X].min())
            t, y = float(result.t[-1]), result.y[:, -1].copy()
            if result.status == 0:
                history.append((t, y, slips))
                rates = _rate(t, y, piece, slips, way, touch, m)
                break
            what = surfaces[next(k for k, times in enumerate(result.t_events) if len(times))][1]
            if what == "turns":
                slips, way, y[body] = np.zeros(count), -way, 0.0
            elif what == "contact":
                touch = 0.0 if touch else float(np.sign(y[X] - y[XC]))
            else:
                slips = slips.copy()
                slips[what], y[Z + what] = 1.0, y[Z + what] * self.rubs[0].kinetic_share
            history.append((t, y, slips))
        else:
            history.append((t, np.full(len(y), np.nan), slips))
        times, states, slipping = zip(*history, strict=True)
        return Followed(np.array(times), np.array(states), np.array(slipping), rates, float(high), float(low))

    def long_run(self, y: np.ndarray, end: float, rtol: float) -> Run:
        """Run from a state to the time `end` [s], over thousands of periods, on the last piece of the reference."""
        how = 0.0, end, self.pieces[-1], self.measured, np.inf, end / 50, AWAY * self.length, rtol, MOST_STEPS
        return self._long(y, np.zeros(self.arrays.elements.shape[1]), *how)

    def settling(self, within: float, duration: float, place: int = X, rtol: float = 1e-7) -> float:
        """Return the longest time [s] after which a place is in a band [m] about where the reference comes to rest.

        It is infinite if the place stays out of the band, and NaN if the run failed.
        """
        y, slips, longest = self.rest(), np.zeros(self.arrays.elements.shape[1]), 0.0
        for piece, (begin, end) in zip(self.pieces, pairwise([*self.pieces[:, 0], duration]), strict=True):
            run = self._long(y, slips, begin, end, piece, place, within, 1e-2, np.inf, rtol, MOST_STEPS_OF_A_MOVE)
            if not run.done:
                return np.nan
            y = run.state
            if not piece[2:].any():
                longest = max(longest, run.since - begin)
        return longest

    def _long(self, y: np.ndarray, slips: np.ndarray, *how: Any) -> Run:
        arguments: tuple[Any, ...] = (y.astype(float), slips, *how, self.scales, self.live, self.arrays)
        followed: tuple[Any, ...] = _followed(*arguments)
        times, places, count, *rest = followed
        return Run(times[:count], places[:count], *rest)


def by_hand(flat: Flat) -> ByHand:
    """Return the equations of a stage given as flat keys to SI numbers. Raises NotWritten."""
    if missing := [key for key in flat if not key.startswith(WRITTEN)]:
        raise NotWritten(", ".join(missing))
    if flat["controller.kind"] not in KINDS or flat.get("controller.anti_windup", "none") not in WINDUPS:
        raise NotWritten(f"{flat['controller.kind']}, {flat.get('controller.anti_windup')}")
    joint, get = joint_state(flat), flat.get
    if joint != "rigid" and "transmission.mass" in flat:
        raise NotWritten("a transmission before a joint")
    if get("motor_friction.model", "none") not in LAWS[: STRIBECK + 1]:
        raise NotWritten(f"{flat['motor_friction.model']} at the motor")
    values = {name: get(key, UNLESS_GIVEN.get(name, 0.0)) for name, key in KEYS.items()} | dict.fromkeys(MORE, 0.0)
    values["part"] = part = values["part"] if joint != "rigid" else 0.0
    values["stage"] -= part
    reduced, omega = 1 / (1 / part + 1 / values["stage"]) if part else 0.0, 2 * np.pi * get("parasitic.frequency", 0.0)
    values |= {
        "joint": JOINTS.index(joint),
        "mode_k": reduced * omega**2,
        "mode_d": 2 * get("parasitic.damping_ratio", 0.0) * omega * reduced,
        "place_at_motor": get("encoder.position") == "motor",
        "pace_at_motor": get("encoder.velocity") == "motor",
        "cold": 1 + (get("conditions.cold", 1.0) - 1) * np.exp(-_warm(flat)),
        "kind": KINDS.index(flat["controller.kind"]),
        "windup": WINDUPS.index(get("controller.anti_windup", "clamp")) if values["limit"] < np.inf else 0,
        "leak": 2 * np.pi * get("controller.integral_leak", 0.0),
        **{"pid": _pid, "cascade": _cascade, "adrc": _observer}[flat["controller.kind"]](flat),
    }
    numbers = np.array([float(values[name]) for name in NUMBERS.names or ()])
    (rub, elements), (second, _) = (_friction_of(flat, table) for table in ("friction.", "motor_friction."))
    arrays = Arrays(numbers, np.concatenate([rub, second]), elements, _filters(flat), _tones(flat))
    return ByHand(arrays, _pieces(flat))


def joint_state(flat: Flat) -> str:
    """Return which of `JOINTS` a stage has."""
    if "joint.limiter_stiffness" not in flat:
        return "rigid"
    if flat["joint.locked"]:
        return "locked"
    return "free" if flat["joint.stroke"] else "touching"


def rates(flat: Flat, names: Sequence[str]) -> Callable[[float, Sequence[float]], np.ndarray]:
    """Return dx/dt as a function of time [s] and the states called `names` by friso."""
    equations = by_hand(flat)
    at = equations.places(names)

    def right_hand_side(t: float, x: Sequence[float]) -> np.ndarray:
        y = np.zeros(equations.size)
        y[at] = x
        return equations.rate(t, y)[at]

    return right_hand_side


def reference(flat: Flat, t: float) -> tuple[float, float, float]:
    """Return position [m], velocity [m/s] and acceleration [m/s^2] of the reference at a time [s]."""
    return _reference(t, _row(_pieces(flat), t), _tones(flat))


def friction(flat: Flat, v: float, z: float) -> tuple[float, float]:
    """Return the friction force [N] against the velocity v [m/s] of one bristle, and the bristle's rate [m/s]."""
    rub, elements = _friction_of(flat, "friction.")
    out, idle = np.zeros(1), np.zeros(1)
    drag, _ = _drag(
        rub.view(RUB).view(np.recarray)[0], elements, np.array([float(z)]), out, 0.0, float(v), np.nan, idle, 0.0, 1.0
    )
    return drag, float(out[0])


def joint(flat: Flat, deflection: float, rate: float) -> float:
    """Return the force [N] of the joint on the cart; the limiter works beside the leaf springs once it touches."""
    return _joint(deflection, rate, np.nan, by_hand(flat).numbers)


def conditions(flat: Flat, acceleration: float) -> float:
    """Return the factor of load and temperature on the levels of friction (no rail)."""
    return _conditions(by_hand(flat).numbers, acceleration)


def _warm(flat: Flat) -> float:
    """Return the running time over that of warming up."""
    return float(flat.get("conditions.running_time", 0.0) / flat.get("conditions.warm_up_time", 1.0))


def _friction_of(flat: Flat, table: str) -> tuple[np.ndarray, np.ndarray]:
    """Return friction in the order of `RUBS`, and its elements (4, n). Raises NotWritten."""
    keys = {key.removeprefix(table): value for key, value in flat.items() if key.startswith(table)}
    law = keys.get("model", "none")
    if law not in LAWS:
        raise NotWritten(law)
    if law != "none":
        keys["static"] = keys["coulomb"] if law == "dahl" else keys.get("static", keys.get("coulomb", 0.0))
    rub = np.array([float(keys.get(name, otherwise)) for name, otherwise in RUBS.items()])
    rub[0] = LAWS.index(law)
    count = sum(key.startswith("element_stiffness.") for key in keys)
    if law in ("gms", "maxwell_slip"):
        numbers, names = range(1, count + 1), ("stiffness", "share", "damping", "strength")
        elements = np.array([[keys.get(f"element_{name}.{n}", 0.0) for n in numbers] for name in names])
        if law == "maxwell_slip":
            rub[1] = elements[3].sum()
        return rub, elements
    return rub, np.array([[keys.get("bristle_stiffness", 0.0)], [1.0], [keys.get("bristle_damping", 0.0)], [0.0]])


def _pid(flat: Flat) -> dict[str, float]:
    """Return what is not a key of a PID.

    By van Dijk's rules (Eq. 7, 8) kp, ki, kd are those of (s tau_z + 1)(s tau_i + 1) k_p/(s tau_i), multiplied out.
    """
    if "controller.crossover" not in flat:
        return {"on_error": flat["controller.derivative_on"] == "error"}
    omega, alpha = 2 * np.pi * flat["controller.crossover"], flat["controller.alpha"]
    gain, tau_z = flat["controller.tuned_mass"] * omega**2 * np.sqrt(alpha), 1 / (omega * np.sqrt(alpha))
    tau_i = flat["controller.beta"] * tau_z
    gains = {"kp": gain * (1 + tau_z / tau_i), "ki": gain / tau_i, "kd": gain * tau_z, "tau": np.sqrt(alpha) / omega}
    return gains | {"tuned": 1.0, "on_error": 1.0}


def _cascade(flat: Flat) -> dict[str, float]:
    """Return what is not a key of a cascade. Raises NotWritten for settings of a PID."""
    if {"error_deadband", "integral_leak", "integral_limit"} & {key.removeprefix("controller.") for key in flat}:
        raise NotWritten("a cascade with a dead band, a leak or a limit of the integral")
    inner, outer = (flat.get(f"controller.{name}_integral_time", np.inf) for name in ("velocity", "position"))
    return {"inner": 1 / inner, "outer": 1 / outer, "on_target": flat["controller.proportional_on"] == "error"}


def _observer(flat: Flat) -> dict[str, float]:
    """Return the observer and its feedback, with the resulting proportional and integral gain. Raises NotWritten."""
    if any(key.startswith(("controller.force", "controller.integral", "controller.filters")) for key in flat):
        raise NotWritten("an observer with a limit, a leak or filters")
    feedback, mass = 2 * np.pi * flat["controller.bandwidth"], flat["controller.tuned_mass"]
    observer = flat["controller.observer_ratio"] * feedback
    whole = 3 * observer**2 + 6 * observer * feedback + feedback**2
    integral = observer**3 * feedback**2 / whole
    linear = 3 * observer**2 * feedback**2 + 2 * observer**3 * feedback
    proportional = (linear - integral * (3 * observer + 2 * feedback)) / whole
    gains = {"kp": mass * proportional, "ki": mass * integral}
    return gains | {"observer": observer, "feedback": feedback, "believed": mass}


def _filters(flat: Flat) -> np.ndarray:
    """Return the filters, (n, 6): path, a1 and a2 of 1 + a1 s + a2 s^2, and b0, b1, b2 above it."""
    rows = []
    for n in range(1, MOST_FILTERS + 1):
        row = {key.rpartition(f"filters.{n}.")[2]: value for key, value in flat.items() if f".filters.{n}." in key}
        if not row:
            break
        kind, above, below = row["kind"], (1.0, 0.0, 0.0), (1.0, 0.0, 0.0)
        turns = {key: 2 * np.pi * value for key, value in row.items() if key.endswith(("frequency", "width"))}
        if kind == "lead_lag":
            above, below = (1.0, 1 / turns["zero_frequency"], 0.0), (1.0, 1 / turns["pole_frequency"], 0.0)
        elif row.get("order") == 1:
            below = 1.0, 1 / turns["frequency"], 0.0
        elif kind == "notch":
            w, width = turns["frequency"], turns["width"]
            above, below = (1.0, (1 - row["depth"]) * width / w**2, 1 / w**2), (1.0, width / w**2, 1 / w**2)
        elif kind == "sampled_biquad":  # z^-1 = (1 - s T/2)/(1 + s T/2), a power of (1 + s T/2)^2 left out
            h = row["sample_time"] / 2
            b, a = ([row[f"numerator.{k}"] for k in (1, 2, 3)], [1.0, *(row[f"denominator.{k}"] for k in (1, 2))])
            above, below = (
                tuple(c / sum(a) for c in (p[0] + p[1] + p[2], 2 * h * (p[0] - p[2]), h * h * (p[0] - p[1] + p[2])))
                for p in (b, a)
            )
        elif kind == "biquad":
            w, w_z = turns["pole_frequency"], turns["zero_frequency"]
            above, below = (
                (1.0, 2 * row["zero_damping"] / w_z, 1 / w_z**2),
                (1.0, 2 * row["pole_damping"] / w, 1 / w**2),
            )
        elif kind == "low_pass":
            w = turns["frequency"]
            below = 1.0, 2 * row["damping_ratio"] / w, 1 / w**2
        else:
            raise NotWritten(f"a filter {kind}")
        if row["path"] not in ("forward", "feedback"):
            raise NotWritten(f"a filter in the {row['path']} path")
        rows.append([FEEDBACK if row["path"] == "feedback" else FORWARD, *below[1:], *above])
    return np.array(rows).reshape(-1, 6)


def s_curve_times(distance: float, velocity: float, acceleration: float, jerk: float) -> tuple[float, float, float]:
    """Times of constant jerk, of constant acceleration and of constant velocity of an S-curve, case by case."""
    tj = min((distance / (2 * jerk)) ** (1 / 3), (velocity / jerk) ** 0.5, acceleration / jerk)
    ta = 0.0
    if tj == acceleration / jerk:  # 2 (tj + ta) and the cruise make the distance: acceleration (tj + ta)(2 tj + ta)
        reached = -1.5 * tj + (tj * tj / 4 + distance / acceleration) ** 0.5
        ta = max(0.0, min(velocity / acceleration - tj, reached))
    top = jerk * tj * (tj + ta)
    return tj, ta, max(0.0, distance / top - 2 * tj - ta)


def _pieces(flat: Flat) -> np.ndarray:
    """Return the polynomials of the reference, (n, 5): start [s], position, velocity, acceleration and jerk."""
    get = {name.removeprefix("motion."): value for name, value in flat.items() if name.startswith("motion.")}
    if get["kind"] == "there_and_back":
        a, ramp, back = get["acceleration"], get["acceleration_time"], get["return_at"]
        far, fast = a * ramp**2, a * ramp
        there = [(0.0, 0.0, 0.0, a), (ramp, far / 2, fast, -a), (2 * ramp, far, 0.0, 0.0)]
        home = [(back + t, far - r, -v, -a) for t, r, v, a in there]
        return np.array([(*row, 0.0) for row in there + home])
    if get["kind"] != "profile":
        known = {"step": (get.get("size"), 0.0), "ramp": (0.0, get.get("velocity"))}
        if get["kind"] not in (*known, "hold", "release", "sine", "multisine", "chirp"):
            raise NotWritten(f"the motion {get['kind']}")
        return np.array([[0.0, *known.get(get["kind"], (0.0, 0.0)), 0.0, 0.0]], dtype=float)
    if "snap" in get:
        raise NotWritten("moves with bounded snap")
    rows, t, here = [], 0.0, 0.0
    for n in range(1, sum(key.startswith("distance.") for key in get) + 1):
        distance, j = get[f"distance.{n}"], get["jerk"]
        tj, ta, tv = s_curve_times(abs(distance), get["velocity"], get["acceleration"], j)
        r, v, a, side = here, 0.0, 0.0, float(np.sign(distance))
        for lasts, jerk in ((tj, j), (ta, 0.0), (tj, -j), (tv, 0.0), (tj, -j), (ta, 0.0), (tj, j)):
            if lasts > 0:
                rows.append((t, r, v, a, side * jerk))
            r, v = (
                r + v * lasts + a * lasts**2 / 2 + side * jerk * lasts**3 / 6,
                v + a * lasts + side * jerk * lasts**2 / 2,
            )
            a, t = a + side * jerk * lasts, t + lasts
        here += distance
        rows.append((t, here, 0.0, 0.0, 0.0))
        t += get["dwell"]
    return np.array(rows)


def _tones(flat: Flat) -> np.ndarray:
    """Return the sinusoids of the reference, (n, 4): size, phase, frequency [Hz], and its rise [Hz/s]."""
    get = {name.removeprefix("motion."): value for name, value in flat.items() if name.startswith("motion.")}
    parts: list[Any] = []
    if get["kind"] == "chirp":
        rise = (get["end_frequency"] - get["start_frequency"]) / get["duration"]
        parts = [(get["amplitude"], 0.0, get["start_frequency"], rise)]
    elif get["kind"] == "sine":
        parts = [(get["amplitude"], 0.0, get["frequency"], 0.0)]
    elif get["kind"] == "multisine":
        numbers = range(1, sum(key.startswith("amplitude.") for key in get) + 1)
        parts = [(get[f"amplitude.{n}"], get.get(f"phase.{n}", 0.0), get[f"frequency.{n}"], 0.0) for n in numbers]
    return np.array(parts, dtype=float).reshape(-1, 4)


def _row(pieces: np.ndarray, t: float) -> np.ndarray:
    return pieces[max(np.searchsorted(pieces[:, 0], t, side="right") - 1, 0)]


@njit(cache=True)
def _reference(t, piece, tones):  # type: ignore[no-untyped-def]
    """Return position, velocity and acceleration of the reference."""
    s = t - piece[0]
    r = piece[1] + s * (piece[2] + s * (piece[3] / 2 + s * piece[4] / 6))
    v, a = piece[2] + s * (piece[3] + s * piece[4] / 2), piece[3] + s * piece[4]
    for k in range(len(tones)):
        size, phase, frequency, rise = tones[k]
        angle, rate = phase + 2 * np.pi * (frequency * t + rise * t * t / 2), 2 * np.pi * (frequency + rise * t)
        r, v = r + size * np.sin(angle), v + size * rate * np.cos(angle)
        a += size * (2 * np.pi * rise * np.cos(angle) - rate**2 * np.sin(angle))
    return r, v, a


@njit(cache=True)
def _conditions(n, acceleration):  # type: ignore[no-untyped-def]
    return (1 + n.load_share * (n.load + n.load_per_acceleration * abs(acceleration) - 1)) * n.cold


@njit(cache=True)
def _level(rub, v, factor):  # type: ignore[no-untyped-def]
    """Return the steady friction without viscous friction [N], equal in both directions."""
    drop = np.exp(-(abs(v / rub.stribeck_velocity) ** rub.stribeck_exponent))
    return factor * (rub.coulomb + (rub.static - rub.coulomb) * drop)


@njit(cache=True)
def _limit(k, v, factor, m):  # type: ignore[no-untyped-def]
    """Return the force at which an element slips [N]."""
    rub = m.rubs.view(RUB)[0]
    return m.elements[3, k] if rub.law == MAXWELL else m.elements[1, k] * _level(rub, v, factor)


@njit(cache=True)
def _drag(rub, elements, bristles, rates, lack, v, way, slips, drive, factor):  # type: ignore[no-untyped-def]
    """Return the friction force at a velocity v, and the rate of its lack; write the rates of its bristles.

    `way` is the side of a velocity of 0, or NaN: that of the velocity. `slips` tells which elements slip, or is NaN:
    those that are at their limit and are pulled on. `drive` is the force of the actuator.
    """
    law, late = rub.law, 0.0
    if law == NONE:
        return 0.0, 0.0
    if np.isnan(way):
        way = 1.0 if v > 0 else -1.0
    level = _level(rub, v, factor) * (1 + rub.asymmetry * way)
    drag = rub.viscous * v * (1 + rub.viscous_asymmetry * way)
    if law == STRIBECK:
        return drag + level * np.tanh(v / rub.regularisation_velocity), 0.0
    if law == DWELL:
        late = (1 + abs(v) / rub.stribeck_velocity) * (rub.static * factor - level - lack) / rub.dwell_time
        level = rub.static * factor - lack
    if law == LOAD:
        corner, share = 1e-7 * rub.static * factor, rub.load_coefficient
        level, drag = (1 - share) * level + share * (np.hypot(drive, corner) - corner), drag * (1 - share)
    for i in range(len(bristles)):
        z, stiff, share = bristles[i], elements[0, i], elements[1, i]
        limit = elements[3, i] if law == MAXWELL else share * level
        pulled_on = z * v > 0 and stiff * abs(z) >= limit and rub.kinetic_share >= 1
        slipping = pulled_on if np.isnan(slips[i]) else slips[i] > 0
        rate = v
        if law == PLASTIC:
            most, begins, alpha = level / stiff, rub.breakaway_deflection, 0.0
            if way * z >= most:
                alpha = 1.0
            elif way * z > begins:
                alpha = 0.5 + 0.5 * np.sin(np.pi * (way * z - (most + begins) / 2) / (most - begins))
            rate = v * (1 - alpha * way * z / most)
        elif law == ROLLING:
            lacks, more = 1 - way * stiff * z / level, rub.rolling_exponent - 1
            rate = v * lacks * np.hypot(lacks, ROUNDED) ** more / np.hypot(1.0, ROUNDED) ** more
        elif law == GMS and slipping:
            rate = rub.attraction * (share * way - stiff * z / level) / stiff
        elif law == MAXWELL and slipping:
            rate = 0.0
        elif law < PLASTIC:
            rate = v - stiff * way * v / level * z
        rates[i] = rate
        drag += stiff * z + elements[2, i] * rate
    return drag, late


@njit(cache=True)
def _joint(gap, speed, touch, n):  # type: ignore[no-untyped-def]
    """Return the force [N] of the joint on the cart. `touch` is the side that touches, 0, or NaN: by the gap."""
    if n.joint == LOCKED:
        return n.k_limiter * gap + n.d_limiter * speed
    side = touch
    if np.isnan(touch):
        side = 1.0 if gap > n.stroke else -1.0 if gap < -n.stroke else 0.0
    push = 0.0
    if side != 0 or n.stroke == 0:
        push = n.k_limiter * (gap - side * n.stroke) + n.d_limiter * speed
        if n.pulls == 0:
            push = side * max(side * push, 0.0)
    return n.k_joint * gap + n.d_joint * speed + push


@njit(cache=True)
def _filtered(u, path, y, out, m):  # type: ignore[no-untyped-def]
    """Return a signal behind the filters of a path, and write the rates of their states."""
    for k in range(len(m.filters)):
        of, a1, a2, b0, b1, b2 = m.filters[k]
        if of != path:
            continue
        at = Z + m.elements.shape[1] + 2 * k
        low, slope = y[at], y[at + 1]
        if a2 == 0:
            out[at] = (u - low) / a1
            u = b0 * low + b1 * out[at]
        else:
            out[at], out[at + 1] = slope, (u - low - a1 * slope) / a2
            u = b0 * low + b1 * slope + b2 * out[at + 1]
    return u


@njit(cache=True)
def _force(y, out, r, r_v, r_a, n, m):  # type: ignore[no-untyped-def]
    """Return the force of the actuator, and write the rates of the controller's states."""
    place, pace = y[XF] if n.place_at_motor > 0 else y[X], y[VF] if n.pace_at_motor > 0 else y[V]
    if n.kind == PID:
        place = _filtered(place, FEEDBACK, y, out, m)
    e = r - place
    e -= min(max(e, -n.deadband), n.deadband)
    if n.kind == OBSERVER:
        force = n.believed * (n.feedback**2 * y[LOW] + 2 * n.feedback * y[RATE] + y[INTEGRAL])
        short = e - y[LOW]
        out[LOW] = y[RATE] + 3 * n.observer * short
        out[RATE] = y[INTEGRAL] - force / n.believed + 3 * n.observer**2 * short
        out[INTEGRAL] = n.observer**3 * short
        return force
    winding, held = e, n.ki * y[INTEGRAL]
    if n.kind == CASCADE:
        if n.pace_time > 0:
            out[PACE] = (pace - y[PACE]) / n.pace_time
            pace = y[PACE]
        pace = _filtered(pace, FEEDBACK, y, out, m)
        wanted = n.kv * e + n.v_forward * r_v + n.kv * n.outer * y[OUTER]
        winding = wanted - pace
        demand = n.kp * ((wanted if n.on_target > 0 else 0.0) - pace) + n.kp * n.inner * y[INTEGRAL]
        demand += n.a_forward * r_a + n.viscous_forward * r_v + n.coulomb_forward * np.sign(r_v)
    elif n.tuned > 0:
        out[LOW] = (e - y[LOW]) / n.tau
        winding, demand = y[LOW], n.kp * y[LOW] + held + n.kd * out[LOW]
    else:
        rise = 0.0 if n.on_error > 0 else pace
        if n.tau > 0 and n.kd > 0:
            out[LOW] = rise = ((e if n.on_error > 0 else place) - y[LOW]) / n.tau
        demand = n.kp * e + held + (n.kd * rise if n.on_error > 0 else -n.kd * rise)
    demand = _filtered(demand, FORWARD, y, out, m)
    force, share, beyond = min(max(demand, -n.limit), n.limit), 1.0, abs(demand) - n.limit
    if n.windup == 1 and beyond > 0:
        share = max(0.0, 1 - beyond / (REST_BAND * n.limit))
    out[INTEGRAL] = winding * (share if winding * demand > 0 else 1.0)
    if abs(held) > n.most and held * winding > 0:
        out[INTEGRAL] *= max(0.0, 1 - (abs(held) - n.most) / (REST_BAND * n.most))
    out[INTEGRAL] -= n.leak * y[INTEGRAL]
    if n.outer > 0:
        out[OUTER] = e * (share if e * demand > 0 else 1.0)
    if n.windup == 2 and n.ki > 0:
        out[INTEGRAL] += (force - demand) / (n.ki * n.unwinding)
    return force


@njit(cache=True)
def _rate(t, y, piece, slips, way, touch, m):  # type: ignore[no-untyped-def]
    """Return dy/dt, with the modes of `_drag` and `_joint`."""
    n, rubs, out = m.numbers.view(NUMBERS)[0], m.rubs.view(RUB), np.zeros(len(y))
    r, r_v, r_a = _reference(t, piece, m.tones)
    force = _force(y, out, r, r_v, r_a, n, m)
    end = Z + m.elements.shape[1]
    v, factor = y[V] if n.joint == RIGID else y[VC], _conditions(n, r_a)
    drag, out[LACK] = _drag(
        rubs[0], m.elements, y[Z:end], out[Z:end], y[LACK], v, way, slips, force, factor
    )  # fmt: skip
    out[X] = y[V]
    if n.motor > 0:
        gap, pull = y[XF] - y[X], 0.0
        if abs(gap) >= n.play / 2:
            pull = n.k_drive * (gap - (n.play / 2 if gap > 0 else -n.play / 2)) + n.d_drive * (y[VF] - y[V])
        second = rubs[1]
        one = np.array([[second.bristle_stiffness], [1.0], [second.bristle_damping], [0.0]])
        rub, _ = _drag(second, one, y[ZM : ZM + 1], out[ZM : ZM + 1], 0.0, y[VF], np.nan, slips, force, 1.0)
        out[XF], out[VF] = y[VF], (force - pull - rub) / n.motor
        force = pull
    if n.joint == RIGID:
        out[V] = (force + n.bias_stage + n.bias_cart - drag) / (n.cart + n.stage)
        return out
    inner = 0.0
    if n.part > 0:
        inner = n.mode_k * (y[X] - y[XF]) + n.mode_d * (y[V] - y[VF])
        out[XF], out[VF] = y[VF], inner / n.part
    pull = _joint(y[X] - y[XC], y[V] - y[VC], touch, n)
    out[V] = (force + n.bias_stage - pull - inner) / n.stage
    out[XC], out[VC] = y[VC], (pull + n.bias_cart - drag) / n.cart
    return out


@njit(cache=True)
def _slopes(t, y, base, scales, live, piece, slips, m):  # type: ignore[no-untyped-def]
    """Return the Jacobian of some states by differences, for velocities to the side on which they are."""
    out, moved = np.zeros((len(live), len(live))), y.copy()
    for column, k in enumerate(live):
        step = 1e-7 * max(abs(y[k]), scales[k])
        moved[k] += -step if k in (V, VC, VF) and y[k] < 0 else step
        rates = _rate(t, moved, piece, slips, np.nan, np.nan, m) - base
        out[:, column] = rates[live] / (moved[k] - y[k])
        moved[k] = y[k]
    return out


@njit(cache=True)
def _factored(a):  # type: ignore[no-untyped-def]
    """Factor a matrix in place (LU); return the order of rows."""
    size = len(a)
    order = np.arange(size)
    for k in range(size):
        best = k
        for i in range(k + 1, size):
            if abs(a[i, k]) > abs(a[best, k]):
                best = i
        if best != k:
            for j in range(size):
                a[k, j], a[best, j] = a[best, j], a[k, j]
            order[k], order[best] = order[best], order[k]
        for i in range(k + 1, size):
            if a[i, k] != 0.0:
                a[i, k] /= a[k, k]
                for j in range(k + 1, size):
                    a[i, j] -= a[i, k] * a[k, j]
    return order


@njit(cache=True)
def _solved(lu, order, b):  # type: ignore[no-untyped-def]
    """Solve a system whose matrix was factored, with its order of rows, for the right-hand side b."""
    size = len(b)
    x = np.empty(size)
    for i in range(size):
        total = b[order[i]]
        for j in range(i):
            total -= lu[i, j] * x[j]
        x[i] = total
    for i in range(size - 1, -1, -1):
        for j in range(i + 1, size):
            x[i] -= lu[i, j] * x[j]
        x[i] /= lu[i, i]
    return x


@njit(cache=True)
def _step(t, y, h, base, forcing, slopes, piece, slips, live, m):  # type: ignore[no-untyped-def]
    """Return the state after a step of h, and its estimated error, for the moving states."""
    lu = np.eye(len(live)) * (2.0 / h) - slopes
    order, moved = _factored(lu), y.copy()
    g1 = _solved(lu, order, base + h * forcing / 2)
    moved[live] = y[live] + 2.0 * g1
    second = _rate(t + h, moved, piece, slips, np.nan, np.nan, m)[live]
    g2 = _solved(lu, order, second - 1.5 * h * forcing - 8.0 / h * g1)
    moved[live] = y[live] + 48 / 25 * g1 + 6 / 25 * g2
    third = _rate(t + 0.6 * h, moved, piece, slips, np.nan, np.nan, m)[live]
    g3 = _solved(lu, order, third + 121 / 50 * h * forcing + (372 / 25 * g1 + 12 / 5 * g2) / h)
    g4 = _solved(lu, order, third + 29 / 250 * h * forcing - (112 / 125 * g1 + 54 / 125 * g2 + 2 / 5 * g3) / h)
    moved[live] = y[live] + 19 / 9 * g1 + g2 / 2 + 25 / 108 * g3 + 125 / 108 * g4
    return moved, 17 / 54 * g1 + 7 / 36 * g2 + 125 / 108 * g4


@njit(cache=True)
def _passes(before, after, slips, m):  # type: ignore[no-untyped-def]
    """Return how far a step passes a change of any element, 0 if it passes none.

    It is 1 at the largest that is allowed. An element slips from its limit on, until the motion turns.
    """
    row, worst = V if m.numbers.view(NUMBERS)[0].joint == RIGID else VC, 0.0
    v = after[row]
    for k in range(len(slips)):
        limit, z = _limit(k, v, 1.0, m), after[Z + k]
        if slips[k] > 0 and before[row] * v < 0:
            worst = max(worst, min(abs(v), abs(before[row])) / (PASSED_BY * m.rubs.view(RUB)[0].stribeck_velocity))
        elif slips[k] == 0 and v * z > 0:
            worst = max(worst, (m.elements[0, k] * abs(z) - limit) / (PASSED_BY * limit))
    return worst


@njit(cache=True)
def _change(before, after, slips, m):  # type: ignore[no-untyped-def]
    """Let elements slip that have reached their limit, and stick where the motion has turned."""
    row = V if m.numbers.view(NUMBERS)[0].joint == RIGID else VC
    v = after[row]
    for k in range(len(slips)):
        z = after[Z + k]
        if slips[k] > 0:
            slips[k] = 1.0 if before[row] * v > 0 else 0.0
        elif v * z > 0:
            slips[k] = 1.0 if m.elements[0, k] * abs(z) >= _limit(k, v, 1.0, m) else 0.0


@njit(cache=True)
def _followed(y, slips, begin, end, piece, place, within, largest, far, rtol, most, scales, live, m):  # type: ignore[no-untyped-def]
    """Follow a stage on one piece of its reference; see `Run`."""
    times, places, count = np.empty(MOST_TURNS), np.empty(MOST_TURNS), 0
    t, h, steps, low, high = begin, (end - begin) * 1e-9, 0, np.inf, -np.inf
    since, speed = begin if abs(y[place] - piece[1]) <= within else np.inf, place + 1
    remembers, still = m.rubs.view(RUB)[0].law >= GMS, len(m.tones) == 0 and not piece[2:].any()
    base = _rate(t, y, piece, slips, np.nan, np.nan, m)
    slopes, forcing = _slopes(t, y, base, scales, live, piece, slips, m), np.zeros(len(live))
    while t < end:
        steps += 1
        if steps > most or not h > 1e-13 * (end - begin) or abs(y[place]) > far:
            return times, places, count, y, high - low, since, steps, False
        h = min(h, end - t, largest)
        if not still:
            later = _rate(t + 1e-3 * h, y, piece, slips, np.nan, np.nan, m)
            forcing = (later - base)[live] / (1e-3 * h)
        moved, error = _step(t, y, h, base[live], forcing, slopes, piece, slips, live, m)
        size = 0.0
        for row, k in enumerate(live):
            size = max(size, abs(error[row]) / (rtol * max(scales[k], abs(y[k]))))
        if not size <= 1.0:  # NaN counts as too large
            h *= max(0.2, 0.9 * size ** (-1 / 3)) if size < np.inf else 0.2
            continue
        if remembers and h > FINEST_STEP and _passes(y, moved, slips, m) > 1.0:
            h /= 2
            continue
        if remembers:
            _change(y, moved, slips, m)
        before = y[speed]
        t += h
        y = moved
        if before * y[speed] <= 0 and before != 0 and count < MOST_TURNS:
            times[count], places[count] = t, y[place]
            count += 1
        if t >= begin + 0.75 * (end - begin):
            low, high = min(low, y[place]), max(high, y[place])
        if abs(y[place] - piece[1]) > within:
            since = np.inf
        elif since == np.inf:
            since = t
        h *= min(4.0, 0.9 * size ** (-1 / 4)) if size > 0 else 4.0
        base = _rate(t, y, piece, slips, np.nan, np.nan, m)
        slopes = _slopes(t, y, base, scales, live, piece, slips, m)
    return times, places, count, y, high - low, since, steps, True


WINDOWS = ("error_deadband", "integral_deadband", "standstill_window", "freeze_window")
ERROR, PAUSE, GAINS, FREEZE = range(len(WINDOWS))
"""Windows of the error in a drive. Each acts below a first error, after a time there, until a second error."""


PUSHES = ("stiction_push", "stiction_push_window", "dither_amplitude", "dither_frequency")
"""Forces beside those of the PID: a push from an error on, at rest, and a sine of the time since the last corner."""


class Drive(NamedTuple):
    """A rigid mass on LuGre friction under a PID whose derivative is that of the measurement, with windows and limits.

    `numbers` (1,) and friction (1,) are records. A window, of (4, 3), has the error at which it is entered and left
    [m], and its time [s]; a window of 0 never acts. The schedule (2, n) has places and factors of the gains.
    """

    numbers: np.ndarray
    rub: np.ndarray
    windows: np.ndarray
    schedule: np.ndarray


def drive(flat: Flat) -> Drive:
    """Return the drive of a stage given as flat keys to SI numbers."""
    key = {name.removeprefix("controller."): value for name, value in flat.items() if name.startswith("controller.")}
    ends = [(key.get(name, 0.0), key.get(f"{name}_exit", key.get(name, 0.0)), key.get(f"{name}_time", 0.0))
            for name in WINDOWS]  # fmt: skip
    factor = key.get("standstill_factor", 1.0)
    values = {
        **{name: key[name] for name in ("kp", "ki", "kd")},
        "mass": sum(flat.get(f"masses.{name}", 0.0) for name in ("cart", "stage")),
        "reduces": not {"error_deadband_exit", "error_deadband_time"} & {*key},
        "left": key.get("error_deadband_gain", 0.0),
        "decay": 1 / key["integral_deadband_decay"] if "integral_deadband_decay" in key else 0.0,
        "in_moves": not key.get("integral_rests_in_moves", False),
        "factor": factor,
        "integral_factor": key.get("standstill_integral_factor", factor),
        "at_rest": key.get("windows_at_rest", False),
        "moving": key.get("moving_factor", 1.0),
        "over_speed": "schedule_speed.1" in key,
        "resets": key.get("integral_reset", False),
        "leak": 2 * np.pi * key.get("integral_leak", 0.0),
        **{name: key.get(name, np.inf) for name in ("integral_limit", "force_limit")},
        **{name: key.get(name, 0.0) for name in PUSHES},
    }
    numbers = np.zeros(1, [(name, float) for name in values]).view(np.recarray)
    for name, value in values.items():
        numbers[name] = value
    over = "schedule_speed" if values["over_speed"] else "schedule_error"
    count = sum(name.startswith("schedule_factor.") for name in key)
    rows = [[key[f"{name}.{n}"] for n in range(1, count + 1)] for name in (over, "schedule_factor")]
    schedule = np.array(rows if count else [[0.0], [1.0]])
    return Drive(numbers, _friction_of(flat, "friction.")[0].view(RUB).view(np.recarray), np.array(ends), schedule)


def trace(flat: Flat, start: np.ndarray, times: np.ndarray, step: float, sample: float = 0.0) -> np.ndarray:
    """Return positions [m] of a stage at times [s], from position, velocity, bristle and integral at the first.

    Steps [s] are fixed. `sample` [s] is the time of a drive that computes at samples; 0 stands for continuous time.
    """
    return _traced(drive(flat), _pieces(flat), np.asarray(start, dtype=float), times, step, sample)


@njit(cache=True)
def _enter(of, rests, error, dt, inside, clock):  # type: ignore[no-untyped-def]
    """Change the modes of the windows for an error after a time `dt` [s]; begin in those in which it is for `dt` 0."""
    for k in range(len(of.windows)):
        entered, left, time = of.windows[k]
        may = rests or not (of.numbers[0].at_rest > 0.0 or k == FREEZE)
        near = may and abs(error) < entered
        if dt == 0.0:
            inside[k], clock[k] = (1.0, time) if near else (0.0, 0.0)
            continue
        if inside[k] > 0.0:
            if not may or abs(error) > left:
                inside[k] = 0.0
        elif near and clock[k] >= time - 0.5 * dt:
            inside[k] = 1.0
        clock[k] = clock[k] + dt if near else 0.0


@njit(cache=True)
def _shares(of, inside, rests, error, speed):  # type: ignore[no-untyped-def]
    """Return the error that acts, the factor on the gains, and that on what the integral takes in."""
    n, band = of.numbers[0], inside[4]
    if n.reduces > 0.0:
        lost = (1.0 - n.left) if rests or n.at_rest == 0.0 else 0.0
        acting = error - lost * min(max(error, -band), band)
    else:
        acting = error * (n.left if inside[ERROR] > 0.0 else 1.0)
    size = abs(speed) if n.over_speed > 0.0 else abs(error)
    gains = np.interp(size, of.schedule[0], of.schedule[1]) * (1.0 if rests else n.moving)
    winds = gains * (n.integral_factor if inside[GAINS] > 0.0 else 1.0)
    gains *= n.factor if inside[GAINS] > 0.0 else 1.0
    if inside[PAUSE] > 0.0 or inside[FREEZE] > 0.0 or (n.in_moves == 0.0 and not rests):
        winds = 0.0
    return acting, gains, winds


@njit(cache=True)
def _demand(n, rests, t, error, acting, gains, speed, i):  # type: ignore[no-untyped-def]
    """Return the force that the controller asks for, before its limit, and whether a limit stops its integral."""
    force = gains * (n.kp * acting - n.kd * speed) + n.ki * i
    if rests and abs(error) > n.stiction_push_window:
        force += n.stiction_push if error > 0.0 else -n.stiction_push
    force += n.dither_amplitude * np.sin(2 * np.pi * n.dither_frequency * t)
    way = 1.0 if acting > 0 else -1.0
    return force, n.ki * i * way > n.integral_limit or force * way > n.force_limit


@njit(cache=True)
def _rates_of_drive(of, inside, rests, t, ref, y, held, sampled):  # type: ignore[no-untyped-def]
    """Return the rates of position, velocity, bristle and integral."""
    n, rub, (x, v, z, i) = of.numbers[0], of.rub[0], y
    acting, gains, winds = _shares(of, inside, rests, ref - x, v)
    force, stops = _demand(n, rests, t, ref - x, acting, gains, v, i)
    force = 0.0 if inside[FREEZE] > 0.0 else min(max(force, -n.force_limit), n.force_limit)
    winds *= 0.0 if stops else 1.0
    if sampled:
        force, winds = held, 0.0
    z_rate = v - rub.bristle_stiffness * abs(v) / _level(rub, v, 1.0) * z
    drag = rub.bristle_stiffness * z + rub.bristle_damping * z_rate + rub.viscous * v
    decay = 0.0 if sampled else n.leak * i + (n.decay * i if inside[PAUSE] > 0.0 else 0.0)
    return v, (force - drag) / n.mass, z_rate, winds * acting - decay


@njit(cache=True)
def _moved(y, h, k):  # type: ignore[no-untyped-def]
    """Return the state after a time `h` [s] at the rates `k`."""
    return y[0] + h * k[0], y[1] + h * k[1], y[2] + h * k[2], y[3] + h * k[3]


@njit(cache=True)
def _traced(of, pieces, start, times, step, sample):  # type: ignore[no-untyped-def]
    out, now, n, tones = np.empty(len(times)), times[0], of.numbers[0], np.zeros((0, 4))
    y = (start[0], start[1], start[2], start[3])
    inside, clock, sampled = np.zeros(5), np.zeros(4), sample > 0.0
    inside[4] = of.windows[0, 0]
    piece, ticks, held, before, begun, last = 0, 0, 0.0, start[0], False, 0.0
    out[0] = y[0]
    for number in range(1, len(times)):
        while now < times[number] - 1e-12:
            while piece + 1 < len(pieces) and pieces[piece + 1, 0] <= now + 1e-12:
                piece += 1
            p = pieces[piece]
            rests = not p[2:].any()
            end = min(times[number], pieces[piece + 1, 0]) if piece + 1 < len(pieces) else times[number]
            if not begun:
                _enter(of, rests, p[1] - y[0], 0.0, inside, clock)
                begun = True
            if sampled:
                if now > (ticks - 1e-9) * sample:
                    error = _reference(now, p, tones)[0] - y[0]
                    _enter(of, rests, error, sample, inside, clock)
                    speed = (y[0] - before) / sample
                    acting, gains, winds = _shares(of, inside, rests, error, speed)
                    added = sample * winds * acting
                    stops = _demand(n, rests, now, error, acting, gains, speed, y[3] + added)[1]
                    i = added if n.resets > 0.0 and last * error < 0.0 else y[3] + (0.0 if stops else added)
                    i /= 1.0 + n.leak * sample
                    if inside[PAUSE] > 0.0:
                        i /= 1.0 + n.decay * sample
                    if inside[FREEZE] > 0.0:
                        i = 0.0
                    y = (y[0], y[1], y[2], i)
                    wanted = _demand(n, rests, now, error, acting, gains, speed, i)[0]
                    held = 0.0 if inside[FREEZE] > 0.0 else min(max(wanted, -n.force_limit), n.force_limit)
                    before, last = y[0], error
                    ticks += 1
                end = min(end, ticks * sample)
            h = min(step, end - now)
            r0, r1 = _reference(now, p, tones)[0], _reference(now + h / 2, p, tones)[0]
            r2 = _reference(now + h, p, tones)[0]
            k1 = _rates_of_drive(of, inside, rests, now - p[0], r0, y, held, sampled)
            k2 = _rates_of_drive(of, inside, rests, now + h / 2 - p[0], r1, _moved(y, h / 2, k1), held, sampled)
            k3 = _rates_of_drive(of, inside, rests, now + h / 2 - p[0], r1, _moved(y, h / 2, k2), held, sampled)
            k4 = _rates_of_drive(of, inside, rests, now + h - p[0], r2, _moved(y, h, k3), held, sampled)
            error = r0 - y[0]
            y = _moved(_moved(_moved(_moved(y, h / 6, k1), h / 3, k2), h / 3, k3), h / 6, k4)
            now += h
            if not sampled:
                if n.resets > 0.0 and error * (r2 - y[0]) < 0.0:
                    y = (y[0], y[1], y[2], 0.0)
                froze = inside[FREEZE]
                _enter(of, rests, r2 - y[0], h, inside, clock)
                if inside[FREEZE] != froze:
                    y = (y[0], y[1], y[2], 0.0)
        out[number] = y[0]
    return out
