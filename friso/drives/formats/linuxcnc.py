"""LinuxCNC INI file

The gains of a joint go to the HAL component `pid`: output = P e + I sum(e) T + D e' + FF0 r + FF1 r' + FF2 r'' + BIAS.
The error e is taken after MAX_ERROR and DEADBAND, and the output is limited to MAX_OUTPUT. At that limit the integral
rests while it would drive the output further. e' is r' - y', as in versions with the pins command-deriv and
feedback-deriv. Older versions differentiate the error after its deadband.

In torque mode the output is a force. In velocity mode it is a velocity, which the drive's own loop follows, in the unit
that the drive is scaled to. FF1 = 1 if that unit is machine units per second.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from math import isclose
from typing import Any, ClassVar

from friso.axis import LINEAR, ROTARY, AxisKind, axis_of
from friso.drives.ask import FORCE, FORCE_FIELD, GAIN_FIELD, Ask
from friso.drives.drive import (
    POSITION_TIME,
    SAMPLE_TIME,
    AsStage,
    AxisParameters,
    Beside,
    DriveFormat,
    DriveUnits,
    FlatStage,
    Parameters,
    lacks,
    rows,
    si,
    there_and_back,
)
from friso.errors import InputError
from friso.quantities import Quantity, positive, quoted

VELOCITY = "velocity_per_output"
UNIT = "machine_unit"
VELOCITY_FIELD = Quantity("m/s", positive, "5 mm/s")

UNITY_RANGE = (0.9, 1.1)
"""Range of FF1 [machine units/s per unit of output] for which the output counts as machine units per second."""

TARGET = "error-previous-target, with which the error is taken from the command of the sample before"

LENGTHS = {"mm": 1e-3, "metric": 1e-3, "inch": 0.0254, "in": 0.0254, "imperial": 0.0254, "m": 1.0, "cm": 1e-2}
ANGLES = {"deg": 0.017453292519943295, "degree": 0.017453292519943295, "rad": 1.0, "radian": 1.0}
UNITS = {LINEAR: LENGTHS, ROTARY: ANGLES}
"""Machine units of linear axes in metres (`LENGTHS`), and of rotary axes in radians (`ANGLES`)."""

OUTPUT_SCALE = "OUTPUT_SCALE"
"""Name of the divisor of the `pid` output in a HAL file; with it an output of 1 is not 1 V of an amplifier."""

DOCUMENTED = re.compile(
    r"TYPE|UNITS|MAX_(?:VELOCITY|ACCELERATION|JERK|OUTPUT|ERROR|ERROR_I|ERROR_D)|BACKLASH|COMP_FILE(?:_TYPE)?|"
    r"(?:MIN|MAX)_LIMIT|(?:MIN_)?FERROR|LOCKING_INDEXER|WRAPPED_ROTARY|HOME\w*|VOLATILE_HOME|DEADBAND|BIAS|P|I|D|"
    r"FF[0-3]|CYCLE_TIME|"
    r"(?:OUTPUT|INPUT|ENCODER|STEP)\w*|SCALE|DIR(?:SETUP|HOLD)|PWM\w*|DAC\w*|MOTOR\w*"
)
"""Pattern of documented names in the section of a joint, and of parameters between `pid` and the machine."""

MOST_LINES = 100_000
MOST_INCLUDED = 100
"""Largest number of included files; `MOST_LINES` limits the lines."""

_AXIS = r"(?:JOINT|AXIS)_[0-9]{1,3}"
"""Pattern of the name of a section with the parameters of an axis."""

_CONTINUED = re.compile(r"\\\r?\n")
"""Pattern of the end of a line that continues in the next one."""

_COMMENT = re.compile(r"\s[#;]")
"""Pattern of the start of a comment after a value."""

_INCLUDE = re.compile(r"^#INCLUDE[ \t]+(\S{1,200})[ \t]*$", re.MULTILINE)
"""Pattern of a line that includes another file; included files may include none."""

_HEADING = re.compile(r"\[([^\[\]]*)\][ \t]*(?:[#;].*)?")
_READ = re.compile(r"(?:JOINT|AXIS)_[0-9]{1,3}|TRAJ|EMCMOT")
"""Pattern of the names of sections in which every line must be understood."""

TYPES = ("LINEAR", "ANGULAR")

INCLUDED = "#INCLUDE"
REPEATED = "#REPEATED"
"""Key of `AxisParameters.machine` for repeated names.

No variable has this name, since # begins a comment."""


def _letter(name: str, letters: str, counts: Mapping[str, int]) -> str:
    """Return the letter of the joint `name`, such as X; "" if its letter has several joints.

    `letters` are those of all joints in order, and `counts` tells how many joints each letter has. An axis gives "",
    too.
    """
    number = int(name.partition("_")[2])
    is_named = name.startswith("JOINT") and number < len(letters) and counts[letters[number]] == 1
    return letters[number] if is_named else ""


def _sections(text: str) -> dict[str, dict[str, str]]:
    """Read the variables of an INI file by section.

    LinuxCNC takes the first of several equal names, and so does this reader. The entry REPEATED lists the names whose
    later values differ. Raises InputError for lines that are no INI syntax.
    """
    sections: dict[str, dict[str, str]] = {}
    section: dict[str, str] = {}
    repeated: dict[tuple[str, str], None] = {}
    title = ""
    lines = _CONTINUED.sub(" ", text).splitlines()
    if len(lines) > MOST_LINES:
        raise InputError("", f"{len(lines)} lines", f"at most {MOST_LINES}")
    for line in map(str.strip, lines):
        if not line or line[0] in "#;":
            continue
        if line.startswith("["):
            if (heading := _HEADING.fullmatch(line)) is None:
                raise InputError("", quoted(line), "a section's name in brackets", "[JOINT_0]")
            title = heading[1].strip()
            section = sections.setdefault(title, {})
            continue
        key, equals, value = line.partition("=")
        if equals:
            name, text = key.strip(), _COMMENT.split(value, maxsplit=1)[0].strip()
            if section.setdefault(name, text) != text and title in sections:
                repeated[title, name] = None
        elif _READ.fullmatch(title):
            raise InputError(f"[{title}]", quoted(line), "NAME = VALUE; behind a # what is none", "P = 50")
    for title, name in repeated:
        sections[title][REPEATED] = f"{sections[title][REPEATED]}, {name}" if REPEATED in sections[title] else name
    return sections


def _unity(axis: AxisParameters) -> bool:
    """Tell whether FF1 is about 1, which means that the output is in machine units per second."""
    return UNITY_RANGE[0] <= axis.number("FF1", 0.0) <= UNITY_RANGE[1]


def _kind(axis: AxisParameters) -> AxisKind:
    """Return whether the axis is linear or rotary. Raises InputError for any other type."""
    if (name := str(axis.values.get("TYPE", TYPES[0]))).upper() not in TYPES:
        raise InputError("TYPE", quoted(name), f"one of {', '.join(TYPES)}", f"TYPE = {TYPES[0]}")
    return ROTARY if name.upper() == TYPES[1] else LINEAR


def _unit_of(axis: AxisParameters) -> str | None:
    """Return the machine unit of an axis, as the file gives it.

    Returns None if the file gives none, or if axis and machine give different units. LinuxCNC's manual then uses the
    axis's unit, but its program uses the machine's.
    """
    kind = _kind(axis)
    names = (axis.machine.get("unit" if kind == LINEAR else "angle"), axis.values.get("UNITS"))
    units = {_unit_named(str(name), kind) for name in names if name is not None}
    return units.pop() if len(units) == 1 else None


def _unit_named(name: str, kind: AxisKind) -> str:
    """Return the name of a machine unit.

    Older files give the unit as a number: how many units make a millimetre or a degree.
    """
    units, base = (LENGTHS, 1e-3) if kind == LINEAR else (ANGLES, ANGLES["deg"])
    try:
        size = base / float(name)
    except (ValueError, ZeroDivisionError):
        size = units.get(name.lower(), 0.0)
    return next((unit for unit, listed in units.items() if isclose(listed, size, rel_tol=1e-4)), name)


class Linuxcnc(DriveFormat):
    """A joint whose loop the component `pid` closes, with a force or a velocity as its output."""

    title, suffix = "LinuxCNC INI file", ".ini"
    firmware, source = "LinuxCNC's component pid with the pin command-deriv", "src/hal/components/pid.c"
    pattern = rf"^[ \t]*\[(?:{_AXIS}|EMC|EMCMOT|TRAJ)\]"
    line = "{} = {:.12g}\n"
    rows = rows(
        **{"kp": "P", "ki": "I", "kd": "D", "acceleration_feedforward": "FF2"},
        **{"error_deadband": "DEADBAND", "force_limit": "MAX_OUTPUT"},
    )
    lost: ClassVar[Mapping[str, str]] = {
        "FF0": ", a force in proportion to the commanded position",
        "FF3": ", of the commanded jerk",
        "BIAS": ", a constant output: friso assumes that it balances a constant load",
        "MAX_ERROR": ", beyond which the error counts no further",
        "MAX_ERROR_D": ", the limit of the error's derivative",
        "BACKLASH": ", by which LinuxCNC compensates a play: the play itself is transmission.backlash",
        "OUTPUT_OFFSET": ", what is taken from the output of pid",
    }

    def whole(self, text: str, beside: Beside) -> str:
        """Replace each #INCLUDE line by the text of the file that it names, as read by `beside`.

        Only files in the folder of the INI file are taken in. Included files cannot include others.
        """

        def taken_in(line: re.Match[str]) -> str:
            """Return the text that replaces an #INCLUDE line."""
            included = beside(line[1])
            return line[0] if included is None else _INCLUDE.sub("", included)

        return _INCLUDE.sub(taken_in, text, count=MOST_INCLUDED)

    def axes(self, text: str) -> tuple[AxisParameters, ...]:
        """Return the joints (LinuxCNC 2.8 and later) or axes that have a gain P.

        Raises InputError if there is none, or if the text is no INI file.
        """
        sections = _sections(text)
        included = _INCLUDE.findall(text)[:3]
        machine = {
            "unit": sections.get("TRAJ", {}).get("LINEAR_UNITS"),
            "angle": sections.get("TRAJ", {}).get("ANGULAR_UNITS"),
            "SERVO_PERIOD": sections.get("EMCMOT", {}).get("SERVO_PERIOD"),
            INCLUDED: ", ".join(included) or None,
        }
        with_gains = [
            AxisParameters(
                f"[{name}]",
                {key: value for key, value in values.items() if key != REPEATED},
                {key: value for key, value in {**machine, REPEATED: values.get(REPEATED)}.items() if value is not None},
            )
            for name, values in sections.items()
            if re.fullmatch(_AXIS, name) and "P" in values
        ]
        joints = [axis for axis in with_gains if axis.name.startswith("[JOINT")]
        if not with_gains:
            expected = "an axis whose loop LinuxCNC closes"
            if included:
                expected += f"; what #INCLUDE names ({machine[INCLUDED]}) is not in the folder of the file"
            raise InputError("", "no [JOINT_n] or [AXIS_n] with a P", expected, "P = 50")
        letters = re.sub(r"\s", "", sections.get("TRAJ", {}).get("COORDINATES", "")).upper()
        named = [replace(axis, name=axis.name.strip("[]")) for axis in joints or with_gains]
        counts = Counter(letters)
        return tuple(replace(axis, letter=_letter(axis.name, letters, counts)) for axis in named)

    def stage(self, axis: AxisParameters, ask: Ask) -> AsStage:
        """Turn an axis and the answers into a stage.

        Raises InputError for what friso cannot describe, and for a stepper without an encoder, which has no loop that
        could hunt.
        """
        stepped = any(name.startswith("STEPGEN") or name in ("STEPLEN", "STEPSPACE") for name in axis.values)
        if stepped and not any(name.startswith("ENCODER") for name in axis.values):
            actual = "a stepper: its steps are counted, not its position"
            raise InputError("", actual, "a servo axis, whose loop can hunt")
        kind = _kind(axis)
        name = self._unit(axis, ask, kind)
        unit, in_velocity = UNITS[kind][name], self._in_velocity(axis, ask)
        drive = {UNIT: next(one for one, size in UNITS[kind].items() if size == unit)}
        thread = POSITION_TIME if in_velocity else SAMPLE_TIME
        if "SERVO_PERIOD" in axis.machine:
            drive[thread.removeprefix("drive.")] = si(axis.number("SERVO_PERIOD") * 1e-9, "s")
        else:
            ask(thread, "period of the servo thread", '"1 ms"')
        table, left = (self._velocity if in_velocity else self._torque)(axis, ask, kind, unit)
        if in_velocity and VELOCITY not in ask:
            drive[VELOCITY] = si(unit, kind.unit("m/s"))
        motion = there_and_back(axis, ("MAX_VELOCITY", "MAX_ACCELERATION"), unit, kind)
        left = [*self._left_out(axis), *left, TARGET]
        return self.as_stage(ask, axis, kind, left, controller=table, drive=drive, motion=motion)

    def _left_out(self, axis: AxisParameters) -> list[str]:
        """Say what is left out, beside parameters that a stage has no key for."""
        left = []
        if axis.is_set(OUTPUT_SCALE) and axis.number(OUTPUT_SCALE) != 1:
            scale = f"OUTPUT_SCALE = {axis.number(OUTPUT_SCALE):g}"
            left.append(f"{scale}: an output of 1 is that of pid, before this scale")
        if strange := [name for name in axis.values if not DOCUMENTED.fullmatch(name)]:
            left.append(f"{', '.join(strange)}: names that LinuxCNC's manual does not have")
        if REPEATED in axis.machine:
            later = f"the later values of {axis.machine[REPEATED]}"
            left.append(f"{later}, which stand more than once: the first counts")
        if INCLUDED in axis.machine:
            left.append(f"what #INCLUDE names and is not in the folder of the file: {axis.machine[INCLUDED]}")
        return left

    def _unit(self, axis: AxisParameters, ask: Ask, kind: AxisKind) -> str:
        """Return the name of the machine unit. Raises InputError for an unknown one."""
        units, told = UNITS[kind], _unit_of(axis)
        if told is None or UNIT in ask:
            meaning = "unit of the gains: [TRAJ] has no LINEAR_UNITS or ANGULAR_UNITS, or the axis has other UNITS"
            return ask(UNIT, meaning, '"mm"' if kind == LINEAR else '"deg"', (*units,))
        if told not in units:
            raise InputError(UNIT, quoted(told[:40]), f"one of {', '.join(units)}", f'--set {UNIT}="mm"')
        return told

    def _in_velocity(self, axis: AxisParameters, ask: Ask) -> bool:
        """Tell whether the output of `pid` is a velocity and not a force.

        An answer of the user decides: a gain of the drive's loop, or a force per output. Otherwise the output counts as
        a velocity if FF1 is about 1 and D is 0.
        """
        if FORCE in ask:
            return False
        return VELOCITY in ask or "controller.kp" in ask or (_unity(axis) and not axis.is_set("D"))

    def _torque(self, axis: AxisParameters, ask: Ask, kind: AxisKind, unit: float) -> tuple[dict[str, Any], list[str]]:
        """Return the table [controller] of a PID loop whose output is a force, and what is left out.

        `unit` is the machine unit [m or rad]. Raises InputError for a negative gain.
        """
        field = FORCE_FIELD.on(kind)
        meaning = "force that an output of 1 makes (torque mode)"
        if not axis.is_set("D"):
            gain = GAIN_FIELD.on(kind).written_example
            meaning += f"; in velocity mode, instead, --set controller.kp={gain} of the drive's velocity loop"
        drive_units = DriveUnits(kind, ask(FORCE, meaning, field.written_example, field), unit)
        axis.refuse_negative("PID")
        always = ("kp", "ki", "kd", *(("acceleration_feedforward",) if axis.number("FF2", 0.0) else ()))
        table = {"kind": "pid", "derivative_on": "measurement", **self.keys(axis, drive_units, always)}
        gain = drive_units.force / unit
        if ahead := (axis.number("FF1", 0.0) + axis.number("D", 0.0)) * gain:  # D acts on the reference too
            table["viscous_feedforward"] = si(ahead, kind.unit("N*s/m"))
        if "force_limit" in table:
            table["anti_windup"] = "clamp"
        if axis.is_set("MAX_ERROR_I") and (ki := axis.number("I", 0.0)):
            table["integral_limit"] = si(axis.number("MAX_ERROR_I") * unit * ki * gain, kind.unit("N"))
        return table, []

    def _velocity(
        self, axis: AxisParameters, ask: Ask, kind: AxisKind, unit: float
    ) -> tuple[dict[str, Any], list[str]]:
        """Return the table [controller] of a cascade whose outer loop commands a velocity, and what is left out.

        `unit` is the machine unit [m or rad]. Raises InputError for a D, which has no place in a cascade, and for a P
        that is not positive.
        """
        field, unity, size = VELOCITY_FIELD.on(kind), _unity(axis), unit
        torque = f"in torque mode, instead, --set {FORCE}={FORCE_FIELD.on(kind).written_example}"
        assumed = unity and VELOCITY not in ask
        self.velocity_loop(ask, kind, more=f" (FF1 is about 1: velocity mode; {torque})" if assumed else "")
        ask(SAMPLE_TIME, "period of that loop, of which the servo thread's is a multiple", '"125 us"')
        if not assumed:
            meaning = "velocity that an output of 1 makes: FF1 is not about 1, so it is not one machine unit per second"
            size = ask(VELOCITY, meaning, field.written_example, field)
        if axis.is_set("D"):
            expected = f"D = 0 with an output that is a velocity; or {FORCE}, with one that is a force"
            raise InputError("D", f"{axis.number('D'):g}", expected, f'--set {FORCE}="20 N"')
        p, i, scale = axis.number("P"), axis.number("I", 0.0), size / unit
        if p <= 0:
            raise InputError("P", f"{p:g}", "a gain greater than 0", "P = 50")
        table: dict[str, Any] = {"kind": "cascade", "kv": si(p * scale, "1/s")}
        if i:
            table["position_integral_time"] = si(p / i, "s")
        if axis.is_set("FF1"):
            table["velocity_feedforward"] = axis.number("FF1") * scale
        if axis.is_set("DEADBAND"):
            table["error_deadband"] = si(axis.number("DEADBAND") * unit, kind.unit("m"))
        further = {
            "FF2": "a velocity in proportion to the commanded acceleration",
            "MAX_OUTPUT": "the largest velocity commanded",
            "MAX_ERROR_I": "the limit of the error's integral",
        }
        left = [f"{name} = {axis.number(name):g}, {what}" for name, what in further.items() if axis.is_set(name)]
        if VELOCITY not in ask:
            scale_of_output = "the scale of the output, since FF1 is about 1"
            left.append(f"{scale_of_output}: one machine unit per second is assumed ({VELOCITY})")
        return table, left

    def parameters(self, flat: FlatStage, ask: Ask) -> Parameters:
        """Compute the parameters of the `pid` component. Raises InputError for a controller that it cannot be."""
        kind, controller = axis_of(flat), flat["controller.kind"]
        usual = '"mm"' if kind == LINEAR else '"deg"'
        unit = UNITS[kind][ask(UNIT, "unit of the machine", usual, (*UNITS[kind],))]
        what, key, field = (
            ("velocity", VELOCITY, VELOCITY_FIELD) if controller == "cascade" else ("force", FORCE, FORCE_FIELD)
        )
        example = field.on(kind).written_example
        size = ask(key, f"{what} that an output of 1 makes", example, field.on(kind))
        if controller not in ("pid", "cascade"):
            raise lacks(f'kind = "{controller}"', 'kind = "pid" or kind = "cascade", which this component can be')
        get = lambda name: float(flat.get(f"controller.{name}", 0.0))  # noqa: E731
        if controller == "cascade":
            kv, time = get("kv") / (size / unit), get("position_integral_time")
            settings = {"P": kv, "I": kv / time if time else 0.0, "D": 0.0, "FF0": 0.0}
            settings |= {"FF1": get("velocity_feedforward") / (size / unit), "FF2": 0.0}
            settings["DEADBAND"] = get("error_deadband") / unit
            held = ("kv", "position_integral_time", "velocity_feedforward", "error_deadband")
            return Parameters(settings, frozenset(held))  # the velocity loop belongs to the drive
        if "controller.crossover" in flat:
            expected = "gains: this component has no low-pass before its terms"
            raise lacks("van Dijk's rules", expected, 'kp = "3 N/m", ki = "4 N/(m*s)", kd = "6 N*s/m"')
        if get("tau") > 0:
            raise lacks("a filter of the derivative", "no filter (tau = 0), which this component has not")
        of = self.values(flat, DriveUnits(kind, size, unit))
        ahead = get("viscous_feedforward") - (0.0 if flat["controller.derivative_on"] == "error" else get("kd"))
        settings = {name: of[name] for name in ("P", "I", "D")}
        settings |= {"FF0": 0.0, "FF1": ahead / (size / unit), "FF2": of["FF2"], "BIAS": 0.0}
        settings |= {"DEADBAND": of["DEADBAND"], "MAX_OUTPUT": of["MAX_OUTPUT"]}
        if "controller.integral_limit" in flat and get("ki"):
            settings["MAX_ERROR_I"] = get("integral_limit") / (get("ki") * unit)
        held = (*(row.key for row in self.rows), "viscous_feedforward", "integral_limit")
        return Parameters(settings, frozenset(held))

    def text(self, settings: Mapping[str, float]) -> str:
        """Write parameters as the lines of a joint's section."""
        return f"[JOINT_0]\n{super().text(settings)}"
