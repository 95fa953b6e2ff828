"""iCub motor control file (XML)

Output = kp e + ki integral(e) + kd e', in units of the motor's PWM per degree of the joint, 1000 times a second; the
integral is limited to maxInt and the output to maxOutput. One file has the gains of several joints, a column each.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from math import radians

from friso.axis import KINDS, axis_of
from friso.drives.format import AsStage, AxisParameters, FlatStage, ParameterFormat, Parameters, lacks
from friso.drives.pid_units import PidUnits, force_of, open_units
from friso.drives.questions import OpenQuestion, UserAnswers, of_the_machine
from friso.drives.xml_files import root_of
from friso.errors import InputError

GROUP = "POSITION_CONTROL"
NAMES = {"kp": "kp", "ki": "ki", "kd": "kd", "force_limit": "maxOutput", "integral_limit": "maxInt"}
PUSHES = ("stictionUp", "stictionDown")
OUTPUT, LOOP_PERIOD, ROTARY = "an output of 1 (a unit of PWM)", "1 ms", KINDS["rotary"]


def recognises(name: str, text: str) -> bool:
    """Tell whether a text has a group of position gains of an iCub's joints."""
    return re.search(rf"<group\s+name=[\"'](?:\w+_)?{GROUP}\w*[\"']", text) is not None and "<param" in text


def axes(text: str) -> tuple[AxisParameters, ...]:
    """Return the joints whose gains the file has. Raises InputError for a text that is no XML, or has no gain."""
    root = root_of(text, "as iCub's robots-configuration has them")
    groups = [group for group in root.iter("group") if GROUP in group.get("name", "")]
    columns: dict[str, list[str]] = {}
    for param in (param for group in groups for param in group.iter("param")):
        columns.setdefault(param.get("name", ""), (param.text or "").split())
    joints = tuple(
        AxisParameters(f"joint_{number}", {name: row[number] for name, row in columns.items() if number < len(row)})
        for number in range(len(columns.get("kp", [])))
    )
    if not joints:
        raise InputError("", f"no kp in a group {GROUP}", "the gains of a joint", '<param name="kp"> 900 </param>')
    return joints


def questions(axis: AxisParameters, answers: UserAnswers) -> tuple[OpenQuestion, ...]:
    """List what the file leaves open: the machine, and what a unit of PWM exerts at the joint."""
    return (*open_units(answers, ROTARY, OUTPUT), *of_the_machine(answers, ROTARY))


def stage(axis: AxisParameters, answers: UserAnswers) -> AsStage:
    """Build the controller of a joint. Raises InputError for unusable numbers."""
    table = PidUnits(ROTARY, force_of(answers, ROTARY), radians(1.0)).table(axis, NAMES)
    left = [
        f"{name} = {axis.number(name):g}, an output at the start of a motion" for name in PUSHES if axis.is_set(name)
    ]
    left.append("a unit of PWM is a voltage: the motor's own damping is that of [friction] viscous")
    tables = {"axis": {"kind": ROTARY.name}, "controller": table, "drive": {"sample_time": LOOP_PERIOD}}
    return AsStage(tables, tuple(left))


def questions_back(flat: FlatStage, answers: UserAnswers) -> tuple[OpenQuestion, ...]:
    """Ask what a unit of PWM exerts unless it is answered."""
    return tuple(open_units(answers, axis_of(flat), OUTPUT))


def parameters(flat: FlatStage, answers: UserAnswers) -> Parameters:
    """Compute the gains of a joint. Raises InputError for a linear axis, and for another controller than a PID."""
    kind = axis_of(flat)
    force = force_of(answers, kind)  # an axis that is not a joint has no degrees, and is refused
    if kind != ROTARY and flat["controller.kind"] == "pid":
        raise lacks("that of a linear axis", "that of a joint, which turns", '[axis] kind = "rotary"')
    return PidUnits(ROTARY, force, radians(1.0)).parameters(flat, NAMES)


def text(settings: Mapping[str, float]) -> str:
    """Write the gains of one joint as a group."""
    rows = "".join(f'  <param name="{name}"> {value:.12g} </param>\n' for name, value in settings.items())
    return f'<group name="{GROUP}">\n{rows}</group>\n'


FORMAT = ParameterFormat(
    title="iCub motor control file",
    firmware="iCub's joints controlled by PWM",
    source="robotology documentation of motor control, POSITION_CONTROL",
    recognises=recognises,
    axes=axes,
    questions=questions,
    stage=stage,
    questions_back=questions_back,
    parameters=parameters,
    text=text,
    suffix=".xml",
)
