"""Define the fitted parameters, their ranges, and the stages that follow from their values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.axis import LINEAR, AxisKind, axis_of
from friso.errors import InputError
from friso.stage.tables import friction_law, friction_laws

MASS, SHARE, RATIO = "mass", "cart share", "static friction ratio"
"""Names of fit parameters: moving mass; the cart's fraction of it (a rigid stage keeps the stage file's); ratio of
static to Coulomb friction."""

EXPONENT = "friction.stribeck_exponent"
STRIBECK = (RATIO, "friction.stribeck_velocity")
CURVE = (*STRIBECK, EXPONENT)
BRISTLES = ("friction.bristle_stiffness", "friction.bristle_damping")
"""Fit parameters of the bristles; `CURVE` has the parameters of the Stribeck curve."""


@dataclass(frozen=True)
class FitParameter:
    """A parameter of the fit with its SI unit, start value and range [SI].

    The fitted number is the logarithm of a `logarithmic` parameter, otherwise its value. Every motion determines a
    `core` parameter. For each of the others, the fit tests whether this motion determines it.
    """

    name: str
    unit: str
    start: float
    low: float
    high: float
    logarithmic: bool = True
    core: bool = True

    def inner(self, value: Any) -> Any:
        """Return the fitted number for an SI value: its logarithm, or the value itself."""
        return np.log(value) if self.logarithmic else value

    def outer(self, inner: Any) -> Any:
        """Return the SI value of a fitted number."""
        return np.exp(inner) if self.logarithmic else inner


SHORTEST_BRISTLE_BEND = 5e-8  # [m]
"""Smallest deflection of a bearing's bristles before they slip."""

LONGEST_BRISTLE_BEND = 3e-4  # [m]
"""Largest deflection of a bearing's bristles before they slip."""

BEARING_RADII = (5e-3, 0.5)  # [m]
"""Smallest and largest radius of rotary bearings, which convert bristle deflections to angles."""


def bends(axis: AxisKind) -> tuple[float, float]:
    """Return the shortest and longest bend of bristles before sliding in a fit [m].

    On a rotary axis they are angles [rad], which follow from the largest and smallest bearing radii.
    """
    if axis == LINEAR:
        return SHORTEST_BRISTLE_BEND, LONGEST_BRISTLE_BEND
    smallest, largest = BEARING_RADII
    return SHORTEST_BRISTLE_BEND / largest, LONGEST_BRISTLE_BEND / smallest


HIGHEST_STRIBECK_VELOCITY = 0.02  # [m/s]
"""Highest plausible Stribeck velocity of a bearing."""


def stribeck_up_to(flat: Mapping[str, Any]) -> float:
    """Return the highest plausible Stribeck velocity [m/s] of a bearing.

    On a rotary axis it is in rad/s, at a medium radius of bearings.
    """
    radius = 1.0 if axis_of(flat) == LINEAR else float(np.sqrt(np.prod(BEARING_RADII)))
    return HIGHEST_STRIBECK_VELOCITY / radius


def is_free(flat: Mapping[str, Any]) -> bool:
    """Tell whether a stage, given by keys such as joint.locked, has a joint that moves freely."""
    return "joint.stiffness" in flat and not flat["joint.locked"]


def fit_parameters(
    flat: Mapping[str, Any], levels: Mapping[str, float], speed: float, travel: float, both_ways: bool
) -> list[FitParameter]:
    """List the parameters of a stage that a log may determine, with their starts and ranges.

    `levels` has first values of mass, Coulomb and viscous friction and offset, from the inverse model. `speed` [m/s] is
    the highest in the log, and `travel` [m] its range: bristles bend no further, and the Stribeck velocity is no higher
    unless bearings typically have higher ones. If the log does not go `both_ways`, a constant force and friction that
    differs by direction cannot be separated from friction, and are left out. Raises InputError for a friction law that
    cannot be fitted.
    """
    mass = levels["mass"]
    parameters = [FitParameter(MASS, "kg", mass, mass / 5, mass * 5)]
    if friction_law(flat["friction.model"]).fitted:
        parameters += _friction(flat, levels, speed, travel, both_ways)
    elif flat["friction.model"] != "none":
        actual = f'"{flat["friction.model"]}", a law that friso cannot fit'
        fitted = ", ".join(name for name, law in friction_laws().items() if law.fitted)
        raise InputError("friction.model", actual, f"one of {fitted}, or none", 'model = "lugre"')
    bias = "bias.cart" if "masses.cart" in flat else "bias.stage"
    reach = 5 * max(levels["coulomb"], abs(levels["offset"]))
    if both_ways:
        parameters.append(FitParameter(bias, "N", -levels["offset"] or 1e-9, -reach, reach, logarithmic=False))
    if is_free(flat):
        k, d = flat["joint.stiffness"], max(flat["joint.damping"], 1e-3)
        share = flat["masses.cart"] / (flat["masses.cart"] + flat["masses.stage"])
        parameters += [
            FitParameter(SHARE, "", share, share / 20, 1 - (1 - share) / 20, logarithmic=False, core=False),
            FitParameter("joint.stiffness", "N/m", k, k / 10, k * 10, core=False),
            FitParameter("joint.damping", "N*s/m", d, d / 100, d * 100, core=False),
        ]
    return parameters


HIGHEST_FRICTION_RATIO = 4.0
"""Largest plausible ratio of static to Coulomb friction of a bearing. The thesis's rig has 3."""


def _friction(
    flat: Mapping[str, Any], levels: Mapping[str, float], speed: float, travel: float, both_ways: bool
) -> list[FitParameter]:
    """List the parameters of the friction law that a log may determine, with starts and ranges.

    `levels` has first values from the inverse model; `speed` [m/s] and `travel` [m] are the largest in the log.
    """
    coulomb, viscous = levels["coulomb"], levels["viscous"]
    parameters = [
        FitParameter("friction.coulomb", "N", coulomb, coulomb / 20, coulomb * 5),
        FitParameter("friction.viscous", "N*s/m", viscous, 0.0, 20 * max(viscous, coulomb / speed), logarithmic=False),
    ]
    if "friction.stribeck_velocity" in flat:
        if both_ways:
            parameters.append(FitParameter("friction.viscous_asymmetry", "", 1e-6, -0.9, 0.9, logarithmic=False))
        parameters += [
            FitParameter(RATIO, "", 1.0, 1.0, HIGHEST_FRICTION_RATIO, logarithmic=False, core=False),
            _slow("friction.stribeck_velocity", "m/s", flat, speed / 3e3, max(speed, stribeck_up_to(flat))),
            _exponent(flat["friction.stribeck_exponent"]),
        ]
    if "friction.bristle_stiffness" in flat:
        shortest, longest = bends(axis_of(flat))
        softest, stiffest = coulomb / min(longest, travel / 10), coulomb / shortest
        parameters.append(_slow("friction.bristle_stiffness", "N/m", flat, softest, stiffest))
    if "friction.bristle_damping" in flat:
        critical = 2 * np.sqrt(flat["friction.bristle_stiffness"] * levels["mass"])
        parameters.append(_slow("friction.bristle_damping", "N*s/m", flat, critical / 50, 10 * critical))
    return parameters


EXPONENT_SHARE_OF_A_START = 0.995
"""Start of a fitted Stribeck exponent, relative to the stated one. Exactly 1 and 2 have simplified equations."""

STRIBECK_EXPONENTS = (0.5, 2.5)
"""Range of plausible exponents of a Stribeck curve: 0.5 to 2 in Armstrong-Helouvry et al. 1994, with a margin."""


def _exponent(stated: float) -> FitParameter:
    """Define the fit parameter for the exponent of the Stribeck curve.

    The fit starts slightly below the `stated` value, because 1 and 2 have simplified equations.
    """
    start, (least, most) = EXPONENT_SHARE_OF_A_START * stated, STRIBECK_EXPONENTS
    return FitParameter(EXPONENT, "", start, min(least, start), max(most, start), logarithmic=False, core=False)


def _slow(name: str, unit: str, flat: Mapping[str, Any], low: float, high: float) -> FitParameter:
    """Define a parameter that only slow motion shows; its fit starts at the stage's value.

    The range from `low` to `high` is widened to contain the start.
    """
    start = float(flat[name])
    return FitParameter(name, unit, start, float(min(low, start)), float(max(high, start)), core=False)


def stages(flat: Mapping[str, Any], parameters: Sequence[FitParameter], inner: np.ndarray) -> dict[str, Any]:
    """Turn fitted numbers, (runs, parameters) or (parameters,), into stages as flat keys with SI values."""
    return {**flat, **keys_at(flat, parameters, inner)}


def keys_at(flat: Mapping[str, Any], parameters: Sequence[FitParameter], inner: np.ndarray) -> dict[str, Any]:
    """Turn fitted numbers, (runs, parameters) or (parameters,), into SI values of keys of the stage file."""
    columns = zip(parameters, inner.T, strict=True)
    return keys_of(flat, {parameter.name: parameter.outer(column) for parameter, column in columns})


def keys_of(flat: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """Turn values of fit parameters, by name, into SI values of keys of the stage file.

    Values are numbers or arrays; `flat` is the stage before the fit.
    """
    keys = {name: value for name, value in values.items() if name not in (MASS, SHARE, RATIO)}
    bodies = [name for name in ("masses.cart", "masses.stage") if name in flat]
    total = sum(flat[name] for name in bodies)
    if MASS in values:
        shares = {name: flat[name] / total for name in bodies}
        if SHARE in values:
            shares = {"masses.cart": values[SHARE], "masses.stage": 1 - values[SHARE]}
        keys |= {name: values[MASS] * share for name, share in shares.items()}
    if "friction.static" in flat and (RATIO in values or "friction.coulomb" in values):
        ratio = values.get(RATIO, flat["friction.static"] / flat["friction.coulomb"])
        keys["friction.static"] = ratio * values.get("friction.coulomb", flat["friction.coulomb"])
    return keys
