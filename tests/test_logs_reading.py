"""From a file to a log: roles, units, scales, one time base, and which files are refused or commented on."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import log_files
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.io import savemat

import friso
from friso.errors import InputError
from friso.identification.logs import roles as mappings
from friso.identification.logs.assemble import read_log
from friso.identification.logs.checks import (
    clipped_share,
    force_line,
    in_blocks,
    interpolated,
    lag,
    samples_held,
    unwrapped,
)
from friso.identification.logs.gaps import GapsError
from friso.identification.logs.log import ROLES, Log
from friso.identification.logs.roles import Mapping, from_options, role_of
from friso.identification.logs.time_base import resample_tracks, track
from friso.identification.logs.units import in_si, read_scale, spelled, unit_factor
from friso.identification.output_error.problem import loop_problem

DATA = Path(__file__).parents[2] / "shared" / "data"
RIG = Path(__file__).parents[1] / "examples" / "thesis_rig.toml"
M = log_files.motion(2000)
NAMES = ["time [s]", "position [mm]", "velocity [mm/s]", "force [N]"]


def columns() -> list[np.ndarray]:
    return [M["time"], M["position"] * 1e3, M["velocity"] * 1e3, M["force"]]


def log_of(
    tmp_path: Path, names: list[str], values: list[np.ndarray], mapping: Mapping | None = None, strict: bool = True
) -> Log:
    return read_log(log_files.write_text(tmp_path / "a.csv", names, values), mapping, strict)


def is_among(lines: Sequence[str], text: str) -> bool:
    return any(text in line for line in lines)


@pytest.mark.slow
def test_a_log_in_si_units(tmp_path: Path) -> None:
    log = log_of(tmp_path, NAMES, columns())
    assert log.name == "a"
    assert log.sample_time == pytest.approx(1e-3, rel=1e-12)
    assert log.segments == (slice(0, 2000),)
    for role in ("position", "velocity", "force"):
        assert log[role] == pytest.approx(M[role], rel=1e-12, abs=1e-15)
        assert log.unit(role) == ROLES[role]
    assert "2000 samples at 1000 Hz in 1 segment: 0 s to 1.999 s" in log.read
    assert not log.warnings


NAMES_OF_ROLES = {
    "time": "t, Time, Tempo corrente, Temps courant, T [ms]",
    "position": "Axis1.NcToPlc.ActPos, Istposition, Lageistwert, enc2, stage_pos, Posizione reale, FPOS(0)",
    "cart_position": "cart_position",
    "relative_position": "relative position",
    "reference": "Axis1.SetPos, Sollposition, Lagesollwert, desired, setpoint, position_sp, SP_pos, PosSP, pos_d, "
    "Pos_Traj, profile_position, position_nominal, x_des, position_ref, xSoll, x_m_soll, Weg_m_soll, Axis A target, "
    "Axis_A_cmd, A_soll, Posizione comandata, RPOS(0)",
    "velocity": "Axis1.NcToPlc.ActVelo, Istgeschwindigkeit, speed, v_ist [mm/s], vIst [m/s], n_ist [rpm], theta_dot, "
    "encoder velocity [mm/s], dq",
    "acceleration": "a_ist [m/s^2], theta_ddot",
    "force": "iq, MotorCurrent, Force_d, Strom_ist_A, Motorstrom, Motorstromistwert, Corrente motore, F_ist [N], "
    "i_act [A], M_ist [N m], 6077h Torque actual value(0.1%), field.effort0, tau",
    "": "PosDiff, SetVelo, following error, qm, vir, sp_velocity, d, total, composition, v_soll, F_cmd, "
    "Motorstromsollwert, Sollmotorstrom, Motorstromsoll, Comando, Comando tensione, Corrente comandata, "
    "Valore corrente, Weg_m_ist, Axis A actual, A_act, v_ist [mm], v_ist, A_act [mm], v_soll [mm/s], n_soll [rpm], "
    "ref [N], APOS(0), Position PE [mm], header.stamp.nsecs, RVEL(0), lage [mm/s], T [V], T [N m]",
}
"""Names of channels, some with a unit, by the role that they tell; the last tell none."""


@pytest.mark.parametrize("role", NAMES_OF_ROLES)
def test_roles_by_name_and_unit(role: str) -> None:
    for text in NAMES_OF_ROLES[role].split(", "):
        name, _, unit = text.rstrip("]").partition(" [")
        assert (role_of(name, unit) or ("",))[0] == role, text


def changed(column: int, values: np.ndarray) -> list[np.ndarray]:
    return [values if number == column else usual for number, usual in enumerate(columns())]


SLOW_TIME = 4.0 * np.arange(500)
TWO_CLOCKS = [1e3 * M["time"], 1e3 * M["position"], SLOW_TIME, np.cos(SLOW_TIME)]


@pytest.mark.cases(first=2)
@pytest.mark.parametrize(
    ("first", "others"),
    [("force", ["force_p", "force_i", "friction_force"]), ("Force", ["Force_d"]), ("iq", ["iq filtered"])],
)
def test_an_exact_name_wins(first: str, others: list[str], tmp_path: Path) -> None:
    names = [*NAMES[:3], *(f"{name} [N]" for name in (*others, first))]
    values = [*columns()[:3], *(2 * M["force"] for _ in others), M["force"]]
    log = log_of(tmp_path, names, values)
    assert log["force"] == pytest.approx(M["force"])
    assert is_among(log.read, f'the name is "{first}"')


def test_velocities_of_which_none_is_needed_are_left_out(tmp_path: Path) -> None:
    names = ["time [s]", "position [mm]", "vel a [mm/s]", "vel b [mm/s]", "force [N]"]
    log = log_of(tmp_path, names, [*columns()[:3], M["velocity"], M["force"]])
    assert "velocity" not in log
    assert is_among(log.warnings, '--map velocity="vel a"')


def open_questions(tmp_path: Path, names: Sequence[str], values: Sequence[np.ndarray], *needed: str) -> GapsError:
    with pytest.raises(GapsError) as caught:
        read_log(log_files.write_text(tmp_path / "a.csv", names, values), needed=needed)
    return caught.value


def test_everything_that_is_open_is_told_at_once(tmp_path: Path) -> None:
    """The options of one message are all that it takes."""
    values = [M["time"], columns()[1], columns()[1], M["force"]]
    options = open_questions(tmp_path, ["t", "ref", "x", "F"], values, "position", "force").options
    assert {*options} == {
        "--map position=x", "--map force=F", "--unit t=s", "--unit x=mm", "--unit ref=mm", "--unit F=N"
    }  # fmt: skip
    pairs = [option.split(" ", 1) for option in options]
    maps, units = ([text for name, text in pairs if name == kind] for kind in ("--map", "--unit"))
    log = read_log(tmp_path / "a.csv", from_options(maps, units), needed=("position", "force"))
    assert log["position"] == pytest.approx(M["position"])
    assert log["force"] == pytest.approx(M["force"])
    assert not open_questions(tmp_path, NAMES[:3], columns()[:3], "position", "force").options


@pytest.mark.cases(first=2)
@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize(
    ("wanted", "measured", "force", "scale"), [("qg", "qm", "vir", "N/V"), ("xd", "xm", "iq", "N/A")]
)
def test_of_two_channels_alike_the_noisier_is_the_position(
    wanted: str, measured: str, force: str, scale: str, turned: bool, tmp_path: Path
) -> None:
    """Whichever comes first; and no motor current is in newtons."""
    noisy = M["position"] + 1e-5 * np.random.default_rng(1).standard_normal(M["position"].size)
    pair = [(wanted, M["position"]), (measured, noisy)]
    names, values = zip(("t", M["time"]), *(pair[::-1] if turned else pair), (force, M["force"]), strict=True)
    error = open_questions(tmp_path, names, values, "position", "force")
    assert f"--map position={measured}" in error.options
    assert f'"{measured}" is like "{wanted}" with more noise' in str(error)
    options = [option for option in error.options if "force" in option or force in option]
    scaled = [f'--scale force="NUMBER {scale}"']
    assert options == ([f"--map force={force}", *scaled] if force == "vir" else scaled)


def test_of_two_channels_that_are_the_same_none_is_the_position(tmp_path: Path) -> None:
    values = [M["time"], M["position"], M["position"]]
    for names in (["time [s]", "x", "y"], ["time [s]", "pos a", "pos b"]):
        error = open_questions(tmp_path, names, values, "position")
        assert "are alike: one of them may be a reference" in str(error)
        assert error.options == ()
        assert [gap.key for gap in error.gaps] == ["position"]
    error = open_questions(tmp_path, ["time [s]", "x_des", "x"], values, "position")
    assert "--map position=x" in error.options


@pytest.mark.parametrize(
    ("names", "chosen", "options"),
    [
        (["x [mm]", "T [N]"], (1, 3), {"maps": ["position=x", "force=T"], "dt": "1 ms"}),
        (["t [s]", "phi [deg]", "T [Nm]"], (0, 1, 3), {"axis": "rotary"}),
    ],
)
def test_a_torque_is_no_time_whatever_its_letter(
    tmp_path: Path, names: list[str], chosen: tuple[int, ...], options: dict
) -> None:
    path = log_files.write_text(tmp_path / "a.csv", names, [columns()[number] for number in chosen])
    log = read_log(path, from_options(**options), needed=("position", "force"))
    assert log["force"] == pytest.approx(M["force"])


@pytest.mark.cases(first=1)
@pytest.mark.parametrize(
    "names",
    [
        ["t/s", "x_soll/mm", "x/mm", "F/N"],
        ["time [s]", "Axis A target [mm]", "Axis A actual [mm]", "Kraft [N]"],
        ["time [s]", "V_soll [mm]", "x_ist [mm]", "Kraft [N]"],
    ],
)
def test_a_unit_tells_the_role_of_the_only_channel_that_has_it(tmp_path: Path, names: list[str]) -> None:
    """Also where a letter names an axis."""
    values = [M["time"], *2 * [columns()[1]], M["force"]]
    assert {"reference", "position", "force"} <= log_of(tmp_path, names, values).signals.keys()
    error = open_questions(tmp_path, ["t [s]", "x [mm]", "y [mm]", "F [N]"], values, "position")
    assert [gap.key for gap in error.gaps] == ["position"]


@pytest.mark.slow
def test_units_and_scales_of_options(tmp_path: Path) -> None:
    """Units that are not those of the role are kept where that is allowed."""
    names = ["time [s]", "position", "velocity [mm/s]", "current [mA]"]
    mapping = from_options(units=["position=mm"], scales=["force=12 N/A"])
    log = log_of(tmp_path, names, columns(), mapping)
    assert log["position"] == pytest.approx(M["position"])
    assert log["force"] == pytest.approx(M["force"] * 12e-3)
    with pytest.raises(InputError, match="--scale force"):
        log_of(tmp_path, [*NAMES[:3], "current [mA]"], columns())
    log = log_of(tmp_path, [*NAMES[:3], "current [mA]"], columns(), strict=False)
    assert log.unit("force") == "A"
    assert log["force"] == pytest.approx(M["force"] * 1e-3)
    log = log_of(
        tmp_path, ["time [s]", "position [deg]", "velocity [deg/s]", "force [counts]"], columns(), strict=False
    )
    assert log.units == {"position": "rad", "velocity": "rad/s", "force": "count"}
    assert log["position"] == pytest.approx(np.radians(M["position"] * 1e3))
    pulses = np.where(M["time"] % 0.5 < 0.05, 0.4, 0.0)
    mapping = from_options(["disturbance=pulses_N"], scales=["disturbance=35.15 N/V"])
    log = log_of(tmp_path, ["time [s]", "position [mm]", "pulses_N", "force [N]"], changed(2, pulses), mapping)
    assert log["disturbance"] == pytest.approx(35.15 * pulses)


@pytest.mark.parametrize(
    ("text", "unit", "factor"),
    [
        ("35.1507 N/V", "", 35.1507),
        ("35.1507 N/V", "mV", 0.0351507),
        ("2 kN/V", "V", 2000),
        ("-3 N/count", "counts", -3),
    ],
)
def test_scales(text: str, unit: str, factor: float) -> None:
    assert read_scale("force", text, unit)[0] == pytest.approx(factor)


@pytest.mark.parametrize(
    ("text", "si", "factor"),
    [
        ("m/s2", "m/s^2", 1),
        ("µm", "m", 1e-6),
        ("Nm", "N", 1),
        ("msec", "s", 1e-3),
        ("rpm", "m/s", np.pi / 30),
        ("°", "m", np.pi / 180),
        ("Grad", "m", np.pi / 180),
        ("U/min", "m/s", np.pi / 30),
        ("1/min", "m/s", np.pi / 30),
        ("mNm", "N", 1e-3),
        ("N-m", "N", 1),
        ("Arms", "N", 1),
        ("deg/Nm", "rad/(N*m)", np.pi / 180),
    ],
)
def test_unit_spellings(text: str, si: str, factor: float) -> None:
    """Nothing is in megametres."""
    assert in_si(text, si)[0] == pytest.approx(factor)
    assert spelled(spelled(text)) == spelled(text)
    for large in ("Mm", "Ms", "Grads", "Gm"):
        assert unit_factor(large, "m") is unit_factor(large, "s") is unit_factor(large, "rad") is None


@pytest.mark.slow
@settings(max_examples=40)
@given(st.integers(8, 24), st.integers(0, 2**24), st.integers(1, 20))
def test_a_counter_that_overflows_is_unwrapped(bits: int, start: int, turns: int) -> None:
    size = 2**bits
    true = start + np.cumsum(np.full(200 * turns, size // 60 + 1))
    values, result = unwrapped((true % size).astype(float))
    assert result == bits
    assert np.diff(values) == pytest.approx(np.diff(true))


SQUARE = 1000.0 * (np.arange(3000) % 100 < 50) + np.arange(3000) % 7


def test_a_log_is_unwrapped_only_if_it_is_a_counter(tmp_path: Path) -> None:
    for values in (np.array([0.0, 1, 0, 1, 1, 0]), np.round(1e4 * M["position"] * 100), M["force"], SQUARE):
        assert unwrapped(values)[1] == 0
    log = log_of(tmp_path, ["time [s]", "position [mm]"], [M["time"], (np.arange(2000.0) * 40) % 65536])
    assert is_among(log.warnings, "16-bit counter")
    assert log["position"][-1] == pytest.approx(1999 * 40e-3)


def test_gaps_split_and_are_not_bridged(tmp_path: Path) -> None:
    keep = np.r_[0:700, 760:2000]
    log = log_of(tmp_path, NAMES, [column[keep] for column in columns()])
    assert log.segments == (slice(0, 700), slice(700, 1940))
    assert log["position"] == pytest.approx(M["position"][keep])
    assert log.time == pytest.approx(M["time"][keep])


def test_nan_splits_and_is_counted(tmp_path: Path) -> None:
    holed = np.where((np.arange(2000) >= 500) & (np.arange(2000) < 504), np.nan, M["force"])
    log = log_of(tmp_path, NAMES, changed(3, holed))
    assert log.segments == (slice(0, 500), slice(500, 1996))
    assert is_among(log.read, "4 samples that are not numbers")
    assert all(np.isfinite(signal).all() for signal in log.signals.values())


def test_a_few_lost_samples_are_bridged_and_do_not_count(tmp_path: Path) -> None:
    """Rows that are missing, and numbers that are missing in one channel, up to three in a row."""
    rows, numbers = [100, 101, 102, 700, 1500], [300, 1998]
    values = changed(3, np.where(np.isin(np.arange(2000), numbers), np.nan, M["force"]))
    log = log_of(tmp_path, NAMES, [np.delete(column, rows) for column in values])
    assert log.segments == (slice(0, 2000),)
    assert log.bridged is not None
    assert np.flatnonzero(log.bridged).tolist() == sorted(rows + numbers)
    assert log.time == pytest.approx(M["time"])
    assert log["position"] == pytest.approx(M["position"], abs=1e-4 * np.ptp(M["position"]))
    assert is_among(log.warnings, "7 of 2000 samples lost, in 5 places")
    part = log.excerpt(150)
    assert part.bridged is not None
    assert part.measured(part.longest).sum() == 150 - np.count_nonzero(part.bridged)
    moved, flat = replace(log, signals={**log.signals, "reference": log["position"]}), friso.load(RIG).flat()
    problem = loop_problem(flat, moved, log.longest, [])
    without = loop_problem(flat, replace(moved, bridged=None), log.longest, [])
    assert np.array_equal(problem.counted, np.where(log.bridged, 0.0, without.counted))
    assert without.counted[[700, 1500, 1998]].all()  # how a log begins does not count in a loop anyway


def test_many_lost_samples_are_bridged_where_the_stamps_tell_them(tmp_path: Path) -> None:
    """A tenth of the rows is missing at random; the time stamps of the others are right."""
    rows = np.flatnonzero(np.random.default_rng(1).random(2000) > 0.1)
    log = log_of(tmp_path, NAMES, [column[rows] for column in columns()])
    assert log.sample_time == pytest.approx(1e-3, rel=1e-6)
    assert log.bridged is not None
    assert np.count_nonzero(log.bridged) > 150
    assert log["position"] == pytest.approx(
        np.interp(log.time, M["time"], M["position"]), abs=1e-4 * np.ptp(M["position"])
    )


def test_a_sample_time_against_the_stamps_is_mentioned(tmp_path: Path) -> None:
    for text, mentioned in (("2 ms", True), ("1 ms", False)):
        log = log_of(tmp_path, NAMES, columns(), from_options(dt=text))
        assert is_among(log.warnings, "the time stamps are 0.001 s apart") == mentioned


def test_a_clock_that_begins_anew_is_not_bridged() -> None:
    time = np.r_[0:500, 501.6:1000] * 1e-3
    assert track("position", time, time).segments == [slice(0, 500), slice(500, time.size)]


def test_repeated_rows_are_left_out(tmp_path: Path) -> None:
    again = np.sort(np.r_[0:2000, 300, 301])
    log = log_of(tmp_path, NAMES, [column[again] for column in columns()])
    assert log.time.size == 2000
    assert is_among(log.read, "2 samples repeated")


def test_jitter_is_interpolated_and_told(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    time, exact = M["time"] + 1e-4 * rng.uniform(-1, 1, 2000), M["position"]
    late = np.interp(time, M["time"], exact)
    log = log_of(tmp_path, ["time [s]", "position [m]"], [time, late])
    assert is_among(log.warnings, "scatter by 0.057 of a sample time")
    assert is_among(log.warnings, '--dt "1 ms"')
    assert np.diff(log.time) == pytest.approx(log.sample_time)
    assert np.abs(log["position"] - np.interp(log.time, M["time"], exact)).max() < 1e-4 * np.abs(M["velocity"]).max()
    period = np.mean(np.diff(M["time"]))
    coarse = M["time"] + 0.12 * period * rng.normal(size=2000)  # a step in 600 is then over 1.5 periods
    log = log_of(tmp_path, ["time [s]", "position [m]"], [coarse, exact])
    assert len(log.segments) == 1
    assert not is_among(log.warnings, "lost")
    assert log.sample_time == pytest.approx(period, rel=1e-3)


@pytest.mark.slow
@settings(max_examples=200, deadline=None)
@given(st.floats(3, 40) | st.floats(1.4, 3), st.floats(0, 1), st.lists(st.integers(50, 1950), max_size=8))
def test_stamps_with_few_digits_are_those_of_a_uniform_clock(period: float, begin: float, lost: list[int]) -> None:
    few = lost if period >= 3 else []  # a step of coarser stamps may hide a lost sample
    clock = np.delete(period * np.arange(2000) + begin, few)
    values = np.sin(0.01 * clock)
    read = track("position", np.round(clock) * 1e-4, values)
    assert not read.warnings
    assert read.period == pytest.approx(period * 1e-4, rel=1e-3)
    measured = ~read.bridged
    assert np.array_equal(read.values[measured], values)  # not interpolated
    assert np.abs(read.time[measured] - clock * 1e-4).max() < 1.01e-4


def test_what_a_log_holds_is_told_with_the_rate_of_its_clock(tmp_path: Path) -> None:
    time = np.round(np.arange(2000) / 400, 3)  # 2 and 3 ms for 2.5
    path = log_files.write_text(tmp_path / "a.csv", NAMES, [time, *columns()[1:]])
    rates = [channel.sample_rate for channel in friso.logs(path).result[0].channels if channel.sample_rate]
    assert rates == pytest.approx([400.0] * 3, rel=1e-3)


def test_a_random_walk_of_whole_digits_is_no_uniform_clock() -> None:
    steps = np.random.default_rng(1).choice([2e-3, 3e-3], 2000)
    read = track("position", np.cumsum(steps), np.arange(2000.0))
    assert is_among(read.warnings, "interpolated")


def test_saturation_is_told_with_its_share(tmp_path: Path) -> None:
    values = columns()
    limit = 0.6 * np.abs(values[3]).max()
    share = np.mean(np.abs(values[3]) >= limit)
    log = log_of(tmp_path, NAMES, [*values[:3], np.clip(values[3], -limit, limit)])
    item = next(line for line in log.warnings if "saturated" in line)
    assert float(item.split()[1].rstrip("%")) / 100 == pytest.approx(share, rel=0.05)
    assert clipped_share(values[3]) == 0


def test_amperes_rms_are_told_from_those_of_peak(tmp_path: Path) -> None:
    """A motor constant per ampere of peak would put mass and friction off by a factor of 1.41."""
    log = log_of(tmp_path, [*NAMES[:3], "force [Arms]"], columns(), from_options(scales=["force=12 N/A"]))
    assert is_among(log.warnings, "0.707 times")


def test_values_that_are_held_or_interpolated_are_told(tmp_path: Path) -> None:
    assert samples_held(np.repeat(M["position"][:200], 4)) == 4
    assert samples_held(M["position"]) == 1
    log = log_of(tmp_path, NAMES, changed(3, np.repeat(M["force"][::5], 5)))
    assert is_among(log.warnings, "holds each value for 5 samples")
    assert is_among(log.warnings, "force seems to come after motion by 2 ms +/- 0.01 ms")
    instants = np.arange(len(M["force"]))
    slower = np.interp(instants, instants[::4], M["force"][::4])
    assert interpolated(slower) == 4
    assert interpolated(M["force"]) == 1
    assert interpolated(np.repeat(M["force"][::4], 4)) == 1
    assert is_among(log_of(tmp_path, NAMES, changed(3, slower)).warnings, "straight lines of 4 samples")


@pytest.mark.cases(first=2)
@pytest.mark.parametrize(
    ("velocity", "words"),
    [
        (1e6 * M["velocity"], "mm against m"),
        (-1e3 * M["velocity"], "the sign"),
        (1.3e3 * M["velocity"], "wrong units or counts"),
        (np.cumsum(np.random.default_rng(2).standard_normal(2000)), "correlation -0.01"),
    ],
)
def test_velocity_against_position(tmp_path: Path, velocity: np.ndarray, words: str) -> None:
    assert is_among(log_of(tmp_path, NAMES, changed(2, velocity)).warnings, words)


@pytest.mark.parametrize("true", [-3.4, 0.0, 0.5, 7.25])
def test_delay_with_its_interval(true: float) -> None:
    rng = np.random.default_rng(3)
    t = np.arange(8000.0)

    def signal(at: np.ndarray) -> np.ndarray:
        return sum(np.sin(0.01 * k * at + 2.1 * k**2) for k in range(1, 30))

    one, two = signal(t), signal(t - true)
    one, two = (x + 0.3 * rng.standard_normal(t.size) for x in (one, two))
    value, half = in_blocks(lambda a, b: lag(one[a:b], two[a:b]), t.size)
    assert abs(value - true) < 2 * half + 0.02
    assert half < 0.3


def test_a_body_that_sticks_while_the_force_turns_is_not_late() -> None:
    """Force and motion of a sine with dwells at its ends, through which friction turns."""
    step, count, dwell = 5e-3, 2400, 0.1
    phase = 2 * np.pi * 0.5 * step * np.arange(count)
    swing, way = np.sin(phase), np.sign(np.cos(phase))
    velocity = 0.15 * np.sign(swing) * np.maximum(np.abs(swing) - dwell, 0.0)
    stuck = way * np.clip(way * swing / dwell, -1, 1)
    friction = 3 * np.where(np.abs(swing) > dwell, np.sign(swing), stuck)
    position = np.cumsum(velocity) * step
    force = 6 * np.gradient(velocity, step) + friction + 10 * velocity
    whole = [slice(0, count)]
    assert force_line(position, force, step, whole) == ""


def test_friction_is_no_delay(tmp_path: Path) -> None:
    """A force with much viscous friction leads the acceleration; that is not taken for a late instrument."""
    force = M["force"] + 80 * M["velocity"] + 5 * np.sign(M["velocity"])
    assert not is_among(log_of(tmp_path, NAMES, changed(3, force)).warnings, "come after")
    late = log_of(tmp_path, NAMES, changed(3, np.r_[np.zeros(4), force[:-4]]))
    (delayed,) = (line for line in late.warnings if "come after" in line)
    start, _, rest = delayed.partition(" by ")
    assert "force" in start
    assert float(rest.split()[0]) == pytest.approx(4, abs=0.1)


def test_channels_of_different_rates(tmp_path: Path) -> None:
    fast = 0.25e-3 * np.arange(8000)
    groups = [
        (0.25, [("ActPos", "mm", 50 * np.sin(7 * fast))]),
        (1.0, [("Force", "N", np.cos(7e-3 * np.arange(1800)))]),
    ]
    log = read_log(log_files.write_twincat(tmp_path / "a.csv", groups))
    assert log.sample_time == pytest.approx(1e-3)
    assert log.time.size == 1800  # the common span
    assert log["position"] == pytest.approx(0.05 * np.sin(7 * log.time), rel=1e-9, abs=1e-12)
    assert log["force"] == pytest.approx(np.cos(7 * log.time), rel=1e-9, abs=1e-12)
    assert is_among(log.warnings, "sampled at 4000 Hz and read at 1000 Hz")


@settings(max_examples=30)
@given(
    st.lists(st.integers(20, 100), min_size=1, max_size=4),
    st.lists(st.integers(20, 100), min_size=1, max_size=4),
    st.floats(0, 1),
)
def test_values_between_segments_are_never_made_up(first: list[int], second: list[int], shift: float) -> None:
    """Whatever the gaps, an instant of the log lies within a segment of each channel."""
    spans = []
    for lengths, offset in ((first, 0.0), (second, shift)):
        starts = np.cumsum([0, *[n + 5 for n in lengths[:-1]]])
        spans.append(np.concatenate([offset + s + np.arange(n) for s, n in zip(starts, lengths, strict=True)]))
    tracks = {name: track(name, t, 2 * t) for name, t in zip("ab", spans, strict=True)}
    try:
        base, values = resample_tracks(tracks)
    except InputError:
        return
    for name, t in zip("ab", spans, strict=True):
        assert values[name] == pytest.approx(2 * base.time, abs=0.02 + 1e-9)  # 0.01 of a step is one instant
        assert np.all(np.min(np.abs(base.time[:, None] - t[None, :]), axis=1) <= 0.5 + 1e-9)


def test_without_time(tmp_path: Path) -> None:
    log = log_of(tmp_path, NAMES[1:], columns()[1:], from_options(dt="2 ms"))
    assert log.sample_time == pytest.approx(2e-3)
    savemat(tmp_path / "a.mat", {"position": M["position"], "fs": 2500.0})
    with pytest.raises(InputError, match=r'--dt "0\.4 ms", if fs = 2500'):
        read_log(tmp_path / "a.mat")


def test_mapping_is_kept_and_overridden(tmp_path: Path) -> None:
    log = log_files.write_text(tmp_path / "a.csv", NAMES, columns())
    assert mappings.load_mapping(log) is None
    first = from_options(["position=ä b=c"[:12]], ['x y="mm"'], ["force=35.1507 N/V"], "1 ms", "steps")
    assert mappings.place_for(log, tmp_path / "elsewhere") == tmp_path / "a.csv.friso.toml"
    mappings.sidecar(log).write_text(mappings.mapping_text(first), encoding="utf-8")
    assert mappings.load_mapping(log) == first
    second = from_options(["position=other"], dt="2 ms").over(first)
    assert second.roles == {"position": "other"}
    assert second.sample_time == 2e-3
    assert second.scales == first.scales


@pytest.mark.slow
@settings(max_examples=50)
@given(
    st.dictionaries(st.sampled_from(list(ROLES)), st.text(st.characters(codec="utf-8"), min_size=1)),
    st.floats(1e-9, 1e3),
)
def test_any_mapping_comes_back(tmp_path_factory: pytest.TempPathFactory, roles: dict[str, str], step: float) -> None:
    log = tmp_path_factory.mktemp("kept") / "log.csv"
    mapping = Mapping(roles, dict.fromkeys(roles.values(), "mm"), {}, step)
    mappings.sidecar(log).write_text(mappings.mapping_text(mapping), encoding="utf-8")
    assert mappings.load_mapping(log) == mapping


def test_mapping_in_another_folder(tmp_path: Path) -> None:
    folder = tmp_path / "closed"
    folder.mkdir()
    log = folder / "a.csv"
    folder.chmod(0o500)
    try:
        place = mappings.place_for(log, tmp_path)
    finally:
        folder.chmod(0o700)
    assert place.parent == tmp_path
    place.write_text(mappings.mapping_text(Mapping({"position": "x"})), encoding="utf-8")
    assert mappings.load_mapping(log, tmp_path) == Mapping({"position": "x"})
    assert mappings.load_mapping(tmp_path / "another" / "a.csv", tmp_path) is None
    long, alike = (mappings.sidecar(folder / f"{'n' * 240}{end}.csv", tmp_path) for end in "12")
    assert long != alike
    assert len(long.name) < 200


def test_what_is_said_now_silences_what_was_kept() -> None:
    kept = Mapping({"force": "u"}, {}, {"force": "25 N/A"}, 1e-3)
    assert from_options(["time=Uhrzeit"]).over(kept).sample_time is None
    assert from_options(units=["time=ms"]).over(kept).sample_time is None
    assert from_options(units=["u=A"]).over(kept).sample_time == 1e-3
    assert "time" not in from_options(dt="2 ms").over(Mapping({"time": "t"})).roles
    assert from_options(["force=w"]).over(kept).scales == {}
    assert from_options(["force=u"]).over(kept) == kept
    beside = kept.beside(from_options(["time=Uhrzeit"]))
    assert (beside.roles, beside.scales, beside.sample_time) == ({"force": "u"}, {"force": "25 N/A"}, None)


def test_the_unit_of_a_time_column_can_be_told(tmp_path: Path) -> None:
    """Also over what the file says."""
    for first in ("time", "time [s]"):
        log = log_of(tmp_path, [first, *NAMES[1:]], columns(), from_options(units=["time=ms"]))
        assert log.sample_time == pytest.approx(1e-6)
    names = ["t1", "position [mm]", "t2", "force [N]"]
    log = log_of(tmp_path, names, TWO_CLOCKS, from_options(units=["t1=ms", "t2=ms"]))
    assert log.sample_time == pytest.approx(4e-3)
    assert log["position"] == pytest.approx(M["position"][::4])


def record(name: str) -> Path:
    if not (DATA / name).exists():
        pytest.skip(f"the measured record {name} is not here")
    return DATA / name


def test_emps() -> None:
    options = ["time=t", "reference=qg", "position=qm", "force=vir"]
    log = read_log(record("emps/DATA_EMPS.mat"), from_options(options, scales=["force=35.1507 N/V"]))
    assert log.time.size == 24841
    assert log.sample_time == pytest.approx(1e-3, rel=1e-6)
    assert len(log.segments) == 1
    assert np.ptp(log["position"]) == pytest.approx(0.2464, abs=1e-4)
    assert log.scalars["gtau"] == pytest.approx(35.1507, abs=1e-4)
    assert log.scalars["kp"] == pytest.approx(160.18, abs=0.01)
    assert [line.split(":")[0] for line in log.warnings] == ["time", "reference", "position"]  # without units


@pytest.mark.slow
def test_ku_leuven() -> None:
    path = record("kuleuven_lsb250/exp1.mat")
    with pytest.raises(InputError, match='"enc1" and "enc2"'):
        read_log(path)
    log = read_log(path, from_options(["position=enc2 (mm)", "cart_position=enc1", "force=input (V)"]), strict=False)
    assert log.units == {"force": "V"}
    assert np.abs(log["position"]).max() == pytest.approx(0.0652, abs=1e-4)
    assert np.abs(log["force"]).max() == pytest.approx(0.5, abs=1e-3)


@pytest.mark.slow
def test_tokyo_bench() -> None:
    path = record("utokyo_motorbench/MultisineTypeA.mat")
    options = from_options(["position=theta_mx", "force=iq_adx"], ["theta_mx=rad", "iq_adx=A"])
    with pytest.raises(InputError, match=r'--dt "0\.4 ms", if fs = 2500'):
        read_log(path, options, strict=False)
    log = read_log(path, from_options(dt="0.4 ms").over(options), strict=False)
    assert log.time.size == 50000
    assert log.units == {"position": "rad", "force": "A"}
    assert log.scalars["nrofs"] == 2500


SCOPE_HEAD = """Name;rig
SampleTime[ms];1

Name;ActPos;Name;Force
SampleTime[ms];1;SampleTime[ms];4
Unit;mm;Unit;N

"""


def test_twincat_filled_with_the_previous_value(tmp_path: Path) -> None:
    """Scope can repeat the samples of a slow group, stamp and value, to have all rows full."""
    again = np.repeat(np.arange(500), 4)
    slow = np.cos(4e-3 * np.arange(500))
    rows = [f"{i};{50 * np.sin(7e-3 * i):.12g};{4 * again[i]};{slow[again[i]]:.12g}" for i in range(2000)]
    (tmp_path / "a.csv").write_text(SCOPE_HEAD + "\n".join([*rows, "EOF"]).replace(".", ","))
    log = read_log(tmp_path / "a.csv")
    assert log.sample_time == pytest.approx(4e-3)
    assert log["force"] == pytest.approx(np.cos(log.time))
    assert log["position"] == pytest.approx(0.05 * np.sin(7 * log.time))
    assert is_among(log.read, "1500 samples repeated")


def test_of_a_long_log_the_part_that_moves_most_is_taken() -> None:
    time = np.arange(10_000) * 1e-3
    position = np.where((time > 4.0) & (time < 5.0), np.sin(20 * time), 0.0)
    log = Log("long", time, 1e-3, {"position": position, "force": time}, (slice(0, 10_000),))
    part = log.excerpt(1500)
    assert part.segments == (slice(0, 1500),)
    assert part.time[0] <= 4.0
    assert part.time[-1] >= 5.0
    assert np.array_equal(part["force"], part.time)
    assert part.is_excerpt
    assert log.excerpt(10_000) is log
    assert not log.is_excerpt
