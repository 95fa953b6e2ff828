"""The quality of a fit of moves: what it leaves unexplained against the noise of the record, and whether inverse model,
whole model and the halves of the record agree."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.identification.inverse_model import InverseModel
from friso.identification.spread import spread_of
from friso.intervals import COVERAGE

NOISY = 10.0
"""A fit that leaves so many times the noise of the record lacks something, and says so."""

APART = 3.29
"""Standard deviations by which the halves of a record differ by chance once in a thousand times."""


@dataclass(frozen=True)
class Halves:
    """A quantity of the inverse model, `name`, that differs between both halves of a record: its values there, and the
    interval that holds those of either."""

    name: str
    first: float
    second: float
    low: float
    high: float


@dataclass(frozen=True)
class Quality:
    """`noise` [N] of the record's force; `left` [N], RMS of what the fit leaves of it where it counts, and what `noise`
    alone would leave there; relative errors of the force by the inverse model, and on its samples by the steady
    friction and mass of the whole model; sentences that say what is wrong (`doubts`); whether the whole model was
    `rejected`, and whether nothing holds (`failed`); the quantities whose `halves` differ; the inverse models `without`
    a cause, of a log rid of what may be wrong with it; whether the record is `spoilt`, so that what is wrong with it
    passes for slow friction, whether much is left that is `unsettled`: for which no cause was found, and whether a
    `compliant` coupling seems to be between force and position."""

    noise: float
    left: float
    noise_left: float
    inverse_error: float
    whole_error: float
    doubts: tuple[str, ...] = ()
    rejected: bool = False
    failed: bool = False
    halves: tuple[Halves, ...] = ()
    without: tuple[InverseModel, ...] = ()
    spoilt: bool = False
    unsettled: bool = False
    compliant: bool = False

    @property
    def ratio(self) -> float:
        """What is left over what noise alone would leave."""
        return self.left / self.noise_left if self.noise_left > 0 else np.inf

    @property
    def lacks_something(self) -> bool:
        return self.ratio > NOISY

    @property
    def lacking(self) -> float:
        """Share of what is left, RMS, that is not noise: 0 of a model that lacks nothing."""
        return float(np.sqrt(max(0.0, 1 - 1 / self.ratio**2))) if self.ratio > 1 else 0.0


def steady_friction(flat: Mapping[str, Any], velocity: np.ndarray) -> np.ndarray:
    """Friction [N] of a stage as flat keys at steady velocities [m/s], shape (n,), less its constant force."""
    return _by_direction(flat, np.abs(velocity), np.sign(velocity))


def whole_error(flat: Mapping[str, Any], inverse: InverseModel) -> float:
    """The relative error of the force on the samples of the inverse model, by mass and steady friction of a stage as
    flat keys; dry friction turns as gradually as the direction in the inverse model, whose columns are filtered."""
    mass = sum(flat.get(f"masses.{name}", 0.0) for name in ("cart", "stage"))
    acceleration, velocity, sign, _ = inverse.columns.T
    dry = {**flat, "friction.viscous": 0.0}
    wet = steady_friction(flat, velocity) - steady_friction(dry, velocity)
    left = inverse.measured - mass * acceleration - wet - _by_direction(dry, np.abs(velocity), sign)
    return float(np.linalg.norm(left) / np.linalg.norm(inverse.measured))


def _by_direction(flat: Mapping[str, Any], speed: np.ndarray, sign: np.ndarray) -> np.ndarray:
    """Friction [N] at speeds [m/s] in directions from -1 to 1, which turn from one to the other, less the constant
    force; each of shape (n,)."""
    from friso.frequency.friction import steady_force  # brings SymPy along

    forward, backward = (steady_force(flat, speed, forwards) for forwards in (True, False))
    constant = flat.get("bias.cart", 0.0) + flat.get("bias.stage", 0.0)
    return forward * (1 + sign) / 2 - backward * (1 - sign) / 2 - constant


def halves(inverse: InverseModel) -> list[Halves]:
    """Mass, viscous and Coulomb friction, where they differ by more than their spreads."""
    names = ("mass", "viscous", "coulomb")
    parts = np.array_split(np.arange(len(inverse.measured)), 2)
    fits = []
    for part in parts:
        columns, force = inverse.columns[part], inverse.measured[part]
        solution = np.linalg.lstsq(columns, force, rcond=None)[0]
        fits.append((solution, np.sqrt(np.diag(spread_of(columns, force - columns @ solution)))))
    values, off = (np.array(rows) for rows in zip(*fits, strict=True))
    apart = np.abs(values[0] - values[1]) > APART * np.hypot(*off)
    low, high = (values - COVERAGE * off).min(axis=0), (values + COVERAGE * off).max(axis=0)
    return [
        Halves(name, *(float(number) for number in (*values[:, i], low[i], high[i])))
        for i, name in enumerate(names)
        if apart[i] and np.isfinite(off[:, i]).all()
    ]
