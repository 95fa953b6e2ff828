"""Define the base of all stage-file tables: strict keys, errors, rules, and variants.

A key may take an array of values, or of tables: `element_stiffness = ["40 N/um", "30 N/um"]` and
`[[controller.filters]]`. In `Stage.flat` every element has a key of its own, numbered from 1, such as
friction.element_stiffness.2. A table in an array has such a key for each of its own keys, such as
controller.filters.2.frequency.

Sections may come from other packages and files. Friso's own are named here. Installed packages name theirs in entry
points, which are read if a name in a stage file is not friso's own.

A kernel is built in a separate process, which gets the plug-ins with its task and finds them again there. A plug-in is
a friction law or a controller from another package, from one file, or from the script that runs.
"""

from __future__ import annotations

import difflib
import hashlib
import importlib
import importlib.util
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import count, takewhile
from math import isfinite
from pathlib import Path
from types import NoneType
from typing import Any, ClassVar, Self, TypeVar, get_args

from pydantic import (
    BaseModel,
    ConfigDict,
    GetCoreSchemaHandler,
    ValidationError,
    ValidationInfo,
    ValidatorFunctionWrapHandler,
    field_validator,
)
from pydantic_core import CoreSchema, core_schema

from friso.axis import LINEAR, AxisKind
from friso.errors import InputError
from friso.intervals import Interval, UncertainValue, is_range, uncertain_value
from friso.platform.installed import installed_modules, leave_out, load_module
from friso.quantities import Number, Quantity, as_toml, quoted

_WORDS = {1: "one", 2: "two"}


class Values(tuple[Any, ...]):
    """An array of values, dimensioned or bare."""

    @property
    def text(self) -> list[Any]:
        """Return the values, each as the user wrote it."""
        return [getattr(value, "text", value) for value in self]


class Rows(tuple[Any, ...]):
    """An array of tables."""

    @property
    def text(self) -> list[Any]:
        """Return the rows as the user wrote them."""
        return [row.as_written() for row in self]


@dataclass(frozen=True)
class Several:
    """A key that takes an array of at least `least` and, if stated, at most `most` values.

    `examples` are two such values. With `alone`, a single value may stand for an array of one.
    """

    of: Quantity | Number
    examples: tuple[str, ...]
    least: int = 2
    most: int | None = None
    alone: bool = False

    def on(self, kind: AxisKind) -> Self:
        """Return this declaration for an axis of another kind, with its units."""
        examples = tuple(replace(self.of, example=text).on(kind).example for text in self.examples)
        return replace(self, of=self.of.on(kind), examples=examples)

    @property
    def expected(self) -> str:
        """Say in words what values the key accepts."""
        if self.alone:
            return f"one value or an array of up to {self.most}, each {self.of.expected}"
        count = f"{_WORDS[self.least]} or more" if self.most is None else f"{self.least} to {self.most}"
        return f"an array of {count}, each {self.of.expected}"

    @property
    def written_example(self) -> str:
        """Return an example of the array as it stands in a file."""
        quote = '"' if isinstance(self.of, Quantity) else ""
        return f"[{', '.join(f'{quote}{example}{quote}' for example in self.examples)}]"

    def read(self, raw: Any, read_one: Callable[[Any], Any] | None = None) -> Values:
        """Return the values of an array, or with `alone` of a single value, too.

        Each element is read by `read_one`, by default as `of` reads it. Raises InputError for a wrong length or a wrong
        element, whose number it names.
        """
        if self.alone and not isinstance(raw, list | tuple):
            raw = [raw]
        size = len(raw) if isinstance(raw, list | tuple) else None
        if size is None or size < self.least or size > (self.most or size):
            hint = "not an array" if size is None else f"of {size}"
            raise InputError("", quoted(raw if size is None else [*raw], hint), self.expected, self.written_example)
        read, values = read_one or self.of.read, []
        for number, item in enumerate(raw, start=1):
            try:
                values.append(read(item))
            except InputError as error:
                raise error.under(str(number)) from None
        return Values(values)

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.with_info_plain_validator_function(self._read_on_axis)

    def _read_on_axis(self, raw: Any, info: ValidationInfo) -> Values:
        return self.on(info.context or LINEAR).read(raw)


@dataclass(frozen=True)
class Coefficients:
    """A key that takes an array of numbers that are varied only together.

    `roots` may be complex, written as texts.
    """

    examples: tuple[Any, ...]
    roots: bool = False

    @property
    def expected(self) -> str:
        """Say in words what values the key accepts."""
        return f"an array of numbers{', complex ones as texts' if self.roots else ''}"

    @property
    def written_example(self) -> str:
        """Return an example of the array as it stands in a file."""
        return f"[{', '.join(as_toml(example) for example in self.examples)}]"

    def read(self, raw: Any) -> Values:
        """Return the values of an array of numbers; complex numbers stay texts.

        Raises InputError for anything but an array, or under the number of an element that is no finite number. Only
        `roots` may be written as texts.
        """
        if not isinstance(raw, list | tuple):
            raise InputError("", quoted(raw), self.expected, self.written_example)
        for number, item in enumerate(raw, start=1):
            try:
                fine = not isinstance(item, bool) and isfinite(abs(complex(item)))
                fine = fine and (self.roots or not isinstance(item, str))
            except (TypeError, ValueError):
                fine = False
            if not fine:
                raise InputError(str(number), quoted(item), self.expected, self.written_example)
        return Values(item if isinstance(item, str) else float(item) for item in raw)

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(self.read)


def element_keys(flat: Mapping[str, Any], key: str) -> list[str]:
    """Return the keys of an array's elements in a stage, such as "friction.element_stiffness.2".

    They are in order; there are none if the stage lacks the array.
    """
    return [*takewhile(flat.__contains__, (f"{key}.{number}" for number in count(1)))]


def row_keys(flat: Mapping[str, Any], key: str) -> list[str]:
    """Return the names of an array's tables in a stage, such as "controller.filters.2".

    They are in order; there are none if the stage lacks the array.
    """
    places = (f"{key}.{number}" for number in count(1))
    return [*takewhile(lambda place: any(name.startswith(f"{place}.") for name in flat), places)]


OWN = "friso"
SCRIPT = "__main__"


@dataclass(frozen=True)
class PlugIn:
    """A module from outside friso: its name, and the file it was loaded from ("" for none)."""

    module: str
    file: str

    @property
    def digest(self) -> str:
        """Return a digest of the module's source."""
        return hashlib.sha256(Path(self.file).read_bytes() if self.file else b"").hexdigest()

    def load(self) -> None:
        """Import the module, unless it has been imported; a script is always run again.

        The module is imported by its name if that leads to its file, else from the file. Raises ImportError if there is
        no file.
        """
        if self.module in sys.modules and self.module != SCRIPT:
            return
        if (
            self.module != SCRIPT
            and (spec := importlib.util.find_spec(self.module))
            and Path(spec.origin or "").resolve() == Path(self.file)
        ):
            importlib.import_module(self.module)
            return
        name = "friso_script" if self.module == SCRIPT else self.module
        spec = importlib.util.spec_from_file_location(name, self.file) if self.file else None
        if spec is None or spec.loader is None:
            raise ImportError(f"{self.module}, which registers a section, has no file that it could be loaded from")
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module
        spec.loader.exec_module(module)


def plug_in_of(cls: type) -> PlugIn | None:
    """Return the plug-in that a class comes from; None for friso's own."""
    if cls.__module__.split(".")[0] == OWN:
        return None
    file = getattr(sys.modules.get(cls.__module__), "__file__", None)
    return PlugIn(cls.__module__, str(Path(file).resolve()) if file else "")


def plug_ins(classes: Iterable[type]) -> tuple[PlugIn, ...]:
    """Return the plug-ins that classes come from, each once."""
    return tuple(dict.fromkeys(plug_in for cls in classes if (plug_in := plug_in_of(cls))))


FRISO = {
    "friso.controllers": ("friso.equations.controllers", "friso.identification.state_space_controller"),
    "friso.friction": ("friso.equations.friction",),
    "friso.motions": ("friso.equations.motions", "friso.identification.recorded_motion"),
    "friso.derivations": ("friso.leaf_springs.closed_forms", "friso.equations.conditions"),
}
"""Modules that register friso's own sections of the stage file, by group.

They belong to higher layers, and are imported when a stage is first read.
"""


def load_own(group: str) -> None:
    """Import friso's own modules of a group, such as "friso.controllers"."""
    for module in FRISO.get(group, ()):
        if module not in sys.modules:
            importlib.import_module(module)


@cache
def load_installed(group: str) -> None:
    """Import the modules of installed packages in a group of entry points.

    The modules register their sections. A package that cannot be imported, or registers a name that is taken, is
    reported and skipped.
    """
    for name, module in installed_modules(group).items():
        try:
            load_module(group, name, module)
        except InputError as error:
            leave_out(error)


@dataclass(frozen=True)
class Rule:
    """A condition between keys of a stage file.

    `holds` gets the stage's keys with SI values, which may be arrays, and tests it. `expected` says in words what must
    hold, and `example` shows it.
    """

    keys: tuple[str, ...]
    holds: Callable[[Mapping[str, Any]], Any]
    expected: str
    example: str

    def at(self, place: str) -> Rule:
        """Return the rule with its keys moved to a table at `place` in the stage file."""
        keys = tuple(f"{place}.{key}" for key in self.keys)
        return Rule(keys, lambda flat: self.holds(keys_below(flat, place)), self.expected, self.example)


def keys_below(flat: Mapping[str, Any], place: str) -> dict[str, Any]:
    """Return the keys of a table or a row of an array, without `place` and the dot before them.

    `place` is the name of the table, such as "controller" or "controller.filters.2".
    """
    return {key.removeprefix(f"{place}."): value for key, value in flat.items() if key.startswith(f"{place}.")}


UNKNOWN = "unknown"
"""What a file writes for a value that nobody knows."""

MOST_KEYS = 100
"""Largest number of keys of a table, unknown ones included, because the nearest known key is searched for each unknown
one."""


class Section(BaseModel):
    """A table of a TOML file.

    Wrong data raise the exception class that the section names as `refusal`.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    rules: ClassVar[tuple[Rule, ...]] = ()
    refusal: ClassVar[type[InputError]] = InputError
    """The error raised by this section and the sections within it."""
    among: ClassVar[Variants | None] = None
    """The sections told apart from this one by its tag, if there are others."""

    @classmethod
    def otherwise(cls, key: str) -> str:
        """Return what else a numeric key takes besides its values, after a semicolon; "" for nothing."""
        return ""

    def __init__(self, /, **data: Any) -> None:
        self._take(data, LINEAR)

    @classmethod
    def on(cls, kind: AxisKind, data: Mapping[str, Any]) -> Self:
        """Return the section of a stage with a kind of axis, which decides the units of keys."""
        section = cls.__new__(cls)
        section._take(data, kind)
        return section

    def _take(self, data: Mapping[str, Any], kind: AxisKind) -> None:
        if len(data) > MOST_KEYS:
            first = ", ".join(quoted(key) for key, _ in zip(data, range(3), strict=False))
            raise self.refusal("", f"a table of {len(data)} keys: {first}, ...", f"at most {MOST_KEYS} keys")
        for key in data:
            if not isinstance(key, str):
                raise self.refusal("", f"a key that is no text: {quoted(key)}", "keys of texts", '"stiffness"')
        try:
            self.__pydantic_validator__.validate_python(dict(data), self_instance=self, context=kind)
        except ValidationError as error:
            raise self.refusal.of(_problems(type(self), error, kind)) from None

    def __setattr__(self, name: str, value: Any) -> None:
        """Raises AttributeError for a key: tables do not change."""
        if name in type(self).model_fields:
            changes = '{"table.key": value}' if type(self).__name__ != "Stage" else f'{{"{name}": ...}}'
            raise AttributeError(f"a stage does not change; make another one: stage.replace({changes})")
        super().__setattr__(name, value)

    def as_written(self) -> dict[str, Any]:
        """Return the keys that the user gave, with the values as written."""
        values = {key: getattr(self, key) for key in type(self).model_fields if key in self.model_fields_set}
        return {key: getattr(value, "text", value) for key, value in values.items()}


class UncertainSection(Section):
    """A table with uncertain quantities, "20 N +/- 1 N" or "1 N .. 3 N".

    The value of such a quantity is the centre.
    """

    @field_validator("*", mode="wrap")
    @classmethod
    def _read_uncertain(cls, value: Any, read: ValidatorFunctionWrapHandler, info: ValidationInfo) -> Any:
        key, text, kind = str(info.field_name), getattr(value, "text", value), info.context or LINEAR
        if isinstance(value, UncertainValue) and text == UNKNOWN:
            return value
        if (field := numeric_fields(cls).get(key)) and is_range(text):
            return uncertain_value(text, field.on(kind))
        if several := list_fields(cls).get(key):
            array = several.on(kind)
            return array.read(value, lambda item: _perhaps_uncertain(item, array.of))
        return read(value)

    @property
    def numbers(self) -> dict[str, Any]:
        """Return the values by key.

        A value in an array stands under key and number, counted from 1. Keys of a table in an array stand under that
        array's key and the table's number.
        """
        values: dict[str, Any] = {}
        for key, value in self:
            if isinstance(value, Values):
                values |= {f"{key}.{number}": item for number, item in enumerate(value, start=1)}
            elif isinstance(value, Rows):
                rows = enumerate(value, start=1)
                values |= {f"{key}.{n}.{name}": item for n, row in rows for name, item in row.numbers.items()}
            else:
                values[key] = value
        return values

    def uncertain(self) -> dict[str, Interval]:
        """Return the intervals of the uncertain quantities by key.

        Intervals without width are left out.
        """
        values = {key: value.interval for key, value in self.numbers.items() if isinstance(value, UncertainValue)}
        return {key: interval for key, interval in values.items() if interval.low < interval.high}


def _perhaps_uncertain(value: Any, field: Quantity | Number) -> Any:
    """Read an element of an array, which may be uncertain, "20 N +/- 1 N".

    `field` declares what an element may be. Raises InputError for anything else.
    """
    text = getattr(value, "text", value)
    return uncertain_value(text, field) if is_range(text) else field.read(value)


SectionClass = TypeVar("SectionClass", bound=type[Section])


PickClass = Callable[[dict[str, Any]], type[Section]]
"""Chooses the class that reads a table."""


def read_table(pick: PickClass, example: str, entry: Any, info: ValidationInfo) -> Any:
    """Make the section from a table; a section is left as it is.

    Raises InputError for anything but a table, and for a table with wrong keys or values.
    """
    if isinstance(entry, Section):
        return entry
    if not isinstance(entry, dict):
        raise InputError("", quoted(entry), "a table of keys", example)
    return pick(entry).on(info.context or LINEAR, entry)


@dataclass(frozen=True)
class Table:
    """A key that takes a table, which `example` shows.

    Its class is that of the annotation, or the one that `variants` choose.
    """

    example: str
    variants: Variants | None = None

    def picked_by(self, annotation: Any) -> PickClass:
        """Return the function that chooses the class by a table's keys, for a key with this annotation."""
        section = next(part for part in get_args(annotation) or (annotation,) if part is not NoneType)
        return (self.variants or OneTable(section)).pick

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        read = partial(read_table, self.picked_by(source), self.example)
        return core_schema.with_info_before_validator_function(read, handler(source))


class Variants:
    """Sections told apart by one key, the tag: `kind` of [motion], `model` of [friction].

    Installed packages may add more through entry points of a `group`, which are imported when an unknown name is met.
    """

    def __init__(self, tag: str, group: str = "") -> None:
        self.tag, self.group = tag, group
        self._classes: dict[str, type[Section]] = {}

    @property
    def classes(self) -> dict[str, type[Section]]:
        """Return the classes of the sections by name.

        friso's own come first, alphabetically, whichever module was imported first.
        """
        load_own(self.group)
        return self._classes

    @property
    def forms(self) -> Mapping[str, Sequence[type[Section]]]:
        """Return the classes of the sections by name, of which a name may have several."""
        return {name: [cls] for name, cls in self.classes.items()}

    def name_of(self, cls: type[Section]) -> str:
        """Return the name that a class declares, "step" for `kind: Literal["step"]`."""
        return get_args(cls.model_fields[self.tag].annotation)[0]

    def register(self, cls: SectionClass) -> SectionClass:
        """Add a class, as a class decorator. Raises InputError where its name is taken."""
        name = self.name_of(cls)
        if plug_in_of(cls):
            load_own(self.group)  # friso's own names come first
        holder = self._classes.get(name, cls)
        if (holder.__module__, holder.__qualname__) != (cls.__module__, cls.__qualname__):
            actual = f"{as_toml(name)}, which {cls.__module__}.{cls.__qualname__} registers"
            expected = f"a name that is not taken: {holder.__module__}.{holder.__qualname__} has it"
            raise InputError(self.tag, actual, expected, f'{self.tag}: Literal["my_{name}"]')
        self._classes[name] = cls
        cls.among = self
        if self.group:
            own_first = sorted(
                self._classes.items(), key=lambda item: (not item[1].__module__.startswith("friso."), item[0])
            )
            self._classes.clear()
            self._classes.update(own_first)
        return cls

    def named(self, name: Any) -> type[Section] | None:
        """Return the class with this name; None for a name that nobody declares."""
        if name not in self.classes and self.group:
            load_installed(self.group)
        return self.classes.get(name)

    def pick(self, table: dict[str, Any]) -> type[Section]:
        """Return the class that reads a table. Raises InputError when the tag is missing or unknown."""
        name = table.get(self.tag)
        if isinstance(name, str) and (cls := self.named(name)):
            return cls
        if name is None:
            keys = {key: cls for several in self.forms.values() for cls in several for key in cls.model_fields}
            typos = [(key, near) for key in {*table} - {*keys} if (near := nearest_name(key, keys))]
            for key, near in sorted(typos)[:1]:  # of a key that decides alone what is read, such as a guess
                raise unknown_key(key, keys, _described(keys[near], near, LINEAR)[1])
        example = nearest_name(name, self.classes) or next(iter(self.classes))
        expected = f"one of {', '.join(map(as_toml, self.classes))}"
        raise InputError(self.tag, quoted(name), expected, f"{self.tag} = {as_toml(example)}")


@dataclass(frozen=True)
class OneTable:
    """The single class that reads a table, used in place of `Variants`."""

    section: type[Section]

    def pick(self, table: dict[str, Any]) -> type[Section]:
        """Return the class that reads a table."""
        return self.section


@dataclass(frozen=True)
class TableArray:
    """A key that takes an array of at most `most` tables.

    `variants` choose the class that reads each table; `example` shows one.
    """

    variants: Variants | OneTable
    example: str
    most: int

    def read(self, entries: Any, info: ValidationInfo) -> Rows:
        """Make the sections from an array of tables.

        Raises InputError, under the number of the wrong one.
        """
        size = len(entries) if isinstance(entries, list | tuple) else None
        if size is None or size > self.most:
            text = quoted(entries) if size is None else f"{size} tables"
            raise InputError("", text, f"an array of at most {self.most} tables", self.example)
        rows = []
        for number, entry in enumerate(entries, start=1):
            try:
                rows.append(read_table(self.variants.pick, self.example, entry, info))
            except InputError as error:
                raise error.under(str(number)) from None
        return Rows(rows)

    def rows(self, flat: Mapping[str, Any], key: str) -> dict[str, type[Section]]:
        """Return the classes of the tables in a stage's array, by names like "controller.filters.2".

        `flat` has the stage's keys, and `key` names the array.
        """
        return {place: self.variants.pick(keys_below(flat, place)) for place in row_keys(flat, key)}

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.with_info_plain_validator_function(self.read)


@cache
def table_arrays(cls: type[Section]) -> Mapping[str, TableArray]:
    """Return the keys of a table that take an array of tables."""
    items = ((key, item) for key, field in cls.model_fields.items() for item in field.metadata)
    return {key: item for key, item in items if isinstance(item, TableArray)}


@cache
def numeric_fields(cls: type[Section]) -> Mapping[str, Quantity | Number]:
    """Return unit, bound and example of each numeric key of a table."""
    items = ((key, item) for key, field in cls.model_fields.items() for item in field.metadata)
    return {key: item for key, item in items if isinstance(item, Quantity | Number)}


@cache
def list_fields(cls: type[Section]) -> Mapping[str, Several]:
    """Return the keys of a table that take an array, each with the declaration of the array."""
    items = ((key, item) for key, field in cls.model_fields.items() for item in field.metadata)
    return {key: item for key, item in items if isinstance(item, Several)}


def nearest_name(name: Any, names: Iterable[str]) -> str | None:
    """Return the known name most similar to `name`; None if none is similar."""
    return next(iter(difflib.get_close_matches(str(name).lower(), [*names], n=1, cutoff=0.7)), None)


def unknown_key(key: str, names: Iterable[str], example: str = "") -> InputError:
    """Make the error for an unknown key, with the nearest of the existing `names`.

    The error shows the `example`.
    """
    near = nearest_name(key, names)
    hint = f"an unknown key; did you mean {near}?" if near else "an unknown key"
    return InputError(key, hint, f"one of {', '.join(names)}", example)


def _problems(cls: type[Section], error: ValidationError, kind: AxisKind) -> InputError:
    """Make one InputError from pydantic's list of problems.

    An unknown key comes first, since it often explains a missing one; other problems follow below it.
    """
    order = sorted(error.errors(include_url=False), key=lambda problem: problem["type"] != "extra_forbidden")
    nearest_keys = {
        nearest_name(problem["loc"][-1], cls.model_fields) for problem in order if problem["type"] == "extra_forbidden"
    }
    missing = [problem for problem in order if problem["type"] == "missing" and problem["loc"][0] not in nearest_keys]
    others = [problem for problem in order if problem["type"] != "missing"]
    problems = [_problem(cls, problem, kind) for problem in others]
    if missing:
        keys = [".".join(map(str, problem["loc"])) for problem in missing]
        actual = f"nothing; also missing: {', '.join(keys[1:])}" if keys[1:] else "nothing"
        problems.append(InputError(keys[0], actual, *_described(cls, keys[0], kind)))
    return problems[0].together(problems[1:])


def _problem(cls: type[Section], problem: Any, kind: AxisKind) -> InputError:
    """Make the error for one entry of pydantic's list of problems."""
    key = ".".join(map(str, problem["loc"]))
    cause = problem.get("ctx", {}).get("error")
    if isinstance(cause, InputError):
        return _complete(cause, key, cls.otherwise(str(problem["loc"][0])) if problem["loc"] else "")
    if not problem["loc"]:  # no key has a wrong value: the mistake is friso's own
        raise cause or ValueError(problem["msg"])
    if problem["type"] == "extra_forbidden":
        if other := _of_another(cls, key):
            return other
        near = nearest_name(key, cls.model_fields) or next(iter(cls.model_fields))
        return unknown_key(key, _own_first(cls), _described(cls, near, kind)[1])
    return InputError(key, quoted(problem["input"]), *_described(cls, key, kind))


def _of_another(cls: type[Section], key: str) -> InputError | None:
    """Make the error for an unknown key that a section told apart from this one by its tag has, exactly or nearly."""
    if cls.among is None:
        return None
    keys = {name: form for several in cls.among.forms.values() for form in several for name in form.model_fields}
    near = key if key in keys else None if nearest_name(key, cls.model_fields) else nearest_name(key, keys)
    if near is None:
        return None
    tag, owner = cls.among.tag, cls.among.name_of(keys[near])
    did_you_mean = "" if near == key else f"; did you mean {near}?"
    of_other = f"{tag} = {as_toml(owner)}"
    own = [name for name in _own_first(cls) if cls.model_fields[name].is_required() and name != tag]
    such = f", such as {', '.join(own)}" if own else ""
    expected = f"a key of {tag} = {as_toml(cls.among.name_of(cls))}{such}; {near} belongs to {of_other}"
    return InputError(key, f"an unknown key{did_you_mean}", expected, of_other)


def _own_first(cls: type[Section]) -> list[str]:
    """Return the keys of a table: its own first, then those that several tables have."""
    declared = (name for base in cls.__mro__ for name in vars(base).get("__annotations__", ()))
    return [name for name in dict.fromkeys(declared) if name in cls.model_fields]


def _complete(error: InputError, key: str, otherwise: str) -> InputError:
    """Put the key of the table before the key of an error that occurred in it, and say what is `otherwise` taken.

    `key` is also put before an example that is a mere value.
    """
    is_value = not error.key and error.example and "=" not in error.example
    example = f"{key} = {error.example}" if is_value else error.example
    return InputError(error.key, error.actual, f"{error.expected}{otherwise}", example, also=error.also).under(key)


def _described(cls: type[Section], key: str, kind: AxisKind) -> tuple[str, str]:
    """Say in words what a key takes, and give an example."""
    field = cls.model_fields[key]
    for item in field.metadata:
        if isinstance(item, Table):
            return f"a table [{key}]", item.example
        if isinstance(item, TableArray):
            return f"an array of tables [[{key}]]", item.example
        if hasattr(item, "written_example"):
            item = item.on(kind) if hasattr(item, "on") else item
            return f"{item.expected}{cls.otherwise(key)}", f"{key} = {item.written_example}"
    type_ = next((part for part in get_args(field.annotation) if part is not NoneType and get_args(part)), None)
    type_ = type_ or next((part for part in get_args(field.annotation) if part in (bool, str)), field.annotation)
    if type_ is bool:
        return "true or false", f"{key} = true"
    if type_ is str:
        return "a text in quotes", f"{key} = {as_toml((field.examples or ['Thesis rig'])[0])}"
    choices = [as_toml(choice) for choice in get_args(type_) if choice]
    return f"one of {', '.join(choices)}", f"{key} = {choices[0]}"
