"""Ask at once for everything that a parameter file or a stage does not say, while it is read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi
from typing import Any

from friso.axis import LINEAR, ROTARY, AxisKind, axis_of
from friso.equations.motions import ThereAndBack
from friso.errors import InputError
from friso.quantities import Number, Quantity, positive, quoted
from friso.stage.section import Section, nearest_name, numeric_fields
from friso.stage.tables import FRICTION, Masses, friction_law

Field = Quantity | Number | tuple[str, ...]
"""What an answer may be: a quantity, a number, or one of some texts."""


@dataclass(frozen=True)
class OpenQuestion:
    """A value that the user must give: its key, its meaning, and an example for --set."""

    key: str
    meaning: str
    example: str

    @property
    def option(self) -> str:
        """Return the command-line option that answers the question."""
        return f"--set {self.key}={self.example}"


class Ask:
    """The values that the user gives beside a file: texts by key, as --set reads them.

    Asking for one returns the answer. Where there is none, the question is noted in `open` and its example stands in,
    so that one pass over a file finds everything that is open. All keys that were asked for are kept, so that
    misspelled ones can be refused.
    """

    def __init__(self, texts: Mapping[str, Any]) -> None:
        """Keep the texts that the user gave. No key has been asked for yet."""
        self.texts = dict(texts)
        self.open: list[OpenQuestion] = []
        self._asked: set[str] = set()

    def __contains__(self, key: object) -> bool:
        """Tell whether the user answered a key, and remember that it was asked for."""
        self._asked.add(str(key))
        return key in self.texts

    def __call__(self, key: str, meaning: str, example: str, field: Field | None = None) -> Any:
        """Return an answer: a number in SI or a text, as the `field` reads it; a key of the stage has none.

        Raises InputError for an answer that the field does not allow.
        """
        if key not in self and all(one.key != key for one in self.open):
            self.open.append(OpenQuestion(key, meaning, example))
        return None if field is None else self._read(key, example, field)

    def value(self, key: str, field: Quantity | Number) -> float:
        """Return a given answer as a number in SI. Raises InputError if it is not what the `field` allows."""
        return self._read(key, "", field)

    def _read(self, key: str, example: str, field: Field) -> Any:
        """Return an answer, or the example if there is none, as the `field` reads it."""
        given = self.texts.get(key, float(example) if isinstance(field, Number) and example else example.strip('"'))
        if isinstance(field, tuple):
            if str(given) not in field:
                raise InputError(key, quoted(str(given)), f"one of {', '.join(field)}", f"--set {key}={field[0]}")
            return str(given)
        try:
            return float(field.read(given))
        except InputError as error:
            raise error.under(key) from None

    def of_kind(
        self, key: str, meaning: str, example: str, fields: Mapping[AxisKind, Quantity]
    ) -> tuple[AxisKind, float]:
        """Return the kind of axis that an answer's unit implies, and the answer in SI; of an open one, linear and 1.

        `fields` say, for each kind of axis, what the answer may be. Raises InputError if the unit fits no kind of axis.
        """
        self(key, meaning, example)
        if key not in self.texts:
            return LINEAR, 1.0
        for kind, field in fields.items():
            try:
                return kind, float(field.read(self.texts[key]))
            except InputError:
                continue
        units = " or ".join(field.unit for field in fields.values())
        raise InputError(
            key, quoted(str(self.texts[key])), f"number and unit in quotes, in {units}", fields[LINEAR].example
        )

    def length(self, position: str, example: str) -> tuple[AxisKind, float]:
        """Return the kind of axis, and how far a `position` of 1 moves the load [m or rad]."""
        return self.of_kind(LENGTH, f"how far {position} moves the load; an angle on a rotary axis", example, LENGTHS)

    def force(self, kind: AxisKind, output: str) -> float:
        """Return what an `output` of 1 exerts at the load [N or N m]."""
        field = FORCE_FIELD.on(kind)
        return self(FORCE, f"what {output} exerts at the load", field.written_example, field)

    def turn(self, meaning: str, example: str, flat: Mapping[str, Any]) -> tuple[AxisKind, float]:
        """Return the kind of axis, and how far a turn of the motor moves the load [m or rad].

        A stage, unless `flat` is empty, tells its kind, and the travel if it has a transmission.
        """
        if not flat:
            return self.of_kind(TRAVEL, meaning, example, TRAVELS)
        kind, told = axis_of(flat), travel_of(flat)
        if told is not None and TRAVEL not in self:
            return kind, told
        return kind, self(TRAVEL, meaning, TRAVELS[kind].written_example, TRAVELS[kind])

    def kind(self, *keys: str) -> AxisKind:
        """Return the kind of axis that an answer on a length or a travel implies; linear without an answer."""
        for key in keys:
            if key in self:
                return self.of_kind(key, "", "", {LENGTH: LENGTHS, TRAVEL: TRAVELS}[key])[0]
        return LINEAR

    def of_the_machine(self, kind: AxisKind, moved: bool = False) -> None:
        """Ask for what no parameter file states: the moving mass, friction, and a move to try unless one is `moved`.

        Raises InputError for an unknown friction law.
        """
        if not {"masses.cart", "masses.stage"} & self.texts.keys():
            self._of_table("masses", Masses, {"stage": moving_mass(kind)}, kind)
        guessed = "friction.guess" in self
        model = str(self.texts.get("friction.model", "lugre"))
        if model not in FRICTION.classes:
            raise InputError("friction.model", quoted(model), f"one of {', '.join(sorted(FRICTION.classes))}")
        law: type[Section] = friction_law(model)
        names = [name for name in numeric_fields(law) if law.model_fields[name].is_required() and not guessed]
        contact, what = (
            ("ball screw", "the guide") if kind == LINEAR else ("strain-wave gear", "the bearings and the gear")
        )
        instead = f'; or friction.coulomb and friction.guess="{contact}" alone, or friction.model=none'
        meaning = f"friction of {what}{instead if model == 'lugre' else ''}"
        self._of_table("friction", law, dict.fromkeys(names, meaning), kind)
        if not moved and "motion.kind" not in self:
            names = ["acceleration", "acceleration_time"]
            self._of_table("motion", ThereAndBack, dict.fromkeys(names, "of the move to try"), kind)

    def _of_table(self, table: str, section: type[Section], meanings: Mapping[str, str], kind: AxisKind) -> None:
        """Ask for keys of a table of the stage file, with what each means.

        `section` is the class that reads the table. Unit and example follow from it and from the kind of axis.
        """
        fields = numeric_fields(section)
        for name, meaning in meanings.items():
            self(f"{table}.{name}", meaning, fields[name].on(kind).written_example)

    def refuse_open(self, origin: str) -> None:
        """Refuse to go on while questions are open.

        Raises InputError that lists them all, and names the file or option `origin`.
        """
        if not self.open:
            return
        values = f"{len(self.open)} values are" if len(self.open) > 1 else "one value is"
        width = max(len(question.option) for question in self.open)
        before = ["", *(question.meaning for question in self.open)]
        says = ["as above" if q.meaning == last else q.meaning for q, last in zip(self.open, before, strict=False)]
        lines = [f"{question.option:<{width}}  {text}" for question, text in zip(self.open, says, strict=True)]
        expected = "\n            ".join(["set all of these:" if len(self.open) > 1 else "set:", *lines])
        raise InputError("", f"{values} missing", expected, origin=origin)

    def refuse_unwanted(self) -> None:
        """Refuse answers that nothing asked for, such as a misspelled key.

        Raises InputError for the first of them. Keys of tables, which contain a dot, are left to the check of the
        stage.
        """
        for key in self.texts:
            if "." not in key and key not in self._asked:
                wanted = sorted(name for name in self._asked if "." not in name)
                near = nearest_name(key, wanted) or "masses.stage"
                expected = f"a key of the stage{''.join(f', {name}' for name in wanted)}"
                raise InputError("--set", quoted(key), expected, f"--set {near}=...")


FORCE, LENGTH, TRAVEL = "force_per_output", "length_per_unit", "travel_per_turn"
"""Keys of answers on units: what an output of 1 exerts at the load, and how far a position of 1 and a turn move it."""

FORCE_FIELD = Quantity("N", positive, "20 N")
GAIN_FIELD = Quantity("N*s/m", positive, "500 N*s/m")
LENGTHS = {LINEAR: Quantity("m", positive, "1 um"), ROTARY: Quantity("rad", positive, "0.01 deg")}
TRAVELS = {LINEAR: Quantity("m", positive, "10 mm"), ROTARY: Quantity("rad", positive, "360 deg")}


def moving_mass(kind: AxisKind) -> str:
    """Say what counts as moving mass of an axis that a drive moves; no parameter file states it."""
    if kind == LINEAR:
        return "the mass of load and rotor; a rotor of inertia J counts as J (2 pi / travel of a turn)^2"
    return "the inertia of load and rotor about the axis; behind a gear the rotor's counts times the ratio squared"


def travel_of(flat: Mapping[str, Any]) -> float | None:
    """Return how far one turn of the motor moves the load [m or rad].

    The transmission's ratio or lead gives it. Returns None for a stage without a transmission.
    """
    if "transmission.ratio" in flat:
        return 2 * pi / flat["transmission.ratio"]
    return flat.get("transmission.lead")
