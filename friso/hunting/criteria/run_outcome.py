"""Name what a stage does, by its run and by what attracts it, and when it has settled.

The settling time is that of friso check, compare, simulate, sweep, map and tune. It runs from the last corner of the
reference until the deviation stays within a band while the reference stands there. For a motion that stands at several
places it is the longest of these times. It is infinite if the deviation is outside the band when the reference leaves,
or when the run ends. So a stage that does not move at all has not settled, although it is in position once the
reference is back.

The outcome says what a run did until its end, and nothing on what the stage can do. Just one of the four holds:

- *swings*: over the last quarter the deviation goes to and fro by more than twice the band. It does so again and again,
  so it has a period. And it lasts: it is at least half as wide as over the last half of the run, and it turned within
  the last period. If the reference moves in the last half, only the time after it counts.
- *rests*: it does not swing, and stays within the band about the reference to the end.
- *creeps*: it does neither: it is outside the band at its end without swinging. It drifts, sticks there, or dies out.
- *failed*: the run was not completed.

The band depends on the question: `REST_BAND` for sweeps and maps, the position window of a specification, or the user's
band for being in position. A swing slower than the run is long looks like creeping.

The verdict is on the stage: by the cycles that attract, and by where its own motion ends. Just one of them holds:

| verdict | a cycle attracts | the stage's own motion |
|---|---|---|
| hunts | yes | ends in it |
| bistable | yes | rests; a kick or another move starts hunting |
| transient | no | has not come to rest at its end |
| settles | no | has come to rest |
| undecided | perhaps | was completed; whether a cycle attracts, or where the motion ends, is not certain |
| failed | | was not completed |
| none | unknown | has a reference that keeps moving: of a single stage there is no verdict then |

A run alone gives no verdict. What attracts is a cycle that was closed as an orbit, or else, and then it is said
("observed"), a swing that long simulations do not leave.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np

from friso.engine.batch import Runs
from friso.equations.motion import Stand, last_part, stands
from friso.hunting.turning import LAST_HALF, LAST_QUARTER, scan_turning_points

BandName = Literal["inner", "outer"]


def settling_of_runs(flat: Mapping[str, Any], runs: Runs, band: BandName) -> np.ndarray:
    """Return the settling times [s] of a chunk of runs into one of their bands, shape (runs,).

    `flat` has the keys of the stages, such as "friction.static", in SI; arrays have one entry per run of the chunk.
    Runs that were not completed get a time as well.
    """
    return _longest(_at_stands(flat, runs, band))


def settling_in_the_end(flat: Mapping[str, Any], runs: Runs, band: BandName) -> np.ndarray:
    """Return the settling times [s] of runs at the last place of the reference, shape (runs,).

    The verdict on a stage needs no other place. `flat` has the keys of the stages in SI.
    """
    return _at_stands(flat, runs, band)[-1]


def _at_stands(flat: Mapping[str, Any], runs: Runs, band: BandName) -> list[np.ndarray]:
    """Return settling times [s] at the places that the reference leaves, and at its last place.

    Both arrays have the shape (runs,). The first has the longest time over all places that the reference leaves. A time
    is infinite for a run that is outside its `band` when the reference leaves or the run ends.
    """
    last, before = runs.statistic(f"{band}_exit"), runs.statistic(f"{band}_before")
    in_the_end = _since(stands(flat)[-1], np.where(last < runs.statistic("ended"), last, np.inf))
    return [np.maximum(before, 0.0), in_the_end]


def settling_of_traces(places: list[Stand], time: np.ndarray, deviation: np.ndarray, within: float) -> np.ndarray:
    """Return the longest settling time [s] of sampled runs over the reference's places, (runs,).

    The deviations [m] have the shape (runs, n), the times [s] (n,). A run has settled at the sample after the last one
    outside of the band, `within` [m].
    """
    times = []
    for place in places:
        seen = time if place is places[-1] else time[time < place.until]
        following = np.searchsorted(seen, last_outside(seen, deviation[:, : len(seen)], within), side="right")
        times.append(_since(place, np.append(seen, np.inf)[following]))
    return _longest(times)


def _since(place: Stand, entered: np.ndarray) -> np.ndarray:
    return np.maximum(entered - place.corner, 0.0)


def _longest(times: list[np.ndarray]) -> np.ndarray:
    return np.max(times, axis=0)


SWINGS: Final = "swings"
CREEPS: Final = "creeps"
RESTS: Final = "rests"
FAILED: Final = "failed"

OUTCOMES = (SWINGS, CREEPS, RESTS, FAILED)
"""All words for an outcome; the order decides which of two counts as worse."""

REST_BAND = 1e-5
"""Band [m] about the reference within which a run of a sweep rests: friso's choice, the wider one of
`friso.hunting.measures.BANDS`."""

LASTING_RATIO = 0.5
"""Least ratio of the peak-to-peak deviation over the last quarter to that over the last half, for a swing to last. A
swing that decays at a tenth of its frequency is gone by then."""

OUTCOME_CRITERION = (
    "what the run does at its end: swings (a lasting swing), creeps (outside the band without), rests (inside)"
)


@dataclass(frozen=True)
class End:
    """State of runs at their end, arrays of shape (runs,).

    `completed`: the run came to its end. `swing` [m]: peak to peak over the last quarter; `earlier` [m]: over the last
    half. `period` [s]: period of the swing (NaN: none). `turned` [s]: time of the last turn (-inf: never). `outside`
    [s]: last time outside the band. `ended` [s]: end of the run.
    """

    completed: np.ndarray
    swing: np.ndarray
    earlier: np.ndarray
    period: np.ndarray
    turned: np.ndarray
    outside: np.ndarray
    ended: np.ndarray


def lasts(
    swing: np.ndarray, earlier: np.ndarray | float, band: np.ndarray | float, lasting: float = LASTING_RATIO
) -> np.ndarray:
    """Return which runs still swing by more than twice the `band` [m] without decaying, (runs,).

    The peak-to-peak `swing` [m] must also be at least `lasting` times the `earlier` one [m]. Pass 0 as `earlier` for a
    run long enough for any transient to decay.
    """
    return (swing > 2 * np.asarray(band)) & (swing >= lasting * np.asarray(earlier))


def swings_on(end: End, band: np.ndarray | float) -> np.ndarray:
    """Return which runs swing by more than twice the `band` [m] to their end, again and again, (runs,)."""
    with np.errstate(invalid="ignore"):
        return lasts(end.swing, end.earlier, band) & (end.ended - end.turned <= end.period)


def outcomes(end: End, band: np.ndarray | float = REST_BAND, hold: np.ndarray | float = 0.0) -> np.ndarray:
    """Return swings, creeps, rests or failed for every run, shape (runs,).

    A run rests if it left the band [m] for the last time more than `hold` [s] before its end.
    """
    with np.errstate(invalid="ignore"):
        rests = end.outside + hold < end.ended
    words = np.where(swings_on(end, band), SWINGS, np.where(rests, RESTS, CREEPS))
    return np.where(end.completed, words, FAILED).astype(object)


@np.errstate(all="ignore")  # runs that fail leave infinities and NaN behind
def end_of_traces(
    time: np.ndarray,
    deviation: np.ndarray,
    band: float,
    completed: np.ndarray | None = None,
    corner: np.ndarray | float = 0.0,
) -> End:
    """Describe how sampled runs end: deviations [m], (runs, n), over times [s], (n,).

    All runs count as `completed` unless an array says otherwise; their references stand from the `corner` [s] on. A run
    outside the band [m] at its last sample was outside when it ended.
    """
    runs = len(deviation)
    ended = np.full(runs, time[-1])
    swing, earlier = (
        np.ptp(np.where(time >= last_part(share, ended, corner)[:, None], deviation, deviation[:, -1:]), axis=1)
        for share in (LAST_QUARTER, LAST_HALF)
    )
    # The whole trace: the first sample of a part would pass for a turn, even on a flank.
    samples, values = np.full(runs, len(time)), np.ascontiguousarray(deviation)
    turns = scan_turning_points(np.tile(time, (runs, 1)), values, samples, np.nan_to_num(swing), ended, corner)
    done = np.ones(runs, bool) if completed is None else completed
    return End(done, swing, earlier, turns.period, turns.turned, last_outside(time, deviation, band), ended)


def last_outside(time: np.ndarray, deviation: np.ndarray, band: float) -> np.ndarray:
    """Return the last time [s] at which deviations were outside the band [m], (runs,).

    NaN counts as outside; the result is -inf if they never were. The deviations [m] have the shape (runs, n), the times
    [s] (n,).
    """
    outside = ~(np.abs(deviation) <= band)
    last = len(time) - 1 - outside[:, ::-1].argmax(axis=1)
    return np.where(outside.any(axis=1), time[last], -np.inf)


Verdict = Literal["hunts", "bistable", "transient", "settles", "undecided", "failed", "none"]

VERDICTS: tuple[Verdict, ...] = ("hunts", "bistable", "transient", "settles", "undecided", "failed")
"""All verdicts, the worst first."""

ATTRACTED: tuple[Verdict, ...] = ("hunts", "bistable")
"""Verdicts on stages with a stable limit cycle."""

UNDECIDED: tuple[Verdict, ...] = ("undecided", "failed")
"""Verdicts that leave open whether a stage has a stable limit cycle."""

VERDICT_CRITERION = "verdict on the stage, by its attracting cycles and where its own motion ends"


def verdicts(
    completed: np.ndarray, decided: np.ndarray, attracts: np.ndarray, ends_in_cycle: np.ndarray, rests: np.ndarray
) -> np.ndarray:
    """Return the verdict on every stage; all arrays have the shape (count,).

    `completed` is true if the run of the stage's own motion was, and `decided` if the following arguments are certain.
    `attracts` is true if the stage has a stable limit cycle. The end of its own motion is described by `ends_in_cycle`
    if it has one, else by `rests`.
    """
    hunting = np.where(ends_in_cycle, "hunts", "bistable")
    free = np.where(rests, "settles", "transient")
    word = np.where(decided, np.where(attracts, hunting, free), "undecided")
    return np.where(completed, word, "failed").astype(object)
