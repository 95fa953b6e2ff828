"""The criteria on hunting: words that exclude each other and leave nothing out, in batches and alone, mirrored, and
the thesis's peak count against scipy."""

from dataclasses import fields
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.signal import find_peaks

import friso
from friso.engine.batch import run_chunks
from friso.engine.kernel import kernel
from friso.equations.structure import structure
from friso.hunting import check_given, judge_many
from friso.hunting.criteria import (
    ATTRACTED,
    COUNTED_ABOVE,
    COUNTED_AFTER,
    LEAST_PEAK_SEPARATION,
    LEAST_VALLEY_DEPTH,
    OUTCOMES,
    REST_BAND,
    UNDECIDED,
    VERDICTS,
    End,
    counted_peaks,
    distinct_peaks,
    end_of_traces,
    outcomes,
    peaks_in_traces,
    verdicts,
)
from friso.hunting.measures import measure_runs, measuring_options
from friso.questions.simulate.question import conclusion
from friso.stage import Stage
from friso_thesis.studies.rig.moves_on_rails import turning_points

STEP, DURATION = 1 / 128, 20.0
TIME = np.arange(0, DURATION + STEP / 2, STEP)

lengths = st.floats(1e-8, 1e-1)


def one(end: End, k: int) -> End:
    """The end of one of several runs."""
    return End(*(getattr(end, item.name)[[k]] for item in fields(End)))


# ---------------------------------------------------------------- the verdict on a stage


@given(st.tuples(*[st.booleans()] * 5))
def test_a_stage_has_just_one_verdict(facts: tuple[bool, bool, bool, bool, bool]) -> None:
    """The table of `friso.hunting.criteria.run_outcome` is tested entry by entry."""
    completed, decided, attracts, in_cycle, rests = facts
    sure = completed and decided
    (word,) = verdicts(*(np.array([flag]) for flag in facts))
    assert word in VERDICTS
    assert (word == "failed") == (not completed)
    assert (word in UNDECIDED) == (not sure)
    assert (word in ATTRACTED) == (sure and attracts)
    assert (word == "hunts") == (sure and attracts and in_cycle)
    assert (word == "bistable") == (sure and attracts and not in_cycle)
    assert (word == "settles") == (sure and not attracts and rests)
    assert (word == "transient") == (sure and not attracts and not rests)


@pytest.mark.slow
@pytest.mark.usefixtures("own_bandwidth")
def test_check_is_the_batch_of_one(rig: Stage) -> None:
    """Four verdicts of stages alone, and the same stages in one batch."""
    crossovers = np.array([8.0, 10.0, 12.0, 4.0])
    locked = rig.replace({"joint.locked": True})
    flat = locked.flat({"controller.crossover": crossovers})
    stages = [locked.replace({"controller.crossover": f"{f} Hz"}) for f in crossovers]
    alone = [check_given(stage, 1e-6).verdict for stage in stages]
    assert judge_many(flat, 4, 1e-6).tolist() == alone
    assert judge_many(locked.flat({"controller.crossover": crossovers[:1]}), 1, 1e-6).tolist() == alone[:1]
    assert set(alone) == {"hunts", "transient", "settles"}


# ---------------------------------------------------------------- what a run did


ends = st.tuples(
    st.booleans(),
    lengths,
    lengths,
    st.floats(0.1, 10.0) | st.just(np.nan),
    st.floats(0.0, DURATION) | st.just(-np.inf),
    st.floats(0.0, DURATION) | st.just(-np.inf),
)


@pytest.mark.slow
@given(st.lists(ends, min_size=1, max_size=20), st.floats(1e-7, 1e-3), st.floats(0.0, 5.0))
def test_a_run_has_just_one_outcome(several: list[tuple], band: float, hold: float) -> None:
    """The definitions of `friso.hunting.criteria.run_outcome` are tested; a batch equals its single runs."""
    done, swing, before, period, turned, outside = (np.array(column) for column in zip(*several, strict=True))
    earlier = np.maximum(swing, before)
    end = End(done, swing, earlier, period, turned, outside, np.full(len(several), DURATION))
    words = outcomes(end, band, hold)
    for k in range(len(several)):
        swings = swing[k] > 2 * band and swing[k] >= earlier[k] / 2 and DURATION - turned[k] <= period[k]
        rests = not swings and outside[k] + hold < DURATION
        expected = [not done[k], swings, rests, not swings and not rests]
        assert words[k] == ("failed" if not done[k] else ("swings", "rests", "creeps")[expected[1:].index(True)])
        assert words[k] in OUTCOMES
        assert sum(expected[1:]) == 1
        assert outcomes(one(end, k), band, hold)[0] == words[k]


@pytest.mark.slow
@settings(max_examples=60)
@given(st.floats(0.3, 5.0), st.floats(1e-5, 1e-2), st.floats(-1e-3, 1e-3), st.floats(0.5, 50.0), st.floats(1e-7, 1e-2))
def test_outcomes_of_traces(frequency: float, size: float, offset: float, decay: float, band: float) -> None:
    """Traces swing, drift, stand or die out; each is tested with its mirror image."""
    swing = offset + size * np.sin(2 * np.pi * frequency * TIME)
    dying = size * np.exp(-TIME / decay) * np.cos(2 * np.pi * frequency * TIME)
    runs = np.array([swing, dying, offset + 0 * TIME, offset + size * TIME])
    words = outcomes(end_of_traces(TIME, runs, band), band)
    mirrored = outcomes(end_of_traces(TIME, -runs, band), band)
    assert words.tolist() == mirrored.tolist()
    if size < 0.49 * band or size > 1.1 * band:  # sampling sees the extremes to a tenth
        assert (words[0] == "swings") == (size > band)
    assert words[2] == ("rests" if abs(offset) <= band else "creeps")
    assert words[3] != "swings"
    if decay < 3:
        assert words[1] != "swings"
    alone = [outcomes(end_of_traces(TIME, row[None], band), band)[0] for row in runs]
    assert alone == words.tolist()


def test_a_run_that_failed_has_failed_whatever_it_did() -> None:
    swing = 1e-3 * np.sin(TIME * 5)[None]
    assert outcomes(end_of_traces(TIME, swing, REST_BAND, np.zeros(1, bool))).tolist() == ["failed"]
    assert outcomes(end_of_traces(TIME, swing, REST_BAND)).tolist() == ["swings"]
    assert outcomes(end_of_traces(TIME, np.full((1, len(TIME)), np.nan), REST_BAND)).tolist() == ["creeps"]


@pytest.mark.parametrize("until", [15.5, 17.0, 18.5])
def test_a_swing_that_stops_before_the_end_rests(until: float) -> None:
    """However large the last quarter is; one that is going on swings."""
    stopped = np.where(until > TIME, 1e-3 * np.sin(2 * np.pi * TIME), 0.0)[None]
    assert outcomes(end_of_traces(TIME, stopped, REST_BAND)).tolist() == ["rests"]
    assert outcomes(end_of_traces(TIME, 1e-3 + stopped, REST_BAND)).tolist() == ["creeps"]


def test_a_jump_after_a_decay_is_no_swing() -> None:
    """An integral that is reset as the error passes zero: the stage comes in, jumps once, and comes in again. A part of
    the trace that begins on the flank before begins with no turn."""
    decay = lambda since: np.exp(-np.maximum(TIME - since, 0))  # noqa: E731
    jumped = np.where(TIME < 15.4, 1e-3 * decay(6.0), 2e-5 * decay(15.4) ** 0.1)[None]
    for run in (jumped, -jumped):
        assert outcomes(end_of_traces(TIME, run, 1e-6), 1e-6).tolist() == ["creeps"]


def test_rest_may_be_asked_for_some_time() -> None:
    late = np.where(TIME < 18, 1e-3, 0.0)[None]
    end = end_of_traces(TIME, late, REST_BAND)
    assert [outcomes(end, REST_BAND, hold)[0] for hold in (0.0, 1.9, 2.1)] == ["rests", "rests", "creeps"]


def test_outcomes_of_runs_are_those_of_their_traces(rig: Stage) -> None:
    """The statistics and turning points of the kernel against samples of the same runs; each alone and together."""
    crossovers = np.array([2.0, 5.0, 8.0, 9.5, 12.0, 16.0])
    flat = rig.replace({"joint.locked": True}).flat({"controller.crossover": crossovers})
    (runs,) = run_chunks(kernel(structure({**flat, "controller.crossover": 8.0})), flat, 6, measuring_options(1e-6))
    words = measure_runs(runs.part(flat), runs).outcome
    assert set(words) > {"swings", "rests"}
    for k, crossover in enumerate(crossovers):
        stage = rig.replace({"joint.locked": True, "controller.crossover": f"{crossover} Hz"})
        trace = friso.simulate(stage, rtol=1e-6, sample_time=1e-3)
        deviation = (trace.position - trace.reference).values[None]
        assert outcomes(end_of_traces(trace.time.values, deviation, REST_BAND), REST_BAND)[0] == words[k]
        (alone,) = run_chunks(kernel(structure(stage.flat())), stage.flat(), 1, measuring_options(1e-6))
        assert measure_runs(stage.flat(), alone).outcome[0] == words[k]


# ---------------------------------------------------------------- the peak count


def sampled_peaks(values: np.ndarray, prominence: float | None = None) -> list[float]:
    """Times of the counted peaks of samples by scipy: maxima late and tall, of which the tallest are kept first."""
    maxima, _ = find_peaks(values, height=np.nextafter(COUNTED_ABOVE, 1), prominence=prominence)
    spikes = np.zeros(len(values))
    late = maxima[TIME[maxima] >= COUNTED_AFTER]
    spikes[late] = values[late]
    return TIME[find_peaks(spikes, distance=round(LEAST_PEAK_SEPARATION / STEP))[0]].tolist()


waves = st.lists(st.tuples(st.floats(0.1, 4.0), st.floats(1e-5, 1e-3), st.floats(0, 6.28)), min_size=1, max_size=4)


@pytest.mark.slow
@settings(max_examples=150)
@given(waves, st.floats(-1e-3, 1e-3))
def test_peaks_of_sampled_traces_agree_with_scipy(parts: list[tuple[float, float, float]], offset: float) -> None:
    """The thesis's rule is that of findpeaks, which asks for no prominence."""
    values = offset + sum(size * np.sin(2 * np.pi * rate * TIME + phase) for rate, size, phase in parts)
    times, turns = turning_points(TIME, values)
    assume(len(times) > 1 and len({*turns}) == len(turns))  # of equals either may stay
    marked = counted_peaks(times[None], turns[None], np.array([len(times)]))[0]
    assert times[marked].tolist() == sampled_peaks(values)


def test_where_a_trace_ends_is_no_peak() -> None:
    """Traces that end on their way up, smooth or with noise, have the peaks that scipy finds; a drift has none."""
    random = np.random.default_rng(5)
    phases, noise = np.linspace(0, 2 * np.pi, 12), 1e-7 * random.standard_normal((12, len(TIME)))
    swings = 5e-4 * np.sin(2 * np.pi * 0.31 * TIME + phases[:, None]) + 2e-5 * np.sin(2 * np.pi * 2.3 * TIME)
    drifts = np.array([1e-5 * TIME, 2e-4 - 1e-6 * TIME, 2e-4 + 0 * TIME])
    runs = np.vstack([swings, swings + noise, drifts, drifts + noise[:3]])
    counts = peaks_in_traces(TIME, runs)
    assert counts.tolist() == [len(sampled_peaks(values, LEAST_VALLEY_DEPTH)) for values in runs]
    assert np.any(swings[:, -1] > np.maximum(swings[:, -2], COUNTED_ABOVE))
    assert counts[24:].tolist() == [0] * 6


def test_ripple_is_counted_by_the_thesis_and_is_not_distinct() -> None:
    """A stage that breaks away on its way back springs forward by half a micrometre first."""
    times = np.array([[10.5, 11.5, 11.501, 12.5]])
    values = np.array([[1e-3, 5e-4, 5e-4 + 5e-7, -1e-3]])
    assert counted_peaks(times, values, np.array([4])).sum() == 2
    assert distinct_peaks(times, values, np.array([4])).sum() == 1


@pytest.mark.parametrize(
    ("deviation", "word"),
    [
        (10.0 + 0 * TIME, "creeps"),
        (TIME, "ever farther"),
        (np.exp(TIME / DURATION) * np.cos(TIME), "ever farther"),
        (np.exp(-TIME / DURATION) * np.cos(TIME), "come to rest"),
    ],
)
def test_a_run_off_its_reference_is_said_to_creep_only_where_it_hardly_moves(deviation: np.ndarray, word: str) -> None:
    late = deviation[TIME >= 0.75 * DURATION]
    measures: Any = SimpleNamespace(outcome=["creeps"], peak_to_peak=[np.ptp(late)], offset=[0.0])
    said = conclusion("axis", measures, deviation)
    assert [other for other in ("creeps", "ever farther", "come to rest") if other in said] == [word]
