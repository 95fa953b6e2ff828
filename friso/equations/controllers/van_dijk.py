"""Controllers that follow from a bandwidth: van Dijk's rules, and an observer of disturbances.

PID by van Dijk's tuning rules: crossover, alpha, beta and mass (thesis, Eq. 7 and 8).

Linear active disturbance rejection: an extended state observer and its feedback.

All that acts on the mass m besides the force F is one disturbance d: e'' = d - F/m for the error e. The observer has a
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

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, NamedTuple

from friso.equations.controllers.pid import Pid
from friso.quantities import Number, Quantity, Value, at_least_1, inside_0_1, positive
from friso.stage import ControllerSection, Rule, register_controller
from friso.stage.controllers import KIND, Gain
from friso.stage.tables import TIME_ROUNDING, moving_mass

if TYPE_CHECKING:
    import sympy as sp

    from friso.equations.blocks import Blocks, Measured, Signal


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
