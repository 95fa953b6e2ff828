"""PID by van Dijk's tuning rules: crossover, alpha, beta and mass (thesis, Eq. 7 and 8)."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from friso.equations.controllers.pid import Pid
from friso.quantities import Number, Quantity, Value, at_least_1, inside_0_1, positive
from friso.stage import Rule, register_controller
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
