"""Define the dimensionless groups that govern hunting (Buckingham's theorem).

Parameters are read off the equations of a structure, and their dimensions off the units of the stage file's keys. n
parameters whose dimensions have the rank r make n - r groups. `tests/thesis/test_guideline.py` checks that the groups
listed here have that number, and are dimensionless and independent.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from friso.equations.controllers.pid import ALPHA, BETA, CROSSOVER, TUNED_MASS, tuned
from friso.equations.model import assemble
from friso.equations.structure import structure
from friso.errors import InputError
from friso.quantities import Quantity
from friso.stage import numeric_keys

LIMITER_OVER_BRISTLES = 200.0
"""Ratio of limiter to bristle stiffness of the thesis rig (2e7 to 1e5 N/m, Table 2). It is so large that its value
hardly matters."""


STRIBECK_EXPONENT = 2.0
"""Stribeck exponent of all sweeps, from the thesis (Table 2). The exponent is a group by itself."""

RIGID_SHARE = 0.3
"""Fraction of a rigid mass that is declared as the stage. It has no effect, because the equations contain the sum
only."""


@dataclass(frozen=True)
class Parameter:
    """A physical parameter: its symbol, its stage-file keys of one unit, and their formula."""

    written: str
    keys: tuple[str, ...]
    value: Callable[..., Any] = lambda value: value


PARAMETERS: Mapping[str, Parameter] = {
    "mass": Parameter("m", ("masses.cart", "masses.stage"), lambda cart, stage: cart + stage),
    "stage_mass": Parameter("M_stage", ("masses.stage",)),
    "static": Parameter("F_s", ("friction.static",)),
    "drop": Parameter("(F_s - F_c)", ("friction.static", "friction.coulomb"), lambda static, coulomb: static - coulomb),
    "stribeck_velocity": Parameter("v_s", ("friction.stribeck_velocity",)),
    "sigma_0": Parameter("sigma_0", ("friction.bristle_stiffness",)),
    "sigma_1": Parameter("sigma_1", ("friction.bristle_damping",)),
    "sigma_2": Parameter("sigma_2", ("friction.viscous",)),
    "omega_c": Parameter("omega_c", (CROSSOVER,), lambda crossover: 2 * np.pi * crossover),
    "alpha": Parameter("alpha", (ALPHA,)),
    "beta": Parameter("beta", (BETA,)),
    "tuned_mass": Parameter("m_t", (TUNED_MASS,)),
    "k_j": Parameter("k_j", ("joint.stiffness",)),
    "d_j": Parameter("d_j", ("joint.damping",)),
    "stroke": Parameter("S_j", ("joint.stroke",)),
    "k_l": Parameter("k_l", ("joint.limiter_stiffness",)),
    "d_l": Parameter("d_l", ("joint.limiter_damping",)),
    "omega_p": Parameter("omega_p", ("parasitic.frequency",), lambda frequency: 2 * np.pi * frequency),
    "parasitic_mass": Parameter("m_p", ("parasitic.mass",)),
    "zeta_p": Parameter("zeta_p", ("parasitic.damping_ratio",)),
}


@dataclass(frozen=True)
class Group:
    """A dimensionless group: `factor` times the parameters to their `powers`.

    Stored as well are the group's meaning in words, and the part of the stage to which it belongs ("stage", "joint" or
    "parasitic").
    """

    written: str
    meaning: str
    powers: Mapping[str, float]
    factor: float = 1.0
    part: str = "stage"

    def of(self, flat: Mapping[str, Any]) -> Any:
        """Return the value of this dimensionless group for stages.

        Stages are given by keys [SI] with numbers or arrays.
        """
        value = self.factor
        for name, power in self.powers.items():
            parameter = PARAMETERS[name]
            value = value * parameter.value(*(flat[key] for key in parameter.keys)) ** power
        return value


GROUPS: Mapping[str, Group] = {
    "crossover": Group(
        "omega_c/sqrt(sigma_0/m)",
        "crossover over the frequency of the mass on its bristles",
        {"omega_c": 1, "sigma_0": -0.5, "mass": 0.5},
    ),
    "gap": Group("(F_s - F_c)/F_s", "friction gap", {"drop": 1, "static": -1}),
    "stribeck": Group(
        "v_s sqrt(sigma_0 m)/(F_s - F_c)",
        "Stribeck velocity over the speed that the gap gives the mass on its bristles",
        {"stribeck_velocity": 1, "sigma_0": 0.5, "mass": 0.5, "drop": -1},
    ),
    "bristle_damping": Group(
        "sigma_1/(2 sqrt(sigma_0 m))",
        "damping ratio of the mass on its bristles",
        {"sigma_1": 1, "sigma_0": -0.5, "mass": -0.5},
        0.5,
    ),
    "viscous": Group(
        "sigma_2/(2 sqrt(sigma_0 m))",
        "viscous friction, in the same measure",
        {"sigma_2": 1, "sigma_0": -0.5, "mass": -0.5},
        0.5,
    ),
    "alpha": Group("alpha", "lead of the controller", {"alpha": 1}),
    "beta": Group("beta", "slowness of its integrator", {"beta": 1}),
    "tuned_mass": Group("m_t/m", "mass the controller is tuned for over that it moves", {"tuned_mass": 1, "mass": -1}),
    "joint": Group(
        "k_j/sigma_0", "stiffness of the joint over that of the bristles", {"k_j": 1, "sigma_0": -1}, 1.0, "joint"
    ),
    "stage_share": Group("M_stage/m", "share of the stage in the mass", {"stage_mass": 1, "mass": -1}, 1.0, "joint"),
    "joint_damping": Group(
        "d_j/(2 sqrt(k_j M_stage))",
        "damping ratio of the stage on its joint",
        {"d_j": 1, "k_j": -0.5, "stage_mass": -0.5},
        0.5,
        "joint",
    ),
    "stroke": Group(
        "k_j S_j/F_s",
        "force of the joint at its full stroke over static friction",
        {"k_j": 1, "stroke": 1, "static": -1},
        1.0,
        "joint",
    ),
    "limiter": Group(
        "k_l/sigma_0", "stiffness of the limiter over that of the bristles", {"k_l": 1, "sigma_0": -1}, 1.0, "joint"
    ),
    "limiter_damping": Group(
        "d_l/(2 sqrt(k_l M_stage))",
        "damping ratio of the stage on the limiter",
        {"d_l": 1, "k_l": -0.5, "stage_mass": -0.5},
        0.5,
        "joint",
    ),
    "parasitic": Group(
        "omega_p/omega_c", "parasitic mode over crossover", {"omega_p": 1, "omega_c": -1}, 1.0, "parasitic"
    ),
    "parasitic_mass": Group("m_p/m", "its share of the mass", {"parasitic_mass": 1, "mass": -1}, 1.0, "parasitic"),
    "parasitic_damping": Group("zeta_p", "its damping ratio", {"zeta_p": 1}, 1.0, "parasitic"),
}

_TELLING = {"joint": "joint.stiffness", "parasitic": "parasitic.frequency"}
"""Key whose presence shows that a stage has a part, by the part."""

GroupValues = Mapping[str, Any]
"""Values of groups by name: numbers, or arrays of one shape."""


@dataclass(frozen=True)
class GroupScale:
    """A mass [kg], a stiffness [N/m] and a force [N], which dimensionless groups leave open.

    With them, a stage follows from its groups.
    """

    mass: float = 1.0
    stiffness: float = 1.0
    force: float = 1.0

    @property
    def rate(self) -> float:
        """Return the natural frequency [rad/s] of the mass on its bristles, the unit of crossovers."""
        return float(np.sqrt(self.stiffness / self.mass))


_UNIT = GroupScale()


@dataclass(frozen=True)
class Count:
    """Number of parameters of a structure, and the rank of their dimensions."""

    parameters: int
    rank: int

    @property
    def groups(self) -> int:
        return self.parameters - self.rank


def group_parameters(flat: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the parameters on which the equations of a stage depend, by name.

    Masses that move as one count as one.
    """
    form = structure(flat)
    present = {str(symbol) for symbol in assemble(form).parameters}
    names = [name for name, parameter in PARAMETERS.items() if present.issuperset(parameter.keys)]
    return tuple(name for name in names if name != "stage_mass" or form.joint != "rigid")


def dimensions(name: str, flat: Mapping[str, Any]) -> np.ndarray:
    """Return the powers of kg, m and s in the unit of a parameter, shape (3,)."""
    field = numeric_keys(flat)[PARAMETERS[name].keys[0]]
    return np.array(_powers(field.unit if isinstance(field, Quantity) else ""))


@cache
def _powers(unit: str) -> tuple[float, float, float]:
    import pint

    kind = pint.UnitRegistry()(unit or "1").dimensionality if unit else {}
    mass, length, time = (float(str(kind.get(f"[{base}]", 0))) for base in ("mass", "length", "time"))
    return mass, length, time


def group_count(flat: Mapping[str, Any]) -> Count:
    """Count the parameters of a stage's structure, and the rank of their dimensions.

    Their difference is the number of dimensionless groups. Only the structure counts, such as whether there is a joint,
    not the values of the keys `flat`.
    """
    names = group_parameters(flat)
    matrix = np.stack([dimensions(name, flat) for name in names])
    return Count(len(names), int(np.linalg.matrix_rank(matrix)))


def values_of(flat: Mapping[str, Any]) -> dict[str, Any]:
    """Return the dimensionless groups of stages, given by keys [SI] with numbers or arrays.

    Only groups of the stage's own parts are returned. Raises InputError for a stage without LuGre friction or without
    van Dijk's rules.
    """
    if flat.get("friction.model") != "lugre" or CROSSOVER not in flat:
        expected = "LuGre friction and a controller by van Dijk's rules, for which the groups are derived"
        raise InputError("stage", "one with other friction, or with gains", expected, 'crossover = "8 Hz", alpha = 0.1')
    parts = {"stage", *(part for part, key in _TELLING.items() if key in flat)}
    return {name: group.of(flat) for name, group in GROUPS.items() if group.part in parts}


def flat_of(values: GroupValues, scale: GroupScale = _UNIT) -> dict[str, Any]:
    """Return stages with these dimensionless groups, as keys [SI]; the inverse of `values_of`.

    The stages are rigid, or have a free joint if `joint` is among the groups. `scale` gives the mass, stiffness and
    force that the groups leave open.
    """
    mass, stiffness, force = scale.mass, scale.stiffness, scale.force
    impedance = np.sqrt(stiffness * mass)
    share = values.get("stage_share", RIGID_SHARE)
    flat: dict[str, Any] = {
        "masses.cart": mass * (1 - share),
        "masses.stage": mass * share,
        "friction.model": "lugre",
        "friction.static": force,
        "friction.coulomb": force * (1 - values["gap"]),
        "friction.stribeck_velocity": values["stribeck"] * values["gap"] * force / impedance,
        "friction.stribeck_exponent": STRIBECK_EXPONENT,
        "friction.bristle_stiffness": stiffness,
        "friction.bristle_damping": 2 * values["bristle_damping"] * impedance,
        "friction.viscous": 2 * values["viscous"] * impedance,
        **tuned(
            values["crossover"] * scale.rate / (2 * np.pi), values["alpha"], values["beta"], values["tuned_mass"] * mass
        ),
    }
    return flat | (_joint(values, flat, scale) if "joint" in values else {})


def _joint(values: GroupValues, flat: Mapping[str, Any], scale: GroupScale) -> dict[str, Any]:
    stiffness = values["joint"] * scale.stiffness
    limiter = values.get("limiter", LIMITER_OVER_BRISTLES) * scale.stiffness
    return {
        "joint.locked": False,
        "joint.stiffness": stiffness,
        "joint.damping": 2 * values["joint_damping"] * np.sqrt(stiffness * flat["masses.stage"]),
        "joint.stroke": values["stroke"] * scale.force / stiffness,
        "joint.limiter_stiffness": limiter,
        "joint.limiter_damping": 2 * values["limiter_damping"] * np.sqrt(limiter * flat["masses.stage"]),
    }
