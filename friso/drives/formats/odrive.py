"""ODrive configuration (odrivetool backup-config)

Firmware 0.5.1 to 0.6, control in position: w = v_ff + pos_gain e; torque = inertia a_ff + vel_gain (w - v) +
vel_integrator_gain sum(w - v) T, turns for positions, 8000 times a second. v is the estimate of the encoder's
phase-locked loop, which has a double pole at its bandwidth. Gain scheduling multiplies vel_gain and vel_integrator_gain
by the error over its width, within it; how a least ratio (0.6) bounds that is asked for. Firmware 0.6 has other names
for the motor, the encoder and the limit of the torque, and is read under those of 0.5. Firmware up to 0.4 counts in
encoder counts and amperes.
"""

from __future__ import annotations

import json
import re
from math import inf, isclose, pi
from typing import Any

from friso.drives.ask import Ask
from friso.drives.drive import (
    AsStage,
    AxisParameters,
    CascadeDrive,
    DriveUnits,
    FlatStage,
    ParameterRow,
    Parameters,
    lacks,
    number_in,
    si,
    there_and_back,
    torque,
)
from friso.errors import InputError
from friso.quantities import quoted
from friso.stage.controllers import FEEDBACK, FILTERS_KEY
from friso.stage.section import element_keys, row_keys

CONFIG, MOTOR, ENCODER, MOVE = "controller.config", "motor.config", "encoder.config", "trap_traj.config"
LIMITS_OF_MOVES = f"{MOVE}.vel_limit", f"{MOVE}.accel_limit"
SAMPLE_RATE = 8000.0
"""Samples of the controller per second, in ODrive 3."""

INERTIA = f"{CONFIG}.inertia"
SCHEDULED = f"{CONFIG}.enable_gain_scheduling"
SCHEDULE_WIDTH, LEAST_RATIO = f"{CONFIG}.gain_scheduling_width", f"{CONFIG}.gain_scheduling_min_ratio"
CONTROL_MODES = ("VOLTAGE_CONTROL", "TORQUE_CONTROL", "VELOCITY_CONTROL", "POSITION_CONTROL")
POSITION_CONTROL = CONTROL_MODES.index("POSITION_CONTROL")
"""Value of control_mode for position control, an index of `CONTROL_MODES`."""

INPUT_MODES = (
    *("INACTIVE", "PASSTHROUGH", "VEL_RAMP", "POS_FILTER", "MIX_CHANNELS"),
    *("TRAP_TRAJ", "TORQUE_RAMP", "MIRROR", "TUNING"),
)
PASSTHROUGH, POSITION_FILTER, TRAJECTORY = map(INPUT_MODES.index, ("PASSTHROUGH", "POS_FILTER", "TRAP_TRAJ"))
AHEAD = (POSITION_FILTER, TRAJECTORY)
"""Values of input_mode in which the drive feeds its own reference forward."""


def _symbols(modes: tuple[str, ...], *before: str) -> dict[str, float]:
    """Return numbers by symbol, as Python scripts write them: `before` plus the name of a mode.

    The number of a mode is its place in `modes`.
    """
    return {f"{start}{name}": number for start in before for number, name in enumerate(modes)}


SYMBOLS = {
    "control_mode": _symbols(CONTROL_MODES, "CONTROL_MODE_", "ControlMode.", "CTRL_MODE_"),
    "input_mode": _symbols(INPUT_MODES, "INPUT_MODE_", "InputMode."),
}

MOST_KEYS, LONGEST_KEY = 100_000, 200

_OTHERS = """
pos_gain vel_gain vel_integrator_gain
control_mode input_mode vel_limit vel_limit_tolerance vel_ramp_rate torque_ramp_rate circular_setpoints
circular_setpoint_range steps_per_circular_range homing_speed inertia axis_to_mirror mirror_ratio
torque_mirror_ratio load_encoder_axis input_filter_bandwidth enable_vel_limit enable_current_mode_vel_limit
enable_torque_mode_vel_limit enable_gain_scheduling gain_scheduling_width gain_scheduling_min_ratio
enable_overspeed_error absolute_setpoints
vel_integrator_limit mechanical_power_bandwidth electrical_power_bandwidth spinout_mechanical_power_threshold
spinout_electrical_power_threshold anticogging
"""
KNOWN = frozenset(_OTHERS.split())
"""Names in controller.config of the supported firmwares."""

_LINE = re.compile(r"[ \t]*(odrv[0-9]{1,3})\.([\w.]{1,200})[ \t]*=(?!=)((?:(?!//)[^#])*+)(?:[#/].*)?")
"""Pattern of a line for odrivetool that sets a parameter; a comment after it is ignored."""

_OTHER_LINE = re.compile(
    r"[ \t]*+(?:$|#|import |from |odrv[0-9]{1,3}(?:[ \t]*=[ \t]*odrive\.\w+|(?:\.\w+)+)\([^()#]*\)[ \t]*(?:#|//|$)"
    r"|(?=[^_=]*$)[^\w]*\w+(?:[^\w]+[^\W\d]\w*){2})"
)
"""Pattern of a line that sets no parameter.

It is empty, a comment, an import, a call such as odrv0.save_configuration(), or a sentence of notes: three words or
more, without an equals sign or a name of several parts."""

_OF_AXIS = re.compile(r"(?:(odrv[0-9]+)\.)?(axis[0-9]+)\.(.*)")
"""Pattern of the place of a parameter: drive, axis, and name."""

_MODULE = re.compile(r"^(?:odrive\.)?enums\.")

IN_TURNS = "motor.config.torque_constant"
"""Parameter whose presence shows that the gains are in turns and N m."""

OLD = frozenset({"setpoints_in_cpr", "A_per_css", "counts_per_step", "current_ramp_rate", "CTRL_MODE"})
NEW = frozenset({"torque_lim", "torque_ramp_rate", "turns_per_step", "input_mode", "CONTROL_MODE", "ControlMode"})
"""Names that occur only in firmware up to 0.4 (`OLD`), and from 0.5 on (`NEW`).

Firmware up to 0.4 has gains in counts; 0.5 has gains in turns."""

MOVED = {
    "config.motor.torque_constant": "motor.config.torque_constant",
    "config.motor.current_soft_max": "motor.config.current_lim",
    "config.motor.current_control_bandwidth": "motor.config.current_control_bandwidth",
    "config.torque_soft_max": "motor.config.torque_lim",
    "config.encoder_bandwidth": "encoder.config.bandwidth",
}
"""Names of firmware 0.6, and those of 0.5 for the same parameters."""

FASTEST_MOTOR = 1000.0
"""Speed in turns per second beyond any motor. A higher limit must be in counts."""

TURNS_EXPECTED = "firmware whose gains are in turns and N m: 0.5.1 to 0.6"
IN_TURNS_INSTEAD = (
    f"vel_gain and vel_integrator_gain times {IN_TURNS} and cpr, vel_limit through cpr (ODrive's migration guide)"
)


def _settings(text: str) -> dict[str, Any]:
    """Read the parameters that lines for odrivetool set; the last of equal names counts.

    Values are numbers, arithmetic, true, false, or texts. Raises InputError for a line that odrivetool would not
    take.
    """
    values: dict[str, Any] = {}
    lines = text.splitlines()
    if len(lines) > MOST_KEYS:
        raise InputError("", f"{len(lines)} lines", f"at most {MOST_KEYS}")
    for number, line in enumerate(lines, 1):
        if setting := _LINE.fullmatch(line):
            drive, key, written = setting[1], setting[2], setting[3].strip()
            value = {"True": True, "False": False}.get(written, number_in(written))
            values[f"{drive}.{key}"] = _MODULE.sub("", written) if value is None else value
        elif not _OTHER_LINE.match(line):
            expected = "lines that set one parameter each; behind a # what is none"
            raise InputError(f"line {number}", quoted(line.strip()), expected, f"odrv0.axis0.{CONFIG}.vel_gain = 0.16")
    return values


def _refuse_other_firmware(axis: AxisParameters) -> None:
    """Raise InputError for firmware up to 0.4, whose gains are in counts."""
    if IN_TURNS in axis.values:
        return
    if name := _sign_of(axis, OLD) or _fastest(axis):
        raise _in_counts(name, str(axis.values[name]))


def _in_counts(name: str, value: str) -> InputError:
    """Build the error for gains that are in encoder counts."""
    actual = f"{quoted(value)}, as in firmware up to 0.4, whose gains are in counts of the encoder and amperes"
    return InputError(name, actual, TURNS_EXPECTED, IN_TURNS_INSTEAD)


def _sign_of(axis: AxisParameters, names: frozenset[str]) -> str:
    """Return the first parameter that only some versions of the firmware have; "" if none.

    Its name, or the symbol that is its value, is among `names`.
    """
    for key, value in axis.values.items():
        symbol = re.match("CTRL_MODE|CONTROL_MODE|ControlMode", value) if isinstance(value, str) else None
        if names & {key.rpartition(".")[2], ".".join(key.split(".")[:2]), symbol[0] if symbol else ""}:
            return key
    return ""


def _fastest(axis: AxisParameters) -> str:
    """Return the name of a velocity limit too high to be in turns per second; "" if none is."""
    limits = (f"{place}.vel_limit" for place in (CONFIG, MOVE))
    return next((key for key in limits if axis.is_set(key) and axis.number(key) > FASTEST_MOTOR), "")


def _entries(text: str) -> dict[str, Any]:
    """Return the entries of a JSON document by their places.

    Raises InputError for a text that is no JSON.
    """
    try:
        document = json.loads(text)
    except RecursionError:
        raise InputError("", "objects nested too deeply", "a configuration as odrivetool writes it") from None
    except ValueError as error:
        raise InputError("", f"not JSON: {str(error)[:120]}", "a configuration as odrivetool writes it") from None
    values: dict[str, Any] = {}
    waiting: list[tuple[str, Any]] = [("", document)]
    while waiting:
        place, entry = waiting.pop()
        if len(place) > LONGEST_KEY:
            raise InputError("", f"a key of {len(place)} characters", "a configuration as odrivetool writes it")
        if isinstance(entry, dict):
            waiting += [(f"{place}.{key}" if place else str(key), inner) for key, inner in entry.items()]
        else:
            values[place] = entry
        if len(values) + len(waiting) > MOST_KEYS:
            raise InputError("", f"more than {MOST_KEYS} entries", "a configuration as odrivetool writes it")
    return values


def _mode(axis: AxisParameters, name: str, default: float) -> float:
    """Return the number of a mode `name`, which the file may also give by a symbol.

    An absent mode has the number `default`.
    """
    return axis.number(f"{CONFIG}.{name}", default, SYMBOLS[name])


def _torque_limit(axis: AxisParameters) -> float:
    """Return the largest torque of the motor [N m], from its torque and current limits."""
    largest = axis.number(f"{MOTOR}.torque_lim") if axis.is_set(f"{MOTOR}.torque_lim") else inf
    if not axis.is_set(f"{MOTOR}.current_lim"):
        return largest
    return min(axis.number(f"{MOTOR}.current_lim") * axis.number(IN_TURNS), largest)


LEAST_GAIN_RATIO = 0.01
"""Least ratio of scheduled gains in a stage whose drive lets them fall to 0: a loop needs some gain."""


def _left_out(axis: AxisParameters, mode: float, limited: bool) -> tuple[str, ...]:
    """List in sentences the settings of the axis that a stage cannot describe.

    `mode` is the number of the axis's input mode. `limited` is true if the stage has a force limit.
    """
    left = ["the position is the estimate of a phase-locked loop too, which follows a steady motion without an error"]
    if IN_TURNS not in axis.values:
        unknown = f"the firmware, which no {IN_TURNS} tells"
        left.append(f"{unknown}: gains in turns and N m are assumed, as 0.5.1 and later have")
    if axis.flag(SCHEDULED) and axis.is_set(SCHEDULE_WIDTH) and not axis.is_set(LEAST_RATIO):
        least = f"{LEAST_GAIN_RATIO:g}"
        left.append(f"gains that fall to 0 with the error: here they stay at {least} of theirs, or more")
    if axis.flag(f"{CONFIG}.enable_vel_limit", True) and axis.is_set(f"{CONFIG}.vel_limit"):
        left.append(f"vel_limit = {axis.number(f'{CONFIG}.vel_limit'):g} turn/s, the largest velocity commanded")
    if mode == PASSTHROUGH:
        left.append("input_vel and input_torque of the position source: taken as 0")
    elif mode == POSITION_FILTER:
        left.append("the filter of the commanded position (input_filter_bandwidth)")
    elif mode != TRAJECTORY:
        how = "how the drive comes to its position; none of its feedforward is taken over"
        left.append(f"input_mode = {mode:g}: {how}")
    accelerates, brakes = (axis.number(f"{MOVE}.{name}", 0.0) for name in ("accel_limit", "decel_limit"))
    if accelerates and brakes and accelerates != brakes:
        left.append(f"decel_limit = {brakes:g} turn/s^2: friso's move brakes as it accelerates")
    if limited:
        left.append("at the limit of the torque the integral decays by 1 % a sample; here it rests")
    own = float(axis.name.rpartition("axis")[2])
    if (load := axis.number(f"{CONFIG}.load_encoder_axis", own)) != own:
        left.append(
            f"load_encoder_axis = {load:g}: position and velocity come from that axis's encoder; where it is "
            "behind a screw or belt, [transmission] and [encoder] have to be added"
        )
    settings = (key.removeprefix(f"{CONFIG}.") for key in axis.values if key.startswith(f"{CONFIG}."))
    names = dict.fromkeys(key.split(".")[0] for key in settings)
    if strange := [name for name in names if name not in KNOWN]:
        left.append(f"{', '.join(strange)}: these firmwares have no such setting")
    if axis.flag(f"{CONFIG}.anticogging.anticogging_enabled"):
        left.append("the map against cogging")
    return tuple(left)


def _loop_of_velocity(flat: FlatStage) -> str:
    """Return the velocity filter that a phase-locked loop can stand for; "" without one."""
    places = [place for place in row_keys(flat, FILTERS_KEY) if flat[f"{place}.path"] == FEEDBACK]
    if len(places) != 1 or flat[f"{places[0]}.kind"] != "low_pass":
        return ""
    (place,) = places
    return place if flat[f"{place}.order"] == 2 and flat[f"{place}.damping_ratio"] == 1.0 else ""


class Odrive(CascadeDrive):
    """Turns and N m, 8000 times a second, in position control."""

    title, suffix = "ODrive configuration (odrivetool backup-config)", ".txt"
    firmware, source = "ODrive 0.5.1 to 0.6", "Firmware/MotorControl/controller.cpp and encoder.cpp"
    pattern = r"^[ \t]*odrv[0-9]{1,3}\.axis[0-9]{1,3}\.[\w.]{1,180}[ \t]*=(?!=)"
    rows = (
        ParameterRow(f"{CONFIG}.pos_gain", "kv", "1/s", (0, 0, -1)),
        ParameterRow(f"{CONFIG}.vel_gain", "kp", "N*s/m", (1, -1, 1)),
        ParameterRow(f"{CONFIG}.vel_integrator_limit", "integral_limit", "N", (1, 0, 0)),
        ParameterRow(f"{MOTOR}.torque_lim", "force_limit", "N", (1, 0, 0)),
    )
    line = "odrv0.axis0.{} = {:.12g}\n"

    def recognises(self, text: str) -> bool:
        """Tell whether the file is JSON with the gains of an axis, or has lines for odrivetool."""
        in_json = text.lstrip().startswith("{") and '"axis' in text and "vel_integrator_gain" in text
        return in_json or super().recognises(text)

    def axes(self, text: str) -> tuple[AxisParameters, ...]:
        """Return the axes that have gains.

        Raises InputError for a text that is neither JSON nor lines for odrivetool, and for firmware with other units or
        names.
        """
        in_lines = not text.lstrip().startswith("{")
        held: dict[tuple[str, str], dict[str, Any]] = {}
        for key, value in (_settings(text) if in_lines else _entries(text)).items():
            if place := _OF_AXIS.fullmatch(key):
                held.setdefault((place[1] or "", place[2]), {})[MOVED.get(place[3], place[3])] = value
        several = len({drive for drive, _ in held}) > 1
        axes = tuple(
            AxisParameters(f"{drive}.{name}" if several else name, held[drive, name])
            for drive, name in sorted(held)
            if f"{CONFIG}.pos_gain" in held[drive, name]
        )
        if not axes:
            raise InputError("", "no axis with a controller.config.pos_gain", "a configuration as odrivetool writes it")
        for axis in axes:
            _refuse_other_firmware(axis)
            if IN_TURNS not in axis.values and not in_lines:
                actual = f"{axis.name} without a {IN_TURNS}, which firmware from 0.5.1 on has"
                raise InputError("", actual, TURNS_EXPECTED)
        return axes

    def _turn(self, ask: Ask, flat: FlatStage) -> DriveUnits:
        """Return N m and turns of the motor."""
        what = "what one turn of the motor moves"
        more = "" if flat else '; an angle on a rotary axis, "360 deg" without a gear'
        return torque(*ask.turn(f"{what}{more}", '"10 mm"', flat))

    def _line(self, ask: Ask) -> bool:
        """Tell whether gains fall on a line to their least ratio, as the user answers; else they are clipped at it."""
        what = "gains within the width: clipped, as the error down to min_ratio, or line, to min_ratio at no error"
        return ask("gain_schedule", what, "clipped", ("clipped", "line")) == "line"

    def stage(self, axis: AxisParameters, ask: Ask) -> AsStage:
        """Turn an axis and the answers into a stage. Raises InputError for what friso cannot describe."""
        control = _mode(axis, "control_mode", POSITION_CONTROL)
        if control != POSITION_CONTROL:
            raise InputError(f"{CONFIG}.control_mode", f"{control:g}", "3, control in position", '"control_mode": 3')
        if IN_TURNS not in axis.values and not _sign_of(axis, NEW):
            what = "that gains are in turns and N m, as firmware 0.5 has them; up to 0.4 they are in counts and A"
            if ask("gains_in", what, "turns", ("turns", "counts")) == "counts":
                raise _in_counts("gains_in", "counts")
        units = self._turn(ask, {})
        schedule = self._schedule(axis, ask, units)
        for row in self.rows[:2]:
            if (gain := axis.number(row.name)) <= 0:
                name = row.name.rpartition(".")[2]
                raise InputError(row.name, f"{gain:g}", "a gain greater than 0", f'"{name}": 20.0')
        table: dict[str, Any] = {"kind": "cascade", **self.keys(axis, units), **schedule}
        if (ki := axis.number(f"{CONFIG}.vel_integrator_gain")) > 0:
            table["velocity_integral_time"] = si(axis.number(f"{CONFIG}.vel_gain") / ki, "s")
        else:
            table.pop("integral_limit", None)
        mode = _mode(axis, "input_mode", PASSTHROUGH)
        if mode in AHEAD:
            table["velocity_feedforward"] = 1.0
            if inertia := axis.number(INERTIA, 0.0):
                table["acceleration_feedforward"] = si(inertia * units.force / units.length, units.kind.unit("kg"))
        if (limit := _torque_limit(axis)) < inf:
            table |= {"force_limit": si(limit * units.force, units.kind.unit("N")), "anti_windup": "clamp"}
        low_pass = {"kind": "low_pass", "path": "feedback", "order": 2, "damping_ratio": 1.0}
        bandwidth = axis.number(f"{ENCODER}.bandwidth", 1000.0) / (2 * pi)
        table["filters"] = [{**low_pass, "frequency": si(bandwidth, "Hz")}]
        drive = {"sample_time": si(1 / SAMPLE_RATE, "s")}
        if axis.is_set(name := f"{MOTOR}.current_control_bandwidth"):
            drive["current_bandwidth"] = si(axis.number(name) / (2 * pi), "Hz")
        motion = there_and_back(axis, LIMITS_OF_MOVES, units.length, units.kind)
        left = _left_out(axis, mode, limit < inf)
        return self.as_stage(ask, axis, units.kind, left, controller=table, drive=drive, motion=motion)

    def _schedule(self, axis: AxisParameters, ask: Ask, units: DriveUnits) -> dict[str, Any]:
        """Return the schedule of gains over the error; empty without one.

        Raises InputError for a least ratio that is not below 1.
        """
        if not axis.flag(SCHEDULED) or not axis.is_set(SCHEDULE_WIDTH):
            return {}
        line = axis.is_set(LEAST_RATIO) and self._line(ask)
        turns, least = axis.number(SCHEDULE_WIDTH), axis.number(LEAST_RATIO, 0.0)
        if turns <= 0 or not 0 <= least < 1:
            actual = f"{turns:g} turns and a least ratio of {least:g}"
            raise InputError(SCHEDULE_WIDTH, actual, "a width above 0, and a ratio from 0 to below 1", "0.01")
        least = least or LEAST_GAIN_RATIO
        width, unit = turns * units.length, units.kind.unit("m")
        places = [si(0.0 if line else least * width, unit), si(width, unit)]
        return {"schedule_error": places, "schedule_factor": [least, 1.0]}

    def _schedule_back(self, flat: FlatStage, line: bool, units: DriveUnits) -> dict[str, float]:
        """Return the parameters of a stage's schedule of gains; empty if the drive cannot hold it."""
        places, factors = (
            [flat[at] for at in element_keys(flat, f"controller.schedule_{of}")] for of in ("error", "factor")
        )
        begins = 0.0 if line else factors[0] * places[-1]
        if len(places) != 2 or factors[1] != 1 or not isclose(places[0], begins, rel_tol=1e-6):
            return {}
        return {SCHEDULED: 1.0, SCHEDULE_WIDTH: places[1] / units.length, LEAST_RATIO: factors[0]}

    def parameters(self, flat: FlatStage, ask: Ask) -> Parameters:
        """Compute the parameters of an axis.

        Raises InputError for a controller other than a position loop with P over a velocity loop with P or PI.
        """
        units, scheduled = self._turn(ask, flat), "controller.schedule_error.1" in flat
        line = scheduled and self._line(ask)
        if flat["controller.kind"] != "cascade":
            raise lacks(f'kind = "{flat["controller.kind"]}"', "a cascade, the only structure that this drive has")
        if "controller.position_integral_time" in flat:
            raise lacks("an integral in the position loop", "a proportional position loop")
        if flat["controller.proportional_on"] != "error":
            raise lacks('proportional_on = "measurement"', 'proportional_on = "error"')
        ahead = flat["controller.velocity_feedforward"] == 1.0
        values = self.values(flat, units, optional=("integral_limit", "force_limit"))
        time = flat.get("controller.velocity_integral_time")
        kp = values[f"{CONFIG}.vel_gain"]
        held = {"kv", "kp", "velocity_integral_time", "force_limit", "integral_limit"}
        held |= {"velocity_feedforward", "acceleration_feedforward"} if ahead else set()
        settings = {f"{CONFIG}.input_mode": float(TRAJECTORY if ahead else PASSTHROUGH)}
        settings |= dict.fromkeys((row.name for row in self.rows[:2]), 0.0)
        settings[f"{CONFIG}.vel_integrator_gain"] = kp / time if time else 0.0
        if ahead:
            settings[INERTIA] = flat["controller.acceleration_feedforward"] * units.length / units.force
        settings |= values
        if (bandwidth := flat.get("drive.current_bandwidth")) is not None:
            settings[f"{MOTOR}.current_control_bandwidth"] = 2 * pi * bandwidth
        if scheduled and (schedule := self._schedule_back(flat, line, units)):
            settings |= schedule
            held |= {f"schedule_{of}.{number}" for of in ("error", "factor") for number in (1, 2)}
        if place := _loop_of_velocity(flat):
            settings[f"{ENCODER}.bandwidth"] = 2 * pi * flat[f"{place}.frequency"]
            held.add(place.removeprefix("controller."))
        return Parameters(settings, frozenset(held))
