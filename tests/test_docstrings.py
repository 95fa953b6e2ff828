"""Docstrings: every public function has one, with the units of its physical arguments and the errors that it raises."""

import ast
import inspect
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

import friso
import friso_thesis

PACKAGES = [Path(str(package.__file__)).parent for package in (friso, friso_thesis)]

SHELL = ("cli", "app", "commands", "questions", "shown")
"""Floors of commands and sentences, whose functions take what the floors below return."""

ERRORS = ("InputError", "StageError", "LogError", "SpecError", "StoreError")

ARRAYS = ("float", "float | None", "np.ndarray", "np.ndarray | None", "Complex", "Sequence[float]")

PHYSICAL = re.compile(
    r"(.+_)?(times?|frequency|frequencies|omega|forces?|mass|velocity|velocities|positions?|strokes?|amplitudes?|"
    r"speeds?|stiffness|damping|crossovers?|displacements?|deflections?|length|period|delay|sample_time|cutoff|"
    r"bandwidth|acceleration)"
)
"""Names of arguments that have a unit."""

_ATOM = r"(?:1|[kmunGM]?(?:m|s|N|g|Hz|Pa|V|A|W|J|rad)|deg|min|h|dB|K|%)(?:\^-?\d(?:\.\d)?)?"
_GROUP = rf"(?:{_ATOM}|(?:sqrt)?\({_ATOM}(?: {_ATOM})*\))"
_UNIT = rf"{_GROUP}(?:[*/ ]{_GROUP})*"
UNITS = re.compile(rf"\[(?:SI(?:, [a-z ]+)?|-|log|[a-z /]*\bunit\b[a-z /]*|{_UNIT}(?:, {_UNIT})*)\]")
"""Units in brackets: "[N/m]", "[kg, kg m, kg m^2]", "[-]", "[log]", "[SI]", "[input per output unit]"."""

COMMON = {"stage", "text", "rtol", "threads"}
"""Arguments that mean the same everywhere: a relative tolerance of the solver, how many cores it takes."""


@dataclass(frozen=True)
class Function:
    """A public function or method of a module, and where it stands."""

    place: str
    node: ast.FunctionDef

    @property
    def text(self) -> str:
        return ast.get_docstring(self.node) or ""

    @property
    def arguments(self) -> list[ast.arg]:
        return [*self.node.args.posonlyargs, *self.node.args.args, *self.node.args.kwonlyargs]

    @property
    def raises(self) -> set[str]:
        """Errors in its own body, not in functions within."""
        names: set[str] = set()
        todo: list[ast.AST] = [*self.node.body]
        while todo:
            node = todo.pop()
            if isinstance(node, ast.FunctionDef | ast.ClassDef | ast.Lambda):
                continue
            if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call):
                names.add(ast.unparse(node.exc.func))
            todo += ast.iter_child_nodes(node)
        return names


def functions() -> Iterator[Function]:
    for package in PACKAGES:
        for path in sorted(package.rglob("*.py")):
            name = path.relative_to(package.parent)
            if name.parts[1] not in SHELL or name.name == "question.py":
                yield from within(ast.parse(path.read_text(encoding="utf-8")).body, str(name))


def within(body: list[ast.stmt], place: str) -> Iterator[Function]:
    for node in body:
        if isinstance(node, ast.ClassDef | ast.FunctionDef) and node.name.startswith("_"):
            continue
        if isinstance(node, ast.ClassDef):
            yield from within(node.body, f"{place}: {node.name}")
        elif isinstance(node, ast.FunctionDef) and not any("property" in ast.unparse(d) for d in node.decorator_list):
            yield Function(f"{place}: {node.name}", node)


FUNCTIONS = [*functions()]


def test_every_public_function_has_a_docstring() -> None:
    assert len(FUNCTIONS) > 800
    assert [function.place for function in FUNCTIONS if not function.text] == []


@pytest.mark.slow
def test_errors_that_a_function_raises_itself_are_told() -> None:
    assert [
        function.place for function in FUNCTIONS if function.raises & set(ERRORS) and "Raises" not in function.text
    ] == []


def test_arguments_that_are_physical_have_units() -> None:
    """A unit in brackets, anywhere in the docstring: which quantity has which unit is for its reader to judge."""

    def physical(argument: ast.arg) -> bool:
        kind = ast.unparse(argument.annotation) if argument.annotation else ""
        return kind in ARRAYS and PHYSICAL.fullmatch(argument.arg) is not None

    bare = [function for function in FUNCTIONS if not UNITS.search(function.text)]
    assert [function.place for function in bare if any(map(physical, function.arguments))] == []


@pytest.mark.parametrize("name", [*friso.__all__, "reproduce", "guideline"])
def test_the_public_list(name: str) -> None:
    """Everything has a docstring; a function's has every argument, the errors raised, and an example."""
    value = getattr(friso, name)
    if name == "__version__":
        return
    text = inspect.getdoc(value) or ""
    assert len(text.split()) > 3
    if inspect.isfunction(value):
        assert "Raises" in text
        assert ">>>" in text
        arguments = set(inspect.signature(value).parameters) - COMMON
        assert {argument for argument in arguments if not re.search(rf"\b{argument}\b", text)} == set()
