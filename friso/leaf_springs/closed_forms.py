"""Evaluate mechanisms by closed forms, and derive joint stiffness and parasitic mode of the equations of motion.

Sources: Soemers, Design Principles for Precision Mechanisms (2010), ch. 2; Awtar, Slocum & Sevincer (2007),
doi:10.1115/1.2717231, for the deflected leaf; mechanism.py for the effect of clamps on a wide leaf.

Stiffness in N/m, forces in N, lengths in m, frequencies in Hz. Arrays have one shape throughout, for one or for a
million geometries at once.

At a stroke, one mechanism is evaluated: a deflected leaf is a curved beam, whose 6 x 6 stiffness follows from the
energy of unit loads (Castigliano).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from friso.errors import InputError
from friso.leaf_springs import mechanism as plate
from friso.leaf_springs.mechanism import VISIBLE_PEAK, Evaluation, Mechanism, Mode, along_motion
from friso.stage.flexure import register_derivation

SHEAR_COEFFICIENT = 5 / 6
"""Fraction of a rectangle's area that carries shear (Timoshenko's coefficient)."""

CLAMPED_ROOT = 4.730040744862704
"""First root of cos x cosh x = 1: a beam between clamps."""

WITH_STAGE, WITH_TURN = 0.41543076162434, 0.08939232481715
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


CLOSED_DEFLECTIONS = 5
"""Deflections of the closed forms, as many as of beams, for one table."""


def closed_form_model(mechanism: Mechanism, stroke: float) -> Evaluation:
    """Evaluate the mechanism by closed forms over its stroke [m].

    The drive stiffness is equal at all deflections.
    """
    deflections = np.linspace(0.0, stroke, CLOSED_DEFLECTIONS)
    drive = drive_stiffness(mechanism) * np.ones(CLOSED_DEFLECTIONS)
    return Evaluation(
        model="closed forms",
        mechanism=mechanism,
        deflections=deflections,
        forces=drive * deflections,
        drive=drive,
        support_x=support_x(mechanism, deflections),
        support_y=support_y(mechanism, deflections),
        stiffness=np.array([stage_stiffness_at(mechanism, deflection) for deflection in (0.0, stroke)]),
        modes=_modes(mechanism),
        stress=float(max_stress(mechanism, stroke)),
        shortening=float(shortening(mechanism, stroke)),
        buckling=float(buckling_load(mechanism)),
    )


def _modes(mechanism: Mechanism) -> tuple[Mode, ...]:
    """Return the modes of stage and leaves by closed forms.

    In some modes the leaves bend in phase with the stage; in the others they move while the stage is at rest.
    """
    frequencies, shapes = modes(mechanism)
    drive = int(drive_mode(frequencies, shapes))
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


MODE_SHAPE_POINTS = 17
"""Points of a mode shape, enough to draw the third bending mode smoothly."""


def following(mechanism: Mechanism, stage: np.ndarray) -> np.ndarray:
    """Return how the leaves' middle lines follow a motion of the stage, (leaves, POINTS, 3).

    The motion has shape (6,), and the leaves follow statically.
    """
    s = np.linspace(0.0, 1.0, MODE_SHAPE_POINTS)
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
        leaves = np.zeros((count, MODE_SHAPE_POINTS, 3))
        leaves[:, :, 2] = wave[:, None] * _clamped_shape() / np.sqrt(leaf_mass * np.sum(wave**2))
        frequency = float(leaf_bending(mechanism))
        modes.append(Mode("leaf bending, out of phase", frequency, 0.0, 0.0, 0.0, np.zeros(6), leaves))
    return modes


def _clamped_shape() -> np.ndarray:
    """Return the first bending mode of a clamped beam at even places, with mean square 1."""
    x = CLAMPED_ROOT * np.linspace(0.0, 1.0, MODE_SHAPE_POINTS)
    ratio = (np.cosh(CLAMPED_ROOT) - np.cos(CLAMPED_ROOT)) / (np.sinh(CLAMPED_ROOT) - np.sin(CLAMPED_ROOT))
    return np.cosh(x) - np.cos(x) - ratio * (np.sinh(x) - np.sin(x))


def _torsion_mode(mechanism: Mechanism) -> Mode:
    """Return the first torsional mode of the leaves, whose middle lines stay at rest."""
    leaves = np.zeros((int(mechanism.leaves), MODE_SHAPE_POINTS, 3))
    return Mode("leaf torsion", float(leaf_torsion(mechanism)), 0.0, 0.0, 0.0, np.zeros(6), leaves)


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


GAUSS_POINTS = 48
"""Points of integration along a curved leaf, which are exact to rounding."""


def leaf_stiffness(mechanism: Mechanism, deflection: float) -> np.ndarray:
    """Return the stiffness matrix (6, 6) at the end of one deflected leaf.

    The leaf is bent by `deflection` [m] into the shape 3 s^2 - 2 s^3, s being the fraction of its length.
    """
    nodes, weights = np.polynomial.legendre.leggauss(GAUSS_POINTS)
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


@register_derivation("flexure")
def joint_keys(flat: Mapping[str, Any]) -> dict[str, Any]:
    """Return `joint.stiffness` and the keys of [parasitic] for leaf springs in closed form.

    Raises InputError if a single mechanism buckles under its load.
    """
    with np.errstate(all="ignore"):  # the rules of the stage file find numbers that make no mechanism
        mechanism = Mechanism.of(flat)
        frequency, share = parasitic_mode(mechanism)
        stiffness, buckling = loaded_drive_stiffness(mechanism), buckling_load(mechanism)
    if np.ndim(stiffness) == 0 and mechanism.load >= buckling > 0:
        expected = f"less than the buckling load of the leaves, {float(buckling):.4g} N"
        example = f'load = "{float(buckling) / 3:.2g} N"'
        raise InputError("flexure.load", f"{float(mechanism.load):.4g} N", expected, example)
    keys = {
        "joint.stiffness": stiffness,
        "parasitic.frequency": frequency,
        "parasitic.mass": share / (1 + share) * mechanism.body.mass,
        "parasitic.damping_ratio": mechanism.damping_ratio,
    }
    return {key: value if np.ndim(value) else float(value) for key, value in keys.items()}


@dataclass(frozen=True)
class VisibleModes:
    """All modes of mechanisms except their drive mode, as arrays of shape (..., 7).

    `frequency` is in Hz; `residue` is the residue times the mass of the stage, positive where actuator and sensor move
    in phase. Residues are 0 at the drive mode. `visible` marks the modes that actuator and sensor both see.
    """

    frequency: np.ndarray
    residue: np.ndarray
    visible: np.ndarray

    @classmethod
    def of(cls, mechanism: Mechanism) -> VisibleModes:
        """Compute the modes by closed forms, and decide which of them are visible."""
        frequency, shapes = modes(mechanism)
        pushed, measured = (along_motion(mechanism, at, shapes) for at in (mechanism.actuation, mechanism.sensor))
        internal = np.arange(7) != drive_mode(frequency, shapes)[..., None]
        residue = np.where(internal, pushed * measured * np.asarray(mechanism.body.mass)[..., None], 0.0)
        least = VISIBLE_PEAK * 2 * np.asarray(mechanism.damping_ratio)[..., None]
        return cls(frequency, residue, np.abs(residue) > least)

    def at(self, mode: np.ndarray) -> tuple[Any, Any]:
        """Return frequency [Hz] and residue of the mode with number `mode`, all of shape (...).

        For a mechanism without any visible mode the frequency is infinite and the residue 0.
        """
        both = ((self.frequency, np.inf), (self.residue, 0.0))
        visible, at = self.visible.any(axis=-1), mode[..., None]
        frequency, residue = (
            np.where(visible, np.take_along_axis(quantity, at, axis=-1)[..., 0], none)[()] for quantity, none in both
        )
        return frequency, residue


def first_interfering(mechanism: Mechanism) -> Any:
    """Return the frequency [Hz] of the lowest mode that disturbs control; infinite without one.

    Actuator and sensor both see the mode, and it is not the drive mode.
    """
    visible = VisibleModes.of(mechanism)
    return visible.at(np.argmin(np.where(visible.visible, visible.frequency, np.inf), axis=-1))[0]


LEAST_RESIDUE = 1e-9
"""Least residue of a parasitic mode, because the equations need a mass above 0."""


def parasitic_mode(mechanism: Mechanism) -> tuple[Any, Any]:
    """Return frequency [Hz] and residue of the mode whose resonance stands highest in the plant.

    Residues are multiplied by the stage's mass. The mode has the largest residue over the square of its frequency. If
    no mode is visible, the leaves' own mode is returned with the least residue that the equations allow.

    In the equations, a part m_p of the stage's mass m moves on a spring, which gives the residue m_p/(m (m - m_p)). It
    is never negative. If actuator and sensor move against each other, only the size of the residue counts.
    """
    visible = VisibleModes.of(mechanism)
    height = np.where(visible.visible, np.abs(visible.residue), 0.0) / np.maximum(visible.frequency, 1e-9) ** 2
    frequency, residue = visible.at(np.argmax(height, axis=-1))
    leaves = leaf_bending(mechanism)
    size = np.maximum(np.abs(residue), LEAST_RESIDUE)
    return np.where(np.isfinite(frequency), frequency, leaves)[()], size[()]
