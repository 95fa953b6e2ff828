"""Model the mechanism as geometrically exact beams (exudyn), nonlinear over the stroke.

The stage is pushed along z. Leaves and stage then move in the x-z plane alone. The stiffness of the deflected mechanism
has all six coordinates: three in the plane (x, z, about y) and three across it (y, about x, about z), which stay
independent. Nodes between cart and stage are eliminated leaf by leaf.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from friso.leaf_springs import closed_forms, plate
from friso.leaf_springs.beam_modes import Reduced, buckling_load, modes
from friso.leaf_springs.beam_system import LEAF_ELEMENTS, BeamFailure, Condensed, Configuration, LeafBeams
from friso.leaf_springs.evaluation import Evaluation
from friso.leaf_springs.mechanism import Mechanism
from friso.leaf_springs.settings import settings

PLANE, ACROSS = slice(0, None, 2), slice(1, None, 2)
"""Coordinates of the stage in the plane of motion, and across it, as slices of six."""


@dataclass(frozen=True)
class HeldEquilibrium:
    """Equilibrium of leaves and stage with the stage held at a deflection z.

    `place` is the configuration, and `rate` its change per z. `force` [N] holds the stage along z, and `stiffness` (6,
    6) is the tangent stiffness of the stage.
    """

    place: Configuration
    rate: Configuration
    force: float
    stiffness: np.ndarray


def beams(mechanism: Mechanism, stroke: float, elements: int = LEAF_ELEMENTS) -> Evaluation:
    """Evaluate the mechanism at even deflections up to the stroke [m], 5 by default.

    Raises BeamFailure where the mechanism has no equilibrium, or has numbers that are not positive.
    """
    _check(mechanism, stroke)
    try:
        with np.errstate(all="ignore"):  # Leaves finds results that are no numbers
            return _evaluate(mechanism, float(stroke), LeafBeams(mechanism, elements))
    except BeamFailure:
        raise
    except (ValueError, ArithmeticError, RuntimeError) as error:  # errors of numpy, scipy and exudyn
        cause = str(error).strip().splitlines() or [type(error).__name__]
        raise BeamFailure(f"The beams have no unique equilibrium or modes: {cause[0]}") from error


def _check(mechanism: Mechanism, stroke: float) -> None:
    """Check that dimensions, material and stroke [m] are positive and finite.

    Raises BeamFailure for the first that is not.
    """
    dimensions = {name: getattr(mechanism, name) for name in ("length", "width", "thickness", "young", "density")}
    dimensions |= {"leaves": mechanism.leaves, "mass of the stage": mechanism.body.mass, "stroke": stroke}
    for name, value in dimensions.items():
        if not 0 < float(value) < np.inf:
            raise BeamFailure(f"The beams need a positive {name}, not {float(value):.6g}.")


def _evaluate(mechanism: Mechanism, stroke: float, leaves: LeafBeams) -> Evaluation:
    """Evaluate the mechanism at several deflections up to the stroke [m], and its modes at rest."""
    deflections = np.linspace(0, stroke, settings.beam_deflections)
    rest = Configuration.rest(leaves)
    straight = np.repeat(leaves.stiffness(rest.state(mechanism.offsets)[:1]), leaves.count, axis=0)
    unloaded = np.zeros((leaves.count, leaves.nodes, 6))
    held = [_held(mechanism, rest, _condensed(mechanism, rest, straight, unloaded), straight, unloaded)]
    for z in deflections[1:]:
        held.append(_pushed(mechanism, leaves, held, z))
    stiffness = np.array([state.stiffness for state in held])
    mean, largest = plate.stress_factors(*mechanism.plate_shape)
    moment = np.max(np.abs(leaves.forces(held[-1].place.state(mechanism.offsets))[:, [0, -1], 4]))
    return Evaluation(
        model="beams",
        mechanism=mechanism,
        deflections=deflections,
        forces=np.array([state.force for state in held]),
        drive=1 / np.linalg.inv(stiffness)[:, 2, 2],
        support_x=stiffness[:, 0, 0],
        support_y=stiffness[:, 1, 1],
        stiffness=stiffness[[0, -1]],
        modes=modes(mechanism, Reduced.of(mechanism, straight[0], leaves.mass())),
        stress=float(moment / (mechanism.width * mechanism.thickness**2 / 6) * largest / mean),
        shortening=float(-held[-1].place.stage[0]),
        buckling=buckling_load(mechanism, leaves, straight[0], float(closed_forms.buckling_load(mechanism))),
    )


def _pushed(mechanism: Mechanism, leaves: LeafBeams, held: list[HeldEquilibrium], z: float) -> HeldEquilibrium:
    """Return the equilibrium at z [m], reached from the last of `held` in few steps.

    The number of steps doubles until one succeeds. Raises BeamFailure if none does.
    """
    nearest = held[-2:]
    start = nearest[-1].place.stage[1]
    for halving in range(settings.most_step_halvings):
        steps = 2**halving
        try:
            reached = nearest
            for k in range(1, steps + 1):
                place = _predicted(reached, start + (z - start) * k / steps)
                reached = [reached[-1], _equilibrium(mechanism, leaves, place)]
            return reached[-1]
        except (BeamFailure, np.linalg.LinAlgError):
            continue
    raise BeamFailure(f"The beams find no equilibrium at a deflection of {z * 1e3:.4g} mm: reduce the stroke.")


def _predicted(reached: list[HeldEquilibrium], z: float) -> Configuration:
    """Extrapolate to z [m] from the last two equilibria and their rates.

    With a single equilibrium, its rate is used.
    """
    last = reached[-1]
    if len(reached) == 1:
        return last.place.plus(last.rate, z - last.place.stage[1])
    before = reached[-2]
    step = last.place.stage[1] - before.place.stage[1]
    s = (z - before.place.stage[1]) / step
    weights = (1 + s**2 * (2 * s - 3), s**2 * (3 - 2 * s), step * s * (s - 1) ** 2, step * s**2 * (s - 1))
    parts = (before.place, last.place, before.rate, last.rate)
    inner, stage = (
        np.sum([weight * getattr(part, name) for weight, part in zip(weights, parts, strict=True)], axis=0)
        for name in ("inner", "stage")
    )
    return Configuration(inner, stage)


def _equilibrium(mechanism: Mechanism, leaves: LeafBeams, place: Configuration) -> HeldEquilibrium:
    """Find the equilibrium at the z of a configuration by Newton's method, starting from it.

    Raises BeamFailure if the method does not converge.
    """
    z = place.stage[1]
    relative = settings.newton_energy_share * (float(mechanism.thickness) / z) ** 2
    close = relative * float(closed_forms.drive_stiffness(mechanism)) * z**2
    for _ in range(settings.step_newton_iterations):
        if not np.max(np.abs(place.inner[:, :, 2]), initial=abs(place.stage[2])) < settings.folding_angle:
            break
        state = place.state(mechanism.offsets)
        forces, stiffness = leaves.forces(state), leaves.stiffness(state)
        solved = _condensed(mechanism, place, stiffness, forces)
        if solved.energy < close:
            return _held(mechanism, place, solved, stiffness, forces)
        place = place.plus(solved.change)
    raise BeamFailure("Newton's method does not converge.")


@dataclass(frozen=True)
class LinearisedLeaves:
    """A configuration linearised in the plane of motion.

    `plane` has the leaves condensed onto the stage. `change` leads to equilibrium at the same z, `energy` [J] is the
    work of the unbalanced forces on it, and `force` [N] then holds the stage.
    """

    plane: Condensed
    change: Configuration
    force: float
    energy: float


def _condensed(
    mechanism: Mechanism, place: Configuration, stiffness: np.ndarray, forces: np.ndarray
) -> LinearisedLeaves:
    """Linearise a configuration, with stiffness of the leaves and forces on their nodes.

    `stiffness` and `forces` belong to this configuration, `place`.
    """
    offsets, turn = mechanism.offsets, place.stage[2]
    ends = np.tile(np.eye(3), (len(offsets), 1, 1))
    ends[:, 0, 2], ends[:, 1, 2] = np.cos(turn) * offsets, -np.sin(turn) * offsets
    bend = -np.sum(offsets * (np.sin(turn) * forces[:, -1, 0] + np.cos(turn) * forces[:, -1, 2]))
    plane = Condensed.of(stiffness, forces, 0, ends, bend=(2, bend))
    free = plane.stiffness[::2, ::2]
    move = np.zeros(3)
    move[::2] = -np.linalg.solve(free, plane.force[::2])
    change = Configuration((plane.settle + plane.follow @ move).reshape(place.inner.shape), move)
    at_ends = np.einsum("li,lij,j", forces[:, -1, PLANE], ends, move)
    energy = abs(np.sum(forces[:, 1:-1, PLANE] * change.inner) + at_ends)
    return LinearisedLeaves(plane, change, float(plane.force[1] + plane.stiffness[1] @ move), float(energy))


def _held(
    mechanism: Mechanism, place: Configuration, solved: LinearisedLeaves, stiffness: np.ndarray, forces: np.ndarray
) -> HeldEquilibrium:
    """Return the equilibrium to which the linearised leaves lead from a configuration."""
    plane = solved.plane
    rate = np.array([0.0, 1.0, 0.0])
    rate[::2] = -np.linalg.solve(plane.stiffness[::2, ::2], plane.stiffness[::2, 1])
    matrix = np.zeros((6, 6))
    matrix[PLANE, PLANE] = plane.stiffness
    matrix[ACROSS, ACROSS] = _across(mechanism, place.stage[2], stiffness, forces)
    change = Configuration((plane.follow @ rate).reshape(place.inner.shape), rate)
    return HeldEquilibrium(place.plus(solved.change), change, solved.force, matrix)


def _across(mechanism: Mechanism, turn: float, stiffness: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """Return the stage's stiffness (3, 3) along y and about x and z.

    The stage is turned about y by `turn` [rad]. `stiffness` and `forces` are those of the leaves' nodes.
    """
    offsets, tilt = mechanism.offsets, np.cos(turn)
    ends = np.tile(np.eye(3), (len(offsets), 1, 1))
    ends[:, 0, 1] = -tilt * offsets
    bend = -tilt * np.sum(offsets * forces[:, -1, 2])
    successive = Condensed.of(stiffness, np.zeros_like(forces), 1, ends, bend=(1, bend)).stiffness
    # convert angles of successive rotations to rotations about fixed axes
    angles = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, -np.tan(turn)], [0.0, 0.0, 1 / tilt]])
    return angles.T @ successive @ angles
