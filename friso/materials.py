"""Materials of leaf springs: data with their sources."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

from friso.quantities import Quantity, Value, positive

YOUNG = Quantity("Pa", positive, "195 GPa")
DENSITY = Quantity("kg/m^3", positive, "7900 kg/m^3")
STRENGTH = Quantity("Pa", positive, "1300 MPa")


@dataclass(frozen=True)
class Material:
    """A material: its elastic constants, density and strength, with their sources.

    Young's modulus [Pa], Poisson's ratio, density [kg/m^3], yield strength [Pa], and the stress amplitude [Pa] that it
    bears for ever (reversed bending, unnotched).
    """

    name: str
    grade: str
    young: Value
    poisson: float
    density: Value
    yield_strength: Value
    fatigue: Value
    source: str


@cache
def materials() -> dict[str, Material]:
    """Return all known materials by name."""
    rows = tomllib.loads(files("friso").joinpath("materials.toml").read_text(encoding="utf-8"))["material"]
    return {row["name"]: _read(**row) for row in rows}


def _read(young: str, density: str, fatigue: str, **row: object) -> Material:
    strength = STRENGTH.read(row.pop("yield"))
    values = YOUNG.read(young), DENSITY.read(density), STRENGTH.read(fatigue)
    return Material(young=values[0], density=values[1], yield_strength=strength, fatigue=values[2], **row)  # type: ignore[arg-type]
