"""Linear active disturbance rejection: an extended state observer and its feedback.

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

from friso.equations.controllers.van_dijk import TUNED_MASS
from friso.quantities import Number, Quantity, Value, at_least_1, positive
from friso.stage import ControllerSection, Rule, register_controller
from friso.stage.controllers import Gain
from friso.stage.tables import TIME_ROUNDING, moving_mass

if TYPE_CHECKING:
    import sympy as sp

    from friso.equations.blocks import Blocks, Measured, Signal

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
