"""Whole runs against exact solutions, against SciPy Radau with live kinks, and against themselves at tighter rtol."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from cycles import by_gains
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq
from variants import HOLD, PARASITIC, TOUCHING, VARIANTS, lugre, stage, step, van_dijk

import friso
from benchmarks import by_hand as plain
from benchmarks.by_hand import by_hand
from benchmarks.truth.draws import draw
from friso.engine.arrays import BatchOptions, Results, Status, new_queue
from friso.engine.batch import RunOptions, prepare, run_chunks
from friso.engine.kernel import empty_results, kernel
from friso.equations import motion
from friso.equations.structure import structure
from friso.stage import Stage

LINEAR = VARIANTS["rigid, no friction section"]
MOVE = {"motion.return_at": 0.1, "motion.duration": 0.3}


def exact(flat: dict[str, Any], names: tuple[str, ...], times: np.ndarray) -> np.ndarray:
    """States of the linear stage at the times, shape (times, states), by matrix exponentials from corner to corner."""
    still = plain.rates(flat | {"motion.kind": "hold"}, names)
    held = plain.rates(flat | {"motion.kind": "step", "motion.size": 1.0}, names)
    n = len(names)
    system = np.zeros((n + 3, n + 3))
    system[:n, :n] = np.array([still(0, row) for row in np.eye(n)]).T
    system[:n, n] = held(0, [0.0] * n)
    system[n, n + 1] = system[n + 1, n + 2] = 1.0
    rows = motion.pieces(flat, 1)[0]
    x, states = np.zeros(n), np.zeros((times.size, n))
    for start, end, r in zip(rows[:, 0], [*rows[1:, 0], np.inf], rows[:, 1:], strict=True):
        full = np.concatenate([x, r])
        for i in np.flatnonzero((times >= start) & (times < end)):
            states[i] = (expm(system * (times[i] - start)) @ full)[:n]
        if end < np.inf:
            x = (expm(system * (end - start)) @ full)[:n]
    return states


def fixed_steps(h: float, interval: float, changes: dict[str, Any]) -> tuple[Results, np.ndarray, np.ndarray]:
    """The linear stage in steps of h (shorter to a corner): results, sampled states, exact states."""
    flat = LINEAR.flat() | changes
    shape = kernel(structure(LINEAR.flat()))
    options = RunOptions(rtol=1e-2, interval=interval)
    batch = prepare(shape, flat, 1, options)
    batch.first_steps[:] = h
    batch.longest[:] = h
    batch.tolerances[:] = 1e9
    samples = int(flat["motion.duration"] / interval * (1 + 1e-12)) + 1
    results = empty_results(1, 512, samples, len(shape.states))
    settings = BatchOptions(1e-2, 1e6, 1e-6, 1e-5, 0.0, interval, np.zeros(1, np.int64))
    shape.run(new_queue(), batch, settings, results)
    assert results.statuses[0] == Status.DONE
    assert results.statistics[0, 6] == 0
    times = np.arange(samples) * interval
    return results, results.samples[0], exact(flat, shape.states, times)


def test_order_of_the_compiled_kernel() -> None:
    """Order 5 everywhere in the steps, over a move with corners (both step lengths divide the times between them)."""
    errors = []
    for h in (1e-3, 5e-4):
        _, states, expected = fixed_steps(h, 0.3 / 731, MOVE | {"controller.crossover": 5.0})
        errors.append(np.max(np.abs(states - expected), axis=0))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(5, abs=0.1)


def test_every_corner_is_a_step() -> None:
    """With the reference known, only the corner times decide the number of steps."""
    results, _, _ = fixed_steps(1.0, 0.3, MOVE)
    corners = {0.0, 0.03, 0.06, 0.1, 0.13, 0.16, 0.225, 0.3}  # 0.225: start of the window for extremes
    assert results.statistics[0, 5] == len(corners) - 1
    assert results.statistics[0, 7] == 0.3


@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-8])
def test_samples_and_turning_points_are_as_good_as_the_steps(rtol: float) -> None:
    """Everywhere within some rtol of the size of the motion; a straight line between steps would miss by far."""
    flat = LINEAR.flat() | MOVE
    shape = kernel(structure(LINEAR.flat()))
    (runs,) = run_chunks(shape, flat, 1, RunOptions(rtol=rtol, interval=7e-4))
    times = np.arange(runs.results.samples.shape[1]) * 7e-4
    expected = exact(flat, shape.states, times)
    sizes = np.max(np.abs(expected), axis=0)
    assert np.all(np.abs(runs.results.samples[0] - expected) <= 20 * rtol * sizes)
    count = int(runs.results.turn_counts[0])
    assert count >= 5
    turns = true_turns(flat, shape.states, times[::4])
    assert runs.results.turn_times[0, :count] == pytest.approx(turns, abs=20 * rtol * 0.03)
    at = exact(flat, shape.states, np.array(turns))[:, 0] - motion.reference(flat, np.array(turns))
    assert runs.results.turn_values[0, :count] == pytest.approx(at, abs=20 * rtol * sizes[0])


def true_turns(flat: dict[str, Any], names: tuple[str, ...], times: np.ndarray) -> list[float]:
    """Times at which the exact position turns against the reference."""

    def rate(t: float) -> float:
        return exact(flat, names, np.array([t]))[0, 1] - plain.reference(flat, t)[1]

    rates = np.array([rate(t) for t in times])
    at = np.flatnonzero(rates[1:-1] * rates[2:] < 0) + 1
    return [brentq(rate, times[i], times[i + 1], xtol=1e-13) for i in at]


def radau(flat: dict[str, Any], names: tuple[str, ...], scales: np.ndarray, times: np.ndarray) -> np.ndarray:
    """States by SciPy Radau from the equations written by hand, from corner to corner."""
    signs = {"position": 1, "cart_position": 1, "parasitic_position": 1, "filtered_error": -1}  # it has settled
    x = motion.initial_displacement(flat) * np.array([signs.get(name, 0) for name in names], float)
    corners = [*(c for c in motion.pieces(flat, 1)[0][:, 0] if c < times[-1]), times[-1]]
    states = np.zeros((times.size, len(names)))
    rates, nudges = plain.rates(flat, names), np.diag(1e-7 * scales)

    def jacobian(t: float, x: np.ndarray) -> np.ndarray:
        columns = [np.subtract(rates(t, x + nudge), rates(t, x - nudge)) for nudge in nudges]
        return np.array(columns).T / (2e-7 * scales)

    for start, end in pairwise(corners):
        inside = (times >= start) & (times <= end)
        options = {"rtol": 1e-9, "atol": 1e-11 * scales, "max_step": (end - start) / 20, "first_step": 1e-7}
        solution = solve_ivp(rates, (start, end), x, "Radau", dense_output=True, jac=jacobian, **options)
        assert solution.success
        states[inside], x = solution.sol(times[inside]).T, solution.y[:, -1]
    return states


TOUCHES = stage(step(), friction=lugre(2), joint=TOUCHING, parasitic=PARASITIC, controller=van_dijk())


@pytest.mark.cases(slow=3)
@pytest.mark.parametrize(
    ("chosen", "changes"),
    [
        pytest.param(VARIANTS["rigid"], {"motion.duration": 3.5}, id="rigid"),
        pytest.param(
            VARIANTS["free, parasitic"],
            {"motion.duration": 0.12},
            id="free, parasitic",
            marks=pytest.mark.thorough,
        ),
        pytest.param(by_gains(8, "6 N"), {"motion.duration": 0.5, "motion.displacement": 1e-2}, id="gains, limit"),
        pytest.param(VARIANTS["rigid, Stribeck 1.5, PD measured"], {"motion.duration": 0.4}, id="Stribeck, measured"),
        pytest.param(VARIANTS["rigid, limit, wound up"], {"motion.duration": 0.5}, id="wound up"),
        pytest.param(VARIANTS["rigid, limit, back-calculation"], {"motion.duration": 0.5}, id="back-calculation"),
        pytest.param(TOUCHES, {"motion.duration": 0.06}, id="touching, parasitic"),
    ],
)
def test_runs_against_radau(chosen: Stage, changes: dict[str, Any]) -> None:
    """Stretches are short, with stops, reversals, contacts and a force at its limit.

    Except for Stribeck's law, their structures are those of other tests, whose kernels are compiled already.
    """
    flat = chosen.flat() | changes
    if "motion.return_at" in flat:
        flat["motion.return_at"] = 0.6 * flat["motion.duration"]
    shape = kernel(structure(flat))
    interval = flat["motion.duration"] / 100
    (runs,) = run_chunks(shape, flat, 1, RunOptions(rtol=1e-11, interval=interval))
    assert runs.results.statuses[0] == Status.DONE
    times = np.arange(runs.results.samples.shape[1]) * interval
    ours = runs.results.samples[0]
    scales = np.max(np.abs(ours), axis=0)
    theirs = radau(flat, shape.states, scales, times)
    sensitive = 50 if "joint.stroke" in flat else 1  # contacts and the 300 Hz mode multiply small differences
    assert np.max(np.abs(ours - theirs) / scales) < 1e-6 * sensitive


@pytest.mark.slow
@pytest.mark.parametrize("bias", [5.0, -5.0])
def test_a_reference_that_stands_still_is_no_measure_of_length(bias: float) -> None:
    """Constant forces that nothing carries set the stage in motion: tolerances follow from the friction, whatever the
    reference does."""
    slow = {"bias.cart": f"{bias} N", "bias.stage": "1e-6 N", "controller.crossover": "4 Hz"}
    flat = stage(HOLD, friction=lugre(2), controller=van_dijk()).replace(slow).flat() | {"motion.duration": 5.0}
    shape = kernel(structure(flat))
    (runs,) = run_chunks(shape, flat, 1, RunOptions(interval=0.1), starts=np.zeros((1, shape.initial_size)))
    ours, times = runs.results.samples[0], np.arange(51) * 0.1
    theirs = radau(flat, shape.states, np.max(np.abs(ours), axis=0), times)
    length = flat["friction.static"] / float(shape.module.stiffness(shape.values(flat | {"motion.size": 0.0}, 1))[0][0])
    assert np.max(np.abs(theirs[:, shape.position])) > 5e-3
    assert np.max(np.abs(ours - theirs)[:, shape.position]) < 1e-2 * length


@pytest.mark.parametrize("duration", [0.33, 0.43, 0.46])
def test_the_last_sample_is_taken(duration: float) -> None:
    """The last sample is taken even if rounding puts the end of the run just before it."""
    flat = LINEAR.flat() | MOVE | {"motion.duration": duration}
    (runs,) = run_chunks(kernel(structure(LINEAR.flat())), flat, 1, RunOptions(rtol=1e-6, interval=duration / 24))
    assert runs.results.samples.shape[1] == 25
    assert np.all(np.isfinite(runs.results.samples))


def test_turning_points_against_a_tighter_run() -> None:
    """On a stretch with stops, at rtol 1e-6 they agree to about 1e-6 with those at 1e-11."""
    flat = VARIANTS["rigid"].replace({"motion": {"kind": "step", "size": "-2 mm", "duration": "8 s"}}).flat()
    shape = kernel(structure(flat))
    rough, fine = (next(iter(run_chunks(shape, flat, 1, RunOptions(rtol=rtol)))).results for rtol in (1e-6, 1e-11))
    count = int(fine.turn_counts[0])
    assert count > 10
    assert rough.turn_counts[0] == count
    assert rough.turn_times[0, :count] == pytest.approx(fine.turn_times[0, :count], abs=2e-4)
    assert rough.turn_values[0, :count] == pytest.approx(fine.turn_values[0, :count], abs=2e-8)


@pytest.mark.slow
def test_a_long_step_does_not_pass_over_the_stribeck_peak():
    """Under a limited force a release is nearly a parabola, and steps are long; friction's peak before the stage comes
    to rest is narrow beside what such a step changes the velocity by (seed 1, number 18 of `benchmarks.truth`)."""
    released = draw(1, 18)
    equations, times = by_hand(released.flat()), np.linspace(0, 2, 401)
    expected = equations.run(equations.start(released.flat()["motion.displacement"]), times, 1e-9)[:, 0]
    ours = friso.simulate(released, sample_time=times[1])["position"].values[: times.size]
    assert np.abs(ours - expected).max() < 1e-4 * equations.length  # 0.06 where the peak is passed over
