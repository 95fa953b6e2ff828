"""Parameter files of drives: to stages by the formulas of their firmware, and back; and files that are refused."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import own_controller  # noqa: F401  (registers "pi-d")
import pytest
import sympy as sp
from inside import friso_inside

import friso
from friso.drives.ask import Ask
from friso.drives.drive import FORMATS
from friso.drives.gains import conversions, gains_of
from friso.drives.read import stage_from
from friso.equations.blocks import Loop
from friso.equations.component import state
from friso.equations.sampled import sampled_controller
from friso.equations.structure import controller_form
from friso.errors import InputError

EXAMPLES = Path(__file__).parents[1] / "examples"

AXIS = EXAMPLES / "drives" / "linuxcnc_torque_axis.ini"

MACHINE = {
    "masses.stage": "20 kg",
    "friction.static": "20 N",
    "friction.coulomb": "15 N",
    "friction.stribeck_velocity": "3 mm/s",
    "friction.stribeck_exponent": 2,
    "friction.bristle_stiffness": "2e6 N/m",
    "friction.bristle_damping": "1e3 N*s/m",
    "friction.viscous": "50 N*s/m",
}
ROTARY = {"masses.stage": "0.02 kg*m^2", "friction.model": "none"}

TORQUE = {**MACHINE, "force_per_output": "20 N"}
VELOCITY = {**MACHINE, "controller.kp": "900 N*s/m", "drive.sample_time": "125 us"}
SCREW = {**MACHINE, "travel_per_turn": "5 mm"}
HELD = {**SCREW, "motion.kind": "hold", "motion.duration": "1 s"}
"""What a file does not state, of axes in torque mode and in velocity mode, and of ODrives with a screw."""

GAINS = {"P": 4.0, "I": 80.0, "D": 0.06, "FF1": 0.001, "FF2": 4e-4, "DEADBAND": 0.002, "MAX_OUTPUT": 10.0}

CONTROL = {
    "control_mode": 3,
    "input_mode": 5,
    "pos_gain": 20.0,
    "vel_gain": 0.16,
    "vel_integrator_gain": 0.32,
    "vel_integrator_limit": 0.5,
    "inertia": 1e-4,
    "vel_limit": 10.0,
}
MOTOR = {"torque_constant": 0.04, "current_lim": 20.0, "torque_lim": float("inf"), "current_control_bandwidth": 1000.0}


def ini(folder: Path, gains: dict[str, Any], unit: str = "mm", joint: str = "TYPE = LINEAR") -> Path:
    """A LinuxCNC file with one joint."""
    kind = "ANGULAR_UNITS" if "ANGULAR" in joint else "LINEAR_UNITS"
    lines = [f"{name} = {value}" for name, value in gains.items()]
    head = ["[EMCMOT]", "SERVO_PERIOD = 1000000", "[TRAJ]", f"{kind} = {unit}", "[JOINT_0]", joint, "# a comment"]
    path = folder / "machine.ini"
    path.write_text("\n".join([*head, "MAX_VELOCITY = 100", "MAX_ACCELERATION = 1000", *lines, ""]))
    return path


def backup(folder: Path, **changes: Any) -> Path:
    """An ODrive configuration; changes are of controller.config."""
    parts = {
        "motor": MOTOR,
        "encoder": {"cpr": 8192, "bandwidth": 1000.0},
        "controller": {**CONTROL, **changes},
        "trap_traj": {"vel_limit": 2.0, "accel_limit": 20.0, "decel_limit": 20.0},
    }
    path = folder / "odrive.json"
    path.write_text(json.dumps({"axis0": {name: {"config": part} for name, part in parts.items()}}))
    return path


def test_the_example_is_an_axis_in_torque_mode(tmp_path: Path) -> None:
    """All that is not in the file is asked for at once, and nothing is written until it is answered."""
    command = ("init", "axis.toml", "--from", AXIS)
    unanswered = friso_inside(tmp_path, *command)
    assert unanswered.returncode == 2
    asked = re.findall(r"^ +--set ([a-z_.]+)=", unanswered.stderr, re.MULTILINE)
    assert asked[0] == "force_per_output"
    assert {*asked[1:]} == {*MACHINE}
    assert not list(tmp_path.iterdir())
    options = [part for key, value in MACHINE.items() for part in ("--set", f"{key}={value}")]
    command = (*command, "--set", "force_per_output=60 N", *options)
    done = friso_inside(tmp_path, *command)
    assert done.returncode == 0
    (left_out,) = done.stderr.splitlines()
    assert "error-previous-target" in left_out
    flat = friso.load(tmp_path / "axis.toml").flat()
    assert flat["controller.kp"] == pytest.approx(2.0 * 60 / 1e-3)
    assert flat["controller.error_deadband"] == pytest.approx(0.5e-6)
    assert flat["drive.sample_time"] == pytest.approx(0.5e-3)
    assert flat["motion.acceleration"] == pytest.approx(2.0)
    again = friso_inside(tmp_path, *command)
    assert (again.returncode, "nothing was overwritten" in again.stderr) == (2, True)


@pytest.mark.parametrize(
    ("unit", "joint", "force", "answers"),
    [
        ("mm", "TYPE = LINEAR", "20 N", MACHINE),
        ("inch", "TYPE = LINEAR", "20 N", MACHINE),
        ("deg", "TYPE = ANGULAR", "3 N*m", ROTARY),
    ],
)
def test_torque_mode_there_and_back(tmp_path: Path, unit: str, joint: str, force: str, answers: dict[str, Any]) -> None:
    more, path = {"force_per_output": force}, ini(tmp_path, {**GAINS, "MAX_ERROR_I": 0.01}, unit, joint)
    text = stage_from(path, None, {**answers, **more}).text()
    stage, size = friso.loads(text), {"mm": 1e-3, "inch": 0.0254, "deg": np.pi / 180}[unit]
    assert stage.flat()["controller.kp"] == pytest.approx(GAINS["P"] * float(force.split()[0]) / size)
    back = gains_of(stage, {**more, "machine_unit": unit}, "linuxcnc").parameters
    assert {name: back[name] for name in GAINS} == pytest.approx(GAINS)
    assert back["MAX_ERROR_I"] == pytest.approx(0.01)


def test_a_variable_that_stands_twice_counts_once_and_is_named(tmp_path: Path) -> None:
    """The first value counts, as in LinuxCNC. Comments may be in Latin-1."""
    path = ini(tmp_path, {"P": 50, "I": 100})
    expected = stage_from(path, None, TORQUE)
    twice = "P = 1\nP = 2\n" + path.read_text().replace("[JOINT_0]", "# für die Achse, in µm\n[JOINT_0]")
    path.write_bytes(f"{twice}\nP = 60\nI = 100\n".encode("latin-1"))
    stage = stage_from(path, None, TORQUE)
    assert stage.stage.flat() == expected.stage.flat()
    (repeated,) = {*stage.left_out} - {*expected.left_out}
    assert " of P, " in repeated


@pytest.mark.parametrize(
    ("usual", "written", "times"),
    [
        ("P = 50", "P = 50   # was 30", 1),
        ("SERVO_PERIOD = 1000000", "SERVO_PERIOD = 1000000 ; ns", 1),
        ("[JOINT_0]", "[JOINT_0]  # X", 1),
        ("LINEAR_UNITS = mm", "LINEAR_UNITS = 1.0", 1),
        ("LINEAR_UNITS = mm", "LINEAR_UNITS = 0.03937007874016", 25.4),
        ("LINEAR_UNITS = mm\n[JOINT_0]", "[JOINT_0]\nUNITS = inch", 25.4),
        ("TYPE = LINEAR", "TYPE = LINEAR\nUNITS = 1.0", 1),
        ("[TRAJ]", "#INCLUDE traj.inc\n[TRAJ]", 1),
    ],
)
def test_files_are_written_in_several_ways(tmp_path: Path, usual: str, written: str, times: float) -> None:
    """Comments behind values and sections, units by their number in a millimetre or of the joint, other files taken
    in."""
    path = ini(tmp_path, {"P": 50, "I": 100})
    plain = path.read_text()
    assert usual in plain
    before = stage_from(path, None, TORQUE).stage.flat()
    path.write_text(plain.replace(usual, written))
    drawn = stage_from(path, None, TORQUE)
    flat = drawn.stage.flat()
    assert flat["controller.kp"] == pytest.approx(before["controller.kp"] / times)
    assert flat["motion.acceleration"] == pytest.approx(before["motion.acceleration"] * times)
    assert flat["drive.sample_time"] == pytest.approx(before["drive.sample_time"])
    assert any("traj.inc" in sentence for sentence in drawn.left_out) == ("INCLUDE" in written)


@pytest.mark.parametrize("name", ["joints.inc", "below/joints.inc", "../outside.inc", "/etc/hostname", "beside.inc"])
def test_what_include_names_is_read_inside_the_folder_alone(tmp_path: Path, name: str) -> None:
    """A link to outside is not followed either. An included file may not include others, as in LinuxCNC."""
    folder = tmp_path / "machine"
    (folder / "below").mkdir(parents=True)
    path = ini(folder, {})
    for place in ("joints.inc", "below/joints.inc", "../outside.inc"):
        (folder / place).write_text("P = 70\n#INCLUDE more.inc\n")
    (folder / "more.inc").write_text("I = 5\n")
    (folder / "beside.inc").symlink_to(tmp_path / "outside.inc")
    path.write_text(f"{path.read_text()}#INCLUDE {name}\n")
    if not name.endswith("joints.inc"):
        with pytest.raises(InputError, match=re.escape(name)):
            stage_from(path, None, TORQUE)
        return
    drawn = stage_from(path, None, TORQUE)
    assert drawn.stage.flat()["controller.kp"] == pytest.approx(70 * 20 / 1e-3)
    assert drawn.stage.flat()["controller.ki"] == 0
    assert not any("INCLUDE" in sentence for sentence in drawn.left_out)


def test_units_that_contradict_each_other_are_asked_for(tmp_path: Path) -> None:
    path = ini(tmp_path, {"P": 50}, joint="UNITS = inch")
    flat = stage_from(path, None, {**TORQUE, "machine_unit": "inch"}).stage.flat()
    assert flat["controller.kp"] == pytest.approx(50 * 20 / 0.0254)


def test_velocity_mode_there_and_back(tmp_path: Path) -> None:
    """The output is in machine units per second, as FF1 = 1 shows.

    An axis with a step generator and an encoder is a servo axis as well.
    """
    gains = {"P": 50.0, "I": 10.0, "FF1": 1.0, "DEADBAND": 0.001}
    others = {"BIAS": 0.5, "STEPGEN_MAXVEL": 104.17, "ENCODER_SCALE": 4000.0, "HOME_OFFSET": 2.0}
    others |= {"OUTPUT_SCALE": 250.0, "BACKLASH": 0.01, "FF9": 3.0, "DEDBAND": 0.1}
    loop = {"controller.velocity_integral_time": "8 ms"}
    drawn = stage_from(ini(tmp_path, gains | others), None, {**VELOCITY, **loop})
    times = [drawn.stage.flat()[f"drive.{name}"] for name in ("sample_time", "position_sample_time")]
    assert times == pytest.approx([125e-6, 1e-3])
    for start in ("BIAS = 0.5", "BACKLASH = 0.01", "OUTPUT_SCALE = 250", "FF9, DEDBAND: ", "the scale of the output"):
        assert sum(sentence.startswith(start) for sentence in drawn.left_out) == 1
    assert "velocity_per_output" in " ".join(drawn.left_out)
    back = gains_of(drawn.stage, {"machine_unit": "mm", "velocity_per_output": "1 mm/s"}, "linuxcnc").parameters
    assert {name: back[name] for name in gains} == pytest.approx(gains)


def _asked(path: Path, answers: dict[str, Any]) -> list[str]:
    """The keys that are asked for."""
    with pytest.raises(InputError, match="missing") as refused:
        stage_from(path, None, answers)
    return re.findall(r"^ *--set ([a-z_.]+)=", refused.value.expected, re.MULTILINE)


def test_the_mode_of_an_axis_is_told_before_anything_is_asked(tmp_path: Path) -> None:
    """FF1 = 1 without a D is velocity mode, in which its loop is asked for; with a D it is torque mode."""
    velocity = ini(tmp_path, {"P": 50.0, "FF1": 1.0})
    assert _asked(velocity, MACHINE) == ["controller.kp", "drive.sample_time"]
    assert "drive.sample_time" not in _asked(velocity, {"force_per_output": "20 N"})
    torque = ini(tmp_path, {"P": 50.0, "FF1": 1.0, "D": 0.1})
    assert _asked(torque, MACHINE) == ["force_per_output"]


def test_an_output_in_volts_has_a_scale(tmp_path: Path) -> None:
    """P and FF1 of an output of which 1 makes 5 mm/s; without the scale they are not known."""
    path = ini(tmp_path, {"P": 50.0, "I": 10.0, "FF1": 0.2})
    with pytest.raises(InputError, match="velocity_per_output"):
        stage_from(path, None, VELOCITY)
    drawn = stage_from(path, None, {**VELOCITY, "velocity_per_output": "5 mm/s"})
    flat = drawn.stage.flat()
    assert flat["controller.kv"] == pytest.approx(250.0)
    assert flat["controller.velocity_feedforward"] == pytest.approx(1.0)
    assert flat["controller.position_integral_time"] == pytest.approx(5.0)
    assert not any("velocity_per_output" in sentence for sentence in drawn.left_out)
    # the drawn stage contains the answer, which is not asked for again
    back = gains_of(friso.loads(drawn.text()), {}, "linuxcnc").parameters
    assert [back[name] for name in ("P", "I", "FF1")] == pytest.approx([50.0, 10.0, 0.2])
    uncertain = drawn.stage.replace({"drive.velocity_per_output": "5 mm/s +/- 1 mm/s"})
    assert gains_of(uncertain, {}, "linuxcnc").parameters == pytest.approx(back)
    with pytest.raises(InputError, match="velocity_per_output"):
        gains_of(drawn.stage.replace({"drive.velocity_per_output": None}), {}, "linuxcnc")


def test_the_commands_are_those_of_the_component_pid(tmp_path: Path) -> None:
    """A drive with the stage's controller against the formulas of LinuxCNC, written down by hand; at their limits the
    integrals of the two stop a sample apart."""
    gains = {name: value for name, value in GAINS.items() if name != "MAX_OUTPUT"}
    drawn = stage_from(ini(tmp_path, gains), None, {**MACHINE, "force_per_output": "20 N"})
    flat, period, unit = drawn.stage.flat(), 1e-3, 1e-3
    times = np.arange(400) * period
    command, feedback = 5 * np.sin(8 * times), 5 * np.sin(8 * times - 0.03) + 0.02 * np.cos(90 * times)
    names = ("e", "y", "r_rate", "r_bend")
    e, y, rate, bend = sp.symbols(names, real=True)
    loop = Loop(e, y, sp.S.Zero, rate, bend)
    force, held = sampled_controller(controller_form(flat), loop, 1)
    parts = (force, *(number.update for number in held))
    keys = {symbol: flat[str(symbol)] for part in parts for symbol in part.free_symbols if str(symbol) in flat}
    clip = {"clipped": lambda value, end: min(max(value, -end), end)}
    once = sp.lambdify([e, y, rate, bend, *keys, *(number.symbol for number in held)], parts, [clip, "math"])
    kept = [feedback[0] * unit if number.symbol == state("position_before_1") else 0.0 for number in held]
    total, speeds = 0.0, (0.0, 0.0)
    for k in range(len(times)):
        before = max(k - 1, 0)
        speed = (command[k] - command[before]) / period
        acceleration = (speed - speeds[0]) / period
        error = command[k] - feedback[k]
        slope = speed - (feedback[k] - feedback[before]) / period
        dead = error - min(max(error, -gains["DEADBAND"]), gains["DEADBAND"])
        total += dead * period
        output = gains["P"] * dead + gains["I"] * total + gains["D"] * slope
        output += gains["FF1"] * speed + gains["FF2"] * acceleration
        speeds = (speed, speeds[0])
        row = (error * unit, feedback[k] * unit, speed * unit, acceleration * unit)
        ours, *kept = once(*row, *keys.values(), *kept)
        assert ours == pytest.approx(20 * output, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("travel", ["5 mm", "360 deg"])
def test_odrive_there_and_back(tmp_path: Path, travel: str) -> None:
    turn = {"travel_per_turn": travel}
    labels = {**(MACHINE if travel == "5 mm" else ROTARY), **turn}
    drawn = stage_from(backup(tmp_path), None, labels)
    back = gains_of(friso.loads(drawn.text()), turn, "odrive").parameters
    names = ("input_mode", "pos_gain", "vel_gain", "vel_integrator_gain", "inertia", "vel_integrator_limit")
    assert [back[f"controller.config.{name}"] for name in names] == pytest.approx([CONTROL[name] for name in names])
    assert back["encoder.config.bandwidth"] == back["motor.config.current_control_bandwidth"] == pytest.approx(1000.0)
    lines = tmp_path / "parameters.txt"
    scheduling = "odrv0.axis0.controller.config.enable_gain_scheduling = False"
    lines.write_text(f"# kept\n{FORMATS['odrive'].text(back)}{scheduling}\n")
    again = stage_from(lines, None, {**labels, "motion.kind": "hold", "motion.duration": "1 s"})
    assert not any("gain_scheduling" in sentence for sentence in again.left_out)
    assert gains_of(friso.loads(again.text()), turn, "odrive").parameters == pytest.approx(back)
    assert back["motor.config.torque_lim"] == pytest.approx(0.04 * 20)


def test_an_odrive_exerts_the_force_of_its_torque(tmp_path: Path) -> None:
    """Turns and N m by the firmware's formula, against metres and newtons by the stage's."""
    key = {k.removeprefix("controller."): v for k, v in stage_from(backup(tmp_path), None, SCREW).stage.flat().items()}
    error, speed, wound = 3e-5, 0.01, 4e-5  # [m], [m/s], [m] of the velocity's error
    turns = [value / 5e-3 for value in (error, speed, wound)]
    torque = 0.16 * (20.0 * turns[0] - turns[1]) + 0.32 * turns[2]
    force = key["kp"] * (key["kv"] * error - speed) + key["kp"] / key["velocity_integral_time"] * wound
    assert force * 5e-3 == pytest.approx(torque * 2 * np.pi)  # work in a turn


def lines(folder: Path, **changes: str) -> Path:
    """Lines for odrivetool; changes are texts of controller.config and of motor.config."""
    settings = {
        "motor.config.torque_constant": "8.27 / 170",
        "motor.config.current_lim": "20",
        "controller.config.control_mode": "CONTROL_MODE_POSITION_CONTROL",
        "controller.config.input_mode": "InputMode.TRAP_TRAJ",
        "controller.config.pos_gain": "20.0",
        "controller.config.vel_gain": "0.16  # N m/(turn/s)",
        "controller.config.vel_integrator_gain": "0.32",
        "encoder.config.bandwidth": "2 * 500",
    }
    settings |= {key.replace("__", ".config."): text for key, text in changes.items()}
    path = folder / "lines.txt"
    path.write_text("".join(f"odrv0.axis0.{key} = {text}\n" for key, text in settings.items() if text))
    return path


ARITHMETIC = {
    "8.27 / 170": 8.27 / 170,
    "(1.5 + .5) * 2e3": 4e3,
    "2*math.pi*100": 200 * np.pi,
    "7": 7.0,
    "2**13": 8192.0,
}
NONE = "8.27 / kv|0.16 Nm|1 / 0|2 ** 9999|True|0x10|1_0|1,5|'3'|__import__('os')|f(1)|1 if 2 else 3|1\\|1j|(-8)**0.5"
NONE += "|2 * (-8)**(1/3) + 1|-(-8)**0.5|9**9**9**9|0**-1|" + "(" * 150 + "|" + "9" * 201


def test_arithmetic_of_numbers_is_worked_out_and_nothing_else(tmp_path: Path) -> None:
    for text, number in ARITHMETIC.items():
        flat = stage_from(lines(tmp_path, controller__pos_gain=text), None, HELD).stage.flat()
        assert flat["controller.kv"] == pytest.approx(number), text
    for text in NONE.split("|"):
        with pytest.raises(InputError):
            stage_from(lines(tmp_path, controller__pos_gain=text), None, HELD)
    for text in ("inf", "float('inf')", 'float("inf")', "math.inf"):
        stage_from(lines(tmp_path, controller__vel_limit=text), None, HELD)


def test_a_script_for_an_odrive_says_what_its_arithmetic_and_its_symbols_make(tmp_path: Path) -> None:
    path = lines(tmp_path)
    text, flat = path.read_text(), stage_from(path, None, HELD).stage.flat()
    assert flat["controller.force_limit"] == pytest.approx(20 * 8.27 / 170 * 2 * np.pi / 5e-3)
    assert flat["controller.velocity_feedforward"] == 1.0
    assert flat["controller.filters.1.frequency"] == pytest.approx(1000 / (2 * np.pi))
    path.write_text(f"import odrive\nodrv0 = odrive.find_any()\n{text}odrv0.save_configuration() # kept\n")
    assert stage_from(path, None, HELD).stage.flat() == flat
    path.write_text(text + text.replace("odrv0", "odrv1").replace("= 20.0", "= 30.0"))
    for axis, gain in (("odrv0.axis0", 20.0), ("odrv1.axis0", 30.0)):
        assert stage_from(path, axis, HELD).stage.flat()["controller.kv"] == gain


def test_where_nothing_tells_turns_from_counts_it_is_asked(tmp_path: Path) -> None:
    names = ("motor__torque_constant", "motor__current_lim", "controller__input_mode", "controller__control_mode")
    path = lines(tmp_path, **dict.fromkeys(names, ""))
    assert _asked(path, HELD) == ["gains_in"]
    flat = stage_from(path, None, {**HELD, "gains_in": "turns"}).stage.flat()
    assert flat["controller.kv"] == 20.0
    with pytest.raises(InputError, match="counts"):
        stage_from(path, None, {**HELD, "gains_in": "counts"})


def _tokens(text: str) -> list[tuple[int, int]]:
    """Return the spans of all values: after an equals sign or a colon, up to a comma or the line's end."""
    return [match.span(1) for match in re.finditer(r"[=:] *([\w.+-]+)(?= *[,}#\n])", text)]


@pytest.mark.parametrize("kind", ["linuxcnc", "json", "lines"])
def test_a_token_that_is_not_understood_is_quoted_before_anything_is_asked(tmp_path: Path, kind: str) -> None:
    """Whichever it is, of those that are read."""
    files = {
        "linuxcnc": lambda: ini(tmp_path, {**GAINS, "MAX_ERROR_I": 0.01}),
        "json": lambda: backup(tmp_path, enable_gain_scheduling=False, load_encoder_axis=0, vel_limit_tolerance=1.2),
        "lines": lambda: lines(tmp_path, controller__enable_gain_scheduling="False", controller__vel_ramp_rate="10"),
    }
    path = files[kind]()
    text = path.read_text()
    unquoted = []
    for start, end in _tokens(text):
        strange = f"{text[start:end]}.q"
        path.write_text(text[:start] + (f'"{strange}"' if kind == "json" else strange) + text[end:])
        with pytest.raises(InputError) as refused:
            stage_from(path, None, {"force_per_output": "20 N"} if kind == "linuxcnc" else {})
        unquoted += [] if strange in refused.value.actual else [text[start:end]]
    assert unquoted == {"linuxcnc": [], "json": ["8192", "1.2"], "lines": ["10"]}[kind]  # those that nothing reads


def test_gains_in_the_units_of_drives() -> None:
    stage = friso.load(EXAMPLES / "twincat_cascade.toml")
    labels = {"travel_per_turn": "10 mm", "motor_constant": "0.5 N*m/A"}
    rows = {row.symbol: {unit: value for value, unit in row.values} for row in conversions(stage.flat(), Ask(labels))}
    lever = 10e-3 / (2 * np.pi)
    assert rows["kv"]["(m/min)/mm"] == pytest.approx(1.5)
    assert rows["Tn"]["ms"] == pytest.approx(40.0)
    assert rows["kp"]["N*m/(rad/s)"] == pytest.approx(90 * lever**2)
    assert rows["kp"]["A/rpm"] == pytest.approx(90 * lever**2 / 0.5 * 2 * np.pi / 60)
    assert rows["kp"]["A*s/m"] == pytest.approx(90 * lever / 0.5)


def test_a_pid_as_a_cascade_is_the_same_controller() -> None:
    gains = {"controller.kp": "500 N/mm", "controller.ki": "4.4e6 N/(m*s)"}
    stage = friso.load(EXAMPLES / "ball_screw_axis.toml").replace(gains)
    rows = {row.symbol: row.values[0][0] for row in conversions(stage.flat(), Ask({}))}
    kd, kv, time = rows["kd"], rows["kv"], rows["Tn"]
    assert kd * (kv + 1 / time) == pytest.approx(rows["kp"])
    assert kd * kv / time == pytest.approx(rows["ki"])


def test_export_writes_page_and_parameters(tmp_path: Path) -> None:
    stage = EXAMPLES / "twincat_cascade.toml"
    done = friso_inside(tmp_path, "export", stage, "--to", "odrive", "--set", "travel_per_turn=10 mm", "--out", "out")
    assert (done.returncode, done.stderr) == (0, "")
    assert "[ kp (1 + 1/(Tn s)) ]" in done.stdout
    assert "controller.filters.1" in done.stdout
    assert "vel_gain" in (tmp_path / "out" / "parameters.txt").read_text()
    assert "[ kp (1 + 1/(Tn s)) ]" in (tmp_path / "out" / "gains.html").read_text("utf-8")
    document = json.loads(friso_inside(tmp_path, "export", stage, "--json").stdout)
    assert document["gains"][0]["values"][0] == {"value": 25.0, "unit": "1/s"}


@pytest.mark.parametrize("to", [*FORMATS])
def test_a_controller_of_one_s_own_is_none_of_a_drive(to: str) -> None:
    stage = friso.load(EXAMPLES / "thesis_drive.toml").replace(
        {"controller": {"kind": "pi-d", "bandwidth": "6 Hz", "mass": "1.7 kg"}}
    )
    ask = Ask({})
    with pytest.raises(InputError, match='kind = "pi-d"'):
        FORMATS[to].parameters(stage.flat(), ask)
    examples = {question.key: question.example.strip('"') for question in ask.open}
    answers = {key: float(text) if text.isdigit() else text for key, text in examples.items()}
    with pytest.raises(InputError, match='kind = "pi-d"'):
        gains_of(stage, answers, to)


def test_what_is_left_out_is_told(tmp_path: Path) -> None:
    more = {"gain_scheduling_width": 0.01, "load_encoder_axis": 1}
    path = backup(tmp_path, enable_gain_scheduling=True, input_mode=1, **more)
    path.write_text(path.read_text().replace('"decel_limit": 20.0', '"decel_limit": 5.0'))
    drawn = stage_from(path, None, SCREW)
    settings = ("fall to 0 with the error", "decel_limit = 5", "load_encoder_axis = 1")
    for setting in settings:
        assert any(setting in text for text in drawn.left_out)
    assert all(f"# Left out: {text}" in drawn.text() for text in drawn.left_out)
    assert drawn.stage.flat()["controller.velocity_feedforward"] == 0.0
    mirrored = stage_from(backup(tmp_path, input_mode=7), None, SCREW)
    assert any("input_mode = 7" in text for text in mirrored.left_out)


@pytest.mark.parametrize(
    ("share", "mode", "lost"), [(1.0, 5, ()), (0.0, 1, ("acceleration",)), (0.8, 1, ("velocity", "acceleration"))]
)
def test_an_odrive_feeds_forward_along_its_own_trajectories(share: float, mode: int, lost: tuple[str, ...]) -> None:
    """The velocity whole and the acceleration, or neither."""
    keys = {"controller.velocity_feedforward": share}
    stage = friso.load(EXAMPLES / "twincat_cascade.toml").replace(keys)
    back = gains_of(stage, {"travel_per_turn": "10 mm"}, "odrive")
    assert back.parameters["controller.config.input_mode"] == mode
    assert ("controller.config.inertia" in back.parameters) == (share == 1.0)
    assert {key for key in back.not_held if "feedforward" in key} == {f"controller.{name}_feedforward" for name in lost}


def test_what_is_left_out_is_as_many_lines_as_friso_says(tmp_path: Path) -> None:
    strange = {f"x{k}\nfriso: all is well": 1 for k in range(2000)}
    left_out = stage_from(backup(tmp_path, load_encoder_axis=10**29, **strange), None, SCREW).left_out
    assert len(left_out) < 10
    assert all(len(text) < 2000 and "\n" not in text for text in left_out)


@pytest.mark.parametrize("name", ["transfer_function", "sections", "state_space", "sampled_transfer_function"])
def test_export_tells_every_coefficient(name: str) -> None:
    """A controller by coefficients has hardly a gain beside them; they are notes as the stage file has them."""
    stage = friso.load(friso.example(f"controllers/{name}"))
    notes = " ".join(friso.export(stage).to_dict()["notes"])

    written = {
        key: value
        for key, value in stage.as_written()["controller"].items()
        if key not in ("sample_time", "force_limit")
    }
    numbers = re.findall(r"-?\d+\.?\d*(?:e-?\d+)?", json.dumps(written))
    assert len(numbers) >= 6
    assert all(number in notes for number in numbers)


def test_export_tells_filters() -> None:
    notch = {"kind": "notch", "frequency": "120 Hz", "width": "60 Hz", "depth": 0.1}
    stage = friso.load(friso.example("thesis_rig"))
    notes = " ".join(friso.export(stage.replace({"controller.filters": [notch]})).sentences())
    assert 'frequency = "120 Hz"' in notes
    assert "filters" not in " ".join(friso.export(stage).sentences())
    by_gains = {"kind": "pid", "kp": "3 N/mm", "kd": "6 N*s/m", "derivative_on": "measurement"}
    assert 'derivative_on = "measurement"' in str(friso.export(stage.replace({"controller": by_gains})))
