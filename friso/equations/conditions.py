"""Apply the operating conditions of a machine to static and Coulomb friction of its guide.

Conditions multiply both levels alike, for every friction law. Friction consists of a constant part (seals, preload) and
a part that grows with the normal force. It is larger in the cold: Carvalho Bittencourt, Gunnarsson 2012,
doi:10.1115/1.4006589. A running machine warms up exponentially in time: Simoni, Beschi, Legnani, Visioli 2019,
doi:10.1017/S0263574717000509. For the variation of friction along a rail, see `friso.equations.rail`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from friso.stage.flexure import register_derivation
from friso.stage.tables import CONDITIONS

if TYPE_CHECKING:
    import sympy as sp

LEVELS = ("static", "coulomb")
"""Names of the friction keys that operating conditions multiply."""

GROWTH = f"{CONDITIONS}.growth"
"""Key of the relative growth of the factors per acceleration of the reference [s^2/m]."""

DECISIVE = (f"{CONDITIONS}.load_per_acceleration", f"{CONDITIONS}.load_share")
"""Numeric keys that decide whether friction follows the acceleration of the reference."""


def factor_key(level: str) -> str:
    """Return the key of the factor with which [conditions] multiply one kind of friction.

    `level` is "static" or "coulomb".
    """
    return f"{CONDITIONS}.{level}_factor"


def has_conditions(flat: Mapping[str, Any]) -> bool:
    """Tell whether a stage has a table [conditions]; `flat` has its keys."""
    return factor_key("static") in flat


def load_follows(flat: Mapping[str, Any]) -> bool:
    """Tell whether friction changes with the acceleration of the reference."""
    return bool(np.any(flat.get(GROWTH, 0.0)))


def friction_level(name: str, conditions: bool) -> sp.Expr:
    """Return static or Coulomb friction [N] in symbols, with its factor if there are conditions.

    It is valid at constant speed of the reference. `name` is "static" or "coulomb".
    """
    from friso.equations.component import key

    measured = key(f"friction.{name}")
    return measured * key(factor_key(name)) if conditions else measured


def level_under_conditions(flat: Mapping[str, Any], name: str) -> Any:
    """Return static or Coulomb friction [N] of a stage under its operating conditions.

    `name` is "static" or "coulomb", and `flat` has the stage's keys in SI.
    """
    return flat[f"friction.{name}"] * flat.get(factor_key(name), 1.0)


def under_acceleration(acceleration: sp.Expr) -> dict[Any, Any]:
    """Return substitutions that turn the friction factors into those at an acceleration [m/s^2].

    Without them, the factors are those at constant speed.
    """
    from friso.equations.component import key

    factors = [key(factor_key(name)) for name in LEVELS]
    return {factor: factor * (1 + key(GROWTH) * acceleration) for factor in factors}


@register_derivation(CONDITIONS)
def factors(flat: Mapping[str, Any]) -> dict[str, Any]:
    """Compute the friction factors that follow from [conditions], by key, as numbers or arrays.

    They are valid at the stage's place on the rail. `flat` has the stage's keys in SI. Raises InputError for a
    correlation length that is tiny against the range of places.
    """
    own = {key.removeprefix(f"{CONDITIONS}."): flat[key] for key in flat if key.startswith(f"{CONDITIONS}.")}
    loaded = 1 - own["load_share"] + own["load_share"] * own["load"]
    warm = np.exp(-own["running_time"] / own.get("warm_up_time", np.inf))
    common = loaded * (1 + (own["cold"] - 1) * warm)
    # else the file breaks a rule
    varies = "rail.seed" in flat and ("rail.correlation_length" in flat or not _deviates(flat))
    place = _at_place(flat, own["place"]) if "place" in own and varies else np.ones(len(LEVELS))
    made = {factor_key(name): common * there for name, there in zip(LEVELS, place, strict=True)}
    made[GROWTH] = own["load_share"] * own["load_per_acceleration"] / loaded
    return {key: value if np.ndim(value) else float(value) for key, value in made.items()}


def anywhere(flat: Mapping[str, Any]) -> dict[str, Any]:
    """Return a stage's keys for motion along its rail, instead of at one place of it.

    Its friction factors then leave out the factors of that place.
    """
    if not has_conditions(flat):
        return dict(flat)
    free = {key: value for key, value in flat.items() if key != f"{CONDITIONS}.place"}
    return free | factors(free)


def _deviates(flat: Mapping[str, Any]) -> bool:
    """Tell whether friction deviates at random along the rail; `flat` has the keys of the rail."""
    return any(np.any(flat.get(f"rail.{level}_deviation", 0.0)) for level in LEVELS)


def _at_place(flat: Mapping[str, Any], place: Any) -> np.ndarray:
    """Return factors of static and Coulomb friction at places [m] on the rail, (2,) or (2, n)."""
    from friso.equations.rail import friction_factors

    rail = {key: value for key, value in flat.items() if key.startswith("rail.")}
    if not any(np.ndim(value) for value in rail.values()):
        there = friction_factors(rail, np.atleast_1d(place))
        return there if np.ndim(place) else there[:, 0]
    columns = np.broadcast_arrays(place, *rail.values())
    one_by_one = [
        friction_factors(dict(zip(rail, values, strict=True)), np.array([at]))[:, 0]
        for at, *values in zip(*columns, strict=True)
    ]
    return np.transpose(one_by_one)
