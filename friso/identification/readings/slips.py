"""Find the starts of slips of a sticking body, where its speed stands out of the noise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from friso.identification.logs.checks import runs
from friso.identification.readings.common import rate, robust
from friso.identification.readings.settings import settings


class Slip(NamedTuple):
    """Start of a slip of a sticking body, by sample numbers.

    `onset` is that of visible motion (above the noise and a hundredth of the highest speed), `start` that of the slip
    (above the threshold). `rest` is the beginning of the rest before, and `fastest` the fastest sample. The `direction`
    is +1 or -1.
    """

    onset: int
    start: int
    rest: int
    fastest: int
    direction: int


@dataclass(frozen=True)
class Slips:
    """Starts of slips of a sticking body.

    `speed` [m/s], shape (samples,), is the body's, with the `threshold` [m/s] of slips and the fraction of time above
    it.
    """

    starts: tuple[Slip, ...]
    speed: np.ndarray
    threshold: float
    share: float


def slips(position: np.ndarray, sample_time: float, cutoff: float) -> Slips:
    """Find the slips in a position [m], shape (n,), differentiated below `cutoff` [Hz].

    A slip counts only after a rest of some length.
    """
    speed = rate(position, sample_time, cutoff)
    size = np.abs(speed)
    slow = speed[size <= np.percentile(size, 50)]
    noise = robust(slow) * 2  # of normal scatter, the slower half spreads by about half the standard deviation
    clear = settings.deviations_of_a_slip * noise
    threshold = max(clear, settings.speed_share_of_a_slip * float(size.max(initial=0.0)))
    above = size > threshold
    least = max(int(settings.time_before_a_slip / sample_time), settings.samples_before_a_slip)
    edge = int(1 / (cutoff * sample_time))
    starts: list[Slip] = []
    rested = 0
    for run in runs(above):
        if run.start - rested >= least and run.start > edge and threshold > 0:
            top = run.start + int(np.argmax(size[run]))
            level = min(max(clear, settings.speed_share_of_an_onset * float(size[top])), threshold)
            quiet = np.flatnonzero(size[rested : run.start] <= level)
            onset = rested + int(quiet[-1]) if len(quiet) else rested
            if onset - rested >= settings.samples_before_a_slip:
                starts.append(Slip(onset, run.start - 1, rested, top, int(np.sign(speed[top]))))
        rested = run.stop
    return Slips(tuple(starts), speed, threshold, float(above.mean()) if len(above) else 0.0)
