"""Drives with a PID of the position whose output is a force: iCub, KFLOP and moteus."""

from __future__ import annotations

import re
from collections.abc import Mapping
from math import radians
from typing import Any, ClassVar

from friso.axis import ROTARY, axis_of
from friso.drives.ask import Ask
from friso.drives.drive import (
    AxisParameters,
    DriveUnits,
    FlatStage,
    Parameters,
    PidDrive,
    axes_with,
    deadband,
    deadband_back,
    lacks,
    root_of,
    rows,
    torque,
)
from friso.errors import InputError
from friso.quantities import quoted


class Icub(PidDrive):
    """Output = kp e + ki integral(e) + kd e', in units of the motor's PWM per degree of the joint, 1000 times a second.

    The integral is limited to maxInt and the output to maxOutput. One file has the gains of several joints, a column
    each.
    """

    title, suffix = "iCub motor control file", ".xml"
    firmware, source = "iCub's joints controlled by PWM", "robotology documentation of motor control, POSITION_CONTROL"
    group = "POSITION_CONTROL"
    pattern = rf"<group\s+name=[\"'](?:\w+_)?{group}\w*[\"']"
    rows = rows(kp="kp", ki="ki", kd="kd", force_limit="maxOutput", integral_limit="maxInt")
    period = "1 ms"
    lost = dict.fromkeys(("stictionUp", "stictionDown"), ", an output at the start of a motion")
    line = '  <param name="{}"> {:.12g} </param>\n'

    def recognises(self, text: str) -> bool:
        """Tell whether a text has a group of position gains."""
        return "<param" in text and super().recognises(text)

    def axes(self, text: str) -> tuple[AxisParameters, ...]:
        """Return the joints whose gains the file has. Raises InputError for a text that is no XML, or has no gain."""
        root = root_of(text, "as iCub's robots-configuration has them")
        groups = [group for group in root.iter("group") if self.group in group.get("name", "")]
        columns: dict[str, list[str]] = {}
        for param in (param for group in groups for param in group.iter("param")):
            columns.setdefault(param.get("name", ""), (param.text or "").split())
        joints = tuple(
            AxisParameters(f"joint_{k}", {name: row[k] for name, row in columns.items() if k < len(row)})
            for k in range(len(columns.get("kp", [])))
        )
        if not joints:
            actual = f"no kp in a group {self.group}"
            raise InputError("", actual, "the gains of a joint", '<param name="kp"> 900 </param>')
        return joints

    def units(self, ask: Ask, axis: AxisParameters | None, flat: FlatStage) -> DriveUnits:
        """Return degrees of the joint, and what a unit of PWM exerts. Raises InputError for a linear axis."""
        kind = ROTARY if axis else axis_of(flat)
        force = ask.force(kind, "an output of 1 (a unit of PWM)")  # before an axis without degrees is refused
        if kind != ROTARY and flat["controller.kind"] == "pid":
            raise lacks("that of a linear axis", "that of a joint, which turns", '[axis] kind = "rotary"')
        return DriveUnits(ROTARY, force, radians(1.0))

    def further(self, axis: AxisParameters, ask: Ask, units: DriveUnits) -> tuple[dict[str, Any], list[str]]:
        """Say what a unit of PWM is."""
        return {}, ["a unit of PWM is a voltage: the motor's own damping is that of [friction] viscous"]

    def text(self, settings: Mapping[str, float]) -> str:
        """Write the gains of one joint as a group."""
        return f'<group name="{self.group}">\n{super().text(settings)}</group>\n'


class Moteus(PidDrive):
    """Torque = kp e + ki integral(e) + kd e', in N m per revolution of the output; the integral is limited to ilimit.

    The output is the shaft behind motor_position.rotor_to_output_ratio.
    """

    title, suffix = "moteus configuration", ".cfg"
    firmware, source = "mjbots moteus", "docs/reference.md of moteus, servo.pid_position"
    pid = "servo.pid_position"
    pattern = rf"^[ \t]*(?:conf set )?{re.escape(pid)}\.kp[ \t]"
    rows = rows(kp=f"{pid}.kp", ki=f"{pid}.ki", kd=f"{pid}.kd", integral_limit=f"{pid}.ilimit")
    known = frozenset((*(row.name for row in rows), f"{pid}.sign", f"{pid}.iratelimit", f"{pid}.max_desired_rate"))
    usual_period = '"33.3 us"'

    def axes(self, text: str) -> tuple[AxisParameters, ...]:
        """Return the only axis of a moteus. Raises InputError for a line that sets nothing."""
        values = {}
        for number, line in enumerate(text.splitlines(), 1):
            if setting := re.fullmatch(r"[ \t]*(?:conf set )?([a-z]\w*(?:\.\w+)+)[ \t]+(\S+)[ \t]*", line):
                values[setting[1]] = setting[2]
            elif line.strip() and not line.lstrip().startswith("#"):
                raise InputError(f"line {number}", quoted(line.strip()), "a name and its value", f"{self.pid}.kp 4.0")
        return (AxisParameters("moteus", values),)

    def units(self, ask: Ask, axis: AxisParameters | None, flat: FlatStage) -> DriveUnits:
        """Return N m and revolutions of the output."""
        what = 'what one revolution of the output moves; an angle on a rotary axis, "360 deg" without more gears'
        return torque(*ask.turn(what, '"360 deg"', flat))

    def further(self, axis: AxisParameters, ask: Ask, units: DriveUnits) -> tuple[dict[str, Any], list[str]]:
        """Say what is left out."""
        left = ["the limit of the current: [controller] force_limit", "the filters of the encoders"]
        if (rate := axis.values.get(f"{self.pid}.iratelimit", "-1")) not in ("-1", "-1.0"):
            left.append(f"iratelimit = {rate}, the largest rate of the integral")
        if (slip := axis.values.get("servo.max_position_slip", "nan")) != "nan":
            left.append(f"max_position_slip = {slip}, beyond which the error counts no further")
        if strange := [name for name in axis.values if name.startswith(f"{self.pid}.") and name not in self.known]:
            left.append(f"{', '.join(strange)}: no published firmware documents them")
        return {}, left


class Kflop(PidDrive):
    """Every 90 us: output = P e + I sum(e) + D (e - e before), in counts of the output per count of the encoder.

    The integral is limited to MaxI and the output to MaxOutput. Inside DeadBandRange counts the error counts
    DeadBandGain times; what is left of a larger one is asked for. Then up to three sampled biquads follow.
    """

    title, suffix = "KFLOP initialisation program", ".c"
    firmware, source = "Dynomotion KFLOP and KOGNA", "the maker's pages on servo flow and IIR filters"
    pattern = r"ch[0-7][ \t]*->[ \t]*P[ \t]*="
    rows = rows(kp="P", ki="I", kd="D", force_limit="MaxOutput", integral_limit="MaxI")
    period = "90 us"
    lost: ClassVar[Mapping[str, str]] = {
        "FFVel": ": a feedforward of the velocity, in units that nobody documents",
        "FFAccel": ": a feedforward of the acceleration, in units that nobody documents",
    }
    line = "ch0->{}={:.12g};\n"
    band, share = "DeadBandRange", "DeadBandGain"

    def axes(self, text: str) -> tuple[AxisParameters, ...]:
        """Return the axes whose gains a program sets, by their last settings. Raises InputError without one."""
        plain = re.sub(r"//[^\n]*|/\*(?s:.*?)(?:\*/|\Z)", "", text)
        setting = r"(ch[0-7])[ \t]*->[ \t]*([\w.\[\]]{1,40})[ \t]*=(?!=)[ \t]*+([^;\n]{0,100});"
        settings = [(axis, name, value.strip()) for axis, name, value in re.findall(setting, plain)]
        missing = InputError("", "no statement that sets a gain", "the initialisation of an axis", "ch0->P=2.0;")
        return axes_with("P", settings, missing)

    def units(self, ask: Ask, axis: AxisParameters | None, flat: FlatStage) -> DriveUnits:
        """Return counts and outputs. Raises InputError for an axis without a servo loop of the program's own."""
        mode = str(axis.values.get("OutputMode", "")) if axis else ""
        if "STEP" in mode or "NO_OUTPUT" in mode:
            raise InputError("OutputMode", quoted(mode), "a servo axis, whose loop can hunt", "DAC_SERVO_MODE")
        kind, count = ask.length("one count of the encoder", '"0.5 um"')
        kind = axis_of(flat) if flat else kind
        force, gain = ask.force(kind, "an output of 1"), axis.number("InputGain0", 1.0) if axis else 1.0
        if gain == 0:
            raise InputError("InputGain0", "0", "a gain of the encoder other than 0", "1.0")
        return DriveUnits(kind, force, count / gain, 90e-6)

    def further(self, axis: AxisParameters, ask: Ask, units: DriveUnits) -> tuple[dict[str, Any], list[str]]:
        """Return biquads and a deadband."""
        filters = [row for number in range(3) if (row := self._biquad(axis, number))]
        table: dict[str, Any] = {"filters": filters} if filters else {}
        if not axis.is_set(self.band) or axis.number(self.share, 1.0) == 1:
            return table, []
        table |= {**deadband(ask, axis, self.band, units), "error_deadband_gain": axis.number(self.share)}
        return table, [f"whether {self.share} counts for D too: here D acts on the whole error"]

    def _biquad(self, axis: AxisParameters, number: int) -> dict[str, Any] | None:
        """Return a biquad of the output as a row of filters; None if it passes everything or is not set."""
        names = {name: f"iir[{number}].{name}" for name in ("B0", "B1", "B2", "A1", "A2")}
        value = {name: axis.number(place, 0.0) for name, place in names.items()}
        if axis.values.keys().isdisjoint(names.values()) or value == {**dict.fromkeys(value, 0.0), "B0": 1.0}:
            return None
        above = [value[name] for name in ("B0", "B1", "B2")]
        below = [-value[name] for name in ("A1", "A2")]  # the program adds A1 and A2 times earlier outputs
        return {"kind": "sampled_biquad", "numerator": above, "denominator": below, "sample_time": self.period}

    def parameters(self, flat: FlatStage, ask: Ask) -> Parameters:
        """Compute the parameters of an axis. Raises InputError for a controller other than a PID by its gains."""
        of_loop, length = super().parameters(flat, ask), self.units(ask, None, flat).length
        if (band := deadband_back(flat)) is None:
            return of_loop
        values = {self.band: band[0] / length, self.share: flat.get("controller.error_deadband_gain", 0.0)}
        return Parameters({**of_loop.values, **values}, of_loop.held | band[1] | {"error_deadband_gain"})
