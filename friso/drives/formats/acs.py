"""ACS SPiiPlus program with the variables of an axis

The position loop commands a velocity, SLPKP times the position error [1/s], and a PI loop follows it. What a 1 of SLVKP
and SLVKI exerts depends on the drive and on the motor, and is asked for. So is what the axis does in its dead zone,
which an error below SLDZMIN begins and one above SLDZMAX ends.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from friso.axis import LINEAR
from friso.drives.format import AsStage, AxisParameters, FlatStage, ParameterFormat, Parameters, lacks, si
from friso.drives.pid_units import LENGTH, kind_of_length, open_length, open_period
from friso.drives.questions import OpenQuestion, UserAnswers, of_the_machine
from friso.errors import InputError
from friso.quantities import Number, Quantity, positive
from friso.stage.controllers import ControllerSection, settings_of

UNIT = "a position of 1 in the user's unit"
DEAD_ZONE, DEAD_TIME = "dead_zone", "dead_zone_time"
OF_DEAD_ZONE = {"error": "error_deadband", "output": "freeze_window"}
"""Windows against friction for what an axis may do in its dead zone, of which no public page tells."""

ENDS = {"": "SLDZMIN", "_exit": "SLDZMAX", "_time": "SLDZTIME"}
"""Variables of the dead zone, by the ends of the keys of a window."""

GAIN, TIME = "controller.kp", "controller.velocity_integral_time"

_VARIABLE = re.compile(
    r"(?<![\w.])([A-Z][A-Z0-9_]{2,20})[ \t]*\([ \t]*(\d{1,3})[ \t]*\)[ \t]*=(?!=)[ \t]*([^\s;!]{1,60})"
)
"""Pattern of a variable of an axis and its value; a comment begins with an exclamation mark."""

_LEFT = {
    "SLZFF": "the zone in which the feedforward ends",
    "SLFRC": "a feedforward of the friction",
    "SLFRCN": "one of the other direction",
    "SLAFF": "a feedforward of the acceleration",
    "SLVSOF": "a low-pass of the velocity loop",
    "SLVNFRQ": "a notch",
    "SLVB0NF": "a biquad",
    "SLIOFFS": "an offset of the output",
}
"""Variables that a stage does not take over, with what they are."""


def recognises(name: str, text: str) -> bool:
    """Tell whether a text sets the gain of an ACS velocity loop."""
    return re.search(r"SLVKP[ \t]*\(", text) is not None


def axes(text: str) -> tuple[AxisParameters, ...]:
    """Return the axes whose gains the program sets. Raises InputError without one."""
    values: dict[str, dict[str, Any]] = {}
    for line in text.splitlines():
        for name, axis, value in _VARIABLE.findall(line.partition("!")[0]):
            values.setdefault(axis, {})[name] = value
    every = tuple(AxisParameters(axis, values[axis]) for axis in sorted(values, key=int) if "SLPKP" in values[axis])
    if not every:
        raise InputError("", "no gain of a position loop", "the variables of a servo axis", "SLPKP(0)=140")
    return every


def questions(axis: AxisParameters, answers: UserAnswers) -> tuple[OpenQuestion, ...]:
    """List what the program leaves open: the machine, and what the velocity loop exerts."""
    asked = [
        OpenQuestion(GAIN, f"force per velocity error that SLVKP = {axis.number('SLVKP'):g} makes", '"500 N*s/m"'),
    ]
    if axis.is_set("SLVKI"):
        what = f"integral time that SLVKI = {axis.number('SLVKI'):g} makes"
        asked.append(OpenQuestion(TIME, what, '"5 ms"'))
    if axis.is_set(ENDS[""]):
        asked += open_length(answers, UNIT, '"1 mm"')
        what = "what counts as 0 in the dead zone: error, or output, the whole command with its integral"
        asked.append(OpenQuestion(DEAD_ZONE, what, "error"))
        if axis.is_set(ENDS["_time"]):
            asked.append(OpenQuestion(DEAD_TIME, f"time that SLDZTIME = {axis.number('SLDZTIME'):g} makes", '"1 ms"'))
    period = open_period(answers, '"50 us"')
    kind = kind_of_length(answers)[0] if LENGTH in answers else LINEAR
    return (*(one for one in asked if one.key not in answers), *period, *of_the_machine(answers, kind))


def stage(axis: AxisParameters, answers: UserAnswers) -> AsStage:
    """Build the controller of an axis. Raises InputError for unusable numbers."""
    if (kv := axis.number("SLPKP")) <= 0:
        raise InputError("SLPKP", f"{kv:g}", "a gain greater than 0", "SLPKP(0)=140")
    left = [f"{name} = {axis.number(name):g}: {what}" for name, what in _LEFT.items() if axis.is_set(name)]
    table = {"kind": "cascade", "kv": si(kv, "1/s"), "velocity_feedforward": 1.0}
    tables: dict[str, Mapping[str, Any]] = {"controller": table}
    if axis.is_set(ENDS[""]):
        kind, unit = kind_of_length(answers)
        window = OF_DEAD_ZONE[answers.choice(DEAD_ZONE, (*OF_DEAD_ZONE,))]
        near, far = (axis.number(ENDS[end], 0.0) for end in ("", "_exit"))
        table |= {window: si(near * unit, kind.unit("m")), f"{window}_exit": si(max(near, far) * unit, kind.unit("m"))}
        if axis.is_set(ENDS["_time"]):
            table[f"{window}_time"] = si(answers.value(DEAD_TIME, Quantity("s", positive, "1 ms")), "s")
        if kind != LINEAR:
            tables["axis"] = {"kind": kind.name}
    return AsStage(tables, tuple(left))


def questions_back(flat: FlatStage, answers: UserAnswers) -> tuple[OpenQuestion, ...]:
    """Ask for SLVKP that makes the gain of the stage, and for the units of a dead zone."""
    asked = [] if "slvkp" in answers else [OpenQuestion("slvkp", "SLVKP that makes the gain kp of the stage", "65")]
    if window := _dead_zone(flat):
        asked += open_length(answers, UNIT, '"1 mm"')
        if f"{window}_time" in flat and "sldztime" not in answers:
            what = f"SLDZTIME that makes {flat[f'{window}_time'] * 1e3:g} ms"
            asked.append(OpenQuestion("sldztime", what, "1"))
    return tuple(asked)


def _dead_zone(flat: FlatStage) -> str:
    """Return the key of the stage's only window that a dead zone can hold; "" without one."""
    windows = [name for name in map(ControllerSection.key, OF_DEAD_ZONE.values()) if name in flat]
    others = ("controller.windows_in_position_loop", "controller.error_deadband_gain")
    if len(windows) != 1 or any(other in flat for other in others):
        return ""
    (window,) = windows  # an error deadband without a memory reduces the error instead of dropping it
    return window if settings_of(flat).remembers(window.removeprefix("controller.")) else ""


def parameters(flat: FlatStage, answers: UserAnswers) -> Parameters:
    """Compute the variables of an axis. Raises InputError for a controller other than a cascade."""
    if flat["controller.kind"] != "cascade" or "controller.position_integral_time" in flat:
        expected = "a proportional position loop above a velocity loop, as this drive has it"
        raise lacks(f'kind = "{flat["controller.kind"]}", or an integral of the position', expected)
    values = {"SLPKP": flat["controller.kv"], "SLVKP": answers.value("slvkp", Number(positive, "65"))}
    held = {"kv", "kp", "velocity_feedforward"}
    if window := _dead_zone(flat):
        name, unit = window.removeprefix("controller."), kind_of_length(answers)[1]
        values |= {ENDS[""]: flat[window] / unit, ENDS["_exit"]: flat.get(f"{window}_exit", flat[window]) / unit}
        held |= {name, f"{name}_exit", f"{name}_time"}
        if f"{window}_time" in flat:
            values[ENDS["_time"]] = answers.value("sldztime", Number(positive, "1"))
    return Parameters(values, frozenset(held))


def text(settings: Mapping[str, float]) -> str:
    """Write variables as a program sets them."""
    return "".join(f"{name}(0)={value:.12g}\n" for name, value in settings.items())


FORMAT = ParameterFormat(
    title="ACS SPiiPlus program",
    firmware="ACS SPiiPlus",
    source="names of ACSPL+ variables; units of the velocity loop are asked for",
    recognises=recognises,
    axes=axes,
    questions=questions,
    stage=stage,
    questions_back=questions_back,
    parameters=parameters,
    text=text,
    suffix=".prg",
)
