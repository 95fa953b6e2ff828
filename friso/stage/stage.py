"""The stage: all tables together, the flat SI view that the equations read, and the rules between tables."""

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from pydantic import model_validator

from friso.quantities import Number, Quantity, StageError, as_toml, quoted
from friso.stage.section import Rule, Section, Table, nearest, numeric_fields
from friso.stage.tables import (
    FRICTION,
    MOTION,
    Controller,
    FrictionSection,
    GainsController,
    Joint,
    Masses,
    Motion,
    Parasitic,
    TunedController,
    controller_form,
)


class Stage(Section):
    """A positioning stage, its controller and its motion, as one stage file describes them."""

    name: str = ""
    source: str = ""
    masses: Annotated[Masses, Table(lambda _: Masses, '[masses] cart = "1.2 kg"')]
    friction: Annotated[FrictionSection | None, Table(FRICTION.pick, '[friction] model = "lugre" ...')] = None
    joint: Annotated[Joint | None, Table(lambda _: Joint, '[joint] stiffness = "2.4 N/mm" ...')] = None
    parasitic: Annotated[
        Parasitic | None, Table(lambda _: Parasitic, '[parasitic] frequency = "300 Hz" ...')
    ] = None
    controller: Annotated[
        Controller, Table(controller_form, '[controller] kind = "pid", crossover = "8 Hz" ...')
    ]
    motion: Annotated[Motion, Table(MOTION.pick, '[motion] kind = "step", size = "1 mm", duration = "20 s"')]

    rules: ClassVar = (
        Rule(
            ("parasitic.mass", "masses.stage"),
            lambda f: "parasitic.mass" not in f or f["parasitic.mass"] < f["masses.stage"],
            "a parasitic mass less than the stage mass it is taken out of",
            '[parasitic] mass = "0.25 kg" with [masses] stage = "0.5 kg"',
        ),
    )

    @model_validator(mode="after")
    def _tables_fit_together(self) -> Self:
        if self.joint and (self.masses.cart is None or self.masses.stage is None):
            given = "a joint, but only one mass"
            raise StageError("masses", given, "cart and stage", 'cart = "1.2 kg", stage = "0.5 kg"')
        if self.parasitic and not self.joint:
            raise StageError(
                "parasitic", "a parasitic mode, but no joint", "a [joint] table, or no [parasitic]"
            )
        for rule, broken in broken_rules(self.flat()):
            if broken:
                raise StageError(", ".join(rule.keys), self._written(rule.keys), rule.expected, rule.example)
        return self

    def _written(self, keys: tuple[str, ...]) -> str:
        given, flat = self.given(), self.flat()
        pairs = ((key, *key.split(".")) for key in keys)
        return ", ".join(
            f"{name} = {quoted(given[table].get(name, flat[key]))}" for key, table, name in pairs
        )

    def given(self) -> dict[str, Any]:
        """The stage file as nested tables, exactly as the user wrote the values."""
        return {
            key: item.given() if isinstance(item, Section) else item for key, item in super().given().items()
        }

    def flat(self, swept: Mapping[str, Any] | None = None) -> dict[str, Any]:
        """Dotted keys to SI floats (and the texts and booleans), defaults filled in, absent optional keys absent.

        `swept` (dotted key to SI number or array) is laid over the stage before the defaults that depend on other
        keys are filled in, so that tuned_mass follows a swept mass. Raises StageError for a key it has no use for.
        """
        flat = {
            f"{table}.{key}": float(value)
            if isinstance(value, int | float) and not isinstance(value, bool)
            else value
            for table, section in self
            if isinstance(section, Section)
            for key, value in section
            if value is not None
        }
        flat.setdefault("friction.model", "none")
        for key, value in (swept or {}).items():
            if key not in fields(flat):
                raise unknown_key(key, fields(flat))
            flat[key] = value
        return _with_defaults(flat)

    def replace(self, changes: Mapping[str, Any]) -> "Stage":
        """The stage with some keys changed (None removes one), checked like a file. Raises StageError."""
        tables = self.given()
        for key, value in changes.items():
            _put(tables, key, value)
        return Stage(**tables)

    def to_toml(self) -> str:
        """The stage file: loading it gives this stage again."""
        given = self.given()
        lines = [f"{key} = {as_toml(value)}" for key, value in given.items() if isinstance(value, str)]
        for name, table in given.items():
            if isinstance(table, dict):
                lines += ["", f"[{name}]", *(f"{key} = {as_toml(value)}" for key, value in table.items())]
        return "\n".join(lines).strip() + "\n"


def _with_defaults(flat: dict[str, Any]) -> dict[str, Any]:
    """Fill in the defaults that depend on other keys."""
    if "controller.crossover" in flat and "controller.tuned_mass" not in flat:
        flat["controller.tuned_mass"] = flat.get("masses.cart", 0.0) + flat.get("masses.stage", 0.0)
    if "controller.force_limit" in flat:
        flat.setdefault("controller.anti_windup", "clamp")
    return flat


def _tables(flat: Mapping[str, Any]) -> dict[str, type[Section]]:
    """The classes of the tables a flat mapping was made of."""
    names = dict.fromkeys(key.split(".")[0] for key in flat)
    fixed = {"masses": Masses, "joint": Joint, "parasitic": Parasitic}
    picked = {
        "friction": FRICTION.classes.get(flat["friction.model"], FrictionSection),
        "controller": TunedController if "controller.crossover" in flat else GainsController,
        "motion": MOTION.classes[flat["motion.kind"]],
    }
    return {name: (fixed | picked)[name] for name in names}


def fields(flat: Mapping[str, Any]) -> dict[str, Quantity | Number]:
    """Unit, bound and example of every numeric key that a stage with these tables can have."""
    found = {name: numeric_fields(cls) for name, cls in _tables(flat).items()}
    return {f"{name}.{key}": field for name, table in found.items() for key, field in table.items()}


def broken_rules(flat: Mapping[str, Any]) -> Iterator[tuple[Rule, Any]]:
    """Each rule of a stage and where it is broken: a boolean, or an array of them where `flat` holds arrays."""
    for rule in (*Stage.rules, *(rule for cls in _tables(flat).values() for rule in cls.rules)):
        yield rule, np.logical_not(rule.holds(flat))


def violations(flat: Mapping[str, Any]) -> list[tuple[Any, str]]:
    """The bounds and rules that a flat SI mapping (arrays allowed) breaks: where (boolean or array), and why."""
    bounds = [
        (np.logical_not(field.bound.holds(flat[key])), f"{key} has to be {field.bound.text}")
        for key, field in fields(flat).items()
        if key in flat
    ]
    rules = [
        (broken, f"{', '.join(rule.keys)}: expected {rule.expected}") for rule, broken in broken_rules(flat)
    ]
    return [(broken, why) for broken, why in bounds + rules if np.any(broken)]


def unknown_key(key: str, known: Mapping[str, Any]) -> StageError:
    """The error for a dotted key that does not exist."""
    near = nearest(key, known)
    return StageError(
        key, f"{key} ({f'did you mean {near}?' if near else 'unknown key'})", f"one of {', '.join(known)}"
    )


def _put(tables: dict[str, Any], key: str, value: Any) -> None:
    """Set or (None) remove a dotted key in nested tables."""
    *path, last = key.split(".")
    table = tables
    for name in path:
        table = table.setdefault(name, {})
        if not isinstance(table, dict):
            raise StageError(key, f"{name} is no table", "a key of a table", 'controller.crossover="12 Hz"')
    if value is None and last not in table:
        raise StageError(key, "None, to remove it", "a key that the stage has")
    if value is None:
        del table[last]
    else:
        table[last] = getattr(value, "text", value)
