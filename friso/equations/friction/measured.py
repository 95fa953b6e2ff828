"""What measurements show of friction, whatever the law: steady friction over speed, the force over displacement before
sliding from rest (the virgin curve), and damping at rest. Laws declare theirs, and what else they leave open."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from friso.equations.conditions import LEVELS, level_under_conditions

REACH, POINTS, FURTHER = 60.0, 2000, 200
"""How far virgin curves go, in units of the deflection that static friction would cause at the first stiffness; and
their points, which lie the closer the nearer to rest, and in those that go on further."""

NEAR = 1e-6
"""Distance of points, as a share of the last, below which no slope can be told."""


@dataclass(frozen=True)
class Levels:
    """Parameters of steady friction against velocity: a Stribeck curve (see `StribeckSection`)."""

    static: float
    coulomb: float
    stribeck_velocity: float
    stribeck_exponent: float
    viscous: float
    asymmetry: float = 0.0
    viscous_asymmetry: float = 0.0

    @property
    def keys(self) -> dict[str, float]:
        """As keys of the stage file; asymmetries only where there are any."""
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
        """Return the largest deviation of another virgin curve [N], as a share of static friction.

        Both have the same displacements.
        """
        return float(np.max(np.abs(force - self.force)) / self.levels.static)


def virgin_displacements(static: float, stiffness: float, corners: Sequence[float] | np.ndarray = ()) -> np.ndarray:
    """Return displacements [m] at which to compare virgin curves, shape (n,).

    They reach beyond break-away, or to the last of `corners` if that lies farther, and include all `corners`, the
    displacements at which a curve made of straight pieces bends.
    """
    usual, corners = static / stiffness * REACH, np.unique(np.append(0.0, corners))
    places = usual * np.linspace(0.0, 1.0, POINTS) ** 2
    if corners[-1] > usual:
        places = np.append(places, np.geomspace(usual, corners[-1], FURTHER)[1:])
    after = np.searchsorted(corners, places)
    beside = [corners[np.clip(after - before, 0, len(corners) - 1)] for before in (0, 1)]
    return np.union1d(places[np.abs(places - beside).min(axis=0) > NEAR * places[-1]], corners)


def levels_of(flat: Mapping[str, Any]) -> Levels:
    """Return the Stribeck curve of a law as it was measured, without [conditions]."""
    values = {field.name: flat.get(f"friction.{field.name}", field.default) for field in fields(Levels)}
    return Levels(**{name: float(value) for name, value in values.items()})


def levels_under_conditions(flat: Mapping[str, Any]) -> Levels:
    """Return the friction levels under the operating conditions of [conditions]."""
    return replace(levels_of(flat), **{name: float(level_under_conditions(flat, name)) for name in LEVELS})


def on_bristles(flat: Mapping[str, Any], displacement: np.ndarray, force: np.ndarray) -> MeasuredFriction:
    """Return what measurements would show of a law with a Stribeck curve and bristles.

    The bristles are as stiff and damped as those of LuGre, and give the virgin curve `force` [N] over `displacement`
    [m].
    """
    stiffness, damping = (float(flat[f"friction.bristle_{name}"]) for name in ("stiffness", "damping"))
    return MeasuredFriction(levels_of(flat), stiffness, damping, displacement, force)


def power_law(static: float, stiffness: float, exponent: float, displacement: np.ndarray) -> np.ndarray:
    """Return a virgin curve whose slope falls by a power of the missing force (Dahl's exponent).

    It is force [N] over displacement [m] from rest, both of shape (n,). Below an exponent of 1 it ends at static
    friction, at 0 it is straight.
    """
    way, more = stiffness * displacement / static, exponent - 1
    lacking = np.exp(-way) if more == 0 else np.maximum(1 + more * way, 0.0) ** (-1 / more)
    return static * (1 - lacking)


def best(candidates: np.ndarray, misfits: np.ndarray) -> float:
    """Return the candidate whose misfit is the smallest."""
    return float(candidates[int(np.argmin(misfits))])


SLACK = 0.02
"""Share of static friction by which a virgin curve may be off more than the best, and still pass for the measured."""


def as_good(candidates: np.ndarray, misfits: np.ndarray) -> tuple[float, float]:
    """Return the range of the candidates that a measurement could not tell from the best."""
    good = candidates[misfits <= np.min(misfits) + SLACK]
    return float(good.min()), float(good.max())
