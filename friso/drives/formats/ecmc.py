"""ecmc axis (YAML, or IOC commands of a motor)

Position loop, every cycle of the bus: velocity = Kp e + I + Kd (e - e before) + Kff r', where I grows by Ki e a cycle
and both are limited alone. Within inner.tol of the target other gains act; when the error has stayed within
deadband.tol at the target, the command is 0 and I is emptied. The drive's velocity loop goes on meanwhile. It has its
gain in mA per rad/s and its integral time in 0.1 ms (Beckhoff EL72xx), in the commands that set the motor.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from math import pi
from typing import Any

from friso.axis import LINEAR, AxisKind
from friso.drives.conversions import TRAVEL, TRAVELS, kind_of_turn, open_turn, open_turn_back, travel_back
from friso.drives.format import AsStage, AxisParameters, FlatStage, ParameterFormat, Parameters, lacks, si
from friso.drives.pid_units import LENGTH, kind_of_length, open_length
from friso.drives.questions import OpenQuestion, UserAnswers, of_the_machine
from friso.errors import InputError
from friso.quantities import Number, Quantity, positive, quoted

CYCLE, GAIN = "drive.position_sample_time", "controller.kp"
UNIT = "a position of 1 of the axis"
DEAD_BAND, DEAD_TIME, INNER = "controller.deadband.tol", "controller.deadband.time", "controller.inner.tol"
TARGET, MONITORED, SWITCHED = "monitoring.target", "target_monitoring", ("on", "off")
"""Place of the tolerance at the target, and the answer on whether it is watched; only then a dead band acts."""

IN_LOOP = {"windows_in_position_loop": True, "windows_at_rest": True}
CURRENT, TIME, PER_AMPERE = "MOT_VELO_KP", "MOT_VELO_TI", "MOT_TRQ_CONST_MNM_P_A"
LIMIT = "MOT_I_MAX_MA"
TURN = "what one turn of the motor moves"

_YAML = re.compile(r"( *)([A-Za-z_]\w*):([^#\n]*)(?:#.*)?")
_COMMAND = re.compile(r"[ \t]*epicsEnvSet\([ \t]*\"?(\w+)\"?[ \t]*,[ \t]*+\"?([^\"),]*+)\"?[ \t]*\)[ \t]*(?:#.*)?")


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
            values[".".join([*(name for _, name in above), entry[2]])] = entry[3].strip().strip("\"'")
            above.append((len(entry[1]), entry[2]))
        elif not re.match(r"[ \t]*(?:-|<|\$|require|iocsh|ecmc|dbLoad|\w+\()", line):
            raise InputError(f"line {number}", quoted(line.strip()), "a key and its value", "Kp: 15.0")
    return (AxisParameters(f"axis {values.get('axis.id', '')}".strip(), values),)


def questions(axis: AxisParameters, answers: UserAnswers) -> tuple[OpenQuestion, ...]:
    """List what the file leaves open: the machine, and the loop that the other file has."""
    kind = kind_of_length(answers)[0] if LENGTH in answers else kind_of_turn(answers)
    of_motor = CURRENT in axis.values
    asked = open_turn(answers, f"{TURN}; an angle on a rotary axis", '"10 mm"') if of_motor else []
    if of_motor and "controller.kv" not in answers:
        asked.append(OpenQuestion("controller.kv", "Kp of the axis's YAML file", '"15 1/s"'))
    if not of_motor and GAIN not in answers:
        gain = Quantity("N*s/m", positive, "500 N*s/m").on(kind).written_example
        what = "gain of the drive's velocity loop, whose integral time, if any, is controller.velocity_integral_time"
        asked.append(OpenQuestion(GAIN, what, gain))
    if not of_motor and (_dead_band(axis) or axis.is_set(INNER)):
        asked += open_length(answers, UNIT, '"1 mm"')
    if not of_motor and _dead_band(axis) and _watched(axis) is None and MONITORED not in answers:
        what = f"whether the axis watches its target ({TARGET}.enabled): only then its dead band acts"
        asked.append(OpenQuestion(MONITORED, what, SWITCHED[0]))
    for key, what, example in (
        (CYCLE, "cycle of the bus, in which ecmc controls the position", '"1 ms"'),
        ("drive.sample_time", "period of the drive's velocity loop, of which that is a multiple", '"125 us"'),
    ):
        asked += [] if key in answers else [OpenQuestion(key, what, example)]
    return (*asked, *of_the_machine(answers, kind))


def _dead_band(axis: AxisParameters) -> str:
    """Return the name of the tolerance of the dead band, which is that of the target if it has no own; "" for none."""
    return next((name for name in (DEAD_BAND, f"{TARGET}.tolerance") if axis.is_set(name)), "")


def _watched(axis: AxisParameters) -> bool | None:
    """Tell whether the axis watches its target; None if the file does not say."""
    words = {"true": True, "yes": True, "on": True, "1": True, "false": False, "no": False, "off": False, "0": False}
    return words.get(str(axis.values.get(f"{TARGET}.enabled", "")).lower())


def _windows(axis: AxisParameters, answers: UserAnswers) -> tuple[AxisKind, dict[str, Any], list[str]]:
    """Return the kind of axis, the settings of its position loop near the target, and sentences on what is left out."""
    name, inner = _dead_band(axis), axis.is_set(INNER)
    if not name and not inner:
        return LINEAR, {}, []
    (kind, unit), table, left = kind_of_length(answers), dict[str, Any](), []
    cycle = answers.value(CYCLE, Quantity("s", positive, "1 ms"))
    watched = _watched(axis)
    if name and (answers.choice(MONITORED, SWITCHED) == SWITCHED[0] if watched is None else watched):
        table["freeze_window"] = si(axis.number(name) * unit, kind.unit("m"))
        time = DEAD_TIME if name == DEAD_BAND else f"{TARGET}.time"
        if axis.is_set(time):
            table["freeze_window_time"] = si(axis.number(time) * cycle, "s")
    elif name == DEAD_BAND:
        left.append(f"{name} = {axis.number(name):g}: it does not act, as the axis does not watch its target")
    if inner:
        gains = {part: (axis.number(f"controller.inner.{part}", 0.0), axis.number(f"controller.{part}", 0.0))
                 for part in ("Kp", "Ki", "Kd")}  # fmt: skip
        if gains["Kp"][0] > 0 and gains["Kd"][0] == 0 and (gains["Ki"][1] > 0 or gains["Ki"][0] == 0):
            table["standstill_window"] = si(axis.number(INNER) * unit, kind.unit("m"))
            table["standstill_factor"] = gains["Kp"][0] / gains["Kp"][1]
            if gains["Ki"][1]:
                table["standstill_integral_factor"] = gains["Ki"][0] / gains["Ki"][1]
            left.append("inner gains in the last part of a move, within inner.tol of its end: here they act at rest")
        else:
            left.append(
                f"{INNER} = {axis.number(INNER):g}: gains of 0, of a derivative, or of an integral that the axis has "
                "not elsewhere, and friso's results for swings that small do not hold for this axis"
            )
    return kind, {**table, **(IN_LOOP if table else {})}, left


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
        kind, windows, unheld = _windows(axis, answers)
        table |= windows
        left += unheld
    tables: dict[str, Mapping[str, Any]] = {"controller": table}
    if kind != LINEAR:
        tables["axis"] = {"kind": kind.name}
    return AsStage(tables, tuple(left))


def questions_back(flat: FlatStage, answers: UserAnswers) -> tuple[OpenQuestion, ...]:
    """Ask what a turn of the motor moves, and for its constant; () if a transmission or answers tell."""
    ampere = OpenQuestion(PER_AMPERE.lower(), "torque constant of the motor in mN m/A", "96")
    unit = open_length(answers, UNIT, '"1 mm"') if _held_windows(flat) else []
    return (*open_turn_back(flat, answers, TURN), *([] if ampere.key in answers else [ampere]), *unit)


def _held_windows(flat: FlatStage) -> list[str]:
    """Return the windows of the stage's position loop that an axis of ecmc can have."""
    if not flat.get("controller.windows_in_position_loop"):
        return []
    windows = [name for name in ("freeze_window", "standstill_window") if f"controller.{name}" in flat]
    alone = {"freeze_window": "controller.freeze_window_exit", "standstill_window": "controller.standstill_window_time"}
    also = "controller.standstill_window_exit"
    return [name for name in windows if alone[name] not in flat and not (name[0] == "s" and also in flat)]


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
    windows = _held_windows(flat)
    held |= {*windows, *(IN_LOOP if windows else ())}
    if "freeze_window" in windows:
        values["deadband.tol"] = flat["controller.freeze_window"] / kind_of_length(answers)[1]
        values["deadband.time"] = round(flat.get("controller.freeze_window_time", 0.0) / cycle)
        held.add("freeze_window_time")
    if "standstill_window" in windows:
        factor = flat["controller.standstill_factor"]
        own = flat.get("controller.standstill_integral_factor", factor)
        values |= {"inner.Kp": factor * values["Kp"], "inner.Ki": own * values["Ki"]}
        values["inner.tol"] = flat["controller.standstill_window"] / kind_of_length(answers)[1]
        held |= {"standstill_factor", "standstill_integral_factor"}
    return Parameters(values, frozenset(held))


def text(settings: Mapping[str, float]) -> str:
    """Write the position loop as YAML, and the drive's loop as comments below it."""
    own: list[str] = []
    for name, value in settings.items():
        part, _, inside = name.rpartition(".")
        if part and f"  {part}:" not in own:
            own.append(f"  {part}:")
        if not name.startswith("MOT_"):
            own.append(f"  {'  ' * bool(part)}{inside}: {value:.12g}")
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
