"""A log of hunting: number, period, amplitude and evenness of swings, compared with the predicted cycle.

Thesis, Sec. 3.2.2 and 4.3.2, Fig. 24 to 27.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from friso.errors import InputError
from friso.hunting import hunting
from friso.identification.kind import AnalysisSettings, ExperimentKind, Prior, of_one
from friso.identification.logs.log import Log
from friso.identification.readings.common import channel
from friso.identification.settings import experiment_settings


@dataclass(frozen=True)
class PredictedCycle:
    """Predicted limit cycle of a stage: amplitude [m] and period [s]."""

    amplitude: float
    period: float


@dataclass(frozen=True)
class HuntingLog:
    """Swings of a stage about its reference.

    `count` is the number of whole cycles. `period` [s] and `amplitude` [m], half of peak to peak, are means over them,
    with their standard deviations. `above` and `below` [m] are the mean peaks on either side of the reference.
    `predicted` is the cycle predicted from the stage file (None: no file, or no hunting). `time` [s] and `deviation`
    [m] from the reference have the shape (n,); `peaks` are the sample numbers of the peaks.
    """

    count: int
    period: float
    period_deviation: float
    amplitude: float
    amplitude_deviation: float
    above: float
    below: float
    predicted: PredictedCycle | None
    time: np.ndarray
    deviation: np.ndarray
    peaks: np.ndarray
    warnings: tuple[str, ...] = ()


def swings_of(log: Log) -> HuntingLog:
    """Return the swings in a log, from the last change of its reference on.

    A cycle lasts from one upward crossing of the middle of the swing to the next, with a hysteresis against noise.
    Cycles before the first one that is about as large as the later ones are a transient, and left out.
    Raises InputError for a log without a position in SI units, or with less than two cycles.
    """
    part = log.longest
    position = channel(log, "position")[part]
    time, reference = log.time[part], np.zeros(len(position))
    if "reference" in log:
        reference = channel(log, "reference")[part]
        changes = np.flatnonzero(np.abs(np.diff(reference)) > np.finfo(np.float32).eps * np.ptp(reference))
        start = int(changes[-1]) + 1 if changes.size else 0
        time, position, reference = time[start:], position[start:], reference[start:]
    deviation = position - (reference if "reference" in log else np.median(position))
    low, high = np.percentile(deviation[len(deviation) // 2 :], [1, 99])  # the later part, after the transient
    side = _sides(deviation - (low + high) / 2, experiment_settings.hysteresis_of_swings * (high - low) / 2)
    ups = np.flatnonzero((side[1:] > 0) & (side[:-1] < 0)) + 1
    if len(ups) < 3:
        actual = f"{max(len(ups) - 1, 0)} whole cycles after the reference stands"
        raise InputError(f"{log.name}, position", actual, "two cycles of hunting or more", "a longer log")
    cycles = [slice(first, last) for first, last in pairwise(ups.tolist())]
    above, below = (np.array([way * (way * deviation[one]).max() for one in cycles]) for way in (1, -1))
    sizes = (above - below) / 2
    settled = np.abs(sizes / np.median(sizes[len(sizes) // 2 :]) - 1) < experiment_settings.transient_swing_share
    first = min(int(settled.argmax()), len(cycles) - 2)
    cycles, above, below, sizes = cycles[first:], above[first:], below[first:], sizes[first:]
    periods = np.diff(time[ups[first:]])
    peaks = np.array([one.start + int(np.argmax(deviation[one])) for one in cycles])
    return HuntingLog(
        count=len(cycles),
        period=float(periods.mean()),
        period_deviation=float(periods.std(ddof=1)),
        amplitude=float(sizes.mean()),
        amplitude_deviation=float(sizes.std(ddof=1)),
        above=float(above.mean()),
        below=float(-below.mean()),
        predicted=None,
        time=time,
        deviation=deviation,
        peaks=peaks,
    )


def _sides(values: np.ndarray, hysteresis: float) -> np.ndarray:
    """Return the side of 0 of values, 1 or -1, with hysteresis; shape (n,).

    Values within the hysteresis keep the previous side.
    """
    side = np.where(np.abs(values) > hysteresis, np.sign(values), 0.0)
    last = np.maximum.accumulate(np.where(side != 0, np.arange(len(side)), 0))
    return side[last]


def _analyse(log: Log, prior: Prior, settings: AnalysisSettings) -> HuntingLog:
    """Analyse a log of hunting, and predict the cycle of the stage, if a stage file is given."""
    shown = swings_of(log)
    if prior.stage is None or not prior.from_user:
        return shown
    cycle = next(iter(hunting(prior.stage).attracting), None)
    if cycle is None:
        warning = "The stage file does not hunt, whatever the move: its friction or its controller is another."
        return replace(shown, warnings=(warning,))
    return replace(shown, predicted=PredictedCycle(float(cycle.amplitude), float(cycle.period)))


KIND = ExperimentKind[HuntingLog](of_one(_analyse), roles=("position",))
