"""Lanes, threads, chunks and order of the runs change nothing, bit for bit; a failing run harms no other."""

from typing import Any

import numpy as np
import pytest
from variants import VARIANTS, gains, lugre, release, stage

from friso.engine.arrays import Results, Status
from friso.engine.batch import RunOptions, run_chunks
from friso.engine.kernel import Kernel, kernel
from friso.equations.structure import structure

RUNS = 83
BASE = RunOptions(rtol=1e-5, interval=5e-3)
Flat = dict[str, Any]


@pytest.fixture(scope="module")
def flat() -> Flat:
    """Runs that differ in crossover, friction and move, and so in steps: lanes are refilled at all times."""
    rng = np.random.default_rng(1)
    flat = VARIANTS["rigid"].flat()
    return flat | {
        "controller.crossover": rng.uniform(2, 20, RUNS),
        "friction.static": rng.uniform(1, 4, RUNS),
        "motion.displacement": rng.normal(size=RUNS) * 2e-2,
        "motion.duration": 3.0,
    }


@pytest.fixture(scope="module")
def native() -> Kernel:
    """A kernel with as many lanes as this processor's registers hold."""
    return kernel(structure(VARIANTS["rigid"].flat()))


def run(shape: Kernel, flat: Flat, options: RunOptions, runs: int = RUNS) -> Results:
    """The results of all chunks in one piece. Turning points and samples that are not there are NaN."""
    chunks = list(run_chunks(shape, flat, runs, options))
    order, parts = np.argsort(np.concatenate([chunk.numbers for chunk in chunks])), [chunk.results for chunk in chunks]
    columns = []
    for arrays in zip(*parts, strict=True):
        width = max(array.shape[1] if array.ndim > 1 else 0 for array in arrays)
        columns.append(np.concatenate([widened(array, width) for array in arrays])[order])
    results = Results(*columns)
    for j, count in enumerate(results.turn_counts):
        results.turn_times[j, count:] = results.turn_values[j, count:] = np.nan
    return results


def widened(array: np.ndarray, width: int) -> np.ndarray:
    if array.ndim == 1 or array.dtype != float:
        return array
    padding = [(0, 0), (0, width - array.shape[1])] + [(0, 0)] * (array.ndim - 2)
    return np.pad(array, padding, constant_values=np.nan)


def assert_identical(first: Results, second: Results, which: Any = slice(None)) -> None:
    for name, a, b in zip(Results._fields, first, second, strict=True):
        width = max(array.shape[1] if array.ndim > 1 else 0 for array in (a, b))
        assert np.array_equal(widened(a, width)[which], widened(b, width)[which], equal_nan=True), name


@pytest.fixture(scope="module")
def reference(native: Kernel, flat: Flat) -> Results:
    results = run(native, flat, BASE)
    assert np.all(results.statuses == Status.DONE)
    assert np.all(results.turn_counts > 0)
    assert len({tuple(row) for row in results.statistics}) == RUNS
    return results


@pytest.mark.cases(first=4)
@pytest.mark.parametrize(("threads", "chunk"), [(1, 4096), (2, 4096), (5, 4096), (2, 1), (1, 7), (3, 32)])
def test_any_number_of_threads_and_chunks(
    native: Kernel, flat: Flat, reference: Results, threads: int, chunk: int
) -> None:
    assert_identical(run(native, flat, RunOptions(1e-5, interval=5e-3, threads=threads, chunk=chunk)), reference)


def test_alone_or_in_company(native: Kernel, flat: Flat, reference: Results) -> None:
    for j in range(0, RUNS, 9):
        alone = {key: value[j] if np.ndim(value) else value for key, value in flat.items()}
        single = run(native, alone, BASE, 1)
        samples = single.samples.shape[1]
        assert np.array_equal(single.samples[0], reference.samples[j, :samples])
        count = single.turn_counts[0]
        assert count == reference.turn_counts[j]
        assert np.array_equal(single.turn_times[0, :count], reference.turn_times[j, :count])
        assert np.array_equal(single.turn_values[0, :count], reference.turn_values[j, :count])
        assert np.array_equal(single.statistics[0], reference.statistics[j])


def test_any_order(native: Kernel, flat: Flat, reference: Results) -> None:
    order = np.random.default_rng(2).permutation(RUNS)
    shuffled = {key: value[order] if np.ndim(value) else value for key, value in flat.items()}
    results = run(native, shuffled, BASE)
    assert_identical(results, Results(*(array[order] for array in reference)))


def test_half_as_many_lanes_or_twice_as_many(native: Kernel, flat: Flat, reference: Results) -> None:
    """A single lane is computed by other instructions, which round differently.

    Lanes in two registers also round differently if there are fused multiply-adds; SSE2, with two lanes, has none.
    """
    count = native.layout.lanes // 2 if native.layout.lanes > 2 else 4
    other = kernel(structure(VARIANTS["rigid"].flat()), lanes=count)
    assert other.layout.lanes == count
    assert_identical(run(other, flat, BASE), reference)


def test_a_run_out_of_steps_harms_no_other(native: Kernel, flat: Flat, reference: Results) -> None:
    attempted = reference.statistics[:, 5]
    budget = int(np.median(attempted))
    results = run(native, flat, RunOptions(1e-5, interval=5e-3, budget=budget))
    short = results.statuses == Status.BUDGET
    assert np.array_equal(short, attempted > budget)
    assert 0 < np.count_nonzero(short) < RUNS
    assert np.all(results.statistics[short, 5] == budget)
    assert np.all(results.statistics[short, 7] < flat["motion.duration"])
    assert_identical(results, reference, ~short)
    for j in np.flatnonzero(short):  # as far as it came, it is the same run, and NaN from there on
        reached = int(results.statistics[j, 7] / 5e-3)
        assert np.array_equal(results.samples[j, : reached + 1], reference.samples[j, : reached + 1])
        assert np.all(np.isnan(results.samples[j, reached + 2 :]))


def test_an_unstable_run_harms_no_other(native: Kernel, flat: Flat, reference: Results) -> None:
    """An integrator far too strong (beta 1e-3): the stage runs away."""
    bad = np.arange(RUNS) % 11 == 3
    results = run(native, flat | {"controller.beta": np.where(bad, 1e-3, flat["controller.beta"])}, BASE)
    assert np.all(results.statuses[bad] == Status.DIVERGED)
    assert np.all(results.statistics[bad, 7] < 3.0)
    assert_identical(results, reference, ~bad)


def test_a_run_that_is_not_a_number_ends_at_once(native: Kernel, flat: Flat, reference: Results) -> None:
    bad = np.arange(RUNS) % 11 == 3
    mass = np.where(bad, np.nan, flat["masses.cart"])
    results = run(native, flat | {"masses.cart": mass}, RunOptions(1e-5, interval=5e-3, budget=20_000))
    assert np.all(results.statuses[bad] == Status.UNDERFLOW)
    assert_identical(results, reference, ~bad)


def test_runs_of_different_length(native: Kernel, flat: Flat) -> None:
    """The length of other runs does not change a run."""
    lengths = np.random.default_rng(3).uniform(0.2, 3, RUNS)
    together = run(native, flat | {"motion.duration": lengths}, BASE)
    assert_identical(
        run(native, flat | {"motion.duration": lengths}, RunOptions(1e-5, interval=5e-3, chunk=7)), together
    )


def test_many_turning_points_get_room() -> None:
    """An undamped mass on a spring turns 2000 times in 100 s: more often than there is room for at first."""
    spring = stage(release("1 mm", "100 s"), "cart", lugre(2), controller=gains(4e3))
    changes = {"friction.static": 1e-9, "friction.coulomb": 1e-9, "friction.viscous": 0.0}
    flat = spring.flat() | changes | {"friction.bristle_stiffness": 1e-3, "friction.bristle_damping": 0.0}
    (runs,) = run_chunks(kernel(structure(spring.flat())), flat, 1, RunOptions(rtol=1e-6))
    assert runs.results.statuses[0] == Status.DONE
    expected = 100 * np.sqrt(4e3) / np.pi
    assert runs.results.turn_counts[0] == pytest.approx(expected, abs=1)
    assert np.all(np.diff(runs.results.turn_times[0, : runs.results.turn_counts[0]]) > 0)
