"""moteus configuration (moteus_tool --dump-config)

Torque = kp e + ki integral(e) + kd e', in N m per revolution of the output; the integral is limited to ilimit. The
output is the shaft behind motor_position.rotor_to_output_ratio.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from math import pi
from typing import Any

from friso.axis import LINEAR, axis_of
from friso.drives.conversions import TRAVEL, TRAVELS, kind_of_turn, open_turn, open_turn_back, travel_back
from friso.drives.format import AsStage, AxisParameters, FlatStage, ParameterFormat, Parameters
from friso.drives.pid_units import PidUnits, open_period
from friso.drives.questions import OpenQuestion, UserAnswers, of_the_machine
from friso.errors import InputError
from friso.quantities import quoted

PID = "servo.pid_position"
NAMES = {**{name: f"{PID}.{name}" for name in ("kp", "ki", "kd")}, "integral_limit": f"{PID}.ilimit"}
TURN = 'what one revolution of the output moves; an angle on a rotary axis, "360 deg" without more gears'
NO_LIMIT = "-1"
KNOWN = {*NAMES.values(), f"{PID}.sign", f"{PID}.iratelimit", f"{PID}.max_desired_rate"}

_LINE = re.compile(r"[ \t]*(?:conf set )?([a-z]\w*(?:\.\w+)+)[ \t]+(\S+)[ \t]*")


def recognises(name: str, text: str) -> bool:
    """Tell whether a text sets the proportional gain of a moteus."""
    return re.search(rf"^[ \t]*(?:conf set )?{re.escape(PID)}\.kp[ \t]", text, re.MULTILINE) is not None


def axes(text: str) -> tuple[AxisParameters, ...]:
    """Return the only axis of a moteus. Raises InputError for a line that sets nothing."""
    values = {}
    for number, line in enumerate(text.splitlines(), 1):
        if setting := _LINE.fullmatch(line):
            values[setting[1]] = setting[2]
        elif line.strip() and not line.lstrip().startswith("#"):
            raise InputError(f"line {number}", quoted(line.strip()), "a name and its value", f"{PID}.kp 4.0")
    return (AxisParameters("moteus", values),)


def questions(axis: AxisParameters, answers: UserAnswers) -> tuple[OpenQuestion, ...]:
    """List what the configuration leaves open: the machine, and what a revolution of the output moves."""
    period = open_period(answers, '"33.3 us"')
    return (*open_turn(answers, TURN, '"360 deg"'), *period, *of_the_machine(answers, kind_of_turn(answers)))


def _units(kind: Any, travel: float) -> PidUnits:
    """Return the units of a moteus whose output moves the load by `travel` [m or rad] per revolution."""
    return PidUnits(kind, 2 * pi / travel, travel)


def stage(axis: AxisParameters, answers: UserAnswers) -> AsStage:
    """Build the controller of an axis. Raises InputError for unusable numbers."""
    kind, travel = answers.kind_of(TRAVEL, TRAVELS)
    table = _units(kind, travel).table(axis, NAMES)
    left = ["the limit of the current: [controller] force_limit", "the filters of the encoders"]
    if axis.values.get(f"{PID}.iratelimit", NO_LIMIT) not in (NO_LIMIT, "-1.0"):
        left.append(f"iratelimit = {axis.values[f'{PID}.iratelimit']}, the largest rate of the integral")
    if (slip := str(axis.values.get("servo.max_position_slip", "nan"))) != "nan":
        left.append(f"max_position_slip = {slip}, beyond which the error counts no further")
    if strange := [name for name in axis.values if name.startswith(f"{PID}.") and name not in KNOWN]:
        left.append(f"{', '.join(strange)}: no published firmware documents them")
    tables: dict[str, Mapping[str, Any]] = {"controller": table}
    if kind != LINEAR:
        tables["axis"] = {"kind": kind.name}
    return AsStage(tables, tuple(left))


def questions_back(flat: FlatStage, answers: UserAnswers) -> tuple[OpenQuestion, ...]:
    """Ask what a revolution of the output moves; () if a transmission or an answer tells."""
    return tuple(open_turn_back(flat, answers, TURN))


def parameters(flat: FlatStage, answers: UserAnswers) -> Parameters:
    """Compute the parameters of a moteus. Raises InputError for a controller other than a PID by its gains."""
    return _units(axis_of(flat), travel_back(flat, answers)).parameters(flat, NAMES)


def text(settings: Mapping[str, float]) -> str:
    """Write parameters as lines of a configuration."""
    return "".join(f"{name} {value:.12g}\n" for name, value in settings.items())


FORMAT = ParameterFormat(
    title="moteus configuration",
    firmware="mjbots moteus",
    source="docs/reference.md of moteus, servo.pid_position",
    recognises=recognises,
    axes=axes,
    questions=questions,
    stage=stage,
    questions_back=questions_back,
    parameters=parameters,
    text=text,
    suffix=".cfg",
)
