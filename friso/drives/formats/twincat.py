"""TwinCAT NC axis (.xti)

The position loop of the NC commands a velocity: Kv e + f r', with f = PriorControlFactor, every cycle of the NC task.
Within DeadBandPosition the error counts as 0; what is left of a larger one is asked for. Kv is asked for too, as no
public page names it in the file, and so is the velocity loop, which the drive has. A drive that is commanded by
positions has the position loop as well, and is refused.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from friso.axis import LINEAR
from friso.drives.format import AsStage, AxisParameters, FlatStage, ParameterFormat, Parameters, lacks, si
from friso.drives.pid_units import (
    LENGTH,
    deadband_back,
    deadband_of,
    kind_of_length,
    open_beyond,
    open_length,
)
from friso.drives.questions import OpenQuestion, UserAnswers, of_the_machine
from friso.drives.xml_files import root_of
from friso.errors import InputError
from friso.quantities import Quantity, positive, quoted

CLASS, NO_NAME = "CNcAxisDef", "__FILENAME__"
UNIT = "a position of 1 of the axis (usually 1 mm or 1 deg)"
GAIN, POSITION_GAIN, CYCLE = "controller.kp", "controller.kv", "drive.position_sample_time"
BAND, AHEAD = "PID.DeadBandPosition", "PriorControlFactor"
STEP, STEPS = "EncPara.ScaleFactorNumerator", "EncPara.ScaleFactorDenominator"
POSITION_COMMAND = "nDataOut1"
"""Part of the name of the drive's output that commands a position."""

LIKE_TWINCAT = "as TwinCAT writes it for an axis"


def recognises(name: str, text: str) -> bool:
    """Tell whether a text is an axis of a TwinCAT NC."""
    return f'ClassName="{CLASS}"' in text or ("<Axis " in text and "<CtrPara" in text)


def axes(text: str) -> tuple[AxisParameters, ...]:
    """Return the axes with a controller. Raises InputError for a text that is no XML, or has no such axis."""
    root = root_of(text, LIKE_TWINCAT)
    links = [(link.get("VarA", ""), link.get("VarB", "")) for link in root.iter("Link")]
    positions = [to for output, to in links if POSITION_COMMAND in output and "osition" in to]
    every = []
    for axis in root.iter("Axis"):
        values: dict[str, Any] = {"commanded": positions[0]} if positions else {}
        for parent in (*axis.iter("CtrPara"), *axis.iter("EncPara")):
            values |= {name if parent.tag == "CtrPara" else f"EncPara.{name}": text for name, text in parent.items()}
            values |= {f"{part.tag}.{name}": text for part in parent for name, text in part.items()}
        if axis.find("Controller") is not None:
            called = (axis.findtext("Name") or NO_NAME).strip()
            every.append(AxisParameters(f"axis {axis.get('Id', '')}".strip() if called == NO_NAME else called, values))
    if not every:
        raise InputError(
            "", "no axis with a controller", f"a file {LIKE_TWINCAT}", "<Controller><CtrPara/></Controller>"
        )
    return tuple(every)


def questions(axis: AxisParameters, answers: UserAnswers) -> tuple[OpenQuestion, ...]:
    """List what the file leaves open. Raises InputError for a drive that is commanded by positions."""
    if commanded := axis.values.get("commanded"):
        expected = "a drive that the NC commands by velocity; else the position loop is the drive's"
        raise InputError("Link", f"{quoted(str(commanded))}, to which the NC writes positions", expected)
    kind = kind_of_length(answers)[0] if LENGTH in answers else LINEAR
    gain = Quantity("N*s/m", positive, "500 N*s/m").on(kind).written_example
    held = ", ".join(f"{name} = {value}" for name, value in axis.values.items() if name.startswith("PID."))
    asked = [
        OpenQuestion(
            POSITION_GAIN, f"factor Kv of the position control{held and f' (the file has {held})'}", '"20 1/s"'
        ),
        OpenQuestion(
            GAIN, "gain of the drive's velocity loop; its integral time: controller.velocity_integral_time", gain
        ),
        OpenQuestion(CYCLE, "cycle of the NC task", '"2 ms"'),
        OpenQuestion(
            "drive.sample_time", "period of the drive's velocity loop, of which that is a multiple", '"125 us"'
        ),
    ]
    asked += open_length(answers, UNIT, '"1 mm"')
    if axis.is_set(BAND):
        asked += open_beyond(answers, BAND)
    return (*(one for one in asked if one.key not in answers), *of_the_machine(answers, kind))


def stage(axis: AxisParameters, answers: UserAnswers) -> AsStage:
    """Build the controller of an axis. Raises InputError for unusable numbers."""
    kind, unit = kind_of_length(answers)
    table: dict[str, Any] = {"kind": "cascade", "velocity_feedforward": axis.number(AHEAD, 1.0)}
    left = ["limits of the command, and how it follows the NC's own delays"]
    if axis.is_set(BAND):
        table |= deadband_of(answers, si(axis.number(BAND) * unit, kind.unit("m")))
    strange = [name for name in axis.values if name.startswith("PID.") and name != BAND]
    if strange:
        left.append(f"{', '.join(strange)}: no public page tells what they are")
    tables: dict[str, Mapping[str, Any]] = {"controller": table}
    if axis.is_set(STEP):
        step = axis.number(STEP) / axis.number(STEPS, 1.0) if axis.number(STEPS, 1.0) else 0.0
        if step <= 0:
            raise InputError(
                STEPS, f"{axis.number(STEPS, 1.0):g}", "a positive length of an increment", f'{STEP}="5e-5"'
            )
        tables["drive"] = {"encoder_resolution": si(step * unit, kind.unit("m"))}
    if kind != LINEAR:
        tables["axis"] = {"kind": kind.name}
    return AsStage(tables, tuple(left))


def questions_back(flat: FlatStage, answers: UserAnswers) -> tuple[OpenQuestion, ...]:
    """Ask what a position of 1 is unless it is answered."""
    return tuple(open_length(answers, UNIT, '"1 mm"'))


def parameters(flat: FlatStage, answers: UserAnswers) -> Parameters:
    """Compute the parameters of an axis. Raises InputError for a controller other than a proportional position loop."""
    if flat["controller.kind"] != "cascade" or "controller.position_integral_time" in flat:
        expected = "a proportional position loop above the drive's velocity loop"
        raise lacks(f'kind = "{flat["controller.kind"]}", or an integral of the position', expected)
    unit = kind_of_length(answers)[1]
    values = {"Kv": flat[POSITION_GAIN], AHEAD: flat["controller.velocity_feedforward"]}
    held = frozenset({"kv", "kp", "velocity_integral_time", "velocity_feedforward"})
    if "controller.error_deadband_gain" not in flat and (band := deadband_back(flat)) is not None:
        return Parameters({**values, BAND: band[0] / unit}, held | band[1])
    return Parameters(values, held)


def text(settings: Mapping[str, float]) -> str:
    """Write the position control of an axis; Kv stands in a comment, to be entered by hand."""
    band = f'<PID DeadBandPosition="{settings[BAND]:.12g}"/>' if BAND in settings else ""
    control = f'<CtrPara {AHEAD}="{settings[AHEAD]:.12g}">{band}</CtrPara>'
    kv = f"<!-- Kv = {settings['Kv']:.12g} 1/s -->"
    axis = f'<Axis Id="1">\n<Controller Name="Ctrl">\n{control}\n</Controller>\n</Axis>'
    return f'<TcSmItem ClassName="{CLASS}">\n{kv}\n{axis}\n</TcSmItem>\n'


FORMAT = ParameterFormat(
    title="TwinCAT NC axis (.xti)",
    firmware="TwinCAT 3 NC PTP, position control",
    source="Beckhoff Information System, TF50x0, Position Control Loop",
    recognises=recognises,
    axes=axes,
    questions=questions,
    stage=stage,
    questions_back=questions_back,
    parameters=parameters,
    text=text,
    suffix=".xti",
)
