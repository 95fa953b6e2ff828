"""Model one leaf as a plate, and define the parallel leaf-spring mechanism (thesis, Fig. 6) with its results.

A plate is stiffer than a beam of equal section. A leaf bent along its length curls across it (anticlastic curvature)
and a twisted leaf warps, unless clamps prevent it; both make the leaf stiffer near the clamps.

The deflection is taken as W(x, y) = f(x) + g(x) (y^2/2 - w^2/24), for twisting W = theta(x) y. Kirchhoff's energy is
least for a function g (and theta) that solves a linear equation with constant coefficients, which gives closed forms
(Kantorovich's method; Timoshenko & Woinowsky-Krieger, Theory of Plates and Shells, 1959, Sec. 82 for the energy). With
more functions across the width the solution converges (tests/ritz.py) to nearly constant multiples of the closed forms.
The width is assumed to be many times the thickness.

In a leaf, lengths are in m, arrays allowed; s runs along the leaf from its middle, from -L/2 to L/2.

In a mechanism, x runs along the leaves, from the cart (0) to the stage (L), y along their width, z through their
thickness, which is the direction of motion. The origin lies between the clamps at the cart, in the middle of the width
and of the row of leaves. Numbers may be arrays of one shape: many mechanisms at once.

Results are at a stroke, and any model may give them. Modes are named by the part with the largest fraction of the
kinetic energy.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

CONVERGED_STIFFENING, CONVERGED_PEAK = 0.878, 0.63
"""Fractions that remain with more functions across the width: of the stiffening (0.866 to 0.895 at a Poisson's ratio of
0.3, 0.854 to 0.909 from 0.05 to 0.45), and of the excess stress (0.60, for square leaves 0.65). They hold for leaves
from 1 to 6 times as long as wide (tests/ritz.py)."""


@dataclass(frozen=True)
class Curl:
    """Curvature across a leaf (anticlastic) that a bending moment along it causes.

    If `odd`, the moment is m = s, as in the parallel motion of the leaf's ends; otherwise m = 1, as where the ends turn
    against each other.

    g = -nu/(1 - nu^2) (m - a h1 - b h2), where m is the moment per flexural rigidity D w. h1 and h2 decay from the
    clamps (`rates` [1/m]). a and b (`weights`) make g and its slope 0 there.
    """

    poisson: Any
    rates: tuple[Any, Any]
    weights: tuple[Any, Any]
    odd: bool

    @classmethod
    def of(cls, length: Any, width: Any, poisson: Any, odd: bool) -> Curl:
        # w^4/720 g'''' - (1 - nu) w^2/6 g'' + (1 - nu^2) g = -nu m; both squares are positive up to nu = 1/2
        """Return the curvature of leaves of a length and width [m].

        `odd` stands for a moment that changes sign in the middle.
        """
        middle, square = (1 - poisson) / 6, 4 * (1 - poisson**2) / 720
        root = np.sqrt(middle**2 - square)
        fast, slow = (np.sqrt(360 * (middle + sign * root)) / width for sign in (1, -1))
        half = length / 2
        at_clamp = (half, 1.0) if odd else (1.0, 0.0)
        # a + b = m, a slope_1 + b slope_2 = m' at the clamp, where h is 1 and h' is rate/tanh or rate tanh
        tanhs = [np.tanh(rate * half) for rate in (fast, slow)]
        slopes = [rate / (tanh if odd else 1 / tanh) for rate, tanh in zip((fast, slow), tanhs, strict=True)]
        a = (at_clamp[1] - at_clamp[0] * slopes[1]) / (slopes[0] - slopes[1])
        return cls(poisson, (fast, slow), (a, at_clamp[0] - a), odd)

    def shape(self, s: Any, length: Any, derivative: int = 0) -> Any:
        """Return m - a h1 - b h2 at s or, if `derivative` is 2, its second derivative."""
        moment = (s if self.odd else 1.0) if derivative == 0 else 0.0
        terms = (
            weight * rate**derivative * _decay(rate, s, length, self.odd)
            for rate, weight in zip(self.rates, self.weights, strict=True)
        )
        return moment - sum(terms)

    def curvature(self, s: Any, length: Any) -> Any:
        """Return the curvature f'' along the leaf at s, under the moment m."""
        moment = s if self.odd else 1.0
        return moment + self.poisson**2 / (1 - self.poisson**2) * self.shape(s, length)


def _decay(rate: Any, s: Any, length: Any, odd: bool) -> Any:
    """Return sinh(rate s) / sinh(rate L/2) if `odd`, else cosh(rate s) / cosh(rate L/2).

    Neither overflows.
    """
    half = rate * length / 2
    sign = -1.0 if odd else 1.0
    size = np.abs(s)
    ratio = (np.exp(rate * size - half) + sign * np.exp(-rate * size - half)) / (1 + sign * np.exp(-2 * half))
    return np.sign(s) * ratio if odd else ratio


def stiffening(length: Any, width: Any, poisson: Any, odd: bool = True) -> Any:
    """Return the factor by which clamps make a leaf stiffer than a beam.

    The factor grows from 1 for a narrow leaf to 1/(1 - nu^2) for a wide one. If `odd`, it is for the parallel motion of
    the ends, k = factor 12 E I/L^3; otherwise for turning them against each other, k = factor E I/L.
    """
    curl = Curl.of(length, width, poisson, odd)
    # compliance: integral of f'' m over that of m^2, times (1 - nu^2) for a beam
    share = poisson**2 / (1 - poisson**2)
    beam = length**3 / 12 if odd else length
    decays = zip(curl.rates, curl.weights, strict=True)
    reduction = sum(weight * _moment_of(rate, length, odd) for rate, weight in decays)
    compliance = 1 + share * (1 - reduction / beam)
    return 1 + CONVERGED_STIFFENING * (1 / ((1 - poisson**2) * compliance) - 1)


def compliance_profile(s: Any, length: Any, width: Any, poisson: Any) -> Any:
    """Return the bending compliance at s relative to a beam.

    A beam with this compliance has the stiffness of the plate in the parallel motion of its ends.
    """
    curl = Curl.of(length, width, poisson, odd=True)
    stiff = 1 - (1 - poisson**2) * curl.curvature(s, length) / s
    factor = stiffening(length, width, poisson)
    return (
        1 - stiff * (CONVERGED_STIFFENING + factor - 1) / factor
    )  # fraction of `stiff` that remains with more functions


def _moment_of(rate: Any, length: Any, odd: bool) -> Any:
    """Return the integral of `_decay` times the moment m over a leaf: m = s if `odd`, else 1."""
    half = rate * length / 2
    return (length * rate / np.tanh(half) - 2) / rate**2 if odd else 2 * np.tanh(half) / rate


def stress_factors(length: Any, width: Any, poisson: Any) -> tuple[Any, Any]:
    """Return the bending stress at the clamp relative to a beam, 3 E t delta/L^2.

    The first factor is the mean over the width. The second is the largest, except at the very corners, where theory has
    no bound.
    """
    curl = Curl.of(length, width, poisson, odd=True)
    half = length / 2
    mean = stiffening(length, width, poisson)
    uncurling = poisson / (1 - poisson**2) * curl.shape(half, length, derivative=2) * width**2 / 24
    return mean, 1 + CONVERGED_PEAK * (mean * (1 + uncurling / half) - 1)


def warping_rate(width: Any, poisson: Any) -> Any:
    """Return the rate [1/m] at which a clamp's restraint of warping decays along a twisted leaf."""
    return np.sqrt(24 * (1 - poisson)) / width


def torsion_stiffness(length: Any, width: Any, thickness: Any, shear: Any, poisson: Any) -> Any:
    """Return the torsional stiffness of a leaf between clamps [N m/rad].

    `shear` is its shear modulus [Pa]; lengths are in metres [m].
    """
    u = warping_rate(width, poisson) * length / 2
    return torsion_constant(width, thickness) * shear / length / (1 - np.tanh(u) / u)


def torsion_constant(width: Any, thickness: Any) -> Any:
    """Return J of a rectangle [m^4] (Roark's formula) whose width exceeds its thickness."""
    ratio = thickness / width
    return width * thickness**3 * (1 / 3 - 0.21 * ratio * (1 - ratio**4 / 12))


def cubic_twist(s: Any, length: Any, width: Any, poisson: Any) -> Any:
    """Return the rate of twist at s under a torque that goes with s^3.

    A force across a deflected leaf makes such a torque. A leaf free to warp would twist at the rate s^3. The clamps
    change it: p - p''/rate^2 = s^3, with p = 0 at the clamps. s is in half lengths, from -1 to 1.
    """
    rate = warping_rate(width, poisson) * length / 2
    return s**3 + 6 * s / rate**2 - (1 + 6 / rate**2) * _decay(rate, s, 2.0, odd=True)


TILT_ITERATIONS = 8
"""Iterations of the tilt. Four reach rounding."""


def tilted(shares: np.ndarray, torques: np.ndarray, places: np.ndarray, weighted_sum: float) -> np.ndarray:
    """Multiply torsional compliances `shares` (n,) by exp(tilt place^2), for a tilt to be found.

    `places` (n,) run along the leaf. The tilt makes the sum of the compliances, weighted by the square of the `torques`
    (n,), equal to `weighted_sum`. Their plain sum stays, so that an even torque twists the leaf as before.
    """
    tilt, total = 0.0, shares.sum()
    for _ in range(TILT_ITERATIONS):
        now = shares * np.exp(tilt * places**2)
        now *= total / now.sum()
        met = now @ torques**2
        slope = now @ (torques * places) ** 2 - met * (now @ places**2) / total
        tilt += (weighted_sum - met) / slope
    now = shares * np.exp(tilt * places**2)
    return now * total / now.sum()


def free_twist(s: Any, length: Any, width: Any, poisson: Any) -> Any:
    """Return the rate of twist at s relative to a leaf free to warp, under an even torque."""
    return 1 - _decay(warping_rate(width, poisson), s, length, odd=False)


def stretching(length: Any, width: Any, poisson: Any) -> Any:
    """Return the factor by which a leaf is stiffer along its length than a rod.

    The clamps of the leaf keep it from growing narrower. The factor is fitted to shells (tests/shells.py) of 0.6 to 6
    times the width in length, with Poisson's ratios from 0 to 0.45.
    """
    return 1 / (1 - 0.28 * poisson**2 * width / length)


def edgewise_shear_factor(length: Any, width: Any, poisson: Any) -> Any:
    """Return the factor by which a leaf is stiffer against shear in its plane than a beam.

    Bending of the leaf in that plane is taken as for a beam. The factor is fitted to shells (tests/shells.py).
    """
    ratio = length / width
    beam = 2.4 * (1 + poisson) * ratio
    return beam / np.maximum(beam - 0.55 * poisson**2 * ratio**2 - 0.076 - 0.13 * poisson, beam / 2)


AXES = ("x", "y", "z")

STANDARD_GRAVITY = 9.80665
"""Standard acceleration of free fall [m/s^2]."""

ALUMINIUM_DENSITY = 2700.0
"""Density [kg/m^3] of the block that stands in for a stage whose inertia is not given."""


@dataclass(frozen=True)
class MovingBody:
    """The stage as a rigid body: mass [kg], moments of inertia [kg m^2], and centre of mass [m].

    Moments of inertia are about axes through the centre of mass. Each triple stands for x, y, z. Products of inertia
    are 0.
    """

    mass: Any
    inertia: tuple[Any, Any, Any]
    centre: tuple[Any, Any, Any]


@dataclass(frozen=True)
class Mechanism:
    """Leaves in a row, neighbours `spacing` apart, all of `length`, `width` and `thickness` [m].

    `young` [Pa], `poisson`, `density` [kg/m^3], `yield_strength` and `fatigue` [Pa] (NaN if unknown) describe their
    material. `actuation` and `sensor` are the points [m] where the actuator pushes along z and where the position along
    z is measured. `damping_ratio` is that of the mechanism's own modes, `stress_concentration` a factor on the stress
    at the clamps. The `load` [N] presses along the leaves, on all of them together.
    """

    leaves: Any
    length: Any
    width: Any
    thickness: Any
    spacing: Any
    young: Any
    poisson: Any
    density: Any
    yield_strength: Any
    fatigue: Any
    body: MovingBody
    actuation: tuple[Any, Any, Any]
    sensor: tuple[Any, Any, Any]
    damping_ratio: Any = 0.01
    stress_concentration: Any = 1.0
    load: Any = 0.0

    @classmethod
    def of(cls, flat: Mapping[str, Any]) -> Mechanism:
        """Build the mechanism of a stage given as flat keys to SI numbers or arrays.

        Raises KeyError for a stage without [flexure].
        """
        section = {key.removeprefix("flexure."): value for key, value in flat.items() if key.startswith("flexure.")}
        names = ("leaves", "length", "width", "thickness", "spacing", "young", "poisson", "density")
        shape = {name: section[name] for name in names}
        bare = cls(
            **shape,
            yield_strength=section["yield"],
            fatigue=section.get("fatigue", np.nan),
            body=MovingBody(flat["masses.stage"], (0.0, 0.0, 0.0), (section["length"], 0.0, 0.0)),
            actuation=(section["length"], 0.0, 0.0),
            sensor=(section["length"], 0.0, 0.0),
            damping_ratio=section["damping_ratio"],
            stress_concentration=section["stress_concentration"],
            load=section.get("load", 0.0),
        )
        inertia = _triple(section, "inertia", block_inertia(bare.body.mass, bare.width, bare.depth))
        centre = _triple(section, "centre", bare.body.centre)
        actuation = _triple(section, "actuation", centre)
        body, sensor = MovingBody(bare.body.mass, inertia, centre), _triple(section, "sensor", actuation)
        return replace(bare, body=body, actuation=actuation, sensor=sensor)

    def member(self, number: int) -> Mechanism:
        """Return one mechanism, with plain numbers, out of many that are arrays, by its number."""

        def pick(value: Any) -> Any:
            if isinstance(value, tuple):
                return tuple(map(pick, value))
            if isinstance(value, MovingBody):
                return MovingBody(*(pick(getattr(value, field.name)) for field in fields(MovingBody)))
            return float(value[number]) if np.ndim(value) else value

        return Mechanism(*(pick(getattr(self, field.name)) for field in fields(Mechanism)))

    @property
    def weight(self) -> Any:
        """Return the weight of the stage [N]."""
        return STANDARD_GRAVITY * self.body.mass

    @property
    def shear(self) -> Any:
        """Return the shear modulus [Pa]."""
        return self.young / (2 * (1 + self.poisson))

    @property
    def area(self) -> Any:
        """Return the cross-section of a leaf [m^2]."""
        return self.width * self.thickness

    @property
    def bending(self) -> Any:
        """Return the second moment of area of a leaf in the direction of motion [m^4]."""
        return self.width * self.thickness**3 / 12

    @property
    def edgewise(self) -> Any:
        """Return the second moment of area of a leaf in its plane [m^4]."""
        return self.thickness * self.width**3 / 12

    @property
    def plate_shape(self) -> tuple[Any, Any, Any]:
        """Return length [m], width [m] and Poisson's ratio of a leaf, of which its stiffness as a plate depends."""
        return self.length, self.width, self.poisson

    @property
    def torsional_rigidity(self) -> Any:
        """Return the rigidity of a leaf in torsion, G J [N m^2], where it is free to warp."""
        return self.shear * torsion_constant(self.width, self.thickness)

    @property
    def leaf_mass(self) -> Any:
        """Return the mass of a leaf between its clamps [kg]."""
        return self.density * self.area * self.length

    @property
    def depth(self) -> Any:
        """Return the distance between the outermost leaves [m]."""
        return (self.leaves - 1) * self.spacing

    @property
    def offset_squares(self) -> Any:
        """Return the sum over the leaves of their squared distance from the middle of the row [m^2]."""
        return self.spacing**2 * self.leaves * (self.leaves**2 - 1) / 12

    @property
    def offsets(self) -> np.ndarray:
        """Return the places of a single mechanism's leaves along z [m], shape (leaves,)."""
        return (np.arange(int(self.leaves)) - (int(self.leaves) - 1) / 2) * float(self.spacing)


def block_inertia(mass: Any, width: Any = 0.0, depth: Any = 0.0) -> tuple[Any, Any, Any]:
    """Return the moments of inertia [kg m^2] of an aluminium block of a mass [kg] that bears on its leaves.

    The block stands in for a stage of unknown inertia. It is a cube, unless the `width` of the leaves or the `depth` of
    their row [m] is larger; then it reaches as far as they do, and is flatter along the leaves.
    """
    volume = mass / ALUMINIUM_DENSITY
    edge = volume ** (1 / 3)
    across, along = np.maximum(edge, width), np.maximum(edge, depth)
    squares = (volume / (across * along)) ** 2, across**2, along**2
    x, y, z = (mass / 12 * (sum(squares) - square) for square in squares)
    return x, y, z


def _triple(section: Mapping[str, Any], name: str, default: tuple[Any, Any, Any]) -> tuple[Any, Any, Any]:
    """Return the three keys of a point or of inertias, each as given or its default."""
    return tuple(section.get(f"{name}_{axis}", value) for axis, value in zip(AXES, default, strict=True))  # type: ignore[return-value]


def along_motion(mechanism: Mechanism, point: tuple[Any, Any, Any], shapes: np.ndarray) -> np.ndarray:
    """Return the displacement of a point of the stage along z, in each mode, shape (..., modes).

    `shapes` (..., 6, modes) are motions of the stage about its reference point, the middle of the leaf ends.
    """
    x, y = (np.asarray(coordinate, dtype=float)[..., None] for coordinate in (point[0] - mechanism.length, point[1]))
    return shapes[..., 2, :] + shapes[..., 3, :] * y - shapes[..., 4, :] * x


VISIBLE_PEAK = 0.01
"""Peak over the mass line from which a mode interferes. Lower ones do not reach 0 dB below a margin of 40 dB."""


@dataclass(frozen=True)
class Mode:
    """A mode of the mechanism: its name, its frequency [Hz], and its displacements.

    Displacements are (count, 3) triples at unit modal mass [1/sqrt(kg)]. Those of the leaves have shape (leaves,
    points, 3), at even places from cart to stage. The stage's motion (6,) is a translation of its reference point, the
    middle of the leaf ends, and a rotation [1/m] about it.

    `actuator` and `sensor` [1/sqrt(kg)] tell how far the mode moves along the motion, where the actuator pushes and
    where the sensor measures. `peak` tells how far its resonance rises over the line of the stage's mass: their
    product, the residue, over 1/m of the stage's mass m and over 2 zeta.
    """

    name: str
    frequency: float
    actuator: float
    sensor: float
    peak: float
    stage: np.ndarray
    leaves: np.ndarray

    @classmethod
    def of(cls, mechanism: Mechanism, frequency: float, stage: np.ndarray, leaves: np.ndarray) -> Mode:
        """Build and name a mode from its frequency [Hz] and the motions of stage and leaves."""
        actuator, sensor = (
            float(along_motion(mechanism, point, stage[:, None])[0])
            for point in (mechanism.actuation, mechanism.sensor)
        )
        body, leaf_mass = mechanism.body, float(mechanism.leaf_mass)
        arm = np.subtract(body.centre, (mechanism.length, 0.0, 0.0)).astype(float)
        name = mode_name(stage, float(body.mass), body.inertia, arm, leaves, leaf_mass)
        peak = abs(actuator * sensor) * float(body.mass) / (2 * float(mechanism.damping_ratio))
        return cls(name, float(frequency), actuator, sensor, peak, stage, leaves)

    @property
    def interferes(self) -> bool:
        """Tell whether actuator and sensor both see the mode well enough to disturb control."""
        return self.peak > VISIBLE_PEAK


@dataclass(frozen=True)
class Evaluation:
    """Results for a mechanism at deflections of its stage along the motion.

    `deflections` [m] run from 0 to the stroke, shape (n,). `forces` [N] hold the stage there. `drive` is the stiffness
    along the motion [N/m], with the stage otherwise free to shift and turn. `support_x` along the leaves and
    `support_y` along their width [N/m] are stiffnesses with all other coordinates fixed. All have shape (n,).

    `stiffness` (2, 6, 6) belongs to the stage at its reference point, the middle of the leaf ends, at deflection 0 and
    at full stroke. It relates forces [N] and moments [N m] along and about x, y, z to displacements [m] and rotations.
    `modes` are the modes at deflection 0, the drive mode first, then by frequency.

    At full stroke, `stress` is the largest bending stress [Pa] without the concentration at the clamp, and `shortening`
    how much the leaves shorten [m]. `buckling` is the load [N] along all leaves together at which the stage sways.
    """

    model: str
    mechanism: Mechanism
    deflections: np.ndarray
    forces: np.ndarray
    drive: np.ndarray
    support_x: np.ndarray
    support_y: np.ndarray
    stiffness: np.ndarray
    modes: tuple[Mode, ...]
    stress: float
    shortening: float
    buckling: float

    @property
    def stroke(self) -> float:
        """Return the largest deflection [m]."""
        return float(self.deflections[-1])

    @property
    def loaded_drive(self) -> float:
        """Return the drive stiffness [N/m] at deflection 0 under the load along the leaves.

        The stiffness vanishes at the buckling load.
        """
        return float(self.drive[0] * (1 - self.mechanism.load / self.buckling))

    @property
    def buckling_margin(self) -> float:
        """Return the buckling load over the load along the leaves.

        Without a load, the weight of the stage counts. The margin is infinite if the load pulls.
        """
        load = self.mechanism.load if self.mechanism.load else self.mechanism.weight
        return float(self.buckling / load) if load > 0 else np.inf

    @property
    def clamp_stress(self) -> float:
        """Return the stress [Pa] at full stroke times the concentration factor of the clamp."""
        return self.stress * self.mechanism.stress_concentration

    @property
    def nonlinearity(self) -> float:
        """Return the largest relative deviation of the force from a straight line through 0.

        The line has the stiffness at deflection 0.
        """
        linear = self.drive[0] * self.deflections
        return float(np.max(np.abs(self.forces[1:] / linear[1:] - 1)))

    @property
    def fatigue_margin(self) -> float:
        """Return the fatigue limit over the clamp stress at full stroke; NaN if unknown."""
        return self.mechanism.fatigue / self.clamp_stress

    @property
    def yield_margin(self) -> float:
        """Return the yield strength over the clamp stress at full stroke."""
        return self.mechanism.yield_strength / self.clamp_stress

    @property
    def interfering(self) -> Mode | None:
        """Return the lowest mode that interferes with control; None without one.

        The drive mode, on which control works, does not count.
        """
        return next((mode for mode in self.modes if self.interferes(mode)), None)

    def interferes(self, mode: Mode) -> bool:
        """Tell whether a mode disturbs control.

        The drive mode, on which control works, never does.
        """
        return mode.interferes and mode is not self.modes[0]

    @property
    def named_modes(self) -> dict[str, Mode]:
        """Return the modes by name in their order; repeated names are numbered."""
        counts: Counter[str] = Counter()
        named = {}
        for mode in self.modes:
            counts[mode.name] += 1
            named[mode.name if counts[mode.name] == 1 else f"{mode.name} ({counts[mode.name]})"] = mode
        return named


STAGE = ("stage along x", "stage along y", "drive", "stage about x", "stage about y", "stage about z")
"""Names by the motion of the stage."""


def mode_name(
    stage: np.ndarray,
    mass: float,
    inertia: Sequence[float] | np.ndarray,
    arm: np.ndarray,
    leaves: np.ndarray,
    leaf_mass: float,
) -> str:
    """Return the name of a mode at unit modal mass.

    `stage` (6,) is the motion of the stage at its reference point, the middle of the leaf ends: translations, then
    rotations. `mass` [kg] and `inertia` [kg m^2] (3,) are the stage's, about its centre of mass. The centre lies `arm`
    [m] (3,) away from the reference point.

    `leaves` (leaves, points, 3) are displacements of the middle lines at even places from cart to stage. `leaf_mass`
    [kg] is the mass of one leaf. The remaining energy counts as torsion of the leaves.
    """
    speed = stage[:3] + np.cross(stage[3:], arm)
    energies = np.concatenate([mass * speed**2, np.asarray(inertia, dtype=float) * stage[3:] ** 2])
    _, y, z = leaf_mass * np.sum(_mean(leaves**2), axis=0)
    shares = {
        **dict(zip(STAGE, energies, strict=True)),
        "leaf bending": z,
        "leaf in-plane bending": y,
        "leaf torsion": 1 - energies.sum() - y - z,
    }
    name = max(shares, key=shares.__getitem__)
    if name == "drive" and stage[2] ** 2 < speed[2] ** 2 / 2:
        return STAGE[3 + int(np.argmax(energies[3:5]))]
    if name == "leaf bending":
        ripples = _dynamic_part(leaves[:, :, 2])
        # fraction that is common to all leaves
        alike = len(leaves) * np.sum(np.mean(ripples, axis=0) ** 2) / np.sum(ripples**2)
        return f"leaf bending, {'in' if alike > 0.5 else 'out of'} phase{_number(ripples)}"
    if name == "leaf in-plane bending":
        return name + _number(_dynamic_part(leaves[:, :, 1]))
    return name


def _mean(values: np.ndarray) -> np.ndarray:
    """Return the mean over the points along the leaves, axis 1, by the trapezoidal rule."""
    return (values[:, 1:] + values[:, :-1]).mean(axis=1) / 2


def _dynamic_part(shapes: np.ndarray) -> np.ndarray:
    """Return the shapes (leaves, points) without their static part.

    The static part is the shape of leaves that follow a shift of the stage.
    """
    x = np.linspace(0, 1, shapes.shape[1])
    return shapes - np.outer(shapes[:, -1], x**2 * (3 - 2 * x))


SHAPE_RIPPLE = 0.05
"""Displacement over the largest one below which rounding decides the sign of a shape."""


def _number(shapes: np.ndarray) -> str:
    """Return the number of waves of a mode as a suffix of its name; "" for one wave.

    `shapes` (leaves, points) are displacements. Waves are counted on the leaf that moves most.
    """
    shape = shapes[np.argmax(np.sum(shapes**2, axis=1))]
    signs = np.sign(shape[np.abs(shape) > SHAPE_RIPPLE * np.max(np.abs(shape))])
    waves = 1 + int(np.sum(signs[1:] != signs[:-1]))
    return "" if waves == 1 else f" {waves}"
