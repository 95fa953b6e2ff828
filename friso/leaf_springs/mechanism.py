"""Represent a parallel leaf-spring mechanism as data (thesis, Fig. 6).

x runs along the leaves, from the cart (0) to the stage (L), y along their width, z through their thickness, which is
the direction of motion. The origin lies between the clamps at the cart, in the middle of the width and of the row of
leaves. Numbers may be arrays of one shape: many mechanisms at once.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from friso.leaf_springs.plate import torsion_constant

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
