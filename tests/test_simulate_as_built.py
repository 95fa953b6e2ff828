"""Runs of a stage file's own motion with the drive as built, of one stage and of the cells of a map."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import friso
import friso.equations.motion
from friso.engine.batch import simulate
from friso.equations.rail import friction_factors
from friso.stage import Stage
from friso.stage.rig import is_as_built

DRIVE = {"drive": {"sample_time": "200 us", "delay": "200 us"}}
SURROUNDINGS = {
    "rail": {"seed": 3, "static_deviation": 0.3, "coulomb_deviation": 0.3, "correlation_length": "0.5 mm"},
    "cable": {"stiffness": "50 N/m", "drag": "0.5 N*s/m"},
}


@pytest.fixture(scope="module")
def stage() -> Stage:
    return friso.load(friso.example("motions/profile"))


def test_a_file_with_a_drive_runs_on_it_unless_told_otherwise(stage: Stage) -> None:
    built = stage.replace(DRIVE)
    answer, ideal = friso.simulate(built), friso.simulate(built, continuous=True)
    assert answer.as_built
    assert not ideal.as_built
    assert "as built, sample by sample, with [drive]" in answer.sentences()[-1]
    alone = simulate(stage)
    assert np.array_equal(ideal["position"].to_numpy(), alone["position"].to_numpy())


def test_units_of_a_drive_alone_are_no_drive_as_built(stage: Stage) -> None:
    assert not is_as_built(stage.replace({"drive": {"force_per_output": "20 N"}}))


def test_the_command_is_what_the_controller_computes_of_its_samples(stage: Stage) -> None:
    response, flat = friso.simulate(stage.replace(DRIVE), sample_time="200 us").data, stage.flat()
    time, reading = response["time"].to_numpy(), response["measured_position"].to_numpy()
    error = response["reference"].to_numpy() - reading
    gain = {name.removeprefix("controller."): value for name, value in flat.items() if name.startswith("controller.")}
    by_hand = gain["kp"] * error + gain["ki"] * 2e-4 * np.cumsum(error)
    by_hand -= gain["kd"] * np.diff(reading, prepend=0.0) / 2e-4
    rows = friso.equations.motion.pieces(flat, 1)[0]
    rows = rows[np.searchsorted(rows[:, 0], time * (1 + 1e-12), side="right") - 1]
    since = time - rows[:, 0]
    by_hand += gain["viscous_feedforward"] * (rows[:, 2] + rows[:, 3] * since + rows[:, 4] * since**2 / 2)
    by_hand += gain["acceleration_feedforward"] * (rows[:, 3] + rows[:, 4] * since)
    by_hand += gain["jerk_feedforward"] * rows[:, 4]
    assert response["command"].to_numpy() == pytest.approx(by_hand, abs=1e-8)
    assert response["force"].to_numpy()[2:] == pytest.approx(by_hand[1:-1], abs=1e-8)  # a sample later


def test_friction_varies_along_the_rail_and_the_cable_pulls(stage: Stage) -> None:
    built = stage.replace({**DRIVE, **SURROUNDINGS})
    response, flat = friso.simulate(built, 1e-8, sample_time="200 us").data, built.flat()
    place, speed = response["position"].to_numpy(), response["velocity"].to_numpy()
    factors = friction_factors({key: value for key, value in flat.items() if key.startswith("rail.")}, place)
    levels = [flat[f"friction.{name}"] * factor for name, factor in zip(("static", "coulomb"), factors, strict=True)]
    curve = levels[1] + (levels[0] - levels[1]) * np.exp(-np.abs(speed) / flat["friction.stribeck_velocity"])
    deflection, stiffness = response["bristle_deflection"].to_numpy(), flat["friction.bristle_stiffness"]
    rate = speed - stiffness * np.abs(speed) / curve * deflection
    by_hand = stiffness * deflection + flat["friction.bristle_damping"] * rate + flat["friction.viscous"] * speed
    force = response["friction_force"].to_numpy()
    assert np.ptp(factors) > 0.2
    steady = flat["friction.bristle_damping"] * np.abs(speed) + flat["friction.static"]
    assert np.all(np.abs(force - by_hand) < 1e-3 * steady)  # between the points of the table of the rail
    resisting = force + 50 * place + 0.5 * speed
    pushes = response["force"].to_numpy()[:-1] - (resisting[1:] + resisting[:-1]) / 2  # the force is held in between
    off = np.abs(np.diff(speed) * 1.7 / 2e-4 - pushes)  # friction's levels are held from sample to sample
    assert np.percentile(off, 95) < 0.02 * np.abs(pushes).max()


def test_settling_at_every_dwell_is_read_off_the_samples(stage: Stage) -> None:
    answer = friso.simulate(stage.replace({**DRIVE, "motion.dwell": "1 s"}))
    assert len(answer.dwells) == 3
    slowest = answer.dwells[0].settling[1e-5]
    assert answer.measures.settling_time[1][0] == pytest.approx(slowest)


def test_a_cell_of_a_map_is_the_run_of_its_stage(stage: Stage) -> None:
    built = stage.replace({**DRIVE, "motion.dwell": "1 s"})
    axes = {
        "controller.kp": ["30 N/mm", "60 N/mm"],
        "drive.sample_time": ["200 us", "400 us"],
        "motion.velocity": ["0.1 m/s", "0.02 m/s"],
    }
    runs = friso.sweep(built, axes, metric="settling_time_10um").data
    changes = {key: values[1] for key, values in axes.items()}
    alone = friso.simulate(built.replace(changes)).measures
    assert float(runs["settling_time_10um"][1, 1, 1]) == pytest.approx(alone.settling_time[1][0], rel=1e-3)
    assert float(runs["largest_force"][1, 1, 1]) == pytest.approx(alone.largest_force[0], rel=1e-9)


def test_a_cell_of_a_map_over_the_duration_is_the_run_of_its_stage(stage: Stage) -> None:
    """Cells that last shorter are not measured at the end of the longest one."""
    built = stage.replace({"drive": {"sample_time": "250 us", "delay": "350 us"}})
    durations = ["1.7 s", "1.8001 s", "2.00013 s"]
    cells = friso.sweep(built, {"motion.duration": durations}, metric="peak_to_peak").data["peak_to_peak"].values
    alone = [friso.simulate(built.replace({"motion.duration": one})).measures.peak_to_peak[0] for one in durations]
    assert cells == pytest.approx(alone, rel=1e-6)
    assert np.ptp(alone) > 1e-6


def test_a_sample_time_between_the_samples_of_the_drive_is_refused(stage: Stage) -> None:
    with pytest.raises(friso.InputError) as caught:
        friso.simulate(stage.replace(DRIVE), sample_time="300 us")
    assert caught.value.key == "sample_time"
    assert "whole number of samples of the drive" in caught.value.expected


def largest_error(stage: Stage, sample_time: str, delay: str, duration: str = "2 s") -> float:
    """Largest error on the way [m]. No row may lack a number, and an ideal encoder reads the position."""
    built = stage.replace({"drive": {"sample_time": sample_time, "delay": delay}, "motion.duration": duration})
    data = friso.simulate(built).data
    assert not any(np.isnan(data[name]).any() for name in data)
    assert np.abs(data["measured_position"] - data["position"]).max() < 1e-12
    return float(np.abs(data["position"] - data["reference"]).max())


@pytest.mark.slow
@given(
    sample_time=st.floats(100.0, 400.0),
    samples=st.floats(0.01, 2.99),
    longer=st.sampled_from([0.0, 1e-4, 0.1, 0.5, 0.99]),
)
@settings(max_examples=12)
def test_results_are_continuous_in_delay_sample_time_and_duration(
    sample_time: float, samples: float, longer: float
) -> None:
    """A ten-thousandth more of one of them changes the largest error of an S-curve by hardly more than that."""
    stage = friso.load(friso.example("motions/profile"))
    duration = 2.0 + 1e-6 * sample_time * longer
    delay = samples * sample_time
    own = largest_error(stage, f"{sample_time} us", f"{delay} us", f"{duration} s")
    for times in ((1.0001, 1.0, 1.0), (1.0, 1.0001, 1.0), (1.0, 1.0, 1.0001)):
        more = [value * factor for value, factor in zip((sample_time, delay, duration), times, strict=True)]
        other = largest_error(stage, f"{more[0]} us", f"{more[1]} us", f"{more[2]} s")
        assert other == pytest.approx(own, rel=3e-3)


def test_more_delay_is_no_better_tracking(stage: Stage) -> None:
    """Across whole samples and between them: the largest error of an S-curve grows with the delay."""
    delays = [0, 50, 125, 200, 249.999, 250, 250.001, 350, 450, 500]
    errors = [largest_error(stage, "250 us", f"{delay} us") for delay in delays]
    assert np.all(np.diff(errors) > -1e-4 * errors[0])
    assert errors[-1] > 1.01 * errors[0]


@pytest.mark.cases(first=3)
@pytest.mark.parametrize("duration", ["2 s", "2.00005 s"])
@pytest.mark.parametrize("delay", ["100 us", "350 us", "249.9999 us", "249.99999999 us", "250 us"])
def test_a_move_that_rests_is_told_at_rest_whatever_the_delay_and_duration(
    stage: Stage, delay: str, duration: str
) -> None:
    """The last sample lies 50 us before the end, or a whole sample, and its command acts after it."""
    built = stage.replace({"drive": {"sample_time": "250 us", "delay": delay}, "motion.duration": duration})
    assert not np.isnan(friso.simulate(built, sample_time="250 us").data["position"]).any()
    assert friso.simulate(built).measures.outcome[0] == "rests"
    runs = friso.sweep(built, {"drive.delay": [delay, "400 us"]}, metric="settling_time_10um").data
    assert np.isfinite(runs["settling_time_10um"]).all()
    assert list(runs["outcome"].values) == ["rests", "rests"]
