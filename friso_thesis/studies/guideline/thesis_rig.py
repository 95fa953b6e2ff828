"""Compute the edge of hunting of the thesis rig by the laws and by simulation, side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.equations.controllers.van_dijk import CROSSOVER
from friso.hunting import Ensemble, find_margin
from friso.stage import Stage
from friso_thesis.studies.guideline.edges import ABOVE, BELOW, FLIP, find_edges
from friso_thesis.studies.guideline.groups import values_of
from friso_thesis.studies.guideline.laws import FittedLaw
from friso_thesis.studies.thesis.studies import thesis_rig

RIGID_GRID = np.geomspace(2.0, 60.0, 14)
FREE_GRID = np.geomspace(1.0, 20.0, 28)
"""Crossovers tried for the rig [Hz]. There are more than in the sweeps, because some cycles with a free joint cannot be
closed."""

RigChanges = Mapping[str, Any]
"""Keys that differ from those of the rig, with SI values."""


@dataclass(frozen=True)
class ThesisCase:
    """A stage like the rig: what is changed, and its edge [Hz] by the law and as computed.

    The computed edge is NaN if none was found; `kind`, one of `KINDS`, then gives the reason.
    """

    changes: RigChanges
    law: float
    computed: float
    kind: str = FLIP

    @property
    def ranked(self) -> float:
        """Return the computed edge [Hz] for comparisons.

        The result is 0 if the edge lies below the crossovers tried, infinite if above, and NaN if unknown.
        """
        return {BELOW: 0.0, ABOVE: np.inf}.get(self.kind, self.computed)


@dataclass(frozen=True)
class Laws:
    """The law of the edge for a locked joint, and the one for a free joint, which builds on it."""

    locked: FittedLaw
    free: FittedLaw

    def locked_edge(self, flat: Mapping[str, Any]) -> np.ndarray:
        """Return the edge [Hz] of stages with the joint locked, by the law.

        Stages are given by keys [SI] with numbers or arrays.
        """
        values, rate = _shaped(flat)
        return self.locked.edge(values) * rate

    def free_edge(self, flat: Mapping[str, Any]) -> np.ndarray:
        """Return the edge [Hz] of stages with the joint free, by both laws.

        Stages are given by keys [SI] with numbers or arrays.
        """
        values, rate = _shaped(flat)
        return self.free.edge(values, self.locked.edge(values)) * rate

    def rates(self, flat: Mapping[str, Any]) -> dict[str, np.ndarray]:
        """Return all frequencies [Hz] that enter the two laws, by name.

        Stages are given by keys [SI] with numbers or arrays.
        """
        values, rate = _shaped(flat)
        return {
            quantity.name: np.exp(log) * rate
            for law in (self.locked, self.free)
            for quantity, log in zip(law.law.rates, law.log_rates(values), strict=True)
        }


def _shaped(flat: Mapping[str, Any]) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Return the dimensionless groups of stages by name, and natural frequencies [Hz].

    The groups are arrays of one shape. Each frequency is that of cart and stage together on the bristle stiffness.
    """
    values = values_of(flat)
    rate = np.sqrt(flat["friction.bristle_stiffness"] / (flat["masses.cart"] + flat["masses.stage"])) / (2 * np.pi)
    arrays = np.broadcast_arrays(*(np.atleast_1d(value) for value in values.values()))
    return dict(zip(values, arrays, strict=True)), np.atleast_1d(rate)


def plain_rig(part: str = "") -> dict[str, Any]:
    """Return the rig's keys [SI] without its parasitic mode.

    The joint is left out too, unless `part` is "joint".
    """
    dropped = "parasitic." if part == "joint" else ("parasitic.", "joint.")
    return {key: value for key, value in thesis_rig().flat().items() if not key.startswith(dropped)}


def cases(laws: Laws, changes: Sequence[RigChanges], free: bool) -> list[ThesisCase]:
    """Return the edges of the rig with each of several changes, by the law and as computed.

    If `free`, the joint is free, otherwise the rig is one rigid mass.
    """
    mode = any("parasitic.frequency" in change for change in changes)
    base = thesis_rig().flat() if mode else plain_rig("joint" if free else "")
    keys = {key for change in changes for key in change}
    flat = base | {key: np.array([change.get(key, base[key]) for change in changes], float) for key in keys}

    def stages(which: np.ndarray, crossover: np.ndarray) -> Ensemble:
        subset = {key: value[which] if np.ndim(value) else value for key, value in flat.items()}
        return Ensemble.held(subset | {CROSSOVER: crossover}, len(which))

    grid = FREE_GRID if free else RIGID_GRID
    edges = find_edges(stages, np.broadcast_to(grid, (len(changes), len(grid))))
    with_joint = plain_rig("joint") | {key: value for key, value in flat.items() if not key.startswith("parasitic.")}
    law = np.broadcast_to(laws.free_edge(with_joint) if free else laws.locked_edge(with_joint), edges.kind.shape)
    columns = law.tolist(), edges.crossover.tolist(), edges.kind.astype(str).tolist()
    return [ThesisCase(*row) for row in zip(changes, *columns, strict=True)]


def direct(stage: Stage) -> float:
    """Return the edge [Hz] that `friso check` finds for a hunting stage; NaN without one."""
    edge = find_margin(stage, attracting=True)
    return edge.crossover if edge and edge.crossover else np.nan
