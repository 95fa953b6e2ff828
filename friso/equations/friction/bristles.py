"""Friction laws with one damped bristle: LuGre and those made of it.

The laws differ in how fast the bristle deflects; the rest is as in LuGre.

LuGre: Canudas de Wit et al. 1995, doi:10.1109/9.376053 (thesis, Eq. 3 to 5).

Elasto-plastic: Dupont et al. 2002, doi:10.1109/TAC.2002.1000274.

Growing with the force of the drive, as in joints with strain-wave and cycloid gears: friction of a robot's joint rises
in proportion to the torque that it transmits (Carvalho Bittencourt, Gunnarsson 2012, doi:10.1115/1.4006589).

Static friction growing with the time at rest: friction approaches its curve over speed with a delay, as in laws of rate
and state (Ruina 1983, doi:10.1029/JB088iB12p10359). At rest it does so exponentially in time, which is Kato's law with
the exponent 1 (Armstrong-Helouvry, Dupont, Canudas de Wit 1994, doi:10.1016/0005-1098(94)90209-7). Sliding renews the
contacts over a distance.

Rolling: stiffness before gross rolling falls with a power of the force. The law is due to Dahl 1976,
doi:10.2514/3.61511, here with the Stribeck level, bristle damping and viscous friction of LuGre. Dahl's exponent i
shapes the virgin curve: d(sigma_0 z)/dx = sigma_0 (1 - sigma_0 z/g)^i. From rest, 1 - F/F_s = (1 + (i - 1) sigma_0
x/F_s)^(-1/(i - 1)); with i = 1 the law is LuGre. It has a single state, so that a reversal from rolling leaves the
stiffness 2^i sigma_0. Masing's rule, which ball guideways obey (Al-Bender, Symens 2005,
doi:10.1016/j.wear.2004.11.018), needs elements in parallel (`gms`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import numpy as np

from friso.equations.conditions import friction_level, level_under_conditions
from friso.equations.friction.common import (
    COULOMB_BELOW_STATIC,
    STEADY_LOAD,
    Friction,
    MeasuredFriction,
    StribeckCurve,
    StribeckSection,
    as_good,
    best,
    direction,
    levels_under_conditions,
    on_bristles,
    power_law,
    stribeck_level,
    stribeck_level_from_speed,
    transmitted_force,
    virgin_displacements,
    viscous_force,
)
from friso.quantities import Bound, Number, Quantity, Value, non_negative, positive
from friso.stage import Rule, register_friction

if TYPE_CHECKING:
    import sympy as sp

    from friso.equations.component import Kink


def bristle_friction(
    velocity: sp.Symbol,
    variant: StribeckCurve,
    rate: sp.Expr,
    kinks: Sequence[Kink],
    sliding: Mapping[sp.Symbol, sp.Expr] | None = None,
) -> Friction:
    """Return friction of a bristle z that deflects at `rate` [m/s]: F = s0 z + s1 z' + s2 v.

    s0, s1, s2 are stiffness, damping and viscous friction. `variant` has the choices of the law's Stribeck curve. The
    `kinks` are where derivatives jump; the first one is the reversal of the velocity. `sliding` holds states and modes
    in steady sliding, where the equations do not determine them.
    """
    from friso.equations.component import Component, Output, Role, State, key, state

    deflection, stiffness = state("bristle_deflection"), key("friction.bristle_stiffness")
    force = (
        stiffness * deflection
        + key("friction.bristle_damping") * rate
        + viscous_force(velocity, kinks[0].sign, variant)
    )
    static = friction_level("static", variant.conditions)
    bristle = State(deflection, rate, "m", static / stiffness, Role.BRISTLE)
    outputs = {"bristle_deflection": Output(deflection, "m", "bristle deflection z")}
    return Friction(force, static, Component((bristle,), tuple(kinks), outputs), sliding)


def keeping_bristle(measured: MeasuredFriction, **shape: float) -> dict[str, Any]:
    """Return the keys of a law with measured friction levels, bristle stiffness and damping.

    `shape` has further keys, which shape the virgin curve.
    """
    return {
        **measured.levels.keys,
        "friction.bristle_stiffness": measured.stiffness,
        "friction.bristle_damping": measured.damping,
        **{f"friction.{name}": value for name, value in shape.items()},
    }


def bristles_active(flat: Mapping[str, Any], softer: float = 1.0, power: str = "") -> str:
    """Return the condition of passivity that a damped bristle violates; "" if it is passive.

    A fully bent bristle yields `softer` times as fast as in LuGre. `power` is the exponent that the condition then
    shows, such as "^2".
    """
    levels, damping = levels_under_conditions(flat), flat["friction.bristle_damping"]
    least = damping * (levels.static / levels.coulomb - 1) * softer
    viscous = levels.viscous * (1 - abs(levels.viscous_asymmetry))  # in the direction with less damping
    if viscous >= least:
        return ""
    return (
        f"viscous >= bristle_damping ((static - coulomb)/coulomb){power} = {least:.4g} N*s/m; "
        f"it is {viscous:.4g} N*s/m{' in one direction' if levels.viscous_asymmetry else ''}"
    )


@register_friction
class LuGre(StribeckSection):
    """Bristles that deflect by z.

    z' = v - sigma_0 abs(v)/g(v) z, F = sigma_0 z + sigma_1 z' + sigma_2 v.
    """

    model: Literal["lugre"]
    fitted: ClassVar[bool] = True
    bristle_stiffness: Annotated[Value, Quantity("N/m", positive, "1e5 N/m")]
    bristle_damping: Annotated[Value, Quantity("N*s/m", non_negative, "316 N*s/m")]

    @staticmethod
    def declare(velocity: sp.Symbol, variant: StribeckCurve) -> Friction:
        """Return the equations of friction on a body moving at `velocity` [m/s]."""
        from friso.equations.component import key, state

        forward = direction(velocity, key("friction.stribeck_velocity"))
        deflection, stiffness = state("bristle_deflection"), key("friction.bristle_stiffness")
        level = stribeck_level(velocity, forward.sign, variant)
        rate = velocity - stiffness * forward.sign * velocity / level * deflection
        return bristle_friction(velocity, variant, rate, (forward,))

    @staticmethod
    def shown(flat: Mapping[str, Any]) -> MeasuredFriction:
        """Return what measurements would show; from rest, F = F_s (1 - exp(-sigma_0 x/F_s))."""
        static, stiffness = flat["friction.static"], flat["friction.bristle_stiffness"]
        displacement = virgin_displacements(static, stiffness)
        return on_bristles(flat, displacement, -static * np.expm1(-displacement * stiffness / static))

    @staticmethod
    def keeping(measured: MeasuredFriction, elements: int) -> dict[str, Any]:
        """Return the law's keys for measured friction; the virgin curve keeps LuGre's shape."""
        return keeping_bristle(measured)

    @staticmethod
    def active(flat: Mapping[str, Any]) -> str:
        """Return the condition of passivity if it is violated: sigma_2 >= sigma_1 (F_s - F_c)/F_c.

        The result is "" if the law is passive. The condition is due to Barabanov, Ortega 2000, doi:10.1109/9.839944.
        """
        return bristles_active(flat)


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


from_0_below_1 = Bound("at least 0 and less than 1", lambda value: (value >= 0) & (value < 1))


@register_friction
class LoadDependent(StribeckSection):
    """LuGre bristles below a level of which a part is proportional to the force P of the drive.

    z' = v - sigma_0 abs(v)/((1 - mu) g(v) + mu abs(P)) z, F = sigma_0 z + sigma_1 z' + (1 - mu) sigma_2 v, with mu =
    `load_coefficient`. Levels and viscous friction are those that a drive measures which moves nothing else: P is then
    friction itself. Without mu the law is LuGre.
    """

    model: Literal["load_dependent"]
    follows_drive: ClassVar[bool] = True
    bristle_stiffness: Annotated[Value, Quantity("N/m", positive, "1e5 N/m")]
    bristle_damping: Annotated[Value, Quantity("N*s/m", non_negative, "316 N*s/m")]
    load_coefficient: Annotated[float, Number(from_0_below_1, "0.1")]
    rounded: ClassVar[float] = 1e-7
    """Force of the drive, relative to static friction, below which its size is rounded."""
    usual_coefficients: ClassVar[tuple[float, float]] = (0.02, 0.3)
    """Coefficients of the load that joints with strain-wave and cycloid gears show."""
    decided_by: ClassVar[Mapping[str, str]] = dict.fromkeys(
        ("", "friction.load_coefficient"), "the drive's force in slow motion to and fro under several loads"
    )

    @staticmethod
    def declare(velocity: sp.Symbol, variant: StribeckCurve) -> Friction:
        """Return the equations of friction on a body moving at `velocity` [m/s]."""
        from sympy import sqrt

        from friso.equations.component import key, state

        forward = direction(velocity, key("friction.stribeck_velocity"))
        deflection, stiffness = state("bristle_deflection"), key("friction.bristle_stiffness")
        share, corner = (
            key("friction.load_coefficient"),
            LoadDependent.rounded * friction_level("static", variant.conditions),
        )
        level = stribeck_level(velocity, forward.sign, variant)
        load = sqrt(transmitted_force() ** 2 + corner**2) - corner
        rate = velocity - stiffness * forward.sign * velocity / ((1 - share) * level + share * load) * deflection
        viscous = viscous_force(velocity, forward.sign, variant)
        rounded = forward.sign * corner * share / (1 - share)
        sliding = {deflection: (forward.sign * level + share * viscous - rounded) / stiffness}
        law = bristle_friction(velocity, variant, rate, (forward,), sliding)
        alone = stiffness * deflection + (1 - share) * viscous
        return Friction(law.force - share * viscous, law.breakaway, law.component, sliding, alone)

    @staticmethod
    def shown(flat: Mapping[str, Any]) -> MeasuredFriction:
        """Return what measurements without another load would show."""
        share, static, stiffness = (
            float(flat[f"friction.{name}"]) for name in ("load_coefficient", "static", "bristle_stiffness")
        )
        displacement = virgin_displacements(static, stiffness)
        lacking = np.append(np.linspace(1.0, 0.01, 800, endpoint=False), np.geomspace(0.01, 1e-12, 401))
        places = -static / stiffness / (1 - share) * (np.log(lacking) + share * (1 - lacking))
        force = static * (1 - np.exp(np.interp(displacement, places, np.log(lacking))))
        return on_bristles(flat, displacement, force)

    @staticmethod
    def keeping(measured: MeasuredFriction, elements: int) -> dict[str, Any]:
        """Return the law's keys for measured friction, with a coefficient in the middle of what may be."""
        return keeping_bristle(measured, load_coefficient=sum(LoadDependent.usual_coefficients) / 2)

    @staticmethod
    def left_open(measured: MeasuredFriction) -> dict[str, tuple[float, float]]:
        """Return the range of coefficients, of which friction without a load does not tell."""
        return {"friction.load_coefficient": LoadDependent.usual_coefficients}

    @staticmethod
    def active(flat: Mapping[str, Any]) -> str:
        """Return the condition of passivity that the law violates without a load; "" if it is passive."""
        return bristles_active(flat)


@register_friction
class DwellFriction(StribeckSection):
    """LuGre bristles below a level that follows its Stribeck curve with a delay.

    z' = v - sigma_0 abs(v)/(F_s - w) z, w' = (1 + abs(v)/v_s) (F_s - g(v) - w)/T, F = sigma_0 z + sigma_1 z' +
    sigma_2 v.

    w is the friction that a contact lacks which has not rested for long: after sliding it is F_s - g(v), and at rest it
    decays with the time constant T, `dwell_time`. Sliding renews the contacts over the distance v_s T. With a short
    dwell time the law is LuGre.
    """

    model: Literal["dwell"]
    bristle_stiffness: Annotated[Value, Quantity("N/m", positive, "1e5 N/m")]
    bristle_damping: Annotated[Value, Quantity("N*s/m", non_negative, "316 N*s/m")]
    dwell_time: Annotated[Value, Quantity("s", positive, "0.5 s")]
    usual_times: ClassVar[tuple[float, float]] = (0.01, 10.0)
    """Dwell times [s] that metal on metal with grease shows."""
    decided_by: ClassVar[Mapping[str, str]] = dict.fromkeys(
        ("", "friction.dwell_time"), "static friction after rests of different length"
    )

    @staticmethod
    def declare(velocity: sp.Symbol, variant: StribeckCurve) -> Friction:
        """Return the equations of friction on a body moving at `velocity` [m/s]."""
        from friso.equations.component import STEADY, Output, Role, State, key, state

        forward = direction(velocity, key("friction.stribeck_velocity"))
        deflection, stiffness, lack = state("bristle_deflection"), key("friction.bristle_stiffness"), state("lack")
        static = friction_level("static", variant.conditions)
        tilt = 1 + key("friction.asymmetry") * forward.sign if variant.asymmetric else 1
        even = variant._replace(asymmetric=False)
        steady = static - stribeck_level(velocity, forward.sign, even)
        slid = static - stribeck_level_from_speed(STEADY.velocity, even)
        level, speed = tilt * (static - lack), forward.sign * velocity
        rate = velocity - stiffness * speed / level * deflection
        ages = (1 + speed / key("friction.stribeck_velocity")) / key("friction.dwell_time")
        sliding = {deflection: forward.sign * tilt * (static - steady) / stiffness, lack: steady}
        law = bristle_friction(velocity, variant, rate, (forward,), sliding)
        scale = friction_level("coulomb", variant.conditions) / 2
        ageing = State(lack, ages * (steady - lack), "N", scale, Role.BRISTLE, slid)
        outputs = {"lack": Output(lack, "N", "friction that more rest would add")}
        return law.joined((ageing,), outputs)

    shown = staticmethod(LuGre.shown)  # of measurements after a long rest
    active = staticmethod(LuGre.active)  # the level stays between Coulomb and static friction

    @staticmethod
    def keeping(measured: MeasuredFriction, elements: int) -> dict[str, Any]:
        """Return the law's keys for measured friction, with a dwell time in the middle of what may be."""
        return keeping_bristle(measured, dwell_time=float(np.sqrt(np.prod(DwellFriction.usual_times))))

    @staticmethod
    def left_open(measured: MeasuredFriction) -> dict[str, tuple[float, float]]:
        """Return the range of dwell times, of which neither friction over speed nor the virgin curve tells."""
        return {"friction.dwell_time": DwellFriction.usual_times}


from_1_to_4 = Bound("from 1 to 4", lambda value: (value >= 1) & (value <= 4))


@register_friction
class Rolling(StribeckSection):
    """Bristles that give way by a power of what they lack.

    z' = v r abs(r)^(i - 1), r = 1 - sigma_0 z sgn(v)/g(v), F = sigma_0 z + sigma_1 z' + sigma_2 v, the power rounded
    at r = 0 (`softening`).
    """

    model: Literal["rolling"]
    fitted: ClassVar[bool] = True
    bristle_stiffness: Annotated[Value, Quantity("N/m", positive, "1e5 N/m")]
    bristle_damping: Annotated[Value, Quantity("N*s/m", non_negative, "316 N*s/m")]
    rolling_exponent: Annotated[float, Number(from_1_to_4, "1.5")]
    decided_by: ClassVar[Mapping[str, str]] = {
        "": "force over displacement from rest up to break-away",
        "friction.rolling_exponent": "force over displacement from rest up to break-away",
    }

    @staticmethod
    def declare(velocity: sp.Symbol, variant: StribeckCurve) -> Friction:
        """Return the equations of friction on a body moving at `velocity` [m/s]."""
        from friso.equations.component import key, state

        forward = direction(velocity, key("friction.stribeck_velocity"))
        deflection, stiffness = state("bristle_deflection"), key("friction.bristle_stiffness")
        level = stribeck_level(velocity, forward.sign, variant)
        lacking = 1 - stiffness * forward.sign * deflection / level
        rate = velocity * lacking * softening(lacking, key("friction.rolling_exponent"))
        sliding = {deflection: forward.sign * level / stiffness}
        return bristle_friction(velocity, variant, rate, (forward,), sliding)

    @staticmethod
    def shown(flat: Mapping[str, Any]) -> MeasuredFriction:
        """Return what measurements would show of the law; Dahl's exponent shapes the virgin curve."""
        static, stiffness, i = (
            flat[f"friction.{name}"] for name in ("static", "bristle_stiffness", "rolling_exponent")
        )
        far = static / stiffness * (MISSING_AT_END ** (1 - i) - 1) / (i - 1) if i > 1 else 0.0
        displacement = virgin_displacements(static, stiffness, [far])
        return on_bristles(flat, displacement, power_law(static, stiffness, i, displacement))

    @staticmethod
    def keeping(measured: MeasuredFriction, elements: int) -> dict[str, Any]:
        """Return the law's keys for measured friction, its exponent fitted to the virgin curve."""
        return keeping_bristle(measured, rolling_exponent=best(*_exponent_candidates(measured)))

    @staticmethod
    def left_open(measured: MeasuredFriction) -> dict[str, tuple[float, float]]:
        """Return the range of exponents with almost the same virgin curve."""
        return {"friction.rolling_exponent": as_good(*_exponent_candidates(measured))}

    @staticmethod
    def active(flat: Mapping[str, Any]) -> str:
        """Return the condition of passivity if violated: sigma_2 >= sigma_1 ((F_s - F_c)/F_c)^i.

        The result is "" if the law is passive. The condition follows from z' v >= -v^2 ((F_s - F_c)/F_c)^i, with the
        power rounded.
        """
        levels, exponent = levels_under_conditions(flat), flat["friction.rolling_exponent"]
        softer = softening(levels.static / levels.coulomb - 1, exponent)
        return bristles_active(flat, softer, "" if exponent == 1 else f"^{exponent:g}")


MISSING_AT_END = 0.01
"""Force, as a fraction of static friction, that may be missing at the last point of a virgin curve."""

ROUNDED_SHARE = 1e-4
"""Missing force, as a fraction of the level, below which the bristle yields in proportion to the missing force."""


def softening(lacking: Any, exponent: Any) -> Any:
    """Return abs(r)^(i - 1), rounded at r = 0 and still 1 at rest, where r = `lacking` is 1.

    It is ((r^2 + d^2)/(1 + d^2))^((i - 1)/2) with the `exponent` i and d = ROUNDED_SHARE. A bare power is 0 at r = 0.
    Bristles of a body that rolls steadily would then not follow a small change of the level. The linearised law would
    also change abruptly as i leaves 1. Rounding changes the force by less than d F_s.
    """
    return ((lacking**2 + ROUNDED_SHARE**2) / (1 + ROUNDED_SHARE**2)) ** ((exponent - 1) / 2)


def _exponent_candidates(measured: MeasuredFriction) -> tuple[np.ndarray, np.ndarray]:
    """Return trial exponents, and the misfit of the virgin curve for each."""
    tried = np.linspace(1.0, 4.0, 301)
    curves = (power_law(measured.levels.static, measured.stiffness, i, measured.displacement) for i in tried)
    return tried, np.array([measured.misfit(curve) for curve in curves])
