"""A log of hunting: number, period, amplitude and evenness of swings, compared with the predicted cycle.

Thesis, Sec. 3.2.2 and 4.3.2, Fig. 24 to 27.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from friso.errors import InputError
from friso.hunting import hunting
from friso.identification.kind import TIME, AnalysisSettings, ExperimentKind, Facts, Prior, Source
from friso.identification.logs.log import Log
from friso.identification.readings.common import channel
from friso.shown.documents import entries
from friso.shown.drawing.figure import INK, VERMILLION, Axis, Figure, Limit, Markers, Panel, Series
from friso.shown.text import swing_with_unit, with_unit


@dataclass(frozen=True)
class PredictedCycle:
    """Predicted limit cycle of a stage: amplitude [m], period [s], and middle between its peaks [m]."""

    amplitude: float
    period: float
    middle: float


@dataclass(frozen=True, kw_only=True)
class HuntingLog:
    """Swings of a stage about its reference.

    `count` is the number of whole cycles. `period` [s] and `amplitude` [m], half of peak to peak, are means over them,
    with their standard deviations. `above` and `below` [m] are the mean peaks on either side of the reference, or of
    the middle of the swing without one. `predicted` is the cycle predicted from the stage file (None: no file, or no
    hunting). `time` [s] and `deviation` [m] from the reference have the shape (n,); `peaks` are the sample numbers of
    the peaks.
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

    @property
    def middle(self) -> float:
        """Return the middle between the mean peaks on either side of the reference [m]."""
        return (self.above - self.below) / 2

    @property
    def extremes(self) -> tuple[float, float]:
        """Return the mean peaks below and above the reference [m], with their signs."""
        return -self.below, self.above


HYSTERESIS_OF_SWINGS = 0.3  # [of half the swing]
"""Hysteresis in counting swings. With less, noise counts as hunting; with more, lopsided cycles are missed."""

TRANSIENT_SWING_SHARE = 0.2
"""Largest difference in size from the later cycles. Cycles that differ more at the beginning are a transient."""


def swings_of(log: Log) -> HuntingLog:
    """Return the swings in a log, from the last change of its reference on.

    A cycle lasts from one upward crossing of the middle of the swing to the next, with a hysteresis against noise.
    Cycles before the first one that is about as large as the later ones are a transient, and left out.
    Raises InputError for a log without a position in SI units, or with less than two cycles.
    """
    part = log.longest
    position = channel(log, "position")[part]
    time, deviation = log.time[part], position
    if "reference" in log:
        reference = channel(log, "reference")[part]
        changes = np.flatnonzero(np.abs(np.diff(reference)) > np.finfo(np.float32).eps * np.ptp(reference))
        start = int(changes[-1]) + 1 if changes.size else 0
        time, deviation = time[start:], (position - reference)[start:]
    low, high = np.percentile(deviation[len(deviation) // 2 :], [1, 99])  # the later part, after the transient
    middle = (low + high) / 2
    if "reference" not in log:
        deviation, middle = deviation - middle, 0.0
    side = _sides(deviation - middle, HYSTERESIS_OF_SWINGS * (high - low) / 2)
    ups = np.flatnonzero((side[1:] > 0) & (side[:-1] < 0)) + 1
    if len(ups) < 3:
        actual = f"{max(len(ups) - 1, 0)} whole cycles after the reference stands"
        raise InputError(f"{log.name}, position", actual, "two cycles of hunting or more", "a longer log")
    cycles = [slice(first, last) for first, last in pairwise(ups.tolist())]
    above, below = (np.array([way * (way * deviation[one]).max() for one in cycles]) for way in (1, -1))
    sizes = (above - below) / 2
    settled = np.abs(sizes / np.median(sizes[len(sizes) // 2 :]) - 1) < TRANSIENT_SWING_SHARE
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


class HuntingKind(ExperimentKind[HuntingLog]):
    """Hunting in a log, compared with the predicted cycle."""

    title = "Hunting"
    roles = ("position",)
    longest = True

    def analyse_log(self, log: Log, prior: Prior, settings: AnalysisSettings) -> HuntingLog:
        """Analyse a log of hunting, and predict the cycle of the stage, if a stage file is given."""
        shown = swings_of(log)
        if prior.stage is None or not prior.from_user:
            return shown
        cycle = next(iter(hunting(prior.stage).attracting), None)
        if cycle is None:
            warning = "The stage file does not hunt, whatever the move: its friction or its controller is another."
            return replace(shown, warnings=(warning,))
        return replace(shown, predicted=PredictedCycle(cycle.amplitude, cycle.period, cycle.middle))

    def facts(self, result: HuntingLog) -> Facts:
        """List count, period, amplitude and symmetry of the cycles, and the predicted cycle."""
        period = f"{result.period:.3g} s (standard deviation {result.period_deviation:.2g} s)"
        scatter = with_unit(result.amplitude_deviation, "m")
        amplitude = f"{swing_with_unit(result.amplitude, result.middle, 'm')} (standard deviation {scatter})"
        sides = f"{with_unit(result.above, 'm')} above the reference, {with_unit(result.below, 'm')} below"
        facts = [
            ("Whole cycles", str(result.count)),
            ("Period", period),
            ("Amplitude", amplitude),
            ("Peaks", sides),
        ]
        if cycle := result.predicted:
            slower, larger = result.period / cycle.period, result.amplitude / cycle.amplitude
            predicted = swing_with_unit(cycle.amplitude, cycle.middle, "m")
            facts.append(("Predicted cycle", f"{predicted} every {cycle.period:.3g} s"))
            facts.append(
                ("Measured over predicted", f"{slower:.3g} times the period, {larger:.3g} times the amplitude")
            )
        return tuple(facts)

    def headline(self, result: HuntingLog) -> str:
        """Say with which amplitude and period the stage hunts, and how many cycles were seen."""
        size = swing_with_unit(result.amplitude, result.middle, "m")
        return f"It hunts: {size} every {result.period:.3g} s, {result.count} cycles."

    def numbers(self, result: HuntingLog) -> dict[str, Any]:
        """Return the cycles and the predicted one, for the document."""
        numbers = entries(result, "period_s", "period_deviation_s", "amplitude_m", "amplitude_deviation_m", "warnings")
        predicted = result.predicted and {
            **entries(result.predicted, "amplitude_m", "period_s"),
            "offset_m": result.predicted.middle,
        }
        sides = {**entries(result, "above_m", "below_m", "extremes_m"), "offset_m": result.middle}
        return {**numbers, **sides, "cycles": result.count, "predicted": predicted}

    def figures(self, result: HuntingLog, logs: Sequence[Source], name: str) -> list[Figure]:
        """Draw the deviation over time with the peaks of the cycles, and the predicted amplitude."""
        limits = ()
        if result.predicted:
            size, middle = result.predicted.amplitude, result.predicted.middle
            limits = (Limit((middle - size, middle + size), "predicted extremes", VERMILLION, "dashed"),)
        panel = Panel(
            "",
            TIME,
            Axis("Position minus reference", "m"),
            (Series(result.time, result.deviation, "as logged", INK, width=1.0),),
            (Markers(result.time[result.peaks], result.deviation[result.peaks], "peaks", VERMILLION),),
            limits,
        )
        return [Figure(f"{name}_record", "Hunting", "From the last change of the reference on.", (panel,))]


KIND = HuntingKind()
