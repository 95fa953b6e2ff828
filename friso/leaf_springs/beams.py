"""Model the mechanism as geometrically exact beams (exudyn), nonlinear over the stroke.

`LeafBeams` computes forces, stiffness and mass of the nodes. No other file knows exudyn. A leaf is a chain of equal
two-node elements of constant strain. Three corrections keep few elements exact:

- An element misses bending because its moment is taken as constant. That bending is added to its shear flexibility
  (residual bending flexibility: h^2/(12 E I) per force).
- The bent middle of an element carries mass beyond the straight line between its nodes. That mass is added to its
  rotary inertia (rho A h^2/6).
- What the leaf has as a plate (mechanism.py) is averaged over the element. The whole leaf then has the stiffness of the
  plate in parallel motion, under a constant torque, and under the torque that a force across the deflected leaf adds.

Stiffness and mass of one leaf give the modes and buckling load of straight leaves and their stage. A leaf between held
ends moves along x, y and z and twists, each independently of the others. Its lowest modes of each kind describe it
completely, together with the shapes that it takes statically when the stage moves (Craig & Bampton 1968,
doi:10.2514/3.4741).

The stage is pushed along z, so leaves and stage move in the x-z plane alone. The stiffness of the deflected mechanism
has all six coordinates: three in the plane (x, z, about y) and three across it (y, about x, about z), which stay
independent. Nodes between cart and stage are eliminated leaf by leaf.

Beams and closed forms are evaluated side by side, at one stroke.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.linalg import eigh

from friso.leaf_springs import closed_forms
from friso.leaf_springs import mechanism as plate
from friso.leaf_springs.closed_forms import SHEAR_COEFFICIENT, axial, body_mass, closed_form_model, edgewise_shear
from friso.leaf_springs.mechanism import Evaluation, Mechanism, Mode
from friso.stage import Stage

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


STAGE_ENERGY_SHARE = 0.1
"""Fraction of the kinetic energy in the stage below which a mode is one of the leaves."""

REPORTED_MODES = 12
"""Modes that are reported. Higher ones lie beyond any crossover."""


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
        moves = vector[stage] @ body @ vector[stage] > STAGE_ENERGY_SHARE
        if len(lowest) >= REPORTED_MODES and not moves:
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


BEAM_DEFLECTIONS = 5
"""Deflections at which beams are evaluated. Fewer miss the curvature of the stiffness over the stroke."""


def _evaluate(mechanism: Mechanism, stroke: float, leaves: LeafBeams) -> Evaluation:
    """Evaluate the mechanism at several deflections up to the stroke [m], and its modes at rest."""
    deflections = np.linspace(0, stroke, BEAM_DEFLECTIONS)
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


MOST_STEP_HALVINGS = 5
"""Halvings of a step. Leaves that still do not converge are buckled or folded."""


def _pushed(mechanism: Mechanism, leaves: LeafBeams, held: list[HeldEquilibrium], z: float) -> HeldEquilibrium:
    """Return the equilibrium at z [m], reached from the last of `held` in few steps.

    The number of steps doubles until one succeeds. Raises BeamFailure if none does.
    """
    nearest = held[-2:]
    start = nearest[-1].place.stage[1]
    for halving in range(MOST_STEP_HALVINGS):
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


NEWTON_ENERGY_SHARE = 1e-7
"""Newton's error in energy, relative to the total. It leaves an error of 4e-4 of the buckling load in the axial
force."""

STEP_NEWTON_ITERATIONS = 8
"""Newton iterations of a step. A step that needs more converges sooner when halved."""

FOLDING_ANGLE = 1.3  # [rad]
"""Angle beyond which the mechanism is folded rather than deflected."""


def _equilibrium(mechanism: Mechanism, leaves: LeafBeams, place: Configuration) -> HeldEquilibrium:
    """Find the equilibrium at the z of a configuration by Newton's method, starting from it.

    Raises BeamFailure if the method does not converge.
    """
    z = place.stage[1]
    relative = NEWTON_ENERGY_SHARE * (float(mechanism.thickness) / z) ** 2
    close = relative * float(closed_forms.drive_stiffness(mechanism)) * z**2
    for _ in range(STEP_NEWTON_ITERATIONS):
        if not np.max(np.abs(place.inner[:, :, 2]), initial=abs(place.stage[2])) < FOLDING_ANGLE:
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


BEAMS, CLOSED = "Beams", "Closed forms"
"""Names of the models."""


@dataclass(frozen=True)
class BothModels:
    """The leaf springs of a stage at a stroke, by closed forms and by beams.

    `beams` is None where the beam model has no solution; `failure` gives the reason.
    """

    stage: Stage
    closed: Evaluation
    beams: Evaluation | None
    failure: str = ""

    @property
    def best(self) -> Evaluation:
        """Return the more exact evaluation: beams, if they have a solution."""
        return self.beams or self.closed

    @property
    def models(self) -> dict[str, Evaluation]:
        """Return the evaluations by the name of the model."""
        models = {} if self.beams is None else {BEAMS: self.beams}
        return {**models, CLOSED: self.closed}

    @property
    def mechanism(self) -> Mechanism:
        """Return the mechanism that was evaluated."""
        return self.closed.mechanism


def both_models(stage: Stage, mechanism: Mechanism, stroke: float) -> BothModels:
    """Evaluate the leaf springs of a stage at a stroke [m].

    If the beam model fails, the result has the reason.
    """
    simple = closed_form_model(mechanism, stroke)
    try:
        return BothModels(stage, simple, beams(mechanism, stroke))
    except BeamFailure as failure:
        return BothModels(stage, simple, None, str(failure))
