"""Sweep the edge of hunting over quasi-random (Sobol) samples of the dimensionless groups.

The sweeps are computed in parts, which are kept if a run is interrupted.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields

import numpy as np
from scipy.stats import qmc

from friso.hunting import Ensemble
from friso.progress import Tally
from friso_thesis.studies.guideline.edges import Edges, find_edges
from friso_thesis.studies.guideline.groups import flat_of
from friso_thesis.studies.kept_work import KeptWork

LOCKED, FREE = "edges of rigid masses", "edges with a free joint"

STEPS = {LOCKED: 1, FREE: 8}
"""Steps of progress per sample: one with a free joint takes as long as eight rigid masses."""

Box = Mapping[str, tuple[float, float]]
"""Range of each group; samples are uniform in its logarithm."""

LOCKED_BOX: Box = {
    "gap": (0.1, 0.85),
    "stribeck": (0.1, 10.0),
    "bristle_damping": (0.1, 1.0),
    "viscous": (1e-4, 5e-3),
    "alpha": (0.05, 0.25),
    "beta": (1.5, 4.0),
    "tuned_mass": (0.8, 1.25),
}
"""Ranges around the thesis rig (gap 0.67, stribeck 0.33, bristle damping 0.38, viscous 6e-4, alpha 0.1, beta 2). They
are as wide as masses from 0.5 to 50 kg and bristles from 1e5 to 1e8 N/m make them."""

JOINT_BOX: Box = {
    "ratio": (0.15, 3.0),
    "stage_share": (0.15, 0.8),
    "joint_damping": (1e-3, 0.1),
    "stroke": (0.02, 20.0),
    "limiter_damping": (5e-3, 0.3),
}
"""Ranges of the joint. `ratio` is its frequency, sqrt(k_j/m), over the locked edge. Below its range the joint is far
softer than any that the thesis tries; above it the isolator changes hardly anything."""

LOCKED_GRID = np.geomspace(0.004, 1.0, 20)
"""Crossovers tried, in units of sqrt(sigma_0/m)."""

FREE_GRID = np.geomspace(0.03, 1.6, 12)
"""Crossovers tried with a free joint, in units of the locked edge."""

PART_SAMPLES = 32
"""Number of samples that are computed and saved together."""

LOCKED_FIT, LOCKED_TEST, FREE_FIT, FREE_TEST = 1, 2, 3, 4
"""Seeds of the scrambled Sobol sequences; fits and tests have separate samples."""


@dataclass(frozen=True)
class Sweep:
    """Samples, which are stages given by their dimensionless groups, and their edges of hunting.

    `values` are the groups, each of shape (count,), and contain the crossover at the edge (in units of sqrt(sigma_0/m),
    NaN without an edge). `locked` (count,) is the edge of the same stage with its joint locked (rigid).
    """

    values: Mapping[str, np.ndarray]
    locked: np.ndarray
    edges: Edges

    def take(self, which: np.ndarray) -> Sweep:
        """Select samples by indices or by a boolean array."""
        values = {name: value[which] for name, value in self.values.items()}
        return Sweep(values, self.locked[which], self.edges.take(which))

    @property
    def edge(self) -> np.ndarray:
        """Return the crossovers at the edges, in units of sqrt(sigma_0/m); NaN without an edge."""
        return self.edges.crossover

    @property
    def usable(self) -> Sweep:
        """Return the samples whose edge lies in the range that was searched."""
        return self.take(self.edges.located)


def concatenate_sweeps(*sweeps: Sweep) -> Sweep:
    """Return the samples of all sweeps of one kind."""
    values = {name: np.concatenate([sweep.values[name] for sweep in sweeps]) for name in sweeps[0].values}
    return Sweep(
        values, np.concatenate([sweep.locked for sweep in sweeps]), Edges.joined(sweep.edges for sweep in sweeps)
    )


@dataclass(frozen=True)
class Keep(KeptWork):
    """Folder in which finished parts of sweeps are saved until all are done; `parts` has them by name."""

    parts: dict[str, Edges] = field(default_factory=dict)

    sources = ("../friso_thesis/studies/guideline",)

    def part(self, name: str, make: Callable[[], Edges]) -> Edges:
        """Return the part of a sweep with this name; otherwise `make` and save it."""
        if name not in self.parts:
            columns = self.arrays((name,), lambda: _columns(make()), [column.name for column in fields(Edges)])
            self.parts[name] = Edges(**columns)
        return self.parts[name]


def _columns(edges: Edges) -> dict[str, np.ndarray]:
    return vars(edges) | {"kind": edges.kind.astype(str)}


def sobol_samples(box: Box, count: int, seed: int) -> dict[str, np.ndarray]:
    """Return Sobol samples in the ranges `box`, by dimensionless group, each of shape (count,)."""
    points = qmc.Sobol(len(box), rng=seed).random_base2(int(np.ceil(np.log2(max(count, 2)))))[:count]
    low, high = np.log(np.array(list(box.values()))).T
    return dict(zip(box, np.exp(low + points * (high - low)).T, strict=True))


def locked_sweep(count: int, seed: int, keep: Keep, tally: Tally) -> Sweep:
    """Return the edges of `count` samples of rigid masses; finished parts are stored by `keep`.

    A locked joint is almost a rigid mass: it differs only by the contact of its fixtures.
    """
    values = sobol_samples(LOCKED_BOX, count, seed)
    grid = np.broadcast_to(LOCKED_GRID, (count, len(LOCKED_GRID)))
    edges = _in_parts(f"locked {seed}", values, grid, keep, tally, LOCKED)
    return Sweep(values, edges.crossover, edges)


def free_sweep(count: int, seed: int, keep: Keep, tally: Tally, last: bool = True) -> tuple[Sweep, Sweep]:
    """Return the edges of samples with a free joint, and of all `count` with locked joints.

    The first result has only samples with a locked edge, because the frequency of the joint is chosen relative to it.
    Unless it is the `last` sweep of these samples, a part that a larger sweep will fill up is left out.
    """
    drawn_values = sobol_samples({**LOCKED_BOX, **JOINT_BOX}, count, seed)
    rigid = {name: drawn_values[name] for name in LOCKED_BOX}
    grid = np.broadcast_to(LOCKED_GRID, (count, len(LOCKED_GRID)))
    locked = _in_parts(f"locked beside free {seed}", rigid, grid, keep, tally, LOCKED)
    has = np.flatnonzero(locked.located)
    has = has if last or len(has) < PART_SAMPLES else has[: len(has) // PART_SAMPLES * PART_SAMPLES]
    values = {name: value[has] for name, value in drawn_values.items() if name != "ratio"}
    at = locked.crossover[has]
    values["joint"] = (drawn_values["ratio"][has] * at) ** 2
    edges = _in_parts(f"free {seed}", values, at[:, None] * FREE_GRID, keep, tally, FREE)
    return Sweep(values, at, edges), Sweep(rigid, locked.crossover, locked)


def _in_parts(
    name: str, values: Mapping[str, np.ndarray], grid: np.ndarray, keep: Keep, tally: Tally, label: str
) -> Edges:
    parts = []
    for first in range(0, len(grid), PART_SAMPLES):
        part = slice(first, min(first + PART_SAMPLES, len(grid)))
        subset = {group: value[part] for group, value in values.items()}
        title, done = f"{name} {first} {part.stop}", len(keep.parts)
        parts.append(keep.part(title, lambda subset=subset, part=part: find_edges(_stages(subset), grid[part])))
        if len(keep.parts) > done:
            tally.add(STEPS[label] * len(grid[part]), label)
    return Edges.joined(parts)


def _stages(values: Mapping[str, np.ndarray]) -> Callable[[np.ndarray, np.ndarray], Ensemble]:
    """Return a function that builds stages by the indices of samples and their crossovers.

    Crossovers are in units of sqrt(sigma_0/m).
    """

    def stages(which: np.ndarray, crossover: np.ndarray) -> Ensemble:
        subset = {name: value[which] for name, value in values.items()}
        return Ensemble.held(flat_of({**subset, "crossover": crossover}), len(which))

    return stages
