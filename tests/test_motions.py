"""Motions: references by hand, traces against SciPy, bad input, and one that a module outside friso declares."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from log_files import write_twincat
from own_motion import Spiral as Spiral
from scipy.integrate import solve_ivp
from scipy.io import savemat
from variants import gains, limit, lugre, release, stage

import friso
from benchmarks import by_hand as plain
from benchmarks.by_hand import by_hand
from friso.engine.batch import simulate
from friso.equations import motion
from friso.equations.motion import value
from friso.equations.motions import plan
from friso.hunting import dwells, tracking
from friso.stage import Stage
from friso.stage.rig import motion_of
from friso.virtual_rig.run import run
from friso.virtual_rig.task import own_motion

TABLES = friso.load(friso.example("lugre_stick_slip")).as_written()
CONTROLLER = {"kind": "pid", "kp": "2e4 N/m", "ki": "1e5 N/(m*s)", "kd": "300 N*s/m", "derivative_on": "measurement"}

PROFILE = {
    "kind": "profile",
    "distance": ["5 mm", "-4 mm", "20 um"],
    "velocity": "0.05 m/s",
    "acceleration": "2 m/s^2",
    "jerk": "100 m/s^3",
    "dwell": "50 ms",
}
JERKLESS = {key: entry for key, entry in PROFILE.items() if key != "jerk"}
SINE = {"kind": "sine", "amplitude": "1 mm", "frequency": "4 Hz", "duration": "1 s"}
MULTISINE = {
    "kind": "multisine",
    "amplitude": ["1 mm", "0.2 mm"],
    "frequency": ["2 Hz", "5 Hz"],
    "phase": ["0 deg", "40 deg"],
    "duration": "1 s",
}
CHIRP = {"kind": "chirp", "amplitude": "1 mm", "start_frequency": "0 Hz", "end_frequency": "8 Hz", "duration": "1 s"}
MOVING = {"profile": PROFILE, "sine": SINE, "multisine": MULTISINE, "chirp": CHIRP}


def moved(keys: Mapping[str, Any], **controller: str) -> Stage:
    return Stage(**{**TABLES, "controller": {**CONTROLLER, **controller}, "motion": dict(keys)})


@pytest.mark.cases(first=3)
@pytest.mark.parametrize("keys", MOVING.values(), ids=MOVING)
def test_the_reference_is_that_written_by_hand(keys: dict[str, Any]) -> None:
    flat = moved(keys).flat()
    time = np.linspace(0, flat["motion.duration"], 997)
    by_hand = np.array([plain.reference(flat, t) for t in time])
    form, rows = motion.form_of(flat), motion.pieces(flat, 1)[0]
    rows = rows[np.searchsorted(rows[:, 0], time, side="right") - 1]
    for order in range(3):
        scale = np.abs(by_hand[:, order]).max()
        assert value(form, rows, time - rows[:, 0], order) == pytest.approx(by_hand[:, order], abs=1e-12 * scale)


@pytest.mark.thorough
@pytest.mark.parametrize("keys", MOVING.values(), ids=MOVING)
def test_the_trace_is_that_of_scipy_to_a_millionth_of_the_break_away_deflection(keys: dict[str, Any]) -> None:
    stage = moved(keys)
    flat = stage.flat()
    response = simulate(stage, 1e-11, 1e-2)
    names = ["position", "velocity", "bristle_deflection", "integral"]
    rates, x, last = plain.rates(flat, names), np.zeros(4), 0.0
    corners = [c for c in np.unique(motion.pieces(flat, 1)[0, :, 0]) if 0 < c < flat["motion.duration"]]
    time, result = response["time"].to_numpy(), []
    for end in [*corners, flat["motion.duration"] * (1 + 1e-12)]:
        inside = time[(time >= last) & (time < end)]
        part = solve_ivp(rates, (last, end), x, "Radau", inside, rtol=1e-11, atol=1e-15, dense_output=True)
        result += [*part.sol(inside)[0]] if inside.size else []
        x, last = part.sol(end), end
    deflection = flat["friction.static"] / flat["controller.kp"]
    assert response["position"].to_numpy()[: len(result)] == pytest.approx(np.array(result), abs=1e-6 * deflection)


@pytest.mark.cases(first=2)
@pytest.mark.parametrize("keys", MOVING.values(), ids=MOVING)
def test_a_drive_as_built_sees_the_reference_at_its_samples_to_rounding(keys: dict[str, Any]) -> None:
    stage = moved(keys).replace({"drive": {"sample_time": "1 ms"}})
    (recorded,) = run(stage, own_motion(stage), [0], 1e-3)
    flat = stage.flat()
    by_hand = np.array([plain.reference(flat, t)[0] for t in recorded.time])
    assert recorded.logged["reference"][0] == pytest.approx(by_hand, abs=1e-14)
    gain = {key: flat[f"controller.{key}"] for key in ("kp", "ki", "kd")}
    position, error = recorded.logged["position"][0], by_hand - recorded.logged["position"][0]
    slope = np.diff(position, prepend=0.0) / 1e-3
    force = gain["kp"] * error + gain["ki"] * 1e-3 * np.cumsum(error) - gain["kd"] * slope
    assert recorded.logged["force"][0] == pytest.approx(force, abs=1e-9)


@pytest.mark.cases(first=7)
@pytest.mark.parametrize("distance", [1e-7, 1e-5, 3e-4, 1e-2, 1.0])
@pytest.mark.parametrize("order", [2, 3, 4])
def test_a_move_keeps_its_limits_and_reaches_one_of_them(distance: float, order: int) -> None:
    limits = [0.1, 2.0, 100.0, 2e4][:order]
    move = plan(-distance, limits)
    assert all(peak <= limit * (1 + 1e-12) for peak, limit in zip(move.peaks, limits, strict=True))
    assert move.peaks[-1] == pytest.approx(limits[-1])
    assert np.prod(move.widths) * move.peaks[-1] == pytest.approx(distance, rel=1e-13)
    inner = np.cumsum(move.widths[::-1])[:-1]
    assert np.all(move.widths[-2::-1] >= inner * (1 - 1e-12))  # each average is as wide as all within it


def test_a_third_order_move_is_as_quick_as_the_textbook_says() -> None:
    for distance in np.geomspace(1e-7, 1, 50):
        tj, ta, tv = plain.s_curve_times(distance, 0.1, 2.0, 100.0)
        assert plan(distance, [0.1, 2.0, 100.0]).time == pytest.approx(4 * tj + 2 * ta + tv, rel=1e-12)


def test_a_fourth_order_move_integrates_to_its_distance() -> None:
    flat = moved({**PROFILE, "snap": "2e4 m/s^4"}).flat()
    form, rows = motion.form_of(flat), motion.pieces(flat, 1)[0]
    lengths = np.diff(rows[:, 0])
    assert form.degree == 4
    assert np.all(lengths >= 0)
    for k in range(4):  # each derivative goes on where the piece before ended
        after = sum(rows[:-1, 1 + m] * lengths ** (m - k) / np.prod(range(1, m - k + 1)) for m in range(k, 5))
        assert after == pytest.approx(rows[1:, 1 + k], abs=1e-12 * np.abs(rows[:, 1 + k]).max())
    assert rows[-1, 1] == pytest.approx(1.02e-3, abs=1e-18)
    snaps = np.abs(rows[:-1, 5][lengths > 1e-12])
    assert snaps[snaps > 0] == pytest.approx(2e4)


def test_what_a_move_is_too_short_for_is_told_with_what_it_reaches() -> None:
    stage = moved({**PROFILE, "distance": "20 um", "dwell": "0.2 s"})
    (peak, other) = motion_of(stage.flat()).lowered(stage.flat())
    assert (peak.name, other.name) == ("velocity", "acceleration")
    tj = (20e-6 / 200) ** (1 / 3)
    assert (peak.reached, other.reached) == pytest.approx((100 * tj**2, 100 * tj))
    assert "20.0 µm reaches 2.15 mm/s instead of 50.0 mm/s" in " ".join(friso.simulate(stage).sentences())


def test_each_run_of_a_sweep_has_its_own_profile() -> None:
    stage = moved(PROFILE)
    speeds, jerks = np.array([0.05, 0.001, 1.0]), np.array([100.0, 10.0, 3.0])
    together = motion.pieces(stage.flat({"motion.velocity": speeds, "motion.jerk": jerks}), 3)
    for number in range(3):
        alone = stage.flat({"motion.velocity": speeds[number], "motion.jerk": jerks[number]})
        assert np.array_equal(motion.pieces(alone, 1)[0], together[number])


@pytest.mark.cases(first=1)
@pytest.mark.parametrize("dwell", ["0.3 s", "2 s"])
def test_settling_is_told_at_every_dwell_the_slowest_first(dwell: str) -> None:
    stage = moved({**PROFILE, "dwell": dwell})
    flat, response = stage.flat(), simulate(stage, 1e-10, 1e-5)
    time = response["time"].to_numpy()
    deviation = (response["position"] - response["reference"]).to_numpy()
    result = dwells(stage, 1e-10)
    assert [place.slowness for place in result] == sorted((place.slowness for place in result), reverse=True)
    assert sorted(place.number for place in result) == [1, 2, 3]
    for place_told in result:
        place = motion.stands(flat)[place_told.number - 1]
        stand = (time >= place.corner) & (time <= place.until)
        outside = np.flatnonzero(np.abs(deviation[stand]) > 1e-5)
        by_hand = time[stand][outside[-1]] - place.corner if outside.size else 0.0
        settles = by_hand < place.until - place.corner - 2e-5
        assert place_told.settling[1e-5] == (pytest.approx(by_hand, abs=2e-5) if settles else None)


def test_settling_of_a_run_is_the_longest_at_any_of_its_dwells() -> None:
    stage = moved({**PROFILE, "dwell": "2 s"})
    measures = friso.simulate(stage, 1e-10).measures
    slowest = max(dwell.slowness for dwell in dwells(stage, 1e-10))
    assert measures.settling_time[1][0] == pytest.approx(slowest, rel=1e-6)


@pytest.mark.slow
def test_a_periodic_response_is_that_in_which_long_simulation_ends() -> None:
    stage = moved({**SINE, "duration": "2 s"})
    result = tracking(stage, 1e-9)
    assert result.closed
    assert result.attracts
    response = simulate(stage.replace({"motion.duration": "60 s"}), 1e-9, 1e-4)
    error = (response["reference"] - response["position"]).to_numpy()[-2500:]
    assert result.largest == pytest.approx(np.abs(error).max(), rel=1e-4)
    assert result.rms == pytest.approx(np.sqrt(np.mean(error**2)), rel=1e-4)
    assert [round(reversal.time * 4, 9) for reversal in result.reversals] == [0.25, 0.75]


def test_a_stage_whose_reference_keeps_moving_gets_no_verdict() -> None:
    answer = friso.check(moved({**SINE, "duration": "2 s"}))
    assert answer.verdict == "none"
    assert "no verdict on hunting, because the reference never stands still" in answer.sentences()[0]
    assert answer.to_dict()["cases"]["given"]["tracking"]["closed"] is True


def test_tones_without_a_common_period_are_followed_to_the_end() -> None:
    stage = moved({**MULTISINE, "frequency": ["2 Hz", "4.7 Hz"]})
    assert motion_of(stage.flat()).period(stage.flat()) is None
    result = tracking(stage, 1e-8)
    assert not result.closed
    assert result.period is None


@pytest.mark.parametrize(("frequency", "period"), [(["2 Hz", "5 Hz"], 1.0), (["0.3 Hz", "0.4 Hz"], 10.0)])
def test_the_period_of_tones_is_their_least_common_one(frequency: list[str], period: float) -> None:
    stage = moved({**MULTISINE, "frequency": frequency, "duration": "10 s"})
    assert motion_of(stage.flat()).period(stage.flat()) == pytest.approx(period)


def test_jerk_feedforward_is_its_gain_times_the_jerk() -> None:
    stage = moved(PROFILE, jerk_feedforward="0.5 g*s")
    response = simulate(stage, 1e-9, 1e-4)
    flat, time = stage.flat(), response["time"].to_numpy()
    rows = motion.pieces(flat, 1)[0]
    jerk = rows[np.searchsorted(rows[:, 0], time, side="right") - 1, 4]
    assert response["force_f"].to_numpy() == pytest.approx(0.5e-3 * jerk, abs=1e-12)
    assert np.abs(jerk).max() == 100


def test_feedforward_by_direction_changes_where_the_reference_turns() -> None:
    response = simulate(moved(SINE, coulomb_feedforward="1 N"), 1e-9, 1e-3)
    time, ahead = response["time"].to_numpy(), response["force_f"].to_numpy()
    away = np.abs(np.cos(8 * np.pi * time)) > 1e-6
    assert ahead[away] == pytest.approx(np.sign(np.cos(8 * np.pi * time[away])))


def record(folder: Path, time: np.ndarray, place: np.ndarray, head: str = "time [s],setpoint [mm]") -> str:
    np.savetxt(folder / "record.csv", np.c_[time, 1e3 * place], delimiter=",", header=head, comments="")
    return str(folder / "record.csv")


TIME = np.arange(0, 1, 1e-3)
PLACE = 0.3 + 1e-3 * np.sin(2 * np.pi * TIME)


@pytest.mark.parametrize("between", ["linear", "hold"])
def test_a_recorded_reference_is_that_of_the_file_and_its_end_is_held(tmp_path: Path, between: str) -> None:
    keys = {"kind": "recorded", "file": record(tmp_path, TIME, PLACE), "between": between, "scale": 2.0}
    flat = moved({**keys, "duration": "2 s"}).flat()
    time = np.linspace(0, 2, 4001)
    by_hand = (
        np.interp(time, TIME, PLACE)
        if between == "linear"
        else PLACE[np.minimum((time + 1e-9) // 1e-3, 999).astype(int)]
    )
    off = np.abs(motion.reference(flat, time + 1e-12) - 2 * (by_hand - PLACE[0]))
    assert off.max() < 1e-10
    assert motion.rests(flat)
    assert motion.last_corner(flat) == pytest.approx(0.999)


def test_a_recorded_reference_is_found_beside_its_stage_file(tmp_path: Path) -> None:
    record(tmp_path, TIME, PLACE)
    text = friso.load(friso.example("lugre_stick_slip")).to_toml().partition("[motion]")[0]
    (tmp_path / "stage.toml").write_text(f'{text}[motion]\nkind = "recorded"\nfile = "record.csv"\n')
    stage = friso.load(tmp_path / "stage.toml")
    assert stage.flat()["motion.duration"] == pytest.approx(0.999)
    assert friso.loads(stage.to_toml()) == stage


@pytest.mark.slow
def test_a_recorded_reference_is_read_from_matlab_files(tmp_path: Path) -> None:
    savemat(tmp_path / "record.mat", {"t": TIME, "wanted": 1e3 * PLACE})
    keys = {"kind": "recorded", "file": str(tmp_path / "record.mat"), "reference": "wanted", "time": "t", "unit": "mm"}
    assert motion.reference(moved(keys).flat(), TIME) == pytest.approx(PLACE - PLACE[0], abs=1e-15)


GAP, BACK, HOLE = np.r_[0:300, 330:1000], TIME - 0.2 * (TIME > 0.6), np.where(np.arange(1000) == 32, np.nan, PLACE)


@pytest.mark.parametrize(
    ("time", "place", "words"),
    [
        (TIME[GAP], PLACE[GAP], "a gap of 0.031 s behind 0.299 s"),
        (BACK, PLACE, "time that goes from 0.6 s to 0.401 s behind sample 601"),
        (TIME, HOLE, "no number in sample 33 of 1000"),
        (TIME[:1], PLACE[:1], "1 sample"),
    ],
    ids=["gap", "back", "hole", "one"],
)
def test_a_record_that_is_not_whole_is_refused(tmp_path: Path, time: np.ndarray, place: np.ndarray, words: str) -> None:
    with pytest.raises(friso.InputError) as caught:
        moved({"kind": "recorded", "file": record(tmp_path, time, place)})
    assert caught.value.key == "motion.file"
    assert words in caught.value.actual


def test_a_motion_from_outside_is_run_checked_and_named() -> None:
    keys = {"kind": "spiral", "radius": "1 mm", "turn": "4 Hz", "drift": "1 mm/s", "duration": "1 s"}
    stage = moved(keys)
    time = np.linspace(0, 1, 301)
    by_hand = 1e-3 * time + 1e-3 * np.sin(8 * np.pi * time)
    assert motion.reference(stage.flat(), time) == pytest.approx(by_hand, abs=1e-15)
    response = simulate(stage, 1e-9, 1e-3)
    assert response["reference"].to_numpy() == pytest.approx(
        1e-3 * response["time"].to_numpy() + 1e-3 * np.sin(8 * np.pi * response["time"].to_numpy()), abs=1e-13
    )
    assert friso.check(stage).verdict == "none"


def test_a_recorded_reference_is_read_from_a_scope_of_twincat(tmp_path: Path) -> None:
    channels = [("SetPos", "mm", 1e3 * PLACE), ("ActPos", "mm", 1e3 * PLACE)]
    path = write_twincat(tmp_path / "scope.csv", [(1.0, channels)])
    assert motion.reference(moved({"kind": "recorded", "file": str(path)}).flat(), TIME) == pytest.approx(
        PLACE - PLACE[0], abs=1e-14
    )


def test_moves_of_a_rotary_axis_are_in_its_units() -> None:
    stage = Stage(
        axis={"kind": "rotary"},
        masses={"stage": "0.01 kg*m^2"},
        controller={"kind": "pid", "kp": "600 N*m/rad", "jerk_feedforward": "5e-6 kg*m^2*s"},
        motion={**JERKLESS, "distance": "5 deg", "velocity": "1 rad/s", "acceleration": "20 rad/s^2"},
    )
    assert motion.reference(stage.flat(), np.array([1.0])) == pytest.approx(np.deg2rad(5))
    assert stage.numeric_keys()["motion.jerk"].unit == "rad/s^3"


TUNED = 'kind="pid"\ncrossover="8 Hz"\nalpha=0.1\nbeta=2'
ON_ERROR = gains(900, 7000, 33, 3e-3)
LIMITED = gains(900, 7000, 33, 3e-3, extra=limit("1.5 N", "clamp"))


@pytest.mark.parametrize(
    "controller",
    [TUNED, ON_ERROR, f'{LIMITED}\nderivative_on = "measurement"', 'kind="adrc"\nbandwidth="8 Hz"'],
    ids=["tuned", "on error", "limited", "observer"],
)
def test_a_release_begins_with_filters_at_rest(controller: str) -> None:
    """A stage held by hand until its filters have settled, by equations written by hand."""
    chosen = stage(release("-2 mm"), friction=lugre(2), controller=controller)
    equations, time = by_hand(chosen.flat()), np.linspace(0.0, 1.0, 201)
    theirs = equations.run(equations.start(-2e-3), time, 1e-9)[:, equations.measured]
    ours = friso.simulate(chosen, 1e-8, sample_time=5e-3)["position"].values[: len(time)]
    assert np.abs(ours - theirs).max() < 1e-9


def test_a_release_does_not_depend_on_what_the_derivative_is_of() -> None:
    """With a reference that stands the rates of error and position differ in sign alone."""
    on_error = stage(release(), friction=lugre(2), controller=ON_ERROR)
    on_position = on_error.replace({"controller.derivative_on": "measurement"})
    one, other = (friso.simulate(chosen, 1e-9)["position"].values for chosen in (on_error, on_position))
    assert np.abs(one - other).max() < 1e-9


def test_a_release_as_built_begins_within_the_limit_of_the_force() -> None:
    """With delay and current loop: what the drive has commanded before is what it exerts at rest."""
    drive = {"drive": {"sample_time": "0.25 ms", "delay": "0.3 ms", "current_bandwidth": "300 Hz"}}
    chosen = Stage(**{**stage(release("-2 mm"), friction=lugre(2), controller=LIMITED).as_written(), **drive})
    assert friso.simulate(chosen)["force"].values[:9] == pytest.approx(1.5)
