"""Ask at once for everything that a parameter file does not say, and read the answers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from friso.axis import LINEAR, AxisKind
from friso.equations.motions import ThereAndBack
from friso.errors import InputError
from friso.quantities import Number, Quantity, quoted
from friso.stage.section import Section, nearest_name, numeric_fields
from friso.stage.tables import FRICTION, Masses, friction_law


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


class UserAnswers:
    """The values that the user gives beside a file: texts by key, as --set reads them.

    The object remembers which keys were asked for, so that misspelled ones can be refused.
    """

    def __init__(self, texts: Mapping[str, Any]) -> None:
        """Keep the texts that the user gave. No key has been asked for yet."""
        self.texts = dict(texts)
        self.wanted: set[str] = set()

    def with_examples(self, questions: Iterable[OpenQuestion]) -> UserAnswers:
        """Return a copy in which the example answers each question that is still open."""
        return UserAnswers({**{question.key: question.example.strip('"') for question in questions}, **self.texts})

    def __contains__(self, key: object) -> bool:
        """Tell whether the user answered a key, and remember that it was asked for."""
        self.wanted.add(str(key))
        return key in self.texts

    def refuse_unwanted(self) -> None:
        """Refuse answers that nothing asked for, such as a misspelled key.

        Raises InputError for the first of them. Keys of tables, which contain a dot, are left to the check of the
        stage.
        """
        for key in self.texts:
            if "." not in key and key not in self.wanted:
                wanted = sorted(name for name in self.wanted if "." not in name)
                near = nearest_name(key, wanted) or "masses.stage"
                expected = f"a key of the stage{''.join(f', {name}' for name in wanted)}"
                raise InputError("--set", quoted(key), expected, f"--set {near}=...")

    def value(self, key: str, field: Quantity | Number) -> float:
        """Return an answer as a number in SI, if it is what the `field` allows.

        Raises InputError otherwise.
        """
        try:
            return float(field.read(self.texts[key]))
        except InputError as error:
            raise error.under(key) from None

    def choice(self, key: str, choices: tuple[str, ...]) -> str:
        """Return an answer that must be one of some texts. Raises InputError for any other."""
        if (text := str(self.texts[key])) not in choices:
            raise InputError(key, quoted(text), f"one of {', '.join(choices)}", f"--set {key}={choices[0]}")
        return text

    def kind_of(self, key: str, fields: Mapping[AxisKind, Quantity]) -> tuple[AxisKind, float]:
        """Return the kind of axis that an answer's unit implies, and the answer in SI.

        `fields` say, for each kind of axis, what the answer may be. Raises InputError if the unit fits no kind of axis.
        """
        for kind, field in fields.items():
            try:
                return kind, float(field.read(self.texts[key]))
            except InputError:
                continue
        units = " or ".join(field.unit for field in fields.values())
        example = next(iter(fields.values())).example
        raise InputError(key, quoted(str(self.texts[key])), f"number and unit in quotes, in {units}", example)


def moving_mass(kind: AxisKind) -> str:
    """Say what counts as moving mass of an axis that a drive moves; no parameter file states it."""
    if kind == LINEAR:
        return "the mass of load and rotor; a rotor of inertia J counts as J (2 pi / travel of a turn)^2"
    return "the inertia of load and rotor about the axis; behind a gear the rotor's counts times the ratio squared"


def of_the_machine(answers: UserAnswers, kind: AxisKind = LINEAR, moved: bool = False) -> tuple[OpenQuestion, ...]:
    """List questions about the machine that no parameter file answers and the user has not.

    They ask for moving mass and friction, and for a move to try unless the file gives one (`moved`). Raises InputError
    for an unknown friction law.
    """
    asked: list[OpenQuestion] = []
    if not {"masses.cart", "masses.stage"} & answers.texts.keys():
        asked += _of_table("masses", Masses, ("stage",), {"stage": moving_mass(kind)}, kind)
    guessed = "friction.guess" in answers
    model = str(answers.texts.get("friction.model", "lugre"))
    if model not in FRICTION.classes:
        raise InputError("friction.model", quoted(model), f"one of {', '.join(sorted(FRICTION.classes))}")
    law: type[Section] = friction_law(model)
    names = [name for name in numeric_fields(law) if law.model_fields[name].is_required() and not guessed]
    contact, of_what = (
        ("ball screw", "the guide") if kind == LINEAR else ("strain-wave gear", "the bearings and the gear")
    )
    instead = f'; or friction.coulomb and friction.guess="{contact}" alone, or friction.model=none'
    meaning = dict.fromkeys(names, f"friction of {of_what}{instead if model == 'lugre' else ''}")
    asked += _of_table("friction", law, names, meaning, kind)
    if not moved and "motion.kind" not in answers:
        names = ["acceleration", "acceleration_time"]
        asked += _of_table("motion", ThereAndBack, names, dict.fromkeys(names, "of the move to try"), kind)
    return tuple(question for question in asked if question.key not in answers)


def _of_table(
    table: str, section: type[Section], names: Iterable[str], meaning: Mapping[str, str], kind: AxisKind
) -> list[OpenQuestion]:
    """Build one open question for each named key of a table of the stage file.

    `section` is the class that reads the table, and `meaning` says what each key means. Unit and example follow from
    the kind of axis, linear or rotary.
    """
    fields = {name: field.on(kind) for name, field in numeric_fields(section).items()}
    return [OpenQuestion(f"{table}.{name}", meaning[name], fields[name].written_example) for name in names]


def refuse_open(questions: Iterable[OpenQuestion], origin: str) -> None:
    """Refuse to go on while questions are open.

    Raises InputError that lists them all, and names the file or option `origin`.
    """
    asked = list(questions)
    if asked:
        values = f"{len(asked)} values are" if len(asked) > 1 else "one value is"
        width = max(len(question.option) for question in asked)
        before = ["", *(question.meaning for question in asked)]
        says = ["as above" if q.meaning == last else q.meaning for q, last in zip(asked, before, strict=False)]
        lines = [f"{question.option:<{width}}  {text}" for question, text in zip(asked, says, strict=True)]
        expected = "\n            ".join(["set all of these:" if len(asked) > 1 else "set:", *lines])
        raise InputError("", f"{values} missing", expected, origin=origin)
