"""Define what a question declares, and what is derived from it.

A question is a function of friso with a command of the same name; the table of `friso/questions/`, or the folder of
another package, declares a `Question`. The command, its options, its help, and its entry in `friso --help` are derived
from it, the function's signature and its docstring. Nothing heavy is imported here, because the list of commands is
printed before arrays and units are loaded.

Parameters that several questions share are declared once, for docstrings and for the help of commands. A function names
such a parameter in its signature and leaves it out of its docstring; `described` adds it.
"""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
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


@dataclass(frozen=True)
class SharedOption:
    """The type and meaning of a shared parameter in docstrings.

    The line in a command's help is given if it differs from the docstring.
    """

    kind: str
    meaning: str
    help: str = ""


SHARED: Mapping[str, SharedOption] = {
    "stage": SharedOption("Stage, path or dict", "The stage, its file, or the tables of one.", "The stage file."),
    "set": SharedOption(
        "dict, optional",
        'Keys to override, ``{"joint.locked": True}``.',
        'Override a key: masses.stage="0.6 kg"; a number alone has the unit that the file has there.',
    ),
    "progress": SharedOption("Progress", "Called as work is done, also from worker threads."),
    "rtol": SharedOption("float", "Relative tolerance of the solver, 1e-12 to 1e-2."),
    "seed": SharedOption("int", "Seed of the draws: the same seed gives the same machines."),
    "within": SharedOption(
        "str or float, optional",
        'Deviation that counts as in position, "5 um" or a number [m]; default: that of [tolerance], or 1 um. It is '
        "never finer than a step of the encoder, or than an error at which the controller exerts no force.",
    ),
    "logs": SharedOption("path or list of paths", "Log files; friso logs --help lists their formats."),
    "map": SharedOption(
        "dict, optional", 'Roles and their channels: ``{"position": "Axis1.ActPos"}``.', 'position="Axis1.ActPos"'
    ),
    "unit": SharedOption(
        "dict, optional", 'Channels and their units: ``{"Axis1.ActPos": "mm"}``.', 'Axis1.ActPos="mm"'
    ),
    "scale": SharedOption("dict, optional", 'Roles and their scales: ``{"force": "35.15 N/V"}``.', 'force="35.15 N/V"'),
    "dt": SharedOption("str or float, optional", 'Sample time, "1 ms" or a number [s], if a file does not contain it.'),
    "axis": SharedOption("str, optional", '"rotary" for angles, torques and moments of inertia.'),
}
"""The shared parameters by name."""


def described(function: Callable[..., Any]) -> str:
    """Return the docstring of a function with an entry for every parameter in order.

    Raises TypeError for a parameter that is neither in the docstring nor shared.
    """
    text = inspect.getdoc(function) or ""
    before, own, after = _parts(text)
    entries, lines = {name: block for names, block in own for name in names}, []
    for name in inspect.signature(function).parameters:
        block = entries.get(name)
        if block is None:
            if name not in SHARED:
                raise TypeError(f"the docstring of {function.__name__} does not describe {name}")
            block = f"{name} : {SHARED[name].kind}\n    {SHARED[name].meaning}"
        if block not in lines:
            lines.append(block)
    return "\n".join([before.rstrip(), "", "Parameters", "----------", *lines, "", after])


def meaning(function: Callable[..., Any], name: str) -> str:
    """Return the text of a parameter in a command's help.

    The text is the first paragraph of the parameter's description, without mentions of SI numbers, since a command line
    takes texts with units.
    """
    own = {parameter: block for names, block in _parts(function.__doc__ or "")[1] for parameter in names}
    shared = SHARED.get(name)
    if shared is not None and shared.help and own[name].endswith(shared.meaning):
        return shared.help
    _, _, lines = own[name].partition("\n")
    text = " ".join(lines.partition("\n\n")[0].split()).replace("``", "").replace("`", "")
    return re.sub(r",? or (a number|two numbers) \[[^][]*\]", "", text)


def _parts(text: str) -> tuple[str, list[tuple[list[str], str]], str]:
    """Split a docstring into the part before its parameters, their entries, and the part behind."""
    match = re.search(r"^Parameters\n-+\n", text, re.MULTILINE)
    following = re.search(r"^\w+\n-+\n", text[match.end() if match else 0 :], re.MULTILINE)
    start = match.start() if match else (following.start() if following else len(text))
    first = match.end() if match else start
    last = (first if match else 0) + following.start() if following else len(text)
    return text[:start], [*_entries(text[first:last] if match else "")], text[last:]


def _entries(text: str) -> Iterator[tuple[list[str], str]]:
    """Yield the entries of a docstring's parameters: the names ("only, keep") and the lines."""
    for block in re.split(r"\n(?=\w)", text.strip("\n")):
        if block:
            yield [name.strip() for name in block.partition(":")[0].split(",")], block.rstrip()


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
    """Place of a function, "module:name", that replaces the usual command, which only shows the answer."""

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
"""The questions: those in the table of `friso/questions/`, and those of installed packages."""


def function_of(name: str) -> Callable[..., Any]:
    """Return the function friso.NAME of a question.

    Raises KeyError for an unknown name, and InputError if another package's module has no such function.
    """
    own = name.replace("_", "-")
    if own in QUESTIONS and QUESTIONS[own].in_python == name:
        return QUESTIONS[own].function
    return {question.in_python: question for _, question in QUESTIONS.items()}[name].function
