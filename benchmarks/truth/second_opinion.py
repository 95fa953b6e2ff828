"""Test verdicts by SciPy alone, with equations by hand: own motion and some releases."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from benchmarks.by_hand import ByHand, NotWritten, by_hand
from benchmarks.truth.claims import RUNS_AWAY, Claim
from benchmarks.truth.refute import Refutation
from benchmarks.truth.swings import RESTS, SWINGS, UNSURE, judge, legs
from benchmarks.truth.trials import SMALL

RELEASES = (0.3, 1.5, 20.0)
"""Displacements in deflections by the break-away force."""

PERIODS, SAMPLES = 40.0, 8000
"""Periods for which runs are followed, and samples in which turning points are sought."""

TWICE = 1e-9, 1e-11
"""The two relative tolerances at which a refutation has to hold."""

LONGER = 10.0
"""Factor on the time of a run that still swings, because it may be coming to rest for hundreds of periods."""


def scipy_refutations(claim: Claim) -> Iterator[Refutation]:
    """Yield SciPy's refutations of a verdict.

    They are a lasting swing although nothing is said to attract, or rest although the stage's own motion is said to
    hunt.
    """
    flat = claim.stage.flat()
    displaced = flat["motion.displacement"] if flat["motion.kind"] == "release" else 0.0
    try:
        equations = by_hand(flat)
        start, still = equations.start(displaced), equations.held()
        begun = {"its own motion": (equations, start)}
        begun |= {f"release {d:.6g}": (still, still.start(d)) for d in np.array(RELEASES) * equations.length}
    except NotWritten:
        return
    if claim.verdict == "failed" or flat["motion.kind"] == "ramp":
        return
    if equations.remembers or not np.isfinite(equations.wait):
        return
    if claim.verdict in ("hunts", RUNS_AWAY) and ends_so(equations, start, RESTS):
        yield Refutation("own motion", claim.sure, "SciPy: the motion rests in the end")
    if claim.attracted or claim.verdict == RUNS_AWAY:
        return
    for name, run in begun.items():
        if ends_so(*run, SWINGS):
            yield Refutation("verdict", claim.sure, f"SciPy: {name} swings on")
            return


def ends_so(equations: ByHand, start: np.ndarray, word: str) -> bool:
    """Tell whether a word of `swings` describes a stage's end from a state.

    Both tolerances must agree.
    """
    return all(followed(equations, start, rtol) == word for rtol in TWICE)


def followed(equations: ByHand, start: np.ndarray, rtol: float) -> str:
    """Return what becomes of a stage from a state, as a word of `swings`."""
    corner = float(equations.pieces[-1, 0])
    period = equations.period
    times = corner + np.linspace(0.0, PERIODS * period, SAMPLES)
    if corner > 0:
        before = np.linspace(0.0, corner, 100)
        start = equations.run(start, before, rtol)[-1]
        if not np.isfinite(start).all():
            return UNSURE
    last = replace(equations, pieces=equations.pieces[-1:])
    run = last.run(start, times, rtol)
    if (word := _word(equations, run, times - corner)) != SWINGS:
        return word
    longer = np.linspace(0.0, LONGER * PERIODS * period, int(LONGER) * SAMPLES)
    return _word(equations, last.run(run[-1], times[-1] + longer, rtol), longer)


def _word(equations: ByHand, run: np.ndarray, times: np.ndarray) -> str:
    """Return what became of states (times, states) at times from 0 on [s]."""
    x = run[:, 0] - equations.pieces[-1, 1]
    if not np.isfinite(x[-1]):
        return UNSURE
    small = SMALL * equations.length
    places = _turns(x, small)
    late = x[3 * len(x) // 4 :]
    return judge(legs(times[places], x[places], float(times[-1])), float(np.ptp(late)), small, False)


def _turns(x: np.ndarray, least: float) -> np.ndarray:
    """Return the numbers of the turning points of a zigzag with legs of at least `least`."""
    kept = [0]
    for k in range(1, len(x) - 1):
        turns = (x[k] - x[k - 1]) * (x[k + 1] - x[k]) <= 0 and x[k] != x[k - 1]
        if turns and abs(x[k] - x[kept[-1]]) >= least:
            kept.append(k)
    return np.array(kept)
