"""Define the two raced rigs: the thesis rig with its joint locked and free, at 8 Hz."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import friso
from friso.engine.kernel import Kernel, kernel
from friso.equations import motion
from friso.equations.structure import structure
from friso.stage import Stage

FILE = Path(__file__).parents[1] / "examples" / "thesis_rig.toml"
RTOLS = (1e-4, 1e-6)
SAMPLE = 1e-3
"""Interval [s] at which every method returns its trace."""


@dataclass(frozen=True)
class Rig:
    """A stage with its flat SI numbers, its kernel and what all methods share.

    `scales` (states,): absolute tolerance over rtol. `pieces` (pieces, 4): start [s] of each piece of the reference,
    and position [m], velocity and acceleration there.
    """

    name: str
    flat: Mapping[str, Any]
    kernel: Kernel
    scales: np.ndarray
    pieces: np.ndarray

    @property
    def duration(self) -> float:
        """Return the length of the run [s]."""
        return float(self.flat["motion.duration"])

    @property
    def grid(self) -> np.ndarray:
        """Return the sampling instants [s], shape (samples,).

        A corner of the reference replaces a nearby instant.
        """
        grid = np.arange(round(self.duration / SAMPLE) + 1) * SAMPLE
        for corner in self.pieces[1:, 0]:
            nearest = int(np.argmin(np.abs(grid - corner)))
            if abs(grid[nearest] - corner) < 1e-9:
                grid[nearest] = corner
        return grid

    @property
    def parameters(self) -> dict[str, float]:
        """Return the value [SI] of every parameter of the equations."""
        numbers = {**self.flat, "motion.size": motion.size(self.flat)}
        return {name: float(numbers[name]) for name in self.kernel.parameters}


def rig(locked: bool) -> Rig:
    """Return the thesis rig, locked or free."""
    stage = friso.load(FILE).replace({"joint.locked": locked, "controller.crossover": "8 Hz"})
    return rig_of(stage, "locked" if locked else "free")


def rig_of(stage: Stage, name: str = "") -> Rig:
    """Return the rig that a stage describes."""
    flat = stage.flat()
    shape = kernel(structure(flat))
    values = shape.values({**flat, "motion.size": motion.size(flat)}, 1)
    scales = np.array([float(np.ravel(scale)[0]) for scale in shape.module.scales(values)])
    return Rig(name, flat, shape, scales, motion.pieces(flat, 1)[0])
