"""Leaf springs by closed forms and by beams: published numbers, what physics demands of them, and each other."""

from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.polynomial import Polynomial
from scipy.integrate import solve_bvp
from scipy.linalg import block_diag, eigh
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from friso.leaf_springs import closed_forms
from friso.leaf_springs import closed_forms as closed_model
from friso.leaf_springs import mechanism as plate
from friso.leaf_springs.beams import BeamFailure, Configuration, LeafBeams, beams
from friso.leaf_springs.closed_forms import closed_form_model, first_interfering, parasitic_mode
from friso.leaf_springs.mechanism import VISIBLE_PEAK, Mechanism, MovingBody, block_inertia

MANY = settings(max_examples=40)
FEW = settings(max_examples=10)
SHARE = st.floats(0.0, 1.2)


def mechanism(
    length: float = 0.07,
    width: float = 0.045,
    thickness: float = 0.35e-3,
    leaves: float = 2,
    spacing: float = 0.06,
    poisson: float = 0.3,
    mass: float = 0.5,
    off: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Mechanism:
    """The thesis's leaves; the centre of mass of the stage, where it is pushed and seen, is `off` the leaf ends [m]."""
    centre = (length + off[0], off[1], off[2])
    body = MovingBody(mass, (0.0, 0.0, 0.0), centre)
    base = Mechanism(
        leaves, length, width, thickness, spacing, 210e9, poisson, 7850.0, 1.1e9, 4e8, body, centre, centre, 0.01
    )
    return replace(base, body=replace(body, inertia=block_inertia(base.body.mass)))


@st.composite
def mechanisms(draw: st.DrawFn) -> Mechanism:
    length = draw(st.floats(0.02, 0.15))
    width = length / draw(st.floats(0.8, 6.0))
    thickness = min(width / 10, length / draw(st.floats(60, 400)))
    leaves, spacing = draw(st.integers(2, 4)), draw(st.floats(0.2, 1.5)) * length
    off = tuple(draw(st.floats(-0.1, 0.1)) * length for _ in range(3))
    return mechanism(
        length,
        width,
        thickness,
        leaves,
        spacing,
        poisson=draw(st.floats(0.2, 0.4)),
        mass=2700 * width * length * spacing * draw(st.floats(0.3, 2.0)),  # a block about as long as the leaves
        off=off,  # type: ignore[arg-type]
    )


THESIS = mechanism()


def together(many: list[Mechanism]) -> Mechanism:
    """Many mechanisms as one of arrays."""

    def stacked(values: list[Any]) -> Any:
        if isinstance(values[0], tuple):
            return tuple(map(stacked, zip(*values, strict=True)))
        if isinstance(values[0], MovingBody):
            return MovingBody(
                *(stacked([getattr(value, field.name) for value in values]) for field in fields(MovingBody))
            )
        return np.array(values, dtype=float)

    return Mechanism(*(stacked([getattr(alone, field.name) for alone in many]) for field in fields(Mechanism)))


# ---- published numbers (references.md, section 3: 70 x 45 x 0.35 mm, E 210 GPa, nu 0.3)


def test_published_leaf_by_closed_forms() -> None:
    beam = closed_forms.drive_stiffness(THESIS) / plate.stiffening(0.07, 0.045, 0.3)
    mean, largest = plate.stress_factors(0.07, 0.045, 0.3)
    assert beam == pytest.approx(2362.5, rel=1e-6)
    assert closed_forms.drive_stiffness(THESIS) == pytest.approx(2540, rel=5e-3)  # shells
    assert closed_forms.max_stress(THESIS, 1e-3) / largest == pytest.approx(45.0e6, rel=1e-6)
    assert closed_forms.max_stress(THESIS, 1e-3) == pytest.approx(51.8e6, rel=0.01)  # shells
    assert 45.0e6 * mean == pytest.approx(48.6e6, rel=0.01)  # shells
    rod = closed_forms.support_x(THESIS) / plate.stretching(0.07, 0.045, 0.3)
    assert rod == pytest.approx(94.5e6, rel=1e-9)
    assert closed_forms.support_x(THESIS, 1e-3) == pytest.approx(84.9e6, rel=0.005)  # shells; 83 N/um as a beam
    assert closed_forms.shortening(THESIS, 1e-3) == pytest.approx(3e-6 / (5 * 0.07), rel=1e-12)
    euler = 2 * np.pi**2 * 210e9 * 0.045 * 0.35e-3**3 / 12 / 0.07**2
    assert closed_forms.buckling_load(THESIS) / plate.stiffening(0.07, 0.045, 0.3) == pytest.approx(euler, rel=1e-9)
    clamped = 1.028 * 0.35e-3 / 0.07**2 * np.sqrt(210e9 / 7850)
    assert closed_forms.leaf_bending(replace(THESIS, poisson=0.0)) == pytest.approx(clamped, rel=1e-3)


@pytest.mark.parametrize("model", [closed_form_model, beams])
def test_published_leaf_by_both_models(model: Any) -> None:
    evaluation = model(THESIS, 1e-3)
    named = {mode.name: mode.frequency for mode in evaluation.modes}
    assert evaluation.drive[0] == pytest.approx(2540, rel=5e-3)
    assert evaluation.stress == pytest.approx(51.8e6, rel=0.01)
    assert evaluation.support_x[[0, -1]] == pytest.approx([96.0e6, 84.9e6], rel=0.01)  # shells
    assert 10.9 < named["drive"] < 11.4
    stiffer = np.sqrt(210 / 200)  # shells at 200 GPa: 383.9 and 385.1 Hz
    assert named["leaf bending, out of phase"] == pytest.approx(383.9 * stiffer, rel=5e-3)
    assert named["leaf bending, in phase"] == pytest.approx(385.1 * stiffer, rel=5e-3)


def test_a_plain_beam_is_what_exudyn_makes_of_it() -> None:
    """Without lateral contraction only the correction of torsion is left; 2.365 N/mm with 32 elements, published."""
    evaluation = beams(replace(THESIS, poisson=0.0), 1e-3)
    assert evaluation.forces[-1] == pytest.approx(2.365, rel=2e-3)
    assert evaluation.drive[0] == pytest.approx(2362.5, rel=1e-3)
    assert evaluation.stress == pytest.approx(45.3e6, rel=0.01)
    assert evaluation.shortening == pytest.approx(3e-6 / (5 * 0.07), rel=0.01)


# ---- closed forms


@MANY
@given(springs=mechanisms(), share=st.floats(0.0, 0.05))
def test_stiffness_at_the_stage(springs: Mechanism, share: float) -> None:
    straight = closed_forms.stage_stiffness(springs)
    assert closed_model.stage_stiffness_at(springs, 0.0) == pytest.approx(straight, rel=2e-3, abs=1e-6 * straight[2, 2])
    bent = closed_model.stage_stiffness_at(springs, share * springs.length)
    unit = np.array([1, 1, 1, *[springs.length] * 3])
    for matrix in (straight, bent):
        even = matrix / np.outer(unit, unit)
        assert np.allclose(even, even.T, rtol=1e-9, atol=1e-9 * np.max(even))
        assert np.all(np.linalg.eigvalsh((even + even.T) / 2) > 0)
    # the mechanism is softest along the motion, and its supports fall as it deflects
    assert straight[2, 2] < straight[1, 1] < straight[0, 0] * 1.0001 + straight[1, 1]
    assert closed_forms.support_x(springs, share * springs.length) <= closed_forms.support_x(springs)
    if (
        springs.length >= springs.width and springs.poisson <= 0.35
    ):  # where docs/flexure.md says that the closed forms hold
        assert bent[0, 0] == pytest.approx(closed_forms.support_x(springs, share * springs.length), rel=0.03)
    assert bent[1, 1] == pytest.approx(closed_forms.support_y(springs, share * springs.length), rel=0.03)


@FEW
@given(springs=mechanisms(), share=st.floats(0.005, 0.05))
def test_twist_of_a_deflected_leaf(springs: Mechanism, share: float) -> None:
    """k_y against the numerical solution of the twist p of a leaf, p - p''/rate^2 = torque/(G J), p = 0 at clamps."""
    delta = share * springs.length
    half = springs.length / 2
    rate = plate.warping_rate(springs.width, springs.poisson)
    rigidity = springs.shear * plate.torsion_constant(springs.width, springs.thickness)

    def torque(s: np.ndarray) -> np.ndarray:
        """Return the torque of a unit force along y at the end, about the middle line 3 u^2 - 2 u^3.

        The linear part of that line is left out.
        """
        return 4 * delta * (s / springs.length) ** 3

    s = np.linspace(-half, half, 201)
    solution = solve_bvp(
        lambda s, p: np.stack([p[1], rate**2 * (p[0] - torque(s) / rigidity)]),
        lambda a, b: np.array([a[0], b[0]]),
        s,
        np.zeros((2, len(s))),
        tol=1e-8,
    )
    nodes, weights = np.polynomial.legendre.leggauss(60)
    twisted = half * np.sum(weights * solution.sol(half * nodes)[0] * torque(half * nodes))
    factor = plate.edgewise_shear_factor(springs.length, springs.width, springs.poisson)
    shear = 5 / 6 * springs.shear * springs.area * factor
    flat = springs.length**3 / (12 * springs.young * springs.edgewise) + springs.length / shear
    assert closed_forms.support_y(springs, delta) == pytest.approx(springs.leaves / (flat + twisted), rel=1e-5)


@FEW
@given(many=st.lists(mechanisms(), min_size=3, max_size=3))
def test_arrays_are_one_by_one(many: list[Mechanism]) -> None:
    arrays = together(many)
    stroke = np.array([alone.length / 50 for alone in many])
    for name in ("drive_stiffness", "buckling_load", "leaf_bending", "leaf_torsion", "lateral_load"):
        f = getattr(closed_forms, name)
        assert f(arrays) == pytest.approx([f(alone) for alone in many], rel=1e-12)
    for name in ("support_x", "support_y", "max_stress", "shortening"):
        f = getattr(closed_forms, name)
        assert f(arrays, stroke) == pytest.approx([f(*pair) for pair in zip(many, stroke, strict=True)], rel=1e-12)
    for name in ("stage_stiffness", "stage_mass"):
        f = getattr(closed_forms, name)
        assert np.allclose(f(arrays), [f(alone) for alone in many], rtol=1e-12, atol=0)
    frequencies = closed_forms.modes(arrays)[0]
    assert np.allclose(frequencies, [closed_forms.modes(alone)[0] for alone in many], rtol=1e-7, atol=0)
    assert np.allclose(first_interfering(arrays), [first_interfering(alone) for alone in many], rtol=1e-7)
    assert np.allclose(parasitic_mode(arrays), np.transpose([parasitic_mode(alone) for alone in many]), rtol=1e-7)
    for k, item in enumerate(many):
        assert closed_forms.drive_stiffness(arrays.member(k)) == closed_forms.drive_stiffness(item)


def displacements(springs: Mechanism, s: np.ndarray) -> np.ndarray:
    """Return how leaves move at s, from 0 at the cart to 1, shape (leaves, points, 3, 7).

    The motions are per stage coordinate, and for the first mode of clamped beams, all alike, at unit modal mass; `s`
    are the nodes of Gauss's rule.
    """
    place, slope = 3 * s**2 - 2 * s**3, springs.length * (s**3 - s**2)
    root = brentq(lambda x: np.cos(x) * np.cosh(x) - 1, 4.5, 5.0)
    first, second = np.sinh(root) - np.sin(root), np.cos(root) - np.cosh(root)
    bending = first * (np.cosh(root * s) - np.cos(root * s)) + second * (np.sinh(root * s) - np.sin(root * s))
    weights = np.polynomial.legendre.leggauss(len(s))[1]
    bending *= np.sign(bending[len(s) // 2]) / np.sqrt(
        springs.leaves * springs.leaf_mass * np.sum(weights / 2 * bending**2)
    )
    moved = np.zeros((int(springs.leaves), len(s), 3, 7))
    for leaf, offset in zip(moved, springs.offsets, strict=True):
        leaf[:, 0, 0], leaf[:, 0, 4] = s, offset * s
        leaf[:, 1, 1], leaf[:, 1, 3], leaf[:, 1, 5] = place, -offset * place, slope
        leaf[:, 2, 2], leaf[:, 2, 4], leaf[:, 2, 6] = place, -slope, bending
    return moved


@MANY
@given(springs=mechanisms())
def test_modes_of_stage_and_leaves(springs: Mechanism) -> None:
    """Against a mass matrix from the displacements of the leaves, and a stage moved as a rigid body."""
    nodes, weights = np.polynomial.legendre.leggauss(24)
    s = (nodes + 1) / 2
    moved = displacements(springs, s)
    mass = springs.leaf_mass * np.einsum("p,lpca,lpcb->ab", weights / 2, moved, moved)
    mass[3, 3] += (
        springs.leaves * springs.leaf_mass * springs.width**2 / 12 * np.sum(weights / 2 * s**2)
    )  # leaves twist linearly
    arm = np.subtract(springs.body.centre, (springs.length, 0.0, 0.0))
    rigid = np.eye(6)
    rigid[:3, 3:] = np.cross(np.eye(3), arm).T  # column k: e_k x arm
    mass[:6, :6] += rigid.T @ np.diag([springs.body.mass] * 3 + list(springs.body.inertia)) @ rigid
    stiffness = block_diag(closed_forms.stage_stiffness(springs), (2 * np.pi * closed_forms.leaf_bending(springs)) ** 2)
    frequencies, shapes = closed_forms.modes(springs)
    squares = eigh(stiffness, mass, eigvals_only=True)
    assert frequencies == pytest.approx(np.sqrt(squares) / (2 * np.pi), rel=1e-9)
    assert np.allclose(shapes.T @ mass @ shapes, np.eye(7), atol=1e-9)
    drive = int(closed_forms.drive_mode(frequencies, shapes))
    compliances = (shapes[2] / (2 * np.pi * frequencies)) ** 2
    assert np.linalg.inv(stiffness)[2, 2] == pytest.approx(np.sum(compliances), rel=1e-9)
    assert compliances[drive] > 0.5 * np.sum(compliances)


@FEW
@given(springs=mechanisms(), centre=st.floats(-0.2, 0.3), actuation=SHARE, sensor=SHARE, together=st.booleans())
def test_first_interfering_mode_of_both_models(
    springs: Mechanism, centre: float, actuation: float, sensor: float, together: bool
) -> None:
    """Centre of mass, actuation and sensor anywhere along x, the latter two at one place or at two."""
    pushed, seen = ((share * springs.length, 0.0, 0.0) for share in (actuation, actuation if together else sensor))
    body = replace(springs.body, centre=((1 + centre) * springs.length, 0.0, 0.0))
    springs = replace(springs, body=body, actuation=pushed, sensor=seen)
    by_beams, by_closed = beams(springs, springs.length / 300), closed_form_model(springs, springs.length / 300)
    peak = VISIBLE_PEAK
    assume(not any(peak / 1.5 < mode.peak < peak * 1.5 for mode in by_beams.modes[1:]))  # seen by one alone
    assert (by_closed.interfering is None) == (by_beams.interfering is None)
    if by_closed.interfering and by_beams.interfering:
        assert by_closed.interfering.frequency == pytest.approx(by_beams.interfering.frequency, rel=0.02)
        assert first_interfering(springs) == pytest.approx(by_closed.interfering.frequency, rel=1e-9)
    else:
        assert first_interfering(springs) == np.inf


def test_lateral_load_without_dimensions() -> None:
    """theta'' = -p^2 m (m theta - mean of m theta), m = 1 - x, theta(0) = theta(1) = 0 by finite differences."""
    n = 400
    m = 1 - np.arange(1, n) / n
    second = (2 * np.eye(n - 1) - np.eye(n - 1, k=1) - np.eye(n - 1, k=-1)) * n**2
    loads = np.linalg.eigvals(np.linalg.solve(second, np.diag(m**2) - np.outer(m, m) / n)).real
    assert 1 / np.sqrt(np.max(loads)) == pytest.approx(closed_forms.LATERAL_BUCKLING, rel=1e-3)


def lateral_load_without_warping(springs: Mechanism) -> float:
    """Return the lateral load of leaves whose clamps forbid them to warp (Vlasov), by Ritz's method.

    At the clamps, theta = theta' = 0.
    """
    nodes, weights = np.polynomial.legendre.leggauss(60)
    x, weights = (nodes + 1) / 2, weights / 2
    base = [Polynomial([0, 0, 1, -2, 1]) * Polynomial([-1, 2]) ** n for n in range(12)]
    twist, rate, warping = (
        np.array([function.deriv(k)(x) if k else function(x) for function in base]) for k in range(3)
    )
    decay = plate.warping_rate(springs.width, springs.poisson) * springs.length
    stiff = (rate * weights) @ rate.T + (warping * weights) @ warping.T / decay**2
    bent = (1 - x) * twist
    mean = bent @ weights
    largest = np.max(eigh((bent * weights) @ bent.T - np.outer(mean, mean), stiff, eigvals_only=True))
    return float(closed_forms.lateral_load(springs) / closed_forms.LATERAL_BUCKLING / np.sqrt(largest))


def lateral_load_by_beams(springs: Mechanism) -> float:
    """Force across the ends of straight leaves [N] at which their tangent stiffness is singular, linearised: the stage
    free along y and z and to turn about z."""
    leaves = LeafBeams(springs, elements=32)
    node = np.arange(6, 6 * leaves.nodes).reshape(-1, 6)
    plane = np.concatenate([node[:-1, [1, 5]].ravel(), node[-1, [1, 5]]])
    out = np.concatenate([node[:-1, [2, 3, 4]].ravel(), node[-1, [2]]])

    def tangent(state: np.ndarray, free: np.ndarray) -> np.ndarray:
        return leaves.stiffness(state.reshape(1, -1, 6))[0][np.ix_(free, free)]

    state, force = np.zeros(6 * leaves.nodes), np.zeros(len(plane))
    force[-2] = 1.0
    state[plane] = np.linalg.solve(tangent(state, plane), force)
    step = 1e-5 * springs.length / np.max(np.abs(state))
    softer = (tangent(step * state, out) - tangent(-step * state, out)) / (2 * step)
    return float(springs.leaves / np.max(eigh(softer, tangent(0 * state, out), eigvals_only=True)))


@pytest.mark.parametrize(("width", "above"), [(0.02, 1.2), (0.03, 1.3), (0.045, 1.45)])
def test_lateral_load(width: float, above: float) -> None:
    """The closed form lets leaves warp, which clamps forbid: it is on the safe side, the nearer the more slender."""
    springs = mechanism(width=width)
    by_closed, by_beams = closed_forms.lateral_load(springs), lateral_load_by_beams(springs)
    assert 1 < by_beams / by_closed < above
    bound = np.sqrt(plate.stiffening(springs.length, springs.width, springs.poisson)) * lateral_load_without_warping(
        springs
    )
    assert by_beams < bound
    slender = mechanism(length=3.0, width=width)
    assert 1 < lateral_load_without_warping(slender) / closed_forms.lateral_load(slender) < 1.01


def test_numbers_that_make_no_mechanism_are_nan() -> None:
    frequencies, _ = closed_forms.modes(together([THESIS, replace(THESIS, length=np.nan), THESIS]))
    assert np.isnan(frequencies).all(axis=1).tolist() == [False, True, False]


def test_drive_mode_of_a_heavy_stage() -> None:
    """On narrow leaves a long stage turns about z more slowly than it moves along the drive."""
    springs = mechanism(0.06, 0.01, 0.3e-3, spacing=0.03, mass=3.0)
    by_beams, by_closed = beams(springs, 1e-3).modes[0], closed_form_model(springs, 1e-3).modes[0]
    assert by_beams.name == by_closed.name == "drive"
    assert by_closed.frequency == pytest.approx(by_beams.frequency, rel=0.01)
    assert first_interfering(springs) != pytest.approx(by_beams.frequency, rel=0.01)


# ---- beams


@FEW
@given(springs=mechanisms(), share=st.floats(0.002, 0.02))
def test_beams_agree_with_closed_forms(springs: Mechanism, share: float) -> None:
    stroke = share * springs.length
    by_closed, by_beams = closed_form_model(springs, stroke), beams(springs, stroke)
    assert by_beams.drive[0] == pytest.approx(by_closed.drive[0], rel=0.01)  # the stage may turn
    assert by_beams.forces == pytest.approx(by_closed.forces, rel=0.03)
    assert by_beams.support_x == pytest.approx(by_closed.support_x, rel=0.05)
    assert by_beams.support_y == pytest.approx(by_closed.support_y, rel=0.05)
    assert by_beams.stress == pytest.approx(by_closed.stress, rel=0.05)
    assert by_beams.shortening == pytest.approx(by_closed.shortening, rel=0.02)
    assert by_beams.buckling == pytest.approx(by_closed.buckling, rel=0.015)
    assert by_beams.modes[0].name == by_closed.modes[0].name == "drive"
    assert by_beams.modes[0].frequency == pytest.approx(by_closed.modes[0].frequency, rel=0.01)
    unit = np.array([1, 1, 1, *[springs.length] * 3])
    for matrix in by_beams.stiffness / np.outer(unit, unit):
        assert np.allclose(matrix, matrix.T, rtol=1e-6, atol=1e-6 * np.max(matrix))
        assert np.all(np.linalg.eigvalsh((matrix + matrix.T) / 2) > 0)


@FEW
@given(springs=mechanisms())
def test_tangent_is_the_slope_of_the_force(springs: Mechanism) -> None:
    """The drive stiffness is the derivative of the force over the stroke, which a parabola through three fits."""
    evaluation = beams(springs, springs.length / 50)
    step = evaluation.deflections[1]
    slopes = (evaluation.forces[2:] - evaluation.forces[:-2]) / (2 * step)
    assert slopes == pytest.approx(evaluation.drive[1:-1], rel=2e-4)
    work = np.sum((evaluation.forces[1:] + evaluation.forces[:-1]) / 2) * step - step**2 / 12 * (
        evaluation.drive[-1] - evaluation.drive[0]
    )
    linear = evaluation.drive[0] * evaluation.stroke**2 / 2
    assert work == pytest.approx(linear, rel=2 * evaluation.nonlinearity + 1e-6)


class Pushed:
    """Leaves between a cart at rest and a stage anywhere, by virtual work alone: the stage goes by displacements [m]
    and a rotation vector [rad] about axes at rest, on top of a turn [rad] about y; its inner nodes are solved for."""

    def __init__(self, springs: Mechanism) -> None:
        self.leaves, self.offsets = LeafBeams(springs), springs.offsets
        self.state = np.zeros((self.leaves.count, self.leaves.nodes, 6))

    def ends(self, move: np.ndarray, turn: float) -> np.ndarray:
        """Coordinates of the leaf ends, shape (leaves, 6)."""
        rotation = Rotation.from_rotvec(move[3:]) * Rotation.from_euler("y", turn)
        arms = np.stack([0 * self.offsets, 0 * self.offsets, self.offsets], axis=1)
        angles = np.tile(rotation.as_euler("XYZ"), (len(arms), 1))
        return np.concatenate([move[:3] + rotation.apply(arms) - arms, angles], axis=1)

    def slopes(self, move: np.ndarray, turn: float) -> np.ndarray:
        """Return how leaf ends follow the stage, shape (leaves, 6, 6)."""
        steps = 1e-6 * np.eye(6)
        return np.stack([self.ends(move + h, turn) - self.ends(move - h, turn) for h in steps], axis=2) / 2e-6

    def forces(self, move: np.ndarray, turn: float) -> np.ndarray:
        """Force and moment [N, N m] on the stage, shape (6,), conjugate to `move`."""
        state = self.state
        state[:, -1] = self.ends(move, turn)
        for _ in range(4):
            inner = self.leaves.forces(state)[:, 1:-1].reshape(len(state), -1, 1)
            slope = self.leaves.stiffness(state)[:, 6:-6, 6:-6]
            state[:, 1:-1] -= np.linalg.solve(slope, inner).reshape(state[:, 1:-1].shape)
        return np.einsum("lik,li->k", self.slopes(move, turn), self.leaves.forces(state)[:, -1])

    def stiffness(self, move: np.ndarray, turn: float) -> np.ndarray:
        """The slope of these forces, shape (6, 6)."""
        steps = np.diag([1e-8, 1e-8, 1e-8, 1e-6, 1e-6, 1e-6])
        return np.array([(self.forces(move + h, turn) - self.forces(move - h, turn)) / (2 * h.sum()) for h in steps]).T

    def to(self, stroke: float, steps: int) -> tuple[np.ndarray, float]:
        """Return where the stage is at this z [m], free along x and about y.

        Newton's method solves for all free coordinates at once.
        """
        x, turn, rate, last = 0.0, 0.0, 0 * self.state, 0.0
        for z in stroke * np.linspace(0, 1, steps + 1)[1:] ** 2:
            before, state = self.state, self.state + (z - last) * rate
            for _ in range(12):
                move = np.array([x, 0, z, 0, 0, 0])
                state[:, -1] = self.ends(move, turn)
                forces, follow = self.leaves.forces(state)[:, 1:], self.slopes(move, turn)[:, :, [0, 4]]
                bend = (self.slopes(move, turn + 1e-6) - self.slopes(move, turn - 1e-6))[:, :, 4] / 2e-6
                free = block_diag(*[np.eye(forces[0].size - 6)] * len(state), np.eye(2))
                ways = np.split(free[:-2], len(state))
                slope = np.zeros((len(free), len(free)))
                for matrix, motion, end in zip(self.leaves.stiffness(state)[:, 6:, 6:], ways, follow, strict=True):
                    motion = np.concatenate([motion, end @ free[-2:]])
                    slope += motion.T @ matrix @ motion
                slope[-1, -1] += np.sum(bend * forces[:, -1])
                out = np.concatenate([forces[:, :-1].ravel(), np.einsum("lik,li->k", follow, forces[:, -1])])
                change = -np.linalg.solve(slope, out)
                state[:, 1:-1] += change[:-2].reshape(state[:, 1:-1].shape)
                x, turn = x + change[-2], turn + change[-1]
            self.state, rate, last = state, (state - before) / (z - last), z
        return np.array([x, 0, stroke, 0, 0, 0]), turn


@pytest.mark.slow
def test_a_stage_that_turns_as_it_is_pushed() -> None:
    """Leaves near each other hardly keep the stage from turning: its whole stiffness, as it stands, by virtual work."""
    springs, stroke = mechanism(spacing=0.003), 6e-3
    pushed = Pushed(springs)
    move, turn = pushed.to(stroke, 16)
    expected, evaluation = pushed.stiffness(move, turn), beams(springs, stroke)
    assert abs(turn) > 0.01
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    assert np.abs((evaluation.stiffness[-1] - expected) / scale).max() < 2e-5
    assert evaluation.forces[-1] == pytest.approx(pushed.forces(move, turn)[2], rel=1e-5)
    assert evaluation.shortening == pytest.approx(-move[0], rel=1e-4)


@pytest.mark.parametrize("leaves", [2, 3, 4])
def test_mirrored_motion(leaves: int) -> None:
    """Pushed either way by the same amount, leaves in a row that is even about its middle answer the same."""
    springs = mechanism(leaves=leaves)
    system = LeafBeams(springs)
    rng = np.random.default_rng(leaves)
    inner = rng.standard_normal((leaves, system.nodes - 2, 3)) * np.array([1e-6, 1e-4, 1e-3])
    place = Configuration(inner, np.array([-2e-6, 5e-4, 1e-5]))
    mirrored = Configuration(inner[::-1] * [1, -1, -1], place.stage * [1, -1, -1])
    there, back = (system.forces(configuration.state(springs.offsets)) for configuration in (place, mirrored))
    assert np.allclose(back[::-1, :, 0::2] * [1, -1, -1], there[:, :, 0::2], atol=1e-9 * np.max(np.abs(there)))


@pytest.mark.parametrize("leaves", [3, 4])
def test_more_leaves(leaves: int) -> None:
    """Each leaf bears its share; the leaves of a row move alike if the stage does not turn."""
    two, more = beams(THESIS, 1e-3), beams(mechanism(leaves=leaves), 1e-3)
    for name in ("forces", "drive", "support_x", "support_y"):
        assert getattr(more, name) == pytest.approx(leaves / 2 * getattr(two, name), rel=2e-3)
    assert more.stress == pytest.approx(two.stress, rel=3e-3)
    assert more.buckling == pytest.approx(leaves / 2 * two.buckling, rel=1e-3)
    names = [mode.name for mode in more.modes]
    assert names.count("leaf bending, in phase") == 1
    assert names.count("leaf bending, out of phase") == leaves - 1


def test_elements_converge() -> None:
    coarse, fine = beams(THESIS, 1.4e-3), beams(THESIS, 1.4e-3, elements=48)
    assert coarse.forces == pytest.approx(fine.forces, rel=1e-3)
    assert coarse.support_x == pytest.approx(fine.support_x, rel=5e-3)
    assert coarse.support_y == pytest.approx(fine.support_y, rel=5e-3)


def test_modes_have_unit_modal_mass_and_are_orthogonal() -> None:
    """The modes are orthogonal as far as the stage shows, by far the heaviest part."""
    evaluation = beams(replace(THESIS, density=1.0), 1e-3)
    of_stage = [mode for mode in evaluation.modes if np.linalg.norm(mode.stage) > 0.1]
    shapes = np.array([mode.stage for mode in of_stage]).T
    assert "drive" in [mode.name for mode in of_stage]
    assert np.allclose(
        shapes.T @ closed_forms.body_mass(evaluation.mechanism) @ shapes, np.eye(len(of_stage)), atol=1e-2
    )


@pytest.mark.parametrize(
    ("change", "stroke", "text"),
    [
        ({"thickness": -1e-3}, 1e-3, "positive thickness"),
        ({"length": np.nan}, 1e-3, "positive length"),
        ({"young": np.inf}, 1e-3, "positive young"),
        ({}, 0.0, "positive stroke"),
        ({}, np.nan, "positive stroke"),
        ({}, 0.2, "reduce the stroke"),
        ({}, 1e30, "reduce the stroke"),
    ],
)
def test_failures_say_so_and_print_nothing(change: dict[str, float], stroke: float, text: str, capfd: Any) -> None:
    with pytest.raises(BeamFailure, match=text):
        beams(replace(THESIS, **change), stroke)
    assert capfd.readouterr() == ("", "")
