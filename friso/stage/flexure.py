"""The [flexure] table: leaf springs instead of joint stiffness and parasitic mode."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Annotated, Any, ClassVar, Self

from pydantic import create_model, model_validator

from friso.errors import StageError
from friso.materials import DENSITY, STRENGTH, YOUNG, materials
from friso.quantities import Bound, Number, Quantity, Value, any_sign, at_least_1, positive, quoted
from friso.stage.section import Rule, UncertainSection, load_own, nearest_name

Derivation = Callable[[Mapping[str, Any]], dict[str, Any]]
"""Function of a stage's keys in SI that computes further keys; values may be arrays."""

DERIVATIONS: dict[str, Derivation] = {}
"""Functions that compute the keys that follow from a table, by the table's name."""


def register_derivation(table: str) -> Callable[[Derivation], Derivation]:
    """Return a decorator that registers a function for a table of the stage file.

    The function computes the keys that follow from that table.
    """

    def register(derivation: Derivation) -> Derivation:
        DERIVATIONS[table] = derivation
        return derivation

    return register


def derived(flat: dict[str, Any]) -> dict[str, Any]:
    """Add to a stage's keys in SI all keys that follow from its tables, such as [flexure]."""
    load_own("friso.derivations")
    tables = {key.split(".")[0] for key in flat}
    for table, derivation in DERIVATIONS.items():
        if table in tables:
            flat |= derivation(flat)
    return flat


leaf_count = Bound("a whole number, 2 to 20", lambda value: (value >= 2) & (value <= 20) & (value % 1 == 0))
poisson_range = Bound("0 or greater, below 0.5", lambda value: (value >= 0) & (value < 0.5))
share = Bound("greater than 0, at most 1", lambda value: (value > 0) & (value <= 1))

_LENGTH = Quantity("m", positive, "70 mm")
_PLACE = Quantity("m", any_sign, "35 mm")
_INERTIA = Quantity("kg*m^2", positive, "2e-4 kg*m^2")

_EITHER = (
    'material = "stainless 1.4310" or young = "195 GPa", poisson = 0.3, density = "7900 kg/m^3", yield = "1.3 GPa"'
)


class _Leaves(UncertainSection):
    """Parallel leaf springs between cart and stage (thesis, Fig. 6).

    x runs along the leaves from the cart (0) to the stage, y along their width, z along the motion; the origin lies
    between the clamps at the cart. `spacing` is the distance of neighbouring leaves.
    """

    leaves: Annotated[float, Number(leaf_count, "2")]
    length: Annotated[Value, _LENGTH]
    width: Annotated[Value, Quantity("m", positive, "45 mm")]
    thickness: Annotated[Value, Quantity("m", positive, "0.35 mm")]
    spacing: Annotated[Value, Quantity("m", positive, "60 mm")]
    material: str = ""
    young: Annotated[Value | None, YOUNG] = None
    poisson: Annotated[float | None, Number(poisson_range, "0.3")] = None
    density: Annotated[Value | None, DENSITY] = None
    fatigue: Annotated[Value | None, STRENGTH] = None
    load: Annotated[Value | None, Quantity("N", any_sign, "5 N")] = None
    """Compressive load along the leaves, which softens the drive direction; negative for tension, as of a hanging
    stage."""
    inertia_x: Annotated[Value | None, _INERTIA] = None
    inertia_y: Annotated[Value | None, _INERTIA] = None
    inertia_z: Annotated[Value | None, _INERTIA] = None
    centre_x: Annotated[Value | None, _PLACE] = None
    centre_y: Annotated[Value | None, _PLACE] = None
    centre_z: Annotated[Value | None, _PLACE] = None
    actuation_x: Annotated[Value | None, _PLACE] = None
    actuation_y: Annotated[Value | None, _PLACE] = None
    actuation_z: Annotated[Value | None, _PLACE] = None
    sensor_x: Annotated[Value | None, _PLACE] = None
    sensor_y: Annotated[Value | None, _PLACE] = None
    sensor_z: Annotated[Value | None, _PLACE] = None
    damping_ratio: Annotated[float, Number(share, "0.01")] = 0.01
    stress_concentration: Annotated[float, Number(at_least_1, "1.5")] = 1.5

    rules: ClassVar[tuple[Rule, ...]] = (
        Rule(
            ("flexure.thickness", "flexure.width"),
            lambda f: 3 * f["flexure.thickness"] <= f["flexure.width"],
            "leaves at least three times as wide as thick",
            'width = "45 mm", thickness = "0.35 mm"',
        ),
        Rule(
            ("flexure.thickness", "flexure.length"),
            lambda f: 10 * f["flexure.thickness"] <= f["flexure.length"],
            "leaves at least ten times as long as thick",
            'length = "70 mm", thickness = "0.35 mm"',
        ),
        Rule(
            ("flexure.thickness", "flexure.spacing"),
            lambda f: f["flexure.thickness"] < f["flexure.spacing"],
            "leaves farther apart than they are thick",
            'spacing = "60 mm", thickness = "0.35 mm"',
        ),
    )

    @model_validator(mode="after")
    def _can_turn(self) -> Self:
        inertia = [self.inertia_x, self.inertia_y, self.inertia_z]
        moments = [moment for moment in inertia if moment is not None]
        if len(moments) == 3 and 2 * max(moments) > sum(moments) * (1 + 1e-9):
            text = ", ".join(
                f"inertia_{axis} = {quoted(moment.text)}" for axis, moment in zip("xyz", moments, strict=True)
            )
            example = 'inertia_x = "2e-4 kg*m^2", inertia_y = "3e-4 kg*m^2", inertia_z = "3e-4 kg*m^2"'
            expected = "none larger than the sum of the other two, as for any rigid body"
            raise StageError("inertia", text, expected, example)
        return self

    @model_validator(mode="after")
    def _has_a_material(self) -> Self:
        numbers = ("young", "poisson", "density", "yield")
        keys = [key for key in (*numbers, "fatigue") if getattr(self, key) is not None]
        if self.material and keys:
            raise StageError("", f"material together with {', '.join(keys)}", "one form, not both", _EITHER)
        if self.material:
            if self.material not in materials():
                raise unknown_material(self.material).under("material")
            return self
        if missing := [key for key in numbers if getattr(self, key) is None]:
            raise StageError(missing[0], "nothing", "a material, or all numbers of one", _EITHER)
        return self


Flexure = create_model(
    "Flexure",
    __base__=_Leaves,
    __doc__=_Leaves.__doc__,
    **{"yield": (Annotated[Value | None, STRENGTH], None)},  # type: ignore[call-overload]  # a keyword of Python
)


def unknown_material(name: str) -> StageError:
    """Make the error for a material that friso does not have, with the nearest that it has."""
    near = nearest_name(name, materials()) or next(
        (material for material in materials() if name.lower() in material), None
    )
    hint = f"unknown; did you mean {near}?" if near else "unknown"
    names = ", ".join(materials())
    return StageError("", quoted(name, hint), f"one of {names}", f'material = "{near or "stainless 1.4310"}"')


def with_material(flat: dict[str, Any]) -> dict[str, Any]:
    """Return a stage's keys with the numbers of its leaf springs' material, in SI."""
    name = flat.get("flexure.material")
    if not name:
        return flat
    properties = materials()[str(name)]
    numbers = {
        "young": properties.young,
        "density": properties.density,
        "yield": properties.yield_strength,
        "fatigue": properties.fatigue,
    }
    plain = {f"flexure.{key}": float(value) for key, value in numbers.items()}
    return flat | plain | {"flexure.poisson": properties.poisson}
