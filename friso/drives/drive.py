"""Declare drives: how their parameter files are recognised, read as a stage, and written from one."""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from math import inf, isclose, pi
from operator import add, mul, neg, pos, pow, sub, truediv
from typing import Any, ClassVar
from xml.etree import ElementTree

from friso.axis import LINEAR, AxisKind
from friso.drives.ask import GAIN_FIELD, Ask
from friso.errors import InputError, one_line
from friso.quantities import quoted
from friso.registry import Registry

FlatStage = Mapping[str, Any]
"""A stage as flat keys such as controller.kp, with SI values."""

Beside = Callable[[str], str | None]
"""Function that returns the text of another file.

The file's name is relative to the folder of a parameter file. The result is None for a file outside that folder."""


@dataclass(frozen=True)
class AxisParameters:
    """The parameters of one axis, as a parameter file holds them.

    `name` is the axis's name in the file, and `letter` is what users of the machine call it. `values` holds texts or
    numbers by name. `machine` holds the settings of the whole machine that matter for the axis.
    """

    name: str
    values: Mapping[str, Any]
    machine: Mapping[str, Any] = field(default_factory=dict)
    letter: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", one_line(self.name))

    def number(self, name: str, default: float | None = None, symbols: Mapping[str, float] | None = None) -> float:
        """Return a parameter as a finite number.

        A text may be one of the `symbols`, which stand for numbers. Raises InputError if the parameter is no number, or
        if it is absent and has no `default`.
        """
        entry = self.values.get(name, self.machine.get(name, default))
        if entry is None:
            raise InputError(name, "nothing", "a number", f"{name} = 1.0")
        if symbols and isinstance(entry, str) and not _NUMBER.fullmatch(entry.strip()):
            if entry not in symbols:
                names = [*symbols][: len({*symbols.values()})]  # each symbol in one spelling
                expected = f"a number, or one of {', '.join(names)}"
                raise InputError(name, quoted(entry), expected, f"{name} = 1")
            return symbols[entry]
        try:
            if isinstance(entry, bool) or (isinstance(entry, str) and not _NUMBER.fullmatch(entry.strip())):
                raise TypeError
            value = float(entry)
        except (TypeError, ValueError, OverflowError):
            raise InputError(name, quoted(str(entry)), "a number", f"{name} = 1.0") from None
        if abs(value) > LARGEST_PARAMETER or value != value:
            raise InputError(name, f"{value:g}", f"a number of at most {LARGEST_PARAMETER:g}", f"{name} = 1.0")
        return value

    def flag(self, name: str, default: bool = False) -> bool:
        """Tell whether a switch is on; an absent one is as `default` says.

        Raises InputError if its value is neither true nor false, 0 nor 1.
        """
        entry = self.values.get(name, default)
        if not isinstance(entry, bool) and entry not in (0, 1):
            raise InputError(name, quoted(str(entry)), "true or false", f"{name} = true")
        return bool(entry)

    def refuse_negative(self, names: Iterable[str]) -> None:
        """Refuse the first of some gains that is below 0. Raises InputError."""
        for name in names:
            if (gain := self.number(name, 0.0)) < 0:
                raise InputError(name, f"{gain:g}", "a gain of 0 or more", f"{name} = 10")

    def is_set(self, name: str) -> bool:
        """Tell whether a parameter exists and is neither 0 nor infinite."""
        entry = self.values.get(name)
        return entry is not None and str(entry).strip().lower() not in ENDLESS and self.number(name) != 0


_NUMBER = re.compile(r"[+-]?(?:(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:e[+-]?[0-9]+)?|inf(?:inity)?|nan)", re.IGNORECASE)
"""Pattern of a number as drives read it.

Unlike Python, drives accept neither underscores nor digits of other scripts. The pattern matches a run of digits in
only one way, so that a hundred thousand take no time."""

LARGEST_PARAMETER = 1e30
"""Largest value of a parameter."""

ENDLESS = ("", "inf", "+inf", "infinity")
"""Values that stand for no limit, or for an empty parameter."""


@dataclass(frozen=True)
class AsStage:
    """Stage that an axis's parameters describe, as tables of a stage file.

    `left_out` says in sentences which settings of the drive a stage cannot describe.
    """

    tables: Mapping[str, Mapping[str, Any]]
    left_out: tuple[str, ...] = ()


@dataclass(frozen=True)
class Parameters:
    """Parameters of a drive: their `values` by name.

    `held` are the names of the keys of [controller] that these parameters hold.
    """

    values: Mapping[str, float]
    held: frozenset[str]


@dataclass(frozen=True)
class ParameterRow:
    """A parameter and the key of [controller] that it is: its unit, and its powers of force, length and time."""

    name: str
    key: str
    unit: str
    powers: tuple[int, int, int]


def rows(**names: str) -> tuple[ParameterRow, ...]:
    """Return rows of parameters by the key of [controller] that they are."""
    return tuple(ParameterRow(name, key, *_ROWS[key]) for key, name in names.items())


_ROWS = {
    "kp": ("N/m", (1, -1, 0)),
    "ki": ("N/(m*s)", (1, -1, -1)),
    "kd": ("N*s/m", (1, -1, 1)),
    "acceleration_feedforward": ("kg", (1, -1, 2)),
    "error_deadband": ("m", (0, 1, 0)),
    "force_limit": ("N", (1, 0, 0)),
    "integral_limit": ("N", (1, 0, 0)),
}
"""Units of keys of [controller] on a linear axis, and their powers."""


@dataclass(frozen=True)
class DriveUnits:
    """What a 1 of a drive is at the load: `force` [N or N m], `length` [m or rad], and the `time` of its loop [s]."""

    kind: AxisKind
    force: float = 1.0
    length: float = 1.0
    time: float = 1.0

    def of(self, row: ParameterRow) -> float:
        """Return what a 1 of a parameter is in SI."""
        force, length, time = row.powers
        return float(self.force**force * self.length**length * self.time**time)


class DriveFormat:
    """A drive: how its parameter file is recognised, read as a stage, and written from one.

    `title` names the file. `firmware` and `source` say whose formulas are used, and where they are published. Both ways
    ask for what is open as they read, so that one pass finds all of it.
    """

    title: ClassVar[str]
    firmware: ClassVar[str]
    source: ClassVar[str]
    suffix: ClassVar[str]
    pattern: ClassVar[str]
    """Expression for what a text of this kind contains."""

    rows: ClassVar[tuple[ParameterRow, ...]] = ()

    lost: ClassVar[Mapping[str, str]] = {}
    """What is said of a parameter that is set and that a stage cannot have."""

    line: ClassVar[str] = "{} {:.12g}\n"
    """How a parameter is written: name and value."""

    def recognises(self, text: str) -> bool:
        """Tell whether a text is a file of this kind."""
        return re.search(self.pattern, text, re.MULTILINE) is not None

    def whole(self, text: str, beside: Beside) -> str:
        """Return a text with the files of the same folder that it includes, which `beside` reads."""
        return text

    def axes(self, text: str) -> tuple[AxisParameters, ...]:
        """Return the axes of a text. Raises InputError for one that cannot be read."""
        raise NotImplementedError

    def stage(self, axis: AxisParameters, ask: Ask) -> AsStage:
        """Turn an axis and the answers into a stage. Raises InputError for what friso cannot describe."""
        raise NotImplementedError

    def parameters(self, flat: FlatStage, ask: Ask) -> Parameters:
        """Compute the parameters of a stage. Raises InputError for a controller that the drive does not have."""
        raise NotImplementedError

    def text(self, settings: Mapping[str, float]) -> str:
        """Write parameters as a file."""
        return "".join(self.line.format(name, value) for name, value in settings.items())

    def keys(self, axis: AxisParameters, units: DriveUnits, always: Iterable[str] = ()) -> dict[str, Any]:
        """Return the keys of [controller] of the rows that an axis sets, and of those that are `always` there."""
        set_ones = [row for row in self.rows if row.key in always or axis.is_set(row.name)]
        return {row.key: si(axis.number(row.name, 0.0) * units.of(row), units.kind.unit(row.unit)) for row in set_ones}

    def values(self, flat: FlatStage, units: DriveUnits, optional: Iterable[str] = ()) -> dict[str, float]:
        """Return the parameters of the rows, without those `optional` keys that the stage has not."""
        held = [row for row in self.rows if row.key not in optional or f"controller.{row.key}" in flat]
        return {row.name: flat.get(f"controller.{row.key}", 0.0) / units.of(row) for row in held}

    def velocity_loop(self, ask: Ask, kind: AxisKind, meaning: str = "", more: str = "") -> None:
        """Ask for the gain of the drive's velocity loop, where a file has the loop above it alone."""
        usual = "gain of the drive's velocity loop, whose integral time, if any, is controller.velocity_integral_time"
        ask("controller.kp", f"{meaning or usual}{more}", GAIN_FIELD.on(kind).written_example)

    def as_stage(
        self, ask: Ask, axis: AxisParameters, kind: AxisKind, left: Iterable[str], **tables: Mapping[str, Any]
    ) -> AsStage:
        """Return a stage of the `tables` that are not empty, and ask for the machine.

        `left` says what a stage does not take over, beside the parameters in `lost`.
        """
        ask.of_the_machine(kind, moved=bool(tables.get("motion")))
        if kind != LINEAR:
            tables["axis"] = {"kind": kind.name}
        lost = [f"{name} = {axis.number(name):g}{what}" for name, what in self.lost.items() if axis.is_set(name)]
        return AsStage({name: table for name, table in tables.items() if table}, (*lost, *left))


class PidDrive(DriveFormat):
    """A drive with a PID of the position whose derivative is that of the error, and whose output is a force."""

    period: ClassVar[str] = ""
    """Period of the loop, if it is that of the firmware."""

    usual_period: ClassVar[str] = ""
    """Example of the period, if it is open."""

    def units(self, ask: Ask, axis: AxisParameters | None, flat: FlatStage) -> DriveUnits:
        """Return the units of an axis, or those for a stage if there is no axis."""
        raise NotImplementedError

    def further(self, axis: AxisParameters, ask: Ask, units: DriveUnits) -> tuple[dict[str, Any], list[str]]:
        """Return further keys of [controller], and what is left out."""
        return {}, []

    def stage(self, axis: AxisParameters, ask: Ask) -> AsStage:
        """Turn an axis and the answers into a stage. Raises InputError for unusable numbers."""
        units = self.units(ask, axis, {})
        axis.refuse_negative(row.name for row in self.rows[:3])
        table = {"kind": "pid", "derivative_on": "measurement", **self.keys(axis, units)}
        if not table.keys() & {"kp", "ki"}:
            raise InputError(self.rows[0].name, "no gain greater than 0", "a loop that controls the position", "10")
        if "kd" in table:  # the derivative acts on the reference, too
            table["viscous_feedforward"] = table["kd"]
        if "ki" not in table:
            table.pop("integral_limit", None)
        more, left = self.further(axis, ask, units)
        if self.usual_period:
            ask(SAMPLE_TIME, "period of the drive's loop", self.usual_period)
        drive = {"sample_time": self.period} if self.period else {}
        return self.as_stage(ask, axis, units.kind, left, controller={**table, **more}, drive=drive)

    def parameters(self, flat: FlatStage, ask: Ask) -> Parameters:
        """Compute the parameters of a stage.

        Raises InputError for a controller other than a PID by its gains, and for one whose derivative is not that of
        the error. A limit that the stage has not is not among them.
        """
        units = self.units(ask, None, flat)
        if flat["controller.kind"] != "pid" or "controller.crossover" in flat:
            raise lacks(f'kind = "{flat["controller.kind"]}", or tuning rules', "a PID by its gains", 'kp = "3 N/m"')
        if flat.get("controller.tau", 0.0) > 0:
            raise lacks("a filter of the derivative", "no filter (tau = 0), which this drive has not")
        gain, ahead = flat.get("controller.kd", 0.0), flat.get("controller.viscous_feedforward", 0.0)
        if gain and flat["controller.derivative_on"] == "measurement" and not isclose(gain, ahead, rel_tol=1e-6):
            raise lacks("a derivative of the measurement alone", "viscous_feedforward = kd, as this drive has it")
        values = self.values(flat, units, optional=("force_limit", "integral_limit"))
        return Parameters(values, frozenset({*(row.key for row in self.rows), "viscous_feedforward"}))


class CascadeDrive(DriveFormat):
    """A drive with a proportional position loop above a velocity loop."""

    structure: ClassVar[str] = "a proportional position loop above a velocity loop, as this drive has it"

    def refuse_other(self, flat: FlatStage) -> None:
        """Raise InputError for a controller that is no cascade, or one with an integral of the position."""
        if flat["controller.kind"] != "cascade" or "controller.position_integral_time" in flat:
            raise lacks(f'kind = "{flat["controller.kind"]}", or an integral of the position', self.structure)


def torque(kind: AxisKind, travel: float) -> DriveUnits:
    """Return the units of a drive that counts in N m and turns, each of which moves the load by `travel` [m or rad]."""
    return DriveUnits(kind, 2 * pi / travel, travel)


def deadband(ask: Ask, axis: AxisParameters, band: str, units: DriveUnits) -> dict[str, Any]:
    """Return the keys of [controller] for a deadband whose half width is the parameter `band`.

    What is left of an error beyond it is asked for.
    """
    width = si(axis.number(band) * units.length, units.kind.unit("m"))
    what = f"what is left of an error beyond {band}: reduced, by what is lost within, or whole"
    whole = ask("error_beyond_deadband", what, "reduced", ("reduced", "whole")) == "whole"
    return {"error_deadband": width, **({"error_deadband_exit": width} if whole else {})}


def deadband_back(flat: FlatStage) -> tuple[float, frozenset[str]] | None:
    """Return the size of a deadband without memory [m], and the names of its keys; None without one."""
    key = "controller.error_deadband"
    if key not in flat or f"{key}_time" in flat or flat.get(f"{key}_exit", flat[key]) != flat[key]:
        return None
    return float(flat[key]), frozenset({"error_deadband", "error_deadband_exit"})


SAMPLE_TIME, POSITION_TIME = "drive.sample_time", "drive.position_sample_time"
"""Keys of the stage file that a drive's file may leave open."""

FORMATS: Registry[DriveFormat] = Registry("friso.drives.formats", "")


def axes_with(gain: str, settings: Iterable[tuple[str, str, Any]], otherwise: InputError) -> tuple[AxisParameters, ...]:
    """Return the axes that have a `gain` among their settings (axis, name and value), of which the last ones count.

    Raises the InputError `otherwise` without one.
    """
    values: dict[str, dict[str, Any]] = {}
    for axis, name, value in settings:
        values.setdefault(axis, {})[name] = value
    ordered = sorted(values, key=lambda axis: (len(axis), axis))
    if found := tuple(AxisParameters(axis, values[axis]) for axis in ordered if gain in values[axis]):
        return found
    raise otherwise


def si(value: float, unit: str) -> str:
    """Write a number in SI with its unit, in the form of a stage file."""
    return f"{value:.15g} {unit}"


def there_and_back(axis: AxisParameters, limits: tuple[str, str], unit: float, kind: AxisKind) -> dict[str, str]:
    """Return the table [motion] of a move there and back that uses all of a drive's speed and acceleration.

    `limits` are their names; they are in the drive's `unit` [m or rad] per second and square second. The table is empty
    if the drive does not limit both.
    """
    if not all(map(axis.is_set, limits)):
        return {}
    fastest, acceleration = map(axis.number, limits)
    back = max(5.0, 4 * fastest / acceleration)
    return {
        "kind": "there_and_back",
        "acceleration": si(acceleration * unit, kind.unit("m/s^2")),
        "acceleration_time": si(fastest / acceleration, "s"),
        "return_at": si(back, "s"),
        "duration": si(back + 15, "s"),
    }


def lacks(what: str, expected: str, example: str = "") -> InputError:
    """Build the error for a controller that a parameter format cannot hold.

    `what` is the controller, and `expected` the kind of controller that the format can hold.
    """
    return InputError("controller", what, expected, example)


def root_of(text: str, expected: str) -> ElementTree.Element:
    """Return the root element of an XML text.

    `expected` says what files of this kind are like. Raises InputError for a text that is no XML, and for one with a
    document type.
    """
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise InputError("", "a document type", f"an XML file without one, {expected}")
    try:
        return ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError) as error:
        raise InputError("", f"no XML: {error}", f"a file {expected}") from None


LONGEST_EXPRESSION = 200
"""Longest arithmetic expression in characters."""

_NAMED: Mapping[str, float] = {
    "float('inf')": inf,
    **{f"{module}{name}": value for name, value in (("pi", pi), ("inf", inf)) for module in ("", "math.", "np.")},
}
_PAIRS = {ast.Add: add, ast.Sub: sub, ast.Mult: mul, ast.Div: truediv, ast.Pow: pow}
_SIGNS = {ast.USub: neg, ast.UAdd: pos}

_OTHER = re.compile(r"\d(?!e[+-]?\d)[a-z_]|\\", re.IGNORECASE)
"""Pattern of texts that are not arithmetic and would make Python's parser warn, such as letters after a digit in
0x10."""


def number_in(text: str) -> float | None:
    """Return the number that a text stands for, or None if it is no number.

    Arithmetic with +, -, *, /, **, brackets, pi and inf is evaluated. Python code is never executed.
    """
    if len(text) > LONGEST_EXPRESSION or _OTHER.search(text):
        return None
    try:
        return _worked_out(ast.parse(text.strip(), mode="eval").body)
    except (SyntaxError, ValueError, ArithmeticError, RecursionError, MemoryError):
        return None


def _worked_out(node: ast.expr) -> float:
    """Return the value of an arithmetic expression.

    Raises ValueError for anything but arithmetic of numbers, and for a root of a negative number.
    """
    match node:
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            return float(value)
        case ast.BinOp(left, sign, right) if type(sign) in _PAIRS:
            value = _PAIRS[type(sign)](_worked_out(left), _worked_out(right))
            if isinstance(value, complex):
                raise ValueError(value)
            return value
        case ast.UnaryOp(sign, operand) if type(sign) in _SIGNS:
            return _SIGNS[type(sign)](_worked_out(operand))
    name = ast.unparse(node)
    if name not in _NAMED:
        raise ValueError(name)
    return _NAMED[name]
