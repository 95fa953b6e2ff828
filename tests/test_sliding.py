"""Stick-slip at constant speed: the speeds at which it lasts agree with long runs of their own."""

import numpy as np
import pytest

import friso
from friso.hunting import StickSlipSpeeds, is_moved_evenly
from friso.hunting.tracking import stick_slip
from friso.shown.motion_words import stick_slip_sentences
from friso.stage import Stage


@pytest.fixture(scope="module")
def pulled() -> Stage:
    """A mass pulled by a spring, as in the first paper on the LuGre law (doi:10.1109/9.376053, Fig. 5)."""
    return friso.load(friso.example("lugre_stick_slip"))


@pytest.fixture(scope="module")
def speeds(pulled: Stage) -> StickSlipSpeeds:
    answer = stick_slip(pulled, 1e9)
    assert answer is not None
    return answer


def swing_at(stage: Stage, speed: float) -> float:
    """The peak-to-peak error of a run of 600 s in its last quarter."""
    run = friso.simulate(stage.replace({"motion.velocity": f"{speed} m/s", "motion.duration": "600 s"}))
    error = run["position"].values - run["reference"].values
    return float(np.ptp(error[-len(error) // 4 :]))


def test_a_mass_pulled_slowly_sticks_and_slips_and_a_fast_one_does_not(pulled: Stage, speeds: StickSlipSpeeds) -> None:
    assert (speeds.lasts, speeds.sticks) == (True, True)
    (range_,) = speeds.ranges
    assert range_.quiet_below is None
    assert range_.quiet_above / range_.fastest < 1.05
    assert swing_at(pulled, range_.fastest * 0.97) > 1e3 * swing_at(pulled, range_.quiet_above * 1.03)


def test_the_swing_is_that_of_the_run(pulled: Stage, speeds: StickSlipSpeeds) -> None:
    assert speeds.swing == pytest.approx(swing_at(pulled, 0.1), rel=0.01)


def test_only_a_ramp_with_friction_is_moved_evenly(pulled: Stage, rig: Stage) -> None:
    assert is_moved_evenly(pulled)
    assert not is_moved_evenly(rig)
    assert not is_moved_evenly(pulled.replace({"friction": {"model": "none"}}))


def test_check_says_from_which_speed_on_the_stage_slides_smoothly(pulled: Stage, speeds: StickSlipSpeeds) -> None:
    answer = friso.check(pulled)
    assert answer.sentences()[0].startswith("As given: sticks and slips at 100 mm/s")
    assert "smooth from" in answer.sentences()[0]
    (text,) = stick_slip_sentences(StickSlipSpeeds(False, False, 0.0, None, (), (1e-4, 1.0), 0), 0.2)
    assert text == "slides smoothly at 200 mm/s; no stick-slip from 100 µm/s to 1.00 m/s."
    undecided = stick_slip_sentences(StickSlipSpeeds(None, False, 0.0, None, speeds.ranges, (1e-4, 1.0), 3), 0.2)
    assert "not decided" in undecided[0]
    assert "3 of the speeds" in undecided[1]


def test_a_map_over_speeds_agrees_with_the_ranges_of_the_check(pulled: Stage, speeds: StickSlipSpeeds) -> None:
    """Cells 10 % inside and outside the end of the range; another motion is no ramp."""
    end = speeds.ranges[-1].fastest
    axes = {"motion.velocity": f"{0.9 * end} m/s, {1.1 * end} m/s"}
    cells = friso.sweep(pulled, axes, metric="stick_slip")["stick_slip"]
    assert cells.values.tolist() == ["sticks", "slides"]
    step = pulled.replace({"motion": {"kind": "step", "size": "1 mm", "duration": "1 s"}})
    other = friso.sweep(step, {"friction.viscous": "0.3 N*s/m, 0.4 N*s/m"}, metric="stick_slip")["stick_slip"]
    assert {*other.values.tolist()} == {"no ramp"}
