"""Price the features of friso in lines of code: `python -m benchmarks.price [NAME ...]`.

`benchmarks/features.toml` names each feature with the definitions, or modules, in which it begins. Its price is the
code that nothing reaches any more once these are taken out: functions, classes and constants of modules, followed by
the names in their text. A text that names a module reaches all of it, as registries do; a package, all modules in it.
What nothing is seen to reach counts as reached from outside. A landing that makes a feature more than 5 % dearer says
in its message what users get for it.
"""

import argparse
import ast
import tomllib
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

from benchmarks.code import count

ROOT = Path(__file__).parents[1]
ROOTS = ("friso", "friso.__main__", "friso.cli", "friso_thesis.questions")
"""Modules that are asked for from outside."""


class Definition(NamedTuple):
    """A function, class or constant of a module: its lines of code, and the names, and modules in texts, in it."""

    lines: int
    names: frozenset[str]


class Module(NamedTuple):
    """A module: its definitions by name, what its imports bind, and what it does when it is imported."""

    definitions: dict[str, Definition]
    imported: dict[str, str]
    begins: frozenset[str]


@cache
def modules() -> dict[str, Module]:
    """Read the modules of friso and friso_thesis, by dotted name."""
    paths = {
        ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
        for package in ("friso", "friso_thesis")
        for path in sorted((ROOT / package).rglob("*.py"))
    }
    return {name: _read(name, path, paths) for name, path in paths.items()}


def _read(name: str, path: Path, known: Iterable[str]) -> Module:
    """Read one module; texts and imports may name the `known` ones."""
    source = path.read_text(encoding="utf-8")
    lines, definitions, begins = source.splitlines(), dict[str, Definition](), set[str]()
    tree, imported = ast.parse(source), dict[str, str]()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            imported |= {alias.asname or alias.name: f"{node.module}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Import):
            imported |= {
                alias.asname or alias.name.split(".")[0]: (alias.asname and alias.name) or "" for alias in node.names
            }
    for node in tree.body:
        own = [part.id for part in ast.walk(node) if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store)]
        names = [node.name] if isinstance(node, ast.FunctionDef | ast.ClassDef) else own
        said = frozenset(_said(node, known))
        if names and isinstance(node, ast.FunctionDef | ast.ClassDef | ast.Assign | ast.AnnAssign):
            first = min([node.lineno, *(one.lineno for one in getattr(node, "decorator_list", []))])
            code = count("\n".join(lines[first - 1 : node.end_lineno])).code
            definitions |= dict.fromkeys(names, Definition(0, said)) | {names[0]: Definition(code, said)}
            registers = getattr(node, "decorator_list", []) or getattr(node, "bases", [])
            begins |= {f"{name}:{names[0]}"} if registers else set()
        elif not isinstance(node, ast.Import | ast.ImportFrom):
            begins |= said
    return Module(definitions, imported, frozenset(begins))


def _said(node: ast.AST, known: Iterable[str]) -> Iterator[str]:
    """Yield the names in a statement, with attributes, and the modules that its texts name."""
    for part in ast.walk(node):
        if isinstance(part, ast.Name):
            yield part.id
        elif isinstance(part, ast.Attribute) and isinstance(part.value, ast.Name):
            yield f"{part.value.id}.{part.attr}"
        elif isinstance(part, ast.Constant) and isinstance(part.value, str) and part.value.split(":")[0] in known:
            yield f"text {part.value.split(':')[0]}"


def reached(without: frozenset[str] = frozenset(), outside: Iterable[str] = ()) -> set[str]:
    """Return the definitions, as "module:name", that are reached from outside, or from those named.

    Those `without` which friso is to do, and modules named so, are left out with what only they reach.
    """
    every, seen = modules(), set[str]()
    left = [*(f"text {name}" for name in ROOTS), *outside]
    while left:
        one = left.pop()
        name, _, own = one.removeprefix("text ").partition(":")
        if one in seen or one in without or any(name == gone or name.startswith(f"{gone}.") for gone in without):
            continue
        seen.add(one)
        if own:
            module = every[name]
            left += filter(None, (_place(name, word) for word in module.definitions[own].names))
            left += filter(None, (_place(name, word) for word in module.begins))
        else:
            inside = [inner for inner in every if inner.rpartition(".")[0] == name] if "." in name else []
            left += [f"{part}:{own}" for part in (name, *inside) for own in every[part].definitions]
    return {one for one in seen if not one.startswith("text ")}


def _place(name: str, word: str) -> str:
    """Return where a word of a module is defined; "" if that is not in friso."""
    every = modules()
    if word.startswith("text ") or ":" in word:
        return word
    first, _, attribute = word.partition(".")
    if first in every[name].definitions:
        return f"{name}:{first}"
    target = every[name].imported.get(first, "")
    if target in every:
        return _place(target, attribute) if attribute else ""
    module, _, own = target.rpartition(".")
    return _place(module, own) if module in every else ""


@cache
def _usually_reached() -> set[str]:
    return reached()


def features() -> dict[str, list[str]]:
    """Return the definitions in which each feature begins, by the feature's name."""
    return {
        f"{kind} {name}": places if isinstance(places, list) else [places]
        for kind, those in tomllib.loads(Path(__file__).with_name("features.toml").read_text(encoding="utf-8")).items()
        for name, places in those.items()
    }


def price(places: Iterable[str]) -> tuple[int, int]:
    """Return the lines of code, and the constants, that only these definitions reach."""
    everything = {f"{name}:{own}" for name, module in modules().items() for own in module.definitions}
    only = everything - reached(frozenset(places), everything - _usually_reached())
    parts = [modules()[name].definitions[own].lines for name, _, own in (one.partition(":") for one in only)]
    return sum(parts), sum(one.partition(":")[2].isupper() for one in only)


def main() -> None:
    """Print the features, the dearest first."""
    parser = argparse.ArgumentParser(prog="price", description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help="of the features; default: all")
    wanted = parser.parse_args().names
    tests = [path.read_text(encoding="utf-8") for path in (ROOT / "tests").rglob("test_*.py")]
    rows = []
    for name, places in features().items():
        if not wanted or name in wanted or name.split(" ", 1)[1] in wanted:
            word = name.split(" ", 1)[1]
            named = sum(f'"{word}"' in text for text in tests)
            rows.append((name, *price(places), named))
    print(f"{'feature':32}{'lines':>8}{'numbers':>9}{'test files that name it':>25}")
    for name, lines, numbers, named in sorted(rows, key=lambda row: -row[1]):
        print(f"{name:32}{lines:8}{numbers:9}{named:25}")


if __name__ == "__main__":
    main()
