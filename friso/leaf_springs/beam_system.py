"""Model the leaves of a mechanism as geometrically exact beams of exudyn.

The module computes forces, stiffness and mass of the nodes. Only this module knows exudyn. A leaf is a chain of equal
two-node elements of constant strain. Three corrections keep few elements exact:

- An element misses bending because its moment is taken as constant. That bending is added to its shear flexibility
  (residual bending flexibility: h^2/(12 E I) per force).
- The bent middle of an element carries mass beyond the straight line between its nodes. That mass is added to its
  rotary inertia (rho A h^2/6).
- What the leaf has as a plate (plate.py) is averaged over the element. The whole leaf then has the stiffness of the
  plate in parallel motion, under a constant torque, and under the torque that a force across the deflected leaf adds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.leaf_springs import plate
from friso.leaf_springs.closed_forms import SHEAR_COEFFICIENT, axial, edgewise_shear
from friso.leaf_springs.mechanism import Mechanism

LEAF_ELEMENTS = 16
"""Elements along a leaf; its modes are reported at the nodes between them."""

NODE_COORDINATES = 6
"""Coordinates of a node: displacements along x, y, z and angles of successive rotations about them."""


class BeamFailure(RuntimeError):
    """Error: a mechanism that the beam model cannot evaluate."""


class LeafBeams:
    """The identical leaves of a mechanism with free ends, as beams in exudyn.

    exudyn holds one leaf and evaluates each leaf in turn. States and forces have shape (leaves, nodes, 6), with the
    cart end first.
    """

    def __init__(self, mechanism: Mechanism, elements: int = LEAF_ELEMENTS) -> None:
        """Build one leaf with the given number of elements in exudyn."""
        self.count, self.nodes = int(mechanism.leaves), elements + 1
        import exudyn  # package of an extra

        self._container: Any = exudyn.SystemContainer()
        self._system: Any = self._container.AddSystem()
        _add_leaf(self._system, mechanism, elements)
        self._system.Assemble()
        settings: Any = exudyn.SimulationSettings()
        settings.solution.file.write = False
        settings.solution.sensors.active = False
        settings.staticSolver.verboseMode = 0
        self._solver: Any = exudyn.MainSolverStatic()
        self._solver.InitializeSolver(self._system, settings)

    def forces(self, state: np.ndarray) -> np.ndarray:
        """Return the forces and moments [N, N m] that hold the nodes in a state, (leaves, nodes, 6)."""
        return -np.array([self._forces(leaf) for leaf in state]).reshape(state.shape)

    def stiffness(self, state: np.ndarray) -> np.ndarray:
        """Return the tangent stiffness of each leaf in a state, (leaves, 6 * nodes, 6 * nodes)."""
        return np.array([self._stiffness(leaf) for leaf in state])

    def mass(self) -> np.ndarray:
        """Return the mass matrix of an undeflected leaf, shape (6 * nodes, 6 * nodes)."""
        self._move(np.zeros((self.nodes, NODE_COORDINATES)))
        self._solver.ComputeMassMatrix(self._system)
        return np.array(self._solver.GetSystemMassMatrix())

    def _move(self, leaf: np.ndarray) -> None:
        if not np.all(np.isfinite(leaf)):
            raise BeamFailure("The beams have no finite state: check that all dimensions are positive numbers.")
        self._system.systemData.SetODE2Coordinates(leaf.ravel())

    def _forces(self, leaf: np.ndarray) -> np.ndarray:
        self._move(leaf)
        self._solver.ComputeODE2RHS(self._system)
        return np.array(self._solver.GetSystemResidual())

    def _stiffness(self, leaf: np.ndarray) -> np.ndarray:
        self._move(leaf)
        factors = {"scalarFactor_ODE2": -1, "scalarFactor_ODE2_t": 0, "scalarFactor_ODE1": 0}
        self._solver.ComputeJacobianODE2RHS(self._system, **factors)
        return np.array(self._solver.GetSystemJacobian())


@dataclass(frozen=True)
class Configuration:
    """Displacements of leaves and stage in the plane of motion.

    `inner` holds the displacements of the nodes between the ends (leaves, nodes, 3), `stage` those of the stage (x, z,
    about y).
    """

    inner: np.ndarray
    stage: np.ndarray

    @classmethod
    def rest(cls, leaves: LeafBeams) -> Configuration:
        """Return the configuration in which leaves and stage are not displaced."""
        return cls(np.zeros((leaves.count, leaves.nodes - 2, 3)), np.zeros(3))

    def plus(self, rate: Configuration, factor: float = 1.0) -> Configuration:
        """Return the configuration plus `factor` times the displacements in `rate`."""
        return Configuration(self.inner + factor * rate.inner, self.stage + factor * rate.stage)

    def state(self, offsets: np.ndarray) -> np.ndarray:
        """Return the state of all nodes, shape (leaves, nodes, 6).

        `offsets` [m] are the places of the leaves along z.
        """
        x, z, turn = self.stage
        leaves, inner, _ = self.inner.shape
        state = np.zeros((leaves, inner + 2, NODE_COORDINATES))
        state[:, 1:-1, 0::2] = self.inner
        state[:, -1, 0] = x + np.sin(turn) * offsets
        state[:, -1, 2] = z + (np.cos(turn) - 1) * offsets
        state[:, -1, 4] = turn
        return state


@dataclass(frozen=True)
class Condensed:
    """The leaves condensed onto the stage: their inner nodes are eliminated.

    `follow` (leaves, inner coordinates, 3) tells how inner nodes move with the stage. `settle` (leaves, inner
    coordinates) tells how they move under forces that are out of balance. `force` (3,) and `stiffness` (3, 3) act on
    the stage.
    """

    follow: np.ndarray
    settle: np.ndarray
    force: np.ndarray
    stiffness: np.ndarray

    @classmethod
    def of(
        cls, stiffness: np.ndarray, forces: np.ndarray, which: int, ends: np.ndarray, bend: tuple[int, float]
    ) -> Condensed:
        """Condense the stiffness of the leaves and the forces on their nodes onto the stage.

        Of each node, the coordinates `which`, `which` + 2 and `which` + 4 are used. `ends` (leaves, 3, 3) tells how the
        leaf ends follow the stage. If the stage turns, the leaf ends move along arcs. `bend` has the index of this
        rotation, and the stiffness [N m/rad] that the forces at the ends add to it.
        """
        matrices = stiffness[:, NODE_COORDINATES + which :: 2, NODE_COORDINATES + which :: 2]
        out = forces[:, 1:, which::2].reshape(len(forces), -1)
        inside, border = slice(None, -3), slice(-3, None)
        back = np.swapaxes(ends, 1, 2)
        across = matrices[:, inside, border] @ ends
        solved = np.linalg.solve(matrices[:, inside, inside], np.concatenate([across, out[:, inside, None]], axis=2))
        follow, settle = -solved[:, :, :3], -solved[:, :, 3]
        felt = np.swapaxes(across, 1, 2)
        left = np.sum(back @ matrices[:, border, border] @ ends + felt @ follow, axis=0)
        left[bend[0], bend[0]] += bend[1]
        force = np.sum(back @ out[:, border, None] + felt @ settle[:, :, None], axis=0)[:, 0]
        return cls(follow, settle, force, left)


def _add_leaf(system: Any, mechanism: Mechanism, elements: int) -> None:
    """Add the nodes and elements of a leaf to a system of exudyn."""
    h = float(mechanism.length) / elements
    middles = h * (np.arange(elements // 2) + 0.5)
    compliances = zip(_curl(mechanism, h, middles), _twist(mechanism, h, middles), strict=True)
    half = [_section(mechanism, h, *pair) for pair in compliances]
    nodes = [
        system.AddNode({"nodeType": "RigidBodyRxyz", "referenceCoordinates": [i * h, 0, 0, 0, 0, 0], "Vshow": False})
        for i in range(elements + 1)
    ]
    beam = {"objectType": "BeamGeometricallyExact", "length": h, "Vshow": False}
    for i, section in enumerate(half[::-1] + half):
        system.AddObject({**beam, "nodeNumbers": nodes[i : i + 2], "sectionData": section})


def _section(mechanism: Mechanism, h: float, curl: float, twist: float) -> Any:
    """Return the cross-section of an element of length h [m].

    `curl` and `twist` are the compliances in bending and torsion relative to a plain beam.
    """
    weak, strong = mechanism.young * mechanism.bending / curl, mechanism.young * mechanism.edgewise
    shears = (edgewise_shear(mechanism), strong), (SHEAR_COEFFICIENT * mechanism.shear * mechanism.area, weak)
    torsion = mechanism.torsional_rigidity / twist
    edgewise, flatwise = (1 / (1 / shear + h**2 / (12 * bending)) for shear, bending in shears)
    bulge = mechanism.area * h**2 / 6
    import exudyn

    section: Any = exudyn.BeamSection()
    section.stiffnessMatrix = np.diag([axial(mechanism), edgewise, flatwise, torsion, weak, strong])
    section.massPerLength = mechanism.density * mechanism.area
    moments = [mechanism.bending + mechanism.edgewise, mechanism.bending + bulge, mechanism.edgewise + bulge]
    section.inertia = mechanism.density * np.diag(moments)
    return section


GAUSS_POINTS, GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(4)


def _inside(h: float, middles: np.ndarray) -> np.ndarray:
    """Return four integration points [m] in each element, shape (elements, 4).

    Elements of length `h` [m] have their `middles` [m], shape (elements,), counted from the middle of the leaf.
    """
    return middles[:, None] + GAUSS_POINTS * h / 2


def _curl(mechanism: Mechanism, h: float, middles: np.ndarray) -> np.ndarray:
    """Return the bending compliance of elements relative to a plain beam, shape (elements,).

    Its mean over an element is weighted by the square of the moment in parallel motion.
    """
    s = _inside(h, middles)
    compliance = plate.compliance_profile(s, *mechanism.plate_shape)
    return (compliance * s**2) @ GAUSS_WEIGHTS / (s**2 @ GAUSS_WEIGHTS)


def _twist(mechanism: Mechanism, h: float, middles: np.ndarray) -> np.ndarray:
    """Return the torsional compliance of elements relative to a plain beam, shape (elements,).

    Under a constant torque, the leaf then has the stiffness of the plate (`plate.free_twist`). The compliance is also
    tilted along the leaf. The stiffness of the plate then holds, too, under the torque s^3 that a force across the
    deflected leaf adds, with s from -1 to 1.

    At the middle of an element of length h, in half lengths of the leaf, this torque is s^3 + s h^2/2. The reason is
    that elements of constant strain represent the curved leaf as arcs (found by comparison; 1/n^2 errors of the
    stiffness along y vanish).
    """
    s, end = 2 * _inside(h, middles) / mechanism.length, 2 * middles / mechanism.length
    even = plate.free_twist(s * mechanism.length / 2, *mechanism.plate_shape) @ GAUSS_WEIGHTS / 2
    odd = (plate.cubic_twist(s, *mechanism.plate_shape) * s**3) @ GAUSS_WEIGHTS / 2
    return plate.tilted(even, end**3 + end * (2 * h / mechanism.length) ** 2 / 2, end, odd.sum())
