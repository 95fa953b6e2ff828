"""Evaluate the mechanism by closed forms, for one or for a million geometries at once.

Sources: Soemers, Design Principles for Precision Mechanisms (2010), ch. 2; Awtar, Slocum & Sevincer (2007),
doi:10.1115/1.2717231, for the deflected leaf; plate.py for the effect of clamps on a wide leaf. Stiffness in N/m,
forces in N, lengths in m, frequencies in Hz; arrays of one shape throughout.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from friso.leaf_springs import plate
from friso.leaf_springs.mechanism import Mechanism

SHEAR_COEFFICIENT = 5 / 6
"""Fraction of a rectangle's area that carries shear (Timoshenko's coefficient)."""

CLAMPED_ROOT = 4.730040744862704
"""First root of cos x cosh x = 1: a beam between clamps."""

WITH_STAGE, WITH_TURN = 0.41543, 0.08939
"""Mean over a leaf of its first bending mode, which has mean square 1, times a static shape of the leaf: the shape when
the stage moves along the motion, and the shape when it turns about the width (per length of the leaf)."""

LATERAL_BUCKLING = 9.229
"""Force across the end of a leaf, over sqrt(E I G J)/L^2, at which the leaf gives way sideways: it twists and bends.
theta'' = -p^2 m (m theta - mean of m theta), m = 1 - x/L, theta = 0 at both clamps, the stage free to follow."""


def drive_stiffness(mechanism: Mechanism) -> Any:
    """Return the stiffness along the motion [N/m] while the stage stays parallel.

    It is 12 E I/L^3 for each leaf, times the factor by which a plate is stiffer than a beam.
    """
    beam = 12 * mechanism.young * mechanism.bending / mechanism.length**3
    return mechanism.leaves * beam * plate.stiffening(*mechanism.plate_shape)


def loaded_drive_stiffness(mechanism: Mechanism) -> Any:
    """Return the stiffness along the motion [N/m] under the load along the leaves.

    The stiffness vanishes at the buckling load.
    """
    return drive_stiffness(mechanism) * (1 - mechanism.load / buckling_load(mechanism))


def axial(mechanism: Mechanism) -> Any:
    """Return E A of a leaf [N], its stiffness against stretching, stiffened by its clamps."""
    return mechanism.young * mechanism.area * plate.stretching(*mechanism.plate_shape)


def edgewise_shear(mechanism: Mechanism) -> Any:
    """Return the shear stiffness of a leaf in its plane, 5/6 G A [N], stiffened by its clamps."""
    return SHEAR_COEFFICIENT * mechanism.shear * mechanism.area * plate.edgewise_shear_factor(*mechanism.plate_shape)


def support_x(mechanism: Mechanism, deflection: Any = 0.0) -> Any:
    """Return the stiffness along the leaves [N/m] while all other coordinates are held.

    The stiffness falls as the leaves deflect, because leaves under a `deflection` [m] bend under the force. Leaves
    count as plates.
    """
    straight = mechanism.leaves * axial(mechanism) / mechanism.length
    stiffened = plate.stiffening(*mechanism.plate_shape)
    return straight / (1 + 12 / 700 * (deflection / mechanism.thickness) ** 2 / stiffened)


def support_y(mechanism: Mechanism, deflection: Any = 0.0) -> Any:
    """Return the stiffness along the width [N/m] while all other coordinates are held.

    The stiffness contains bending and shear in the plane of the leaves. A force across a leaf under a `deflection` [m],
    delta, also twists it: the torque is 4 delta (s/L)^3 per force, with s from its middle. The clamps, which forbid
    warping, reduce this twist.
    """
    bent = mechanism.length**3 / (12 * mechanism.young * mechanism.edgewise)
    sheared = mechanism.length / edgewise_shear(mechanism)
    twisted = deflection**2 * mechanism.length / (28 * mechanism.torsional_rigidity) * _cubic_twist(mechanism)
    return mechanism.leaves / (bent + sheared + twisted)


def _cubic_twist(mechanism: Mechanism) -> Any:
    """Return the torsional compliance relative to free warping, for a torque that goes with s^3.

    The rate of twist p solves p - p''/rate^2 = s^3, with p = 0 at the clamps: p = s^3 + 6 s/rate^2 - A sinh(rate s).
    """
    half = plate.warping_rate(mechanism.width, mechanism.poisson) * mechanism.length / 2
    free = half**7 / 7
    end = half**3 + 6 * half
    decay = half**3 / np.tanh(half) - 3 * half**2 + 6 * half / np.tanh(half) - 6
    return (free + 6 * half**5 / 5 - end * decay) / free


def max_stress(mechanism: Mechanism, deflection: Any) -> Any:
    """Return the largest bending stress [Pa] at the clamps; for a beam, 3 E t delta/L^2."""
    beam = 3 * mechanism.young * mechanism.thickness * deflection / mechanism.length**2
    return beam * plate.stress_factors(*mechanism.plate_shape)[1]


def shortening(mechanism: Mechanism, deflection: Any) -> Any:
    """Return how much closer the stage comes to the cart: 3 delta^2/(5 L)."""
    return 3 * deflection**2 / (5 * mechanism.length)


def buckling_load(mechanism: Mechanism) -> Any:
    """Return the load [N] along all leaves together at which the stage sways.

    It is pi^2 E I/L^2 for each leaf, times the factor by which a plate is stiffer than a beam.
    """
    euler = mechanism.leaves * np.pi**2 * mechanism.young * mechanism.bending / mechanism.length**2
    return euler * _mode_stiffening(mechanism)


def leaf_bending(mechanism: Mechanism) -> Any:
    """Return the frequency [Hz] of the first bending mode of a leaf between its clamps.

    It is 1.028 t/L^2 sqrt(E/rho), raised because a plate is stiffer than a beam.
    """
    speed = np.sqrt(mechanism.young * mechanism.bending / (mechanism.density * mechanism.area))
    return CLAMPED_ROOT**2 / (2 * np.pi * mechanism.length**2) * speed * np.sqrt(_mode_stiffening(mechanism))


def _mode_stiffening(mechanism: Mechanism) -> Any:
    """Return the factor by which a plate is stiffer than a beam in its bending modes.

    The factor for parallel motion is used, whose moments change sign along the leaf. In a mode, moments of equal sign
    occur mainly far from the clamps and have little influence.
    """
    return plate.stiffening(*mechanism.plate_shape)


def leaf_torsion(mechanism: Mechanism) -> Any:
    """Return the frequency [Hz] of the first torsional mode of a leaf between its clamps.

    The frequency follows from Rayleigh's quotient for the twist under a constant torque along the leaf.
    """
    rate = plate.warping_rate(mechanism.width, mechanism.poisson)
    nodes, weights = np.polynomial.legendre.leggauss(24)
    half = np.asarray(rate * mechanism.length / 2)[..., None]
    s = nodes * half
    twist = (half**2 - s**2) / 2 - half * (np.cosh(half) - np.cosh(s)) / np.sinh(half)
    quotient = (twist @ weights) / (twist**2 @ weights)
    rigidity = mechanism.young * mechanism.thickness**2 / (12 * (1 - mechanism.poisson**2))
    return rate**2 * np.sqrt(quotient * rigidity / mechanism.density) / (2 * np.pi)


def lateral_load(mechanism: Mechanism) -> Any:
    """Return the force [N] along the leaves' width at which they give way sideways.

    The force acts at the leaf ends, on all leaves together.
    """
    rigidity = np.sqrt(mechanism.young * mechanism.bending * mechanism.torsional_rigidity)
    return mechanism.leaves * LATERAL_BUCKLING * rigidity / mechanism.length**2


def stage_stiffness(mechanism: Mechanism) -> np.ndarray:
    """Return the stiffness of the undeflected stage at its reference point, shape (..., 6, 6)."""
    odd, even = (plate.stiffening(*mechanism.plate_shape, parity) for parity in (True, False))
    bending = mechanism.young * mechanism.bending / mechanism.length
    edgewise = mechanism.young * mechanism.edgewise / mechanism.length
    sheared = 12 * edgewise / (edgewise_shear(mechanism) * mechanism.length)
    parallel, half = 12 * edgewise / mechanism.length**2 / (1 + sheared), mechanism.length / 2
    along = axial(mechanism) / mechanism.length
    length, width, poisson = mechanism.plate_shape
    twist = plate.torsion_stiffness(length, width, mechanism.thickness, mechanism.shear, poisson)
    spread = mechanism.offset_squares
    return _symmetric(
        mechanism,
        {
            (0, 0): mechanism.leaves * along,
            (1, 1): mechanism.leaves * parallel,
            (2, 2): mechanism.leaves * 12 * bending * odd / mechanism.length**2,
            (3, 3): mechanism.leaves * twist + parallel * spread,
            (4, 4): mechanism.leaves * bending * (3 * odd + even) + along * spread,
            (5, 5): mechanism.leaves * (parallel * half**2 + edgewise),
            (2, 4): mechanism.leaves * 6 * bending * odd / mechanism.length,
            (1, 5): -mechanism.leaves * parallel * half,
        },
    )


def stage_mass(mechanism: Mechanism) -> np.ndarray:
    """Return the mass of stage and leaves at the reference point, shape (..., 6, 6).

    The leaves follow the stage statically.
    """
    leaf, length, spread = mechanism.leaf_mass, mechanism.length, mechanism.offset_squares
    leaves = _symmetric(
        mechanism,
        {
            (0, 0): mechanism.leaves * leaf / 3,
            (1, 1): mechanism.leaves * leaf * 13 / 35,
            (2, 2): mechanism.leaves * leaf * 13 / 35,
            (3, 3): mechanism.leaves * leaf * mechanism.width**2 / 36 + leaf * spread * 13 / 35,
            (4, 4): mechanism.leaves * leaf * length**2 / 105 + leaf * spread / 3,
            (5, 5): mechanism.leaves * leaf * length**2 / 105,
            (2, 4): mechanism.leaves * leaf * length * 11 / 210,
            (1, 5): -mechanism.leaves * leaf * length * 11 / 210,
        },
    )
    return leaves + body_mass(mechanism)


def body_mass(mechanism: Mechanism) -> np.ndarray:
    """Return the mass of the rigid stage alone at its reference point, shape (..., 6, 6)."""
    mass = mechanism.body.mass
    x, y, z = mechanism.body.centre[0] - mechanism.length, mechanism.body.centre[1], mechanism.body.centre[2]
    inertia = mechanism.body.inertia
    return _symmetric(
        mechanism,
        {
            (0, 0): mass,
            (1, 1): mass,
            (2, 2): mass,
            (3, 3): inertia[0] + mass * (y**2 + z**2),
            (4, 4): inertia[1] + mass * (x**2 + z**2),
            (5, 5): inertia[2] + mass * (x**2 + y**2),
            (3, 4): -mass * x * y,
            (3, 5): -mass * x * z,
            (4, 5): -mass * y * z,
            (0, 4): mass * z,
            (0, 5): -mass * y,
            (1, 3): -mass * z,
            (1, 5): mass * x,
            (2, 3): mass * y,
            (2, 4): -mass * x,
        },
    )


def _symmetric(mechanism: Mechanism, entries: dict[tuple[int, int], Any]) -> np.ndarray:
    """Build symmetric matrices, shape (..., 6, 6), from their entries by (row, column).

    The entries are on or above the diagonal; all others are 0.
    """
    shape = np.broadcast_shapes(*(np.shape(entry) for entry in entries.values()), np.shape(mechanism.length))
    matrices = np.zeros((*shape, 6, 6))
    for (i, k), entry in entries.items():
        matrices[..., i, k] = matrices[..., k, i] = entry
    return matrices


def modes(mechanism: Mechanism) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies [Hz], (..., 7), and mode shapes (..., 7, 7) of stage and leaves.

    Frequencies ascend. Shapes stand in columns at unit modal mass. Six coordinates are the stage's. The seventh is the
    first bending mode of all leaves in phase, at its unit modal mass. Besides, the leaves follow the stage statically
    (Craig & Bampton 1968, doi:10.2514/3.4741). Frequencies are NaN for numbers that make no mechanism.
    """
    mass, stiffness = stage_mass(mechanism), stage_stiffness(mechanism)
    mass, stiffness = (np.pad(matrix, [(0, 0)] * (matrix.ndim - 2) + [(0, 1), (0, 1)]) for matrix in (mass, stiffness))
    together = np.sqrt(mechanism.leaves * mechanism.leaf_mass)
    for coordinate, coupling in ((2, WITH_STAGE * together), (4, WITH_TURN * together * mechanism.length)):
        mass[..., coordinate, 6] = mass[..., 6, coordinate] = coupling
    mass[..., 6, 6] = 1.0
    stiffness[..., 6, 6] = (2 * np.pi * leaf_bending(mechanism)) ** 2
    possible = np.isfinite(mass + stiffness).all(axis=(-2, -1)) & (np.einsum("...ii->...i", mass) > 0).all(axis=-1)
    factor = np.linalg.cholesky(np.where(possible[..., None, None], mass, np.eye(7)))
    inverse = np.linalg.inv(factor)
    turned = np.swapaxes(inverse, -1, -2)
    squares, vectors = np.linalg.eigh(inverse @ np.where(possible[..., None, None], stiffness, 0.0) @ turned)
    frequencies = np.sqrt(np.maximum(squares, 0)) / (2 * np.pi)
    return np.where(possible[..., None], frequencies, np.nan), turned @ vectors


def drive_mode(frequencies: np.ndarray, shapes: np.ndarray) -> np.ndarray:
    """Return the number of the drive mode, which yields most to a steady force along the motion.

    `frequencies` [Hz] have shape (..., modes), and shapes (..., 7, modes).
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.argmax(np.nan_to_num((shapes[..., 2, :] / frequencies) ** 2, posinf=np.inf), axis=-1)
