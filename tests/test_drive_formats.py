"""Parameter files of drives: their gains in SI by hand, the way back, and texts that are none."""

from contextlib import suppress
from math import pi, radians
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from patience import grows_with_the_square

import friso
from friso.drives.ask import Ask
from friso.drives.drive import FORMATS
from friso.drives.gains import gains_of
from friso.drives.read import stage_from
from friso.errors import InputError

MOVE = {"motion.acceleration": "1 m/s^2", "motion.acceleration_time": "0.1 s"}
MACHINE = {"masses.stage": "3 kg", "friction.guess": "ball screw", "friction.coulomb": "6 N", **MOVE}
JOINT = {"masses.stage": "0.02 kg*m^2", "friction.model": "none", "motion.kind": "hold", "motion.duration": "1 s"}
CYCLES = {"drive.position_sample_time": "1 ms", "drive.sample_time": "125 us"}

TEXTS = {
    "kflop": "void main()\n{\n ch0->OutputMode=DAC_SERVO_MODE;\n ch0->P=2; /* of now */\n"
    " ch0->I=3e-5;\n ch0->D=10; // D\n ch0->MaxI=150;\n ch0->MaxOutput=2047;\n"
    " ch0->DeadBandRange=3;\n ch0->DeadBandGain=0.4;\n ch0->iir[0].B0=0.5;\n"
    " ch0->iir[0].B1=0.5;\n ch0->iir[0].A1=0.25;\n}\n",
    "moteus": "# kept\nservo.pid_position.kp 50\nservo.pid_position.ki 400\nservo.pid_position.kd 2\n"
    "servo.pid_position.ilimit 0.3\nservo.pid_position.iratelimit -1.0\nservo.max_position_slip nan\n",
    "icub": '<device name="torso"><group name="POSITION_CONTROL">\n<param name="kp"> 900 1200 </param>\n'
    '<param name="ki"> 0 9000 </param>\n<param name="kd"> 0 5 </param>\n<param name="maxOutput"> 4000 3000 </param>\n'
    '<param name="maxInt"> 700 800 </param>\n<param name="stictionUp"> 0 10 </param></group></device>\n',
    "ecmc": "# axis\naxis:\n  id: 2\ncontroller:\n  Kp: 12\n  Ki: 0.05\n  Kd: 0\n"
    "  deadband:\n    tol: 0.0004\n    time: 80\n  inner:\n    Kp: 4\n    Ki: 0.2\n    tol: 0.0015\n"
    "monitoring:\n  target:\n    enabled: true\n    tolerance: 0.0008\n",
    "twincat": '<TcSmItem ClassName="CNcAxisDef">\n<Axis Id="7">\n<Name>__FILENAME__</Name>\n'
    '<Encoder Name="Enc"><EncPara ScaleFactorNumerator="5e-05"/></Encoder>\n'
    '<Controller Name="Ctrl" CtrType="2"><CtrPara PriorControlFactor="0.9">\n'
    '<PosDiffControl Range="0.8"/><PID DeadBandPosition="0.002"/></CtrPara></Controller></Axis>\n'
    '<Mappings><Link VarA="Drive^Outputs^Out^nDataOut2[0]" VarB="STM Velocity^Velocity"/></Mappings></TcSmItem>\n',
    "acs": "! gains\nSLPKP(0)=140\nSLVKP(0)=65\nSLVKI(0)=150\nSLDZMIN(0)=0.0008\nSLDZMAX(0)=0.004\nSLDZTIME(0)=1\n"
    "SLAFF(0)=1500\nSTOP\n",
    "odrive": '{"axis0.config.motor.torque_constant": 0.06, "axis0.config.motor.current_soft_max": 18.0,\n'
    '"axis0.config.encoder_bandwidth": 1000.0, "axis0.controller.config.pos_gain": 18,\n'
    '"axis0.controller.config.vel_gain": 0.3, "axis0.controller.config.vel_integrator_gain": 1.2,\n'
    '"axis0.controller.config.enable_gain_scheduling": true,\n'
    '"axis0.controller.config.gain_scheduling_width": 0.015,\n'
    '"axis0.controller.config.gain_scheduling_min_ratio": 0.25,\n'
    '"axis0.controller.config.vel_integrator_limit": Infinity}\n',
}
ANSWERS: dict[str, dict[str, Any]] = {
    "kflop": {
        **{**MACHINE, "force_per_output": "0.05 N", "length_per_unit": "0.5 um"},
        "error_beyond_deadband": "reduced",
    },
    "moteus": {**MACHINE, "travel_per_turn": "10 mm", "drive.sample_time": "50 us"},
    "icub": {**JOINT, "force_per_output": "1 mN*m"},
    "ecmc": {**MACHINE, **CYCLES, "controller.kp": "5 kN*s/m", "length_per_unit": "1 mm"},
    "twincat": {
        **{**MACHINE, **CYCLES, "controller.kp": "5 kN*s/m", "controller.kv": "20 1/s", "length_per_unit": "1 mm"},
        "error_beyond_deadband": "whole",
    },
    "acs": {
        **{**MACHINE, "length_per_unit": "1 mm", "dead_zone": "error", "dead_zone_time": "1 ms"},
        "drive.sample_time": "50 us",
        "controller.kp": "5 kN*s/m",
        "controller.velocity_integral_time": "5 ms",
    },
    "odrive": {**MACHINE, "travel_per_turn": "10 mm", "gain_schedule": "clipped"},
}
TURN = 2 * pi / 0.01  # [N] for 1 N m on a screw with a lead of 10 mm
BY_HAND: dict[str, dict[str, float]] = {
    "kflop": {
        **{"kp": 2 * 0.05 / 5e-7, "ki": 3e-5 * 0.05 / 5e-7 / 90e-6, "kd": 10 * 0.05 / 5e-7 * 90e-6},
        **{"force_limit": 2047 * 0.05, "integral_limit": 150 * 0.05, "filters.1.denominator.1": -0.25},
        **{"error_deadband": 3 * 5e-7, "error_deadband_gain": 0.4},
    },
    "moteus": {"kp": 50 * TURN / 0.01, "ki": 400 * TURN / 0.01, "kd": 2 * TURN / 0.01, "integral_limit": 0.3 * TURN},
    "icub": {
        "kp": 1.2 / radians(1),
        "ki": 9.0 / radians(1),
        "kd": 5e-3 / radians(1),
        "force_limit": 3.0,
        "integral_limit": 0.8,
    },
    "ecmc": {
        **{"kv": 12.0, "position_integral_time": 12 * 1e-3 / 0.05, "kp": 5e3},
        **{"freeze_window": 4e-7, "freeze_window_time": 80e-3, "windows_in_position_loop": True},
        **{"standstill_window": 1.5e-6, "standstill_factor": 4 / 12, "standstill_integral_factor": 0.2 / 0.05},
    },
    "twincat": {
        **{"kv": 20.0, "kp": 5e3, "velocity_feedforward": 0.9},
        **{"error_deadband": 2e-6, "error_deadband_exit": 2e-6},
    },
    "acs": {
        **{"kv": 140.0, "kp": 5e3, "velocity_integral_time": 5e-3},
        **{"error_deadband": 8e-7, "error_deadband_exit": 4e-6, "error_deadband_time": 1e-3},
    },
    "odrive": {
        **{"kv": 18.0, "kp": 0.3 * TURN / 0.01, "velocity_integral_time": 0.25, "force_limit": 18 * 0.06 * TURN},
        **{"schedule_error.1": 0.25 * 0.015 * 0.01, "schedule_error.2": 0.015 * 0.01, "schedule_factor.1": 0.25},
    },
}
"""What the formula of each drive makes of its file, in SI; a joint of the second column for iCub."""


BACK = {"acs": {"slvkp": 65, "sldztime": 1}, "ecmc": {"travel_per_turn": "10 mm", "mot_trq_const_mnm_p_a": 96}}
"""What the way back asks for, beside the way from the file."""

ONLY_THERE = {"error_beyond_deadband", "dead_zone", "dead_zone_time"}
"""What the way back does not ask for, as the stage says it."""

SAME = {
    **dict.fromkeys(("kflop", "moteus", "icub"), ("kp", "ki", "kd")),
    "ecmc": ("kv", "position_integral_time"),
    "twincat": ("velocity_feedforward",),
    "acs": ("kv",),
    "odrive": ("kv", "kp", "velocity_integral_time"),
}
"""Keys that a file read again makes as before."""


def written(folder: Path, kind: str) -> Path:
    path = folder / f"axis{FORMATS[kind].suffix}"
    path.write_text(TEXTS[kind], "utf-8")
    return path


@pytest.mark.parametrize("kind", TEXTS)
def test_gains_are_those_by_hand_and_lead_back(tmp_path: Path, kind: str) -> None:
    read = stage_from(written(tmp_path, kind), "joint_1" if kind == "icub" else None, ANSWERS[kind])
    flat = friso.loads(read.text()).flat()
    for key, value in BY_HAND[kind].items():
        assert flat[f"controller.{key}"] == pytest.approx(value, rel=1e-9), key
    units = {key: value for key, value in ANSWERS[kind].items() if "." not in key and key not in ONLY_THERE}
    gains = gains_of(read.stage, units | BACK.get(kind, {}), kind)
    back = gains.parameters
    assert not [key for key in gains.not_held if any(part in key for part in CHANGED)]
    numbers = [f"{value:.12g}" for value in back.values()]
    text = FORMATS[kind].text(back)
    assert all(number in text for number in numbers)
    if kind == "odrive":
        text += "odrv0.axis0.motor.config.torque_constant = 0.06\n"
    if kind == "ecmc":
        text += "monitoring:\n  target:\n    enabled: true\n"
    path = tmp_path / f"again{FORMATS[kind].suffix}"
    path.write_text(text, "utf-8")
    again = stage_from(path, None, ANSWERS[kind]).stage.flat()
    windows = [key.removeprefix("controller.") for key in flat if any(part in key for part in CHANGED)]
    for key in (*SAME[kind], *windows):
        assert again[f"controller.{key}"] == pytest.approx(flat[f"controller.{key}"], rel=1e-9), key


CHANGED = ("window", "deadband", "standstill", "schedule")
"""Parts of the names of settings against friction."""


def test_the_settings_of_a_stage_that_was_changed_are_those_written_back(tmp_path: Path) -> None:
    """Windows and gains that the user has changed, in the units of the drive."""
    changes = {
        "ecmc": ({"freeze_window": "2 um", "standstill_factor": 0.5}, {"deadband.tol": 2e-3, "inner.Kp": 6.0}),
        "acs": ({"error_deadband_exit": "9 um"}, {"SLDZMAX": 9e-3}),
        "twincat": (
            {"error_deadband": "7 um", "error_deadband_exit": "7 um", "kv": "30 1/s"},
            {"PID.DeadBandPosition": 7e-3, "Kv": 30.0},
        ),
        "kflop": ({"error_deadband": "5 um", "error_deadband_gain": 0.1}, {"DeadBandRange": 10, "DeadBandGain": 0.1}),
        "odrive": (
            {"schedule_error": ["20 um", "200 um"], "schedule_factor": [0.1, 1]},
            {"controller.config.gain_scheduling_width": 0.02, "controller.config.gain_scheduling_min_ratio": 0.1},
        ),
    }
    for kind, (keys, parameters) in changes.items():
        stage = stage_from(written(tmp_path, kind), None, ANSWERS[kind]).stage
        stage = stage.replace({f"controller.{key}": value for key, value in keys.items()})
        units = {key: value for key, value in ANSWERS[kind].items() if "." not in key and key not in ONLY_THERE}
        back = gains_of(stage, units | BACK.get(kind, {}), kind).parameters
        assert {name: back[name] for name in parameters} == pytest.approx(parameters, rel=1e-9)


@pytest.mark.parametrize(
    ("kind", "keys", "lost"),
    [
        ("ecmc", {"freeze_window_exit": "9 um"}, "freeze_window"),
        ("acs", {"error_deadband_gain": 0.2}, "error_deadband_gain"),
        ("twincat", {"error_deadband_exit": "9 um"}, "error_deadband_exit"),
        ("kflop", {"error_deadband_time": "2 ms"}, "error_deadband"),
        ("odrive", {"schedule_factor": [0.3, 1.2]}, "schedule_factor.2"),
    ],
)
def test_settings_that_a_drive_cannot_hold_are_named(
    kind: str, keys: dict[str, Any], lost: str, tmp_path: Path
) -> None:
    stage = stage_from(written(tmp_path, kind), None, ANSWERS[kind]).stage
    stage = stage.replace({f"controller.{key}": value for key, value in keys.items()})
    units = {key: value for key, value in ANSWERS[kind].items() if "." not in key and key not in ONLY_THERE}
    ask = Ask({})
    FORMATS[kind].parameters(stage.flat(), ask)
    asked = {question.key for question in ask.open}
    answers = {key: value for key, value in (units | BACK.get(kind, {})).items() if key in asked}
    assert f"controller.{lost}" in gains_of(stage, answers, kind).not_held


@pytest.mark.parametrize(
    ("name", "text"), [("a.prg", "SLPKP(0)=140\nSLVKP(0)=65\n"), ("a.yaml", "controller:\n  Kp: 12\n")]
)
def test_a_length_in_degrees_makes_a_rotary_axis_without_a_window_too(tmp_path: Path, name: str, text: str) -> None:
    path = tmp_path / name
    path.write_text(text)
    answers = {**JOINT, **CYCLES, "length_per_unit": "1 deg", "controller.kp": "5 N*m*s/rad"}
    assert stage_from(path, None, answers).stage.flat()["axis.kind"] == "rotary"


def test_gains_per_cycle_of_a_stage_without_a_drive_need_the_cycle(tmp_path: Path) -> None:
    stage = stage_from(written(tmp_path, "ecmc"), None, ANSWERS["ecmc"]).stage
    answers = {"length_per_unit": "1 mm", **BACK["ecmc"]}
    with pytest.raises(InputError, match=r"--set drive\.sample_time="):
        gains_of(stage.replace({"drive": None}), answers, "ecmc")
    back = gains_of(stage.replace({"drive": {"sample_time": "2 ms"}}), answers, "ecmc").parameters
    assert back["Ki"] == pytest.approx(2 * 0.05)


@pytest.mark.parametrize(
    ("kind", "without", "asked"),
    [
        ("kflop", "error_beyond_deadband", "error_beyond_deadband"),
        ("twincat", "controller.kv", "controller.kv"),
        ("ecmc", "length_per_unit", "length_per_unit"),
        ("acs", "dead_zone", "dead_zone"),
        ("acs", "dead_zone_time", "dead_zone_time"),
        ("odrive", "gain_schedule", "gain_schedule"),
    ],
)
def test_what_nobody_documents_is_asked_for(kind: str, without: str, asked: str, tmp_path: Path) -> None:
    answers = {key: value for key, value in ANSWERS[kind].items() if key != without}
    with pytest.raises(InputError, match=f"--set {asked}="):
        stage_from(written(tmp_path, kind), None, answers)


def test_the_other_answer_makes_the_other_window(tmp_path: Path) -> None:
    for kind, key, answer, name, value in (
        ("kflop", "error_beyond_deadband", "whole", "error_deadband_exit", 1.5e-6),
        ("acs", "dead_zone", "output", "freeze_window_exit", 4e-6),
        ("odrive", "gain_schedule", "line", "schedule_error.1", 0.0),
    ):
        flat = stage_from(written(tmp_path, kind), None, {**ANSWERS[kind], key: answer}).stage.flat()
        assert flat[f"controller.{name}"] == pytest.approx(value)


@pytest.mark.parametrize(
    ("line", "answer", "acts"),
    [
        ("enabled: false", {}, False),
        ("tolerance: 0.0008", {"target_monitoring": "on"}, True),
        ("enabled: on", {}, True),
    ],
)
def test_a_dead_band_of_ecmc_acts_if_the_target_is_watched(
    line: str, answer: dict[str, Any], acts: bool, tmp_path: Path
) -> None:
    text = TEXTS["ecmc"].replace("    enabled: true\n    tolerance: 0.0008\n", f"    {line}\n")
    path = tmp_path / "axis.yaml"
    path.write_text(text, "utf-8")
    read = stage_from(path, None, {**ANSWERS["ecmc"], **answer})
    assert ("controller.freeze_window" in read.stage.flat()) == acts
    assert acts or any("watch" in sentence for sentence in read.left_out)
    if answer:
        with pytest.raises(InputError, match="target_monitoring"):
            stage_from(path, None, ANSWERS["ecmc"])


@pytest.mark.parametrize(
    ("kind", "word"),
    [
        ("kflop", "rest there"),
        ("moteus", "current"),
        ("icub", "stictionUp"),
        ("ecmc", "inner.tol"),
        ("acs", "acceleration"),
    ],
)
def test_what_a_stage_does_not_take_over_is_told(tmp_path: Path, kind: str, word: str) -> None:
    read = stage_from(written(tmp_path, kind), "joint_1" if kind == "icub" else None, ANSWERS[kind])
    assert any(word in sentence for sentence in read.left_out)


def test_axes_of_a_twincat_nc_are_asked_about_and_those_commanded_by_position_refused(tmp_path: Path) -> None:
    path = tmp_path / "nc.xti"
    axis = TEXTS["twincat"].split("<Axis")[1].partition("</Axis>")[0]
    other = axis.replace("__FILENAME__", "Y axis").replace("0.002", "0.004")
    path.write_text(f"<Axes><Axis{axis}</Axis><Axis{other}</Axis></Axes>", "utf-8")
    with pytest.raises(InputError, match="2 axes") as refused:
        stage_from(path, None, ANSWERS["twincat"])
    assert "axis 7, Y axis" in refused.value.expected
    flat = stage_from(path, "Y axis", ANSWERS["twincat"]).stage.flat()
    assert flat["controller.error_deadband"] == pytest.approx(4e-6)
    assert flat["drive.encoder_resolution"] == pytest.approx(5e-8)
    position = TEXTS["twincat"].replace("nDataOut2[0]", "nDataOut1").replace("STM Velocity^Velocity", "MDT^Position")
    path.write_text(position, "utf-8")
    with pytest.raises(InputError, match="velocity"):
        stage_from(path, None, ANSWERS["twincat"])


def test_the_velocity_loop_of_an_ecmc_motor_is_in_its_commands(tmp_path: Path) -> None:
    path = tmp_path / "motor.cmd"
    lines = {"MOT_TRQ_CONST_MNM_P_A": 96, "MOT_VELO_KP": 58, "MOT_VELO_TI": 120, "MOT_I_MAX_MA": 12000}
    path.write_text("".join(f"epicsEnvSet({name},{value})\n" for name, value in lines.items()), "utf-8")
    answers = {**MACHINE, **CYCLES, "controller.kv": "12 1/s", "travel_per_turn": "10 mm"}
    flat = stage_from(path, None, answers).stage.flat()
    assert flat["controller.kp"] == pytest.approx(58e-3 * 96e-3 * TURN**2)
    assert flat["controller.velocity_integral_time"] == pytest.approx(12e-3)
    assert flat["controller.force_limit"] == pytest.approx(12 * 96e-3 * TURN)


def test_notes_about_an_odrive_are_read_with_their_comments(tmp_path: Path) -> None:
    path = tmp_path / "notes.md"
    path.write_text(
        "# tuning\nThis is what we use now\nodrv0.axis0.motor.config.torque_constant = 8.27 / 190 // from KV\n"
        "odrv0.axis0.encoder.config.cpr = 2**13\nodrv0.axis0.controller.config.pos_gain = 90\n"
        "odrv0.axis0.controller.config.vel_gain = 0.21\n"
        "odrv0.axis0.controller.config.vel_integrator_gain = 0.5 * 10 * 0.21 // half\n",
        "utf-8",
    )
    flat = stage_from(path, None, {**MACHINE, "travel_per_turn": "10 mm"}).stage.flat()
    assert flat["controller.kp"] == pytest.approx(0.21 * TURN / 0.01)
    assert flat["controller.velocity_integral_time"] == pytest.approx(0.2)


@pytest.mark.parametrize("kind", TEXTS)
@given(data=st.data())
def test_no_damage_to_a_file_raises_anything_but_one_message(
    kind: str, data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    text = TEXTS[kind]
    first, size = data.draw(st.integers(0, len(text))), data.draw(st.integers(0, 40))
    strange = st.text(st.sampled_from("0123456789.-+eE=:;<>()[]{}\"'#/!\n xKpP\u00b5"), max_size=12)
    path = tmp_path_factory.mktemp("fuzzed") / "file.txt"
    path.write_text(text[:first] + data.draw(strange) + text[first + size :], "utf-8")
    with suppress(InputError):
        stage_from(path, None, ANSWERS[kind])


@pytest.mark.slow
@pytest.mark.parametrize("kind", [*TEXTS, "stage"])
@pytest.mark.parametrize("filler", [" ", "\t", '"', "1", "a.", "a(", "[", "=", "<a ", "/", "_"])
def test_a_long_text_is_read_or_refused_in_a_time_like_its_length(tmp_path: Path, kind: str, filler: str) -> None:
    """In a line of its own, before and behind a value, and in a comment."""
    text = TEXTS[kind] if kind != "stage" else friso.example("lugre_stick_slip").read_text("utf-8")
    place = text.index("=" if "=" in text else ":" if ":" in text else " ", len(text) // 3) + 1
    path = tmp_path / "file.txt"

    def read(length: int) -> None:
        long = filler * length
        for changed in (
            f"{text}\n{long}\n",
            f"{long}{text}",
            f"{text[:place]}{long}{text[place:]}",
            f"{text[:place]} 1{long}!{text[place:]}",
            f"# {long} x\n{text}",
        ):
            with suppress(InputError):
                if kind == "stage":
                    friso.loads(changed)
                else:
                    path.write_text(changed, "utf-8")
                    stage_from(path, None, ANSWERS[kind])

    assert not grows_with_the_square(read, 10_000)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "iso-8859-1", "nobody-knows"])
def test_xml_counts_as_it_was_read_whatever_encoding_it_declares(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "axis.xml"
    path.write_text(f'<?xml version="1.0" encoding="{encoding}"?>{TEXTS["icub"].replace("torso", "ü")}', "utf-8")
    read = stage_from(path, "joint_1", ANSWERS["icub"])
    assert read.stage.flat()["controller.kp"] == pytest.approx(BY_HAND["icub"]["kp"])
