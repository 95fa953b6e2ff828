"""The thesis's identification on the virtual rig (Sec. 4.2): what the logs show against what the stage truly is."""

import numpy as np
import pytest
from refusals import refused

from friso.progress import silent
from friso.stage import Stage
from friso_thesis.studies.identification.stick_slip import static_from_stick_slip
from friso_thesis.studies.rig import many_speeds, outcome
from friso_thesis.studies.rig.experiments import constant_speed, frf, stiction, stiffness
from friso_thesis.studies.rig.outcome import rig_log

PLACE = 0.02


def test_sizes_on_the_thesis_rig_are_the_thesis_s(built: Stage) -> None:
    low, high = outcome.travel(built)
    assert high - low == pytest.approx(0.09)
    assert outcome.longest_travel(built) == pytest.approx(0.15)
    assert constant_speed.pass_speeds(built) == pytest.approx((2.5e-3, 10e-3))
    assert outcome.freed(built).flat()["joint.stroke"] == pytest.approx(8e-3)
    assert np.array(frf.CROSSOVER_SETTINGS) * outcome.pace(built) == pytest.approx([8, 12, 16, 24, 32, 48])


def test_steps_show_the_joint_on_its_cables(built: Stage) -> None:
    """A weaker motor makes it look stiffer."""
    result = stiffness.EXPERIMENT.run(built, 1, silent).result
    on_cables = result.true + built.flat()["cable.stiffness"]
    assert result.steps.stiffness.holds(on_cables)
    assert result.steps.stiffness.value == pytest.approx(on_cables, rel=1e-3)
    result = stiffness.EXPERIMENT.run(built.replace({"drive.motor_constant_ratio": 0.68}), 1, silent).result
    assert result.steps.stiffness.value == pytest.approx(result.apparent, rel=5e-3)
    assert result.apparent > result.true


@pytest.mark.slow
def test_slips_lie_within_the_static_friction_of_their_rail(built: Stage) -> None:
    (log,) = stiction.slow_legs(built, 1, 1)
    flat = log.stage.flat()
    slips = static_from_stick_slip(log.log, flat["joint.stiffness"], flat["masses.stage"], flat["joint.stroke"])
    low, high = stiction.true_range(log)
    assert len(slips.forces) > 8
    assert slips.forces.max() < high
    assert slips.forces.min() > 0.9 * low
    assert slips.static.holds((low + high) / 2)


@pytest.mark.thorough
def test_uneven_friction_at_constant_speed_is_not_read_as_coulomb_friction(
    built: Stage, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Faster passes with a faster controller show it, and the whole curve, though friction varies along the way."""
    monkeypatch.setattr(outcome, "WAY_FACTOR", 1 / 6)
    monkeypatch.setattr(constant_speed, "PASS_DURATIONS", (48.0, 12.0))
    monkeypatch.setattr(many_speeds, "SHARED_PLACES", 1)
    result = constant_speed.EXPERIMENT.run(built, 1, silent).result
    free, (place,) = result.cases[0], result.many.places
    assert not free.place.separated
    assert not free.velocity.both.coulomb.determined
    assert place.velocity.both.coulomb.determined
    assert len(place.friction) > 12
    true = np.interp(np.abs(place.velocity.velocities), place.speeds, place.true)
    assert place.friction == pytest.approx(true, rel=0.1)


@pytest.mark.parametrize(("locked", "mass", "weak_mass"), [(True, 1.7, 2.5), (False, 0.5, 0.75)])
def test_a_weaker_motor_makes_masses_look_heavier(built: Stage, locked: bool, mass: float, weak_mass: float) -> None:
    stage = outcome.locked_stage(built) if locked else outcome.freed(built)
    true, weak, strong = frf.apparent_masses(stage, PLACE, 1)
    assert true == pytest.approx(mass, rel=0.1)
    assert weak == pytest.approx(weak_mass, rel=0.1)
    assert strong < true < weak


def test_the_measured_loop_is_the_one_computed_and_crosses_where_tuned(built: Stage) -> None:
    """Controller times plant, both measured in the same run, against the loop read from the sensitivity alone."""
    stage = outcome.locked_stage(built)
    _, loops = frf.open_loops(stage, PLACE, 1, frf.CROSSOVER_SETTINGS)
    for item in loops[2:]:
        assert frf.crossing_near_target(item) == pytest.approx(item.tuned, rel=0.15)
    log = rig_log(outcome.excite(stage, PLACE, 1), 0, "", "frequency", stage, 1)
    plant, loop = outcome.estimate_plant([log]), outcome.loop(log)
    hertz = plant.frequency
    control = _controller(stage, hertz)
    inside = (hertz > 4) & (hertz < 150)
    ratio = loop.response[inside] / (control * plant.response)[inside]
    assert np.abs(ratio - 1).max() < 0.05


def _controller(stage: Stage, hertz: np.ndarray) -> np.ndarray:
    """Eq. 7 and 8 of the thesis, in continuous time."""
    flat, s = stage.flat(), 2j * np.pi * hertz
    omega = 2 * np.pi * flat["controller.crossover"]
    root = flat["controller.alpha"] ** -0.5
    tau_z, tau_p = root / omega, 1 / (omega * root)
    tau_i = flat["controller.beta"] * tau_z
    gain = flat["controller.tuned_mass"] * omega**2 / root
    return gain * (1 + s * tau_z) * (1 + 1 / (s * tau_i)) / (1 + s * tau_p)


def test_a_free_joint_is_stable_up_to_a_setting_and_not_beyond(built: Stage) -> None:
    settings, stable = frf.stable_settings(outcome.freed(built), PLACE, 1)
    highest = frf.highest_stable(settings, stable)
    assert settings[0] < highest < settings[-1]
    assert stable[settings <= highest].all()
    assert not stable[settings > highest].any()


def test_an_experiment_on_the_joint_needs_one(built: Stage) -> None:
    rigid = built.replace({"joint": None, "parasitic": None})
    for item in (frf, stiffness, stiction, constant_speed):
        with refused("joint"):
            item.EXPERIMENT.run(rigid, 1, silent)


def test_a_standing_stage_is_simulated_as_exactly_as_a_moving_one(built: Stage) -> None:
    """A motion of no length gave tolerances without bound: the cart's velocity changed its sign unseen."""
    log = rig_log(outcome.excite(outcome.locked_stage(built), PLACE, 1), 0, "", None, built, 1)
    flat = built.flat()
    assert not log.failure
    deflection = log.true["bristle_deflection"] * flat["friction.bristle_stiffness"]
    assert np.abs(deflection).max() < 2 * flat["friction.static"]
