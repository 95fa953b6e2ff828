"""Collect the results for a mechanism at a stroke, by any model.

Modes are named by the part with the largest fraction of the kinetic energy.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from friso.leaf_springs.mechanism import Mechanism, along_motion
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


STAGE = ("stage along x", "stage along y", "drive", "stage about x", "stage about y", "stage about z")
"""Names by the motion of the stage."""


def mode_name(
    stage: np.ndarray,
    mass: float,
    inertia: Sequence[float] | np.ndarray,
    arm: np.ndarray,
    leaves: np.ndarray,
    leaf_mass: float,
) -> str:
    """Return the name of a mode at unit modal mass.

    `stage` (6,) is the motion of the stage at its reference point, the middle of the leaf ends: translations, then
    rotations. `mass` [kg] and `inertia` [kg m^2] (3,) are the stage's, about its centre of mass. The centre lies `arm`
    [m] (3,) away from the reference point.

    `leaves` (leaves, points, 3) are displacements of the middle lines at even places from cart to stage. `leaf_mass`
    [kg] is the mass of one leaf. The remaining energy counts as torsion of the leaves.
    """
    speed = stage[:3] + np.cross(stage[3:], arm)
    energies = np.concatenate([mass * speed**2, np.asarray(inertia, dtype=float) * stage[3:] ** 2])
    _, y, z = leaf_mass * np.sum(_mean(leaves**2), axis=0)
    shares = {
        **dict(zip(STAGE, energies, strict=True)),
        "leaf bending": z,
        "leaf in-plane bending": y,
        "leaf torsion": 1 - energies.sum() - y - z,
    }
    name = max(shares, key=shares.__getitem__)
    if name == "drive" and stage[2] ** 2 < speed[2] ** 2 / 2:
        return STAGE[3 + int(np.argmax(energies[3:5]))]
    if name == "leaf bending":
        ripples = _dynamic_part(leaves[:, :, 2])
        # fraction that is common to all leaves
        alike = len(leaves) * np.sum(np.mean(ripples, axis=0) ** 2) / np.sum(ripples**2)
        return f"leaf bending, {'in' if alike > 0.5 else 'out of'} phase{_number(ripples)}"
    if name == "leaf in-plane bending":
        return name + _number(_dynamic_part(leaves[:, :, 1]))
    return name


def _mean(values: np.ndarray) -> np.ndarray:
    """Return the mean over the points along the leaves, axis 1, by the trapezoidal rule."""
    return (values[:, 1:] + values[:, :-1]).mean(axis=1) / 2


def _dynamic_part(shapes: np.ndarray) -> np.ndarray:
    """Return the shapes (leaves, points) without their static part.

    The static part is the shape of leaves that follow a shift of the stage.
    """
    x = np.linspace(0, 1, shapes.shape[1])
    return shapes - np.outer(shapes[:, -1], x**2 * (3 - 2 * x))


def _number(shapes: np.ndarray) -> str:
    """Return the number of waves of a mode as a suffix of its name; "" for one wave.

    `shapes` (leaves, points) are displacements. Waves are counted on the leaf that moves most.
    """
    shape = shapes[np.argmax(np.sum(shapes**2, axis=1))]
    signs = np.sign(shape[np.abs(shape) > settings.shape_ripple * np.max(np.abs(shape))])
    waves = 1 + int(np.sum(signs[1:] != signs[:-1]))
    return "" if waves == 1 else f" {waves}"
