"""PID controllers, by gains and by van Dijk's rules, and a controller with an observer that is tuned likewise.

By gains: thesis, Eq. 6, with feedforward of acceleration and friction. By van Dijk's rules: crossover, alpha, beta and
mass (thesis, Eq. 7 and 8).

The controller with an observer is linear active disturbance rejection: an extended state observer and its feedback. All
that acts on the mass m besides the force F is one disturbance d: e'' = d - F/m for the error e. The observer has a
triple pole at -w_o. With the correction c = e - e1, it is
    e1' = e2 + 3 w_o c, e2' = e3 - F/m + 3 w_o^2 c, e3' = w_o^3 c.
The force F = m (w_c^2 e1 + 2 w_c e2 + e3) takes away e3, the estimate of d, and gives the mass a double pole at -w_c.
So there are two bandwidths, of which w_o is some times w_c (Gao 2003, doi 10.1109/ACC.2003.1242516). The observer acts
on the error, so that the acceleration of the reference is part of d (Madonski et al. 2023, doi
10.1007/s11768-023-00129-y).

Since F is known to the observer, it drops out: e1, e2 and e3 are the error behind linear filters. F follows from the
transfer function (Herbst 2021, doi 10.1007/s11768-021-00031-5)
    F/e = m (n2 s^2 + n1 s + n0) / (s (s^2 + d1 s + d0)).
Here it is an integral of the error beside a filter of the second order: three states, as many as the observer has. What
a limit of the force does to the observer is therefore up to the anti-windup, as in all controllers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import sqrt
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, NamedTuple, cast

from friso.errors import StageError
from friso.quantities import Number, Quantity, Value, any_sign, at_least_1, inside_0_1, non_negative, positive
from friso.stage import ControllerSection, Rule, register_controller
from friso.stage.controllers import KIND, Gain, PidLike
from friso.stage.tables import TIME_ROUNDING, moving_mass

if TYPE_CHECKING:
    import sympy as sp

    from friso.equations.blocks import Blocks, Measured, Signal


SYMBOLS: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "acceleration_feedforward": ("feedforward of acceleration", "m"),
        "jerk_feedforward": ("feedforward of jerk", "mj"),
        "viscous_feedforward": ("feedforward of viscous friction", "d"),
        "coulomb_feedforward": ("feedforward of Coulomb friction", "Fc"),
    }
)

TERMS = {
    "acceleration_feedforward": "m d²r/dt²",
    "jerk_feedforward": "mj d³r/dt³",
    "viscous_feedforward": "d dr/dt",
    "coulomb_feedforward": "Fc sign(dr/dt)",
}


def fed_forward(flat: Mapping[str, Any]) -> str:
    """Return the feedforward terms of a controller in words; "" without any."""
    return " + ".join(term for name, term in TERMS.items() if flat.get(ControllerSection.key(name)))


def feedforward_of_moves(flat: Mapping[str, Any], *names: str) -> dict[str, float]:
    """Return the feedforward that moving mass and viscous friction require, by key [SI].

    `names` are the feedforward keys that the controller can have. Only keys among these whose value is not 0, and that
    the stage does not set yet, are in the result.
    """
    needed = {"acceleration_feedforward": moving_mass(flat), "viscous_feedforward": flat.get("friction.viscous", 0.0)}
    return {
        ControllerSection.key(name): float(value)
        for name, value in needed.items()
        if name in names and value and not flat.get(ControllerSection.key(name))
    }


EITHER_FORM = 'crossover = "8 Hz", alpha = 0.1, beta = 2 or kp = "3 N/m", ki = "4 N/(m*s)", kd = "6 N*s/m"'


class Pid(ControllerSection):
    """A PID controller, given by tuning rules or by gains."""

    kind: Literal["pid"]

    written: ClassVar[str]
    """Words for the keys of this way to give a controller, in a message."""
    needed: ClassVar[tuple[str, ...]]
    """Names of the keys of which a table that gives a controller this way has at least one."""
    asked: ClassVar[str]
    """The needed keys, in words for a message."""
    shares: ClassVar[Mapping[str, str]] = MappingProxyType({"p": "proportional", "i": "integral", "d": "derivative"})

    @classmethod
    def pick(cls, forms: Sequence[type[ControllerSection]], table: Mapping[str, Any]) -> type[Pid]:
        """Choose the class that reads a [controller] table: by rules or by gains.

        `forms` are the classes to choose from. Raises StageError for keys of both or of neither.
        """
        by_keys = sorted(cast(Sequence[type[Pid]], forms), key=lambda form: not form.recognised_by)
        keys_of = {
            form: [key for key in form.model_fields if key in {*table} - {*cls.model_fields}] for form in by_keys
        }
        used = [form for form, keys in keys_of.items() if keys]
        if len(used) > 1:
            actual = " together with ".join(f"{', '.join(keys_of[form])} ({form.written})" for form in used)
            raise StageError("", actual, "one form, not both", EITHER_FORM)
        if not used or not {*used[0].needed} & {*table}:
            actual = f"neither {' nor '.join(form.asked for form in by_keys)}"
            raise StageError("", actual, "one of the two forms", EITHER_FORM)
        return used[0]


CROSSOVER, ALPHA, BETA, TUNED_MASS, LOW_PASS = (
    f"controller.{name}" for name in ("crossover", "alpha", "beta", "tuned_mass", "low_pass")
)


@register_controller
class VanDijk(Pid):
    """PID by van Dijk's tuning rules (thesis, Eq. 7, 8).

    The low-pass comes first, and the three terms act on what it lets through. With `low_pass` on the derivative alone,
    proportional and integral term act on the error itself.
    """

    crossover: Annotated[Value, Quantity("Hz", positive, "8 Hz")]
    alpha: Annotated[float, Number(inside_0_1, "0.1")]
    beta: Annotated[float, Number(at_least_1, "2")]
    tuned_mass: Annotated[Value | None, Quantity("kg", positive, "1.7 kg")] = None
    low_pass: Literal["all", "derivative"] | None = None
    """On which terms the low-pass of the rules acts."""

    written = "van Dijk's rules"
    needed = ("crossover", "alpha", "beta", "tuned_mass")
    asked = "crossover"
    recognised_by = ("crossover",)
    bandwidth_key = CROSSOVER
    speeds_up: ClassVar[Mapping[str, int]] = MappingProxyType({"crossover": 1})
    shaped_by: ClassVar[Mapping[str, tuple[float, float]]] = MappingProxyType(
        {"alpha": (0.05, 0.3), "beta": (1.2, 8.0)}
    )
    loop_gain = ("tuned_mass",)
    words: ClassVar[Mapping[str, str]] = MappingProxyType(
        {"alpha": "Controller α", "beta": "Controller β", "crossover": "Crossover", "tuned_mass": "Tuned mass"}
    )

    rules: ClassVar[tuple[Rule, ...]] = (
        Rule(
            (CROSSOVER, "drive.sample_time"),
            lambda f: (
                "drive.sample_time" not in f or f[CROSSOVER] * f["drive.sample_time"] <= 1 / 10 * (1 + TIME_ROUNDING)
            ),
            "a sample time of at most a tenth of the crossover's period",
            '[drive] sample_time = "50 us" (20 kHz) with crossover = "8 Hz"',
        ),
    )

    @classmethod
    def variant(cls, flat: Mapping[str, Any]) -> str | None:
        """Return "derivative" if the low-pass acts on the derivative alone, else None."""
        return "derivative" if flat.get(LOW_PASS) == "derivative" else None

    @classmethod
    def with_defaults(cls, flat: Mapping[str, Any]) -> dict[str, Any]:
        """Return the default of the mass that the controller is tuned for: the moving mass."""
        return {TUNED_MASS: moving_mass(flat)}

    @classmethod
    def structures(cls, flat: Mapping[str, Any]) -> Mapping[str, Mapping[str, Any]]:
        """Return another structure to try, in which the derivative acts on the measurement.

        The gains stay as they are. The result maps its name to the keys that change, with their values [SI]; None
        removes a key.
        """
        gone = dict.fromkeys((CROSSOVER, ALPHA, BETA, TUNED_MASS))
        written = {cls.key(name): value for name, value in as_gains(**numbers(flat)).items()}
        return {"derivative of the measurement": {**gone, **written, cls.key("derivative_on"): "measurement"}}

    @classmethod
    def as_pid(cls, flat: Mapping[str, Any]) -> PidLike:
        """Return the gains of Eq. 6."""
        return PidLike(**as_gains(**numbers(flat)), mass=flat[TUNED_MASS])

    @classmethod
    def like_pid(cls, pid: PidLike) -> dict[str, Any]:
        """Return the crossover."""
        return {"crossover": pid.crossover}

    @classmethod
    def gains(cls, flat: Mapping[str, Any]) -> tuple[Gain, ...]:
        """Return gain and time constants of Eq. 7, which follow from the keys, and the other gains."""
        values = numbers(flat)
        times = {"tau_z": "lead", "tau_i": "integral", "tau_p": "low-pass, before all terms"}
        return (
            Gain("gain of the loop", "k_p", values["k_p"], "N/m"),
            *(Gain(f"time constant of the {name}", symbol, values[symbol], "s") for symbol, name in times.items()),
            *(gain for gain in super().gains(flat) if gain.symbol not in cls.needed),
        )

    @classmethod
    def draw(cls, canvas: Any, flat: Mapping[str, Any]) -> None:
        """Draw the controller: a low-pass, then the three terms; or terms with filtered derivative."""
        if cls.variant(flat):
            canvas.box("k_p (1 + tau_z/tau_i + 1/(tau_i s) + tau_z s/(1 + tau_p s))")
            return
        canvas.box("1/(1 + tau_p s)")
        canvas.box("k_p (1 + tau_z s)(1 + 1/(tau_i s))")

    @classmethod
    def integrates(cls, flat: Mapping[str, Any]) -> bool:
        """Return True: the controller always has an integral."""
        return True

    @classmethod
    def stiffness(cls, blocks: Blocks, variant: str | None) -> sp.Expr:
        """Return the gain k_p of Eq. 8 [N/m]."""
        return rules(blocks)["k_p"]

    @classmethod
    def declare(cls, measured: Measured, blocks: Blocks, variant: str | None) -> Mapping[str, Signal]:
        """Return the parts "p", "i" and "d" of the force [N], by Eq. 7 of the thesis.

        With a `variant`, the filter of Eq. 6 acts on the derivative alone.
        """
        k_p, tau_z, tau_i, tau_p = rules(blocks).values()
        if variant:
            return {
                "p": measured.error * (k_p * (1 + tau_z / tau_i)),
                "i": blocks.integral(measured.error, k_p / tau_i),
                "d": blocks.derivative(measured.error, "error", tau_p) * (k_p * tau_z),
            }
        passed = blocks.low_pass(measured.error, tau_p, "error")
        return {
            "p": passed * (k_p * (1 + tau_z / tau_i)),
            "i": blocks.integral(passed, k_p / tau_i),
            "d": (measured.error - passed) * (k_p * tau_z / tau_p),
        }


def controller_table(crossover: str) -> dict[str, Any]:
    """Return a [controller] table for a crossover such as "8 Hz", with alpha and beta as usual.

    The usual alpha and beta are those of the examples.
    """
    return {"kind": "pid", "crossover": crossover, "alpha": 0.1, "beta": 2}


def tuned(crossover: Any, alpha: Any, beta: Any, mass: Any) -> dict[str, Any]:
    """Return the keys of a controller by van Dijk's rules, for a crossover [Hz] and a mass [kg].

    `alpha` and `beta` are the rules' other numbers.
    """
    return {KIND: "pid", CROSSOVER: crossover, ALPHA: alpha, BETA: beta, TUNED_MASS: mass}


def numbers(flat: Mapping[str, Any]) -> dict[str, float]:
    """Compute k_p [N/m] and the times tau_z, tau_i, tau_p [s] from a stage's keys in SI."""
    from sympy import S

    from friso.equations.continuous import Continuous

    return {
        name: float(expression.subs({symbol: flat[str(symbol)] for symbol in expression.free_symbols}))
        for name, expression in rules(Continuous(S.One)).items()
    }


def as_gains(k_p: float, tau_z: float, tau_i: float, tau_p: float) -> dict[str, float]:
    """Convert van Dijk's gain and time constants to kp [N/m], ki [N/(m s)], kd [N s/m], tau [s].

    These are the gains of Eq. 6 of the thesis.
    """
    return {"kp": k_p * (1 + tau_z / tau_i), "ki": k_p / tau_i, "kd": k_p * tau_z, "tau": tau_p}


def rules(blocks: Blocks) -> dict[str, sp.Expr]:
    """Return, as symbols, gain k_p [N/m] and time constants tau_z, tau_i, tau_p [s] by Eq. 8."""
    from sympy import pi, sqrt

    crossover, alpha, beta, mass = map(blocks.key, ("crossover", "alpha", "beta", "tuned_mass"))
    omega = 2 * pi * crossover
    root = sqrt(1 / alpha)
    tau_z = root / omega
    return {"k_p": mass * omega**2 / root, "tau_z": tau_z, "tau_i": beta * tau_z, "tau_p": 1 / (omega * root)}


BANDWIDTH, OBSERVER_RATIO = "controller.bandwidth", "controller.observer_ratio"


class _Parts(NamedTuple):
    """The two parts of the controller, from the error [m] to a force [N].

    They are an integral gain [N/(m s)] and a filter (lead s + proportional)/(d0 + d1 s + s^2).
    """

    integral: Any
    lead: Any
    proportional: Any
    d1: Any
    d0: Any


def _parts(blocks: Any) -> _Parts:
    """Return the integral gain and the filter of the controller, in terms of its keys."""
    from sympy import pi

    bandwidth, ratio, mass = map(blocks.key, ("bandwidth", "observer_ratio", "tuned_mass"))
    feedback = 2 * pi * bandwidth
    observer = ratio * feedback
    kp, kd = feedback**2, 2 * feedback
    b1, b2, b3 = 3 * observer, 3 * observer**2, observer**3
    n2, n1, n0 = b1 * kp + b2 * kd + b3, kp * b2 + kd * b3, kp * b3
    d1, d0 = b1 + kd, b2 + b1 * kd + kp
    return _Parts(mass * n0 / d0, mass * (n2 - n0 / d0), mass * (n1 - n0 * d1 / d0), d1, d0)


@register_controller
class DisturbanceRejection(ControllerSection):
    """Linear active disturbance rejection (ADRC) by the bandwidths of feedback and observer."""

    kind: Literal["adrc"]
    bandwidth: Annotated[Value, Quantity("Hz", positive, "8 Hz")]
    """Bandwidth of the feedback, w_c/(2 pi); the loop crosses 0 dB at a higher frequency."""
    observer_ratio: Annotated[float, Number(at_least_1, "5")] = 5.0
    """Bandwidth of the observer relative to that of the feedback, usually 3 to 10 (Herbst 2021)."""
    tuned_mass: Annotated[Value | None, Quantity("kg", positive, "1.7 kg")] = None
    """Mass that the observer assumes, 1/b0."""

    bandwidth_key = BANDWIDTH
    bandwidth_name = "bandwidth"
    speeds_up: ClassVar[Mapping[str, int]] = MappingProxyType({"bandwidth": 1})
    shaped_by: ClassVar[Mapping[str, tuple[float, float]]] = MappingProxyType({"observer_ratio": (2.0, 10.0)})
    loop_gain = ("tuned_mass",)
    shares: ClassVar[Mapping[str, str]] = MappingProxyType({"o": "observer", "i": "integral"})
    words: ClassVar[Mapping[str, str]] = MappingProxyType(
        {"bandwidth": "Bandwidth of the feedback", "observer_ratio": "Observer over feedback"}
    )
    symbols: ClassVar[Mapping[str, tuple[str, str]]] = MappingProxyType(
        {
            "bandwidth": ("bandwidth of the feedback, w_c/(2 pi)", "fc"),
            "observer_ratio": ("bandwidth of the observer over it", "w_o/w_c"),
            "tuned_mass": ("mass in the observer, 1/b0", "m"),
        }
    )

    rules: ClassVar[tuple[Rule, ...]] = (
        Rule(
            (BANDWIDTH, OBSERVER_RATIO, "drive.sample_time"),
            lambda f: (
                "drive.sample_time" not in f
                or f[BANDWIDTH] * f[OBSERVER_RATIO] * f["drive.sample_time"] <= 1 / 10 * (1 + TIME_ROUNDING)
            ),
            "a sample time of at most a tenth of the observer's period",
            '[drive] sample_time = "50 us" (20 kHz) with bandwidth = "8 Hz", observer_ratio = 5',
        ),
    )

    @classmethod
    def with_defaults(cls, flat: Mapping[str, Any]) -> dict[str, Any]:
        """Return the default of the mass that the controller assumes: the moving mass."""
        return {TUNED_MASS: moving_mass(flat)}

    @classmethod
    def as_pid(cls, flat: Mapping[str, Any]) -> PidLike:
        """Return gains by van Dijk's rules for the crossover of the loop."""
        crossover = flat[BANDWIDTH] * crossing_ratio(flat[OBSERVER_RATIO])
        return VanDijk.as_pid(tuned(crossover, 0.1, 2.0, flat[TUNED_MASS]))

    @classmethod
    def like_pid(cls, pid: PidLike) -> dict[str, Any]:
        """Return the bandwidth with which the loop has the same crossover."""
        return {"bandwidth": pid.crossover / crossing_ratio(5.0), "observer_ratio": 5.0}

    @classmethod
    def gains(cls, flat: Mapping[str, Any]) -> tuple[Gain, ...]:
        """Return the controller's keys, and the bandwidth of the observer."""
        observer = flat[BANDWIDTH] * flat[OBSERVER_RATIO]
        return (*super().gains(flat), Gain("bandwidth of the observer, w_o/(2 pi)", "fo", observer, "Hz"))

    @classmethod
    def draw(cls, canvas: Any, flat: Mapping[str, Any]) -> None:
        """Draw the controller: a box for the observer, then one for the feedback of its states."""
        canvas.box("observer: e1, e2, e3")
        canvas.box("m (w_c^2 e1 + 2 w_c e2 + e3)")

    @classmethod
    def integrates(cls, flat: Mapping[str, Any]) -> bool:
        """Return True: the estimated disturbance is an integral."""
        return True

    @classmethod
    def stiffness(cls, blocks: Blocks, variant: None) -> sp.Expr:
        """Return the static stiffness of the filter in parallel with the integral [N/m]."""
        parts = _parts(blocks)
        return parts.proportional / parts.d0

    @classmethod
    def declare(cls, measured: Measured, blocks: Blocks, variant: None) -> Mapping[str, Signal]:
        """Return the integral and the filtered part of the force [N]."""
        integral, lead, proportional, d1, d0 = _parts(blocks)
        upper, lower = (proportional / d0, lead / d0, 0), (1, d1 / d0, 1 / d0)
        return {
            "o": blocks.biquad(measured.error, upper, lower, "observer"),
            "i": blocks.integral(measured.error, integral),
        }


def crossing_ratio(observer_ratio: float) -> float:
    """Return the loop's 0 dB crossover over the key `bandwidth`, for a free mass as assumed.

    The result depends only on `observer_ratio`, the bandwidth of the observer over that of the feedback.

    Examples -------- >>> round(crossing_ratio(5.0), 2) 2.73
    """
    import numpy as np

    k = observer_ratio
    upper = np.array([3 * k + 6 * k**2 + k**3, 3 * k**2 + 2 * k**3, k**3])
    lower = np.array([1.0, 3 * k + 2, 3 * k**2 + 6 * k + 1, 0.0, 0.0, 0.0])

    def size(polynomial: np.ndarray) -> np.ndarray:  # of the squared magnitude over frequency
        even = polynomial.astype(complex) * 1j ** np.arange(len(polynomial) - 1, -1, -1)
        return np.convolve(even, even.conj()).real

    roots = np.roots(np.polysub(size(lower), size(upper)))
    real = roots[(abs(roots.imag) < 1e-9 * abs(roots)) & (roots.real > 0)].real
    return float(real.max())


KP, KI, KD, TAU, DERIVATIVE_ON = (f"controller.{name}" for name in ("kp", "ki", "kd", "tau", "derivative_on"))


FEEDFORWARD = ("viscous_feedforward", "acceleration_feedforward", "coulomb_feedforward", "jerk_feedforward")


INTEGRAL_TIME_FACTOR = 4.0
"""Initial integral time, in units of the derivative time."""


class Terms(NamedTuple):
    """Which terms a PID controller has; terms that it lacks are left out of the equations.

    They are the integral, the derivative and its filter, and `feedforward`, by the names of its keys.
    """

    integral: bool
    filtered: bool
    derivative_on: Literal["none", "error", "measurement"]
    feedforward: tuple[str, ...] = ()


def proportional_derivative(stiffness: float, damping: float) -> dict[str, Any]:
    """Return the keys of a controller with a stiffness [N/m] and a damping [N s/m], no integral."""
    return {KIND: "pid", KP: stiffness, KI: 0.0, KD: damping, TAU: 0.0, DERIVATIVE_ON: "error"}


@register_controller
class PidGains(Pid):
    """PID by its gains (thesis, Eq. 6); omitted gains are 0. The filter acts on the derivative."""

    kp: Annotated[Value, Quantity("N/m", non_negative, "3 N/m")] = Value(0, "0 N/m")
    ki: Annotated[Value, Quantity("N/(m*s)", non_negative, "4 N/(m*s)")] = Value(0, "0 N/(m*s)")
    kd: Annotated[Value, Quantity("N*s/m", non_negative, "6 N*s/m")] = Value(0, "0 N*s/m")
    tau: Annotated[Value, Quantity("s", non_negative, "1 ms")] = Value(0, "0 s")
    derivative_on: Literal["error", "measurement"] = "error"
    viscous_feedforward: Annotated[Value | None, Quantity("N*s/m", any_sign, "6 N*s/m")] = None
    """Force per velocity of the reference; equal to `kd`, it turns a derivative of the measurement into one of the
    error."""
    acceleration_feedforward: Annotated[Value | None, Quantity("kg", any_sign, "1.7 kg")] = None
    coulomb_feedforward: Annotated[Value | None, Quantity("N", any_sign, "1 N")] = None
    """Force fed forward with the sign of the reference's velocity."""
    jerk_feedforward: Annotated[Value | None, Quantity("kg*s", any_sign, "0.5 g*s")] = None

    written = "gains"
    needed = ("kp", "ki", "kd")
    asked = "any of kp, ki, kd"
    speeds_up: ClassVar[Mapping[str, int]] = MappingProxyType({"kp": 2, "ki": 3, "kd": 1, "tau": -1})
    loop_gain = ("kp", "ki", "kd")
    integral_gain: ClassVar[Mapping[str, int]] = MappingProxyType({"ki": 1})
    decisive = ("ki", "kd", "tau")
    shares: ClassVar[Mapping[str, str]] = MappingProxyType({**Pid.shares, "f": "feedforward"})
    symbols: ClassVar[Mapping[str, tuple[str, str]]] = MappingProxyType(
        {
            "kp": ("proportional gain", "kp"),
            "ki": ("integral gain", "ki"),
            "kd": ("derivative gain", "kd"),
            "tau": ("filter of the derivative", "tau"),
            **SYMBOLS,
        }
    )

    rules: ClassVar[tuple[Rule, ...]] = (
        Rule(
            (DERIVATIVE_ON, KD, TAU),
            lambda f: (f[DERIVATIVE_ON] != "error") | (f[KD] == 0) | (f[TAU] > 0),
            "a filter (tau > 0) for the derivative of the error, or the derivative of the measurement",
            'tau = "1 ms", or derivative_on = "measurement"',
        ),
    )

    @classmethod
    def variant(cls, flat: Mapping[str, Any]) -> Terms:
        """Return which terms the controller has, from a stage's keys in SI."""
        derived = flat[KD] > 0
        return Terms(
            integral=bool(flat[KI] > 0),
            filtered=bool(derived and flat[TAU] > 0),
            derivative_on=flat[DERIVATIVE_ON] if derived else "none",
            feedforward=tuple(name for name in FEEDFORWARD if cls.key(name) in flat),
        )

    @classmethod
    def takes_velocity(cls, flat: Mapping[str, Any]) -> bool:
        """Tell whether the controller takes the derivative of the measurement."""
        return bool(flat[KD] > 0 and flat[DERIVATIVE_ON] == "measurement")

    @classmethod
    def structures(cls, flat: Mapping[str, Any]) -> Mapping[str, Mapping[str, Any]]:
        """Return other structures to try, by name: a mapping of the keys that change to values [SI].

        A structure takes the derivative of the other signal, adds feedforward, or drops or adds the integral. None as a
        value removes the key.
        """
        listed: dict[str, Mapping[str, Any]] = {}
        if flat[KD] and flat[DERIVATIVE_ON] == "error":
            listed["derivative of the measurement"] = {DERIVATIVE_ON: "measurement"}
        if flat[KD] and flat[DERIVATIVE_ON] == "measurement" and flat[TAU]:
            listed["derivative of the error"] = {DERIVATIVE_ON: "error"}
        ahead = feedforward_of_moves(flat, "viscous_feedforward", "acceleration_feedforward")
        if ahead and flat[DERIVATIVE_ON] == "measurement":  # the derivative of the measurement opposes the move itself
            ahead[cls.key("viscous_feedforward")] = ahead.get(cls.key("viscous_feedforward"), 0.0) + flat[KD]
        if ahead:
            listed["feedforward of the move"] = ahead
        if flat[KI] and flat[KP]:
            listed["no integral"] = {KI: None}
        elif flat[KP] and flat[KD]:
            listed["with an integral"] = {KI: flat[KP] ** 2 / flat[KD] / INTEGRAL_TIME_FACTOR}
        return listed

    @classmethod
    def as_pid(cls, flat: Mapping[str, Any]) -> PidLike:
        """Return the gains."""
        return PidLike(flat[KP], flat[KI], flat[KD], flat[TAU], moving_mass(flat))

    @classmethod
    def like_pid(cls, pid: PidLike) -> dict[str, Any]:
        """Return the gains; without a filter, the derivative acts on the measurement."""
        on = {} if pid.tau or not pid.kd else {"derivative_on": "measurement"}
        return {"kp": pid.kp, "ki": pid.ki, "kd": pid.kd, "tau": pid.tau, **on}

    @classmethod
    def gains(cls, flat: Mapping[str, Any]) -> tuple[Gain, ...]:
        """Return the controller's gains and times, and those of an equivalent P over PI loop.

        The gains of the P over PI loop are left out if there is no such loop.
        """
        kp, ki, kd = flat[KP], flat[KI], flat[KD]
        listed = [*super().gains(flat)]
        if ki and kp:
            listed.append(Gain("integral time kp/ki", "Ti", kp / ki, "s"))
        if kp and kd:
            listed.append(Gain("derivative time kd/kp", "Td", kd / kp, "s"))
        if ki and kd and not flat[TAU] and flat[DERIVATIVE_ON] == "measurement" and kp**2 >= 4 * ki * kd:
            half, root = kp / (2 * kd), sqrt((kp / (2 * kd)) ** 2 - ki / kd)
            listed.append(Gain("as P over PI with kp = kd: kv (or 1/Tn)", "kv", half - root, "1/s"))
            listed.append(Gain("as P over PI with kp = kd: Tn (or 1/kv)", "Tn", 1 / (half + root), "s"))
        return tuple(listed)

    @classmethod
    def draw(cls, canvas: Any, flat: Mapping[str, Any]) -> None:
        """Draw the controller: a box for the terms on the error, and a summing point for the others."""
        derivative = "kd s/(1 + tau s)" if flat[TAU] else "kd s"
        on_error = flat[DERIVATIVE_ON] == "error"
        terms = ["kp", *(["ki/s"] if flat[KI] else []), *([derivative] if flat[KD] and on_error else [])]
        canvas.box(" + ".join(terms))
        ahead, beside = fed_forward(flat), flat[KD] and not on_error
        if ahead or beside:
            canvas.sum(ahead, f"[ {derivative} ]-- y" if beside else "")

    @classmethod
    def integrates(cls, flat: Mapping[str, Any]) -> bool:
        """Tell whether the integral gain is not 0."""
        return bool(flat[KI] > 0)

    @classmethod
    def stiffness(cls, blocks: Blocks, variant: Terms) -> sp.Expr:
        """Return the proportional gain [N/m]."""
        return blocks.key("kp")

    @classmethod
    def declare(cls, measured: Measured, blocks: Blocks, variant: Terms) -> Mapping[str, Signal]:
        """Return the terms of the force [N] in Eq. 6 by letter: p, i, d and, if there is any, f.

        f is the feedforward; any other term that the controller lacks is 0.
        """
        kp, ki, kd, tau = map(blocks.key, ("kp", "ki", "kd", "tau"))
        lag = tau if variant.filtered else None
        derivative = {
            "none": lambda: blocks.nothing,
            "error": lambda: blocks.derivative(measured.error, "error", lag) * kd,
            "measurement": lambda: -(blocks.derivative(measured.rated, "position", lag) * kd),
        }
        shares = {
            "p": measured.error * kp,
            "d": derivative[variant.derivative_on](),
            "i": blocks.integral(measured.error, ki, rule="backward_euler") if variant.integral else blocks.nothing,
        }
        references = (
            measured.reference_velocity,
            measured.reference_acceleration,
            measured.reference_direction,
            measured.reference_jerk,
        )
        ahead = [
            reference * blocks.key(name)
            for name, reference in zip(FEEDFORWARD, references, strict=True)
            if name in variant.feedforward
        ]
        return {**shares, "f": sum(ahead, start=blocks.nothing)} if ahead else shares
