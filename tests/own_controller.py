"""A controller of one's own in one file: PI on the error, D with a lead filter on the measurement, and a force limit.

Tuned by its bandwidth: F = (k + k_i/s) e - d s (1 + t_1 s)/((1 + t_2 s)(1 + t_1/10 s)) y, with k, k_i, d, t_1 and t_2
from the bandwidth and the mass.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from friso.quantities import Number, Quantity, Value, positive
from friso.stage import ControllerSection, register_controller

if TYPE_CHECKING:
    import sympy as sp

    from friso.equations.blocks import Blocks, Measured, Signal


@register_controller
class PiDLead(ControllerSection):
    """PI-D with a lead filter."""

    kind: Literal["pi-d"]
    bandwidth: Annotated[Value, Quantity("Hz", positive, "8 Hz")]
    mass: Annotated[Value, Quantity("kg", positive, "1.7 kg")]
    damping: Annotated[float, Number(positive, "0.7")] = 0.7

    bandwidth_key = "controller.bandwidth"
    bandwidth_name = "bandwidth"
    speeds_up: ClassVar[Mapping[str, int]] = MappingProxyType({"bandwidth": 1})
    loop_gain = ("mass",)
    shares: ClassVar[Mapping[str, str]] = MappingProxyType({"p": "spring", "i": "integral", "d": "damper"})

    @classmethod
    def integrates(cls, flat: Mapping[str, Any]) -> bool:
        return True

    @classmethod
    def stiffness(cls, blocks: Blocks, variant: None) -> sp.Expr:
        bandwidth, mass = blocks.key("bandwidth"), blocks.key("mass")
        return 4 * mass * bandwidth**2 * 9

    @classmethod
    def declare(cls, measured: Measured, blocks: Blocks, variant: None) -> Mapping[str, Signal]:
        from sympy import Rational, pi

        bandwidth, mass, zeta = map(blocks.key, ("bandwidth", "mass", "damping"))
        omega = 2 * pi * bandwidth
        stiffness = cls.stiffness(blocks, variant)
        rate = blocks.derivative(measured.position, "position", 1 / (10 * omega))
        damper = blocks.lead(rate, 1 / (3 * omega), 1 / (30 * omega), "rate")
        return {
            "p": measured.error * stiffness,
            "i": blocks.integral(measured.error, stiffness * omega * Rational(1, 4), rule="backward_euler"),
            "d": -(damper * (2 * zeta * mass * omega)),
        }
