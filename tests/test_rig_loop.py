"""The loop closed: what the rig logs of a drawn machine comes back from files as a stage that holds the truth."""

from pathlib import Path

import numpy as np
import pytest
from rig_machines import built, mean_level, sources, through_files

from friso.identification.experiments.frequency import _of_stage_alone
from friso.identification.method import identify
from friso.identification.readings.common import record
from friso.identification.readings.friction_velocity import friction_velocity
from friso.stage import load, save
from friso_thesis.studies.rig.experiments.stiction import slow_legs
from friso_thesis.studies.rig.experiments.stiffness import steps
from friso_thesis.studies.rig.outcome import freed

STIFFNESS, STATIC = "joint.stiffness", "friction.static"


@pytest.mark.slow
def test_rig_logs_come_back_as_a_stage_file_that_holds_the_truth(tmp_path: Path) -> None:
    machine = built(3)
    slow = slow_legs(machine.truth, 1, 1)
    files = through_files([steps(machine.truth, 1), *slow], tmp_path)
    assert [item.kind for item in files] == ["steps", "stick-slip"]
    stroke = freed(machine.truth).flat()["joint.stroke"]
    guess = machine.guess.with_numbers({"joint.stroke": stroke})
    identification = identify(sources(files), guess)
    save(identification.stage, tmp_path / "identified.toml")
    labels = load(tmp_path / "identified.toml").uncertain()
    assert set(labels) == {STIFFNESS, STATIC}
    for key, truth in ((STIFFNESS, machine.flat[STIFFNESS]), (STATIC, mean_level(slow, STATIC))):
        assert labels[key].low <= truth <= labels[key].high
        assert not labels[key].low <= guess.flat()[key] <= labels[key].high
    assert identification.stage.flat()[STIFFNESS] == pytest.approx(machine.flat[STIFFNESS], rel=2e-3)


def test_the_mass_line_of_a_free_joint_is_not_taken_for_the_whole_mass() -> None:
    """If friction hides the resonance, only the mass line above it remains, which is that of the stage alone."""
    for seed in range(20):
        machine = built(seed)
        alone, guess = machine.flat["masses.stage"], machine.guess
        assert _of_stage_alone(alone, guess)
        assert not _of_stage_alone(alone + machine.flat["masses.cart"], guess)
        assert not _of_stage_alone(alone, guess.replace({"joint.locked": True}))


def test_two_speeds_bound_friction_and_do_not_show_it() -> None:
    """With both speeds below the Stribeck velocity, the line through them starts above Coulomb friction and falls."""
    coulomb, rise, viscous, stribeck, sample_time = 1.0, 1.0, 10.0, 3e-3, 1e-3
    legs = []
    for speed in (1e-3, 2e-3) * 2:
        way = np.linspace(0.0, 0.01, round(0.01 / speed / sample_time))
        legs += [way, np.full(500, 0.01), way[::-1], np.zeros(500)]
    position = np.concatenate(legs)
    velocity = np.gradient(position, sample_time)
    friction = np.sign(velocity) * (coulomb + rise * np.exp(-((velocity / stribeck) ** 2))) + viscous * velocity
    force = friction + 0.01 * np.random.default_rng(1).standard_normal(len(position))
    both = friction_velocity(record("two", sample_time, reference=position, position=position, force=force)).both
    for result, truth in ((both.coulomb, coulomb), (both.viscous, viscous), (both.static, coulomb + rise)):
        assert not result.determined
        assert result.holds(truth)
    assert both.coulomb.high < 2.5
    assert both.stribeck_velocity.holds(stribeck)
