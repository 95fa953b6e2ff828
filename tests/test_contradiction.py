"""Does a log contradict the verdict on a stage, and which single change would explain it."""

import numpy as np
import pytest

import friso
from friso.errors import InputError
from friso.identification.logs.log import Log
from friso.stage import Stage
from friso.studies.contradiction import Standing, contradiction, standing_of
from friso.studies.draws import friction_levels

STEP = 1e-3


def log_of(position: np.ndarray, reference: np.ndarray | None = None) -> Log:
    time = np.arange(len(position)) * STEP
    wanted = np.zeros(len(position)) if reference is None else reference
    signals = {"reference": wanted, "position": np.round(position / 1e-7) * 1e-7}
    return Log("log", time, STEP, signals, (slice(0, len(time)),))


@pytest.fixture(scope="module")
def hunting() -> Stage:
    """The thesis rig, locked at 8 Hz, which hunts by 0.525 mm every 1.65 s."""
    return friso.load(friso.example("thesis_rig")).replace({"joint.locked": True})


@pytest.fixture(scope="module")
def swinging() -> Standing:
    time = np.arange(0, 16, STEP)
    return standing_of(
        log_of(0.525e-3 * np.sign(np.sin(2 * np.pi * time / 1.64)) * np.abs(np.sin(2 * np.pi * time / 1.64)) ** 0.3)
    )


def test_a_swing_is_seen_where_the_reference_stands_longest() -> None:
    time = np.arange(0, 12, STEP)
    reference = np.where(time < 2, 0.01 * np.clip(time, 0, 1), 0.01)
    standing = standing_of(log_of(reference + 1e-4 * np.sin(2 * np.pi * time / 0.8), reference))
    assert standing.time == pytest.approx(11, abs=0.01)
    assert standing.swing == pytest.approx(1e-4, rel=0.02)
    assert standing.period == pytest.approx(0.8, rel=0.01)


@pytest.mark.parametrize("seed", range(3))
def test_noise_and_a_swing_that_dies_out_are_rest(seed: int) -> None:
    time = np.arange(0, 12, STEP)
    noise = 3e-7 * np.random.default_rng(seed).standard_normal(len(time))
    assert not standing_of(log_of(noise)).hunts
    assert not standing_of(log_of(noise + 1e-4 * np.exp(-time) * np.sin(10 * time))).hunts


def test_a_log_that_does_as_the_stage_agrees(hunting: Stage, swinging: Standing) -> None:
    same = contradiction(hunting, swinging)
    assert same.agrees
    assert not same.explanations


def test_the_change_that_was_made_explains_the_log(hunting: Stage, swinging: Standing) -> None:
    """A stage thought to have half of its static friction, and one with a controller 1.6 times as fast."""
    thought = contradiction(hunting.replace({"friction.static": "1.2 N"}), swinging)
    assert not thought.agrees
    factors = {one.name: one.factor for one in thought.explanations}
    assert factors["friction.static"] == pytest.approx(2.5, rel=0.35)
    faster = contradiction(hunting.replace({"controller.crossover": "13 Hz"}), swinging)
    factors = {one.name: one.factor for one in faster.explanations}
    assert factors["controller speed"] == pytest.approx(8 / 13, rel=0.2)


def test_rest_contradicts_hunting_only_if_the_reference_stands_long_enough(hunting: Stage) -> None:
    brief, long = (contradiction(hunting, Standing(time, None, None)) for time in (2.0, 20.0))
    assert brief.agrees
    assert not long.agrees
    speeds = [one.factor for one in long.explanations if one.name == "controller speed"]
    assert 1.2 < speeds[0] < 1.5


def test_steps_of_the_encoder_and_brief_stands_decide_nothing(hunting: Stage) -> None:
    """A position that jumps by a count is no hunting; half a swing is no rest; noise of the reference is no motion."""
    time = np.arange(0, 10, STEP)
    counts = 1e-6 * (np.sin(2 * np.pi * time / 0.7) > 0)
    assert not standing_of(log_of(counts)).hunts
    half = standing_of(log_of(1e-4 * np.sin(2 * np.pi * time / 15)))
    assert (half.hunts, half.rests) == (False, False)
    settled = hunting.replace({"controller.crossover": "20 Hz"})
    assert contradiction(settled, half).open
    assert contradiction(settled, Standing(0.03, None, None)).open
    noisy = 1e-9 * np.random.default_rng(0).standard_normal(len(time))
    assert standing_of(log_of(np.zeros(len(time)), noisy)).time > 9


def test_a_stage_whose_values_are_ranges_contradicts_nothing_for_certain(hunting: Stage, swinging: Standing) -> None:
    uncertain = hunting.replace({"friction.static": "0.8 N .. 1.6 N"})
    assert not contradiction(uncertain, swinging).certain


def test_a_log_without_a_reference_is_refused() -> None:
    log = log_of(np.zeros(100))
    with pytest.raises(InputError, match="reference"):
        standing_of(Log("log", log.time, STEP, {"position": log["position"]}, log.segments))


@pytest.mark.slow
def test_a_stage_without_friction_hunts_from_a_level_on(hunting: Stage) -> None:
    """The level of the thesis's own friction, 1 N, lies among those at which similar contacts hunt with the joint
    locked; a stage that states friction is not asked."""
    assert friction_levels(hunting) is None
    assert friction_levels(friso.load(friso.example("ball_screw_axis")).replace({"friction": None})) is None
    levels = friction_levels(hunting.replace({"friction": None, "controller.crossover": "4 Hz"}))
    assert levels.shares[0] < 0.1
    ends = levels.ends(0.5)
    assert ends[0] < 17
    faster = friction_levels(hunting.replace({"friction": None, "controller.crossover": "40 Hz"}))
    assert (faster.shares <= levels.shares + 0.1).all()
