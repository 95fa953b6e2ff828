"""Derive commands from questions.

Options come from the function's signature, and help from its docstring.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from inspect import Parameter, Signature, getdoc
from pathlib import Path
from pkgutil import resolve_name
from typing import Annotated, Any

import typer

from friso.cli.asking import Shown, ask, option_of
from friso.interface.question import OF_THE_CALLER, Question, meaning
from friso.platform.interrupts import answers_interrupts
from friso.stage.arguments import KINDS, ArgumentKind, alternatives


@dataclass(frozen=True)
class CommandParameter:
    """A parameter of a question's function, as its command takes and shows it."""

    name: str
    kind: ArgumentKind
    default: Any
    help: str


def command_function(question: Question) -> Callable[..., None]:
    """Return the function that typer calls for a question.

    Its signature and docstring are made from the question's function, so that typer shows the right options and help.
    """

    def command(**values: Any) -> None:
        """Ask the question by the values of the command's options."""
        ask_by_values(question, values)

    parameters = [*_asked(question), *_of_the_shell(question)]
    command.__signature__ = Signature(parameters)  # type: ignore[attr-defined]  # inspect.signature reads it first
    command.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    command.__doc__ = command_help(question)
    return command


def ask_by_values(question: Question, values: Mapping[str, Any]) -> None:
    """Ask a question by the values of its command's parameters.

    Values that are None are left out.
    """
    shown = Shown(**{name: value for name, value in values.items() if name in Shown.__dataclass_fields__})
    about = [values[name] for name in question.takes]
    apart = {*question.takes, *Shown.__dataclass_fields__}
    options = {name: value for name, value in values.items() if value is not None and name not in apart}
    if question.answers_interrupted:
        answers_interrupts()
    run = resolve_name(question.runner) if question.runner else ask
    run(question, about, options, shown)


def command_help(question: Question) -> str:
    """Return the help of a command: its function's docstring without parameters, then examples."""
    before, _, _ = (getdoc(question.function) or "").partition("\n\nParameters\n---")
    first, *more = question.example.splitlines()
    return "\n\n".join([before, f"Example: friso {first}", *more])


def _asked(question: Question) -> Iterator[Parameter]:
    """Yield the parameters of a question: arguments in the order of `takes`, then options."""
    parameters = question.parameters
    for name in (*question.takes, *(name for name in parameters if name not in question.takes)):
        parameter = parameters[name]
        kind = _kind_of(str(parameter.annotation))
        if kind is not None and name not in (*OF_THE_CALLER, "out", "overwrite"):
            kind = replace(kind, metavar=question.metavars.get(name, kind.metavar))
            shown = CommandParameter(name, kind, parameter.default, meaning(question.function, name))
            yield _argument(shown) if name in question.takes else _option(shown)


def _kind_of(annotation: str) -> ArgumentKind | None:
    """Return how a parameter with this type `annotation` is read from the command line.

    Returns None for a parameter that only Python has.
    """
    kinds = [KINDS[part] for part in alternatives(annotation) if KINDS[part].command_type is not None]
    several = [kind for kind in kinds if kind.several]
    paths = [kind for kind in kinds if kind.command_type is Path]
    return (several or paths or kinds)[0] if kinds else None


def _argument(parameter: CommandParameter) -> Parameter:
    """Build an argument of a command, which has a place and no name."""
    info = typer.Argument(metavar=parameter.kind.metavar or parameter.name.upper(), help=parameter.help)
    return _typed(parameter, info, Parameter.empty if parameter.default is Parameter.empty else None)


def _option(parameter: CommandParameter) -> Parameter:
    """Build an option of a command, with its name, default and help.

    A boolean becomes a flag. Defaults are shown as short numbers.
    """
    kind, default = parameter.kind, parameter.default
    names = [option_of(parameter.name)]
    needed = default is Parameter.empty
    if kind.command_type is bool:
        return _typed(parameter, typer.Option(*names, help=parameter.help), default)
    metavar = kind.metavar or parameter.name.strip("_").upper()
    info = typer.Option(*names, metavar=metavar, help=parameter.help)
    if isinstance(default, float) and kind.command_type is str:
        default = f"{default:g}".replace("e-0", "e-")
    return _typed(parameter, info, default if needed or isinstance(default, str | int | float) else None)


def _typed(parameter: CommandParameter, info: Any, default: Any) -> Parameter:
    """Build a parameter with the type that typer expects; one that may be repeated takes a list.

    `info` describes it to typer. A parameter without a `default` may be None.
    """
    one: Any = parameter.kind.command_type
    value = list[one] if parameter.kind.several else one
    annotation = value if default is not None else value | None
    return Parameter(parameter.name, Parameter.KEYWORD_ONLY, default=default, annotation=Annotated[annotation, info])


def _of_the_shell(question: Question) -> Iterator[Parameter]:
    """Yield the options that say where the answer goes: --out, --overwrite, --json and --details."""

    def option(name: str, default: Any, annotation: Any, declared: str, help: str, **more: Any) -> Parameter:
        """Build an option called `declared` on the command line, with its default, type and help."""
        info = typer.Option(declared, help=help, **more)
        return Parameter(name, Parameter.KEYWORD_ONLY, default=default, annotation=Annotated[annotation, info])

    if question.writes:
        folder = Path(question.folder) if question.folder else None
        helps = {
            "out": "Folder for the files written.",
            "overwrite": "Write even if the folder holds other files; replace files of the same name.",
        }
        helps |= {name: meaning(question.function, name) for name in helps if name in question.parameters}
        yield option("out", folder, Path | None, "--out", helps["out"], metavar=question.metavars.get("out", "DIR"))
        yield option("overwrite", False, bool, "--overwrite", helps["overwrite"])
    if question.document:
        yield option("as_json", False, bool, "--json", "One JSON document on standard output, nothing else.")
    if question.details:
        yield option("details", False, bool, "--details", "Also print what the answer rests on.")
