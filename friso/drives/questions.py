"""What a parameter file does not tell, asked for all at once, and the answers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from friso.axis import LINEAR, AxisKind
from friso.errors import InputError
from friso.quantities import Number, Quantity, quoted
from friso.stage.section import Section, nearest_name, numeric_fields
from friso.stage.tables import FRICTION, Masses, ThereAndBack, friction_law


@dataclass(frozen=True)
class OpenQuestion:
    """What is asked for: its key, what it is, and an example of an answer as --set takes it."""

    key: str
    meaning: str
    example: str

    @property
    def option(self) -> str:
        """The option that answers it."""
        return f"--set {self.key}={self.example}"


class UserAnswers:
    """What the user says besides a file: texts by key, as --set reads them."""

    def __init__(self, texts: Mapping[str, Any]) -> None:
        self.texts = dict(texts)
        self.wanted: set[str] = set()

    def with_examples(self, questions: Iterable[OpenQuestion]) -> UserAnswers:
        """These answers, and to the questions that are open the examples."""
        return UserAnswers({**{question.key: question.example.strip('"') for question in questions}, **self.texts})

    def __contains__(self, key: object) -> bool:
        self.wanted.add(str(key))
        return key in self.texts

    def refuse_unwanted(self) -> None:
        """Raises InputError for an answer to what nothing asked, such as a misspelled one; keys of tables are checked
        with the stage."""
        for key in self.texts:
            if "." not in key and key not in self.wanted:
                wanted = sorted(name for name in self.wanted if "." not in name)
                near = nearest_name(key, wanted) or "masses.stage"
                expected = f"a key of the stage{''.join(f', {name}' for name in wanted)}"
                raise InputError("--set", quoted(key), expected, f"--set {near}=...")

    def value(self, key: str, field: Quantity | Number) -> float:
        """A number in SI. Raises InputError for another answer."""
        try:
            return float(field.read(self.texts[key]))
        except InputError as error:
            raise error.under(key) from None

    def choice(self, key: str, choices: tuple[str, ...]) -> str:
        """One of some texts. Raises InputError for another answer."""
        if (text := str(self.texts[key])) not in choices:
            raise InputError(key, quoted(text), f"one of {', '.join(choices)}", f"--set {key}={choices[0]}")
        return text

    def kind_of(self, key: str, fields: Mapping[AxisKind, Quantity]) -> tuple[AxisKind, float]:
        """The kind of axis whose unit an answer has, and its value in SI. Raises InputError for another answer."""
        for kind, field in fields.items():
            try:
                return kind, float(field.read(self.texts[key]))
            except InputError:
                continue
        units = " or ".join(field.unit for field in fields.values())
        example = next(iter(fields.values())).example
        raise InputError(key, quoted(str(self.texts[key])), f"number and unit in quotes, in {units}", example)


def of_the_machine(answers: UserAnswers, kind: AxisKind = LINEAR, moved: bool = False) -> tuple[OpenQuestion, ...]:
    """What no drive knows of its machine and nobody has said yet: what moves, its friction, and, unless a file says how
    it is `moved`, a move to try. Raises InputError for a friction law that there is not."""
    asked: list[OpenQuestion] = []
    if not {"masses.cart", "masses.stage"} & answers.texts.keys():
        asked += _of_table("masses", Masses, ("stage",), {"stage": "what moves"}, kind)
    model = str(answers.texts.get("friction.model", "lugre"))
    if model not in FRICTION.classes:
        raise InputError("friction.model", quoted(model), f"one of {', '.join(sorted(FRICTION.classes))}")
    law: type[Section] = friction_law(model)
    names = [name for name in numeric_fields(law) if law.model_fields[name].is_required()]
    meaning = dict.fromkeys(
        names, "friction of the guide" + ("; or --set friction.model=none" if model == "lugre" else "")
    )
    asked += _of_table("friction", law, names, meaning, kind)
    if not moved and "motion.kind" not in answers:
        names = ["acceleration", "acceleration_time"]
        asked += _of_table("motion", ThereAndBack, names, dict.fromkeys(names, "of the move to try"), kind)
    return tuple(question for question in asked if question.key not in answers)


def _of_table(
    table: str, section: type[Section], names: Iterable[str], meaning: Mapping[str, str], kind: AxisKind
) -> list[OpenQuestion]:
    fields = {name: field.on(kind) for name, field in numeric_fields(section).items()}
    return [OpenQuestion(f"{table}.{name}", meaning[name], fields[name].written_example) for name in names]


def refuse_open(questions: Iterable[OpenQuestion], origin: str) -> None:
    """Raises InputError with all that is open, in one list."""
    asked = list(questions)
    if asked:
        values = f"{len(asked)} values are" if len(asked) > 1 else "one value is"
        width = max(len(question.option) for question in asked)
        lines = [f"{question.option:<{width}}  {question.meaning}" for question in asked]
        raise InputError(
            "",
            f"{values} missing",
            "\n            ".join(["set all of these:" if len(asked) > 1 else "set:", *lines]),
            origin=origin,
        )
