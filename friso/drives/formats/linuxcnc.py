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

from friso.axis import KINDS, LINEAR, AxisKind, axis_of
from friso.drives.format import (
    AsStage,
    AxisParameters,
    Beside,
    FlatStage,
    ParameterFormat,
    Parameters,
    lacks,
    si,
    there_and_back,
)
from friso.drives.pid_units import FORCE, FORCE_FIELD
from friso.drives.questions import OpenQuestion, UserAnswers, of_the_machine
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
"""Machine units of linear axes in metres (`LENGTHS`), and of rotary axes in radians (`ANGLES`)."""

ROTARY = KINDS["rotary"]
NOT_CARRIED = {
    "FF0": "FF0 = {:g}, a force in proportion to the commanded position",
    "FF3": "FF3 = {:g}, of the commanded jerk",
    "BIAS": "BIAS = {:g}, a constant output: friso assumes that it balances a constant load",
    "MAX_ERROR": "MAX_ERROR = {:g}, beyond which the error counts no further",
    "MAX_ERROR_D": "MAX_ERROR_D = {:g}, the limit of the error's derivative",
    "BACKLASH": "BACKLASH = {:g}, by which LinuxCNC compensates a play: the play itself is transmission.backlash",
    "OUTPUT_OFFSET": "OUTPUT_OFFSET = {:g}, what is taken from the output of pid",
}
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

_FEEDFORWARD, _LIMITS = ("viscous_feedforward", "acceleration_feedforward"), ("force_limit", "integral_limit")
HELD = frozenset(("kp", "ki", "kd", *_FEEDFORWARD, *_LIMITS, "error_deadband"))
HELD_OF_CASCADE = frozenset(("kv", "position_integral_time", "velocity_feedforward", "error_deadband"))
"""Names in [controller] that the parameters hold. The velocity loop belongs to the drive."""


def recognises(name: str, text: str) -> bool:
    """Tell whether the file has a section of a LinuxCNC joint, axis or machine."""
    return re.search(rf"^[ \t]*\[(?:{_AXIS}|EMC|EMCMOT|TRAJ)\]", text, re.MULTILINE) is not None


def whole(text: str, beside: Beside) -> str:
    """Replace each #INCLUDE line by the text of the file that it names, as read by `beside`.

    Only files in the folder of the INI file are taken in. Included files cannot include others.
    """

    def taken_in(line: re.Match[str]) -> str:
        """Return the text that replaces an #INCLUDE line."""
        included = beside(line[1])
        return line[0] if included is None else _INCLUDE.sub("", included)

    return _INCLUDE.sub(taken_in, text, count=MOST_INCLUDED)


def axes(text: str) -> tuple[AxisParameters, ...]:
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


def questions(axis: AxisParameters, answers: UserAnswers) -> tuple[OpenQuestion, ...]:
    """List what the file leaves open: the machine, its unit, and what an output of 1 does.

    Raises InputError for a stepper without an encoder, which has no loop that could hunt.
    """
    stepped = any(name.startswith("STEPGEN") or name in ("STEPLEN", "STEPSPACE") for name in axis.values)
    if stepped and not any(name.startswith("ENCODER") for name in axis.values):
        raise InputError("", "a stepper: its steps are counted, not its position", "a servo axis, whose loop can hunt")
    kind = _kind(axis)
    asked: list[OpenQuestion] = []
    if _unit_of(axis) is None and UNIT not in answers:
        example = '"mm"' if kind == LINEAR else '"deg"'
        meaning = "unit of the gains: [TRAJ] has no LINEAR_UNITS or ANGULAR_UNITS, or the axis has other UNITS"
        asked.append(OpenQuestion(UNIT, meaning, example))
    in_velocity = _in_velocity(axis, answers)
    if "SERVO_PERIOD" not in axis.machine:
        thread = "drive.position_sample_time" if in_velocity else "drive.sample_time"
        asked += [] if thread in answers else [OpenQuestion(thread, "period of the servo thread", '"1 ms"')]
    if in_velocity:
        asked += _of_the_velocity_loop(axis, answers, kind)
    elif FORCE not in answers:
        meaning = "force that an output of 1 makes (torque mode)"
        if not axis.is_set("D"):
            gain = Quantity("N*s/m", positive, "500 N*s/m").on(kind).written_example
            meaning += f"; in velocity mode, instead, --set controller.kp={gain} of the drive's velocity loop"
        asked.append(OpenQuestion(FORCE, meaning, FORCE_FIELD.on(kind).written_example))
    moved = axis.is_set("MAX_ACCELERATION") and axis.is_set("MAX_VELOCITY")
    return (*asked, *of_the_machine(answers, kind, moved))


def _in_velocity(axis: AxisParameters, answers: UserAnswers) -> bool:
    """Tell whether the output of `pid` is a velocity and not a force.

    An answer of the user decides: a gain of the drive's loop, or a force per output. Otherwise the output counts as a
    velocity if FF1 is about 1 and D is 0.
    """
    if FORCE in answers or VELOCITY in answers or "controller.kp" in answers:
        return FORCE not in answers
    return _unity(axis) and not axis.is_set("D")


def _of_the_velocity_loop(axis: AxisParameters, answers: UserAnswers, kind: AxisKind) -> list[OpenQuestion]:
    """List questions about the drive's velocity loop, of which an INI file says nothing.

    They ask for its gain and its sample time, and for the scale of the output unless FF1 is about 1.
    """
    gain = Quantity("N*s/m", positive, "500 N*s/m").on(kind).written_example
    meaning = "gain of the drive's velocity loop, whose integral time, if any, is controller.velocity_integral_time"
    if _unity(axis) and VELOCITY not in answers:
        force = FORCE_FIELD.on(kind).written_example
        meaning += f" (FF1 is about 1: velocity mode; in torque mode, instead, --set {FORCE}={force})"
    asked = [
        OpenQuestion("controller.kp", meaning, gain),
        OpenQuestion("drive.sample_time", "period of that loop, of which the servo thread's is a multiple", '"125 us"'),
    ]
    if not _unity(axis):
        meaning = "velocity that an output of 1 makes: FF1 is not about 1, so it is not one machine unit per second"
        asked.append(OpenQuestion(VELOCITY, meaning, VELOCITY_FIELD.on(kind).written_example))
    return [question for question in asked if question.key not in answers]


def stage(axis: AxisParameters, answers: UserAnswers) -> AsStage:
    """Build controller, drive and move of an axis.

    Raises InputError for what friso cannot describe.

    Parameters without a place in a stage are listed in sentences.
    """
    kind = _kind(axis)
    unit = _metres(axis, answers, kind)
    left = [text.format(axis.number(key)) for key, text in NOT_CARRIED.items() if axis.is_set(key)]
    if axis.is_set(OUTPUT_SCALE) and axis.number(OUTPUT_SCALE) != 1:
        left.append(f"OUTPUT_SCALE = {axis.number(OUTPUT_SCALE):g}: an output of 1 is that of pid, before this scale")
    if strange := [name for name in axis.values if not DOCUMENTED.fullmatch(name)]:
        left.append(f"{', '.join(strange)}: names that LinuxCNC's manual does not have")
    if REPEATED in axis.machine:
        left.append(f"the later values of {axis.machine[REPEATED]}, which stand more than once: the first counts")
    if INCLUDED in axis.machine:
        left.append(f"what #INCLUDE names and is not in the folder of the file: {axis.machine[INCLUDED]}")
    in_torque = not _in_velocity(axis, answers)
    controller, more = (_torque if in_torque else _velocity)(axis, answers, kind, unit)
    if axis.is_set("DEADBAND"):
        controller["error_deadband"] = si(axis.number("DEADBAND") * unit, kind.unit("m"))
    drive = {UNIT: next(name for name, size in (LENGTHS if kind == LINEAR else ANGLES).items() if size == unit)}
    if not in_torque and VELOCITY not in answers:
        drive[VELOCITY] = si(unit, kind.unit("m/s"))
    if "SERVO_PERIOD" in axis.machine:
        drive["sample_time" if in_torque else "position_sample_time"] = si(axis.number("SERVO_PERIOD") * 1e-9, "s")
    tables: dict[str, Mapping[str, object]] = {"controller": controller, "drive": drive}
    if kind != LINEAR:
        tables["axis"] = {"kind": kind.name}
    if axis.is_set("MAX_ACCELERATION") and axis.is_set("MAX_VELOCITY"):
        limits = axis.number("MAX_VELOCITY"), axis.number("MAX_ACCELERATION")
        tables["motion"] = there_and_back(*limits, unit, kind)
    return AsStage(tables, (*left, *more, TARGET))


def _torque(
    axis: AxisParameters, answers: UserAnswers, kind: AxisKind, unit: float
) -> tuple[dict[str, object], list[str]]:
    """Build the table [controller] of a PID loop whose output is a force.

    `unit` is the machine unit [m or rad].

    Raises InputError for a negative gain.
    """
    scale = answers.value(FORCE, FORCE_FIELD.on(kind)) / unit
    gain = {name: axis.number(name, 0.0) * scale for name in ("P", "I", "D", "FF1", "FF2")}
    for name in ("P", "I", "D"):
        if gain[name] < 0:
            raise InputError(name, f"{axis.number(name):g}", "a gain of 0 or more", f"{name} = 10")
    table: dict[str, object] = {
        "kind": "pid",
        "kp": si(gain["P"], kind.unit("N/m")),
        "ki": si(gain["I"], kind.unit("N/(m*s)")),
        "kd": si(gain["D"], kind.unit("N*s/m")),
        "derivative_on": "measurement",
    }
    if ahead := gain["FF1"] + gain["D"]:  # D acts on the reference too
        table["viscous_feedforward"] = si(ahead, kind.unit("N*s/m"))
    if gain["FF2"]:
        table["acceleration_feedforward"] = si(gain["FF2"], kind.unit("kg"))
    if axis.is_set("MAX_OUTPUT"):
        table |= {"force_limit": si(axis.number("MAX_OUTPUT") * scale * unit, kind.unit("N")), "anti_windup": "clamp"}
    if axis.is_set("MAX_ERROR_I") and gain["I"]:
        table["integral_limit"] = si(axis.number("MAX_ERROR_I") * unit * gain["I"], kind.unit("N"))
    return table, []


def _velocity(
    axis: AxisParameters, answers: UserAnswers, kind: AxisKind, unit: float
) -> tuple[dict[str, object], list[str]]:
    """Build the table [controller] of a cascade whose outer loop commands a velocity.

    `unit` is the machine unit [m or rad]. Raises InputError for a D, which has no place in a cascade, and for a P that
    is not positive.
    """
    if axis.is_set("D"):
        expected = f"D = 0 with an output that is a velocity; or {FORCE}, with one that is a force"
        raise InputError("D", f"{axis.number('D'):g}", expected, f'--set {FORCE}="20 N"')
    p, i = axis.number("P"), axis.number("I", 0.0)
    if p <= 0:
        raise InputError("P", f"{p:g}", "a gain greater than 0", "P = 50")
    scale = answers.value(VELOCITY, VELOCITY_FIELD.on(kind)) / unit if VELOCITY in answers else 1.0
    table: dict[str, object] = {"kind": "cascade", "kv": si(p * scale, "1/s")}
    if i:
        table["position_integral_time"] = si(p / i, "s")
    if axis.is_set("FF1"):
        table["velocity_feedforward"] = axis.number("FF1") * scale
    left = [
        f"{name} = {axis.number(name):g}, {what}"
        for name, what in {
            "FF2": "a velocity in proportion to the commanded acceleration",
            "MAX_OUTPUT": "the largest velocity commanded",
            "MAX_ERROR_I": "the limit of the error's integral",
        }.items()
        if axis.is_set(name)
    ]
    if VELOCITY not in answers:
        scale_of_output = "the scale of the output, since FF1 is about 1"
        left.append(f"{scale_of_output}: one machine unit per second is assumed ({VELOCITY})")
    return table, left


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


def _metres(axis: AxisParameters, answers: UserAnswers, kind: AxisKind) -> float:
    """Return the size of the machine unit [m or rad]. Raises InputError for an unknown unit."""
    units = LENGTHS if kind == LINEAR else ANGLES
    name = answers.choice(UNIT, tuple(units)) if UNIT in answers else _unit_of(axis)
    if name not in units:
        raise InputError(UNIT, quoted(str(name)[:40]), f"one of {', '.join(units)}", f'--set {UNIT}="mm"')
    return units[name]


def questions_back(flat: FlatStage, answers: UserAnswers) -> tuple[OpenQuestion, ...]:
    """List what is needed to write parameters: the machine unit, and what an output of 1 does.

    An output of 1 is a velocity for a cascade, and a force for any other controller.
    """
    kind = axis_of(flat)
    asked = [OpenQuestion(UNIT, "unit of the machine", '"mm"' if kind == LINEAR else '"deg"')]
    if flat["controller.kind"] == "cascade":
        example = VELOCITY_FIELD.on(kind).written_example
        asked.append(OpenQuestion(VELOCITY, "velocity that an output of 1 makes", example))
    else:
        asked.append(OpenQuestion(FORCE, "force that an output of 1 makes", FORCE_FIELD.on(kind).written_example))
    return tuple(question for question in asked if question.key not in answers)


def parameters(flat: FlatStage, answers: UserAnswers) -> Parameters:
    """Compute the parameters of the `pid` component from a stage.

    Raises InputError for a controller that the component cannot represent.
    """
    kind = axis_of(flat)
    units = LENGTHS if kind == LINEAR else ANGLES
    unit = units[answers.choice(UNIT, tuple(units))]
    if flat["controller.kind"] not in ("pid", "cascade"):
        expected = 'kind = "pid" or kind = "cascade", which this component can be'
        raise lacks(f'kind = "{flat["controller.kind"]}"', expected)
    get = lambda name, default=0.0: float(flat.get(f"controller.{name}", default))  # noqa: E731
    if flat["controller.kind"] == "cascade":
        return _of_cascade(flat, unit, answers.value(VELOCITY, VELOCITY_FIELD.on(kind)) / unit)
    if "controller.crossover" in flat:
        expected = "gains: this component has no low-pass before its terms"
        raise lacks("van Dijk's rules", expected, 'kp = "3 N/m", ki = "4 N/(m*s)", kd = "6 N*s/m"')
    if get("tau") > 0:
        raise lacks("a filter of the derivative", "no filter (tau = 0), which this component has not")
    scale = answers.value(FORCE, FORCE_FIELD.on(kind)) / unit
    on_error = flat["controller.derivative_on"] == "error"
    settings = {
        "P": get("kp") / scale,
        "I": get("ki") / scale,
        "D": get("kd") / scale,
        "FF0": 0.0,
        "FF1": (get("viscous_feedforward") - (0.0 if on_error else get("kd"))) / scale,
        "FF2": get("acceleration_feedforward") / scale,
        "BIAS": 0.0,
        "DEADBAND": get("error_deadband") / unit,
        "MAX_OUTPUT": get("force_limit") / (scale * unit),
    }
    if "controller.integral_limit" in flat and get("ki"):
        settings["MAX_ERROR_I"] = get("integral_limit") / (get("ki") * unit)
    return Parameters(settings, HELD)


def _of_cascade(flat: FlatStage, unit: float, scale: float) -> Parameters:
    """Compute the parameters of a cascade's outer loop, whose output commands a velocity.

    `unit` is the machine unit [m or rad]. An output of 1 stands for `scale` machine units per second.
    """
    kv, time = flat["controller.kv"], flat.get("controller.position_integral_time")
    ahead = flat["controller.velocity_feedforward"] / scale
    kv /= scale
    settings = {"P": kv, "I": kv / time if time else 0.0, "D": 0.0, "FF0": 0.0, "FF1": ahead, "FF2": 0.0}
    settings["DEADBAND"] = flat.get("controller.error_deadband", 0.0) / unit
    return Parameters(settings, HELD_OF_CASCADE)


def text(settings: Mapping[str, float]) -> str:
    """Write parameters as the lines of a joint's section."""
    lines = [f"{name} = {value:.12g}" for name, value in settings.items()]
    return "\n".join(["[JOINT_0]", *lines, ""])


FORMAT = ParameterFormat(
    title="LinuxCNC INI file",
    firmware="LinuxCNC's component pid with the pin command-deriv",
    source="src/hal/components/pid.c",
    recognises=recognises,
    axes=axes,
    questions=questions,
    stage=stage,
    questions_back=questions_back,
    parameters=parameters,
    text=text,
    suffix=".ini",
    whole=whole,
)
