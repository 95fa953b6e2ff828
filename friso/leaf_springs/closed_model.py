"""Evaluate one mechanism at a stroke by closed forms.

A deflected leaf is a curved beam, whose 6 x 6 stiffness follows from the energy of unit loads (Castigliano).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from friso.leaf_springs import closed_forms, plate
from friso.leaf_springs.closed_forms import CLAMPED_ROOT, SHEAR_COEFFICIENT, axial, edgewise_shear
from friso.leaf_springs.evaluation import Evaluation, Mode
from friso.leaf_springs.mechanism import Mechanism
from friso.leaf_springs.settings import settings


def closed_form_model(mechanism: Mechanism, stroke: float) -> Evaluation:
    """Evaluate the mechanism by closed forms over its stroke [m].

    The drive stiffness is equal at all deflections.
    """
    deflections = np.linspace(0.0, stroke, settings.closed_deflections)
    drive = closed_forms.drive_stiffness(mechanism) * np.ones(settings.closed_deflections)
    return Evaluation(
        model="closed forms",
        mechanism=mechanism,
        deflections=deflections,
        forces=drive * deflections,
        drive=drive,
        support_x=closed_forms.support_x(mechanism, deflections),
        support_y=closed_forms.support_y(mechanism, deflections),
        stiffness=np.array([stage_stiffness_at(mechanism, deflection) for deflection in (0.0, stroke)]),
        modes=_modes(mechanism),
        stress=float(closed_forms.max_stress(mechanism, stroke)),
        shortening=float(closed_forms.shortening(mechanism, stroke)),
        buckling=float(closed_forms.buckling_load(mechanism)),
    )


def _modes(mechanism: Mechanism) -> tuple[Mode, ...]:
    """Return the modes of stage and leaves by closed forms.

    In some modes the leaves bend in phase with the stage; in the others they move while the stage is at rest.
    """
    frequencies, shapes = closed_forms.modes(mechanism)
    drive = int(closed_forms.drive_mode(frequencies, shapes))
    first = replace(_mode(mechanism, frequencies[drive], shapes[:, drive]), name="drive")
    others = [_mode(mechanism, frequencies[k], shapes[:, k]) for k in range(7) if k != drive]
    return (first, *sorted([*others, *_unlike(mechanism), _torsion_mode(mechanism)], key=lambda mode: mode.frequency))


def _mode(mechanism: Mechanism, frequency: float, shape: np.ndarray) -> Mode:
    """Build a mode from its frequency [Hz] and its shape at unit modal mass, (7,).

    The shape has the stage's six coordinates, then the bending of the leaves.
    """
    stage, leaves = shape[:6], following(mechanism, shape[:6])
    leaves[:, :, 2] += shape[6] / np.sqrt(mechanism.leaves * mechanism.leaf_mass) * _clamped_shape()
    return Mode.of(mechanism, frequency, stage, leaves)


def following(mechanism: Mechanism, stage: np.ndarray) -> np.ndarray:
    """Return how the leaves' middle lines follow a motion of the stage, (leaves, POINTS, 3).

    The motion has shape (6,), and the leaves follow statically.
    """
    s = np.linspace(0.0, 1.0, settings.mode_shape_points)
    by_place, by_slope = 3 * s**2 - 2 * s**3, mechanism.length * (s**3 - s**2)
    x, y, z, turn_x, turn_y, turn_z = stage
    return np.array(
        [
            np.stack(
                [
                    (x + turn_y * offset) * s,
                    (y - turn_x * offset) * by_place + turn_z * by_slope,
                    z * by_place - turn_y * by_slope,
                ],
                axis=1,
            )
            for offset in mechanism.offsets
        ]
    )


def _unlike(mechanism: Mechanism) -> list[Mode]:
    """Return the modes in which the leaves bend against each other, with the stage at rest."""
    count, leaf_mass = int(mechanism.leaves), float(mechanism.leaf_mass)
    modes = []
    for k in range(1, count):
        wave = np.cos(np.pi * k * (np.arange(count) + 0.5) / count)  # patterns of the leaves, orthogonal to each other
        leaves = np.zeros((count, settings.mode_shape_points, 3))
        leaves[:, :, 2] = wave[:, None] * _clamped_shape() / np.sqrt(leaf_mass * np.sum(wave**2))
        frequency = float(closed_forms.leaf_bending(mechanism))
        modes.append(Mode("leaf bending, out of phase", frequency, 0.0, 0.0, 0.0, np.zeros(6), leaves))
    return modes


def _clamped_shape() -> np.ndarray:
    """Return the first bending mode of a clamped beam at even places, with mean square 1."""
    x = CLAMPED_ROOT * np.linspace(0.0, 1.0, settings.mode_shape_points)
    ratio = (np.cosh(CLAMPED_ROOT) - np.cos(CLAMPED_ROOT)) / (np.sinh(CLAMPED_ROOT) - np.sin(CLAMPED_ROOT))
    return np.cosh(x) - np.cos(x) - ratio * (np.sinh(x) - np.sin(x))


def _torsion_mode(mechanism: Mechanism) -> Mode:
    """Return the first torsional mode of the leaves, whose middle lines stay at rest."""
    leaves = np.zeros((int(mechanism.leaves), settings.mode_shape_points, 3))
    return Mode("leaf torsion", float(closed_forms.leaf_torsion(mechanism)), 0.0, 0.0, 0.0, np.zeros(6), leaves)


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
    sheared = 1 / (SHEAR_COEFFICIENT * mechanism.shear * mechanism.area)
    shape, ends = mechanism.plate_shape, 2 * s / mechanism.length
    compliance = (plate.cubic_twist(ends, *shape) * ends**3) @ weight
    free = plate.tilted(plate.free_twist(s, *shape) * weight, ends**3, ends, compliance) / weight
    twist = free / (mechanism.torsional_rigidity)
    curl = plate.compliance_profile(s, *mechanism.plate_shape) / (mechanism.young * mechanism.bending)
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
