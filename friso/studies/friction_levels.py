"""Ask for which friction a stage would hunt whose own friction nobody knows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.errors import StageError
from friso.hunting import can_hunt, loops_unstable, sketch_attractors
from friso.stage import Stage
from friso.stage.contacts import any_contact, written
from friso.stage.correlations import Correlations, draw, laid_over
from friso.stage.tables import moving_mass
from friso.studies.settings import settings


@dataclass(frozen=True)
class FrictionLevels:
    """Which of many machines hunt at levels of Coulomb friction, drawn about those of similar contacts.

    `coulomb` [N] are the levels in ascending order, (levels,). `hunts` is 1 where a drawn machine hunts, 0 where it
    does not, and NaN where that is not certain, (machines, levels).
    """

    coulomb: np.ndarray
    hunts: np.ndarray

    @property
    def shares(self) -> np.ndarray:
        """Return the share of machines that hunt for certain at each level, (levels,)."""
        return (self.hunts == 1).mean(axis=0)

    def ends(self, share: float) -> tuple[float, float] | None:
        """Return the least and the largest level [N] at which at least a share of machines hunt; None if at none."""
        at = np.flatnonzero(self.shares >= share)
        return (float(self.coulomb[at[0]]), float(self.coulomb[at[-1]])) if at.size else None


def friction_levels(stage: Stage) -> FrictionLevels | None:
    """Draw machines like a stage without friction at levels of Coulomb friction, and see which of them hunt.

    Levels are those that bearings of such a mass may have. Returns None for a stage that states its friction, be it
    none, that moves for ever, or whose loop cannot hunt with any friction.
    """
    if stage.states_friction:
        return None
    mass = float(moving_mass(stage.flat()))
    levels = mass * np.geomspace(*settings.accelerations_of_friction, settings.levels_of_friction)
    columns = []
    for level in levels:
        column = _hunting(stage, float(level))
        if column is None:
            return None
        columns.append(column)
    return FrictionLevels(levels, np.stack(columns, axis=1))


def _hunting(stage: Stage, coulomb: float) -> np.ndarray | None:
    """Return which machines with a level of Coulomb friction [N] hunt, (machines,); None if none can."""
    axis = stage.axis_kind
    ranges = any_contact(axis).ranges((coulomb, coulomb))
    table: dict[str, Any] = {"model": "lugre", "stribeck_exponent": 2}
    units = {"static": axis.force, "coulomb": axis.force, "stribeck_velocity": f"{axis.length}/s"}
    units |= {
        "bristle_stiffness": axis.unit("N/m"),
        "bristle_damping": axis.unit("N*s/m"),
        "viscous": axis.unit("N*s/m"),
    }
    table |= {key: written(ends, units[key]) for key, ends in ranges.items()}
    table["coulomb"] = f"{coulomb!r} {axis.force}"
    unknown = ", ".join(f"friction.{key}" for key in ranges if key != "coulomb")
    try:
        tried = Stage(**{**stage.as_written(), "friction": table, "unknown": unknown})
        sample = draw(tried, Correlations(), settings.machines_of_a_level, 0)
    except StageError:  # uncertain keys of the stage itself may hardly ever fit together
        return None
    flat = laid_over(tried, sample.keys)
    if not can_hunt(flat) or loops_unstable(flat, sample.count).any():
        return None
    attracted = sketch_attractors(flat, sample.count)
    return np.where(attracted.certain, attracted.attracts, np.nan)
