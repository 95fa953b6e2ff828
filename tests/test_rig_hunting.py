"""Hunting on the virtual rig: how runs end, and what the experiment finds of the thesis's figures."""

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from patched import patched
from refusals import refused

from friso import load
from friso.engine.arrays import Status
from friso.progress import silent
from friso.virtual_rig.run import RecordedRuns
from friso_thesis.questions.rig.words import rig_document, rig_figures, sentences
from friso_thesis.studies.rig.experiments import hunting
from friso_thesis.studies.rig.moves_on_rails import (
    distance,
    move,
    numbers_of,
    on_rails,
    rail_runs,
    rails,
    released,
    run_moves,
    turning_points,
    with_joint,
)

RIG = load(Path(__file__).parents[1] / "examples" / "thesis_drive.toml")


def recorded(*deviations: np.ndarray, step: float = 1e-3) -> RecordedRuns:
    """Runs whose position deviates so [m] from a reference of 0."""
    position = np.array(deviations)
    statuses = np.where(np.isfinite(position).all(axis=1), Status.DONE, Status.DONE + 1)
    logged = {"position": position, "reference": np.zeros_like(position)}
    return RecordedRuns(np.arange(len(position)), step, logged, {"position": position}, statuses)


def test_a_cycle_of_known_shape() -> None:
    """A triangle that rises for 0.4 s and falls for 1.2 s, between -0.2 and 0.6 mm."""
    time = np.arange(0, 20, 1e-3)
    phase = time % 1.6
    deviation = np.where(phase < 0.4, -0.2 + 2 * phase, 0.6 - (phase - 0.4) * 2 / 3) * 1e-3
    runs = rail_runs(recorded(deviation))
    assert runs.swings[0]
    assert runs.swing[0] == pytest.approx(0.8e-3, rel=1e-2)
    assert runs.period[0] == pytest.approx(1.6, rel=1e-3)
    assert (runs.above[0], runs.below[0]) == pytest.approx((0.6e-3, 0.2e-3), rel=1e-2)
    assert runs.rising[0] == pytest.approx(0.25, rel=1e-2)
    assert max(runs.period_scatter[0], runs.height_scatter[0]) < 1e-2
    assert runs.peaks[0] == 7  # maxima at 10.0, 11.6, ..., 19.6 s


def test_swings_that_die_out_count_but_do_not_last() -> None:
    """Runs that failed neither hunt nor settle."""
    time = np.arange(0, 20, 1e-3)
    runs = rail_runs(recorded(np.where(time < 16.5, 5e-4 * np.sin(2 * np.pi * time), 0.0)))
    assert runs.peaks[0] == 7  # maxima at 10.25, 11.25, ..., 16.25 s
    assert not runs.swings[0]
    cycle = 5e-4 * np.sin(2 * np.pi * time)
    runs = rail_runs(recorded(cycle, np.where(time < 15, cycle, np.nan), np.zeros_like(time)))
    assert runs.failed.tolist() == [False, True, False]
    assert np.isnan(runs.swing[1])
    share = runs.share()
    assert share.probability == 0.5
    sound = replace(runs, **{item.name: getattr(runs, item.name)[[0, 2]] for item in fields(runs)})
    assert share.high > sound.share().probability


def test_turning_points_of_a_flat_top() -> None:
    time, values = np.arange(7.0), np.array([0, 1, 1, 1, 0, 0, 2.0])
    assert [point.tolist() for point in turning_points(time, values)] == [[3.0, 5.0], [1.0, 0.0]]


def test_the_move_is_the_thesis_s() -> None:
    """Sec. 4.3.2: 100 mm at 100 m/s^2. A larger stage moves farther, and one without a joint is refused."""
    task = move(RIG)
    assert distance(RIG) == pytest.approx(0.1)
    assert task.pieces[0] == pytest.approx([0, 0, 0, 100])
    assert task.pieces[-1] == pytest.approx([2 * np.sqrt(0.1 / 100), 0.1, 0, 0])
    assert task.duration == 20.0
    assert distance(RIG.replace({"motion.acceleration_time": "0.1 s"})) == pytest.approx(1.0)
    with refused("joint"):
        hunting.EXPERIMENT.run(RIG.replace({"joint": None, "parasitic": None}), 1, silent)


@pytest.mark.slow
def test_hunting_ends_at_more_crossover() -> None:
    """Fig. 25: it hunts at 8 Hz, here on some of eight rails, and no more at 14.3 Hz."""
    changes = on_rails(RIG, {"controller.crossover": np.array([8.0, 14.3])}, rails(RIG)[:8])
    moved = run_moves(with_joint(RIG, locked=True), move(RIG), numbers_of(1, 2, 8), changes).shaped(2, 8)
    assert 2 <= (moved.peaks[0] > 0).sum() < 8
    assert not moved.peaks[1].any()
    assert moved.swing[0, moved.swings[0]] == pytest.approx(1e-3, rel=0.5)


@pytest.mark.slow
def test_hunting_can_be_started() -> None:
    """Fig. 25: a rail that settles after the move hunts on once released, from several places; here at 11 Hz."""
    machine = with_joint(RIG, locked=True).replace({"controller.crossover": "11 Hz", "rail.seed": 20})
    tasks = [move(machine), *(released(machine, place) for place in (-3e-2, -2e-2, 1e-3, 2e-3))]
    after_move, *after_release = (run_moves(machine, task, [20], {}) for task in tasks)
    assert after_move.peaks[0] == 0
    assert sum(bool(item.swings[0]) for item in after_release) >= 2


SMALL = {
    "RELATIVE_CROSSOVERS": np.array([8.0, 9.5, 14.3]) / 8,
    "SHOWN_CROSSOVERS": (0, 1, 2),
    "RELEASE_DISTANCES": (0.02,),
    "rails": lambda stage: rails(stage)[:2],
}


def test_free_joint_does_not_hunt() -> None:
    """The result agrees with Fig. 24, and the page says so."""
    with patched({hunting: SMALL}):
        outcome = hunting.EXPERIMENT.run(RIG, 1, silent)
    assert not outcome.result.cases["free"].peaks.any()
    assert outcome.result.cases["locked"].peaks[0].any()
    assert [log.kind for log in outcome.logs] == ["moves"] * 6
    assert all(sentences(outcome))
    assert rig_figures(outcome)
    assert rig_document(outcome)["results"]
