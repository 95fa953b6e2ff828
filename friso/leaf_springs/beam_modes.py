"""Compute modes and buckling load of straight leaves and their stage.

Stiffness and mass of one leaf suffice. A leaf between held ends moves along x, y and z and twists, each independently
of the others. Its lowest modes of each kind describe it completely, together with the shapes that it takes statically
when the stage moves (Craig & Bampton 1968, doi:10.2514/3.4741).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import eigh

from friso.leaf_springs import plate
from friso.leaf_springs.beam_system import NODE_COORDINATES, LeafBeams
from friso.leaf_springs.closed_forms import axial, body_mass
from friso.leaf_springs.evaluation import Mode
from friso.leaf_springs.mechanism import Mechanism
from friso.leaf_springs.settings import settings

COUPLED_KINDS = (((2, 4), 8), ((1, 5), 4), ((3,), 5), ((0,), 2))
"""Coordinates of a node that couple while the leaf is straight, with the number of modes between held ends: bending,
bending in its plane, torsion, stretching."""


@dataclass(frozen=True)
class Reduced:
    """A straight leaf reduced to the motion of its stage end and a few modes of its own.

    `static` (nodes, 6, 6) holds the shapes of the leaf for unit motions of the stage end. `inner` (nodes, 6, modes)
    holds its modes between held ends at unit modal mass, and `squares` (modes,) their circular frequencies squared
    [1/s^2]. `stiffness` and `mass` (6, 6) are those at the stage end. `coupling` (modes, 6) is the mass that couples
    both kinds of motion.
    """

    static: np.ndarray
    inner: np.ndarray
    squares: np.ndarray
    stiffness: np.ndarray
    mass: np.ndarray
    coupling: np.ndarray

    @classmethod
    def of(cls, mechanism: Mechanism, stiffness: np.ndarray, mass: np.ndarray) -> Reduced:
        """Reduce a leaf to its stage end and a few modes.

        `stiffness` [N/m, N, N m] and `mass` [kg, kg m, kg m^2] are those of its nodes. The torsion of the beam is
        replaced by the torsion of a plate.
        """
        size, twisted = len(stiffness), (slice(3, None, NODE_COORDINATES),) * 2
        stiffness, mass = stiffness.copy(), mass.copy()
        stiffness[twisted], mass[twisted] = _torsion(mechanism, size // NODE_COORDINATES)
        static, parts, squares = np.zeros((size, NODE_COORDINATES)), [], []
        static[-NODE_COORDINATES:] = np.eye(NODE_COORDINATES)
        for kind, number in COUPLED_KINDS:
            inside = np.add.outer(np.arange(NODE_COORDINATES, size - NODE_COORDINATES, NODE_COORDINATES), kind).ravel()
            clamped = stiffness[np.ix_(inside, inside)]
            static[inside] = -np.linalg.solve(clamped, stiffness[inside, -NODE_COORDINATES:])
            values, vectors = eigh(clamped, mass[np.ix_(inside, inside)])
            shapes = np.zeros((size, min(number, len(values))))
            shapes[inside] = vectors[:, :number]
            parts.append(shapes)
            squares.append(values[:number])
        inner, moved = np.hstack(parts), mass @ static
        return cls(
            static.reshape(-1, NODE_COORDINATES, static.shape[1]),
            inner.reshape(-1, NODE_COORDINATES, inner.shape[1]),
            np.concatenate(squares),
            static.T @ stiffness @ static,
            static.T @ moved,
            inner.T @ moved,
        )


def _torsion(mechanism: Mechanism, nodes: int) -> tuple[np.ndarray, np.ndarray]:
    """Return torsional stiffness and mass of the nodes of a leaf that cannot warp at its ends.

    Both matrices have the shape (nodes, nodes). Elements are cubic; rates of twist at inner nodes are those of static
    equilibrium. Beams lack warping, which matters more for modes than for statics.
    """
    h = float(mechanism.length) / (nodes - 1)
    rigidity = float(mechanism.torsional_rigidity)
    warping = rigidity / float(plate.warping_rate(mechanism.width, mechanism.poisson)) ** 2
    signs = np.array([[1, 1, -1, 1], [1, 1, -1, 1], [-1, -1, 1, -1], [1, 1, -1, 1]])
    lengths = np.outer([1, h, 1, h], [1, h, 1, h])
    bent = np.array([[12, 6, 12, 6], [6, 4, 6, 2], [12, 6, 12, 6], [6, 2, 6, 4]]) * signs / h**3
    turned = np.array([[36, 3, -36, 3], [3, 4, -3, -1], [-36, -3, 36, -3], [3, -1, -3, 4]]) / (30 * h)
    moved = np.array([[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4]]) * h / 420
    polar = float(mechanism.density * (mechanism.bending + mechanism.edgewise))
    stiffness, mass = np.zeros((2 * nodes, 2 * nodes)), np.zeros((2 * nodes, 2 * nodes))
    for i in range(0, 2 * nodes - 2, 2):
        stiffness[i : i + 4, i : i + 4] += (warping * bent + rigidity * turned) * lengths
        mass[i : i + 4, i : i + 4] += polar * moved * lengths
    follow = np.zeros((2 * nodes, nodes))
    follow[::2] = np.eye(nodes)
    inside = slice(3, -1, 2)
    follow[inside] = -np.linalg.solve(stiffness[inside, inside], stiffness[inside, ::2])
    return follow.T @ stiffness @ follow, follow.T @ mass @ follow


def modes(mechanism: Mechanism, leaf: Reduced) -> tuple[Mode, ...]:
    """Return the lowest modes of stage and leaves, and all modes in which the stage moves much.

    The drive mode comes first, the others by frequency.
    """
    ends, rows = end_motions(mechanism.offsets), _rows(mechanism.offsets)
    count = len(leaf.squares)
    size = NODE_COORDINATES + count * len(rows)
    stiffness, mass = np.zeros((size, size)), np.eye(size)
    stage = slice(0, NODE_COORDINATES)
    stiffness[stage, stage] = _gathered(ends, leaf.stiffness)
    body = body_mass(mechanism)
    mass[stage, stage] = body + _gathered(ends, leaf.mass)
    np.fill_diagonal(stiffness[NODE_COORDINATES:, NODE_COORDINATES:], np.tile(leaf.squares, len(rows)))
    # pattern k of the leaves acts with the weights rows[k]
    mass[NODE_COORDINATES:, stage] = np.einsum("kl,me,les->kms", rows, leaf.coupling, ends).reshape(
        -1, NODE_COORDINATES
    )
    mass[stage, NODE_COORDINATES:] = mass[NODE_COORDINATES:, stage].T
    squares, vectors = eigh(stiffness, mass)
    lowest = []
    for square, vector in zip(squares, vectors.T, strict=True):
        moves = vector[stage] @ body @ vector[stage] > settings.stage_energy_share
        if len(lowest) >= settings.reported_modes and not moves:
            continue
        amplitudes = rows.T @ vector[NODE_COORDINATES:].reshape(len(rows), count)
        moved = np.einsum("nce,les,s->lnc", leaf.static[:, :3], ends, vector[stage])
        moved += np.einsum("ncm,lm->lnc", leaf.inner[:, :3], amplitudes)
        sign = 1.0 if moved.flat[np.argmax(np.abs(moved))] >= 0 else -1.0  # of the largest displacement of a leaf
        frequency = np.sqrt(max(square, 0.0)) / (2 * np.pi)
        lowest.append(Mode.of(mechanism, frequency, sign * vector[stage], sign * moved))
    drive = max(lowest, key=lambda mode: abs(mode.stage[2]) / mode.frequency if mode.frequency else np.inf)
    return (replace(drive, name="drive"), *(mode for mode in lowest if mode is not drive))


def end_motions(offsets: np.ndarray) -> np.ndarray:
    """Return the motion of the leaves' stage ends per small motion of the stage, (leaves, 6, 6).

    `offsets` [m], shape (leaves,), are the places of the leaves along z.
    """
    ends = np.tile(np.eye(NODE_COORDINATES), (len(offsets), 1, 1))
    ends[:, 0, 4], ends[:, 1, 3] = offsets, -offsets
    return ends


def _gathered(ends: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Add up a matrix (6, 6) at each leaf's stage end to the matrix that acts on the stage.

    `ends` (leaves, 6, 6) tells how the stage ends of the leaves follow the stage.
    """
    return np.einsum("lea,ef,lfb->ab", ends, matrix, ends)


def _rows(offsets: np.ndarray) -> np.ndarray:
    """Return orthonormal patterns of motion among the leaves, one in each row.

    The first is uniform, the second linear in the position of the leaf, and the rest complete the set. `offsets` [m],
    shape (leaves,), are the places of the leaves along z.
    """
    powers = np.vander(np.arange(len(offsets)) - (len(offsets) - 1) / 2, increasing=True)
    return np.linalg.qr(powers)[0].T


def buckling_load(mechanism: Mechanism, leaves: LeafBeams, straight: np.ndarray, load: float) -> float:
    """Return the least load [N] along all leaves together at which the stage sways.

    `straight` is the stiffness of a leaf without load. `load` [N] is a guess, at which the problem is linearised.
    """
    state = np.zeros((1, leaves.nodes, NODE_COORDINATES))
    strain = load / float(mechanism.leaves * axial(mechanism))
    state[:, :, 0] = -strain * np.linspace(0, float(mechanism.length), leaves.nodes)
    loaded = leaves.stiffness(state)[0]
    # all leaves bend identically; the stage's pitch stretches them
    moving = np.add.outer(np.arange(NODE_COORDINATES, len(straight), NODE_COORDINATES), (2, 4)).ravel()
    without, with_load = (int(mechanism.leaves) * matrix[np.ix_(moving, moving)] for matrix in (straight, loaded))
    softening = without - with_load
    without[-1, -1] += axial(mechanism) / mechanism.length * mechanism.offset_squares
    last = len(moving) - 1
    largest = eigh(softening, without, eigvals_only=True, subset_by_index=(last, last))[0]
    return float(load / largest)
