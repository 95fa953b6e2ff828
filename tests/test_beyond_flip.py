"""Ends of cycles beside which other swings attract, and where a limiter chatters."""

import numpy as np
import pytest
from book import BOOK

from friso.equations.bandwidth import faster
from friso.hunting import Ensemble, KeyRange, Space, diagram, find_attractors, stuck
from friso.stage import Stage

FLIP = 0.135006
"""Factor of the bandwidth at which the symmetric cycle of the steep stage begins to repel; subcritical near by."""


@pytest.mark.slow
def test_what_attracts_beyond_a_flip() -> None:
    """Irregular swings beside the cycle, and others, attract to more than 1 % beyond its end."""
    flat = faster(BOOK["steep"].flat(), FLIP * np.array([0.99, 1.0125, 1.03]))
    assert find_attractors(flat, 3).attracts.tolist() == [True, True, False]


@pytest.mark.slow
def test_the_steep_stage_swings_on_beyond_its_flip() -> None:
    """For 300 periods, 0.1 and 1.25 % above."""
    distances = np.linspace(112e-6, 128e-6, 24)
    for share in (1.001, 1.0125):
        stages = Ensemble.held(faster(BOOK["steep"].flat(), np.full(24, share * FLIP)), 24)
        results = stages.run(stuck(stages, distances), np.full(24, 26 * 300.0), 1e-8, window=0.95)
        assert np.any(np.ptp(results.statistics[:, 1:3], axis=1) > 200e-6)


@pytest.mark.slow
def test_a_flip_with_a_limiter_that_chatters_is_known_as_far_as_its_multipliers_scatter(rig: Stage) -> None:
    """The thesis rig's multiplier passes -1 at 5.599, 5.609 and 5.614 Hz; the start decides which is met."""
    key = KeyRange("controller.crossover", 5.4, 5.8)
    traced = diagram(Space.of(rig.replace({"joint.locked": False}), [key]), seeds=2)
    ((flip,),) = traced.special  # a boundary lists it once, as uncertain
    assert 2e-3 < traced.error(flip) / 5.6 < 0.01
    assert abs(traced.value(flip.point.place) - 5.6065) + 0.0075 < traced.error(flip)


@pytest.mark.slow
def test_a_fold_with_a_limiter_that_chatters_is_where_its_branch_turns_back(rig: Stage) -> None:
    """The fold lies elsewhere than where the multiplier over a hundredth of the distance is 1 (3.64663 Hz).

    At 1e-9, started beside the cycle, the stage still swings after 400 periods at 3.6468 Hz, and rests at 3.647 Hz.
    """
    joint = {"joint.locked": False, "joint.stiffness": "50 N/mm", "joint.stroke": "50 um"}
    leaning = rig.replace({**joint, "friction.asymmetry": 0.1, "controller.crossover": "3.63 Hz"})
    traced = diagram(Space.of(leaning, [KeyRange("controller.crossover", 3.6, 3.7)]), seeds=2)
    (fold,) = (spot for spot in sum(traced.special, ()) if spot.kind == "fold")
    assert traced.value(fold.point.place) == pytest.approx(3.6468, rel=1e-3)
