"""Collect the commands of friso.

Each question has a command; a few commands ask no question (`friso/cli/commands/`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from inspect import signature
from typing import Any

from typer.core import TyperArgument, TyperCommand

from friso.errors import InputError
from friso.interface.question import QUESTIONS, TOPICS, Choices, Question
from friso.platform.installed import leave_out
from friso.registry import Registry


class _Command(TyperCommand):
    """A command whose help names arguments as the usage line does, without their Python types."""

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write the options and arguments without the types of arguments."""
        for parameter in self.params:
            if isinstance(parameter, TyperArgument):
                parameter.display_type_rich = lambda ctx: None
        super().format_options(ctx, formatter)


@dataclass(frozen=True)
class Command:
    """A command that asks no question.

    The docstring of `function` is its help. `place` orders the commands of a `topic` in `friso --help`. Raises
    ValueError for a topic that is not one of TOPICS. Raises TypeError or NameError for a function whose options typer
    could not read.
    """

    function: Callable[..., None]
    place: float
    topic: str
    choices: Choices | None = None

    def __post_init__(self) -> None:
        """Check that typer can read the function's options, and that the topic exists.

        Raises ValueError for an unknown topic. Raises TypeError or NameError for a function that typer cannot read.
        """
        signature(self.function, eval_str=True)
        if self.topic not in TOPICS:
            raise ValueError(f"topic {self.topic!r} is none of {', '.join(TOPICS)}")

    @property
    def summary(self) -> str:
        """Return the command in one line, the first of its function's docstring."""
        return (self.function.__doc__ or "").partition("\n")[0].strip().rstrip(".")


@dataclass(frozen=True)
class QuestionCommand:
    """The command of a question.

    Its options are read from the question's function when needed.
    """

    question: Question

    @property
    def place(self) -> float:
        """Return where the command stands among those of its topic; lower numbers come first."""
        return self.question.place

    @property
    def topic(self) -> str:
        """Return the topic below which the command is listed."""
        return self.question.topic

    @property
    def choices(self) -> Choices | None:
        """Return the list below the help of the command, if it has one."""
        return self.question.choices

    @property
    def summary(self) -> str:
        """Return the command in one line."""
        return self.question.summary

    @cached_property
    def function(self) -> Callable[..., None]:
        """Return the function that typer calls.

        Raises InputError for a question of another package that cannot be read.
        """
        from friso.cli.derived import command_function

        try:
            return command_function(self.question)
        except (KeyError, TypeError) as error:
            if self.question.package.startswith("friso."):
                raise
            expected = "a function with @question, whose parameters are described and of kinds that friso knows"
            raise InputError(
                f"friso.questions: {self.question.name}", f"{self.question.module}: {error}", expected
            ) from error


AnyCommand = Command | QuestionCommand

WITHOUT_QUESTION = Registry[Command]("friso.cli.commands", "COMMAND")
"""Every module of `friso/cli/commands/` declares a command that asks no question."""


class _Commands(Mapping[str, AnyCommand]):
    """All commands by name, in alphabetical order."""

    def __iter__(self) -> Iterator[str]:
        return iter(sorted({*WITHOUT_QUESTION, *QUESTIONS}))

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def __contains__(self, name: object) -> bool:
        return name in WITHOUT_QUESTION or name in QUESTIONS

    def __getitem__(self, name: str) -> AnyCommand:
        return WITHOUT_QUESTION[name] if name in WITHOUT_QUESTION else QuestionCommand(QUESTIONS[name])

    def usable(self) -> Iterator[tuple[str, AnyCommand]]:
        """Yield the commands by name.

        A command of another package that cannot be used is reported and left out.
        """
        for name in self:
            try:
                command = self[name]
                command.summary  # noqa: B018 (raises where there is none)
                yield name, command
            except InputError as error:
                leave_out(error)


COMMANDS = _Commands()


def help_class(choices: Choices | None) -> type[TyperCommand]:
    """Return the typer class that shows a command's help, with its choices below."""
    if choices is None:
        return _Command

    class ListingCommand(_Command):
        """A command whose help ends with a list of choices."""

        def format_epilog(self, ctx: Any, formatter: Any) -> None:
            """Write the list of choices below the help."""
            with formatter.section(choices.title):
                formatter.write_dl([*choices.rows()])

    return ListingCommand


def listed(command: AnyCommand) -> Callable[[], None]:
    """Return a stand-in for a command in the list of all, which needs only a summary."""

    def stand_in() -> None:
        """Stand for the command in the list, where it is never called."""
        raise RuntimeError("a command of the list is not called")

    stand_in.__doc__ = command.summary
    return stand_in
