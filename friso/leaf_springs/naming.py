"""Name modes by the part with the largest fraction of the kinetic energy."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from friso.leaf_springs.settings import settings

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
