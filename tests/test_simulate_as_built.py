"""Runs of a stage file's own motion with the drive as built, of one stage and of the cells of a map."""

import numpy as np
import pytest

import friso
import friso.equations.motion
from friso.engine.simulate import simulate
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


def test_a_sample_time_between_the_samples_of_the_drive_is_refused(stage: Stage) -> None:
    with pytest.raises(friso.InputError) as caught:
        friso.simulate(stage.replace(DRIVE), sample_time="300 us")
    assert caught.value.key == "sample_time"
    assert "whole number of samples of the drive" in caught.value.expected
