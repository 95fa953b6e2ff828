"""Inject a multisine into the closed loop at standstill, and estimate plant and open loop."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from friso.identification.response.estimators import multisine
from friso.identification.response.records import ResponseRecord, from_log
from friso.identification.response.response import Channels, FrequencyResponse
from friso.stage import Stage
from friso.studies.rig.outcome import RigLog, stopped
from friso.studies.rig.sizes import friction, interval, pace
from friso.virtual_rig.run import RecordedRuns, as_built_keys, run
from friso.virtual_rig.task import standing

PERIOD, PERIODS = 8.0, 8
"""Period of the multisine in periods of the crossover, and number of periods.

The period is the inverse of the multisine's lowest frequency (1 Hz on the thesis's rig).
"""

FINEST = 0.4
"""Highest frequency of the multisine over the sampling rate of the log."""

PHASES = int.from_bytes(b"sines")
"""Second half of the random generator's key for the phases of the multisine."""


@dataclass(frozen=True)
class Excitation:
    """Sizes of a multisine, the sum of sines with which a frequency response is measured.

    `strength` is the RMS of the injected force over static friction, and `top` the highest frequency over the
    crossover. `lines` is the approximate number of frequencies, spaced evenly in the logarithm. `samples` are those of
    the log per period of the crossover.
    """

    strength: float
    top: float
    lines: int
    samples: float


SLIDING = Excitation(2.0, 100.0, 150, 625.0)
"""Excitation that moves the cart, up to 800 Hz on the thesis's rig, logged every 0.2 ms; the thesis states no strength.
"""


def excite(
    stage: Stage,
    place: float,
    seed: int,
    runs: int = 1,
    changes: Mapping[str, Any] | None = None,
    kind: Excitation = SLIDING,
) -> RecordedRuns:
    """Run the stage at a standstill at a place [m], and inject a multisine as a force.

    `seed` draws the phases of the multisine and the noise, and `kind` has the sizes of the multisine. `changes` of keys
    are arrays of shape (runs,). Returns the recorded runs, which share the seed.
    """
    step, slow = as_built_keys(stage)["drive.sample_time"], interval(stage, 1 / (kind.samples * pace(stage)))
    period = round(PERIOD / pace(stage) / slow) * slow
    lines = np.geomspace(1, min(kind.top * PERIOD, FINEST * period / slow), kind.lines)
    force = kind.strength * friction(stage) * sines(round(period / step), np.unique(np.rint(lines).astype(int)), seed)
    task = replace(standing(place, PERIODS * period), injected=np.tile(force, PERIODS), injected_each=step)
    (recorded,) = run(stage, task, [seed] * runs, slow, changes)
    return recorded


def sines(count: int, lines: np.ndarray, seed: int) -> np.ndarray:
    """Return one period of a sum of sines with equal amplitudes, random phases and RMS 1.

    The period has `count` samples. `lines` are the sines' whole numbers of turns in it.
    """
    phases = np.random.Generator(np.random.Philox(key=[seed, PHASES])).uniform(0, 2 * np.pi, len(lines))
    spectrum = np.zeros(count // 2 + 1, complex)
    spectrum[lines] = np.exp(1j * phases)
    signal = np.fft.irfft(spectrum, count)
    return signal / signal.std()


def estimate_plant(logs: Sequence[RigLog]) -> FrequencyResponse:
    """Estimate the response from commanded force to position, averaged over several logs.

    It is estimated indirectly, by way of the injected force. Raises InputError for a log of a loop that was not stable.
    """
    for log in logs:
        if log.failure:
            raise stopped(log)
    return multisine([from_log(log.log, "force", "position", "disturbance")[0] for log in logs])


def loop(log: RigLog) -> FrequencyResponse:
    """Estimate the open loop from one log: the controller's force over the total, sign reversed."""
    injected, commanded = log.logged["disturbance"], log.logged["force"]
    record = ResponseRecord(commanded, injected - commanded, log.interval, injected)
    return multisine([record], None, Channels("error", "1", "loop", "1"))
