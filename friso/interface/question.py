"""Define what a folder of `friso/questions/` declares, and what is derived from it.

A question is a function of friso with a command of the same name; its folder declares a `QUESTION`. The command, its
options, its help, and its entry in `friso --help` are derived from the QUESTION, the function's signature and its
docstring. Nothing heavy is imported here, because the list of commands is printed before arrays and units are loaded.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from importlib import import_module
from importlib.util import find_spec
from inspect import Parameter, signature
from pkgutil import resolve_name
from typing import Any

from friso.errors import InputError
from friso.platform.installed import load_declared
from friso.registry import Registry

GROUP = "friso.questions"
"""Group of entry points in which installed packages name their questions."""

HUNTS, WHERE, WHY, STOPS, MACHINE, HELP = (
    "Does it hunt?",
    "Where does it hunt?",
    "Why does it hunt?",
    "What stops it?",
    "What is my machine?",
    "Help",
)
TOPICS = (HUNTS, WHERE, WHY, STOPS, MACHINE, HELP)
"""The headings under which `friso --help` lists the commands."""


@dataclass(frozen=True)
class Choices:
    """A list below the help of a command: a title, and names, each with one line on it.

    `rows` is called, to read the list, only when the help is shown.
    """

    title: str
    rows: Callable[[], Iterable[tuple[str, str]]]

    @classmethod
    def of_registry(cls, title: str, *places: str) -> Choices:
        """Return a list of what registries hold, with one line on each.

        `places` are the registries' modules and their names in them, such as "friso.drives.drive:FORMATS".
        """

        def rows() -> list[tuple[str, str]]:
            """List the names in the registries, which are imported now."""
            registries = [resolve_name(place) for place in places]
            return [(name, registry.one_line(name)) for registry in registries for name in registry]

        return cls(title, rows)


@dataclass(frozen=True)
class Question:
    """One question: where its function is, and how its command takes options and shows answers.

    Raises ValueError for a topic that is not one of TOPICS, and TypeError for a `place` in the list of commands that is
    no number.
    """

    package: str
    """The package whose module `question` holds the function."""

    place: float
    """Position below the topic in `friso --help`; lower numbers come first."""

    topic: str

    example: str
    """Example command lines without "friso", one per line, shown below the help."""

    takes: tuple[str, ...] = ("stage",)
    """Parameters that the command takes as arguments; every other one is an option."""

    function_name: str = ""
    """Name of the function; "": the package's name."""

    folder: str = ""
    """Folder for files without --out; "": no files are written without --out."""

    writes: bool = True
    """Whether the answer has files, so that the command has --out and --overwrite."""

    document: bool = True
    """Whether the command has --json."""

    details: bool = False
    """Whether the answer has details, so that the command has --details."""

    files: tuple[str, ...] = ()
    """Names of files that must be writable before the command begins its work."""

    during: str = ""
    """Label of the progress bar until the work reports its own."""

    answers_interrupted: bool = False
    """Whether Ctrl-C ends the work with an answer from the results so far."""

    choices: Choices | None = None

    metavars: Mapping[str, str] = field(default_factory=dict)
    """Placeholder of a parameter's value in the help, if the usual placeholder says too little."""

    runner: str = ""
    """Module whose function `run` replaces the usual command, which only shows the answer."""

    def __post_init__(self) -> None:
        """Check the topic, and the place in the list of commands.

        Raises ValueError for an unknown topic, and TypeError for a place that is no number.
        """
        if self.topic not in TOPICS:
            raise ValueError(f"topic {self.topic!r} is none of {', '.join(TOPICS)}")
        if not isinstance(self.place, int | float):
            raise TypeError(f"place {self.place!r} is not a number")

    @property
    def name(self) -> str:
        """Return the name of the command: the name of the package, with dashes."""
        return self.package.rpartition(".")[2].replace("_", "-")

    @property
    def module(self) -> str:
        """Return the name of the module that holds the question's function."""
        return f"{self.package}.question"

    @property
    def in_python(self) -> str:
        """Return the name of the function in Python: friso.NAME."""
        return self.function_name or self.package.rpartition(".")[2]

    @cached_property
    def function(self) -> Callable[..., Any]:
        """Return the function that answers the question; its module is imported at first use.

        Raises InputError if an installed package's module cannot be imported, or lacks the function or its docstring.
        """
        if self.package.startswith("friso."):
            return getattr(import_module(self.module), self.in_python)
        _ = self.summary  # raises for a function without docstring
        return load_declared(GROUP, self.name, self.module, self.in_python, Callable)

    @property
    def parameters(self) -> Mapping[str, Parameter]:
        """Return the parameters of the question's function by name."""
        return signature(self.function).parameters

    @property
    def options(self) -> list[str]:
        """List all parameters that are options in Python, with or without a command-line form."""
        return [name for name in self.parameters if name not in self.takes and name not in OF_THE_CALLER]

    @cached_property
    def summary(self) -> str:
        """Return the first line of the function's docstring without its full stop.

        The module is not imported. Raises InputError if there is no such function, or it has no docstring.
        """
        text = ""
        try:
            spec = find_spec(self.module)
            source = getattr(spec.loader, "get_source", None) if spec else None
            for node in ast.parse((source and source(self.module)) or "").body:
                if isinstance(node, ast.FunctionDef) and node.name == self.in_python:
                    text = ast.get_docstring(node) or ""
        except (ImportError, SyntaxError) as error:
            raise InputError(f"{GROUP}: {self.name}", f"{self.module}, {error}", "a module that can be read") from error
        if not text:
            expected = f"a module with the function {self.in_python} and its docstring"
            raise InputError(f"{GROUP}: {self.name}", self.module, expected)
        return text.partition("\n")[0].rstrip(".")


OF_THE_CALLER = ("folder", "partly", "beside", "keep", "progress")
"""Parameters that the command supplies itself, such as the folder and the progress."""

QUESTIONS = Registry[Question]("friso.questions", "QUESTION", GROUP, Question)
"""The questions: one for each folder of `friso/questions/`, and those of installed packages."""


def function_of(name: str) -> Callable[..., Any]:
    """Return the function friso.NAME of a question.

    Raises KeyError for an unknown name, and InputError if another package's module has no such function.
    """
    own = name.replace("_", "-")
    if own in QUESTIONS and QUESTIONS[own].in_python == name:
        return QUESTIONS[own].function
    return {question.in_python: question for _, question in QUESTIONS.items()}[name].function
