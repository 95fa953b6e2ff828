"""The thesis's own experiments of the rig: what they find, beside what the thesis shows."""

from pathlib import Path

import numpy as np
import pytest
from patched import patched
from refusals import refused

from friso import load
from friso.progress import silent
from friso_thesis.questions.rig.words import rig_document, rig_figures, sentences
from friso_thesis.studies.rig import in_position, measured_cycles, stroke_crossover
from friso_thesis.studies.rig.moves_on_rails import rails, with_joint

RIG = load(Path(__file__).parents[2] / "examples" / "thesis_drive.toml")


def test_what_has_no_joint() -> None:
    bare = RIG.replace({"joint": None, "parasitic": None})
    for experiment in (stroke_crossover, measured_cycles, in_position):
        with refused("joint"):
            experiment.EXPERIMENT.run(bare, 1, silent)


def test_the_stroke_of_a_free_joint_matters() -> None:
    """The result agrees with Fig. 26, and the page says so."""
    sizes = {"RELATIVE_CROSSOVERS": np.array([0.5, 1.0]), "RELATIVE_STROKES": np.array([0.02, 1.0])}
    with patched({stroke_crossover: {**sizes, "rails": lambda stage: rails(stage)[:2]}}):
        outcome = stroke_crossover.EXPERIMENT.run(RIG, 1, silent)
    assert outcome.result.share[1, 1] == 0
    assert outcome.result.share[0].max() > 0
    assert all(sentences(outcome))
    assert rig_figures(outcome)
    assert rig_document(outcome)["results"]


@pytest.mark.slow
def test_limits_take_fewer_runs_than_the_grid_that_shows_them() -> None:
    """What is left out cannot move a limit: the lowest crossover is tried on some rails, one above the limit on all."""
    free, seeds = with_joint(RIG, locked=False), np.arange(1.0, 4.0)
    grid = free, 1, np.array([0.02, 1.0]), np.array([0.5, 0.75, 1.5]), seeds
    with patched({stroke_crossover: {"AT_ONCE": 1}}):
        brief = stroke_crossover.limits_of_crossover(*grid)
    whole = stroke_crossover.stroke_crossover(*grid, silent)
    assert brief.limits == pytest.approx(whole.limits)
    tried = ~brief.runs.failed
    assert brief.runs.swing[tried] == pytest.approx(whole.runs.swing[tried])
    assert not tried.all()
    assert tried[:, 0].any(axis=1).all()


@pytest.mark.slow
def test_an_even_rail_has_a_symmetric_cycle_and_an_uneven_one_has_not() -> None:
    """Fig. 27."""
    with patched({measured_cycles: {"CYCLE_STARTS": (0.0,)}}):
        even = measured_cycles.on_rail(with_joint(RIG, locked=True))
        one = measured_cycles.started(even, 1, {}, 1, silent, "")
        cases = {f"rail.{kind}_deviation": np.array([0.0, 0.1]) for kind in ("static", "coulomb")}

        several, asymmetry = measured_cycles.moves_on_varied_rails(
            even, 1, cases, np.arange(1.0, 5.0), float(one.swing[0]), silent, ""
        )
    assert one.above[0] == pytest.approx(one.below[0], rel=0.1)
    assert asymmetry[:4] == pytest.approx(0.0, abs=1e-12)
    assert several.swing[:4] == pytest.approx(one.swing[0], rel=0.02)
    lives = several.swings[4:]
    larger = (several.above > several.below)[4:][lives]
    assert lives.any()
    assert (larger == (asymmetry[4:][lives] < 0)).all()  # it overshoots to where friction is less


def test_standstill_adds_up_and_stiffness_holds() -> None:
    """Fig. 28: variances of independent disturbances add up; the free joint moves more."""
    with patched({in_position: {"SETTLING_TIME": 1.0, "RECORD_LENGTH": 4.0, "DAMPING_RATIOS": (0.01, 1.0)}}):
        standstill, kept = in_position.in_position(RIG, 1, silent, noises=(1.0, 3.0))
    assert set(kept) == {"locked", "free"}
    alike = [standstill.runs[case, "all"].true[0, 1] for case in in_position.CASES]
    assert [standstill.louder[1.0].locked, standstill.louder[1.0].free] == pytest.approx(alike)
    assert 0.1 < standstill.louder[3.0].recovered < 1.0  # by the damping of the bearing's bristles
    assert standstill.louder[3.0].free > 2 * alike[1]
    for case in in_position.CASES:
        alone = [standstill.runs[case, source].true[0, 0] ** 2 for source in in_position.SOURCES[:-1]]
        assert standstill.runs[case, "all"].true[0, 0] ** 2 == pytest.approx(sum(alone), rel=0.2)
        spectrum = standstill.runs[case, "all"].spectrum[0]
        step = standstill.frequencies[1]
        assert np.sqrt((spectrum**2).sum() * step) == pytest.approx(standstill.runs[case, "all"].true[0, 0], rel=0.2)
    assert standstill.ratio("all") > 3
    assert standstill.recovered[1] > standstill.recovered[0]
    assert standstill.amplifier == pytest.approx(400 / 2**14 / np.sqrt(12))
