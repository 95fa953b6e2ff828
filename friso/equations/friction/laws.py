"""Friction laws of their own form: none, Stribeck, Dahl, generalized Maxwell slip.

Stribeck: static, with a viscous term, regularised. Armstrong-Helouvry, Dupont, Canudas de Wit 1994,
doi:10.1016/0005-1098(94)90209-7.

Dahl: LuGre without Stribeck effect and bristle damping. Dahl 1968 (Aerospace Corp. TOR-0158(3107-18)-1).

Generalised Maxwell slip: Al-Bender et al. 2005, doi:10.1109/TAC.2005.858676. The source's conditions are read as
follows. An element sticks until its force *along the motion* reaches its share of the level, sgn(v) F_i = alpha_i s(v),
and then slips until the velocity passes zero. After a reversal, an element that is still bent against the motion goes
on sticking, however far s(v) falls below its force. Codes that compare abs(F_i) with the level let such an element jump
to the other side.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np

from friso.equations.conditions import friction_level, has_conditions
from friso.equations.friction.common import (
    COULOMB_BELOW_STATIC,
    LEVEL_WORDS,
    STEADY_LOAD,
    TINY_SQUARE,
    Friction,
    Levels,
    MeasuredFriction,
    StribeckCurve,
    StribeckSection,
    direction,
    levels_of,
    levels_under_conditions,
    stribeck_level,
    stribeck_level_from_speed,
    virgin_displacements,
    viscous_force,
)
from friso.quantities import Number, Quantity, Value, non_negative, positive
from friso.stage import FrictionSection, Rule, Several, Values, element_keys, register_friction

if TYPE_CHECKING:
    import sympy as sp


@register_friction
class NoFriction(FrictionSection):
    """A bearing without friction, such as an air bearing."""

    model: Literal["none"]


@register_friction
class Stribeck(StribeckSection):
    """A curve of force against velocity: F = g(v) tanh(v/v_r) + sigma_2 v.

    At rest it creeps instead of sticking.
    """

    model: Literal["stribeck"]
    fitted: ClassVar[bool] = True
    regularisation_velocity: Annotated[Value, Quantity("m/s", positive, "10 um/s")]

    @staticmethod
    def declare(velocity: sp.Symbol, variant: StribeckCurve) -> Friction:
        """Return the equations of friction on a body moving at `velocity` [m/s]."""
        from sympy import tanh

        from friso.equations.component import Component, key

        forward = direction(velocity, key("friction.stribeck_velocity"))
        level = stribeck_level(velocity, forward.sign, variant)
        force = level * tanh(velocity / key("friction.regularisation_velocity"))
        even = variant.exponent is None or variant.exponent % 2 == 0
        smooth = even and not (variant.asymmetric or variant.viscous_asymmetric)  # smooth at rest
        static = friction_level("static", variant.conditions)
        component = Component(kinks=() if smooth else (forward,))
        return Friction(force + viscous_force(velocity, forward.sign, variant), static, component)

    @staticmethod
    def shown(flat: Mapping[str, Any]) -> MeasuredFriction:
        """Return what measurements would show: friction over speed, and none before sliding."""
        return MeasuredFriction(levels_of(flat), 0.0, 0.0, np.zeros(1), np.zeros(1))

    @staticmethod
    def keeping(measured: MeasuredFriction, elements: int) -> dict[str, Any]:
        """Return the law's keys for measured friction over speed.

        The curve is kept down to a hundredth of the Stribeck velocity.
        """
        return {
            **measured.levels.keys,
            "friction.regularisation_velocity": RISE_SHARE * measured.levels.stribeck_velocity,
        }


RISE_SHARE = 0.01
"""Velocity over which the curve rises from 0, as a fraction of the Stribeck velocity."""


@register_friction
class Dahl(FrictionSection):
    """A spring that slips: z' = v - sigma_0 abs(v)/F_c z, F = sigma_0 z + sigma_2 v."""

    model: Literal["dahl"]
    fitted: ClassVar[bool] = True
    words: ClassVar[Mapping[str, str]] = LEVEL_WORDS
    coulomb: Annotated[Value, Quantity("N", positive, "1 N")]
    bristle_stiffness: Annotated[Value, Quantity("N/m", positive, "1e5 N/m")]
    viscous: Annotated[Value, Quantity("N*s/m", non_negative, "0.5 N*s/m")]

    under_conditions: ClassVar[bool] = True

    @staticmethod
    def variant(flat: Mapping[str, Any]) -> Any:
        """Tell whether [conditions] multiply the law's level of sliding friction."""
        return has_conditions(flat)

    @staticmethod
    def declare(velocity: sp.Symbol, variant: bool) -> Friction:
        """Return the equations of friction on a body moving at `velocity` [m/s]."""
        from friso.equations.component import Component, Output, Role, State, key, state

        forward = direction(velocity)
        deflection, stiffness = state("bristle_deflection"), key("friction.bristle_stiffness")
        coulomb = friction_level("coulomb", variant)
        rate = velocity - stiffness * forward.sign * velocity / coulomb * deflection
        bristles = State(deflection, rate, "m", coulomb / stiffness, Role.BRISTLE)
        outputs = {"bristle_deflection": Output(deflection, "m", "bristle deflection z")}
        force = stiffness * deflection + key("friction.viscous") * velocity
        return Friction(force, coulomb, Component((bristles,), (forward,), outputs))

    @staticmethod
    def shown(flat: Mapping[str, Any]) -> MeasuredFriction:
        """Return what measurements would show of Dahl's law: one level of friction at all speeds.

        Friction does not fall with speed, and at rest there is no damping but the viscous one.
        """
        coulomb, stiffness = flat["friction.coulomb"], flat["friction.bristle_stiffness"]
        levels = Levels(coulomb, coulomb, NO_SPEED, 2.0, flat["friction.viscous"])
        displacement = virgin_displacements(coulomb, stiffness)
        return MeasuredFriction(
            levels, stiffness, 0.0, displacement, -coulomb * np.expm1(-displacement * stiffness / coulomb)
        )

    @staticmethod
    def keeping(measured: MeasuredFriction, elements: int) -> dict[str, Any]:
        """Return keys with the measured stiffness and sliding friction; the break-away peak is lost.

        `elements` has no effect on a law with one spring.
        """
        return {
            "friction.coulomb": measured.levels.coulomb,
            "friction.viscous": measured.levels.viscous,
            "friction.bristle_stiffness": measured.stiffness,
        }


NO_SPEED = 1e-3
"""Stribeck velocity [m/s] for a law whose friction does not depend on speed. Its value does not matter."""


STIFFNESS, SHARE, DAMPING = (f"friction.element_{name}" for name in ("stiffness", "share", "damping"))

SLIPS_AT = 1 - 1e-9
"""Fraction of its limit from which a pulled element counts as slipping at the start of a run."""

MOST_ELEMENTS = 12
"""Largest number of elements."""


class Elements(NamedTuple):
    """Choices that decide the equations: Stribeck curve, number of elements, and their damping."""

    curve: StribeckCurve
    number: int
    damped: bool


def _as_many(key: str, what: str, two: str) -> Rule:
    """Return the rule that the list `key` has one value for each element stiffness, or is empty.

    In the error message, `what` names a value of the list, and `two` is an example for two elements.
    """
    example = f'element_stiffness = ["70 N/mm", "30 N/mm"], {key.removeprefix("friction.")} = {two}'
    return Rule(
        (STIFFNESS, key),
        lambda flat: len(element_keys(flat, key)) in (len(element_keys(flat, STIFFNESS)), 0),
        f"one {what} for each stiffness",
        example,
    )


@register_friction
class GeneralisedMaxwellSlip(StribeckSection):
    """Elements side by side, springs that stick or slip.

    F_i' = k_i v, or F_i' = C (alpha_i sgn(v) - F_i/s(v)); F = sum of F_i + sigma_i z_i' + sigma_2 v, z_i = F_i/k_i
    being the deflection of an element.
    """

    model: Literal["gms"]
    element_stiffness: Annotated[
        Values, Several(Quantity("N/m", positive, "70 N/mm"), ("70 N/mm", "30 N/mm"), 1, MOST_ELEMENTS)
    ]
    element_share: Annotated[Values, Several(Number(positive, "0.5"), ("0.4", "0.6"), 1, MOST_ELEMENTS)]
    element_damping: Annotated[
        Values | None,
        Several(Quantity("N*s/m", non_negative, "100 N*s/m"), ("220 N*s/m", "95 N*s/m"), 1, MOST_ELEMENTS),
    ] = None
    """Damping of the rate of each element's deflection (micro-damping); without it there is none."""
    attraction: Annotated[Value, Quantity("N/s", positive, "1000 N/s")]
    """Attraction parameter C: the force of a slipping element follows its level with the time constant s(v)/C."""
    decided_by: ClassVar[Mapping[str, str]] = {
        "": "loops within loops of force over displacement before sliding: whether the inner ones close",
        "friction.attraction": "friction while the speed swings about the Stribeck velocity: how far it lags",
    }

    rules: ClassVar[tuple[Rule, ...]] = (
        COULOMB_BELOW_STATIC,
        _as_many(SHARE, "share", "[0.4, 0.6]"),
        _as_many(DAMPING, "damping", '["220 N*s/m", "95 N*s/m"]'),
        Rule(
            (SHARE,),
            lambda flat: abs(sum(flat[name] for name in element_keys(flat, SHARE)) - 1) < 1e-9,
            "shares that add up to 1, to nine digits",
            "element_share = [0.4, 0.6]",
        ),
        STEADY_LOAD,
    )

    @staticmethod
    def variant(flat: Mapping[str, Any]) -> Any:
        """Return the choices that decide the equations: curve, number of elements, damping."""
        return Elements(
            StribeckSection.variant(flat), len(element_keys(flat, STIFFNESS)), bool(element_keys(flat, DAMPING))
        )

    @staticmethod
    def declare(velocity: sp.Symbol, variant: Elements) -> Friction:
        """Return the equations of friction on a body moving at `velocity` [m/s]."""
        from sympy import And, Integer, sqrt

        from friso.equations.component import Component, Output, Piecewise, Role, State, Switch, key, state

        curve = variant.curve
        forward = direction(velocity, key("friction.stribeck_velocity"))
        level, level_at_start = (
            stribeck_level(velocity, forward.sign, curve),
            stribeck_level_from_speed(velocity, curve),
        )
        static, attraction = friction_level("static", curve.conditions), key("friction.attraction")
        force = viscous_force(velocity, forward.sign, curve)
        states, switches, outputs, sliding = [], [], {}, {}
        for number in range(1, variant.number + 1):
            z, stiffness, share = state(f"deflection_{number}"), key(f"{STIFFNESS}.{number}"), key(f"{SHARE}.{number}")
            scale = share * static / stiffness
            limit = share * level / stiffness
            pulled_on = And(z * velocity > 0, z**2 >= (SLIPS_AT * share * level_at_start / stiffness) ** 2)
            slip = Switch(
                f"slip_{number}",
                enter=forward.sign * z - limit,
                leave=-z * velocity / scale,
                begins=Piecewise((1, pulled_on), (-1, True)),
                # the limit on either side, except for the squared rounding error
                entered={z: (z + limit**2 / z) / 2},
            )
            side = z / sqrt(z**2 + TINY_SQUARE)  # a slipping element is bent along the motion
            slipping = attraction / stiffness * (share * side - stiffness * z / level)
            rate = velocity * (1 - slip.beyond) + slipping * slip.beyond
            states.append(State(z, rate, "m", scale, Role.BRISTLE))
            switches.append(slip)
            outputs[f"deflection_{number}"] = Output(z, "m", f"deflection of element {number}")
            outputs[f"slip_{number}"] = Output(slip.beyond, "1", f"element {number} slips")
            sliding |= {z: forward.sign * limit, slip.beyond: Integer(1)}
            force += stiffness * z + (key(f"{DAMPING}.{number}") * rate if variant.damped else 0)
        return Friction(force, static, Component(tuple(states), (forward, *switches), outputs), sliding)

    @staticmethod
    def shown(flat: Mapping[str, Any]) -> MeasuredFriction:
        """Return what measurements would show of the law.

        From rest, each element is stretched until it carries its fraction of static friction.
        """
        levels, stiffness, strength = levels_of(flat), _elements(flat, STIFFNESS), _elements(flat, SHARE)
        strength = strength * levels.static
        displacement = virgin_displacements(levels.static, float(stiffness.sum()), strength / stiffness)
        force = np.minimum(stiffness * displacement[:, None], strength).sum(axis=1)
        damping = sum(flat[name] for name in element_keys(flat, DAMPING))
        return MeasuredFriction(levels, float(stiffness.sum()), float(damping), displacement, force)

    @staticmethod
    def keeping(measured: MeasuredFriction, elements: int) -> dict[str, Any]:
        """Return the keys of elements that approximate the measured virgin curve by its tangents.

        First stiffness and break-away are kept exactly. The attraction lets friction lag as in LuGre at the Stribeck
        velocity, s/C = g/(sigma_0 v_s).
        """
        return _elements_with(measured, *polygon(measured, elements)) | {
            "friction.attraction": measured.stiffness * measured.levels.stribeck_velocity
        }

    @staticmethod
    def left_open(measured: MeasuredFriction) -> dict[str, tuple[float, float]]:
        """Return the range of the attraction [N/s], which measurements leave open, by its key.

        The range is a factor of ten each way, because no virgin curve determines the attraction.
        """
        usual = measured.stiffness * measured.levels.stribeck_velocity
        return {"friction.attraction": (usual / 10, usual * 10)}

    @staticmethod
    def active(flat: Mapping[str, Any]) -> str:
        """Return the condition of passivity that the law violates; "" if it is passive.

        Static friction must equal Coulomb friction. Otherwise slip that slows down loads the elements without a
        displacement, and they return that energy when they are unloaded.
        """
        levels, stiffness, share = levels_under_conditions(flat), _elements(flat, STIFFNESS), _elements(flat, SHARE)
        gained = float((share**2 * (levels.static**2 - levels.coulomb**2) / (2 * stiffness)).sum())
        return (
            f"static = coulomb; with more static friction a reversal gives back up to {gained:.3g} J" if gained else ""
        )


def _elements_with(measured: MeasuredFriction, stiffness: np.ndarray, slips: np.ndarray) -> dict[str, Any]:
    """Return the keys of elements by stiffness [N/m] and slip deflection [m], both (elements,)."""
    strength = stiffness * slips
    damped = {f"{DAMPING}.{n}": measured.damping * k / measured.stiffness for n, k in enumerate(stiffness, 1)}
    return {
        **measured.levels.keys,
        **{f"{STIFFNESS}.{n}": float(k) for n, k in enumerate(stiffness, 1)},
        **{f"{SHARE}.{n}": float(f) for n, f in enumerate(strength / strength.sum(), 1)},
        **(damped if measured.damping else {}),
    }


def _elements(flat: Mapping[str, Any], key: str) -> np.ndarray:
    """Return the values of a list key, shape (elements,)."""
    return np.array([flat[name] for name in element_keys(flat, key)])


STRAIGHT_CURVE = 1e-6
"""Difference of slopes, relative to the first, below which a virgin curve counts as straight."""

TRIED_EXPONENTS = np.linspace(0.6, 4.0, 69)
"""Exponents to try for spacing the tangents along the virgin curve."""


def polygon(measured: MeasuredFriction, elements: int) -> tuple[np.ndarray, np.ndarray]:
    """Return stiffness [N/m] and slip deflection [m] of elements that follow the virgin curve.

    Both have the shape (at most `elements`,). A curve of few straight pieces is reproduced exactly. Otherwise the
    elements form the polygon of tangents with the least error.
    """
    slopes = np.append(np.diff(measured.force) / np.diff(measured.displacement), 0.0)
    corners = np.flatnonzero(-np.diff(slopes) > STRAIGHT_CURVE * measured.stiffness)
    if len(corners) <= elements:
        return -np.diff(slopes[[0, *corners + 1]]), measured.displacement[corners + 1]
    tried = [_tangents(measured, (1 - np.arange(elements + 1) / elements) ** power) for power in TRIED_EXPONENTS]
    curves = [np.minimum(k * measured.displacement[:, None], k * x).sum(axis=1) for k, x in tried]
    return tried[int(np.argmin([measured.misfit(curve) for curve in curves]))]


def _tangents(measured: MeasuredFriction, levels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return elements, stiffness [N/m] and slip deflection [m], that make a polygon of tangents.

    The tangents touch the virgin curve where its slope has the values `levels`, relative to the first stiffness, from 1
    down to 0.
    """
    slope = measured.stiffness * levels
    touched = np.interp(-slope, -measured.slope, measured.displacement)
    force = np.interp(touched, measured.displacement, measured.force)
    force[0], force[-1], touched[0], touched[-1] = 0.0, measured.levels.static, 0.0, 0.0
    stiffness = -np.diff(slope)
    return stiffness, np.diff(force - slope * touched) / stiffness
