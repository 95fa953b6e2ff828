"""Put a rigid stage on an isolator.

Its mass is split, a joint is added between the parts, and the friction stays on the cart.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from friso.design_method.settings import settings
from friso.equations.breakaway import least_breakaway
from friso.stage import Stage
from friso.stage.controllers import as_tuned

STROKE = 1e-3
"""Stroke [m] of the joint from which a search starts. `first_force_share` and `first_damping` of the settings give the
rest."""

STEEL = 190e9
"""Young's modulus of spring steel [Pa], the default for leaves and stops."""


def split(flat: Mapping[str, Any]) -> dict[str, float]:
    """Return the masses of cart and stage [kg]; a stage file with one mass has it divided."""
    masses = {key: flat[key] for key in ("masses.cart", "masses.stage") if key in flat}
    if len(masses) == 2:
        return masses
    (whole,) = masses.values()
    return {"masses.cart": (1 - settings.stage_mass_share) * whole, "masses.stage": settings.stage_mass_share * whole}


def isolated(stage: Stage, stroke: float = STROKE, young: float = STEEL) -> Stage:
    """Return the stage with a free joint: its own joint, or one from which a search starts.

    The new joint has a stroke [m], and stops whose stiffness follows from Young's modulus `young` [Pa]. The controller
    stays tuned for the whole mass. Raises StageError if the result is not a valid stage.
    """
    free = stage.variants().get("free")
    if free is not None:
        return free
    flat = stage.flat()
    masses = split(flat)
    stiffness = settings.first_force_share * float(least_breakaway(flat)) / stroke
    stop = settings.stop_stiffness * young * stroke
    numbers = {
        **masses,
        **as_tuned(flat),
        "joint.stiffness": stiffness,
        "joint.damping": 2 * settings.first_damping * (stiffness * masses["masses.stage"]) ** 0.5,
        "joint.stroke": stroke,
        "joint.limiter_stiffness": stop,
        "joint.limiter_damping": 2 * settings.stop_damping * (stop * masses["masses.stage"]) ** 0.5,
    }
    whole = stage.with_numbers({key: float(f"{value:.10g}") for key, value in numbers.items()})
    return whole.replace({"joint.locked": False}) if stage.joint else whole
