"""Describe friction as measurements show it, whatever the law.

Measurements show steady friction over speed, the force over displacement from rest until sliding (the virgin curve),
and damping at rest. Each law's file computes these, and says which of its parameters they leave open.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from friso.equations.conditions import LEVELS, level_under_conditions

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
