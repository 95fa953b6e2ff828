"""Collect the results for a mechanism at a stroke, by any model."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from friso.leaf_springs.mechanism import Mechanism, along_motion
from friso.leaf_springs.naming import mode_name
from friso.leaf_springs.settings import settings


@dataclass(frozen=True)
class Mode:
    """A mode of the mechanism: its name, its frequency [Hz], and its displacements.

    Displacements are (count, 3) triples at unit modal mass [1/sqrt(kg)]. Those of the leaves have shape (leaves,
    points, 3), at even places from cart to stage. The stage's motion (6,) is a translation of its reference point, the
    middle of the leaf ends, and a rotation [1/m] about it.

    `actuator` and `sensor` [1/sqrt(kg)] tell how far the mode moves along the motion, where the actuator pushes and
    where the sensor measures. `peak` tells how far its resonance rises over the line of the stage's mass: their
    product, the residue, over 1/m of the stage's mass m and over 2 zeta.
    """

    name: str
    frequency: float
    actuator: float
    sensor: float
    peak: float
    stage: np.ndarray
    leaves: np.ndarray

    @classmethod
    def of(cls, mechanism: Mechanism, frequency: float, stage: np.ndarray, leaves: np.ndarray) -> Mode:
        """Build and name a mode from its frequency [Hz] and the motions of stage and leaves."""
        actuator, sensor = (
            float(along_motion(mechanism, point, stage[:, None])[0])
            for point in (mechanism.actuation, mechanism.sensor)
        )
        body, leaf_mass = mechanism.body, float(mechanism.leaf_mass)
        arm = np.subtract(body.centre, (mechanism.length, 0.0, 0.0)).astype(float)
        name = mode_name(stage, float(body.mass), body.inertia, arm, leaves, leaf_mass)
        peak = abs(actuator * sensor) * float(body.mass) / (2 * float(mechanism.damping_ratio))
        return cls(name, float(frequency), actuator, sensor, peak, stage, leaves)

    @property
    def interferes(self) -> bool:
        """Tell whether actuator and sensor both see the mode well enough to disturb control."""
        return self.peak > settings.visible_peak


@dataclass(frozen=True)
class Evaluation:
    """Results for a mechanism at deflections of its stage along the motion.

    `deflections` [m] run from 0 to the stroke, shape (n,). `forces` [N] hold the stage there. `drive` is the stiffness
    along the motion [N/m], with the stage otherwise free to shift and turn. `support_x` along the leaves and
    `support_y` along their width [N/m] are stiffnesses with all other coordinates fixed. All have shape (n,).

    `stiffness` (2, 6, 6) belongs to the stage at its reference point, the middle of the leaf ends, at deflection 0 and
    at full stroke. It relates forces [N] and moments [N m] along and about x, y, z to displacements [m] and rotations.
    `modes` are the modes at deflection 0, the drive mode first, then by frequency.

    At full stroke, `stress` is the largest bending stress [Pa] without the concentration at the clamp, and `shortening`
    how much the leaves shorten [m]. `buckling` is the load [N] along all leaves together at which the stage sways.
    """

    model: str
    mechanism: Mechanism
    deflections: np.ndarray
    forces: np.ndarray
    drive: np.ndarray
    support_x: np.ndarray
    support_y: np.ndarray
    stiffness: np.ndarray
    modes: tuple[Mode, ...]
    stress: float
    shortening: float
    buckling: float

    @property
    def stroke(self) -> float:
        """Return the largest deflection [m]."""
        return float(self.deflections[-1])

    @property
    def loaded_drive(self) -> float:
        """Return the drive stiffness [N/m] at deflection 0 under the load along the leaves.

        The stiffness vanishes at the buckling load.
        """
        return float(self.drive[0] * (1 - self.mechanism.load / self.buckling))

    @property
    def buckling_margin(self) -> float:
        """Return the buckling load over the load along the leaves.

        Without a load, the weight of the stage counts. The margin is infinite if the load pulls.
        """
        load = self.mechanism.load if self.mechanism.load else self.mechanism.weight
        return float(self.buckling / load) if load > 0 else np.inf

    @property
    def clamp_stress(self) -> float:
        """Return the stress [Pa] at full stroke times the concentration factor of the clamp."""
        return self.stress * self.mechanism.stress_concentration

    @property
    def nonlinearity(self) -> float:
        """Return the largest relative deviation of the force from a straight line through 0.

        The line has the stiffness at deflection 0.
        """
        linear = self.drive[0] * self.deflections
        return float(np.max(np.abs(self.forces[1:] / linear[1:] - 1)))

    @property
    def fatigue_margin(self) -> float:
        """Return the fatigue limit over the clamp stress at full stroke; NaN if unknown."""
        return self.mechanism.fatigue / self.clamp_stress

    @property
    def yield_margin(self) -> float:
        """Return the yield strength over the clamp stress at full stroke."""
        return self.mechanism.yield_strength / self.clamp_stress

    @property
    def interfering(self) -> Mode | None:
        """Return the lowest mode that interferes with control; None without one.

        The drive mode, on which control works, does not count.
        """
        return next((mode for mode in self.modes if self.interferes(mode)), None)

    def interferes(self, mode: Mode) -> bool:
        """Tell whether a mode disturbs control.

        The drive mode, on which control works, never does.
        """
        return mode.interferes and mode is not self.modes[0]

    @property
    def named_modes(self) -> dict[str, Mode]:
        """Return the modes by name in their order; repeated names are numbered."""
        counts: Counter[str] = Counter()
        named = {}
        for mode in self.modes:
            counts[mode.name] += 1
            named[mode.name if counts[mode.name] == 1 else f"{mode.name} ({counts[mode.name]})"] = mode
        return named
