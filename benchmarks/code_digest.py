"""Compute a digest of what modules compute: their syntax, without parts for readers alone.

Comments, docstrings, sentences, annotations, imports and the names that a module gives to its own values do not count,
so that a change of words leaves the digest unchanged. Another number, condition or called function changes it.
"""

import ast
import hashlib
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import friso

PACKAGE = Path(friso.__file__).parent
DIGITS = 12
"""Number of digits of a stored digest."""

READ_ALONE = ast.Import | ast.ImportFrom
ANNOTATED = ("annotation", "returns", "type_comment", "type_params", "kind", "ctx")


def code_digest(places: Sequence[str]) -> str:
    """Return a digest of what the modules in some folders and files compute; "" for none.

    Paths start from the package friso.
    """
    if not places:
        return ""
    code = hashlib.sha256()
    for file in sorted({file for place in places for file in _files(PACKAGE / place)}):
        code.update(computed(file.read_text(encoding="utf-8")).encode())
    return code.hexdigest()[:DIGITS]


def computed(source: str) -> str:
    """Return the syntax of a module, with its own names numbered by occurrence."""
    tree = ast.parse(source)
    own = {name for node in ast.walk(tree) for name in _bound(node)}
    numbers: dict[str, str] = {}

    def shown(value: object) -> str:
        if isinstance(value, ast.AST):
            return _node(value)
        if isinstance(value, list):
            return f"[{' '.join(shown(part) for part in value if not _prose(part))}]"
        if isinstance(value, str) and value in own:
            return numbers.setdefault(value, f"_{len(numbers)}")
        return repr(value)

    def _node(node: ast.AST) -> str:
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            return "text" if " " in node.value.strip() else repr(node.value)
        if isinstance(node, ast.JoinedStr):
            return f"(text {' '.join(shown(part) for part in node.values if isinstance(part, ast.FormattedValue))})"
        fields = [value for name, value in ast.iter_fields(node) if name not in ANNOTATED]
        return f"({type(node).__name__} {' '.join(shown(value) for value in fields if value not in (None, []))})"

    return shown(tree.body)


def _bound(node: ast.AST) -> Iterator[str]:
    """Yield the names that a node of the syntax defines."""
    if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
        yield node.id
    elif isinstance(node, ast.arg):
        yield node.arg
    elif isinstance(node, ast.FunctionDef | ast.ClassDef):
        yield node.name


def _prose(part: object) -> bool:
    """Tell whether a statement is for readers alone: import, docstring, declared type."""
    if isinstance(part, ast.AnnAssign) and part.value is None:
        return True
    docstring = isinstance(part, ast.Expr) and isinstance(part.value, ast.Constant)
    return docstring or isinstance(part, READ_ALONE)


def _files(place: Path) -> Iterable[Path]:
    """Return the Python files at a place. Raises FileNotFoundError if the place does not exist."""
    if not place.exists():
        raise FileNotFoundError(place)
    return place.rglob("*.py") if place.is_dir() else [place]
