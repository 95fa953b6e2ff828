"""ecmc axis (YAML, or IOC commands of a motor)

Position loop, every cycle of the bus: velocity = Kp e + I + Kd (e - e before) + Kff r', where I grows by Ki e a cycle
and both are limited alone. The drive's velocity loop has its gain in mA per rad/s and its integral time in 0.1 ms
(Beckhoff EL72xx); it stands in the commands that set the motor.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from math import pi
from typing import Any

from friso.axis import LINEAR, AxisKind
from friso.drives.conversions import TRAVEL, TRAVELS, kind_of_turn, open_turn, open_turn_back, travel_back
from friso.drives.format import AsStage, AxisParameters, FlatStage, ParameterFormat, Parameters, lacks, si
from friso.drives.questions import OpenQuestion, UserAnswers, of_the_machine
from friso.errors import InputError
from friso.quantities import Number, Quantity, positive, quoted

CYCLE, GAIN = "drive.position_sample_time", "controller.kp"
CURRENT, TIME, PER_AMPERE = "MOT_VELO_KP", "MOT_VELO_TI", "MOT_TRQ_CONST_MNM_P_A"
LIMIT = "MOT_I_MAX_MA"
TURN = "what one turn of the motor moves"

_YAML = re.compile(r"( *)([A-Za-z_]\w*):[ \t]*([^#\n]*?)[ \t]*(?:#.*)?")
_COMMAND = re.compile(r"[ \t]*epicsEnvSet\([ \t]*\"?(\w+)\"?[ \t]*,[ \t]*\"?([^\"),]*)\"?[ \t]*\)[ \t]*(?:#.*)?")


def recognises(name: str, text: str) -> bool:
    """Tell whether a text is the axis of an ecmc, or commands that set the velocity loop of its motor."""
    is_axis = re.search(r"^controller:", text, re.MULTILINE) and re.search(r"^[ \t]+Kp:", text, re.MULTILINE)
    return bool(is_axis) or f"epicsEnvSet({CURRENT}" in text.replace('"', "")


def axes(text: str) -> tuple[AxisParameters, ...]:
    """Return the only axis of a file. Raises InputError for a line that is neither YAML nor a command."""
    values: dict[str, Any] = {}
    above: list[tuple[int, str]] = []
    for number, line in enumerate(text.splitlines(), 1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        if command := _COMMAND.fullmatch(line):
            values[command[1]] = command[2].strip()
        elif entry := _YAML.fullmatch(line.rstrip()):
            above = [one for one in above if one[0] < len(entry[1])]
            values[".".join([*(name for _, name in above), entry[2]])] = entry[3].strip("\"'")
            above.append((len(entry[1]), entry[2]))
        elif not re.match(r"[ \t]*(?:-|<|\$|require|iocsh|ecmc|dbLoad|\w+\()", line):
            raise InputError(f"line {number}", quoted(line.strip()), "a key and its value", "Kp: 15.0")
    return (AxisParameters(f"axis {values.get('axis.id', '')}".strip(), values),)


def questions(axis: AxisParameters, answers: UserAnswers) -> tuple[OpenQuestion, ...]:
    """List what the file leaves open: the machine, and the loop that the other file has."""
    kind = kind_of_turn(answers)
    of_motor = CURRENT in axis.values
    asked = open_turn(answers, f"{TURN}; an angle on a rotary axis", '"10 mm"') if of_motor else []
    if of_motor and "controller.kv" not in answers:
        asked.append(OpenQuestion("controller.kv", "Kp of the axis's YAML file", '"15 1/s"'))
    if not of_motor and GAIN not in answers:
        gain = Quantity("N*s/m", positive, "500 N*s/m").on(kind).written_example
        what = "gain of the drive's velocity loop, whose integral time, if any, is controller.velocity_integral_time"
        asked.append(OpenQuestion(GAIN, what, gain))
    for key, what, example in (
        (CYCLE, "cycle of the bus, in which ecmc controls the position", '"1 ms"'),
        ("drive.sample_time", "period of the drive's velocity loop, of which that is a multiple", '"125 us"'),
    ):
        asked += [] if key in answers else [OpenQuestion(key, what, example)]
    return (*asked, *of_the_machine(answers, kind))


def stage(axis: AxisParameters, answers: UserAnswers) -> AsStage:
    """Build the controller of an axis. Raises InputError for unusable numbers, and for a derivative gain."""
    left = ["what ecmc's own limits of the output do: they clip it, and its integral goes on"]
    table: dict[str, Any] = {"kind": "cascade"}
    kind: AxisKind = LINEAR
    if CURRENT in axis.values:
        kind, travel = answers.kind_of(TRAVEL, TRAVELS)
        force = 2 * pi / travel  # [N] for a torque of 1 N m
        per_ampere = axis.number(PER_AMPERE) * 1e-3 * force
        table["kp"] = si(axis.number(CURRENT) * 1e-3 * per_ampere * force, kind.unit("N*s/m"))
        if axis.is_set(TIME):
            table["velocity_integral_time"] = si(axis.number(TIME) * 1e-4, "s")
        if axis.is_set(LIMIT):
            table["force_limit"] = si(axis.number(LIMIT) * 1e-3 * per_ampere, kind.unit("N"))
    else:
        kp, ki = axis.number("controller.Kp"), axis.number("controller.Ki", 0.0)
        if axis.is_set(name := "controller.Kd"):
            raise InputError(name, f"{axis.number(name):g}", "0: friso's cascade has no derivative", "Kd: 0")
        if kp <= 0 or ki < 0:
            raise InputError("controller.Kp", f"{kp:g}", "a gain greater than 0, and Ki of 0 or more", "Kp: 15")
        table["kv"] = si(kp, "1/s")
        table["velocity_feedforward"] = axis.number("controller.Kff", 1.0)
        if ki:
            table["position_integral_time"] = si(kp * answers.value(CYCLE, Quantity("s", positive, "1 ms")) / ki, "s")
        for name, what in (("deadband.tol", "a dead band with a time"), ("inner.tol", "gains of its own within")):
            if axis.is_set(f"controller.{name}"):
                left.append(f"controller {name} = {axis.number(f'controller.{name}'):g}: {what} this error")
    tables: dict[str, Mapping[str, Any]] = {"controller": table}
    if kind != LINEAR:
        tables["axis"] = {"kind": kind.name}
    return AsStage(tables, tuple(left))


def questions_back(flat: FlatStage, answers: UserAnswers) -> tuple[OpenQuestion, ...]:
    """Ask what a turn of the motor moves, and for its constant; () if a transmission or answers tell."""
    ampere = OpenQuestion(PER_AMPERE.lower(), "torque constant of the motor in mN m/A", "96")
    return (*open_turn_back(flat, answers, TURN), *([] if ampere.key in answers else [ampere]))


def parameters(flat: FlatStage, answers: UserAnswers) -> Parameters:
    """Compute the gains of both loops. Raises InputError for a controller other than a cascade."""
    if flat["controller.kind"] != "cascade":
        raise lacks(f'kind = "{flat["controller.kind"]}"', "a cascade, the only structure of ecmc and its drive")
    constant = answers.value(PER_AMPERE.lower(), Number(positive, "96"))
    force = 2 * pi / travel_back(flat, answers)
    kv, integral = flat["controller.kv"], flat.get("controller.position_integral_time")
    cycle = flat.get(CYCLE, flat.get("drive.sample_time", 0.0))
    values = {"Kp": kv, "Ki": kv * cycle / integral if integral else 0.0}
    values["Kff"] = flat["controller.velocity_feedforward"]
    values[CURRENT] = flat[GAIN] / force**2 / (constant * 1e-3) * 1e3
    if (time := flat.get("controller.velocity_integral_time")) is not None:
        values[TIME] = time * 1e4
    held = {"kv", "kp", "position_integral_time", "velocity_integral_time", "velocity_feedforward"}
    return Parameters(values, frozenset(held))


def text(settings: Mapping[str, float]) -> str:
    """Write the position loop as YAML, and the drive's loop as comments below it."""
    own = [f"  {name}: {value:.12g}" for name, value in settings.items() if not name.startswith("MOT_")]
    motor = [f"# epicsEnvSet({name},{value:.12g})" for name, value in settings.items() if name.startswith("MOT_")]
    return "\n".join(["controller:", *own, *motor, ""])


FORMAT = ParameterFormat(
    title="ecmc axis",
    firmware="ecmc's position loop and Beckhoff EL72xx",
    source="ecmcPIDController.cpp of epics-modules/ecmc",
    recognises=recognises,
    axes=axes,
    questions=questions,
    stage=stage,
    questions_back=questions_back,
    parameters=parameters,
    text=text,
    suffix=".yaml",
)
