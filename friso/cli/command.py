"""What the module of a command declares: the command, its place in `friso --help`, and a list below its help."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from inspect import signature
from typing import Any

from typer.core import TyperArgument, TyperCommand

from friso.registry import Registry

HUNTS, WHERE, WHY, STOPS, MACHINE, HELP = (
    "Does it hunt?",
    "Where does it hunt?",
    "Why does it hunt?",
    "What stops it?",
    "What is my machine?",
    "Help",
)
QUESTIONS = (HUNTS, WHERE, WHY, STOPS, MACHINE, HELP)
"""The questions by which `friso --help` lists the commands."""


class _Command(TyperCommand):
    """A command whose help shows arguments as the usage does, without the type that Python has them in."""

    def format_options(self, ctx: Any, formatter: Any) -> None:
        for parameter in self.params:
            if isinstance(parameter, TyperArgument):
                parameter.display_type_rich = lambda ctx: None
        super().format_options(ctx, formatter)


@dataclass(frozen=True)
class Choices:
    """A list below the help of a command, read only when the help is asked for: (name, what it is in one line)."""

    title: str
    rows: Callable[[], Iterable[tuple[str, str]]]


@dataclass(frozen=True)
class Command:
    """A command of friso: the function that typer calls, whose docstring is the help; its `place` in the list of
    commands, which goes by increasing numbers, under the `question` that it answers. Raises ValueError for a question
    that is not one of QUESTIONS, TypeError or NameError for a function whose options typer could not read."""

    function: Callable[..., None]
    place: float
    question: str = HELP
    choices: Choices | None = None

    def __post_init__(self) -> None:
        signature(self.function, eval_str=True)
        if self.question not in QUESTIONS:
            raise ValueError(f"question {self.question!r} is none of {', '.join(QUESTIONS)}")
        if not isinstance(self.place, int | float):
            raise TypeError(f"place {self.place!r} is not a number")

    @property
    def summary(self) -> str:
        """The command in one line."""
        return (self.function.__doc__ or "").partition("\n")[0].strip().rstrip(".")

    @property
    def help_class(self) -> type[TyperCommand]:
        """The class of typer that shows the help, with the choices below."""
        choices = self.choices
        if choices is None:
            return _Command

        class ListingCommand(_Command):
            def format_epilog(self, ctx: Any, formatter: Any) -> None:
                with formatter.section(choices.title):
                    formatter.write_dl([*choices.rows()])

        return ListingCommand


COMMANDS = Registry[Command]("friso.cli.commands", "COMMAND", "friso.commands", Command)
"""Every module of `friso/cli/commands/` declares one, and every module that an installed package names."""
