"""Model a deflected leaf as a curved beam.

Its 6 x 6 stiffness follows from the energy of unit loads at its end (Castigliano).
"""

from __future__ import annotations

import numpy as np

from friso.leaf_springs import plate
from friso.leaf_springs.closed_forms import SHEAR, axial, edgewise_shear
from friso.leaf_springs.mechanism import Mechanism
from friso.leaf_springs.settings import settings


def stage_stiffness_at(mechanism: Mechanism, deflection: float) -> np.ndarray:
    """Return the stiffness (6, 6) of the stage at its reference point, at a `deflection` [m].

    The stage is kept parallel. Elasticity is linear about the deflected shape. The forces that hold the shape are too
    small to matter as long as they are small against the buckling load.
    """
    leaf = leaf_stiffness(mechanism, deflection)
    stiffness = np.zeros((6, 6))
    for offset in mechanism.offsets:
        shift = np.eye(6)
        shift[0, 4], shift[1, 3] = offset, -offset
        stiffness += shift.T @ leaf @ shift
    return stiffness


def leaf_stiffness(mechanism: Mechanism, deflection: float) -> np.ndarray:
    """Return the stiffness matrix (6, 6) at the end of one deflected leaf.

    The leaf is bent by `deflection` [m] into the shape 3 s^2 - 2 s^3, s being the fraction of its length.
    """
    nodes, weights = np.polynomial.legendre.leggauss(settings.gauss_points)
    x, weight = (nodes + 1) / 2 * mechanism.length, weights / 2 * mechanism.length
    share = x / mechanism.length
    height, slope = deflection * (3 * share**2 - 2 * share**3), 6 * deflection / mechanism.length * (share - share**2)
    loads, (per, arc) = _resultants(mechanism, deflection, x, height, slope), _per(mechanism, x, weight, slope)
    compliance = np.einsum("pij,pik,pi,p->jk", loads, loads, per, arc)
    return np.linalg.inv(compliance)


def _per(mechanism: Mechanism, x: np.ndarray, weight: np.ndarray, slope: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the compliance of a short piece of a leaf, per force and moment, (points, 6).

    The piece is at a point x [m]. Also returned is the arc length, (points,), for which each point stands: its `weight`
    in the integral along x, lengthened by the `slope` of the leaf. All arguments have the shape (points,).
    """
    s = x - mechanism.length / 2
    sheared = 1 / (SHEAR * mechanism.shear * mechanism.area)
    shape, ends = (mechanism.length, mechanism.width, mechanism.poisson), 2 * s / mechanism.length
    compliance = (plate.cubic_twist(ends, *shape) * ends**3) @ weight
    free = plate.tilted(plate.free_twist(s, *shape) * weight, ends**3, ends, compliance) / weight
    twist = free / (mechanism.shear * plate.torsion_constant(mechanism.width, mechanism.thickness))
    curl = plate.compliance_profile(s, mechanism.length, mechanism.width, mechanism.poisson) / (
        mechanism.young * mechanism.bending
    )
    columns = (
        1 / axial(mechanism),
        1 / edgewise_shear(mechanism),
        sheared,
        twist,
        curl,
        1 / (mechanism.young * mechanism.edgewise),
    )
    return np.stack(np.broadcast_arrays(*columns), axis=1), weight * np.sqrt(1 + slope**2)


def _resultants(
    mechanism: Mechanism, deflection: float, x: np.ndarray, height: np.ndarray, slope: np.ndarray
) -> np.ndarray:
    """Return forces and moments at points of a leaf per unit load at its end, (points, 6, 6).

    They act along and about tangent, width and normal of the leaf. The points have the coordinate x [m], and the
    `height` [m] and `slope` of the deflected leaf, each of shape (points,).
    """
    cosine, sine = 1 / np.sqrt(1 + slope**2), slope / np.sqrt(1 + slope**2)
    turn = np.zeros((len(x), 3, 3))
    turn[:, 0, 0], turn[:, 0, 2], turn[:, 1, 1], turn[:, 2, 0], turn[:, 2, 2] = cosine, sine, 1.0, -sine, cosine
    arm_x, arm_z = mechanism.length - x, deflection - height
    moment = np.zeros((len(x), 3, 3))  # arm x force
    moment[:, 0, 1], moment[:, 1, 0], moment[:, 1, 2], moment[:, 2, 1] = -arm_z, arm_z, -arm_x, arm_x
    full = np.zeros((len(x), 6, 6))
    full[:, :3, :3] = turn
    full[:, 3:, :3] = turn @ moment
    full[:, 3:, 3:] = turn
    return full
