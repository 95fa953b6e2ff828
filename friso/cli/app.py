"""Run the command line: `friso COMMAND STAGE.toml`.

Exit status: 0 done, 1 the computation could not be completed, 2 the input is wrong, 130 interrupted.

Each question has a command. A few commands ask no question (`friso/cli/commands.py`).
"""

from __future__ import annotations

import gc
import io
import logging
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextvars import copy_context
from dataclasses import dataclass
from functools import cached_property
from inspect import signature
from typing import Annotated, Any, NoReturn, TextIO

import typer
from typer.core import TyperArgument, TyperCommand, TyperGroup

from friso.cli.asking import number_refused, parted_path, refuse_empty, with_checked_paths
from friso.cli.terminal import INTERRUPTED_STATUS, SPELLED, escaping, say
from friso.errors import InputError, shortened
from friso.interface.question import QUESTIONS, TOPICS, Choices, Question
from friso.platform import interrupts
from friso.platform.installed import installed_modules, leave_out
from friso.platform.system import LIBRARIES, cause_of, path_of
from friso.registry import Registry
from friso.version import VERSION


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
"""The commands that ask no question, in the table of `friso/cli/commands.py`."""


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


def _version(requested: bool) -> None:
    """Print the version and leave, if `--version` is given."""
    if requested:
        print(f"friso {VERSION}")
        raise typer.Exit


def friso(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Does a positioning stage on contact bearings hunt, why, and what stops it?

    Start with: friso init stage.toml, then friso check stage.toml
    """


TOUR = """friso: does a positioning stage on contact bearings hunt, why, and what stops it?

  friso example thesis_rig                  a stage file to try: thesis_rig.toml
  friso check thesis_rig.toml               does it hunt: as given, joint locked, joint free
  friso boundary thesis_rig.toml --set joint.locked=true --x controller.crossover="1 Hz..40 Hz"
                                            where hunting ends
  friso bode thesis_rig.toml                why: the loop in every state, stuck and sliding
  friso init my_stage.toml                  a commented stage file for your own machine

friso --help lists all commands by question; friso COMMAND --help has an example of each."""
"""Text that `friso` alone prints."""


class ByQuestion(TyperGroup):
    """The list of commands in `friso --help`, grouped by the question that they answer."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write each topic with the names and summaries of its commands."""
        for topic in TOPICS:
            commands = [(name, COMMANDS[name]) for name in self.list_commands(ctx) if name in COMMANDS]
            if rows := [(name, command.summary) for name, command in commands if command.topic == topic]:
                formatter.write(f"\n{topic}\n")
                with formatter.indentation():
                    formatter.write_dl(rows)


def command_line(*names: str, for_list: bool = False) -> typer.Typer:
    """Build the command line with the named commands, or with all of them.

    Commands stand in the order of their `place`. With `for_list` they have no options, so that their functions need not
    be imported.
    """
    app = typer.Typer(
        cls=ByQuestion,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.callback()(friso)
    commands = ((name, COMMANDS[name]) for name in names) if names else COMMANDS.usable()
    for name, command in sorted(commands, key=lambda item: item[1].place):
        function = listed(command) if for_list else with_checked_paths(command.function)
        app.command(name, cls=help_class(command.choices))(function)
    return app


GARBAGE_THRESHOLDS = 20_000, 20, 10
"""Thresholds of Python's garbage collector.

The defaults take a tenth of the time of imports and figures."""


def main() -> NoReturn:
    """Run the command line and end the process with its status.

    Wrong input ends in one message and status 2, never in a traceback.
    """
    gc.set_threshold(*GARBAGE_THRESHOLDS)
    sys.stdout, sys.stderr = sys.stdout or _nowhere(), sys.stderr or _nowhere()  # a closed stream
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors=SPELLED)  # a terminal without a minus sign still shows the answer
    with escaping():
        sys.exit(_status())


def _nowhere() -> TextIO:
    """Return a stream that discards what is written to it."""
    return open(os.devnull, "w", encoding="utf-8")


def _status() -> int:
    """Run the command and return the status of the process.

    Interrupts give 130 or 128 plus the signal.
    """
    signal = 0
    try:
        with interrupts.raising():
            try:
                status = _run()
                sys.stdout.flush()
            finally:
                signal = interrupts.came()
    except BaseException as error:
        signal = signal or interrupts.came() or (2 if isinstance(error, KeyboardInterrupt | typer.Abort) else 0)
        if not signal:
            return _failed(error)
        status = INTERRUPTED_STATUS
    if status == INTERRUPTED_STATUS:  # typer's word for Ctrl-C too
        # Where code from a text was interrupted (a dataclass's, say), python -m ends by SIGINT whatever the status is,
        # unless other such code ran to its end after it.
        exec("")
        say(interrupts.last_word(signal))
        return 128 + signal if signal else INTERRUPTED_STATUS
    return status


class Notices(logging.StreamHandler[Any]):
    """Writes messages as they come, but each of those on inputs once, when the answer stands."""

    def __init__(self) -> None:
        super().__init__(sys.stderr)
        self.held: dict[str, logging.LogRecord] = {}

    def emit(self, record: logging.LogRecord) -> None:
        """Write a message, or hold it."""
        if getattr(record, "after", False):
            self.held.setdefault(record.getMessage(), record)
        else:
            super().emit(record)

    def tell(self) -> None:
        """Write what was held."""
        sys.stdout.flush()
        for record in self.held.values():
            super().emit(record)


def _run() -> int:
    """Run the command and return its status.

    Only the named command is loaded, because the options of all commands take seconds to build.
    """
    messages, log = Notices(), logging.getLogger("friso")
    messages.setFormatter(logging.Formatter("friso: %(message)s"))
    log.addHandler(messages)
    try:
        if len(sys.argv) == 1 and "_FRISO_COMPLETE" not in os.environ:  # set by a shell that asks for completions
            print(TOUR)
            return 0
        refuse_empty(sys.argv[1:])
        typed = os.environ.get("_TYPER_COMPLETE_ARGS") or os.environ.get("COMP_WORDS")  # what a shell completes
        first = [name for name in (typed.split() if typed else sys.argv)[1:2] if name in COMMANDS]
        app = command_line(*first, for_list=not first)  # options of all commands take seconds to put together
        if {"-h", "--help"} & {*sys.argv[1:2]}:
            app.info.epilog = _plug_ins()
        return copy_context().run(app, standalone_mode=False) or 0
    finally:  # another run in this process may have another standard error
        log.removeHandler(messages)
        messages.tell()


def _function_of(command: str) -> Callable[..., None] | None:
    """Return the function of a command by its name; None for another name."""
    return COMMANDS[command].function if command in COMMANDS else None


def _failed(error: BaseException) -> int:
    """Report an error in one message and return the exit status.

    Raises errors that only a fault of friso can cause.
    """
    if isinstance(error, typer.Exit):
        return error.exit_code
    exits = isinstance(error, SystemExit)  # typer raises it for such errors
    if isinstance(error.__context__ if exits else error, BrokenPipeError):
        sys.stderr.close()
        return 1
    wrong = error if isinstance(error, InputError) else number_refused(error, sys.argv[1:], _function_of)
    if wrong is not None:
        say(f"{wrong}{parted_path(sys.argv[1:])}")
        return 2
    usage = getattr(error, "format_message", None)
    if usage is not None:
        context = getattr(error, "ctx", None)
        command = context.command_path if context else "friso"
        say(f"{shortened(usage())}{parted_path(sys.argv[1:])}\n  try: {command} --help")
        return 2
    if _is_of_loading(error):
        say(f"a library could not be loaded ({error}): {LIBRARIES}")
        return 1
    if isinstance(error, RuntimeError | OSError | MemoryError):
        cause = cause_of(error) if isinstance(error, OSError) else error
        path = path_of(error) if isinstance(error, OSError) else ""
        say(f"the computation could not be completed: {cause}{': ' if path else ''}{path}")
        return 1
    raise error


def _is_of_loading(error: BaseException) -> bool:
    """Tell whether a compiled library could not be loaded.

    A missing runtime of the system is a typical cause.
    """
    if isinstance(error, ImportError):
        return not isinstance(error, ModuleNotFoundError)
    return isinstance(error, OSError) and "llvmlite" in str(error)


def _plug_ins() -> str:
    """Return a line for the help that names what installed packages add; empty if nothing.

    The line names controllers, friction laws and motions.
    """
    if not any(map(installed_modules, ("friso.controllers", "friso.friction", "friso.motions"))):
        return ""
    from friso.stage.arguments import installed

    names = installed()
    return f"From other packages: {', '.join(names)}." if names else ""
