"""Drives with a position loop above a velocity loop: ACS, ecmc and TwinCAT."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, ClassVar

from friso.axis import LINEAR, AxisKind
from friso.drives.ask import LENGTH, TRAVEL, Ask
from friso.drives.drive import (
    POSITION_TIME,
    SAMPLE_TIME,
    AsStage,
    AxisParameters,
    CascadeDrive,
    DriveUnits,
    FlatStage,
    Parameters,
    axes_with,
    deadband,
    deadband_back,
    lacks,
    root_of,
    si,
    torque,
)
from friso.errors import InputError
from friso.quantities import Number, Quantity, positive, quoted
from friso.stage.controllers import settings_of


class Acs(CascadeDrive):
    """The position loop commands a velocity, SLPKP times the position error [1/s], and a PI loop follows it.

    What a 1 of SLVKP and SLVKI exerts depends on the drive and on the motor, and is asked for. So is what the axis does
    in its dead zone, which an error below SLDZMIN begins and one above SLDZMAX ends.
    """

    title, suffix = "ACS SPiiPlus program", ".prg"
    firmware, source = "ACS SPiiPlus", "names of ACSPL+ variables; units of the velocity loop are asked for"
    pattern = r"SLVKP[ \t]*\("
    lost: ClassVar[Mapping[str, str]] = {
        "SLZFF": ": the zone in which the feedforward ends",
        "SLFRC": ": a feedforward of the friction",
        "SLFRCN": ": one of the other direction",
        "SLAFF": ": a feedforward of the acceleration",
        "SLVSOF": ": a low-pass of the velocity loop",
        "SLVNFRQ": ": a notch",
        "SLVB0NF": ": a biquad",
        "SLIOFFS": ": an offset of the output",
    }
    line = "{}(0)={:.12g}\n"
    of_dead_zone: ClassVar[Mapping[str, str]] = {"error": "error_deadband", "output": "freeze_window"}
    """Windows against friction for what an axis may do in its dead zone, of which no public page tells."""

    def axes(self, text: str) -> tuple[AxisParameters, ...]:
        """Return the axes whose gains the program sets. Raises InputError without one."""
        name = r"(?<![\w.])([A-Z][A-Z0-9_]{2,20})"
        variable = rf"{name}[ \t]*\([ \t]*(\d{{1,3}})[ \t]*\)[ \t]*=(?!=)[ \t]*([^\s;!]{{1,60}})"
        lines = (line.partition("!")[0] for line in text.splitlines())
        settings = [(axis, name, value) for line in lines for name, axis, value in re.findall(variable, line)]
        missing = InputError("", "no gain of a position loop", "the variables of a servo axis", "SLPKP(0)=140")
        return axes_with("SLPKP", settings, missing)

    def stage(self, axis: AxisParameters, ask: Ask) -> AsStage:
        """Turn an axis and the answers into a stage. Raises InputError for unusable numbers."""
        meaning = f"force per velocity error that SLVKP = {axis.number('SLVKP'):g} makes"
        self.velocity_loop(ask, LINEAR, meaning)
        if axis.is_set("SLVKI"):
            time = f"integral time that SLVKI = {axis.number('SLVKI'):g} makes"
            ask("controller.velocity_integral_time", time, '"5 ms"')
        if (kv := axis.number("SLPKP")) <= 0:
            raise InputError("SLPKP", f"{kv:g}", "a gain greater than 0", "SLPKP(0)=140")
        kind, table = ask.kind(LENGTH), {"kind": "cascade", "kv": si(kv, "1/s"), "velocity_feedforward": 1.0}
        if axis.is_set("SLDZMIN"):
            kind, window = self._dead_zone(axis, ask)
            table |= window
        ask(SAMPLE_TIME, "period of the drive's loop", '"50 us"')
        return self.as_stage(ask, axis, kind, (), controller=table)

    def _dead_zone(self, axis: AxisParameters, ask: Ask) -> tuple[AxisKind, dict[str, Any]]:
        """Return the kind of axis, and the keys of [controller] for a dead zone."""
        kind, unit = ask.length("a position of 1 in the user's unit", '"1 mm"')
        what = "what counts as 0 in the dead zone: error, or output, the whole command with its integral"
        window = self.of_dead_zone[ask("dead_zone", what, "error", (*self.of_dead_zone,))]
        near, far = (axis.number(name, 0.0) for name in ("SLDZMIN", "SLDZMAX"))
        table = {window: si(near * unit, kind.unit("m")), f"{window}_exit": si(max(near, far) * unit, kind.unit("m"))}
        if axis.is_set("SLDZTIME"):
            what = f"time that SLDZTIME = {axis.number('SLDZTIME'):g} makes"
            table[f"{window}_time"] = si(ask("dead_zone_time", what, '"1 ms"', Quantity("s", positive, "1 ms")), "s")
        return kind, table

    def _window(self, flat: FlatStage) -> str:
        """Return the stage's only window that a dead zone can hold; "" without one."""
        windows = [name for name in self.of_dead_zone.values() if f"controller.{name}" in flat]
        others = ("controller.windows_in_position_loop", "controller.error_deadband_gain")
        if len(windows) != 1 or any(other in flat for other in others):
            return ""
        # an error deadband without a memory reduces the error instead of dropping it
        return windows[0] if settings_of(flat).remembers(windows[0]) else ""

    def parameters(self, flat: FlatStage, ask: Ask) -> Parameters:
        """Compute the variables of an axis. Raises InputError for a controller other than a cascade."""
        gain = ask("slvkp", "SLVKP that makes the gain kp of the stage", "65", Number(positive, "65"))
        zone, held = dict[str, float](), frozenset({"kv", "kp", "velocity_feedforward"})
        if name := self._window(flat):
            key, (_, unit) = f"controller.{name}", ask.length("a position of 1 in the user's unit", '"1 mm"')
            zone = {"SLDZMIN": flat[key] / unit, "SLDZMAX": flat.get(f"{key}_exit", flat[key]) / unit}
            if (time := flat.get(f"{key}_time")) is not None:
                what = f"SLDZTIME that makes {time * 1e3:g} ms"
                zone["SLDZTIME"] = ask("sldztime", what, "1", Number(positive, "1"))
            held |= {name, f"{name}_exit", f"{name}_time"}
        self.refuse_other(flat)
        return Parameters({"SLPKP": flat["controller.kv"], "SLVKP": gain, **zone}, held)


class Twincat(CascadeDrive):
    """The position loop of the NC commands a velocity every cycle: Kv e + f r', with f = PriorControlFactor.

    Within DeadBandPosition the error counts as 0; what is left of a larger one is asked for. Kv is asked for too, as no
    public page names it in the file, and so is the velocity loop, which the drive has. A drive that is commanded by
    positions has the position loop as well, and is refused.
    """

    title, suffix = "TwinCAT NC axis (.xti)", ".xti"
    firmware = "TwinCAT 3 NC PTP, position control"
    source = "Beckhoff Information System, TF50x0, Position Control Loop"
    structure = "a proportional position loop above the drive's velocity loop"
    band, ahead = "PID.DeadBandPosition", "PriorControlFactor"

    def recognises(self, text: str) -> bool:
        """Tell whether a text is an axis of a TwinCAT NC."""
        return 'ClassName="CNcAxisDef"' in text or ("<Axis " in text and "<CtrPara" in text)

    def axes(self, text: str) -> tuple[AxisParameters, ...]:
        """Return the axes with a controller. Raises InputError for a text that is no XML, or has no such axis."""
        root = root_of(text, "as TwinCAT writes it for an axis")
        links = [(link.get("VarA", ""), link.get("VarB", "")) for link in root.iter("Link")]
        positions = [to for output, to in links if "nDataOut1" in output and "osition" in to]
        every = []
        for axis in root.iter("Axis"):
            values: dict[str, Any] = {"commanded": positions[0]} if positions else {}
            for parent in (*axis.iter("CtrPara"), *axis.iter("EncPara")):
                before = "" if parent.tag == "CtrPara" else "EncPara."
                values |= {f"{before}{name}": text for name, text in parent.items()}
                values |= {f"{part.tag}.{name}": text for part in parent for name, text in part.items()}
            if axis.find("Controller") is not None:
                name = (axis.findtext("Name") or "__FILENAME__").strip()
                unnamed = f"axis {axis.get('Id', '')}".strip()
                every.append(AxisParameters(unnamed if name == "__FILENAME__" else name, values))
        if not every:
            expected, example = "a file as TwinCAT writes it for an axis", "<Controller><CtrPara/></Controller>"
            raise InputError("", "no axis with a controller", expected, example)
        return tuple(every)

    def _length(self, ask: Ask) -> tuple[AxisKind, float]:
        """Return the kind of axis, and the length of a position of 1 [m or rad]."""
        return ask.length("a position of 1 of the axis (usually 1 mm or 1 deg)", '"1 mm"')

    def stage(self, axis: AxisParameters, ask: Ask) -> AsStage:
        """Turn an axis and the answers into a stage.

        Raises InputError for unusable numbers, and for a drive that is commanded by positions.
        """
        if commanded := axis.values.get("commanded"):
            expected = "a drive that the NC commands by velocity; else the position loop is the drive's"
            raise InputError("Link", f"{quoted(str(commanded))}, to which the NC writes positions", expected)
        held = ", ".join(f"{name} = {value}" for name, value in axis.values.items() if name.startswith("PID."))
        ask("controller.kv", f"factor Kv of the position control{held and f' (the file has {held})'}", '"20 1/s"')
        meaning = "gain of the drive's velocity loop; its integral time: controller.velocity_integral_time"
        self.velocity_loop(ask, ask.kind(LENGTH), meaning)
        ask(POSITION_TIME, "cycle of the NC task", '"2 ms"')
        ask(SAMPLE_TIME, "period of the drive's velocity loop, of which that is a multiple", '"125 us"')
        kind, unit = self._length(ask)
        table: dict[str, Any] = {"kind": "cascade", "velocity_feedforward": axis.number(self.ahead, 1.0)}
        if axis.is_set(self.band):
            table |= deadband(ask, axis, self.band, DriveUnits(kind, length=unit))
        left = ["limits of the command, and how it follows the NC's own delays"]
        if strange := [name for name in axis.values if name.startswith("PID.") and name != self.band]:
            left.append(f"{', '.join(strange)}: no public page tells what they are")
        return self.as_stage(ask, axis, kind, left, controller=table, drive=self._encoder(axis, unit, kind))

    def _encoder(self, axis: AxisParameters, unit: float, kind: AxisKind) -> dict[str, str]:
        """Return the resolution of the encoder. Raises InputError for one that is not positive."""
        part, whole = "EncPara.ScaleFactorNumerator", "EncPara.ScaleFactorDenominator"
        if not axis.is_set(part):
            return {}
        parts = axis.number(whole, 1.0)
        step = axis.number(part) / parts if parts else 0.0
        if step <= 0:
            raise InputError(whole, f"{parts:g}", "a positive length of an increment", f'{part}="5e-5"')
        return {"encoder_resolution": si(step * unit, kind.unit("m"))}

    def parameters(self, flat: FlatStage, ask: Ask) -> Parameters:
        """Compute the parameters of an axis. Raises InputError for another controller than the drive's."""
        _, unit = self._length(ask)
        self.refuse_other(flat)
        values = {"Kv": flat["controller.kv"], self.ahead: flat["controller.velocity_feedforward"]}
        held = frozenset({"kv", "kp", "velocity_integral_time", "velocity_feedforward"})
        if "controller.error_deadband_gain" in flat or (band := deadband_back(flat)) is None:
            return Parameters(values, held)
        return Parameters({**values, self.band: band[0] / unit}, held | band[1])

    def text(self, settings: Mapping[str, float]) -> str:
        """Write the position control of an axis; Kv stands in a comment, to be entered by hand."""
        band = f'<PID DeadBandPosition="{settings[self.band]:.12g}"/>' if self.band in settings else ""
        control = f'<CtrPara {self.ahead}="{settings[self.ahead]:.12g}">{band}</CtrPara>'
        axis = f'<Axis Id="1">\n<Controller Name="Ctrl">\n{control}\n</Controller>\n</Axis>'
        return f'<TcSmItem ClassName="CNcAxisDef">\n<!-- Kv = {settings["Kv"]:.12g} 1/s -->\n{axis}\n</TcSmItem>\n'


class Ecmc(CascadeDrive):
    """Position loop, every cycle of the bus: velocity = Kp e + I + Kd (e - e before) + Kff r'.

    I grows by Ki e a cycle, and both are limited alone. Within inner.tol of the target other gains act; when the error
    has stayed within deadband.tol at the target, the command is 0 and I is emptied. The drive's velocity loop goes on
    meanwhile. It has its gain in mA per rad/s and its integral time in 0.1 ms (Beckhoff EL72xx), in the commands that
    set the motor.
    """

    title, suffix = "ecmc axis", ".yaml"
    firmware = "ecmc's position loop and Beckhoff EL72xx"
    source = "ecmcPIDController.cpp of epics-modules/ecmc"
    gain, time, most, constant = "MOT_VELO_KP", "MOT_VELO_TI", "MOT_I_MAX_MA", "MOT_TRQ_CONST_MNM_P_A"
    dead_band, inner, target = "controller.deadband.tol", "controller.inner.tol", "monitoring.target"
    cycle = "cycle of the bus, in which ecmc controls the position"
    in_loop: ClassVar[Mapping[str, bool]] = {"windows_in_position_loop": True, "windows_at_rest": True}
    """Keys of [controller] with which windows act where ecmc has them."""

    def recognises(self, text: str) -> bool:
        """Tell whether a text is the axis of an ecmc, or commands that set the velocity loop of its motor."""
        is_axis = re.search(r"^controller:", text, re.MULTILINE) and re.search(r"^[ \t]+Kp:", text, re.MULTILINE)
        return bool(is_axis) or f"epicsEnvSet({self.gain}" in text.replace('"', "")

    def axes(self, text: str) -> tuple[AxisParameters, ...]:
        """Return the only axis of a file. Raises InputError for a line that is neither YAML nor a command."""
        sets = r"[ \t]*epicsEnvSet\([ \t]*\"?(\w+)\"?[ \t]*,[ \t]*+\"?([^\"),]*+)\"?[ \t]*\)[ \t]*(?:#.*)?"
        values: dict[str, Any] = {}
        above: list[tuple[int, str]] = []
        for number, line in enumerate(text.splitlines(), 1):
            if not line.strip() or line.lstrip().startswith("#"):
                continue
            if command := re.fullmatch(sets, line):
                values[command[1]] = command[2].strip()
            elif entry := re.fullmatch(r"( *)([A-Za-z_]\w*):([^#\n]*)(?:#.*)?", line.rstrip()):
                above = [one for one in above if one[0] < len(entry[1])]
                values[".".join([*(name for _, name in above), entry[2]])] = entry[3].strip().strip("\"'")
                above.append((len(entry[1]), entry[2]))
            elif not re.match(r"[ \t]*(?:-|<|\$|require|iocsh|ecmc|dbLoad|\w+\()", line):
                raise InputError(f"line {number}", quoted(line.strip()), "a key and its value", "Kp: 15.0")
        return (AxisParameters(f"axis {values.get('axis.id', '')}".strip(), values),)

    def stage(self, axis: AxisParameters, ask: Ask) -> AsStage:
        """Turn an axis and the answers into a stage.

        Raises InputError for unusable numbers, and for a derivative gain.
        """
        left = ["what ecmc's own limits of the output do: they clip it, and its integral goes on"]
        kind = ask.kind(LENGTH, TRAVEL)
        if self.gain in axis.values:
            kind, table = self._motor(axis, ask)
        else:
            table, more = self._axis(axis, ask, kind)
            left += more
        self._cycle(ask)
        ask(SAMPLE_TIME, "period of the drive's velocity loop, of which that is a multiple", '"125 us"')
        return self.as_stage(ask, axis, kind, left, controller={"kind": "cascade", **table})

    def _cycle(self, ask: Ask, field: Quantity | None = None) -> Any:
        """Ask for the cycle of the bus [s]."""
        return ask(POSITION_TIME, self.cycle, '"1 ms"', field)

    def _turn(self, ask: Ask, flat: FlatStage) -> DriveUnits:
        """Return N m and turns of the motor."""
        what = "what one turn of the motor moves"
        return torque(*ask.turn(what if flat else f"{what}; an angle on a rotary axis", '"10 mm"', flat))

    def _length(self, ask: Ask) -> tuple[AxisKind, float]:
        """Return the kind of axis, and the length of a position of 1 [m or rad]."""
        return ask.length("a position of 1 of the axis", '"1 mm"')

    def _motor(self, axis: AxisParameters, ask: Ask) -> tuple[AxisKind, dict[str, Any]]:
        """Return the kind of axis, and keys of [controller] for the velocity loop, from commands that set the motor."""
        units = self._turn(ask, {})
        kind, per_ampere = units.kind, axis.number(self.constant) * 1e-3 * units.force
        ask("controller.kv", "Kp of the axis's YAML file", '"15 1/s"')
        table = {"kp": si(axis.number(self.gain) * 1e-3 * per_ampere * units.force, kind.unit("N*s/m"))}
        if axis.is_set(self.time):
            table["velocity_integral_time"] = si(axis.number(self.time) * 1e-4, "s")
        if axis.is_set(self.most):
            table["force_limit"] = si(axis.number(self.most) * 1e-3 * per_ampere, kind.unit("N"))
        return kind, table

    def _axis(self, axis: AxisParameters, ask: Ask, kind: AxisKind) -> tuple[dict[str, Any], list[str]]:
        """Return keys of [controller] for the position loop, and what is left out."""
        self.velocity_loop(ask, kind)
        kp, ki = axis.number("controller.Kp"), axis.number("controller.Ki", 0.0)
        if axis.is_set(name := "controller.Kd"):
            raise InputError(name, f"{axis.number(name):g}", "0: friso's cascade has no derivative", "Kd: 0")
        if kp <= 0 or ki < 0:
            raise InputError("controller.Kp", f"{kp:g}", "a gain greater than 0, and Ki of 0 or more", "Kp: 15")
        table: dict[str, Any] = {"kv": si(kp, "1/s"), "velocity_feedforward": axis.number("controller.Kff", 1.0)}
        band = next((name for name in (self.dead_band, f"{self.target}.tolerance") if axis.is_set(name)), "")
        windows, left = dict[str, Any](), list[str]()
        if band or axis.is_set(self.inner):
            unit = self._length(ask)[1]
            length = lambda name: si(axis.number(name) * unit, kind.unit("m"))  # noqa: E731
            if band and self._watched(axis, ask):
                windows["freeze_window"] = length(band)
                time = "controller.deadband.time" if band == self.dead_band else f"{self.target}.time"
                if axis.is_set(time):
                    cycle = self._cycle(ask, Quantity("s", positive, "1 ms"))
                    windows["freeze_window_time"] = si(axis.number(time) * cycle, "s")
            elif band == self.dead_band:
                left.append(f"{band} = {axis.number(band):g}: it does not act, as the axis does not watch its target")
            if axis.is_set(self.inner):
                factors, words = self._inner(axis)
                windows |= {"standstill_window": length(self.inner), **factors} if factors else {}
                left.append(words)
        if ki:
            cycle = self._cycle(ask, Quantity("s", positive, "1 ms"))
            table["position_integral_time"] = si(kp * cycle / ki, "s")
        return {**table, **windows, **(self.in_loop if windows else {})}, left

    def _watched(self, axis: AxisParameters, ask: Ask) -> bool:
        """Tell whether the axis watches its target, as the file or the user says."""
        words = {
            "true": True,
            "yes": True,
            "on": True,
            "1": True,
            "false": False,
            "no": False,
            "off": False,
            "0": False,
        }
        told = words.get(str(axis.values.get(f"{self.target}.enabled", "")).lower())
        if told is not None:
            return told
        what = f"whether the axis watches its target ({self.target}.enabled): only then its dead band acts"
        return ask("target_monitoring", what, "on", ("on", "off")) == "on"

    def _inner(self, axis: AxisParameters) -> tuple[dict[str, float], str]:
        """Return factors of the gains near the target, none if a stage cannot have them; and what is left out."""
        (p, own_p), (i, own_i), (d, _) = (
            (axis.number(f"controller.inner.{part}", 0.0), axis.number(f"controller.{part}", 0.0))
            for part in ("Kp", "Ki", "Kd")
        )
        if p <= 0 or d != 0 or (own_i <= 0 and i != 0):
            return {}, (
                f"{self.inner} = {axis.number(self.inner):g}: gains of 0, of a derivative, or of an integral that the "
                "axis has not elsewhere, and friso's results for swings that small do not hold for this axis"
            )
        factors = {"standstill_factor": p / own_p, **({"standstill_integral_factor": i / own_i} if own_i else {})}
        return factors, "inner gains in the last part of a move, within inner.tol of its end: here they act at rest"

    def _windows(self, flat: FlatStage) -> list[str]:
        """Return the windows of the stage's position loop that an axis can have."""
        others = {
            "freeze_window": ("freeze_window_exit",),
            "standstill_window": ("standstill_window_time", "standstill_window_exit"),
        }
        if not flat.get("controller.windows_in_position_loop"):
            return []
        held = [name for name in others if f"controller.{name}" in flat]
        return [name for name in held if not any(f"controller.{other}" in flat for other in others[name])]

    def parameters(self, flat: FlatStage, ask: Ask) -> Parameters:
        """Compute the gains of both loops. Raises InputError for a controller other than a cascade."""
        force, what = self._turn(ask, flat).force, "torque constant of the motor in mN m/A"
        constant = ask(self.constant.lower(), what, "96", Number(positive, "96"))
        windows = self._windows(flat)
        unit = self._length(ask)[1] if windows else 1.0
        cycle = flat.get(POSITION_TIME, flat.get(SAMPLE_TIME))
        if cycle is None and ("controller.position_integral_time" in flat or "freeze_window" in windows):
            ask(SAMPLE_TIME, self.cycle, '"1 ms"')  # gains are per cycle
        cycle = cycle or 1.0
        if flat["controller.kind"] != "cascade":
            raise lacks(f'kind = "{flat["controller.kind"]}"', "a cascade, the only structure of ecmc and its drive")
        of = {key.removeprefix("controller."): value for key, value in flat.items() if key.startswith("controller.")}
        integral = of.get("position_integral_time")
        values = {"Kp": of["kv"], "Ki": of["kv"] * cycle / integral if integral else 0.0}
        values |= {"Kff": of["velocity_feedforward"], self.gain: of["kp"] / force**2 / (constant * 1e-3) * 1e3}
        if (time := of.get("velocity_integral_time")) is not None:
            values[self.time] = time * 1e4
        held = {"kv", "kp", "position_integral_time", "velocity_integral_time", "velocity_feedforward", *windows}
        held |= self.in_loop.keys() if windows else set()
        if "freeze_window" in windows:
            values["deadband.tol"] = of["freeze_window"] / unit
            values["deadband.time"] = round(of.get("freeze_window_time", 0.0) / cycle)
            held.add("freeze_window_time")
        if "standstill_window" in windows:
            factor = of["standstill_factor"]
            own = of.get("standstill_integral_factor", factor)
            values |= {"inner.Kp": factor * values["Kp"], "inner.Ki": own * values["Ki"]}
            values["inner.tol"] = of["standstill_window"] / unit
            held |= {"standstill_factor", "standstill_integral_factor"}
        return Parameters(values, frozenset(held))

    def text(self, settings: Mapping[str, float]) -> str:
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
