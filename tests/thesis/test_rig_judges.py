"""The judges of the real rig (F24 to F28, and its additions to others) on evidence made to hold and to fail."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from rig_evidence import FAILED, HUNTS, cycles, grid, loops, moves, standstill

from friso_thesis.studies.rig.experiments.frf import measured_loop
from friso_thesis.studies.thesis.claims import Evidence, Finding, registered
from friso_thesis.studies.thesis.experiments import BUILT, GRID, MOVES, ON_RAILS, STANDSTILL, Experiments
from friso_thesis.studies.thesis.judges.identified_in_time import MEASURED_MASSES, WEIGHED_MASSES
from friso_thesis.studies.thesis.judges.rig_loops import measured_free, measured_locked, on_the_rig, weaker_motor
from friso_thesis.studies.thesis.reading import OWN, read_as

Y, N = True, False
H, F = HUNTS, FAILED

MADE: dict[str, list[tuple[Any, tuple[bool, ...]]]] = {
    "F24": [
        (moves((H, 0, H, 0)), (Y, Y)),  # half of the rails will do
        (moves((H, 0, 0, 0)), (N, Y)),
        (moves((H, F, F, 0)), (Y, Y)),  # one of the two that are known
        (moves((H, H, H, H), free=(0, 0, 0, 1)), (Y, N)),
        (moves((0, 0, 0, 0), free=(H, H, H, H)), (N, N)),
        (moves((F, F, F, F), free=(F, F, F, F)), (N, N)),  # nothing is known
        (moves((0, 0, 0, 0), middle=(H, H, H, H), high=(H, H, H, H)), (N, Y)),  # the first crossover alone counts
    ],
    "F25": [
        (moves((H, H, 0, 0), middle=(H, 0, 0, 0), released=(0, H, 0, 0)), (Y, Y, Y)),
        (moves((H, 0, 0, 0), released=(0, H, 0, 0)), (Y, Y, Y)),
        (moves((H, 0, 0, 0), middle=(F, 0, 0, 0), released=(H, 0, 0, 0)), (Y, Y, N)),  # what failed did not settle
        # no stable motion other than those that moves found
        (moves((H, H, H, 0), middle=(H, 0, H, 0), released=(H, 0, H, 0)), (Y, Y, N)),
        (moves((H, 0, 0, 0), middle=(H, H, H, H), released=(H, H, H, H)), (Y, N, N)),
        (moves((H, 0, 0, 0), middle=(H, 0, 0, 0)), (Y, N, N)),  # no more rails come to rest than at 8 Hz
        (moves((H, H, 0, 0), middle=(H, 0, 0, 0), released=(0, 0, 0, 1), swings=False), (Y, Y, N)),  # dies out
        (moves((H, H, 0, 0), middle=(H, 0, 0, 0), released=(0, 0, 0, H)), (Y, Y, Y)),
        (moves((H, 0, 0, 0), high=(0, 0, 0, 1), released=(0, H, 0, 0)), (N, Y, Y)),
        (moves((0, 0, 0, 0), middle=(0, 0, 0, H), released=(0, H, 0, 0)), (N, N, Y)),
        (moves((0, 0, 0, 0), high=(H, H, H, H)), (N, N, N)),
    ],
    "F26": [
        (grid(1, 1, 0), (Y, Y)),
        (grid(1, 0, 1), (Y, N)),
        (grid(0, 1, 1), (Y, N)),
        (grid(2, 1, 0), (N, Y)),  # at the highest crossover one hunts
        (grid(1, 0, -1), (N, Y)),  # at the largest stroke none does
        (grid(0, 1, 2), (N, N)),
        (grid(runs=[[[H, H], [F, H], [F, 0]], [[H, H], [0, 0], [0, 0]], [[0, H], [0, 0], [0, 0]]]), (Y, Y)),
        (grid(runs=[[[H, H], [H, H], [F, F]], [[H, H], [0, 0], [0, 0]], [[H, H], [0, 0], [0, 0]]]), (N, Y)),
    ],
    "F27": [
        (cycles(), (Y, Y, Y, Y)),
        (cycles({"swing": 4e-3}), (N, N, Y, Y)),
        (cycles({"above": 8e-4, "below": 2e-4}), (N, Y, Y, Y)),
        (cycles({"swings": False}), (N, Y, Y, Y)),
        (cycles({"period": np.nan, "swing": 1e-6, "swings": False}), (N, N, Y, Y)),  # no cycle to compare with
        (cycles(period=0.8), (Y, N, Y, Y)),
        (cycles(swing=2e-3), (Y, N, Y, Y)),  # slow, but larger
        (cycles(swing=[1e-3, 1e-3, 3e-3, 3e-3]), (Y, Y, Y, Y)),  # half of those that live
        (cycles(swing=[1e-3, 3e-3, 3e-3, 3e-3]), (Y, N, Y, Y)),  # all that are similar, but one of four
        (cycles(period=[1.0, 0.5, 0.5, 1.0], swings=[True, True, False, False]), (Y, Y, Y, Y)),  # two of four have died
        (cycles(period=[0.5, 0.5, 1.0, 1.0], swings=[True, True, False, False]), (Y, N, Y, Y)),
        (cycles(above=5.2e-4), (Y, Y, N, Y)),
        (cycles(above=[5e-4, 5e-4, 5e-4, 9e-4]), (Y, Y, N, Y)),
        (cycles(above=4e-4, below=6e-4), (Y, Y, Y, Y)),  # either side may be the larger
        (cycles(period_scatter=0.04), (Y, Y, Y, N)),
        (cycles(period_scatter=[0.1, 0.1, np.nan, 0.0]), (Y, Y, Y, Y)),
        (cycles(swings=False, period_scatter=np.nan), (Y, N, N, N)),  # none lives on
    ],
    "F28": [
        (standstill(), (Y, Y, Y)),
        (standstill(locked=2e-8, free=2e-7), (N, Y, Y)),
        (standstill(locked=3e-7, free=5e-6), (N, Y, Y)),
        (standstill(locked=2e-7, free=5e-7), (Y, N, Y)),
        (standstill(locked=5e-8, free=2e-6), (Y, N, Y)),
        (standstill(recovered=0.4), (Y, Y, N)),
        (standstill(recovered=-0.5), (Y, Y, N)),
        (standstill(locked=1e-6, recovered=0.1), (N, N, N)),
    ],
    "locked": [
        (loops(), (Y, Y)),
        (loops(locked=((9.0,), (45.0,))), (Y, N)),
        (loops(locked=((9.0,), (45.0, 65.0, 300.0))), (Y, N)),
        (loops(locked=((9.0, 600.0), (45.0,))), (Y, N)),  # of the highest setting
        (loops(locked=((9.0,), (20.0, 600.0))), (N, Y)),
        (loops(locked=((16.0,), (45.0, 600.0))), (N, Y)),
        (loops(locked=((), (45.0, 600.0))), (N, Y)),
        (loops(locked=((16.0,), ())), (N, N)),
    ],
    "free": [
        (loops(), (Y, Y)),
        (loops(free=(21.0, 6.0)), (Y, Y)),
        (loops(free=(6.0, 20.0, 50.0)), (N, Y)),  # the last crossing counts
        (loops(free=(8.0,)), (N, Y)),
        (loops(free=()), (N, Y)),
        (loops(stable=1), (Y, N)),
        (loops(stable=4), (Y, N)),
        (loops(free=(8.0,), stable=0), (N, N)),
    ],
    "motor, locked": [(loops(), (Y,)), (loops(weak=(2.0, 0.9)), (N,)), (loops(weak=(np.nan, 0.9)), (N,))],
    "motor, free": [(loops(), (Y,)), (loops(weak=(2.4, 0.6)), (N,))],
}
"""Invented evidence by claim, or by addition to claims, and which parts hold."""

NEEDS = {"F24": MOVES, "F25": MOVES, "F26": GRID, "F27": ON_RAILS, "F28": STANDSTILL}

ADDED = {
    "locked": measured_locked,
    "free": measured_free,
    "motor, locked": lambda results: weaker_motor(results, 0, MEASURED_MASSES[0], WEIGHED_MASSES[0]),
    "motor, free": lambda results: weaker_motor(results, 1, MEASURED_MASSES[1], WEIGHED_MASSES[1]),
}
"""Parts that the loops of the rig as built add to F17, F18, F22 and F23."""


def evidence(**results: Any) -> Evidence:
    return Evidence({}, {}, identified=cast(Experiments, SimpleNamespace(**results)))


def judged(what: str, made: Any) -> Finding:
    if what in ADDED:
        return Finding(on_the_rig(evidence(rig_loops=made), ADDED[what]))
    return registered()[what].judge(evidence(**{NEEDS[what]: made}))


EACH = [
    pytest.param(what, made, pattern, id=f"{what}-{n}")
    for what, cases in MADE.items()
    for n, (made, pattern) in enumerate(cases)
]


@pytest.mark.cases(first=54)
@pytest.mark.parametrize(("what", "made", "pattern"), EACH)
def test_made_evidence(what: str, made: Any, pattern: tuple[bool, ...]) -> None:
    finding = judged(what, made)
    assert tuple(part.holds for part in finding.parts) == pattern, finding  # self-tests too


@pytest.mark.parametrize(
    ("words", "what", "made", "part"),
    [
        ({"half": 0.7}, "F24", moves((H, 0, H, 0)), 0),
        ({"half": 0.7}, "F27", cycles(swing=[1e-3, 1e-3, 3e-3, 3e-3]), 1),
        ({"half": 0.2}, "F27", cycles(above=[5e-4, 5e-4, 5e-4, 9e-4]), 2),
        ({"half": 0.7}, "F28", standstill(), 2),
        ({"twice": 1.9}, "F27", cycles(period=0.93), 1),
        ({"similar": 3.0}, "F27", cycles(swing=2e-3), 1),
        ({"unequal": 1.05}, "F27", cycles(above=5.4e-4), 2),
        ({"uneven": 0.02}, "F27", cycles(period_scatter=0.04), 3),
    ],
)
def test_other_readings_turn_what_they_are_about(words: dict[str, float], what: str, made: Any, part: int) -> None:
    own = [part.holds for part in judged(what, made).parts]
    with read_as(replace(OWN, **words)):
        turned = [part.holds for part in judged(what, made).parts]
    assert [n for n, (before, after) in enumerate(zip(own, turned, strict=True)) if before != after] == [part]


def test_every_judge_of_the_rig_as_built_is_tried() -> None:
    on_rig = {claim for claim, entry in registered().items() if entry.needs & set(NEEDS.values())}
    assert on_rig == NEEDS.keys() == MADE.keys() - ADDED.keys()
    assert all(registered()[claim].needs == {need} for claim, need in NEEDS.items())
    assert {claim for claim, entry in registered().items() if BUILT in entry.needs} == {"F17", "F18", "F22", "F23"}


def test_a_part_is_added_where_the_rig_was_run() -> None:
    assert on_the_rig(Evidence({}, {}), measured_locked) == ()


def test_a_loop_that_was_not_stable_crosses_nowhere() -> None:
    nothing = SimpleNamespace(failure="after 0.4 s: the sampled loop is unstable")
    made = loops()
    unstable = replace(made, locked=(made.locked[0], measured_loop(cast(Any, nothing), 48.0)))
    assert [part.holds for part in judged("locked", unstable).parts] == [False, False]


def test_settings_beyond_one_that_is_not_stable_do_not_count() -> None:
    island = replace(loops(), stable=np.array([True, False, True, False]))
    assert [part.holds for part in judged("free", island).parts] == [True, False]
