"""KFLOP initialisation program in C (Dynomotion KMotion)

Every 90 us: output = P e + I sum(e) + D (e - e before), in counts of the output per count of the encoder; the integral
is limited to MaxI and the output to MaxOutput. Inside DeadBandRange counts the error counts DeadBandGain times; what is
left of a larger one is asked for. Then up to three sampled biquads follow.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from friso.axis import LINEAR, axis_of
from friso.drives.format import AsStage, AxisParameters, FlatStage, ParameterFormat, Parameters, si
from friso.drives.pid_units import (
    LENGTH,
    PidUnits,
    deadband_back,
    deadband_of,
    force_of,
    kind_of_length,
    open_beyond,
    open_units,
)
from friso.drives.questions import OpenQuestion, UserAnswers, of_the_machine
from friso.errors import InputError
from friso.quantities import Quantity, positive, quoted

SERVO_PERIOD = "90 us"
"""Period of the servo loop of KFLOP and KOGNA."""

NAMES = {"kp": "P", "ki": "I", "kd": "D", "force_limit": "MaxOutput", "integral_limit": "MaxI"}
BAND, SHARE = "DeadBandRange", "DeadBandGain"
OUTPUT, COUNT = "an output of 1", "one count of the encoder"
NO_SERVO = ("STEP", "NO_OUTPUT")
"""Parts of the names of output modes without a servo loop of the program's own."""

_SETTING = re.compile(r"ch([0-7])[ \t]*->[ \t]*([\w.\[\]]{1,40})[ \t]*=(?!=)[ \t]*+([^;\n]{0,100});")
"""Pattern of a statement that sets a parameter of an axis."""

_COMMENT = re.compile(r"//[^\n]*|/\*.*?(?:\*/|\Z)", re.DOTALL)
BIQUAD = {"numerator": ("B0", "B1", "B2"), "denominator": ("A1", "A2")}
_SIDE = {"FFVel": "a feedforward of the velocity", "FFAccel": "a feedforward of the acceleration"}


def recognises(name: str, text: str) -> bool:
    """Tell whether a text sets the gain P of a KFLOP axis."""
    return re.search(r"ch[0-7][ \t]*->[ \t]*P[ \t]*=", text) is not None


def axes(text: str) -> tuple[AxisParameters, ...]:
    """Return the axes whose gains a program sets; the last of equal settings counts. Raises InputError without one."""
    values: dict[str, dict[str, Any]] = {}
    for number, name, value in _SETTING.findall(_COMMENT.sub("", text)):
        values.setdefault(f"ch{number}", {})[name] = value.strip()
    found_axes = tuple(AxisParameters(name, values[name]) for name in sorted(values) if "P" in values[name])
    if not found_axes:
        raise InputError("", "no statement that sets a gain", "the initialisation of an axis", "ch0->P=2.0;")
    return found_axes


def questions(axis: AxisParameters, answers: UserAnswers) -> tuple[OpenQuestion, ...]:
    """List what the program leaves open. Raises InputError for an axis without a servo loop."""
    mode = str(axis.values.get("OutputMode", ""))
    if any(part in mode for part in NO_SERVO):
        raise InputError("OutputMode", quoted(mode), "a servo axis, whose loop can hunt", "DAC_SERVO_MODE")
    kind = kind_of_length(answers)[0] if LENGTH in answers else LINEAR
    asked = open_units(answers, kind, OUTPUT, COUNT)
    if _has_deadband(axis):
        asked += open_beyond(answers, BAND)
    return (*asked, *of_the_machine(answers, kind))


def _has_deadband(axis: AxisParameters) -> bool:
    """Tell whether the error counts otherwise within a deadband."""
    return axis.is_set(BAND) and axis.number(SHARE, 1.0) != 1


def stage(axis: AxisParameters, answers: UserAnswers) -> AsStage:
    """Build controller and drive of an axis. Raises InputError for unusable numbers."""
    kind, count = kind_of_length(answers)
    units = PidUnits(kind, force_of(answers, kind), count / axis.number("InputGain0", 1.0), _period())
    table = units.table(axis, NAMES)
    if filters := [row for number in range(3) if (row := _biquad(axis, number))]:
        table["filters"] = filters
    left = [f"{name} = {axis.number(name):g}: {what}, in units that nobody documents" for name, what in _SIDE.items()
            if axis.is_set(name)]  # fmt: skip
    if _has_deadband(axis):
        table |= deadband_of(answers, si(axis.number(BAND) * units.length, kind.unit("m")))
        table["error_deadband_gain"] = axis.number(SHARE)
        left.append(f"whether {SHARE} counts for D too: here D acts on the whole error")
    tables: dict[str, Mapping[str, Any]] = {"controller": table, "drive": {"sample_time": SERVO_PERIOD}}
    if kind != LINEAR:
        tables["axis"] = {"kind": kind.name}
    return AsStage(tables, tuple(left))


def _period() -> float:
    """Return the period of the servo loop [s]."""
    return float(Quantity("s", positive, SERVO_PERIOD).read(SERVO_PERIOD))


def _biquad(axis: AxisParameters, number: int) -> dict[str, Any] | None:
    """Return a biquad of the output as a row of filters; None if it passes everything or is not set."""
    names = {name: f"iir[{number}].{name}" for names in BIQUAD.values() for name in names}
    if not any(name in axis.values for name in names.values()):
        return None
    value = {name: axis.number(text, 0.0) for name, text in names.items()}
    if value == {**dict.fromkeys(value, 0.0), "B0": 1.0}:
        return None
    rows: dict[str, Any] = {side: [value[name] for name in parts] for side, parts in BIQUAD.items()}
    rows["denominator"] = [-part for part in rows["denominator"]]  # the program adds A1 and A2 times earlier outputs
    return {"kind": "sampled_biquad", **rows, "sample_time": SERVO_PERIOD}


def questions_back(flat: FlatStage, answers: UserAnswers) -> tuple[OpenQuestion, ...]:
    """Ask for the units of output and position unless they are answered."""
    return tuple(open_units(answers, axis_of(flat), OUTPUT, COUNT))


def parameters(flat: FlatStage, answers: UserAnswers) -> Parameters:
    """Compute the parameters of an axis. Raises InputError for a controller other than a PID by its gains."""
    kind = axis_of(flat)
    units = PidUnits(kind, force_of(answers, kind), kind_of_length(answers)[1], _period())
    of_loop = units.parameters(flat, NAMES)
    if (deadband := deadband_back(flat)) is None:
        return of_loop
    band = {BAND: deadband[0] / units.length, SHARE: flat.get("controller.error_deadband_gain", 0.0)}
    return Parameters({**of_loop.values, **band}, of_loop.held | deadband[1] | {"error_deadband_gain"})


def text(settings: Mapping[str, float]) -> str:
    """Write parameters as statements of an initialisation program."""
    return "".join(f"ch0->{name}={value:.12g};\n" for name, value in settings.items())


FORMAT = ParameterFormat(
    title="KFLOP initialisation program",
    firmware="Dynomotion KFLOP and KOGNA",
    source="the maker's pages on servo flow and IIR filters",
    recognises=recognises,
    axes=axes,
    questions=questions,
    stage=stage,
    questions_back=questions_back,
    parameters=parameters,
    text=text,
    suffix=".c",
)
