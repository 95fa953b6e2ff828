"""Ends of cycles beside which other swings attract, and where a limiter chatters."""

import numpy as np
import pytest
from beyond_flip import STEEP

from friso.equations.bandwidth import faster
from friso.hunting import Ensemble, KeyRange, Space, diagram, find_cycles, stuck
from friso.hunting.attractors.survey import of_cycles
from friso.hunting.edge_search import EdgeSearch
from friso.hunting.path import bandwidth_path
from friso.hunting.what_attracts import what_attracts
from friso.stage import Stage

pytestmark = pytest.mark.inner

FLIP = 0.135006
"""Factor of the bandwidth at which the symmetric cycle of the steep stage begins to repel; subcritical near by."""


@pytest.mark.slow
def test_an_edge_moves_on_to_what_attracts_beyond_a_flip() -> None:
    """Irregular swings beside the cycle, and others, attract to more than 1 % beyond its end."""
    outward = EdgeSearch(bandwidth_path(STEEP.flat(), True), 1.0)
    below = what_attracts(outward.path.stages(np.array([0.13])))
    end = outward.end(0.13, below.motions, 0.14)
    assert 1.0125 * FLIP < end.inside < end.outside < 1.03 * FLIP


@pytest.mark.slow
def test_the_steep_stage_swings_on_beyond_its_flip() -> None:
    """For 300 periods, 0.1 and 1.25 % above."""
    distances = np.linspace(112e-6, 128e-6, 24)
    for share in (1.001, 1.0125):
        stages = Ensemble.held(faster(STEEP.flat(), np.full(24, share * FLIP)), 24)
        results = stages.run(stuck(stages, distances), np.full(24, 26 * 300.0), 1e-8, window=0.95)
        assert np.any(np.ptp(results.statistics[:, 1:3], axis=1) > 200e-6)


@pytest.mark.slow
def test_a_flip_with_a_limiter_that_chatters_is_known_as_far_as_its_multipliers_scatter(rig: Stage) -> None:
    """The thesis rig's multiplier passes -1 at 5.599, 5.609 and 5.614 Hz; the start decides which is met."""
    flat = rig.replace({"joint.locked": False}).flat()
    for crossover in (5.45, 5.5):
        at = crossover / flat["controller.crossover"]
        stages = Ensemble.held(faster(flat, np.array([at])), 1)
        (orbit,) = of_cycles(np.arange(1), find_cycles(stages), stages.sticking)
        factor, *_ = EdgeSearch(bandwidth_path(flat, True), 10.0).followed(at, orbit)
        assert factor * flat["controller.crossover"] == pytest.approx(5.607, rel=0.01)
    key = KeyRange("controller.crossover", 5.4, 5.8)
    traced = diagram(Space.of(rig.replace({"joint.locked": False}), [key]), seeds=2)
    ((flip,),) = traced.special  # a boundary lists it once, as uncertain
    assert 2e-3 < traced.error(flip) / 5.6 < 0.01
    assert abs(traced.value(flip.point.place) - 5.6065) + 0.0075 < traced.error(flip)


def test_a_fold_with_a_limiter_that_chatters_is_where_its_branch_turns_back(rig: Stage) -> None:
    """The fold lies elsewhere than where the multiplier over a hundredth of the distance is 1 (3.64663 Hz).

    At 1e-9, started beside the cycle, the stage still swings after 400 periods at 3.6468 Hz, and rests at 3.647 Hz.
    """
    joint = {"joint.locked": False, "joint.stiffness": "50 N/mm", "joint.stroke": "50 um"}
    leaning = rig.replace({**joint, "friction.asymmetry": 0.1, "controller.crossover": "3.63 Hz"})
    flat = leaning.flat()
    stages = Ensemble.held(flat, 1)
    (orbit,) = of_cycles(np.arange(1), find_cycles(stages), stages.sticking)
    factor, *_ = EdgeSearch(bandwidth_path(flat, True), 10.0).followed(1.0, orbit)
    assert 3.63 * factor == pytest.approx(3.6468, rel=0.01)
