"""Define the stage: all tables together, and the keys with SI values that equations read."""

import logging
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from copy import deepcopy
from dataclasses import replace
from functools import cached_property
from math import isclose
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from pydantic import field_validator, model_validator

from friso.axis import KINDS, LINEAR, AxisKind, axis_of
from friso.errors import InputError, StageError
from friso.intervals import Interval
from friso.quantities import COMMANDS, Number, Quantity, as_toml, exactly, in_unit_of, positive, quoted, unit_of
from friso.stage.contacts import FRICTIONS, followed, with_guess
from friso.stage.controllers import (
    ANTI_WINDUP,
    CONTROLLER,
    CONTROLLERS,
    FORCE_LIMIT,
    KIND,
    OF_ANY_FORM,
    WINDOWS,
    ControllerSection,
    controller_of,
)
from friso.stage.flexure import Flexure, derived, with_material
from friso.stage.rig import MOTION, Cable, Drive, Floor, Motion, Rail, motion_of
from friso.stage.section import (
    UNKNOWN,
    Rule,
    Section,
    Table,
    UncertainSection,
    element_keys,
    list_fields,
    numeric_fields,
    table_arrays,
    unknown_key,
)
from friso.stage.tables import (
    BRAKING,
    FRICTION,
    MOTOR_FRICTION,
    MOTOR_MASS,
    Actuator,
    AxisTable,
    Bias,
    Conditions,
    Encoder,
    FrictionSection,
    Joint,
    Masses,
    Parasitic,
    PositionTolerance,
    StatedMoves,
    Transmission,
    friction_law,
    motor_mass,
    of_motor,
)

LOGGER = logging.getLogger("friso")

_TRANSMISSION = Table('[transmission] inertia = "1.2e-4 kg*m^2", lead = "10 mm" ...')
_ENCODER = Table('[encoder] position = "load", velocity = "motor"')
_JOINT = Table('[joint] stiffness = "2.4 N/mm" ...')
_LOCKED = '[joint] locked = true, limiter_stiffness = "2e7 N/m", limiter_damping = "100 N*s/m"'
_FLEXURE = Table('[flexure] leaves = 2, length = "70 mm", width = "45 mm" ...')
_RAIL = Table('[rail] seed = 1, static_deviation = 0.2, correlation_length = "5 mm" ...')
_CONTROLLER = Table('[controller] kind = "pid", crossover = "8 Hz", alpha = 0.1, beta = 2', CONTROLLERS)


class Stage(Section):
    """A positioning stage with its controller and motion, as a stage file describes them.

    It does not change; `replace` makes another one.

    Examples
    --------
    >>> import friso
    >>> stage = friso.load(friso.example("thesis_rig"))
    >>> stage.replace({"controller.crossover": "12 Hz"}).controller.crossover
    12.0
    """

    refusal: ClassVar[type[InputError]] = StageError

    name: str = ""
    source: str = ""
    note: str = ""
    unknown: str = ""
    axis: Annotated[AxisTable | None, Table('[axis] kind = "rotary"')] = None
    masses: Annotated[Masses, Table('[masses] cart = "1.2 kg"')]
    friction: Annotated[FrictionSection | None, Table('[friction] model = "lugre" ...', FRICTION)] = None
    transmission: Annotated[Transmission | None, _TRANSMISSION] = None
    motor_friction: Annotated[FrictionSection | None, Table('[motor_friction] model = "stribeck" ...', FRICTION)] = None
    encoder: Annotated[Encoder | None, _ENCODER] = None
    joint: Annotated[Joint | None, _JOINT] = None
    flexure: Annotated[Flexure | None, _FLEXURE] = None  # type: ignore[valid-type]
    parasitic: Annotated[Parasitic | None, Table('[parasitic] frequency = "300 Hz" ...')] = None
    bias: Annotated[Bias | None, Table('[bias] cart = "0.2 N"')] = None
    actuator: Annotated[Actuator | None, Table('[actuator] motor_constant = "50 N/A"')] = None
    controller: Annotated[ControllerSection, _CONTROLLER]
    drive: Annotated[Drive | None, Table('[drive] sample_time = "50 us"')] = None
    rail: Annotated[Rail | None, _RAIL] = None
    conditions: Annotated[Conditions | None, Table("[conditions] load = 1.3, load_share = 0.8")] = None
    cable: Annotated[Cable | None, Table('[cable] stiffness = "50 N/m"')] = None
    floor: Annotated[Floor | None, Table('[floor] frequency = ["1 Hz", "100 Hz"] ...')] = None
    motion: Annotated[Motion, Table('[motion] kind = "step", size = "1 mm", duration = "20 s"', MOTION)]
    tolerance: Annotated[PositionTolerance | None, Table('[tolerance] within = "5 um"')] = None
    moves: Annotated[StatedMoves | None, Table('[moves] smallest = "10 um", largest = "32 mm"')] = None

    rules: ClassVar[tuple[Rule, ...]] = (
        Rule(
            ("parasitic.mass", "masses.stage"),
            lambda f: "parasitic.mass" not in f or f["parasitic.mass"] < f["masses.stage"],
            "a parasitic mass smaller than the stage mass, of which it is a part",
            '[parasitic] mass = "0.25 kg" with [masses] stage = "0.5 kg"',
        ),
        Rule(
            ("controller.anti_windup_time", "drive.sample_time", "drive.position_sample_time"),
            lambda f: (
                f.get("controller.anti_windup_time", np.inf)
                >= np.maximum(f.get("drive.sample_time", 0.0), f.get("drive.position_sample_time", 0.0))
            ),
            "an anti-windup time of at least one sample: in a shorter one the integrator overshoots at every sample",
            '[controller] anti_windup_time = "50 ms" with [drive] sample_time = "50 us"',
        ),
        *(
            Rule(
                (f"controller.{window}", f"controller.{window}_exit"),
                lambda f, key=f"controller.{window}": f.get(f"{key}_exit", np.inf) >= f.get(key, 0.0),
                f"a {window.replace('_', ' ')} that is left at a larger error than that at which it is entered",
                f'{window} = "1 um", {window}_exit = "3 um"',
            )
            for window in WINDOWS
        ),
    )

    def __init__(self, /, **data: Any) -> None:
        axis = axis_written(data)
        self._take(with_guess(data, axis), axis)

    def __getstate__(self) -> dict[Any, Any]:
        """Return the state to be pickled: the tables, without cached results."""
        state = super().__getstate__()
        return state | {"__dict__": {key: item for key, item in state["__dict__"].items() if not key.startswith("_")}}

    @property
    def axis_kind(self) -> AxisKind:
        """Return the kind of axis, linear or rotary, and the force or torque per ampere."""
        kind = KINDS[self.axis.kind] if self.axis else LINEAR
        exerts = self.actuator.exerts if self.actuator else ()
        return replace(kind, exerts=exerts, counted=counted_by(kind, vars(self)))

    @property
    def states_friction(self) -> bool:
        """Tell whether the stage file states friction, of the guide or at the motor, be it none."""
        return self.friction is not None or self.motor_friction is not None

    @field_validator("name", "source", "note", "unknown")
    @classmethod
    def _can_be_saved(cls, text: str) -> str:
        text.encode()  # raises for half a character, which a command line may contain
        return text

    @model_validator(mode="after")
    def _tables_fit_together(self) -> Self:
        if self.joint and (self.masses.cart is None or self.masses.stage is None):
            text = "a [joint], but a single mass"
            raise StageError("masses", text, "both masses", 'cart = "1.2 kg", stage = "0.5 kg"')
        for table, words in (("parasitic", "a parasitic mode"), ("flexure", "leaf springs")):
            if getattr(self, table) and not self.joint:
                expected, example = "both or neither", _JOINT.example
                if table == "parasitic":
                    expected += "; a machine in one piece has the joint locked and its mass as cart and stage"
                    example = _LOCKED
                raise StageError(table, f"{words}, but no [joint]", expected, example)
        if self.flexure and self.axis_kind != LINEAR:
            text = f"leaf springs on an axis with {self.axis_kind.described}"
            raise StageError("flexure", text, "[joint] with its stiffness", 'stiffness = "2.4 N*m/mrad"')
        self._has_a_whole_transmission()
        self._has_one_stiffness()
        for body in ("cart", "stage"):
            if self.bias and getattr(self.bias, body) is not None and getattr(self.masses, body) is None:
                example = f'[masses] {body} = "1 kg"'
                raise StageError(f"bias.{body}", f"a force on the {body}, which has no mass", "its mass", example)
        self._has_computable_leaves()
        self._has_what_is_unknown()
        for rule, broken in _broken_rules(self.flat()):
            if broken:
                raise StageError(", ".join(rule.keys), self._written(rule), rule.expected, rule.example)
        return self

    def _has_a_whole_transmission(self) -> None:
        """Check that transmission and [encoder] are both there or both missing.

        Motor friction needs a transmission. The motor's travel per turn must be a lead on a linear axis, and a ratio on
        a rotary one. Raises StageError otherwise.
        """
        if self.transmission is None:
            for table, words in (("encoder", "a choice of encoders"), ("motor_friction", "friction at the motor")):
                if getattr(self, table):
                    raise StageError(table, f"{words}, but no [transmission]", "both or neither", _TRANSMISSION.example)
            return
        if self.encoder is None:
            expected = "the sides on which position and velocity are measured"
            raise StageError("encoder", "a [transmission], but no [encoder]", expected, _ENCODER.example)
        kind = self.axis_kind
        name, other = ("ratio", 'lead = "10 mm"') if kind == LINEAR else ("lead", "ratio = 5")
        if getattr(self.transmission, name) is not None:
            actual = f"a {name} on an axis with {kind.described}"
            raise StageError(f"transmission.{name}", actual, "what one turn of the motor does there", other)

    def _has_one_stiffness(self) -> None:
        """Check that a joint has a stiffness, or leaf springs from which it follows, but not both.

        A locked joint needs neither. Leaf springs also replace [parasitic]. Raises StageError otherwise.
        """
        joint = self.joint
        if joint and self.flexure:
            keys = ["joint.stiffness"] if joint.stiffness is not None else ["[parasitic]"] if self.parasitic else []
            if keys:
                expected = "one of the two: stiffness and parasitic mode follow from the leaf springs"
                raise StageError(keys[0], f"{keys[0]} together with [flexure]", expected, _FLEXURE.example)
        elif joint and not joint.locked and joint.stiffness is None:
            expected = "the stiffness of the joint, or a [flexure]; only a joint with locked = true needs none"
            raise StageError("joint.stiffness", "nothing", expected, 'stiffness = "2.4 N/mm"')

    def _has_computable_leaves(self) -> None:
        """Check that stiffness and modes can be computed for the sizes of the leaf springs.

        Raises StageError otherwise.
        """
        try:
            flat = self.flat() if self.flexure else {}
        except InputError:  # leaves that buckle, for one: it says why
            raise
        except (ArithmeticError, ValueError, np.linalg.LinAlgError):  # numbers too large for floats
            flat = {"joint.stiffness": np.nan}
        followed = (key for key in flat if key.startswith(("parasitic.", "joint.")))
        undefined = [key for key in followed if not isinstance(flat[key], bool) and not np.isfinite(flat[key])]
        if undefined:
            text = f"leaf springs for which {undefined[0]} cannot be computed"
            raise StageError("flexure", text, "sizes of leaf springs", 'length = "70 mm", width = "45 mm"')

    def _has_what_is_unknown(self) -> None:
        """Check that the keys and tables listed as unknown are in the file. Raises StageError otherwise."""
        tables = self.as_written()
        for key in self.unknown_keys:
            if not isinstance(tables.get(key), dict) and not ("." in key and _has(tables, key)):
                expected = "keys and tables of this file with a value that nobody knows, separated by commas"
                raise StageError("unknown", as_toml(key), expected, 'unknown = "friction.static, controller"')

    @property
    def unknown_keys(self) -> tuple[str, ...]:
        """Return the keys, and the tables, whose values in the stage file nobody knows."""
        return tuple(dict.fromkeys((*_split(self.unknown), *self.guessed_keys)))

    @property
    def guessed_keys(self) -> tuple[str, ...]:
        """Return the keys of friction that are unknown, and whose ranges follow from what the stage file states."""
        sections = ((name, section) for name in FRICTIONS if (section := getattr(self, name)))
        return tuple(f"{name}.{key}" for name, section in sections for key, value in section if _text(value) == UNKNOWN)

    @property
    def assumed_keys(self) -> tuple[str, ...]:
        """Return the unknown keys, and tables, for which the stage file has one value and no range."""
        ranges = self.uncertain()
        return tuple(key for key in self.unknown_keys if key not in ranges)

    @property
    def doubt(self) -> str:
        """Return why nothing is certain of a stage with unknown values that have no range; "" for another."""
        keys = self.assumed_keys
        return f"{' and '.join(keys)} {'is' if len(keys) == 1 else 'are'} listed as unknown" if keys else ""

    def _written(self, rule: Rule) -> str:
        """Return the values that a rule compares, as the user wrote them."""
        values = [(key.split(".")[-1], _at(self, key)) for key in rule.keys if getattr(self, key.split(".")[0])]
        return ", ".join(f"{name} = {_written(getattr(value, 'text', value))}" for name, value in values)

    def as_written(self) -> dict[str, Any]:
        """Return the stage file as nested tables, with keys and values as the user wrote them."""
        texts = super().as_written()
        return {key: item.as_written() if isinstance(item, Section) else item for key, item in texts.items()}

    def flat(self, swept: Mapping[str, Any] | None = None) -> dict[str, Any]:
        """Return all keys of the stage, such as "friction.static", with their values in SI.

        Values are floats, texts and booleans; defaults are filled in. Absent optional keys are absent, and so are the
        arrays of [floor]. Elements of any other array are numbered from 1: friction.element_stiffness.2.

        `swept`, keys to SI numbers or arrays, is laid over the stage before the defaults that follow other keys are
        filled in: tuned_mass follows a swept mass, and guessed friction what it was guessed from. Raises StageError for
        an unknown key.
        """
        if not swept:
            return dict(self._complete)
        for key in swept:
            if key not in self._sweepable:
                raise StageError.of(unknown_key(key, self._sweepable))
        guesses = {key: values for key, (_, values) in followed(self, swept).items()}
        return derived(_with_defaults({**self._declared, **guesses, **swept}))

    def numeric_keys(self) -> Mapping[str, Quantity | Number]:
        """Return unit, bound and example of every numeric key that this stage can have."""
        return self._numeric_keys

    @cached_property
    def _declared(self) -> dict[str, Any]:
        """Return the keys that the stage file gives, with SI values."""
        flat: dict[str, Any] = {"friction.model": "none"}
        for table, section in self:
            if isinstance(section, UncertainSection):
                values = {key: value for key, value in section.numbers.items() if value is not None}
                flat |= {f"{table}.{key}": _plain(value) for key, value in values.items()}
        if self.actuator and (braking := self.actuator.braking) is not None:
            flat[BRAKING] = braking
        return flat

    @cached_property
    def _complete(self) -> dict[str, Any]:
        return derived(_with_defaults(dict(self._declared)))

    @cached_property
    def _numeric_keys(self) -> Mapping[str, Quantity | Number]:
        return {key: field.on(self.axis_kind) for key, field in numeric_keys(self._complete).items()}

    @cached_property
    def _sweepable(self) -> Mapping[str, Quantity | Number]:
        """Return unit, bound and example of the numeric keys that may be swept.

        Keys that follow from leaf springs are excluded.
        """
        keys = numeric_keys(self._declared)
        if not self.flexure:
            return keys
        return {key: item for key, item in keys.items() if not key.startswith(("parasitic.", "joint.stiffness"))}

    def uncertain(self) -> dict[str, Interval]:
        """Return the intervals of uncertain quantities by dotted key; `flat` has their centres.

        All values in a "range" are equally likely; a "tolerance" is the 95 % interval of a normal distribution.
        """
        tables = {name: section.uncertain() for name, section in self if isinstance(section, UncertainSection)}
        return {f"{name}.{key}": interval for name, table in tables.items() for key, interval in table.items()}

    def replace(self, changes: Mapping[str, Any]) -> "Stage":
        """Return the stage with dotted keys set, or removed by None, checked like a file.

        Raises StageError for a change that makes no valid stage.
        """
        if not (isinstance(changes, Mapping) and all(isinstance(key, str) for key in changes)):
            expected = "a dictionary of keys to new values"
            raise StageError("", quoted(changes), expected, 'stage.replace({"masses.stage": "0.6 kg"})')
        return changed(self.as_written(), changes)

    def in_own_units(self, changes: Mapping[str, Any]) -> dict[str, Any]:
        """Complete changes that a user typed beside a stage file by the units of the file.

        A bare number gets the unit that the file has for its key; wrong capitals in a unit are corrected.
        """
        tables, keys = self.as_written(), numeric_keys(self.flat())
        units = {key for key in changes if getattr(keys.get(key), "unit", "")}
        return {
            key: in_unit_of(_under(tables, key), value) if key in units else value for key, value in changes.items()
        }

    def with_numbers(self, numbers: Mapping[str, float], without: Iterable[str] = ()) -> "Stage":
        """Return the stage with some keys set to SI numbers, and `without` some tables.

        Numbers are written so that they read back unchanged. Keys that are unknown stay so. Raises StageError if the
        result is no valid stage.
        """
        keys = numeric_keys({**self.flat(), **numbers})
        texts = {key: exactly(value, keys[key].unit) if keys[key].unit else value for key, value in numbers.items()}
        return changed(self.as_written(), texts | dict.fromkeys(without), derived_from_it=True)

    def unit_in_file(self, key: str) -> str:
        """Return the unit in which the file writes a key; "" for a key that it lacks or that has an uncertain value."""
        return unit_of(_under(self.as_written(), key))

    def in_file_unit(self, key: str, value: float, digits: int) -> float | str:
        """Write the value [SI] of a key of this stage in the unit of the file, rounded to significant `digits`.

        A key that the file lacks is written in SI, and one without a unit as a number.
        """
        quantity = numeric_keys({**self.flat(), key: value})[key].on(self.axis_kind)
        if isinstance(quantity, Number):
            return float(f"{value:.{digits}g}")
        unit = self.unit_in_file(key) or quantity.unit
        return exactly(float(f"{value / quantity.factor(unit):.{digits}g}"), unit)

    def with_rounded(self, numbers: Mapping[str, float], digits: int) -> "Stage":
        """Return the stage with some keys set to SI numbers, rounded to significant `digits` in the units of the file.

        Keys that have their number already stay as they are written. Unknown keys stay so. Raises StageError if the
        result is no valid stage.
        """
        flat = self.flat()
        new = {key: value for key, value in numbers.items() if not (key in flat and isclose(flat[key], value))}
        texts = {key: self.in_file_unit(key, value, digits) for key, value in new.items()}
        return changed(self.as_written(), texts, derived_from_it=True)

    def variants(self) -> "Mapping[str, Stage]":
        """Return the stage as "given" and, if it has a joint, with it "locked" and "free".

        "free" needs all keys of the joint in the file.
        """
        variants: dict[str, Stage | Self] = {"given": self}
        if self.joint:
            variants["locked"] = self.replace({"joint.locked": True})
            with suppress(StageError):  # a joint that is locked in the file may lack stiffness, damping or stroke
                variants["free"] = self.replace({"joint.locked": False})
        return variants

    def to_toml(self) -> str:
        """Return the text of a stage file from which an equal stage is read."""
        texts = self.as_written()
        lines = [f"{key} = {as_toml(text)}" for key, text in texts.items() if isinstance(text, str)]
        for name, table in texts.items():
            if isinstance(table, dict):
                lines += _table_lines(name, table)
        return "\n".join(lines).lstrip() + "\n"


def changed(tables: Mapping[str, Any], changes: Mapping[str, Any], derived_from_it: bool = False) -> Stage:
    """Return a new stage from tables in which some keys are set, or removed by None.

    A key that is set is no longer listed as unknown, unless its value was `derived_from_it`, the stage itself.

    A controller that is given in another way, by its gains where the tables have a crossover, replaces the controller
    of the tables. The tables passed in stay as they are. Raises StageError for a key that cannot be set or removed, and
    if the result is no valid stage.
    """
    own, tables = {*tables}, deepcopy(dict(tables))
    guessed = [key for key in changes if derived_from_it and _text(_under(tables, key)) == UNKNOWN]
    for key, value in changes.items():
        _put(tables, key, _text(value))
    if isinstance(listed := tables.get("unknown", ""), str) and "unknown" not in changes:
        tables.pop("unknown", None)
        stated = () if derived_from_it else changes  # what the user sets is known
        unset = [
            key for key in dict.fromkeys((*_split(listed), *guessed)) if not {key, key.partition(".")[0]} & {*stated}
        ]
        unset = [key for key in unset if _has(tables, key)]
        tables |= {"unknown": ", ".join(unset)} if unset else {}
    try:
        return Stage(**tables)
    except StageError as error:
        name = error.key.partition(".")[0]
        kept = {*OF_ANY_FORM, *(key.partition(".")[2] for key in changes)}
        table = tables.get(CONTROLLER)
        others = [key for key in table if key not in kept] if isinstance(table, dict) else []
        if error.key == CONTROLLER and others and any(key.startswith(f"{CONTROLLER}.") for key in changes):
            for key in others:
                del tables[CONTROLLER][key]
            try:
                replaced = Stage(**tables)
            except StageError as other:
                raise error if other.key == CONTROLLER else _of_another_form(other, changes, others) from None
            LOGGER.warning(f"[controller] is of another form now: {', '.join(others)} are gone", extra={"after": True})
            return replaced
        begun = [key for key in changes if key.startswith(f"{name}.")]
        if name in own or not begun or not error.actual.startswith("nothing"):
            raise
        actual = f"set for a stage that has no [{name}]"
        expected = f"a stage with [{name}], or all of its keys; {error.key}: {error.expected}"
        raise StageError(begun[0], actual, expected, error.example) from None


def _of_another_form(error: StageError, changes: Mapping[str, Any], others: Sequence[str]) -> StageError:
    """Return a clearer error for keys of another form of controller than the stage file's.

    A form is one way to give a controller, such as by rules or by gains. `error` says that keys of the other form are
    missing; `others` are the keys in the file. An error about anything else is returned unchanged.
    """
    if not error.actual.startswith("nothing"):
        return error
    own = [key for key in changes if key.startswith(f"{CONTROLLER}.")]
    key = next((key for key in own if key.partition(".")[2] not in OF_ANY_FORM), own[0])
    expected = (
        f"its other keys, such as {error.key}, too; or speed instead, an axis of friso map and friso boundary that "
        "scales any controller"
    )
    return StageError(key, f"a key of another form than yours ({', '.join(others)})", expected, 'speed="0.25..4"')


def axis_written(tables: Mapping[str, Any]) -> AxisKind:
    """Return the kind of axis of a stage file's tables, with the force or torque per ampere.

    Errors in [axis] and [actuator] are found later.
    """
    name = _of_table(tables, "axis", "kind")
    kind = KINDS.get(name, LINEAR) if isinstance(name, str) else LINEAR
    kind = replace(kind, counted=counted_by(kind, tables))
    table = tables.get("actuator")
    if table is None:
        return kind
    try:
        actuator = table if isinstance(table, Actuator) else Actuator.on(kind, dict(table))
        return replace(kind, exerts=actuator.exerts)
    except (InputError, TypeError, ValueError):  # a later check reports this error
        return replace(kind, exerts=tuple((command, 1.0) for command in COMMANDS))


def counted_by(kind: AxisKind, tables: Mapping[str, Any]) -> tuple[tuple[str, float], ...]:
    """Return the size of a count of the encoder [m or rad], and the time of a sample [s], as far as [drive] has them.

    Errors in [drive] are found later.
    """
    counted = []
    for name, key, unit in (("count", "encoder_resolution", "m"), ("sample", "sample_time", "s")):
        with suppress(InputError):
            if (entry := _of_table(tables, "drive", key)) is not None:
                counted.append((name, float(Quantity(unit, positive, f"1 {unit}").on(kind).read(entry))))
    return tuple(counted)


def _of_table(tables: Mapping[str, Any], name: str, key: str) -> Any:
    """Return the value of a key in a table, a mapping or a section; None if there is none."""
    table = tables.get(name)
    return table.get(key) if isinstance(table, dict) else getattr(table, key, None)


_MOTOR_LAW = f"{MOTOR_FRICTION}.model"


def numeric_keys(flat: Mapping[str, Any]) -> dict[str, Quantity | Number]:
    """Return unit, bound and example of every numeric key that a stage can have.

    `flat` has the stage's keys, which name its tables. Units are those of its axis.
    """
    return {key: field.on(axis_of(flat)) for key, field in declared_keys(flat).items()}


def declared_keys(flat: Mapping[str, Any]) -> dict[str, Quantity | Number]:
    """Return unit, bound and example of every numeric key that a stage can have.

    `flat` has the stage's keys, which name its tables. Units are those of a linear axis.
    """
    keys: dict[str, Quantity | Number] = {}
    for name, cls in _tables(flat).items():
        keys |= _numeric_keys_of(flat, name, cls)
    return keys


def _numeric_keys_of(flat: Mapping[str, Any], name: str, cls: type[Section]) -> dict[str, Quantity | Number]:
    """Return unit, bound and example of the numeric keys of a table, and of the tables in it.

    `cls` reads the table with this `name`.
    """
    keys: dict[str, Quantity | Number] = {f"{name}.{key}": field for key, field in numeric_fields(cls).items()}
    for key, several in list_fields(cls).items():
        keys |= dict.fromkeys(element_keys(flat, f"{name}.{key}"), several.of)
    for place, row in _rows(flat, name, cls):
        keys |= _numeric_keys_of(flat, place, row)
    return keys


def _rows(flat: Mapping[str, Any], name: str, cls: type[Section]) -> Iterator[tuple[str, type[Section]]]:
    """Yield the tables in a table's arrays: names such as "controller.filters.2", and classes."""
    for key, array in table_arrays(cls).items():
        yield from array.rows(flat, f"{name}.{key}").items()


def violations(flat: Mapping[str, Any]) -> list[tuple[Any, str]]:
    """Return the bounds and rules that a stage's keys in SI break, each as where and why.

    Keys may have arrays; `where` is then a boolean array, else a boolean.
    """
    bounds = [
        (np.logical_not(field.bound.holds(flat[key])), f"{key} must be {field.bound.text}")
        for key, field in numeric_keys(flat).items()
        if key in flat
    ]
    rules = [(broken, f"{', '.join(rule.keys)}: expected {rule.expected}") for rule, broken in _broken_rules(flat)]
    return [(broken, why) for broken, why in bounds + rules if np.any(broken)]


def _broken_rules(flat: Mapping[str, Any]) -> Iterator[tuple[Rule, Any]]:
    """Yield each rule between keys, and where the stage's keys in SI break it.

    "Where" is a boolean, or an array of booleans if keys have arrays.
    """
    for name, owner in (("", Stage), *_tables(flat).items()):
        at_motor = name == MOTOR_FRICTION
        for rule in owner.rules:
            keys = tuple(key.replace("friction.", f"{name}.", 1) for key in rule.keys) if at_motor else rule.keys
            holds = rule.holds(of_motor(flat) if at_motor else flat)
            yield replace(rule, keys=keys), np.logical_not(holds)
        for place, row in _rows(flat, name, owner):
            for rule in (rule.at(place) for rule in row.rules):
                yield rule, np.logical_not(rule.holds(flat))


def _tables(flat: Mapping[str, Any]) -> dict[str, type[Section]]:
    """Return the classes of a stage's tables by name; `flat` has the stage's keys."""
    classes = {
        "axis": AxisTable,
        "masses": Masses,
        "friction": friction_law(flat["friction.model"]),
        "transmission": Transmission,
        "encoder": Encoder,
        **({MOTOR_FRICTION: friction_law(flat[_MOTOR_LAW])} if _MOTOR_LAW in flat else {}),
        "flexure": Flexure,  # first, because a mistake here causes later ones
        "joint": Joint,
        "parasitic": Parasitic,
        "bias": Bias,
        "drive": Drive,
        "rail": Rail,
        "conditions": Conditions,
        "cable": Cable,
        **({CONTROLLER: controller_of(flat)} if KIND in flat else {}),
        "motion": motion_of(flat),
    }
    present = {key.split(".")[0] for key in flat}
    return {name: cls for name, cls in classes.items() if name in present}


def _table_lines(name: str, table: Mapping[str, Any]) -> list[str]:
    """Return the lines of a table in TOML: its own keys, then its arrays of tables."""
    arrays = {
        key: value
        for key, value in table.items()
        if isinstance(value, list) and isinstance(next(iter(value), {}), dict)
    }
    lines = ["", f"[{name}]", *(f"{key} = {_toml(value)}" for key, value in table.items() if key not in arrays)]
    for key, rows in arrays.items():
        for row in rows:
            lines += ["", f"[[{name}.{key}]]", *(f"{inner} = {_toml(value)}" for inner, value in row.items())]
    return lines


def _at(stage: Stage, key: str) -> Any:
    """Return the value at a key such as "friction.static" in a stage; None if there is none."""
    value: Any = stage
    for name in key.split("."):
        value = value[int(name) - 1] if isinstance(value, tuple) else getattr(value, name)
    return value


def _toml(value: Any) -> str:
    """Write a key's value, a scalar or a list, as TOML."""
    return f"[{', '.join(map(as_toml, value))}]" if isinstance(value, list) else as_toml(value)


def _written(value: Any) -> str:
    """Write a key's value for an error message."""
    return f"[{', '.join(map(quoted, value))}]" if isinstance(value, list) else quoted(value)


def _plain(value: Any) -> Any:
    """Convert numbers to plain floats; texts and booleans stay."""
    return value if isinstance(value, bool | str) else float(value)


def _with_defaults(flat: dict[str, Any]) -> dict[str, Any]:
    """Add to a stage's keys in SI the defaults that follow from other keys."""
    if (mass := motor_mass(flat)) is not None:
        flat.setdefault(MOTOR_MASS, mass)
    for key, value in controller_of(flat).with_defaults(flat).items():
        flat.setdefault(key, value)
    for key, value in motion_of(flat).with_defaults(flat).items():
        flat.setdefault(key, value if np.ndim(value) else float(value))
    if FORCE_LIMIT in flat:
        flat.setdefault(ANTI_WINDUP, "clamp")
    return with_material(flat)


def _text(value: Any) -> Any:
    """Return a value as the user wrote it."""
    return getattr(value, "text", value)


def _under(tables: Mapping[str, Any], key: str) -> Any:
    """Return the value at a key like "friction.static" in nested tables; None if there is none."""
    place: Any = tables
    for name in key.split("."):
        place = place.get(name) if isinstance(place, Mapping) else None
    return place


def _put(tables: dict[str, Any], key: str, value: Any) -> None:
    """Set a key such as "friction.static" in nested tables, or an element of an array.

    None removes the key; it removes no single element of an array. Raises StageError for a key below a value that is no
    table, and for an element that an array does not have. It is also raised for a key to be removed that is not there.
    """
    *path, last = key.split(".")
    place: Any = tables
    for depth, name in enumerate(path):
        place = place[_number(place, key, depth)] if isinstance(place, list) else place.setdefault(name, {})
        if not isinstance(place, dict | list):
            raise StageError(key, "an unknown key", f"{name} is not a table", 'masses.stage="0.6 kg"')
    if isinstance(place, list):
        number = _number(place, key, len(path))
        if value is None:
            array = ".".join(path)
            raise StageError(key, "an element to remove", f"the whole array {array} without it")
        place[number] = value
    elif value is not None:
        place[last] = value
    elif place.pop(last, None) is None:
        raise StageError(key, "a key to remove", "a key that the stage has")


def _split(text: str) -> tuple[str, ...]:
    """Return the words of a text, which commas separate."""
    return tuple(filter(None, map(str.strip, text.split(","))))


def _has(tables: Mapping[str, Any], key: str) -> bool:
    """Tell whether nested tables have a key such as "friction.static", or a table."""
    place: Any = tables
    for name in key.split("."):
        if not isinstance(place, Mapping) or name not in place:
            return False
        place = place[name]
    return True


def _number(values: list[Any], key: str, depth: int) -> int:
    """Return the index, from 0, of an array element, by its number in a key: 1 for "2".

    The number is the part of the key at the place `depth`. Raises StageError if the array `values` has no such element.
    """
    parts = key.split(".")
    number, array = parts[depth], ".".join(parts[:depth])
    if not (number.isascii() and number.isdigit() and 1 <= int(number) <= len(values)):
        expected = f"a number from 1 to {len(values)}" if values else "no number: the array is empty"
        raise StageError(key, f"the element {number}", expected, f"{array}.1")
    return int(number) - 1
