"""Declare the specification of a friction isolator, and the leaf springs that it leaves free to choose.

A specification says what the machine is, what it has to do, and what may be built.

Leaf springs that can be built are numbers to choose from, and mechanisms.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from pydantic import GetCoreSchemaHandler, model_validator
from pydantic_core import CoreSchema, core_schema

from friso.errors import InputError, SpecError
from friso.intervals import Interval, Span
from friso.leaf_springs.mechanism import Mechanism
from friso.materials import materials
from friso.quantities import Number, Quantity, Value, at_least_1, exactly, inside_0_1, non_negative, positive, quoted
from friso.stage.flexure import leaf_count, unknown_material
from friso.stage.section import Section, Table
from friso.stage.tables_of_files import parsed, text_of


@dataclass(frozen=True)
class OneOrMany:
    """A key of the specification that takes one item or a list of items.

    `of` reads each item; None stands for names of materials. Raises SpecError for an item that is not usable.
    """

    of: Quantity | Number | None
    example: str

    @property
    def expected(self) -> str:
        """Return what the key takes, in words."""
        return f"a list, each {self.of.expected}" if self.of else f"a list of some of {', '.join(materials())}"

    @property
    def written_example(self) -> str:
        """Return the example as it stands in a file."""
        return self.example

    def read(self, entry: Any) -> tuple[Any, ...]:
        """Read one item or a list of items.

        Raises SpecError for an empty list, and for an item that is not usable.
        """
        items = entry if isinstance(entry, list | tuple) else [entry]
        if not items:
            raise SpecError("", "an empty list", self.expected, self.example)
        return tuple(self._item(item) for item in items)

    def _item(self, value: Any) -> Any:
        """Read one item, or the name of a material.

        Raises SpecError for a value that is not usable, or an unknown material.
        """
        if self.of:
            try:
                return self.of.read(value)
            except InputError as error:
                raise SpecError("", error.actual, self.expected, self.example) from None
        if not isinstance(value, str) or value not in materials():
            raise unknown_material(value if isinstance(value, str) else str(value))
        return value

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(self.read)


STOCK_THICKNESSES = (0.05, 0.08, 0.1, 0.12, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.5, 0.6, 0.7, 0.8, 1.0, 1.2, 1.5, 2.0)
"""Thicknesses of spring strip that are usually in stock [mm]."""


@dataclass(frozen=True)
class Gauges(OneOrMany):
    """A key for a list of thicknesses, or a range, which stands for its usual gauges."""

    def read(self, entry: Any) -> tuple[Any, ...]:
        """Read thicknesses; a range stands for the usual gauges in it.

        Raises SpecError for an unusable thickness, or a range without a usual gauge.
        """
        if not (isinstance(entry, str) and ".." in entry):
            return super().read(entry)
        assert isinstance(self.of, Quantity)
        among = Span(self.of, "0.1 mm .. 0.5 mm").read(entry)
        gauges = [
            f"{gauge:g} mm"
            for gauge in STOCK_THICKNESSES
            if among.low <= gauge * 1e-3 * (1 + 1e-9) <= among.high * (1 + 1e-8)
        ]
        if not gauges:
            expected = f"a range with a usual gauge in it ({', '.join(f'{gauge:g}' for gauge in STOCK_THICKNESSES)} mm)"
            raise SpecError("", quoted(entry), expected, 'thickness = "0.1 mm .. 0.5 mm"')
        return super().read(gauges)


_FORCE = Quantity("N", non_negative, "20 N")
_MOMENT = Quantity("N*m", non_negative, "0.5 N*m")
_SUPPORT = Quantity("N/m", positive, "20 N/um")
_LENGTH = Quantity("m", positive, "70 mm")
_MASS = Quantity("kg", positive, "1.2 kg")
_GAUGE = Quantity("m", positive, "0.3 mm")
_GAUGES = 'thickness = ["0.2 mm", "0.25 mm", "0.3 mm"]'


FORMER_LIMIT = "bandwidth_limit"


class SpecMachine(Section):
    """How fast the controller may be: a crossover limit, or parasitic frequencies that set it."""

    crossover_limit: Annotated[Value | None, Quantity("Hz", positive, "48 Hz")] = None
    parasitic_frequencies: Annotated[
        tuple[Any, ...] | None, OneOrMany(Quantity("Hz", positive, "480 Hz"), '["480 Hz", "730 Hz"]')
    ] = None

    @model_validator(mode="before")
    @classmethod
    def _by_its_former_name(cls, table: Any) -> Any:
        """Accept `bandwidth_limit`, the former name of the crossover limit, in specifications."""
        if isinstance(table, dict) and FORMER_LIMIT in table and "crossover_limit" not in table:
            others = {key: value for key, value in table.items() if key != FORMER_LIMIT}
            return {**others, "crossover_limit": table[FORMER_LIMIT]}
        return table

    @model_validator(mode="after")
    def _has_one(self) -> Self:
        """Raise SpecError unless just one of crossover limit and parasitic frequencies is given."""
        if (self.crossover_limit is None) == (self.parasitic_frequencies is None):
            text = "both" if self.crossover_limit else "neither"
            example = 'crossover_limit = "48 Hz" or parasitic_frequencies = ["480 Hz"]'
            raise SpecError("", text, "the crossover limit, or the parasitic frequencies that determine it", example)
        return self


class SpecFriction(Section):
    """Ranges of the friction of the bearing; a key left out stays as in the stage file."""

    static: Annotated[Interval | None, Span(Quantity("N", positive, "3 N"), "1 N .. 3 N")] = None
    coulomb: Annotated[Interval | None, Span(Quantity("N", positive, "1 N"), "0.5 N .. 1 N")] = None
    gap: Annotated[Interval | None, Span(Number(inside_0_1, "0.5"), "0.3 .. 0.85")] = None
    """Fraction of static friction that is lost in sliding, (F_s - F_c)/F_s, in place of `coulomb`."""
    stribeck_velocity: Annotated[Interval | None, Span(Quantity("m/s", positive, "1.6 mm/s"), "1 mm/s .. 3 mm/s")] = (
        None
    )
    bristle_stiffness: Annotated[Interval | None, Span(Quantity("N/m", positive, "1e5 N/m"), "5e4 N/m .. 2e5 N/m")] = (
        None
    )
    viscous: Annotated[Interval | None, Span(Quantity("N*s/m", non_negative, "0.5 N*s/m"), "0 N*s/m .. 5 N*s/m")] = None

    @model_validator(mode="after")
    def _is_not_contradictory(self) -> Self:
        """Check that Coulomb friction, static friction and gap agree.

        Raises SpecError for Coulomb friction beside a gap, or above the static friction.
        """
        if self.coulomb and self.gap:
            raise SpecError("", "coulomb together with gap", "one of the two", 'gap = "0.3 .. 0.85"')
        if self.static and self.coulomb and self.coulomb.high > self.static.high:
            text = f"coulomb = {quoted(self.coulomb.text)}, static = {quoted(self.static.text)}"
            raise SpecError("", text, "Coulomb friction below the static friction", 'coulomb = "0.5 N .. 1 N"')
        return self


class SpecMasses(Section):
    """Masses with their tolerance; a key left out stays as in the stage file."""

    cart: Annotated[Interval | None, Span(_MASS, "1.2 kg +/- 5 %")] = None
    stage: Annotated[Interval | None, Span(_MASS, "0.5 kg +/- 5 %")] = None


class SpecMoves(Section):
    """The moves that the machine has to make: ranges of travel and acceleration."""

    travel: Annotated[Interval, Span(Quantity("m", positive, "10 mm"), "1 mm .. 100 mm")]
    acceleration: Annotated[Interval, Span(Quantity("m/s^2", positive, "10 m/s^2"), "10 m/s^2 .. 100 m/s^2")]


class Position(Section):
    """When a move is done: once the stage stays within `window` of its reference.

    Also the time that this may take.
    """

    window: Annotated[Value, Quantity("m", positive, "1 um")]
    settling_time: Annotated[Value | None, Quantity("s", positive, "1 s")] = None


class Load(Section):
    """What the joint carries at the leaf ends, and how stiff it has to be.

    Forces along the leaves (besides the weight of the stage) and along their width, moments about all axes; required
    stiffness along leaves and width at full stroke.
    """

    force_x: Annotated[Value, _FORCE] = Value(0, "0 N")
    force_y: Annotated[Value, _FORCE] = Value(0, "0 N")
    moment_x: Annotated[Value, _MOMENT] = Value(0, "0 N*m")
    moment_y: Annotated[Value, _MOMENT] = Value(0, "0 N*m")
    moment_z: Annotated[Value, _MOMENT] = Value(0, "0 N*m")
    support_x: Annotated[Value | None, _SUPPORT] = None
    support_y: Annotated[Value | None, _SUPPORT] = None


class SpecLeaves(Section):
    """What can be built: the leaves' space, the available sheets and materials, the stroke.

    A single length, width or spacing is the largest allowed, a tenth of it the least.
    """

    leaves: Annotated[tuple[Any, ...], OneOrMany(Number(leaf_count, "2"), "leaves = 2")] = (2,)
    length: Annotated[Interval, Span(_LENGTH, "30 mm .. 70 mm")]
    width: Annotated[Interval, Span(_LENGTH, "10 mm .. 45 mm")]
    spacing: Annotated[Interval, Span(_LENGTH, "20 mm .. 60 mm")]
    thickness: Annotated[tuple[Any, ...], Gauges(_GAUGE, _GAUGES)]
    materials: Annotated[tuple[Any, ...], OneOrMany(None, 'materials = ["stainless 1.4310"]')]
    stroke: Annotated[Interval, Span(_LENGTH, "0.3 mm .. 1 mm")]
    offset: Annotated[Value, Quantity("m", non_negative, "1 mm")] = Value(1e-3, "1 mm")
    """Distance of actuator and sensor from mid-width, by which they couple to rotation of the stage about the leaves;
    places in the stage file take precedence."""

    def space(self, name: str) -> tuple[float, float]:
        """Return the least and the largest length, width or spacing [m].

        A single value is the largest; the least is then a tenth of it.
        """
        allowed: Interval = getattr(self, name)
        return (allowed.high / 10 if allowed.single else allowed.low), allowed.high

    @model_validator(mode="after")
    def _can_be_built(self) -> Self:
        """Check that stroke, sizes and thicknesses fit each other.

        Raises SpecError for a stroke of more than half the length, and for sheets thicker than a size or the spacing.
        """
        thickest = max(self.thickness)
        if 2 * self.stroke.low > self.length.high:
            text = f"stroke = {quoted(self.stroke.text)}, length = {quoted(self.length.text)}"
            raise SpecError("stroke", text, "a stroke of at most half the length of the leaves", 'stroke = "1 mm"')
        for name in ("length", "width"):
            longest = getattr(self, name)
            if min(self.thickness) >= longest.high:
                text = f"thickness = {quoted(self.thickness[0].text)}, {name} = {quoted(longest.text)}"
                raise SpecError("thickness", text, f"sheets thinner than the {name} of the leaves", _GAUGES)
        if thickest >= self.spacing.high:
            text = f"thickness up to {thickest:g} m, spacing = {quoted(self.spacing.text)}"
            raise SpecError("spacing", text, "leaves farther apart than they are thick", 'spacing = "20 mm .. 60 mm"')
        return self


class Safety(Section):
    """Factors of safety, and the tolerance of the drive stiffness in production."""

    strength: Annotated[float, Number(at_least_1, "1.5")] = 1.5
    """Ratio of yield strength to stress."""
    fatigue: Annotated[float, Number(at_least_1, "1.3")] = 1.3
    """Ratio of fatigue strength to the stress at the clamps at full stroke."""
    buckling: Annotated[float, Number(at_least_1, "3")] = 3.0
    """Ratio of buckling load to load."""
    breakaway: Annotated[float, Number(at_least_1, "1.1")] = 1.1
    """Ratio of the least static friction to the joint's force at full stroke."""
    parasitic: Annotated[float, Number(at_least_1, "10")] = 10.0
    """Ratio of the first interfering parasitic frequency to the crossover (thesis, Sec. 4.3.3)."""
    hunting: Annotated[float, Number(at_least_1, "1.2")] = 1.2
    """Ratio of the crossover to the highest crossover at which a cycle attracts."""
    stiffness_tolerance: Annotated[float, Number(inside_0_1, "0.1")] = 0.1
    """Relative tolerance of the drive stiffness; the thickness, which enters cubed, may deviate by a third of it."""


class Spec(Section):
    """A specification, as its file describes it."""

    refusal: ClassVar[type[InputError]] = SpecError

    name: str = ""
    source: str = ""
    machine: Annotated[SpecMachine, Table('[machine] crossover_limit = "48 Hz"')]
    friction: Annotated[SpecFriction, Table('[friction] static = "1 N .. 3 N"')]
    masses: Annotated[SpecMasses, Table('[masses] stage = "0.5 kg +/- 5 %"')] = SpecMasses()
    moves: Annotated[SpecMoves, Table('[moves] travel = "1 mm .. 100 mm", acceleration = "10 m/s^2 .. 100 m/s^2"')]
    position: Annotated[Position, Table('[position] window = "1 um"')]
    load: Annotated[Load, Table('[load] force_x = "20 N"')] = Load()
    leaves: Annotated[SpecLeaves, Table('[leaves] length = "30 mm .. 70 mm", ...')]
    safety: Annotated[Safety, Table("[safety] buckling = 3")] = Safety()

    @property
    def limit(self) -> float:
        """Return the highest crossover [Hz] that the machine allows."""
        if self.machine.crossover_limit is not None:
            return float(self.machine.crossover_limit)
        frequencies: Sequence[float] = self.machine.parasitic_frequencies or ()
        return min(frequencies) / self.safety.parasitic

    def with_limit(self, crossover: float) -> Spec:
        """Return the specification with another highest crossover [Hz], whatever its machine allows."""
        limit = Value(crossover, exactly(crossover, "Hz"))
        machine = self.machine.model_copy(update={"crossover_limit": limit, "parasitic_frequencies": None})
        return self.model_copy(update={"machine": machine})


EXAMPLE = '[machine] and, on the next line, crossover_limit = "48 Hz"'
EXPECTED = "a specification; examples/specs/thesis.toml is one"


def read_spec(text: str) -> Spec:
    """Read a specification from a TOML text.

    Raises SpecError for a text that is not TOML or no valid specification.
    """
    try:
        return Spec(**parsed(text, EXPECTED, EXAMPLE))
    except InputError as error:
        raise SpecError.of(error) from None


def load_spec(path: str | os.PathLike[str]) -> Spec:
    """Read a specification from a TOML file.

    Raises SpecError for a file that cannot be read or is no valid specification.
    """
    try:
        tables = parsed(text_of(Path(path), EXPECTED, EXAMPLE), EXPECTED, EXAMPLE)
        if "machine" not in tables and {"controller", "motion"} <= tables.keys():
            raise SpecError("", "a stage file", EXPECTED, "friso design STAGE.toml SPECIFICATION.toml")
        return Spec(**tables)
    except InputError as error:
        raise SpecError.of(error).found_in(str(path)) from None


SIZES = ("length", "width", "spacing")


@dataclass(frozen=True)
class Sheet:
    """Material for leaf springs: number of leaves, thickness of the sheet [m], and material."""

    leaves: float
    thickness: float
    material: str


def sheets(spec: Spec) -> list[Sheet]:
    """Return all sheets that a specification allows: count, thickness and material combined."""
    section = spec.leaves
    return [
        Sheet(*sheet) for sheet in product(section.leaves, sorted(map(float, section.thickness)), section.materials)
    ]


@dataclass(frozen=True)
class Geometry:
    """Leaf springs: length, width and spacing [m], and their sheet."""

    length: float
    width: float
    spacing: float
    sheet: Sheet

    @classmethod
    def of(cls, sizes: np.ndarray, sheet: Sheet) -> Geometry:
        """Build a geometry from length, width and spacing [m], shape (3,), and a sheet."""
        length, width, spacing = sizes.tolist()
        return cls(length, width, spacing, sheet)

    @classmethod
    def of_stage(cls, flat: Mapping[str, Any]) -> Geometry:
        """Read the geometry of a stage with [flexure] from its keys in SI."""
        bought = (flat[f"flexure.{name}"] for name in ("leaves", "thickness", "material"))
        return cls.of(np.array([flat[f"flexure.{name}"] for name in SIZES]), Sheet(*bought))

    def keys(self) -> dict[str, Any]:
        """Return the keys of [flexure] as texts with units."""
        sizes = {f"flexure.{name}": f"{getattr(self, name) * 1e3:.6g} mm" for name in SIZES}
        bought = {
            "flexure.leaves": int(self.sheet.leaves),
            "flexure.thickness": f"{self.sheet.thickness * 1e3:.6g} mm",
            "flexure.material": self.sheet.material,
        }
        return sizes | bought


def mechanisms(flat: Mapping[str, Any], sizes: np.ndarray, bought: list[Sheet]) -> Mechanism:
    """Build mechanisms from lengths, widths and spacings [m], shape (count, 3), and sheets.

    All other numbers are those of the stage `flat`.
    """
    sheet_materials = [materials()[sheet.material] for sheet in bought]
    columns = {
        "leaves": [sheet.leaves for sheet in bought],
        "thickness": [sheet.thickness for sheet in bought],
        "young": [material.young for material in sheet_materials],
        "poisson": [material.poisson for material in sheet_materials],
        "density": [material.density for material in sheet_materials],
        "yield": [material.yield_strength for material in sheet_materials],
        "fatigue": [material.fatigue for material in sheet_materials],
    }
    keys = {f"flexure.{name}": np.array(column, float) for name, column in columns.items()}
    keys |= {f"flexure.{name}": column for name, column in zip(SIZES, sizes.T, strict=True)}
    return Mechanism.of({**flat, **moved_along(flat, sizes[:, 0]), **keys})


def moved_along(flat: Mapping[str, Any], length: Any) -> dict[str, Any]:
    """Return where points on the stage lie if the leaves' length [m] changes, as keys [SI].

    Points that the file gives, such as the centre of mass, keep their distance from the leaf ends.
    """
    points = [f"flexure.{name}_x" for name in ("centre", "actuation", "sensor")]
    return {key: flat[key] + length - flat["flexure.length"] for key in points if key in flat}


def box(spec: Spec) -> tuple[np.ndarray, np.ndarray]:
    """Return the least and the largest length, width and spacing [m], each of shape (3,)."""
    ends = np.array([spec.leaves.space(name) for name in SIZES])
    return ends[:, 0], ends[:, 1]


def sizes_of(geometries: Sequence[Geometry]) -> np.ndarray:
    """Return the lengths, widths and spacings of geometries [m], shape (count, 3)."""
    return np.array([[getattr(geometry, name) for name in SIZES] for geometry in geometries])


def round_geometries(spec: Spec, geometry: Geometry, step: float) -> list[Geometry]:
    """Return the geometries next to one whose sizes are whole multiples of a step [m].

    Geometries beyond the space allowed are left out.
    """
    low, high = box(spec)
    near = [{float(np.round(size / step + side, 0) * step) for side in (-0.5, 0.5)} for size in sizes_of([geometry])[0]]
    corners = [np.array(corner) for corner in product(*map(sorted, near))]
    inside = [
        corner for corner in corners if np.all(corner >= low * (1 - 1e-9)) and np.all(corner <= high * (1 + 1e-9))
    ]
    return [Geometry.of(corner, geometry.sheet) for corner in inside]
