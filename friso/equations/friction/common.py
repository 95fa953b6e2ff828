"""What friction laws share: keys, the steady friction level of Eq. 4, and friction as measurements show it.

Measurements show steady friction over speed, the force over displacement from rest until sliding (the virgin curve),
and damping at rest. Each law's file computes these, and says which of its parameters they leave open.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, NamedTuple, cast

import numpy as np
from pydantic import Field

from friso.equations.conditions import LEVELS, friction_level, has_conditions, level_under_conditions
from friso.quantities import Number, Quantity, Value, inside_minus_1_1, non_negative, positive
from friso.stage import FrictionSection, Rule
from friso.stage.tables import STATE_PREFIX, friction_law

if TYPE_CHECKING:
    import sympy as sp

    from friso.equations.component import Component, Kink, Output, State


CURVE_LENGTH, CURVE_POINTS, LONGER_CURVE_POINTS = 60.0, 2000, 200
"""Length of virgin curves, and numbers of their points. The length is in units of the deflection that static friction
causes at the first stiffness. Points are denser near rest. The last number is for points on a longer curve."""

LEAST_POINT_DISTANCE = 1e-6
"""Distance between points, relative to the last, below which no slope is computed."""


@dataclass(frozen=True)
class Levels:
    """Parameters of steady friction over velocity in SI, a Stribeck curve (`StribeckSection`)."""

    static: float
    coulomb: float
    stribeck_velocity: float
    stribeck_exponent: float
    viscous: float
    asymmetry: float = 0.0
    viscous_asymmetry: float = 0.0

    @property
    def keys(self) -> dict[str, float]:
        """Return the parameters by key of the stage file, such as friction.static, in SI.

        Asymmetries are included only where they are not 0.
        """
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return {f"friction.{name}": value for name, value in values.items() if value or "asymmetry" not in name}


@dataclass(frozen=True)
class MeasuredFriction:
    """Friction as measurements show it.

    `levels` is steady friction over speed; `stiffness` [N/m] and `damping` [N s/m] are of small motions at rest;
    `force` [N] over `displacement` [m], both of shape (n,), is the virgin curve, from rest without load. A stiffness
    of 0 means that the law does not stick.
    """

    levels: Levels
    stiffness: float
    damping: float
    displacement: np.ndarray
    force: np.ndarray

    @property
    def slope(self) -> np.ndarray:
        """Return the slope of the virgin curve [N/m], shape (n,)."""
        slopes = np.gradient(self.force, self.displacement)
        slopes[0] = self.stiffness
        return np.minimum.accumulate(np.clip(slopes, 0.0, self.stiffness))

    def misfit(self, force: np.ndarray) -> float:
        """Return the largest deviation from another virgin curve, `force` [N], over static friction.

        Both curves have the same displacements; the result has no unit.
        """
        return float(np.max(np.abs(force - self.force)) / self.levels.static)


def virgin_displacements(static: float, stiffness: float, corners: Sequence[float] | np.ndarray = ()) -> np.ndarray:
    """Return displacements [m] at which to compare virgin curves, shape (n,).

    They reach beyond break-away, which follows from `static` friction [N] and `stiffness` [N/m], or to the last of
    `corners` if that lies farther. They include all `corners`, the displacements at which a curve made of straight
    pieces bends.
    """
    usual, corners = static / stiffness * CURVE_LENGTH, np.unique(np.append(0.0, corners))
    places = usual * np.linspace(0.0, 1.0, CURVE_POINTS) ** 2
    if corners[-1] > usual:
        places = np.append(places, np.geomspace(usual, corners[-1], LONGER_CURVE_POINTS)[1:])
    after = np.searchsorted(corners, places)
    beside = [corners[np.clip(after - before, 0, len(corners) - 1)] for before in (0, 1)]
    return np.union1d(places[np.abs(places - beside).min(axis=0) > LEAST_POINT_DISTANCE * places[-1]], corners)


def levels_of(flat: Mapping[str, Any]) -> Levels:
    """Return the Stribeck curve of a law, from its keys in SI, without factors of [conditions]."""
    values = {field.name: flat.get(f"friction.{field.name}", field.default) for field in fields(Levels)}
    return Levels(**{name: float(value) for name, value in values.items()})


def levels_under_conditions(flat: Mapping[str, Any]) -> Levels:
    """Return the Stribeck curve of a law, from its keys in SI, with the factors of [conditions]."""
    return replace(levels_of(flat), **{name: float(level_under_conditions(flat, name)) for name in LEVELS})


def on_bristles(flat: Mapping[str, Any], displacement: np.ndarray, force: np.ndarray) -> MeasuredFriction:
    """Return what measurements would show of a law with a Stribeck curve and bristles.

    Stiffness and damping are as in LuGre, and the virgin curve is `force` [N] over `displacement` [m].
    """
    stiffness, damping = (float(flat[f"friction.bristle_{name}"]) for name in ("stiffness", "damping"))
    return MeasuredFriction(levels_of(flat), stiffness, damping, displacement, force)


def power_law(static: float, stiffness: float, exponent: float, displacement: np.ndarray) -> np.ndarray:
    """Return a virgin curve whose slope falls with a power of the force that is still missing.

    The curve begins with `stiffness` [N/m], and rises to `static` friction [N]. The power is Dahl's exponent. The
    result is the force [N] over displacement [m] from rest, both of shape (n,). With an exponent below 1 the curve ends
    at static friction; with 0 it is straight.
    """
    way, more = stiffness * displacement / static, exponent - 1
    lacking = np.exp(-way) if more == 0 else np.maximum(1 + more * way, 0.0) ** (-1 / more)
    return static * (1 - lacking)


def best(candidates: np.ndarray, misfits: np.ndarray) -> float:
    """Return the candidate whose misfit is the smallest."""
    return float(candidates[int(np.argmin(misfits))])


MISFIT_SLACK = 0.02
"""Misfit, as a fraction of static friction, by which a virgin curve may exceed the best one and still pass."""


def as_good(candidates: np.ndarray, misfits: np.ndarray) -> tuple[float, float]:
    """Return the lowest and highest candidate that a measurement cannot tell from the best.

    Candidates between these limits have misfits almost as small as the best one.
    """
    good = candidates[misfits <= np.min(misfits) + MISFIT_SLACK]
    return float(good.min()), float(good.max())


COULOMB_BELOW_STATIC = Rule(
    ("friction.coulomb", "friction.static"),
    lambda flat: flat["friction.coulomb"] <= flat["friction.static"],
    expected='Coulomb friction no larger than static friction; static = "unknown" follows it',
    example='static = "3 N", coulomb = "1 N"',
)

STEADY_LOAD = Rule(
    ("conditions.load_per_acceleration",),
    lambda flat: flat.get("conditions.load_per_acceleration", 0.0) == 0,
    expected="a load that does not follow the acceleration: this law slips at limits that would jump with it",
    example='load_per_acceleration = "0 s^2/m", or model = "lugre"',
)


LEVEL_WORDS = {"static": "Static friction", "coulomb": "Coulomb friction", "viscous": "Viscous friction"}
"""Names of the friction keys on the axes of maps."""


class Friction:
    """A friction law's equations: the force [N] against the velocity, its states and its scales.

    `component` has states, outputs, and kinks (where derivatives jump). `breakaway` [N] is the largest force at rest,
    from which the solver takes its length scale. `sliding` maps symbols to their values in a steady motion at the
    velocity: the law's own states, its modes with memory, and the sides of its kinks other than the direction. Without
    `sliding`, these are the values at which the states do not change. At rest all modes with memory have been left. Of
    a law that follows the drive's force, `transmitted_force()` stands for that, and `alone` [N] for what it is where
    nothing but friction resists the drive.
    """

    def __init__(
        self,
        force: sp.Expr,
        breakaway: sp.Expr,
        component: Component,
        sliding: Mapping[sp.Symbol, sp.Expr] | None = None,
        alone: sp.Expr | None = None,
    ) -> None:
        self.force, self.breakaway, self.component, self.sliding = force, breakaway, component, sliding
        self.alone = alone

    def driven_by(self, force: sp.Expr | None) -> Friction:
        """Return the law under a force [N] of the drive; None stands for what moves the body steadily."""
        if self.alone is None:
            return self
        return self.with_values({transmitted_force(): self.alone if force is None else force})

    def with_values(self, values: Mapping[Any, Any]) -> Friction:
        """Return the law with expressions replaced by others, except in scales and steady motion."""
        part, force = self.component, cast(Any, self.force.xreplace(values))
        states = tuple(replace(x, derivative=x.derivative.xreplace(values)) for x in part.states)
        outputs = {name: replace(x, expression=x.expression.xreplace(values)) for name, x in part.outputs.items()}
        component = replace(
            part, states=states, kinks=tuple(k.with_values(values) for k in part.kinks), outputs=outputs
        )
        return Friction(force, self.breakaway, component, self.sliding, self.alone)

    def joined(self, states: tuple[State, ...], outputs: Mapping[str, Output]) -> Friction:
        """Return the law with further states and outputs."""
        part = self.component
        joined = replace(part, states=(*part.states, *states), outputs={**part.outputs, **outputs})
        return Friction(self.force, self.breakaway, joined, self.sliding, self.alone)

    def slid(self) -> dict[sp.Symbol, sp.Expr]:
        """Return the law's states, and the sides of its kinks, in steady motion at the velocity.

        Kinks are where derivatives jump; the reversal of the velocity is left out. Raises ValueError if the law does
        not say how it slides steadily, and its equations are not linear in its states.
        """
        import sympy as sp

        from friso.equations.component import Switch

        states = [state.symbol for state in self.component.states]
        if self.sliding is not None:
            slid = {x: sp.sympify(self.sliding.get(x, 0)) for x in states}
        else:
            unchanged = solve_linear([state.derivative for state in self.component.states], states) if states else []
            slid = dict(zip(states, unchanged, strict=True))
        sides = self.sides(slid)
        modes = {kink.beyond: sp.S.Zero for kink in self.component.kinks if isinstance(kink, Switch)}
        stated = {x: sp.sympify(side) for x, side in (self.sliding or {}).items() if x in sides or x in modes}
        return slid | modes | sides | stated

    def steady(self, velocity: sp.Symbol) -> sp.Expr | None:
        """Return the steady force [N] at the velocity; None if the law does not determine it."""
        from friso.equations.component import Piecewise

        try:
            slid: dict[Any, Any] = {**self.slid()}
        except ValueError:
            return None
        ahead = Piecewise((1, velocity > 0), (0, True))
        kinks = (direction(velocity), *self.component.kinks)
        side: dict[Any, Any] = {kink.beyond: ahead for kink in kinks if _is_direction(kink)}
        return self.force.subs(slid).subs(side)

    def sides(self, states: Mapping[sp.Symbol, sp.Expr]) -> dict[Any, Any]:
        """Return on which side of its kinks the law is, as conditions on its `states`.

        Kinks are where derivatives jump; the direction of the motion and modes with memory are left out.
        """
        from friso.equations.component import Piecewise, Switch

        kinks = [k for k in self.component.kinks if not isinstance(k, Switch) and not _is_direction(k)]
        return {kink.beyond: Piecewise((1, kink.surface.subs({**states}) >= 0), (0, True)) for kink in kinks}


def transmitted_force() -> sp.Symbol:
    """Return the symbol of the drive's force [N], which a law of friction may follow."""
    from friso.equations.component import state

    return state("transmitted_force")


def friction_alone(name: str, velocity: sp.Symbol, variant: Any) -> Any:
    """Return the equations of a law by its name, where nothing but friction resists the drive; None for no force."""
    friction = friction_law(name).declare(velocity, variant)
    return friction and friction.driven_by(None)


def solve_linear(equations: Sequence[sp.Expr], unknowns: Sequence[sp.Symbol]) -> list[sp.Expr]:
    """Solve linear equations for the unknowns. Raises ValueError if they are not linear."""
    import sympy as sp

    matrix, right = sp.linear_eq_to_matrix(list(equations), list(unknowns))
    return list(matrix.LUsolve(right))


def direction(velocity: sp.Symbol, narrow: sp.Expr | None = None) -> Kink:
    """Return the kink of a friction law at which the velocity [m/s] changes its direction.

    At a kink derivatives jump. `beyond` is 1 for a positive velocity. Friction may have a peak of width `narrow` [m/s]
    around the kink.
    """
    from friso.equations.component import Kink

    return Kink(DIRECTION, velocity) if narrow is None else Kink(DIRECTION, velocity, narrow=narrow)


DIRECTION = "forward"
"""Name of the kink (where derivatives jump) at which the velocity changes its direction."""


def _is_direction(kink: Kink) -> bool:
    """Tell whether a kink is the reversal of the velocity, at the guide or at the motor."""
    return kink.name.removeprefix(STATE_PREFIX) == DIRECTION


class StribeckCurve(NamedTuple):
    """Choices that decide the equations of a Stribeck curve.

    `exponent` is given if it is a small whole number, and its powers are then written as products; otherwise it is
    None. The other fields are true if levels, or viscous friction, differ between directions, and if [conditions]
    multiply the levels.
    """

    exponent: int | None
    asymmetric: bool
    viscous_asymmetric: bool
    conditions: bool = False


class StribeckSection(FrictionSection):
    """The keys of the laws with a Stribeck curve.

    Static and Coulomb friction are larger by the share `asymmetry` when moving forward, and smaller by it when moving
    back, viscous friction by the share `viscous_asymmetry`.
    """

    static: Annotated[Value, Quantity("N", positive, "3 N")]
    coulomb: Annotated[Value, Quantity("N", positive, "1 N")]
    stribeck_velocity: Annotated[Value, Quantity("m/s", positive, "1.6 mm/s")]
    stribeck_exponent: Annotated[float, Number(positive, "2")]
    viscous: Annotated[Value, Quantity("N*s/m", non_negative, "0.5 N*s/m")]
    asymmetry: Annotated[float | None, Number(inside_minus_1_1, "0.1")] = None
    viscous_asymmetry: Annotated[float | None, Number(inside_minus_1_1, "0.1")] = None
    guess: str | None = Field(None, examples=["ball screw"])
    """Contact whose usual friction stands for keys that nobody measured (see `friso.stage.contacts`)."""
    under_conditions: ClassVar[bool] = True
    rules: ClassVar[tuple[Rule, ...]] = (COULOMB_BELOW_STATIC,)
    words: ClassVar[Mapping[str, str]] = LEVEL_WORDS
    decisive: ClassVar[tuple[str, ...]] = (
        "friction.stribeck_exponent",
        "friction.asymmetry",
        "friction.viscous_asymmetry",
    )

    @staticmethod
    def variant(flat: Mapping[str, Any]) -> Any:
        """Return the choices that decide the equations of a Stribeck curve, from the law's keys.

        They are the exponent (None unless it is a small whole number), whether directions differ, and whether there are
        [conditions].
        """
        exponent = float(flat["friction.stribeck_exponent"])
        return StribeckCurve(
            int(exponent) if exponent in (1.0, 2.0, 3.0, 4.0) else None,
            flat.get("friction.asymmetry", 0.0) != 0,
            flat.get("friction.viscous_asymmetry", 0.0) != 0,
            has_conditions(flat),
        )


def stribeck_level(velocity: sp.Expr, sign: sp.Expr, curve: StribeckCurve) -> sp.Expr:
    """Return the level of friction g(v) of Eq. 4 [N]: F_c + (F_s - F_c) exp(-abs(v/v_s)^j).

    It is smooth in v while `sign`, the direction of the velocity, is held. `curve` has the choices that decide the
    terms.
    """
    from sympy import exp

    from friso.equations.component import key

    static, coulomb = (friction_level(name, curve.conditions) for name in LEVELS)
    exponent = curve.exponent
    ratio = velocity / key("friction.stribeck_velocity")
    if exponent is None:
        power = (ratio**2 + TINY_SQUARE) ** (key("friction.stribeck_exponent") / 2)
    else:
        power = ratio**exponent if exponent % 2 == 0 else (sign * ratio) ** exponent
    force = coulomb + (static - coulomb) * exp(-power)
    return force * (1 + key("friction.asymmetry") * sign) if curve.asymmetric else force


def stribeck_level_from_speed(velocity: sp.Expr, curve: StribeckCurve) -> sp.Expr:
    """Return the level of friction g(v) [N] from the velocity alone; `curve` has its choices.

    It is not differentiable at rest.
    """
    from sympy import Integer, sqrt

    from friso.equations.component import key

    speed = sqrt(velocity**2 + TINY_SQUARE)
    force = stribeck_level(speed, Integer(1), curve._replace(asymmetric=False))
    return force * (1 + key("friction.asymmetry") * velocity / speed) if curve.asymmetric else force


TINY_SQUARE = 1e-60
"""Small number that keeps roots and powers of squares differentiable at 0."""


def viscous_force(velocity: sp.Expr, sign: sp.Expr, curve: StribeckCurve) -> sp.Expr:
    """Return the viscous force [N]; `curve` has the choices that decide its terms.

    The force is smooth in v while `sign`, the direction of v, is held.
    """
    from friso.equations.component import key

    force = key("friction.viscous") * velocity
    return force * (1 + key("friction.viscous_asymmetry") * sign) if curve.viscous_asymmetric else force
