"""Give the gains of a stage as an engineer types them into a drive: the loop drawn, other units, a drive's parameters.

One turn of the motor moves the load by a travel L, in m, or in rad on a rotary axis. A force F then equals a torque F
L/(2 pi). A velocity v equals v/L turns per second. A torque equals a current times the motor's constant.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from math import isclose, isfinite, pi
from typing import Any

from friso.axis import LINEAR, AxisKind, axis_of
from friso.drives.ask import TRAVEL, TRAVELS, Ask, travel_of
from friso.drives.drive import FORMATS, DriveFormat
from friso.errors import InputError
from friso.quantities import Quantity, positive, quoted
from friso.stage import Stage
from friso.stage.controllers import CONTROLLER, FEEDBACK, FILTERS_KEY, FORCE_LIMIT, FORWARD, controller_of
from friso.stage.rig import CONVERSIONS
from friso.stage.section import row_keys

ABOVE, MAIN, BELOW, LAST, LOWEST = range(5)
"""Lines of a drawing, from top to bottom."""

SUM_DISTANCE = 6
"""Characters between a signal from below and its summing point."""


class Canvas:
    """Drawing of the loop from the error to the force.

    Boxes and sums are added from left to right. Feedback and feedforward enter on lines above and below.
    """

    def __init__(self, flat: Mapping[str, Any]) -> None:
        """Start the drawing with the reference, the first sum and the fed-back position.

        `flat` is the stage as flat keys; its keys tell which filters and limits to draw.
        """
        self.paths = {flat[f"{place}.path"] for place in row_keys(flat, FILTERS_KEY)}
        self.limited = FORCE_LIMIT in flat
        self.lines = [""] * 5
        self.lines[MAIN] = "r --(+)-- e --"
        self._put(BELOW, 5, "| -")
        self._put(LAST, 5, "y")

    @property
    def filtered(self) -> bool:
        """Tell whether a filter acts on the fed-back position."""
        return FEEDBACK in self.paths

    def box(self, text: str) -> None:
        """Add a box with a text that the signal passes through next."""
        line = self.lines[MAIN]
        self.lines[MAIN] = f"{line}{'' if line.endswith('-') else '--'}[ {text} ]"

    def sum(self, above: str = "", below: str = "", minus: bool = True, deep: bool = False) -> None:
        """Add a sum of the signal and of what enters from above or below.

        What enters from below is subtracted, or added if `minus` is False, and drawn one line lower if `deep`.
        """
        self.lines[MAIN] += "--(+)"
        place = len(self.lines[MAIN]) - 2
        if above:
            self._put(ABOVE, place, f"v  {above}")
        if below:
            self._put(BELOW, place, "| -" if minus else "|")
            if deep:
                self._put(LAST, place, "|")
            self._put(LOWEST if deep else LAST, place if minus else place - SUM_DISTANCE, below)

    def text(self) -> str:
        """Finish the drawing with output filters and force limit, and return its lines as text."""
        boxes = [*(["filters"] if FORWARD in self.paths else []), *(["limit"] if self.limited else [])]
        for name in boxes:
            self.box(name)
        self.lines[MAIN] += "--> F"
        return "\n".join(line.rstrip() for line in self.lines if line.strip())

    def _put(self, line: int, place: int, text: str) -> None:
        """Write a text at column `place` of a line, padding the line with spaces up to there."""
        self.lines[line] = f"{self.lines[line]:<{place}}{text}"


def loop_diagram(flat: Mapping[str, Any]) -> str:
    """Draw the loop of a stage with the terms that its controller has."""
    canvas = Canvas(flat)
    controller_of(flat).draw(canvas, flat)
    return canvas.text()


MOTOR_CONSTANT = "motor_constant"
"""Key of the user's answer: torque per ampere [N m/A], or force per ampere [N/A] without a turn."""

TORQUE_PER_AMPERE, FORCE_PER_AMPERE = Quantity("N*m/A", positive, "0.5 N*m/A"), Quantity("N/A", positive, "30 N/A")


Other = tuple[float, str]
"""A value in another unit."""


@dataclass(frozen=True)
class Conversion:
    """One gain of a controller: its name, its symbol, and its value in several units.

    Values stand beside their units; the first one is in SI.
    """

    name: str
    symbol: str
    values: tuple[tuple[float, str], ...]

    @property
    def finite(self) -> bool:
        """Tell whether all values of the gain are finite numbers."""
        return all(isfinite(value) for value, _ in self.values)


Commands = tuple[tuple[str, float], ...]
"""Force or torque [N or N m] per unit of each command that a drive may have."""


@dataclass(frozen=True)
class Turn:
    """Travel of a turn and force per command, which convert units between motor and load.

    `travel` is how far one turn moves the load [m or rad], None if unknown. `exerts` has the force or torque at the
    load [N or N m] per unit of command, such as ("A", 50.0).
    """

    travel: float | None
    exerts: Commands

    @property
    def per_ampere(self) -> float | None:
        """Return the force or torque at the load per ampere [N/A or N m/A]; None if unknown."""
        return dict(self.exerts).get("A")

    @classmethod
    def of(cls, flat: Mapping[str, Any], answers: Ask, exerts: Commands = ()) -> Turn:
        """Collect travel and force per command from the stage file and the user's answers.

        The transmission gives the travel, the actuator gives `exerts`; the user may add what is missing. Raises
        InputError for an answer in a wrong unit, or one that contradicts the stage.
        """
        kind, travel, per_ampere = axis_of(flat), travel_of(flat), dict(exerts).get("A")
        if TRAVEL in answers:
            answer = answers.value(TRAVEL, TRAVELS[kind])
            if travel is not None and not isclose(answer, travel, rel_tol=1e-6):
                unit = kind.unit("m")
                expected = f"that of the transmission, {travel:.6g} {unit}, which is enough"
                raise InputError(TRAVEL, f"{answer:.6g} {unit}", expected)
            travel = answer
        if MOTOR_CONSTANT not in answers:
            return cls(travel, exerts)
        if travel is not None:
            exerted = answers.value(MOTOR_CONSTANT, TORQUE_PER_AMPERE) * 2 * pi / travel
        else:
            exerted = answers.value(MOTOR_CONSTANT, FORCE_PER_AMPERE if kind == LINEAR else TORQUE_PER_AMPERE)
        if per_ampere is not None and not isclose(exerted, per_ampere, rel_tol=1e-6):
            unit = kind.unit("N/A")
            expected = f"that of [actuator], {per_ampere:.6g} {unit} at the load, which is enough"
            raise InputError(MOTOR_CONSTANT, f"{exerted:.6g} {unit} at the load", expected)
        return cls(travel, (("A", exerted), *(one for one in exerts if one[0] != "A")))


Convert = Callable[[float, Turn, AxisKind], list[Other]]
"""Function that converts a value in SI to other units."""


def conversions(flat: Mapping[str, Any], answers: Ask, exerts: Commands = ()) -> tuple[Conversion, ...]:
    """Return every gain of a stage in SI and in the units that drives use.

    `flat` holds the stage as flat keys such as controller.kp. Units that need an unknown travel or motor constant are
    left out; `exerts` has the force or torque [N or N m] per unit of command. Raises InputError for gains too large or
    too small to convert, and for answers that contradict the stage.
    """
    turn = Turn.of(flat, answers, exerts)
    try:
        return tuple(row for row in _rows(flat, turn) if row.finite)
    except (ArithmeticError, ValueError):
        actual = "gains or a travel that are too large or too small for the conversions"
        raise InputError("controller", actual, "numbers that a drive could take", 'kp = "500 N*s/m"') from None


def _rows(flat: Mapping[str, Any], turn: Turn) -> Iterator[Conversion]:
    """Yield each gain that the controller declares, in SI and in other units."""
    kind = axis_of(flat)
    for gain in controller_of(flat).gains(flat):
        convert = BY_UNIT.get(gain.unit)
        others = convert(gain.value, turn, kind) if convert else []
        yield Conversion(gain.name, gain.symbol, ((gain.value, kind.unit(gain.unit)), *others))


def _mass(value: float, turn: Turn, kind: AxisKind) -> list[Other]:
    """Convert an inertia [kg or kg m^2] to command per acceleration, and to the motor's side.

    Units that need an unknown travel or motor constant are left out.
    """
    commanded = [(value / exerted, f"{name}*s^2/{kind.length}") for name, exerted in turn.exerts]
    at_motor = [(value * (turn.travel / (2 * pi)) ** 2, "kg*m^2 at the motor")] if turn.travel else []
    return [*commanded, *at_motor]


def _force(value: float, turn: Turn, kind: AxisKind) -> list[Other]:
    """Convert a force [N or N m] to commands and motor torque, as far as they are known."""
    at_motor = [(value * turn.travel / (2 * pi), "N*m at the motor")] if turn.travel else []
    return [*at_motor, *((value / exerted, name) for name, exerted in turn.exerts)]


def _per(unit: str, *per: tuple[str, float]) -> Convert:
    """Build a converter for gains that are a force per motion, such as N/m or N s/m.

    The converter also gives the gain per turn of the motor, as torque and as current.
    """

    def others(value: float, turn: Turn, kind: AxisKind) -> list[Other]:
        """Return the gain with commands for force, and per turn of the motor, as far as known.

        On a linear axis the gain per millimetre is added.
        """
        values = []
        for name, exerted in turn.exerts:
            shown = kind.unit(unit).replace("N*m", name, 1) if kind != LINEAR else unit.replace("N", name, 1)
            values.append((value / exerted, shown))
        if turn.travel:
            at_motor = value * (turn.travel / (2 * pi)) ** 2
            place = "" if kind == LINEAR else " at the motor"  # gains of the load are per angle too
            values += [(at_motor * factor, f"N*m{angle}{place}") for angle, factor in per]
            if turn.per_ampere:
                ampere = turn.per_ampere * turn.travel / (2 * pi)  # torque of an ampere
                values += [(at_motor * factor / ampere, f"A{angle}{place}") for angle, factor in per]
        return [*values, *([(value / 1e3, unit.replace("m", "mm"))] if kind == LINEAR else [])]

    return others


BY_UNIT: Mapping[str, Convert] = {
    "N/m": _per("N/m", ("/rad", 1.0), ("/turn", 2 * pi)),
    "N*s/m": _per("N*s/m", ("/(rad/s)", 1.0), ("/(turn/s)", 2 * pi), ("/rpm", 2 * pi / 60)),
    "N/(m*s)": _per("N/(m*s)", ("/(rad*s)", 1.0), ("/(turn*s)", 2 * pi)),
    "N": _force,
    "kg": _mass,
    "m": lambda value, turn, kind: [(value / turn.travel, "turn")] if turn.travel else [],
    "s": lambda value, turn, kind: [(value * 1e3, "ms"), (1 / (2 * pi * value), "Hz (corner)")],
    "1/s": lambda value, turn, kind: [(value * 0.06, "(m/min)/mm")],
    "Hz": lambda value, turn, kind: [(value * 2 * pi, "rad/s")],
}
"""Converters of SI values to other units, by their unit on a linear axis.

A length becomes turns of the motor if the travel is known, a time also its corner frequency, and a rate the speed in
metres per minute for each millimetre of error."""


DRIVE_OUTPUT = "output of the drive"
"""What stands for a unit where the output of a drive has none."""


@dataclass(frozen=True)
class Gains:
    """The gains of a stage, with its loop drawn (`diagram`) and the gains in drives' units.

    `conversions` has the gains in these units. For a `kind` of drive, `parameters` holds its parameters by name.
    `not_held` lists the keys of the stage that these parameters cannot hold.
    """

    stage: Stage
    diagram: str
    conversions: tuple[Conversion, ...]
    kind: DriveFormat | None = None
    parameters: Mapping[str, float] | None = None
    not_held: tuple[str, ...] = ()

    @property
    def text(self) -> str:
        """Return the parameters as the drive's file holds them; "" without a kind of drive."""
        return self.kind.text(self.parameters) if self.kind and self.parameters else ""


def gains_of(stage: Stage, user_values: Mapping[str, Any], to: str | None = None) -> Gains:
    """Return the gains of a stage, and the parameters of the drive `to` if one is named.

    `user_values` are the user's answers to what the drive needs besides. Raises InputError for a controller that the
    drive does not have, for an answer that nothing asks for, and for all missing answers together.
    """
    flat = stage.flat()
    answers = Ask({**_told(stage, flat), **user_values})
    kind = None if to is None else FORMATS[FORMATS.checked(to, "--to", "--to {}")]
    askable = {TRAVEL, MOTOR_CONSTANT}
    if kind is not None:
        askable |= {question.key for question in _asked(kind, flat, {}).open}
    for key in user_values:
        if key not in askable:
            raise InputError("--set", quoted(key), f"a key of the stage, or one of {', '.join(sorted(askable))}")
    rows = conversions(flat, answers, stage.axis_kind.exerts)
    if kind is None:
        return Gains(stage, loop_diagram(flat), rows)
    _asked(kind, flat, answers.texts).refuse_open(f"--to {to}")
    back = kind.parameters(flat, answers)
    return Gains(stage, loop_diagram(flat), rows, kind, back.values, _not_held(flat, back.held))


def _asked(kind: DriveFormat, flat: Mapping[str, Any], texts: Mapping[str, Any]) -> Ask:
    """Return what a drive asks for on the way back, whether or not it can hold the controller."""
    ask = Ask(texts)
    with suppress(InputError):
        kind.parameters(flat, ask)
    return ask


def output_of(stage: Stage, user_values: Mapping[str, Any]) -> tuple[str, float]:
    """Return the unit of a controller's output, and the output per newton of its force.

    It is amperes if the motor constant is known, else the unit of a drive's output if the stage has it, else newtons.
    Raises InputError for an answer that nothing asks for.
    """
    for key in user_values:
        if key not in (TRAVEL, MOTOR_CONSTANT):
            raise InputError("--set", quoted(key), f"a key of the stage, {TRAVEL} or {MOTOR_CONSTANT}")
    flat = stage.flat()
    answers = Ask({**_told(stage, flat), **user_values})
    if per_ampere := Turn.of(flat, answers, stage.axis_kind.exerts).per_ampere:
        return "A", 1 / per_ampere
    if of_output := flat.get("drive.force_per_output"):
        return DRIVE_OUTPUT, 1 / of_output
    return stage.axis_kind.unit("N"), 1.0


def _told(stage: Stage, flat: Mapping[str, Any]) -> dict[str, Any]:
    """Return the answers that `friso init --from` kept in the stage file.

    An uncertain answer counts by the centre of its range.
    """
    fields = stage.numeric_keys()
    kept = {name: flat[key] for name in CONVERSIONS if (key := f"drive.{name}") in flat}
    return {
        name: value if isinstance(value, str) else f"{value!r} {fields[f'drive.{name}'].unit}"
        for name, value in kept.items()
    }


def _not_held(flat: Mapping[str, Any], held: frozenset[str]) -> tuple[str, ...]:
    """Return the keys of [controller] that the parameters of a drive cannot hold.

    `held` are the names of the keys that the parameters hold. A filter counts once. Values of 0 and mere choices are
    left out.
    """
    before = f"{CONTROLLER}."
    names = [key.removeprefix(before) for key, value in flat.items() if key.startswith(before) and value]
    numbers = [name for name in names if name not in held and not isinstance(flat[before + name], str)]
    parts = [".".join(name.split(".")[:2]) for name in numbers]  # all keys of a filter count as the filter
    return tuple(dict.fromkeys(before + part for part in parts if part not in held))
