"""Measure the size of the code: `python -m benchmarks.code [PACKAGE ...]`.

Default packages are friso, friso_thesis and two anchors. A line of code has a token of its own: docstrings, comments
and blank lines do not count. Prose is docstrings and comments. The anchors, python-control and xarray, are counted as
installed, with the same rules.
"""

import argparse
import ast
import io
import tokenize
from collections import Counter
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

ANCHORS = ("control", "xarray")
"""Packages of the field and of its neighbourhood that are known for good code."""

NO_CODE = (tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER)


class LineCount(NamedTuple):
    """Lines of modules: all lines, lines with code, and lines with prose."""

    lines: int
    code: int
    prose: int


def count(source: str) -> LineCount:
    """Count the lines of a module."""
    prose = {line for first, last in _docstrings(ast.parse(source)) for line in range(first, last + 1)}
    code: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT and not token.line[: token.start[1]].strip():
            prose.add(token.start[0])
        elif token.type not in NO_CODE:
            code.update(range(token.start[0], token.end[0] + 1))
    return LineCount(len(source.splitlines()), len(code - prose), len(prose))


def _docstrings(tree: ast.Module) -> Iterator[tuple[int, int]]:
    """Yield the first and last line of each text that stands as a statement, as docstrings do."""
    for node in ast.walk(tree):
        for statement in getattr(node, "body", []) if isinstance(getattr(node, "body", None), list) else []:
            value = statement.value if isinstance(statement, ast.Expr) else None
            if isinstance(value, ast.Constant) and isinstance(value.value, str):
                yield statement.lineno, statement.end_lineno or statement.lineno


def of_package(package: str) -> dict[str, LineCount]:
    """Count the modules of an installed package, by its rooms, without its tests."""
    spec = find_spec(package)
    if spec is None or spec.origin is None:
        raise SystemExit(f"{package} is not installed")
    root, rooms = Path(spec.origin).parent, Counter[tuple[str, int]]()
    for path in sorted(root.rglob("*.py")):
        parts = path.relative_to(root).parts
        if not {"tests", "tests.py"} & {*parts}:
            for column, number in enumerate(count(path.read_text(encoding="utf-8"))):
                rooms[parts[0] if len(parts) > 1 else ".", column] += number
    return {room: LineCount(*(rooms[room, column] for column in range(3))) for room in {room for room, _ in rooms}}


def main() -> None:
    """Print a table of the packages, and of the rooms of the first one."""
    parser = argparse.ArgumentParser(prog="code", description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("packages", nargs="*", metavar="PACKAGE", default=["friso", "friso_thesis", *ANCHORS])
    packages = parser.parse_args().packages
    counted = {package: of_package(package) for package in packages}
    rows = [(name, LineCount(*map(sum, zip(*rooms.values(), strict=True)))) for name, rooms in counted.items()]
    rows += sorted(((f"  {packages[0]}/{room}", lines) for room, lines in counted[packages[0]].items()), key=_by_code)
    print(f"{'':32}{'lines':>8}{'code':>8}{'prose':>8}")
    for name, lines in rows:
        print(f"{name:32}{lines.lines:8}{lines.code:8}{lines.prose / max(lines.lines, 1):8.1%}")


def _by_code(row: tuple[str, LineCount]) -> int:
    return -row[1].code


if __name__ == "__main__":
    main()
