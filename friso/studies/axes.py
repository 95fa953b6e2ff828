"""Read the axes of a study into SI values: texts, ranges, arrays with unit, samples, links.

Some axes multiply several keys: controller speed, friction level. Several keys at once are drawn as Sobol points or
Latin hypercubes (`scipy.stats.qmc`). Links are expressions such as "0.7 * mass" for keys that follow the axes; their
numbers without a unit are in SI.
"""

from __future__ import annotations

import ast
import operator
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from numbers import Integral
from typing import Any, Literal, cast

import numpy as np

from friso.axis import AxisKind
from friso.equations.bandwidth import faster, with_friction
from friso.errors import InputError
from friso.quantities import Number, Quantity, any_sign, quoted, si_value
from friso.stage import Stage, parse_set
from friso.stage.controllers import KIND

EXAMPLE = 'masses.stage = "0.3 * mass" or friction.static = "max(friction.static, friction.coulomb)"'

_OPERATORS: dict[type, Any] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}
_FUNCTIONS: dict[str, Any] = {"min": np.minimum, "max": np.maximum, "sqrt": np.sqrt, "abs": np.abs}
_KEY, _ELEMENT = re.compile(r"\b[A-Za-z_]\w*(?:\.\w+)+"), re.compile(r"\.([0-9]+)\b")
"""Patterns of a key, and of the number of an array element in a key, as in controller.filters.2.frequency. Python
itself would write [2]."""

_QUANTITY = re.compile(r"(?<![\w.])[0-9.]+(?:[eE][+-]?[0-9]+)?\s+[^\W\d_][\w/*^²³]*(?:/\([\w*^]+\))?")
"""Pattern of a number with a unit, which has no blanks: "2 um", "0.5 N*s/m", "3 N/(m*s)"."""

_ARGUMENTS = {"min": 2, "max": 2, "sqrt": 1, "abs": 1}


def linked_names(links: Mapping[str, str]) -> frozenset[str]:
    """Return every name of a key or an axis in the expressions of links.

    Raises InputError for an expression that is not allowed.
    """
    trees = [_parsed(key, text) for key, text in links.items()]
    called = {id(node.func) for tree in trees for node in ast.walk(tree) if isinstance(node, ast.Call)}
    keys = set()
    for tree in trees:
        inner = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Attribute | ast.Subscript)}
        for node in ast.walk(tree):
            if isinstance(node, ast.Name | ast.Attribute | ast.Subscript) and id(node) not in called | inner:
                keys.add(_name(node))
    return frozenset(keys)


def check_links(stage: Stage, links: Mapping[str, str], axes: frozenset[str]) -> None:
    """Check that links lead to keys, and that their expressions use only keys or `axes`.

    Raises InputError otherwise.
    """
    numeric = stage.numeric_keys()
    for key in links:
        if key not in numeric:
            stage.flat({key: 0.0})  # raises an error that names the nearest key
        if key in axes and key not in linked_names({key: links[key]}):
            text = f"{key} = {links[key]}, which does not follow the axis {key}"
            raise InputError("link", text, "an axis or a link, or a link in which the axis occurs", EXAMPLE)
    for name in sorted(linked_names(links) - axes):
        if name not in numeric or name not in stage.flat():
            raise InputError("link", f"the name {name}", "axes and numeric keys that the stage has", EXAMPLE)


def linked(links: Mapping[str, str], values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the SI values of linked keys, from `values` of keys and axes (numbers or arrays).

    A link can use the links before it.
    """
    numbers = dict(values)
    for key, text in links.items():
        with np.errstate(all="ignore"):  # a result that is no number makes the cell invalid
            numbers[key] = _value(_parsed(key, text), numbers)
    return {key: numbers[key] for key in links}


def _parsed(key: str, text: str) -> ast.expr:
    try:
        plain = _QUANTITY.sub(lambda quantity: repr(si_value(quantity[0])), text.strip())
        tree = ast.parse(_KEY.sub(lambda key: _ELEMENT.sub(r"[\1]", key[0]), plain), mode="eval").body
        _check(tree)
    except InputError as error:
        raise error.under(key) from None
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise InputError(
            key, quoted(text), "numbers, with units or in SI, names, + - * / **, min, max, sqrt, abs", EXAMPLE
        ) from error
    return tree


def _check(node: ast.expr) -> None:
    """Raise ValueError for anything but arithmetic in an expression."""
    match node:
        case ast.BinOp(left, op, right) if type(op) in _OPERATORS:
            _check(left)
            _check(right)
        case ast.UnaryOp(op, operand) if type(op) in _OPERATORS:
            _check(operand)
        case ast.Call(ast.Name(name), arguments, []) if _ARGUMENTS.get(name) == len(arguments):
            for argument in arguments:
                _check(argument)
        case ast.Name():
            pass
        case ast.Attribute(ast.Name() | ast.Attribute() | ast.Subscript() as owner, _):
            _check(owner)
        case ast.Subscript(ast.Attribute() as owner, ast.Constant()):
            _check(owner)
        case ast.Constant(value) if type(value) in (int, float):
            pass
        case _:
            raise ValueError(ast.unparse(node))


def _value(node: ast.expr, numbers: Mapping[str, Any]) -> Any:
    match node:
        case ast.BinOp(left, op, right):
            return _OPERATORS[type(op)](_value(left, numbers), _value(right, numbers))
        case ast.UnaryOp(op, operand):
            return _OPERATORS[type(op)](_value(operand, numbers))
        case ast.Call(ast.Name(name), arguments):
            return _FUNCTIONS[name](*(_value(argument, numbers) for argument in arguments))
        case ast.Constant(value):
            return np.float64(str(value))
        case _:
            return np.asarray(numbers[_name(node)], dtype=float)[()]


def _name(node: ast.expr) -> str:
    """Return the name of a key or an axis as in a stage file."""
    match node:
        case ast.Subscript(owner, part):
            return f"{_name(owner)}.{ast.unparse(part)}"
        case ast.Attribute(owner, part):
            return f"{_name(owner)}.{part}"
        case _:
            return ast.unparse(node)


@dataclass(frozen=True)
class Scaling:
    """Axis of factors on several keys, such as the speed of the controller.

    Fields are `words` for figures and the function that multiplies the keys. `needs` is a key that a stage must have
    for this axis.
    """

    words: str
    scaled: Callable[[Mapping[str, Any], Any], dict[str, Any]]
    needs: str


SCALINGS = {
    "speed": Scaling("Controller speed (times yours)", faster, KIND),
    "friction": Scaling("All friction (times yours)", with_friction, "friction.model"),
}
"""All axes of factors, by name.

Factors apply to all poles and zeros of the controller, or to every friction force.
"""


def scaled(flat: Mapping[str, Any], columns: Mapping[str, np.ndarray], links: Mapping[str, str]) -> dict[str, Any]:
    """Return keys of stages, multiplied by the scaling factors among the columns.

    `flat` has SI numbers or arrays (cells,) by key. A name that links use is a free variable, not a scaling. Raises
    InputError if a stage has nothing to scale.
    """
    for name, scaling in SCALINGS.items():
        if name in columns and name not in linked_names(links):
            if flat.get(scaling.needs, "none") == "none":
                table = scaling.needs.partition(".")[0]
                raise InputError(name, f"a stage without [{table}]", "one that has it, or a key of the stage", "--help")
            flat = scaling.scaled(flat, columns[name])
    return dict(flat)


AxisValues = str | Sequence[Any] | np.ndarray | tuple[Any, str]
Scale = Literal["linear", "log"]


RANGE_EXAMPLE = '"1 Hz..40 Hz:41", "10 um..1 cm:41:log" or "4 Hz, 8 Hz, 16 Hz"'

_SCALE = r"\s*(?P<scale>linear|log)\s*"
_RANGE = re.compile(rf"(?P<first>[^:]*?)\.\.(?P<last>[^:]*?)(?::(?!\s*(?:linear|log))(?P<count>[^:]*))?(?::{_SCALE})?")


@dataclass(frozen=True)
class SweptAxis:
    """Axis of a study: a swept key, a scaling, or a free variable that links use.

    `values` (n,) are SI numbers, or words or booleans; `numeric` is true for numbers. `unit` is their SI unit, and
    `scale` the spacing of the axis in figures.
    """

    name: str
    values: np.ndarray
    unit: str = ""
    scale: Scale = "linear"
    numeric: bool = True


@dataclass(frozen=True)
class SweptRange:
    """A range from `first` to `last` [SI] of an axis: its number of points, and their spacing.

    `count` is None if the text does not state a number of points.
    """

    name: str
    first: float
    last: float
    unit: str
    count: int | None
    scale: Scale

    def at(self, share: np.ndarray) -> np.ndarray:
        """Return the values [SI] at fractions `share`, 0 to 1, of the way through the range.

        On a logarithmic scale the way is that of the logarithms.
        """
        if self.scale == "log":
            return np.exp(np.log(self.first) + share * (np.log(self.last) - np.log(self.first)))
        return self.first + share * (self.last - self.first)

    def axis(self) -> SweptAxis:
        """Return the axis of this range with `count` points, both ends exactly as stated."""
        space = np.geomspace if self.scale == "log" else np.linspace
        return SweptAxis(self.name, space(self.first, self.last, cast(int, self.count)), self.unit, self.scale)


def read_axis(stage: Stage, name: str, values: AxisValues, free: bool) -> SweptAxis | SweptRange:
    """Return an axis from a text, a list or an array with a unit; a range stays a `SweptRange`.

    `name` is a key or a scaling of the stage, or with `free` a name that links use. Raises InputError
    for a name or values that the stage cannot have.
    """
    field, scales = stage.numeric_keys().get(name), name in SCALINGS and not free
    if field is None and not free and not scales:
        return _words(stage, name, values)
    reader = _Reader(Number(any_sign, "1.2") if scales else field, stage.axis_kind)
    try:
        axis: SweptAxis | SweptRange
        if isinstance(values, str) and ".." in values:
            axis = _range(name, values, reader)
        else:
            axis = _axis_of_values(name, values, reader)
        if scales and (axis.first if isinstance(axis, SweptRange) else axis.values.min()) <= 0:
            raise InputError("", quoted(values), "factors above 0", '"0.4..2.5:41:log"')
        return axis
    except InputError as error:
        raise error.under(name) from None


class _Reader:
    """Reader of the numbers of an axis, of any sign.

    `field` is the key's number or quantity. It is None for a free variable, which only links use: its first value's
    kind of quantity decides the SI unit. Any sign is allowed, because a value that no stage may have makes only its
    cells invalid.
    """

    def __init__(self, field: Quantity | Number | None, kind: AxisKind) -> None:
        self.kind = kind
        self.field = None if field is None else replace(field, bound=any_sign)

    @property
    def unit(self) -> str:
        return "" if self.field is None else self.field.unit

    def text(self, entry: Any) -> float:
        """Return the SI value of an axis value such as "8 Hz", or "0.1" for a number without unit."""
        entry = entry.strip() if isinstance(entry, str) else entry
        bare = _number(entry)
        if self.field is None:
            self.field = Number(any_sign, "0.1") if bare is not None else self._natural(str(entry))
        return float(self.field.read(bare if isinstance(self.field, Number) and bare is not None else entry))

    def factor(self, unit: str) -> float:
        """Return the SI value of 1 `unit`."""
        if self.field is None and unit:
            self.field = self._natural(f"1 {unit}")
        if isinstance(self.field, Quantity):
            return self.field.factor(unit)
        if unit:
            raise InputError("", f"the unit {unit}", "bare numbers, since the key has no unit", "[0.1, 0.2, 0.3]")
        return 1.0

    def _natural(self, text: str) -> Quantity:
        for unit in map(self.kind.unit, ("kg", "N", "m", "s", "Hz", "m/s", "m/s^2", "N/m", "N*s/m", "N/(m*s)")):
            try:
                Quantity(unit, any_sign, "").read(text)
            except InputError:
                continue
            return Quantity(unit, any_sign, f"1 {unit}")
        raise InputError("", quoted(text), "a number with a unit that some key of the stage file has", '"1.7 kg"')


def _number(value: Any) -> float | None:
    """Return a number, or a text that is only a number, as float; None for anything else."""
    if isinstance(value, int | float | np.number) and not isinstance(value, bool):
        return float(value)
    try:
        return float(value) if isinstance(value, str) else None
    except ValueError:
        return None


def _range(name: str, text: str, reader: _Reader) -> SweptRange:
    """Read a range of an axis, such as "1 Hz..40 Hz:41", into its ends, count and spacing.

    Raises InputError for a text that is no range.
    """
    match = _RANGE.fullmatch(text)
    if match is None:
        raise InputError("", quoted(text), "FIRST..LAST:POINTS, optionally followed by :log", RANGE_EXAMPLE)
    try:
        first, last = reader.text(match["first"]), reader.text(match["last"])
    except InputError as error:
        ends = [f"{match[end].strip()} {reader.unit}" for end in ("first", "last") if _number(match[end]) is not None]
        if len(ends) < 2:
            raise
        raise InputError("", error.actual, error.expected, f'"{"..".join(ends)}"') from None
    if not first < last:
        order = "empty" if first == last else "reversed"
        raise InputError("", quoted(text, f"{order} range"), "an increasing range", RANGE_EXAMPLE)
    scale: Scale = cast(Scale, match["scale"] or "linear")
    if scale == "log" and first <= 0:
        range_text = quoted(text, "a logarithmic axis never reaches 0")
        raise InputError("", range_text, "a logarithmic range that begins above 0", '"10 um..1 cm:41:log"')
    return SweptRange(name, first, last, reader.unit, _count(text, match["count"]), scale)


MOST_AXIS_POINTS = 1_000_000_000
"""Most points of an axis. Longer ones take more than 8 GB before a cell is run."""


def _count(text: str, digits: str | None) -> int | None:
    """Read the number of points of a range from its `digits`, None if it has none.

    `text` is the whole range, for the error. Raises InputError for fewer than two points, or too many.
    """
    if digits is None:
        return None
    count = int(digits) if digits.strip().isascii() and digits.strip().isdigit() and len(digits) < 20 else 0
    if not 2 <= count <= MOST_AXIS_POINTS:
        expected = f"2 points or more, at most {MOST_AXIS_POINTS:,}"
        raise InputError("", quoted(text, f"{digits.strip()} points"), expected, RANGE_EXAMPLE)
    return count


def _axis_of_values(name: str, values: AxisValues, reader: _Reader) -> SweptAxis:
    """Make an axis from its values one by one: a list, a text with commas, or (array, unit).

    Raises InputError for values that are no finite numbers.
    """
    if isinstance(values, tuple) and len(values) == 2 and isinstance(values[1], str) and np.ndim(values[0]):
        si = np.asarray(values[0], dtype=float) * reader.factor(values[1])
    elif isinstance(values, str):
        if "," not in values:
            raise InputError("", quoted(values), "a range FIRST..LAST, or a list of values with commas", RANGE_EXAMPLE)
        si = np.array([reader.text(value) for value in values.split(",")])
    else:
        si = np.array([reader.text(value) for value in _items(values)], dtype=float)
    if si.ndim != 1 or not si.size:
        raise InputError("", "no values", "a list or one-dimensional array of values", '["4 Hz", "8 Hz"]')
    if not np.all(np.isfinite(si)):
        raise InputError("", "values that are not finite", "finite numbers", '(np.linspace(1, 40, 41), "Hz")')
    return SweptAxis(name, si, reader.unit)


def _items(values: Any) -> list[Any]:
    """Return the items of a list or array as a list. Raises InputError for anything else."""
    try:
        return list(values)
    except TypeError:
        raise InputError("", quoted(values), "a range, or a list of values", RANGE_EXAMPLE) from None


def _words(stage: Stage, key: str, values: AxisValues) -> SweptAxis:
    """Return an axis of words or booleans for a key, after trying each of them in the stage.

    Raises InputError for a word that the stage does not take, and for an unknown key.
    """
    options = (
        [parse_set(f"{key}={word}")[1] for word in values.split(",")] if isinstance(values, str) else _items(values)
    )
    table, _, rest = key.partition(".")
    if rest and getattr(stage, table, 0) is None:
        problem = f"a key of [{table}], which this stage does not have"
        raise InputError(key, problem, "a key of the stage, or a stage with that table")
    if not rest or table not in type(stage).model_fields:
        expected = "a key of the stage file, or a name that a link uses"
        names = [*stage.numeric_keys(), *SCALINGS]
        near = [name for name in stage.numeric_keys() if key in name.split(".", 1)[-1] or name.startswith(key)]
        near = near or get_close_matches(key, [*names, *(name.split(".", 1)[-1] for name in names)], 1)
        hint = f"; did you mean {' or '.join(near)}?" if 0 < len(near) < 4 else ""
        actual = f"a name that nothing depends on{hint}"
        raise InputError(key, actual, expected, 'with the link masses.cart = "0.7 * mass"')
    for value in options:
        stage.replace({key: value})
    if not options:
        raise InputError(key, "no values", "a list of values", "[true, false]")
    return SweptAxis(key, np.array(options), numeric=False)


def read_axes(
    stage: Stage, axes: Mapping[str, AxisValues], free: frozenset[str], log: bool = False
) -> tuple[SweptAxis | SweptRange, ...]:
    """Return all axes of a study; `axes` are texts, lists or arrays with a unit, by name.

    Ranges without a number of points stay a `SweptRange`. Names in `free` are used by links only. Raises InputError
    for a name or values that the stage cannot have.
    """
    return tuple(read_axis(stage, name, values, name in free) for name, values in axes.items())


SAMPLE = "sample"
"""Name of the dimension along which samples lie."""

METHODS = ("sobol", "latin")


@dataclass(frozen=True)
class Samples:
    """Samples of ranges: `count` points by a method of `METHODS`, the same for the same `seed`.

    `ranges` are name to "1 Hz..40 Hz", with ":log" behind it if the points shall be even in the logarithm. Lists or
    arrays of equal length are the points themselves.

    Examples
    --------
    >>> import friso
    >>> points = friso.Samples({"joint.stroke": "0.2 mm..1 mm", "controller.crossover": "4 Hz..12 Hz"}, count=8)
    >>> friso.sweep(friso.example("thesis_rig"), samples=points).sizes["sample"]
    8
    """

    ranges: Mapping[str, AxisValues]
    count: int | None = None
    method: str = "sobol"
    seed: int = field(default=0)

    def __post_init__(self) -> None:
        """Check the fields. Raises InputError for other types."""
        if not isinstance(self.ranges, Mapping):
            raise InputError(
                "ranges", quoted(self.ranges), "a dictionary of keys to ranges", 'ranges={"joint.stroke": "0 m..1 mm"}'
            )
        for name, number, least in (("samples", self.count, 2), ("seed", self.seed, 0)):
            whole = (
                isinstance(number, Integral) and not isinstance(number, bool) and least <= number <= MOST_AXIS_POINTS
            )
            if not (whole or (number is None and name == "samples")):
                expected = f"a whole number from {least} to {MOST_AXIS_POINTS:,}"
                raise InputError(name, quoted(number), expected, f"{name}=1024")
        if self.method not in METHODS:
            raise InputError("method", quoted(self.method), f"one of {', '.join(METHODS)}", 'method="sobol"')


def sample_axes(stage: Stage, samples: Samples, free: frozenset[str]) -> tuple[SweptAxis, ...]:
    """Return the axes of samples, all of one length, from ranges or from lists.

    `free` are names that links use. Raises InputError for ranges with a number of
    points, for lists of unequal length, and for ranges together with lists.
    """
    read = read_axes(stage, samples.ranges, free)
    ranges = [axis for axis in read if isinstance(axis, SweptRange)]
    if not ranges:
        return _values(read)
    if len(ranges) < len(read):
        raise InputError("samples", "ranges together with lists", "one or the other", '{"joint.stroke": "0 m..1 mm"}')
    for axis in ranges:
        if axis.count is not None:
            raise InputError(axis.name, f"a range with {axis.count} points", "for samples, FIRST..LAST alone")
    points = _points(len(ranges), samples)
    return tuple(SweptAxis(axis.name, axis.at(points[:, i]), axis.unit, axis.scale) for i, axis in enumerate(ranges))


def _values(read: tuple[SweptAxis | SweptRange, ...]) -> tuple[SweptAxis, ...]:
    axes = tuple(axis for axis in read if isinstance(axis, SweptAxis))
    if len({len(axis.values) for axis in axes}) != 1:
        lengths = ", ".join(f"{axis.name} {len(axis.values)}" for axis in axes) or "none"
        raise InputError("samples", f"lengths: {lengths}", "keys with equally many values each")
    return axes


def _points(dimensions: int, samples: Samples) -> np.ndarray:
    """Return points in the unit cube, shape (count, dimensions).

    Raises InputError if the samples have no count.
    """
    from scipy.stats import qmc

    if samples.count is None:
        raise InputError("samples", "no number of points", "2 points or more", "samples=1024")
    if samples.method == "sobol":
        sampler = qmc.Sobol(dimensions, rng=samples.seed)
        points = sampler.random_base2(int(np.ceil(np.log2(samples.count))))
        return points[: samples.count]
    return qmc.LatinHypercube(dimensions, rng=samples.seed).random(samples.count)
