"""The verdict on a machine as built: counts, samples and delays decide, and what is left out shows it."""

import numpy as np
import pytest
from book import BOOK

import friso
from friso.equations.bandwidth import sped_up
from friso.hunting import check_given
from friso.remedies.method import tune
from friso.stage import Stage
from friso.virtual_rig.cures import cures, edges, is_quiet, judged
from friso.virtual_rig.run import as_built_keys, run_flat
from friso.virtual_rig.task import motion_task
from friso.virtual_rig.verdict import PLACES, Built, judge_as_built

DRIVE = {"sample_time": "2 ms", "delay": "2 ms", "encoder_resolution": "1.5 mrad"}
COUNTS = BOOK["small joint"].replace({"drive": DRIVE})
"""A joint whose integral never stops, as its target lies between two counts. Without them it settles."""


def built(changes: dict[str, object]) -> Built:
    judged = judge_as_built(check_given(COUNTS.replace(changes)))
    assert judged
    return judged


def test_a_target_between_two_counts_makes_a_machine_hunt() -> None:
    answer = friso.check(COUNTS)
    document = answer.to_dict()
    assert answer.verdict == document["as_built"]["verdict"] == "hunts"
    assert document["continuous"] == {"verdict": "settles", "certain": True}
    assert document["as_built"]["because"] == ["the counts of its encoder"]
    assert document["as_built"]["moves"] == {"hunts": PLACES}
    assert "without the counts of its encoder it would not" in answer.sentences()[0]


def test_its_swing_is_that_of_a_long_run() -> None:
    judged, flat = built({}), as_built_keys(COUNTS.replace({"motion.duration": "2000 s"}))
    (run,) = run_flat(flat, None, motion_task(flat, 1), [0], 0.02)
    late = run.true["position"][0, run.time > 1000]
    above = late > (late.max() + late.min()) / 2
    assert judged.amplitude
    assert judged.period
    assert judged.amplitude[0] * 0.95 <= np.ptp(late) / 2 <= judged.amplitude[1] * 1.05
    assert judged.period[0] <= 1000 / np.count_nonzero(np.diff(above.astype(int)) > 0) <= judged.period[1]


@pytest.mark.parametrize(
    ("changes", "verdict", "because"),
    [
        ({"drive.encoder_resolution": "0.2 mrad", "friction.bristle_stiffness": "40 N*m/rad"}, "toggles", ()),
        ({"drive.encoder_resolution": "0.1 mrad", "drive.integrator_deadband": "0.3 mrad"}, "settles", ()),
        ({"drive.encoder_resolution": "1 urad", "drive.delay": "60 ms"}, "hunts", ("its delay",)),
        ({"controller.ki": "60 N*m/(rad*s)"}, "hunts", ()),
        (
            {"controller.ki": "20 N*m/(rad*s)", "drive.integrator_deadband": "20 mrad"},
            "settles",
            ("the dead band of its integral",),
        ),
    ],
)
def test_what_alone_makes_it_differ(changes: dict[str, object], verdict: str, because: tuple[str, ...]) -> None:
    judged = built(changes)
    assert (judged.verdict, judged.certain, judged.because) == (verdict, True, because)


@pytest.mark.parametrize(
    ("changes", "moves"),
    [
        ({"drive.encoder_noise": "0.1 mrad"}, {"hunts", "rests", "open"}),
        ({"motion.duration": "10 ms"}, {"hunts"}),
        ({"motion.duration": "100000 s"}, {"hunts", "open"}),
        ({"controller.force_limit": "0.05 N*m"}, {"rests"}),
    ],
    ids=["noise", "a run of five samples", "a run of years", "a motor that cannot break it away"],
)
def test_runs_are_followed_however_long_their_motion(changes: dict[str, object], moves: set[str]) -> None:
    """A motor too weak to break the stage away winds up, but never makes it slip."""
    judged = built(changes)
    assert {*judged.moves} <= moves
    assert judged.certain == (len(moves) == 1)


def test_a_stage_that_hunts_at_some_places_alone_is_bistable() -> None:
    """Whether it hunts then depends on where its target lies between two counts."""
    judged = built({"drive.encoder_resolution": "0.75 mrad"})
    assert {"hunts", "rests"} <= {*judged.moves}
    assert judged.verdict == "bistable"


def test_a_finer_encoder_with_a_dead_band_of_its_count_cures_it_where_the_dead_band_alone_does_not() -> None:
    """Its integral winds between two counts of any encoder."""
    (cure,) = cures(COUNTS)
    drive = cure.stage.flat()
    assert (cure.kind, drive["drive.encoder_resolution"]) == ("a finer encoder", drive["drive.integrator_deadband"])
    assert cure.built.rest_error
    assert cure.built.rest_error <= drive["drive.encoder_resolution"]
    assert judged(COUNTS.replace({"drive.encoder_resolution": "0.75 mrad"})).verdict == "bistable"


@pytest.mark.slow
def test_what_tune_advises_holds_as_built() -> None:
    """Faster it settles in continuous time, but still hunts between its counts."""
    advice = tune(COUNTS, chosen={"bandwidth"})
    (outcome,) = advice.outcomes
    assert "as built" in advice.unmet
    assert (outcome.certainty, outcome.doubts) == ("unsure", ("as built",))


@pytest.mark.slow
def test_sampling_moves_the_edge_of_the_rig_upwards(locked: Stage) -> None:
    """With its joint locked it hunts below 9.75 Hz in continuous time. A sample of 1 ms costs phase."""
    stage = locked.replace({"drive": {"sample_time": "1 ms"}})
    edge = edges(check_given(stage))["bandwidth"].above
    assert edge
    assert edge.certain
    assert edge.inside * 8 > 9.75
    for factor, quiet in ((edge.inside, False), (edge.outside, True)):
        assert is_quiet(judged(stage.with_numbers(sped_up(stage.flat(), factor)))) == quiet


def test_friction_holds_a_sampled_loop_up_to_a_displacement() -> None:
    """A force held for a sample feeds a swing, and friction takes from it: by harmonic balance both are equal at X.

    The loop of a gain alone is unstable with its samples (Budai et al. 2019, doi 10.1007/s11071-019-05101-7).
    """
    gain, sample, mass, coulomb = 5.0, 0.02, 0.02, 0.05
    friction = {"model": "lugre", "static": "0.05 N*m", "coulomb": f"{coulomb} N*m", "stribeck_velocity": "0.05 rad/s"}
    bristles = {
        "bristle_stiffness": "8000 N*m/rad",
        "bristle_damping": "1 N*m*s/rad",
        "viscous": "0 N*m*s/rad",
        "stribeck_exponent": 2,
    }
    zero = {"ki": "0 N*m/(rad*s)", "kd": "0 N*m*s/rad", "tau": "20 ms"}
    stage = BOOK["small joint"].replace(
        {
            "friction": {**friction, **bristles},
            "controller": {"kind": "pid", "kp": f"{gain} N*m/rad", **zero},
            "drive": {"sample_time": f"{sample} s"},
            "motion.duration": "20 s",
        }
    )
    largest = 8 * coulomb / (np.pi * gain * sample * np.sqrt(gain / mass))
    assert judged(stage.replace({"motion.size": f"{0.95 * largest} rad"})).verdict == "settles"
    assert judged(stage.replace({"motion.size": f"{1.08 * largest} rad"})).verdict in ("hunts", "failed")
