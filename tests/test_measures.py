"""Peak count and period on turning points made by hand: what they count, and what they leave out."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import find_peaks

from friso.engine.batch import run_chunks
from friso.engine.kernel import kernel
from friso.equations.structure import structure
from friso.hunting.criteria import COUNTED_ABOVE, COUNTED_AFTER, LEAST_PEAK_SEPARATION, distinct_peaks
from friso.hunting.measures import measure_runs, measuring_options, scan_turning_points
from friso.hunting.settings import CheckSettings
from friso.stage import Stage
from friso.studies.axes import Samples
from friso.studies.study import Request


def peaks(turns: list[tuple[float, float]]) -> list[float]:
    """Times of the distinct peaks among the (time, value) turning points of one run."""
    times, values = (np.array([column]) for column in zip(*turns, strict=True))
    return times[distinct_peaks(times, values, np.array([len(turns)]))].tolist()


def periods(times: np.ndarray, values: np.ndarray, counts: np.ndarray, amplitude: np.ndarray) -> np.ndarray:
    """Periods of the cycles [s] in runs of 20 s."""
    return scan_turning_points(times, values, counts, amplitude, np.full(len(counts), 20.0)).period


RINGING = [(11.0, -3e-4), (12.0, 3e-4), (12.1, 3e-4 - 1e-9), (12.2, 3e-4 - 1e-10), (13.0, -3e-4)]
AT_THE_EDGE = [(9.5, 0.0), (10.0, 2e-4), (10.2, 0.0), (10.5, 2e-4), (10.7, 0.0), (11.5, 1e-4), (12.0, 0.0)]


@pytest.mark.parametrize(
    ("turns", "counted"),
    [
        (
            [(9.0, 2e-4), (9.5, -2e-4), (11.0, 2e-4), (12.0, -2e-4), (13.0, 0.9e-4), (14.0, -2e-4), (15.0, 3e-4)],
            [11.0, 15.0],
        ),
        (
            [(11.0, 2e-4), (11.1, 1e-4), (11.2, 5e-4), (11.3, 1e-4), (11.6, 4e-4), (11.65, 0.0), (11.75, 3e-4)],
            [11.2, 11.75],
        ),
        (AT_THE_EDGE, [10.0, 10.5]),  # peaks at 10 s and 0.5 s apart count, those of 0.1 mm do not
        ([(11.0, 0.0), (11.2, 2e-4), (11.3, 0.0), (11.4, 2e-4), (11.5, 0.0)], [11.2]),
        ([(11.0, 5e-4), (11.2, 0.0), (11.3, 3e-4), (11.4, 0.0)], [11.0]),
        ([(9.0, 3e-4), (9.5, 0.0), (11.0, 0.5e-4), (12.0, 0.0)], []),
        ([(11.0 + k, 2e-4 + 1e-19 * (-1) ** k) for k in range(9)], []),  # a stuck stage turns by rounding alone
        (RINGING, [12.0]),
    ],
)
def test_late_and_tall_maxima_count_and_of_close_ones_the_tallest(
    turns: list[tuple[float, float]], counted: list[float]
) -> None:
    assert peaks(turns) == counted


def test_runs_of_a_batch_do_not_mix() -> None:
    times = np.array([[11.0, 11.5, 12.0], [11.0, 11.5, 12.0]])
    values = np.array([[1e-3, -1e-3, 1e-3], [1e-3, -1e-3, 1e-3]])
    assert distinct_peaks(times, values, np.array([3, 1])).sum(axis=1).tolist() == [2, 0]


@pytest.mark.slow
@given(st.lists(st.tuples(st.floats(0.01, 0.4), st.integers(-500, 500)), min_size=2, max_size=60))
def test_agrees_with_scipy(gaps: list[tuple[float, int]]) -> None:
    """Against find_peaks with the same prominence (the swing), and the tallest kept first done slowly."""
    values = 2e-6 * np.array([value for _, value in gaps])
    times = 9.0 + np.cumsum([gap for gap, _ in gaps])
    fenced = np.concatenate([[-1.0], values, [-1.0]])
    maxima = find_peaks(fenced, prominence=1e-6)[0] - 1
    kept: list[int] = []
    tall = [k for k in maxima if times[k] >= COUNTED_AFTER and values[k] > COUNTED_ABOVE]
    for k in sorted(tall, key=lambda k: -values[k]):
        if all(abs(times[k] - times[other]) >= LEAST_PEAK_SEPARATION for other in kept):
            kept.append(k)
    if len(set(values)) == len(values):
        assert peaks(list(zip(times.tolist(), values.tolist(), strict=True))) == times[sorted(kept)].tolist()


@pytest.mark.parametrize("many", [0, 10**9])
def test_period_of_a_cycle_with_ringing_on_top(many: int) -> None:
    """A 2 s cycle of 1 mm on which a 0.05 s ringing of 0.1 mm makes turning points of its own; compiled and plain."""
    time = np.linspace(0.0, 20.0, 200_001)
    wave = np.sin(np.pi * time) + 0.1 * np.sin(40 * np.pi * time)
    turns = np.flatnonzero(np.diff(np.sign(np.diff(wave)))) + 1
    with CheckSettings(compiled_from_points=many).in_use():
        period = periods(time[None, turns], 1e-3 * wave[None, turns], np.array([turns.size]), np.array([2.2e-3]))
    assert period[0] == pytest.approx(2.0, rel=1e-3)


def swung(maxima: list[float], minima: list[float], leg: float) -> float:
    """The period of swings by a leg [m] in a run whose peak-to-peak amplitude is 2 m."""
    times = np.sort(maxima + minima)
    values = leg * np.isin(times, maxima)
    return float(periods(times[None], values[None], np.array([times.size]), np.array([2.0]))[0])


def test_period_of_uneven_swings() -> None:
    """The period is measured from the first maximum of the last quarter, at 15 s, to the last but one.

    The last maximum is unfinished. Half-swings of at least half the amplitude count.
    """
    assert swung([14.0, 15.0, 16.2, 18.0, 19.0], [14.5, 15.5, 16.6, 18.5], 1.0) == pytest.approx(1.5)
    assert np.isnan(swung([14.0, 15.0, 16.2, 18.0, 19.0], [14.5, 15.5, 16.6, 18.5], 0.99))
    assert swung([14.9, 16.2, 18.7], [15.2, 17.2, 19.6], 1.0) == pytest.approx(2.5)  # of two maxima
    assert swung([14.9, 16.2, 19.7], [13.0, 15.2, 17.2], 1.0) == pytest.approx(2.0)  # of two minima
    assert swung([9.0, 10.5, 13.5, 16.5], [9.5, 12.0, 15.5, 19.0], 1.0) == pytest.approx(3.0)  # the last half's last


def test_no_period_without_a_cycle() -> None:
    still = periods(np.array([[16.0, 18.0]]), np.zeros((1, 2)), np.array([2]), np.array([1e-9]))
    assert np.isnan(still[0])


def test_a_period_longer_than_the_last_quarter_is_taken_from_the_last_half() -> None:
    times, values = np.array([[10.5, 13.5, 16.5, 19.5]]), 1e-3 * np.array([[1.0, -1.0, 1.0, -1.0]])
    period = periods(times, values, np.array([4]), np.array([2e-3]))
    assert period[0] == pytest.approx(6.0)


def test_compiled_loops_do_what_the_plain_ones_do() -> None:
    rng = np.random.default_rng(1)
    times = np.sort(rng.uniform(8, 20, (300, 40)), axis=1)
    values = rng.normal(0, 3e-4, (300, 40)) * (-1.0) ** np.arange(40)
    values[::2] = 2e-4 + 1e-3 * values[::2]  # ripple
    counts, amplitude = rng.integers(0, 41, 300), rng.uniform(0, 1e-3, 300)
    compiled = scan_turning_points(times, values, counts, amplitude, np.full(300, 20.0))
    with CheckSettings(compiled_from_points=10**9).in_use():
        plain = scan_turning_points(times, values, counts, amplitude, np.full(300, 20.0))
    for name in ("peaks", "distinct", "period", "turned", "earlier"):
        assert np.array_equal(getattr(compiled, name), getattr(plain, name), equal_nan=name == "period")
    assert 0 < np.isnan(plain.period).sum() < 300
    assert plain.peaks.sum() > plain.distinct.sum() > 0


@pytest.mark.parametrize("rtol", [1e-2, 1e-4])
def test_small_swings_that_are_passed_over_change_no_measure(rig: Stage, rtol: float) -> None:
    """The kernel keeps a zigzag of turning points only; against all of them, on stages that ring on their limiter."""
    samples = Samples(
        {"joint.limiter_damping": "0.01 N*s/m..1e4 N*s/m:log", "controller.crossover": "2 Hz..12 Hz"}, 256
    )
    study = Request(rig, {}, samples).study()
    flat = rig.flat(study.columns(np.arange(256)))
    shape = kernel(structure(flat))
    result = {}
    for least in (measuring_options(rtol).least_swing, 0.0):
        columns = [np.full(256, np.nan) for _ in range(7)]
        for runs in run_chunks(shape, flat, 256, replace(measuring_options(rtol), least_swing=least)):
            measures = measure_runs(runs.part(flat), runs)
            swings = measures.outcome == "swings"
            measured = (
                measures.distinct_peaks,
                measures.period,
                measures.peak_to_peak,
                *measures.settling_time,
                swings,
            )
            measured = (*measured, runs.results.turn_counts)
            for column, values in zip(columns, measured, strict=True):
                column[runs.numbers] = values
        result[least] = columns
    (*filtered, few), (*unfiltered, many) = result.values()
    for one, other in zip(filtered, unfiltered, strict=True):
        assert np.array_equal(one, other, equal_nan=True)
    assert few.sum() < many.sum()
