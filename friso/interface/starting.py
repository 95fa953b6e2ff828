"""Provide what users start from: a stage file to edit, the examples, and JSON Schemas.

The schemas are of the stage file and of a specification, derived from their tables. Editors use them to complete and
check files; the reference pages are made from them.
"""

from __future__ import annotations

import ast
import inspect
import os
import re
import textwrap
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from importlib.resources import files
from itertools import pairwise
from pathlib import Path
from types import NoneType
from typing import Any, get_args

from friso.design_method.spec import OneOrMany, Spec
from friso.errors import InputError
from friso.interface.inputs import LOGGER, Changes, changes_of, choice
from friso.interface.output_folder import check_file, write_file
from friso.intervals import Span
from friso.quantities import Number, Quantity
from friso.stage import Stage, load
from friso.stage.arguments import check_arguments
from friso.stage.controllers import Controllers
from friso.stage.section import Coefficients, Section, Several, Table, TableArray, Variants
from friso.version import VERSION

DIALECT = "https://json-schema.org/draft/2020-12/schema"

Node = dict[str, Any]
"""A piece of a schema."""


def stage_schema() -> Node:
    """Return the schema of the stage file."""
    return _document(Stage, "A stage file of friso", _template())


def specification_schema() -> Node:
    """Return the schema of a design's specification."""
    return _document(Spec, "A specification of friso design", {})


SCHEMAS: Mapping[str, Callable[[], Node]] = {"stage": stage_schema, "specification": specification_schema}
"""Functions that make the schemas, by the kind of file."""


def _document(cls: type[Section], title: str, described: Mapping[str, str]) -> Node:
    return {"$schema": DIALECT, "title": title, "$comment": f"friso {VERSION}", **_table(cls, "", described)}


def _table(cls: type[Section], place: str, described: Mapping[str, str]) -> Node:
    """Return the schema of a table that the class `cls` reads, which stands at `place`.

    `described` holds comments on keys by dotted names.
    """
    documented = _attributes(cls)
    properties = {}
    for key, field in cls.model_fields.items():
        path = f"{place}.{key}".lstrip(".")
        node = _key(field.annotation, field.metadata, path, described)
        text = documented.get(key) or described.get(path, "")
        expected = node.pop("description", "")
        node["description"] = " ".join(dict.fromkeys(part for part in (_sentence(text), _sentence(expected)) if part))
        properties[key] = {name: value for name, value in node.items() if value not in ("", None)}
    required = [key for key, field in cls.model_fields.items() if field.is_required()]
    text = " ".join((cls.__doc__ or "").split())
    head: Node = {"type": "object", "description": text} if text else {"type": "object"}
    return {**head, "properties": properties, "required": required, "additionalProperties": False}


def _key(annotation: Any, metadata: Iterable[Any], path: str, described: Mapping[str, str]) -> Node:
    """Return the schema of the values of a key, by its annotation and the metadata of that.

    `path` is the dotted name of the key, and `described` holds comments on keys.
    """
    for item in metadata:
        if isinstance(item, Table):
            return _one_of(item.picked_by(annotation), path, described)
        if isinstance(item, TableArray):
            return {"type": "array", "maxItems": item.most, "items": _one_of(item.variants.pick, path, described)}
        if isinstance(item, Coefficients):
            numbers: Node = {"anyOf": [{"type": "number"}, {"type": "string"}]} if item.roots else {"type": "number"}
            return {"type": "array", "items": numbers, "description": item.expected, "examples": [[*item.examples]]}
        if isinstance(item, Quantity | Number | Several | Span | OneOrMany):
            return _numeric(item)
    types = [part for part in get_args(annotation) or (annotation,) if part is not NoneType]
    words = [word for part in types for word in (get_args(part) or (part,)) if isinstance(word, str | int)]
    if words:
        return {"enum": [word for word in words if word]}
    return {"type": "boolean"} if bool in types else {"type": "string"}


def _numeric(item: Quantity | Number | Several | Span | OneOrMany) -> Node:
    """Return the schema of numbers: texts with a unit, bare numbers, or arrays of them."""
    if isinstance(item, Several):
        array: Node = {
            "type": "array",
            "items": _numeric(item.of),
            "minItems": item.least,
            "maxItems": item.most,
            "description": item.expected,
            "examples": [[*item.examples]],
        }
        return {"anyOf": [_numeric(item.of), array], "description": item.expected} if item.alone else array
    if isinstance(item, OneOrMany):
        single = _numeric(item.of) if item.of else {"type": "string"}
        return {"anyOf": [single, {"type": "array", "items": single}], "description": item.expected}
    if isinstance(item, Number):
        return {
            "anyOf": [{"type": "number"}, {"type": "string", "pattern": r"\.\.|\+/-"}],
            "description": item.expected,
            "examples": [float(item.example)],
        }
    unit = item.unit if isinstance(item, Quantity) else item.of.unit
    return {"type": "string", "description": item.expected, "examples": [item.example], "x-unit": unit}


def _one_of(pick: Any, path: str, described: Mapping[str, str]) -> Node:
    """Return the schema of a table that is read by one of several classes, which `pick` names."""
    tables = [_table(cls, path, described) for cls in _classes(pick)]
    if len(tables) == 1:
        return {**tables[0], "description": _sentence(described.get(path, "")) or tables[0].get("description", "")}
    return {"type": "object", "anyOf": tables, "description": _sentence(described.get(path, ""))}


def _classes(pick: Any) -> list[type[Section]]:
    """Return the classes that a table may be read as; `pick` chooses one by the table's keys."""
    variants = getattr(pick, "__self__", None)
    if isinstance(variants, Controllers):
        return [form for forms in variants.forms.values() for form in forms]
    return [*variants.classes.values()] if isinstance(variants, Variants) else [pick({})]


@cache
def _attributes(cls: type[Section]) -> dict[str, str]:
    """Return the docstrings of keys, from the source of a class and of its bases."""
    texts: dict[str, str] = {}
    for base in reversed(cls.__mro__):
        if not issubclass(base, Section):
            continue
        try:
            body = ast.parse(textwrap.dedent(inspect.getsource(base))).body[0].body  # type: ignore[attr-defined]
        except (OSError, TypeError):  # a class that was made by a function has no source
            continue
        for node, below in pairwise(body):
            if (
                isinstance(node, ast.AnnAssign)
                and isinstance(below, ast.Expr)
                and isinstance(below.value, ast.Constant)
            ):
                texts[ast.unparse(node.target)] = " ".join(str(below.value.value).split())
    return texts


_ENTRY = re.compile(r"^(?:# )?(?:\[(?P<table>\w+)\]|(?P<key>\w+) = .*?)(?:(?<!\s)\s{2,}# (?P<text>.*))?$")


@cache
def _template() -> dict[str, str]:
    """Return the comments on tables and keys in the file that `friso init` writes."""
    texts, table = {}, ""
    for line in files("friso").joinpath("templates/stage.toml").read_text(encoding="utf-8").splitlines():
        match = _ENTRY.match(line)
        if match is None:
            continue
        table = match["table"] or table
        path = match["table"] or f"{table}.{match['key']}".lstrip(".")
        if match["text"]:
            texts.setdefault(path, match["text"].strip())
    return texts


def _sentence(text: str) -> str:
    """Give a text a capital first letter and a full stop."""
    text = text.strip().rstrip(":.;")
    return f"{text[0].upper()}{text[1:]}." if text else ""


EXAMPLES = "examples"


def examples_folder() -> Path:
    """Return the folder of the examples: in the installed package, or beside it in the repository."""
    package = Path(str(files("friso")))
    return next(folder for folder in (package / EXAMPLES, package.parent / EXAMPLES) if folder.is_dir())


def example_names() -> list[str]:
    """Return the names of the examples that come with friso.

    Names of specifications begin with "specs/"; names of drives' parameter files begin with "drives/" and keep their
    suffix.
    """
    return sorted(_examples())


def _examples() -> dict[str, Path]:
    """Return the paths of the examples by name."""
    folder = examples_folder()
    named = {path.relative_to(folder): path for path in folder.rglob("*.*") if path.suffix in (".toml", ".ini")}
    return {(name.with_suffix("") if name.suffix == ".toml" else name).as_posix(): path for name, path in named.items()}


@check_arguments
def example(name: str) -> Path:
    """The path of an example that comes with friso.

    Parameters
    ----------
    name : str
        Its name, "thesis_rig", "specs/thesis" or "drives/linuxcnc_torque_axis.ini"; a wrong one is answered with all
        of them.

    Returns
    -------
    Path
        A stage file, the specification of a design, or the parameters of a drive.

    Raises
    ------
    InputError
        For an unknown name.

    Examples
    --------
    >>> import friso
    >>> friso.load(friso.example("thesis_rig")).name
    'Thesis rig'
    """
    stem = name.removesuffix(".toml").removeprefix("examples/")
    return _examples()[choice(stem, "NAME", example_names(), "friso example thesis_rig")]


@check_arguments
def init(
    path: str | os.PathLike[str] | None = None,
    overwrite: bool = False,
    *,
    spec: str | os.PathLike[str] | None = None,
    from_: str | os.PathLike[str] | None = None,
    axis: str | None = None,
    set: Changes = None,
) -> Path:
    """Write a stage file to start from, or a specification for the design of a stage.

    The stage file is a commented one, or that of an axis in a drive's parameter file.

    Parameters
    ----------
    path : path, optional
        The file to write; default: "stage.toml", or "spec.toml".
    overwrite : bool
        Whether a file of that name may be replaced.
    spec : path, optional
        The stage file of which a specification is written instead.
    from_ : path, optional
        The parameter file of a drive, such as a LinuxCNC INI. What it has and the stage leaves out is mentioned.
    axis : str, optional
        Which axis of that file, where it has several.
    set : dict, optional
        What that file does not tell, of the machine above all.

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    InputError
        Where there is a file already, or none can be written.

    Examples
    --------
    >>> import friso, tempfile, pathlib
    >>> friso.load(friso.init(pathlib.Path(tempfile.mkdtemp(), "my_stage.toml"))).name
    'My stage'
    """
    place = Path(path or ("stage.toml" if spec is None else "spec.toml"))
    values = changes_of(set)
    if from_ is None and (axis is not None or values):
        key = "set" if values else "axis"
        raise InputError(key, "no --from", "a parameter file that it is about", "--from machine.ini")
    check_file("STAGE.toml", place, overwrite, [Path(source) for source in (spec, from_) if source is not None])
    write_file("STAGE.toml", place, _start(spec, from_, axis, values), overwrite)
    return place


def _start(
    spec: str | os.PathLike[str] | None,
    source: str | os.PathLike[str] | None,
    axis: str | None,
    values: Mapping[str, Any],
) -> str:
    """Return the text of a file to start from.

    The text is a specification for the stage file `spec`, the stage of an axis in the parameter file `source`, or the
    commented stage file. Raises InputError if both files are named, or one cannot be used.
    """
    if spec is not None and source is not None:
        raise InputError("spec", "together with --from", "one of the two", "friso init --from machine.ini")
    if spec is not None:
        from friso.design_method.prepare import outline

        return outline(load(spec))
    if source is None:
        return files("friso").joinpath("templates/stage.toml").read_text(encoding="utf-8")
    from friso.drives.read import stage_from

    stage_of_axis = stage_from(Path(source), axis, values)
    for sentence in stage_of_axis.left_out:
        LOGGER.warning(f"left out: {sentence}")
    return stage_of_axis.text()


@check_arguments
def schema(of: str = "stage") -> dict[str, Any]:
    """The JSON Schema of the stage file, or of the specification of a design: keys, units, bounds, examples.

    Parameters
    ----------
    of : str
        "stage" or "specification".

    Returns
    -------
    dict
        A JSON Schema (draft 2020-12), by which editors complete and check the files.

    Raises
    ------
    InputError
        For anything else.

    Examples
    --------
    >>> import friso
    >>> friso.schema()["properties"]["masses"]["properties"]["cart"]["examples"]
    ['1.2 kg']
    """

    return SCHEMAS[choice(of, "of", tuple(SCHEMAS), "of=stage")]()
