"""The work that a question may take: counted in steps, the same on every machine."""

from dataclasses import replace

import numpy as np
import pytest
from variants import VARIANTS

from friso.engine.allowance import BATCH_WORK, Exhausted, allowance
from friso.engine.batch import RunOptions, run_chunks
from friso.engine.kernel import CALL_WORK, OPERATION_WORK, STEP_WORK, kernel
from friso.equations.structure import structure
from friso.stage import Stage


def runs_of(stage: Stage, count: int) -> np.ndarray:
    """The steps that runs of a stage take, shape (count,)."""
    flat = stage.flat()
    (runs,) = run_chunks(kernel(structure(flat)), flat, count, RunOptions())
    return runs.statistic("attempted")


def test_work_is_counted_by_steps_and_what_they_compute(locked: Stage) -> None:
    work = kernel(structure(locked.flat())).work
    with allowance() as around, allowance() as several:
        steps = runs_of(locked, 24)
    assert several.used == around.used >= work * steps.sum()
    with allowance() as single:
        runs_of(locked, 1)
    assert several.used / 24 < single.used < several.used  # a run alone keeps a whole vector busy


def test_work_is_counted_alike_on_every_processor(locked: Stage) -> None:
    """Work counts as if eight runs were done side by side, whatever the processor does."""
    work = kernel(structure(locked.flat())).work
    with allowance() as single:
        (steps,) = runs_of(locked, 1)
    assert single.used == BATCH_WORK + 8 * work * steps


def test_a_step_is_as_dear_as_the_operations_in_it() -> None:
    """One more state, a bristle, and deviations beside all states make a step dearer.

    The source alone decides, so that the result does not depend on the machine.
    """
    rigid, free = (kernel(structure(VARIANTS[name].flat())) for name in ("rigid", "free"))
    variational = kernel(structure(VARIANTS["rigid"].flat()), variational=True)
    bare = replace(
        rigid,
        source="def step(b, k):\n    b[0] = b[1] * b[2] + exp(b[3])\n\ndef locate(b, k):\n    b[0] = b[1] / b[2]\n",
    )
    assert STEP_WORK < rigid.work < free.work < variational.work < 5 * rigid.work
    assert bare.work == pytest.approx(STEP_WORK + 2 * OPERATION_WORK + CALL_WORK)


def test_runs_beyond_an_allowance_are_refused(locked: Stage) -> None:
    with allowance() as needed:
        runs_of(locked, 1)
    with allowance(needed.used / 4) as too_little, pytest.raises(Exhausted):
        runs_of(locked, 1)
    assert too_little.exhausted
    with allowance(needed.used / 4), allowance(2 * needed.used), pytest.raises(Exhausted):
        runs_of(locked, 1)
    runs_of(locked, 1)  # without one, as many as are wanted


def test_who_gave_up_is_told_as_far_out_as_the_work_was_short() -> None:
    """An allowance within another tells both that runs were given up if the other one's work is what ran out."""
    with allowance(100.0) as around, allowance(1000.0) as within, pytest.raises(Exhausted):
        within.exhaust()
    assert within.exhausted
    assert around.exhausted
    with allowance(1000.0) as around, allowance(100.0) as within, pytest.raises(Exhausted):
        within.exhaust()
    assert within.exhausted
    assert not around.exhausted
