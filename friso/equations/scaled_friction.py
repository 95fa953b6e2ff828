"""Scale the friction of stages: all of it, or static friction alone."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from friso.stage import numeric_keys
from friso.stage.tables import MOTOR_FRICTION

TABLES = ("friction", MOTOR_FRICTION)
"""Tables of a stage file that hold a friction law."""


def static_frictions(flat: Mapping[str, Any]) -> dict[str, str]:
    """Return the keys of static friction, each with its key of Coulomb friction.

    The result is empty for a law without static or Coulomb friction.
    """
    pairs = {f"{table}.static": f"{table}.coulomb" for table in TABLES}
    return {static: coulomb for static, coulomb in pairs.items() if static in flat and coulomb in flat}


def least_static_factor(flat: Mapping[str, Any]) -> float:
    """Return the smallest factor on static friction for which it is at least Coulomb friction.

    The stages, given by keys in SI, must have a law with static and Coulomb friction.
    """
    return max(float(np.max(flat[coulomb] / flat[static])) for static, coulomb in static_frictions(flat).items())


def with_static_friction(flat: Mapping[str, Any], factor: Any) -> dict[str, Any]:
    """Return stages with static friction times a factor, Coulomb friction unchanged.

    `flat` has the stages' keys in SI. A law without static or Coulomb friction stays as it is.
    """
    return {**flat, **{key: flat[key] * factor for key in static_frictions(flat)}}


def with_friction(flat: Mapping[str, Any], factor: Any) -> dict[str, Any]:
    """Return stages with all their friction times a factor; `flat` has their keys in SI.

    Every force, stiffness and damping of a law is multiplied, so that its deflections and speeds do not change.
    """
    forces = [key for key, kind in numeric_keys(flat).items() if key.partition(".")[0] in TABLES and _is_force(kind)]
    return {**flat, **{key: flat[key] * factor for key in forces if key in flat}}


def _is_force(kind: Any) -> bool:
    """Tell whether a quantity is a force, or a force per speed or distance."""
    return str(kind.unit).startswith("N")
