"""A rigid stage on an isolator: its mass split, a joint between the parts, friction on the cart."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from friso.equations.breakaway import least_breakaway
from friso.stage import Stage
from friso.stage.controllers import as_tuned

STAGE_SHARE = 0.3
"""Share of the moving mass that the joint carries where the stage file does not tell: the thesis's rig has 0.29."""

STROKE, FORCE_SHARE, DAMPING_RATIO = 1e-3, 0.5, 0.05
"""The joint that a search begins with: stroke [m], force at the stroke over static friction, damping ratio."""

STEEL = 190e9
"""Young's modulus of spring steel [Pa], of which leaves and stops are where nothing else is told."""

STOP, STOP_DAMPING_RATIO = 0.1, 0.016
"""Stiffness of a stroke limiter over Young's modulus times the stroke, and its damping ratio with the stage: of the
thesis's limiter they are 0.105 and 0.0158."""


def split(flat: Mapping[str, Any]) -> dict[str, float]:
    """Masses of cart and stage [kg]: those of the file, or shares of the only one."""
    masses = {key: flat[key] for key in ("masses.cart", "masses.stage") if key in flat}
    if len(masses) == 2:
        return masses
    (whole,) = masses.values()
    return {"masses.cart": (1 - STAGE_SHARE) * whole, "masses.stage": STAGE_SHARE * whole}


def isolated(stage: Stage, stroke: float = STROKE, young: float = STEEL) -> Stage:
    """The stage with a free joint: its own, or one to begin a search with, of a stroke [m] and leaves with a Young's
    modulus `young` [Pa]; its controller as tuned for the whole mass. Raises StageError where the result is no stage.
    """
    free = stage.variants().get("free")
    if free is not None:
        return free
    flat = stage.flat()
    masses = split(flat)
    stiffness = FORCE_SHARE * float(least_breakaway(flat)) / stroke
    stop = STOP * young * stroke
    numbers = {
        **masses,
        **as_tuned(flat),
        "joint.stiffness": stiffness,
        "joint.damping": 2 * DAMPING_RATIO * (stiffness * masses["masses.stage"]) ** 0.5,
        "joint.stroke": stroke,
        "joint.limiter_stiffness": stop,
        "joint.limiter_damping": 2 * STOP_DAMPING_RATIO * (stop * masses["masses.stage"]) ** 0.5,
    }
    whole = stage.with_numbers({key: float(f"{value:.10g}") for key, value in numbers.items()})
    return whole.replace({"joint.locked": False}) if stage.joint else whole
