"""Shell finite elements (pyfe3d) of a parallel leaf-spring mechanism, to judge beam models.

x along the leaves from the clamp to the stage, y along their width, z through their thickness: the drive. The leaves
stand in a row along z, centred on z=0, clamped at x=0; at x=L their edges are rigidly attached to a rigid stage with
the coordinates q = (ux, uy, uz, rx, ry, rz) at the reference point (L, 0, deflection). SI throughout. Nothing here is
shared with friso.
"""

from typing import NamedTuple

import numpy as np
from pyfe3d import Quad4, Quad4Data, Quad4Probe
from pyfe3d.shellprop import ShellProp
from pyfe3d.shellprop_utils import isotropic_plate
from scipy.sparse import block_diag, bmat, coo_matrix, csc_matrix
from scipy.sparse.linalg import eigsh, splu

DOF = 6
Mesh = tuple[int, int]  # elements along x, along y
MESH: Mesh = (24, 12)
STRESS_MESH: Mesh = (32, 16)
CROWDING, STRESS_CROWDING = 0.5, 0.8  # of the nodes at the ends and free edges: 0 evenly spaced, 1 as a cosine


class Sheet(NamedTuple):
    """Material and thickness of the leaves, in SI."""

    length: float
    width: float
    thickness: float
    young: float
    poisson: float
    density: float


class Leaf(NamedTuple):
    """One meshed leaf.

    Nodes run along y first; nodes of the clamp come first, nodes of the stage last.
    """

    nodes: np.ndarray  # (n, 3) [m]
    elements: list[Quad4]
    prop: ShellProp
    stiffness: csc_matrix  # (6n, 6n)
    mass: csc_matrix  # (6n, 6n)
    inner: slice  # unknowns neither clamped nor on the stage
    clamp: slice
    edge: slice
    rigid: np.ndarray  # (6 * nodes of the edge, 6): motion of the edge from that of the middle of the edge


def rigid_motion(arms: np.ndarray) -> np.ndarray:
    """Displacements and rotations (6n, 6) of points at arms (n, 3) [m] from a reference point that moves by q."""
    x, y, z = arms.T
    motion = np.tile(np.eye(6), (len(arms), 1, 1))
    motion[:, 0, 4], motion[:, 0, 5] = z, -y
    motion[:, 1, 3], motion[:, 1, 5] = -z, x
    motion[:, 2, 3], motion[:, 2, 4] = y, -x
    return motion.reshape(-1, 6)


def leaf_mesh(sheet: Sheet, mesh: Mesh, deflection: float = 0.0, crowding: float = CROWDING) -> Leaf:
    """Mesh a leaf along its deflected mid-surface, and assemble it."""
    length, width, thickness, young, poisson, density = sheet
    nx, ny = mesh
    s, y = divisions(nx, crowding), width * (divisions(ny, crowding) - 0.5)
    z = deflection * (3 - 2 * s) * s**2
    nodes = np.stack(np.broadcast_arrays(length * s[:, None], y, z[:, None]), axis=-1).reshape(-1, 3)
    prop = isotropic_plate(thickness=thickness, E=young, nu=poisson, rho=density)
    first = (np.arange(nx)[:, None] * (ny + 1) + np.arange(ny)).ravel()
    elements = make_elements(np.stack([first, first + ny + 1, first + ny + 2, first + 1], axis=1))
    row = DOF * (ny + 1)
    arms = nodes[-ny - 1 :] - [length, 0, deflection]
    return Leaf(
        nodes,
        elements,
        prop,
        *assemble(nodes, elements, prop),
        slice(row, nx * row),
        slice(0, row),
        slice(nx * row, None),
        rigid_motion(arms),
    )


def divisions(count: int, crowding: float) -> np.ndarray:
    """Return values from 0 to 1 in `count` steps, shorter at both ends."""
    even = np.linspace(0, 1, count + 1)
    return (1 - crowding) * even + crowding * np.sin(np.pi / 2 * even) ** 2


def make_elements(corners: np.ndarray) -> list[Quad4]:
    """Elements on the nodes (count, 4), each with its place in the arrays of the matrices."""
    probe, sizes = Quad4Probe(), Quad4Data()
    elements = []
    for k, quad in enumerate(corners):
        element = Quad4(probe)
        element.c1, element.c2, element.c3, element.c4 = (DOF * int(n) for n in quad)
        element.init_k_KC0 = k * sizes.KC0_SPARSE_SIZE
        element.init_k_M = k * sizes.M_SPARSE_SIZE
        element.init_k_KG = k * sizes.KG_SPARSE_SIZE
        elements.append(element)
    return elements


def assemble(nodes: np.ndarray, elements: list[Quad4], prop: ShellProp) -> tuple[csc_matrix, csc_matrix]:
    """Stiffness and consistent mass (with rotary inertia), both (6n, 6n)."""
    sizes, at = Quad4Data(), nodes.ravel()
    stiffness = triplets(len(elements) * sizes.KC0_SPARSE_SIZE)
    mass = triplets(len(elements) * sizes.M_SPARSE_SIZE)
    for element in elements:
        element.update_rotation_matrix(at)
        element.update_probe_xe(at)
        element.update_KC0(*stiffness, prop)
        element.update_M(*mass, prop, 0)
    return matrix(stiffness, nodes), matrix(mass, nodes)


def triplets(size: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows, columns and values (size,), for pyfe3d to fill."""
    return np.zeros(size, np.int64), np.zeros(size, np.int64), np.zeros(size)


def matrix(filled: tuple[np.ndarray, np.ndarray, np.ndarray], nodes: np.ndarray) -> csc_matrix:
    rows, columns, values = filled
    return csc_matrix(coo_matrix((values, (rows, columns)), shape=(DOF * len(nodes),) * 2))


def follow(leaf: Leaf) -> np.ndarray:
    """Return the motion of all unknowns of the leaf (6n, 6) per motion of its edge's middle, in equilibrium."""
    moved = np.zeros((DOF * len(leaf.nodes), 6))
    moved[leaf.edge] = leaf.rigid
    k = leaf.stiffness
    moved[leaf.inner] = -splu(k[leaf.inner, leaf.inner]).solve(k[leaf.inner, leaf.edge] @ leaf.rigid)
    return moved


def mechanism_stiffness(
    sheet: Sheet, leaves: int, spacing: float, deflection: float = 0.0, mesh: Mesh = MESH
) -> np.ndarray:
    """Stiffness (6, 6) of all leaves at the stage's reference point (L, 0, deflection) [N/m, N, N m], kept parallel.

    Linear about the curved mid-surfaces; their prestress is neglected.
    """
    leaf = leaf_mesh(sheet, mesh, deflection)
    end = leaf.rigid.T @ (leaf.stiffness @ follow(leaf))[leaf.edge]
    return sum((shift.T @ (end + end.T) @ shift / 2 for shift in places(leaves, spacing)), np.zeros((6, 6)))


def places(leaves: int, spacing: float) -> list[np.ndarray]:
    """Return how the middles of the leaves' edges move with the stage, (6, 6) each."""
    return [rigid_motion(np.array([[0, 0, z]])) for z in spacing * (np.arange(leaves) - (leaves - 1) / 2)]


def clamp_stress(sheet: Sheet, deflection: float, mesh: Mesh = STRESS_MESH) -> tuple[float, float]:
    """Mean and largest over the width of the size of the bending stress [Pa] at the clamp of a leaf kept parallel.

    From the moments that react at the nodes: they carry the whole moment exactly, and each is divided by the width
    that belongs to its node. The corners may be singular within a thickness or so; outside it stress falls to them.
    """
    leaf = leaf_mesh(sheet, mesh, crowding=STRESS_CROWDING)
    moments = deflection * (leaf.stiffness[leaf.clamp] @ follow(leaf)[:, 2])[4::DOF]
    widths = np.convolve(np.diff(leaf.nodes[: len(moments), 1]), [0.5, 0.5])
    modulus = sheet.thickness**2 / 6
    return abs(float(np.sum(moments))) / (sheet.width * modulus), float(np.max(np.abs(moments) / widths)) / modulus


def coupled(part: csc_matrix, leaf: Leaf, shifts: list[np.ndarray], body: np.ndarray) -> csc_matrix:
    """Matrix of the inner unknowns of all leaves, then q, from that of one leaf (6n, 6n) and of the stage (6, 6)."""
    edges = [leaf.rigid @ shift for shift in shifts]
    borders = csc_matrix(np.vstack([part[leaf.inner, leaf.edge] @ edge for edge in edges]))
    stage = body + sum(edge.T @ (part[leaf.edge, leaf.edge] @ edge) for edge in edges)
    inner = block_diag([part[leaf.inner, leaf.inner]] * len(edges))
    return csc_matrix(bmat([[inner, borders], [borders.T, csc_matrix(stage)]]))


def start(matrix: csc_matrix) -> np.ndarray:
    """Return a start vector for the eigenvalues of a matrix, equal every time."""
    return np.random.default_rng(0).standard_normal(len(matrix.indptr) - 1)


def modes(
    sheet: Sheet,
    leaves: int,
    spacing: float,
    mass: float,
    inertia: tuple[float, float, float],
    centre: tuple[float, float, float],
    count: int = 10,
    mesh: Mesh = MESH,
) -> tuple[np.ndarray, list[str]]:
    """Lowest frequencies (count,) [Hz] of the stage (inertia [kg m^2] about x, y, z through its centre [m]) on leaves
    with mass, and what moves, see kind().

    At zero deflection; consistent mass of the leaves, with rotary inertia.
    """
    leaf = leaf_mesh(sheet, mesh)
    arm = np.asarray(centre, float) - [sheet.length, 0, 0]
    centred, inertias = rigid_motion(arm[None, :]), np.array([mass] * 3 + list(inertia))
    body, shifts = centred.T @ (inertias[:, None] * centred), places(leaves, spacing)
    stiff, heavy = coupled(leaf.stiffness, leaf, shifts, np.zeros((6, 6))), coupled(leaf.mass, leaf, shifts, body)
    squares, vectors = eigsh(stiff, count, heavy, sigma=0.0, v0=start(stiff))
    order = np.argsort(squares)
    vectors = vectors[:, order]
    shares = inertias[:, None] * (centred @ vectors[-6:]) ** 2
    kinds = [kind(share, vector[:-6], leaf) for share, vector in zip(shares.T, vectors.T, strict=True)]
    return np.sqrt(squares[order]) / (2 * np.pi), kinds


def kind(shares: np.ndarray, inner: np.ndarray, leaf: Leaf) -> str:
    """Return which part a mode moves, with the half waves along leaves.

    It follows from the fractions (6,) of the kinetic energy in the stage's coordinates, and from the inner unknowns of
    all leaves.
    """
    if np.sum(shares) > 0.5:
        return f"stage {('ux', 'uy', 'uz', 'rx', 'ry', 'rz')[int(np.argmax(shares))]}"
    across = len(leaf.rigid) // DOF
    field = inner.reshape(-1, leaf.inner.stop // (DOF * across) - 1, across, DOF)
    if np.sum(field[..., 2] ** 2) < np.sum(field[..., :2] ** 2):
        return "leaves in plane"
    y = leaf.nodes[:across, 1]
    lines = field[..., 2] @ np.stack([np.full(across, across**-0.5), y / np.linalg.norm(y)], axis=1)
    parts = np.sum(lines**2, axis=(0, 1))  # moving straight, and turned; the rest moves curved over the width
    if np.sum(parts) < np.sum(field[..., 2] ** 2) / 2:
        return "leaves dishing"
    main = lines[..., np.argmax(parts)]
    line = main[np.argmax(np.sum(main**2, axis=1))]
    signs = np.sign(line[np.abs(line) > 0.05 * np.max(np.abs(line))])
    waves = 1 + np.count_nonzero(np.diff(signs))
    return f"leaves {('bending', 'twisting')[int(np.argmax(parts))]} {waves}"


def buckling_load(sheet: Sheet, leaves: int, mesh: Mesh = MESH) -> float:
    """Load [N] along -x on the stage, shared by the leaves, at which it sways, kept parallel: linear buckling."""
    leaf = leaf_mesh(sheet, mesh)
    moved = -follow(leaf)[:, 0]
    load = -leaf.rigid[:, 0] @ (leaf.stiffness @ moved)[leaf.edge]
    keep = np.diag([1.0, 1, 1, 0, 0, 0])[:, :3]  # of the stage's coordinates
    stiff = coupled(leaf.stiffness, leaf, [keep], np.zeros((3, 3)))
    softer = coupled(geometric(leaf, moved / load), leaf, [keep], np.zeros((3, 3)))
    inverse, _ = eigsh(-softer, 1, stiff, which="LA", v0=start(stiff))
    return leaves / float(inverse[0])


def geometric(leaf: Leaf, moved: np.ndarray) -> csc_matrix:
    """Geometric stiffness (6n, 6n) of the membrane forces of a displacement (6n,)."""
    nodes = leaf.nodes.ravel()
    filled = triplets(len(leaf.elements) * Quad4Data().KG_SPARSE_SIZE)
    for element in leaf.elements:
        element.update_probe_xe(nodes)
        element.update_probe_ue(moved)
        element.update_KG(*filled, leaf.prop)
    return matrix(filled, leaf.nodes)
