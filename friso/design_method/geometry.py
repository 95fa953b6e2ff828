"""Define the leaf springs that can be built, as numbers to choose from and as mechanisms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from friso.design_method.spec import Spec
from friso.leaf_springs.mechanism import Mechanism
from friso.materials import materials

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
