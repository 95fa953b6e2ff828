"""Elasto-plastic friction: Dupont et al. 2002, doi:10.1109/TAC.2002.1000274."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import numpy as np

from friso.equations.conditions import level_under_conditions
from friso.equations.friction.bristles import bristle_friction, bristles_active, keeping_bristle
from friso.equations.friction.common import (
    COULOMB_BELOW_STATIC,
    STEADY_LOAD,
    Friction,
    StribeckCurve,
    StribeckSection,
    direction,
    stribeck_level,
    stribeck_level_from_speed,
)
from friso.equations.friction.measured import MeasuredFriction, as_good, best, on_bristles, virgin_displacements
from friso.quantities import Quantity, Value, non_negative, positive
from friso.stage import Rule, register_friction

if TYPE_CHECKING:
    import sympy as sp

BREAKAWAY_BELOW_COULOMB = Rule(
    ("friction.breakaway_deflection", "friction.bristle_stiffness", "friction.coulomb"),
    lambda flat: (
        flat["friction.breakaway_deflection"] * flat["friction.bristle_stiffness"]
        < level_under_conditions(flat, "coulomb") * (1 - abs(flat.get("friction.asymmetry", 0.0)))
    ),
    expected="bristles that hold less than Coulomb friction in either direction when they begin to slip",
    example='breakaway_deflection = "7 um" with bristle_stiffness = "1e5 N/m" and coulomb = "1 N"',
)


@register_friction
class ElastoPlastic(StribeckSection):
    """LuGre bristles that are purely elastic up to a break-away deflection.

    A load below does not make them drift: z' = v (1 - alpha(z, v) sigma_0 z sgn(v)/g(v)), F = sigma_0 z + sigma_1 z' +
    sigma_2 v.

    alpha is 0 while abs(z) < z_ba, or while z and v have opposite signs; from there it rises as half a sine to 1 at
    the deflection of steady sliding, z_max = g(v)/sigma_0, and stays 1 beyond (Eq. 15 and 16 of the source).
    """

    model: Literal["elasto_plastic"]
    bristle_stiffness: Annotated[Value, Quantity("N/m", positive, "1e5 N/m")]
    bristle_damping: Annotated[Value, Quantity("N*s/m", non_negative, "316 N*s/m")]
    breakaway_deflection: Annotated[Value, Quantity("m", positive, "7 um")]
    decided_by: ClassVar[Mapping[str, str]] = {
        "": "the drift under a load that oscillates below break-away",
        "friction.breakaway_deflection": "the largest oscillating load under which the stage does not drift",
    }
    rules: ClassVar[tuple[Rule, ...]] = (COULOMB_BELOW_STATIC, BREAKAWAY_BELOW_COULOMB, STEADY_LOAD)

    @staticmethod
    def declare(velocity: sp.Symbol, variant: StribeckCurve) -> Friction:
        """Return the equations of friction on a body moving at `velocity` [m/s]."""
        from friso.equations.component import Kink, key, sine, state

        forward = direction(velocity, key("friction.stribeck_velocity"))
        deflection, stiffness = state("bristle_deflection"), key("friction.bristle_stiffness")
        limit, begins = (
            stribeck_level(velocity, forward.sign, variant) / stiffness,
            key("friction.breakaway_deflection"),
        )
        most = stribeck_level_from_speed(velocity, variant) / stiffness
        kinks, shares, sliding = [forward], [], {deflection: forward.sign * limit}
        for side, name, along in ((1, "ahead", forward.beyond), (-1, "behind", 1 - forward.beyond)):
            plastic = Kink(f"plastic_{name}", side * deflection - begins)
            full = Kink(f"slipping_{name}", side * deflection - limit, starts=side * deflection - most)
            sliding |= {plastic.beyond: along, full.beyond: along}
            turns = (side * deflection - (limit + begins) / 2) / (limit - begins) / 2
            swelling: Any = sine(turns)
            rising = (1 + swelling) / 2
            # z beyond z_max is beyond z_ba, too; written so, neither kink jumps, whatever the side of the other
            shares.append(plastic.beyond * rising + full.beyond * (1 - rising))
            kinks += [plastic, full]
        ahead, behind = shares
        alpha = forward.beyond * ahead + (1 - forward.beyond) * behind
        rate = velocity * (1 - alpha * forward.sign * deflection / limit)
        return bristle_friction(velocity, variant, rate, kinks, sliding)

    @staticmethod
    def shown(flat: Mapping[str, Any]) -> MeasuredFriction:
        """Return what measurements would show of the law, which is elastic up to break-away."""
        static, stiffness = flat["friction.static"], flat["friction.bristle_stiffness"]
        displacement = virgin_displacements(static, stiffness)
        force = virgin_force(static, stiffness, flat["friction.breakaway_deflection"], displacement)
        return on_bristles(flat, displacement, force)

    @staticmethod
    def keeping(measured: MeasuredFriction, elements: int) -> dict[str, Any]:
        """Return keys with measured bristles; the break-away deflection fits the virgin curve best."""
        return keeping_bristle(measured, breakaway_deflection=best(*_break_away_candidates(measured)))

    @staticmethod
    def left_open(measured: MeasuredFriction) -> dict[str, tuple[float, float]]:
        """Return the range of break-away deflections that the measured virgin curve allows."""
        return {"friction.breakaway_deflection": as_good(*_break_away_candidates(measured))}

    @staticmethod
    def active(flat: Mapping[str, Any]) -> str:
        """Return the condition of passivity that the law violates; "" if it is passive.

        The law is passive if LuGre with equal bristles is, because alpha lies between 0 and 1.
        """
        return bristles_active(flat)


def _most(measured: MeasuredFriction) -> float:
    """Return the deflection [m] at which bristles carry the weaker direction's Coulomb friction.

    Larger break-away deflections are not possible.
    """
    levels = measured.levels
    return levels.coulomb * (1 - abs(levels.asymmetry)) / measured.stiffness


def _break_away_candidates(measured: MeasuredFriction) -> tuple[np.ndarray, np.ndarray]:
    """Return trial break-away deflections [m], and the misfit of the virgin curve for each."""
    levels, stiffness = measured.levels, measured.stiffness
    tried = np.linspace(0.02, 0.98, 49) * _most(measured)
    curves = (virgin_force(levels.static, stiffness, begins, measured.displacement) for begins in tried)
    return tried, np.array([measured.misfit(curve) for curve in curves])


def virgin_force(static: float, stiffness: float, begins: float, displacement: np.ndarray) -> np.ndarray:
    """Return the virgin curve, force [N] over displacement [m] from rest, both of shape (n,).

    `static` [N] and `stiffness` [N/m] are F_s and sigma_0, and bristles begin to slip at the deflection `begins` [m].
    The curve solves dz/dx = 1 - alpha(z) z/z_max, with z_max = F_s/sigma_0, by quadrature of dx/dz.
    """
    from scipy.integrate import cumulative_simpson

    most = static / stiffness
    left = np.concatenate([np.linspace(1.0, 0.01, 800, endpoint=False), np.geomspace(0.01, 1e-12, 401)])
    z = most - (most - begins) * left
    alpha = (1 + np.sin(np.pi * (z - (most + begins) / 2) / (most - begins))) / 2
    x = begins + cumulative_simpson(1 / np.maximum(1 - alpha * z / most, 1e-15), x=z, initial=0.0)
    lacking = (most - begins) * np.exp(np.interp(displacement, x, np.log(left)))
    return stiffness * np.where(displacement <= begins, displacement, most - lacking)
